//! The sample that `terrace init` writes: every key of the schema, with its default, its values and what it is for.
//!
//! Keys are described once, at the fields of `crates/input/src/job/file.rs` and `crates/input/src/job/texture/keys.rs`: the schema of job files
//! has that from there, and `crates/input/src/job/sample.toml` is made of the schema. `KEYS=write` writes it again.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};
use terrace_input::job::{Job, Overrides, SAMPLE_JOB, json_schema};

/// Columns of a comment at most.
const WIDTH: usize = 100;

/// What the sample says first.
const HEAD: &str = "#:schema ./job.schema.json
# A terrace job with every key. Every length, angle, speed and power carries its unit.
# `terrace compile job.toml` writes the job folder job.job; open its layout.svg before you mark.
# Keys that are commented out have their default, or belong to another kind of input; docs/job-file.md
# says more of each.
";

/// A second texture, after the keys of the first.
const SECOND: &str = "
# A drawing, in addition to the hatch or instead of it:
# [[texture]]
# file = \"sample.svg\"             # a leaf on a page of 10 x 10 mm
# area = \"part\"
# tile = true
# pen = \"fill\"
";

/// The keys of the sample that are not commented out, with their values.
const ACTIVE: [(&str, &str); 24] = [
    ("surface.file", "\"sample.stl\""),
    ("surface.unit", "\"mm\""),
    ("placement.turn", "\"0 deg\""),
    ("texture.pattern", "\"hatch\""),
    ("texture.area", "\"part\""),
    ("texture.pitch", "\"0.5 mm\""),
    ("texture.direction", "\"0 deg\""),
    ("texture.pen", "\"fill\""),
    ("focus.pdof", "\"0.07 mm\""),
    ("focus.level", "\"mid\""),
    ("focus.rule", "\"range\""),
    ("partition.method", "\"auto\""),
    ("order.stops", "\"time\""),
    ("order.strokes", "\"shortest\""),
    ("limits.warn_incidence", "\"10 deg\""),
    ("limits.max_incidence", "\"60 deg\""),
    ("limits.steep", "\"skip\""),
    ("machine.profile", "\"xyz-galvo-40\""),
    ("pen.name", "\"fill\""),
    ("pen.speed", "\"1000 mm/s\""),
    ("pen.power", "\"60 %\""),
    ("pen.frequency", "\"60 kHz\""),
    ("pen.passes", "1"),
    ("emit.formats", "[\"dxf\", \"linuxcnc\", \"ovf\"]"),
];

/// The schema of job files.
struct Schema(Value);

/// A table of a job file.
struct Table<'a> {
    /// Its path, such as `surface.heightmap`.
    path: String,
    /// Whether there may be several of it.
    is_list: bool,
    /// What it is for.
    about: String,
    keys: Vec<(String, Map<String, Value>)>,
    tables: Vec<Table<'a>>,
    schema: &'a Schema,
}

impl Schema {
    fn of_jobs() -> Self {
        Self(serde_json::from_str(&json_schema()).expect("JSON"))
    }

    /// A node with what it refers to, its own keys first.
    fn node(&self, node: &Value) -> Map<String, Value> {
        let mut own = node.as_object().cloned().unwrap_or_default();
        let target = own.remove("$ref").and_then(|r| Some(r.as_str()?.rsplit('/').next()?.to_owned()));
        if let Some(name) = target {
            for (key, value) in self.node(&self.0["$defs"][&name]) {
                own.entry(key).or_insert(value);
            }
        }
        own
    }

    /// The table that a node stands for, if it is one.
    fn table_of(&self, node: &Map<String, Value>) -> Option<Map<String, Value>> {
        if node.contains_key("properties") {
            return Some(node.clone());
        }
        // An optional table; one that may be given in place of a value is that value's.
        let any = node.get("anyOf")?.as_array()?;
        let [table, null] = &any[..] else { return None };
        (null["type"] == "null").then(|| self.node(table)).filter(|table| table.contains_key("properties"))
    }

    fn table(&self, path: &str, is_list: bool, node: &Map<String, Value>) -> Table<'_> {
        let about = node.get("description").and_then(Value::as_str).unwrap_or_default().to_owned();
        let mut table = Table { path: path.into(), is_list, about, keys: Vec::new(), tables: Vec::new(), schema: self };
        for (name, value) in node["properties"].as_object().expect("a table") {
            let inner = self.node(value);
            let below = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            let item = self.node(inner.get("items").unwrap_or(&Value::Null));
            let described = |table: Map<String, Value>| {
                let about = inner.get("description").cloned();
                table.into_iter().chain(about.map(|text| ("description".to_owned(), text))).collect()
            };
            match (self.table_of(&inner), self.table_of(&item)) {
                (Some(one), _) => table.tables.push(self.table(&below, false, &described(one))),
                (None, Some(many)) => table.tables.push(self.table(&below, true, &described(many))),
                (None, None) => table.keys.push((name.clone(), inner)),
            }
        }
        table
    }
}

impl Table<'_> {
    fn is_active(&self) -> bool {
        self.keys.iter().any(|(name, _)| active(&self.full(name)).is_some()) || self.path.is_empty()
    }

    /// The path of a key.
    fn full(&self, name: &str) -> String {
        if self.path.is_empty() { name.into() } else { format!("{}.{name}", self.path) }
    }

    /// Paths of all keys in it and below.
    fn all(&self) -> Vec<String> {
        let own = self.keys.iter().map(|(name, _)| self.full(name));
        own.chain(self.tables.iter().flat_map(Table::all)).collect()
    }

    fn write(&self, out: &mut String) {
        if !self.path.is_empty() {
            let [open, close] = if self.is_list { ["[[", "]]"] } else { ["[", "]"] };
            let comment = if self.is_active() { "" } else { "# " };
            *out += &format!("\n\n{}{comment}{open}{}{close}\n", wrapped(&self.about), self.path);
        }
        for (name, node) in &self.keys {
            *out += &self.key(name, node);
        }
        self.tables.iter().for_each(|table| {
            table.write(out);
            *out += if table.path == "texture" { SECOND } else { "" };
        });
    }

    /// A key below its description.
    fn key(&self, name: &str, node: &Map<String, Value>) -> String {
        let default = node.get("default").filter(|v| !v.is_null()).map(toml);
        let example = node.get("examples").and_then(|list| list.get(0)).map(toml);
        let values = self.schema.values(node);
        let path = self.full(name);
        let described = node["description"].as_str().unwrap_or_else(|| panic!("{path} is not described"));
        let mut text = described.split_whitespace().collect::<Vec<_>>().join(" ");
        let own = active(&path);
        let shown = own.map(str::to_owned).or_else(|| self.own_example(name).map(|v| toml(&v)));
        let shown = shown.or_else(|| default.clone()).or_else(|| values.last().cloned()).or(example);
        let shown = shown.unwrap_or_else(|| panic!("{path} needs an example"));
        if values.len() > 1 {
            text += &format!(" One of {}.", values.join(", "));
        }
        let is_told = text.to_lowercase().contains("default");
        if let Some(default) = default.filter(|default| *default != shown && !is_told) {
            text += &format!(" Default: {default}.");
        }
        let comment = if own.is_some() { "" } else { "# " };
        format!("\n{}{comment}{name} = {shown}\n", wrapped(&text))
    }

    /// The example that the field has, not that of its type.
    fn own_example(&self, name: &str) -> Option<Value> {
        let mut node = &self.schema.0;
        for word in self.path.split('.').filter(|word| !word.is_empty()) {
            node = self.schema.below(node, word);
        }
        node["properties"][name]["examples"].get(0).cloned()
    }
}

impl Schema {
    /// The table below a table, as it is defined.
    fn below<'a>(&'a self, node: &'a Value, word: &str) -> &'a Value {
        let defined = |node: &'a Value| match node["$ref"].as_str() {
            Some(path) => &self.0["$defs"][path.rsplit('/').next().expect("a name")],
            None => node,
        };
        let property = &node["properties"][word];
        let inner = [property, &property["items"], &property["anyOf"][0]].map(defined);
        inner.into_iter().find(|node| node["properties"].is_object()).expect("a table")
    }

    /// The values of a key that has a few.
    fn values(&self, node: &Map<String, Value>) -> Vec<String> {
        let lists = ["oneOf", "anyOf"].map(|key| node.get(key).and_then(Value::as_array).cloned().unwrap_or_default());
        let mut out: Vec<String> = node.get("enum").and_then(Value::as_array).into_iter().flatten().map(toml).collect();
        for one in lists.iter().flatten() {
            match one.get("const") {
                Some(value) => out.push(toml(value)),
                None => out.extend(self.values(&self.node(one))),
            }
        }
        out.extend(node.get("const").map(toml));
        out
    }
}

fn active(path: &str) -> Option<&'static str> {
    ACTIVE.iter().find(|(key, _)| *key == path).map(|(_, value)| *value)
}

/// A value as a job file has it.
fn toml(value: &Value) -> String {
    match value {
        Value::Array(list) => format!("[{}]", list.iter().map(toml).collect::<Vec<_>>().join(", ")),
        Value::Object(table) if table.is_empty() => "{}".into(),
        Value::Object(table) => {
            let pairs: Vec<String> = table.iter().map(|(key, value)| format!("{key:?} = {}", toml(value))).collect();
            format!("{{ {} }}", pairs.join(", "))
        }
        other => other.to_string(),
    }
}

/// A text as lines of a comment.
fn wrapped(text: &str) -> String {
    let mut out = String::new();
    let mut line = String::from("#");
    for word in text.split(' ') {
        if line.chars().count() + 1 + word.chars().count() > WIDTH {
            out += &format!("{line}\n");
            line = String::from("#");
        }
        line += &format!(" {word}");
    }
    out + &format!("{line}\n")
}

fn sample(schema: &Schema) -> String {
    let mut out = HEAD.to_owned();
    let root = schema.node(&schema.0);
    schema.table("", false, &root).write(&mut out);
    out
}

#[test]
fn the_sample_is_made_of_the_schema() {
    let made = sample(&Schema::of_jobs());
    if std::env::var("KEYS").is_ok_and(|v| v == "write") {
        std::fs::write(file(), &made).expect("a writable repository");
        return;
    }
    assert!(made == SAMPLE_JOB, "crates/input/src/job/sample.toml is not what `KEYS=write` writes");
}

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/input/src/job/sample.toml")
}

/// The keys of the sample, commented out or not, and the line of each.
fn keys_of_the_sample() -> Vec<(String, usize)> {
    let (mut table, mut out) = (String::new(), Vec::new());
    let before_second = SAMPLE_JOB.split(SECOND).next().expect("a text");
    let after = SAMPLE_JOB.split(SECOND).nth(1).unwrap_or_default();
    let skipped = SECOND.lines().count();
    let count = before_second.lines().count();
    for (i, line) in before_second.lines().chain(after.lines()).enumerate() {
        let bare = line.strip_prefix("# ").unwrap_or(line);
        if let Some(name) = bare.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
            table = name.trim_start_matches('[').to_owned();
        } else if let Some((key, _)) = bare.split_once(" = ").filter(|(key, _)| is_key(key)) {
            let path = if table.is_empty() { key.to_owned() } else { format!("{table}.{key}") };
            out.push((path, if i < count { i } else { i + skipped }));
        }
    }
    out
}

fn is_key(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_lowercase() || c == '_')
}

#[test]
fn the_sample_has_every_key_of_the_schema_once() {
    let schema = Schema::of_jobs();
    let wanted = schema.table("", false, &schema.node(&schema.0)).all();
    let found: Vec<String> = keys_of_the_sample().into_iter().map(|(path, _)| path).collect();
    assert_eq!(found.len(), found.iter().collect::<BTreeSet<_>>().len(), "each once");
    assert_eq!(found.iter().collect::<BTreeSet<_>>(), wanted.iter().collect::<BTreeSet<_>>());
    assert!(wanted.len() > 110, "{}", wanted.len());
}

#[test]
fn every_value_of_the_sample_is_one_that_its_key_can_have() {
    let keys = keys_of_the_sample();
    let bare = |line: &str| line.strip_prefix("# ").map(str::to_owned);
    for (path, line) in &keys {
        let mut lines: Vec<String> = SAMPLE_JOB.lines().map(str::to_owned).collect();
        let Some(key) = bare(&lines[*line]) else { continue };
        lines[*line] = key;
        // A table that is commented out comes with all its keys: some need others.
        let head = (0..*line).rev().find(|&i| lines[i].trim_start_matches("# ").starts_with('['));
        if let Some((head, text)) = head.and_then(|i| Some((i, bare(&lines[i])?))) {
            lines[head] = text;
            let table = path.rsplit_once('.').expect("a key of a table").0;
            for (_, other) in keys.iter().filter(|(other, _)| other.rsplit_once('.').is_some_and(|(t, _)| t == table)) {
                lines[*other] = bare(&lines[*other]).unwrap_or_else(|| lines[*other].clone());
            }
        }
        let parsed = Job::parse(Path::new("job.toml"), &lines.join("\n"), &Overrides::default());
        let codes: Vec<&str> = parsed.err().map_or_else(Vec::new, |e| e.diags().iter().map(|d| d.code).collect());
        // Keys that exclude others are refused for that, which is said of keys that could be read.
        assert!(!codes.contains(&"toml"), "{path}: {codes:?}\n{}", lines[*line]);
    }
}
