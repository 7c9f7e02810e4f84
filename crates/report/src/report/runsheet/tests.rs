use terrace_core::machine::{FieldShape, Machine};
use terrace_core::program::sample;
use terrace_core::units::Length;
use terrace_plan::manifest::sample::{machine, with_facts, with_sample};

use super::{Sheet, csv, txt};

#[test]
fn table_has_a_line_per_block_and_quotes_separators() {
    let text = with_sample(|facts| String::from_utf8(csv(&Sheet::new(facts))).expect("UTF-8"));
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 4);
    let third = "B0003,1,0,1,-41.000000,2.000000,0.405000,0.105000,blocks/B0003.dxf,2,250.000,";
    assert!(lines[3].starts_with(third), "{}", lines[3]);
    assert!(lines[3].ends_with(",0.125,fill; edge (fine),1,1,200.000000,0.000000"), "{}", lines[3]);
    assert!(lines.iter().all(|l| l.split(',').count() == 18));
}

#[test]
fn run_sheet_lists_settings_that_the_files_do_not_carry() {
    let text = with_sample(|facts| String::from_utf8(txt(&Sheet::new(facts))).expect("UTF-8"));
    for needed in
        ["10 mm", "pilot laser", "not a safety system", "60 % = 8.4 W", "hood.toml", "WARNING    steep places"]
    {
        assert!(text.contains(needed), "{needed}\n{text}");
    }
    for i in 1..=3 {
        assert_eq!(text.matches(&format!("\n[ ] B000{i} ")).count(), 1);
    }
    assert!(text.lines().all(|l| l.len() <= 132), "fits on paper");
}

#[test]
fn run_sheets_say_where_to_lift() {
    // The third block asks for it. Before the first block the stage position is unknown.
    let sheets = with_sample(|facts| [csv(&Sheet::new(facts)), txt(&Sheet::new(facts))]);
    let [csv, txt] = sheets.map(|bytes| String::from_utf8(bytes).expect("UTF-8"));
    let lifts: Vec<&str> = csv.lines().filter_map(|l| l.rsplit(',').nth(1)).collect();
    assert_eq!(lifts, ["lift_z_mm", "200.000000", "", "200.000000"]);
    let lines: Vec<&str> = txt.lines().collect();
    let follows = |id: &str| {
        lines
            .windows(2)
            .any(|w| w[0] == format!("  LIFT to Z200.0000, then go to {id}") && w[1].starts_with(&format!("[ ] {id} ")))
    };
    assert_eq!(["B0001", "B0002", "B0003"].map(follows), [true, false, true], "{txt}");
}

#[test]
fn the_run_sheet_says_what_of_the_field_is_used() {
    let sheet = |machine: &Machine| {
        with_facts(sample::program(), machine, |facts| String::from_utf8(txt(&Sheet::new(facts))).expect("UTF-8"))
    };
    let mut m = machine();
    assert!(sheet(&m).contains("field      40 x 40 mm\n"));
    m.lens.margin = Length::mm(1.5);
    assert!(sheet(&m).contains("field      40 x 40 mm, of which 37 x 37 mm are used\n"));
    m.lens.shape = FieldShape::Circle;
    m.lens.field = [Length::mm(90.0); 2];
    m.lens.margin = Length::mm(2.0);
    assert!(sheet(&m).contains("field      circle of 90 mm, of which 60.811 x 60.811 mm are used\n"));
}
