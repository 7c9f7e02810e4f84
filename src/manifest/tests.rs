use std::path::Path;

use super::*;
use crate::diag::Diag;
use crate::geom::Nm;
use crate::job::{Overrides, SAMPLE_JOB};
use crate::machine::{FieldShape, Origin};
use crate::program::{BlockFigures, Program, sample};
use crate::report::runsheet::{Sheet, csv as runsheet_csv, txt as runsheet_txt};
use crate::units::Length;

fn machine() -> Machine {
    Machine::built_in("xyz-galvo-40").expect("profile")
}

/// The facts of the sample program, given to `use_them`.
fn with_sample<R>(use_them: impl FnOnce(&Facts<'_>) -> R) -> R {
    with(sample::program(), &machine(), use_them)
}

fn with<R>((program, origin): (Program, Origin), machine: &Machine, use_them: impl FnOnce(&Facts<'_>) -> R) -> R {
    let figures = vec![BlockFigures { time_s: 0.125, ..BlockFigures::default() }; program.blocks.len()];
    let checked = Checked::unchecked(program, origin);
    let job = Job::parse(Path::new("hood.toml"), SAMPLE_JOB, &Overrides::default()).expect("sample job");
    let sections =
        Sections { origin: crate::geom::P2::new(-20_000_000, -20_000_001), pitch: [Nm(40_000_000); 2], count: [2, 1] };
    let summary = Summary {
        stops: 3,
        method: "contour".into(),
        warnings: vec![Message::from(&Diag::warning("steep", "steep places"))],
        ..Summary::default()
    };
    use_them(&Facts {
        job_file: "../hood.toml",
        job: &job,
        machine,
        checked: &checked,
        passes: vec![(&sections, None)],
        depth_mm: 0.07,
        tessellation_mm: None,
        figures: &figures,
        summary: &summary,
    })
}

#[test]
fn the_manifest_has_its_keys_in_order_and_exact_millimetres() {
    let text = with_sample(|facts| {
        let inputs = vec![InputFact { role: "surface".into(), file: "hood.stl".into(), bytes: 3, blake3: "ef".into() }];
        let files = vec![FileFact { file: "program.txt".into(), bytes: 7, blake3: "ab".into() }];
        let head = Head { files, ..Head::new(facts.job, facts.job_file.into(), inputs) };
        String::from_utf8(manifest(&head, facts)).expect("UTF-8")
    });
    let keys: Vec<&str> = text.lines().filter(|l| l.starts_with("  \"")).filter_map(|l| l.split('"').nth(1)).collect();
    assert_eq!(
        keys,
        [
            "schema",
            "terrace",
            "mode",
            "job",
            "inputs",
            "seed",
            "objective",
            "files",
            "machine",
            "placement",
            "focus",
            "seams",
            "passes",
            "setups",
            "pens",
            "blocks",
            "summary"
        ]
    );
    assert!(text.ends_with("}\n"));
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(json["passes"][0]["sections"]["origin_mm"], serde_json::json!([-20.0, -20.000001]));
    assert_eq!(json["placement"]["origin_mm"], serde_json::json!([1.0, -2.0, 0.3]));
    assert_eq!(json["pens"][1]["power"], "3.5 W");
    assert_eq!(json["pens"][0]["power_w"], 8.4);
    let block = &json["blocks"][2];
    assert_eq!(block["id"], "B0003");
    assert_eq!(block["stage"], serde_json::json!([-41.0, 2.0, 0.405]));
    assert_eq!((&block["lpfl_mm"], &block["z_lo_mm"]), (&0.105.into(), &0.0701.into()));
    assert_eq!(block["pens"], serde_json::json!(["fill", "edge (fine)"]));
    assert_eq!(block["files"], serde_json::json!({"dxf": "blocks/B0003.dxf"}));
    assert_eq!((&block["strokes"], &block["time_s"]), (&2.into(), &0.125.into()));
    assert_eq!(json["focus"]["level"], "mid");
    assert_eq!(json["job"]["file"], "../hood.toml");
}

#[test]
fn table_has_a_line_per_block_and_quotes_separators() {
    let text = with_sample(|facts| String::from_utf8(runsheet_csv(&Sheet::new(facts))).expect("UTF-8"));
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 4);
    let third = "B0003,1,0,1,-41.000000,2.000000,0.405000,0.105000,blocks/B0003.dxf,2,250.000,";
    assert!(lines[3].starts_with(third), "{}", lines[3]);
    assert!(lines[3].ends_with(",0.125,fill; edge (fine),1,1,200.000000,0.000000"), "{}", lines[3]);
    assert!(lines.iter().all(|l| l.split(',').count() == 18));
}

#[test]
fn run_sheet_lists_settings_that_the_files_do_not_carry() {
    let text = with_sample(|facts| String::from_utf8(runsheet_txt(&Sheet::new(facts))).expect("UTF-8"));
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
    let (csv, txt) = with_sample(|facts| (runsheet_csv(&Sheet::new(facts)), runsheet_txt(&Sheet::new(facts))));
    let [csv, txt] = [csv, txt].map(|bytes| String::from_utf8(bytes).expect("UTF-8"));
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
fn durations_are_formatted_in_words() {
    let said = [0.0, 4.24, 59.94, 59.96, 725.2, 3599.6, 11_520.0].map(duration);
    assert_eq!(said, ["0.0 s", "4.2 s", "59.9 s", "1 min 0 s", "12 min 5 s", "1 h 0 min", "3 h 12 min"]);
    assert_eq!(duration(-1.0), "0.0 s");
}

#[test]
fn the_run_sheet_says_what_of_the_field_is_used() {
    let sheet = |machine: &Machine| {
        with(sample::program(), machine, |facts| String::from_utf8(runsheet_txt(&Sheet::new(facts))).expect("UTF-8"))
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
