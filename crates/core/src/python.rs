//! Which Python runs the parts of this program that are Python, and how what they need is installed.

use std::ffi::OsString;
use std::path::PathBuf;

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
pub fn install_line(package: &str) -> String {
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
