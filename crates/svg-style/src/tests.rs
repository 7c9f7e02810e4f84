use super::*;

/// Computes the styles of a drawing from the root down, and shows what `show` tells of every `path`.
fn shown<T>(xml: &str, show: impl Fn(&Style) -> T) -> Vec<T> {
    let doc = Document::parse(xml).expect("well-formed");
    let mut cascade = Cascade::new(&doc).expect("bounded");
    let mut out = Vec::new();
    descend(&mut cascade, doc.root_element(), &Arc::new(Style::initial()), &mut |node, style| {
        if node.has_tag_name("path") || node.tag_name().name() == "path" {
            out.push(show(style));
        }
    });
    out
}

fn descend(cascade: &mut Cascade, node: Node<'_, '_>, parent: &Arc<Style>, see: &mut dyn FnMut(Node<'_, '_>, &Style)) {
    let (style, _) = cascade.style(node, parent, None).expect("bounded");
    see(node, &style);
    node.children().filter(Node::is_element).for_each(|child| descend(cascade, child, &style, see));
}

/// The fill of the only path, as `#rrggbb`, `none` or `url`.
fn fill(xml: &str) -> String {
    let of = |style: &Style| match &style.fill {
        Paint::None => "none".to_owned(),
        Paint::Colour(colour) => {
            let Rgba { rgb: [r, g, b], alpha } = colour.resolved(style.current());
            if alpha < 1.0 { format!("#{r:02x}{g:02x}{b:02x}/{alpha:.2}") } else { format!("#{r:02x}{g:02x}{b:02x}") }
        }
        Paint::ContextFill | Paint::ContextStroke => "context".to_owned(),
        Paint::Server(..) => "url".to_owned(),
    };
    shown(xml, of).pop().expect("a path")
}

const RED: &str = "#ff0000";
const BLUE: &str = "#0000ff";

#[test]
fn the_cascade_goes_by_origin_layer_specificity_and_order() {
    for (xml, want) in [
        ("<s><path fill='red'/></s>", RED),
        ("<s><style>path{fill:blue}</style><path fill='red'/></s>", BLUE),
        ("<s><style>*{fill:blue}</style><path fill='red'/></s>", BLUE),
        ("<s><style>path{fill:blue}</style><path style='fill:red'/></s>", RED),
        ("<s><style>path{fill:blue!important}</style><path style='fill:red'/></s>", BLUE),
        ("<s><style>path{fill:blue!important}</style><path style='fill:red ! IMPORTANT'/></s>", RED),
        ("<s><style>.a{fill:blue}path{fill:red}</style><path class='b a'/></s>", BLUE),
        ("<s><style>path{fill:blue}path{fill:red}</style><path/></s>", RED),
        ("<s><style>#i{fill:blue}.a.a.a{fill:red}</style><path id='i' class='a'/></s>", BLUE),
        ("<s><style>@layer x{#i{fill:blue}}path{fill:red}</style><path id='i'/></s>", RED),
        ("<s><style>@layer x{path{fill:blue!important}}path{fill:red!important}</style><path/></s>", BLUE),
        ("<s><style>@layer a,b;@layer b{path{fill:blue}}@layer a{path{fill:red}}</style><path/></s>", BLUE),
        ("<s><style>@layer a{path{fill:blue}@layer b{path{fill:red}}}</style><path/></s>", BLUE),
        ("<s><style>@layer a.b{path{fill:red}}@layer a{path{fill:blue}}</style><path/></s>", BLUE),
        ("<s><style>@layer a{path{fill:blue}}@layer b{path{fill:revert-layer}}</style><path/></s>", BLUE),
        ("<s><style>path{fill:revert-layer}</style><path fill='blue'/></s>", BLUE),
        ("<s fill='red'><style>path{fill:revert}</style><path fill='blue'/></s>", RED),
        ("<s fill='red'><path fill='inherit'/></s>", RED),
        ("<s fill='red'><path fill='unset'/></s>", RED),
        ("<s fill='red'><path fill='initial'/></s>", "#000000"),
        ("<s fill='red'><path style='all:unset' fill='blue'/></s>", RED),
        ("<s fill='red'><path style='all:initial'/></s>", "#000000"),
        ("<s><style>g{fill:red;path &amp;{fill:lime} path{fill:blue}}</style><g><path/></g></s>", BLUE),
        ("<s><style>g{ &amp; path{fill:blue} @media print{path{fill:red}} }</style><g><path/></g></s>", BLUE),
        ("<s><style>path{fill:red;@media all{fill:blue}}</style><path/></s>", BLUE),
        ("<s><style>path{@media all{fill:red} fill:blue}</style><path/></s>", BLUE),
        ("<s><style media='print'>path{fill:red}</style><path fill='blue'/></s>", BLUE),
        ("<s><style>@media screen{path{fill:blue}}</style><path/></s>", BLUE),
        ("<s><style>@supports (fill:red){path{fill:blue}}</style><path/></s>", BLUE),
        ("<s><style><![CDATA[path{fill:blue}]]></style><path/></s>", BLUE),
        ("<s><style>path{fill:<!-- c -->blue}</style><path/></s>", BLUE),
    ] {
        assert_eq!(fill(xml), want, "{xml}");
    }
}

#[test]
fn values_that_are_not_valid_leave_earlier_ones() {
    for (style, want) in [
        ("fill:blue;fill:bogus", BLUE),
        ("fill:blue;fill:color(bogus 1 1 1)", BLUE),
        ("fill:blue;fill:#12345", BLUE),
        ("fill:blue;fill:red blue", BLUE),
        ("fill:blue;fill", BLUE),
        ("fill:blue;;fill:red !imp", BLUE),
        ("FILL:Blue", BLUE),
        ("fill:NONE", "none"),
        ("f\\69ll:blue", BLUE),
        ("fill:/**/blue/**/", BLUE),
        ("fill:red;--a:blue;fill:var(--a)", BLUE),
        ("fill:red;fill:var(--a,blue)", BLUE),
        ("fill:red;fill:var(--missing)", "#00ff00"),
        ("fill:red;--a:bogus;fill:var(--a)", "#00ff00"),
        ("fill:url(#x)", "url"),
        ("fill:url( '#x' ) blue", "url"),
        ("fill:context-fill", "context"),
        ("color:blue;fill:currentColor", BLUE),
        ("fill:#00f icc-color(x, 1, 2)", BLUE),
    ] {
        assert_eq!(fill(&format!("<s fill='lime'><path style=\"{style}\"/></s>")), want, "{style}");
    }
}

#[test]
fn colours_of_level_4_are_resolved_to_srgb() {
    for (text, want) in [
        ("rgb(0 0 255)", BLUE),
        ("rgb(0% 0% 100%)", BLUE),
        ("rgba(0,0,255,1)", BLUE),
        ("rgb(0 0 255 / 50%)", "#0000ff/0.50"),
        ("rgba(0,0,255,.5)", "#0000ff/0.50"),
        ("rgb(none none 255)", BLUE),
        ("hsl(240 100% 50%)", BLUE),
        ("hsl(240deg,100%,50%)", BLUE),
        ("hsla(0.6667turn 100% 50% / 1)", BLUE),
        ("hwb(240 0% 0%)", BLUE),
        ("lab(29.57% 68.29 -112.03)", BLUE),
        ("lch(29.57% 131.2 301.37)", BLUE),
        ("oklab(45.2% -0.0325 -0.3115)", BLUE),
        ("oklch(0.452 0.3132 264.05)", BLUE),
        ("color(srgb 0 0 1)", BLUE),
        ("color(srgb-linear 0 0 1)", BLUE),
        ("color(display-p3 1 1 1)", "#ffffff"),
        ("color(xyz 0.1805 0.0722 0.9505)", BLUE),
        ("color-mix(in srgb, red, blue 100%)", BLUE),
        ("color-mix(in srgb, blue 50%, blue 50%)", BLUE),
        ("color-mix(in srgb, white, black)", "#808080"),
        ("color-mix(in srgb, currentColor, blue 100%)", BLUE),
        ("color-mix(in hsl longer hue, blue, blue 100%)", BLUE),
        ("color-mix(in srgb longer hue, blue, blue)", "#00ff00"),
        ("light-dark(blue, red)", BLUE),
        ("CanvasText", "#000000"),
        ("Canvas", "#ffffff"),
        ("rgb(calc(1 - 1) 0 calc(5 * 51))", BLUE),
        ("transparent", "#000000/0.00"),
        ("#00f", BLUE),
        ("#0000ff80", "#0000ff/0.50"),
        ("rebeccapurple", "#663399"),
        ("rgb(0 0 255 , 1)", "#00ff00"),
        ("rgb(0, 0% , 255)", "#00ff00"),
    ] {
        assert_eq!(fill(&format!("<s fill='lime'><path fill='{text}'/></s>")), want, "{text}");
    }
}

#[test]
fn lengths_are_exact_and_computed() {
    let width = |style: &str| {
        let of = |s: &Style| s.stroke_width;
        shown(&format!("<s font-size='10'><g style=\"{style}\"><path/></g></s>"), of).pop().expect("a path")
    };
    for (style, px, share) in [
        ("stroke-width:2", 2.0, 0.0),
        ("stroke-width:0.1234567890123", 0.123_456_789_012_3, 0.0),
        ("stroke-width:25.4mm", 96.0, 0.0),
        ("stroke-width:2em", 20.0, 0.0),
        ("font-size:200%;stroke-width:1em", 20.0, 0.0),
        ("font:italic 700 30px/2 serif;stroke-width:1em", 30.0, 0.0),
        ("stroke-width:1rem", 10.0, 0.0),
        ("stroke-width:10%", 0.0, 0.1),
        ("stroke-width:calc(1px + 2 * 3px - (4px / 2) + 10%)", 5.0, 0.1),
        ("stroke-width:min(3px, 2px)", 2.0, 0.0),
        ("stroke-width:max(3em, 0px)", 30.0, 0.0),
        ("stroke-width:clamp(1px, 7px, 5px)", 5.0, 0.0),
        ("stroke-width:3;stroke-width:-1", 3.0, 0.0),
        ("stroke-width:3;stroke-width:1deg", 3.0, 0.0),
        ("stroke-width:3;stroke-width:calc(1px+2px)", 3.0, 0.0),
    ] {
        let width = width(style);
        assert_eq!((width.px, width.share), (px, share), "{style}");
    }
}

#[test]
fn what_may_mean_something_to_browsers_is_remarked() {
    let remarks = |css: &str, style: &str| {
        let text = format!("<s><style>{css}</style><path style=\"{style}\"/></s>");
        let doc = Document::parse(&text).expect("well-formed");
        let mut cascade = Cascade::new(&doc).expect("bounded");
        let path = doc.descendants().find(|n| n.has_tag_name("path")).expect("a path");
        let own = cascade.style(path, &Arc::new(Style::initial()), None).expect("bounded").1;
        let all = cascade.remarks().iter().chain(&own);
        all.map(|r| match &r.weight {
            Weight::Unknown(what) => format!("?{what}"),
            Weight::Ignored => format!("!{}", r.text),
            Weight::External => format!(">{}", r.text),
        })
        .collect::<Vec<_>>()
        .join("; ")
    };
    for (css, style, want) in [
        ("path{fill:red;cursor:help;font-family:x;-inkscape-font-specification:x}", "", ""),
        ("@font-face{font-family:x;src:url(x)} @keyframes k{from{fill:red}} @charset 'x';", "", ""),
        ("path:hover{fill:red} a:link{fill:red} path::before{fill:red}", "", ""),
        ("@container (width > 1px){path{fill:red}}", "", "?@container"),
        ("", "stroke-width:max(3, 0px)", "?max() of different units"),
        ("", "stroke-width:max(3px, 0)", "?max() of different units"),
        ("@media (min-width:1px){path{fill:red}}", "", "?the media feature (min-width:1px)"),
        ("@import 'x.css';", "", ">@import 'x.css'"),
        ("/* @import 'x.css'; */", "", ""),
        ("path{}@import 'x.css';", "", "!@import 'x.css'"),
        ("path:bogus{fill:red}", "", "!path:bogus"),
        ("path:dir(ltr){fill:red}", "", "?the selector :dir()"),
        ("", "fill:bogus", "!fill: bogus"),
        ("", "fill:rgb(from red r g b)", "?a colour relative to another (from)"),
        ("", "stroke-width:1vw", "?the unit vw"),
        ("", "stroke-width:sin(1)", "?sin()"),
        ("", "offset-path:path('M0 0')", "?the property offset-path"),
        ("", "animation:none;transition:all 1s;will-change:transform", ""),
        ("", "bogus:1", "!bogus: 1"),
        ("", "transform:rotateX(10deg)", "?rotatex()"),
    ] {
        assert_eq!(remarks(css, style), want, "{css} {style}");
    }
}

#[test]
fn selectors_match_as_in_browsers() {
    let xml = |selector: &str| {
        format!(
            "<svg xmlns='http://www.w3.org/2000/svg' xmlns:x='urn:x'><style>@namespace x 'urn:x';\
             @namespace s 'http://www.w3.org/2000/svg';\
             {selector}{{fill:blue}}</style><g class='a b'><rect x:k='v'/><circle id='c'/><path class='P q' k='one two' \
             lang='en-GB' id='p.1'/><line/></g></svg>"
        )
    };
    for (selector, hit) in [
        ("path", true),
        ("PATH", false),
        (".P", true),
        (".p", false),
        ("g path", true),
        ("svg>g>path", true),
        ("circle+path", true),
        ("rect~path", true),
        ("line~path", false),
        ("[k]", true),
        ("[k='one two']", true),
        ("[k='ONE two' i]", true),
        ("[k^=one]", true),
        ("[k$=two]", true),
        ("[k*='e t']", true),
        ("[k~=two]", true),
        ("[lang|=en]", true),
        (":nth-child(3)", true),
        (":nth-child(4)", false),
        (":nth-last-child(2)", true),
        (":nth-child(1 of path)", true),
        ("path:only-of-type", true),
        (":first-of-type", true),
        ("path:last-child", false),
        ("path:not(.q)", false),
        ("path:not(.z, .y)", true),
        (":is(.z, path)", true),
        (":where(g > path)", true),
        ("g:has(> rect) path", true),
        ("g:has(> text) path", false),
        ("path:empty", true),
        (":root path", true),
        ("s|path", true),
        ("x|path", false),
        ("*|path", true),
        (":lang(en)", true),
        ("#p\\.1", true),
        ("[x|k] ~ path", true),
        ("path:hover", false),
        ("g.a.b > .q", true),
        (".a, .q", true),
    ] {
        assert_eq!(fill(&xml(selector)) == BLUE, hit, "{selector}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn selectors_that_cost_too_much_are_refused() {
    let excess = |css: &str, body: &str| {
        let text = format!("<s><style>{css}</style>{body}</s>");
        let options = roxmltree::ParsingOptions { nodes_limit: u32::MAX, ..Default::default() };
        let doc = Document::parse_with_options(&text, options).expect("well-formed");
        let mut cascade = match Cascade::new(&doc) {
            Ok(cascade) => cascade,
            Err(e) => return Some(e),
        };
        doc.descendants()
            .filter(Node::is_element)
            .find_map(|node| cascade.style(node, &Arc::new(Style::initial()), None).err())
    };
    let row = "<g/>".repeat(20_000);
    assert_eq!(excess(&("g~".repeat(450) + "p{fill:red}"), &row), None);
    assert_eq!(excess(&("g~".repeat(2000) + "g{fill:red}"), &row), Some(Excess::Selectors));
    assert_eq!(excess(&"*~*~g{fill:red}".repeat(3000), &row), Some(Excess::Steps));
    assert_eq!(excess(&"@media all{".repeat(400_000), ""), Some(Excess::Depth));
    assert_eq!(excess(&("g".to_owned() + &":not(".repeat(400_000)), ""), None);
    assert_eq!(excess(&("g{".to_owned() + &"&amp;{".repeat(60)), &row), None);
    let deep = "<g>".repeat(250) + "<p/>" + &"</g>".repeat(250);
    assert_eq!(excess(&("g ".repeat(200) + "p{fill:red} x " + &"g ".repeat(200) + "p{fill:red}"), &deep), None);
}
