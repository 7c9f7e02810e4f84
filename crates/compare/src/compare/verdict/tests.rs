//! Sentences, notes and pages of made comparisons.

use super::*;
use crate::compare::{Curves, Split, page};
use terrace_core::diag::{Diag, Error};
use terrace_plan::manifest::Loading;
use terrace_plan::on_the_fly::decompose::Limits;
use terrace_plan::on_the_fly::statistics::Statistics;

/// A system within all limits that takes so long, with beams at so many degrees.
fn figures(time_s: f64, incidence: f64) -> Figures {
    let worst = |worst| Statistics { worst, ..Statistics::default() };
    Figures {
        time: Split { mark: time_s, ..Split::default() },
        focus_um: worst(35.0),
        incidence_deg: worst(incidence),
        within: 100.0,
        stops: 7,
        ..Figures::default()
    }
}

fn made(time_s: f64, incidence: f64) -> Figures {
    Figures { job_key: Some("partition.method = \"z-range\"".into()), ..figures(time_s, incidence) }
}

fn beyond(beyond: Beyond, figures: Figures) -> Figures {
    Figures { beyond: vec![beyond], within: 12.0, ..figures }
}

fn comparison(rows: Vec<(&'static str, Result<Figures, Error>)>) -> Comparison {
    Comparison {
        job: "job".into(),
        machine: "xyz-galvo-40".into(),
        limits: Limits { half_depth: 0.035, angle: 20f64.to_radians(), field: 28.0 },
        marked_mm: 1000.0,
        passes: 1,
        loading: Loading { way: LoadingWay::Ovf, ..Loading::default() },
        galvo: terrace_core::motion::GalvoModel::AtSpeed,
        cost: None,
        key_costs: Vec::new(),
        rows: rows.into_iter().map(|(system, figures)| Row { system, figures }).collect(),
        curves: Curves::default(),
        warnings: Vec::new(),
    }
}

/// The example of the issue: a steep part on a machine of three axes.
fn example() -> Comparison {
    let lent = |hardware, f: Figures| Ok(Figures { hardware, job_key: None, ..f });
    let sync = Figures { is_held_by_z: true, ..figures(2290.0, 18.8) };
    comparison(vec![
        ("flat", Ok(beyond(Beyond::Focus([4012.0, 35.0]), figures(60.0, 18.8)))),
        ("contour", Ok(made(240.0, 18.8))),
        ("z-range", Ok(made(229.0, 18.8))),
        ("zoom", lent(Hardware::WithZoom("xyz-zoom-40"), figures(115.0, 18.8))),
        ("sync", lent(Hardware::Synchronised, sync)),
        ("7-axis", lent(Hardware::Other("xyzac-galvo-10"), figures(687.0, 1.8))),
    ])
}

#[test]
fn fastest_system_of_the_machine_is_recommended_and_the_others_are_compared_with_it() {
    let verdict = Verdict::of(&example());
    assert_eq!(verdict.recommended, Some("z-range"));
    assert_eq!(
        verdict.sentences,
        [
            "On xyz-galvo-40, step by z-range: 3 min 49 s, all in focus.",
            "In the job file: partition.method = \"z-range\"; without a method compile chooses one, and merges stops \
             where that is quicker.",
            "A zoom optic (that of xyz-zoom-40) takes half as long.",
            "Marking on the fly (with a controller that moves scanner and stage together) takes 10 times as long, because \
             z must go with every line.",
            "Seven axes (those of xyzac-galvo-10) take 3 times as long, with beams at up to 1.8 instead of 18.8 deg.",
            "Beyond the limits: flat (4 mm out of focus, 0.035 mm allowed).",
        ]
    );
    let notes: Vec<String> = (0..6).map(|k| verdict.note(k)).collect();
    assert_eq!(
        notes,
        [
            "not usable: 4 mm out of focus, 0.035 mm allowed",
            "as fast",
            "recommended",
            "2 times as fast, other hardware",
            "10 times as long, other hardware",
            "3 times as long, other hardware"
        ]
    );
}

#[test]
fn systems_beyond_limits_on_other_hardware_or_not_made_by_compile_are_never_recommended() {
    let limits = [
        Beyond::Focus([36.0, 35.0]),
        Beyond::Incidence([21.0, 20.0]),
        Beyond::Displacement([29.0, 28.0]),
        Beyond::TooSharp,
        Beyond::Travel("x needs 700 mm of travel".into()),
    ];
    for limit in limits {
        // The travel may be too short though every mark keeps the limits.
        for within in [100.0, 99.96] {
            let quick = Figures { within, ..beyond(limit.clone(), made(1.0, 18.8)) };
            let c = comparison(vec![("contour", Ok(quick.clone())), ("window", Ok(made(300.0, 18.8)))]);
            assert_eq!(Verdict::of(&c).recommended, Some("window"), "{limit}");
            let is_warned = matches!(limit, Beyond::Incidence(_));
            let standing = if is_warned { Standing::YoursToSet } else { Standing::BeyondLimits };
            assert_eq!(Verdict::of(&c).systems[0].standing, standing, "{limit}");
            assert_eq!(Verdict::of(&comparison(vec![("contour", Ok(quick))])).recommended, None, "{limit}");
        }
    }
    // Not even where no single limit is named.
    let nearly = Figures { within: 99.999, ..made(1.0, 18.8) };
    assert_eq!(Verdict::of(&comparison(vec![("contour", Ok(nearly))])).recommended, None);
    let lent = Figures { hardware: Hardware::WithTilt("xyz-tilt-galvo-40"), ..made(1.0, 0.0) };
    let c = comparison(vec![("tilt", Ok(lent)), ("sync-bands", Ok(figures(2.0, 18.8)))]);
    let standings = Verdict::of(&c).systems.iter().map(|s| s.standing).collect::<Vec<_>>();
    assert_eq!(standings, [Standing::OtherHardware, Standing::EstimateOnly]);
}

#[test]
fn nothing_is_recommended_where_no_system_of_the_machine_keeps_the_limits() {
    let mut c = example();
    let steep = Beyond::Incidence([24.0, 20.0]);
    for row in &mut c.rows[1..3] {
        row.figures = Ok(beyond(steep.clone(), row.figures.clone().expect("figures")));
        row.figures.as_mut().expect("figures").incidence_deg.worst = 24.0;
    }
    let Verdict { recommended, job_key, sentences, systems } = Verdict::of(&c);
    assert_eq!((recommended, job_key), (None, None));
    assert_eq!(
        sentences[..3],
        [
            "Yours to set: z-range takes 3 min 49 s, all in focus, with beams at up to 24 deg; limits.warn_incidence \
             of the job file is 20 deg, above which compile warns.",
            "In the job file: partition.method = \"z-range\"; without a method compile chooses one, and merges stops \
             where that is quicker.",
            "A zoom optic (that of xyz-zoom-40) takes 1 min 55 s, within all limits.",
        ]
    );
    let last = [
        "Beyond limits.warn_incidence alone, which is yours to set: contour and z-range (beam incidence 24 deg, 20 \
         deg allowed).",
        "Beyond the limits: flat (4 mm out of focus, 0.035 mm allowed).",
    ];
    assert_eq!(sentences[sentences.len() - 2..], last);
    assert_eq!(Verdict::of(&c).note(2), "yours to set: beam incidence 24 deg, 20 deg allowed by limits.warn_incidence");
    assert!(!page(&c).contains("<s>z-range</s>") && page(&c).contains("<s>flat</s>"));
    // What the times leave out is said here too.
    c.loading.way = LoadingWay::Run;
    c.rows[2].figures.as_mut().expect("figures").load_s = Some(0.0);
    assert!(Verdict::of(&c).sentences[1].starts_with("No time here includes"), "{:?}", Verdict::of(&c).sentences);
    // Where nothing else than that keeps a machine from it, nothing is recommended and nothing is struck out.
    c.rows.truncate(1);
    assert_eq!(Verdict::of(&c).sentences[0], "None of these systems keeps all limits on xyz-galvo-40.");
    assert!(systems.iter().all(|s| s.times_the_recommended.is_none()));
}

#[test]
fn time_with_loading_decides_and_a_person_attends_all_of_it() {
    let loaded = |load_s, f| Ok(Figures { load_s: Some(load_s), ..f });
    let rows = |load: [f64; 2]| {
        vec![("z-range", loaded(load[0], made(100.0, 5.0))), ("window", loaded(load[1], made(200.0, 5.0)))]
    };
    let mut c = comparison(rows([800.0, 500.0]));
    c.loading.way = LoadingWay::Person;
    let verdict = Verdict::of(&c);
    assert_eq!(
        verdict.sentences[0],
        "On xyz-galvo-40, step by window: 11 min 40 s with blocks loaded by a person, all in focus."
    );
    assert!((verdict.systems[0].times_the_recommended.expect("a ratio") - 9.0 / 7.0).abs() < 1e-12);
    // The machine waits while a person loads, and a person attends all of it by every way.
    let text = r#"{"machine": "60 EUR/h", "operator": "30 EUR/h"}"#;
    c.cost = serde_json::from_str(text).expect("rates");
    let first = |c: &Comparison| Verdict::of(c).sentences[0].clone();
    assert!(first(&c).contains("by a person, 17.50 EUR, all"), "{}", first(&c));
    c.rows = comparison(rows([0.0, 0.0])).rows;
    c.loading.way = LoadingWay::Ovf;
    let wanted =
        "On xyz-galvo-40, step by z-range: 1 min 40 s by a controller that reads job.ovf, 2.50 EUR, all in focus.";
    assert_eq!(first(&c), wanted);
}

#[test]
fn time_of_loading_that_is_not_known_is_said_to_be_left_out() {
    let mut c = comparison(vec![("z-range", Ok(Figures { load_s: Some(0.0), ..made(100.0, 5.0) }))]);
    c.loading.way = LoadingWay::Run;
    let sentences = Verdict::of(&c).sentences;
    let wanted = "On xyz-galvo-40, step by z-range: 1 min 40 s without loading the blocks, all in focus.";
    assert_eq!(sentences[0], wanted);
    assert!(sentences[1].starts_with("No time here includes what terrace run takes"), "{}", sentences[1]);
    c.loading.load_s = 2.0;
    let sentences = Verdict::of(&c).sentences;
    assert!(sentences[0].contains("1 min 40 s with blocks loaded by terrace run,"), "{}", sentences[0]);
    assert!(sentences[1].starts_with("In the job file:"), "{}", sentences[1]);
}

#[test]
fn keys_of_the_job_that_make_stepping_slower_are_named_with_what_they_cost() {
    let mut c = comparison(vec![("z-range", Ok(made(68.0, 5.0))), ("window", Ok(made(70.0, 5.0)))]);
    let cost = |key, time_s| KeyCost { system: "z-range", key, value: "8.2244 mm".into(), time_s };
    c.key_costs = vec![
        cost("partition.section", 41.9),
        // As fast, and another system's.
        cost("partition.overlap", 67.0),
        KeyCost { system: "window", ..cost("partition.zone", 1.0) },
    ];
    let sentences = Verdict::of(&c).sentences;
    let wanted = "Of this time partition.section = \"8.2244 mm\" of the job file, not the machine, costs 26.1 s: without \
                  it z-range takes 41.9 s.";
    assert_eq!(sentences[2..], [wanted.to_owned()]);
}

#[test]
fn systems_that_do_not_apply_are_named_once_for_each_reason() {
    let e = |why: &str| Err(Error::from(Diag::limit("travel", why)));
    let c = comparison(vec![
        ("contour", Ok(made(10.0, 5.0))),
        ("zoom", e("z is too short")),
        ("tilt", e("A is too short")),
        ("7-axis", e("z is too short")),
    ]);
    let verdict = Verdict::of(&c);
    let wanted = ["zoom and 7-axis do not apply: z is too short.", "tilt does not apply: A is too short."];
    assert_eq!(verdict.sentences[2..], wanted);
    assert_eq!(verdict.note(2), "does not apply: A is too short");
}

#[test]
fn of_systems_that_are_as_fast_the_first_is_recommended() {
    let c = comparison(vec![("contour", Ok(made(10.0, 5.0))), ("z-range", Ok(made(10.0, 5.0)))]);
    assert_eq!(Verdict::of(&c).recommended, Some("contour"));
}

#[test]
fn a_job_file_without_a_method_is_said_to_ask_for_auto() {
    let key = Some("partition.method = \"auto\"".to_owned());
    let c = comparison(vec![("auto", Ok(Figures { job_key: key, ..made(10.0, 5.0) }))]);
    assert_eq!(Verdict::of(&c).sentences[1], "In the job file: partition.method = \"auto\", or no method.");
}

#[test]
fn ratios_are_reported_in_words() {
    let cases = [
        (0.05, "is 20 times as fast"),
        (0.42, "is 2.4 times as fast"),
        (0.5, "takes half as long"),
        (0.71, "is 1.4 times as fast"),
        (0.96, "takes as long"),
        (1.04, "takes as long"),
        (1.06, "takes 1.1 times as long"),
        (2.05, "takes twice as long"),
        (2.96, "takes 3 times as long"),
        (9.94, "takes 9.9 times as long"),
        (9.96, "takes 10 times as long"),
        (104.4, "takes 104 times as long"),
    ];
    for (ratio, said) in cases {
        assert_eq!(verb_of_ratio(ratio, false), said);
    }
    assert_eq!(verb_of_ratio(0.5, true), "take half as long");
    assert_eq!(verb_of_ratio(3.0, true), "take 3 times as long");
}

#[test]
fn a_value_and_its_limit_never_read_alike() {
    assert_eq!(apart(35.004, 35.0), ["35.004", "35"]);
    assert_eq!(apart(293.4, 35.0), ["293", "35"]);
    assert_eq!(apart(4.012, 0.035), ["4", "0.035"]);
    assert_eq!(apart(10.0, 9.99), ["10", "9.99"]);
    assert_eq!(apart(5.0, 5.0), ["5", "5"]);
}

#[test]
fn the_page_begins_with_the_verdict_and_strikes_out_what_must_not_be_used() {
    let html = page(&example());
    let at = |what: &str| html.find(what).unwrap_or_else(|| panic!("no {what} in {html}"));
    let order = [
        "<p class=\"answer\">On xyz-galvo-40, step by z-range: 3 min 49 s, all in focus.</p>",
        "<li>A zoom optic (that of xyz-zoom-40) takes half as long.</li>",
        "flat (beyond limits)",
        "<span class=\"aloud\">not usable: </span><s>flat</s>",
        "<details>",
        "within limits",
    ];
    assert!(order.windows(2).all(|w| at(w[0]) < at(w[1])));
    assert!(html.contains("<td class=\"l\">not usable: 4 mm out of focus, 0.035 mm allowed</td>"), "{html}");
    assert_eq!(html.matches("<s>").count(), 6, "one row but for its note");
    let table = crate::compare::overview(&example());
    assert_eq!(table.columns().len(), 7);
    assert!(table.markdown().contains("| ~~flat~~ | ~~xyz-galvo-40~~ | ~~1 min 0 s~~ |"), "{}", table.markdown());
}

#[test]
fn cost_stands_in_the_table_for_what_runs_on_the_machine_alone() {
    let mut c = example();
    assert!(!page(&c).contains("cost"));
    c.cost = serde_json::from_str(r#"{"machine": "36 CHF/h"}"#).expect("rates");
    let table = serde_json::to_value(crate::compare::overview(&c)).expect("JSON");
    let costs: Vec<Option<f64>> = (0..6).map(|k| table[k]["cost_chf"].as_f64()).collect();
    assert_eq!(costs, [Some(0.6), Some(2.4), Some(2.29), Some(1.15), Some(22.9), None]);
}
