//! What of a folder is not proved, for the verdict: pictures and pages, what stands around the tables of the run sheet, and
//! keys of the manifest that are taken as stated.

use std::path::Path;

use crate::proof::NotProved;
use crate::read::leaves::Leaves;
use crate::read::manifest::{self, Listed};

/// What is not proved of the files that a manifest lists, and of the manifest itself.
pub(crate) fn of(listed: &Listed<'_>, leaves: &Leaves) -> Vec<NotProved> {
    let ending = |file: &str| Path::new(file).extension().map(|e| e.to_string_lossy().into_owned());
    let what = |file: &str| match ending(file).as_deref() {
        Some("svg") => Some("a picture"),
        Some("html") => Some("a page"),
        Some("txt") if file.starts_with("runsheet") => Some("what stands around its tables"),
        _ => None,
    };
    let files = listed.files.iter().filter_map(|f| Some((f.file.clone(), what(&f.file)?.to_owned())));
    let keys = leaves.stated().collect::<Vec<_>>().join(", ");
    let all = files.chain([(manifest::NAME.to_owned(), keys)]);
    all.map(|(file, what)| NotProved { file, what }).collect()
}
