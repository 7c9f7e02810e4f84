//! Standstills of the stage: the blocks that a zoom optic serves from one position, and the plane that the stage sets.
//!
//! The optic shifts the focal plane up or down by as much as half its range. Blocks over one place whose focal planes
//! lie within that range share a standstill; taken from below, these are the fewest. A standstill leaves an interval of
//! planes from which the optic reaches all its blocks. Of all standstills together the fewest planes are set that
//! have one in every interval, so that the stage changes z as rarely as it can. Without an optic every block is a
//! standstill of its own and its plane is its focal plane.

use super::setups::CellId;
use crate::partition::Lattice;
use terrace_core::geom::{Nm, P2, Turned};
use terrace_core::machine::TiltAngles;

/// Where a block is marked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockPlace {
    pub(super) cell: CellId,
    pub(super) tilt: TiltAngles,
    pub(super) centre: P2<Turned>,
    /// Height of its focal plane.
    pub(super) lpfl: Nm,
}

/// What is marked while the stage stands still.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Standstill {
    /// Indices of the blocks, by rising focal plane.
    pub(super) members: Vec<usize>,
    /// Height of the focal plane with the optic at rest.
    pub(super) plane: Nm,
}

/// A standstill that is not given a plane yet: the blocks of one place that the optic reaches from one plane, by rising
/// focal plane.
struct SharedPlace(Vec<usize>);

impl SharedPlace {
    /// The lowest and the highest plane from which the optic reaches all blocks, within what is `allowed` if it can.
    fn planes(&self, places: &[BlockPlace], reach: Nm, allowed: [Nm; 2]) -> [Nm; 2] {
        let [lowest, highest] = [self.0[0], self.0[self.0.len() - 1]].map(|i| places[i].lpfl);
        let reached = [highest - reach, lowest + reach];
        let kept = [reached[0].max(allowed[0]), reached[1].min(allowed[1])];
        if kept[0] <= kept[1] { kept } else { reached }
    }
}

/// Whether blocks may share a standstill.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sharing {
    /// Where the optic's range permits.
    Allowed,
    /// Never: levels have to come one after another.
    Forbidden,
}

/// The standstills of blocks at `places`. The optic shifts the focal plane by `reach` at most, which is a whole number
/// of steps of the lattice. `allowed` gives the lowest and the highest plane at which the head may stand over the place
/// of a block, which is kept where the optic's range permits.
pub(super) fn standstills(
    places: &[BlockPlace],
    lattice: &Lattice,
    reach: Nm,
    sharing: Sharing,
    allowed: impl Fn(usize) -> [Nm; 2],
) -> Vec<Standstill> {
    if reach == Nm(0) {
        let alone = |(i, place): (usize, &BlockPlace)| Standstill { members: vec![i], plane: place.lpfl };
        return places.iter().enumerate().map(alone).collect();
    }
    let mut order: Vec<usize> = (0..places.len()).collect();
    let over = |i: usize| (places[i].cell, places[i].tilt, places[i].centre);
    order.sort_by_key(|&i| (over(i), places[i].lpfl));
    let mut groups: Vec<SharedPlace> = Vec::new();
    // From below: a block that its group cannot take opens the next one, so there are as few as can be.
    for i in order {
        let takes = |SharedPlace(members): &SharedPlace| {
            let first = members[0];
            sharing == Sharing::Allowed && over(first) == over(i) && places[i].lpfl - places[first].lpfl <= reach * 2
        };
        match groups.last_mut() {
            Some(last) if takes(last) => last.0.push(i),
            _ => groups.push(SharedPlace(vec![i])),
        }
    }
    let intervals: Vec<[Nm; 2]> = groups.iter().map(|group| group.planes(places, reach, allowed(group.0[0]))).collect();
    let planes = planes(&intervals, lattice);
    groups.into_iter().zip(planes).map(|(SharedPlace(members), plane)| Standstill { members, plane }).collect()
}

/// A plane in every interval, of the fewest different ones: each in the middle of what its intervals have in common.
fn planes(intervals: &[[Nm; 2]], lattice: &Lattice) -> Vec<Nm> {
    let mut by_end: Vec<usize> = (0..intervals.len()).collect();
    by_end.sort_by_key(|&i| (intervals[i][1], intervals[i][0], i));
    let mut out = vec![Nm(0); intervals.len()];
    let mut rest = by_end.as_slice();
    while let Some(&first) = rest.first() {
        // All intervals that hold the lowest upper end have a plane in common, and no plane serves that one and more.
        let end = intervals[first][1];
        let common: Vec<usize> = rest.iter().copied().take_while(|&i| intervals[i][0] <= end).collect();
        let begin = common.iter().map(|&i| intervals[i][0]).max().unwrap_or(end);
        let plane = lattice.floor((begin + end).f64() / 2.0).max(begin);
        common.iter().for_each(|&i| out[i] = plane);
        rest = &rest[common.len()..];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATTICE: Lattice = Lattice { depth: Nm(70_000), step: Nm(100), offset: Nm(0), hysteresis: Nm(0) };

    fn place(x: i64, lpfl: i64) -> BlockPlace {
        let cell = CellId::default();
        BlockPlace { cell, tilt: TiltAngles::UPRIGHT, centre: P2::new(x, 0), lpfl: Nm(lpfl) }
    }

    const ANY: [Nm; 2] = [Nm(i64::MIN / 4), Nm(i64::MAX / 4)];

    #[test]
    fn without_an_optic_every_block_is_its_own_standstill_on_its_focal_plane() {
        let places = [place(0, 500), place(0, 500), place(1, 900)];
        let found = standstills(&places, &LATTICE, Nm(0), Sharing::Allowed, |_| ANY);
        let wanted = [(0, 500), (1, 500), (2, 900)];
        assert_eq!(found, wanted.map(|(i, plane)| Standstill { members: vec![i], plane: Nm(plane) }));
    }

    #[test]
    fn blocks_over_one_place_share_the_fewest_standstills_and_these_the_fewest_planes() {
        let mut random = terrace_core::random::Random::new(5);
        for _ in 0..500 {
            let reach = Nm(random.between(1, 30) * 100);
            let places: Vec<BlockPlace> = (0..random.between(1, 40))
                .map(|_| place(random.between(0, 4), random.between(-50, 50) * 100))
                .collect();
            let found = standstills(&places, &LATTICE, reach, Sharing::Allowed, |_| ANY);
            let mut seen: Vec<usize> = found.iter().flat_map(|s| s.members.clone()).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..places.len()).collect::<Vec<_>>());
            for s in &found {
                assert_eq!(s.plane % Nm(100), Nm(0));
                assert!(s.members.iter().all(|&i| (places[i].lpfl - s.plane).abs() <= reach));
                assert!(s.members.iter().all(|&i| places[i].centre == places[s.members[0]].centre));
            }
            for x in 0..5 {
                let of = |i: usize| places[i].centre.x == x;
                let mut heights: Vec<Nm> = (0..places.len()).filter(|&i| of(i)).map(|i| places[i].lpfl).collect();
                heights.sort_unstable();
                // Heights more than the range apart cannot share: as many of them as there are standstills.
                let (mut apart, mut last) = (0, None);
                for z in heights {
                    if last.is_none_or(|last: Nm| z - last > reach * 2) {
                        (apart, last) = (apart + 1, Some(z));
                    }
                }
                assert_eq!(found.iter().filter(|s| of(s.members[0])).count(), apart);
            }
        }
    }

    #[test]
    fn the_fewest_planes_are_set_in_any_list_of_intervals() {
        let mut random = terrace_core::random::Random::new(6);
        for _ in 0..300 {
            let intervals: Vec<[Nm; 2]> = (0..random.between(1, 8))
                .map(|_| {
                    let lo = random.between(0, 12);
                    [Nm(lo * 100), Nm((lo + random.between(0, 6)) * 100)]
                })
                .collect();
            let set = planes(&intervals, &LATTICE);
            assert!(set.iter().zip(&intervals).all(|(z, [lo, hi])| lo <= z && z <= hi), "{intervals:?} {set:?}");
            let mut different = set;
            different.sort_unstable();
            different.dedup();
            // Every choice of planes among the 19 possible ones that serves all intervals has at least as many.
            let serves = |chosen: u32| {
                let is_in = |[lo, hi]: &[Nm; 2]| (lo.0 / 100..=hi.0 / 100).any(|k| chosen & (1 << k) != 0);
                intervals.iter().all(is_in)
            };
            let fewest = (1u32..1 << 19).filter(|c| c.count_ones() < different.len() as u32).any(serves);
            assert!(!fewest, "{intervals:?} {different:?}");
        }
    }

    #[test]
    fn the_plane_keeps_to_what_is_allowed_where_the_optic_reaches_it() {
        let places = [place(0, 0), place(0, 2_000)];
        let plane = |allowed: [i64; 2]| {
            standstills(&places, &LATTICE, Nm(2_000), Sharing::Allowed, |_| allowed.map(Nm))[0].plane
        };
        assert_eq!(plane([-9_000, 9_000]), Nm(1_000));
        assert_eq!(plane([1_600, 9_000]), Nm(1_800));
        assert_eq!(plane([-9_000, 400]), Nm(200));
        assert_eq!(plane([5_000, 9_000]), Nm(1_000));
    }

    #[test]
    fn blocks_in_a_given_order_of_heights_do_not_share() {
        let places = [place(0, 0), place(0, 2_000), place(1, 100)];
        let found = standstills(&places, &LATTICE, Nm(2_000), Sharing::Forbidden, |_| ANY);
        assert!(found.len() == 3 && found.iter().all(|s| s.plane == found[0].plane));
    }
}
