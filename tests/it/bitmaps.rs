//! Bitmaps as texture: jobs on a dome, and files of other sources.

use std::path::Path;
use terrace_core::math;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{
    JobText, assert_balance, compile, folder, image, number, processor, said, shared, terrace, verify,
};
use terrace_core::geom::BoxMm;
use terrace_core::program::PenId;
use terrace_input::texture::{Area, Kind, Marking, Masks, Position, Request, Screen, Size, Texture, Tone};

/// A PNG of 16 bits: a disc whose grey rises from its middle to its border, on white.
fn disc() -> Vec<u8> {
    let samples: Vec<u16> = (0..64 * 64)
        .map(|i| {
            let [x, y] = [i % 64, i / 64].map(|v| (f64::from(v) - 31.5) / 28.0);
            if math::hypot(x, y) < 1.0 { (math::hypot(x, y) * 65_535.0) as u16 } else { u16::MAX }
        })
        .collect();
    image::height_map(64, &samples)
}

#[test]
fn bitmaps_on_a_dome_are_compiled_and_verified() {
    let dir = folder();
    let part = dir.path().join("dome.stl");
    write_stl(&part, &mesh(24, [165.0, 165.0, 285.0, 285.0], dome));
    std::fs::write(dir.path().join("disc.png"), disc()).expect("written");
    let texture = |keys: &str| format!("file = \"disc.png\"\n{keys}");
    let spot = 0.02;
    for method in ["z-range", "window"] {
        let job = JobText::on(&part)
            .method(method)
            .texture(&texture("size = [\"6 mm\", \"6 mm\"]\nscreen = \"lines\"\norigin = [\"175 mm\", \"228 mm\"]"))
            .texture(&texture(
                "dpi = 300\nscreen = \"dashes\"\ndirection = \"45 deg\"\norigin = [\"250 mm\", \"180 mm\"]",
            ))
            .texture(&texture("dpi = 254\nthreshold = \"40 %\"\nmirror = \"x\"\nturn = \"30 deg\"\npitch = \"0.1 mm\""))
            .write(dir.path(), "job.toml");
        let out = dir.path().join("out.job");
        let summary = compile(&job, &out);
        assert_balance(&summary, &verify(&out));
        // A cone of density 1 in its middle: a third of its base, marked as if all of it were lines a spot apart.
        let disc = |side: f64| std::f64::consts::PI * (side * 28.0 / 64.0_f64).powi(2);
        let grey = (disc(6.0) + disc(64.0 / 300.0 * 25.4)) / 3.0 / spot;
        // Up to 0.6 of its radius the cone is darker than 40 %.
        let area = 0.36 * disc(6.4) / 0.1;
        let texture_mm = number(&summary, "texture_mm");
        assert!((texture_mm / (grey + area) - 1.0).abs() < 0.02, "{texture_mm} mm instead of {}", grey + area);
        std::fs::remove_dir_all(out).expect("removed");
    }
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn areas_and_screens_on_dome_hood_and_relief_are_verified_with_every_method() {
    let (dir, data) = (folder(), shared().join("surfaces"));
    let made = dir.path().join("dome.stl");
    write_stl(&made, &mesh(60, [165.0, 165.0, 285.0, 285.0], dome));
    std::fs::write(dir.path().join("disc.png"), disc()).expect("written");
    let areas = r##"<svg xmlns="http://www.w3.org/2000/svg" width="30mm" height="20mm" viewBox="0 0 30 20">
        <path fill-rule="evenodd" fill="#f00" d="M1 1h12v18h-12zM4 4v8h6v-8z"/><circle cx="22" cy="10" r="7"/></svg>"##;
    std::fs::write(dir.path().join("areas.svg"), areas).expect("written");
    for (part, depth, pitch, size) in [
        (made, "0.3 mm", "0.4 mm", "\"30 mm\", \"20 mm\""),
        (data.join("hood_mm_bin.stl"), "2 mm", "2 mm", "\"300 mm\", \"200 mm\""),
        (data.join("helens_relief_small.stl"), "0.3 mm", "0.4 mm", "\"30 mm\", \"20 mm\""),
    ] {
        for (method, profile) in
            [("z-range", "xyz-galvo-40"), ("window", "xyz-galvo-40"), ("tilt", "xyz-tilt-galvo-40")]
        {
            for keys in [
                "file = \"areas.svg\"",
                "file = \"areas.svg\"\ndirection = \"contour\"",
                "file = \"disc.png\"\nthreshold = \"40 %\"",
                "file = \"disc.png\"\nscreen = \"lines\"",
                "file = \"disc.png\"\nscreen = \"dashes\"",
            ] {
                let mut job =
                    JobText::on(&part).method(method).texture(&format!("{keys}\nsize = [{size}]\npitch = \"{pitch}\""));
                job.focus = format!("pdof = \"{depth}\"");
                job.machine = format!("profile = \"{profile}\"");
                job.more = "[limits]\nmax_off_part = \"100 %\"\n".into();
                let out = dir.path().join("out.job");
                let summary = compile(&job.write(dir.path(), "job.toml"), &out);
                assert_balance(&summary, &verify(&out));
                assert!(number(&summary, "mark_mm") > 100.0, "{}, {method}, {keys}: {summary}", part.display());
                std::fs::remove_dir_all(out).expect("removed");
            }
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn every_screen_reproduces_a_ramp_in_the_program() {
    const STEPS: usize = 16;
    const WIDE: usize = 8;
    let dir = folder();
    let part = dir.path().join("dome.stl");
    write_stl(&part, &mesh(40, [-30.0, -30.0, 30.0, 30.0], |x, y| -(x * x + y * y) / 1500.0));
    let samples: Vec<u16> = (0..STEPS * WIDE).map(|i| (i / WIDE * 4369) as u16).collect();
    let samples = samples.repeat(12);
    std::fs::write(dir.path().join("ramp.png"), image::height_map(STEPS * WIDE, &samples)).expect("written");
    // 512 lines or rows, 30 sites or three periods in each step.
    let (side, high, spot) = (0.6, 10.24, 0.02);
    for (screen, method) in [
        ("lines", "z-range"),
        ("dashes", "window"),
        ("halftone", "z-range"),
        ("diffusion", "window"),
        ("noise", "z-range"),
    ] {
        let mut job = JobText::on(&part).method(method).texture(&format!(
            "file = \"ramp.png\"\nsize = [\"9.6 mm\", \"10.24 mm\"]\norigin = [\"0 mm\", \"-5 mm\"]\nscreen = {screen:?}\npen = \"grey\""
        ));
        job.more =
            "[[pen]]\nname = \"grey\"\nspeed = \"500 mm/s\"\npower = \"40 %\"\nfrequency = \"50 kHz\"\ndwell = \"200 us\"\n".into();
        let out = dir.path().join("out.job");
        compile(&job.write(dir.path(), "job.toml"), &out);
        let proof = verify(&out);
        let rule = proof["rules"].as_array().expect("rules").iter().find(|r| r["code"] == "bitmap").expect("the rule");
        assert!(
            rule["checked"].as_u64() > Some(1000) && rule["left_out"].as_array().is_none_or(Vec::is_empty),
            "{rule}"
        );
        // What is marked in each step, mm².
        let mut marked = [0.0; STEPS];
        let mut add = |x: f64, amount: f64| marked[(x / side) as usize] += amount;
        let text = std::fs::read_to_string(out.join("program.txt")).expect("program.txt");
        let mut centre = 0.0;
        for line in text.lines() {
            let words: Vec<&str> = line.split(' ').collect();
            if words[0] == "block" {
                centre = words[7].parse::<f64>().expect("nm") / 1e6;
            } else if words.len() >= 6 && matches!(words[3], "+" | "-") {
                let at = |i: usize| words[i].parse::<f64>().expect("nm") / 1e6 + centre;
                if words.len() == 6 {
                    add(at(4), spot * spot);
                } else {
                    assert_eq!((words.len(), words[5]), (8, words[7]), "lines of two points along x");
                    let (a, b) = (at(4).min(at(6)), at(4).max(at(6)));
                    let first = (a / side).floor();
                    let mut from = a;
                    for k in 1..=STEPS {
                        let to = b.min((first + k as f64) * side);
                        if to > from {
                            add((from + to) / 2.0, (to - from) * spot);
                            from = to;
                        }
                    }
                }
            }
        }
        for (k, marked) in marked.iter().enumerate() {
            let (coverage, density) = (marked / (side * high), 1.0 - k as f64 / 15.0);
            assert!((coverage - density).abs() < 0.01, "{screen}, step {k}: {coverage} instead of {density}");
        }
        std::fs::remove_dir_all(out).expect("removed");
    }
}

#[test]
fn keys_that_do_not_apply_are_refused() {
    let dir = folder();
    let part = dir.path().join("dome.stl");
    write_stl(&part, &mesh(4, [165.0, 165.0, 285.0, 285.0], dome));
    std::fs::write(dir.path().join("disc.png"), disc()).expect("written");
    std::fs::write(dir.path().join("leaf.svg"), terrace_input::job::SAMPLE_DRAWING).expect("written");
    for (keys, code, say) in [
        ("file = \"leaf.svg\"\ngamma = 2", "texture-key", "does not apply to this drawing"),
        ("file = \"disc.png\"\ndpi = 300\nstroke = \"hatch\"", "texture-key", "stroke does not apply to a bitmap"),
        ("file = \"disc.png\"\ndpi = 300\nsize = [\"1 mm\", \"1 mm\"]", "texture-key", "both size and dpi"),
        ("file = \"disc.png\"\ndpi = -3", "texture-key", "dpi -3 is not possible"),
        ("file = \"disc.png\"\ndpi = 1e300", "texture-key", "is not possible"),
        (
            "file = \"disc.png\"\ndpi = 300\nscreen = \"dashes\"\nperiod = \"1e-9 mm\"",
            "texture-large",
            "larger pitch or period",
        ),
        ("file = \"disc.png\"\ndpi = 300\ngamma = 0", "texture-key", "gamma 0 is not possible"),
        ("file = \"disc.png\"\ndpi = 300\nthreshold = \"100 %\"", "texture-key", "threshold 100 is not possible"),
        ("file = \"disc.png\"\ndpi = 300\nscreen = \"lines\"\nperiod = \"1 mm\"", "texture-key", "screen = \"lines\""),
        ("file = \"disc.png\"\ndpi = 300\nscreen = \"dashes\"\nfill = \"rings\"", "texture-key", "screen = \"dashes\""),
        ("pattern = \"hatch\"\npitch = \"1 mm\"\ninvert = true", "texture-key", "invert does not apply to hatch"),
        (
            "pattern = \"hatch\"\npitch = \"1 mm\"\ninside = { file = \"leaf.svg\", unit = \"mm\" }",
            "texture-key",
            "unit applies to DXF drawings alone",
        ),
        ("file = \"disc.png\"", "bitmap-size", "64 x 64 pixels"),
        ("file = \"disc.png\"\ndpi = \"file\"", "bitmap-size", "states no resolution"),
    ] {
        let job = JobText::on(&part).texture(keys).write(dir.path(), "job.toml");
        let text = said(&terrace([Path::new("check"), &job]));
        assert!(text.contains(&format!("error[{code}]")) && text.contains(say), "{keys}: {text}");
    }
}

/// Reads a bitmap and marks it in a way.
fn load(path: &Path, screen: Screen, spot_mm: f64) -> Result<Texture, &'static str> {
    let marking = Marking { tone: Some(Tone { screen, ..Tone::default() }), ..Marking::default() };
    let kind = Kind::Drawing {
        path: path.to_owned(),
        size: Size::Mm([20.0, 20.0]),
        unit_mm: None,
        position: Position::Origin([0.0; 2]),
        turn_rad: 0.0,
        tile: false,
        marking: Box::new(marking),
    };
    let request = Request { kind, area: Area::Unlimited, tolerance_mm: 1e-3, pen: PenId(0), masks: Masks::default() };
    let texture = processor::within(5, &path.display().to_string(), || {
        Texture::load(&[request], BoxMm::rectangle(0.0, 0.0, 20.0, 20.0), 0.0, spot_mm, &mut Vec::new())
    });
    texture.map_err(|e| e.diags()[0].code)
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn bitmaps_of_other_sources_are_read_and_damaged_ones_refused() {
    let mut names: Vec<_> = std::fs::read_dir(shared().join("textures"))
        .expect("../shared/data/textures")
        .map(|e| e.expect("an entry").path())
        .filter(|p| p.extension().is_some_and(|e| e == "png"))
        .collect();
    names.sort();
    assert!(names.len() > 25, "{}", names.len());
    for path in names {
        for screen in [Screen::Threshold, Screen::Lines, Screen::Dashes] {
            let texture = load(&path, screen, 0.04).unwrap_or_else(|code| panic!("{}: {code}", path.display()));
            assert!(!texture.is_empty());
        }
    }
    for (name, code) in [
        ("png_bad_idat_crc.png", "bitmap-damaged"),
        ("png_decompression_bomb.png", "bitmap-large"),
        ("png_huge_dims.png", "bitmap-large"),
        ("pngsuite_xcsn0g01.png", "bitmap-damaged"),
        ("pngsuite_xdtn0g01.png", "bitmap-damaged"),
        ("pngsuite_xhdn0g08.png", "bitmap-damaged"),
        ("pngsuite_xlfn0g04.png", "bitmap-damaged"),
        ("tiff_cyclic_ifd.tif", "bitmap-damaged"),
        ("tiff_huge_strip.tif", "bitmap-samples"),
    ] {
        let path = shared().join("bad").join(name);
        assert_eq!(load(&path, Screen::Threshold, 0.04).expect_err(name), code, "{name}");
    }
}
