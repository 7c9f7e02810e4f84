//! From fragments to a program: gathered by stop, focal planes set, stops and strokes ordered, all laid
//! out flat.

use rayon::prelude::*;

use super::{Ground, Setups, dose};
use crate::geom::{Box2, P2};
use crate::order;
use crate::order::stops::Climb;
use crate::order::strokes::{Path, Visit};
use crate::partition::Stops;
use crate::program::{Block, Program, Stop, Stroke};
use crate::record::Slope;
use crate::spec::{Level, StopOrder, StrokeOrder};
use crate::split::Fragments;

/// A program in order, and how far its marks lie from their focal planes at most, nm.
pub(super) struct Built {
    pub(super) program: Program,
    pub(super) setups: Setups,
    pub(super) worst_defocus: i64,
    /// The same with the mean height as focal plane.
    pub(super) worst_defocus_mean: i64,
    /// Slope under the marks of every block; None where the part is tilted.
    pub(super) slopes: Vec<Slope>,
}

/// Heights of one block's marks.
#[derive(Clone, Copy)]
struct Heights {
    lo: f64,
    hi: f64,
    z_length: f64,
    length: f64,
}

/// Gathers fragments by stop, orders stops and strokes, and lays the program out flat.
pub(super) fn build(ground: &Ground<'_>, stops: &Stops, parts: &[Fragments]) -> Built {
    let n = stops.stops.len();
    let pens = dose::Pens::new(ground, parts.iter().flat_map(|p| &p.list));
    let mut slopes = vec![Slope::default(); n];
    let mut starts = vec![0usize; n + 1];
    let mut heights = vec![Heights { lo: f64::INFINITY, hi: f64::NEG_INFINITY, z_length: 0.0, length: 0.0 }; n];
    for f in parts.iter().flat_map(|p| &p.list) {
        starts[f.stop as usize + 1] += 1;
        let h = &mut heights[f.stop as usize];
        h.lo = h.lo.min(f.z[0]);
        h.hi = h.hi.max(f.z[1]);
        h.z_length += f.z_length;
        h.length += f.length;
        slopes[f.stop as usize].add(f.length, dose::mean_cos(f), f.slope2, pens.gain(f));
    }
    for i in 0..n {
        starts[i + 1] += starts[i];
    }
    let mut members = vec![(0u32, 0u32); starts[n]];
    let mut next = starts.clone();
    for (part, fragments) in parts.iter().enumerate() {
        for (i, f) in fragments.list.iter().enumerate() {
            members[next[f.stop as usize]] = (part as u32, i as u32);
            next[f.stop as usize] += 1;
        }
    }
    let mut worst = [0i64; 2];
    let used: Vec<usize> = (0..n).filter(|&i| starts[i + 1] > starts[i]).collect();
    let placed: Vec<(Stop, [i64; 2])> = used
        .iter()
        .map(|&i| {
            let h = &heights[i];
            let z = [h.lo.round() as i64, h.hi.round() as i64];
            let mut stop = stops.stops[i].clone();
            let mean = if h.length > 0.0 { (h.z_length / h.length).clamp(h.lo, h.hi) } else { (h.lo + h.hi) / 2.0 };
            let (focus, mean) = focus(ground, z, mean);
            stop.focus = focus;
            let off = |at: i64| (z[1] - at).max(at - z[0]);
            worst = [worst[0].max(off(focus)), worst[1].max(off(mean))];
            (stop, z)
        })
        .collect();
    let centres: Vec<P2> = placed.iter().map(|(s, _)| s.centre).collect();
    let setups = ground.place.setups.clone().unwrap_or_else(|| Setups::of(ground, &centres));
    let cells: Vec<usize> = centres.iter().map(|&c| setups.cell(c)).collect();
    let target = |((s, _), &cell): (&(Stop, [i64; 2]), &usize)| {
        ground.machine.stage_from_part([s.centre.x, s.centre.y, s.focus], setups.origin(cell, ground.origin))
    };
    let targets: Vec<[i64; 3]> = placed.iter().zip(&cells).map(target).collect();
    let points = |(part, i): (u32, u32)| {
        let (fragments, f) = (&parts[part as usize], &parts[part as usize].list[i as usize]);
        &fragments.points[f.first as usize..(f.first + f.len) as usize]
    };
    let in_order = |&stop: &usize| {
        let members = &members[starts[stop]..starts[stop + 1]];
        let path =
            |&m: &(u32, u32)| Path { points: points(m), is_closed: parts[m.0 as usize].list[m.1 as usize].is_figure };
        match ground.job.file.order.strokes {
            StrokeOrder::Shortest => order::strokes::order(&members.iter().map(path).collect::<Vec<_>>()),
            StrokeOrder::Drawing => order::strokes::as_drawn(members.len()),
        }
    };
    let (tour, orders): (_, Vec<Vec<Visit>>) =
        rayon::join(|| tours(ground, &placed, &targets, &cells), || used.par_iter().map(in_order).collect());
    let mut program = Program { pens: pens.list.clone(), ..Program::default() };
    let slopes = tour.iter().map(|&t| slopes[used[t]]).collect();
    program.strokes.reserve_exact(starts[n]);
    program.points.reserve_exact(parts.iter().map(|p| p.points.len()).sum());
    program.blocks.reserve_exact(tour.len());
    for &t in &tour {
        let (stop, z) = &placed[t];
        let first_stroke = program.strokes.len();
        let members = &members[starts[used[t]]..starts[used[t] + 1]];
        for &Visit { stroke, start, reversed } in &orders[t] {
            let member = members[stroke as usize];
            let f = &parts[member.0 as usize].list[member.1 as usize];
            let first = program.points.len();
            let points = points(member);
            if reversed {
                program.points.extend(points.iter().rev());
            } else {
                // A closed stroke is turned so that it begins and ends at its start.
                program.points.extend_from_slice(&points[start as usize..]);
                program.points.extend_from_slice(&points[1..][..start as usize]);
            }
            program.strokes.push(Stroke {
                source: f.source,
                segment: f.segment + start,
                reversed,
                pen: pens.of(f),
                first: u32::try_from(first).expect("memory holds fewer than 2^32 points"),
                len: f.len,
            });
        }
        let setup = cells[t] as u32;
        let before = ground.place.before.as_ref().map(|(stop, setup)| (stop, *setup));
        let last = program.blocks.last().map(|b| (&b.stop, b.setup)).or(before);
        let retract = last.is_some_and(|(last, before)| before != setup || lifts(ground, last, stop));
        program.blocks.push(Block {
            pass: ground.place.number,
            setup,
            stage: targets[t],
            retract,
            z_lo: z[0],
            z_hi: z[1],
            strokes: first_stroke..program.strokes.len(),
            stop: stop.clone(),
        });
    }
    Built { program, setups, worst_defocus: worst[0], worst_defocus_mean: worst[1], slopes }
}

/// The order in which the stage visits the stops: set-up after set-up, backwards in every other pass.
fn tours(ground: &Ground<'_>, placed: &[(Stop, [i64; 2])], targets: &[[i64; 3]], cells: &[usize]) -> Vec<usize> {
    let mut used = cells.to_vec();
    used.sort_unstable();
    used.dedup();
    if used.len() <= 1 {
        return tour(ground, placed, targets, ground.place.from);
    }
    if ground.place.number % 2 == 1 {
        used.reverse();
    }
    let mut from = ground.place.from;
    let mut order = Vec::with_capacity(placed.len());
    for cell in used {
        let members: Vec<usize> = (0..placed.len()).filter(|&i| cells[i] == cell).collect();
        let stops: Vec<_> = members.iter().map(|&i| placed[i].clone()).collect();
        let at: Vec<[i64; 3]> = members.iter().map(|&i| targets[i]).collect();
        order.extend(tour(ground, &stops, &at, from).into_iter().map(|i| members[i]));
        from = order.last().map_or(from, |&i| [targets[i][0], targets[i][1], ground.machine.retract_z()]);
    }
    order
}

/// The order in which the stage visits stops of one set-up.
fn tour(ground: &Ground<'_>, placed: &[(Stop, [i64; 2])], targets: &[[i64; 3]], from: [i64; 3]) -> Vec<usize> {
    if placed.is_empty() {
        return Vec::new();
    }
    let Ground { machine, clearance, .. } = ground;
    // Most parts are so flat that the head never needs to lift.
    let mut area = Box2::EMPTY;
    placed.iter().for_each(|(s, _)| area.add(s.centre));
    let lowest = clearance.lowest_focus(area.lo, area.hi) + ground.place.lowered;
    if placed.iter().any(|(s, _)| s.tilt != [0; 2]) {
        return turned_tour(ground, targets, placed);
    }
    let lifts = |a: usize, b: usize| placed[a].0.focus < lowest && lifts(ground, &placed[a].0, &placed[b].0);
    let stage =
        order::stops::Stage { machine, from, lifts: placed.iter().any(|(s, _)| s.focus < lowest).then_some(&lifts) };
    order::stops::tour(targets, &stage, climb(ground), order::stops::EFFORT)
}

fn climb(ground: &Ground<'_>) -> Climb {
    match ground.job.file.order.stops {
        StopOrder::Time => Climb::Free,
        StopOrder::ZUp => Climb::Up,
        StopOrder::ZDown => Climb::Down,
    }
}

/// The tour of tilted stops: levels of one place and tilt follow each other, alternately up and down, since
/// every other move turns the part.
fn turned_tour(ground: &Ground<'_>, targets: &[[i64; 3]], placed: &[(Stop, [i64; 2])]) -> Vec<usize> {
    let stage = order::stops::Stage { machine: ground.machine, from: ground.place.from, lifts: None };
    if climb(ground) != Climb::Free {
        return order::stops::tour(targets, &stage, climb(ground), order::stops::EFFORT);
    }
    let mut columns: Vec<usize> = (0..placed.len()).collect();
    let key = |i: usize| (placed[i].0.centre, placed[i].0.tilt);
    columns.sort_by_key(|&i| (key(i), targets[i][2]));
    let columns: Vec<&[usize]> = columns.chunk_by(|&a, &b| key(a) == key(b)).collect();
    let middle: Vec<[i64; 3]> = columns.iter().map(|c| targets[c[c.len() / 2]]).collect();
    let mut z = stage.from[2];
    let mut order = Vec::with_capacity(placed.len());
    for c in order::stops::tour(&middle, &stage, Climb::Free, order::stops::EFFORT) {
        let column = columns[c];
        let [low, high] = [column[0], column[column.len() - 1]].map(|i| targets[i][2]);
        if (high - z).abs() < (low - z).abs() {
            order.extend(column.iter().rev());
            z = low;
        } else {
            order.extend(column);
            z = high;
        }
    }
    order
}

/// Whether the stage must lift between two stops.
fn lifts(ground: &Ground<'_>, a: &Stop, b: &Stop) -> bool {
    if a.tilt == b.tilt {
        return a.centre != b.centre && a.focus - ground.place.lowered < lowest_over(ground, a, b);
    }
    let turn = |u: i64, v: i64| ground.machine.turn([u, v], ground.origin);
    let [[a0, a1], [b0, b1]] = [a.tilt, b.tilt];
    a.focus - ground.place.lowered
        < ground.clearance.lowest_swing([turn(a0, a1), turn(b0, a1), turn(a0, b1), turn(b0, b1)])
}

/// The lowest focal plane at which the stage may go straight from one stop to another of the same tilt.
fn lowest_over(ground: &Ground<'_>, a: &Stop, b: &Stop) -> i64 {
    if a.tilt == [0; 2] {
        return ground.clearance.lowest_focus(a.centre, b.centre);
    }
    let turn = ground.machine.turn(a.tilt, ground.origin);
    ground.clearance.lowest_swing([turn; 4])
}

/// The focal plane of a block whose marks lie between `z` and have the mean height `mean`, and the
/// plane that the mean alone would give; both on the lattice.
fn focus(ground: &Ground<'_>, z: [i64; 2], mean: f64) -> (i64, i64) {
    let lattice = &ground.lattice;
    let nearest = |at: f64| lattice.floor(at + lattice.step as f64 / 2.0);
    let mean = nearest(mean);
    if ground.job.file.focus.level == Level::Mean {
        return (mean, mean);
    }
    // The middle, moved where rounding it to the lattice would cost more than half the depth range.
    let mut mid = nearest((z[0] + z[1]) as f64 / 2.0);
    if z[1] - mid > lattice.depth / 2 {
        mid += lattice.step;
    } else if mid - z[0] > lattice.depth / 2 {
        mid -= lattice.step;
    }
    (mid, mean)
}
