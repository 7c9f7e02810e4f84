//! Where textures lie: size, fit and alignment of drawings.

use std::path::Path;

use terrace::diag::Error;
use terrace::geom::{BoxMm, P2};
use terrace::job::{Job, Overrides};
use terrace::texture::Texture;

use crate::support::{JobText, folder};

/// The part's box.
const PART: BoxMm<2> = BoxMm::rectangle(-10.0, 0.0, 50.0, 40.0);

/// The texture that the keys make on a part with that box, next to the files of a folder.
pub(crate) fn texture(dir: &Path, keys: &str) -> Result<Texture, Error> {
    let job = JobText::on(Path::new("absent.stl")).texture(keys).write(dir, "job.toml");
    let job = Job::load(&job, &Overrides::default())?;
    Texture::load(&job.textures, PART, 0.0, 0.02, &mut Vec::new())
}

pub(crate) fn strokes(texture: &Texture) -> Vec<Vec<P2>> {
    let mut points = Vec::new();
    let stroke = |i| {
        texture.stroke(i, &mut points);
        points.clone()
    };
    (0..texture.len()).map(stroke).collect()
}

/// A drawing whose one line runs round its page of 20 x 10.
fn frame(dir: &Path, name: &str, size: &str) {
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" {size} viewBox=\"0 0 20 10\">\
         <path d=\"M0 0h20v10h-20z\" fill=\"none\" stroke=\"#000\" stroke-width=\".001\"/></svg>"
    );
    std::fs::write(dir.join(name), svg).expect("writable");
}

fn bounds(texture: &Texture) -> [f64; 4] {
    let (lo, hi) = (texture.bounds().lo.mm(), texture.bounds().hi.mm());
    [lo[0], lo[1], hi[0], hi[1]]
}

#[test]
fn drawings_are_fitted_scaled_and_aligned() {
    let dir = folder();
    frame(dir.path(), "mm.svg", "width=\"20mm\" height=\"10mm\"");
    frame(dir.path(), "px.svg", "");
    let dxf = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n\
               0\nLINE\n8\n0\n10\n5\n20\n5\n11\n25\n21\n5\n0\nLINE\n8\n0\n10\n25\n20\n5\n11\n25\n21\n15\n\
               0\nENDSEC\n0\nEOF\n";
    std::fs::write(dir.path().join("corner.dxf"), dxf).expect("writable");
    let area = "area = [\"0 mm\", \"0 mm\", \"30 mm\", \"30 mm\"]";
    for (keys, want) in [
        // The part's box is 60 x 40 mm, from -10, 0 to 50, 40.
        ("file = \"px.svg\"\nfit = \"contain\"".to_owned(), [-10.0, 5.0, 50.0, 35.0]),
        ("file = \"px.svg\"\nfit = \"cover\"".to_owned(), [-20.0, 0.0, 60.0, 40.0]),
        ("file = \"px.svg\"\nfit = \"height\"\nalign = \"left\"".to_owned(), [-10.0, 0.0, 70.0, 40.0]),
        ("file = \"px.svg\"\nfit = \"contain\"\nturn = \"90 deg\"".to_owned(), [10.0, 0.0, 30.0, 40.0]),
        (format!("file = \"px.svg\"\nfit = \"width\"\nalign = \"bottom\"\n{area}"), [0.0, 0.0, 30.0, 15.0]),
        ("file = \"mm.svg\"\nscale = 1.5".to_owned(), [5.0, 12.5, 35.0, 27.5]),
        ("file = \"mm.svg\"\nalign = \"right top\"".to_owned(), [30.0, 30.0, 50.0, 40.0]),
        (format!("file = \"mm.svg\"\nalign = \"centre\"\n{area}"), [5.0, 10.0, 25.0, 20.0]),
        (format!("file = \"mm.svg\"\n{area}"), [0.0, 0.0, 20.0, 10.0]),
        // A turned page is aligned by the box around it.
        ("file = \"mm.svg\"\nturn = \"-90 deg\"\nalign = \"left bottom\"".to_owned(), [-10.0, 0.0, 0.0, 20.0]),
        // Its own coordinates, multiplied; or the box of what it shows, aligned.
        ("file = \"corner.dxf\"\nscale = 2.0".to_owned(), [10.0, 10.0, 50.0, 30.0]),
        ("file = \"corner.dxf\"\nscale = 0.5\nalign = \"centre\"".to_owned(), [15.0, 17.5, 25.0, 22.5]),
        ("file = \"corner.dxf\"\nfit = \"width\"".to_owned(), [-10.0, 5.0, 50.0, 35.0]),
    ] {
        let texture = texture(dir.path(), &keys).unwrap_or_else(|e| panic!("{keys}: {e}"));
        let found = bounds(&texture);
        assert!((0..4).all(|k| (found[k] - want[k]).abs() < 1.5e-6), "{keys}: {found:?}");
    }
}

#[test]
fn curves_of_a_drawing_that_grows_stay_within_the_tolerance() {
    let dir = folder();
    let dxf = "0\nSECTION\n2\nENTITIES\n0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n0.1\n0\nENDSEC\n0\nEOF\n";
    std::fs::write(dir.path().join("circle.dxf"), dxf).expect("writable");
    std::fs::write(dir.path().join("circle.plt"), "IN;SP1;PA100,100;CI40;").expect("writable");
    for file in ["circle.dxf\"\nunit = \"mm", "circle.plt"] {
        let keys = format!("file = \"{file}\"\nfit = \"height\"\ntolerance = \"1 um\"");
        let circle = &strokes(&texture(dir.path(), &keys).unwrap_or_else(|e| panic!("{file}: {e}")))[0];
        for side in circle.windows(2) {
            let middle = side[0].lerp(side[1], 0.5).mm();
            let from = 20.0 - (middle[0] - 20.0).hypot(middle[1] - 20.0);
            // The box of the polygon, which is the page, is within the tolerance too.
            assert!((-1e-3..2e-3).contains(&from), "{file}: {} points, {from} mm inside the circle", circle.len());
        }
    }
}

#[test]
fn keys_that_contradict_each_other_are_refused() {
    let dir = folder();
    frame(dir.path(), "mm.svg", "width=\"20mm\" height=\"10mm\"");
    frame(dir.path(), "px.svg", "");
    let size = "size = [\"4 mm\", \"2 mm\"]";
    let origin = "origin = [\"4 mm\", \"2 mm\"]";
    for (keys, code, words) in [
        (format!("file = \"mm.svg\"\nfit = \"width\"\n{size}"), "texture-key", "both size and fit"),
        (format!("file = \"mm.svg\"\nscale = 2.0\n{size}"), "texture-key", "both size and scale"),
        ("file = \"mm.svg\"\nfit = \"width\"\nscale = 2.0".to_owned(), "texture-key", "both scale and fit"),
        (format!("file = \"mm.svg\"\nfit = \"width\"\n{origin}"), "texture-key", "both origin and fit"),
        (format!("file = \"mm.svg\"\nalign = \"left\"\n{origin}"), "texture-key", "both origin and align"),
        ("file = \"mm.svg\"\nscale = 0.0".to_owned(), "texture-key", "scale 0 is not possible"),
        ("file = \"px.svg\"\nscale = 2.0".to_owned(), "svg-size", "no physical size"),
        ("pattern = \"hatch\"\npitch = \"1 mm\"\nalign = \"left\"".to_owned(), "texture-key", "align does not apply"),
    ] {
        let e = texture(dir.path(), &keys).expect_err(&keys);
        let d = &e.diags()[0];
        assert!(d.code == code && d.message.contains(words), "{keys}: {e}");
    }
}
