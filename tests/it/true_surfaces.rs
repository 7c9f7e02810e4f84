//! Warped parts that terrace has never seen, measured with noise: what it makes of the points, against the truth.
//!
//! The true part is the car hood of the fixtures, turned, leaning, shifted, and bent, twisted and dented, or not: by six
//! bumps of one width, up and down, or by many. A sensor measures it in a net, or where `terrace probe` says.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use terrace_core::geom::{Box2, NM_PER_MM, P2, SpacePoint};
use terrace_core::math;
use terrace_core::random::Random;
use terrace_input::surface::{self, Options, Trail};
use terrace_plan::plan::SteppedPlan;

use crate::support::{JobText, fixture, folder, planned, planning, said, seeds, terrace};

/// Noise of the sensor, mm.
const NOISE: f64 = 0.005;

/// The middle of the square of the hood that is marked, mm, and its usual side.
const MIDDLE: [f64; 2] = [625.0, 0.0];
const SIDE: f64 = 250.0;

/// The bounds of the square, mm.
fn area(side: f64) -> [f64; 4] {
    let [x, y] = MIDDLE;
    [x - side / 2.0, y - side / 2.0, x + side / 2.0, y + side / 2.0]
}

/// A normal deviate.
fn gauss(random: &mut Random) -> f64 {
    (-2.0 * math::ln(1.0 - random.unit())).sqrt() * math::cos(std::f64::consts::TAU * random.unit())
}

/// The true part as it lies on the table.
struct TruePart {
    /// Facets of the hood as they are clamped, undented, by cells of 5 mm of the table.
    cells: std::collections::HashMap<(i64, i64), Vec<[SpacePoint; 3]>>,
    /// Facets of the file.
    designed: Vec<[SpacePoint; 3]>,
    /// Side of the square that is measured and marked, mm.
    side: f64,
    /// Middle and height of the bumps, and their width, mm.
    bumps: Vec<[f64; 3]>,
    width: f64,
    /// By how much a corner of the square is higher than its middle by the bend about y, and by the twist, mm.
    bend: f64,
    twist: f64,
}

/// How far the part is turned about x, y and z, rad, and where its origin lies, mm.
const TURNS: [f64; 3] = [0.004, -0.003, 0.002];
const SHIFT: SpacePoint = [-625.123_456_7, 0.765_432_1, -126.5];

fn clamped(p: SpacePoint) -> SpacePoint {
    let turned = (0..3).fold(p, |p, axis| {
        let (s, c) = math::sin_cos(TURNS[axis]);
        let [i, k] = [(axis + 1) % 3, (axis + 2) % 3];
        let mut out = p;
        (out[i], out[k]) = (c * p[i] - s * p[k], s * p[i] + c * p[k]);
        out
    });
    [0, 1, 2].map(|k| turned[k] + SHIFT[k])
}

/// The height of the facet over a place, if one of them is there.
fn over<'a>(facets: impl IntoIterator<Item = &'a [SpacePoint; 3]>, [x, y]: [f64; 2]) -> Option<f64> {
    facets.into_iter().find_map(|[a, b, c]| {
        let d = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let u = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / d;
        let v = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / d;
        let is_in = u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9;
        is_in.then(|| a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]))
    })
}

impl TruePart {
    /// Six bumps of this width, highest less lowest `depth` over the usual square, mm.
    fn dented(seed: u64, width: f64, depth: f64) -> Self {
        let mut part = Self::designed(SIDE);
        part.width = width;
        let mut random = Random::case(seed);
        let bumps = (0..6).map(|_| [random.range(-130.0, 130.0), random.range(-130.0, 130.0), random.range(-1.0, 1.0)]);
        part.bumps = bumps.collect();
        part.scale(depth);
        part
    }

    /// Bent, twisted and dented all over a square of 450 mm, as much by the dents as by bend and twist: highest less lowest
    /// 0.4 mm.
    fn warped(seed: u64, width: f64) -> Self {
        let mut part = Self::designed(450.0);
        part.width = width;
        let mut random = Random::case(seed);
        let reach = part.side / 2.0 + width;
        let count = (reach / width).powi(2) as usize;
        let bumps =
            (0..count).map(|_| [random.range(-reach, reach), random.range(-reach, reach), random.range(-1.0, 1.0)]);
        part.bumps = bumps.collect();
        part.scale(0.2);
        [part.bend, part.twist] = [random.range(-0.1, 0.1), random.range(-0.1, 0.1)];
        part.scale(0.4);
        part
    }

    fn designed(side: f64) -> Self {
        let options = Options { unit_mm: Some(1.0), ..Options::default() };
        let mut designed = Vec::new();
        surface::read(&fixture("hood.stl"), &options, &mut Vec::new(), &mut |facet| designed.push(facet))
            .expect("a hood");
        let mut cells = std::collections::HashMap::<_, Vec<_>>::new();
        for facet in &designed {
            let lies = facet.map(clamped);
            let range = |k: usize| {
                let v = lies.map(|p| (p[k] / 5.0).floor() as i64);
                v[0].min(v[1]).min(v[2])..=v[0].max(v[1]).max(v[2])
            };
            for i in range(0) {
                range(1).for_each(|k| cells.entry((i, k)).or_default().push(lies));
            }
        }
        Self { cells, designed, side, bumps: Vec::new(), width: 1.0, bend: 0.0, twist: 0.0 }
    }

    /// Makes highest less lowest over the square `depth`, mm.
    fn scale(&mut self, depth: f64) {
        let steps = self.side as usize / 10;
        let at = |i: usize| 10.0 * i as f64 - self.side / 2.0;
        let places = (0..=steps).flat_map(|i| (0..=steps).map(move |k| [at(i), at(k)]));
        let heights: Vec<f64> = places.map(|at| self.dent(at)).collect();
        let [lo, hi] = [
            heights.iter().copied().fold(f64::INFINITY, f64::min),
            heights.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ];
        let by = depth / (hi - lo);
        self.bumps
            .iter_mut()
            .map(|bump| &mut bump[2])
            .chain([&mut self.bend, &mut self.twist])
            .for_each(|mm| *mm *= by);
    }

    /// By how much it is bent, twisted and dented at a place of the table, mm.
    fn dent(&self, [x, y]: [f64; 2]) -> f64 {
        let of = |[a, b, h]: &[f64; 3]| {
            h * math::exp(-((x - a).powi(2) + (y - b).powi(2)) / (2.0 * self.width * self.width))
        };
        let [u, v] = [x, y].map(|mm| mm / (self.side / 2.0));
        self.bumps.iter().map(of).sum::<f64>() + self.bend * u * u + self.twist * u * v
    }

    /// Its height over a place of the table, mm; None beside it.
    fn height(&self, at: [f64; 2]) -> Option<f64> {
        let facets = self.cells.get(&((at[0] / 5.0).floor() as i64, (at[1] / 5.0).floor() as i64))?;
        Some(over(facets, at)? + self.dent(at))
    }

    /// Five features found with the pilot laser.
    fn features(&self, random: &mut Random) -> String {
        let mut text = "kind,stage_x,stage_y,stage_z,sigma_um,part_x,part_y,part_z\n".to_owned();
        let by = self.side / SIDE;
        for at in [[-115.0, -118.0], [115.0, -118.0], [115.0, 118.0], [-120.0, 118.0], [-5.0, 5.0]] {
            let [x, y] = [0, 1].map(|k| MIDDLE[k] + at[k] * by);
            let p = [x, y, over(&self.designed, [x, y]).expect("on the hood")];
            let [a, b, c] = clamped(p);
            let mut found = [a, b, c + self.dent([a, b])];
            found.iter_mut().for_each(|v| *v += 0.01 * gauss(random));
            let _ = writeln!(text, "optical,{:.7},{:.7},{:.7},10,{x},{y},{:.6}", -found[0], -found[1], found[2], p[2]);
        }
        text
    }

    /// The row of the sensor over a place of the table; None beside the part.
    fn row(&self, at: [f64; 2], random: &mut Random) -> Option<String> {
        let z = self.height(at)? + NOISE * gauss(random);
        Some(format!("distance,{:.7},{:.7},{z:.7},{},,,\n", -at[0], -at[1], NOISE * 1e3))
    }

    /// Features, and so many points in rows from rim to rim, those within off an even net by up to `off` of its steps.
    fn net(&self, count: usize, off: f64, random: &mut Random) -> String {
        let rows = (count as f64).sqrt().round() as usize;
        let mut offsets = Random::case(count as u64);
        let mut at = |k: usize, of: usize| {
            let is_rim = k == 0 || k + 1 == of;
            let steps = k as f64 + if is_rim { 0.0 } else { off * offsets.range(-1.0, 1.0) };
            2.0 + (self.side - 4.0) * steps / (of - 1) as f64
        };
        let [x0, y0, ..] = area(self.side);
        let mut text = self.features(random);
        for row in 0..rows {
            let of = count * (row + 1) / rows - count * row / rows;
            for k in 0..of {
                let [x, y] = [x0 + at(k, of), y0 + at(row, rows)];
                let [x, y, _] = clamped([x, y, over(&self.designed, [x, y]).expect("on the hood")]);
                text.extend(self.row([x, y], random));
            }
        }
        text
    }
}

/// What is marked.
#[derive(Clone, Copy)]
enum Marked {
    /// Lines all over a square of this side, mm.
    Square(f64),
    /// Lines over two patches at opposite corners of the usual square.
    Patches,
}

/// Side of a patch, mm.
const PATCH: f64 = 80.0;

impl Marked {
    /// The lines of the texture's table.
    fn texture(self, dir: &Path) -> String {
        let side = if let Self::Square(side) = self { side } else { SIDE };
        let [x0, y0, x1, y1] = area(side);
        if matches!(self, Self::Square(_)) {
            let area = format!("area = [\"{x0} mm\", \"{y0} mm\", \"{x1} mm\", \"{y1} mm\"]");
            return format!("pattern = \"hatch\"\npitch = \"2.5 mm\"\n{area}");
        }
        let lines = |from: f64| {
            let line = |k: usize| format!("M{from} {}h{PATCH}", from + 2.5 * k as f64);
            (0..=(PATCH / 2.5) as usize).map(line).collect::<String>()
        };
        // y of the drawing goes down.
        let d = lines(0.0) + &lines(SIDE - PATCH);
        let size = format!("width='{SIDE}mm' height='{SIDE}mm' viewBox='0 0 {SIDE} {SIDE}'");
        let svg =
            format!("<svg xmlns='http://www.w3.org/2000/svg' {size} stroke='black' fill='none'><path d='{d}'/></svg>");
        std::fs::write(dir.join("patches.svg"), svg).expect("writable");
        format!("file = \"patches.svg\"\norigin = [\"{x0} mm\", \"{y0} mm\"]")
    }

    /// Whether a place is marked, as shares of the area from its left and lower sides.
    fn has(self, [u, v]: [f64; 2]) -> bool {
        let share = PATCH / SIDE;
        let is_low = |w: f64| w <= share;
        match self {
            Self::Square(_) => true,
            Self::Patches => is_low(u) && is_low(1.0 - v) || is_low(1.0 - u) && is_low(v),
        }
    }
}

/// A job on the hood; `focus` and `measured` are lines of their tables.
fn job(dir: &Path, name: &str, marked: Marked, focus: &str, measured: &str) -> PathBuf {
    let mut job = JobText::on(&fixture("hood.stl")).texture(&marked.texture(dir));
    job.focus = focus.into();
    job.more = format!(
        "[placement]\norigin = [\"-625 mm\", \"1 mm\", \"-126 mm\"]\n[placement.measured]\nfile = \"points.csv\"\n{measured}\n"
    );
    job.write(dir, name)
}

/// What a plan made of the points of a part, against it.
struct Judged {
    /// Shares of places inside three deviations of the height, of marks in focus, and of places that would be in focus
    /// without the correction.
    inside: f64,
    in_focus: f64,
    in_focus_rigid: f64,
    /// Root mean square and largest error of the height, mm.
    rms: f64,
    worst: f64,
    stops: usize,
    /// The most that is kept free anywhere, mm.
    kept: f64,
    /// Largest deviation of the height under the texture, mm.
    sigma: f64,
}

impl Judged {
    fn told(&self) -> String {
        let [rms, worst, sigma, kept] = [self.rms, self.worst, self.sigma, self.kept].map(|mm| mm * 1e3);
        let [inside, focus, rigid] = [self.inside, self.in_focus, self.in_focus_rigid].map(|share| share * 100.0);
        format!(
            "error {rms:.1} um rms, {worst:.1} at worst, sigma up to {sigma:.1} um, kept up to {kept:.1} um; {inside:.2} % of \
             places inside three sigmas, {focus:.2} % of marks in focus, {rigid:.1} % without correction; {} stops",
            self.stops
        )
    }
}

fn judged(plan: &SteppedPlan, marked: Marked, part: &TruePart) -> Judged {
    let inputs = &plan.inputs;
    let (surface, reserve) = (&inputs.surface, inputs.reserve().expect("a measured part"));
    let origin = plan.checked.origin().mm();
    let correction = inputs.measured.as_ref().and_then(|m| m.correction.clone());
    let mut trail = Trail::new(2.0);
    let (mut places, mut inside, mut rigid, mut square, mut worst, mut sigma) = (0.0, 0.0, 0.0, 0.0, 0.0f64, 0.0f64);
    let bounds = inputs.texture.bounds();
    let step = 3_000_000;
    let half = plan.job.focus.half_depth_mm();
    for x in (bounds.lo.x..bounds.hi.x).step_by(step) {
        for y in (bounds.lo.y..bounds.hi.y).step_by(step) {
            let p = P2::new(x, y);
            let share = |v: i64, lo: i64, hi: i64| (v - lo) as f64 / (hi - lo) as f64;
            if !marked.has([share(x, bounds.lo.x, bounds.hi.x), share(y, bounds.lo.y, bounds.hi.y)]) {
                continue;
            }
            trail.follow(surface, p, p);
            let Some((span, _)) = trail.spans().next().filter(|(span, _)| span.facet().is_some()) else { continue };
            let at = [x as f64 / NM_PER_MM, y as f64 / NM_PER_MM];
            let Some(height) = part.height([at[0] + origin[0], at[1] + origin[1]]) else { continue };
            let found = span.z0 / NM_PER_MM + origin[2];
            let error = height - found;
            let deviation = reserve.deviation(Box2 { lo: p, hi: p }) / NM_PER_MM;
            let added = correction.as_ref().map_or(0.0, |c| c.height([x as f64, y as f64]) / NM_PER_MM);
            places += 1.0;
            inside += f64::from(u8::from(error.abs() <= 3.0 * deviation));
            rigid += f64::from(u8::from((error + added).abs() <= half / 2.0));
            square += error * error;
            (worst, sigma) = (worst.max(error.abs()), sigma.max(deviation));
        }
    }
    let program = plan.checked.program();
    let (mut marks, mut focused) = (0.0, 0.0);
    for block in &program.blocks {
        let [cx, cy] = block.stop.centre.mm();
        for stroke in program.strokes_of(block) {
            for p in program.points_of(stroke) {
                let at = [f64::from(p.x) / NM_PER_MM + cx + origin[0], f64::from(p.y) / NM_PER_MM + cy + origin[1]];
                let Some(height) = part.height(at) else { continue };
                marks += 1.0;
                let off = height - block.stop.lpfl.mm() - origin[2];
                focused += f64::from(u8::from(off.abs() <= half));
            }
        }
    }
    assert!(places > 1000.0 && marks > 1000.0, "{places} places, {marks} ends of marks");
    Judged {
        inside: inside / places,
        in_focus: focused / marks,
        in_focus_rigid: rigid / places,
        rms: (square / places).sqrt(),
        worst,
        stops: program.stops(),
        kept: reserve.kept(bounds) / NM_PER_MM,
        sigma,
    }
}

/// The depth of focus of the jobs, and how far parts may be warped.
const FOCUS: &str = "pdof = \"0.12 mm\"";
const WARP: &str = "warp = \"0.5 mm\"";

/// Widths of the dents, mm, and how many points show them.
const PAIRS: [(f64, usize); 9] =
    [(20.0, 60), (20.0, 120), (20.0, 240), (40.0, 60), (40.0, 120), (40.0, 240), (80.0, 60), (80.0, 120), (80.0, 240)];

/// A depth of focus as fine as published for a part of 450 mm, and coarser ones, um.
const DEPTHS: [u32; 3] = [70, 120, 400];

/// Points set by hand lie so far off an even net, steps of it.
const BY_HAND: f64 = 1.0 / 3.0;

#[test]
#[ignore = "slow: make test-all"]
fn places_are_known_as_closely_as_is_said_and_stops_keep_free_no_more_than_they_need() {
    let dir = folder();
    let points = dir.path().join("points.csv");
    let (mut inside, mut fewer) = (0.0, 0.0);
    for (seed, (width, count)) in (1..).zip(PAIRS) {
        let part = TruePart::warped(seed, width);
        let marked = Marked::Square(part.side);
        std::fs::write(&points, part.net(count, BY_HAND, &mut Random::case(100 + seed))).expect("writable");
        // The finest depth of focus for which so many points are enough.
        let (depth, plan) = DEPTHS
            .into_iter()
            .find_map(|depth| match planning(&job(dir.path(), "own.toml", marked, &focus(depth), WARP)) {
                Ok(plan) => Some((depth, plan)),
                Err(e) => {
                    assert!(e.to_string().contains("not known closely enough"), "{e}");
                    None
                }
            })
            .expect("known closely enough for a coarse focus");
        let own = judged(&plan, marked, &part);
        // One reserve for the whole job that is as safe where the part is known least.
        let reserve = format!("{}\nreserve = \"{:.4} mm\"", focus(depth), (2.0 * own.kept * 1e4).ceil() / 1e4);
        let single = planned(&job(dir.path(), "single.toml", marked, &reserve, &format!("{WARP}\nsigmas = 0")));
        let single = single.checked.program().stops();
        let saved = 1.0 - own.stops as f64 / single as f64;
        let text = format!(
            "{count} points, dents of {width} mm, depth of focus {depth} um: {}, {:.1} % fewer than {single} with one reserve",
            own.told(),
            100.0 * saved
        );
        println!("{text}");
        assert!(own.inside >= 0.97 && own.in_focus >= 0.99, "{text}");
        assert!(depth == DEPTHS[2] || own.in_focus_rigid < 0.5, "{text}");
        inside += own.inside / PAIRS.len() as f64;
        fewer += saved / PAIRS.len() as f64;
    }
    println!("{:.2} % of places inside three deviations, {:.1} % fewer stops", 100.0 * inside, 100.0 * fewer);
    assert!(inside >= 0.99 && fewer >= 0.25, "means: {inside} of places inside three deviations, {fewer} fewer stops");
}

#[test]
#[ignore = "slow: make test-all"]
fn points_of_a_warped_part_say_that_a_job_without_correction_is_out_of_focus() {
    let dir = folder();
    let mut judged_pairs = 0;
    for (seed, (width, count)) in (1..).zip(PAIRS) {
        let part = TruePart::warped(seed, width);
        let marked = Marked::Square(part.side);
        let table = part.net(count, BY_HAND, &mut Random::case(100 + seed));
        let rigid = job(dir.path(), "rigid.toml", marked, &focus(DEPTHS[0]), "sigmas = 0");
        // All features, and three, which any rigid part goes through.
        std::fs::write(dir.path().join("points.csv"), &table).expect("writable");
        let refused = planning(&rigid).map(|_| ()).expect_err("features on a warped part").to_string();
        assert!(refused.contains("go together") && refused.contains("placement.measured.warp"), "{refused}");
        let three = table.lines().enumerate().filter(|&(i, _)| i != 2 && i != 5);
        let three: String = three.map(|(_, line)| format!("{line}\n")).collect();
        std::fs::write(dir.path().join("points.csv"), three).expect("writable");
        match planning(&rigid) {
            Ok(plan) => {
                let warned = plan.warnings.iter().find(|warning| warning.code == "measured-noise");
                let said = warned.expect("a warning of the noise").to_string();
                let rigid = judged(&plan, marked, &part);
                println!(
                    "{count} points, dents of {width} mm: {:.1} % of marks in focus; {said}",
                    100.0 * rigid.in_focus
                );
                assert!(said.contains("placement.measured.warp") && rigid.in_focus < 0.5, "{said}; {}", rigid.told());
                judged_pairs += 1;
            }
            Err(e) => {
                println!("{count} points, dents of {width} mm: {e}");
                assert!(e.to_string().contains("the part is not as designed where points lie off it together"), "{e}");
            }
        }
    }
    assert!(judged_pairs >= 6, "{judged_pairs} of {} planned", PAIRS.len());
}

/// The table of the job's focus, a depth in um.
fn focus(depth: u32) -> String {
    format!("pdof = \"{depth} um\"")
}

/// Where to measure, as `terrace probe` says: positions of the table, mm.
fn chosen(job: &Path, count: usize, to: &Path) -> Vec<[f64; 2]> {
    let count = count.to_string();
    let args = ["--sensor", "5 um", "--points", &count, "--json", "-o"].map(Path::new);
    let out = terrace([Path::new("probe"), job].into_iter().chain(args).chain([to]));
    assert!(out.status.success(), "{}", said(&out));
    let told: serde_json::Value = serde_json::from_slice(&out.stdout).expect("JSON");
    let points = told["points"].as_array().expect("points").iter();
    let stage = points.map(|p| serde_json::from_value::<SpacePoint>(p["stage_mm"].clone()).expect("mm"));
    stage.map(|[x, y, _]| [-x, -y]).collect()
}

/// Stops, how many times it was inside three deviations, and largest errors of the height, mm, summed over plans.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    stops: f64,
    inside: f64,
    worst: f64,
}

/// How many draws of the noise are planned of each set of points: between two of one set stops differ by a tenth.
const DRAWS: u64 = 2;

/// What plans make of an even net of points over the area, and of as many chosen ones, on the same part, summed.
fn net_and_chosen(seed: u64, count: usize, marked: Marked, (width, depth): (f64, f64), measured: &str) -> [Sums; 2] {
    let dir = folder();
    let part = TruePart::dented(seed, width, depth);
    let points = dir.path().join("points.csv");
    let file = job(dir.path(), "job.toml", marked, FOCUS, measured);
    let at = chosen(&file, count, &dir.path().join("probe"));
    let mut sums = [Sums::default(); 2];
    for draw in 0..DRAWS {
        let mut random = Random::case(200 + 100 * draw + seed);
        let mut of_chosen = part.features(&mut random);
        at.iter().for_each(|&at| of_chosen.extend(part.row(at, &mut random)));
        let tables = [("net", part.net(count, 0.0, &mut random)), ("chosen", of_chosen)];
        for ((name, table), sum) in tables.into_iter().zip(&mut sums) {
            std::fs::write(&points, table).expect("writable");
            let judged = judged(&planned(&file), marked, &part);
            let text = format!("{seed}, bumps of {width} mm, draw {draw}, {name}: {}", judged.told());
            println!("{text}");
            assert!(judged.in_focus >= 0.99, "{text}");
            sum.stops += judged.stops as f64;
            sum.inside += judged.inside / DRAWS as f64;
            sum.worst += judged.worst;
        }
    }
    sums
}

#[test]
#[ignore = "slow: make test-all"]
fn chosen_points_of_a_rigid_part_cost_fewer_stops_than_a_net_of_as_many() {
    let dir = folder();
    let exact = job(dir.path(), "exact.toml", Marked::Square(SIDE), FOCUS, "sigmas = 0");
    let (mut net, mut chosen) = (0.0, 0.0);
    for seed in seeds(1..4) {
        let part = TruePart::dented(seed, 40.0, 0.0);
        std::fs::write(dir.path().join("points.csv"), part.net(25, 0.0, &mut Random::case(seed))).expect("writable");
        let least = planned(&exact).checked.program().stops();
        let both = net_and_chosen(seed, 25, Marked::Square(SIDE), (40.0, 0.0), "");
        println!("{seed}: {least} stops at least, {both:?}");
        assert!(both.iter().all(|sums| sums.inside >= 0.99), "{seed}: {both:?}");
        let [of_net, of_chosen] = both.map(|sums| sums.stops - (DRAWS * least as u64) as f64);
        (net, chosen) = (net + of_net, chosen + of_chosen);
    }
    assert!(chosen < 0.95 * net, "stops over those of a part that is known exactly: chosen {chosen}, net {net}");
}

#[test]
#[ignore = "slow: make test-all"]
fn chosen_points_of_a_warped_part_that_is_marked_in_patches_cost_fewer_stops_than_a_net_of_as_many() {
    let mut all = [Sums::default(); 2];
    for seed in seeds(11..16) {
        let width = 40.0 + 5.0 * (seed % 8) as f64;
        let both = net_and_chosen(seed, 36, Marked::Patches, (width, 0.2), WARP);
        println!("{seed}: {both:?}");
        for (sum, of) in all.iter_mut().zip(both) {
            let inside = sum.inside + of.inside / 5.0;
            *sum = Sums { stops: sum.stops + of.stops, inside, worst: sum.worst + of.worst };
        }
    }
    let [net, chosen] = all;
    let text = format!("net {net:?}, chosen {chosen:?}");
    println!("{text}");
    assert!(chosen.stops < 0.95 * net.stops && chosen.worst < net.worst && chosen.inside >= 0.99, "{text}");
}

#[test]
#[ignore = "slow: make test-all"]
fn a_warped_part_that_is_marked_all_over_is_measured_in_a_regular_net() {
    let dir = folder();
    let file = job(dir.path(), "job.toml", Marked::Square(SIDE), FOCUS, WARP);
    let at = chosen(&file, 100, &dir.path().join("probe"));
    for axis in 0..2 {
        let mut lines: Vec<i64> = at.iter().map(|p| p[axis].round() as i64).collect();
        lines.sort_unstable();
        lines.dedup();
        let gaps: Vec<i64> = lines.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(lines.len() == 10 && gaps.iter().all(|gap| (25..=31).contains(gap)), "{lines:?}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn what_lies_between_two_patches_that_were_measured_is_not_marked_as_if_it_were_known() {
    let dir = folder();
    let part = TruePart::dented(12, 45.0, 0.2);
    let mut random = Random::case(1);
    let patches = job(dir.path(), "patches.toml", Marked::Patches, FOCUS, WARP);
    let at = chosen(&patches, 36, &dir.path().join("probe"));
    let mut table = part.features(&mut random);
    at.into_iter().for_each(|at| table.extend(part.row(at, &mut random)));
    std::fs::write(dir.path().join("points.csv"), table).expect("writable");
    assert!(planned(&patches).checked.program().stops() > 100);
    let all_over = job(dir.path(), "all-over.toml", Marked::Square(SIDE), FOCUS, WARP);
    let refused = terrace([Path::new("check"), &all_over]);
    let said = said(&refused);
    assert!(!refused.status.success() && said.contains("measured-unsure"), "{said}");
    // Where to measure more lies between them.
    let more = chosen(&all_over, 40, &dir.path().join("more"));
    let is_between = |p: &&[f64; 2]| !Marked::Patches.has([0, 1].map(|k| (p[k] + SIDE / 2.0) / SIDE));
    assert!(more.iter().filter(is_between).count() > 30, "{more:?}");
}
