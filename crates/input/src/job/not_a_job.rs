//! What was named in place of a job file: a surface, a drawing, a folder, or another TOML file of terrace.

use std::path::{Path, PathBuf};

use terrace_core::diag::{self, Diag, Place};

/// What a job names a file for, and how.
#[derive(Clone, Copy)]
enum Use {
    Surface,
    Drawing,
    /// A height map or a drawing.
    Picture,
    /// A point cloud or space curves.
    Points,
}

/// Names of files end in these and mean what stands beside them.
const EXTENSIONS: [(&str, &str, Use); 27] = [
    ("stl", "an STL surface", Use::Surface),
    ("obj", "an OBJ surface", Use::Surface),
    ("ply", "a PLY surface", Use::Surface),
    ("3mf", "a 3MF part", Use::Surface),
    ("step", "a STEP part", Use::Surface),
    ("stp", "a STEP part", Use::Surface),
    ("iges", "an IGES part", Use::Surface),
    ("igs", "an IGES part", Use::Surface),
    ("asc", "a height map or point cloud", Use::Surface),
    ("xyz", "a point cloud", Use::Surface),
    ("pts", "a point cloud", Use::Surface),
    ("ptx", "a point cloud", Use::Surface),
    ("csv", "a table of points", Use::Points),
    ("png", "a PNG picture", Use::Picture),
    ("tif", "a TIFF picture", Use::Picture),
    ("tiff", "a TIFF picture", Use::Picture),
    ("bmp", "a BMP picture", Use::Drawing),
    ("jpg", "a JPEG picture", Use::Drawing),
    ("jpeg", "a JPEG picture", Use::Drawing),
    ("svg", "an SVG drawing", Use::Drawing),
    ("svgz", "an SVG drawing", Use::Drawing),
    ("dxf", "a DXF drawing", Use::Drawing),
    ("plt", "an HPGL plot", Use::Drawing),
    ("hpgl", "an HPGL plot", Use::Drawing),
    ("hpg", "an HPGL plot", Use::Drawing),
    ("lbrn2", "a LightBurn project", Use::Drawing),
    ("ngc", "a stage program", Use::Surface),
];

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
    let extension = path.extension()?.to_string_lossy().to_lowercase();
    let (_, what, used) = EXTENSIONS.iter().find(|(known, ..)| *known == extension)?;
    let name = path.file_name()?.to_string_lossy().into_owned();
    // What is not there is told as such.
    let near = if path.is_file() { job_files(path.parent()?, Some(&name)) } else { return None };
    let key = match used {
        Use::Surface if matches!(extension.as_str(), "ngc") => None,
        Use::Drawing if matches!(extension.as_str(), "lbrn2") => None,
        Use::Surface => Some("surface.file"),
        Use::Drawing => Some("texture.file"),
        Use::Picture => Some("surface.file or texture.file"),
        Use::Points => Some("surface.file or texture.curves"),
    };
    let inspect = format!("`terrace inspect {name}` says what it holds");
    let hint = match (mean(&near), key) {
        (Some(hint), _) => hint,
        (None, Some(key)) => format!("name a job file (.toml), which names this file as {key}; {inspect}"),
        (None, None) => "name a job file (.toml)".into(),
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
    fn surfaces_drawings_and_folders_are_told_and_the_job_that_names_them_is_offered() {
        let dir = tempfile::tempdir().expect("a folder");
        let at = |name: &str| dir.path().join(name);
        for (extension, what, _) in EXTENSIONS {
            let file = at(&format!("part.{}", extension.to_uppercase()));
            assert!(by_name(&file).is_none(), "{extension}: what is not there is no STL file");
            std::fs::write(&file, "x").expect("written");
            let d = read_file(&file).expect_err("no job file").diags()[0].clone();
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
    fn machine_files_and_run_files_are_told() {
        let told = |text: &str| match Job::parse(Path::new("a.toml"), text, &Overrides::default()) {
            Ok(_) => String::new(),
            Err(e) => e.diags()[0].message.clone(),
        };
        for (name, text) in PROFILES {
            assert_eq!(told(text), "this is a machine file, not a job file", "{name}");
        }
        let run = "machine = \"a\"\n[stage]\ndriver = \"manual\"\n[laser]\ndriver = \"manual\"\n";
        assert_eq!(told(run), "this is a run file, not a job file");
        assert_eq!(told(SAMPLE_JOB), "");
    }
}
