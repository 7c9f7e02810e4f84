//! Rules on folders made by hand: a sound one, and one mutant or more for each rule, changed in all
//! files alike with lengths and hashes renewed, that this rule and no other reports.

mod fixtures;
pub(super) mod made;
mod mutants;
pub(super) mod places;
mod scale;
mod writers;

use std::path::Path;

use made::{MM, Made, MadeBlock, p};

use super::Proof;
use terrace_core::geom::Nm;
use terrace_core::machine::{Commanded, Machine, TiltAngles};
use terrace_core::motion;
use terrace_core::program::{Program, StrokeId};
use terrace_plan::manifest::{MANIFEST, Times};

/// The times of a program by the product's own model, and those of its blocks.
fn times(program: &Program, machine: &Machine) -> (Times, Vec<f64>) {
    let centre = |k: usize| {
        let travel = machine.axes()[k].1.travel.map(|t| t.as_nm().expect("travel"));
        ((travel[0] + travel[1]) / 2).0
    };
    let (mut at, mut tilt) = (Commanded([centre(0), centre(1), machine.retract_z().0]), TiltAngles::UPRIGHT);
    let (mut t, mut blocks, mut shift) = (Times::default(), Vec::new(), Nm(0));
    for block in &program.blocks {
        let turning = machine.tilt_time_s(tilt, block.stop.tilt);
        let retract = block.retract.then(|| machine.retract_z());
        let moved = motion::tilting_move(machine, at, block.stage, retract, turning);
        t.zoom += (machine.zoom_time_s(shift, block.focus_shift) - moved.total_s()).max(0.0);
        (at, tilt, shift) = (block.stage, block.stop.tilt, block.focus_shift);
        let marks = program.strokes_of(block).iter().map(|s| {
            let pen = &program.pens[s.pen.index()];
            motion::Mark { points: program.points_of(s), speed: pen.speed, passes: pen.passes, dwell: pen.dwell }
        });
        let m = motion::marking(machine, marks);
        (t.stage, t.settle) = (t.stage + moved.travel_s, t.settle + moved.settle_s);
        (t.mark, t.jump, t.delay) = (t.mark + m.mark_s, t.jump + m.jump_s, t.delay + m.delay_s);
        blocks.push(m.total_s());
    }
    t.total = t.stage + t.settle + t.zoom + t.mark + t.jump + t.delay;
    (t, blocks)
}

/// Whether another byte here changes nothing of an OVF on which a reader acts: a letter of the names of job, part and
/// version, the last figures of a distance in its meta data or of a pose.
fn says_nothing(before: &[u8], after: &[u8], at: usize) -> bool {
    let names: [&[u8]; 3] = [b"job.toml", b"part.stl", concat!("terrace ", env!("CARGO_PKG_VERSION")).as_bytes()];
    let is_in = |name: &&[u8]| {
        before.windows(name.len()).enumerate().any(|(i, w)| w == *name && (i..i + w.len()).contains(&at))
    };
    let is_distance = |start: usize| {
        let value = |bytes: &[u8]| Some(f64::from_le_bytes(bytes.get(start..start + 8)?.try_into().ok()?));
        // The keys of the two fields of eight bytes.
        let is_double = start > 0 && [0x09, 0x11].contains(&before[start - 1]);
        is_double && value(before).zip(value(after)).is_some_and(|(a, b)| (a - b).abs() < 1e-3)
    };
    // The key of the six values of a pose, in packed bytes.
    const POSE: [u8; 2] = [0x62, 24];
    // What single precision does not resolve, as `rules::poses`: mm of a position, degrees of an angle.
    let is_of_pose = |start: usize| {
        let value = |bytes: &[u8]| Some(f32::from_le_bytes(bytes.get(start..start + 4)?.try_into().ok()?));
        let index = (0..6).find(|i| start >= 4 * i + 2 && before[start - 4 * i - 2..].starts_with(&POSE));
        let limit = index.map(|i| if i < 3 { 2e-6 } else { 3e-5 });
        limit.zip(value(before)).zip(value(after)).is_some_and(|((limit, a), b)| (a - b).abs() < limit)
    };
    names.iter().any(is_in)
        || (at.saturating_sub(7)..=at).any(is_distance)
        || (at.saturating_sub(3)..=at).any(is_of_pose)
}

/// Puts the present size and hash of a file into the manifest.
fn renew_hash(folder: &Path, name: &str) {
    if name == MANIFEST {
        return;
    }
    let bytes = std::fs::read(folder.join(name)).expect("a file of the folder");
    alter_manifest(folder, |m| {
        let entry = m["files"].as_array_mut().expect("files").iter_mut().find(|f| f["file"] == name).expect("listed");
        entry["bytes"] = bytes.len().into();
        entry["blake3"] = blake3::hash(&bytes).to_hex().as_str().into();
    });
}

fn alter_manifest(folder: &Path, change: impl FnOnce(&mut serde_json::Value)) {
    let path = folder.join(MANIFEST);
    let bytes = std::fs::read(&path).expect("a manifest");
    let mut manifest = serde_json::from_slice(&bytes).expect("JSON");
    change(&mut manifest);
    std::fs::write(path, serde_json::to_vec(&manifest).expect("JSON")).expect("a writable folder");
}

/// Codes of the rules that are broken.
fn broken(proof: &Proof) -> Vec<&'static str> {
    proof.rules.iter().filter(|r| r.violated > 0).map(|r| r.code).collect()
}

fn assert_only(code: &str, proof: &Proof) {
    assert_eq!(broken(proof), [code], "{}", proof.to_text());
    assert!(!proof.ok);
}

/// Changes the job, renews its figures, and verifies it.
fn mutant(change: impl FnOnce(&mut Made)) -> Proof {
    let mut made = Made::new();
    change(&mut made);
    made.renew();
    made.proof()
}

/// Changes a file of the written folder, renews the hashes, and verifies it.
fn damaged(name: &str, change: impl FnOnce(String) -> String) -> Proof {
    let made = Made::new();
    in_folder(&made, |folder| {
        let text = std::fs::read_to_string(folder.join(name)).expect("text");
        let changed = change(text.clone());
        assert_ne!(changed, text, "the damage does nothing");
        std::fs::write(folder.join(name), changed).expect("write");
        made.write_manifest(folder);
        made.verify(folder)
    })
}

fn in_folder<T>(made: &Made, run: impl FnOnce(&Path) -> T) -> T {
    let dir = tempfile::tempdir().expect("folder");
    let folder = dir.path().join("made.job");
    made.write(&folder);
    run(&folder)
}

#[test]
fn valid_folder_verifies_with_its_lengths() {
    let proof = Made::new().proof();
    assert!(proof.ok, "{}", proof.to_text());
    // Made strokes are neither filled areas nor drawings nor space curves.
    assert!(
        proof.rules.iter().all(|r| r.checked > 0
            || ["fill", "drawing", "bitmap", "mask", "curves", "marked", "measured", "draped"].contains(&r.code)),
        "{}",
        proof.to_text()
    );
    assert_eq!((proof.stops, proof.fragments), (4, 37));
    let l = proof.lengths;
    assert!((l.texture_mm - (9.0 * 83.0 + 3.0 * 18.0)).abs() < 1e-9);
    assert!((l.mark_mm - (9.0 * 80.0 + 54.0)).abs() < 1e-9 && l.overlap_mm == 0.0);
    assert!((l.skipped_off_part_mm - 18.0).abs() < 1e-6 && (l.skipped_steep_mm - 9.0).abs() < 1e-6);
    assert!((proof.worst_defocus_um - 200.0).abs() < 1e-6);
    let json = proof.to_json();
    assert_eq!((json["ok"].as_bool(), json["rules"][0]["code"].as_str()), (Some(true), Some("hash")));
    assert!(proof.to_text().ends_with("verified\n"));
}

#[test]
fn depth_reports_a_shifted_focal_plane() {
    let proof = mutant(|m| m.blocks[1].stop.lpfl += Nm(100_000));
    assert_only("depth", &proof);
    let rule = proof.rule("depth").expect("depth");
    assert_eq!((rule.violated, rule.violations[0].block.as_str()), (9, "B0002"), "the loop stays in focus");
    assert!((proof.worst_defocus_um - 300.0).abs() < 1e-6);
    assert_only("depth", &mutant(|m| m.blocks[2].z[0] += Nm(1_000)));
    assert!(mutant(|m| m.blocks[1].stop.lpfl += Nm(0)).ok);
}

#[test]
fn depth_reports_a_block_beyond_the_depth_range() {
    // Both halves of a section as one block around a mean focal plane.
    let proof = mutant(|m| {
        let other = m.blocks.remove(1);
        let first = &mut m.blocks[0];
        first.marks.extend(other.marks);
        (first.stop.z_hi, first.z[1], first.stop.lpfl) = (other.stop.z_hi, other.z[1], other.stop.z_lo);
        for (level, b) in m.blocks.iter_mut().enumerate() {
            b.stop.level = level as i32;
        }
    });
    assert_only("depth", &proof);
}

#[test]
fn field_reports_marks_outside_the_field() {
    let proof = mutant(|m| m.blocks[3].stop.centre.x -= 5 * MM);
    assert_only("field", &proof);
    assert_eq!(proof.rule("field").expect("field").violated, 9);
}

#[test]
fn travel_reports_targets_beyond_it_or_off_the_increment() {
    assert_only("travel", &mutant(|m| m.origin[0] += 500 * MM));
    assert_only("travel", &mutant(|m| m.origin[1] += 50));
    assert_only("travel", &damaged("stage.ngc", |t| t.replacen("G0 Z200.000000\n", "G0 Z201.000000\n", 1)));
}

#[test]
fn once_reports_a_doubled_mark() {
    let proof = mutant(|m| {
        let again = m.blocks[0].marks[4].clone();
        m.blocks[0].marks.push(again);
    });
    assert_only("once", &proof);
    assert!((proof.lengths.overlap_mm - 20.0).abs() < 1e-9);
    // The loop again from another block that reaches it, and with a share of it only.
    let proof = mutant(|m| {
        let mut part = m.blocks[1].marks[9].clone();
        part.points.truncate(2);
        part.points[1] = p(27.0, 5.0);
        m.blocks[1].marks.push(part);
    });
    assert_only("once", &proof);
    assert!((proof.lengths.overlap_mm - 6.0).abs() < 1e-9, "three passes");
}

#[test]
fn once_allows_overlaps_as_declared_and_no_others() {
    // Line 0 continues in block 1 from 20 mm; both may reach over that cut. Level 1 begins at 0.4 mm height there.
    let overlapping = |declared: f64, by: i64, change: &dyn Fn(&mut Made)| {
        let mut made = Made::new();
        made.facts.overlap_nm = declared;
        let MadeBlock { stop, z, marks, .. } = &mut made.blocks[1];
        marks[0].points[0].x -= by;
        let low = Nm(by / 50);
        (stop.z_lo, z[0]) = (stop.z_lo - low, z[0] - low);
        (stop.z_hi, stop.lpfl) = (stop.z_hi, stop.lpfl);
        made.facts.depth_range = Nm(410_000);
        made.facts.pdof = made.facts.depth_range;
        change(&mut made);
        made.renew();
        made.summary["overlap_mm"] = (by as f64 / 1e6).into();
        made.summary["worst_defocus_um"] = (200.0 + low.f64() / 1e3).into();
        for key in ["skipped_mm", "skipped_off_part_mm"] {
            let stated = made.summary[key].as_f64().expect("a number");
            made.summary[key] = (stated + by as f64 / 1e6).into();
        }
        made.proof()
    };
    let none = |_: &mut Made| {};
    let proof = overlapping(50_000.0, 50_000, &none);
    assert!(proof.ok, "{}", proof.to_text());
    assert!((proof.lengths.overlap_mm - 0.05).abs() < 1e-9);
    assert!(overlapping(50_000.0, 30_000, &none).ok, "a shorter one is counted too");
    assert_only("once", &overlapping(50_000.0, 50_010, &none));
    assert_only("once", &overlapping(0.0, 50_000, &none));
    // A piece in the middle of a mark, from another block and no longer than an overlap.
    let proof = overlapping(50_000.0, 30_000, &|m| {
        let mut again = m.blocks[0].marks[4].clone();
        again.points = vec![p(19.93, 10.0), p(19.96, 10.0)];
        m.blocks[1].marks.push(again);
        (m.blocks[1].stop.z_lo, m.blocks[1].z[0]) = (Nm(398_600), Nm(398_600));
    });
    assert!(broken(&proof).contains(&"once"), "{}", proof.to_text());
    // A third mark over the same place: line 0 again, from where the overlap begins to its end.
    let proof = overlapping(50_000.0, 50_000, &|m| {
        let again = m.blocks[1].marks[0].clone();
        m.blocks[1].marks.push(again);
    });
    assert!(broken(&proof).contains(&"once"), "{}", proof.to_text());
    // What the manifest declares is what the job does.
    let mut made = Made::new();
    made.facts.overlap_nm = 50_000.0;
    made.renew();
    let mut other = made.clone();
    other.facts.overlap_nm = 0.0;
    in_folder(&made, |folder| assert_only("agreement", &other.verify(folder)));
}

#[test]
fn a_closed_figure_may_begin_at_any_vertex_that_it_names() {
    let turned = |by: usize, segment: u32, reversed: bool| {
        mutant(|m| {
            let mark = &mut m.blocks[1].marks[9];
            let n = mark.points.len() - 1;
            mark.points = (0..=n).map(|i| mark.points[(i + by) % n]).collect();
            (mark.segment, mark.reversed) = (segment, reversed);
            if reversed {
                mark.points.reverse();
            }
        })
    };
    for by in 0..4 {
        for reversed in [false, true] {
            let proof = turned(by, by as u32, reversed);
            assert!(proof.ok, "{by}: {}", proof.to_text());
            assert!((proof.lengths.mark_mm - (9.0 * 80.0 + 54.0)).abs() < 1e-9);
            assert_only("source", &turned(by, (by as u32 + 1) % 4, reversed));
        }
    }
    // Turned over its seam without closing, a mark is not a piece of the stroke.
    let proof = mutant(|m| {
        let mark = &mut m.blocks[1].marks[9];
        mark.points = [2, 3, 0, 1].map(|i| mark.points[i]).to_vec();
        mark.segment = 2;
    });
    assert!(broken(&proof).contains(&"source"), "{}", proof.to_text());
}

#[test]
fn coverage_reports_missing_marks() {
    let proof = mutant(|m| drop(m.blocks[2].marks.remove(3)));
    assert_only("coverage", &proof);
    let violation = &proof.rule("coverage").expect("coverage").violations[0];
    assert_eq!((violation.block.as_str(), violation.place.as_str()), ("B0002", "part at (40.000000, 8.000000) mm"));
    // 12 nm between two blocks: more than rounding, less than anyone would see.
    assert_only("coverage", &mutant(|m| m.blocks[0].marks[0].points[1].x -= 12));
    // Stretches below min_mark may be skipped, but not longer ones.
    let skip = |by_nm: i64, min_mark_nm, only_slivers| {
        let mut made = Made::new();
        (made.facts.min_mark_nm, made.facts.only_slivers) = (min_mark_nm, only_slivers);
        made.blocks[0].marks[0].points[1].x -= by_nm;
        made.renew();
        for (key, by) in [("skipped_off_part_mm", -by_nm as f64 / 1e6), ("skipped_small_mm", by_nm as f64 / 1e6)] {
            let stated = made.summary[key].as_f64().expect("a number");
            made.summary[key] = (stated + by).into();
        }
        made.proof()
    };
    let proof = skip(3_000, 5_000.0, false);
    assert!(proof.ok, "{}", proof.to_text());
    assert_only("coverage", &skip(3_000, 1_000.0, false));
    // The block could have gone on: no cut made a sliver of it.
    assert_only("coverage", &skip(30_000, 50_000.0, true));
}

#[test]
fn coverage_reports_what_is_no_sliver_next_to_a_mark() {
    let proof = |change: fn(&mut Made)| {
        mutant(|m| {
            (m.facts.min_mark_nm, m.facts.only_slivers) = (30e6, true);
            change(m);
        })
    };
    let whole = proof(|m| m.blocks[1].marks.retain(|mark| mark.source != StrokeId(9)));
    assert!(broken(&whole).contains(&"coverage"), "a figure is missing: {}", whole.to_text());
    // A line of two marks at its ends lacks less than it may between them; with one mark it lacks more.
    let between = proof(|m| {
        m.blocks[1].marks.remove(0);
        m.blocks[2].marks.remove(0);
    });
    assert!(!broken(&between).contains(&"coverage"), "{}", between.to_text());
    let beyond = proof(|m| {
        m.blocks[2].marks.remove(0);
        m.blocks[3].marks.remove(0);
    });
    assert!(broken(&beyond).contains(&"coverage"), "{}", beyond.to_text());
}

#[test]
fn surface_reports_marks_off_the_part() {
    let proof = mutant(|m| {
        m.blocks[0].marks[0].points[0].x -= 20;
    });
    assert_eq!(broken(&proof), ["field", "surface"], "the part's edge is the field's, so both: {}", proof.to_text());
    let proof = mutant(|m| {
        for b in &mut m.blocks[2..] {
            b.stop.centre.x += MM;
        }
        m.blocks[3].marks[0].points[1].x += 500_000;
    });
    assert!(broken(&proof).contains(&"surface"), "a mark on the steep strip");
    // One or two nanometres beyond the border are rounding.
    assert!(mutant(|m| m.strokes[8].1[0] = p(-0.5, 18.0)).ok);
}

#[test]
fn source_reports_marks_that_are_not_of_the_texture() {
    // Along the level lines of the ramp nothing but the place changes.
    let aside = mutant(|m| m.blocks[0].marks[2].points.iter_mut().for_each(|p| p.y += 1_000));
    assert_only("source", &aside);
    assert_only("source", &mutant(|m| m.blocks[0].marks[2].reversed = true));
    assert_only("source", &mutant(|m| m.blocks[0].marks[2].segment = 1));
    assert_only("source", &mutant(|m| m.blocks[0].marks[2].source = StrokeId(5)));
    assert_only("source", &mutant(|m| m.blocks[0].marks[2].source = StrokeId(7_000)));
    assert_only("source", &mutant(|m| m.blocks[1].marks[9].points[2].x += 2));
}

#[test]
fn agreement_reports_a_change_of_one_file() {
    let cases: [(&str, &str, &str); 12] = [
        ("blocks/B0002.dxf", "-8.000000", "-8.000001"),
        ("blocks/B0002.dxf", "B0002_P2", "B0002_P1"),
        ("blocks/B0003.dxf", "0\r\nLINE", "0\r\nPOINT"),
        ("blocks/B0001.dxf", "0\r\nEOF\r\n", ""),
        ("stage.ngc", "Z0.600000", "Z0.600100"),
        ("stage.ngc", "BLOCK B0003", "BLOCK B0004"),
        ("stage.ngc", "G21 ", ""),
        ("stage_m0.nc", "X20.000000", "X-20.000000"),
        ("program.txt", "\nblocks 4\n", "\nblocks 3\n"),
        ("program.txt", "1000 mm/s", "1001 mm/s"),
        ("program.txt", "block B0002 0 0 1", "block B0002 0 0 2"),
        ("program.txt", "\nend\n", "\n"),
    ];
    for (name, from, to) in cases {
        let proof = damaged(name, |t| t.replacen(from, to, 1));
        assert_eq!(broken(&proof), ["agreement"], "{name} {from:?}: {}", proof.to_text());
    }
}

#[test]
fn agreement_reports_every_changed_value_of_the_ovf() {
    let made = Made::new();
    in_folder(&made, |folder| {
        let path = folder.join("job.ovf");
        let sound = std::fs::read(&path).expect("bytes");
        let mut silent = 0;
        for at in (0..sound.len()).step_by(7) {
            let mut bytes = sound.clone();
            bytes[at] ^= 0x40;
            if says_nothing(&sound, &bytes, at) {
                continue;
            }
            std::fs::write(&path, &bytes).expect("write");
            made.write_manifest(folder);
            match broken(&made.verify(folder)).as_slice() {
                ["agreement"] => {}
                [] => silent += 1,
                other => panic!("byte {at}: {other:?}"),
            }
        }
        assert_eq!(silent, 0, "of {} bytes", sound.len());
        for end in [0, 3, 11, 12, 40, sound.len() / 2, sound.len() - 1] {
            std::fs::write(&path, &sound[..end]).expect("write");
            made.write_manifest(folder);
            assert_only("agreement", &made.verify(folder));
        }
    });
}

#[test]
fn laser_reports_stage_programs_that_could_fire_in_a_move() {
    let cases: [(&str, &str, &str); 15] = [
        ("stage.ngc", "M64 P0\n", ""),
        ("stage.ngc", "G4 P0.100\n", ""),
        ("stage.ngc", "G4 P0.100\n", "G4 P0.099\n"),
        ("stage.ngc", "endif\nM65 P0\nM66", "endif\nM66"),
        ("stage.ngc", "M66 P0 L4 Q2\n", ""),
        ("stage.ngc", "M66 P0 L4 Q11\n", ""),
        ("stage.ngc", "o2 if [#5399 LT 0]\n", ""),
        ("stage.ngc", "(MSG, no BUSY, block B0001)\nM65 P0\nM2\n", "(MSG, no BUSY, block B0001)\nM2\n"),
        ("stage.ngc", "(MSG, no BUSY, block B0001)\nM65 P0\nM2\n", "(MSG, no BUSY, block B0001)\nM65 P0\n"),
        ("stage.ngc", "G21 G90", "G21 G64 G90"),
        ("stage.ngc", "G54\nM65 P0\n", "G54\nM62 P0\n"),
        ("stage.ngc", "G0 Z200.000000\nM65 P0\nM2\n", "G0 Z200.000000\nM64 P0\nM2\n"),
        ("stage.ngc", "G0 Z200.000000\nM65 P0\nM2\n", "G0 Z200.000000\nM65 P0\n"),
        ("stage_m0.nc", "M0 (mark B0001)\n", ""),
        ("stage_m0.nc", "G92.1\nM5\n", "G92.1\nM3\n"),
    ];
    for (name, from, to) in cases {
        let proof = damaged(name, |t| t.replacen(from, to, 1));
        // A mode is also one of those that every program begins with.
        let expected: &[&str] = if to.contains("G64") { &["agreement", "laser"] } else { &["laser"] };
        assert_eq!(broken(&proof), expected, "{name} {from:?}: {}", proof.to_text());
    }
}

#[test]
fn summary_reports_figures_that_differ() {
    for key in ["stops", "fragments"] {
        let mut made = Made::new();
        made.summary[key] = 3.into();
        assert_only("summary", &made.proof());
    }
    for key in [
        "texture_mm",
        "mark_mm",
        "overlap_mm",
        "skipped_mm",
        "skipped_off_part_mm",
        "skipped_steep_mm",
        "skipped_small_mm",
        "worst_defocus_um",
    ] {
        let mut made = Made::new();
        let stated = made.summary[key].as_f64().expect("a number");
        made.summary[key] = (stated + 0.01).into();
        assert_only("summary", &made.proof());
    }
}

#[test]
fn hash_reports_changed_bytes_files_and_inputs() {
    let made = Made::new();
    let cases: [(&str, Option<&[u8]>); 4] =
        [("layout.svg", Some(b"<svg>>")), ("layout.svg", None), ("blocks/note.txt", Some(b"")), ("extra", Some(b"x"))];
    for (name, bytes) in cases {
        in_folder(&made, |folder| {
            match bytes {
                Some(bytes) => std::fs::write(folder.join(name), bytes).expect("write"),
                None => std::fs::remove_file(folder.join(name)).expect("remove"),
            }
            assert_only("hash", &made.verify(folder));
        });
    }
    in_folder(&made, |folder| {
        std::fs::write(folder.join("../part.stl"), b"another part").expect("write");
        let proof = super::verify(folder, None).expect("a proof");
        assert_only("hash", &proof);
        assert!(!proof.rule("depth").expect("depth").ran && proof.rule("laser").expect("laser").ran);
        let elsewhere = tempfile::tempdir().expect("folder");
        assert_only("hash", &super::verify(folder, Some(elsewhere.path())).expect("a proof"));
    });
}

#[test]
fn a_listed_path_never_leads_out_of_the_folder() {
    let made = Made::new();
    in_folder(&made, |folder| {
        let path = folder.join("manifest.json");
        let text = std::fs::read_to_string(&path).expect("text").replace("\"layout.svg\"", "\"../job.toml\"");
        std::fs::write(&path, text).expect("write");
        let proof = made.verify(folder);
        assert_only("hash", &proof);
        assert!(proof.rule("hash").expect("hash").violations.iter().any(|v| v.message.contains("not a path inside")));
        made.write_manifest(folder);
        let text = std::fs::read_to_string(&path)
            .expect("text")
            .replace("{\"dxf\":\"blocks/B0002.dxf\"}", "{\"dxf\":\"/dev/zero\"}");
        std::fs::write(&path, text).expect("write");
        assert_only("agreement", &made.verify(folder));
    });
}

#[test]
fn folder_with_an_invalid_manifest_is_an_error_with_a_hint() {
    let made = Made::new();
    let code = |folder: &Path| super::verify(folder, None).expect_err("no manifest").diags()[0].code;
    in_folder(&made, |folder| {
        let path = folder.join("manifest.json");
        let sound = std::fs::read_to_string(&path).expect("text");
        for text in [&sound[..sound.len() / 2], "", "{}", "[1e999]", &sound.replace("\"schema\":4", "\"schema\":2")] {
            std::fs::write(&path, text).expect("write");
            assert_eq!(code(folder), "manifest");
        }
        std::fs::remove_file(&path).expect("remove");
        assert_eq!(code(folder), "job-folder");
        assert_eq!(code(&folder.join("nowhere")), "job-folder");
    });
}

#[test]
fn damaged_text_files_never_panic() {
    let made = Made::new();
    in_folder(&made, |folder| {
        for name in ["program.txt", "stage.ngc", "blocks/B0002.dxf"] {
            let path = folder.join(name);
            let sound = std::fs::read(&path).expect("bytes");
            for (i, at) in (0..sound.len()).step_by(sound.len() / 150 + 1).enumerate() {
                let mut bytes = sound.clone();
                bytes[at] = b"9-. \n\xffGZ"[i % 8];
                std::fs::write(&path, &bytes).expect("write");
                let proof = made.verify(folder);
                assert!(!proof.ok || bytes == sound);
            }
            std::fs::write(&path, &sound).expect("write");
        }
    });
}
