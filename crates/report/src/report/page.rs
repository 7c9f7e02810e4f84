//! One page of words, tables and charts, and what all pages of this module begin with.
//!
//! Consumes the items of the page in order; promises HTML that is equal byte for byte for equal input, loads
//! nothing, runs no script, and reads on a wide screen, on paper and on a phone, where wide tables and charts
//! are moved sideways within their place.

use std::path::Path;

use super::clean;
use super::plot::Plot;
use crate::report::table::Table;
use terrace_core::diag::Message;

/// The look of every page. A wide table or chart is moved sideways within its place; a shadow at a side of that says that
/// there is more.
const STYLE: &str = "body{font:14px/1.45 Arial,\"Liberation Sans\",sans-serif;margin:2em auto;max-width:110em;padding:0 1em;color:#1a1a1a}\
h1{font-size:1.6em;margin-bottom:.2em}h2{font-size:1.15em;margin:1.8em 0 .5em}\
table{border-collapse:collapse}th,td{padding:.15em .7em;text-align:right;border-bottom:1px solid #ddd;white-space:nowrap}\
th{background:#f3f3f3;font-weight:600}td:first-child,th:first-child,.l{text-align:left}.l{white-space:normal}\
td{font-variant-numeric:tabular-nums}#blocks th{position:sticky;top:0}.row{display:flex;flex-wrap:wrap;gap:0 3em}\
.warn{border-left:4px solid #c2410c;padding:.2em .8em;margin:.5em 0;background:#fdf3ee}.warn small{color:#555}\
.wide{overflow-x:auto;background:linear-gradient(to right,#fff 50%,#fff0) 0 0/3em 100%,linear-gradient(to left,#fff 50%,#fff0) 100% 0/3em 100%,\
linear-gradient(to right,#0005,#0000) 0 0/1em 100%,linear-gradient(to left,#0005,#0000) 100% 0/1em 100%;background-repeat:no-repeat;background-attachment:local,local,scroll,scroll}\
@media print{body{max-width:none;font-size:10px}#blocks th{position:static}.wide{overflow:visible;background:none}}";

/// What a page of tables and charts adds to it.
const MORE: &str = "html{background:#fff;color-scheme:light}p{max-width:50em}.wide{margin:.8em 0 1.2em}\
.wide svg{display:block;width:100%;max-width:960px;min-width:50em;height:auto;mix-blend-mode:multiply}\
caption{text-align:left;font-weight:600;padding:.3em 0}th{vertical-align:bottom;white-space:normal}th small{font-weight:400;color:#555}\
td:not(:first-child).l{max-width:28em;min-width:10em}\
.answer{font-size:1.35em;font-weight:600;margin:.6em 0 .3em}s{color:#666}\
.aloud{position:absolute;width:1px;height:1px;overflow:hidden;clip-path:inset(50%);white-space:nowrap}\
ul{max-width:50em;margin:.3em 0 1em}summary{cursor:pointer;font-weight:600;padding:.5em 0}details{border-top:1px solid #ddd}\
.wide td:first-child,.wide th:first-child{position:sticky;left:0;background:#fff;box-shadow:inset 0 -1px #ddd}.wide th:first-child{background:#f3f3f3}\
@media(max-width:40em){body{margin:1em auto;font-size:15px}th,td{padding:.15em .4em}ul{padding-left:1.2em}}@media print{details::details-content{content-visibility:visible;display:block}.wide{break-inside:avoid}.wide svg{min-width:0}}";

/// A piece of a page.
#[derive(Clone, Copy, Debug)]
pub enum Item<'a> {
    /// The heading of what follows.
    Heading(&'a str),
    /// A paragraph, any text.
    Text(&'a str),
    /// The answer that the page gives, large.
    Answer(&'a str),
    /// Sentences below each other.
    List(&'a [String]),
    /// A paragraph that must not be missed.
    Warning(&'a str),
    /// A table under its title.
    Table(&'a Table),
    /// A chart.
    Plot(&'a Plot),
    /// What is shown where its title is opened; on paper it is.
    Fold(&'a str, &'a [Item<'a>]),
}

/// A path with `/` as the address of a link: relative as it is, whole where it lies on another drive of Windows or on a
/// server (RFC 8089, appendix E).
pub fn address(path: &str) -> String {
    match Path::new(path).is_absolute() {
        false => escaped(path),
        true if path.starts_with("//") => format!("file:{}", escaped(path)),
        true => format!("file:///{}", escaped(path).replacen("%3A", ":", 1)),
    }
}

/// Every byte escaped that an address may not have as it is (RFC 3986).
fn escaped(path: &str) -> String {
    let mut out = String::with_capacity(path.len());
    for byte in path.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => out.push(char::from(byte)),
            _ => out += &format!("%{byte:02X}"),
        }
    }
    out
}

/// The text of an HTML file.
pub fn page_html(title: &str, items: &[Item<'_>]) -> String {
    let mut h = open(title, title, MORE);
    append(&mut h, items);
    h + "</body>\n</html>\n"
}

fn append(h: &mut String, items: &[Item<'_>]) {
    for item in items {
        match item {
            Item::Heading(words) => *h += &format!("<h2>{}</h2>\n", escape(words)),
            Item::Text(words) => *h += &format!("<p>{}</p>\n", escape(words)),
            Item::Answer(words) => *h += &format!("<p class=\"answer\">{}</p>\n", escape(words)),
            Item::List(list) => {
                let lines: String = list.iter().map(|words| format!("<li>{}</li>\n", escape(words))).collect();
                *h += &format!("<ul>\n{lines}</ul>\n");
            }
            Item::Warning(words) => *h += &format!("<p class=\"warn\">{}</p>\n", escape(words)),
            Item::Table(t) => table(h, t),
            Item::Plot(plot) => *h += &format!("<div class=\"wide\">{}</div>\n", plot.element()),
            Item::Fold(title, inside) => {
                *h += &format!("<details>\n<summary>{}</summary>\n", escape(title));
                append(h, inside);
                *h += "</details>\n";
            }
        }
    }
}

fn table(h: &mut String, table: &Table) {
    *h += "<div class=\"wide\"><table>\n";
    if !table.title().is_empty() {
        *h += &format!("<caption>{}</caption>\n", escape(table.title()));
    }
    *h += "<tr>";
    let class = |right: bool| if right { "" } else { " class=\"l\"" };
    for column in table.columns() {
        let unit = if column.unit().is_empty() {
            String::new()
        } else {
            format!("<br/><small>{}</small>", escape(column.unit()))
        };
        *h += &format!("<th{}>{}{unit}</th>", class(column.is_right()), escape(column.name()));
    }
    *h += "</tr>\n";
    for r in 0..table.rows().len() {
        *h += "<tr>";
        for (c, column) in table.columns().iter().enumerate() {
            let mut shown = escape(&table.shown(r, c));
            if table.is_struck(r, c) {
                // What is read aloud says it once a row.
                let aloud = if c == 0 { "<span class=\"aloud\">not usable: </span>" } else { "" };
                shown = format!("{aloud}<s>{shown}</s>");
            }
            *h += &format!("<td{}>{shown}</td>", class(column.is_right()));
        }
        *h += "</tr>\n";
    }
    *h += "</table></div>\n";
}

/// Head of a page up to its heading; titles are any text, `style` adds to the common style.
pub fn open(title: &str, heading: &str, style: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width\"/>\n<title>{}</title>\n\
         <style>{STYLE}{style}</style>\n</head>\n<body>\n<h1>{}</h1>\n",
        escape(title),
        escape(heading)
    )
}

/// A warning or an error as a paragraph: what it says, and below it code, place and remedy.
pub fn message(h: &mut String, m: &Message) {
    *h += &format!("<p class=\"warn\">{}<br/><small>{}", escape(&m.message), escape(&m.code));
    let line = m.line.map(|line| format!("line {line}"));
    for part in [&m.file, &line, &m.place, &m.help].into_iter().flatten() {
        *h += &format!(" &#183; {}", escape(part));
    }
    *h += "</small></p>\n";
}

/// Any text as text of a page.
pub fn escape(text: &str) -> String {
    clean(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
