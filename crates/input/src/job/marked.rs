//! `[[marked]]`: jobs that have marked some of the texture before, on the same part.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::faults::Faults;
use terrace_core::diag::Diag;

/// Most jobs before.
const MAX_MARKED: usize = 100;

/// `[[marked]]`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MarkedKeys {
    /// The folder of a stepped job that was marked on this part; relative to the job file.
    #[schemars(example = &"hood.job", extend("x-value" = "path"))]
    pub folder: PathBuf,
    /// A folder of what is left of it, as `terrace resume` writes: its blocks are not marked.
    #[schemars(example = &"hood-rest.job", extend("x-value" = "path", "x-default" = "all of `folder` is marked"))]
    #[serde(default)]
    pub left: Option<PathBuf>,
}

/// A job that has marked some of the texture before.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkedInput {
    /// Its folder, as named in the job file, relative to it.
    pub folder: PathBuf,
    /// The folder of what is left of it.
    pub left: Option<PathBuf>,
    /// Their files that are read.
    files: Vec<PathBuf>,
}

impl MarkedInput {
    /// Its program, and the files that are read beside it, relative to the job file.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }
}

/// Resolves the jobs before; `passes` is how often this one goes over the part.
pub(super) fn resolve(marked: &[MarkedKeys], passes: u32, f: &mut Faults<'_>) -> Vec<MarkedInput> {
    if marked.len() > MAX_MARKED {
        let text = format!("the job has {} jobs before it, more than {MAX_MARKED}", marked.len());
        f.push("marked", Diag::input("marked-folder", text).hint("name the folders that marked what is left out"));
    }
    if passes > 1 && !marked.is_empty() {
        let text = "the job has several passes, and [[marked]]: of which pass the marks were is not known";
        let hint = "mark what is left pass by pass, each in a job of its own";
        f.push("passes.count", Diag::input("marked-passes", text).hint(hint));
    }
    let of = |keys: &MarkedKeys| {
        let left = keys.left.iter().map(|left| left.join("manifest.json"));
        let files = ["program.txt", "manifest.json"].map(|name| keys.folder.join(name)).into_iter().chain(left);
        MarkedInput { folder: keys.folder.clone(), left: keys.left.clone(), files: files.collect() }
    };
    marked.iter().map(of).collect()
}
