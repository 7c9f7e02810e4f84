//! What `check` tells of hatches in other directions.

use std::path::Path;

use terrace_input::job::{Job, Overrides};
use terrace_plan::plan::{self, HatchSaving, Plan, SteppedPlan};

use crate::support::surfaces::{Height, cyl, mesh, saddle, wave, write_stl};
use crate::support::{JobText, folder, terrace};

/// A hatch in this direction on a surface of 120 mm.
fn job(dir: &Path, height: Height, direction: &str) -> std::path::PathBuf {
    let stl = dir.join("part.stl");
    write_stl(&stl, &mesh(120, [0.0, 0.0, 120.0, 120.0], height));
    let texture = format!("pattern = \"hatch\"\npitch = \"0.25 mm\"\ndirection = \"{direction}\"");
    let mut job = JobText::on(&stl).method("auto").texture(&texture);
    job.focus = "pdof = \"0.03 mm\"".into();
    job.write(dir, "a.toml")
}

fn planned(job: &Path) -> Box<SteppedPlan> {
    let job = Job::load(job, &Overrides::default()).expect("a sound job");
    let Plan::Stepped(plan) = plan::plan(job, &|_, _| ()).expect("a plan") else { panic!("a stepped job") };
    plan
}

/// What the plan of this direction takes less than another, s: in all, and in delays and jumps.
fn saved(dir: &Path, height: Height, than: &SteppedPlan, direction: &str) -> [f64; 2] {
    let (a, b) = (than.summary.time_s, planned(&job(dir, height, direction)).summary.time_s);
    [a.total - b.total, a.delay + a.jump - b.delay - b.jump]
}

#[test]
#[ignore = "slow: make test-all"]
fn what_other_directions_would_save_is_about_what_they_do() {
    let dir = folder();
    let surfaces: [(&str, Height); 3] = [("cyl", cyl), ("saddle", saddle), ("wave", wave)];
    for (name, height) in surfaces {
        let found = planned(&job(dir.path(), height, "0 deg"));
        let HatchSaving { contour_s, turned } = HatchSaving::of(&found);
        let total = found.summary.time_s.total;
        let along = contour_s.map(|printed| ("contour".to_owned(), printed));
        let turned = turned.map(|(deg, printed)| (format!("{deg} deg"), printed));
        for (direction, printed) in along.into_iter().chain(turned) {
            let [all, cuts] = saved(dir.path(), height, &found, &direction);
            println!(
                "{name} {direction}: {printed:.1} s printed, {all:.1} s, {cuts:.1} s of it delays and jumps, of {total:.0} s"
            );
            assert!(printed > 0.03 * total);
            assert!((printed - cuts).abs() < 0.35 * cuts, "{name} {direction}: {printed} {cuts}");
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn check_tells_what_another_direction_would_save_where_it_is_much() {
    let dir = folder();
    let lines = |direction: &str| -> Vec<String> {
        let out = terrace(["check".as_ref(), job(dir.path(), cyl, direction).as_os_str()]);
        let text = String::from_utf8(out.stdout).expect("text");
        text.lines().filter(|l| l.starts_with("hatch ")).map(str::to_owned).collect()
    };
    let across = lines("0 deg");
    assert_eq!(across.len(), 2, "{across:?}");
    assert!(across[0].contains("direction = \"contour\" would save about"), "{across:?}");
    assert!(across[1].contains("lines turned by 90 deg would save about"), "{across:?}");
    // Along its level lines nothing is left to be saved.
    assert!(lines("90 deg").is_empty() && lines("contour").is_empty());
}
