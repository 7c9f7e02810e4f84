//! Properties of tables: nothing is lost, nothing is split that belongs together, nothing is too wide.

use super::*;
use terrace_core::random::Random;

fn sample() -> Table {
    let mut table = Table::new(
        "Systems",
        vec![
            Column::text("system"),
            Column::count("stops"),
            Column::number("worst FOD", "um", 2),
            Column::number("top speed", "mm/s²", 0),
            Column::time("time"),
            Column::share("marks within limits"),
        ],
    );
    table.row(["stepped".into(), 2952usize.into(), 35.0.into(), Cell::Missing, 11_520.0.into(), 100.0.into()]);
    table.row(["a, \"b\" | c".into(), None::<u64>.into(), (-0.001).into(), 7.5.into(), 4.24.into(), 99.97.into()]);
    table.row(["fly".into(), 0usize.into(), f64::NAN.into(), f64::INFINITY.into(), Cell::Missing, 0.01.into()]);
    table
}

/// The cells of a CSV text, by the letter of RFC 4180.
fn parsed(text: &str) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    let mut row = Vec::new();
    let mut cell = String::new();
    let mut quoted = false;
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '"' if quoted && chars.peek() == Some(&'"') => cell.extend(chars.next()),
            '"' => quoted = !quoted,
            ',' if !quoted => row.push(std::mem::take(&mut cell)),
            '\n' if !quoted => {
                row.push(std::mem::take(&mut cell));
                rows.push(std::mem::take(&mut row));
            }
            _ => cell.push(c),
        }
    }
    assert!(!quoted && cell.is_empty() && row.is_empty(), "the text ends with its last row");
    rows
}

#[test]
fn shares_are_never_rounded_to_0_or_100_percent() {
    let want = "\
Systems

                   worst    top                 marks
                     FOD  speed                within
system      stops     um  mm/s²        time    limits
----------  -----  -----  -----  ----------  --------
stepped      2952  35.00      -  3 h 12 min   100.0 %
a, \"b\" | c      -   0.00      8       4.2 s  > 99.9 %
fly             0      -      -           -   < 0.1 %
";
    assert_eq!(sample().text(TERMINAL), want);
}

#[test]
fn keys_are_snake_case_with_the_unit_behind() {
    let table = sample();
    assert_eq!(
        table.keys(),
        ["system", "stops", "worst_fod_um", "top_speed_mm_s2", "time_s", "marks_within_limits_percent"]
    );
    let twice = Table::new("", vec![Column::number("A–C", "°", 1), Column::number("a/c", "deg", 1)]);
    assert_eq!(twice.keys(), ["a_c_deg", "a_c_deg_2"]);
}

#[test]
fn json_is_an_array_of_objects_in_the_order_of_the_columns() {
    let text = sample().json();
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(
        json,
        serde_json::json!([
            {"system": "stepped", "stops": 2952, "worst_fod_um": 35.0, "top_speed_mm_s2": null, "time_s": 11520.0,
             "marks_within_limits_percent": 100.0},
            {"system": "a, \"b\" | c", "stops": null, "worst_fod_um": -0.001, "top_speed_mm_s2": 7.5, "time_s": 4.24,
             "marks_within_limits_percent": 99.97},
            {"system": "fly", "stops": 0, "worst_fod_um": null, "top_speed_mm_s2": null, "time_s": null,
             "marks_within_limits_percent": 0.01},
        ])
    );
    let order: Vec<usize> = sample().keys().iter().map(|k| text.find(k.as_str()).expect("a key")).collect();
    assert!(order.is_sorted(), "{order:?}");
}

#[test]
fn markdown_has_a_cell_for_every_column_and_keeps_bars_inside() {
    let text = sample().markdown();
    let lines: Vec<&str> = text.lines().skip(2).collect();
    assert_eq!(lines[0], "| system | stops | worst FOD, um | top speed, mm/s² | time | marks within limits |");
    assert_eq!(lines[1], "| --- | ---: | ---: | ---: | ---: | ---: |");
    assert_eq!(lines[2], "| stepped | 2952 | 35.00 | - | 3 h 12 min | 100.0 % |");
    assert_eq!(lines[3], "| a, \"b\" \\| c | - | 0.00 | 8 | 4.2 s | > 99.9 % |");
    assert_eq!(lines[4], "| fly | 0 | - | - | - | \\< 0.1 % |");
}

#[test]
fn wide_table_is_split_and_its_first_column_repeated() {
    let columns: Vec<Column> = [Column::text("system")]
        .into_iter()
        .chain((0..30).map(|k| Column::number(&format!("figure-{k}"), "um", 2)))
        .collect();
    let mut table = Table::new("", columns);
    for r in 0..3 {
        let cells = [Cell::from(format!("system-{r}"))].into_iter().chain((0..30).map(|k| f64::from(k * 7 + r).into()));
        table.push(cells.collect());
    }
    let text = table.text(TERMINAL);
    assert!(text.lines().all(|l| length(l) <= TERMINAL), "{text}");
    let blocks = text.matches("system-1").count();
    assert!(blocks >= 3, "{text}");
    for k in 0..30 {
        let value = format!(" {}.00", k * 7 + 1);
        assert_eq!(text.matches(&format!("figure-{k}\n")).count() + text.matches(&format!("figure-{k} ")).count(), 1);
        assert!(text.contains(&value), "{value}\n{text}");
    }
}

#[test]
fn long_words_are_wrapped_and_controls_do_not_reach_the_terminal() {
    let mut table = Table::new("t\u{1b}[2J", vec![Column::text("a"), Column::text("note")]);
    let note = "the scanner saturates where the part is steep, at the rim and at the edge of the blank";
    table.row(["x".into(), note.into()]);
    table.row(["y\tz\n".into(), "w".repeat(95).into()]);
    let text = table.text(TERMINAL);
    assert!(text.lines().all(|l| length(l) <= WORDS[0] + 5), "{text}");
    assert!(!text.contains('\u{1b}') && !text.contains('\t'), "{text}");
    let words: Vec<&str> = text.split_whitespace().collect();
    assert_eq!(words.join(" ").matches("saturates where the part is steep, at the rim and").count(), 1, "{text}");
    assert_eq!(text.matches('w').count(), 95 + note.matches('w').count());
}

#[test]
#[should_panic(expected = "cannot hold")]
fn column_refuses_values_of_another_kind() {
    Table::new("", vec![Column::count("n")]).row([0.5.into()]);
}

/// A whole number of any size, or none.
fn count(noise: &mut Random) -> Option<u64> {
    [None, Some(0), Some(u64::MAX), Some(noise.bits() >> noise.below(64))][noise.below(4)]
}

#[test]
fn csv_round_trips() {
    for seed in 0..256 {
        let mut noise = Random::case(seed);
        let row = |noise: &mut Random| (noise.words(12, "\n\r\t\"',;µ|=+-@"), count(noise), noise.float());
        let rows: Vec<_> = (0..noise.below(6)).map(|_| row(&mut noise)).collect();
        let mut table = Table::new("", vec![Column::text("a,b"), Column::count("n"), Column::number("v", "um", 1)]);
        for (words, n, v) in &rows {
            table.row([words.as_str().into(), (*n).into(), (*v).into()]);
        }
        let back = parsed(&table.csv());
        assert_eq!(&back[0], &["a_b", "n", "v_um"], "seed {seed}");
        assert_eq!(back.len(), rows.len() + 1, "seed {seed}");
        for (cells, (words, n, v)) in back[1..].iter().zip(&rows) {
            // What a spreadsheet would compute has an apostrophe in front, and nothing else has one more than it had.
            let is_formula = words.starts_with(['=', '+', '-', '@', '\t', '\r']) && words.parse::<f64>().is_err();
            let apostrophe = if is_formula { "'" } else { "" };
            assert_eq!(cells[0], format!("{apostrophe}{words}"), "seed {seed}");
            assert_eq!(cells[1].parse().ok(), *n, "seed {seed}");
            assert_eq!(cells[2].parse().ok(), Some(*v).filter(|v| v.is_finite()), "seed {seed}");
        }
    }
}

#[test]
fn no_cell_of_csv_begins_a_formula() {
    for (text, cell) in [
        ("=1+1", "'=1+1"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("+ zoom of xyz-zoom-40", "'+ zoom of xyz-zoom-40"),
        ("-rf", "'-rf"),
        ("\t=1", "'\t=1"),
        ("-2 deg", "'-2 deg"),
        // Numbers stay numbers, and what is quoted stays quoted.
        ("-2.5e-3", "-2.5e-3"),
        ("+7", "+7"),
        ("=A1,B1", "\"'=A1,B1\""),
        ("a=1", "a=1"),
    ] {
        assert_eq!(csv_cell(text), cell);
    }
}

#[test]
fn json_round_trips() {
    for seed in 0..256 {
        let mut noise = Random::case(seed);
        let (words, n, v) = (noise.text(20), count(&mut noise), noise.float());
        let mut table = Table::new("", vec![Column::text("a"), Column::count("n"), Column::number("v", "", 1)]);
        table.row([words.as_str().into(), n.into(), v.into()]);
        let json: serde_json::Value = serde_json::from_str(&table.json()).expect("JSON");
        assert_eq!(json[0]["a"].as_str(), Some(words.as_str()), "seed {seed}");
        assert_eq!(json[0]["n"].as_u64(), n, "seed {seed}");
        // The text is exact; not every reader of JSON is.
        let text = table.json();
        let number = text.split("\"v\": ").nth(1).and_then(|t| t.split_whitespace().next());
        assert_eq!(number.and_then(|n| n.parse().ok()), Some(v).filter(|v| v.is_finite()), "seed {seed}");
    }
}

#[test]
fn text_is_never_too_wide() {
    for seed in 0..256 {
        let mut noise = Random::case(seed);
        let words: Vec<String> = (0..noise.between(1, 7)).map(|_| noise.text(60)).collect();
        let width = 90 + noise.below(50);
        let mut table = Table::new("", words.iter().map(|w| Column::text(w)).collect());
        table.push(words.iter().map(|w| w.as_str().into()).collect());
        assert!(table.text(width).lines().all(|l| length(l) <= width), "seed {seed}: {words:?} in {width}");
    }
}

#[test]
fn every_row_of_markdown_has_as_many_bars() {
    for seed in 0..256 {
        let mut noise = Random::case(seed);
        let words: Vec<String> = (0..noise.between(1, 4)).map(|_| noise.words(20, "\n|\\*")).collect();
        let mut table = Table::new("", words.iter().map(|w| Column::text(w)).collect());
        table.push(words.iter().map(|w| w.as_str().into()).collect());
        for line in table.markdown().lines() {
            let line = line.replace("\\\\", "").replace("\\|", "");
            assert_eq!(line.matches('|').count(), words.len() + 1, "seed {seed}: {line}");
        }
    }
}
