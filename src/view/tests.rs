//! Properties of the page's text.

use super::*;

#[test]
fn the_page_has_every_place_once_and_what_is_put_in_is_not_looked_at_again() {
    for key in ["{{title}}", "{{css}}", "{{head}}", "{{data}}", "{{js}}"] {
        assert_eq!(PAGE.matches(key).count(), 1, "{key}");
    }
    let text =
        filled(&[("{{title}}", "{{js}} of it"), ("{{css}}", ""), ("{{head}}", ""), ("{{data}}", ""), ("{{js}}", "J")]);
    assert!(text.contains("{{js}} of it"), "{text}");
    assert_eq!(text.matches("{{").count(), 1 + text.matches("{{js}} of it").count() - 1);
}

#[test]
fn nothing_of_the_page_is_loaded_from_elsewhere() {
    let whole = [PAGE, CSS, &SCRIPTS.concat()].concat();
    for word in ["http:", "https:", "fetch(", "XMLHttpRequest", "import(", "@import", "WebSocket", "src=", "url("] {
        let found: Vec<&str> =
            whole.match_indices(word).map(|(at, _)| &whole[at..(at + 60).min(whole.len())]).collect();
        // The name space of SVG is a name, not an address.
        let loads = found.iter().filter(|t| !t.starts_with("http://www.w3.org/")).count();
        assert_eq!(loads, 0, "{word}: {found:?}");
    }
}
