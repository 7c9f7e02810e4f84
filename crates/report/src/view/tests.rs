//! Properties of the page's text.

use super::*;

#[test]
fn the_page_has_every_place_once_and_what_is_put_in_is_not_looked_at_again() {
    for key in ["{{title}}", "{{css}}", "{{head}}", "{{data}}", "{{js}}"] {
        assert_eq!(PAGE.matches(key).count(), 1, "{key}");
    }
    let values = [("{{title}}", "{{js}} of it"), ("{{css}}", ""), ("{{head}}", ""), ("{{data}}", ""), ("{{js}}", "J")];
    let text = filled(PAGE, &values);
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

#[test]
fn scripts_are_those_whose_types_are_checked_in_their_order() {
    let config: serde_json::Value = serde_json::from_str(include_str!("page/tsconfig.json")).expect("JSON");
    let named = config["files"].as_array().expect("files");
    let text = |name: &serde_json::Value| {
        let path =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/view/page").join(name.as_str().expect("a name"));
        std::fs::read_to_string(path).expect("a script")
    };
    assert_eq!(named.iter().map(text).collect::<Vec<_>>(), SCRIPTS);
}

#[test]
fn a_page_of_two_views_has_names_and_addresses_of_both_and_loads_nothing_else() {
    let names = ["before <1>.job", "after.job"].map(str::to_owned);
    let views = ["before%20%3C1%3E.job/view.html", "../after.job/view.html"].map(str::to_owned);
    let text = side_by_side(&names, &views);
    assert!(text.contains("before &lt;1&gt;.job") && !text.contains("<1>") && !text.contains("{{"), "{text}");
    let loaded: Vec<&str> = text.split("src=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert_eq!(loaded, views);
}
