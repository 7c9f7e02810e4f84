use super::sample::with_sample;
use super::*;
#[test]
fn the_manifest_has_its_keys_in_order_and_exact_millimetres() {
    let text = with_sample(|facts| {
        let inputs = vec![InputFact { role: "surface".into(), file: "hood.stl".into(), bytes: 3, blake3: "ef".into() }];
        let files = vec![FileFact { file: "program.txt".into(), bytes: 7, blake3: "ab".into() }];
        let head = Head { files, ..Head::new(facts.job, facts.job_file.into(), inputs) };
        String::from_utf8(manifest(&head, facts)).expect("UTF-8")
    });
    let keys: Vec<&str> = text.lines().filter(|l| l.starts_with("  \"")).filter_map(|l| l.split('"').nth(1)).collect();
    assert_eq!(
        keys,
        [
            "schema",
            "terrace",
            "mode",
            "job",
            "inputs",
            "seed",
            "objective",
            "files",
            "machine",
            "placement",
            "focus",
            "seams",
            "passes",
            "setups",
            "pens",
            "blocks",
            "summary"
        ]
    );
    assert!(text.ends_with("}\n"));
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(json["passes"][0]["sections"]["origin_mm"], serde_json::json!([-20.0, -20.000001]));
    assert_eq!(json["placement"]["origin_mm"], serde_json::json!([1.0, -2.0, 0.3]));
    assert_eq!(json["pens"][1]["power"], "3.5 W");
    assert_eq!(json["pens"][0]["power_w"], 8.4);
    let block = &json["blocks"][2];
    assert_eq!(block["id"], "B0003");
    assert_eq!(block["stage"], serde_json::json!([-41.0, 2.0, 0.405]));
    assert_eq!((&block["lpfl_mm"], &block["z_lo_mm"]), (&0.105.into(), &0.0701.into()));
    assert_eq!(block["pens"], serde_json::json!(["fill", "edge (fine)"]));
    assert_eq!(block["files"], serde_json::json!({"dxf": "blocks/B0003.dxf"}));
    assert_eq!((&block["strokes"], &block["time_s"]), (&2.into(), &0.125.into()));
    assert_eq!(json["focus"]["level"], "mid");
    assert_eq!(json["job"]["file"], "../hood.toml");
}
