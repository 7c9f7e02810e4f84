//! The package of a 3MF file: a ZIP archive whose parts are found by relationships.
//!
//! Consumes the archive's directory and single parts, each through one buffer; nothing is written to disk and no name
//! of the archive becomes a path. Promises parts that are whole: a wrong check sum, more or less than the directory
//! states, or a ratio that no model reaches is a fault.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

use quick_xml::Reader;
use quick_xml::events::Event;
use zip::ZipArchive;
use zip::result::ZipError;

use super::super::lines::{self, place};
use super::xml::{attributes, refuse_dtd_and_encoding, text_of, xml_fault};
use terrace_core::diag::{Diag, Error, memory, unreadable};

/// Most bytes that one byte of the archive may stand for. Models reach 20; a stream of one byte repeated reaches 1032.
const MAX_RATIO: u64 = 500;
/// Most bytes of a part with relationships.
const MAX_RELATIONSHIPS: u64 = 16 << 20;

const AGAIN: &str = "export or copy the 3MF file again";

const MODEL: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
const PRINT_TICKET: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/printticket";

/// An open archive.
pub(super) struct Package<'a> {
    path: &'a Path,
    archive: ZipArchive<BufReader<File>>,
}

impl<'a> Package<'a> {
    pub(super) fn open(path: &'a Path) -> Result<Self, Error> {
        let (mut file, length) = lines::open(path)?;
        let mut head = Vec::with_capacity(8);
        file.by_ref().take(8).read_to_end(&mut head).map_err(|e| unreadable(path, &e))?;
        file.rewind().map_err(|e| unreadable(path, &e))?;
        if length == 0 {
            let d = Diag::input("surface-empty", "the file is empty").at(place(path));
            return Err(d.hint("export the surface again").into());
        }
        if !head.starts_with(b"PK") {
            let what = lines::foreign(&head).map_or("this is not a 3MF file".into(), |w| format!("this is {w}"));
            let d = Diag::input("surface-format", format!("{what}; a 3MF file is a ZIP archive")).at(place(path));
            return Err(d.hint("give the file the extension of its format, or export it as 3MF again").into());
        }
        let archive = ZipArchive::new(BufReader::new(file)).map_err(|e| damaged("the archive", &e).at(place(path)))?;
        Ok(Self { path, archive })
    }

    /// The name of the one model part that the package starts with.
    pub(super) fn root(&mut self) -> Result<String, Error> {
        let mut models = self.relationships("")?;
        models.retain(|r| r.kind == MODEL);
        match models.as_slice() {
            [one] => Ok(one.target.clone()),
            [] => Err(self.fault("3mf-part", "no relationship of the package names a 3D model".into()).into()),
            many => {
                let text = format!("the package names {} 3D models, it may start with one", many.len());
                Err(self.fault("3mf-part", text).into())
            }
        }
    }

    /// Checks the relationships of a model part: what they name is in the archive, and there is one print ticket.
    pub(super) fn check_relationships(&mut self, model: &str) -> Result<(), Error> {
        let tickets = self.relationships(model)?.iter().filter(|r| r.kind == PRINT_TICKET).count();
        if tickets > 1 {
            let text = format!("{model} has {tickets} print tickets, it may have one");
            return Err(self.fault("3mf-part", text).into());
        }
        Ok(())
    }

    fn fault(&self, code: &'static str, text: String) -> Diag {
        Diag::input(code, text).at(place(self.path)).hint(AGAIN)
    }

    /// The relationships of a part, or of the package (""): every target is in the archive.
    fn relationships(&mut self, source: &str) -> Result<Vec<Relationship>, Error> {
        let (folder, file) = source.rsplit_once('/').unwrap_or(("", source));
        let name = if folder.is_empty() { format!("_rels/{file}.rels") } else { format!("{folder}/_rels/{file}.rels") };
        if self.index(&name).is_none() {
            return Ok(Vec::new());
        }
        let mut found = self.part(&name, MAX_RELATIONSHIPS, relationships)?;
        for relationship in &mut found {
            let target = std::mem::take(&mut relationship.target);
            let Some(resolved) = resolve(folder, &target).filter(|_| !relationship.is_external) else {
                let text =
                    format!("{name} names \"{}\", which lies outside of the archive", lines::shown(target.as_bytes()));
                return Err(self.fault("3mf-part", text).into());
            };
            if self.index(&resolved).is_none() {
                let text = format!("{name} names \"{}\", which is not in the archive", lines::shown(target.as_bytes()));
                return Err(self.fault("3mf-part", text).into());
            }
            relationship.target = resolved;
        }
        Ok(found)
    }

    /// Where a part is in the archive; names differ by more than their case.
    fn index(&self, name: &str) -> Option<usize> {
        let alike = || self.archive.file_names_raw().position(|n| n.eq_ignore_ascii_case(name.as_bytes()));
        self.archive.index_for_name(name).or_else(alike)
    }

    /// The names of the parts that `is_wanted` accepts.
    pub(super) fn names(&self, is_wanted: impl Fn(&str) -> bool) -> Vec<String> {
        self.archive.file_names().flatten().filter(|name| is_wanted(name)).map(Into::into).collect()
    }

    /// The name that an absolute path in a model stands for.
    pub(super) fn named(&self, path: &str) -> Result<String, Diag> {
        let absolute = path.starts_with('/').then(|| resolve("", path)).flatten();
        absolute.filter(|name| self.index(name).is_some()).ok_or_else(|| {
            let text = format!("path \"{}\" is not a part of the archive", lines::shown(path.as_bytes()));
            self.fault("3mf-part", text)
        })
    }

    /// Reads a part of at most `most` bytes with `read`, to its end.
    pub(super) fn part<T>(
        &mut self,
        name: &str,
        most: u64,
        read: impl FnOnce(&mut dyn BufRead, &str) -> Result<T, Diag>,
    ) -> Result<T, Error> {
        let path = self.path;
        let index = self.index(name).ok_or_else(|| self.fault("3mf-part", format!("there is no part {name}")))?;
        let file = self.archive.by_index(index).map_err(|e| damaged(name, &e).at(place(path)))?;
        let size = file.size();
        let packed = file.compressed_size();
        if size > most || size / MAX_RATIO > packed {
            let text = format!("{name} has {size} bytes, packed in {packed}");
            let hint = format!("no model is packed {MAX_RATIO} to 1 or better: export it again");
            return Err(Diag::input("3mf-archive", text).at(place(path)).hint(hint).into());
        }
        // A vertex of 30 bytes takes 24, a triangle of 33 takes 12, and a facet of the mesh as below.
        memory::ask("the model", 2 * size).map_err(|d| d.at(place(path)))?;
        let mut input = BufReader::with_capacity(1 << 18, Declared { inner: file, left: size });
        let result = read(&mut input, name);
        // What is damaged reads as nonsense: the check sum at the end has the say.
        std::io::copy(&mut input, &mut std::io::sink()).map_err(|e| damaged(name, &ZipError::Io(e)).at(place(path)))?;
        result.map_err(|d| d.at(place(path)).into())
    }
}

/// A part that may have no more bytes than the directory states.
struct Declared<R> {
    inner: R,
    left: u64,
}

impl<R: Read> Read for Declared<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.left = self
            .left
            .checked_sub(count as u64)
            .ok_or_else(|| std::io::Error::other("it has more bytes than the directory of the archive states"))?;
        Ok(count)
    }
}

/// A relationship: its type and its target.
struct Relationship {
    kind: String,
    target: String,
    is_external: bool,
}

fn relationships(input: &mut dyn BufRead, name: &str) -> Result<Vec<Relationship>, Diag> {
    let mut reader = Reader::from_reader(input);
    reader.config_mut().expand_empty_elements = true;
    let mut buffer = Vec::new();
    let mut found = Vec::new();
    loop {
        buffer.clear();
        match reader.read_event_into(&mut buffer).map_err(|e| xml_fault(name, &e))? {
            Event::Start(e) if e.local_name().as_ref() == "Relationship" => {
                let [mut kind, mut target, mut mode] = [const { None }; 3];
                attributes(&e, name, |key, value| {
                    match key {
                        "Type" => kind = Some(text_of(value, name)?),
                        "Target" => target = Some(text_of(value, name)?),
                        "TargetMode" => mode = Some(text_of(value, name)?),
                        _ => {}
                    }
                    Ok(())
                })?;
                let (Some(kind), Some(target)) = (kind, target) else {
                    let text = format!("{name}: a relationship has no Type or no Target");
                    return Err(Diag::input("3mf-part", text).hint(AGAIN));
                };
                found.push(Relationship { kind, target, is_external: mode.is_some_and(|m| m == "External") });
            }
            Event::Eof => return Ok(found),
            event => refuse_dtd_and_encoding(&event, name)?,
        }
    }
}

/// The name of a part, from the folder of its source; None where it lies outside of the archive.
fn resolve(folder: &str, target: &str) -> Option<String> {
    let whole = match target.strip_prefix('/') {
        Some(absolute) => absolute.to_owned(),
        None => format!("{folder}/{target}"),
    };
    let mut names: Vec<&str> = Vec::new();
    for name in whole.split('/') {
        match name {
            "" | "." => {}
            ".." => {
                names.pop()?;
            }
            name if name.contains([':', '\\']) => return None,
            name => names.push(name),
        }
    }
    (!names.is_empty()).then(|| names.join("/"))
}

/// The diagnostic for what the archive does not give.
fn damaged(what: &str, e: &ZipError) -> Diag {
    let (text, hint) = match e {
        ZipError::CompressionMethodNotSupported(method) => {
            (format!("{what} is packed by method {method}; stored and deflated parts are read"), "export it again")
        }
        ZipError::UnsupportedArchive(why) => (format!("{what} is not read: {why}"), "export it again, unencrypted"),
        ZipError::InvalidPassword => (format!("{what} is encrypted"), "export it again, unencrypted"),
        e => (format!("{what} is damaged: {e}"), AGAIN),
    };
    Diag::input("3mf-archive", text).hint(hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_stay_in_the_archive() {
        for (folder, target, want) in [
            ("", "/3D/a.model", Some("3D/a.model")),
            ("3D", "b.model", Some("3D/b.model")),
            ("3D", "../Metadata/t.png", Some("Metadata/t.png")),
            ("", "3D//./a.model", Some("3D/a.model")),
            ("", "/../../etc/passwd", None),
            ("3D", "../../x", None),
            ("3D", "C:/x", None),
            ("", "http://example.org/x", None),
            ("", "..\\x", None),
            ("", "/", None),
        ] {
            assert_eq!(resolve(folder, target).as_deref(), want, "{target}");
        }
    }
}
