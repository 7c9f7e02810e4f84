//! Which Python runs the parts of this program that are Python, and how what they need is installed.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use crate::diag::shell_word;

/// The Python programs that may have a package, in the order in which they are tried: the one that `TERRACE_PYTHON`
/// names alone, else that of the program's own environment and those on the path.
pub fn interpreters() -> Vec<OsString> {
    if let Some(named) = std::env::var_os("TERRACE_PYTHON").filter(|named| !named.is_empty()) {
        return vec![named];
    }
    let own = environment().map(|folder| folder.join(if cfg!(windows) { r"Scripts\python.exe" } else { "bin/python" }));
    let own = own.filter(|python| python.exists()).map(PathBuf::into_os_string);
    own.into_iter().chain(["python3", "python"].map(OsString::from)).collect()
}

/// A Python package that a part of this program needs.
#[derive(Clone, Copy, Debug)]
pub struct Package {
    /// Name and version as pip takes them, such as `name==1.2`.
    pub pinned: &'static str,
    /// A module that it holds.
    pub module: &'static str,
}

/// Where a package is installed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Installed {
    /// The Python that has it.
    pub interpreter: String,
    /// Its version; empty where it is not known.
    pub version: String,
}

/// Prints the version of a package, whose module can be loaded.
const VERSION: &str = "import importlib, importlib.metadata as m, sys
importlib.import_module(sys.argv[2])
try: print(m.version(sys.argv[1]))
except m.PackageNotFoundError: print()";

impl Package {
    /// The first of the [`interpreters`] that can load it; else what each answered. Starts them.
    ///
    /// # Errors
    /// Why none of them can.
    pub fn installed(&self) -> Result<Installed, Vec<String>> {
        let name = self.pinned.split("==").next().unwrap_or_default();
        let mut answers = Vec::new();
        for interpreter in interpreters() {
            let shown = interpreter.to_string_lossy().into_owned();
            match Command::new(&interpreter)
                .args(["-I", "-c", VERSION, name, self.module])
                .stdin(Stdio::null())
                .output()
            {
                Ok(out) if out.status.success() => {
                    let version = String::from_utf8_lossy(&out.stdout).trim().to_owned();
                    return Ok(Installed { interpreter: shown, version });
                }
                Ok(out) => {
                    let said = String::from_utf8_lossy(&out.stderr);
                    let last = said.lines().last().unwrap_or("it failed without a word").trim();
                    answers.push(format!("{shown}: {last}"));
                }
                Err(e) => answers.push(format!("{shown}: {e}")),
            }
        }
        Err(answers)
    }

    /// The line that installs it.
    pub fn install_line(&self) -> String {
        install_line(self.pinned)
    }
}

/// The folder of the virtual environment that the install line makes.
fn environment() -> Option<PathBuf> {
    let named = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let around = if cfg!(windows) {
        named("LOCALAPPDATA")
    } else {
        named("XDG_DATA_HOME").or_else(|| Some(named("HOME")?.join(".local").join("share")))
    };
    Some(around?.join("terrace").join("python"))
}

/// The line that installs a package.
fn install_line(package: &str) -> String {
    let folder = environment().unwrap_or_else(|| PathBuf::from("terrace-python"));
    if cfg!(windows) {
        // Both of its shells run this.
        let [folder, pip] =
            [folder.clone(), folder.join(r"Scripts\pip")].map(|path| shell_word(&path.display().to_string()));
        return format!("cmd /c \"py -m venv {folder} && {pip} install {package}\"");
    }
    let [folder, pip] = [folder.clone(), folder.join("bin/pip")].map(|path| shell_word(&path.display().to_string()));
    format!("python3 -m venv {folder} && {pip} install {package}")
}
