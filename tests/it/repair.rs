//! Meshes with faults: each kind is mended, reported or refused by its rule, through the program.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::surfaces::write_stl;
use crate::support::{JobText, compile, folder, said, shared, terrace, verify};

type Facet = [[f64; 3]; 3];

/// A sloping sheet of 20 x 20 mm, 200 facets.
fn sheet() -> Vec<Facet> {
    let p = |i: usize, j: usize| [2.0 * i as f64, 2.0 * j as f64, 0.125 * i as f64];
    let cells = (0..100).map(|k| (k % 10, k / 10));
    let cell = |(i, j)| [[p(i, j), p(i + 1, j), p(i + 1, j + 1)], [p(i, j), p(i + 1, j + 1), p(i, j + 1)]];
    cells.flat_map(cell).collect()
}

/// A job with lines along x over such a sheet.
fn job(dir: &Path, surface: &Path, keys: &str) -> PathBuf {
    let mut job = JobText::on(surface).texture(
        "pattern = \"hatch\"\npitch = \"0.5 mm\"\ndirection = \"0 deg\"\narea = [\"1 mm\", \"1 mm\", \"19 mm\", \"19 mm\"]",
    );
    job.surface = format!("{}\n{keys}", job.surface);
    job.write(dir, "job.toml")
}

/// Codes and texts of the warnings of a summary.
fn warnings(summary: &Value) -> Vec<(String, String)> {
    let text = |w: &Value, key: &str| w[key].as_str().expect("text").to_owned();
    summary["warnings"].as_array().expect("a list").iter().map(|w| (text(w, "code"), text(w, "message"))).collect()
}

#[test]
fn facets_that_change_nothing_are_left_out_with_count_and_place() {
    let dir = folder();
    let (clean, dirty) = (dir.path().join("clean.stl"), dir.path().join("dirty.stl"));
    let facets = sheet();
    write_stl(&clean, &facets);
    let mut more = facets.clone();
    let [a, b, c] = facets[90];
    more.extend([facets[90], [a, c, b], [a, a, b]]);
    more[20].swap(0, 1);
    write_stl(&dirty, &more);
    let want = compile(&job(dir.path(), &clean, ""), &dir.path().join("a"));
    let got = compile(&job(dir.path(), &dirty, ""), &dir.path().join("b"));
    for (code, says) in [
        ("surface-degenerate", "1 facet without area; it is at (10.000, 8.000, 0.625) mm; left out"),
        ("surface-duplicate", "2 facets have the corners of another; one is at"),
        ("surface-winding", "1 facet winds against the neighbours; it is at"),
    ] {
        let found: Vec<_> = warnings(&got).into_iter().filter(|(found, _)| found == code).collect();
        assert!(matches!(&found[..], [(_, text)] if text.starts_with(says)), "{code}: {found:?}");
    }
    assert_eq!((&want["mark_mm"], &want["fragments"]), (&got["mark_mm"], &got["fragments"]));
    let programs = ["a", "b"].map(|name| std::fs::read(dir.path().join(name).join("stage.ngc")).expect("a program"));
    assert_eq!(programs[0], programs[1]);
    assert!(warnings(&want).iter().all(|(code, _)| !code.starts_with("surface-")), "{want}");
    verify(&dir.path().join("b"));
}

#[test]
fn a_fin_is_refused_with_its_place_and_marked_where_that_is_declared() {
    let dir = folder();
    let path = dir.path().join("fin.stl");
    let mut facets = sheet();
    // It leans over the sheet from y = 8 mm on.
    facets.push([[10.0, 8.0, 0.625], [12.0, 8.0, 0.75], [11.0, 9.0, 0.9375]]);
    write_stl(&path, &facets);
    let out = terrace([Path::new("check"), &job(dir.path(), &path, "")]);
    let text = said(&out);
    assert_eq!(out.status.code(), Some(2), "{text}");
    assert!(text.contains("error[surface-non-manifold]: 1 edge joins three facets"), "{text}");
    assert!(text.contains("8.000, 0.") && text.contains("surface.non_manifold = \"topmost\""), "{text}");
    let to = dir.path().join("out");
    let summary = compile(&job(dir.path(), &path, "non_manifold = \"topmost\""), &to);
    assert!(warnings(&summary).iter().any(|(code, _)| code == "surface-non-manifold"), "{summary}");
    verify(&to);
}

#[test]
fn cracks_are_reported_with_the_weld_that_closes_them() {
    let dir = folder();
    let path = dir.path().join("cracked.stl");
    let moved = |f: Facet| if f.iter().all(|p| p[0] >= 10.0) { f.map(|[x, y, z]| [x + 0.004, y, z]) } else { f };
    write_stl(&path, &sheet().into_iter().map(moved).collect::<Vec<_>>());
    let to = dir.path().join("out");
    let cracked = compile(&job(dir.path(), &path, ""), &to);
    let all = warnings(&cracked);
    let (_, text) = all.iter().find(|(code, _)| code == "surface-cracks").unwrap_or_else(|| panic!("{all:?}"));
    assert!(text.contains("22 corners on rims face another rim across a crack up to 0.00400 mm wide"), "{text}");
    verify(&to);
    let closed = compile(&job(dir.path(), &path, "weld = \"4.1 um\""), &to);
    assert!(warnings(&closed).iter().all(|(code, _)| code != "surface-cracks"), "{closed}");
    let length = |summary: &Value| summary["skipped_off_part_mm"].as_f64().expect("a length");
    assert!((length(&cracked) - 36.0 * 0.004).abs() < 0.01 && length(&closed) < 1e-9, "{cracked}");
    verify(&to);
    // Wider than the spot it is a gap of the part.
    let moved = |f: Facet| if f.iter().all(|p| p[0] >= 10.0) { f.map(|[x, y, z]| [x + 0.1, y, z]) } else { f };
    write_stl(&path, &sheet().into_iter().map(moved).collect::<Vec<_>>());
    let codes: Vec<_> =
        warnings(&compile(&job(dir.path(), &path, ""), &to)).into_iter().map(|(code, _)| code).collect();
    assert!(codes.contains(&"off-part".into()) && !codes.contains(&"surface-cracks".into()), "{codes:?}");
}

#[test]
fn the_head_keeps_clear_of_an_upright_sheet_that_nothing_joins() {
    let dir = folder();
    let path = dir.path().join("fin.stl");
    let mut facets = sheet();
    // Higher than the working distance of 150 mm less the clearance of 10 mm.
    facets.push([[10.0, 5.0, 20.0], [10.0, 15.0, 20.0], [10.0, 10.0, 145.0]]);
    write_stl(&path, &facets);
    let out = terrace([Path::new("check"), &job(dir.path(), &path, "")]);
    assert!(!out.status.success() && said(&out).contains("error[clearance"), "{}", said(&out));
}

/// Kinds of faults with their counts.
type Faults = &'static [(&'static str, u64)];

/// File, unit, and the faults that `inspect` counts: duplicates, degenerate and winding as `INDEX.md` has them, where
/// its reader welded alike.
const FILES: &[(&str, &str, Faults)] = &[
    ("hood_mm_bin.stl", "mm", &[]),
    ("hood_quads_uv.obj", "mm", &[]),
    ("mirror_cloud_shuffled.xyz", "mm", &[]),
    ("helmet_outer_open.stl", "mm", &[]),
    ("helmet_shell_undercut.stl", "mm", &[]),
    ("mould_core_draft3.stl", "mm", &[]),
    ("helens_relief_small.stl", "mm", &[]),
    ("busted.STL", "mm", &[]),
    // "20 dup faces, 11 degenerate": pairs without thickness.
    ("propeller_and_shaft.stl", "mm", &[("degenerate", 11), ("duplicate", 20), ("touching", 5)]),
    ("cycloidal.ply", "in", &[("touching", 242)]),
];

#[test]
#[ignore = "needs ../shared: make test-all"]
fn faults_of_surfaces_of_other_sources_are_counted() {
    for (name, unit, want) in FILES {
        let path = shared().join("surfaces").join(name);
        let out = terrace([Path::new("inspect"), &path, Path::new("--unit"), Path::new(unit), Path::new("--json")]);
        assert!(out.status.success(), "{name}: {}", said(&out));
        let json: Value = serde_json::from_slice(&out.stdout).expect("JSON");
        let faults = json["faults"].as_array().expect("a list").iter();
        let found: Vec<(&str, u64)> =
            faults.map(|f| (f["kind"].as_str().expect("a kind"), f["count"].as_u64().expect("a count"))).collect();
        assert_eq!(found, *want, "{name}");
    }
}

/// "5 holes, 10 % flipped, 1 um cracks, 400 duplicates, 200 degenerate + 100 collinear, a fin, 1 stray facet at
/// z=5000". The collinear ones are off their lines by what f32 rounds; the fin is upright and shares no edge with the
/// sheet.
#[test]
#[ignore = "needs ../shared: make test-all"]
fn the_dirty_hood_compiles_with_every_fault_counted_and_verifies() {
    let dir = folder();
    let source = shared().join("surfaces/hood_dirty_bin.stl");
    let out = terrace([Path::new("check"), &job(dir.path(), &source, "")]);
    let text = said(&out);
    assert!(text.contains("1 of 18406 facets reach so far") && out.status.code() == Some(2), "{text}");
    let bytes = std::fs::read(&source).expect("readable");
    let is_near =
        |r: &&[u8]| r[12..48].chunks(4).all(|v| f32::from_le_bytes(v.try_into().expect("4 bytes")).abs() < 4000.0);
    let kept: Vec<&[u8]> = bytes[84..].chunks(50).filter(is_near).collect();
    let path = dir.path().join("hood.stl");
    std::fs::write(&path, [&bytes[..80], &(kept.len() as u32).to_le_bytes(), &kept.concat()].concat())
        .expect("written");
    let with = |keys: &str| {
        let area = "area = [\"300 mm\", \"-690 mm\", \"560 mm\", \"-620 mm\"]";
        let text = format!("pattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"0 deg\"\n{area}");
        let mut job = JobText::on(&path).texture(&text);
        job.surface = format!("{}\n{keys}", job.surface);
        job.focus = "pdof = \"0.5 mm\"".into();
        job.write(dir.path(), "hood.toml")
    };
    let to = dir.path().join("out");
    let mut off = Vec::new();
    for weld in ["", "weld = \"6 um\""] {
        let summary = compile(&with(weld), &to);
        let codes: Vec<String> = warnings(&summary).into_iter().map(|(code, _)| code).collect();
        for code in ["degenerate", "duplicate", "winding", "needles"] {
            assert!(codes.contains(&format!("surface-{code}")), "{code}: {codes:?}");
        }
        assert_eq!(codes.contains(&"surface-cracks".into()), weld.is_empty(), "{codes:?}");
        off.push(summary["skipped_off_part_mm"].as_f64().expect("a length"));
        verify(&to);
    }
    assert!(off[1] < off[0], "{off:?}");
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn the_refusal_of_a_survey_names_keys_with_which_it_compiles() {
    let dir = folder();
    let path = shared().join("surfaces/helens_cloud_utm.xyz");
    let with = |keys: &str| {
        let area = "area = [\"200 mm\", \"200 mm\", \"240 mm\", \"240 mm\"]";
        let text = format!("pattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"0 deg\"\n{area}");
        let mut job = JobText::on(&path).texture(&text);
        job.surface = format!("file = {:?}\nunit = \"m\"\n{keys}", path.display().to_string());
        job.focus = "pdof = \"1 mm\"".into();
        job.write(dir.path(), "survey.toml")
    };
    let out = terrace([Path::new("check"), &with("")]);
    let text = said(&out);
    let want = "surface.datum = [557805, 5108025, 684] puts its lower corner at the origin, and surface.scale = 5e-5";
    assert!(out.status.code() == Some(2) && text.contains(want), "{text}");
    let to = dir.path().join("out");
    compile(&with("datum = [557805, 5108025, 684]\nscale = 5e-5"), &to);
    verify(&to);
}
