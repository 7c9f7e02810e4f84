//! `view.html`: what the page is given is the job, decoded here by a reader of its own.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use terrace_core::math;

use base64::Engine;
use serde_json::Value;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, manifest, number};

/// The data of a page by name; `head` is JSON.
struct Page {
    head: Value,
    data: BTreeMap<String, Vec<u8>>,
    blocks: Value,
}

/// Bytes that are read one after the other.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take(&mut self, count: usize) -> Vec<u8> {
        let (head, rest) = self.0.split_at(count);
        self.0 = rest;
        head.to_vec()
    }
    fn u32(&mut self) -> usize {
        u32::from_le_bytes(self.take(4).try_into().expect("four bytes")) as usize
    }
    /// Numbers of so many planes of bytes.
    fn planes(&mut self, count: usize, planes: usize) -> Vec<u32> {
        let bytes: Vec<Vec<u8>> = (0..planes).map(|_| self.take(count)).collect();
        (0..count).map(|i| bytes.iter().rev().fold(0, |v, plane| v << 8 | u32::from(plane[i]))).collect()
    }
    fn i16_delta(&mut self, count: usize) -> Vec<f64> {
        let mut last = 0u16;
        let add = |d: u32| {
            last = last.wrapping_add(d as u16);
            f64::from(last as i16)
        };
        self.planes(count, 2).into_iter().map(add).collect()
    }
    fn u32_delta(&mut self, count: usize) -> Vec<u32> {
        let mut last = 0u32;
        let add = |d: u32| {
            last = last.wrapping_add(d);
            last
        };
        self.planes(count, 4).into_iter().map(add).collect()
    }
}

impl Page {
    fn of(folder: &Path) -> Self {
        let text = std::fs::read_to_string(folder.join("view.html")).expect("view.html");
        let mut data = BTreeMap::new();
        for part in text.split("<script id=\"data-").skip(1) {
            let (name, rest) = part.split_once('"').expect("a name");
            let inner = rest.split_once('>').expect("a tag").1.split_once("</script>").expect("an end").0;
            let packed = base64::engine::general_purpose::STANDARD.decode(inner).expect("base64");
            let mut plain = Vec::new();
            flate2::read::DeflateDecoder::new(&packed[..]).read_to_end(&mut plain).expect("deflate");
            data.insert(name.to_owned(), plain);
        }
        let head = text.split_once("<script id=\"head\" type=\"application/json\">").expect("a head").1;
        let head = serde_json::from_str(head.split_once("</script>").expect("an end").0).expect("JSON");
        let blocks = serde_json::from_slice(&data["blocks"]).expect("JSON");
        Self { head, data, blocks }
    }

    fn chunks(&self) -> impl Iterator<Item = Chunk> + '_ {
        self.head["chunks"].as_array().expect("chunks").iter().map(|head| {
            let mut bytes = Bytes(&self.data[head["name"].as_str().expect("a name")]);
            let (marks, points) = (bytes.u32(), bytes.u32());
            assert_eq!((head["marks"].as_u64(), head["points"].as_u64()), (Some(marks as u64), Some(points as u64)));
            let first = head["first"].as_u64().expect("a number") as usize;
            let block = bytes.planes(marks, 2).into_iter().map(|b| first + b as usize).collect();
            bytes.take(marks);
            let len = bytes.planes(marks, 2).into_iter().map(|n| n as usize).collect();
            let steps = [number(head, "xy_mm"), number(head, "xy_mm"), number(head, "z_mm")];
            let axes = steps.map(|mm| bytes.i16_delta(points).into_iter().map(|v| v * mm).collect::<Vec<f64>>());
            let incidence = bytes.take(points).into_iter().map(|v| f64::from(v) * 0.25).collect();
            let is_on_the_fly = self.head["mode"] == "on-the-fly";
            let times = if is_on_the_fly { (bytes.i16_delta(points), bytes.u32_delta(points)).1 } else { Vec::new() };
            assert!(bytes.0.is_empty());
            let at = (0..points).map(|i| [axes[0][i], axes[1][i], axes[2][i]]).collect();
            Chunk { block, len, at, incidence, times, step: steps[0].max(steps[2]) }
        })
    }

    /// A point of a block in the part frame.
    fn part(&self, block: usize, at: [f64; 3]) -> [f64; 3] {
        let numbers =
            |v: &Value| v.as_array().expect("numbers").iter().map(|v| v.as_f64().expect("a number")).collect();
        let frame: Vec<f64> = match &self.blocks["frame"][block] {
            Value::Null => {
                let origin: Vec<f64> = numbers(&self.blocks["origin"][block]);
                return [0, 1, 2].map(|k| origin[k] + at[k]);
            }
            frame => numbers(frame),
        };
        [0, 1, 2].map(|i| frame[9 + i] + (0..3).map(|k| frame[3 * i + k] * at[k]).sum::<f64>())
    }
}

/// The marks of some blocks.
struct Chunk {
    block: Vec<usize>,
    len: Vec<usize>,
    at: Vec<[f64; 3]>,
    incidence: Vec<f64>,
    times: Vec<u32>,
    step: f64,
}

/// A hatch on a part of the dome.
fn job(dir: &Path, machine: &str, method: &'static str, more: &str) -> std::path::PathBuf {
    let stl = dir.join("dome.stl");
    if !stl.exists() {
        write_stl(&stl, &mesh(60, [110.0, 70.0, 170.0, 130.0], dome));
    }
    let mut job =
        JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"20 deg\"").method(method);
    job.machine = machine.into();
    job.more = more.into();
    job.write(dir, "job.toml")
}

/// How far the facets of the test's dome lie below it, mm: cells of 1 mm.
const FACETS_MM: f64 = 3e-3;

/// Every mark lies where the manifest has its block, on the part, and is as far out of focus as the manifest says.
fn assert_marks_are_the_jobs(folder: &Path, summary: &Value) {
    let (page, m) = (Page::of(folder), manifest(folder));
    let blocks = m["blocks"].as_array().expect("blocks");
    let within = number(&page.head["thinned"], "within_um") / 1000.0;
    let mut defocus = vec![[f64::INFINITY, f64::NEG_INFINITY]; blocks.len()];
    let mut marks = vec![0; blocks.len()];
    let mut length = 0.0;
    let mut steepest = 0f64;
    for chunk in page.chunks() {
        let mut first = 0;
        for (&block, &len) in chunk.block.iter().zip(&chunk.len) {
            let points = &chunk.at[first..first + len];
            marks[block] += 1;
            for (&at, &deg) in points.iter().zip(&chunk.incidence[first..]) {
                defocus[block] = [defocus[block][0].min(at[2]), defocus[block][1].max(at[2])];
                steepest = steepest.max(deg);
                let [x, y, z] = page.part(block, at);
                let off = (z - dome(x, y)).abs();
                assert!(off < FACETS_MM + within + 2.0 * chunk.step, "{off} mm off the part at {x}, {y}");
            }
            let parts: Vec<[f64; 3]> = points.iter().map(|&at| page.part(block, at)).collect();
            length += parts.windows(2).map(|w| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1])).sum::<f64>();
            first += len;
        }
    }
    for (i, block) in blocks.iter().enumerate() {
        assert_eq!(block["strokes"].as_u64(), Some(marks[i]), "{block}");
        for (k, key) in ["z_lo_mm", "z_hi_mm"].into_iter().enumerate() {
            let stated = number(block, key) - number(block, "lpfl_mm");
            assert!((defocus[i][k] - stated).abs() < within + 1e-4, "{key} of {block}: {} in the page", defocus[i][k]);
        }
        for key in ["id", "stage"] {
            assert_eq!(page.blocks[key][i], block[key]);
        }
        assert_eq!(page.blocks["focus"][i], block["lpfl_mm"]);
        let time = |key: &str| page.blocks[key][i].as_f64().expect("a time");
        assert!((time("end") - time("start") - number(block, "time_s")).abs() < 1e-9, "{block}");
        assert!(i == 0 || (time("begin") - page.blocks["end"][i - 1].as_f64().expect("a time")).abs() < 1e-12);
    }
    let last = page.blocks["end"][blocks.len() - 1].as_f64().expect("a time");
    assert!((last - number(&summary["time_s"], "total")).abs() < 1e-6, "{last}");
    assert!((length / number(summary, "mark_mm") - 1.0).abs() < 1e-4, "{length}");
    assert!((steepest - number(summary, "worst_incidence_deg")).abs() <= 0.13, "{steepest}");
}

#[test]
fn marks_of_stepped_jobs_lie_on_the_part_and_their_clock_is_the_machines() {
    let dir = folder();
    let passes = "[passes]\ncount = 2\nrotate = \"67 deg\"\nlower = \"8 um\"\n";
    let tilt = "profile = \"xyz-tilt-galvo-40\"";
    for (machine, method, more) in [
        ("profile = \"xyz-galvo-40\"", "z-range", passes),
        ("profile = \"xyz-zoom-40\"", "z-range", ""),
        (tilt, "tilt", ""),
    ] {
        let out = dir.path().join("job.job");
        let summary = compile(&job(dir.path(), machine, method, more), &out);
        assert_marks_are_the_jobs(&out, &summary);
        let page = Page::of(&out);
        assert_eq!(page.head["travel"].as_array().map(Vec::len), Some(1));
        let tilted = page.blocks["frame"].as_array().expect("frames").iter().filter(|f| !f.is_null()).count();
        assert_eq!(tilted > 0, method == "tilt", "{tilted} tilted blocks");
        // Every label of a map is a block of its pass, and most of the texture's box is covered.
        for map in page.head["maps"].as_array().expect("maps") {
            let count = (map["columns"].as_u64().expect("a count") * map["rows"].as_u64().expect("a count")) as usize;
            let labels = Bytes(&page.data[map["name"].as_str().expect("a name")]).planes(count, 4);
            let of_pass = |l: u32| page.blocks["pass"][l as usize - 1] == map["pass"];
            assert!(labels.iter().filter(|&&l| l > 0).all(|&l| of_pass(l)));
            assert!(labels.iter().filter(|&&l| l > 0).count() * 2 > count);
        }
    }
}

#[test]
fn marks_on_the_fly_lie_on_the_part_in_the_order_of_their_times() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    let z = |x: f64, y: f64| 0.004 * (x * x + y * y) + 0.02 * x;
    write_stl(&stl, &mesh(12, [-6.0, -5.0, 6.0, 5.0], z));
    let mut text = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"4 mm\"").method("auto");
    text.machine = "profile = \"xyz-galvo-100\"".into();
    text.more = "".into();
    let file = text.write(dir.path(), "job.toml");
    let out = dir.path().join("job.fly.job");
    let args =
        ["compile", &file.display().to_string(), "--mode", "on-the-fly", "-o", &out.display().to_string(), "--json"];
    let done = crate::support::terrace(args);
    assert!(done.status.success(), "{}", crate::support::said(&done));
    let summary: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    let page = Page::of(&out);
    let (mut last, mut length) = (0, 0.0);
    for chunk in page.chunks() {
        let mut first = 0;
        for (&block, &len) in chunk.block.iter().zip(&chunk.len) {
            let points: Vec<[f64; 3]> = chunk.at[first..first + len].iter().map(|&at| page.part(block, at)).collect();
            // Facets of 1 mm of a paraboloid lie up to 0.002 mm off it.
            assert!(points.iter().all(|p| (p[2] - z(p[0], p[1])).abs() < 4e-3), "{points:?}");
            length += points.windows(2).map(|w| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1])).sum::<f64>();
            first += len;
        }
        for &us in &chunk.times {
            assert!(us >= last, "{us} after {last}");
            last = us;
        }
    }
    assert!(f64::from(last) / 1e6 <= number(&summary, "time_s"));
    assert!((length / number(&summary, "mark_mm") - 1.0).abs() < 1e-4, "{length}");
    let samples = page.head["motion"]["samples"].as_u64().expect("samples") as usize;
    assert_eq!(page.data["motion"].len(), samples * (10 * 4 + 1));
}

#[test]
fn what_is_not_marked_is_given_with_its_reason_share_and_place() {
    let dir = folder();
    // A plate of 40 x 40 mm with a hole of 8 x 8 mm and a flank of 70 degrees from x = 30 on.
    let z = |x: f64, _: f64| if x < 30.0 { 0.0 } else { -(x - 30.0) * math::tan(70f64.to_radians()) };
    let facets: Vec<_> = mesh(40, [0.0, 0.0, 40.0, 40.0], z)
        .into_iter()
        .filter(|f| {
            let [x, y] = [0, 1].map(|k| f.iter().map(|p| p[k]).sum::<f64>() / 3.0);
            !((10.0..18.0).contains(&x) && (16.0..24.0).contains(&y))
        })
        .collect();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &facets);
    let hatch = "pattern = \"hatch\"\npitch = \"1 mm\"\narea = [\"-5 mm\", \"2 mm\", \"38 mm\", \"38 mm\"]";
    let mut text = JobText::on(&stl).texture(hatch).method("z-range");
    text.more = "[limits]\nmax_off_part = \"30 %\"\n".into();
    let out = dir.path().join("job.job");
    let summary = compile(&text.write(dir.path(), "job.toml"), &out);
    let page = Page::of(&out);
    let rows = page.head["skipped"].as_array().expect("rows");
    let row =
        |reason: &str| rows.iter().find(|r| r["reason"] == reason).unwrap_or_else(|| panic!("{reason}: {rows:?}"));
    let edges = |reason: &str| {
        row(reason)["box"].as_array().expect("a box").iter().map(|v| v.as_f64().expect("mm")).collect::<Vec<_>>()
    };
    let near = |a: &[f64], b: [f64; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1.01);
    assert!(near(&edges("off-part"), [-5.0, 2.0, 0.0, 38.0]), "{rows:?}");
    assert!(near(&edges("hole"), [10.0, 16.0, 18.0, 24.0]), "{rows:?}");
    assert!(near(&edges("steep"), [30.0, 2.0, 38.0, 38.0]), "{rows:?}");
    let sum = |keys: &[&str]| keys.iter().map(|k| number(row(k), "length_mm")).sum::<f64>();
    assert!((sum(&["off-part", "hole"]) - number(&summary, "skipped_off_part_mm")).abs() < 1e-3);
    assert!((sum(&["steep"]) - number(&summary, "skipped_steep_mm")).abs() < 1e-3);
    let share = number(row("steep"), "share_percent");
    assert!((share - 100.0 * sum(&["steep"]) / number(&summary, "texture_mm")).abs() < 1e-9, "{share}");
    let lines = page.head["skipped_lines"]["lines"].as_u64().expect("lines") as usize;
    assert!(lines >= 37 + 8 + 37, "{lines} lines");
    // A pattern over the part's box may leave the part: that is not a fault, and its hole is one.
    let mut text = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").method("z-range");
    text.machine = format!("file = {:?}", dir.path().join("machine.txt").display().to_string());
    std::fs::write(dir.path().join("machine.txt"), machine_file("xyz-galvo-40")).expect("a writable folder");
    compile(&text.write(dir.path(), "job.toml"), &out);
    let page = Page::of(&out);
    let reasons: Vec<&str> =
        page.head["skipped"].as_array().expect("rows").iter().filter_map(|r| r["reason"].as_str()).collect();
    assert_eq!(reasons[..2], ["hole", "steep"]);
    assert!(!reasons.contains(&"off-part") && !reasons.contains(&"beyond"), "{reasons:?}");
}
