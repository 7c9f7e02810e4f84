//! The fixtures as the page draws them: their facets, or boxes over those that have very many.

use serde::Serialize;

use super::pack::Data;
use terrace_core::geom::NM_PER_MM;
use terrace_plan::fixtures::Fixture;

/// Of a fixture with more facets boxes are drawn.
const MOST_FACETS: usize = 20_000;

/// A fixture in the head of the page.
#[derive(Serialize)]
pub(super) struct FixtureHead<'a> {
    name: &'a str,
    /// The set-ups in which it is there; empty: all.
    setups: Vec<u32>,
    /// How many triangles of the element are its own.
    triangles: usize,
}

/// The head of each fixture, and the corners of all their triangles, mm: x of all, then y, then z.
pub(super) fn packed(fixtures: &[Fixture]) -> (Vec<FixtureHead<'_>>, Option<String>) {
    let mut all: Vec<[[f64; 3]; 3]> = Vec::new();
    let mut heads = Vec::new();
    for fixture in fixtures {
        let before = all.len();
        if fixture.facets.len() > MOST_FACETS {
            all.extend(boxes(fixture));
        } else {
            all.extend(&fixture.facets);
        }
        let setups = fixture.setups.iter().map(|setup| setup.number()).collect();
        heads.push(FixtureHead { name: &fixture.name, setups, triangles: all.len() - before });
    }
    let element = (!all.is_empty()).then(|| {
        let mut data = Data::default();
        for k in 0..3 {
            data.f32(all.iter().flatten().map(|p| (p[k] / NM_PER_MM) as f32));
        }
        data.element("fixtures")
    });
    (heads, element)
}

/// The tops of boxes over a fixture, and what of their sides rises above its lowest place.
fn boxes(fixture: &Fixture) -> Vec<[[f64; 3]; 3]> {
    let [[.., low], _] = fixture.ends();
    let mut out = Vec::new();
    for (area, top) in fixture.tiles() {
        let (lo, hi) = (area.lo, area.hi);
        let corners = [[lo.x, lo.y], [hi.x, lo.y], [hi.x, hi.y], [lo.x, hi.y]];
        let at = |i: usize, z: f64| [corners[i % 4][0] as f64, corners[i % 4][1] as f64, z];
        let top = top.f64();
        out.extend([[at(0, top), at(1, top), at(2, top)], [at(0, top), at(2, top), at(3, top)]]);
        for i in 0..4 {
            out.extend([[at(i, low), at(i + 1, low), at(i + 1, top)], [at(i, low), at(i + 1, top), at(i, top)]]);
        }
    }
    out
}
