//! What of a folder is not proved, for the verdict: pictures and pages, what stands around the tables of the run sheet,
//! and keys of the manifest that are taken as stated.

use std::path::Path;

use crate::proof::NotProved;
use crate::read::leaves::Leaves;
use crate::read::manifest::{self, Listed};

/// The parts that are not proved of the files that a manifest lists, and of the manifest itself.
pub(crate) fn not_proved(listed: &Listed<'_>, leaves: &Leaves) -> Vec<NotProved> {
    let mut not_proved: Vec<NotProved> = Vec::new();
    for listed in listed.files {
        not_proved
            .extend(not_proved_of(&listed.file).map(|what| NotProved { file: listed.file.clone(), what: what.into() }));
    }
    let keys = leaves.stated().collect::<Vec<_>>().join(", ");
    not_proved.push(NotProved { file: manifest::NAME.to_owned(), what: keys });
    not_proved
}

/// The part of a listed file that is not proved.
fn not_proved_of(file: &str) -> Option<&'static str> {
    match Path::new(file).extension()?.to_string_lossy().as_ref() {
        "svg" => Some("a picture"),
        "html" => Some("a page"),
        "txt" if file.starts_with("runsheet") => Some("what stands around its tables"),
        _ => None,
    }
}
