//! Points that cannot be right, or do not say what a job needs: what is refused of them, and what is told.

use rustc_hash::FxHashMap;

use super::LEAST_UP;
use terrace_core::diag::{Diag, Place};
use terrace_core::geom::SpacePoint;
use terrace_core::math;
use terrace_core::units::Angle;
use terrace_input::measured::{Measure, MeasuredPoint};
use terrace_input::surface::Surface;
use terrace_register::{
    Fit, FreeMotion, Motion, Neighbours, Observation, Pair, PairsFault, Told, TouchResidual, Warp, warp,
};

/// The line of a point: of the table, or of the file that it was read from.
fn line_of(point: &MeasuredPoint, shown: &str) -> String {
    match &point.place {
        Place::File { path, line: Some(line) } if path == shown => format!("line {line}"),
        place => place.to_string(),
    }
}

/// Points without partners this near to each other along x and y are of one place, mm; there they may differ by so many
/// deviations, and by this share of how far they are apart: what a warp makes of it.
const ONE_PLACE: f64 = 0.1;
const ONE_HEIGHT: f64 = 6.0;
const WARPED: f64 = 0.02;

/// Normals of one face: cosine of 25 degrees.
const ONE_FACE: f64 = 0.9;

/// Two touches of one place that contradict one another: one of them is dirt, or was made before something was changed.
/// Touches of steep faces may lie one above the other.
pub(super) fn twice(touches: &[TouchResidual], points: &[&MeasuredPoint], shown: &str) -> Option<Diag> {
    let differ = |&i: &usize, &k: &usize| {
        let (a, b) = (&touches[i], &touches[k]);
        let [x, y] = [0, 1].map(|axis| (points[i].stage[axis] - points[k].stage[axis]).abs());
        let most = ONE_HEIGHT * math::hypot(a.sigma, b.sigma) + WARPED * math::hypot(x, y);
        let is_one_face = (0..3).map(|axis| a.normal[axis] * b.normal[axis]).sum::<f64>() > ONE_FACE;
        let is_one_place = x <= ONE_PLACE && y <= ONE_PLACE && points[i].measure == points[k].measure;
        is_one_place && is_one_face && (a.distance - b.distance).abs() > most
    };
    // Of each square as large as a place the lowest touch of a tip and the highest: others lie between them.
    let mut ends = FxHashMap::<([i64; 2], Option<u64>), [usize; 2]>::default();
    for i in (0..touches.len()).filter(|&i| touches[i].normal[2] >= LEAST_UP) {
        let [x, y] = [0, 1].map(|axis| (points[i].stage[axis] / ONE_PLACE).floor() as i64);
        let tip = match points[i].measure {
            Measure::Touch { tip_mm } => Some(tip_mm.to_bits()),
            Measure::Optical { .. } | Measure::Distance => None,
        };
        let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| ([x + dx, y + dy], tip)));
        let known = around.filter_map(|square| ends.get(&square)).flatten();
        if let Some(&k) = known.filter(|k| differ(&i, k)).min() {
            let um = (touches[i].distance - touches[k].distance) * 1e3;
            let text = format!(
                "{} and {} ({}) are of one place and differ by {um:+.1} um",
                points[k].name,
                points[i].name,
                line_of(points[i], shown)
            );
            let hint = "take the wrong row out: the first, if there was dirt under it and the place was measured again; if \
                        both are right, sigma_um is too small";
            return Some(Diag::input("measured-twice", text).at(points[k].place.clone()).hint(hint));
        }
        let [low, high] = ends.entry(([x, y], tip)).or_insert([i, i]);
        if touches[i].distance < touches[*low].distance {
            *low = i;
        }
        if touches[i].distance > touches[*high].distance {
            *high = i;
        }
    }
    None
}

/// Touches of which each is named, at most, and of which lines are told.
const NAMED: usize = 5;
const LINES: usize = 50;

/// Places around a touch that are looked at, and how many of them lie off the part with it where that is no dirt.
const AROUND: usize = 4;
const TOGETHER: usize = 2;

/// Whether a touch off the part lies among such: places around it do to the same side, or it was measured again and does.
fn lies_among_such(i: usize, touches: &[TouchResidual], all: &Neighbours) -> bool {
    let is_such = |k: usize| !touches[k].is_on_part && touches[k].distance * touches[i].distance > 0.0;
    let mut around: Vec<usize> = Vec::new();
    for (k, distance) in all.of(touches[i].at).filter(|&(k, _)| k != i) {
        let apart = |&n: &usize| (0..3).map(|a| (touches[k].at[a] - touches[n].at[a]).powi(2)).sum::<f64>().sqrt();
        if distance <= ONE_PLACE {
            if is_such(k) {
                return true;
            }
        } else if around.iter().all(|n| apart(n) > ONE_PLACE) {
            around.push(k);
        }
        if around.len() == AROUND {
            break;
        }
    }
    around.into_iter().filter(|&k| is_such(k)).count() >= TOGETHER
}

/// Touches that do not lie on the part are told; where neighbours lie off it together, the part is not as designed there.
///
/// # Errors
/// `measured-off` where a touch and places around it lie off the part to the same side.
pub(super) fn beside(touches: &[TouchResidual], points: &[&MeasuredPoint], shown: &str) -> Result<Option<Diag>, Diag> {
    let off: Vec<usize> = (0..touches.len()).filter(|&i| !touches[i].is_on_part).collect();
    if off.is_empty() {
        return Ok(None);
    }
    let named = |of: &[usize]| {
        let each = |&i: &usize| {
            format!("{} ({:+.1} um, {})", points[i].name, touches[i].distance * 1e3, line_of(points[i], shown))
        };
        let first: Vec<String> = of.iter().take(NAMED).map(each).collect();
        let lines: Vec<String> = of.iter().take(LINES).skip(NAMED).map(|&i| line_of(points[i], shown)).collect();
        let more = match of.len() {
            n if n > LINES => format!(", {}, and {} more", lines.join(", "), n - LINES),
            n if n > NAMED => format!(", {}", lines.join(", ")),
            _ => String::new(),
        };
        format!("{}{more}", first.join(", "))
    };
    let all = Neighbours::new(touches.iter().map(|t| t.at));
    let together: Vec<usize> = off.iter().copied().filter(|&i| lies_among_such(i, touches, &all)).collect();
    if !together.is_empty() {
        let text = format!("the part is not as designed where points lie off it together: {}", named(&together));
        let hint = "were it a clamp or dirt, take these rows out; if the part is so, name placement.measured.warp, large \
                    enough";
        return Err(Diag::limit("measured-off", text).at(Place::file(shown)).hint(hint));
    }
    let text = match off.len() {
        1 => format!("a point does not lie on the part and does not count: {}", named(&off)),
        n => format!("{n} points do not lie on the part and do not count: {}", named(&off)),
    };
    let hint =
        "measure there again: a clamp or dirt does no harm, a dent that no other point saw is marked out of focus";
    Ok(Some(Diag::warning("measured-left-out", text).at(Place::file(shown)).hint(hint)))
}

/// Deviations beyond which a point is told that the others contradict.
const ODD: f64 = 4.0;

/// A point that the others contradict; `names` are those of the observations that the warp was fitted to.
pub(super) fn odd(warp: &Warp, names: &[&str], shown: &str) -> Option<Diag> {
    let sizes = warp.left_out().into_iter().map(|[error, deviation]| (error, error.abs() * warp.factor() / deviation));
    let (worst, (error, size)) = sizes.enumerate().max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    let name = match &warp.members()[worst][..] {
        [one] => names[*one].to_owned(),
        [first, _] => format!("{} with another beside it", names[*first]),
        [first, others @ ..] => format!("{} with {} others beside it", names[*first], others.len()),
        [] => return None,
    };
    (size > ODD).then(|| {
        let text = format!("{name} lies {:+.1} um off what the other points say, {size:.1} deviations", error * 1e3);
        let hint = "measure there again, and beside it: it may be a clamp or dirt, or a dent that no other point saw";
        Diag::warning("measured-odd", text).at(Place::file(shown)).hint(hint)
    })
}

/// Deviations beyond which the mean of the features is told to lie apart.
const HEIGHTS_APART: f64 = 3.0;

/// Features that lie all together above or below what touches say of a rigid part; `residuals` are theirs, mm.
pub(super) fn heights(residuals: &[SpacePoint], pairs: &[Pair], shown: &str) -> Option<Diag> {
    let weight = |pair: &Pair| pair.sigma[2].powi(-2);
    let all: f64 = pairs.iter().map(weight).sum();
    let mean = residuals.iter().zip(pairs).map(|(r, pair)| weight(pair) * r[2]).sum::<f64>() / all;
    heights_apart(mean, all.sqrt().recip(), shown)
}

/// The same of a part that may be warped, against what touches alone say of it. What they do not know of one feature they
/// do not know of the next, so many features are no surer than one.
pub(super) fn heights_of_warped(
    features: &[Observation],
    touches: &[Observation],
    limit: f64,
    shown: &str,
) -> Option<Diag> {
    if features.is_empty() {
        return None;
    }
    let warp = warp(touches, limit)?;
    let each = features.iter().map(|feature| {
        let Told { height, deviation, .. } = warp.at(feature.at);
        let weight = (feature.sigma.powi(2) + deviation.powi(2)).recip();
        [weight * (feature.height - height), weight]
    });
    let [sum, all] = each.fold([0.0; 2], |s, v| [s[0] + v[0], s[1] + v[1]]);
    heights_apart(sum / all, (features.len() as f64 / all).sqrt(), shown)
}

fn heights_apart(mean: f64, sigma: f64, shown: &str) -> Option<Diag> {
    (mean.abs() > HEIGHTS_APART * sigma).then(|| {
        let (mean, sigma) = (mean * 1e3, sigma * 1e3);
        let text = format!("the features lie {mean:+.1} um from the heights of the touches, known to {sigma:.1} um");
        let hint = "the heights rest on the touches: check radius, pretravel and offset z of the probe, and the focus of \
                    the pilot";
        Diag::warning("measured-heights", text).at(Place::file(shown)).hint(hint)
    })
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
         features that hold the part they are trusted to {FARTHEST_MM} mm and 10 degrees",
        turn.to_degrees()
    );
    let hint = "check placement.origin and turn, and the offset and the radius of the probe";
    Err(Diag::limit("measured-far", text).at(Place::file(shown)).hint(hint))
}

/// A part that is turned about z by more than a clamping explains.
pub(super) fn turned_round(fit: &Fit, placed: Angle, shown: &str) -> Option<Diag> {
    let [[xx, ..], [yx, ..], _] = fit.motion.rows();
    let turn = math::atan2(yx, xx);
    (turn.abs() > FARTHEST_TURN).then(|| {
        let text =
            format!("the points turn the part by {:.2} degrees about z, beside placement.turn", turn.to_degrees());
        let sum = (placed.as_deg() + turn.to_degrees()).round();
        // Neither beyond half a turn nor minus nothing.
        let sum = sum - 360.0 * (sum / 360.0).round() + 0.0;
        let hint = format!(
            "state about {sum:.0} deg as placement.turn, and look at layout.svg: features that are named the wrong way \
             round turn the texture"
        );
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
pub(super) fn apart(fault: PairsFault, points: &[&MeasuredPoint], is_warped: bool, shown: &str) -> Diag {
    let warp = if is_warped { "" } else { "; where all are right the part is warped: state placement.measured.warp" };
    let name = |i: usize| format!("{} ({})", points[i].name, line_of(points[i], shown));
    let (text, hint, at) = match fault {
        PairsFault::Wrong(i) => (
            format!("{} does not go with the other points, which go together", name(i)),
            format!("measure it again, or leave it out{warp}"),
            i,
        ),
        PairsFault::Exchanged(i, k) => (
            format!("{} and {} are exchanged: the points go together the other way round", name(i), name(k)),
            "exchange their stage positions, and check that no other two are exchanged".to_owned(),
            i,
        ),
        PairsFault::Mirrored => (
            "the points go together in a mirror alone".to_owned(),
            "check the signs of the axes: stage_x, stage_y and stage_z are what the controller shows, and the machine \
             file says what each axis carries"
                .to_owned(),
            0,
        ),
        PairsFault::Apart(i) => (
            format!("the points do not go together within their noise; {} is farthest off", name(i)),
            if points.len() > 3 {
                format!("check the points, the unit of the part and sigma_um{warp}")
            } else {
                "check the points, the unit of the part and sigma_um; a fourth point shows which one is wrong"
                    .to_owned()
            },
            i,
        ),
    };
    Diag::limit("measured-apart", text).at(points[at].place.clone()).hint(hint)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A touch at a place in mm, which lies so much off the part.
    fn touch(at: SpacePoint, distance: f64, normal: SpacePoint) -> (TouchResidual, MeasuredPoint) {
        let residual = TouchResidual { distance, is_on_part: distance.abs() < 0.02, at, normal, sigma: 0.003 };
        let point = MeasuredPoint {
            name: format!("at {at:?}"),
            place: Place::line("m.csv", 7),
            measure: Measure::Touch { tip_mm: 1.0 },
            stage: at,
            sigma_mm: [0.003; 2],
        };
        (residual, point)
    }

    const UP: SpacePoint = [0.0, 0.0, 1.0];

    fn beside_of(all: &[(TouchResidual, MeasuredPoint)]) -> Result<Option<Diag>, Diag> {
        let touches: Vec<TouchResidual> = all.iter().map(|a| a.0).collect();
        beside(&touches, &all.iter().map(|a| &a.1).collect::<Vec<_>>(), "m.csv")
    }

    #[test]
    fn a_dent_under_four_touches_of_a_net_or_under_one_that_was_repeated_is_refused_and_dirt_is_told() {
        let net = |off: &dyn Fn(i32, i32) -> f64| {
            let cells = (0..8).flat_map(|x| (0..8).map(move |y| (x, y)));
            let all = cells.map(|(x, y)| touch([20.0 * f64::from(x), 20.0 * f64::from(y), 0.0], off(x, y), UP));
            all.collect::<Vec<_>>()
        };
        let dent = net(&|x, y| if (3..5).contains(&x) && (3..5).contains(&y) { -0.2 } else { 0.0 });
        let refused = beside_of(&dent).expect_err("four neighbours");
        assert!(refused.code == "measured-off" && refused.message.matches("line 7").count() == 4, "{refused:?}");
        let corner = net(&|x, y| if x < 2 && y < 2 { -0.2 } else { 0.0 });
        assert!(beside_of(&corner).is_err());
        let apart = net(&|x, y| if (x, y) == (1, 1) || (x, y) == (6, 5) { -0.2 } else { 0.0 });
        let told = beside_of(&apart).expect("dirt").expect("a warning");
        assert!(told.code == "measured-left-out" && told.message.starts_with("2 points"), "{told:?}");
        let above_and_below = net(&|x, y| match (x, y) {
            (3, 3) => 0.2,
            (3, 4) | (4, 3) => -0.2,
            _ => 0.0,
        });
        assert!(beside_of(&above_and_below).is_ok());
        let mut repeated = net(&|x, y| if (x, y) == (4, 4) { -0.2 } else { 0.0 });
        assert!(beside_of(&repeated).is_ok());
        repeated.push(touch([80.02, 80.0, 0.0], -0.2, UP));
        assert!(beside_of(&repeated).is_err());
    }

    #[test]
    fn touches_of_one_place_that_differ_are_refused_and_those_one_above_the_other_on_a_wall_are_not() {
        let of = |all: &[(TouchResidual, MeasuredPoint)]| {
            let touches: Vec<TouchResidual> = all.iter().map(|a| a.0).collect();
            twice(&touches, &all.iter().map(|a| &a.1).collect::<Vec<_>>(), "m.csv")
        };
        let differ = [touch([10.0, 5.0, 0.0], 0.0, UP), touch([10.05, 4.96, 0.03], 0.03, UP)];
        assert_eq!(of(&differ).expect("a fault").code, "measured-twice");
        let within_noise = [touch([10.0, 5.0, 0.0], 0.0, UP), touch([10.05, 4.96, 0.0], 0.015, UP)];
        assert_eq!(of(&within_noise), None);
        let wall = [0.0, -1.0, 0.0];
        assert_eq!(of(&[touch([10.0, 5.0, -5.0], 0.0, wall), touch([10.0, 5.0, -10.0], 0.04, wall)]), None);
        // A step between them.
        assert_eq!(of(&[touch([10.0, 5.0, 0.0], 0.0, UP), touch([10.05, 5.0, -8.0], 0.001, UP)]), None);
    }
}
