//! Polygons of mesh files: triangles by ear cutting on the plane of their Newell normal; every corner stays a corner.

use geo::{LineString, Polygon, TriangulateEarcut};

use super::facets::Facets;

/// Most corners of one polygon: ear cutting can take time by their square (seconds at this number).
pub(super) const MAX_CORNERS: usize = 32_768;

/// Hands on the triangles of a polygon; false where they cannot be trusted to cover it.
pub(super) fn triangulate(polygon: &[[f64; 3]], facets: &mut Facets<'_>) -> bool {
    if let &[a, b, c] = polygon {
        facets.push([a, b, c]);
        return true;
    }
    let normal = newell_normal(polygon);
    // The plane's own axes would round; dropping the normal's largest axis keeps coordinates exact.
    let drop = (0..3).fold(0, |m, k| if normal[k].abs() > normal[m].abs() { k } else { m });
    let (mut u, mut v) = ((drop + 1) % 3, (drop + 2) % 3);
    if normal[drop] < 0.0 {
        std::mem::swap(&mut u, &mut v);
    }
    let outline = LineString::from_iter(polygon.iter().chain(polygon.first()).map(|p| (p[u], p[v])));
    let cut = Polygon::new(outline, vec![]).earcut_triangles_raw().triangle_indices;
    let corners = |t: &[usize; 3]| Some([*polygon.get(t[0])?, *polygon.get(t[1])?, *polygon.get(t[2])?]);
    let triangles = || cut.as_chunks().0.iter().filter_map(corners);
    let covered: f64 = triangles().map(|t| double_area(t, u, v).abs()).sum();
    if cut.is_empty() || covered == 0.0 {
        // No area in any plane: handed on as it is, the mesh counts and drops such facets.
        polygon.windows(2).skip(1).for_each(|e| facets.push([polygon[0], e[0], e[1]]));
        return normal == [0.0; 3];
    }
    triangles().for_each(|t| facets.push(t));
    // Twice the area both ways; sums of n terms, each rounded.
    (covered - normal[drop].abs()).abs() <= 4.0 * f64::EPSILON * polygon.len() as f64 * covered.max(normal[drop].abs())
}

/// Twice the signed area of a triangle in the plane of the axes u and v.
fn double_area([a, b, c]: [[f64; 3]; 3], u: usize, v: usize) -> f64 {
    (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u])
}

/// The normal of a polygon that need not be flat; its length is twice the area.
fn newell_normal(polygon: &[[f64; 3]]) -> [f64; 3] {
    let mut n = [0.0; 3];
    // Taken from the first corner, so that a place far from the origin costs no digits.
    let from = |p: &[f64; 3], k: usize| p[k] - polygon[0][k];
    for (a, b) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
        for (k, n) in n.iter_mut().enumerate() {
            let (u, v) = ((k + 1) % 3, (k + 2) % 3);
            *n += from(a, u) * from(b, v) - from(a, v) * from(b, u);
        }
    }
    n
}
