//! The figures of an earlier run, which the repository keeps, beside those of this one.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::{Value, json};

/// By how much a figure may be larger than the one kept.
const NOISE: f64 = 0.1;

/// The figures by case: CPU seconds as a multiple of the floor's, and peak memory in MB.
pub struct Kept {
    old: BTreeMap<String, [f64; 2]>,
    new: BTreeMap<String, [f64; 2]>,
}

fn path() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/kept.json"))
}

impl Kept {
    /// Those of the repository.
    pub fn read() -> Self {
        let text = std::fs::read_to_string(path()).unwrap_or_else(|_| "{}".into());
        let all: BTreeMap<String, Value> = serde_json::from_str(&text).expect("kept.json");
        let number = |value: &Value, key: &str| value[key].as_f64().expect("a number");
        let old = all.iter().map(|(case, v)| (case.clone(), [number(v, "x_floor"), number(v, "peak_mb")])).collect();
        Self { old, new: BTreeMap::new() }
    }

    /// Takes the figures of a case.
    pub fn add(&mut self, case: &str, x_floor: f64, peak_mb: f64) {
        self.new.insert(case.into(), [x_floor, peak_mb]);
    }

    /// Says what has become slower or larger, or keeps the new figures where that is asked for.
    pub fn tell(&self) {
        if std::env::var("KEEP").is_ok_and(|v| v == "write") {
            let rounded = |v: f64| (v * 100.0).round() / 100.0;
            let of = |[x_floor, peak_mb]: &[f64; 2]| json!({"x_floor": rounded(*x_floor), "peak_mb": peak_mb.round()});
            let all: BTreeMap<&String, Value> = self.new.iter().map(|(case, v)| (case, of(v))).collect();
            let text = serde_json::to_string_pretty(&all).expect("JSON") + "\n";
            std::fs::write(path(), text).expect("a writable repository");
            println!("kept in {}", path().display());
            return;
        }
        let mut told = 0;
        for (case, new) in &self.new {
            let Some(old) = self.old.get(case) else {
                println!("new: {case}");
                continue;
            };
            for ((what, old), new) in ["CPU time against the floor", "peak memory"].iter().zip(old).zip(new) {
                if *new > old * (1.0 + NOISE) {
                    told += 1;
                    println!("WORSE: {case}: {what} {new:.2}, kept is {old:.2} ({:+.0} %)", (new / old - 1.0) * 100.0);
                }
            }
        }
        println!("{told} of {} figures are worse by more than {:.0} %", 2 * self.new.len(), NOISE * 100.0);
    }
}
