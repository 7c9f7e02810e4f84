//! Part of `surface`: no fixture is in the way of a beam, so nothing is marked on one.
//!
//! A beam is parallel to the optical axis, and 1.8 times as wide as where its power has fallen to 1/e² of the middle. It
//! is taken as a stack of upright cylinders, each a tenth higher over the focal plane than the one before and as wide as
//! the beam is at its lower end, which a mark sweeps; facets are held against them as against the head in `clearance`.

use super::sweep::Sweep;
use crate::findings::{Findings, RuleCode};
use crate::fixtures::Fixture;
use crate::geometry::{BoxNm, Geometry, Turn};
use crate::job_facts::JobFacts;
use crate::read::program::ProgramFile;
use terrace_core::geom::NM_PER_MM;
use terrace_core::machine::{Machine, TiltAngles};
use terrace_core::program::{Block, SetupId};

/// Radii of the beam that are looked at.
const RADII: f64 = 1.8;

/// Above the focal plane by less than this, nm, the beam is taken as wide as in it.
const FIRST_HEIGHT: f64 = 1e6;

/// How much higher each cylinder begins than the one before.
const STEP: f64 = 1.1;

/// A fixture as the stops of one tilt in one set-up see it.
struct Seen {
    of: (SetupId, TiltAngles),
    geometry: Option<Geometry>,
    top: f64,
    around: BoxNm,
}

/// Holds all marks of a program.
pub(crate) fn check(program: &ProgramFile, facts: &JobFacts, fixtures: &[Fixture], findings: &mut Findings) {
    let rule = &mut findings.rules[RuleCode::Surface];
    for fixture in fixtures {
        let mut seen: Option<Seen> = None;
        for (i, block) in program.program.blocks.iter().enumerate() {
            if !fixture.is_in(block.setup) {
                continue;
            }
            let of = (block.setup, block.stop.tilt);
            if seen.as_ref().is_none_or(|seen| seen.of != of) {
                seen = Some(Seen::new(fixture, program, block, &facts.machine));
            }
            let Some(seen) = &seen else { continue };
            let geometry = seen.geometry.as_ref().unwrap_or(&fixture.geometry);
            rule.checked += program.program.strokes_of(block).len() as u64;
            if let Some(at) = seen.met(geometry, program, block, &facts.machine) {
                let text = format!("fixture {:?} is in the way of the beam", fixture.name);
                rule.broken(&program.ids[i], super::part_place_nm(at), text);
            }
        }
    }
}

impl Seen {
    fn new(fixture: &Fixture, file: &ProgramFile, block: &Block, machine: &Machine) -> Self {
        let tilt = block.stop.tilt;
        let everywhere = BoxNm { lo: [-1e11; 2], hi: [1e11; 2] };
        let axes = machine.tilt.as_ref().filter(|_| !tilt.is_upright());
        let turn = axes.map(|axes| Turn::new(axes, tilt, file.origin(block)));
        let geometry = turn.map(|turn| fixture.geometry.turned(&turn, everywhere));
        let (mut top, mut around) = (f64::NEG_INFINITY, BoxNm::EMPTY);
        geometry.as_ref().unwrap_or(&fixture.geometry).each_facet(&mut |corners| {
            for [x, y, z] in corners {
                top = top.max(z);
                around.add([x, y]);
            }
        });
        Self { of: (block.setup, tilt), geometry, top, around }
    }

    /// A place of a mark of a block whose beam a fixture meets.
    fn met(&self, geometry: &Geometry, file: &ProgramFile, block: &Block, machine: &Machine) -> Option<[f64; 2]> {
        let plane = block.stop.lpfl.f64();
        // Marks of a block are as low as this, and what is lower is in no beam's way.
        let lowest = block.z_lo.f64() - plane;
        if self.top <= plane + lowest {
            return None;
        }
        let widest = RADII * radius(machine, (self.top - plane).max(-lowest));
        let centre = [block.stop.centre.x as f64, block.stop.centre.y as f64];
        for stroke in file.program.strokes_of(block) {
            let points: Vec<[f64; 2]> = file
                .program
                .points_of(stroke)
                .iter()
                .map(|p| [centre[0] + f64::from(p.x), centre[1] + f64::from(p.y)])
                .collect();
            let mut ways: Vec<[[f64; 2]; 2]> = points.windows(2).map(|w| [w[0], w[1]]).collect();
            if let [dot] = points[..] {
                ways.push([dot, dot]);
            }
            for ends in ways {
                let mut near = BoxNm::EMPTY;
                ends.iter().for_each(|&end| near.add(end));
                let near = near.grown(widest);
                if near.touches(&self.around) && meets(geometry, near, ends, (plane, lowest, self.top), machine) {
                    return Some(ends[0]);
                }
            }
        }
        None
    }
}

/// Whether a fixture reaches into the beam of a straight mark.
fn meets(
    geometry: &Geometry,
    near: BoxNm,
    ends: [[f64; 2]; 2],
    (plane, lowest, top): (f64, f64, f64),
    machine: &Machine,
) -> bool {
    let mut facets = Vec::new();
    geometry.facets_in(near, &mut |corners| facets.push(corners));
    let mut height = lowest;
    while !facets.is_empty() && plane + height < top {
        let sweep = Sweep::new(ends.map(|[x, y]| [x, y, plane + height]), RADII * radius(machine, height.max(0.0)));
        if facets.iter().any(|corners| sweep.rise(corners, 0.0).is_some()) {
            return true;
        }
        height = (height * STEP).max(FIRST_HEIGHT);
    }
    false
}

/// The radius of the beam at a height over its focal plane, nm: ISO 11146-1, from spot, wavelength and M².
fn radius(machine: &Machine, height: f64) -> f64 {
    let waist = machine.lens.spot.as_mm() * NM_PER_MM / 2.0;
    let wavelength = machine.laser.wavelength.as_mm() * NM_PER_MM;
    let spread = machine.laser.m2 * wavelength / (std::f64::consts::PI * waist);
    (waist * waist + (spread * height).powi(2)).sqrt()
}
