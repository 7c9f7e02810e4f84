//! Which places of a part are measured.

use super::belief::Belief;
use super::sites::MarkedPlace;
use super::{Count, MOST, MOST_BY_COST, Place};
use terrace_register::{Known, Observation, Site, Unknown, even_net, regular_net};

/// Stops over those of a part that is known exactly at which more points are not worth their time.
const ENOUGH: f64 = 1.05;

/// By how many times fewer stops other places of a warped part have to be predicted to cost than a regular net. The
/// prediction does not know how well lengths and amplitudes of the warp are found from a set of points: over a rectangle
/// that is marked all over, places that it says cost 6 % fewer stops than a net cost 8 % more (36 points).
const BETTER_THAN_NET: f64 = 1.1;

/// What is to be chosen from, and for what.
pub(super) struct Question<'a> {
    pub(super) belief: &'a Belief,
    pub(super) marked: &'a [MarkedPlace],
    /// What earlier points have shown.
    pub(super) shown: &'a [Observation],
    /// Standard deviation of a point along the normal, mm.
    pub(super) sigma: f64,
    /// Places that can be measured, evenly apart.
    pub(super) spread: Vec<Place>,
    /// The fine net that they are taken from, and whether one of it can be measured.
    pub(super) fine: &'a [Place],
    pub(super) reaches: &'a dyn Fn(&Place) -> bool,
}

/// Places to be measured.
pub(super) struct Chosen {
    pub(super) places: Vec<Place>,
    /// What is known before, after them, and after an even net of as many.
    pub(super) before: Known,
    pub(super) after: Known,
    pub(super) of_net: Known,
    /// Standard deviation of the height of each marked place after them, mm.
    pub(super) deviations: Vec<f64>,
}

impl Question<'_> {
    /// How many points there are is found by adding one after another. From those, and from a regular net of as many,
    /// each is moved to where it is best; the best set is taken. On a warped part that is the net itself, where no other
    /// is clearly better.
    pub(super) fn choose(self, count: Count) -> Chosen {
        let Self { belief, spread, .. } = &self;
        let by_stops = |variances: &[f64]| belief.stops(variances);
        let wanted = if let Count::BySigma(wanted) = count { wanted } else { f64::INFINITY };
        // The fourth power of variances: their largest counts most.
        let by_worst = |variances: &[f64]| variances.iter().map(|v| (v / (wanted * wanted)).powi(4)).sum();
        let cost: terrace_register::Cost<'_> = if wanted.is_finite() { &by_worst } else { &by_stops };
        let is_enough = |n: usize, known: &Known| match count {
            Count::Of(count) => n >= count,
            Count::ByCost => known.cost <= ENOUGH || n >= MOST_BY_COST,
            Count::BySigma(wanted) => known.worst <= wanted || n >= MOST,
        };
        let (one_by_one, before) = {
            let mut unknown = self.unknown(spread);
            let before = unknown.known(&by_stops);
            (unknown.choose(Vec::new(), cost, &is_enough), before)
        };
        let count = one_by_one.len();
        let fine: Vec<Site> = self.fine.iter().map(|place| belief.site(place)).collect();
        let nodes = regular_net(&fine, count).into_iter().map(|i| &self.fine[i]).filter(|place| (self.reaches)(place));
        let mut places = spread.clone();
        let at = |places: &mut Vec<Place>, node: &Place| {
            // A node may be one of the spread places. No place is offered twice: touching it again says little more.
            places.iter().position(|place| place.at == node.at).unwrap_or_else(|| {
                places.push(node.clone());
                places.len() - 1
            })
        };
        let nodes: Vec<usize> = nodes.map(|node| at(&mut places, node)).collect();

        let nothing = self.unknown(&places);
        let sites: Vec<Site> = places.iter().map(|place| belief.site(place)).collect();
        let [spread_net, regular] = [Vec::new(), nodes.clone()].map(|begun| even_net(&sites, begun, count));
        let of_net = [&spread_net, &regular].map(|net| {
            let mut of_net = nothing.clone();
            of_net.measure_all(net);
            of_net.known(&by_stops)
        });
        let is_warped = !belief.prior.warp.is_empty() && wanted.is_infinite();
        let mut best: Option<(f64, Vec<usize>, Unknown)> = None;
        for (begun, is_moved, handicap) in [
            (regular, false, if is_warped { BETTER_THAN_NET } else { 1.0 }),
            (one_by_one.clone(), false, 1.0),
            (one_by_one, true, 1.0),
            (nodes, true, 1.0),
        ] {
            let mut after = nothing.clone();
            let mut chosen = after.choose(begun, cost, &|n, _| n >= count);
            if is_moved {
                after.exchange(&mut chosen, cost);
            }
            let known = after.known(cost);
            // What lowers the mean may raise the worst.
            let value = if known.worst > wanted { f64::INFINITY } else { known.cost / handicap };
            if best.as_ref().is_none_or(|(least, ..)| value < *least) {
                best = Some((value, chosen, after));
            }
        }
        let (_, chosen, after) = best.expect("four sets");
        Chosen {
            places: chosen.into_iter().map(|i| places[i].clone()).collect(),
            before,
            after: after.known(&by_stops),
            of_net: if of_net[0].cost <= of_net[1].cost { of_net[0] } else { of_net[1] },
            deviations: after.deviations(),
        }
    }

    fn unknown(&self, places: &[Place]) -> Unknown {
        let site = |place: &Place| self.belief.site(place);
        let sites: Vec<Site> = places.iter().map(site).collect();
        let targets: Vec<Site> = self.marked.iter().map(|m| site(&m.place)).collect();
        Unknown::new(&self.belief.prior, self.shown, &sites, &targets, self.sigma)
    }
}
