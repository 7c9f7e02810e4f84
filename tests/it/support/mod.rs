//! What the integration tests share: running the program, job files, made surfaces.

#![allow(dead_code, reason = "every test binary uses a part of it")]

pub mod card;
pub mod chromium;
pub mod fleet;
pub mod image;
pub mod lightburn;
pub mod linuxcncrsh;
pub mod malformed;
pub mod nurbs;
pub mod processor;
pub mod seen;
pub mod slurm;
pub mod surfaces;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use terrace_input::texture::{FillMode, Kind, Marking, Position, Size, StrokeMode};

use serde_json::Value;
use tempfile::TempDir;
use terrace_input::job::{Job, Overrides};
use terrace_plan::plan::{self, Plan, SteppedPlan};

/// A new empty folder that goes when it is dropped.
pub fn folder() -> TempDir {
    tempfile::tempdir().expect("a writable temporary folder")
}

/// The data that is shared next to the repository. Only ignored tests need it, and fail where it is absent.
pub fn shared() -> PathBuf {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    assert!(path.is_dir(), "{} is absent", path.display());
    path.to_owned()
}

/// The seeds of a long run: `SEEDS=1000..1100` in the environment chooses others.
pub fn seeds(usual: std::ops::Range<u64>) -> std::ops::Range<u64> {
    let Ok(chosen) = std::env::var("SEEDS") else { return usual };
    let ends = chosen.split_once("..").map(|(a, b)| [a, b].map(|v| v.parse::<u64>()));
    let Some([Ok(from), Ok(to)]) = ends else { panic!("SEEDS is to be like 1000..1100") };
    from..to
}

/// A file of `fixtures`.
pub fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

/// Every line and every contour of a drawing, without hatch; what cannot be reproduced is left out.
pub fn outlines() -> Box<Marking> {
    Box::new(Marking { stroke: StrokeMode::Centre, fill: FillMode::Outline, is_lenient: true, ..Marking::default() })
}

/// A drawing by its lines and contours, placed once.
pub fn outlined(path: &Path, size_mm: Option<[f64; 2]>) -> Kind {
    Kind::Drawing {
        path: path.to_owned(),
        size: size_mm.map_or(Size::File, Size::Mm),
        unit_mm: None,
        position: Position::Usual,
        turn_rad: 0.0,
        tile: false,
        marking: outlines(),
    }
}

/// The program, without arguments.
pub fn command() -> Command {
    Command::new(env!("CARGO_BIN_EXE_terrace"))
}

/// Runs the program, which leaves its output to the system: what is flushed when is for `cli` and `batch` to test.
pub fn terrace<I: AsRef<std::ffi::OsStr>>(args: impl IntoIterator<Item = I>) -> Output {
    command().args(args).arg("--no-sync").output().expect("the program starts")
}

/// stderr and stdout as text, for messages.
pub fn said(out: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&out.stderr), String::from_utf8_lossy(&out.stdout))
}

/// The keys of a job file; the rest has defaults.
pub struct JobText {
    pub surface: String,
    pub textures: Vec<String>,
    pub focus: String,
    pub method: &'static str,
    pub partition: String,
    pub machine: String,
    pub more: String,
}

impl JobText {
    /// A job on the surface file at `path`, in mm.
    pub fn on(path: &Path) -> Self {
        Self {
            surface: format!("file = {:?}\nunit = \"mm\"", path.display().to_string()),
            textures: Vec::new(),
            focus: "pdof = \"0.07 mm\"".into(),
            method: "contour",
            partition: String::new(),
            machine: "profile = \"xyz-galvo-40\"".into(),
            more: String::new(),
        }
    }

    /// The same with one more texture; `keys` are lines of the `[[texture]]` table.
    pub fn texture(mut self, keys: &str) -> Self {
        self.textures.push(keys.into());
        self
    }

    /// The same with another method.
    pub fn method(mut self, method: &'static str) -> Self {
        self.method = method;
        self
    }

    /// The same with more keys of `[partition]`.
    pub fn partition(mut self, keys: &str) -> Self {
        self.partition = keys.into();
        self
    }

    /// Writes the job file into `dir`.
    pub fn write(&self, dir: &Path, name: &str) -> PathBuf {
        let textures: String = self.textures.iter().map(|t| format!("[[texture]]\n{t}\n\n")).collect();
        let text = format!(
            "[surface]\n{}\n\n{textures}[focus]\n{}\n\n[partition]\nmethod = \"{}\"\n{}\n\n[machine]\n{}\n\n\
             [[pen]]\nname = \"fill\"\nspeed = \"1000 mm/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"\n\n{}",
            self.surface, self.focus, self.method, self.partition, self.machine, self.more
        );
        let path = dir.join(name);
        std::fs::write(&path, text).expect("a writable folder");
        path
    }
}

/// Compiles a job and answers with the summary; panics with what the program said where it fails.
pub fn compile(job: &Path, folder: &Path) -> Value {
    // The folder goes with the test: nothing is won by waiting for the disk.
    let args = [Path::new("compile"), job, Path::new("-o"), folder, Path::new("--json")];
    let out = terrace(args);
    assert!(out.status.success(), "{}: {}", job.display(), said(&out));
    serde_json::from_slice(&out.stdout).expect("compile --json prints one JSON object")
}

/// Plans and checks a job without writing anything, and answers with the summary that `compile` would give.
pub fn summary_of(job: &Path) -> Value {
    let out = terrace([Path::new("check"), job, Path::new("--json")]);
    assert!(out.status.success(), "{}: {}", job.display(), said(&out));
    serde_json::from_slice(&out.stdout).expect("check --json prints one JSON object")
}

/// The manifest of a job folder.
pub fn manifest(folder: &Path) -> Value {
    let bytes = std::fs::read(folder.join("manifest.json")).expect("a manifest");
    serde_json::from_slice(&bytes).expect("JSON")
}

/// The text of a built-in machine's file.
pub fn machine_file(profile: &str) -> String {
    let out = terrace(["machines", profile]);
    assert!(out.status.success(), "{}", said(&out));
    String::from_utf8(out.stdout).expect("text")
}

/// `[emit]` with one file of the programs instead of a drawing per block.
pub const ONE_FILE: &str = "[emit]\nformats = [\"linuxcnc\"]\n";

/// Plans a stepped job in this process; panics with the errors where that fails.
pub fn planned(job: &Path) -> Box<SteppedPlan> {
    planning(job).unwrap_or_else(|e| panic!("{}: {e}", job.display()))
}

/// Plans a stepped job in this process.
pub fn planning(job: &Path) -> Result<Box<SteppedPlan>, terrace_core::diag::Error> {
    match Job::load(job, &Overrides::default()).and_then(|job| plan::plan(job, &|_, _| {}))? {
        Plan::Stepped(plan) => Ok(plan),
        Plan::OnTheFly(_) => panic!("{} is an on-the-fly job", job.display()),
    }
}

/// Verifies a job folder and answers with the proof; panics where anything is found.
pub fn verify(folder: &Path) -> Value {
    let out = terrace([Path::new("verify"), folder, Path::new("--json")]);
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(out.status.success(), "{}: {}", folder.display(), said(&out));
    let proof: Value = serde_json::from_str(&text).expect("verify --json prints one JSON object");
    assert_eq!(proof["ok"], true, "{text}");
    proof
}

/// A number of a JSON object.
pub fn number(v: &Value, key: &str) -> f64 {
    v[key].as_f64().unwrap_or_else(|| panic!("{key} is a number in {v}"))
}

/// The balance of lengths, mark - overlap + skipped = texture, to 1e-9, in summary and proof.
pub fn assert_balance(summary: &Value, proof: &Value) {
    for v in [summary, proof] {
        let texture = number(v, "texture_mm");
        let sum = number(v, "mark_mm") - number(v, "overlap_mm") + number(v, "skipped_mm");
        assert!((sum - texture).abs() <= 1e-9 * texture, "{sum} {texture}");
    }
    for key in ["texture_mm", "mark_mm", "skipped_mm"] {
        let (a, b) = (number(summary, key), number(proof, key));
        assert!((a - b).abs() <= 1e-9 * number(summary, "texture_mm"), "{key}: {a} as compiled, {b} as re-read");
    }
}

/// Every file below a folder with its bytes, by name.
pub fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut out = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(dir) = open.pop() {
        for entry in std::fs::read_dir(&dir).expect("a readable folder") {
            let path = entry.expect("a readable folder").path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("below the folder").display().to_string();
                out.push((name, std::fs::read(&path).expect("a readable file")));
            }
        }
    }
    out.sort();
    out
}

/// Compiles a job on one thread and on two, which must give the same bytes; answers one of the folders.
pub fn same_on_any_threads(job: &Path, dir: &Path) -> PathBuf {
    let run = |threads: &str| {
        let out = dir.join(format!("threads-{threads}.job"));
        let args = ["compile", "-j", threads, "-o"].map(Path::new);
        let done = terrace(args.into_iter().chain([out.as_path(), job]));
        assert!(done.status.success(), "{}: {}", job.display(), said(&done));
        out
    };
    let (one, two) = (run("1"), run("2"));
    let (a, b) = (files(&one), files(&two));
    assert!(!a.is_empty() && a.len() == b.len(), "{}", job.display());
    let differs = a.iter().zip(&b).find(|(a, b)| a != b);
    assert!(differs.is_none(), "{}: the number of threads changes {}", job.display(), differs.map_or("", |d| &d.0.0));
    std::fs::remove_dir_all(one).expect("a folder of ours");
    two
}
