//! Point clouds: XYZ and CSV text, meshed by Delaunay triangulation in plan.
//!
//! Consumes rows of three or more columns separated by blanks, tabs, commas or semicolons (one kind per
//! file), and what programs write before them ([`mod@rows`]); columns named x, y and z are found by name
//! ([`names`]). Points are put on the nanometre grid in x and y first: the triangulation is exact, equal for
//! any order of the points, and where several points share a place the highest counts.
//!
//! Triangles with a long edge in plan are holes, not surface. Needs about 0.2 kB per point.

mod cloud;
mod columns;
mod layout;
mod names;
mod rows;

use std::path::Path;
use terrace_core::math;

use rows::Rows;
use spade::{DelaunayTriangulation, HasPosition, InsertionError, Point2, Triangulation};

use super::facets::{Facets, Unit};
use super::lines::{Lines, place};
use super::{Content, Options};
use terrace_core::diag::{Diag, Error, memory};
use terrace_core::geom::{Box2, P2, Pose, orient};

/// Most points that are read (4 GB of triangulation).
const MAX_POINTS: usize = 20_000_000;
/// Longest edge in units of the median of the triangles' shortest edges, where the job states none.
const EDGE_FACTOR: f64 = 8.0;

/// Reads a point cloud; `unit` is what its numbers are, of the options the longest edge in plan and the pose count.
pub(crate) fn read(
    lines: Lines,
    path: &Path,
    unit: Unit,
    &Options { max_edge_mm, pose, .. }: &Options,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    let points = unique(path, rows(lines, path, unit, pose, notes)?, notes);
    let Some(third) = off_line(&points) else {
        let text = format!("the {} points lie on one line in plan: that is not a surface", points.len());
        return Err(no_surface(path, text, "check which columns are x, y and z").into());
    };
    let mesh = delaunay(points, third)
        .map_err(|e| Diag::bug("points-delaunay", format!("the triangulation refused a point: {e}")).at(place(path)))?;
    let max_edge = max_edge_mm.unwrap_or_else(|| EDGE_FACTOR * median_short_edge(&mesh));
    let mut facets = Facets::new(path, Unit::mm(1.0), sink);
    for face in mesh.inner_faces() {
        let corners = face.vertices().map(|v| v.data().mm());
        if edges(&corners)[2] <= max_edge {
            facets.push(corners);
        }
    }
    let all = mesh.num_inner_faces();
    let left = facets.count();
    if left == 0 {
        let text = format!("every triangle between the points has an edge longer than {max_edge:.6} mm");
        return Err(no_surface(path, text, "raise max_edge in [surface]").into());
    }
    // Slivers along the border are always among them.
    if max_edge_mm.is_none() && all - left > all / 10 {
        let text = format!("{} of {all} triangles have an edge longer than {max_edge:.6} mm and are holes", all - left);
        let d = Diag::warning("points-holes", text).at(place(path));
        notes.push(d.hint("state max_edge in [surface] if the points are spaced more unevenly than 1 : 8"));
    }
    facets.finish(notes)
}

fn no_surface(path: &Path, text: String, hint: &str) -> Diag {
    Diag::input("points-no-surface", text).at(place(path)).hint(hint)
}

/// A point on the grid in x and y, z in mm.
#[derive(Clone, Copy, Debug)]
struct Point {
    at: P2,
    z: f64,
}

/// A point that the triangulation sees from the cloud's lower corner. Its coordinates are integers
/// below 2^33: spade refuses only tiny fractions and huge numbers.
struct Node {
    point: Point,
    corner: P2,
}

impl Node {
    fn mm(&self) -> [f64; 3] {
        let [x, y] = self.point.at.mm();
        [x, y, self.point.z]
    }
}

impl HasPosition for Node {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new((self.point.at.x - self.corner.x) as f64, (self.point.at.y - self.corner.y) as f64)
    }
}

/// The first point that does not lie on the line of the first two.
fn off_line(points: &[Point]) -> Option<usize> {
    let (a, b) = (points.first()?.at, points.get(1)?.at);
    points.iter().position(|p| orient(a, b, p.at) != 0.0)
}

/// The triangulation of points without duplicates, `third` off the line of the first two.
///
/// Points enter in rounds, each about twice as large as all before and filled at random, along a Hilbert
/// curve within a round: as fast as loading in bulk, and for any cloud (bulk loading took minutes for
/// 100,000 points along a parabola). A proper triangle enters first, since a line alone grows slowly.
fn delaunay(mut points: Vec<Point>, third: usize) -> Result<DelaunayTriangulation<Node>, InsertionError> {
    let box2 = points.iter().fold(Box2::EMPTY, |mut b, p| {
        b.add(p.at);
        b
    });
    let corner = box2.lo;
    let cell = (box2.size()[0].max(box2.size()[1]).0 >> 16) + 1;
    points.swap(2, third);
    let mut order: Vec<(u32, u32, Point)> = Vec::with_capacity(points.len());
    for (i, p) in points.into_iter().enumerate() {
        let round = if i < 3 { 0 } else { 64 - scattered(i as u64).trailing_zeros() };
        order.push((round, hilbert((p.at.x - corner.x) / cell, (p.at.y - corner.y) / cell), p));
    }
    order.sort_unstable_by_key(|&(round, along, p)| (round, along, p.at));
    let mut mesh = DelaunayTriangulation::new();
    let mut near = None;
    for (_, _, point) in order {
        let node = Node { point, corner };
        near = Some(match near {
            Some(hint) => mesh.insert_with_hint(node, hint)?,
            None => mesh.insert(node)?,
        });
    }
    Ok(mesh)
}

/// A number whose bits look random: the finaliser of splitmix64.
fn scattered(i: u64) -> u64 {
    let i = (i ^ (i >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let i = (i ^ (i >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    i ^ (i >> 31)
}

/// The place of a cell, both coordinates below 2^16, along the Hilbert curve through all cells.
fn hilbert(mut x: i64, mut y: i64) -> u32 {
    let mut along = 0;
    for bit in (0..16).rev() {
        let (right, up) = (x >> bit & 1, y >> bit & 1);
        along = along << 2 | ((3 * right) ^ up) as u32;
        if up == 0 {
            if right == 1 {
                (x, y) = (0xffff - x, 0xffff - y);
            }
            std::mem::swap(&mut x, &mut y);
        }
    }
    along
}

/// The edges of a triangle in plan, the shortest first.
fn edges(corners: &[[f64; 3]; 3]) -> [f64; 3] {
    let length = |i: usize, j: usize| math::hypot(corners[i][0] - corners[j][0], corners[i][1] - corners[j][1]);
    let mut e = [length(0, 1), length(1, 2), length(2, 0)];
    e.sort_unstable_by(f64::total_cmp);
    e
}

/// The median over all triangles of their shortest edge: the typical spacing, in mm.
fn median_short_edge(mesh: &DelaunayTriangulation<Node>) -> f64 {
    let mut short: Vec<f64> = mesh.inner_faces().map(|f| edges(&f.vertices().map(|v| v.data().mm()))[0]).collect();
    let middle = short.len() / 2;
    if short.is_empty() { 0.0 } else { *short.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// Sorts the points and keeps the highest of those that share a place.
fn unique(path: &Path, mut points: Vec<Point>, notes: &mut Vec<Diag>) -> Vec<Point> {
    let all = points.len();
    points.sort_unstable_by(|a, b| a.at.cmp(&b.at).then(b.z.total_cmp(&a.z)));
    points.dedup_by(|next, kept| next.at == kept.at);
    if points.len() < all {
        let text = format!("{} points share x and y with a higher one and were left out", all - points.len());
        let d = Diag::warning("points-duplicate", text).at(place(path));
        notes.push(d.hint("the lens sees the highest; thin the cloud to avoid this warning"));
    }
    points
}

/// The points of the file, in its order.
fn rows(
    mut lines: Lines,
    path: &Path,
    unit: Unit,
    pose: Option<Pose>,
    notes: &mut Vec<Diag>,
) -> Result<Vec<Point>, Error> {
    // Three numbers a line, some 24 bytes.
    memory::ask("the cloud", super::POINT_BYTES * (lines.length() / 24)).map_err(|d| d.at(place(path)))?;
    let mut rows = Rows::new(path, unit, pose);
    while lines.advance()? {
        rows.line(&lines, notes)?;
    }
    rows.finish(notes)
}

#[cfg(test)]
mod tests {
    use super::*;

    type Facet = [[f64; 3]; 3];

    fn read_text(text: &str, max_edge_mm: Option<f64>) -> (Result<Content, Error>, Vec<Facet>, Vec<Diag>) {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.csv");
        std::fs::write(&path, text).expect("written");
        let mut got = vec![];
        let mut notes = vec![];
        let lines = Lines::open(&path, "a point cloud").expect("text");
        let result =
            read(lines, &path, Unit::mm(1.0), &Options { max_edge_mm, ..Options::default() }, &mut notes, &mut |f| {
                got.push(f)
            });
        (result, got, notes)
    }

    /// Area in plan, and whether all facets turn the same way.
    fn area(facets: &[Facet]) -> f64 {
        let one = |[a, b, c]: &Facet| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert!(facets.iter().all(|f| one(f) > 0.0), "no facet is turned or without area");
        facets.iter().map(one).sum::<f64>() / 2.0
    }

    /// A jittered grid of 1 mm spacing, far from the origin; where `keep` says so.
    fn grid(n: usize, keep: impl Fn(usize, usize) -> bool) -> Vec<[f64; 3]> {
        let mut out = vec![];
        for i in 0..n {
            for j in 0..n {
                let jitter = (i * 7919 + j * 104_729) % 97;
                if keep(i, j) {
                    out.push([1000.0 + i as f64, -2000.0 + j as f64, jitter as f64 * 1e-3]);
                }
            }
        }
        out
    }

    fn text_of(points: &[[f64; 3]]) -> String {
        points.iter().map(|p| format!("{:?} {:?} {:?}\n", p[0], p[1], p[2])).collect()
    }

    #[test]
    fn the_whole_cloud_is_covered_once_whatever_the_order_of_its_points() {
        let mut points = grid(20, |_, _| true);
        let (result, first, notes) = read_text(&text_of(&points), None);
        assert!(matches!(result, Ok(Content::Facets(n)) if n == 2 * 19 * 19) && notes.is_empty());
        assert!((area(&first) - 361.0).abs() < 1e-9);
        for f in first.iter().flatten() {
            assert!(points.contains(f), "corners are points of the file");
        }
        points.reverse();
        points.rotate_left(133);
        assert_eq!(read_text(&text_of(&points), None).1, first);
    }

    #[test]
    fn the_curve_visits_every_cell_and_steps_to_neighbours() {
        // The lowest 32 x 32 cells are the start of the curve.
        let mut at: Vec<(u32, [i64; 2])> =
            (0..1024).map(|i| [i % 32, i / 32]).map(|c| (hilbert(c[0], c[1]), c)).collect();
        at.sort_unstable();
        for (k, w) in at.windows(2).enumerate() {
            assert_eq!((w[0].0 as usize, w[1].0 as usize), (k, k + 1));
            assert_eq!((w[0].1[0] - w[1].1[0]).abs() + (w[0].1[1] - w[1].1[1]).abs(), 1);
        }
    }

    #[test]
    fn collinear_clouds_take_linear_time() {
        let line = |y: f64| (0..20_000).map(move |i| [i as f64 * 0.01, y * (i as f64 * 0.01).powi(2), 0.0]);
        let mut stray: Vec<[f64; 3]> = line(0.0).collect();
        stray.push([5.0, 1.0, 0.0]);
        let start = std::time::Instant::now();
        assert!(matches!(read_text(&text_of(&stray), Some(1e3)).0, Ok(Content::Facets(19_999))));
        assert!(matches!(
            read_text(&text_of(&line(1e-2).collect::<Vec<_>>()), Some(1e3)).0,
            Ok(Content::Facets(19_998))
        ));
        assert!(start.elapsed().as_secs() < 2, "{:?}", start.elapsed());
    }

    #[test]
    fn long_edges_are_holes() {
        let hole = |i: usize, j: usize| !((6..=35).contains(&i) && (6..=35).contains(&j));
        let text = text_of(&grid(42, hole));
        let notes = read_text(&text, None).2;
        assert_eq!(notes.len(), 0, "{notes:?}");
        // A hole 31 mm wide at a spacing of 1 mm: open by default but for its corners, where edges of
        // at most 8 mm cut off up to 16 mm² each; closed on demand.
        let open = area(&read_text(&text, None).1);
        assert!((720.0..=784.0).contains(&open), "{open} of 1681 mm² less 961");
        assert!((area(&read_text(&text, Some(60.0)).1) - 1681.0).abs() < 1e-9);
        let uneven = "0 0 0\n0.1 0 0\n0.2 0 0\n0 0.1 0\n0.1 0.1 0\n0.2 0.1 0\n0 5 0\n0.2 5 0\n";
        assert_eq!(read_text(uneven, None).2[0].code, "points-holes");
        assert_eq!(read_text(&text, Some(0.5)).0.err().expect("no facet").diags()[0].code, "points-no-surface");
    }

    #[test]
    fn highest_of_points_with_equal_xy_is_kept() {
        let (_, got, notes) = read_text("0 0 1\n5 0 2\n0 5 3\n0.0000001 0 7\n0 0 -1\n", None);
        assert_eq!(got.len(), 1);
        assert!(got[0].contains(&[0.0, 0.0, 7.0]), "{got:?}");
        assert_eq!(notes[0].code, "points-duplicate");
        assert!(notes[0].message.starts_with("2 points"), "{}", notes[0].message);
    }

    #[test]
    fn separators_headers_and_extra_columns_are_understood() {
        let want = [[1.5, 2.0, 3.0], [11.0, 2.0, 3.0], [1.0, 12.0, -4.0]];
        for text in [
            "1.5 2 3\n11 2 3\n1 12 -4\n",
            "# made by hand\r\n\r\n1.5\t2  3\r\n11\t2\t3\r\n1\t12\t-4",
            "x,y,z\n1.5, 2, 3\n11,2,3\n1,12,-4\n",
            "Point ID\tX\tY\tZ\nP 1\t1.5\t2\t3\nP 2\t11\t2\t3\nP 3\t1\t12\t-4\n",
            "1.5\t\t2\t\t3\n11\t2\t3\n1\t12\t-4",
            "\"Z\";\"id\";\"X\";\"Y\"\n3;a;1.5;2\n3;b;11;2\n-4;c;1;12\n",
            "1.5;2;3;\n11;2;3;\n1;12;-4;\n",
            "x,y,z\n1.5,2,3,\n11,2,3,\n1,12,-4,\n",
            "x;y;z;\n1.5;2;3\n11;2;3\n1;12;-4\n",
            "sep=;\nx;y;z\n1.5;2;3\n11;2;3\n1;12;-4\n",
            "\"x\",\"y\",\"z\"\n\"1.5\",\"2\",\"3\"\n\"11\",\"2\",\"3\"\n\"1\",\"12\",\"-4\"\n",
            "# Y X Z\n2 1.5 3\n2 11 3\n12 1 -4\n",
            "//Y X Z\n2 1.5 3\n2 11 3\n// between\n12 1 -4\n",
            "% y x z\n2 1.5 3\n2 11 3\n% between\n12 1 -4\n",
            "; y x z\n2 1.5 3\n2 11 3\n12 1 -4\n",
            "# y x z\n# made by hand\n2 1.5 3 7\n2 11 3 7\n12 1 -4 7\n",
            "y_mm x_mm z_mm\n2 1.5 3\n2 11 3\n12 1 -4\n",
            "Y [mm] X [mm] Z [mm]\n2 1.5 3\n2 11 3\n12 1 -4\n",
            "Point,y [mm],x [mm],z [mm]\n1,2,1.5,3\n2,2,11,3\n3,12,1,-4\n",
            ",x,y,z\n0,1.5,2,3\n1,11,2,3\n2,1,12,-4\n",
            "# x, y, z\n1.5 2 3\n11 2 3\n1 12 -4\n",
            "3\n1.5 2 3\n11 2 3\n1 12 -4\n",
            "//X Y Z\n3\n1.5 2 3\n11 2 3\n1 12 -4\n",
            "1\n1.5 2 3\n2\n11 2 3\n1 12 -4\n",
            "1.5 2 3D0\n11 2 3\n1 12 -4\n",
        ] {
            let (result, got, notes) = read_text(text, None);
            assert!(matches!(result, Ok(Content::Facets(1))) && notes.is_empty(), "{text}: {notes:?}");
            assert!(want.iter().all(|p| got[0].contains(p)), "{text}: {got:?}");
        }
        for text in [
            "easting northing height\n1.5 2 3\n11 2 3\n1 12 -4\n",
            "North East Elev\n2 1.5 3\n2 11 3\n12 1 -4\n",
            "P,N,E,Z,D\n1,2,1.5,3,a\n2,2,11,3,b\n3,12,1,-4,c\n",
            "a b c\n1.5 2 3\n11 2 3\n1 12 -4\n",
        ] {
            let (_, got, notes) = read_text(text, None);
            assert!(want.iter().all(|p| got[0].contains(p)), "{text}: {got:?}");
            assert_eq!(notes.iter().map(|d| d.code).collect::<Vec<_>>(), ["points-names"], "{text}");
        }
        for (text, code) in [
            ("x_in y_in z_in\n1 2 3\n11 2 3\n1 12 -4\n", "surface-unit-named"),
            ("# units: m\n1 2 3\n11 2 3\n1 12 -4\n", "surface-unit-named"),
            ("4\n1 2 3\n11 2 3\n1 12 -4\n", "points-count"),
        ] {
            assert_eq!(read_text(text, None).2.iter().map(|d| d.code).collect::<Vec<_>>(), [code], "{text}");
        }
        // Whole numbers that grow, but no column of numbers of points.
        let (result, _, notes) = read_text("0 0 0 7\n1 5 0 7\n2 0 5 7\n3 5 5 7\n3 9 9 7\n", None);
        assert!(result.is_ok() && notes.is_empty());
    }

    #[test]
    fn a_scan_goes_through_its_matrix() {
        let head = "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
        // A quarter turn about z, and a shift.
        let text = format!("{head}0 1 0 0\n-1 0 0 0\n0 0 1 0\n100 200 300 1\n");
        let points = "1 2 3 0.5\n0 0 0 0.5\n5 2 3 0.5\n1 7 4 0.5\n";
        let (result, got, notes) = read_text(&format!("{text}{points}"), None);
        assert!(matches!(result, Ok(Content::Facets(1))), "{:?}", result.err());
        assert!([[98.0, 201.0, 303.0], [98.0, 205.0, 303.0], [93.0, 201.0, 304.0]].iter().all(|p| got[0].contains(p)));
        assert_eq!(notes.iter().map(|d| d.code).collect::<Vec<_>>(), ["points-no-data"]);
        let far = points.replace("1 2 3", "1 1 4").replace("5 2 3", "5 3 3").replace("1 7", "2 9");
        let (result, _, notes) = read_text(&format!("{text}{points}{text}{far}"), None);
        assert!(result.is_ok() && notes.len() == 1, "{:?} {notes:?}", result.err());
        let (_, _, notes) = read_text(&format!("{text}1 2 3 0\n5 2 3 0\n1 7 4 0\n"), None);
        assert_eq!(notes.iter().map(|d| d.code).collect::<Vec<_>>(), ["points-count"]);
    }

    #[test]
    fn rows_of_zeros_are_no_points_where_others_lie_elsewhere() {
        let points = "9 9 9\n19 9 9\n9 19 9\n19 19 9\n";
        for (text, facets, code) in [
            (format!("{points}0 0 0\n"), 3, None),
            (format!("{points}0 0 0\n0 0 0\n"), 2, Some("points-no-data")),
            (format!("{points}-1 -1 -1\n0 0 0\n0 0 0\n"), 6, Some("points-duplicate")),
            (format!("{points}-1 -1 -1\n{}", "0 0 0\n".repeat(10)), 4, Some("points-no-data")),
            ("0 0 0\n9 0 0\n0 9 0\n".to_owned(), 1, None),
            (format!("{points}14 14 -9999\n14 12 -9999.0\n"), 2, Some("points-no-data")),
            (format!("{points}14 12 -999.9\n14 14 -999.9\n"), 2, Some("points-no-data")),
            (format!("{points}14 14 -999\n"), 2, Some("points-no-data")),
            ("0 0 -1500\n9 0 0\n9 9 0\n0 9 -1500\n4 4 -999\n".to_owned(), 4, None),
            (points.replace("9\n", "-999\n"), 2, None),
        ] {
            let (result, _, notes) = read_text(&text, Some(100.0));
            assert_eq!(notes.iter().map(|d| d.code).collect::<Vec<_>>(), Vec::from_iter(code), "{text}");
            assert!(matches!(result, Ok(Content::Facets(n)) if n.abs_diff(facets) <= 2), "{text}");
        }
    }

    #[test]
    fn faults_are_named_by_line() {
        for (text, code, say) in [
            ("0 0 0\n1 0\n", "points-columns", ":2: this row has 2 columns, the first one has 3"),
            ("3\nmolecule\nC 0 0 0\n", "points-columns", ":2: a point has three numbers, this row has 1"),
            ("3\n4\n0 0 0\n1 0 0\n", "points-no-surface", "no points"),
            ("x;note\n0;0;\n", "points-columns", "a point has three numbers, this row has 2"),
            ("3\n4\n0 0 0\n1 0\n", "points-columns", ":4: two rows of one number begin a PTX scan, whose row 4 has 3"),
            ("4\n0 0 0\n1 0 0\n0 1 0\n7\n1 1 0\n", "points-columns", ":5: this row has 1 columns"),
            ("x,y,z,i\n0,0,0\n", "points-columns", ":2: this row has 3 columns, the first one has 4"),
            ("Point,a,b,c\n1,0,0,0\n", "points-names", ":1: the columns are named Point, a, b, c, which does not say"),
            ("# the order is y, x, z\n1 0 0\n", "points-names", ":1: a comment has x, y and z in another order"),
            ("x [mm],y [mm],z [um]\n1,0,0\n", "points-names", ":1: the columns x [mm], y [mm], z [um] have different"),
            (
                "1,0,0,0\n2,5,0,0\n3,0,5,0\n4,5,5,0\n5,9,9,0\n",
                "points-id",
                "the first of 4 columns counts the points (1, ...)",
            ),
            ("7 .5 0 0\n9 5 0 0\n12 0 5 0\n40 5 5 0\n41 9 9 0\n", "points-id", "(7, ...)"),
            ("0 0 0\n1 0 0\nfoo bar baz\n", "surface-number", ":3: \"foo\" is not a number"),
            ("0,5;1;2\n", "surface-number", ":1: coordinate \"0,5\" has a decimal comma"),
            ("0,5\t1\t2\n", "surface-number", ":1: coordinate \"0,5\" has a decimal comma"),
            ("0,5 1,5 2,5\n", "surface-number", ":1: coordinate \"5 1\" has a decimal comma"),
            ("0,,1\n", "surface-number", ":1: \"\" is not a number"),
            (
                "0 0 0\n9 0 0\n0 4e3 1\n0 5e6 7\n",
                "surface-size",
                ":4: the surface reaches from (0, 0, 0) to (9, 5000000, 7)",
            ),
            ("0 0 0\n9 0 0\n0 1 -1e300\n", "surface-size", ":3: "),
            ("0 0 0\n1 2 0\n2 4 0\n3 6 1\n", "points-no-surface", "the 4 points lie on one line"),
            ("0 0 0\n9 0 0\n0 0 7\n", "points-no-surface", "the 2 points lie on one line"),
            ("# nothing\n", "points-no-surface", "no points"),
            ("nan 0 0\n", "points-no-surface", "no points"),
        ] {
            let e = read_text(text, None).0.err().expect(text);
            assert_eq!(e.diags()[0].code, code, "{e}");
            assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{e}");
        }
    }

    #[test]
    fn points_that_are_not_finite_are_left_out() {
        let (result, _, notes) = read_text("0 0 0\n9 0 nan\n9 0 0\n0 9 0\n1e999 0 0\n", None);
        assert!(matches!(result, Ok(Content::Facets(1))));
        assert_eq!((notes[0].code, &notes[0].message[..8]), ("points-not-finite", "2 points"));
        assert!(notes[0].place.to_string().ends_with(":2"));
    }

    #[test]
    fn coordinates_of_a_countrys_grid_lose_nothing_to_the_datum() {
        let datum = [557_805.0, 5_108_025.0, 684.0];
        let near = grid(12, |_, _| true);
        let text = |offset: [f64; 3], by: f64| -> String {
            let row = |p: &[f64; 3]| {
                let [x, y, z] = [0, 1, 2].map(|k| offset[k] + (p[k] * by * 1e6).round() / 1e6);
                format!("{x:.6} {y:.6} {z:.6}\n")
            };
            near.iter().map(row).collect()
        };
        let read_with = |text: &str, unit: Unit| {
            let dir = tempfile::tempdir().expect("a folder");
            let path = dir.path().join("a.xyz");
            std::fs::write(&path, text).expect("written");
            let mut got = Vec::new();
            let lines = Lines::open(&path, "a point cloud").expect("text");
            read(lines, &path, unit, &Options::default(), &mut Vec::new(), &mut |f: Facet| got.push(f)).map(|_| got)
        };
        let want = read_with(&text([0.0; 3], 20.0), Unit::mm(0.05)).expect("near");
        let far = text(datum, 20.0);
        let got = read_with(&far, Unit { datum, ..Unit::mm(0.05) }).expect("moved");
        assert_eq!(got.len(), want.len());
        for (a, b) in got.iter().flatten().flatten().zip(want.iter().flatten().flatten()) {
            // f64 holds 5 million to 1e-9 of these units.
            assert!((a - b).abs() < 1.1e-6, "{a} for {b}");
        }
        // The refusal names values that work.
        let e = read_with(&far, Unit::mm(1.0)).expect_err("far away");
        let hint = &e.diags()[0].hint;
        let numbers = hint.split(['[', ']']).nth(1).expect("a datum").split(", ").map(|v| v.parse().expect("a number"));
        let datum: Vec<f64> = numbers.collect();
        assert!(read_with(&far, Unit { datum: [datum[0], datum[1], datum[2]], ..Unit::mm(1.0) }).is_ok(), "{hint}");
        let e = read_with(&far, Unit::mm(1000.0)).expect_err("far away");
        assert!(e.diags()[0].hint.contains("surface.scale = 4e-3 (1 : 250)"), "{}", e.diags()[0].hint);
    }
}
