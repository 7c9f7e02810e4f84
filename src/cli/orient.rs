//! `terrace orient`: the table of set-ups as text and as JSON.

use std::fmt::Write;

use serde_json::{Value, json};

use crate::geom::mm_from_nm;
use crate::manifest::duration;
use crate::plan::orient::{Orientation, SetUp};

/// The table for people.
pub(super) fn text(found: &[Orientation]) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{:<30} {:>12} {:>12} {:>8} {:>12}", "set-up", "about x", "about y", "stops", "stage time");
    for way in found {
        for (i, s) in way.set_ups.iter().enumerate() {
            let name = if i == 0 { way.name } else { "" };
            let [x, y] = s.lean_deg;
            let time = duration(s.stage_s);
            let _ = writeln!(out, "{name:<30} {x:>8.2} deg {y:>8.2} deg {:>8} {time:>12}", s.stops);
        }
        if way.set_ups.len() > 1 {
            let _ = writeln!(out, "{:<55} {:>8} {:>12}", "  together", way.stops(), duration(way.stage_s()));
        }
    }
    out.push_str(
        "\nEstimated from sample points; marking and set-up time not included. Angles rotate the part about\n\
         y, then about x (right-handed). To use a row, rotate the surface file by these angles, clamp the\n\
         part accordingly and compile: that also reports hidden and too steep areas.\n",
    );
    out
}

/// The table for machines.
pub(super) fn json(found: &[Orientation]) -> Value {
    let set_up = |s: &SetUp| {
        let [lo, hi] = [s.area.lo, s.area.hi];
        let area = [lo.x, lo.y, hi.x, hi.y].map(mm_from_nm);
        json!({
            "area_mm": area,
            "lean_deg": s.lean_deg,
            "stops": s.stops,
            "stage_s": s.stage_s,
        })
    };
    let way = |w: &Orientation| {
        json!({
            "name": w.name,
            "set_ups": w.set_ups.iter().map(set_up).collect::<Vec<_>>(),
            "stops": w.stops(),
            "stage_s": w.stage_s(),
        })
    };
    json!({ "orientations": found.iter().map(way).collect::<Vec<_>>() })
}
