//! Slips in a TOML text that other notations allow: what is wrong with a line that cannot be parsed, and how it is
//! written.

/// What is wrong, and what to write instead.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Slip {
    pub(super) fault: String,
    pub(super) remedy: String,
}

/// The slip in a line, if it is a known one; `message` is what the parser said.
pub(super) fn slip(line: &str, message: &str) -> Option<Slip> {
    let line = line.trim();
    let of = |fault: String, remedy: String| Some(Slip { fault, remedy });
    if message.contains("duplicate key") {
        let key = line.split(['=', '.', ']']).next().unwrap_or(line).trim_matches(['[', ' ']);
        return of(format!("{key} is set twice"), "delete one of the two".into());
    }
    if ["//", "/*", ";", "--", "%"].iter().any(|sign| line.starts_with(sign)) {
        return of("this is no comment".into(), "a comment begins with #".into());
    }
    let end = if line.starts_with("[[") { "]]" } else { "]" };
    let name = line.trim_end_matches([']', ' ']);
    let is_name = name.trim_start_matches('[').chars().all(|c| c.is_alphanumeric() || "_-.".contains(c));
    if line.starts_with('[') && !line.ends_with(end) && is_name {
        let remedy = format!("write {name}{end}");
        return of("the name of a table is not closed".into(), remedy);
    }
    let joint = line.find(['=', ':'])?;
    let (key, rest) = line.split_at(joint);
    let key = key.trim();
    let is_key = key.chars().all(|c| c.is_alphanumeric() || "_-.\"'".contains(c)) && key.matches('"').count() % 2 == 0;
    if key.is_empty() || !is_key {
        return None;
    }
    let sign = rest.chars().take_while(|c| "=:".contains(*c)).count();
    let value = rest[sign..].trim();
    if !rest.starts_with('=') || sign > 1 {
        return of("a key and its value are joined by =".into(), format!("write {key} = {}", as_value(value)));
    }
    if value.is_empty() {
        return of(format!("{key} has no value"), "write one behind the =, or delete the line".into());
    }
    if let Some(quote @ ('"' | '\'')) = value.chars().next() {
        let inner = &value[1..];
        if !inner.contains(quote) && !value.starts_with("\"\"\"") && !value.starts_with("'''") {
            let text = inner.split('#').next().unwrap_or(inner).trim_end();
            return of("a quote is not closed".into(), format!("write {key} = {quote}{text}{quote}"));
        }
        let after = inner.split(quote).nth(1).unwrap_or_default().trim();
        let is_end = matches!(after, ";" | ",");
        return if is_end { of(format!("{after} does not end a line"), "delete it".into()) } else { None };
    }
    if let Some(plain) = value.strip_suffix([';', ',']) {
        return of("a line ends with its value".into(), format!("write {key} = {}", as_value(plain.trim())));
    }
    let written = as_value(value.split('#').next().unwrap_or(value).trim());
    let is_bare = value.starts_with(|c: char| c.is_alphanumeric() || "./~-+".contains(c));
    (is_bare && written != value)
        .then(|| Slip { fault: "this is no value of TOML".into(), remedy: format!("write {key} = {written}") })
}

/// A value as TOML has it: what is not a number, a date, true or false is a text, and texts are in quotes.
fn as_value(value: &str) -> String {
    match value.to_ascii_lowercase().as_str() {
        "true" | "yes" | "on" => return "true".into(),
        "false" | "no" | "off" => return "false".into(),
        _ => {}
    }
    let is_whole = value.starts_with(['"', '\'', '[', '{']) || value.parse::<f64>().is_ok();
    // In double quotes a backslash begins an escape.
    if is_whole || value.is_empty() { value.into() } else { format!("\"{}\"", value.replace('\\', "/")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_of_other_notations_are_told_with_what_to_write() {
        for (line, message, fault, remedy) in [
            ("pdof: \"0.07 mm\"", "", "a key and its value are joined by =", "write pdof = \"0.07 mm\""),
            ("pdof: 0.07 mm", "", "a key and its value are joined by =", "write pdof = \"0.07 mm\""),
            ("pitch == 3", "", "a key and its value are joined by =", "write pitch = 3"),
            ("fill = True", "", "this is no value of TOML", "write fill = true"),
            ("fill = no", "", "this is no value of TOML", "write fill = false"),
            ("pdof = 0.07 mm", "", "this is no value of TOML", "write pdof = \"0.07 mm\""),
            ("file = parts/a.stl # the part", "", "this is no value of TOML", "write file = \"parts/a.stl\""),
            (r"file = C:\parts\a.stl", "", "this is no value of TOML", "write file = \"C:/parts/a.stl\""),
            ("pdof = \"0.07 mm", "", "a quote is not closed", "write pdof = \"0.07 mm\""),
            ("pdof = \"0.07 mm\";", "", "; does not end a line", "delete it"),
            ("count = 3,", "", "a line ends with its value", "write count = 3"),
            ("pdof =", "", "pdof has no value", "write one behind the =, or delete the line"),
            ("// leather", "", "this is no comment", "a comment begins with #"),
            ("[focus", "", "the name of a table is not closed", "write [focus]"),
            ("[[pen]", "", "the name of a table is not closed", "write [[pen]]"),
            ("pdof = \"1 mm\"", "duplicate key", "pdof is set twice", "delete one of the two"),
            ("[focus]", "duplicate key", "focus is set twice", "delete one of the two"),
        ] {
            let found = slip(line, message).map(|s| (s.fault, s.remedy));
            assert_eq!(found, Some((fault.into(), remedy.into())), "{line}");
        }
        for line in [
            "[1, 2],",
            "[\"a\"",
            "\"C:\", \"x",
            "pdof = \"0.07 mm\"",
            "a = [1, 2",
            "x",
            "name = \"a\" b",
            "count = 3",
            "",
        ] {
            assert_eq!(slip(line, "expected newline"), None, "{line}");
        }
    }
}
