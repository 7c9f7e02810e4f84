//! Every key that a manifest may have: what of it is proved, and what is not. A key that is neither is a fault, since
//! whoever reads it would take it for proved.
//!
//! Patterns: `a.b` is a key in an object, `[]` every item of an array, `*` any key, `**` all that is below.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};

/// The keys that a kind of manifest may have.
pub(crate) struct Leaves {
    /// Compared with other files, or computed again.
    pub(crate) proved: &'static [&'static str],
    /// Taken as stated.
    pub(crate) not_proved: &'static [&'static str],
}

/// Keys that stepped and on-the-fly jobs share.
const PROVED_OF_BOTH: [&str; 17] = [
    "schema",
    "mode",
    "job.file",
    "job.blake3",
    "inputs[].role",
    "inputs[].file",
    "inputs[].bytes",
    "inputs[].blake3",
    "files[].file",
    "files[].bytes",
    "files[].blake3",
    "machine.**",
    "placement.origin_mm[]",
    "placement.laid_deg[]",
    "placement.turn_deg",
    "summary.part_mm[]",
    "summary.curves.*",
];

/// The leaves that are not proved: how the job came to be, and what the user was warned of.
const NOT_PROVED_OF_BOTH: [&str; 5] = ["terrace", "seed", "objective", "summary.budget.**", "summary.warnings.**"];

/// Of a stepped job.
pub(crate) const STEPPED: Leaves = Leaves {
    proved: &[
        "focus.pdof_mm",
        "focus.reserve_mm",
        "focus.depth_range_mm",
        "focus.level",
        "focus.rule",
        "seams.zone_mm",
        "seams.overlap_mm",
        "passes[].turn_deg",
        "passes[].lowered_mm",
        "placement.measured.points",
        "placement.measured.off_part",
        "placement.measured.rows[][]",
        "placement.measured.rest_nm[]",
        "placement.measured.lean_deg",
        "placement.measured.worst_residual_um",
        "placement.measured.warp.**",
        "fixtures[].name",
        "fixtures[].box_mm[][]",
        "fixtures[].setups[]",
        "setups[].origin_mm[]",
        "setups[].registration[].point_mm[]",
        "setups[].registration[].stage[]",
        "pens[].name",
        "pens[].speed_mm_s",
        "pens[].power",
        "pens[].power_w",
        "pens[].frequency_khz",
        "pens[].passes",
        "pens[].dwell_us",
        "frames.pen",
        "frames.outline[]",
        "blocks[].id",
        "blocks[].pass",
        "blocks[].setup",
        "blocks[].section[]",
        "blocks[].level",
        "blocks[].centre_mm[]",
        "blocks[].lpfl_mm",
        "blocks[].focus_shift_mm",
        "blocks[].lift_z_mm",
        "blocks[].stage[]",
        "blocks[].tilt_deg[]",
        "blocks[].z_lo_mm",
        "blocks[].z_hi_mm",
        "blocks[].pens[]",
        "blocks[].files.*",
        "blocks[].strokes",
        "blocks[].mark_mm",
        "blocks[].jump_mm",
        "blocks[].time_s",
        "blocks[].incidence_deg[]",
        "blocks[].stretch[]",
        "blocks[].dose[]",
        "subset.blocks[]",
        "subset.stops",
        "subset.mark_mm",
        "subset.time_s",
        "subset.total_s",
        "summary.stops",
        "summary.blocks",
        "summary.passes",
        "summary.setups",
        "summary.texture_mm",
        "summary.mark_mm",
        "summary.overlap_mm",
        "summary.skipped_mm",
        "summary.skipped_off_part_mm",
        "summary.skipped_steep_mm",
        "summary.skipped_small_mm",
        "summary.dots.*",
        "summary.fragments",
        "summary.strokes_cut",
        "summary.figures_whole",
        "summary.figures_cut",
        "summary.jump_mm",
        "summary.worst_defocus_um",
        "summary.worst_incidence_deg",
        "summary.off_axis_mm.*",
        "summary.time_s.*",
        "summary.loading.*",
    ],
    not_proved: &[
        "passes[].sections.**",
        "placement.measured.noise_factor",
        "placement.measured.scale_excess[]",
        "placement.measured.off_part_mm",
        "placement.measured.off_part_dots",
        "placement.measured.hidden_mm",
        "placement.measured.hidden_dots",
        "placement.measured.beside_mm",
        "placement.measured.beside_dots",
        "blocks[].errors_um.**",
        "blocks[].line_energy.**",
        "summary.stops_merged",
        "summary.sub_blocks",
        "summary.method",
        "summary.lower_bound_stops",
        "summary.seam_mm",
        "summary.worst_defocus_mean_um",
        "summary.candidates.**",
    ],
};

/// Of an on-the-fly job.
pub(crate) const ON_THE_FLY: Leaves = Leaves {
    proved: &[
        "axes",
        "limits.*",
        "pens[].name",
        "pens[].speed_mm_s",
        "pens[].power",
        "pens[].power_percent",
        "pens[].frequency_khz",
        "left_out[].stroke",
        "left_out[].from_mm",
        "left_out[].to_mm",
        "summary.texture_mm",
        "summary.skipped_mm",
        "summary.skipped_focus_mm",
        "summary.moves",
        "summary.marks",
        "summary.time_s",
        "summary.mark_s",
        "summary.mark_mm",
        "summary.worst_displacement_mm",
        "summary.line_energy.mean_j_per_m",
        "summary.line_energy.length_at_speed_percent",
        "summary.line_energy.slow_s",
        "summary.line_energy.worst_share",
        "summary.laser[].file",
        "summary.laser[].servo_period_s",
        "summary.laser[].laser_error_mm",
    ],
    not_proved: &[
        "summary.skipped_off_part_mm",
        "summary.skipped_steep_mm",
        "summary.skipped_small_mm",
        "summary.jump_mm",
        "summary.worst_fod_um",
        "summary.worst_bia_deg",
        "summary.mark_speed_mm_s",
        "summary.line_energy.worst_at_mm[]",
        "summary.blend_mm",
        "summary.peaks.**",
    ],
};

impl Leaves {
    /// The patterns of what is taken as stated.
    pub(crate) fn stated(&self) -> impl Iterator<Item = &'static str> {
        NOT_PROVED_OF_BOTH.into_iter().chain(self.not_proved.iter().copied())
    }

    /// The first key of a manifest that is not known, with its path.
    pub(crate) fn unknown(&self, manifest: &[u8]) -> Result<Option<String>, serde_json::Error> {
        let mut root = Node::default();
        PROVED_OF_BOTH.iter().chain(self.proved).copied().chain(self.stated()).for_each(|pattern| root.add(pattern));
        let mut unknown = None;
        let walk = Walk { node: Some(&root), path: &Path::Root, unknown: &mut unknown };
        walk.deserialize(&mut serde_json::Deserializer::from_slice(manifest))?;
        Ok(unknown)
    }
}

/// What may be at one place of a manifest.
#[derive(Default)]
struct Node {
    is_leaf: bool,
    /// Whether all below is known (`**`).
    allows_all: bool,
    keys: BTreeMap<&'static str, Self>,
    items: Option<Box<Self>>,
}

impl Node {
    fn add(&mut self, pattern: &'static str) {
        let mut node = self;
        for key in pattern.split('.') {
            let name = key.trim_end_matches("[]");
            if name == "**" {
                return node.allows_all = true;
            }
            node = node.keys.entry(name).or_default();
            for _ in 0..(key.len() - name.len()) / 2 {
                node = node.items.get_or_insert_default();
            }
        }
        node.is_leaf = true;
    }

    fn key(&self, name: &str) -> Option<&Self> {
        self.keys.get(name).or_else(|| self.keys.get("*")).or_else(|| self.allows_all.then_some(self))
    }

    fn item(&self) -> Option<&Self> {
        self.items.as_deref().or_else(|| self.allows_all.then_some(self))
    }
}

/// The way to a value.
enum Path<'a> {
    Root,
    Key(&'a Path<'a>, &'a str),
    Item(&'a Path<'a>, usize),
}

impl fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Root => Ok(()),
            Self::Key(Self::Root, name) => write!(f, "{name}"),
            Self::Key(of, name) => write!(f, "{of}.{name}"),
            Self::Item(of, i) => write!(f, "{of}[{i}]"),
        }
    }
}

/// Walks over a value without keeping any of it.
struct Walk<'a> {
    /// None below what is not known.
    node: Option<&'a Node>,
    path: &'a Path<'a>,
    unknown: &'a mut Option<String>,
}

impl Walk<'_> {
    /// Notes the path of the first value that is not known.
    fn note_unless(self, is_known: impl FnOnce(&Node) -> bool) {
        if self.unknown.is_none() && !self.node.is_some_and(is_known) {
            *self.unknown = Some(self.path.to_string());
        }
    }

    fn leaf(self) {
        self.note_unless(|node| node.is_leaf || node.allows_all);
    }
}

impl<'de> DeserializeSeed<'de> for Walk<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<(), D::Error> {
        value.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Walk<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E: Error>(self, _: bool) -> Result<(), E> {
        self.leaf();
        Ok(())
    }

    fn visit_i64<E: Error>(self, _: i64) -> Result<(), E> {
        self.leaf();
        Ok(())
    }

    fn visit_u64<E: Error>(self, _: u64) -> Result<(), E> {
        self.leaf();
        Ok(())
    }

    fn visit_f64<E: Error>(self, _: f64) -> Result<(), E> {
        self.leaf();
        Ok(())
    }

    fn visit_str<E: Error>(self, _: &str) -> Result<(), E> {
        self.leaf();
        Ok(())
    }

    /// A value that is left out, of whatever kind it would be.
    fn visit_unit<E: Error>(self) -> Result<(), E> {
        self.note_unless(|_| true);
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<(), A::Error> {
        let Self { node, path, unknown } = self;
        let below = node.and_then(Node::item);
        let mut i = 0;
        while items
            .next_element_seed(Walk { node: below, path: &Path::Item(path, i), unknown: &mut *unknown })?
            .is_some()
        {
            i += 1;
        }
        Walk { node, path, unknown }.note_unless(|node| node.items.is_some() || node.allows_all);
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<(), A::Error> {
        let Self { node, path, unknown } = self;
        let mut seen = BTreeSet::new();
        while let Some(name) = entries.next_key::<String>()? {
            let below = node.and_then(|node| node.key(&name));
            let path = Path::Key(path, &name);
            entries.next_value_seed(Walk { node: below, path: &path, unknown: &mut *unknown })?;
            // JSON readers disagree on a repeated key: some take its first value, others its last.
            if seen.contains(&name) {
                return Err(A::Error::custom(format!("{path} is there twice")));
            }
            seen.insert(name);
        }
        Walk { node, path, unknown }.note_unless(|node| !node.keys.is_empty() || node.allows_all);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_are_not_known_are_found_with_their_place() {
        let unknown = |text: &str| STEPPED.unknown(text.as_bytes()).expect("JSON");
        for known in [
            r#"{"schema": 3, "files": [{"file": "a", "bytes": 1, "blake3": "00"}], "machine": {"any": [{"thing": 1}]}}"#,
            r#"{"blocks": [{"lift_z_mm": null, "line_energy": null, "files": {"dxf": "a"}, "stage": [1, 2.5, -3]}]}"#,
            r#"{"summary": {"time_s": {"stage": 1.0}, "candidates": [{"method": "window", "time_s": {"stage": 1}}]}}"#,
        ] {
            assert_eq!(unknown(known), None, "{known}");
        }
        for (text, place) in [
            (r#"{"schema": 3, "note": "text"}"#, "note"),
            (r#"{"blocks": [{"id": "B0001"}, {"id": "B0002", "power": 3}]}"#, "blocks[1].power"),
            (r#"{"blocks": [{"stage": [1, 2, {"x": 3}]}]}"#, "blocks[0].stage[2].x"),
            (r#"{"schema": {"x": 1}}"#, "schema.x"),
            (r#"{"schema": []}"#, "schema"),
            (r#"{"blocks": 1}"#, "blocks"),
        ] {
            assert_eq!(unknown(text).as_deref(), Some(place), "{text}");
        }
        assert!(STEPPED.unknown(b"{").is_err());
        let twice = STEPPED.unknown(br#"{"blocks": [{"files": {"dxf": "a", "csv": "b", "dxf": "c"}}]}"#);
        assert!(twice.is_err_and(|e| e.to_string().contains("blocks[0].files.dxf is there twice")));
    }
}
