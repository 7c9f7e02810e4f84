//! What users install: made by `make packages`, installed into clean systems and tried there. Systems are those that
//! tests/python/setup.sh makes below `.venv/systems`; installing into them needs root, as any installing does.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::golden;
use crate::support::{command, files, folder, said};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const TRIAL: &str = "terrace init try && terrace check try/job.toml && terrace compile try/job.toml \
                     && terrace verify try/job.job";

/// The folder of the packages, made as a user makes them.
fn packages() -> &'static Path {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    MADE.get_or_init(|| {
        let mut make = Command::new("make");
        // What `cargo test` sets is for the crate under test.
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("CARGO_") && name != "CARGO_HOME") {
            make.env_remove(name);
        }
        let done = make.args(["-C", ROOT, "packages"]).output().expect("make starts");
        assert!(done.status.success(), "{}", said(&done));
        println!("{}", said(&done));
        Path::new(ROOT).join("target/packages")
    })
}

/// The package whose name ends so.
fn package(end: &str) -> PathBuf {
    let entries = std::fs::read_dir(packages()).expect("packages");
    let mut found = entries.map(|entry| entry.expect("an entry").path()).filter(|p| p.to_string_lossy().ends_with(end));
    let path = found.next().unwrap_or_else(|| panic!("there is no package {end}"));
    assert!(found.next().is_none(), "several packages end in {end}");
    path
}

fn run(command: &mut Command) -> Output {
    let done = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    assert!(done.status.success(), "{command:?}: {}", said(&done));
    done
}

/// A command that runs as root.
fn as_root(program: &str) -> Command {
    if said(&run(Command::new("id").arg("-u"))).trim() == "0" {
        return Command::new(program);
    }
    let mut command = Command::new("sudo");
    command.args(["-n", program]);
    command
}

/// A clean system, unpacked.
struct System {
    dir: PathBuf,
    _temporary: tempfile::TempDir,
}

impl System {
    fn new(name: &str) -> Self {
        let temporary = folder();
        let dir = temporary.path().join("root");
        std::fs::create_dir(&dir).expect("a writable folder");
        let image = Path::new(ROOT).join(".venv/systems").join(name);
        run(as_root("tar").arg("-C").arg(&dir).arg("-xf").arg(image));
        Self { dir, _temporary: temporary }
    }

    /// Puts a file into the system, at its top.
    fn put(&self, file: &Path) -> String {
        run(as_root("cp").arg(file).arg(&self.dir));
        format!("/{}", file.file_name().expect("a file").to_string_lossy())
    }

    /// Runs a script in the system, which sees its own processes alone, and no network.
    fn sh(&self, script: &str) -> String {
        let inner = r#"mount -t proc proc "$0/proc" && exec chroot "$0" sh -ec "$1""#;
        let mut command = as_root("unshare");
        command.args(["--mount", "--pid", "--fork", "--net", "sh", "-ec", inner]).arg(&self.dir).arg(script);
        command
            .env_clear()
            .envs([("PATH", "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"), ("HOME", "/root")]);
        said(&run(&mut command))
    }
}

impl Drop for System {
    fn drop(&mut self) {
        let _ = as_root("rm").arg("-rf").arg(&self.dir).status();
    }
}

/// Unpacks the archive whose name ends so; the folder that it holds.
fn unpacked(end: &str, dir: &Path) -> PathBuf {
    let archive = package(end);
    let unpack = "import shutil, sys; shutil.unpack_archive(*sys.argv[1:])";
    run(Command::new("python3").args(["-c", unpack]).arg(&archive).arg(dir));
    let name = archive.file_name().expect("a name").to_string_lossy().into_owned();
    let folder = dir.join(name.trim_end_matches(".zip").trim_end_matches(".tar.gz"));
    assert!(folder.is_dir(), "{name} holds no folder of its name");
    folder
}

/// The files of the sample job as the terrace under test makes them.
fn sample() -> Vec<(String, Vec<u8>)> {
    let dir = folder();
    run(command().current_dir(&dir).args(["init", "try"]));
    run(command().current_dir(&dir).args(["compile", "try/job.toml"]));
    files(&dir.path().join("try/job.job"))
}

#[test]
#[ignore = "slow: make test-all"]
fn debian_package_works_in_an_empty_debian_within_a_minute() {
    let system = System::new("debian.tar");
    let deb = system.put(&package("_amd64.deb"));
    let begin = Instant::now();
    system.sh(&format!("dpkg -i {deb} && cd /root && {TRIAL}"));
    assert!(begin.elapsed() < Duration::from_secs(60), "it took {:?}", begin.elapsed());
    assert_eq!(files(&system.dir.join("root/try/job.job")), sample());
    let listed = system.sh("dpkg -L terrace");
    for file in [
        "/usr/share/man/man1/terrace-compile.1.gz",
        "/usr/share/bash-completion/completions/terrace",
        "/usr/share/zsh/vendor-completions/_terrace",
        "/usr/share/fish/vendor_completions.d/terrace.fish",
        "/usr/share/doc/terrace/copyright",
        "/usr/share/doc/terrace/THIRD-PARTY.txt",
        "/usr/share/doc/terrace/docs/how-to/operating.md",
    ] {
        assert!(listed.lines().any(|line| line == file), "{file} is not in {listed}");
        assert!(system.dir.join(&file[1..]).metadata().expect("it is there").len() > 500, "{file}");
    }
    let left = system.sh("dpkg -r terrace; ls /usr/share/doc | grep terrace || true; command -v terrace || true");
    assert!(!left.contains("/usr/bin/terrace"), "{left}");
    // The other processor's package is the same but for the binary.
    let names = |deb: &Path| -> Vec<String> {
        let listed = said(&run(Command::new("dpkg-deb").arg("--contents").arg(deb)));
        listed.lines().map(|line| line.split_whitespace().last().unwrap_or("").to_owned()).collect()
    };
    assert_eq!(names(&package("_amd64.deb")), names(&package("_arm64.deb")));
    let fields = said(&run(Command::new("dpkg-deb").arg("--info").arg(package("_arm64.deb"))));
    assert!(fields.contains("Architecture: arm64"), "{fields}");
}

#[test]
#[ignore = "slow: make test-all"]
fn wheel_brings_the_program_and_readers_into_a_clean_python() {
    let system = System::new("debian-python.tar");
    let wheel = system.put(&package(".whl"));
    let wheels = Path::new(ROOT).join(".venv/systems/wheels");
    run(as_root("cp").arg("-r").arg(wheels).arg(&system.dir));
    let tests = system.put(&Path::new(ROOT).join("crates/packages/python/tests/test_readers.py"));
    let begin = Instant::now();
    system.sh(&format!(
        "cd /root && python3 -m venv venv && . venv/bin/activate \
         && pip install --no-index --find-links /wheels {wheel} && {TRIAL}"
    ));
    assert!(begin.elapsed() < Duration::from_secs(60), "it took {:?}", begin.elapsed());
    assert_eq!(files(&system.dir.join("root/try/job.job")), sample());
    let read = system.sh(&format!(
        "cd /root && . venv/bin/activate \
         && sed -i 's/^formats = .*/formats = [\"csv\"]/' try/job.toml && terrace compile try/job.toml \
         && terrace compile try/job.toml --mode on-the-fly -o try/fly.job \
         && python {tests} try/job.job try/fly.job && terrace --version && terrace-laser --version || true"
    ));
    assert!(read.contains("OK\n"), "{read}");
}

#[test]
#[ignore = "slow: make test-all"]
fn static_binaries_work_without_any_system_and_make_the_golden_bytes() {
    let dir = folder();
    for (target, emulator) in [("x86_64", None), ("aarch64", Some("qemu-aarch64-static"))] {
        let unpacked = unpacked(&format!("{target}-unknown-linux-musl.tar.gz"), dir.path());
        for file in ["LICENSE", "THIRD-PARTY.txt", "rust-standard-library.html", "README.md", "man/terrace.1"] {
            assert!(unpacked.join(file).is_file(), "{target}: {file}");
        }
        let linked = said(&run(Command::new("file").arg(unpacked.join("terrace"))));
        assert!(linked.contains("static"), "{linked}");
        golden_bytes(target, &|| match emulator {
            None => Command::new(unpacked.join("terrace")),
            Some(emulator) => {
                let mut command = Command::new(emulator);
                command.arg(unpacked.join("terrace"));
                command
            }
        });
    }
}

/// Compiles the golden jobs by a command: all their files are those of the terrace under test.
fn golden_bytes(of: &str, terrace: &dyn Fn() -> Command) {
    let dir = folder();
    for (name, job, mode) in golden::jobs(dir.path()) {
        let job = job.write(dir.path(), &format!("{name}.toml"));
        let [here, there] = ["here", "there"].map(|set| dir.path().join(set).join(format!("{name}.job")));
        golden::compile(command(), &job, mode, &here);
        golden::compile(terrace(), &job, mode, &there);
        let (here, there) = (files(&here), files(&there));
        let differ: Vec<_> = here.iter().filter(|file| !there.contains(file)).map(|(file, _)| file).collect();
        assert!(differ.is_empty() && here.len() == there.len(), "{of}: {name}: {differ:?}");
    }
}

/// Windows, as Wine runs it, with the program unpacked.
struct Windows {
    /// Where it works, on drive Z of Windows.
    dir: tempfile::TempDir,
    program: PathBuf,
}

impl Windows {
    fn new() -> Self {
        let dir = folder();
        let unpacked = unpacked("x86_64-pc-windows-gnu.zip", dir.path());
        run(Command::new("x86_64-w64-mingw32-gcc")
            .arg("-shared")
            .arg("-o")
            .arg(unpacked.join("bcryptprimitives.dll"))
            .arg(Path::new(ROOT).join("tests/data/bcryptprimitives.c"))
            .arg("-ladvapi32"));
        let windows = Self { program: unpacked.join("terrace.exe"), dir };
        run(windows.terrace().arg("--version"));
        windows
    }

    fn terrace(&self) -> Command {
        let mut command = self.command("/usr/lib/wine/wine64");
        command.arg(&self.program);
        command
    }

    /// A command that runs where Windows is.
    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.current_dir(self.dir.path());
        command.env("WINEPREFIX", self.dir.path().join("prefix")).env("WINEDEBUG", "-all").env("DISPLAY", "");
        // Wine leaves files there.
        command.env("TMPDIR", self.dir.path());
        command
    }

    /// What lies where it works and begins with a dot.
    fn hidden(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.dir).expect("the folder");
        let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
        names.filter(|name| name.starts_with('.')).collect()
    }

    /// terrace with these arguments in a console of Windows, on a terminal of its own.
    fn in_console(&self, args: &str) -> Child {
        let line = format!("/usr/lib/wine/wine64 '{}' {args}", self.program.display());
        let mut script = self.command("script");
        script.args(["--quiet", "--return", "--command", &line, "/dev/null"]);
        script.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("script starts")
    }

    /// What a command says; panics with it where the exit code is another.
    fn says(&self, code: i32, args: &[&str]) -> String {
        let out = self.terrace().args(args).output().expect("Wine starts");
        assert_eq!(out.status.code(), Some(code), "{args:?}: {}", said(&out));
        said(&out).replace("\r\n", "\n")
    }
}

impl Drop for Windows {
    fn drop(&mut self) {
        drop(self.command("/usr/lib/wine/wineserver64").arg("-k").status());
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn windows_program_makes_the_golden_bytes_under_wine() {
    let windows = Windows::new();
    golden_bytes("Windows", &|| windows.terrace());
}

#[test]
#[ignore = "slow: make test-all"]
fn windows_program_works_under_wine_with_paths_as_they_are_there() {
    let windows = Windows::new();
    let at = |path: &str| windows.dir.path().join(path);
    let begin = Instant::now();
    for args in
        [&["init", "try"][..], &["check", r"try\job.toml"], &["compile", r"try\job.toml"], &["verify", r"try\job.job"]]
    {
        windows.says(0, args);
    }
    assert!(begin.elapsed() < Duration::from_secs(60), "it took {:?}", begin.elapsed());
    assert_eq!(files(&at("try/job.job")), sample());
    // What one system wrote the other verifies.
    run(command().arg("verify").arg(at("try/job.job")));

    // Names with spaces and letters beyond ASCII, folders that are not there yet, drives, links of `..`.
    std::fs::create_dir_all(at("Müller Söhne/Teil ä")).expect("writable");
    for file in ["job.toml", "sample.stl", "sample.svg"] {
        std::fs::copy(at("try").join(file), at("Müller Söhne/Teil ä").join(file)).expect("the sample");
    }
    windows.says(0, &["compile", r"Müller Söhne\Teil ä\job.toml", "-o", r"C:\out one\deep\a.job"]);
    windows.says(0, &["verify", r"C:\out one\..\out one\deep\a.job"]);
    let long = format!(r"out\{}.job", "l".repeat(200));
    windows.says(0, &["compile", r"try\job.toml", "-o", &long]);
    windows.says(0, &["verify", &long]);

    // Names of devices, patterns, a backslash in a job file, a folder of someone else.
    assert!(windows.says(2, &["compile", r"try\job.toml", "-o", "con"]).contains("are devices"));
    std::fs::create_dir(at("bj")).expect("writable");
    for name in ["a.toml", "b.toml"] {
        let text =
            std::fs::read_to_string(at("try/job.toml")).expect("the sample").replace("\"sample.", "\"../try/sample.");
        std::fs::write(at("bj").join(name), text).expect("writable");
    }
    assert!(windows.says(0, &["batch", r"bj\*.toml", "-o", "out"]).contains("2 compiled"));
    assert!(windows.says(0, &["batch", "bj", "-o", "out"]).contains("2 unchanged"));
    let text = std::fs::read_to_string(at("bj/a.toml")).expect("the job").replace("../try/", r"..\\try\\");
    std::fs::write(at("bj/c.toml"), text).expect("writable");
    assert!(windows.says(2, &["check", r"bj\c.toml"]).contains("path-backslash"));
    let refused = windows.says(2, &["compile", r"try\job.toml", "-o", "bj"]);
    assert!(refused.contains("output-not-a-job") && !refused.contains(r"\\?\"), "{refused}");

    // A plan that was made there is worked on here.
    std::fs::remove_file(at("bj/c.toml")).expect("it is there");
    windows.says(0, &["batch", "bj", "-o", "planned", "--plan", "units.jsonl"]);
    run(command().current_dir(&windows.dir).args(["batch", "--units", "units.jsonl", "--unit", "1/1"]));
    assert_eq!(files(&at("planned/a.job")).len(), files(&at("out/a.job")).len());
}

#[test]
#[ignore = "slow: make test-all"]
fn windows_program_writes_to_a_console_and_ctrl_c_leaves_nothing_half_written() {
    let windows = Windows::new();
    let shown = windows.in_console(r"check 'Müller\Teil ä.toml'").wait_with_output().expect("it ends");
    assert_eq!(shown.status.code(), Some(2));
    let shown = String::from_utf8(shown.stdout).expect("UTF-8");
    // Red, and letters beyond ASCII as they are.
    assert!(shown.contains("\u{1b}[91merror[file-unreadable]") && shown.contains("Müller"), "{shown}");

    let job = format!(r"Z:{}/fixtures/hood.toml", ROOT);
    let mut console = windows.in_console(&format!("compile '{job}' -o hood.job"));
    let mut output = console.stdout.take().expect("piped");
    let (mut shown, mut some) = (Vec::new(), [0; 4096]);
    while let count @ 1.. = output.read(&mut some).expect("readable") {
        shown.extend_from_slice(&some[..count]);
        if shown.windows(6).any(|text| text == b"step 4") {
            break;
        }
    }
    console.stdin.as_mut().expect("piped").write_all(b"\x03").expect("a key");
    output.read_to_end(&mut shown).expect("readable");
    console.wait().expect("it ends");
    let folder = windows.dir.path().join("hood.job");
    assert!(!folder.exists(), "{}", String::from_utf8_lossy(&shown));
    windows.says(0, &["compile", &job, "-o", "hood.job"]);
    assert_eq!(windows.hidden(), Vec::<String>::new());
}

#[test]
#[ignore = "slow: make test-all"]
fn six_programs_of_windows_at_one_output_leave_it_whole() {
    let windows = Windows::new();
    windows.says(0, &["init", "try"]);
    let started: Vec<_> = (0..6)
        .map(|_| windows.terrace().args(["compile", r"try\job.toml", "-o", "one.job"]).spawn().expect("Wine starts"))
        .collect();
    for mut child in started {
        assert!(child.wait().expect("it ends").success());
    }
    assert_eq!(files(&windows.dir.path().join("one.job")).len(), sample().len());
    windows.says(0, &["verify", "one.job"]);
    assert_eq!(windows.hidden(), Vec::<String>::new());
}

#[test]
#[ignore = "slow: make test-all"]
fn sums_and_the_list_of_parts_are_those_of_the_packages() {
    run(Command::new("sha256sum").args(["--check", "--strict", "SHA256SUMS"]).current_dir(packages()));
    let sums = std::fs::read_to_string(packages().join("SHA256SUMS")).expect("sums");
    let count = std::fs::read_dir(packages()).expect("packages").count();
    assert_eq!(sums.lines().count() + 1, count, "{sums}");
    let text = std::fs::read(package(".cdx.json")).expect("the list of parts");
    let parts: serde_json::Value = serde_json::from_slice(&text).expect("JSON");
    assert_eq!(parts["bomFormat"], "CycloneDX");
    let names: Vec<&str> =
        parts["components"].as_array().expect("components").iter().filter_map(|part| part["name"].as_str()).collect();
    for name in ["nalgebra", "spade", "geo", "clap", "terrace-verify"] {
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
    // No path of the computer that built them.
    let dir = folder();
    let program =
        std::fs::read(unpacked("x86_64-unknown-linux-musl.tar.gz", dir.path()).join("terrace")).expect("the binary");
    let home = std::env::var("HOME").unwrap_or_default();
    for path in [ROOT, &format!("{home}/.cargo")] {
        assert!(!program.windows(path.len()).any(|bytes| bytes == path.as_bytes()), "{path} is in the binary");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn types_of_the_readers_and_of_what_builds_packages_hold() {
    let python = Path::new(ROOT).join("crates/packages");
    let mypy = Path::new(ROOT).join(".venv/bin/mypy");
    for (folder, what) in [(python.join("python"), ["terrace_laser", "tests"]), (python, ["make.py", "notices.py"])] {
        run(Command::new(&mypy).arg("--strict").args(what).current_dir(folder));
    }
}
