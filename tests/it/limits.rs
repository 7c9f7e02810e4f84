//! docs/explanation/limits.md against the tests: each limit that names a refusal or an absence has a test that tries
//! it, and no sentence of the page stands here that it does not have.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use terrace_core::math;

use terrace_core::machine::{Letter, Machine};
use terrace_input::job::{Job, Mode, Overrides, SAMPLE_JOB};
use terrace_plan::manifest::AnySummary;
use terrace_plan::plan;

use crate::support::{folder, said, terrace};

/// Words of the page, the file of a test below the root, and the test.
const TRIED: [(&str, &str, &str); 63] = [
    (
        "OBJ: no free-form surfaces, no weights",
        "crates/input/src/surface/obj.rs",
        "unknown_keywords_are_counted_and_named_once",
    ),
    ("ASCII PLY: one element to a line", "crates/input/src/surface/ply.rs", "faults_are_named"),
    (
        "3MF: at most a million instances",
        "crates/input/src/surface/threemf/tests.rs",
        "a_small_file_cannot_stand_for_a_huge_part",
    ),
    ("No slices, beam lattices", "crates/input/src/surface/threemf/tests.rs", "faults_of_models_are_named"),
    (
        "What a fixture hides is refused",
        "tests/it/fixtures.rs",
        "a_clamp_beside_the_part_is_shown_and_one_on_the_texture_is_refused",
    ),
    (
        "none can be chosen",
        "crates/input/src/surface/threemf/tests.rs",
        "components_are_placed_from_the_inside_out_and_mirrors_keep_the_winding",
    ),
    ("hidden bodies are left out", "tests/it/cad.rs", "what_a_step_file_hides_is_left_out_and_named"),
    ("IGES with a scale other than 1", "tests/it/cad.rs", "the_head_of_an_iges_file_says_its_size_or_it_is_refused"),
    (
        "units that are stated twice and differ, are refused",
        "tests/it/cad.rs",
        "step_units_that_are_read_wrongly_are_refused_and_a_utf_8_mark_is_not",
    ),
    (
        "at most 20,000 samples a side",
        "crates/input/src/surface/heightmap/png_image.rs",
        "files_that_are_no_height_map_are_refused",
    ),
    (
        "band; no JPEG, no fax packing, no zstd",
        "crates/input/src/surface/heightmap/tiff_image.rs",
        "files_that_are_no_height_map_are_refused",
    ),
    (
        "refused where cells are not square by it",
        "crates/input/src/surface/heightmap/tiff_image.rs",
        "cells_that_are_not_square_are_refused",
    ),
    (
        "CMYK, TIFF palettes and floating samples are refused",
        "crates/input/src/texture/bitmap/tests.rs",
        "tags_that_change_samples_are_refused_by_name",
    ),
    ("They have at most 100 million pixels", "tests/it/bad_input.rs", "malformed_bitmaps_give_the_expected_messages"),
    (
        "An area in the colour of the page hides",
        "tests/it/drawings.rs",
        "every_drawing_is_marked_as_shown_or_refused_with_its_cause",
    ),
    (
        "It is refused, or left out where the job says so",
        "tests/it/drawings.rs",
        "every_drawing_is_marked_as_shown_or_refused_with_its_cause",
    ),
    ("No script runs, and no other file is opened", "tests/it/bad_svg.rs", "hostile_drawings_are_refused_or_bounded"),
    (
        "pen widths (PW) serve for points alone",
        "crates/input/src/texture/hpgl/tests.rs",
        "a_point_of_a_wide_pen_is_a_disc",
    ),
    ("wedges are not read", "crates/input/src/texture/hpgl/tests.rs", "pens_fills_and_faults_are_reported"),
    ("does not fill tiles", "tests/it/limits.rs", "contours_do_not_fill_tiles"),
    (
        "of blocks are not read",
        "crates/input/src/texture/dxf/tests.rs",
        "every_ignored_entity_is_listed_with_count_and_handle",
    ),
    (
        "all of these are refused by type, or left out",
        "crates/input/src/texture/dxf/tests.rs",
        "every_ignored_entity_is_listed_with_count_and_handle",
    ),
    ("Dots: stepped jobs alone", "tests/it/early.rs", "on_the_fly_jobs_are_refused_as_early"),
    ("No format but OVF, RTC and LMC carries their dwell", "tests/it/limits.rs", "dxf_and_csv_files_hold_no_dwell"),
    (
        "compared with the surface along z",
        "tests/it/curves.rs",
        "curves_are_refused_beyond_their_distance_and_not_at_it",
    ),
    ("They are not cut at an area", "tests/it/curves.rs", "what_is_not_a_curve_or_not_read_is_refused_by_name"),
    (
        "A column of numbers of points without a name",
        "crates/input/src/surface/points/names.rs",
        "rows_of_names_say_which_columns_are_taken_or_are_refused",
    ),
    ("parts up to 4 m", "tests/it/bad_surfaces.rs", "a_cloud_in_utm_metres_is_refused_by_its_size"),
    ("| part of SVG and CSS | not read |", "tests/it/css_drawings.rs", "drawings_of_css_are_read_or_refused_by_name"),
    ("| elements | text, images", "tests/it/drawings.rs", "every_drawing_is_marked_as_shown_or_refused_with_its_cause"),
    ("| clip paths and masks |", "tests/it/drawings.rs", "every_drawing_is_marked_as_shown_or_refused_with_its_cause"),
    ("| strokes | joins `arcs`", "tests/it/css_drawings.rs", "drawings_of_css_are_read_or_refused_by_name"),
    ("| animations in CSS |", "tests/it/css_drawings.rs", "drawings_of_css_are_read_or_refused_by_name"),
    ("projected along z, not wrapped", "tests/it/dose.rs", "manifest_states_incidence_stretch_and_dose_of_blocks"),
    ("above 60 deg nothing is marked", "tests/it/limits.rs", "what_is_steeper_than_60_deg_is_not_marked"),
    (
        "Only the topmost surface under the lens is marked",
        "tests/it/solids.rs",
        "one_length_is_marked_of_a_solid_in_whatever_order_and_winding_its_facets_are",
    ),
    ("The part is laid once", "tests/it/laid.rs", "rotations_up_and_level_agree_and_what_says_nothing_is_refused"),
    (
        "Of these C may turn without",
        "crates/core/src/machine/tilt_axes.rs",
        "a_turntable_may_have_no_ends_and_take_angles_modulo_a_turn",
    ),
    ("A and B have a travel", "tests/it/limits.rs", "only_c_turns_without_ends"),
    (
        "Only OVF and RTC lists carry the setting of a zoom optic",
        "tests/it/zoom.rs",
        "drawings_alone_do_not_set_the_zoom_optic_and_compile_says_so",
    ),
    ("On the fly the optic is not used", "tests/it/limits.rs", "the_zoom_optic_is_not_used_on_the_fly"),
    ("PDOF is", "crates/input/src/job/plausible.rs", "pdof_beyond_twice_the_depth_of_focus_is_refused_at_its_key"),
    ("For tilted stops no bound is known", "tests/it/limits.rs", "tilted_stops_have_no_lower_bound"),
    (
        "what is too short to be marked",
        "tests/it/bound.rs",
        "the_bound_does_not_speak_of_what_is_too_short_to_be_marked",
    ),
    (
        "A job is refused only where a facet of the part enters the head",
        "tests/it/clearance.rs",
        "a_pillar_beside_the_lens_is_accepted_and_one_that_enters_it_is_named",
    ),
    (
        "checks clearance again, in stepped",
        "tests/it/clearance.rs",
        "a_lift_that_does_not_clear_what_stands_between_two_stops_is_refused",
    ),
    ("there are no fields and no", "tests/it/on_the_fly.rs", "five_axis_job_compiles_and_verifies"),
    ("no contour hatch, no frames", "tests/it/limits.rs", "what_on_the_fly_jobs_do_not_have_is_refused"),
    ("no dots, no pens of several passes", "tests/it/limits.rs", "what_on_the_fly_jobs_do_not_have_is_refused"),
    (
        "a mark that needs more turns than the travel of C allows",
        "tests/it/on_the_fly.rs",
        "turns_beyond_the_travel_of_c_are_refused_with_what_they_need",
    ),
    (
        "At a step of the part a mark of five axes is cut",
        "tests/it/on_the_fly.rs",
        "five_axes_cut_their_marks_at_walls_and_mark_up_to_them",
    ),
    (
        "listed in `left_out`",
        "tests/it/on_the_fly.rs",
        "seven_axes_leave_out_what_their_height_field_cannot_follow_at_walls_and_say_so",
    ),
    (
        "the galvo is assumed to be always at full speed",
        "crates/core/src/motion/energy.rs",
        "nothing_is_said_of_dots_and_of_a_spot_that_is_always_at_speed",
    ),
    (
        "loading of blocks is in `loading` alone",
        "tests/it/operator.rs",
        "auto_counts_the_loading_of_blocks_by_the_way_that_is_stated",
    ),
    (
        "refused where the handshake would start them without it",
        "tests/it/operator.rs",
        "blocks_with_a_focus_shift_are_refused_where_the_handshake_would_start_them_out_of_focus",
    ),
    (
        "what a pass really removes is not measured",
        "tests/it/passes.rs",
        "passes_with_rotation_lowering_and_shift_verify",
    ),
    ("The error budget has no field curvature", "tests/it/budget.rs", "what_nobody_states_is_named_and_is_not_zero"),
    ("keep_whole` it counts whole figures", "tests/it/bound.rs", "figures_that_stay_whole_count_as_one_piece"),
    (
        "Hysteresis is estimated from the ripples",
        "tests/it/partition.rs",
        "overlapping_levels_keep_strokes_whole_on_a_rough_surface",
    ),
    (
        "what is not read is in the table below",
        "tests/it/css_drawings.rs",
        "drawings_of_css_are_read_or_refused_by_name",
    ),
    (
        "`@supports` with functions other than",
        "tests/it/css_drawings.rs",
        "drawings_of_css_are_read_or_refused_by_name",
    ),
    ("others have no effect |", "tests/it/css_drawings.rs", "drawings_of_css_are_read_or_refused_by_name"),
    (
        "a square of the diameter against boxes",
        "tests/it/clearance.rs",
        "walls_and_edges_count_where_they_enter_the_circle",
    ),
];

/// Words of sentences that name an absence which a test cannot try: what a figure means, how good a method is, what
/// nobody has built. Each with why.
const UNTRIED: [(&str, &str); 31] = [
    ("terrace is not a safety system", "a statement about responsibility"),
    ("colour profiles are not used", "what is not read leaves no trace"),
    ("no map projection", "what is not there"),
    ("Line weights are not used", "what is not read leaves no trace"),
    ("no undercuts, no smoothing of noise", "what is not there"),
    ("is never derived from the optics", "the absence of a computation"),
    ("not meant to be the best", "a judgement"),
    ("`window` is a search, not an optimum", "a judgement; `make bench` has the figures"),
    ("not for the least time", "a judgement; `make bench` has the figures"),
    ("cheap that it cannot win", "a judgement; `make bench` has the figures"),
    ("of which no closed box", "a definition"),
    ("cross none; of dense textures", "how points are chosen"),
    ("make the bound weaker, not wrong", "what a figure means"),
    ("between the two is not known", "what a figure means"),
    ("are not counted", "what a figure means"),
    ("a texture of whole figures alone has none", "how an estimate is made"),
    ("to take no time", "an assumption"),
    ("The tour is not proved optimal", "a judgement; `make bench` has the figures"),
    ("the lens, and cables, are not", "what is not there"),
    ("may be refused", "a judgement"),
    ("it may lift where it need", "a judgement"),
    ("to load a file is not known", "what is not there"),
    ("a smaller hole or gap may not show", "what a picture shows"),
    ("What terrace does not do", "what the page is about"),
    ("No rollers", "what is not there"),
    ("Where the stage must lift one way", "how an order is found"),
    ("A job may be refused (`clearance`) or lift", "a judgement"),
    ("Delays of laser and scanner are not in the", "what is not there"),
    ("Neither is following error", "what is not there"),
    ("Clearance is not checked", "the absence of a check"),
    ("It is not used for programs", "what is not there"),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn page() -> String {
    let text = std::fs::read_to_string(root().join("docs/explanation/limits.md")).expect("readable");
    // Sentences run over the ends of lines.
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The sentences of a text that name a refusal or an absence.
fn absences(text: &str) -> Vec<String> {
    let text: String = text.lines().filter(|line| !line.starts_with('#')).map(|line| format!("{line}\n")).collect();
    let words = ["no", "not", "none", "never", "cannot", "refused", "neither"];
    let paragraphs = text.split("\n\n").flat_map(|p| p.split("\n- ")).flat_map(|p| p.split("\n|"));
    let sentences = paragraphs.flat_map(|p| {
        let line = p.split_whitespace().collect::<Vec<_>>().join(" ");
        line.split_inclusive([':', ';', '.']).map(str::to_owned).collect::<Vec<_>>()
    });
    let names = |s: &String| s.to_lowercase().split(|c: char| !c.is_alphanumeric()).any(|word| words.contains(&word));
    sentences.map(|s| s.trim().to_owned()).filter(names).collect()
}

/// The whole of a test, from its name on; None where the file has none of this name.
fn test_of(file: &str, name: &str) -> Option<String> {
    let text = std::fs::read_to_string(root().join(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
    let at = text.find(&format!("fn {name}()"))?;
    text[..at].rfind("#[test]").map(|_| text[at..].to_owned())
}

#[test]
fn every_limit_that_a_test_tries_stands_on_the_page_and_has_its_test() {
    let page = page();
    for (words, file, name) in TRIED {
        assert!(page.contains(words), "docs/explanation/limits.md does not say {words:?}");
        assert!(test_of(file, name).is_some(), "{file} has no test {name} ({words:?})");
    }
    for (words, why) in UNTRIED {
        assert!(page.contains(words) && !why.is_empty(), "docs/explanation/limits.md does not say {words:?}");
    }
}

#[test]
fn every_sentence_that_names_a_refusal_or_an_absence_is_listed() {
    let text = std::fs::read_to_string(root().join("docs/explanation/limits.md")).expect("readable");
    let page = page();
    // A sentence is covered by words that begin or end in it.
    let listed: Vec<&str> = TRIED.iter().map(|row| row.0).chain(UNTRIED.iter().map(|row| row.0)).collect();
    let covers = |sentence: &str| {
        let from = page.find(sentence.trim())?;
        let range = from..from + sentence.trim().len();
        listed
            .iter()
            .find(|words| page.match_indices(**words).any(|(at, _)| at < range.end && at + words.len() > range.start))
    };
    let found = absences(&text);
    assert!(found.len() > 40, "sentences are found: {}", found.len());
    let bare: Vec<&String> = found.iter().filter(|s| covers(s).is_none()).collect();
    assert!(bare.is_empty(), "tie these to a test, or say why none can try them: {bare:#?}");
}

#[test]
fn sentences_of_absence_are_found_in_lists_tables_and_over_lines() {
    let text = "# No heading\n\nIt is so. It is\nnot so; it is.\n- None: of these\n| a | never |\n";
    assert_eq!(absences(text), ["It is not so;", "None:", "a | never |"]);
}

// --- Tries that no other test has.

/// The sample job with texts replaced, in a folder with what it names.
fn sample(changes: &[(&str, &str)]) -> (tempfile::TempDir, PathBuf) {
    let dir = folder();
    let out = terrace([Path::new("init"), dir.path()]);
    assert!(out.status.success(), "{}", said(&out));
    let text = changes.iter().fold(SAMPLE_JOB.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    });
    let path = dir.path().join("job.toml");
    std::fs::write(&path, text).expect("written");
    (dir, path)
}

/// What a plan of a job in this mode says.
fn planned(path: &Path, mode: Mode) -> AnySummary {
    let overrides = Overrides { mode: Some(mode), ..Overrides::default() };
    let job = Job::load(path, &overrides).unwrap_or_else(|e| panic!("{e}"));
    plan::plan(job, &|_, _| {}).unwrap_or_else(|e| panic!("{e}")).summary()
}

/// The codes for which a job file is refused, in this mode.
fn refused(path: &Path, mode: Mode) -> Vec<&'static str> {
    let overrides = Overrides { mode: Some(mode), ..Overrides::default() };
    let e = Job::load(path, &overrides).and_then(|job| plan::plan(job, &|_, _| {}).map(drop)).expect_err("refused");
    e.diags().iter().map(|d| d.code).collect()
}

const HATCH: &str = "pattern = \"hatch\"";
const ANGLE: &str = "direction = \"0 deg\"";
const FORMATS: &str = "formats = [\"dxf\", \"linuxcnc\", \"ovf\"]";

#[test]
fn contours_do_not_fill_tiles() {
    let contour = (ANGLE, "direction = \"contour\"");
    let (_dir, path) = sample(&[(HATCH, "file = \"sample.svg\"\ntile = true"), contour]);
    assert_eq!(refused(&path, Mode::Stepped), ["texture-key"]);
}

#[test]
fn dxf_and_csv_files_hold_no_dwell() {
    let dwell = |us: u32| format!("frequency = \"60 kHz\"\ndwell = \"{us} us\"");
    let files = |us: u32| {
        let dots = [(HATCH, "pattern = \"dots\""), (ANGLE, ""), ("frequency = \"60 kHz\"", &dwell(us))];
        let formats = (FORMATS, "formats = [\"dxf\", \"csv\", \"ovf\"]");
        let (dir, path) = sample(&[&dots[..], &[formats, ("pitch = \"0.5 mm\"", "pitch = \"2 mm\"")]].concat());
        let out = terrace([Path::new("compile"), &path]);
        assert!(out.status.success(), "{}", said(&out));
        let folder = dir.path().join("job.job");
        let read = |name: &str| std::fs::read(folder.join(name)).expect("a file");
        ["blocks/B0001.dxf", "blocks/B0001.csv", "job.ovf"].map(read)
    };
    let ([dxf, csv, ovf], [other_dxf, other_csv, other_ovf]) = (files(100), files(900));
    assert!(dxf == other_dxf && csv == other_csv, "a dot is a point, however long it is marked");
    assert!(ovf != other_ovf, "OVF tells it");
}

#[test]
fn what_is_steeper_than_60_deg_is_not_marked() {
    let (dir, path) =
        sample(&[("pitch = \"0.5 mm\"", "pitch = \"1 mm\""), ("[limits]", "[limits]\nimplausible = \"allow\"")]);
    // A ramp of 65 deg between two plateaus, and one of 55 deg.
    let ramp = |run: f64| {
        let z = move |x: f64| if x < 10.0 { 0.0 } else { ((x - 10.0) / run).min(1.0) * 5.0 };
        let xs = [0.0, 10.0, 10.0 + run, 30.0];
        let facets = xs.windows(2).flat_map(move |w| {
            let p = |x: f64, y: f64| [x, y, z(x)];
            [[p(w[0], 0.0), p(w[1], 0.0), p(w[1], 20.0)], [p(w[0], 0.0), p(w[1], 20.0), p(w[0], 20.0)]]
        });
        let mut stl = "solid ramp\n".to_owned();
        for facet in facets {
            stl += "facet normal 0 0 1\nouter loop\n";
            facet.iter().for_each(|[x, y, z]| stl += &format!("vertex {x} {y} {z}\n"));
            stl += "endloop\nendfacet\n";
        }
        stl + "endsolid ramp\n"
    };
    let steep_mm = |degrees: f64| {
        std::fs::write(dir.path().join("sample.stl"), ramp(5.0 / math::tan(degrees.to_radians()))).expect("written");
        match planned(&path, Mode::Stepped) {
            AnySummary::Stepped(s) => s.skipped_steep_mm,
            AnySummary::OnTheFly(_) => unreachable!("a stepped job"),
        }
    };
    assert!(steep_mm(65.0) > 10.0);
    assert_eq!(steep_mm(55.0), 0.0);
}

#[test]
fn only_c_turns_without_ends() {
    let text = |name: &str| terrace_core::machine::PROFILES.iter().find(|(n, _)| *n == name).expect("a profile").1;
    let dir = folder();
    let path = dir.path().join("m.toml");
    let endless = |text: &str, letter: Letter| {
        // The travel of the axis of this letter.
        let head = format!("letter = \"{}\"", letter.char());
        let at = text.find(&head).expect("an axis");
        let (from, rest) = text[at..].split_once("travel = ").map(|(a, b)| (at + a.len(), b)).expect("a travel");
        let end = from + "travel = ".len() + rest.find(['\n', '#']).expect("a line");
        let text = format!("{}travel = \"continuous\" {}", &text[..from], &text[end..]);
        std::fs::write(&path, text).expect("written");
        Machine::load(&path).map(drop)
    };
    assert!(endless(text("xyzac-galvo-10"), Letter::C).is_ok());
    let e = endless(text("xyzac-galvo-10"), Letter::A).expect_err("a swivel has ends");
    assert!(e.to_string().contains("cannot be continuous"), "{e}");
}

#[test]
#[ignore = "slow: make test-all"]
fn the_zoom_optic_is_not_used_on_the_fly() {
    let moves = |profile: &str| {
        let few = ("pitch = \"0.5 mm\"", "pitch = \"5 mm\"");
        let (_dir, path) = sample(&[few, ("xyz-galvo-40", profile), (FORMATS, "formats = [\"linuxcnc\"]")]);
        match planned(&path, Mode::OnTheFly) {
            AnySummary::OnTheFly(s) => (s.moves, s.marks, s.time_s.to_bits()),
            AnySummary::Stepped(_) => unreachable!("an on-the-fly job"),
        }
    };
    let zoom = Machine::built_in("xyz-zoom-40").expect("a profile");
    assert!(zoom.zoom.is_some());
    // The machines differ in nothing else that matters here, or the comparison says nothing.
    let plain = Machine::built_in("xyz-galvo-40").expect("a profile");
    assert_eq!((&zoom.stage, &zoom.scanner, &zoom.lens.field), (&plain.stage, &plain.scanner, &plain.lens.field));
    assert_eq!(moves("xyz-zoom-40"), moves("xyz-galvo-40"));
}

#[test]
fn tilted_stops_have_no_lower_bound() {
    let bound = |method: &str| {
        let method = format!("method = \"{method}\"");
        let (_dir, path) = sample(&[("xyz-galvo-40", "xyz-tilt-galvo-40"), ("method = \"auto\"", &method)]);
        match planned(&path, Mode::Stepped) {
            AnySummary::Stepped(s) => s.lower_bound_stops,
            AnySummary::OnTheFly(_) => unreachable!("a stepped job"),
        }
    };
    assert_eq!(bound("tilt"), None);
    assert!(bound("z-range").is_some());
}

#[test]
fn what_on_the_fly_jobs_do_not_have_is_refused() {
    let pilot =
        "frames = \"pilot\"\n\n[[pen]]\nname = \"pilot\"\nspeed = \"1 m/s\"\npower = \"1 %\"\nfrequency = \"60 kHz\"";
    let setups = "[setups]\nregistration = [[\"0 mm\", \"0 mm\"], [\"9 mm\", \"0 mm\"]]\n\n[limits]";
    let mut codes: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (what, from, to) in [
        ("passes", "[limits]", "[passes]\ncount = 2\n\n[limits]"),
        ("set-ups", "[limits]", setups),
        ("dose", "[limits]", "[dose]\ncompensate = \"speed\"\n\n[limits]"),
        ("contour hatch", ANGLE, "direction = \"contour\""),
        ("frames", "# frames = \"pilot\"", pilot),
        ("pens of several passes", "passes = 1\n", "passes = 2\n"),
        ("dots", "pattern = \"hatch\"", "pattern = \"dots\""),
    ] {
        let no_angle = if what == "dots" { (ANGLE, "") } else { ("mode", "mode") };
        let (_dir, path) = sample(&[(from, to), no_angle, (FORMATS, "formats = [\"linuxcnc\"]")]);
        codes.insert(what, refused(&path, Mode::OnTheFly));
    }
    assert!(codes.values().all(|codes| codes[..] == ["fly-job"]), "{codes:?}");
}
