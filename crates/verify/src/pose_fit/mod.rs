//! Where a measured part lies, by the verifier's own arithmetic.
//!
//! Pairs are fitted by Horn's quaternion (Closed-form solution of absolute orientation using unit quaternions, 1987),
//! then by least squares with their own noise. Touches have no closed form: whether a stated pose fits them best is asked
//! there, by one step of least squares from it, and whether another fits them better ([`other`]). All slopes are differences; normal equations are solved by elimination.

mod other;

use crate::geometry::{BoxNm, Geometry, Pose};
use crate::warp_fit::WarpPoint;
use terrace_core::geom::{NM_PER_MM, SpacePoint};
use terrace_core::math;
use terrace_core::parallel;

/// A point with a partner on the part: both nm, the second in the table frame, with its noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct PosePair {
    pub(super) part: SpacePoint,
    pub(super) table: SpacePoint,
    /// As it counts in the pose.
    pub(super) sigma: SpacePoint,
    /// That of its height as the table has it.
    pub(super) sigma_z: f64,
}

/// A point on the part, nm, table frame, that stands off it.
#[derive(Clone, Copy, Debug)]
pub(super) struct PoseTouch {
    pub(super) table: SpacePoint,
    pub(super) off: f64,
    pub(super) sigma: f64,
    pub(super) is_along_z: bool,
}

/// All points, and the part.
pub(super) struct PosePoints<'a> {
    pub(super) pairs: Vec<PosePair>,
    pub(super) touches: Vec<PoseTouch>,
    pub(super) part: &'a Geometry,
    /// How far off, as one deviation, the height of a warped part may be, nm: touches count by how far they spread, and
    /// along z no more than one that is off by that.
    pub(super) warp: Option<f64>,
}

/// A pose against the points.
pub(super) struct JudgedPose {
    /// How far the points move in the step that would make it fit better, nm.
    pub(super) unrest_nm: f64,
    pub(super) touches: Vec<TouchFound>,
    /// Of the rotation vector, rad, about the middle of the points, and the shift, nm.
    pub(super) covariance: [[f64; 6]; 6],
}

/// A touch against the part.
#[derive(Clone, Copy, Debug)]
pub(super) struct TouchFound {
    /// Above the part, less what it stands off, nm.
    pub(super) distance: f64,
    sigma: f64,
    /// The nearest point of the part, and the direction from it, table frame.
    foot: SpacePoint,
    direction: SpacePoint,
}

/// The number of deviations from which a touch does not count.
const CUT: f64 = 4.685;

impl PosePoints<'_> {
    /// The pose that fits the pairs alone.
    pub(super) fn by_pairs(&self) -> Option<Pose> {
        let mut pose = horn(&self.pairs)?;
        for _ in 0..50 {
            let step = self.equations(&pose, &[]).step()?;
            pose = self.stepped(&pose, &step);
            if self.size(&step) < 1e-6 {
                break;
            }
        }
        Some(pose)
    }

    /// What a pose is against the points; None where they do not hold the part.
    pub(super) fn judged(&self, pose: &Pose) -> Option<JudgedPose> {
        let touches = self.met(pose);
        let spread = spread(&touches);
        let counted = if self.warp.is_some() { spread } else { 1.0 };
        let by_one = touches.iter().map(|touch| self.divisor(touch, spread, touches.len()));
        let weights: Vec<f64> = weights(&touches).into_iter().zip(by_one).map(|(weight, by)| weight / by).collect();
        let equations = self.equations(pose, &weights);
        let step = equations.step()?;
        let squares = self.squares(pose, &touches, counted);
        let noise2 = match squares.len().saturating_sub(6) {
            0 => 1.0,
            dof => (squares.iter().sum::<f64>() / dof as f64).max(1.0),
        };
        let covariance = equations.inverse()?.map(|row| row.map(|v| v * noise2));
        Some(JudgedPose { unrest_nm: self.size(&step), touches, covariance })
    }

    /// By how much less than its noise says a touch counts, one of `count` that spread so.
    fn divisor(&self, touch: &TouchFound, spread: f64, count: usize) -> f64 {
        let Some(warp) = self.warp else { return 1.0 };
        // All touches share what is along z.
        let shared = (count as f64).sqrt() * warp * touch.direction[2] / touch.sigma;
        math::hypot(spread, shared)
    }

    /// What the points say of the height of the part over the pose, mm: touches and features on what is no steeper than
    /// 45 degrees, touches no farther off than `limit`, nm.
    pub(super) fn of_height(&self, pose: &Pose, touches: &[TouchFound], limit: f64) -> Vec<WarpPoint> {
        let mm = |nm: f64| nm / NM_PER_MM;
        let middle = self.middle();
        // A turn about z takes a place along (-y, x); what lies aside by (dx, dy) is as much higher as the part falls there.
        let aside = |at: SpacePoint, [nx, ny, nz]: SpacePoint| {
            let [x, y] = [0, 1].map(|k| at[k] - middle[k]);
            [mm((nx * -y + ny * x) / nz), nx / nz, ny / nz]
        };
        let of_pairs = self.pairs.iter().filter_map(|pair| {
            let [x, y, z] = pose.apply(pair.part);
            let facing = flattest(self.part, pair.part)?;
            let [nx, ny, nz] = pose.rows.map(|row| dot(row, facing));
            if nz < std::f64::consts::FRAC_1_SQRT_2 {
                return None;
            }
            let off = [pair.table[0] - x, pair.table[1] - y, pair.table[2] - z];
            let height = off[2] + (nx * off[0] + ny * off[1]) / nz;
            let [sx, sy, _] = pair.sigma;
            let sigma = math::hypot(math::hypot(nx / nz * sx, ny / nz * sy), pair.sigma_z);
            let aside = aside([x, y, z], [nx, ny, nz]);
            Some(WarpPoint { at: [mm(x), mm(y)], height: mm(height), sigma: mm(sigma), aside })
        });
        let of_touches = touches.iter().filter_map(|touch| {
            let up = touch.direction[2];
            let counts = touch.distance.abs() <= limit && up >= std::f64::consts::FRAC_1_SQRT_2;
            let [x, y, _] = touch.foot;
            counts.then(|| WarpPoint {
                at: [mm(x), mm(y)],
                height: mm(touch.distance / up),
                sigma: mm(touch.sigma / up),
                aside: aside(touch.foot, touch.direction),
            })
        });
        of_pairs.chain(of_touches).collect()
    }

    /// Squares of the residuals of all points that count, over their noise.
    fn squares(&self, pose: &Pose, touches: &[TouchFound], counted: f64) -> Vec<f64> {
        let none = vec![0.0; touches.len()];
        let of_pairs = self.residuals(pose, &none).into_iter().take(3 * self.pairs.len());
        let on_part = touches.iter().zip(on_part(touches)).filter(|(_, on)| *on);
        of_pairs.chain(on_part.map(|(t, _)| t.distance / t.sigma / counted)).map(|v| v * v).collect()
    }

    /// The middle of the points, table frame, nm: what small motions turn about.
    pub(super) fn middle(&self) -> SpacePoint {
        let all = self.pairs.iter().map(|p| p.table).chain(self.touches.iter().map(|t| t.table));
        let (sum, count) = all.fold(([0.0; 3], 0.0), |(s, n), p| ([0, 1, 2].map(|k| s[k] + p[k]), n + 1.0));
        sum.map(|v| v / f64::max(count, 1.0))
    }

    /// Largest distance of a point from their middle, nm.
    fn reach(&self) -> f64 {
        let middle = self.middle();
        let all = self.pairs.iter().map(|p| p.table).chain(self.touches.iter().map(|t| t.table));
        all.map(|p| length([0, 1, 2].map(|k| p[k] - middle[k]))).fold(1.0, f64::max)
    }

    /// By how much a step moves the point that it moves most, nm, at most.
    fn size(&self, step: &[f64; 6]) -> f64 {
        length([step[0], step[1], step[2]]) * self.reach() + length([step[3], step[4], step[5]])
    }

    /// A pose turned about the middle of the points by a small rotation vector, and shifted.
    fn stepped(&self, pose: &Pose, step: &[f64; 6]) -> Pose {
        let middle = self.middle();
        let turn = quaternion_rows(small_quaternion([step[0], step[1], step[2]]));
        let moved = |v: SpacePoint| [0, 1, 2].map(|k| (0..3).map(|j| turn[k][j] * v[j]).sum::<f64>());
        let columns = [0, 1, 2].map(|k| moved([0, 1, 2].map(|j| pose.rows[j][k])));
        let arm = moved([0, 1, 2].map(|k| pose.shift[k] - middle[k]));
        Pose {
            rows: [0, 1, 2].map(|i| [0, 1, 2].map(|k| columns[k][i])),
            shift: [0, 1, 2].map(|k| arm[k] + middle[k] + step[3 + k]),
        }
    }

    fn met(&self, pose: &Pose) -> Vec<TouchFound> {
        parallel::map(self.touches.len(), |i| found(self.part, pose, &self.touches[i]))
    }

    /// The residuals over their noise, weighted: three of each pair, one of each touch.
    fn residuals(&self, pose: &Pose, weights: &[f64]) -> Vec<f64> {
        let of_pairs = self.pairs.iter().flat_map(|pair| {
            let at = pose.apply(pair.part);
            [0, 1, 2].map(|k| (pair.table[k] - at[k]) / pair.sigma[k])
        });
        let of_touches =
            self.met(pose).into_iter().zip(weights).map(|(touch, weight)| weight * touch.distance / touch.sigma);
        of_pairs.chain(of_touches).collect()
    }

    /// The equations of least squares about a pose.
    fn equations(&self, pose: &Pose, weights: &[f64]) -> Equations {
        let reach = self.reach();
        // Differences over a micrometre at the farthest point.
        let unit = |k: usize| if k < 3 { 1e3 / reach } else { 1e3 };
        let now = self.residuals(pose, weights);
        let columns = [0, 1, 2, 3, 4, 5].map(|k| {
            let [ahead, behind] = [1.0, -1.0].map(|sign| {
                let mut step = [0.0; 6];
                step[k] = sign * unit(k);
                self.residuals(&self.stepped(pose, &step), weights)
            });
            ahead.iter().zip(behind).map(|(a, b)| (a - b) / 2.0).collect::<Vec<f64>>()
        });
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let matrix = [0, 1, 2, 3, 4, 5].map(|i| [0, 1, 2, 3, 4, 5].map(|k| dot(&columns[i], &columns[k])));
        let right = [0, 1, 2, 3, 4, 5].map(|i| -dot(&columns[i], &now));
        Equations { matrix, right, units: [0, 1, 2, 3, 4, 5].map(unit) }
    }
}

/// Normal equations of a small motion, each unknown in its own unit.
struct Equations {
    matrix: [[f64; 6]; 6],
    right: [f64; 6],
    /// Of the rotation vector, rad, and of the shift, nm.
    units: [f64; 6],
}

impl Equations {
    /// The motion that solves them.
    fn step(&self) -> Option<[f64; 6]> {
        let solution = solved(self.matrix, self.right)?;
        Some([0, 1, 2, 3, 4, 5].map(|k| solution[k] * self.units[k]))
    }

    /// The covariance of that motion for residuals of unit noise.
    fn inverse(&self) -> Option<[[f64; 6]; 6]> {
        let mut rows = [[0.0; 6]; 6];
        for (k, row) in rows.iter_mut().enumerate() {
            let mut one = [0.0; 6];
            one[k] = 1.0;
            *row = solved(self.matrix, one)?;
        }
        Some([0, 1, 2, 3, 4, 5].map(|i| [0, 1, 2, 3, 4, 5].map(|k| rows[i][k] * self.units[i] * self.units[k])))
    }
}

/// Weights of touches by how far they lie off, in units of their median: roots, as residuals are weighted.
fn weights(touches: &[TouchFound]) -> Vec<f64> {
    let spread = spread(touches);
    touches
        .iter()
        .map(|t| {
            let u = t.distance / t.sigma / spread / CUT;
            (1.0 - u * u).max(0.0)
        })
        .collect()
}

/// The deviation of touches in units of their noise, by the median, at least 1.
fn spread(touches: &[TouchFound]) -> f64 {
    let mut sizes: Vec<f64> = touches.iter().map(|t| (t.distance / t.sigma).abs()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).map_or(1.0, |median| (1.4826 * median).max(1.0))
}

/// Which touches lie on the part.
pub(super) fn on_part(touches: &[TouchFound]) -> Vec<bool> {
    let spread = spread(touches);
    touches.iter().map(|t| (t.distance / t.sigma / spread).abs() < CUT).collect()
}

fn length(v: SpacePoint) -> f64 {
    math::hypot(math::hypot(v[0], v[1]), v[2])
}

fn dot(a: SpacePoint, b: SpacePoint) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

/// A touch against the nearest of the file's own facets.
fn found(part: &Geometry, pose: &Pose, touch: &PoseTouch) -> TouchFound {
    let p = pose.back(touch.table);
    let Some(Nearest { distance, foot, normal }) = nearest(part, p) else {
        let nowhere = [0.0, 0.0, 1.0];
        return TouchFound { distance: f64::INFINITY, sigma: touch.sigma, foot: touch.table, direction: nowhere };
    };
    let to = [0, 1, 2].map(|k| p[k] - foot[k]);
    let along = dot(to, normal);
    let is_beside = distance > 1e-3 * NM_PER_MM && (along / distance).abs() > 0.7;
    let direction = if is_beside { to.map(|v| v / distance * along.signum()) } else { normal };
    let in_table = pose.rows.map(|row| dot(row, direction));
    let sigma = if touch.is_along_z { touch.sigma * in_table[2].abs().max(0.1) } else { touch.sigma };
    TouchFound { distance: dot(direction, to) - touch.off, sigma, foot: pose.apply(foot), direction: in_table }
}

/// The upward normal of the facet beneath a feature: of those that are as near as the nearest, to a micrometre, the least
/// steep one, and where several are, their mean.
fn flattest(part: &Geometry, p: SpacePoint) -> Option<SpacePoint> {
    let reach = nearest(part, p)?.distance + 1e-3 * NM_PER_MM;
    let mut around = BoxNm::EMPTY;
    around.add([p[0] - reach, p[1] - reach]);
    around.add([p[0] + reach, p[1] + reach]);
    let mut near: Vec<SpacePoint> = Vec::new();
    part.facets_in(around, &mut |facet| {
        let found = foot(facet, p).filter(|(foot, _)| length([0, 1, 2].map(|k| p[k] - foot[k])) <= reach);
        near.extend(found.map(|(_, normal)| normal));
    });
    let up = near.iter().map(|n| n[2]).fold(f64::NEG_INFINITY, f64::max);
    let flat = near.iter().filter(|n| n[2] >= up - SAME_STEEPNESS);
    let sum = flat.fold([0.0; 3], |sum, n| [0, 1, 2].map(|k| sum[k] + n[k]));
    Some(sum.map(|v| v / length(sum)))
}

/// Facets whose upward normals rise by no more of a difference are as steep as one another: those of a chamfer, whose
/// corners are rounded.
const SAME_STEEPNESS: f64 = 1e-3;

/// The point of a part that is nearest to another.
struct Nearest {
    distance: f64,
    foot: SpacePoint,
    /// Normal of its facet, upwards.
    normal: SpacePoint,
}

/// The point of the file's own facets that is nearest to `p`; None of a part without facets.
fn nearest(part: &Geometry, p: SpacePoint) -> Option<Nearest> {
    // Parts and the ways of stages lie within 4 m of the origin, so nothing is farther from a point.
    const FARTHEST: f64 = 16e9;
    let mut reach = 1.0 * NM_PER_MM;
    loop {
        let mut best: Option<Nearest> = None;
        let mut around = BoxNm::EMPTY;
        around.add([p[0] - reach, p[1] - reach]);
        around.add([p[0] + reach, p[1] + reach]);
        part.facets_in(around, &mut |facet| {
            let Some((foot, normal)) = foot(facet, p) else { return };
            let distance = length([0, 1, 2].map(|k| p[k] - foot[k]));
            if best.as_ref().is_none_or(|known| distance < known.distance) {
                best = Some(Nearest { distance, foot, normal });
            }
        });
        // A nearer facet than that would reach into the box.
        if reach > FARTHEST || best.as_ref().is_some_and(|known| known.distance <= reach) {
            return best;
        }
        reach *= 2.0;
    }
}

/// The point of a facet that is nearest to `p`, and its normal upwards; None where it has no area.
fn foot(facet: [SpacePoint; 3], p: SpacePoint) -> Option<(SpacePoint, SpacePoint)> {
    let [a, b, c] = facet;
    let minus = |a: SpacePoint, b: SpacePoint| [0, 1, 2].map(|k| a[k] - b[k]);
    let cross = |u: SpacePoint, v: SpacePoint| {
        [0, 1, 2].map(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3])
    };
    let area = cross(minus(b, a), minus(c, a));
    let size = length(area);
    if size <= 0.0 {
        return None;
    }
    let normal = area.map(|v| v / size * if area[2] < 0.0 { -1.0 } else { 1.0 });
    let off = dot(minus(p, a), normal);
    let on_plane = [0, 1, 2].map(|k| p[k] - off * normal[k]);
    let is_inside =
        [(a, b), (b, c), (c, a)].iter().all(|&(u, v)| dot(cross(minus(v, u), minus(on_plane, u)), area) >= 0.0);
    if is_inside {
        return Some((on_plane, normal));
    }
    let on_edge = |u: SpacePoint, v: SpacePoint| {
        let d = minus(v, u);
        let t = (dot(minus(p, u), d) / dot(d, d).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        [0, 1, 2].map(|k| u[k] + t * d[k])
    };
    let nearest = [on_edge(a, b), on_edge(b, c), on_edge(c, a)];
    let distance = |q: &SpacePoint| length(minus(p, *q));
    nearest.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|q| (q, normal))
}

/// The pose of pairs of equal weight; None of fewer than three.
fn horn(pairs: &[PosePair]) -> Option<Pose> {
    if pairs.len() < 3 {
        return None;
    }
    let n = pairs.len() as f64;
    let middle = |of: &dyn Fn(&PosePair) -> SpacePoint| {
        pairs.iter().fold([0.0; 3], |s, p| [0, 1, 2].map(|k| s[k] + of(p)[k] / n))
    };
    let (a, b) = (middle(&|p| p.part), middle(&|p| p.table));
    let mut m = [[0.0; 3]; 3];
    for pair in pairs {
        for (i, row) in m.iter_mut().enumerate() {
            for (k, sum) in row.iter_mut().enumerate() {
                *sum += (pair.part[i] - a[i]) * (pair.table[k] - b[k]);
            }
        }
    }
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = m;
    let matrix = [
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ];
    let rows = quaternion_rows(largest(matrix));
    let turned = [0, 1, 2].map(|k| (0..3).map(|j| rows[k][j] * a[j]).sum::<f64>());
    Some(Pose { rows, shift: [0, 1, 2].map(|k| b[k] - turned[k]) })
}

/// The eigenvector of the largest eigenvalue of a symmetric matrix (Jacobi's rotations).
fn largest(mut m: [[f64; 4]; 4]) -> [f64; 4] {
    let mut vectors = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|k| f64::from(u8::from(i == k))));
    for _ in 0..60 {
        for p in 0..4 {
            for q in p + 1..4 {
                if m[p][q] == 0.0 {
                    continue;
                }
                let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
                let t = theta.signum() / (theta.abs() + math::hypot(theta, 1.0));
                let c = 1.0 / math::hypot(t, 1.0);
                let s = t * c;
                for row in &mut m {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                let (rp, rq) = (m[p], m[q]);
                for k in 0..4 {
                    (m[p][k], m[q][k]) = (c * rp[k] - s * rq[k], s * rp[k] + c * rq[k]);
                }
                for row in &mut vectors {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
            }
        }
    }
    let best = (0..4).max_by(|&i, &k| m[i][i].total_cmp(&m[k][k])).unwrap_or(0);
    vectors.map(|row| row[best])
}

/// The rotation of a quaternion.
fn quaternion_rows(q: [f64; 4]) -> [SpacePoint; 3] {
    let size = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|v| v / size);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// The quaternion of a rotation vector.
fn small_quaternion(w: SpacePoint) -> [f64; 4] {
    let angle = length(w);
    let share = if angle > 0.0 { math::sin(angle / 2.0) / angle } else { 0.5 };
    [math::cos(angle / 2.0), w[0] * share, w[1] * share, w[2] * share]
}

/// The solution of a symmetric system by elimination with the largest pivot; None where it has none.
fn solved(mut m: [[f64; 6]; 6], mut right: [f64; 6]) -> Option<[f64; 6]> {
    let size = (0..6).map(|k| m[k][k]).fold(0.0, f64::max);
    for k in 0..6 {
        let pivot = (k..6).max_by(|&a, &b| m[a][k].abs().total_cmp(&m[b][k].abs()))?;
        if m[pivot][k].abs() <= 1e-14 * size {
            return None;
        }
        m.swap(k, pivot);
        right.swap(k, pivot);
        for i in k + 1..6 {
            let share = m[i][k] / m[k][k];
            let pivot_row = m[k];
            m[i].iter_mut().zip(pivot_row).skip(k).for_each(|(v, of)| *v -= share * of);
            right[i] -= share * right[k];
        }
    }
    for k in (0..6).rev() {
        let rest: f64 = (k + 1..6).map(|j| m[k][j] * right[j]).sum();
        right[k] = (right[k] - rest) / m[k][k];
    }
    Some(right)
}
