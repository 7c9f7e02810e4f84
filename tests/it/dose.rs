//! Effects of slope on marks: incidence, stretch and dose, and pens that compensate for it.

use std::path::Path;
use terrace_core::math;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, assert_balance, compile, folder, manifest, number, said, terrace, verify};
use serde_json::Value;

/// A job on a plate that rises by `deg` along x.
fn ramp(dir: &Path, deg: f64, more: &str) -> JobText {
    let stl = dir.join("ramp.stl");
    let tan = math::tan(deg.to_radians());
    write_stl(&stl, &mesh(20, [0.0, 0.0, 30.0, 20.0], |x, _| x * tan));
    let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"0.5 mm\"").method("z-range");
    job.focus = "pdof = \"2 mm\"".into();
    job.more = more.into();
    job
}

fn near(value: &Value, want: f64, tolerance: f64) -> bool {
    value.as_f64().is_some_and(|v| (v - want).abs() <= tolerance)
}

#[test]
fn manifest_states_incidence_stretch_and_dose_of_blocks() {
    let dir = folder();
    for deg in [0.0, 12.0, 30.0] {
        let out = dir.path().join("job.job");
        compile(&ramp(dir.path(), deg, "").write(dir.path(), "job.toml"), &out);
        let cos = math::cos(f64::to_radians(deg));
        for b in manifest(&out)["blocks"].as_array().expect("blocks") {
            // Vertices in f32 turn facets a little.
            for k in 0..2 {
                assert!(near(&b["incidence_deg"][k], deg, 0.02), "{b}");
                assert!(near(&b["stretch"][k], 1.0 / cos, 1e-4), "{b}");
                assert!(near(&b["dose"][k], cos, 1e-4), "{b}");
            }
        }
        let text = |name: &str| std::fs::read_to_string(out.join(name)).expect("text");
        assert!(text("slope.svg").contains("mean incidence, deg"));
        assert!(!text("layout.svg").contains("mean incidence"));
        assert!(text("report.html").contains("Slope under the marks"));
    }
}

#[test]
fn pens_compensate_for_the_slope() {
    let dir = folder();
    let plain = compile(&ramp(dir.path(), 30.0, "").write(dir.path(), "job.toml"), &dir.path().join("plain.job"));
    for (what, factor, name) in [("speed", 0.87, "fill x0.87"), ("power", 1.15, "fill x1.15")] {
        let out = dir.path().join(format!("{what}.job"));
        let job = ramp(dir.path(), 30.0, &format!("[dose]\ncompensate = \"{what}\""));
        let summary = compile(&job.write(dir.path(), "job.toml"), &out);
        assert_balance(&summary, &verify(&out));
        let m = manifest(&out);
        let pens = m["pens"].as_array().expect("pens");
        assert_eq!(pens.len(), 2, "{pens:?}");
        assert_eq!(pens[1]["name"], name);
        assert!(m["blocks"].as_array().expect("blocks").iter().all(|b| b["pens"] == serde_json::json!([name])));
        let [speed, power] = [number(&pens[1], "speed_mm_s"), number(&pens[1], "power_w")];
        let [own_speed, own_power] = [number(&pens[0], "speed_mm_s"), number(&pens[0], "power_w")];
        let mark = |s: &Value| number(&s["time_s"], "mark");
        let slower = if what == "speed" { factor } else { 1.0 };
        assert!((speed - own_speed * slower).abs() < 1e-9 && (power - own_power * factor / slower).abs() < 1e-9);
        assert!((mark(&summary) * slower - mark(&plain)).abs() < 1e-6 * mark(&plain), "marks take longer");
        let dose = if what == "speed" { 0.75f64.sqrt() / factor } else { 0.75f64.sqrt() * factor };
        assert!(m["blocks"].as_array().expect("blocks").iter().all(|b| near(&b["dose"][0], dose, 1e-4)));
        // Every target that carries pens carries it.
        let drawing = std::fs::read_to_string(out.join("blocks/B0001.dxf")).expect("a drawing");
        assert!(drawing.contains("B0001_P2") && !drawing.contains("B0001_P1"), "its own layer");
        assert!(std::fs::read_to_string(out.join("runsheet.txt")).expect("a sheet").contains(name));
    }
}

#[test]
fn dose_factors_are_capped_and_impossible_settings_refused() {
    let dir = folder();
    let out = dir.path().join("job.job");
    let job = ramp(dir.path(), 50.0, "[dose]\ncompensate = \"power\"\ncap = 1.2\nstep = 0.05");
    compile(&job.write(dir.path(), "job.toml"), &out);
    verify(&out);
    assert_eq!(manifest(&out)["pens"][1]["name"], "fill x1.2");
    // 60 % times 1.75 is more than there is.
    let job = ramp(dir.path(), 55.0, "[dose]\ncompensate = \"power\"\ncap = 2").write(dir.path(), "job.toml");
    let done = terrace([Path::new("compile"), &job, Path::new("-o"), &out]);
    assert_eq!(done.status.code(), Some(1), "{}", said(&done));
    assert!(said(&done).contains("pen-power"), "{}", said(&done));
    // Nowhere to say it.
    let more = "[dose]\ncompensate = \"speed\"\n[emit]\nformats = [\"linuxcnc\"]";
    let summary = compile(&ramp(dir.path(), 30.0, more).write(dir.path(), "job.toml"), &out);
    let codes: Vec<&str> =
        summary["warnings"].as_array().expect("list").iter().filter_map(|w| w["code"].as_str()).collect();
    assert!(codes.contains(&"dose-lost"), "{codes:?}");
}

#[test]
#[ignore = "slow: make test-all"]
fn curved_part_gets_several_pens_and_verifies() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(&stl, &mesh(60, [0.0, 0.0, 60.0, 40.0], |x, y| 3.0 * math::sin(x / 12.0) + 2.0 * math::cos(y / 9.0)));
    for what in ["speed", "power"] {
        let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"0.5 mm\"").method("window");
        job.more = format!("[dose]\ncompensate = \"{what}\"\nstep = 0.005");
        let out = dir.path().join("job.job");
        let summary = compile(&job.write(dir.path(), "job.toml"), &out);
        let proof = verify(&out);
        assert_balance(&summary, &proof);
        assert!(manifest(&out)["pens"].as_array().expect("pens").len() > 10);
        let rule = proof["rules"].as_array().expect("rules").iter().find(|r| r["code"] == "dose").expect("a rule");
        assert_eq!(rule["checked"], summary["fragments"]);
    }
}

#[test]
fn invalid_dose_keys_are_refused() {
    let dir = folder();
    for (keys, code) in [
        ("compensate = \"speed\"\ncap = 1", "dose-cap"),
        ("compensate = \"speed\"\ncap = nan", "dose-cap"),
        ("compensate = \"power\"\nstep = 0", "dose-step"),
        ("compensate = \"both\"", "toml"),
        ("cap = 1.5", "toml"),
    ] {
        let job = ramp(dir.path(), 10.0, &format!("[dose]\n{keys}")).write(dir.path(), "job.toml");
        let done = terrace([Path::new("check"), &job]);
        assert_eq!(done.status.code(), Some(2), "{keys}: {}", said(&done));
        assert!(said(&done).contains(&format!("[{code}]")), "{keys}: {}", said(&done));
    }
}

/// Half of every stroke lies on a gentle slope and half on a steep one. On a tilted part the two halves are not
/// as long in the field as in the drawing, and it is there that they take their time.
#[test]
fn slope_of_tilted_marks_is_weighted_by_length_in_the_field() {
    let dir = folder();
    let stl = dir.path().join("saw.stl");
    let saw = |x: f64| {
        let (tooth, rest) = ((x / 0.8).floor(), x.rem_euclid(0.8));
        // Down by 5 deg over 0.4 mm, up by 40 deg over 0.4 mm.
        let (down, up) = (0.4 * math::tan(5f64.to_radians()), 0.4 * math::tan(40f64.to_radians()));
        tooth * (up - down) + if rest < 0.4 { -down * rest / 0.4 } else { -down + up * (rest - 0.4) / 0.4 }
    };
    let mut facets = Vec::new();
    for i in 0..50 {
        let x = [f64::from(i) * 0.4, f64::from(i + 1) * 0.4];
        // Just next to the crease, where the tooth is the one that is meant.
        let z = [saw(x[0] + 1e-9), saw(x[1] - 1e-9)];
        let corner = |k: usize, y: f64| [x[k], y, z[k]];
        facets.push([corner(0, 0.0), corner(1, 0.0), corner(1, 12.0)]);
        facets.push([corner(0, 0.0), corner(1, 12.0), corner(0, 12.0)]);
    }
    write_stl(&stl, &facets);
    for (what, step) in [("speed", 0.002), ("power", 0.002)] {
        let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").method("tilt");
        job.machine = "profile = \"xyz-tilt-galvo-40\"".into();
        job.focus = "pdof = \"0.5 mm\"".into();
        job.more = format!("[dose]\ncompensate = \"{what}\"\nstep = {step}\ncap = 3.0");
        let out = dir.path().join("job.job");
        compile(&job.write(dir.path(), "job.toml"), &out);
        let blocks = manifest(&out)["blocks"].clone();
        assert!(
            blocks.as_array().expect("blocks").iter().any(|b| b["tilt"] != serde_json::json!([0.0, 0.0])),
            "{blocks}"
        );
        // The verifier finds the mean cosine along the mark, on the file's own facets.
        verify(&out);
    }
}
