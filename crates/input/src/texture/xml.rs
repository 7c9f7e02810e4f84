//! From the bytes of a drawing to text that is safe to parse.
//!
//! Understands UTF-8, UTF-16 with a byte order mark, declared Latin-1, and gzip (svgz). Refuses what would only cost
//! time or memory further on: large files, bombs, endless nesting, and entities that hold markup, name other files or
//! expand to more than [`MAX_EXPANDED`].

use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

use quick_xml::Reader;
use quick_xml::events::Event;

use super::foreign;
use terrace_core::diag::{self, Diag, Error, Place};

/// Largest drawing after unpacking an svgz.
const MAX_UNPACKED: u64 = 64 << 20;

/// Deepest nesting of elements; drawings made by programs stay below 50.
pub(super) const MAX_DEPTH: usize = 256;

/// Most attributes of one element: the XML parser compares each with all others.
const MAX_ATTRIBUTES: usize = 2000;

/// Whether a file begins as XML does.
pub(super) fn is_xml(bytes: &[u8]) -> bool {
    bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'<')
}

/// The text of a drawing, checked.
///
/// # Errors
/// `svg-…` where it is not text, or not one that is safe to parse.
pub(super) fn text(mut bytes: Vec<u8>, path: &Path) -> Result<String, Error> {
    let place = Place::file(path.display().to_string());
    if bytes.starts_with(&[0x1f, 0x8b]) {
        bytes = unpacked(&bytes).map_err(|d| d.at(place.clone()))?;
    }
    if let Some(d) = foreign::text(&bytes).or_else(|| foreign::name(path).filter(|_| !is_xml(&bytes))) {
        return Err(d.at(place).into());
    }
    let text = decoded(bytes).map_err(|d| d.at(place))?;
    check(&text).map_err(|f| {
        let line = diag::line_and_column(&text, f.at).0;
        f.diag.at(Place::line(path.display().to_string(), line))
    })?;
    Ok(text)
}

fn unpacked(bytes: &[u8]) -> Result<Vec<u8>, Box<Diag>> {
    let mut out = Vec::new();
    let mut unpacker = flate2::read::MultiGzDecoder::new(bytes).take(MAX_UNPACKED + 1);
    unpacker.read_to_end(&mut out).map_err(|e| {
        Diag::input("svg-gzip", format!("the compressed drawing is damaged: {e}")).hint("save it again, uncompressed")
    })?;
    if out.len() as u64 > MAX_UNPACKED {
        let text = format!("the drawing unpacks to more than {} MB", MAX_UNPACKED >> 20);
        return Err(Diag::input("svg-large", text).hint("save it uncompressed and simpler").into());
    }
    Ok(out)
}

fn decoded(bytes: Vec<u8>) -> Result<String, Box<Diag>> {
    let fault = |what: &str| {
        Diag::input("svg-encoding", format!("the drawing is not {what} text")).hint("save it as plain SVG in UTF-8")
    };
    let wide: Option<fn([u8; 2]) -> u16> = match bytes.as_slice() {
        [0xff, 0xfe, ..] => Some(u16::from_le_bytes),
        [0xfe, 0xff, ..] => Some(u16::from_be_bytes),
        _ => None,
    };
    if let Some(unit) = wide {
        let units = bytes[2..].chunks_exact(2).map(|c| unit([c[0], c[1]]));
        return char::decode_utf16(units).collect::<Result<_, _>>().map_err(|_| fault("UTF-16").into());
    }
    match String::from_utf8(bytes) {
        Ok(mut text) => {
            if text.starts_with('\u{feff}') {
                text.remove(0);
            }
            Ok(text)
        }
        Err(e) if is_declared_latin1(e.as_bytes()) => Ok(e.as_bytes().iter().map(|&b| char::from(b)).collect()),
        Err(_) => Err(fault("UTF-8").into()),
    }
}

fn is_declared_latin1(bytes: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).to_ascii_lowercase();
    let declaration = head.split("?>").next().unwrap_or_default();
    declaration.starts_with("<?xml") && (declaration.contains("iso-8859-1") || declaration.contains("latin1"))
}

/// Most bytes that the entities of a drawing make.
const MAX_EXPANDED: usize = 1 << 20;

/// Deepest reference from entity to entity; the XML parser expands ten levels.
const MAX_ENTITY_DEPTH: usize = 8;

/// The entities that a drawing declares: name and text.
type Entities<'a> = HashMap<&'a str, &'a str>;

/// A refused declaration of an entity at a byte of the text; `what` follows the word entity.
fn entity_fault(what: &str, at: usize) -> Box<XmlFault> {
    let diag = Diag::input("svg-dtd", format!("the drawing declares an XML entity {what}, which is not read"))
        .hint("save it as plain SVG, without a document type");
    Box::new(XmlFault { diag, at })
}

/// Reads the declarations of entities, and says where they end; refuses those that hold markup or name other files.
fn entities(text: &str) -> Result<(Entities<'_>, usize), Box<XmlFault>> {
    let mut all = Entities::new();
    let mut at = 0;
    while let Some(start) = text[at..].find(ENTITY).map(|i| at + i) {
        let fault = |what: &str| entity_fault(what, start);
        let rest = text[start + ENTITY.len()..].trim_start();
        let Some((name, rest)) = rest.split_once(char::is_whitespace) else { return Err(fault("without a value")) };
        let rest = rest.trim_start();
        if name == "%" {
            return Err(fault("of parameters"));
        }
        let Some(quote) = rest.chars().next().filter(|c| matches!(c, '"' | '\'')) else {
            return Err(fault("that stands in another file"));
        };
        let Some((value, after)) = rest[1..].split_once(quote) else { return Err(fault("without an end")) };
        if value.contains('<') || value.contains("&#") {
            return Err(fault("with markup"));
        }
        // The first of several counts (XML 1.0, 4.2).
        all.entry(name).or_insert(value);
        at = text.len() - after.len();
    }
    Ok((all, at))
}

const ENTITY: &str = "<!ENTITY";

/// How many bytes a text has once its entities are put in; None where there are more than [`MAX_EXPANDED`] or they
/// refer to each other too deep.
fn expanded(text: &str, all: &Entities<'_>, depth: usize) -> Option<usize> {
    let mut bytes = text.len();
    for reference in text.split('&').skip(1) {
        let Some(value) = reference.split_once(';').and_then(|(name, _)| all.get(name)) else { continue };
        if depth == 0 {
            return None;
        }
        bytes += expanded(value, all, depth - 1)?;
        if bytes > text.len() + MAX_EXPANDED {
            return None;
        }
    }
    Some(bytes)
}

/// Refuses entities that could take any time and memory.
fn check_entities(text: &str) -> Result<(), Box<XmlFault>> {
    let Some(at) = text.find(ENTITY) else { return Ok(()) };
    let (all, end) = entities(text)?;
    // Each once, so that what is used often is bounded before it is gone through often.
    let mut sizes = HashMap::new();
    for (name, value) in &all {
        let size = expanded(value, &all, MAX_ENTITY_DEPTH - 1);
        sizes.insert(*name, size);
    }
    let references =
        text[end..].split('&').skip(1).filter_map(|r| r.split_once(';')).filter_map(|(name, _)| sizes.get(name));
    let total = references.copied().try_fold(0usize, |sum, size| Some(sum + size?)).filter(|sum| *sum <= MAX_EXPANDED);
    match total {
        Some(_) => Ok(()),
        None => {
            let text = format!(
                "the entities of the drawing expand to more than {} MB, or refer to each other in a circle",
                MAX_EXPANDED >> 20
            );
            let d = Diag::input("svg-dtd", text).hint("save it as plain SVG, without a document type");
            Err(XmlFault { diag: d, at }.into())
        }
    }
}

/// A fault at a byte of the text.
struct XmlFault {
    diag: Diag,
    at: usize,
}

/// Reads tags without building anything.
fn check(text: &str) -> Result<(), Box<XmlFault>> {
    check_entities(text)?;
    let mut reader = Reader::from_str(text);
    reader.config_mut().check_end_names = false;
    reader.config_mut().allow_unmatched_ends = true;
    let mut depth = 0usize;
    loop {
        let at = usize::try_from(reader.buffer_position()).unwrap_or(text.len());
        let fault = |diag: Diag| Box::new(XmlFault { diag, at });
        let tag = match reader.read_event() {
            Ok(Event::Start(tag)) => {
                depth += 1;
                tag
            }
            Ok(Event::Empty(tag)) => tag,
            Ok(Event::End(_)) => {
                depth = depth.saturating_sub(1);
                continue;
            }
            Ok(Event::Eof) => return Ok(()),
            Ok(_) => continue,
            Err(e) => {
                let d = Diag::input("svg-xml", format!("the drawing is not well-formed XML: {e}"));
                return Err(fault(d.hint("save it again as plain SVG")));
            }
        };
        if depth > MAX_DEPTH {
            let text = format!("the drawing nests elements deeper than {MAX_DEPTH}");
            return Err(fault(Diag::input("svg-deep", text).hint("ungroup the drawing")));
        }
        if tag.attributes().with_checks(false).take(MAX_ATTRIBUTES + 1).count() > MAX_ATTRIBUTES {
            let text = format!("an element has more than {MAX_ATTRIBUTES} attributes");
            return Err(fault(Diag::input("svg-large", text).hint("save it as plain SVG")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_counter_ignores_tags_in_comments_and_cdata() {
        let open = "<g a='>' b=\"/>\"><!-- <g><g> --><![CDATA[<g>]]><p/><p a='1'/>";
        let nested = |n: usize| open.repeat(n) + &"</g>".repeat(n);
        assert!(check(&nested(MAX_DEPTH)).is_ok());
        assert!(check(&nested(MAX_DEPTH + 1)).is_err());
        assert!(check(&"<g></g>".repeat(10 * MAX_DEPTH)).is_ok());
    }

    #[test]
    fn encodings_give_the_same_text() {
        let text = "<?xml version='1.0' encoding='ISO-8859-1'?><svg id='é'/>";
        let latin1: Vec<u8> = text.chars().map(|c| c as u8).collect();
        let utf16: Vec<u8> = std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect();
        let bom = [&[0xef, 0xbb, 0xbf], text.as_bytes()].concat();
        for bytes in [latin1, utf16, bom, text.into()] {
            assert_eq!(decoded(bytes).as_deref(), Ok(text));
        }
        assert!(decoded(b"<svg id='\xe9'/>".to_vec()).is_err(), "undeclared Latin-1");
    }

    #[test]
    fn entities_are_bounded() {
        let of = |declared: &str, body: &str| check_entities(&format!("<!DOCTYPE svg [{declared}]><svg>{body}</svg>"));
        assert!(of("<!ENTITY ns \"http://x\"> <!ENTITY b '&ns;/&ns;'>", "&b; &amp; &other;").is_ok());
        for (declared, body) in [
            ("<!ENTITY a '&a;'>", "&a;"),
            ("<!ENTITY a '&b;'><!ENTITY b '&a;'>", "&a;"),
            ("<!ENTITY a '<g/>'>", ""),
            ("<!ENTITY a SYSTEM 'file:///x'>", ""),
            ("<!ENTITY % a 'x'>", ""),
            ("<!ENTITY a 'x", ""),
        ] {
            assert!(of(declared, body).is_err(), "{declared}");
        }
        let tenfold: String =
            (1..8).map(|i| format!("<!ENTITY e{i} '{}'>", format!("&e{};", i - 1).repeat(10))).collect();
        assert!(of(&format!("<!ENTITY e0 'lol'>{tenfold}"), "&e3;").is_ok());
        assert!(of(&format!("<!ENTITY e0 'lol'>{tenfold}"), "&e7;").is_err());
        let long = format!("<!ENTITY a '{}'>", "x".repeat(20_000));
        assert!(of(&long, &"&a;".repeat(40)).is_ok());
        assert!(of(&long, &"&a;".repeat(60)).is_err());
    }
}
