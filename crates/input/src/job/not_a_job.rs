//! What was named in place of a job file: a surface, a drawing, a folder, or another TOML file of terrace.

use std::path::{Path, PathBuf};

use crate::surface;
use terrace_core::diag::{self, Diag, Place};

/// Other files than surfaces: the extension of their names, what they are, and the key of a job that names such a file.
const OTHERS: [(&str, &str, Option<&str>); 14] = [
    ("csv", "a table of points", Some("texture.curves")),
    ("png", "a PNG image", Some("texture.file")),
    ("tif", "a TIFF image", Some("texture.file")),
    ("tiff", "a TIFF image", Some("texture.file")),
    ("bmp", "a BMP image", Some("texture.file")),
    ("jpg", "a JPEG image", Some("texture.file")),
    ("jpeg", "a JPEG image", Some("texture.file")),
    ("svg", "an SVG drawing", Some("texture.file")),
    ("svgz", "an SVG drawing", Some("texture.file")),
    ("dxf", "a DXF drawing", Some("texture.file")),
    ("plt", "an HPGL plot", Some("texture.file")),
    ("hpgl", "an HPGL plot", Some("texture.file")),
    ("hpg", "an HPGL plot", Some("texture.file")),
    ("lbrn2", "a LightBurn project", None),
];

/// What a file is called in messages by its name, and the keys of a job that may name it; None of a name that says
/// nothing.
fn kind(path: &Path) -> Option<(&'static str, Vec<&'static str>)> {
    let extension = path.extension()?.to_string_lossy().to_lowercase();
    // A job may be called job.txt.
    let surface = surface::format::of(path).filter(|_| extension != "txt");
    let other = OTHERS.iter().find(|(known, ..)| *known == extension);
    let keys = surface.map(|_| "surface.file").into_iter().chain(other.and_then(|(.., key)| *key)).collect();
    match (surface, other) {
        _ if extension == "ngc" => Some(("a stage program", Vec::new())),
        (_, Some((_, what, _))) => Some((what, keys)),
        (Some(format), None) => Some((format.name, keys)),
        (None, None) => None,
    }
}

/// Most job files that a hint names.
const SHOWN: usize = 3;

/// `not-a-job` for a folder, or a file that its name shows to be a surface or a drawing.
pub(super) fn by_name(path: &Path) -> Option<Diag> {
    let place = Place::file(path.display().to_string());
    if path.is_dir() {
        let is_job_folder = path.join("manifest.json").is_file();
        let what = if is_job_folder { "a job folder" } else { "a folder" };
        let own = is_job_folder.then(|| own_job(path)).flatten();
        let near = own.map_or_else(|| job_files(path, None), |job| vec![job]);
        let hint = mean(&near).unwrap_or_else(|| "name a job file; `terrace init FOLDER` writes one".into());
        return Some(Diag::input("not-a-job", format!("this is {what}, not a job file")).at(place).hint(hint));
    }
    let (what, keys) = kind(path)?;
    let name = path.file_name()?.to_string_lossy().into_owned();
    // What is not there is reported as such.
    let near = if path.is_file() { job_files(path.parent()?, Some(&name)) } else { return None };
    let inspect = format!("`terrace inspect {name}` says what it holds");
    let hint = match (mean(&near), &keys[..]) {
        (Some(hint), _) => hint,
        (None, []) => "name a job file (.toml)".into(),
        (None, keys) => {
            format!("name a job file (.toml), which names this file as {}; {inspect}", keys.join(" or "))
        }
    };
    Some(Diag::input("not-a-job", format!("this is {what}, not a job file")).at(place).hint(hint))
}

/// `not-a-job` for a machine file or a run file.
pub(super) fn by_keys(path: &Path, source: &str) -> Option<Diag> {
    if diag::has_keys(source, &["surface"]) || diag::has_keys(source, &["texture"]) {
        return None;
    }
    let (what, hint) = if diag::has_keys(source, &["lens", "stage"]) {
        ("a machine file", "name a job file; a job names this file as machine.file")
    } else if diag::has_keys(source, &["machine", "stage", "laser"]) {
        ("a run file", "name a job file; this file is for `terrace run FOLDER --with FILE`")
    } else {
        return None;
    };
    let place = Place::file(path.display().to_string());
    Some(Diag::input("not-a-job", format!("this is {what}, not a job file")).at(place).hint(hint))
}

/// The job file beside a job folder, by its name.
fn own_job(folder: &Path) -> Option<PathBuf> {
    let name = folder.file_name()?.to_string_lossy().into_owned();
    let stem = name.strip_suffix(".fly.job").or_else(|| name.strip_suffix(".job"))?;
    Some(folder.with_file_name(format!("{stem}.toml"))).filter(|job| job.is_file())
}

/// The first job files of a folder, those alone that name a file where one is given.
fn job_files(folder: &Path, named: Option<&str>) -> Vec<PathBuf> {
    // Folders may be huge; this is only for a hint.
    const MOST: usize = 1000;
    const LONGEST: u64 = 1 << 20;
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(folder).into_iter().flatten().take(MOST).flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|file| file.extension().is_some_and(|e| e == "toml"))
        .filter(|file| file.metadata().is_ok_and(|meta| meta.is_file() && meta.len() <= LONGEST))
        .filter(|file| {
            let text = std::fs::read_to_string(file).unwrap_or_default();
            diag::has_keys(&text, &["surface", "texture"]) && named.is_none_or(|name| text.contains(name))
        })
        .map(|file| file.strip_prefix("./").map(Path::to_owned).unwrap_or(file))
        .collect();
    files.sort();
    files
}

/// The question whether files were meant; None where there are none.
fn mean(files: &[PathBuf]) -> Option<String> {
    let names: Vec<String> = files.iter().take(SHOWN).map(|file| file.display().to_string()).collect();
    (!names.is_empty()).then(|| format!("did you mean {}?", names.join(" or ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{Job, Overrides, SAMPLE_JOB, read_file};
    use terrace_core::machine::PROFILES;

    #[test]
    fn surfaces_drawings_and_folders_are_reported_and_the_job_that_names_them_is_offered() {
        let dir = tempfile::tempdir().expect("a folder");
        let at = |name: &str| dir.path().join(name);
        let surfaces = surface::format::FORMATS.iter().flat_map(|format| format.extensions);
        let all: std::collections::BTreeSet<&str> =
            surfaces.chain(OTHERS.iter().map(|(extension, ..)| extension)).copied().collect();
        for extension in all.into_iter().filter(|extension| *extension != "txt") {
            let file = at(&format!("part.{}", extension.to_uppercase()));
            assert!(by_name(&file).is_none(), "{extension}: what is not there is no STL file");
            std::fs::write(&file, "x").expect("written");
            let d = read_file(&file).expect_err("no job file").diags()[0].clone();
            let (what, _) = kind(&file).expect("a kind of file");
            assert_eq!((d.code, d.message), ("not-a-job", format!("this is {what}, not a job file")));
            assert!(d.hint.starts_with("name a job file"), "{extension}: {}", d.hint);
        }
        std::fs::write(at("hood.toml"), SAMPLE_JOB.replace("sample.stl", "part.STL")).expect("written");
        std::fs::write(at("mill.toml"), PROFILES[0].1).expect("written");
        for path in [at("part.STL"), dir.path().to_owned()] {
            let d = by_name(&path).expect("no job file");
            assert_eq!(d.hint, format!("did you mean {}?", at("hood.toml").display()));
        }
        std::fs::create_dir(at("hood.fly.job")).expect("made");
        std::fs::write(at("hood.fly.job/manifest.json"), "{}").expect("written");
        let d = by_name(&at("hood.fly.job")).expect("no job file");
        assert_eq!(d.message, "this is a job folder, not a job file");
        assert_eq!(d.hint, format!("did you mean {}?", at("hood.toml").display()));
        assert!(by_name(&at("hood.toml")).is_none());
    }

    #[test]
    fn machine_files_and_run_files_are_reported() {
        let message = |text: &str| match Job::parse(Path::new("a.toml"), text, &Overrides::default()) {
            Ok(_) => String::new(),
            Err(e) => e.diags()[0].message.clone(),
        };
        for (name, text) in PROFILES {
            assert_eq!(message(text), "this is a machine file, not a job file", "{name}");
        }
        let run = "machine = \"a\"\n[stage]\ndriver = \"manual\"\n[laser]\ndriver = \"manual\"\n";
        assert_eq!(message(run), "this is a run file, not a job file");
        assert_eq!(message(SAMPLE_JOB), "");
    }
}
