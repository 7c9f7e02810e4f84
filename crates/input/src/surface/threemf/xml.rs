//! What all XML parts of a 3MF file have in common: attributes, values, and what is refused in any of them.

use quick_xml::events::{BytesStart, Event};

use super::super::lines::shown;
use terrace_core::diag::Diag;

const AGAIN: &str = "export the surface again as 3MF or STL";

/// Hands the names and raw values of all attributes to `take`.
pub(super) fn attributes(
    e: &BytesStart<'_>,
    name: &str,
    mut take: impl FnMut(&str, &str) -> Result<(), Diag>,
) -> Result<(), Diag> {
    // Without the reader's own search for names that are there twice, whose time grows with the square of their number.
    for attribute in e.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| xml_fault(name, &e.into()))?;
        let key = attribute.key.as_ref();
        if key == "xml:space" {
            return Err(Diag::input("3mf-xml", format!("{name}: xml:space is not allowed in 3MF")).hint(AGAIN));
        }
        take(key, &attribute.value)?;
    }
    Ok(())
}

/// A raw value as text.
pub(super) fn text_of(value: &str, name: &str) -> Result<String, Diag> {
    let text = quick_xml::escape::unescape(value).map_err(|e| xml_fault(name, &e.into()))?;
    Ok(text.trim().to_owned())
}

/// Refuses a document type and every encoding but UTF-8; other events pass. `name` is that of the part of the package.
pub(super) fn refuse_dtd_and_encoding(event: &Event<'_>, name: &str) -> Result<(), Diag> {
    match event {
        Event::DocType(_) => {
            Err(Diag::input("3mf-xml", format!("{name}: a document type (DTD) is not allowed in 3MF"))
                .hint("remove it: entities are not expanded"))
        }
        Event::Decl(decl) => match decl.encoding() {
            Some(Ok(encoding)) if !encoding.eq_ignore_ascii_case("utf-8") => {
                let text = format!("{name}: encoding {} is not supported", shown(encoding.as_bytes()));
                Err(Diag::input("3mf-xml", text).hint("save it as UTF-8"))
            }
            Some(Err(e)) => Err(xml_fault(name, &e.into())),
            // UTF-8 is stated, or nothing is, which means UTF-8.
            _ => Ok(()),
        },
        _ => Ok(()),
    }
}

pub(super) fn xml_fault(name: &str, e: &quick_xml::Error) -> Diag {
    Diag::input("3mf-xml", format!("{name} is not well-formed XML: {e}")).hint(AGAIN)
}
