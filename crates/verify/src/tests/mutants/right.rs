//! Jobs of tilted stops that are marked as they should be, and whose figures differ from those found again by what
//! rounding does on a tilted part: every one is proved.

use super::*;
use terrace_core::math;

/// Facets of a sheet of `n` cells of `d` mm from `at`, z from a function of x and y, all mm.
pub(super) fn sheet(at: [f64; 2], n: [u32; 2], d: [f64; 2], z: impl Fn(f64, f64) -> f64) -> Vec<[[f64; 3]; 3]> {
    let p = |i: u32, j: u32| {
        let (x, y) = (at[0] + f64::from(i) * d[0], at[1] + f64::from(j) * d[1]);
        [x, y, z(x, y)]
    };
    let cells = (0..n[1]).flat_map(|j| (0..n[0]).map(move |i| (i, j)));
    let corners = |(i, j): (u32, u32)| (p(i, j), p(i + 1, j), p(i + 1, j + 1), p(i, j + 1));
    cells.map(corners).flat_map(|(a, b, c, d)| [[a, b, c], [a, c, d]]).collect()
}

fn wavy(x: f64, y: f64) -> f64 {
    0.3 * math::sin(x / 11.0) + 0.25 * math::cos(y / 8.0) + 0.004 * x
}

/// A wavy sheet on which every vertex is off by up to `by` mm.
fn rough(n: u32, by: f64, seed: f64) -> Vec<[[f64; 3]; 3]> {
    sheet([0.0; 2], [n; 2], [0.5; 2], |x, y| wavy(x, y) + by * math::sin(37.1 * x * 2.0 + 91.7 * y * 2.0 + seed))
}

const HATCH: &str = "[[texture]]\npattern = \"hatch\"\npitch = \"1 mm\"\n";

/// A job by method `tilt` in a field of `field` mm, with more keys of the surface and of the partition.
struct Right {
    facets: Vec<[[f64; 3]; 3]>,
    surface: &'static str,
    partition: &'static str,
    turn: f64,
    pdof: f64,
    field: u32,
    passes: u32,
    texture: &'static str,
}

impl Right {
    fn on(facets: Vec<[[f64; 3]; 3]>) -> Self {
        Self { facets, surface: "", partition: "", turn: 0.0, pdof: 0.07, field: 40, passes: 1, texture: HATCH }
    }

    /// Compiles and verifies it.
    fn proved(&self) {
        let dir = tempfile::tempdir().expect("a writable temporary folder");
        let put = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).expect("a writable folder");
        put("part.stl", &stl(&self.facets));
        let profile =
            terrace_core::machine::PROFILES.iter().find(|(n, _)| *n == "xyz-tilt-galvo-40").expect("a profile").1;
        let field = format!("field = [\"{0} mm\", \"{0} mm\"]", self.field);
        let machine = profile.replacen("field = [\"40 mm\", \"40 mm\"]", &field, 1);
        assert!(machine.contains(&field), "the profile has this field");
        put("machine.toml", machine.as_bytes());
        let Self { surface, partition, turn, pdof, passes, texture, .. } = self;
        let text = format!(
            "[surface]\nfile = \"part.stl\"\nunit = \"mm\"\n{surface}\n[placement]\nturn = \"{turn} deg\"\n{texture}\n\
             [focus]\npdof = \"{pdof} mm\"\n[partition]\nmethod = \"tilt\"\n{partition}\n[machine]\n\
             file = \"machine.toml\"\n[emit]\nformats = [\"linuxcnc\"]\n[[pen]]\nname = \"fill\"\nspeed = \"1000 mm/s\"\n\
             power = \"40 %\"\nfrequency = \"60 kHz\"\npasses = {passes}\n"
        );
        put("job.toml", text.as_bytes());
        let job = load(&dir.path().join("job.toml"));
        let plan = plan::plan(job, &|_, _| {}).unwrap_or_else(|e| panic!("{e}"));
        let stepped = plan.stepped().expect("a stepped job");
        let tilts = stepped.checked.program().blocks.iter().filter(|b| !b.stop.tilt.is_upright()).count();
        assert!(tilts > 1, "{:?}", stepped.summary);
        let target = dir.path().join("job.job");
        job_folder::write(&plan, &target).unwrap_or_else(|e| panic!("{e}"));
        let proof = verified(&target);
        assert!(proof.ok, "{}", proof.to_text());
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn nanometre_gaps_at_the_border_of_a_rotated_part_are_accepted() {
    let part = || sheet([0.0; 2], [30, 21], [2.0; 2], wavy);
    Right { turn: 5.0, ..Right::on(part()) }.proved();
    Right { turn: 5.0, field: 12, ..Right::on(part()) }.proved();
}

#[test]
#[ignore = "slow: make test-all"]
fn overlap_tolerance_of_tilted_marks_follows_their_end_points() {
    Right { partition: "overlap = \"0.1 mm\"", field: 12, ..Right::on(rough(80, 0.01, 0.0)) }.proved();
}

#[test]
fn gap_tolerance_of_tilted_marks_in_several_passes_follows_their_end_points() {
    let texture = "[[texture]]\npattern = \"hatch\"\npitch = \"0.5 mm\"\ndirection = \"20 deg\"\n";
    let right = Right {
        partition: "min_mark = \"100 um\"",
        turn: 10.0,
        field: 12,
        passes: 3,
        texture,
        ..Right::on(rough(40, 0.02, 2.0))
    };
    right.proved();
}

#[test]
fn tilted_marks_over_welded_cracks_are_on_their_lines_as_far_as_welding_moves_them() {
    let cells = (0..20u32).flat_map(|j| (0..20u32).map(move |i| (i, j)));
    let cracked = cells.flat_map(|(i, j)| {
        // Neighbours lie 1 or 2 um apart or over each other.
        let off = 0.001 * (f64::from((i + 2 * j) % 3) - 1.0);
        sheet([2.0 * f64::from(i) + off, 2.0 * f64::from(j) + off], [1, 1], [2.0; 2], wavy)
    });
    Right { surface: "weld = \"4 um\"", pdof: 0.1, ..Right::on(cracked.collect()) }.proved();
}

#[test]
fn a_tilted_mark_that_begins_on_the_rim_of_an_upper_sheet_lies_on_that_sheet() {
    let lower = |x: f64, y: f64| 0.05 * x + 0.2 * math::sin(y / 4.0);
    for slope in [-0.03, 0.0] {
        let mut facets = sheet([0.0; 2], [20, 15], [2.0; 2], lower);
        facets.extend(sheet([5.0, 3.0], [12, 10], [2.5, 2.4], |x, _| 1.4 + slope * (x - 5.0)));
        let texture = "[[texture]]\npattern = \"squares\"\npitch = \"2 mm\"\ncell = \"1 mm\"\n";
        Right { pdof: 0.2, texture, ..Right::on(facets) }.proved();
    }
}
