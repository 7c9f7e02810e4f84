//! Where to measure a part: places chosen one after another, each where a point lowers the cost of what is not known
//! most.
//!
//! Consumes places that can be measured, places whose height counts, and what is believed of the part before: a small
//! motion with a covariance, and a warp. Promises the places in the order of their use, and after each how surely the
//! height would be known. How surely it is known does not depend on what the points will show, so all of it is known
//! beforehand.
//!
//! The height is linear in the small motion, and the warp a Gaussian process with the covariance that [`warp`](super::warp()) is
//! fitted with, of each of several lengths in turn; all count alike. A point lowers the covariance of all heights by a
//! matrix of rank one (Rasmussen and Williams 2006, eq. 2.24, for one point more), which is what makes trying every place
//! cheap. Choosing the best next place each time loses at most 1/e of what the best set would lower, where what is
//! lowered is submodular (Krause, Singh and Guestrin, Journal of Machine Learning Research 9, 2008); the cost here is so
//! only nearly. So every place is then moved to where it is best while the others stay, some rounds long, as exchange
//! algorithms of optimal design do (Fedorov 1972).
//!
//! Lengths are mm, angles rad, in the table frame.

use super::uncertainty::height_row;
use super::warp::{Candidate, Observation, apart, matern};
use terrace_core::geom::SpacePoint;
use terrace_core::parallel;

/// A place on the part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Where it lies, table frame, mm.
    pub at: SpacePoint,
    /// dz/dx and dz/dy of the part there.
    pub slope: [f64; 2],
}

/// What is believed of a part before it is measured.
#[derive(Clone, Debug)]
pub struct Prior {
    /// The point about which it turns, mm.
    pub centre: SpacePoint,
    /// Covariance of the turns about it, rad, and the shifts, mm.
    pub covariance: [[f64; 6]; 6],
    /// How it may be warped: lengths, each with its amplitude and how likely it is; none of a rigid part.
    pub warp: Vec<Candidate>,
}

impl Prior {
    /// Turns and shifts with these standard deviations, which do not depend on each other.
    pub fn independent(sigmas: [f64; 6]) -> [[f64; 6]; 6] {
        std::array::from_fn(|i| std::array::from_fn(|k| if i == k { sigmas[i] * sigmas[i] } else { 0.0 }))
    }
}

/// How surely the heights would be known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// What that costs, in the unit of the caller.
    pub cost: f64,
    /// The largest standard deviation of a height, mm.
    pub worst: f64,
    /// Standard deviations of the turns, rad, and the shifts, mm.
    pub motion: [f64; 6],
}

/// What all targets cost whose heights have these variances, mm². It grows with each of them.
pub type Cost<'a> = &'a (dyn Fn(&[f64]) -> f64 + Sync);

/// Rounds in which chosen sites are exchanged, at most, and what a round has to gain to be followed by another.
const MOST_ROUNDS: usize = 4;
const LEAST_GAIN: f64 = 2e-3;

/// The small motion comes first among what is not known.
const MOTION: usize = 6;

/// What is not known, and the covariance of it.
#[derive(Clone)]
pub struct Unknown {
    /// By length of the warp: rows of the covariance of motion, sites and targets, and how likely it is.
    models: Vec<(Vec<f64>, f64)>,
    /// Places that can be measured, and those whose height counts.
    sites: usize,
    targets: usize,
    /// Of a row.
    size: usize,
    /// Variance of what a measurement shows of the height, by site, mm².
    noise: Vec<f64>,
}

impl Unknown {
    /// What is not known once some points have shown the height, at `sites` and `targets`. `sigma` is the standard
    /// deviation of a measurement along the normal, mm.
    pub fn new(prior: &Prior, shown: &[Observation], sites: &[Site], targets: &[Site], sigma: f64) -> Self {
        let level = |o: &Observation| Site { at: [o.at[0], o.at[1], prior.centre[2]], slope: [0.0; 2] };
        let shown_at: Vec<Site> = shown.iter().map(level).collect();
        let places: Vec<&Site> = sites.iter().chain(targets).chain(&shown_at).collect();
        let rows: Vec<[f64; MOTION]> =
            places.iter().map(|site| height_row(site.at, site.slope, prior.centre)).collect();
        let size = MOTION + places.len();
        // What a place shares with each unknown of the motion.
        let times = |row: &[f64; MOTION], k: usize| (0..MOTION).map(|m| row[m] * prior.covariance[m][k]).sum::<f64>();
        let shared: Vec<[f64; MOTION]> = rows.iter().map(|row| std::array::from_fn(|k| times(row, k))).collect();
        let covariance = |warp: &Candidate, i: usize, k: usize| match (i.checked_sub(MOTION), k.checked_sub(MOTION)) {
            (None, None) => prior.covariance[i][k],
            (Some(p), None) => shared[p][k],
            (None, Some(q)) => shared[q][i],
            (Some(p), Some(q)) => {
                let moved: f64 = (0..MOTION).map(|m| shared[p][m] * rows[q][m]).sum();
                let [a, b] = [places[p], places[q]].map(|site| [site.at[0], site.at[1]]);
                moved + warp.amplitude * warp.amplitude * matern(apart(a, b), warp.length)
            }
        };
        let rigid = [Candidate { length: 1.0, amplitude: 0.0, weight: 1.0 }];
        let of = |warp: &Candidate| {
            let rows = parallel::map(size, |i| (0..size).map(|k| covariance(warp, i, k)).collect::<Vec<f64>>());
            (rows.concat(), warp.weight)
        };
        // A tip that touches a slope shows the height less surely than along the normal.
        let steepness = |site: &Site| 1.0 + site.slope[0].powi(2) + site.slope[1].powi(2);
        let mut unknown = Self {
            models: if prior.warp.is_empty() { &rigid } else { prior.warp.as_slice() }.iter().map(of).collect(),
            sites: sites.len(),
            targets: targets.len(),
            size,
            noise: sites.iter().map(|site| sigma * sigma * steepness(site)).collect(),
        };
        for (i, observation) in shown.iter().enumerate() {
            unknown.show(MOTION + sites.len() + targets.len() + i, observation.sigma * observation.sigma);
        }
        unknown
    }

    fn size(&self) -> usize {
        self.size
    }

    /// The mean of an entry over the lengths.
    fn mean(&self, i: usize, k: usize) -> f64 {
        let at = i * self.size() + k;
        self.models.iter().map(|(model, weight)| weight * model[at]).sum()
    }

    fn variances(&self) -> Vec<f64> {
        let first = MOTION + self.sites;
        (first..first + self.targets).map(|i| self.mean(i, i).max(0.0)).collect()
    }

    /// The standard deviation of the height of each target, mm.
    pub fn deviations(&self) -> Vec<f64> {
        self.variances().into_iter().map(f64::sqrt).collect()
    }

    /// How surely all is known now.
    pub fn known(&self, cost: Cost<'_>) -> Known {
        let variances = self.variances();
        Known {
            cost: cost(&variances),
            worst: variances.iter().fold(0.0, |most: f64, &v| most.max(v)).sqrt(),
            motion: std::array::from_fn(|i| self.mean(i, i).max(0.0).sqrt()),
        }
    }

    /// Measures at a site.
    pub fn measure(&mut self, site: usize) {
        self.show(MOTION + site, self.noise[site]);
    }

    /// Measures at several sites: what each lowers follows from its own row and from those before it, and all of it is
    /// taken from every row at once.
    pub fn measure_all(&mut self, sites: &[usize]) {
        let size = self.size();
        for (model, _) in &mut self.models {
            let mut lowered: Vec<Vec<f64>> = Vec::with_capacity(sites.len());
            for &site in sites {
                let at = MOTION + site;
                let mut row = model[at * size..(at + 1) * size].to_vec();
                for before in &lowered {
                    row.iter_mut().zip(before).for_each(|(entry, b)| *entry -= before[at] * b);
                }
                let root = (row[at] + self.noise[site]).sqrt();
                row.iter_mut().for_each(|entry| *entry /= root);
                lowered.push(row);
            }
            parallel::map_items(model.chunks_mut(size).collect(), |i, row: &mut [f64]| {
                for shown in &lowered {
                    row.iter_mut().zip(shown).for_each(|(entry, s)| *entry -= shown[i] * s);
                }
            });
        }
    }

    /// Takes what a measurement of entry `at` would show, whose variance is `noise`.
    fn show(&mut self, at: usize, noise: f64) {
        self.update(at, |variance| variance + noise);
    }

    /// Takes a measurement at a site back.
    fn forget(&mut self, site: usize) {
        let noise = self.noise[site];
        self.update(MOTION + site, |variance| taken_back(variance, noise));
    }

    /// Lowers all covariances by what each shares with entry `at`, over a variance that follows from that of the entry.
    fn update(&mut self, at: usize, over: impl Fn(f64) -> f64) {
        let size = self.size();
        for (model, _) in &mut self.models {
            let shown: Vec<f64> = model[at * size..(at + 1) * size].to_vec();
            let variance = over(shown[at]);
            parallel::map_items(model.chunks_mut(size).collect(), |i, row: &mut [f64]| {
                let share = shown[i] / variance;
                row.iter_mut().zip(&shown).for_each(|(entry, s)| *entry -= share * s);
            });
        }
    }

    /// The site of those that are free whose measurement lowers the cost most, once that at another site is taken back;
    /// the first of several.
    fn best(&self, is_free: &[bool], without: Option<usize>, cost: Cost<'_>) -> Option<usize> {
        let (size, first) = (self.size(), MOTION + self.sites);
        let row = |site: usize| (MOTION + site) * size..(MOTION + site + 1) * size;
        let mut before = self.variances();
        // What the measurement that is taken back has lowered by, and over which variance.
        let back = |model: &[f64], site: usize| taken_back(model[row(site)][MOTION + site], self.noise[site]);
        if let Some(site) = without {
            for (model, weight) in &self.models {
                let factor = weight / back(model, site);
                let shown = &model[row(site)][first..];
                before.iter_mut().zip(shown).for_each(|(v, s)| *v -= factor * s * s);
            }
        }
        let now = cost(&before);
        let lowered = |site: usize| {
            if !is_free[site] {
                return f64::NEG_INFINITY;
            }
            let at = MOTION + site;
            let mut after = before.clone();
            for (model, weight) in &self.models {
                let shown = &model[row(site)];
                let (other, share) = match without {
                    Some(other) => (&model[row(other)], shown[MOTION + other] / back(model, other)),
                    None => (shown, 0.0),
                };
                let factor = weight / (shown[at] - share * other[at] + self.noise[site]);
                let entries = shown[first..].iter().zip(&other[first..]).map(|(s, o)| s - share * o);
                after.iter_mut().zip(entries).for_each(|(v, s)| *v -= factor * s * s);
            }
            after.iter_mut().for_each(|v| *v = v.max(0.0));
            now - cost(&after)
        };
        let gains = parallel::map(self.sites, lowered);
        let best =
            (0..self.sites).filter(|&i| is_free[i]).reduce(|best, i| if gains[i] > gains[best] { i } else { best });
        best.filter(|&i| gains[i] > 0.0)
    }

    /// Measures some sites, and site after site that lowers the cost most until `is_enough`, given how many there are
    /// and how surely all is known, or no site lowers the cost. Returns all of them.
    pub fn choose(
        &mut self,
        mut chosen: Vec<usize>,
        cost: Cost<'_>,
        is_enough: &dyn Fn(usize, &Known) -> bool,
    ) -> Vec<usize> {
        self.measure_all(&chosen);
        let mut is_free = vec![true; self.sites];
        chosen.iter().for_each(|&site| is_free[site] = false);
        while !is_enough(chosen.len(), &self.known(cost)) {
            let Some(site) = self.best(&is_free, None, cost) else { break };
            is_free[site] = false;
            self.measure(site);
            chosen.push(site);
        }
        chosen
    }

    /// Moves chosen sites, each in turn, to where they lower the cost most while all others stay; until a round gains
    /// little.
    pub fn exchange(&mut self, chosen: &mut [usize], cost: Cost<'_>) {
        let mut is_free = vec![true; self.sites];
        chosen.iter().for_each(|&site| is_free[site] = false);
        let mut before = self.known(cost).cost;
        for _ in 0..MOST_ROUNDS {
            for site in chosen.iter_mut() {
                is_free[*site] = true;
                let best = self.best(&is_free, Some(*site), cost).unwrap_or(*site);
                is_free[best] = false;
                if best != *site {
                    self.forget(*site);
                    self.measure(best);
                    *site = best;
                }
            }
            let now = self.known(cost).cost;
            if now > before * (1.0 - LEAST_GAIN) {
                break;
            }
            before = now;
        }
    }
}

/// Over which variance covariances grow again where a measurement is taken back that left `variance`, which is below
/// that of its noise.
fn taken_back(variance: f64, noise: f64) -> f64 {
    (variance - noise).min(-1e-9 * noise)
}

/// As even a net of `count` sites as there is, those at the rim among them: the sites that it begins with, then each the
/// farthest from all before it; the first of all the farthest from the middle.
pub fn even_net(sites: &[Site], begun: Vec<usize>, count: usize) -> Vec<usize> {
    let plane: Vec<[f64; 2]> = sites.iter().map(|site| [site.at[0], site.at[1]]).collect();
    let n = sites.len().max(1) as f64;
    let middle = [0, 1].map(|k| plane.iter().map(|at| at[k]).sum::<f64>() / n);
    let nearer = |distances: &mut [f64], to: [f64; 2]| {
        distances.iter_mut().zip(&plane).for_each(|(distance, &at)| *distance = distance.min(apart(at, to)));
    };
    let mut distances = vec![f64::INFINITY; sites.len()];
    let mut net = begun;
    net.iter().for_each(|&site| nearer(&mut distances, plane[site]));
    while net.len() < count.min(sites.len()) {
        let distance = |i: usize| if net.is_empty() { apart(plane[i], middle) } else { distances[i] };
        let next = (0..sites.len()).reduce(|best, i| if distance(i) > distance(best) { i } else { best });
        let Some(next) = next else { break };
        net.push(next);
        nearer(&mut distances, plane[next]);
    }
    net
}

/// A net of rows and columns over the box of some sites, as fine as `count` allows: the site nearest to each node, if
/// there is one within half the pitch.
pub fn regular_net(sites: &[Site], count: usize) -> Vec<usize> {
    let places: Vec<[f64; 2]> = sites.iter().map(|site| [site.at[0], site.at[1]]).collect();
    let bound = |k: usize, start: f64, more: fn(f64, f64) -> f64| places.iter().map(|p| p[k]).fold(start, more);
    let lo = [0, 1].map(|k| bound(k, f64::INFINITY, f64::min));
    let size = [0, 1].map(|k| (bound(k, f64::NEG_INFINITY, f64::max) - lo[k]).max(1e-3));
    let square = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    let nearest = |at: [f64; 2]| {
        let distances = places.iter().map(|&place| square(place, at)).enumerate();
        distances.reduce(|best, next| if next.1 < best.1 { next } else { best })
    };
    let net = |pitch: f64| {
        let gaps = size.map(|s| (s / pitch).floor().max(1.0) as usize);
        let node = |i: usize, k: usize| lo[k] + size[k] * i as f64 / gaps[k] as f64;
        let nodes = (0..=gaps[1]).flat_map(|row| (0..=gaps[0]).map(move |column| [node(column, 0), node(row, 1)]));
        let near = |at: [f64; 2]| nearest(at).filter(|(_, distance)| *distance <= pitch * pitch / 4.0);
        let mut net: Vec<usize> = nodes.filter_map(near).map(|(site, _)| site).collect();
        net.sort_unstable();
        net.dedup();
        net
    };
    // Half the pitch at which as many fill the whole box.
    let finest = (size[0] * size[1] / count.max(1) as f64).sqrt() / 2.0;
    let coarser = std::iter::successors(Some(finest), |pitch| Some(pitch * 1.01));
    let coarser = coarser.take_while(|pitch| *pitch <= 2.0 * size[0].max(size[1]));
    coarser.map(net).find(|net| net.len() <= count).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use terrace_core::math;
    use terrace_core::random::Random;

    fn prior(amplitude: f64) -> Prior {
        Prior {
            centre: [10.0, 20.0, 5.0],
            covariance: Prior::independent([0.01, 0.02, 0.005, 0.5, 0.7, 1.0]),
            warp: [(30.0, 0.25), (120.0, 0.75)]
                .map(|(length, weight)| Candidate { length, amplitude, weight })
                .to_vec(),
        }
    }

    fn sites(count: usize) -> Vec<Site> {
        let mut random = Random::case(3);
        let site = |_| {
            let [x, y] = [0; 2].map(|_| random.range(-100.0, 100.0));
            Site { at: [x, y, 1e-3 * x * y], slope: [1e-3 * y, 1e-3 * x] }
        };
        (0..count).map(site).collect()
    }

    #[test]
    fn measuring_site_after_site_leaves_what_conditioning_on_all_at_once_does() {
        let all = sites(12);
        let (measured, targets) = all.split_at(7);
        for amplitude in [0.0, 0.1] {
            let prior = prior(amplitude);
            let mut unknown = Unknown::new(&prior, &[], measured, targets, 0.003);
            let before = unknown.models.clone();
            let noise = unknown.noise.clone();
            (0..measured.len()).for_each(|i| unknown.measure(i));
            let size = unknown.size();
            for ((before, _), (after, _)) in before.iter().zip(&unknown.models) {
                let whole = DMatrix::from_row_slice(size, size, before);
                let seen: Vec<usize> = (MOTION..MOTION + measured.len()).collect();
                let mut shown = whole.select_rows(&seen).select_columns(&seen);
                (0..seen.len()).for_each(|i| shown[(i, i)] += noise[i]);
                let cross = whole.select_columns(&seen);
                let left = &whole - &cross * shown.try_inverse().expect("regular") * cross.transpose();
                for i in 0..size {
                    let [exact, found] = [left[(i, i)], after[i * size + i]];
                    assert!((exact - found).abs() < 1e-9, "{amplitude} {i}: {exact} {found}");
                }
            }
        }
    }

    #[test]
    fn points_that_have_shown_a_level_part_count_as_measured_sites_do() {
        let level = |site: Site| Site { at: [site.at[0], site.at[1], 5.0], slope: [0.0; 2] };
        let all: Vec<Site> = sites(12).into_iter().map(level).collect();
        let (measured, targets) = all.split_at(7);
        let mut step_by_step = Unknown::new(&prior(0.1), &[], measured, targets, 0.003);
        (0..measured.len()).for_each(|i| step_by_step.measure(i));
        let shown: Vec<Observation> = measured
            .iter()
            .map(|s| Observation { at: [s.at[0], s.at[1]], height: 7.0, sigma: 0.003, aside: [0.0; 3] })
            .collect();
        let before = Unknown::new(&prior(0.1), &shown, &measured[..1], targets, 0.003);
        let cost = |variances: &[f64]| variances.iter().sum();
        let [a, b] = [step_by_step.known(&cost), before.known(&cost)];
        assert!((a.cost - b.cost).abs() < 1e-9 && (a.worst - b.worst).abs() < 1e-9, "{a:?} {b:?}");
    }

    #[test]
    fn places_that_are_chosen_cost_less_than_an_even_net_of_as_many() {
        let (measured, targets) = (sites(150), sites(150));
        // Only what lies to the right counts.
        let counts = |t: usize| if targets[t].at[0] > 20.0 { 1.0 } else { 0.01 };
        let cost = |variances: &[f64]| variances.iter().enumerate().map(|(t, v)| counts(t) * v).sum();
        let mut unknown = Unknown::new(&prior(0.1), &[], &measured, &targets, 0.003);
        let none = unknown.known(&cost);
        let chosen = unknown.choose(Vec::new(), &cost, &|count, _| count == 15);
        let known = unknown.known(&cost);
        let mut net = Unknown::new(&prior(0.1), &[], &measured, &targets, 0.003);
        even_net(&measured, Vec::new(), 15).into_iter().for_each(|site| net.measure(site));
        let of_net = net.known(&cost);
        assert_eq!(chosen.len(), 15);
        assert!(known.cost < 0.8 * of_net.cost && of_net.cost < 0.2 * none.cost, "{known:?} {of_net:?} {none:?}");
        let right = chosen.iter().filter(|&&i| measured[i].at[0] > 0.0).count();
        assert!(right >= 11, "{right}");
    }

    #[test]
    fn exchanged_places_cost_less_and_are_those_that_were_measured() {
        let (measured, targets) = (sites(80), sites(80));
        let cost = |variances: &[f64]| variances.iter().map(|v| v * v).sum();
        let nothing = Unknown::new(&prior(0.1), &[], &measured, &targets, 0.003);
        let mut unknown = nothing.clone();
        // The first twelve lie anywhere.
        let mut chosen = unknown.choose((0..12).collect(), &cost, &|count, _| count >= 12);
        let before = unknown.known(&cost).cost;
        for &site in &chosen {
            let is_free: Vec<bool> = (0..80).map(|i| i == site || !chosen.contains(&i)).collect();
            let mut without = unknown.clone();
            without.forget(site);
            assert_eq!(unknown.best(&is_free, Some(site), &cost), without.best(&is_free, None, &cost), "{site}");
        }
        unknown.exchange(&mut chosen, &cost);
        let mut again = nothing;
        chosen.iter().for_each(|&site| again.measure(site));
        let mut at_once = Unknown::new(&prior(0.1), &[], &measured, &targets, 0.003);
        at_once.measure_all(&chosen);
        let [found, exact, all] = [unknown, again, at_once].map(|unknown| unknown.known(&cost).cost);
        assert!(found < 0.5 * before && (found / exact - 1.0).abs() < 1e-5, "{before} {found} {exact}");
        assert!((all / exact - 1.0).abs() < 1e-9, "{all} {exact}");
        let mut each = chosen.clone();
        each.sort_unstable();
        each.dedup();
        assert_eq!(each.len(), 12, "{chosen:?}");
    }

    #[test]
    fn a_regular_net_has_the_corners_and_no_place_beside_the_part() {
        let node = |i: i32| [f64::from(i % 41) * 5.0, f64::from(i / 41) * 5.0];
        let site = |[x, y]: [f64; 2]| Site { at: [x, y, 0.0], slope: [0.0; 2] };
        let whole: Vec<Site> = (0..41 * 21).map(|i| site(node(i))).collect();
        let net = regular_net(&whole, 50);
        let at = |net: &[usize], sites: &[Site]| net.iter().map(|&i| sites[i].at).collect::<Vec<_>>();
        let places = at(&net, &whole);
        assert!((36..=50).contains(&net.len()), "{}", net.len());
        for corner in [[0.0, 0.0], [200.0, 0.0], [0.0, 100.0], [200.0, 100.0]] {
            assert!(places.iter().any(|p| p[..2] == corner), "{places:?}");
        }
        // A part with a window, and one that is a line.
        let is_part = |[x, y]: [f64; 2]| !(30.0..170.0).contains(&x) || !(30.0..70.0).contains(&y);
        let frame: Vec<Site> = (0..41 * 21).map(node).filter(|p| is_part(*p)).map(site).collect();
        let net = regular_net(&frame, 50);
        assert!((36..=50).contains(&net.len()), "{}", net.len());
        let line: Vec<Site> = (0..41).map(|i| site([f64::from(i) * 5.0, 7.0])).collect();
        assert!((5..=6).contains(&regular_net(&line, 6).len()), "{:?}", regular_net(&line, 6));
        assert!(regular_net(&[], 9).is_empty() && regular_net(&line, 0).is_empty());
    }

    #[test]
    fn a_wanted_deviation_decides_how_many_there_are() {
        let (measured, targets) = (sites(80), sites(80));
        let cost = |variances: &[f64]| variances.iter().map(|v| v * v).sum();
        let mut unknown = Unknown::new(&prior(0.0), &[], &measured, &targets, 0.003);
        let chosen = unknown.choose(Vec::new(), &cost, &|_, known| known.worst <= 0.004);
        assert!((4..40).contains(&chosen.len()), "{}", chosen.len());
        assert!(unknown.known(&cost).worst <= 0.004);
    }

    #[test]
    fn an_even_net_begins_at_the_rim_and_leaves_no_hole() {
        let all = sites(300);
        let net = even_net(&all, Vec::new(), 30);
        let first = all[net[0]].at;
        assert!(math::hypot(first[0], first[1]) > 110.0, "{first:?}");
        let gap = |site: &Site| {
            let to = net.iter().map(|&i| math::hypot(all[i].at[0] - site.at[0], all[i].at[1] - site.at[1]));
            to.fold(f64::INFINITY, f64::min)
        };
        assert!(all.iter().map(gap).fold(0.0, f64::max) < 45.0);
        assert_eq!(even_net(&[], Vec::new(), 3), Vec::<usize>::new());
    }
}
