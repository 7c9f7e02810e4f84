//! The table of docs/explanation/method.md, made anew: what every method needs on real parts. `make method-table`
//! writes it into the document; every job folder is verified on the way.

use std::path::Path;

use crate::support::{JobText, compile, folder, number, said, shared, terrace};
use serde_json::Value;

/// A surface file, what the table calls it, and the area that is marked; None for all of the part.
const PARTS: [(&str, &str, Option<[i32; 4]>); 5] = [
    ("hood_mm_bin.stl", "hood, 450 x 450 mm of it", Some([415, -225, 865, 225])),
    ("mirror_freeform.stl", "mirror, 320 x 180 mm", None),
    ("helens_relief_small.stl", "helens relief, 190 x 274 mm", None),
    ("mould_core_draft3.stl", "mould core, 200 x 140 mm", None),
    ("mouse_shell_undercut.stl", "mouse shell, 124 x 61 mm", None),
];

const METHODS: [&str; 4] = ["contour", "z-range", "window", "tilt"];

/// Where the table stands in the document.
const BEGIN: &str = "<!-- make method-table -->\n";
const END: &str = "<!-- end of the table -->\n";

#[test]
#[ignore = "slow, needs ../shared: make test-all, make method-table"]
fn real_parts_by_every_method() {
    let data = shared();
    let dir = folder();
    let mut unproved = Vec::new();
    let mut table = String::from(
        "| part | texture | at least | contour | z-range | window | tilt |\n|---|---|---|---|---|---|---|\n",
    );
    for (file, name, area) in PARTS {
        let path = data.join("surfaces").join(file);
        let [x0, y0, x1, y1] = area.unwrap_or_else(|| extent(&path));
        let area = format!("area = [\"{x0} mm\", \"{y0} mm\", \"{x1} mm\", \"{y1} mm\"]");
        let drawing = data.join("textures/hero_topography.svg").display().to_string();
        for (texture, keys) in [
            ("hatch", format!("pattern = \"hatch\"\npitch = \"1 mm\"\n{area}")),
            (
                "drawing",
                format!(
                    "file = {drawing:?}\nsize = [\"100 mm\", \"100 mm\"]\ntile = true\nfill = \"outline\"\nstroke = \"centre\"\n{area}"
                ),
            ),
        ] {
            let job = |method| {
                let mut job = JobText::on(&path).texture(&keys).method(method);
                // The outline of the shell is not a rectangle.
                job.more = "[limits]\nmax_off_part = \"100 %\"\n".into();
                job.machine = "profile = \"xyz-tilt-galvo-40\"".into();
                let (summary, fault) = run(&job, dir.path());
                eprintln!("{name}, {texture}, {method}: {}", cell(&summary));
                unproved.extend(fault.map(|f| format!("{name}, {texture}, {method}: {f}")));
                summary
            };
            let all = METHODS.map(job);
            let least = number(&all[0], "lower_bound_stops");
            for (method, upright) in METHODS.iter().zip(&all[..3]) {
                assert!(least <= number(upright, "stops"), "{name}, {texture}, {method}");
            }
            let cells = all.each_ref().map(cell).join(" | ");
            table += &format!("| {name} | {texture} | {} | {cells} |\n", thousands(least));
        }
    }
    println!("{table}");
    if let Some(document) = std::env::var_os("METHOD_TABLE") {
        let text = std::fs::read_to_string(&document).expect("the document");
        let (head, rest) = text.split_once(BEGIN).expect("where the table begins");
        let (_, tail) = rest.split_once(END).expect("where the table ends");
        std::fs::write(&document, format!("{head}{BEGIN}\n{table}\n{END}{tail}")).expect("a writable document");
    }
    assert!(unproved.is_empty(), "{}", unproved.join("\n"));
}

/// Compiles and verifies; answers with the summary and what the proof found wrong.
fn run(job: &JobText, dir: &Path) -> (Value, Option<String>) {
    let out = dir.join("job.job");
    let summary = compile(&job.write(dir, "job.toml"), &out);
    let proof = terrace([Path::new("verify"), &out]);
    (summary, (!proof.status.success()).then(|| said(&proof)))
}

/// The part's box seen from the lens, whole mm.
fn extent(stl: &Path) -> [i32; 4] {
    let bytes = std::fs::read(stl).expect("a readable file");
    let mut area = [f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
    for facet in bytes[84..].chunks_exact(50) {
        for corner in facet[12..48].chunks_exact(12) {
            for k in 0..2 {
                let v = f32::from_le_bytes(corner[4 * k..4 * k + 4].try_into().expect("four bytes"));
                area[k] = area[k].min(v);
                area[k + 2] = area[k + 2].max(v);
            }
        }
    }
    area.map(|v| v.round() as i32)
}

/// Stops, time and fragments of a result.
fn cell(summary: &Value) -> String {
    let minutes = number(&summary["time_s"], "total") / 60.0;
    let [stops, fragments] = ["stops", "fragments"].map(|k| thousands(number(summary, k)));
    format!("{stops} · {minutes:.1} min · {fragments}")
}

fn thousands(n: f64) -> String {
    let digits = format!("{n:.0}");
    let parts: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().map(|c| std::str::from_utf8(c).expect("digits")).collect();
    parts.join(",")
}
