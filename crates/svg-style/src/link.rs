//! Links: `url()` and `href`.

use std::borrow::Cow;
use std::sync::Arc;

use roxmltree::Node;

const XLINK: &str = "http://www.w3.org/1999/xlink";

/// What a link refers to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Link {
    /// The element of this id in the drawing itself.
    Local(Arc<str>),
    /// Something in another file.
    External,
}

impl Link {
    pub(crate) fn new(text: &str) -> Self {
        local(text).map_or(Self::External, |id| Self::Local(id.as_ref().into()))
    }
}

/// The id that the text of a link refers to in the drawing itself, with its `%20` and the like decoded; None where it
/// refers to another file.
pub fn local(link: &str) -> Option<Cow<'_, str>> {
    let id = link.trim().strip_prefix('#')?;
    if !id.contains('%') {
        return Some(Cow::Borrowed(id));
    }
    let bytes = id.as_bytes();
    let (mut out, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let code = (bytes[at] == b'%').then(|| id.get(at + 1..at + 3)).flatten();
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                at += 3;
            }
            None => {
                out.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8(out).ok().map(Cow::Owned)
}

/// What an element refers to; `href` wins over `xlink:href`.
pub fn href<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    let named = |ns: Option<&str>| node.attributes().find(|a| a.name() == "href" && a.namespace() == ns);
    named(None).or_else(|| named(Some(XLINK))).map(|a| a.value().trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_decoded() {
        assert_eq!(local("#a").as_deref(), Some("a"));
        assert_eq!(local(" #a%20b%C3%A9%zz").as_deref(), Some("a bé%zz"));
        assert_eq!(local("x.svg#a"), None);
    }
}
