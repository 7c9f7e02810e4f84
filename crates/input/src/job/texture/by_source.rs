//! The keys of a `[[texture]]` table, sorted into those that every texture takes and those of its source.
//!
//! A table of the file has them all side by side; [`TextureKeys`](super::keys::TextureKeys) has them apart, each source
//! with a type of its own. The sorting is done on the parsed table, so that every value keeps its place in the file.

use std::ops::Range;
use std::path::Path;
use std::sync::LazyLock;

use serde_json::Value;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use super::keys::{CommonKeys, CurvesKeys, DrawingKeys};
use crate::job::faults::Faults;
use crate::texture;
use crate::texture::pattern::PatternKeys;
use terrace_core::diag::{self, Diag};

/// The keys that say what a texture is made from.
const SOURCES: [&str; 3] = ["pattern", "file", "curves"];

/// The keys of one source.
struct Source {
    /// In messages.
    name: String,
    needs: Vec<String>,
    keys: Vec<String>,
}

impl Source {
    /// The source whose keys are those of a table of a JSON schema.
    fn new(name: &str, table: &Value) -> Self {
        Self { name: name.into(), needs: words_of(&table["required"]), keys: keys_of(table) }
    }
}

/// The words of a list of a JSON schema.
fn words_of(list: &Value) -> Vec<String> {
    list.as_array().into_iter().flatten().filter_map(|word| Some(word.as_str()?.to_owned())).collect()
}

/// The keys of a table of a JSON schema.
fn keys_of(table: &Value) -> Vec<String> {
    table["properties"].as_object().into_iter().flatten().map(|(key, _)| key.clone()).collect()
}

/// The keys of all sources, from the types that read them.
struct Schema {
    common: Vec<String>,
    patterns: Vec<Source>,
    drawing: Source,
    curves: Source,
}

static SCHEMA: LazyLock<Schema> = LazyLock::new(|| {
    let patterns = schemars::schema_for!(PatternKeys).to_value();
    Schema {
        common: keys_of(&schemars::schema_for!(CommonKeys).to_value()),
        patterns: patterns["oneOf"].as_array().into_iter().flatten().map(|entry| pattern(&patterns, entry)).collect(),
        drawing: Source::new("a drawing", &schemars::schema_for!(DrawingKeys).to_value()),
        curves: Source::new("space curves", &schemars::schema_for!(CurvesKeys).to_value()),
    }
});

/// The source of an entry of the schema of patterns, which has its keys in itself or refers to them.
fn pattern(patterns: &Value, entry: &Value) -> Source {
    let table = entry["$ref"].as_str().and_then(|name| patterns["$defs"].get(name.rsplit('/').next()?));
    Source::new(entry["properties"]["pattern"]["const"].as_str().unwrap_or_default(), table.unwrap_or(entry))
}

impl Schema {
    fn sources(&self) -> impl Iterator<Item = &Source> {
        self.patterns.iter().chain([&self.drawing, &self.curves])
    }

    /// Whether every source has a key.
    fn is_common(&self, key: &str) -> bool {
        self.common.iter().any(|common| common == key)
    }

    /// Whether any source has a key.
    fn has(&self, key: &str) -> bool {
        let is_of_source = || self.sources().any(|source| source.keys.iter().any(|known| known == key));
        SOURCES.contains(&key) || self.is_common(key) || is_of_source()
    }
}

/// Sorts the keys of every `[[texture]]` of a job file, as [`TextureKeys`] reads them. Keys of another source are
/// faults, and left out. Returns whether all textures have what they need.
///
/// [`TextureKeys`]: super::keys::TextureKeys
pub(in crate::job) fn split_keys(root: &mut DeTable<'_>, f: &mut Faults<'_>) -> bool {
    let Some(DeValue::Array(list)) = root.get_mut("texture").map(Spanned::get_mut) else { return true };
    let mut is_whole = true;
    for (i, entry) in list.iter_mut().enumerate() {
        let span = entry.span();
        let DeValue::Table(table) = entry.get_mut() else { continue };
        let apart = match source(i, table, f) {
            Some(tag) if holds_own_keys(i, table, tag, f) => sorted(std::mem::take(table), &span, tag, f),
            _ => None,
        };
        match apart {
            Some(apart) => *table = apart,
            None => is_whole = false,
        }
    }
    is_whole
}

/// The key that names the source of a texture.
fn source(i: usize, table: &DeTable<'_>, f: &mut Faults<'_>) -> Option<&'static str> {
    let file = table.get("file").and_then(|file| file.get_ref().as_str());
    if let Some(fault) = file.and_then(|file| texture::foreign_drawing(Path::new(file))) {
        // What other keys mean for it is not the first thing to know.
        f.push(&format!("texture.{i}.file"), fault);
        return None;
    }
    let sources: Vec<&'static str> = SOURCES.into_iter().filter(|key| table.contains_key(*key)).collect();
    match sources[..] {
        [source] => Some(source),
        [] => {
            let fault = Diag::input("texture-empty", "a texture has neither pattern nor file nor curves");
            let hint = "add pattern = \"hatch\" and pitch = \"0.1 mm\", or file = \"drawing.svg\"";
            f.push(&format!("texture.{i}"), fault.hint(hint));
            None
        }
        [first, ..] => {
            let fault = Diag::input("texture-both", format!("the texture has both {}", sources.join(" and ")));
            f.push(&format!("texture.{i}.{first}"), fault.hint("keep one"));
            None
        }
    }
}

/// Takes out the keys that are not of the source, and returns whether those that it needs are there.
fn holds_own_keys(i: usize, table: &mut DeTable<'_>, tag: &str, f: &mut Faults<'_>) -> bool {
    let source = match tag {
        "pattern" => SCHEMA.patterns.iter().find(|source| table["pattern"].get_ref().as_str() == Some(&source.name)),
        "file" => Some(&SCHEMA.drawing),
        _ => Some(&SCHEMA.curves),
    };
    // A pattern that is not known is reported where it is read.
    let Some(source) = source else { return true };
    let own: Vec<&str> = source.keys.iter().map(String::as_str).filter(|key| *key != tag).collect();
    let specific =
        if own.is_empty() { String::new() } else { format!("keys specific to {}: {}", source.name, own.join(", ")) };
    let missing: Vec<&String> = source.needs.iter().filter(|key| !table.contains_key(key.as_str())).collect();
    // A key that is misspelt is reported as such, and not as missing.
    if table.keys().all(|key| SCHEMA.has(key.get_ref())) {
        for key in &missing {
            let fault = Diag::input("texture-key", format!("{} needs {key}", source.name));
            f.push(&format!("texture.{i}.{tag}"), fault.hint(&specific));
        }
    }
    for key in f.keys_given(&format!("texture.{i}")) {
        if key == tag || own.iter().any(|own| *own == key) || SCHEMA.is_common(&key) {
            continue;
        }
        if SCHEMA.has(&key) {
            let fault = Diag::input("texture-key", format!("{key} does not apply to {}", source.name));
            f.push(&format!("texture.{i}.{key}"), fault.hint(&specific));
        } else if let Some((misspelt, _)) = table.get_key_value(key.as_str()) {
            let known = own.iter().copied().chain(SCHEMA.common.iter().map(String::as_str));
            f.push_at(misspelt.span(), diag::unknown_key(&key, &known.collect::<Vec<_>>()));
        }
        table.remove(key.as_str());
    }
    missing.is_empty()
}

/// The table with its keys apart; None where it names a pattern by something else than a text.
fn sorted<'a>(table: DeTable<'a>, span: &Range<usize>, tag: &'static str, f: &mut Faults<'_>) -> Option<DeTable<'a>> {
    let mut own = DeTable::new();
    let mut common = DeTable::new();
    for (key, value) in table {
        if SCHEMA.is_common(key.get_ref()) { &mut common } else { &mut own }.insert(key, value);
    }
    let mut own = DeValue::Table(own);
    if tag == "pattern"
        && let Err((fault, at)) = diag::by_tag(&mut own, tag)
    {
        f.push_at(at.unwrap_or(span.clone()), fault);
        return None;
    }
    let source = table_of(span, [(tag.into(), own)]);
    let DeValue::Table(apart) = table_of(span, [("source".into(), source), ("common".into(), DeValue::Table(common))])
    else {
        unreachable!("a table was made")
    };
    Some(apart)
}

/// A table whose keys and values stand at one place of the file.
fn table_of<'a, const N: usize>(at: &Range<usize>, entries: [(DeString<'a>, DeValue<'a>); N]) -> DeValue<'a> {
    let entries = entries.map(|(key, value)| (Spanned::new(at.clone(), key), Spanned::new(at.clone(), value)));
    DeValue::Table(entries.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::job::{Job, Overrides, SAMPLE_JOB};

    /// The faults of the sample with a texture of these keys in place of its own: place, text and hint.
    fn faults(texture: &str) -> Vec<[String; 3]> {
        let rest = SAMPLE_JOB.split_once("\n[focus]").expect("a table").1;
        let head = "[surface]\nfile = \"sample.stl\"\nunit = \"mm\"\n";
        let text = format!("[[texture]]\n{texture}\n{head}\n[focus]{rest}");
        match Job::parse(Path::new("job.toml"), &text, &Overrides::default()) {
            Ok(_) => Vec::new(),
            Err(e) => e.diags().iter().map(|d| [d.place.to_string(), d.message.clone(), d.hint.clone()]).collect(),
        }
    }

    /// The same as one line a fault.
    fn messages(texture: &str) -> Vec<String> {
        faults(texture).into_iter().map(|[place, text, _]| format!("{place}: {text}")).collect()
    }

    #[test]
    fn values_of_every_source_keep_their_place_in_the_file() {
        for (keys, wanted) in [
            ("pattern = \"hatch\"\npitch = \"0.5\"", "job.toml:3:9: "),
            ("pattern = \"hatch\"\npitch = \"0.5 mm\"\npen = 3", "job.toml:4:7: "),
            ("pattern = \"concentric\"\npitch = \"1 mm\"\ncentre = [\"1 mm\", \"2 grad\"]", "job.toml:4:19: "),
            ("file = \"a.svg\"\nsize = [\"1 mm\", 4]", "job.toml:3:17: "),
            ("file = \"a.svg\"\nscreen = \"lins\"", "job.toml:3:10: "),
            ("curves = \"a.csv\"\nmax_distance = \"-1 mm\"", "job.toml:3:16: "),
            ("pattern = \"hatc\"\npitch = \"1 mm\"", "job.toml:2:11: unknown variant `hatc`, expected one of"),
            ("pattern = 3\npitch = \"1 mm\"", "job.toml:2:11: pattern is not a text"),
        ] {
            let found = messages(keys);
            assert!(found.len() == 1 && found[0].starts_with(wanted), "{keys}: {found:?}");
        }
        assert_eq!(
            messages("pattern = \"dots\"\npitch = \"1 mm\"\nlattice = \"hex\"\njitter = \"10 %\"\nseed = 4"),
            [""; 0]
        );
    }

    #[test]
    fn keys_are_held_to_the_source_all_at_once() {
        let found = messages("pattern = \"hilbert\"\nturn = \"0 deg\"\npitch = \"1 mm\"\npen = \"no\"\norder = 20");
        let wanted = [
            "job.toml:3:8: turn does not apply to hilbert",
            "job.toml:4:9: pitch does not apply to hilbert",
            "job.toml:5:7: there is no pen named \"no\"",
            "job.toml:6:9: Hilbert order 20 is not between 1 and 13",
        ];
        assert_eq!(found, wanted);
        let missing = faults("pattern = \"rings\"\ncell = \"1 mm\"");
        let texts: Vec<&str> = missing.iter().map(|fault| fault[1].as_str()).collect();
        assert_eq!(texts, ["rings needs pitch", "rings needs inner"]);
        assert_eq!(missing[0][2], "keys specific to rings: pitch, cell, inner, lattice");
        assert_eq!(
            messages("file = \"a.svg\"\nmax_distance = \"1 mm\"")[0],
            "job.toml:3:16: max_distance does not apply to a drawing"
        );
        assert_eq!(
            messages("curves = \"a.csv\"\ncell = \"1 mm\"")[0],
            "job.toml:3:8: cell does not apply to space curves"
        );
    }

    #[test]
    fn a_key_that_no_source_has_is_answered_with_the_nearest() {
        for (slip, meant) in
            [("pitsh", "pitch"), ("inisde", "inside"), ("tolerence", "tolerance"), ("dirction", "direction")]
        {
            let [fault] = &faults(&format!("pattern = \"hatch\"\npitch = \"1 mm\"\n{slip} = 1"))[..] else {
                panic!("{slip} is one fault")
            };
            assert!(fault[1].starts_with(&format!("unknown field `{slip}`")), "{fault:?}");
            assert_eq!(fault[2], format!("did you mean {meant}?"));
        }
    }

    #[test]
    fn every_source_has_keys_and_a_name_of_its_own() {
        let names: std::collections::BTreeSet<&str> = SCHEMA.sources().map(|source| source.name.as_str()).collect();
        assert_eq!(names.len(), SCHEMA.patterns.len() + 2);
        assert!(SCHEMA.patterns.len() >= 14 && SCHEMA.common.contains(&"pen".to_owned()));
        for source in SCHEMA.sources() {
            assert!(
                !source.needs.is_empty() && source.needs.iter().all(|key| source.keys.contains(key)),
                "{}",
                source.name
            );
            assert!(source.keys.iter().all(|key| !SCHEMA.common.contains(key)), "{}", source.name);
        }
    }
}
