//! Selectors, colours, at-rules and properties of CSS, one drawing each: what is marked is what Chromium shows.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::support::chromium::{Ink, Picture, Scale, pictures};
use crate::support::folder;
use crate::support::seen::{PER_MM, SPOT, Verdict, codes, judge, load};
use terrace_input::texture::{Marking, Size};

/// A drawing: its name and what the page holds.
type Drawing = (&'static str, String);

fn drawing(body: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" \
         xmlns:s=\"http://www.w3.org/2000/svg\" xmlns:foo=\"http://example.org/foo\" \
         width=\"40mm\" height=\"40mm\" viewBox=\"0 0 40 40\">{body}</svg>"
    )
}

/// A character of XML where markup would begin.
fn escaped(css: &str) -> String {
    css.replace('&', "&amp;").replace('<', "&lt;")
}

/// The document that selectors are tried on: 25 shapes of 5 mm, in five rows.
const SHAPES: &str = r##"
<g id="g0" class="first Group" lang="en-GB" data-layer="cut lines">
  <rect class="a b" x="2" y="2" width="5" height="5"/>
  <rect id="r1" class="b" x="10" y="2" width="5" height="5"/>
  <circle class="a" cx="20.5" cy="4.5" r="2.5"/>
  <rect class="c" x="26" y="2" width="5" height="5"/>
  <path id="p0" class="b" d="M34 2h5v5h-5z"/>
</g>
<g id="g1" class="second">
  <g><rect x="2" y="10" width="5" height="5"/><circle cx="12.5" cy="12.5" r="2.5"/></g>
  <g class="inner"><rect class="a" x="18" y="10" width="5" height="5"/><ellipse cx="28.5" cy="12.5" rx="2.5" ry="2"/></g>
  <rect class="A" x="34" y="10" width="5" height="5"/>
</g>
<g id="g2">
  <rect data-kind="cut-1" x="2" y="18" width="5" height="5"/>
  <rect data-kind="mark cut" x="10" y="18" width="5" height="5"/>
  <rect data-kind="CUT" x="18" y="18" width="5" height="5"/>
  <rect data-kind="pre-cut" x="26" y="18" width="5" height="5"/>
  <rect data-kind="" x="34" y="18" width="5" height="5"/>
</g>
<g id="g3">
  <rect class="1st" x="2" y="26" width="5" height="5"><title>first</title></rect>
  <rect id="a.b" x="10" y="26" width="5" height="5"><!-- nothing --></rect>
  <rect class="weiß" x="18" y="26" width="5" height="5"> </rect>
  <rect class="a:c" foo:cut="yes" x="26" y="26" width="5" height="5"/>
  <rect class="  x	y
z " cut="yes" x="34" y="26" width="5" height="5"/>
</g>
<a xlink:href="#r1"><rect x="2" y="34" width="5" height="5"/></a>
<s:rect class="prefixed" x="10" y="34" width="5" height="5"/>
<foo:g><rect x="0" y="0" width="40" height="40"/></foo:g>
<polygon points="18,34 23,34 23,39 18,39"/>
<svg x="26" y="34" width="5" height="5"><rect class="b" width="5" height="5"/></svg>
<g lang="de"><rect class="last" x="34" y="34" width="5" height="5"/></g>
"##;

/// Name and selector. What each selects is not filled.
const SELECTORS: &[(&str, &str)] = &[
    ("type", "circle"),
    ("universal_in_a_group", "#g1 *"),
    ("descendant", "#g1 rect"),
    ("child", "#g1 > rect"),
    ("next_sibling", "rect + circle"),
    ("later_siblings", ".b ~ *"),
    ("chain", "svg > g.second > g.inner > rect + ellipse"),
    ("list", "circle, ellipse ,path"),
    ("list_with_a_faulty_part", "circle, :nonsense(.x)"),
    ("compound", "rect.a.b"),
    ("attribute", "[data-kind]"),
    ("attribute_equals", "[data-kind='cut-1']"),
    ("attribute_equals_unquoted", "[data-kind=CUT]"),
    ("attribute_of_no_text", "[data-kind='']"),
    ("attribute_word", "[data-kind~='cut']"),
    ("attribute_word_or_hyphen", "[data-kind|='cut']"),
    ("attribute_begins", "[data-kind^='cut']"),
    ("attribute_ends", "[data-kind$='cut']"),
    ("attribute_holds", "[data-kind*='cut']"),
    ("attribute_in_any_case", "[data-kind='cut' i]"),
    ("attribute_begins_in_any_case", "[data-kind^='CuT' I]"),
    ("attribute_holds_nothing", "[data-kind*=''], circle"),
    ("attribute_name_in_another_case", "[DATA-KIND], circle"),
    ("attribute_of_any_namespace", "[*|cut]"),
    ("attribute_without_a_namespace", "[|cut]"),
    ("not", "rect:not(.a)"),
    ("not_a_list", "rect:not(.a, .b, [data-kind])"),
    ("not_a_complex_selector", "rect:not(#g2 > rect)"),
    ("not_of_not", "rect:not(:not(.b))"),
    ("is", "#g0 :is(.a, .c)"),
    ("is_forgives", ":is(.a, :nonsense, .c)"),
    ("where_has_no_weight", ":where(#r1, .c)"),
    ("has", "g:has(> .inner) rect"),
    ("has_a_sibling", "rect:has(+ circle)"),
    ("has_later_siblings", "rect:has(~ path)"),
    ("has_not", "g:not(:has(circle)) > rect"),
    ("first_child", "rect:first-child"),
    ("last_child", "#g2 > :last-child"),
    ("only_child", "rect:only-child"),
    ("first_of_type", "g > rect:first-of-type"),
    ("last_of_type", "#g0 > :last-of-type"),
    ("only_of_type", "#g1 rect:only-of-type"),
    ("nth_child", "#g2 > :nth-child(3)"),
    ("nth_child_odd", "rect:nth-child(odd)"),
    ("nth_child_formula", "#g2 > :nth-child(-n + 2), #g3 > :nth-child(3n - 1)"),
    ("nth_child_signs", "#g3 > :nth-child(+2N+1)"),
    ("nth_child_of", "#g0 > :nth-child(2 of .b)"),
    ("nth_child_of_even", "#g0 > :nth-child(even of rect, circle)"),
    ("nth_last_child", "#g3 > :nth-last-child(2)"),
    ("nth_last_child_of", "#g0 > :nth-last-child(1 of rect)"),
    ("nth_of_type", "#g0 > rect:nth-of-type(2)"),
    ("nth_last_of_type", "#g0 > rect:nth-last-of-type(2)"),
    ("empty", "#g3 > rect:empty"),
    ("root", ":root > polygon"),
    ("scope", ":scope > polygon"),
    ("lang", "rect:lang(en)"),
    ("link", "a:any-link rect"),
    ("pseudo_class_in_capitals", "#g2 > :NTH-CHILD(2)"),
    ("hover_is_not", "rect:hover, circle:not(:hover)"),
    ("any_namespace", "*|rect"),
    ("no_namespace", "|rect, circle"),
    ("prefix_that_is_not_declared", "s|rect, circle"),
    ("class_in_another_case", ".A"),
    ("type_in_another_case", "RECT, circle"),
    ("class_that_begins_with_a_digit", ".\\31 st"),
    ("id_with_a_full_stop", "#a\\.b"),
    ("class_with_a_colon", ".a\\:c"),
    ("class_beyond_ascii", ".weiß"),
    ("class_by_its_code", ".wei\\DF , .wei\\0000df"),
    ("escape_within_a_name", "ci\\72 cle"),
    ("classes_between_white_space", ".y.z"),
    ("comments", "/**/circle/*, rect*/,/* */path/**/"),
    ("pseudo_element", "rect::before, circle"),
    ("child_of_nothing", "> rect"),
    ("id_that_is_a_number", "#1"),
];

/// Prelude, name and selector of those with a namespace.
const NAMESPACES: &[(&str, &str, &str)] = &[
    ("namespace_with_a_prefix", "@namespace s url(http://www.w3.org/2000/svg);", "s|circle"),
    ("namespace_as_text", "@namespace s 'http://www.w3.org/2000/svg';", "s|rect.a"),
    ("namespace_of_all", "@namespace 'http://www.w3.org/1999/xhtml';", "rect, *|circle"),
    ("namespace_of_svg", "@namespace 'http://www.w3.org/2000/svg';", "circle"),
    ("namespace_of_an_attribute", "@namespace f url('http://example.org/foo');", "[f|cut]"),
    ("namespace_after_a_rule", "x{} @namespace s url(http://www.w3.org/2000/svg);", "s|circle"),
];

/// Name, a white, a dark and an invisible form of it, and one that is not valid.
const COLOURS: &[(&str, [&str; 4])] = &[
    ("hex_3", ["#fff", "#012", "transparent", "#0"]),
    ("hex_4", ["#ffff", "#012f", "#0120", "#ggg"]),
    ("hex_6", ["#FFFFFF", "#aBc012", "none", "#12345"]),
    ("hex_8", ["#ffffffff", "#000000ff", "#00000000", "#0000000"]),
    ("names", ["White", "rebeccapurple", "TRANSPARENT", "blak"]),
    ("rgb_with_commas", ["rgb(255,255,255)", "rgb(0, 0 ,0)", "rgb(0,0,0,0)", "rgb(0,0)"]),
    ("rgb_of_percent", ["rgb(100%,100%,100%)", "rgb(10%, 0%, 0%)", "rgb(0%,0%,0%,0%)", "rgb(0%,0,0%)"]),
    ("rgba", ["rgba(255,255,255,1)", "rgba(0,0,0,100%)", "rgba(0,0,0,0)", "rgba(0,0,0,)"]),
    ("rgb_with_spaces", ["rgb(255 255 255)", "rgb(0 0 0 / 1)", "rgb(0 0 0 / 0%)", "rgb(0 0, 0)"]),
    ("rgb_of_none", ["rgb(255 255 255 / 100%)", "rgb(none none none)", "rgb(0 0 0 / none)", "rgb(none, 0, 0)"]),
    ("rgb_beyond_its_range", ["rgb(300 400 1e3)", "rgb(-10 -20 -1e9)", "rgb(0 0 0 / -1)", "rgb(0 0 0 0)"]),
    (
        "rgb_of_calc",
        ["rgb(calc(250 + 5) 255 255)", "rgb(calc(1 - 1) 0 0)", "rgb(0 0 0 / calc(1 - 1))", "rgb(calc() 0 0)"],
    ),
    ("hsl_with_commas", ["hsl(0,0%,100%)", "hsl(120,100%,25%)", "hsla(0,0%,0%,0)", "hsl(0,0,0)"]),
    ("hsl_with_spaces", ["hsl(none 0% 100%)", "hsl(120deg 100% 25%)", "hsl(0 0% 0% / 0)", "hsl(0% 0% 0%)"]),
    ("hsl_by_turns", ["hsl(0.5turn 0% 100%)", "hsl(200grad 100% 20%)", "hsl(3rad 0% 0% / 0%)", "hsl(3px 0% 0%)"]),
    ("hwb", ["hwb(0 100% 0%)", "hwb(90 0% 100%)", "hwb(0 0% 100% / 0)", "hwb(0, 0%, 100%)"]),
    ("lab", ["lab(100% 0 0)", "lab(0 0 0)", "lab(0% 0 0 / 0)", "lab(0%, 0, 0)"]),
    ("lch", ["lch(100 0 0)", "lch(20% 30 270deg)", "lch(0% 0 0 / 0%)", "lch(0% 0)"]),
    ("oklab", ["oklab(1 0 0)", "oklab(0% 0 0)", "oklab(0 0 0 / 0)", "oklab(0 0)"]),
    ("oklch", ["oklch(100% 0 0)", "oklch(0.3 0.1 120)", "oklch(0 0 none / 0)", "oklch(0deg 0 0)"]),
    ("color_srgb", ["color(srgb 1 1 1)", "color(srgb 0% 0% 0%)", "color(srgb 0 0 0 / 0)", "color(srgb 0 0 0 0)"]),
    (
        "color_srgb_linear",
        [
            "color(srgb-linear 1 1 1)",
            "color(srgb-linear 0 0 0)",
            "color(srgb-linear 0 0 0 / 0%)",
            "color(linear 0 0 0)",
        ],
    ),
    (
        "color_display_p3",
        ["color(display-p3 1 1 1)", "color(display-p3 0 0.2 0)", "color(display-p3 0 0 0 / 0)", "color(p3 0 0 0)"],
    ),
    ("color_a98", ["color(a98-rgb 1 1 1)", "color(a98-rgb 0 0 0)", "color(a98-rgb 0 0 0 / 0)", "color(a98 0 0 0)"]),
    (
        "color_prophoto",
        [
            "color(prophoto-rgb 1 1 1)",
            "color(prophoto-rgb 0 0 0)",
            "color(prophoto-rgb 0 0 0 / 0)",
            "color(prophoto 0 0 0)",
        ],
    ),
    (
        "color_rec2020",
        ["color(rec2020 1 1 1)", "color(rec2020 0 0 0)", "color(rec2020 0 0 0 / 0)", "color(bt2020 0 0 0)"],
    ),
    (
        "color_xyz",
        ["color(xyz 0.9505 1 1.089)", "color(xyz-d65 0 0 0)", "color(xyz-d50 0 0 0 / 0)", "color(xyz-d55 0 0 0)"],
    ),
    (
        "color_mix",
        [
            "color-mix(in srgb, white, white)",
            "color-mix(in oklab, black 30%, red)",
            "color-mix(in lch, transparent, transparent)",
            "color-mix(black, red)",
        ],
    ),
    (
        "light_dark",
        ["light-dark(white, black)", "light-dark(#000, #fff)", "light-dark(transparent, black)", "light-dark(black)"],
    ),
    ("system", ["Canvas", "CanvasText", "transparent", "Kanvas"]),
    ("current_color", ["white", "currentColor", "transparent", "current-color"]),
    ("current_color_in_capitals", ["white", "CURRENTCOLOR", "transparent", "currentcolour"]),
    ("variable", ["var(--white)", "var(--dark)", "var(--clear)", "var(--missing)"]),
    (
        "variable_with_a_fallback",
        ["var(--missing, #fff)", "var(--missing, var(--dark))", "var(--missing, transparent)", "var(--missing,)"],
    ),
    (
        "variable_of_a_part",
        ["rgb(var(--full) 255 255)", "rgb(var(--none), 0, 0)", "rgb(0 0 0 / var(--none))", "rgb(var(--white) 0 0)"],
    ),
    ("relative", ["rgb(from white r g b)", "rgb(from white 0 0 0)", "rgb(from black r g b / 0)", "rgb(from 0 0 0)"]),
];

/// A white form on black, a dark one, an invisible one and one that is not valid; `none` is inherited.
fn colours(forms: [&str; 4], is_style: bool) -> String {
    let fill = |colour: &str| match is_style {
        true => format!("style=\"fill:{colour}\""),
        false => format!("fill=\"{colour}\""),
    };
    let [white, dark, clear, faulty] = forms.map(fill);
    drawing(&format!(
        "<g color='#123' style='--white:#fff;--dark:#012;--clear:#0000;--full:255;--none:0'>\
         <rect x='5' y='5' width='30' height='14'/><g fill='none'>\
         <rect x='10' y='8' width='20' height='8' {white}/><rect x='5' y='22' width='8' height='12' {dark}/>\
         <rect x='16' y='22' width='8' height='12' {clear}/><rect x='27' y='22' width='8' height='12' {faulty}/></g></g>"
    ))
}

/// Two squares and a bar: of classes `a`, `b` and `c`.
const THREE: &str = "<rect class='a' x='5' y='5' width='12' height='12'/><rect class='b' x='22' y='5' width='12' \
    height='12'/><path class='c' d='M5 25H35V33H5z'/>";

/// Name and style sheet over [`THREE`].
const SHEETS: &[(&str, &str)] = &[
    ("media_screen", "@media screen{.a{fill:none}}"),
    ("media_print", "@media print{.a{fill:none}} .b{fill:none}"),
    ("media_all", "@MEDIA ALL{.a{fill:none}}"),
    ("media_not", "@media not print{.a{fill:none}} @media not screen{.b{fill:none}}"),
    ("media_only", "@media only screen{.a{fill:none}}"),
    ("media_list", "@media print, screen{.a{fill:none}} @media nonsense, print{.b{fill:none}}"),
    (
        "media_colour_scheme",
        "@media (prefers-color-scheme:light){.a{fill:none}} @media (prefers-color-scheme:dark){.b{fill:none}}",
    ),
    ("media_and", "@media screen and (min-width:1px){.a{fill:none}} @media screen and (max-width:1px){.b{fill:none}}"),
    ("media_range", "@media (width >= 1px){.a{fill:none}} @media (1px > width){.b{fill:none}}"),
    ("media_within_media", "@media screen{@media all{.a{fill:none}} @media print{.b{fill:none}}}"),
    ("media_faulty", "@media screen and{.a{fill:none}} .b{fill:none}"),
    ("supports", "@supports (fill:red){.a{fill:none}} @supports (nonsense:red){.b{fill:none}}"),
    ("supports_not", "@supports not (nonsense:red){.a{fill:none}} @supports not (fill:red){.b{fill:none}}"),
    ("supports_and_or", "@supports (fill:red) and ((nonsense:1) or (r:1px)){.a{fill:none}}"),
    ("supports_selector", "@supports selector(a > b){.a{fill:none}} @supports selector(:nonsense){.b{fill:none}}"),
    ("layer", "@layer one{.a{fill:none} .b{fill:none}} .b{fill:#000}"),
    ("layer_order", "@layer two, one; @layer one{.a{fill:none}} @layer two{.a{fill:#000}.b{fill:none}}"),
    (
        "layer_important",
        "@layer one{.a{fill:none!important}} .a{fill:#000!important} @layer two{.a{fill:#000!important}}",
    ),
    ("layer_in_layer", "@layer one{@layer in{.a{fill:none}} .a{fill:#000}} @layer one.in{.b{fill:none}}"),
    ("layer_without_a_name", "@layer{.a{fill:none}} @layer{.b{fill:none}}"),
    ("import_in_a_comment", "/* @import 'x.css'; */ .a{fill:none}"),
    ("import_in_a_string", ".b::before{content:\"@import 'x.css';\"} .a{fill:none}"),
    ("nesting", "svg{& .a{fill:none} > .b{fill:none} .c &{fill:none}}"),
    ("nesting_of_the_same_element", "rect{&.a{fill:none} .x &{fill:none}}"),
    ("nesting_in_media", "svg{@media screen{.a{fill:none}} @media print{.b{fill:none}}}"),
    ("nesting_after_declarations", ".a{fill:none; &{fill:#000} fill:none}"),
    ("font_face", "@font-face{font-family:x;src:url(data:font/woff;base64,AA)} .a{fill:none}"),
    ("keyframes_that_are_not_used", "@keyframes k{from{fill:red}to{opacity:0}} .a{fill:none}"),
    (
        "page_and_property",
        "@page{margin:1cm} @property --x{syntax:'*';inherits:false} @counter-style z{system:fixed;symbols:a} .a{fill:none}",
    ),
    ("at_rule_that_is_not_known", "@nonsense{.b{fill:none}} @nonsense x; .a{fill:none}"),
    ("charset", "@charset \"utf-8\"; .a{fill:none}"),
    ("important", ".a{fill:none!important} .a{fill:#000} #x.b{fill:none} .b{fill:#000 ! IMPORTANT}"),
    ("weight", "rect.a{fill:none} .a{fill:#000} .b{fill:none} .b{fill:#000} .b.b{fill:none}"),
    ("faulty_rules", "}} .x{ {fill:red} .a{fill:none}"),
    ("faulty_declarations", ".a{fill:none;fill:;fill:red blue;fill red;:red;fill:url(;} .b{fill:none}"),
    ("rule_that_is_not_closed", ".b{fill:#000} .a{fill:none"),
    ("comment_that_is_not_closed", ".a{fill:none} /* .b{fill:none}"),
    ("string_that_is_not_closed", ".b{fill:none;x:'\n;fill:#000} .a{fill:none}"),
    ("marks_of_html", "<!-- .a{fill:none} -->"),
    ("escapes_in_names", ".a{f\\69 ll:none} .b{fill:n\\6fne}"),
    ("variables", ":root{--a:none;--b:var(--a)} .a{fill:var(--b)} .b{fill:var( --b , #000 )}"),
    ("variables_in_a_circle", ":root{--a:var(--b);--b:var(--a)} .a{fill:var(--a,none)} .b{fill:var(--a)}"),
    ("variables_by_case", ":root{--A:none;--a:#000} .a{fill:var(--A)} .b{fill:var(--a)}"),
    ("variable_that_is_inherited", "svg{--x:none} rect{fill:var(--x)} .b{--x:#000}"),
    ("variable_initial", "svg{--x:none} .a{--x:initial;fill:var(--x,none)} .b{--x:initial;fill:var(--x)}"),
    ("initial", "svg{fill:none} .a{fill:initial} .b{fill:inherit}"),
    ("unset", "svg{fill:none} .a{fill:unset} .b{fill:initial;fill:unset}"),
    ("revert", "svg{fill:none} .a{fill:#000;fill:revert} .b{fill:revert-layer}"),
    ("all", "svg{fill:none} .c{all:initial;d:path('M5 25H35V33H5z')} .a{all:inherit;fill:#000}"),
    ("visibility", "svg{visibility:hidden} .a{visibility:visible} .b{visibility:collapse}"),
    ("display", ".a{display:none} .b{display:nonsense} .c{display:block}"),
    ("opacity_of_percent", ".a{opacity:0%} .b{fill-opacity:0} .c{opacity:calc(1 - 1)}"),
    ("scope_rule", "@scope (svg){.a{fill:none}}"),
    ("container", "@container (width > 1px){.a{fill:none}}"),
    ("starting_style", "@starting-style{.a{fill:none}}"),
];

/// Name and content of drawings of properties and attributes.
const PROPERTIES: &[(&str, &str)] = &[
    (
        "style_media_print",
        "<style media='print'>.a{fill:none}</style><style media='screen, print'>.b{fill:none}</style>THREE",
    ),
    ("style_type", "<style type='text/css'>.a{fill:none}</style><style type='text/x'>.b{fill:none}</style>THREE"),
    ("style_after", "THREE<style>.a{fill:none}</style>"),
    ("style_in_defs", "<defs><style>.a{fill:none}</style></defs>THREE"),
    ("style_in_parts", "<style>.a{fill:<![CDATA[none}]]></style>THREE"),
    ("style_of_html", "<style xmlns='http://www.w3.org/1999/xhtml'>.a{fill:none}</style>THREE"),
    ("style_of_no_namespace", "<style xmlns=''>.a{fill:none}</style>THREE"),
    (
        "geometry_of_a_rect",
        "<rect style='x:5px;y:5px;width:20px;height:10px'/><rect style='x:1cm;y:50%;width:25%;height:10px' x='30'/>",
    ),
    (
        "geometry_of_a_rect_in_a_sheet",
        "<style>rect{x:5px;y:5px;width:20px;height:10px;rx:5px}</style><rect width='40' height='40'/>",
    ),
    ("geometry_of_a_circle", "<style>circle{cx:20px;cy:20px;r:10px}</style><circle r='2'/>"),
    (
        "geometry_of_an_ellipse",
        "<ellipse style='cx:20px;cy:20px;rx:15px;ry:auto'/><ellipse cx='20' cy='35' style='rx:8px;ry:3px'/>",
    ),
    (
        "geometry_without_units",
        "<rect width='10' height='10' style='width:20;x:5'/><circle r='5' cx='30' cy='30' style='r:2'/>",
    ),
    ("geometry_of_calc", "<rect height='10' style='width:calc(50% + 5px);x:calc(2 * 3px)'/>"),
    ("geometry_of_a_use", "<defs><rect id='q' width='10' height='10'/></defs><use href='#q' style='x:20px;y:20px'/>"),
    (
        "geometry_of_a_nested_drawing",
        "<svg style='x:10px;y:10px;width:20px;height:20px' viewBox='0 0 1 1'><rect width='1' height='1'/></svg>",
    ),
    ("geometry_that_is_not_valid", "<rect x='5' y='5' width='20' height='10' style='width:-4px;height:wide;x:'/>"),
    (
        "rounded_corners",
        "<rect x='2' y='2' width='16' height='16' style='rx:6px'/><rect x='22' y='2' width='16' height='16' rx='8' style='rx:auto'/><rect x='2' y='22' width='16' height='16' rx='-3' ry='5'/>",
    ),
    ("d", "<path d='M20 20h10v10h-10z' style='d:path(\"M5 5h10v10h-10z\")'/><path d='M30 5h5v5h-5z' style='d:none'/>"),
    ("d_in_a_sheet", "<style>path{d:path('M5 5h30v10h-30z')}</style><path/>"),
    ("transform", "<rect width='10' height='10' style='transform:translate(20px,10px) rotate(30deg)'/>"),
    (
        "transform_in_a_sheet",
        "<style>rect{transform:scale(2) translateX(5px) skewX(10deg)}</style><rect width='10' height='10' transform='translate(20 20)'/>",
    ),
    (
        "transform_matrix",
        "<rect width='10' height='10' style='transform:matrix(1,0.5,0,1,10,5)'/><rect width='5' height='5' style='transform:none' transform='translate(30 30)'/>",
    ),
    ("transform_of_percent", "<rect x='5' y='5' width='10' height='10' style='transform:translate(50%,25%)'/>"),
    (
        "transform_by_turns",
        "<rect x='20' y='10' width='10' height='4' style='transform:rotate(0.125turn)'/><rect x='20' y='-4' width='10' height='4' style='transform:rotate(100grad)'/>",
    ),
    (
        "transform_that_is_not_valid",
        "<rect width='10' height='10' transform='translate(20 20)' style='transform:translate(20,10)'/>",
    ),
    (
        "transform_attribute_that_is_not_valid",
        "<rect width='10' height='10' transform='translate(20 20) nonsense(1)'/><rect x='5' y='20' width='5' height='5' transform='rotate(10deg)'/>",
    ),
    (
        "transform_origin",
        "<rect x='10' y='10' width='20' height='8' style='transform:rotate(45deg);transform-origin:20px 14px'/>",
    ),
    (
        "transform_origin_as_an_attribute",
        "<rect x='10' y='10' width='20' height='8' transform='rotate(45)' transform-origin='20 14'/>",
    ),
    (
        "transform_origin_by_words",
        "<rect x='10' y='5' width='20' height='8' style='transform:rotate(90deg);transform-origin:right bottom'/><rect x='2' y='2' width='6' height='6' transform='scale(2)' transform-origin='top left'/>",
    ),
    (
        "transform_origin_of_percent",
        "<rect x='10' y='10' width='10' height='8' style='transform:scale(2);transform-origin:50% 50%'/>",
    ),
    (
        "transform_box_fill",
        "<rect x='10' y='10' width='20' height='8' style='transform-box:fill-box;transform-origin:center;transform:rotate(45deg)'/>",
    ),
    (
        "transform_box_stroke",
        "<rect x='10' y='10' width='20' height='8' stroke='#000' stroke-width='4' style='transform-box:stroke-box;transform-origin:0 0;transform:rotate(20deg)'/>",
    ),
    (
        "transform_box_view",
        "<rect x='10' y='10' width='20' height='8' style='transform-box:view-box;transform-origin:center;transform:rotate(45deg)'/>",
    ),
    (
        "translate",
        "<rect width='10' height='10' style='translate:20px 10px'/><rect width='5' height='5' style='translate:50%'/>",
    ),
    (
        "rotate",
        "<rect x='20' y='5' width='10' height='4' style='rotate:45deg'/><rect width='8' height='8' style='rotate:x 0deg'/>",
    ),
    (
        "scale",
        "<rect width='10' height='5' style='scale:2 3'/><rect x='30' y='30' width='2' height='2' style='scale:110%'/>",
    ),
    (
        "translate_rotate_scale_transform",
        "<rect width='10' height='10' style='translate:20px 5px;rotate:45deg;scale:0.5 1;transform:translate(4px,0)'/>",
    ),
    ("translate_as_an_attribute_is_nothing", "<rect width='10' height='10' translate='20 10' rotate='45' scale='3'/>"),
    ("zoom_is_nothing", "<g style='zoom:1'><rect x='5' y='5' width='10' height='10'/></g>"),
    (
        "pattern_transform",
        "<pattern id='q' width='8' height='8' patternUnits='userSpaceOnUse' patternTransform='rotate(45)' transform-origin='10 4'><rect width='4' height='8'/></pattern><rect x='5' y='5' width='30' height='30' fill='url(#q)'/>",
    ),
    (
        "pattern_transform_in_css",
        "<pattern id='q' width='8' height='8' patternUnits='userSpaceOnUse' style='transform:translate(3px,0)'><rect width='4' height='8'/></pattern><rect x='5' y='5' width='30' height='30' fill='url(#q)'/>",
    ),
    (
        "clip_path_transform",
        "<clipPath id='q' transform='translate(5 0)' transform-origin='3 3'><rect x='5' y='5' width='15' height='30'/></clipPath><rect x='5' y='5' width='30' height='30' clip-path='url(#q)'/>",
    ),
    ("clip_path_circle", "<rect x='5' y='5' width='30' height='30' style='clip-path:circle(10px at 20px 20px)'/>"),
    ("clip_path_inset", "<rect x='5' y='5' width='30' height='30' style='clip-path:inset(5px 10px)'/>"),
    ("clip_path_polygon", "<rect x='5' y='5' width='30' height='30' clip-path='polygon(0 0, 20px 0, 0 20px)'/>"),
    ("clip_path_that_is_not_valid", "<rect x='5' y='5' width='30' height='30' clip-path='nonsense(1px)'/>"),
    (
        "url_in_capitals",
        "<clipPath id='q'><rect x='5' y='5' width='10' height='10'/></clipPath><rect width='40' height='40' clip-path='URL(#q)'/>",
    ),
    (
        "stroke_in_css",
        "<path d='M5 10H35' style='stroke:#000;stroke-width:4px;stroke-dasharray:6px 2px;stroke-linecap:butt'/><path d='M5 30H35' style='stroke:#000;stroke-width:10%;stroke-dasharray:4,2 1;stroke-dashoffset:3'/>",
    ),
    ("stroke_of_calc", "<path d='M5 10H35' stroke='#000' style='stroke-width:calc(2px + 5%)'/>"),
    (
        "paint_order",
        "<rect x='10' y='10' width='20' height='20' style='fill:#fff;stroke:#000;stroke-width:6px;paint-order:STROKE'/>",
    ),
    (
        "marker_in_css",
        "<marker id='q' markerWidth='4' markerHeight='4' refX='2' refY='2'><rect width='4' height='4'/></marker><style>path{marker-end:url(#q)}</style><path d='M5 20H30' stroke='#000' stroke-width='2'/>",
    ),
    (
        "mask_in_css",
        "<mask id='q' maskUnits='userSpaceOnUse' x='0' y='0' width='40' height='40'><rect x='5' y='5' width='10' height='20' fill='#fff'/></mask><rect x='5' y='5' width='30' height='30' style='mask:url(#q)'/>",
    ),
    (
        "filter_of_a_function",
        "<rect x='5' y='5' width='20' height='20' style='filter:opacity(0)'/><rect x='30' y='30' width='5' height='5'/>",
    ),
    ("offset_path", "<rect width='5' height='5' style='offset-path:path(\"M20 20h10\");offset-distance:50%'/>"),
    (
        "animation",
        "<style>@keyframes k{from{opacity:1}to{opacity:1}} rect{animation:k 1s}</style><rect x='5' y='5' width='20' height='20'/>",
    ),
    ("content_visibility", "<g style='content-visibility:visible'><rect x='5' y='5' width='20' height='20'/></g>"),
    (
        "class_of_use",
        "<style>.a{fill:none} g .b{fill:none}</style><defs><g id='q'><rect class='a' width='8' height='8'/><rect class='b' x='10' width='8' height='8'/><rect x='20' width='8' height='8'/></g></defs><use href='#q' x='5' y='5'/><g class='a'><use href='#q' x='5' y='20'/></g>",
    ),
    (
        "selector_does_not_cross_use",
        "<style>use rect{fill:none} #u rect{fill:none} defs rect{stroke:#000}</style><defs><rect id='q' width='8' height='8'/></defs><use id='u' href='#q' x='5' y='5'/>",
    ),
];

/// What may be refused, with these codes: it is seldom written, and a refusal names it.
const REFUSALS: &[(&[&str], &[&str])] = &[
    (&["color_", "lab", "lch", "oklab", "oklch", "hwb", "light_dark", "system", "relative"], &["svg-css", "svg-paint"]),
    (&["transform", "translate", "rotate", "scale"], &["svg-css", "svg-transform"]),
    (&["pattern_transform"], &["svg-css", "svg-transform", "svg-paint"]),
    (&["clip_path_"], &["svg-css", "svg-effect", "svg-transform"]),
    (&["marker_in_css"], &["svg-marker"]),
    (&["filter_of_a_function"], &["svg-effect", "svg-css"]),
    (
        &[
            "offset_path",
            "animation",
            "scope_rule",
            "container",
            "starting_style",
            "all",
            "geometry_of_calc",
            "stroke_of_calc",
            "geometry_without_units",
        ],
        &["svg-css"],
    ),
    // Browsers lay these out, which no drawing program does.
    (&["style_of_html", "content_visibility"], &["svg-css"]),
    // They depend on the size of the window.
    (&["media_and", "media_range"], &["svg-css"]),
    (&["page_and_property"], &["svg-css"]),
    // Chromium ignores it, Firefox does not.
    (&["geometry_of_a_nested_drawing"], &["svg-transform"]),
];

/// Whether one of these codes is among those that a drawing may be refused with.
fn may_be_refused(name: &str, codes: &BTreeSet<String>) -> bool {
    let rows = REFUSALS.iter().filter(|(begins, _)| begins.iter().any(|begin| name.starts_with(begin)));
    let allowed: BTreeSet<&str> = rows.flat_map(|(_, codes)| codes.iter().copied()).collect();
    codes.iter().all(|code| allowed.contains(code.as_str()))
}

fn selectors() -> Vec<Drawing> {
    let of = |prelude: &str, selector: &str| {
        drawing(&format!("<style>{}</style>{SHAPES}", escaped(&format!("{prelude} {selector}{{fill:none}}"))))
    };
    let plain = SELECTORS.iter().map(|(name, selector)| (*name, of("", selector)));
    plain.chain(NAMESPACES.iter().map(|(name, prelude, selector)| (*name, of(prelude, selector)))).collect()
}

fn at_rules_and_properties() -> Vec<Drawing> {
    let sheet = |css: &str| drawing(&format!("<style>{}</style>{THREE}", escaped(css)));
    let sheets = SHEETS.iter().map(|(name, css)| (*name, sheet(css)));
    sheets.chain(PROPERTIES.iter().map(|(name, body)| (*name, drawing(&body.replace("THREE", THREE))))).collect()
}

/// The drawings that are neither marked as Chromium shows them nor refused as they may be, with what is wrong.
fn wrong(drawings: &[Drawing]) -> Vec<String> {
    let dir = folder();
    let files = written(dir.path(), drawings);
    let pictures = pictures(&files, Scale::PerMm(PER_MM));
    let rows: Vec<(&PathBuf, &str, &Result<Picture, String>)> = files
        .iter()
        .zip(drawings)
        .zip(&pictures.list)
        .map(|((file, (name, _)), picture)| (file, *name, picture))
        .collect();
    let fault = |(file, name, picture): (&PathBuf, &str, &Result<Picture, String>)| {
        let picture = match picture {
            Ok(picture) => picture,
            Err(e) => return Some(format!("{name}: Chromium: {e}")),
        };
        let ink = picture.ink();
        let verdict = judge(file, Size::File, picture.page_mm[1], &ink, name);
        let is_right = match &verdict {
            Verdict::Right(_) => true,
            Verdict::Wrong { .. } => false,
            Verdict::Refused(codes) => {
                may_be_refused(name, codes) || ink.is_blank() && codes.iter().all(|code| code == "texture-empty")
            }
        };
        (!is_right).then(|| format!("{name}: {verdict}"))
    };
    rows.into_par_iter().filter_map(fault).collect()
}

fn written(dir: &Path, drawings: &[Drawing]) -> Vec<PathBuf> {
    let write = |(name, text): &Drawing| {
        let path = dir.join(format!("{name}.svg"));
        std::fs::write(&path, text).expect("a writable folder");
        path
    };
    let files: Vec<PathBuf> = drawings.iter().map(write).collect();
    assert_eq!(files.iter().collect::<BTreeSet<_>>().len(), files.len(), "a name is there twice");
    files
}

fn assert_right(drawings: &[Drawing]) {
    let wrong = wrong(drawings);
    assert!(wrong.is_empty(), "{} of {} are wrong:\n{}", wrong.len(), drawings.len(), wrong.join("\n"));
}

#[test]
#[ignore = "slow: make test-all"]
fn selectors_select_what_they_select_in_a_browser() {
    assert_right(&selectors());
}

#[test]
#[ignore = "slow: make test-all"]
fn colours_in_styles_are_those_of_a_browser() {
    let drawings: Vec<Drawing> = COLOURS.iter().map(|(name, forms)| (*name, colours(*forms, true))).collect();
    assert_right(&drawings);
}

#[test]
#[ignore = "slow: make test-all"]
fn colours_in_attributes_are_those_of_a_browser() {
    let drawings: Vec<Drawing> = COLOURS.iter().map(|(name, forms)| (*name, colours(*forms, false))).collect();
    assert_right(&drawings);
}

#[test]
#[ignore = "slow: make test-all"]
fn at_rules_and_properties_have_the_effect_that_they_have_in_a_browser() {
    assert_right(&at_rules_and_properties());
}

/// A selector that selects nothing in the browser would show nothing of a reader that ignores it.
#[test]
#[ignore = "slow: make test-all"]
fn all_selectors_but_faulty_ones_select_something_in_a_browser() {
    let dir = folder();
    let mut drawings = selectors();
    drawings.push(("no_selector", drawing(SHAPES)));
    let pictures = pictures(&written(dir.path(), &drawings), Scale::PerMm(5.0));
    let inks: Vec<Ink> = pictures.list.iter().map(|p| p.as_ref().expect("a picture").ink()).collect();
    let all = inks.last().expect("no selector");
    let rows = drawings.iter().zip(&inks).filter(|(_, ink)| ink.is_ink == all.is_ink);
    let without: Vec<&str> = rows.map(|((name, _), _)| *name).collect();
    let faulty = [
        "list_with_a_faulty_part",
        "prefix_that_is_not_declared",
        "child_of_nothing",
        "id_that_is_a_number",
        "namespace_after_a_rule",
        "no_selector",
    ];
    let unknown: Vec<&&str> = without.iter().filter(|name| !faulty.contains(name)).collect();
    assert!(unknown.is_empty(), "{unknown:?}");
}

/// Each drawing is read to an end, with or without a browser to compare with.
#[test]
fn drawings_of_css_are_read_or_refused_by_name() {
    let dir = folder();
    let of_colours = COLOURS.iter().map(|(name, forms)| (*name, colours(*forms, true)));
    let drawings: Vec<Drawing> = selectors().into_iter().chain(at_rules_and_properties()).chain(of_colours).collect();
    for file in written(dir.path(), &drawings) {
        if let Err(e) = load(&file, Size::File, SPOT, Marking::default()) {
            let named = codes(e.diags()).iter().all(|code| code.starts_with("svg-") || code == "texture-empty");
            assert!(named, "{}: {e}", file.display());
        }
    }
}
