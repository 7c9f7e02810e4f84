//! Keys of a job file set to other values: a key with its values as typed, and a job file's text with keys set.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use terrace_core::diag::edits;

/// Most values of a setting.
const MOST_VALUES: usize = 10_000;

/// Values of a range that does not say how many.
const STEPS: usize = 6;

/// The value of a key, as a job file has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyValue(Value);

impl fmt::Display for KeyValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Value::String(text) => f.write_str(text),
            other => other.fmt(f),
        }
    }
}

/// The keys of a job file, to be changed.
#[derive(Clone, Debug)]
pub struct Keys(Table);

impl Keys {
    /// The keys of a text; None where it is not TOML.
    pub fn of(text: &str) -> Option<Self> {
        toml::from_str(text).ok().map(Self)
    }

    /// Sets a key such as `focus.pdof` or `texture.0.pitch`, making the tables around it where they are missing.
    ///
    /// # Errors
    /// Why there is no place for it.
    pub fn set(&mut self, key: &str, value: &KeyValue) -> Result<(), String> {
        set(&mut self.0, key, value.0.clone())
    }

    /// The text of a job file with these keys.
    pub fn text(&self) -> String {
        toml::to_string(&self.0).expect("a table of TOML values is TOML")
    }
}

/// A key of the job file and the values that it takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// The key with the tables around it: `focus.pdof`, `texture.0.pitch`.
    pub key: String,
    /// The values of the key, as the job file would have them.
    pub values: Vec<KeyValue>,
}

impl FromStr for Setting {
    type Err = String;

    /// `KEY=V1,V2,…`, or `KEY=LO..HI` with a unit and `/N`: N values, evenly spaced.
    fn from_str(text: &str) -> Result<Self, String> {
        let (key, values) = text.split_once('=').ok_or("a setting is KEY=VALUES, such as focus.pdof=0.05..0.3mm")?;
        let key = key.trim();
        if key.is_empty() || key.split('.').any(str::is_empty) {
            return Err(format!("{key:?} is not a key such as focus.pdof"));
        }
        let values = match values.split_once("..") {
            Some((lo, hi)) => range(lo.trim(), hi.trim())?,
            None => values.split(',').map(|v| KeyValue(value(v.trim()))).collect(),
        };
        if values.iter().any(|v| v.0.as_str() == Some("")) {
            return Err(format!("{key} has an empty value"));
        }
        Ok(Self { key: key.to_owned(), values })
    }
}

/// A value as written: a number, true or false, or else a text.
fn value(text: &str) -> Value {
    match toml::from_str::<Table>(&format!("v = {text}")) {
        Ok(mut keys) => keys.remove("v").unwrap_or_else(|| Value::String(text.to_owned())),
        Err(_) => Value::String(text.to_owned()),
    }
}

/// Values from `lo` to `hi`, which may have a unit and a count behind it.
fn range(lo: &str, hi: &str) -> Result<Vec<KeyValue>, String> {
    let (hi, count) = match hi.split_once('/') {
        Some((hi, n)) => (hi.trim(), n.trim().parse().map_err(|_| format!("{n:?} is not a number of values"))?),
        None => (hi, STEPS),
    };
    let end = hi.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | '+'))).unwrap_or(hi.len());
    let last = &hi[..end];
    let unit = hi[end..].trim();
    // The unit may stand behind both ends.
    let from = number(lo.strip_suffix(unit).unwrap_or(lo))?;
    let to = number(last)?;
    if !(2..=MOST_VALUES).contains(&count) {
        return Err(format!("a range has 2 to {MOST_VALUES} values, not {count}"));
    }
    let step = |i: usize| from + (to - from) * i as f64 / (count - 1) as f64;
    Ok((0..count).map(|i| rounded(step(i), unit)).collect())
}

/// An end of a range.
fn number(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| format!("{text:?} is not a number"))
}

/// A value of a range, to six decimals: without the noise of its division.
fn rounded(v: f64, unit: &str) -> KeyValue {
    let rounded = (v * 1e6).round() / 1e6;
    KeyValue(if unit.is_empty() { value(&rounded.to_string()) } else { Value::String(format!("{rounded} {unit}")) })
}

/// Sets a key in a table of a job file.
fn set(keys: &mut Table, key: &str, value: Value) -> Result<(), String> {
    let mut words = key.split('.').peekable();
    // The value that the words before lead to.
    let mut at: &mut Value = match words.next() {
        Some(first) if words.peek().is_some() => keys.entry(first).or_insert_with(|| Value::Table(Table::new())),
        _ => return Err("it is not inside a table".into()),
    };
    while let Some(word) = words.next() {
        let is_last = words.peek().is_none();
        at = match at {
            Value::Table(table) if is_last => {
                table.insert(word.to_owned(), value);
                return Ok(());
            }
            Value::Table(table) => table.entry(word).or_insert_with(|| Value::Table(Table::new())),
            Value::Array(list) => {
                let count = list.len();
                let place = word.parse::<usize>().ok().and_then(|i| list.get_mut(i));
                let place =
                    place.ok_or_else(|| format!("{word:?} is not one of its {count} entries, which count from 0"))?;
                if is_last {
                    *place = value;
                    return Ok(());
                }
                place
            }
            _ => return Err(format!("{word:?} is inside a value")),
        };
    }
    Err("it ends in a table".into())
}

/// A key that a [`Setting`] can set, as the JSON schema of the job file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownKey {
    /// The key with the tables around it; of a list the first entry: `focus.pdof`, `texture.0.pitch`.
    pub key: String,
    /// The values with a name: `z-range`, `auto`, `true`.
    pub names: Vec<String>,
    /// Whether it takes other values than those: numbers, lengths, paths.
    pub takes_others: bool,
}

impl KnownKey {
    /// Adds a value with a name, once.
    fn add_name(&mut self, name: &str) {
        if !self.names.iter().any(|other| other == name) {
            self.names.push(name.to_owned());
        }
    }
}

/// All keys of a job file that stand in a table.
pub fn known_keys() -> Vec<KnownKey> {
    let schema: serde_json::Value = serde_json::from_str(&super::json_schema()).expect("a schema is JSON");
    let mut keys = Vec::new();
    keys_of(&schema, &schema, "", &mut keys);
    keys
}

/// Keys of a job file that may have been meant by one that has no place: those of that last word, or those that differ
/// from it by a character or two; of a list the first entry.
pub fn near_keys(key: &str) -> Vec<String> {
    let mut all: Vec<String> = known_keys().into_iter().map(|known| known.key).collect();
    let last = |key: &str| key.rsplit('.').next().unwrap_or_default().to_owned();
    let typed = last(key);
    let distance = |known: &String| edits(key, known).min(edits(&typed, &last(known)));
    let nearest = all.iter().map(distance).min().unwrap_or(usize::MAX);
    if nearest > 2 || nearest >= typed.len() {
        return Vec::new();
    }
    all.retain(|known| distance(known) == nearest && known != key);
    all
}

/// Appends all keys with values below `at`, each once: what texture sources share has the values of all of them.
fn keys_of(schema: &serde_json::Value, at: &serde_json::Value, around: &str, out: &mut Vec<KnownKey>) {
    let tables = tables_of(schema, at);
    if !tables.is_empty() {
        let dot = if around.is_empty() { "" } else { "." };
        for (key, value) in tables.into_iter().filter_map(|table| table["properties"].as_object()).flatten() {
            keys_of(schema, value, &format!("{around}{dot}{key}"), out);
        }
    } else if at["items"]["$ref"].is_string() && at["type"] == "array" && !around.contains('.') {
        keys_of(schema, &at["items"], &format!("{around}.0"), out);
    } else if around.contains('.') {
        let place = out.iter().position(|known| known.key == around).unwrap_or_else(|| {
            out.push(KnownKey { key: around.to_owned(), names: Vec::new(), takes_others: false });
            out.len() - 1
        });
        values_of(schema, at, &mut out[place]);
    }
}

/// Adds the values that `at` allows.
fn values_of(schema: &serde_json::Value, at: &serde_json::Value, known: &mut KnownKey) {
    if let Some(name) = at["$ref"].as_str().and_then(|r| r.strip_prefix("#/$defs/")) {
        values_of(schema, &schema["$defs"][name], known);
    } else if let Some(name) = at["const"].as_str() {
        known.add_name(name);
    } else if let Some(names) = at["enum"].as_array() {
        names.iter().filter_map(|name| name.as_str()).for_each(|name| known.add_name(name));
    } else if at["type"] == "boolean" {
        ["true", "false"].into_iter().for_each(|name| known.add_name(name));
    } else if let Some(choices) = at["anyOf"].as_array().or_else(|| at["oneOf"].as_array()) {
        choices.iter().for_each(|choice| values_of(schema, choice, known));
    } else if at["type"] != "null" {
        known.takes_others = true;
    }
}

/// The tables that a value is: one, or some whose keys stand side by side. None where it may be something else.
fn tables_of<'a>(schema: &'a serde_json::Value, at: &'a serde_json::Value) -> Vec<&'a serde_json::Value> {
    let mut tables = Vec::new();
    if let Some(name) = at["$ref"].as_str().and_then(|r| r.strip_prefix("#/$defs/")) {
        tables.extend(tables_of(schema, &schema["$defs"][name]));
    }
    tables.extend(Some(at).filter(|at| at["properties"].is_object()));
    let choices = ["anyOf", "oneOf"].into_iter().filter_map(|of| at[of].as_array()).flatten();
    let choices: Vec<_> = choices.filter(|one| one["type"] != "null").map(|one| tables_of(schema, one)).collect();
    if choices.iter().all(|tables| !tables.is_empty()) {
        tables.extend(choices.into_iter().flatten());
    }
    tables
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Vec<String> {
        text.parse::<Setting>()
            .unwrap_or_else(|e| panic!("{text}: {e}"))
            .values
            .iter()
            .map(ToString::to_string)
            .collect()
    }

    #[test]
    fn settings_are_lists_or_ranges_of_values() {
        assert_eq!(values("focus.pdof=0.05..0.3mm/6"), ["0.05 mm", "0.1 mm", "0.15 mm", "0.2 mm", "0.25 mm", "0.3 mm"]);
        assert_eq!(values("focus.pdof = 50 um .. 70 um / 3"), ["50 um", "60 um", "70 um"]);
        assert_eq!(values("partition.method=auto, z-range"), ["auto", "z-range"]);
        assert_eq!(values("passes.count=1..3/3"), ["1", "2", "3"]);
        assert_eq!("passes.count=2".parse::<Setting>().expect("a setting").values, [KeyValue(Value::Integer(2))]);
        assert_eq!(
            "texture.0.tile=true".parse::<Setting>().expect("a setting").values,
            [KeyValue(Value::Boolean(true))]
        );
        assert_eq!("focus.factor=0.8".parse::<Setting>().expect("a setting").values, [KeyValue(Value::Float(0.8))]);
        for bad in
            ["focus.pdof", "=3", "a..b=3", "focus.pdof=1..2mm/1", "focus.pdof=x..2mm", "focus.pdof=1..mm", "a.b="]
        {
            assert!(bad.parse::<Setting>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_key_that_was_meant_is_found() {
        assert_eq!(near_keys("pdof"), ["focus.pdof"]);
        assert_eq!(near_keys("focus.pdfo"), ["focus.pdof"]);
        assert_eq!(near_keys("methd"), ["partition.method"]);
        assert_eq!(near_keys("texture.1.pitch"), ["texture.0.pitch"]);
        assert_eq!(near_keys("count"), ["passes.count"]);
        assert!(near_keys("speed").contains(&"pen.0.speed".to_owned()));
        assert_eq!(near_keys("nonsense"), [""; 0]);
        // Every key that is offered can be set.
        let all = known_keys();
        assert!(all.len() > 80 && all.iter().any(|known| known.key == "emit.formats"), "{all:?}");
        for KnownKey { key, .. } in &all {
            let mut keys = Table::new();
            for list in ["texture", "pen"] {
                keys.insert(list.into(), Value::Array(vec![Value::Table(Table::new())]));
            }
            set(&mut keys, key, Value::Integer(1)).unwrap_or_else(|e| panic!("{key}: {e}"));
        }
    }

    #[test]
    fn keys_are_set_in_tables_and_in_lists_of_tables() {
        let mut keys: Table = toml::from_str("[focus]\npdof = \"1 mm\"\n[[pen]]\nname = \"a\"\n").expect("TOML");
        for key in ["focus.pdof", "limits.max_incidence", "pen.0.speed"] {
            set(&mut keys, key, Value::Integer(7)).expect(key);
        }
        assert_eq!(keys["focus"]["pdof"], Value::Integer(7));
        assert_eq!(keys["limits"]["max_incidence"], Value::Integer(7));
        assert_eq!(
            (&keys["pen"][0]["speed"], &keys["pen"][0]["name"]),
            (&Value::Integer(7), &Value::String("a".into()))
        );
        for key in ["pen.1.speed", "pen.x", "focus.pdof.deep", "mode"] {
            assert!(set(&mut keys, key, Value::Integer(7)).is_err(), "{key}");
        }
    }

    #[test]
    fn keys_are_known_with_the_values_that_have_names() {
        let all = known_keys();
        let known = |key: &str| all.iter().find(|known| known.key == key).unwrap_or_else(|| panic!("{key}"));
        assert_eq!(known("partition.method").names, ["contour", "z-range", "window", "tilt", "auto"]);
        assert!(!known("partition.method").takes_others);
        assert!(known("focus.pdof").names.is_empty() && known("focus.pdof").takes_others);
        // A name or a number.
        assert_eq!(known("texture.0.dpi").names, ["file"]);
        assert!(known("texture.0.dpi").takes_others);
        for (i, one) in all.iter().enumerate() {
            assert!(one.takes_others || !one.names.is_empty(), "{one:?} takes no value");
            assert!(all[..i].iter().all(|other| other.key != one.key), "{} stands twice", one.key);
        }
    }
}
