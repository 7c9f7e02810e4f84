//! Properties of the map on made-up programs: which cells are passed, whose they are, what is measured.

use super::*;
use terrace_core::geom::{BoxMm, FieldPoint, Turn};
use terrace_core::machine::{Commanded, Machine, TiltAngles};
use terrace_core::math;
use terrace_core::program::{PassId, PenId, SectionId, SetupId, Stop, Stroke, StrokeId};
use terrace_core::random::Random;

const MM: i64 = 1_000_000;

fn grid(columns: u32, rows: u32, cell: i64) -> Grid {
    Grid { origin: P2::new(0, 0), pitch: [Nm(cell); 2], count: [columns, rows] }
}

/// A block: centre and depth interval in nm, strokes in the part frame.
type Made = (P2, [i64; 2], Vec<Vec<P2>>);

fn program(blocks: &[Made]) -> Program {
    let mut program = Program::default();
    for (centre, [z_lo, z_hi], strokes) in blocks {
        let start = program.strokes.len();
        for points in strokes {
            let first = program.points.len() as u32;
            program
                .points
                .extend(points.iter().map(|p| FieldPoint::new((p.x - centre.x) as i32, (p.y - centre.y) as i32)));
            let len = points.len() as u32;
            program.strokes.push(Stroke {
                source: StrokeId(0),
                segment: 0,
                reversed: false,
                pen: PenId(0),
                first,
                len,
            });
        }
        let (z_lo, z_hi, lpfl) = (Nm(*z_lo), Nm(*z_hi), Nm((z_lo + z_hi) / 2));
        program.blocks.push(Block {
            pass: PassId(0),
            setup: SetupId(0),
            stop: Stop {
                section: SectionId([0; 2]),
                level: 0,
                tilt: TiltAngles::UPRIGHT,
                centre: Turn::upright(*centre),
                lpfl,
                z_lo,
                z_hi,
            },
            stage: Commanded::default(),
            focus_shift: Nm(0),
            retract: false,
            z_lo,
            z_hi,
            strokes: start..program.strokes.len(),
        });
    }
    program
}

/// A plane over a box.
fn plane(area: BoxMm<2>, z: impl Fn(f64, f64) -> f64) -> Surface {
    let [a, b, c, d] = area.corners().map(|[x, y]| [x, y, z(x, y)]);
    let facets = [[a, b, c], [a, c, d]];
    Surface::from_facets(facets, &mut Vec::new()).expect("two facets")
}

/// No block is tilted.
fn none(program: &Program) -> Vec<Option<Turn>> {
    vec![None; program.blocks.len()]
}

fn machine() -> Machine {
    Machine::built_in("xyz-galvo-40").expect("profile")
}

fn nm(x: f64, y: f64) -> P2 {
    P2::from_mm(x, y).expect("a length")
}

/// Sections of 40 mm from the origin.
fn sections(columns: u32, rows: u32) -> Sections {
    Sections { origin: P2::new(0, 0), pitch: [Nm(40 * MM); 2], count: [columns, rows] }
}

fn area(x: i64, y: i64) -> Box2 {
    Box2 { lo: P2::new(0, 0), hi: P2::new(x * MM, y * MM) }
}

/// Length of the segment from `a` to `b` inside a cell, borders included.
fn clipped(a: [i64; 2], b: [i64; 2], cell: [i64; 2], side: i64) -> f64 {
    let mut span = [0.0f64, 1.0];
    for k in 0..2 {
        let (lo, hi) = ((cell[k] * side - a[k]) as f64, ((cell[k] + 1) * side - a[k]) as f64);
        let d = (b[k] - a[k]) as f64;
        if d != 0.0 {
            span = [span[0].max((lo / d).min(hi / d)), span[1].min((lo / d).max(hi / d))];
        } else if lo > 0.0 || hi < 0.0 {
            return 0.0;
        }
    }
    let [dx, dy] = [0, 1].map(|k| (b[k] - a[k]) as f64);
    (span[1] - span[0]).max(0.0) * math::hypot(dx, dy)
}

#[test]
fn a_segment_passes_the_cells_it_crosses_and_no_others() {
    let mut tried = 0;
    for seed in 0..310 {
        let mut noise = Random::case(seed);
        let [a, b] = [0, 1].map(|_| [0, 1].map(|_| noise.between(0, 80)));
        let shift = noise.between(0, 2);
        if a == b {
            continue;
        }
        tried += 1;
        // Multiples of a tenth of a cell, so that corners and borders are met often; or just next to them.
        let (a, b) = (a.map(|v| v * 100 + shift), b.map(|v| v * 100 + shift));
        let grid = grid(9, 9, 1000);
        let mut lengths = vec![0.0; grid.len()];
        let mut passed = Vec::new();
        rasterise::pass(a, b, &grid, |cell, length| {
            lengths[cell] += length;
            passed.push(cell);
        });
        let along_border = (0..2).any(|k| a[k] == b[k] && a[k] % 1000 == 0);
        for (cell, &length) in lengths.iter().enumerate() {
            let at = [cell % 9, cell / 9].map(|v| v as i64);
            let want = clipped(a, b, at, 1000);
            // Along a border both cells hold the segment, and it is the upper one's.
            if !along_border || length > 0.0 {
                assert!((length - want).abs() < 1e-6, "seed {seed}: {a:?} to {b:?} in {at:?}: {length} {want}");
            }
        }
        let whole = math::hypot((b[0] - a[0]) as f64, (b[1] - a[1]) as f64);
        assert!((lengths.iter().sum::<f64>() - whole).abs() < 1e-6, "seed {seed}: {a:?} to {b:?}");
        let distinct: std::collections::BTreeSet<_> = passed.iter().collect();
        assert_eq!(distinct.len(), passed.len(), "seed {seed}: {a:?} to {b:?}: no cell is passed twice");
    }
    assert!(tried >= 300, "{tried} segments");
}

#[test]
fn connected_parts_equal_a_flood_fill() {
    for seed in 0..300 {
        let mut noise = Random::case(seed);
        let labels: Vec<u32> = (0..6 * 9).map(|_| noise.below(3) as u32).collect();
        let grid = grid(6, 9, 1);
        let mut seen = vec![false; labels.len()];
        let mut count = 0;
        for start in (0..labels.len()).filter(|&i| labels[i] != 0) {
            count += usize::from(!seen[start]);
            let mut open = vec![start];
            while let Some(i) = open.pop() {
                if std::mem::replace(&mut seen[i], true) {
                    continue;
                }
                let near = |j: &usize| (i % 6).abs_diff(j % 6) <= 1 && (i / 6).abs_diff(j / 6) <= 1;
                open.extend((0..labels.len()).filter(near).filter(|&j| labels[j] == labels[i]));
            }
        }
        assert_eq!(measure::count_components(&grid, &labels), count, "seed {seed}");
    }
}

#[test]
fn a_stroke_along_a_border_is_the_upper_cells_and_one_that_ends_there_the_lower_ones() {
    let grid = grid(4, 4, 1000);
    let cells = |a, b| {
        let mut cells = Vec::new();
        rasterise::pass(a, b, &grid, |cell, _| cells.push([cell % 4, cell / 4]));
        cells
    };
    assert_eq!(cells([0, 1000], [2000, 1000]), [[0, 1], [1, 1]]);
    assert_eq!(cells([2000, 1000], [0, 1000]), [[1, 1], [0, 1]]);
    assert_eq!(cells([3000, 0], [3000, 1000]), [[3, 0]]);
    assert_eq!(cells([0, 4000], [1000, 4000]), [[0, 3]], "the last row is closed");
    assert_eq!(cells([0, 0], [3000, 3000]), [[0, 0], [1, 1], [2, 2]], "through corners");
}

#[test]
fn a_cell_belongs_to_the_longest_marks_in_it() {
    let line = |x0: f64, x1: f64, y: f64| vec![nm(x0, y), nm(x1, y)];
    let z = [0, MM];
    let program = program(&[
        (nm(0.0, 0.0), z, vec![line(0.0, 0.6, 0.1)]),
        // Longer in the third cell, as long as the first in the second, where the first keeps it.
        (nm(1.0, 1.0), z, vec![line(0.25, 0.5, 0.05), line(0.55, 1.0, 0.2)]),
    ]);
    assert_eq!(
        rasterise::marked_cells(&BlockMarks { program: &program, turns: &none(&program) }, &grid(4, 1, 250_000)),
        [1, 1, 2, 2]
    );
}

#[test]
fn length_of_a_straight_border_is_exact() {
    let n = 400usize;
    let grid = grid(400, 400, 1);
    for degrees in [0.0f64, 10.0, 15.0, 22.5, 26.57, 30.0, 45.0, 60.0, 75.0, 90.0, 120.0, 135.0, 150.0] {
        let (sin, cos) = math::sin_cos(degrees.to_radians());
        let side = |i: usize| {
            let (x, y) = ((i % n) as f64 + 0.5 - 200.3, (i / n) as f64 + 0.5 - 199.8);
            1 + u32::from(y * cos - x * sin > 0.0)
        };
        let labels: Vec<u32> = (0..n * n).map(side).collect();
        // From rim to rim of the square through about its middle.
        let want = n as f64 / sin.abs().max(cos.abs());
        let found = measure::seam_cells(&grid, &labels);
        assert!((found / want - 1.0).abs() < 0.02, "{degrees} degrees: {found} of {want}");
    }
}

#[test]
fn length_of_a_circular_border_is_exact_and_unlabelled_sides_do_not_count() {
    let n = 400usize;
    let grid = grid(400, 400, 1);
    let inside = |i: usize| math::hypot((i % n) as f64 - 199.2, (i / n) as f64 - 200.1) < 150.0;
    let labels = |out: u32| (0..n * n).map(|i| if inside(i) { 7 } else { out }).collect::<Vec<u32>>();
    let found = measure::seam_cells(&grid, &labels(3));
    assert!((found / (300.0 * std::f64::consts::PI) - 1.0).abs() < 0.005, "{found}");
    assert_eq!(measure::seam_cells(&grid, &labels(0)), 0.0);
}

#[test]
fn gaps_are_closed_up_to_the_reach() {
    // A hatch of lines 4 cells apart in rows 2 to 18, and far from it a lonely line.
    let grid = grid(40, 60, 1);
    let mut labels = vec![0; grid.len()];
    let lines: Vec<usize> = (2..=18).step_by(4).chain([50]).collect();
    lines.iter().for_each(|y| labels[y * 40 + 5..y * 40 + 30].fill(1));
    let shown = closing::drawn_cells(&grid, &labels, 4, 20);
    for (i, shown) in shown.iter().enumerate() {
        let (x, y) = (i % 40, i / 40);
        assert_eq!(*shown, (5..30).contains(&x) && ((2..=18).contains(&y) || y == 50), "{x} {y}");
    }
    // Dots: between four of them too.
    labels.fill(0);
    (0..100).for_each(|k| labels[(5 + k / 10 * 4) * 40 + 2 + k % 10 * 3] = 1);
    let shown = closing::drawn_cells(&grid, &labels, 4, 20);
    assert_eq!(shown.iter().filter(|s| **s).count(), 28 * 37);
    // Most gaps too wide: sparse figures are closed as far as they are small.
    labels.fill(0);
    for (x, y) in [(2, 5), (35, 5), (2, 35), (35, 35)] {
        labels[y * 40 + x] = 1;
        labels[y * 40 + x + 3] = 1;
    }
    let shown = closing::drawn_cells(&grid, &labels, 4, 20);
    assert_eq!(shown.iter().filter(|s| **s).count(), 16);
    assert!(closing::drawn_cells(&grid, &vec![0; grid.len()], 4, 20).iter().all(|s| !s));
}

/// Two levels on a slope along x, 1 mm hatch along x, texture in the lower half only.
#[test]
fn a_level_without_marks_is_not_painted_and_lines_of_one_level_are_one_part() {
    let surface = plane(BoxMm::rectangle(0.0, 0.0, 40.0, 40.0), |x, y| 0.01 * x + 0.0101 * y);
    // z = 0.2 runs from (20, 0) to the upper left: the cut moves by 1 mm from line to line.
    let cut = |y: f64| (20.0 - 1.01 * y).clamp(0.0, 40.0);
    let ys: Vec<f64> = (0..12).map(|k| f64::from(k) + 0.6).collect();
    let lower = ys.iter().map(|&y| vec![nm(0.0, y), nm(cut(y), y)]).collect();
    let upper = ys.iter().map(|&y| vec![nm(cut(y), y), nm(40.0, y)]).collect();
    let centre = P2::new(20 * MM, 20 * MM);
    let program = program(&[(centre, [0, 200_000], lower), (centre, [200_000, 900_000], upper)]);
    let map =
        BlockMap::new(&program, &sections(1, 1), &none(&program), machine().usable_field(), &surface, area(40, 40));
    assert_eq!(map.size(), [160, 160]);
    assert_eq!(map.sub_blocks(), 2);
    for row in 0..160 {
        for column in 0..160 {
            let [x, y] = map.centre(column, row).mm();
            let label = map.labels()[(row * 160 + column) as usize];
            // Lines lie in rows 2, 6, … 46.
            let want = if !(0.5..11.75).contains(&y) { 0 } else { 1 + u32::from(0.01 * x + 0.0101 * y > 0.2) };
            let on_border = (0.01 * x + 0.0101 * y - 0.2).abs() < 0.0051;
            assert!(label == want || (on_border && want != 0 && label != 0), "{x} {y}: {label}, {want}");
        }
    }
    // 1.4 % for its direction, and a cell for each of its ends.
    let length = math::hypot(11.25f64, 11.25 * 1.01);
    assert!((map.seam_mm() / length - 1.0).abs() < 0.05, "{} {length}", map.seam_mm());
}

#[test]
fn a_valley_holds_two_parts_of_a_level() {
    let facets = [
        [[0.0, 0.0, 0.4], [20.0, 0.0, 0.0], [20.0, 40.0, 0.0]],
        [[0.0, 0.0, 0.4], [20.0, 40.0, 0.0], [0.0, 40.0, 0.4]],
        [[20.0, 0.0, 0.0], [40.0, 0.0, 0.4], [40.0, 40.0, 0.4]],
        [[20.0, 0.0, 0.0], [40.0, 40.0, 0.4], [20.0, 40.0, 0.0]],
    ];
    let surface = Surface::from_facets(facets, &mut Vec::new()).expect("four facets");
    let rows = |spans: &[[f64; 2]]| {
        let line = |y: i32| spans.iter().map(move |s| s.map(|x| nm(x, f64::from(y) * 3.0 + 1.0)).to_vec());
        (0..13).flat_map(line).collect::<Vec<_>>()
    };
    let centre = P2::new(20 * MM, 20 * MM);
    let program = program(&[
        (centre, [0, 200_000], rows(&[[10.0, 30.0]])),
        (centre, [200_000, 400_000], rows(&[[0.0, 10.0], [30.0, 40.0]])),
    ]);
    let map =
        BlockMap::new(&program, &sections(1, 1), &none(&program), machine().usable_field(), &surface, area(40, 40));
    assert_eq!(map.sub_blocks(), 3);
}

#[test]
fn stops_on_centres_of_sections_are_gridded() {
    let at = |x: i64, y: i64| program(&[(P2::new(x * MM, y * MM), [0, 1], Vec::new())]);
    let grid = sections(3, 2);
    let gridded = |program: Program| is_gridded(&program, &program.blocks, &grid);
    assert!(gridded(at(20, 20)) && gridded(at(100, 60)));
    for (x, y) in [(21, 20), (20, 40), (140, 20), (-20, 20), (20, 100)] {
        assert!(!gridded(at(x, y)), "{x} {y}");
    }
    // Wherever a stop stands, it is where its marks lie that counts.
    let marked = |x: i64, from: i64, to: i64| {
        let line = vec![P2::new(from * MM, 20 * MM), P2::new(to * MM, 20 * MM)];
        program(&[(P2::new(x * MM, 23 * MM), [0, 1], vec![line])])
    };
    assert!(gridded(marked(25, 10, 40)) && gridded(marked(70, 45, 80)));
    assert!(!gridded(marked(40, 20, 60)));
}

/// Windows of 40 mm strewn over a slope, their depth intervals at random; every piece of a line goes to
/// one of those that admit it, by chance.
#[test]
fn cells_under_free_windows_belong_to_the_block_of_their_marks() {
    let mut numbers = Random::new(7);
    let mut random = move |below: i64| numbers.between(0, below - 1);
    let surface = plane(BoxMm::rectangle(0.0, 0.0, 100.0, 100.0), |x, y| 0.004 * x + 0.003 * y);
    let z = |p: P2| p.x * 4 / 1000 + p.y * 3 / 1000;
    let stops: Vec<(P2, i64)> =
        (0..120).map(|_| (P2::new(random(100 * MM), random(100 * MM)), random(700) * 1000)).collect();
    let Nm(half) = machine().usable_field()[0] / 2;
    let accepting = |p: P2| {
        let fits = move |&(c, lo): &(P2, i64)| {
            (p.x - c.x).abs() <= half && (p.y - c.y).abs() <= half && (lo..=lo + 100_000).contains(&z(p))
        };
        stops.iter().enumerate().filter(move |(_, s)| fits(s)).map(|(i, _)| i).collect::<Vec<_>>()
    };
    let mut blocks: Vec<Made> = stops.iter().map(|&(c, lo)| (c, [lo, lo + 100_000], Vec::new())).collect();
    // The owner of every cell under a line; lines 0.5 mm apart, pieces of 4 mm, cut between cells.
    let mut owner = vec![0u32; 400 * 400];
    for (line, piece) in (0..200i64).flat_map(|l| (0..25i64).map(move |k| (l, k))) {
        let [a, b] = [piece, piece + 1].map(|k| P2::new(k * 4 * MM, line * 500_000 + 100_000));
        let all: Vec<usize> = accepting(a).into_iter().filter(|i| accepting(b).contains(i)).collect();
        if all.is_empty() {
            continue;
        }
        let own = all[random(all.len() as i64) as usize];
        blocks[own].2.push(vec![a, b]);
        owner[(line as usize * 2 * 400 + piece as usize * 16)..][..16].fill(own as u32 + 1);
    }
    blocks.retain(|b| !b.2.is_empty());
    let program = program(&blocks);
    let grid = Sections { origin: P2::new(0, 0), pitch: [Nm(40 * MM); 2], count: [3, 3] };
    assert!(!is_gridded(&program, &program.blocks, &grid));
    let map = BlockMap::new(&program, &grid, &none(&program), machine().usable_field(), &surface, area(100, 100));
    let place = |label: u32| blocks.get((label as usize).wrapping_sub(1)).map(|b| b.0);
    let (mut same, mut marked) = (0, 0);
    for (i, &own) in owner.iter().enumerate().filter(|(_, own)| **own != 0) {
        marked += 1;
        same += usize::from(place(map.labels()[i]) == Some(stops[own as usize - 1].0));
    }
    // The centre of a cell lies 0.03 mm off the line: at the ends of a level another stop may admit it.
    assert!(marked > 40_000 && same as f64 > 0.99 * f64::from(marked), "{same} of {marked}");
    for (i, &label) in map.labels().iter().enumerate().filter(|(_, l)| **l != 0) {
        let p = map.centre(i as u32 % 400, i as u32 / 400);
        let c = place(label).expect("a block");
        assert!((p.x - c.x).abs() <= half + 2 * MM && (p.y - c.y).abs() <= half + 2 * MM, "{p:?} of {c:?}");
    }
    let again = BlockMap::new(&program, &grid, &none(&program), machine().usable_field(), &surface, area(100, 100));
    assert_eq!(map.labels(), again.labels());
}

/// Lines 7 mm apart are farther from each other than an eighth of the texture, and nearer than a quarter of it.
#[test]
fn bands_have_the_map_of_blocks_in_one_section_over_all_of_the_texture() {
    let surface = plane(BoxMm::rectangle(0.0, 0.0, 40.0, 40.0), |x, _| 0.01 * x);
    let line = |y: i64, from: i64, to: i64| vec![P2::new(from * MM, y * MM), P2::new(to * MM, y * MM)];
    let across = |from: i64, to: i64| (0..6).map(|k| line(2 + 7 * k, from, to)).collect::<Vec<_>>();
    let corner = P2::new(40 * MM + 1, 40 * MM + 1);
    let program = program(&[(corner, [0, 200_000], across(0, 20)), (corner, [200_000, 400_000], across(20, 40))]);
    let area = area(40, 40);
    let pitch = area.size().map(|s| (s + Nm(1)) * 2);
    let section = Sections { origin: area.lo, pitch, count: [1, 1] };
    let of_blocks = BlockMap::new(&program, &section, &none(&program), pitch, &surface, area);
    let band = |b: &Block| Band { lpfl: b.stop.lpfl, z: [b.stop.z_lo, b.stop.z_hi], strokes: b.strokes.clone() };
    let bands: Vec<Band> = program.blocks.iter().map(band).collect();
    let of_bands = BlockMap::of_bands(&OrderedStrokes::of_program(&program), &bands, &surface, area);
    assert_eq!(of_bands.labels(), of_blocks.labels());
    assert_eq!(of_bands.sub_blocks(), of_blocks.sub_blocks());
    // From the lowest line to the highest, where the bands meet.
    assert!((of_bands.seam_mm() - 35.0).abs() < 1.0, "{}", of_bands.seam_mm());
}
