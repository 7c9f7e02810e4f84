//! From the bytes of a file to its tags: a group code and a value each, from text or from the two binary forms.
//!
//! Text has two lines a tag; numbers are parsed where they are used, so what is not read costs nothing. Binary files
//! start with a fixed mark; group codes are one byte in files of R12 and two bytes after it. Values point into the
//! file's bytes.

use std::borrow::Cow;
use std::str::FromStr;

use terrace_core::diag::{Diag, Place};

/// How a binary file begins.
const BINARY: &[u8] = b"AutoCAD Binary DXF\r\n\x1a\0";

/// Most characters of a name or value that messages and labels show.
const MAX_NAME: usize = 255;

pub(super) type Fault = Box<Diag>;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TagValue<'a> {
    Text(&'a [u8]),
    Real(f64),
    Whole(i64),
}

/// A group code and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tag<'a> {
    pub(super) code: i32,
    pub(super) value: TagValue<'a>,
    /// Where its value stands.
    pub(super) at: TagPlace,
}

/// A place in the file: a line of text, from 1, or a byte of a binary file, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TagPlace {
    Line(u32),
    Byte(u32),
}

impl std::fmt::Display for TagPlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}"),
            Self::Byte(n) => write!(f, "byte {n}"),
        }
    }
}

impl TagPlace {
    /// An error at this place. The name of the file is added by the caller of the reader.
    pub(super) fn fault(self, code: &'static str, text: &str) -> Diag {
        match self {
            Self::Line(n) => Diag::input(code, text).at(Place::line("", n as usize)),
            Self::Byte(n) => Diag::input(code, format!("{text} (at byte {n})")),
        }
    }
}

impl<'a> Tag<'a> {
    /// The value as a finite number.
    ///
    /// # Errors
    /// `dxf-number`.
    pub(super) fn real(&self) -> Result<f64, Fault> {
        let number = match self.value {
            TagValue::Real(x) => Some(x),
            TagValue::Whole(i) => Some(i as f64),
            TagValue::Text(text) => parsed::<f64>(text),
        };
        number.filter(|x| x.is_finite()).ok_or_else(|| self.no_number())
    }

    /// The value as a whole number; text such as `1.0` counts as one.
    ///
    /// # Errors
    /// `dxf-number`.
    pub(super) fn whole(&self) -> Result<i64, Fault> {
        let number = match self.value {
            TagValue::Whole(i) => Some(i),
            TagValue::Real(x) => Some(x as i64),
            TagValue::Text(text) => parsed::<i64>(text)
                .or_else(|| parsed::<f64>(text).filter(|x| x.is_finite() && x.fract() == 0.0).map(|x| x as i64)),
        };
        number.ok_or_else(|| self.no_number())
    }

    /// The value as bytes without blanks around it.
    pub(super) fn bytes(&self) -> &'a [u8] {
        match self.value {
            TagValue::Text(text) => text.trim_ascii(),
            _ => b"",
        }
    }

    /// The value as text without blanks around it. What is not UTF-8 is taken as Latin-1: names of layers then stay
    /// apart, whatever the code page.
    pub(super) fn text(&self) -> String {
        let text = match std::str::from_utf8(self.bytes()) {
            Ok(text) => Cow::Borrowed(text),
            Err(_) => self.bytes().iter().map(|&b| char::from(b)).collect(),
        };
        unescaped(&text).chars().filter(|c| !c.is_control()).take(MAX_NAME).collect()
    }

    fn no_number(&self) -> Fault {
        let value = match self.value {
            TagValue::Text(_) => format!("{:?}", self.text().chars().take(40).collect::<String>()),
            TagValue::Real(x) => x.to_string(),
            TagValue::Whole(i) => i.to_string(),
        };
        let text = format!("group {} has the value {value}, which is not a finite number", self.code);
        self.at
            .fault("dxf-number", &text)
            .hint("numbers have a decimal point, not a comma; export the drawing again")
            .into()
    }
}

fn parsed<T: FromStr>(text: &[u8]) -> Option<T> {
    std::str::from_utf8(text).ok()?.trim().parse().ok()
}

/// Text in which `\U+00E9` and the like are characters.
fn unescaped(text: &str) -> Cow<'_, str> {
    if !text.contains("\\U+") {
        return text.into();
    }
    let mut parts = text.split("\\U+");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let char = part.get(..4).and_then(|hex| char::from_u32(u32::from_str_radix(hex, 16).ok()?));
        match char {
            Some(c) => {
                out.push(c);
                out.push_str(&part[4..]);
            }
            None => {
                out.push_str("\\U+");
                out.push_str(part);
            }
        }
    }
    out.into()
}

/// The tags of a file, one after the other.
pub(super) struct Tags<'a> {
    bytes: &'a [u8],
    /// Where the next tag begins.
    pos: usize,
    /// The number of lines before it.
    line: u32,
    form: FileForm,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FileForm {
    /// Lines that end in this byte.
    Text(u8),
    /// Group codes of one byte.
    R12,
    /// Group codes of two bytes.
    R13,
}

impl<'a> Tags<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        if let Some(data) = bytes.strip_prefix(BINARY) {
            // The first group code is 0, and the text after it is not empty.
            let form = if data.starts_with(&[0, 0]) { FileForm::R13 } else { FileForm::R12 };
            return Self { bytes, pos: BINARY.len(), line: 0, form };
        }
        let start = if bytes.starts_with(&[0xef, 0xbb, 0xbf]) { 3 } else { 0 };
        let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
        Self { bytes, pos: start, line: 0, form: FileForm::Text(end) }
    }

    /// The next tag; None at the end of the file.
    ///
    /// # Errors
    /// `dxf-syntax` where there is no group code, or no value after it.
    pub(super) fn next(&mut self) -> Result<Option<Tag<'a>>, Fault> {
        match self.form {
            FileForm::Text(end) => self.text_tag(end),
            FileForm::R12 | FileForm::R13 => self.binary_tag(),
        }
    }

    fn text_tag(&mut self, end: u8) -> Result<Option<Tag<'a>>, Fault> {
        let Some(line) = self.line(end) else { return Ok(None) };
        let at = TagPlace::Line(self.line);
        let Some(code) = parsed::<i32>(line).filter(|c| (-9999..=9999).contains(c)) else {
            let rest = self.bytes.get(self.pos..).unwrap_or_default();
            if line.trim_ascii().is_empty() && rest.trim_ascii().is_empty() {
                return Ok(None);
            }
            let line = Tag { code: 0, value: TagValue::Text(line), at };
            let shown: String = line.text().chars().take(40).collect();
            return Err(at
                .fault("dxf-syntax", &format!("{shown:?} stands where a group code, a whole number, is expected"))
                .hint(EXPORT)
                .into());
        };
        let Some(value) = self.line(end) else {
            return Err(at
                .fault("dxf-syntax", &format!("the file ends after the group code {code}"))
                .hint(EXPORT)
                .into());
        };
        Ok(Some(Tag { code, value: TagValue::Text(value), at: TagPlace::Line(self.line) }))
    }

    fn line(&mut self, end: u8) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.pos..).filter(|rest| !rest.is_empty())?;
        let len = rest.iter().position(|&b| b == end).unwrap_or(rest.len());
        self.pos += len + 1;
        self.line = self.line.saturating_add(1);
        let line = &rest[..len];
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }

    fn binary_tag(&mut self) -> Result<Option<Tag<'a>>, Fault> {
        if self.pos >= self.bytes.len() {
            return Ok(None);
        }
        let at = TagPlace::Byte(u32::try_from(self.pos).unwrap_or(u32::MAX));
        let cut = || -> Fault { at.fault("dxf-syntax", "the file ends within a tag").hint(EXPORT).into() };
        let code = self.binary_code().ok_or_else(cut)?;
        let value = match code {
            0..=9
            | 100..=109
            | 300..=309
            | 320..=369
            | 390..=399
            | 410..=419
            | 430..=439
            | 470..=489
            | 999
            | 1000..=1003
            | 1005..=1009 => self.binary_text().map(TagValue::Text),
            10..=59 | 110..=149 | 210..=239 | 460..=469 | 1010..=1059 => {
                self.take().map(|b| TagValue::Real(f64::from_le_bytes(b)))
            }
            60..=79 | 170..=179 | 270..=289 | 370..=389 | 400..=409 | 1060..=1070 => {
                self.take().map(|b| TagValue::Whole(i16::from_le_bytes(b).into()))
            }
            90..=99 | 420..=429 | 440..=459 | 1071 => {
                self.take().map(|b| TagValue::Whole(i32::from_le_bytes(b).into()))
            }
            160..=169 => self.take().map(|b| TagValue::Whole(i64::from_le_bytes(b))),
            290..=299 => self.take().map(|[b]| TagValue::Whole(b.into())),
            310..=319 | 1004 => self.binary_chunk().map(TagValue::Text),
            _ => {
                let text = format!("{code} stands where a group code is expected");
                return Err(at.fault("dxf-syntax", &text).hint(EXPORT).into());
            }
        };
        Ok(Some(Tag { code, value: value.ok_or_else(cut)?, at }))
    }

    fn binary_code(&mut self) -> Option<i32> {
        if self.form == FileForm::R13 {
            return self.take().map(|b| i16::from_le_bytes(b).into());
        }
        match self.take::<1>()? {
            [255] => self.take().map(|b| i16::from_le_bytes(b).into()),
            [code] => Some(code.into()),
        }
    }

    fn binary_text(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.pos..];
        let len = rest.iter().position(|&b| b == 0)?;
        self.pos += len + 1;
        Some(&rest[..len])
    }

    fn binary_chunk(&mut self) -> Option<&'a [u8]> {
        let [len] = self.take::<1>()?;
        let chunk = self.bytes.get(self.pos..self.pos + usize::from(len))?;
        self.pos += chunk.len();
        Some(chunk)
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let taken = self.bytes.get(self.pos..self.pos + N)?;
        self.pos += N;
        taken.try_into().ok()
    }
}

/// What helps where the file itself is damaged.
pub(super) const EXPORT: &str = "save the drawing again as DXF (R12, 2000 or later, as text)";
