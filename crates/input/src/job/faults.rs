//! Faults of a job file, each at its key.

use std::path::Path;
use std::sync::Arc;

use toml::de::{DeTable, DeValue};

use terrace_core::diag::{Diag, Place};
use terrace_core::geom::{MAX_NM, Nm};
use terrace_core::units::Length;

/// Faults as they are found, each at its key.
pub(super) struct Faults<'a> {
    path: &'a Path,
    source: &'a Arc<str>,
    pub(super) list: Vec<Diag>,
    pub(super) warnings: Vec<Diag>,
}

impl<'a> Faults<'a> {
    pub(super) fn new(path: &'a Path, source: &'a Arc<str>) -> Self {
        Self { path, source, list: Vec::new(), warnings: Vec::new() }
    }

    /// The place of a key such as `texture.0.pitch`, or of an entry of a list such as `emit.formats.lmc`: its value, the
    /// nearest table or list around it that is given, or the file.
    pub(super) fn place(&self, key: &str) -> Place {
        let path = self.path.display().to_string();
        let Ok(root) = DeTable::parse(self.source) else { return Place::file(path) };
        let mut at = DeValue::Table(root.get_ref().clone());
        let mut span = None;
        for step in key.split('.') {
            let found = match &at {
                DeValue::Table(table) => table.get(step),
                DeValue::Array(list) => match step.parse::<usize>() {
                    Ok(i) => list.get(i),
                    Err(_) => list.iter().find(|entry| entry.get_ref().as_str() == Some(step)),
                },
                _ => None,
            };
            let Some(found) = found.cloned() else { break };
            span = Some(found.span());
            at = found.into_inner();
        }
        match span {
            Some(span) => Place::Text { path, source: self.source.clone(), span },
            None => Place::file(path),
        }
    }

    /// Whether the file gives a key, such as `limits.steep`.
    pub(super) fn is_given(&self, key: &str) -> bool {
        let (table, key) = key.rsplit_once('.').unwrap_or(("", key));
        self.keys_given(table).iter().any(|given| given == key)
    }

    /// The keys that the file gives in a table such as `limits` or `texture.0`, in the order of the file; none where
    /// there is no such table.
    pub(super) fn keys_given(&self, table: &str) -> Vec<String> {
        let Ok(root) = DeTable::parse(self.source) else { return Vec::new() };
        let mut at = root.get_ref();
        let mut steps = table.split('.').filter(|step| !step.is_empty()).peekable();
        while let Some(step) = steps.next() {
            let inner = match at.get(step).map(|found| found.get_ref()) {
                Some(DeValue::Array(list)) => {
                    steps.next().and_then(|i| list.get(i.parse::<usize>().ok()?)).map(|entry| entry.get_ref())
                }
                found => found,
            };
            let Some(DeValue::Table(inner)) = inner else { return Vec::new() };
            at = inner;
        }
        let mut keys: Vec<_> = at.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.into_iter().map(|key| key.get_ref().to_string()).collect()
    }

    pub(super) fn push(&mut self, key: &str, fault: Diag) {
        let place = self.place(key);
        self.list.push(fault.at(place));
    }

    /// A fault at a place of the text.
    pub(super) fn push_at(&mut self, span: std::ops::Range<usize>, fault: Diag) {
        let path = self.path.display().to_string();
        let source = self.source.clone();
        self.list.push(fault.at(Place::Text { path, source, span }));
    }

    pub(super) fn warn(&mut self, key: &str, warning: Diag) {
        let place = self.place(key);
        self.warnings.push(warning.at(place));
    }

    /// A length in nm.
    pub(super) fn nm(&mut self, key: &str, length: Length) -> Nm {
        length.as_nm().unwrap_or_else(|| {
            let text = format!("{key} is {length}, beyond {} m", MAX_NM.mm() / 1000.0);
            self.push(key, Diag::input("length-far", text).hint("check its unit; no stage reaches that far"));
            Nm(0)
        })
    }

    pub(super) fn nm_option(&mut self, key: &str, length: Option<Length>) -> Option<Nm> {
        length.map(|length| self.nm(key, length))
    }
}
