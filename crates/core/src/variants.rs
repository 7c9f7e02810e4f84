//! All words that a file may write for an enum, for tests of tables that have a row for each.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;

/// Every variant of an enum of plain, documented words, in their order in the schema: none can be forgotten here.
///
/// # Panics
/// Where the schema of the type is not a list of words.
pub fn variants<T: JsonSchema + DeserializeOwned>() -> Vec<T> {
    let schema = schemars::schema_for!(T).to_value();
    let words = schema["oneOf"].as_array().expect("one entry a word").iter();
    words.map(|entry| serde_json::from_value(entry["const"].clone()).expect("a documented word")).collect()
}
