//! The tables of keys in the documents, as the schemas have them.
//!
//! A document has `<!-- keys: surface -->` where the table of a table belongs; what follows up to the next empty line
//! is made of the schema. `KEYS=write` writes it again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::schema::{Schema, Table};

/// Documents, and the schema of the file that each describes.
fn documents() -> [(&'static str, String); 3] {
    [
        ("docs/reference/job-file.md", terrace_input::job::json_schema()),
        ("docs/reference/machine-file.md", terrace_core::machine::json_schema()),
        ("docs/reference/run-file.md", terrace::run::settings::json_schema()),
    ]
}

/// What stands before and behind the path of a table.
const MARK: [&str; 2] = ["<!-- keys: ", " -->"];

/// The keys of one table.
fn rows(table: &Table) -> String {
    let cell = |text: &str| text.replace('|', "\\|");
    let by_source = table.keys.iter().any(|key| !key.sources.is_empty());
    let [head, line] = if by_source { [" of |", "---|"] } else { [""; 2] };
    let mut out = format!("| key |{head} value | default | meaning |\n|---|{line}---|---|---|\n");
    for key in &table.keys {
        let cells = [&key.value, &key.default, &key.about].map(|text| cell(text));
        let sources = match (&key.sources[..], key.name.as_str()) {
            ([], _) => "every texture".into(),
            (_, "pattern") => "patterns".into(),
            (sources, _) => sources.join(", "),
        };
        let of = if by_source { format!(" {sources} |") } else { String::new() };
        out += &format!("| `{}` |{of} {} |\n", key.name, cells.join(" | "));
    }
    out
}

/// A document with its tables made again, and the paths of the tables that it has.
fn made(text: &str, tables: &BTreeMap<String, &Table>) -> (String, Vec<String>) {
    let (mut out, mut found, mut is_old) = (String::new(), Vec::new(), false);
    for line in text.lines() {
        if is_old && line.starts_with('|') {
            continue;
        }
        is_old = false;
        out += &format!("{line}\n");
        if let Some(path) = line.strip_prefix(MARK[0]).and_then(|rest| rest.strip_suffix(MARK[1])) {
            let table = tables.get(path).unwrap_or_else(|| panic!("there is no table {path}"));
            out += &rows(table);
            found.push(path.to_owned());
            is_old = true;
        }
    }
    (out, found)
}

#[test]
fn the_tables_of_the_documents_are_made_of_the_schemas() {
    for (document, schema) in documents() {
        let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join(document);
        let text = std::fs::read_to_string(&path).expect("a document");
        let file = Schema::parse(&schema).file();
        let with_keys = file.all().into_iter().filter(|table| !table.keys.is_empty());
        // Tables with the same keys, such as those of the three axes, are listed once, with the first.
        let name = |table: &Table| if table.path.is_empty() { "the file itself".into() } else { table.path.clone() };
        let mut seen = Vec::new();
        let mut tables = BTreeMap::new();
        for table in with_keys {
            let rows = rows(table);
            if !seen.contains(&rows) {
                seen.push(rows);
                tables.insert(name(table), table);
            }
        }
        let (made, mut found) = made(&text, &tables);
        if std::env::var("KEYS").is_ok_and(|v| v == "write") {
            std::fs::write(&path, &made).expect("a writable repository");
        } else {
            assert!(made == text, "{document} is not what `KEYS=write` writes");
        }
        found.sort();
        assert_eq!(found, tables.into_keys().collect::<Vec<_>>(), "{document}: each table once");
    }
}
