//! Bitmaps that are marked as they should be, and changed ones.

use super::super::page::Site;
use super::*;
use crate::tests::made::bmp;
use terrace_core::geom::NM_PER_MM;
use terrace_core::math;
use terrace_input::job::{Job, Overrides};
use terrace_input::texture::Texture;

const COLUMNS: usize = 240;
const ROWS: usize = 150;

/// A picture that looks like none of its mirror images: a ramp from the left, a white field, a black one.
fn picture(i: usize, j: usize) -> u8 {
    match (i, j) {
        (20..90, 15..60) => 255,
        (150..220, 90..140) => 0,
        _ => 20 + (i * 215 / COLUMNS) as u8,
    }
}

fn areas(i: usize, j: usize) -> u8 {
    if ((i as i64 - 80).pow(2) + (j as i64 - 60).pow(2) < 2000) || (150..220).contains(&i) && (90..140).contains(&j) {
        0
    } else {
        255
    }
}

/// What the rule finds of a bitmap whose file, keys and strokes are changed after it was placed.
fn found(
    keys: [&str; 2],
    pictures: [&dyn Fn(usize, usize) -> u8; 2],
    change: impl Fn(&Texture, usize, &mut Vec<P2>),
) -> Rule {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("b.bmp");
    let job = |keys: &str| {
        let text = format!(
            "surface = {{ file = \"x.stl\", unit = \"mm\" }}\nfocus = {{ pdof = \"0.1 mm\" }}\n\
             machine = {{ profile = \"xyz-galvo-40\" }}\n[[texture]]\nfile = \"b.bmp\"\n{keys}\n\
             [[pen]]\nname = \"a\"\nspeed = \"100 mm/s\"\npower = \"5 %\"\nfrequency = \"60 kHz\"\ndwell = \"1 ms\"\n"
        );
        Job::parse(&folder.path().join("job.toml"), &text, &Overrides::default()).expect("a job")
    };
    let part_box = BoxMm::rectangle(0.0, 0.0, 26.0, 17.0);
    std::fs::write(&file, bmp([COLUMNS, ROWS], pictures[0])).expect("written");
    let before = job(keys[0]);
    let texture = Texture::load(&before.textures, part_box, 0.3, 0.03, &mut Vec::new()).expect("a texture");
    std::fs::write(&file, bmp([COLUMNS, ROWS], pictures[1])).expect("written");
    let drawing = Drawing {
        stroke: Box::new(|i, out| {
            let pen = texture.stroke(i, out);
            change(&texture, i, out);
            pen
        }),
        ..Drawing::from_texture(&texture)
    };
    let job = job(keys[1]);
    let site = Site { part_box, turn_rad: 0.3 };
    let placed = PlacedTextures { job: &job, texture: &texture, drawing: &drawing, site };
    let mut rule = Rule::new("bitmap", "");
    check(&placed, &job.textures, 0.03, &mut Files::default(), &mut rule);
    rule
}

const SCREENS: [&str; 7] = [
    "screen = \"lines\"",
    "screen = \"lines\"\npitch = \"0.06 mm\"\ndirection = \"20 deg\"",
    "screen = \"dashes\"\ndirection = \"45 deg\"",
    "screen = \"halftone\"\ndirection = \"15 deg\"",
    "screen = \"halftone\"\nperiod = \"0.12 mm\"",
    "screen = \"diffusion\"",
    "screen = \"noise\"\nseed = 9",
];

const AREAS: [&str; 5] = [
    "pitch = \"0.05 mm\"\ndirection = \"30 deg\"",
    "pitch = \"0.05 mm\"\ncross = true\ninset = \"0.1 mm\"\nthreshold = \"30 %\"",
    "fill = \"rings\"\npitch = \"0.05 mm\"",
    "fill = \"outline\"",
    "pitch = \"0.3 mm\"\ncontour = \"after\"",
];

const PLACES: [&str; 6] = [
    "dpi = 254",
    "size = [\"24 mm\", \"15 mm\"]\nturn = \"10 deg\"\nmirror = \"x\"",
    "fit = \"contain\"\nmirror = \"y\"\nturn = \"90 deg\"",
    "dpi = 508\ntile = true\narea = \"part\"\nturn = \"-5 deg\"",
    "dpi = 254\norigin = [\"-4 mm\", \"3 mm\"]\narea = \"part\"",
    "dpi = 400\ngamma = 1.8\nalign = \"right top\"\ninvert = true",
];

#[test]
fn a_screen_and_an_area_hold_and_do_not_once_the_file_is_mirrored() {
    let mirrored = |i: usize, j: usize| picture(COLUMNS - 1 - i, j);
    for keys in [SCREENS[3], AREAS[0]] {
        let keys = format!("{}\n{keys}", PLACES[0]);
        let rule = found([&keys; 2], [&picture; 2], |_, _, _| {});
        assert!(rule.violated == 0 && rule.checked > 100, "{keys}: {rule:?}");
        assert!(found([&keys; 2], [&picture, &mirrored], |_, _, _| {}).violated > 0, "{keys}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn sound_bitmaps_hold() {
    for place in PLACES {
        for keys in SCREENS {
            let keys = format!("{place}\n{keys}");
            let rule = found([&keys; 2], [&picture; 2], |_, _, _| {});
            assert!(rule.violated == 0 && rule.left_out.is_empty(), "{keys}: {rule:?}");
            assert!(rule.checked > 1000, "{keys}: {}", rule.checked);
        }
        for keys in AREAS {
            for of in [areas, picture] {
                let keys = format!("{place}\n{keys}");
                let rule = found([&keys; 2], [&of; 2], |_, _, _| {});
                assert!(rule.violated == 0 && rule.left_out.is_empty(), "{keys}: {rule:?}");
                assert!(rule.checked > 100, "{keys}: {}", rule.checked);
            }
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn a_bitmap_that_looks_otherwise_is_found() {
    type Grey = fn(usize, usize) -> u8;
    let others: [Grey; 6] = [
        |i, j| picture(COLUMNS - 1 - i, j),
        |i, j| picture(i, ROWS - 1 - j),
        |i, j| picture(COLUMNS - 1 - i, ROWS - 1 - j),
        |i, j| 255 - picture(i, j),
        |i, j| (255.0 * math::pow(f64::from(picture(i, j)) / 255.0, 1.5)) as u8,
        |i, j| picture((i + 12) % COLUMNS, j),
    ];
    for keys in SCREENS {
        for (k, other) in others.iter().enumerate() {
            let keys = format!("{}\n{keys}", PLACES[1]);
            let rule = found([&keys; 2], [&picture, other], |_, _, _| {});
            assert!(rule.violated > 0, "{keys} {k}");
        }
    }
    let others: [Grey; 4] = [
        |i, j| areas(COLUMNS - 1 - i, j),
        |i, j| areas(i, ROWS - 1 - j),
        |i, j| 255 - areas(i, j),
        |i, j| areas((i + 3) % COLUMNS, j),
    ];
    for keys in AREAS {
        for (k, other) in others.iter().enumerate() {
            let keys = format!("{}\n{keys}", PLACES[1]);
            assert!(found([&keys; 2], [&areas, other], |_, _, _| {}).violated > 0, "{keys} {k}");
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn other_keys_are_found() {
    for (keys, other) in [
        ("dpi = 254", "dpi = 260"),
        ("dpi = 254\nmirror = \"x\"", "dpi = 254"),
        ("dpi = 254\nturn = \"3 deg\"", "dpi = 254"),
        ("dpi = 254\ninvert = true", "dpi = 254"),
        ("dpi = 254\ngamma = 1.4", "dpi = 254"),
    ] {
        for screen in SCREENS {
            let keys = [keys, other].map(|k| format!("{k}\n{screen}"));
            let rule = found([&keys[0], &keys[1]], [&picture; 2], |_, _, _| {});
            assert!(rule.violated > 0, "{keys:?}");
        }
    }
    let keys = ["30 %", "60 %"].map(|t| format!("dpi = 254\npitch = \"0.05 mm\"\nthreshold = \"{t}\""));
    for [a, b] in [[0, 1], [1, 0]] {
        assert!(found([&keys[a], &keys[b]], [&picture; 2], |_, _, _| {}).violated > 0, "{a}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_that_are_missing_doubled_or_beside_are_found() {
    // Every second one lies on the first.
    let piled = |texture: &Texture, i: usize, out: &mut Vec<P2>| {
        if i % 2 == 1 {
            let mut first = Vec::new();
            texture.stroke(0, &mut first);
            out.fill(first[0]);
        }
    };
    // What lies in one quarter of the texture is marked elsewhere in it.
    let gathered = |texture: &Texture, i: usize, out: &mut Vec<P2>| {
        if i < texture.len() / 4 {
            texture.stroke(i + texture.len() / 2, out);
        }
    };
    for keys in SCREENS {
        let keys = format!("{}\n{keys}", PLACES[0]);
        assert!(found([&keys; 2], [&picture; 2], gathered).violated > 0, "{keys}");
        assert!(found([&keys; 2], [&picture; 2], piled).violated > 0, "{keys}");
    }
    for keys in [AREAS[0], AREAS[2]] {
        let keys = format!("{}\n{keys}", PLACES[0]);
        assert!(found([&keys; 2], [&areas; 2], gathered).violated > 0, "{keys}");
    }
    let moved = |texture: &Texture, i: usize, out: &mut Vec<P2>| {
        if i == texture.len() / 2 {
            out.iter_mut().for_each(|p| p.x += (100.0 * NM_PER_MM) as i64);
        }
    };
    for keys in AREAS {
        let keys = format!("{}\n{keys}", PLACES[0]);
        let rule = found([&keys; 2], [&areas; 2], moved);
        assert!(rule.violations.iter().any(|v| v.message.contains("beyond the page")), "{keys}: {rule:?}");
    }
}
