//! `explain`: what a message means, as docs/reference/errors.md says. The document is part of the program.

use serde_json::{Value, json};

use terrace_core::diag::{Diag, Error, edits};

const ERRORS: &str = include_str!("../../docs/reference/errors.md");

/// Codes named where the one asked for does not exist.
const NEAREST: usize = 5;

/// What the document says of one code.
#[derive(Clone, Copy)]
pub struct Section {
    pub code: &'static str,
    /// "input", or several as in "input, warning".
    kinds: &'static str,
    body: &'static str,
}

/// Every code, in the order of the document.
pub fn sections() -> impl Iterator<Item = Section> {
    // A section ends where the next one or the next chapter begins.
    let parts = ERRORS.split("\n### ").skip(1).map(|part| part.split("\n## ").next().unwrap_or(part));
    parts.filter_map(|part| {
        let (code, rest) = part.split_once('\n')?;
        let (kinds, body) = rest.trim().strip_prefix('*')?.split_once(".*")?;
        Some(Section { code: code.trim(), kinds, body: body.trim() })
    })
}

/// The section of a code, which may be pasted with the brackets around it: `error[toml]`.
///
/// # Errors
/// `code-unknown` with the nearest codes.
pub fn find(asked: &str) -> Result<Section, Error> {
    let code = asked.split_once('[').map_or(asked, |(_, rest)| rest.split(']').next().unwrap_or(rest));
    let code = code.trim().to_lowercase();
    sections().find(|section| section.code == code).ok_or_else(|| {
        let near = nearest(&code);
        let hint = match near.as_slice() {
            [] => "the code of a message stands in brackets after its first word, as in error[toml]".to_owned(),
            near => format!("the nearest codes are {}", near.join(", ")),
        };
        Diag::input("code-unknown", format!("no message has the code {code:?}")).hint(hint).into()
    })
}

/// Codes that differ from `asked` in a third of its characters at most or share a word with it, the nearest first.
fn nearest(asked: &str) -> Vec<&'static str> {
    let words = |code: &str| code.split('-').filter(|word| word.len() > 2).map(str::to_owned).collect::<Vec<_>>();
    let wanted = words(asked);
    let mut near: Vec<(usize, &str)> = sections()
        .filter_map(|section| {
            let distance = edits(asked, section.code);
            let is_near = distance * 3 <= asked.len().max(3);
            let is_kin = words(section.code).iter().any(|word| wanted.contains(word));
            (is_near || is_kin).then_some((distance, section.code))
        })
        .collect();
    near.sort();
    near.truncate(NEAREST);
    near.into_iter().map(|(_, code)| code).collect()
}

impl Section {
    /// As a person reads it: code, kind, exit code, and the text without the targets of its links.
    pub fn text(self) -> String {
        let exits: Vec<&str> = self.kinds.split(", ").map(exit).collect();
        format!("{}: {}, exit code {}\n\n{}\n", self.code, self.kinds, exits.join(" or "), without_links(self.body))
    }

    pub fn json(self) -> Value {
        let kinds: Vec<&str> = self.kinds.split(", ").collect();
        json!({"code": self.code, "kinds": kinds, "text": without_links(self.body)})
    }
}

/// The exit code of a kind, as the document's first table says.
fn exit(kind: &str) -> &'static str {
    match kind {
        "warning" => "0",
        "limit" => "1",
        "input" => "2",
        _ => "3",
    }
}

/// A text of the document with `[words](target)` as the words alone.
fn without_links(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("](") {
        match (before.rsplit_once('['), after.split_once(')')) {
            (Some((head, words)), Some((_, tail))) => {
                out += head;
                out += words;
                rest = tail;
            }
            _ => {
                out += before;
                out += "](";
                rest = after;
            }
        }
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_section_has_a_known_kind_and_a_text_without_links() {
        assert_eq!(sections().count(), ERRORS.matches("\n### ").count());
        for section in sections() {
            assert!(section.kinds.split(", ").all(|k| ["warning", "limit", "input", "bug"].contains(&k)));
            let text = section.text();
            assert!(text.starts_with(section.code) && !text.contains("](") && !text.contains("\n#"), "{text}");
        }
    }

    #[test]
    fn a_code_is_found_as_typed_or_as_pasted() {
        for asked in ["travel", "Travel", "error[travel]", "error[travel]: x would have", "[travel]", " travel\n"] {
            assert_eq!(find(asked).map(|section| section.code), Ok("travel"), "{asked}");
        }
        let hint = |asked: &str| find(asked).err().map(|e| e.diags()[0].hint.clone()).unwrap_or_default();
        assert!(hint("travle").contains("are travel"), "{}", hint("travle"));
        assert!(hint("facet-steep").contains("steep"), "{}", hint("facet-steep"));
        assert!(hint("qqqqqqqqqq").contains("brackets"), "{}", hint("qqqqqqqqqq"));
        assert!(hint("").contains("brackets"), "{}", hint(""));
    }

    #[test]
    fn links_leave_their_words() {
        let cases = [("see [a.md](a.md#b), [c](d)", "see a.md, c"), ("`x[1](2`", "`x[1](2`"), ("plain", "plain")];
        for (text, wanted) in cases {
            assert_eq!(without_links(text), wanted);
        }
    }
}
