//! docs/explanation/compare.md: its regions that hold figures of runs, and that nothing else of it holds any.

use std::sync::Mutex;

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/explanation/compare.md");

fn page() -> String {
    std::fs::read_to_string(PAGE).expect("docs/explanation/compare.md")
}

/// What stands before, in and after a region of the page.
fn region<'a>(page: &'a str, name: &str) -> [&'a str; 3] {
    let (begin, end) = (format!("<!-- make sources: {name} -->\n"), format!("<!-- end of {name} -->\n"));
    let begins =
        page.find(&begin).unwrap_or_else(|| panic!("docs/explanation/compare.md has no {begin}")) + begin.len();
    let ends = begins + page[begins..].find(&end).unwrap_or_else(|| panic!("docs/explanation/compare.md has no {end}"));
    [&page[..begins], &page[begins..ends], &page[ends..]]
}

/// Holds a region against what the program gives, or writes it.
pub fn hold(name: &str, made: &str) {
    static WRITING: Mutex<()> = Mutex::new(());
    let _one_at_a_time = WRITING.lock();
    let page = page();
    let [before, is, after] = region(&page, name);
    let made = format!("\n{}\n\n", made.trim_end());
    if std::env::var_os("SOURCES").is_some_and(|v| v == "write") {
        std::fs::write(PAGE, format!("{before}{made}{after}")).expect("a writable page");
    } else {
        assert_eq!(
            is, made,
            "docs/explanation/compare.md, {name}, against the program (right): `make sources` writes it"
        );
    }
}

pub fn table(head: &[&str], rows: Vec<Vec<String>>) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let head: Vec<String> = head.iter().map(|&h| h.to_owned()).collect();
    let rule = format!("|{}\n", "---|".repeat(head.len()));
    line(&head) + &rule + &rows.iter().map(|row| line(row)).collect::<String>()
}

/// A paragraph, in lines of up to 100 columns; those of a list are indented.
pub fn wrapped(text: &str) -> String {
    let indent = if text.starts_with("- ") { "  " } else { "" };
    let (mut out, mut column) = (String::new(), 0);
    for word in text.split_whitespace() {
        let length = word.chars().count();
        if column > 0 && column + 1 + length > 100 {
            out += &format!("\n{indent}");
            column = indent.len();
        } else if column > 0 {
            out.push(' ');
            column += 1;
        }
        out += word;
        column += length;
    }
    out + "\n"
}

/// What the page states in figures apart from its tables: settings of the models, equations and years. Figures of a run
/// belong into a region of `make sources`.
const SETTINGS: [&str; 35] = [
    "Ma et al. 2025",
    "Cui et al. 2021",
    "Cao and Zhu 2013",
    "10 deg by default",
    "more than 5 % quicker",
    "eq. 1 to 4",
    "eq. 4",
    "eq. 8 and 9",
    "eq. 5",
    "4 sigma",
    "30,000 um",
    "factors of 0.95",
    "z = 0",
    "20 Hz and 1 kHz",
    "damping of 0.7",
    "sqrt(2)",
    "20,000 samples",
    "first 20 m",
    "to 0.1 %",
    "2D head",
    "mean, median, 95 %, worst",
    "\"of 95 %\" means that 95 of 100",
    "1 mm apart",
    "steps of 1 ms",
    "500,000",
    "300,000 to 2,400,000",
    "Cui et al. (2021)",
    "Eagar and Tsai 1983, eq. 12",
    "25 W/(m K)",
    "8190 kg/m3",
    "600 J/(kg K)",
    "limits 1 % is left",
    "more than 15 deg",
    "average over 0.1 s",
    "1 - (S7 / S5) (T5 / T7)",
];

#[test]
fn the_systems_of_the_page_are_those_of_the_table() {
    let systems = terrace_compare::compare::SYSTEMS.iter();
    let rows = systems.map(|system| vec![format!("`{}`", system.name), system.about.to_owned()]);
    hold("systems", &table(&["name", "system"], rows.collect()));
}

#[test]
fn every_region_of_the_page_is_made_and_has_every_system() {
    let page = page();
    let regions: Vec<&str> = page.split("<!-- make sources: ").skip(1).collect();
    assert_eq!(regions.len(), 10);
    for text in regions {
        let name = text.split(" -->").next().expect("a name");
        let made = region(&page, name)[1];
        assert!(
            made.trim().lines().count() > 1,
            "docs/explanation/compare.md, {name}, is empty: `make sources` writes it"
        );
    }
    for name in ["times", "deviations"] {
        let rows = region(&page, name)[1].lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
        let systems: Vec<&str> = terrace_compare::compare::SYSTEMS.iter().map(|s| s.name).collect();
        assert_eq!(rows.collect::<Vec<_>>(), systems, "docs/explanation/compare.md, {name}: `make sources` writes it");
    }
}

#[test]
fn page_has_no_figures_of_runs_but_those_of_its_tables() {
    let page = page();
    // Regions and fenced blocks, which are held against the program, go.
    let (mut prose, mut until) = (String::new(), None);
    for line in page.lines() {
        match until {
            Some(end) if line.starts_with(end) => until = None,
            Some(_) => {}
            None if line.starts_with("```") => until = Some("```"),
            None if line.starts_with("<!-- make sources: ") => until = Some("<!-- end of "),
            None if line.starts_with("<!-- ") => {}
            None => prose += &format!("{line}\n"),
        }
    }
    // So do names of systems and files, which stand in backquotes.
    let plain: String = prose.split('`').step_by(2).collect::<Vec<_>>().join("");
    let words = plain.split_whitespace().collect::<Vec<_>>().join(" ");
    let left = SETTINGS.iter().fold(words, |text, setting| {
        assert!(text.contains(setting), "docs/explanation/compare.md does not state {setting:?}");
        text.replace(setting, "")
    });
    let left: Vec<&str> = left.split(' ').collect();
    let figures = left.iter().enumerate().filter(|(_, w)| w.contains(|c: char| c.is_ascii_digit()));
    let figures: Vec<String> =
        figures.map(|(i, _)| left[i.saturating_sub(3)..(i + 3).min(left.len())].join(" ")).collect();
    assert!(figures.is_empty(), "docs/explanation/compare.md: figures that are not settings, {figures:#?}");
    // The blocks that show output are those that the documents' own test runs.
    for block in page.split("\n```text\n").collect::<Vec<_>>().split_last().expect("blocks").1 {
        assert!(block.lines().last().is_some_and(|l| l.starts_with("<!-- output: ")), "output without its command");
    }
}
