//! Speed and quality of the order of strokes and of stops: `make bench` prints the table.
//!
//! CPU seconds of this thread, as the kernel counts them. Tours of stops are compared with what a hundred
//! times the effort finds, which takes some minutes; `cargo bench --bench order -- 10` takes ten times.

use terrace_core::geom::FieldPoint;
use terrace_core::machine::{Commanded, Machine, MoveTimes, Settling};
use terrace_core::math;
use terrace_core::units::Time;
use terrace_plan::order::stops::{self, EFFORT, HeightOrder, Stage};
use terrace_plan::order::strokes::{self, Path, Visit};

use terrace_core::random::Random;

type Strokes = Vec<Vec<FieldPoint>>;

const MM: i32 = 1_000_000;

fn main() {
    println!("{:<44} {:>9} {:>12} {:>14}", "order of strokes, one thread", "CPU ms", "strokes/s", "mm jump each");
    for seed in 1..=3 {
        strokes(&format!("1,600 squares, shuffle {seed}"), &shuffled(squares(40, 40), seed));
    }
    strokes("90,000 squares", &shuffled(squares(300, 300), 1));
    strokes("1,600 circles of 64 points", &shuffled(circles(40, 64), 1));
    strokes("400 lines of hatch", &shuffled(hatch(400), 1));
    strokes("100,000 dashes in rows", &shuffled(dashes(250, 400, 160_000, 100_000), 1));
    strokes("100,000 dashes at random", &random(100_000, 5));
    let mut crowd = shuffled(dashes(200, 300, 500, 300), 1);
    crowd.extend([
        points(&[[-20 * MM, -20 * MM], [20 * MM, 20 * MM]]),
        points(&[[-20 * MM, 20 * MM], [20 * MM, -20 * MM]]),
    ]);
    strokes("60,000 dashes in 0.1 mm and a cross of 40 mm", &crowd);

    let more = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(100);
    println!("\n{:<44} {:>9} {:>12} {:>14} {:>8}", "tour of stops", "CPU s", "time s", "", "ratio");
    for (times, kind) in [(None, "profiles"), (Some([3.7, 0.3]), "xy 3.7 s, z 0.3 s"), (Some([1.0, 1.0]), "1 s")] {
        for (name, list) in [("windows", windows(3500)), ("144 sections", sections())] {
            tour(&format!("{} stops, {name}, {kind}", list.len()), &list, &machine(times), more);
        }
    }
    tour("3500 stops, windows, time by distance", &windows(3500), &distance(), more);
}

/// A stroke through these points of the field, nm.
fn points(list: &[[i32; 2]]) -> Vec<FieldPoint> {
    list.iter().map(|&p| p.into()).collect()
}

/// Orders strokes, and again until that took a while.
fn strokes(name: &str, strokes: &Strokes) {
    let is_closed = |s: &[FieldPoint]| s.len() > 2 && s[0] == s[s.len() - 1];
    let paths: Vec<Path<'_>> = strokes.iter().map(|s| Path { points: s, is_closed: is_closed(s) }).collect();
    let start = cpu_s();
    let (mut runs, mut took) = (0.0, 0.0);
    let mut visits = Vec::new();
    while took < 0.3 {
        visits = strokes::order(&paths);
        runs += 1.0;
        took = cpu_s() - start;
    }
    let (n, each) = (strokes.len() as f64, took / runs);
    println!("{name:<44} {:>9.2} {:>12.0} {:>14.4}", each * 1e3, n / each, jump_mm(&paths, &visits) / n);
}

fn jump_mm(paths: &[Path<'_>], visits: &[Visit]) -> f64 {
    let mut at = FieldPoint::AXIS;
    let mut sum = 0.0;
    for v in visits {
        let points = paths[v.stroke as usize].points;
        let last = points[points.len() - 1];
        let [first, end] = match (v.start, v.reversed) {
            (0, false) => [points[0], last],
            (0, true) => [last, points[0]],
            (vertex, _) => [points[vertex as usize]; 2],
        };
        sum += math::hypot(f64::from(first.x - at.x), f64::from(first.y - at.y));
        at = end;
    }
    sum / f64::from(MM)
}

/// Tours stops as the driver does, and with `more` times the effort.
fn tour(name: &str, list: &[Commanded], machine: &Machine, more: usize) {
    let stage = Stage { machine, from: Commanded([0, 0, machine.retract_z().0]), lifts: None };
    let mut first = 0.0;
    for effort in [0, EFFORT, EFFORT * more] {
        let start = cpu_s();
        let order = stops::tour(list, &stage, HeightOrder::Free, effort);
        let took = cpu_s() - start;
        let time = stops::time(list, &stage, &order);
        if effort == EFFORT {
            first = time;
        }
        let ratio = if effort > EFFORT { format!("{:.4}", first / time) } else { String::new() };
        println!("{name:<44} {took:>9.2} {time:>12.2} {:>14} {ratio:>8}", format!("effort {effort}"));
    }
}

/// CPU time of this thread.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    stat.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).expect("ns") / 1e9
}

fn shuffled(mut list: Strokes, seed: u64) -> Strokes {
    let mut random = Random::new(seed);
    for i in (1..list.len()).rev() {
        list.swap(i, random.below(i + 1));
    }
    list
}

/// Squares of 0.6 mm at 1 mm.
fn squares(columns: i32, rows: i32) -> Strokes {
    let square = |i: i32| {
        let (x, y) = ((i % columns - columns / 2) * MM, (i / columns - rows / 2) * MM);
        let (u, v) = (x + 600_000, y + 600_000);
        points(&[[x, y], [u, y], [u, v], [x, v], [x, y]])
    };
    (0..columns * rows).map(square).collect()
}

/// Circles of 0.6 mm at 1 mm.
fn circles(columns: i32, corners: i32) -> Strokes {
    let circle = |i: i32| {
        let corner = |k: i32| {
            let turn = f64::from(k % corners) / f64::from(corners) * std::f64::consts::TAU;
            let [x, y] = [math::cos(turn), math::sin(turn)].map(|v| (v * 300_000.0) as i32);
            FieldPoint::new((i % columns - columns / 2) * MM + x, (i / columns - columns / 2) * MM + y)
        };
        (0..=corners).map(corner).collect()
    };
    (0..columns * columns).map(circle).collect()
}

/// Lines of 40 mm at 0.1 mm.
fn hatch(lines: i32) -> Strokes {
    (0..lines).map(|i| [-20 * MM, 20 * MM].map(|x| FieldPoint::new(x, (i - lines / 2) * 100_000)).to_vec()).collect()
}

/// Dashes of two thirds of `pitch`, in rows at `rise`.
fn dashes(columns: i32, rows: i32, pitch: i32, rise: i32) -> Strokes {
    let dash = |i: i32| {
        let (x, y) = ((i % columns - columns / 2) * pitch, (i / columns - rows / 2) * rise);
        points(&[[x, y], [x + pitch * 2 / 3, y]])
    };
    (0..columns * rows).map(dash).collect()
}

/// Dashes of up to 1 mm in a field of 40 mm.
fn random(n: usize, seed: u64) -> Strokes {
    let mut random = Random::new(seed);
    let mut dash = |_| {
        let [x, y] = [0, 1].map(|_| random.below(40 * MM as usize) as i32 - 20 * MM);
        points(&[[x, y], [x + random.below(MM as usize) as i32, y + random.below(MM as usize) as i32]])
    };
    (0..n).map(&mut dash).collect()
}

/// The article's machine, with measured times of its moves if they are given.
fn machine(times: Option<[f64; 2]>) -> Machine {
    let mut machine = Machine::built_in("xyz-galvo-40").expect("profile");
    machine.stage.move_times = times.map(|[xy, z]| MoveTimes { xy: Time::s(xy), z: Time::s(z) });
    machine
}

/// A stage without inertia and settling, for which only distances count.
fn distance() -> Machine {
    let mut machine = machine(None);
    machine.stage.settle = Settling::Every(Time::s(0.0));
    for axis in [&mut machine.stage.x, &mut machine.stage.y, &mut machine.stage.z] {
        axis.jerk = None;
        axis.acceleration = "1e9 mm/s2".parse().expect("an acceleration");
    }
    machine
}

/// Free windows over a dome of 400 mm, 8 mm high.
fn windows(n: usize) -> Vec<Commanded> {
    let mut random = Random::new(7);
    let mut stop = |_| {
        let [x, y] = [0, 1].map(|_| random.between(-200_000, 199_999));
        let sag = (x * x + y * y) as f64 / 1e4;
        Commanded([x * 1000, y * 1000, random.between(0, 1999) * 1000 - sag as i64])
    };
    (0..n).map(&mut stop).collect()
}

/// 24 levels over each section of a grid, at other heights in each.
fn sections() -> Vec<Commanded> {
    let stop = |i: i64| {
        let (section, level) = (i / 24, i % 24);
        let (x, y) = (section % 12 - 6, section / 12 - 6);
        Commanded([x * 37_500_000, y * 37_500_000, level * 70_000 + x.abs() * 300_000 + y.abs() * 200_000])
    };
    (0..144 * 24).map(stop).collect()
}
