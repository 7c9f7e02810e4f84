//! The schemas of the job file, the machine file and the run file, as tables of keys.

use serde_json::{Map, Value};

/// A JSON schema.
pub struct Schema(Value);

/// A table of a file.
pub struct Table {
    /// Its path, such as `surface.heightmap`; with the driver where its keys depend on that, such as `stage.grbl`.
    pub path: String,
    /// Whether there may be several of it.
    pub is_list: bool,
    /// What it is for.
    pub about: String,
    pub keys: Vec<Key>,
    pub tables: Vec<Table>,
}

/// A key of a table.
pub struct Key {
    pub name: String,
    /// With the path of its table.
    pub path: String,
    /// The sources of a texture that have it as described here; none of a key that does not depend on the source.
    pub sources: Vec<String>,
    /// What it is for.
    pub about: String,
    /// What may be written, in words.
    pub value: String,
    /// What may be written, as TOML, where that is a few words.
    pub words: Vec<String>,
    /// What holds without it, in words.
    pub default: String,
    /// The same as TOML, where it is a value.
    pub default_value: Option<String>,
    /// An example of this very key.
    pub example: Option<String>,
    /// An example of its type.
    pub example_of_type: Option<String>,
}

impl Schema {
    pub fn parse(text: &str) -> Self {
        Self(serde_json::from_str(text).expect("JSON"))
    }

    /// The whole file as one table without a path.
    pub fn file(&self) -> Table {
        self.table("", false, &self.node(&self.0))
    }

    /// A node with what it refers to, its own keys first.
    fn node(&self, node: &Value) -> Map<String, Value> {
        let mut own = node.as_object().cloned().unwrap_or_default();
        let target = own.remove("$ref").and_then(|r| Some(r.as_str()?.rsplit('/').next()?.to_owned()));
        let Some(name) = target else { return own };
        for (key, value) in self.node(&self.0["$defs"][&name]) {
            match (own.get_mut(&key), value) {
                (Some(Value::Object(mine)), Value::Object(more)) => mine.extend(more),
                (Some(Value::Array(mine)), Value::Array(more)) if key == "required" => mine.extend(more),
                (Some(_), _) => {}
                (None, value) => {
                    own.insert(key, value);
                }
            }
        }
        own
    }

    /// The table that a node stands for, if it is one. What has a value in words is written in one line.
    fn table_of(&self, node: &Map<String, Value>) -> Option<Map<String, Value>> {
        if node.contains_key("x-value") {
            return None;
        }
        if node.contains_key("properties") {
            return Some(node.clone());
        }
        // An optional table; one that may be given in place of a value is that value's.
        let any = node.get("anyOf")?.as_array()?;
        let [table, null] = &any[..] else { return None };
        (null["type"] == "null").then(|| self.node(table)).filter(|table| table.contains_key("properties"))
    }

    /// The tables that a node stands for, by the word of its key `driver`.
    fn by_driver(&self, node: &Map<String, Value>) -> Option<Vec<(String, Map<String, Value>)>> {
        let all = node.get("oneOf")?.as_array()?.iter().map(|one| self.node(one));
        all.map(|one| Some((one.get("properties")?["driver"]["const"].as_str()?.to_owned(), one))).collect()
    }

    fn table(&self, path: &str, is_list: bool, node: &Map<String, Value>) -> Table {
        let about = text_of(node, "description").unwrap_or_default();
        let mut table = Table { path: path.into(), is_list, about, keys: Vec::new(), tables: Vec::new() };
        let required: Vec<&str> =
            node.get("required").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str).collect();
        for (source, node) in self.sources(node) {
            self.keys_of_source(&source, path, &node, &mut table.keys);
        }
        for (name, value) in node["properties"].as_object().expect("a table") {
            let inner = self.node(value);
            let below = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            let item = self.node(inner.get("items").unwrap_or(&Value::Null));
            let described = |table: Map<String, Value>| {
                let about = value.get("description").cloned();
                table.into_iter().chain(about.map(|text| ("description".to_owned(), text))).collect()
            };
            if let Some(drivers) = self.by_driver(&inner) {
                let tables = drivers.into_iter().map(|(driver, node)| self.driver(&format!("{below}.{driver}"), node));
                table.tables.extend(tables);
                continue;
            }
            match (self.table_of(&inner), self.table_of(&item)) {
                (Some(one), _) => table.tables.push(self.table(&below, false, &described(one))),
                (None, Some(many)) => table.tables.push(self.table(&below, true, &described(many))),
                (None, None) => table.keys.push(self.key(name, below, value, required.contains(&name.as_str()))),
            }
        }
        table
    }

    /// The sources that a table may have, each with its keys: of an enum with a tag its words, else what describes it.
    fn sources(&self, node: &Map<String, Value>) -> Vec<(String, Map<String, Value>)> {
        let mut out = Vec::new();
        for one in node.get("anyOf").and_then(Value::as_array).into_iter().flatten() {
            let target = self.node(&serde_json::json!({ "$ref": one["$ref"] }));
            let Some(words) = target.get("oneOf").and_then(Value::as_array) else {
                out.push((text_of(&target, "title").expect("a name"), target));
                continue;
            };
            for word in words {
                let mut own = self.node(word);
                let keys = own["properties"].as_object_mut().expect("keys");
                let (tag, value) = keys.iter().find(|(_, value)| value.get("const").is_some()).expect("a tag");
                let (tag, word) = (tag.clone(), value["const"].clone());
                let all: Vec<&Value> = words.iter().map(|word| &word["properties"][&tag]["const"]).collect();
                let mut of_tag = serde_json::json!({ "enum": all, "examples": [all[0]] });
                for key in ["description", "x-default"] {
                    of_tag[key] = target[key].clone();
                }
                keys.shift_remove(&tag);
                keys.shift_insert(0, tag, of_tag);
                out.push((word.as_str().expect("a word").to_owned(), own));
            }
        }
        out
    }

    /// Appends the keys of a source, or the source to the keys that are described for others already.
    fn keys_of_source(&self, source: &str, path: &str, node: &Map<String, Value>, keys: &mut Vec<Key>) {
        let required: Vec<&str> =
            node.get("required").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str).collect();
        for (name, value) in node["properties"].as_object().expect("a table") {
            let key = self.key(name, format!("{path}.{name}"), value, required.contains(&name.as_str()));
            match keys.iter_mut().find(|k| (&k.name, &k.about, &k.default) == (&key.name, &key.about, &key.default)) {
                Some(known) => known.sources.push(source.to_owned()),
                None => {
                    let at = keys.iter().rposition(|k| k.name == key.name).map_or(keys.len(), |last| last + 1);
                    keys.insert(at, Key { sources: vec![source.to_owned()], ..key });
                }
            }
        }
    }

    /// The keys beside `driver`.
    fn driver(&self, path: &str, mut node: Map<String, Value>) -> Table {
        node["properties"].as_object_mut().expect("keys").shift_remove("driver");
        self.table(path, false, &node)
    }

    fn key(&self, name: &str, path: String, value: &Value, is_required: bool) -> Key {
        let node = self.node(value);
        let about = text_of(&node, "description").unwrap_or_else(|| panic!("{path} is not described"));
        let first = |node: &Value| node.get("examples").and_then(|list| list.get(0)).map(toml);
        let default_value = node.get("default").filter(|v| !is_nothing(v)).map(toml);
        // A whole number is one whatever its type.
        let bare = |text: &String| text.strip_suffix(".0").unwrap_or(text).to_owned();
        let stated = text_of(&node, "x-default").or_else(|| default_value.as_ref().map(bare));
        Key {
            name: name.into(),
            sources: Vec::new(),
            value: self.value(&node).unwrap_or_else(|| panic!("what {path} can be is not said")),
            words: self.words(&node),
            default: stated.unwrap_or_else(|| if is_required { "required" } else { "none" }.into()),
            default_value,
            example: first(value),
            example_of_type: first(&Value::Object(node)),
            about,
            path,
        }
    }

    /// What may be written, in words.
    fn value(&self, node: &Map<String, Value>) -> Option<String> {
        if let Some(words) = text_of(node, "x-value") {
            return Some(words);
        }
        let words = self.words(node);
        if !words.is_empty() {
            return Some(words.join(", "));
        }
        if let Some([one, null]) = node.get("anyOf").and_then(Value::as_array).map(Vec::as_slice) {
            return if null["type"] == "null" { self.value(&self.node(one)) } else { None };
        }
        let kind = match node.get("type")? {
            Value::Array(kinds) => kinds[0].as_str()?,
            kind => kind.as_str()?,
        };
        let kind = match kind {
            "boolean" => "true, false",
            "integer" => "whole number",
            "number" => "number",
            "string" => "text",
            "array" => {
                let item = self.value(&self.node(&node["items"]))?;
                let count = node.get("maxItems").and_then(Value::as_u64);
                let count = [(2, "two"), (3, "three"), (4, "four")].into_iter().find(|(n, _)| Some(*n) == count);
                return Some(count.map_or_else(|| format!("list of {item}"), |(_, count)| format!("{count} {item}s")));
            }
            _ => return None,
        };
        Some(kind.into())
    }

    /// The words that may be written.
    fn words(&self, node: &Map<String, Value>) -> Vec<String> {
        let lists = ["oneOf", "anyOf"].map(|key| node.get(key).and_then(Value::as_array).cloned().unwrap_or_default());
        let mut out: Vec<String> = node.get("enum").and_then(Value::as_array).into_iter().flatten().map(toml).collect();
        for one in lists.iter().flatten() {
            match one.get("const") {
                Some(value) => out.push(toml(value)),
                None => out.extend(self.words(&self.node(one))),
            }
        }
        out.extend(node.get("const").map(toml));
        out
    }
}

impl Table {
    /// It and all tables below.
    pub fn all(&self) -> Vec<&Table> {
        std::iter::once(self).chain(self.tables.iter().flat_map(Table::all)).collect()
    }
}

fn text_of(node: &Map<String, Value>, key: &str) -> Option<String> {
    let text = node.get(key).and_then(Value::as_str)?;
    Some(text.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Whether a default only says that there is none.
fn is_nothing(value: &Value) -> bool {
    value.is_null() || value.as_array().is_some_and(Vec::is_empty) || value.as_object().is_some_and(Map::is_empty)
}

/// A value as a file has it.
fn toml(value: &Value) -> String {
    match value {
        Value::Array(list) => format!("[{}]", list.iter().map(toml).collect::<Vec<_>>().join(", ")),
        Value::Object(table) => {
            let pairs: Vec<String> = table.iter().map(|(key, value)| format!("{key:?} = {}", toml(value))).collect();
            format!("{{ {} }}", pairs.join(", "))
        }
        other => other.to_string(),
    }
}
