//! The tables of a TOML file: which are lists, and which must be there.

use std::path::Path;
use std::sync::Arc;

use toml::de::{DeTable, DeValue};

use super::{Diag, Place, edits};

/// A table that a kind of file may have.
#[derive(Clone, Copy, Debug)]
pub struct TableKey {
    /// The name of the table with the tables around it, such as `surface.heightmap`.
    pub name: &'static str,
    /// Whether it is a list: `[[pen]]`.
    pub is_list: bool,
    /// Where it must be there: what is to be added.
    pub needed: Option<&'static str>,
}

impl TableKey {
    /// The heading of the table.
    fn heading(&self) -> String {
        if self.is_list { format!("[[{}]]", self.name) } else { format!("[{}]", self.name) }
    }

    /// The name without the tables around it.
    fn last_name(&self) -> &'static str {
        self.name.rsplit_once('.').map_or(self.name, |(_, last)| last)
    }

    /// The table of a document that this one belongs in: the root where the name has no point. None where that table is
    /// not there, or is a list.
    fn parent<'a, 'i>(&self, root: &'a DeTable<'i>) -> Option<&'a DeTable<'i>> {
        let Some((around, _)) = self.name.rsplit_once('.') else { return Some(root) };
        let mut table = root;
        for name in around.split('.') {
            let DeValue::Table(inner) = table.get(name)?.get_ref() else { return None };
            table = inner;
        }
        Some(table)
    }
}

/// What is wrong with the tables of a TOML text that can be parsed; `what` is the kind of file.
pub fn table_faults(path: &Path, source: &Arc<str>, what: &str, tables: &[TableKey]) -> Vec<Diag> {
    let Ok(root) = DeTable::parse(source) else { return Vec::new() };
    let file = path.display().to_string();
    let mut faults = Vec::new();
    for key in tables {
        // A table is judged only where the one around it is there and is no list.
        let Some(parent) = key.parent(root.get_ref()) else { continue };
        let heading = key.heading();
        let Some(value) = parent.get(key.last_name()) else {
            let Some(hint) = key.needed else { continue };
            // A slip of the name is reported where it stands.
            let is_slip = |name: &str| {
                edits(name, key.name) <= 2 && !tables.iter().any(|known| known.name.split('.').next() == Some(name))
            };
            let slip = root.get_ref().iter().find(|(name, _)| is_slip(name.get_ref()));
            faults.push(match slip {
                Some((name, value)) => {
                    let place = Place::Text { path: file.clone(), source: source.clone(), span: value.span() };
                    let text = format!("a {what} has no {}", name.get_ref());
                    Diag::input("toml", text).at(place).hint(format!("did you mean {heading}?"))
                }
                None => {
                    let text = format!("the {what} has no {heading}");
                    Diag::input("toml", text).at(Place::file(file.clone())).hint(hint)
                }
            });
            continue;
        };
        let text = match (value.get_ref(), key.is_list) {
            (DeValue::Table(_), true) => format!("[{}] is a single table, and a {what} has a list of them", key.name),
            // A list of numbers is not a list of tables: what its key takes is said where it is read.
            (DeValue::Array(list), false) if list.iter().all(|v| matches!(v.get_ref(), DeValue::Table(_))) => {
                format!("[[{}]] is a list, and a {what} has one such table", key.name)
            }
            _ => continue,
        };
        let place = Place::Text { path: file.clone(), source: source.clone(), span: value.span() };
        faults.push(Diag::input("toml", text).at(place).hint(format!("write {heading}")));
    }
    faults
}

/// Whether a TOML text has all of these tables or keys at its root.
pub fn has_keys(source: &str, keys: &[&str]) -> bool {
    DeTable::parse(source).is_ok_and(|root| keys.iter().all(|key| root.get_ref().get(*key).is_some()))
}

/// For tests: whether `tables` lists every table of a JSON schema, but for those `in_line`, as what it is there.
#[cfg(any(test, feature = "test-support"))]
pub fn lists_all_of(schema: &str, tables: &[TableKey], in_line: &[&str]) {
    use serde_json::Value;

    fn follow<'a>(schema: &'a Value, at: &'a Value) -> &'a Value {
        if let Some(name) = at["$ref"].as_str().and_then(|r| r.strip_prefix("#/$defs/")) {
            return follow(schema, &schema["$defs"][name]);
        }
        let choices = at["anyOf"].as_array().into_iter().flatten();
        choices.map(|c| follow(schema, c)).find(|c| c.get("properties").is_some()).unwrap_or(at)
    }
    let schema: Value = serde_json::from_str(schema).expect("a schema is JSON");
    let mut open = vec![(String::new(), &schema)];
    let mut listed = 0;
    while let Some((name, at)) = open.pop() {
        let required: Vec<&str> = at["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        for (key, value) in at["properties"].as_object().expect("an object has keys") {
            let value = follow(&schema, value);
            let items = value.get("items").map(|items| follow(&schema, items));
            let is_list = items.is_some_and(|items| items.get("properties").is_some());
            if in_line.contains(&key.as_str()) || !is_list && value.get("properties").is_none() {
                continue;
            }
            let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
            let row = tables.iter().find(|row| row.name == name).unwrap_or_else(|| panic!("no row for {name}"));
            assert_eq!(row.is_list, is_list, "{name}");
            assert_eq!(row.needed.is_some(), required.contains(&key.as_str()), "{name}");
            listed += 1;
            if !is_list {
                open.push((name, value));
            }
        }
    }
    assert_eq!(listed, tables.len(), "a row stands for no table");
}
