//! Clearance under a round head: what stands beside it is accepted and verifies, what enters it is refused and named.

use std::path::{Path, PathBuf};
use std::process::Output;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, said, terrace, verify};

type Facet = [[f64; 3]; 3];

/// The walls and the top of a pillar over a box, from z = 600 mm.
fn pillar([x0, y0, x1, y1]: [f64; 4], top: f64) -> Vec<Facet> {
    let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    let at = |i: usize, z: f64| [corners[i % 4][0], corners[i % 4][1], z];
    let walls = (0..4).flat_map(|i| {
        let [a, b, c, d] = [at(i, 600.0), at(i + 1, 600.0), at(i + 1, top), at(i, top)];
        [[a, b, c], [a, c, d]]
    });
    let lid = [[at(0, top), at(1, top), at(2, top)], [at(0, top), at(2, top), at(3, top)]];
    walls.chain(lid).collect()
}

/// A job on a post of 200 x 200 x 600 mm with `more` on it, hatched on small squares around some places: a stop each,
/// under a lens of 110 mm whose lower end less the clearance is 140 mm above the focal plane.
fn post(dir: &Path, more: &[Facet], places: &[[f64; 2]]) -> JobText {
    let stl = dir.join("post.stl");
    write_stl(&stl, &[mesh(4, [0.0, 0.0, 200.0, 200.0], |_, _| 600.0), more.to_vec()].concat());
    let squares = places.iter().map(|[x, y]| {
        let [x0, y0, x1, y1] = [x - 1.0, y - 1.0, x + 1.0, y + 1.0];
        format!("pattern = \"hatch\"\npitch = \"1 mm\"\narea = [\"{x0} mm\", \"{y0} mm\", \"{x1} mm\", \"{y1} mm\"]")
    });
    let mut job = squares.fold(JobText::on(&stl).method("z-range"), |job, square| job.texture(&square));
    job.partition = "section = \"2 mm\"".into();
    job
}

fn check(job: &Path) -> Output {
    terrace([Path::new("check"), job])
}

fn accepted(dir: &Path, job: &JobText) -> PathBuf {
    let to = dir.join("out");
    compile(&job.write(dir, "job.toml"), &to);
    verify(&to);
    to
}

fn refused(dir: &Path, job: &JobText) -> String {
    let done = check(&job.write(dir, "job.toml"));
    let text = said(&done);
    assert!(done.status.code() == Some(1) && text.contains("error[clearance]"), "{text}");
    text
}

#[test]
fn a_pillar_beside_the_lens_is_accepted_and_one_that_enters_it_is_named() {
    let dir = folder();
    let with = |pillar: &[Facet]| post(dir.path(), pillar, &[[80.0, 80.0]]);
    // The corner nearest to the axis is 84.9 mm away.
    accepted(dir.path(), &with(&pillar([140.0, 140.0, 160.0, 160.0], 760.0)));
    // In the corner of the square around the lens, 55.2 mm away, and 54.4 mm.
    accepted(dir.path(), &with(&pillar([119.0, 119.0, 139.0, 139.0], 760.0)));
    let text = refused(dir.path(), &with(&pillar([118.5, 118.5, 138.5, 138.5], 760.0)));
    assert!(text.contains("at 1 of 1 stops") && text.contains("z = 760.000 mm, 20 mm too high (B0001)"), "{text}");
    let (_, place) = text.split_once("at x = ").expect("the obstacle's place");
    let number = |t: &str| t.split(' ').next().and_then(|v| v.parse::<f64>().ok()).expect("a number");
    let [x, y] = [number(place), number(place.split_once("y = ").expect("y").1)];
    assert!((118.4..119.9).contains(&x) && (118.4..119.9).contains(&y), "{text}");
    assert!(text.contains(&format!("part at ({x:.3}, {y:.3}) mm")) && text.contains("170.000 mm"), "{text}");
    accepted(dir.path(), &with(&pillar([118.5, 118.5, 138.5, 138.5], 740.0)));
}

#[test]
fn walls_and_edges_count_where_they_enter_the_circle() {
    let dir = folder();
    let with = |more: &[Facet]| post(dir.path(), more, &[[80.0, 80.0]]);
    // An upright sheet, of which nothing but an edge enters; its corners lie far outside.
    let wall = |x: f64| [[[x, -900.0, 600.0], [x, 900.0, 600.0], [x, 0.0, 800.0]]];
    accepted(dir.path(), &with(&wall(135.1)));
    refused(dir.path(), &with(&wall(134.9)));
    // One that points to the axis rises by 1 in 1: within the circle to z = 600 + 140 and less.
    let fin = |x: f64| [[[x, 80.0, 600.0], [x + 300.0, 80.0, 600.0], [x + 300.0, 80.0, 900.0]]];
    accepted(dir.path(), &with(&fin(-4.9)));
    let text = refused(dir.path(), &with(&fin(-5.1)));
    assert!(text.contains("at x = 135.000 mm, y = 80.000 mm it rises to z = 740.100 mm, 0.1000"), "{text}");
    // A level facet far larger than the lens, of which only an edge enters.
    let shelf = |x: f64| [[[x, -900.0, 760.0], [x, 900.0, 760.0], [x + 900.0, 0.0, 760.0]]];
    accepted(dir.path(), &with(&shelf(135.1)));
    refused(dir.path(), &with(&shelf(134.9)));
}

#[test]
fn a_lift_that_does_not_clear_what_stands_between_two_stops_is_refused() {
    let dir = folder();
    let machine = machine_file("xyz-galvo-40");
    // The stage can lift by 10 mm above its stops.
    let low = machine.replace("travel = [\"-200 mm\", \"200 mm\"]", "travel = [\"-200 mm\", \"10 mm\"]");
    assert_ne!(low, machine);
    std::fs::write(dir.path().join("low.toml"), low).expect("writable");
    let with = |top: f64, aside: f64| {
        let obstacle = pillar([95.0, 100.0 + aside, 105.0, 110.0 + aside], top);
        let mut job = post(dir.path(), &obstacle, &[[20.0, 100.0], [180.0, 100.0]]);
        job.machine = "file = \"low.toml\"".into();
        job.more = "[placement]\norigin = [\"0 mm\", \"0 mm\", \"-600 mm\"]\n".into();
        job
    };
    accepted(dir.path(), &with(749.9, 0.0));
    let text = refused(dir.path(), &with(751.0, 0.0));
    assert!(text.contains("on the way to 1 of 2 stops") && text.contains("z = 751.000 mm, 1 mm too high"), "{text}");
    // Beside the band that the lens sweeps, 55 mm to each side.
    accepted(dir.path(), &with(751.0, 55.1));
    refused(dir.path(), &with(751.0, 54.9));
}
