//! Points that cannot be right, or do not say what a job needs: what is refused of them, and what is told.

use terrace_core::diag::{Diag, Place};
use terrace_core::geom::SpacePoint;
use terrace_core::math;
use terrace_core::parallel;
use terrace_input::measured::{Measure, MeasuredPoint};
use terrace_input::surface::Surface;
use terrace_register::{Fit, FreeMotion, Motion, PairsFault, TouchResidual};

/// Points without partners this near to each other along x and y are of one place, mm; there they may differ by so many
/// deviations, and by what a slope of 80 degrees makes of how far they are apart.
const ONE_PLACE: f64 = 0.1;
const ONE_HEIGHT: f64 = 6.0;
const STEEPEST: f64 = 5.7;

/// Two points of one place that contradict one another: one of them is dirt, or was made before something was changed.
pub(super) fn twice(points: &[MeasuredPoint], shown: &str) -> Option<Diag> {
    let is_on_part = |p: &&MeasuredPoint| !matches!(p.measure, Measure::Optical { .. });
    let mut all: Vec<&MeasuredPoint> = points.iter().filter(is_on_part).collect();
    all.sort_by(|a, b| a.stage[0].total_cmp(&b.stage[0]));
    let differ = |a: &MeasuredPoint, b: &MeasuredPoint| {
        let [x, y, z] = [0, 1, 2].map(|k| (a.stage[k] - b.stage[k]).abs());
        let noise = math::hypot(a.sigma_mm[0], b.sigma_mm[0]);
        a.measure == b.measure && y <= ONE_PLACE && z > ONE_HEIGHT * noise + STEEPEST * math::hypot(x, y)
    };
    let found = all.iter().enumerate().find_map(|(i, a)| {
        let near = all[i + 1..].iter().take_while(|b| b.stage[0] - a.stage[0] <= ONE_PLACE);
        near.filter(|b| differ(a, b)).map(|b| if a.line < b.line { (*a, *b) } else { (*b, *a) }).next()
    });
    found.map(|(a, b)| {
        let um = (b.stage[2] - a.stage[2]) * 1e3;
        let text = format!("{} and {} (line {}) are of one place and differ by {um:+.1} um", a.name, b.name, b.line);
        let hint = "take the wrong row out: the first, if there was dirt under it and the place was measured again";
        Diag::input("measured-twice", text).at(Place::line(shown, a.line)).hint(hint)
    })
}

/// Touches of which each is named, at most.
const NAMED: usize = 5;

/// Touches that do not lie on the part are told; where neighbours lie off it together, the part is not as designed there.
///
/// # Errors
/// `measured-off` where a touch and its two nearest neighbours lie off the part to the same side.
pub(super) fn beside(touches: &[TouchResidual], points: &[&MeasuredPoint], shown: &str) -> Result<Option<Diag>, Diag> {
    let off: Vec<usize> = (0..touches.len()).filter(|&i| !touches[i].is_on_part).collect();
    if off.is_empty() {
        return Ok(None);
    }
    let named = |of: &[usize]| {
        let each: Vec<String> = of
            .iter()
            .take(NAMED)
            .map(|&i| format!("{} ({:+.1} um)", points[i].name, touches[i].distance * 1e3))
            .collect();
        let more = if of.len() > NAMED { format!(" and {} more", of.len() - NAMED) } else { String::new() };
        format!("{}{more}", each.join(", "))
    };
    let apart2 = |i: usize, k: usize| (0..3).map(|a| (touches[i].at[a] - touches[k].at[a]).powi(2)).sum::<f64>();
    let lies_among_such = parallel::map(off.len(), |n| {
        let i = off[n];
        let mut nearest = [(f64::INFINITY, i); 2];
        for k in (0..touches.len()).filter(|&k| k != i) {
            let distance = apart2(i, k);
            if distance < nearest[0].0 {
                nearest = [(distance, k), nearest[0]];
            } else if distance < nearest[1].0 {
                nearest[1] = (distance, k);
            }
        }
        let is_such = |k: usize| !touches[k].is_on_part && touches[k].distance * touches[i].distance > 0.0;
        nearest.iter().all(|&(_, k)| k != i && is_such(k))
    });
    let together: Vec<usize> = off.iter().zip(lies_among_such).filter(|(_, is)| *is).map(|(&i, _)| i).collect();
    if !together.is_empty() {
        let text = format!("the part is not as designed where touches lie off it together: {}", named(&together));
        let hint = "were it a clamp or dirt, take these rows out; if the part is so, name placement.measured.warp, large \
                    enough";
        return Err(Diag::limit("measured-off", text).at(Place::file(shown)).hint(hint));
    }
    let text = match off.len() {
        1 => format!("a touch does not lie on the part and does not count: {}", named(&off)),
        n => format!("{n} touches do not lie on the part and do not count: {}", named(&off)),
    };
    let hint =
        "measure there again: a clamp or dirt does no harm, a dent that no other touch saw is marked out of focus";
    Ok(Some(Diag::warning("measured-left-out", text).at(Place::file(shown)).hint(hint)))
}

/// Where touches alone say where a part lies, it lies no farther from its start than this, mm and rad.
const FARTHEST_MM: f64 = 10.0;
const FARTHEST_TURN: f64 = 0.175;

/// A part that touches alone have found far from where the job has it.
pub(super) fn far(fit: &Fit, start: &Motion, shown: &str) -> Result<(), Diag> {
    let centre = fit.uncertainty.centre;
    let from = start.apply(fit.motion.back(centre));
    let off = [0, 1, 2].map(|k| centre[k] - from[k]);
    let length = off.iter().map(|v| v * v).sum::<f64>().sqrt();
    let turn = angle(&fit.motion);
    if length <= FARTHEST_MM && turn <= FARTHEST_TURN {
        return Ok(());
    }
    let [x, y, z] = off;
    let text = format!(
        "the touches have the part ({x:+.2}, {y:+.2}, {z:+.2}) mm and {:.2} degrees from where the job places it: without \
         three features they are trusted to {FARTHEST_MM} mm and 10 degrees",
        turn.to_degrees()
    );
    let hint = "check placement.origin and turn, and the offset and the radius of the probe";
    Err(Diag::limit("measured-far", text).at(Place::file(shown)).hint(hint))
}

/// A part that is turned about z by more than a clamping explains.
pub(super) fn turned_round(fit: &Fit, shown: &str) -> Option<Diag> {
    let [[xx, ..], [yx, ..], _] = fit.motion.rows();
    let turn = math::atan2(yx, xx);
    (turn.abs() > FARTHEST_TURN).then(|| {
        let text = format!("the points turn the part by {:.2} degrees about z, beside placement.turn", turn.to_degrees());
        let hint = "state about that angle as placement.turn, and look at layout.svg: features that are named the wrong way \
                    round turn the texture";
        Diag::warning("measured-turned", text).at(Place::file(shown)).hint(hint)
    })
}

/// The angle that a motion turns by, rad.
fn angle(motion: &Motion) -> f64 {
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = motion.rows();
    let sine = math::hypot(math::hypot(zy - yz, xz - zx), yx - xy) / 2.0;
    math::atan2(sine, (xx + yy + zz - 1.0) / 2.0)
}

/// Residuals so many times larger than the stated noise are told.
const NOISE_FACTOR: f64 = 2.0;

/// Residuals that are larger than the noise that the table states.
pub(super) fn noise(fit: &Fit, shown: &str) -> Option<Diag> {
    (fit.noise_factor > NOISE_FACTOR).then(|| {
        let text = format!(
            "the points miss the part by {:.1} times the noise that the table states: its uncertainty counts as much more",
            fit.noise_factor
        );
        let hint = "the part may be warped (placement.measured.warp), or sigma_um too small; `terrace register` shows each \
                    point";
        Diag::warning("measured-noise", text).at(Place::file(shown)).hint(hint)
    })
}

/// A part that is larger on the stage than by its file.
pub(super) fn grown(fit: &Fit, designed: &Surface, shown: &str) -> Option<Diag> {
    let scale = fit.scale.filter(|scale| scale.excess.abs() > 3.0 * scale.sigma)?;
    let size = designed.part_box_mm().size();
    let um = scale.excess.abs() * math::hypot(size[0], size[1]) * 1e3;
    let word = if scale.excess > 0.0 { "larger" } else { "smaller" };
    let text = format!(
        "the part is {:.4} % ({um:.1} um over its box) {word} on the stage than by its file; it is not scaled",
        scale.excess.abs() * 100.0
    );
    Some(Diag::warning("measured-scale", text).at(Place::file(shown)).hint("check its temperature and its unit"))
}

/// What is said of pairs that do not go together.
pub(super) fn apart(fault: PairsFault, points: &[&MeasuredPoint], shown: &str) -> Diag {
    let name = |i: usize| format!("{} (line {})", points[i].name, points[i].line);
    let (text, hint, line) = match fault {
        PairsFault::Wrong(i) => (
            format!("{} does not go with the other points, which go together", name(i)),
            "measure it again, or leave it out",
            points[i].line,
        ),
        PairsFault::Exchanged(i, k) => (
            format!("{} and {} are exchanged: the points go together the other way round", name(i), name(k)),
            "exchange their stage positions, and check that no other two are exchanged",
            points[i].line,
        ),
        PairsFault::Mirrored => (
            "the points go together in a mirror alone".to_owned(),
            "check the signs of the axes: stage_x, stage_y and stage_z are what the controller shows, and the machine \
             file says what each axis carries",
            points[0].line,
        ),
        PairsFault::Apart(i) => (
            format!("the points do not go together within their noise; {} is farthest off", name(i)),
            "check the points, the unit of the part and sigma_um; a fourth point shows which one is wrong",
            points[i].line,
        ),
    };
    Diag::limit("measured-apart", text).at(Place::line(shown, line)).hint(hint)
}

/// What is said of motions that no point holds.
pub(super) fn free(free: &[FreeMotion], shown: &str) -> Diag {
    let all: Vec<String> = free.iter().map(described).collect();
    let text = format!("the points do not hold the part: {} stays free", all.join("; "));
    let hint = "add points that hold it: features of which three do not lie on one line, or touches on faces that look \
                other ways";
    Diag::limit("measured-free", text).at(Place::file(shown)).hint(hint)
}

/// A free motion in words: a shift where the points move alike, a turn where they do not.
fn described(motion: &FreeMotion) -> String {
    let length = |v: &SpacePoint| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let (turn, shift) = (length(&motion.turn) * motion.extent, length(&motion.shift));
    let direction = |v: &SpacePoint| {
        let size = length(v);
        let largest = (0..3).max_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs())).unwrap_or(0);
        let signed = v.map(|c| c / size * v[largest].signum());
        let axis = ["x", "y", "z"][largest];
        if signed[largest] > 0.999 {
            axis.to_owned()
        } else {
            format!("({:.2}, {:.2}, {:.2})", signed[0], signed[1], signed[2])
        }
    };
    if turn > 0.05 * shift {
        let also = if shift > 0.05 * turn { ", with the shift that goes with it" } else { "" };
        format!("a turn about {}{also}", direction(&motion.turn))
    } else {
        format!("a shift along {}", direction(&motion.shift))
    }
}
