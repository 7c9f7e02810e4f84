//! `[order]`: what the job file asks for is what the program does, and every order is proved.

use crate::support::planned;
use terrace_core::program::Program;
use terrace_input::job;
use terrace_plan::plan::Plan;
use terrace_report::job_folder;

/// Compiles the sample part with squares and hatch and these lines of the job file; proves the folder.
fn program(order: &str, machine: &str) -> (Program, f64, f64) {
    let dir = tempfile::tempdir().expect("a folder");
    let put = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).expect("written");
    put(job::SAMPLE_SURFACE_NAME, &job::sample_surface());
    let profile = terrace_core::machine::PROFILES[0].1.replace("[stage]\n", &format!("[stage]\n{machine}\n"));
    put("machine.toml", profile.as_bytes());
    let text = format!(
        r#"
        surface = {{ file = "{}", unit = "mm" }}
        focus = {{ pdof = "0.2 mm" }}
        partition = {{ method = "z-range", section = "20 mm" }}
        machine = {{ file = "machine.toml" }}
        emit = {{ formats = ["dxf", "ovf"] }}
        order = {{ {order} }}
        texture = [
            {{ pattern = "squares", pitch = "2 mm", cell = "1.2 mm" }},
            {{ pattern = "hatch", pitch = "3 mm", direction = "20 deg" }},
        ]
        pen = [{{ name = "a", speed = "1000 mm/s", power = "60 %", frequency = "60 kHz" }}]
    "#,
        job::SAMPLE_SURFACE_NAME
    );
    put("job.toml", text.as_bytes());
    let plan = Plan::Stepped(planned(&dir.path().join("job.toml")));
    let target = dir.path().join("job.job");
    job_folder::write(&plan, &target).unwrap_or_else(|e| panic!("{e}"));
    let plan = plan.stepped().expect("a stepped plan");
    let proof = terrace_verify::verify(&target, None).unwrap_or_else(|e| panic!("{e}"));
    assert!(proof.ok, "{order}: {}", proof.to_text());
    (plan.checked.program().clone(), plan.summary.time_s.stage + plan.summary.time_s.settle, plan.summary.jump_mm)
}

#[test]
#[ignore = "slow: make test-all"]
fn focal_planes_rise_or_fall_where_that_is_asked() {
    let heights = |order: &str| {
        let (program, time, _) = program(order, "");
        (program.blocks.iter().map(|b| b.stop.lpfl).collect::<Vec<_>>(), time)
    };
    let (free, least) = heights("stops = \"time\"");
    let (up, up_time) = heights("stops = \"z-up\"");
    let (down, down_time) = heights("stops = \"z-down\"");
    assert!(up.is_sorted() && down.iter().rev().is_sorted() && !free.is_sorted(), "{up:?} {down:?}");
    assert!(up.len() > 10 && down.len() > 10 && free.len() > 10);
    assert!(least < up_time && least < down_time, "{least} {up_time} {down_time}");
}

#[test]
fn each_section_is_visited_once_where_z_moves_are_fast() {
    let (program, time, _) = program("", "move = { xy = \"3.7 s\", z = \"0.3 s\" }");
    let places: Vec<_> = program.blocks.iter().map(|b| b.stop.centre).collect();
    let mut distinct = places.clone();
    distinct.sort();
    distinct.dedup();
    let moves = places.windows(2).filter(|w| w[0] != w[1]).count();
    assert_eq!(moves, distinct.len() - 1);
    // Stops that share a place and a focal plane are not a move; the stage comes from the centre of its travel, which
    // may be over the first.
    let at = |i: usize| (program.blocks[i].stop.centre, program.blocks[i].stop.lpfl);
    let rest = (1..places.len()).filter(|&i| places[i] == places[i - 1] && at(i) != at(i - 1)).count();
    let whole = distinct.len() as f64 * 3.7 + rest as f64 * 0.3;
    assert!((whole - time).abs() < 1e-9 || (whole - 3.4 - time).abs() < 1e-9, "{whole} {time}");
}

#[test]
fn strokes_keep_the_order_of_the_drawing_or_get_short_jumps() {
    let (drawn, _, far) = program("strokes = \"drawing\"", "");
    for block in &drawn.blocks {
        let strokes = drawn.strokes_of(block);
        assert!(strokes.is_sorted_by_key(|s| (s.source, s.segment)) && strokes.iter().all(|s| !s.reversed));
    }
    let (short, _, near) = program("strokes = \"shortest\"", "");
    assert!(near < 0.7 * far, "{near} {far}");
    assert_eq!(short.strokes.len(), drawn.strokes.len());
    // Some closed figures begin elsewhere than they were drawn from.
    let is_closed = |s: &&terrace_core::program::Stroke| s.len == 5 && short.points_of(s)[0] == short.points_of(s)[4];
    assert!(short.strokes.iter().filter(is_closed).any(|s| s.segment > 0));
}
