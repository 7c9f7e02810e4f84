//! Where the head would come too near to the part: at stops, on its way to them, and while it tilts.
//!
//! Boxes over the part under a square around the head let pass what is far from both. What they do not let pass is
//! judged by the facets themselves under the round head: only where one of them enters is a program refused. While a
//! head turns about its tilt axes a bound decides.

use super::Limits;
use crate::fixtures::Fixture;
use terrace_core::clearance::{Facets, Head, Intrusion, Way};
use terrace_core::diag::{Diag, Place};
use terrace_core::geom::{NM_PER_MM, Nm, P3, Turn};
use terrace_core::machine::{Commanded, Machine, Origin, TiltAngles};
use terrace_core::program::{Block, BlockId, Program};

/// Blocks that a message names.
const NAMED: usize = 3;

/// What helps where a place of the part is too high.
const OTHER_ANGLE: &str = "`terrace orient JOB` suggests a fixture angle";

/// When the head takes a way.
#[derive(Clone, Copy, PartialEq, Eq)]
enum When {
    /// At a stop.
    AtStop,
    /// On its way to one.
    OnTheWay,
}

/// A way of the head, and the block that it stands at or goes to.
struct Doubt {
    block: usize,
    when: When,
    way: Way,
}

/// Where a block's head enters the part, or a fixture.
struct Hit {
    block: usize,
    when: When,
    entered: Intrusion,
}

/// The faults of a program: at most one at stops and one on the way to them, of the part and of each fixture, and one of
/// tilting.
pub(super) fn broken(program: &Program, limits: &Limits<'_>) -> Vec<Diag> {
    let doubts = doubts(program, limits);
    let mut faults = Vec::new();
    if !doubts.is_empty() {
        faults.extend(entered(&doubts, None, program, limits));
        faults.extend(limits.fixtures.iter().flat_map(|fixture| entered(&doubts, Some(fixture), program, limits)));
    }
    faults.extend(tilting(program, limits));
    faults
}

/// The faults of what enters the head: of a fixture, or of the part.
fn entered(
    doubts: &[Doubt],
    fixture: Option<&Fixture>,
    program: &Program,
    limits: &Limits<'_>,
) -> impl Iterator<Item = Diag> {
    let hits = hits(doubts, fixture, program, limits);
    let hits_when = |when: When| hits.iter().filter(|hit| hit.when == when).collect::<Vec<_>>();
    let what = match fixture {
        None => "a higher place of the part".to_owned(),
        Some(fixture) => format!("fixture {:?}", fixture.name),
    };
    let way_out = if fixture.is_none() { OTHER_ANGLE } else { "or move the fixture" };
    let at_stops = at_stops(&hits_when(When::AtStop), &what, program);
    let on_ways = on_ways(&hits_when(When::OnTheWay), &what, program);
    let faults = [at_stops, on_ways].map(|fault| fault.map(|(text, hit)| refused(text, hit, way_out, limits)));
    faults.into_iter().flatten()
}

/// What the boxes do not let pass.
fn doubts(program: &Program, limits: &Limits<'_>) -> Vec<Doubt> {
    let blocks = 0..program.blocks.len();
    let stops = blocks.clone().filter_map(|block| {
        let way = stop(program, limits, block)?;
        Some(Doubt { block, when: When::AtStop, way })
    });
    let moves = blocks.filter_map(|block| {
        let way = movement(program, limits, block)?;
        Some(Doubt { block, when: When::OnTheWay, way })
    });
    stops.chain(moves).collect()
}

/// The doubtful moves in which a facet enters the head: of a fixture, or of the part.
fn hits(doubts: &[Doubt], fixture: Option<&Fixture>, program: &Program, limits: &Limits<'_>) -> Vec<Hit> {
    // Facets below all ways enter no head; where the part is turned their heights are no guide.
    let is_level = doubts.iter().all(|d| d.way.turn.rows() == Turn::none().rows());
    let ends = doubts.iter().flat_map(|d| d.way.ends);
    let lowest = ends.filter(|_| is_level).map(|end| end[2]).reduce(f64::min).unwrap_or(f64::NEG_INFINITY);
    let facets = match fixture {
        None => Facets::above(lowest, limits.facets),
        Some(fixture) => Facets::above(lowest, &|sink| fixture.facets.iter().for_each(|facet| sink(*facet))),
    };
    let is_there = |d: &&Doubt| fixture.is_none_or(|fixture| fixture.is_in(program.blocks[d.block].setup));
    let hit = |d: &Doubt| {
        let entered = facets.entered(&d.way).filter(|e| Nm::round(e.by) > Nm(0))?;
        Some(Hit { block: d.block, when: d.when, entered })
    };
    doubts.iter().filter(is_there).filter_map(hit).collect()
}

/// The way of the head at a stop, if the boxes do not let it pass: it stands there; a head that leans comes down along z
/// from the end of travel.
fn stop(program: &Program, limits: &Limits<'_>, i: usize) -> Option<Way> {
    let block = &program.blocks[i];
    let clearance = limits.clearance;
    let stop = &block.stop;
    let origin = limits.origins[block.setup.index()];
    let plane = block.stage_plane();
    let keeps_clear = if stop.tilt.is_upright() {
        clearance.lowest_focus(stop.centre, stop.centre) <= plane
    } else {
        let centre = [stop.centre.x, stop.centre.y, plane.0].map(|v| v as f64);
        clearance.over_turned(&limits.machine.turn(stop.tilt, origin), [centre; 2]) <= Nm(0)
    };
    let leans = limits.machine.tilts_head() && !stop.tilt.is_upright();
    let head = Head { machine: limits.machine, origin, clearance };
    let is_clear = keeps_clear && !(leans && head.over_lift(stop.tilt, block.stage) > Nm(0));
    let from = if leans { raised(block.stage, limits.machine) } else { block.stage };
    (!is_clear).then(|| way(limits, block, [from, block.stage]))
}

/// The way of the head to a stop from the one before it at the same tilt, if the boxes do not let it pass.
fn movement(program: &Program, limits: &Limits<'_>, i: usize) -> Option<Way> {
    let block = &program.blocks[i];
    let before = &program.blocks[i.checked_sub(1)?];
    let machine = limits.machine;
    let leans = machine.tilts_head() && !block.stop.tilt.is_upright();
    // Over one centre z alone moves, and is looked at where the head stands; under a head that leans another focal plane
    // of that centre lies at another x and y.
    let stays = before.stop.centre == block.stop.centre && !leans;
    // Before a set-up the stage lifts. What the head needs while its tilt changes is [`swing`].
    if before.setup != block.setup || before.stop.tilt != block.stop.tilt || stays {
        return None;
    }
    let mut from = if block.retract { raised(before.stage, machine) } else { before.stage };
    if machine.stage.diagonal && !block.retract && machine.stage.z.sign() * (block.stage[2] - from[2]) < 0 {
        // On a diagonal the head is nowhere lower than at its lower end.
        from[2] = block.stage[2];
    }
    let way = way(limits, block, [from, Commanded([block.stage[0], block.stage[1], from[2]])]);
    let is_clear = if block.stop.tilt.is_upright() {
        let lpfl = limits.machine.field_centre(from, block.stop.tilt, limits.origins[block.setup.index()])[2];
        limits.clearance.lowest_focus(before.stop.centre, block.stop.centre) <= Nm::round(lpfl)
    } else {
        limits.clearance.is_below(&way)
    };
    (!is_clear).then_some(way)
}

/// The place at the end of travel above a position.
fn raised(at: Commanded, machine: &Machine) -> Commanded {
    Commanded([at[0], at[1], machine.retract_z().0])
}

/// The way between two positions of the stage, tilted as at a block.
fn way(limits: &Limits<'_>, block: &Block, ends: [Commanded; 2]) -> Way {
    let tilt = block.stop.tilt;
    let origin = limits.origins[block.setup.index()];
    let turn = limits.machine.turn(tilt, origin);
    let ends = ends.map(|at| {
        let centre = limits.machine.field_centre(at, tilt, origin);
        // Where a table turns the part, the stage is commanded in places of the part as turned.
        if limits.machine.tilts_head() { turn.apply(centre).at } else { centre.at }
    });
    limits.clearance.way(turn, ends)
}

/// Stops at which the head would enter the part.
fn at_stops(hits: &[&Hit], what: &str, program: &Program) -> Option<(String, Intrusion)> {
    let worst = worst(hits)?;
    let text = format!(
        "at {} the head would come too near to {what}: {}{}",
        share(hits, program),
        too_high(worst),
        names(hits)
    );
    Some((text, worst))
}

/// Stops on the way to which it would.
fn on_ways(hits: &[&Hit], what: &str, program: &Program) -> Option<(String, Intrusion)> {
    let worst = worst(hits)?;
    let text = format!(
        "on the way to {} the head would come too near to {what}, even at the end of travel: {}{}",
        share(hits, program),
        too_high(worst),
        names(hits)
    );
    Some((text, worst))
}

/// A head that would turn too near to the part: no facet is looked at, the highest place of the part counts wherever it
/// lies.
fn tilting(program: &Program, limits: &Limits<'_>) -> Option<Diag> {
    let swings = (0..program.blocks.len()).map(|i| (i, swing(program, limits, i)));
    let too_near: Vec<(usize, Nm)> = swings.filter(|(_, by)| *by > Nm(0)).collect();
    let (block, by) = *too_near.iter().reduce(|a, b| if b.1 > a.1 { b } else { a })?;
    let at = highest(limits);
    let text = format!(
        "while the head tilts on its way to {} of {} stops its lower end could come too near to the part{}, by up to {} \
         mm on the way to {}: the highest place, at z = {:.3} mm, counts wherever it lies (a bound)",
        too_near.len(),
        program.blocks.len(),
        if limits.fixtures.is_empty() { "" } else { " or a fixture" },
        by.mm(),
        BlockId::new(block),
        at[2] / NM_PER_MM
    );
    Some(refused(text, Intrusion { by: by.f64(), at }, OTHER_ANGLE, limits))
}

/// How much too near to the highest place of the part a head could come while its tilt changes on its way to block `i`;
/// the least number where it does not change. Before a set-up it goes by way of upright, in which it visits registration
/// points.
fn swing(program: &Program, limits: &Limits<'_>, i: usize) -> Nm {
    let block = &program.blocks[i];
    let before = i.checked_sub(1).map(|i| &program.blocks[i]);
    let (from, tilt) = (before.map_or(TiltAngles::UPRIGHT, |b| b.stop.tilt), block.stop.tilt);
    if !limits.machine.tilts_head() || from.is_upright() && tilt.is_upright() {
        return Nm::MIN;
    }
    let machine = limits.machine;
    let clearance = limits.clearance;
    let origin: Origin = limits.origins[block.setup.index()];
    let head = Head { machine, origin, clearance };
    let lifted = machine.retract_z().0;
    match before.filter(|before| before.setup == block.setup) {
        // A way at one tilt is a movement.
        Some(_) if from == tilt => Nm::MIN,
        Some(before) => head.over_swing(from, tilt, if block.retract { lifted } else { before.stage[2] }),
        None => {
            let upright = TiltAngles::UPRIGHT;
            head.over_swing(from, upright, lifted).max(head.over_swing(upright, tilt, lifted))
        }
    }
}

/// The highest place of the part and its fixtures.
fn highest(limits: &Limits<'_>) -> P3 {
    let mut top = [0.0, 0.0, f64::NEG_INFINITY];
    let mut add =
        |corners: [[f64; 3]; 3]| top = corners.into_iter().fold(top, |top, p| if p[2] > top[2] { p } else { top });
    (limits.facets)(&mut add);
    limits.fixtures.iter().flat_map(|fixture| &fixture.facets).for_each(|facet| add(*facet));
    P3::new(top)
}

/// The deepest of some hits, the first of equal ones.
fn worst(hits: &[&Hit]) -> Option<Intrusion> {
    hits.iter().map(|hit| hit.entered).reduce(|a, b| if b.by > a.by { b } else { a })
}

/// "3 of 40 stops".
fn share(hits: &[&Hit], program: &Program) -> String {
    format!("{} of {} stops", hits.len(), program.blocks.len())
}

/// "at x = 140.000 mm, y = 140.000 mm it rises to z = 760.000 mm, 39.1 mm too high".
fn too_high(Intrusion { by, at }: Intrusion) -> String {
    let [x, y, z] = at.at.map(|v| v / NM_PER_MM);
    format!("at x = {x:.3} mm, y = {y:.3} mm it rises to z = {z:.3} mm, {} mm too high", Nm::round(by).mm())
}

/// " (B0012, B0013, B0014 and 37 more; most at B0020)".
fn names(hits: &[&Hit]) -> String {
    let id = |hit: &&Hit| BlockId::new(hit.block).to_string();
    let first: Vec<String> = hits.iter().take(NAMED).map(id).collect();
    let more = hits.len() - first.len();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let most = hits.iter().reduce(|a, b| if b.entered.by > a.entered.by { b } else { a });
    let most = most.filter(|_| hits.len() > 1).map_or_else(String::new, |hit| format!("; most at {}", id(hit)));
    format!(" ({}{more}{most})", first.join(", "))
}

/// The error, with what would be enough.
fn refused(text: String, Intrusion { by, at }: Intrusion, way_out: &str, limits: &Limits<'_>) -> Diag {
    let by = Nm::round(by).mm();
    let [distance, least] = [limits.machine.lens.working_distance, limits.machine.stage.clearance].map(|l| l.as_mm());
    let less =
        if least >= by { format!(", or a stage.clearance of {:.3} mm", floor_um(least - by)) } else { String::new() };
    let enough = -floor_um(-distance - by);
    let hint = format!("a lens.working_distance of {enough:.3} mm{less} would be enough; {way_out}");
    let [x_mm, y_mm] = [at[0], at[1]].map(|v| v / NM_PER_MM);
    Diag::limit("clearance", text).at(Place::Part { x_mm, y_mm }).hint(hint)
}

/// The whole micrometre below, mm.
fn floor_um(mm: f64) -> f64 {
    // Of a number that is whole but for rounding it is the number.
    (mm * 1e3 + 1e-6).floor() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::tests::{faults_with, mast};
    use terrace_core::clearance::Clearance;
    use terrace_core::geom::{Box2, P2};
    use terrace_core::program::SetupId;
    use terrace_core::units::Length;

    /// Limits that the head alone can break.
    fn limits<'a>(machine: &'a Machine, origins: &'a [Origin], clearance: &'a Clearance) -> Limits<'a> {
        Limits {
            machine,
            origins,
            setups_needed: [1, 1],
            depth: Nm(70_000),
            max_slope: 2.0,
            clearance,
            facets: &|_| (),
            fixtures: &[],
        }
    }

    #[test]
    fn a_head_swings_by_way_of_upright_between_set_ups() {
        let (mut program, origin) = terrace_core::program::sample::program();
        let machine = Machine::built_in("xyz-headtilt-galvo-40").expect("a profile");
        let tilts = [30, 40].map(|deg| TiltAngles([0, deg * 1_000_000]));
        for (block, tilt) in program.blocks.iter_mut().zip(tilts) {
            (block.stop.tilt, block.retract) = (tilt, true);
            block.stage = machine.stand(tilt, P2::new(0, 0), Nm(0), origin).stage;
        }
        let place = Box2 { lo: P2::new(900_000_000, 0), hi: P2::new(900_000_001, 1) };
        let found = |top: Nm, program: &Program| {
            let clearance = Clearance::new(&[(place, top)], &machine);
            swing(program, &limits(&machine, &[origin, origin], &clearance), 1)
        };
        // Where the head just keeps clear on the straight way it is too near when it goes by way of upright.
        let straight = found(Nm(0), &program);
        program.blocks[1].setup = SetupId(1);
        let over = found(Nm(0), &program);
        assert!(over > straight + Nm(1_000_000), "{over:?} {straight:?}");
        let top = Nm(-(straight + (over - straight) / 2).0);
        assert!(found(top, &program) > Nm(0));
        program.blocks[1].setup = SetupId(0);
        assert!(found(top, &program) < Nm(0));
    }

    #[test]
    fn a_leaning_head_that_goes_to_another_plane_of_one_centre_is_a_movement() {
        let (mut program, origin) = terrace_core::program::sample::program();
        let machine = Machine::built_in("xyz-headtilt-galvo-40").expect("a profile");
        // The part is far too high everywhere.
        let place = Box2 { lo: P2::new(-900_000_000, -900_000_000), hi: P2::new(900_000_000, 900_000_000) };
        let clearance = Clearance::new(&[(place, Nm(2_000_000_000))], &machine);
        let origins = [origin];
        let limits = limits(&machine, &origins, &clearance);
        for (deg, is_movement) in [(0, false), (30, true)] {
            let tilt = TiltAngles([0, deg * 1_000_000]);
            for (block, plane) in program.blocks.iter_mut().zip([0, 5_000_000]) {
                block.stop.tilt = tilt;
                block.stop.centre = P2::new(0, 0);
                block.stage = machine.stand(tilt, P2::new(0, 0), Nm(plane), origin).stage;
            }
            assert_eq!(movement(&program, &limits, 1).is_some(), is_movement, "{deg} deg");
        }
    }

    #[test]
    fn a_tilt_without_a_lift_is_judged_at_the_height_of_the_stop_before() {
        let (mut program, origin) = terrace_core::program::sample::program();
        let machine = Machine::built_in("xyz-headtilt-galvo-40").expect("a profile");
        let tilts = [30, 40].map(|deg| TiltAngles([0, deg * 1_000_000]));
        for (block, tilt) in program.blocks.iter_mut().zip(tilts) {
            block.stop.tilt = tilt;
            block.stage = machine.stand(tilt, P2::new(0, 0), Nm(0), origin).stage;
        }
        let place = Box2 { lo: P2::new(900_000_000, 0), hi: P2::new(900_000_001, 1) };
        let clearance = Clearance::new(&[(place, Nm(0))], &machine);
        let origins = [origin];
        let limits = limits(&machine, &origins, &clearance);
        program.blocks[1].retract = true;
        let lifted = swing(&program, &limits, 1);
        program.blocks[1].retract = false;
        let below = machine.retract_z().0 - program.blocks[0].stage[2];
        assert_eq!(swing(&program, &limits, 1), lifted + Nm(below * machine.stage.z.sign()));
        // At one tilt nothing swings.
        program.blocks[1].stop.tilt = tilts[0];
        assert_eq!(swing(&program, &limits, 1), Nm::MIN);
    }

    #[test]
    fn clearance_figures_are_enough_and_no_larger_than_needed() {
        let d = faults_with(&[mast()], [1, 1], |_, _| {}).expect_err("a mast").diags()[0].clone();
        let figure = |after: &str| {
            let (_, rest) = d.hint.split_once(after).unwrap_or_else(|| panic!("{after}: {d}"));
            rest.split(' ').next().and_then(|v| v.parse::<f64>().ok()).expect("a number")
        };
        let distance = figure("working_distance of ");
        let with = |mm: f64| faults_with(&[mast()], [1, 1], |_, m| m.lens.working_distance = Length::mm(mm)).is_ok();
        assert!(with(distance) && !with(distance - 0.002), "{d}");
    }

    #[test]
    fn clearance_is_reported_once_at_the_worst_stop() {
        let found = faults_with(&[mast()], [1, 1], |_, _| {});
        let e = found.expect_err("a mast under the head");
        let [d] = e.diags() else { panic!("{e}") };
        assert!(d.code == "clearance" && d.message.contains(" stops the head would come too near"), "{d}");
        assert!(matches!(d.place, Place::Part { x_mm, y_mm } if x_mm.abs().max(y_mm.abs()) < 1e-6), "{d}");
        assert!(d.message.contains("x = 0.000 mm, y = 0.000 mm it rises to z = 141.000 mm, "), "{d}");
    }

    #[test]
    fn what_the_boxes_alone_refuse_is_accepted() {
        let all = terrace_core::program::sample::program().0.blocks;
        let far = all.iter().map(|b| b.stop.centre).max_by_key(|c| c.x + c.y).expect("blocks");
        // Beside the stop that lies farthest out: within the square around the lens of 110 mm, and in and out of the
        // circle.
        let at = |beyond: i64| {
            let corner = |more: i64| P2::new(far.x + beyond + more, far.y + beyond + more);
            faults_with(&[(Box2 { lo: corner(0), hi: corner(1_000) }, Nm(300_000_000))], [1, 1], |_, _| {})
        };
        assert!(at(54_000_000).is_ok() && at(39_000_000).is_ok());
        assert!(at(20_000_000).is_err());
    }
}
