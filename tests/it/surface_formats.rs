//! Surfaces of other sources in every format: each reads with the box that its index states, or is refused for the
//! reason stated there; the same part in several formats and units has the same heights.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::support::shared;
use terrace_input::surface::{Content, Heightmap, Options, Scale, read};

/// What a file comes to, in the units of the file.
enum Want {
    /// Facets in a box of this size and lower corner.
    Box([f64; 3], [f64; 3]),
    /// A height map of these columns and rows, these lowest and highest values, and so many holes.
    Map([usize; 2], [f64; 2], usize),
    /// Refused with this code.
    Refused(&'static str),
}
use Want::{Box, Map, Refused};

const IN: f64 = 25.4;
const M: f64 = 1000.0;
/// The file states its unit.
const OWN: f64 = 0.0;

/// File, mm in one unit of it, and what `INDEX.md` says of it.
const FILES: &[(&str, f64, Want)] = &[
    ("propeller_and_shaft.stl", 1.0, Box([1483.7, 244.51, 245.36], [-1350.0, -124.966, -124.664])),
    ("helens_relief_small.stl", 1.0, Box([189.6, 273.6, 36.52], [0.0, -273.6, 14.26])),
    ("busted.STL", 1.0, Box([10.675, 11.385, 9.5724], [-5.39826, 18.3005, -9.93568])),
    ("torus.STL", IN, Box([2.999, 2.9995, 0.99803], [-1.5, -1.49976, -0.499013])),
    ("fuji_ascii.stl", 1.0, Box([200.9, 17.4, 7.7], [-100.45, -8.7, 0.0])),
    ("hood_mm_bin.stl", 1.0, HOOD),
    ("hood_ascii_crlf.stl", 1.0, HOOD),
    ("hood_inches_bin.stl", IN, HOOD_INCH),
    ("hood_metres_bin.stl", M, Box([1.2796, 1.493, 0.34949], [0.000_442_907, -0.746_515, -0.154_703])),
    ("hood_tilted_carcoords.stl", 1.0, Box([1172.8, 1118.8, 1435.5], [2487.4, -1001.25, 364.632])),
    // "1 stray facet at z=5000": farther than 4 m from the origin. Half as large it reads.
    ("hood_dirty_bin.stl", 1.0, Refused("surface-size")),
    ("hood_dirty_bin.stl", 0.5, Box([1279.6, 1493.0, 5154.7], [0.442_907, -746.515, -154.703])),
    ("mouse_shell_undercut.stl", 1.0, Box([123.99, 60.533, 39.259], [-61.9937, -30.2663, 0.0])),
    ("helmet_shell_undercut.stl", 1.0, Box([259.28, 207.91, 196.43], [-132.139, -103.956, -74.4315])),
    ("helmet_outer_open.stl", 1.0, Box([259.28, 207.91, 196.43], [-132.139, -103.956, -74.4315])),
    ("mirror_freeform.stl", 1.0, MIRROR),
    ("mould_core_draft3.stl", 1.0, Box([200.0, 140.0, 68.901], [-100.0, -70.0, -25.0])),
    ("fuze.obj", M, FUZE),
    ("quadknot.obj", 1.0, Box([170.73, 133.72, 181.32], [-149.291, -66.859, -167.229])),
    ("groups.obj", 1.0, Box([9.4252, 4.9356, 4.0], [-4.71259, -2.55364, 0.0])),
    ("hood_quads_uv.obj", 1.0, HOOD),
    // Its index has z up to 2 only: it was measured by a reader that misses a corner, as it says itself.
    ("panel_negidx_ngon.obj", 1.0, Box([190.0, 60.0, 4.0], [-30.0, 0.0, -1.0])),
    ("cycloidal.ply", IN, Box([1.875, 1.8746, 1.1069], [0.239_546, -0.338_63, 0.810_647])),
    ("fuze_ascii.ply", M, FUZE),
    ("hood_ascii_quads.ply", 1.0, HOOD),
    ("hood_bin_be_double.ply", 1.0, HOOD),
    ("hood_bin_le_float.ply", 1.0, HOOD),
    ("mirror_freeform_f64.ply", 1.0, MIRROR),
    ("featuretype.3MF", OWN, Box([5.0, 2.5, 1.375], [-2.5, -1.25, 0.0])),
    ("hood_inch.3mf", OWN, HOOD_INCH),
    ("hood_inch.3mf", IN, HOOD_INCH),
    ("hood_inch.3mf", 1.0, Refused("surface-unit")),
    ("mould_core_pair_mm.3mf", OWN, Box([460.0, 140.0, 68.901], [-90.0, -50.0, -20.0])),
    ("P_XPM_0331_01.3mf", OWN, Box([100.0; 3], [33.8, 30.25, 50.1])),
    ("sphere.3mf", OWN, Box([20.0; 3], [0.0; 3])),
    ("torus.3mf", OWN, Box([24.0, 23.953, 3.9593], [0.0, 0.003_999_11, 0.009_999_56])),
    ("mirror_cloud_shuffled.xyz", 1.0, Box([313.6, 173.571_428, 26.062_445], [-156.8, 43.214_286, 1.290_256])),
    // "UTM offsets": kilometres, 5,100 km from the origin. No unit of a job file brings them within 4 m; a map scale does.
    ("helens_cloud_utm.xyz", M, Refused("surface-size")),
    ("helens_cloud_utm.xyz", 1e-3, Refused("surface-size")),
    ("helens_cloud_utm.xyz", 5e-4, Box([9780.0, 13_950.0, 1855.0], [557_805.0, 5_108_025.0, 684.0])),
    ("helens_dem_u16_decimetre.png", OWN, Map([327, 468], [0.0, 25_430.0], 0)),
    ("helens_dem_f32_nan.tif", OWN, Map([327, 468], [682.0, 2543.0], 4151)),
    ("SainteHelens.dem", OWN, Refused("surface-format")),
    ("jacksboro_dem_u16_m.png", OWN, Map([403, 344], [236.0, 1076.0], 0)),
    ("jacksboro_dem_i16.tif", OWN, Map([403, 344], [236.0, 1076.0], 0)),
    ("hood_u16_2mm.png", OWN, Map([640, 780], [0.0, 65_535.0], 0)),
    ("hood_u8_2mm.png", OWN, Map([640, 780], [0.0, 255.0], 0)),
    ("hood_f32_nan_2mm.tif", OWN, Map([640, 780], [-153.859_131, 194.565_536], 51_093)),
];

const HOOD: Want = Box([1279.6, 1493.0, 349.49], [0.442_907, -746.515, -154.703]);
const HOOD_INCH: Want = Box([50.376, 58.781, 13.759], [0.017_437_3, -29.3904, -6.090_69]);
const MIRROR: Want = Box([320.0, 180.0, 39.486], [-160.0, 40.0, 1.178_87]);
const FUZE: Want = Box([0.072_612, 0.073_514, 0.215_13], [-0.036_391, -0.036_711, 0.004_016]);

type Facets = Vec<[[f64; 3]; 3]>;

/// Reads a file: facets in mm, or a height map whose values are mm.
fn load(path: &Path, unit_mm: f64) -> Result<(Facets, Option<Heightmap>), &'static str> {
    let name = path.extension().expect("an extension").to_str().expect("text");
    let is_map = ["png", "tif"].contains(&name);
    // Far from the values of elevations, so that every map of the list is as large as a part.
    let scale = Scale {
        pixel_mm: 2.0,
        z_mm: [0.0, 100.0],
        values: (name != "png").then_some([0.0, 10_000.0]),
        nodata: None,
        origin_mm: [0.0; 2],
    };
    let unit_mm = (unit_mm != OWN).then_some(unit_mm);
    let options = Options { unit_mm, heightmap: is_map.then_some(scale), ..Default::default() };
    let mut facets = Vec::new();
    let start = Instant::now();
    let content = read(path, &options, &mut Vec::new(), &mut |f| facets.push(f));
    assert!(start.elapsed() < Duration::from_secs(5), "{}", path.display());
    match content {
        Ok(Content::Facets(n) | Content::Tessellated(n, _)) => {
            assert_eq!(n, facets.len());
            Ok((facets, None))
        }
        Ok(Content::Heightmap(map)) => Ok((facets, Some(map))),
        Err(e) => Err(e.diags()[0].code),
    }
}

/// Lower corner and size.
fn extent(facets: &Facets) -> [[f64; 3]; 2] {
    let corners = || facets.iter().flatten();
    let lo = [0, 1, 2].map(|k| corners().fold(f64::INFINITY, |v, p| v.min(p[k])));
    let hi = [0, 1, 2].map(|k| corners().fold(f64::NEG_INFINITY, |v, p| v.max(p[k])));
    [lo, [0, 1, 2].map(|k| hi[k] - lo[k])]
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn every_surface_of_other_sources_has_the_box_of_its_index() {
    let folder = shared().join("surfaces");
    let own: BTreeMap<&str, f64> = [("featuretype.3MF", IN), ("hood_inch.3mf", IN)].into();
    for (name, unit_mm, want) in FILES {
        let found = load(&folder.join(name), *unit_mm);
        match (want, found) {
            (Refused(code), Err(found)) => assert_eq!(*code, found, "{name}"),
            (Box(size, lo), Ok((facets, None))) => {
                let unit = if *unit_mm == OWN { *own.get(name).unwrap_or(&1.0) } else { *unit_mm };
                let [found_lo, found_size] = extent(&facets).map(|v| v.map(|v| v / unit));
                for k in 0..3 {
                    let off = [found_size[k] - size[k], found_lo[k] - lo[k]].map(f64::abs);
                    assert!(off.iter().all(|off| *off <= 1e-3 * size[k]), "{name}: {found_lo:?} {found_size:?}");
                }
            }
            (Map(count, values, holes), Ok((_, Some(map)))) => {
                assert_eq!([map.columns, map.rows], *count, "{name}");
                let range = map.samples.range().expect("samples");
                assert!((0..2).all(|k| (range[k] - values[k]).abs() < 1e-5), "{name}: {range:?}");
                let found = (0..map.samples.len()).filter(|&i| map.samples.value(i).is_none()).count();
                assert_eq!(found, *holes, "{name}");
            }
            (_, found) => panic!("{name}: {:?}", found.map(|(facets, map)| (facets.len(), map.is_some()))),
        }
    }
    for entry in std::fs::read_dir(&folder).expect("a readable folder") {
        let name = entry.expect("an entry").file_name().to_string_lossy().into_owned();
        let is_cad = ["step", "stp", "iges", "igs"].iter().any(|e| name.to_lowercase().ends_with(e));
        assert!(is_cad || FILES.iter().any(|(known, ..)| *known == name), "{name} has no row");
    }
}

/// Heights over a grid from `lo`, a step apart; NaN where no facet is.
struct Heights {
    lo: [f64; 2],
    step: f64,
    count: [usize; 2],
    z: Vec<f64>,
}

impl Heights {
    fn of(facets: &Facets, lo: [f64; 2], step: f64, count: [usize; 2]) -> Self {
        let mut z = vec![f64::NAN; count[0] * count[1]];
        for [a, b, c] in facets {
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            let ends = |k: usize| {
                let (least, most) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
                let first = ((least - lo[k]) / step).ceil().max(0.0) as usize;
                first..(((most - lo[k]) / step).floor() + 1.0).clamp(0.0, count[k] as f64) as usize
            };
            for (i, j) in ends(1).flat_map(|j| ends(0).map(move |i| (i, j))) {
                let p = [lo[0] + i as f64 * step, lo[1] + j as f64 * step];
                let part =
                    |q: &[f64; 3], r: &[f64; 3]| ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])) / area;
                let (u, v, w) = (part(b, c), part(c, a), part(a, b));
                if u >= 0.0 && v >= 0.0 && w >= 0.0 {
                    let at = &mut z[j * count[0] + i];
                    *at = at.max(u * a[2] + v * b[2] + w * c[2]);
                }
            }
        }
        Self { lo, step, count, z }
    }

    /// The largest difference, and how many places only one of the two has, of those that any has.
    fn compared(&self, other: &Self) -> (f64, usize, usize) {
        assert_eq!((self.lo, self.step, self.count), (other.lo, other.step, other.count));
        let (mut most, mut single, mut all) = (0.0f64, 0, 0);
        for (a, b) in self.z.iter().zip(&other.z) {
            all += usize::from(!a.is_nan() || !b.is_nan());
            single += usize::from(a.is_nan() != b.is_nan());
            if !a.is_nan() && !b.is_nan() {
                most = most.max((a - b).abs());
            }
        }
        (most, single, all)
    }
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn the_hood_has_the_same_heights_in_every_format_and_unit() {
    let folder = shared().join("surfaces");
    // Off the vertices of the mesh.
    let heights = |name: &str, unit_mm: f64| {
        let (facets, _) = load(&folder.join(name), unit_mm).expect(name);
        Heights::of(&facets, [1.37, -746.11], 3.7, [345, 403])
    };
    let first = heights("hood_bin_be_double.ply", 1.0);
    for (name, unit_mm) in [
        ("hood_ascii_crlf.stl", 1.0),
        ("hood_inches_bin.stl", IN),
        ("hood_metres_bin.stl", M),
        ("hood_quads_uv.obj", 1.0),
        ("hood_ascii_quads.ply", 1.0),
        ("hood_bin_le_float.ply", 1.0),
        ("hood_inch.3mf", OWN),
        ("hood_mm_bin.stl", 1.0),
    ] {
        let (most, single, all) = first.compared(&heights(name, unit_mm));
        eprintln!("{name}: {most:.6} mm at {all} places, {single} at the rim");
        // The finer mesh is the same part within the chord error of the coarse one.
        let tolerance = if name == "hood_mm_bin.stl" { 1.0 } else { 1e-3 };
        assert!(most < tolerance && all > 130_000 && single < 5, "{name}: {most} mm, {single} of {all}");
    }
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn the_same_height_map_has_the_same_heights_in_every_format() {
    let folder = shared().join("surfaces");
    let map = |name: &str| load(&folder.join(name), OWN).expect(name).1.expect("a height map");
    let value = |map: &Heightmap, i: usize| map.samples.value(i);
    // Names, what one step of the second is in the first, the value of its 0, and how far the two may differ.
    for (first, second, step, zero, off) in [
        ("helens_dem_f32_nan.tif", "helens_dem_u16_decimetre.png", 0.1, 0.0, 1e-9),
        ("jacksboro_dem_u16_m.png", "jacksboro_dem_i16.tif", 1.0, 0.0, 0.0),
        ("hood_f32_nan_2mm.tif", "hood_u16_2mm.png", HOOD_STEP, -153.859_131 - HOOD_STEP, HOOD_STEP / 2.0 + 2e-5),
    ] {
        let (a, b) = (map(first), map(second));
        assert_eq!([a.columns, a.rows], [b.columns, b.rows]);
        let has_holes = a.samples.range() != b.samples.range();
        let (mut most, mut both) = (0.0f64, 0);
        for i in 0..a.samples.len() {
            // In images 0 stands for a hole of the other.
            let v = value(&b, i).filter(|v| *v > 0.0 || !has_holes);
            match (value(&a, i), v) {
                (Some(a), Some(v)) => {
                    most = most.max((a - (zero + v * step)).abs());
                    both += 1;
                }
                (a, v) => assert_eq!(a.is_some(), v.is_some(), "{first}, {second}: sample {i}"),
            }
        }
        eprintln!("{first}, {second}: {most:.9} at {both} samples");
        assert!(most <= off && both > 130_000, "{first}, {second}: {most}");
    }
}

/// Height of one step of `hood_u16_2mm.png`, mm: 1 to 65535 are -153.859 to 194.566.
const HOOD_STEP: f64 = (194.565_536 + 153.859_131) / 65_534.0;

#[test]
#[ignore = "needs ../shared: make test-all"]
fn a_height_map_of_the_hood_lies_on_its_mesh() {
    let folder = shared().join("surfaces");
    let (facets, _) = load(&folder.join("hood_mm_bin.stl"), 1.0).expect("the mesh");
    let (_, map) = load(&folder.join("hood_f32_nan_2mm.tif"), OWN).expect("the map");
    let map = map.expect("a map");
    let mesh = Heights::of(&facets, [0.0, -778.0], 2.0, [map.columns, map.rows]);
    let z = (0..map.samples.len()).map(|i| map.samples.value(i).unwrap_or(f64::NAN)).collect();
    let (most, single, all) = mesh.compared(&Heights { z, ..mesh });
    eprintln!("{most:.6} mm at {all} places, {single} at the rim");
    // Samples are exact; facets of 10 mm lie below by their chord error.
    assert!(most < 0.25 && single < 10 && all > 448_000, "{most} mm, {single} of {all}");
}
