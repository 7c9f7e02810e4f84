//! Keys of a job file that another key, or the kind of a file, leaves without effect. Such a key is most often a
//! mistake: what it was set for does not happen.

use std::path::Path;

use super::faults::Faults;
use super::file::{JobFile, Mode};
use super::texture::keys::{SourceKeys, TextureKeys};
use crate::surface::{self, format::SurfaceKind};
use crate::texture::pattern::PatternKeys;
use crate::texture::{FillMode, StrokeMode};
use terrace_core::diag::Diag;

/// Warns of keys without effect, once for what has one cause.
pub(super) fn warn(file: &JobFile, mode: Mode, f: &mut Faults<'_>) {
    surface_keys(file, f);
    file.texture.iter().enumerate().for_each(|(i, texture)| texture_keys(i, texture, f));
    // On-the-fly jobs have a warning of their own, in `resolve`.
    if mode == Mode::Stepped {
        pass_keys(file, f);
    }
}

/// Warns of those of these keys that have no effect; each with whether it has none.
fn warn_of(f: &mut Faults<'_>, keys: &[(String, bool)], why: &str, hint: &str) {
    let unused: Vec<&str> = keys.iter().filter(|(_, is_unused)| *is_unused).map(|(key, _)| key.as_str()).collect();
    let Some(first) = unused.first() else { return };
    let verb = if unused.len() == 1 { "has" } else { "have" };
    let text = format!("{} {verb} no effect: {why}", unused.join(", "));
    f.warn(first, Diag::warning("key-unused", text).hint(hint));
}

/// Keys of passes.
fn pass_keys(file: &JobFile, f: &mut Faults<'_>) {
    let passes = &file.passes;
    let is_rotated = passes.rotate.as_deg() != 0.0;
    if passes.count == 1 {
        let keys = [
            ("passes.rotate".into(), is_rotated),
            ("passes.lower".into(), passes.lower.as_mm() > 0.0),
            ("passes.shift".into(), passes.shift.is_some()),
        ];
        warn_of(f, &keys, "the job has one pass", "leave it out, or set passes.count");
        return;
    }
    let is_turned = file.texture.iter().any(has_straight_hatches);
    let why = "no texture has straight hatches, which alone turn from pass to pass";
    warn_of(f, &[("passes.rotate".into(), is_rotated && !is_turned)], why, "leave it out");
}

/// Whether a texture may have straight hatches.
fn has_straight_hatches(keys: &TextureKeys) -> bool {
    let has_hatches = matches!(keys.source, SourceKeys::Pattern(PatternKeys::Hatch(_)) | SourceKeys::File(_));
    has_hatches && !keys.runs_along_contours()
}

/// Keys of the surface that its file has no use for.
fn surface_keys(file: &JobFile, f: &mut Faults<'_>) {
    let keys = &file.surface;
    let extension = extension(&keys.file);
    let holds = surface::format::of(&keys.file).map(|format| format.holds);
    let [is_cloud, is_map] = [SurfaceKind::Points, SurfaceKind::HeightMap].map(|kind| holds == Some(kind));
    let kind = format!("a .{extension} file");
    warn_of(
        f,
        &[("surface.max_edge".into(), keys.max_edge.is_some() && !is_cloud)],
        &format!("{kind} is not triangulated from points"),
        "leave it out",
    );
    warn_of(
        f,
        &[("surface.heightmap".into(), keys.heightmap.is_some() && !is_map && !is_cloud)],
        &format!("{kind} is not a height map"),
        "leave [surface.heightmap] out",
    );
    let is_rotated = has_pose_keys(file) || file.placement.turn.as_rad() != 0.0;
    let mesh_keys = [
        ("surface.unit".into(), keys.unit.is_some() && is_map),
        ("surface.weld".into(), keys.weld.as_mm() > 0.0 && is_map && !is_rotated),
        ("surface.non_manifold".into(), f.is_given("surface.non_manifold") && is_map && !is_rotated),
    ];
    warn_of(f, &mesh_keys, &format!("{kind} is a height map, whose scale [surface.heightmap] has"), "leave it out");
}

/// Whether a key says how the part is laid: a height map then becomes a mesh.
fn has_pose_keys(file: &JobFile) -> bool {
    let placement = &file.placement;
    placement.rotate.is_some() || placement.up.is_some() || placement.level.is_some()
}

/// Keys of texture `i`.
fn texture_keys(i: usize, keys: &TextureKeys, f: &mut Faults<'_>) {
    let key = |name: &str| format!("texture.{i}.{name}");
    if let SourceKeys::Pattern(PatternKeys::Dots(dots)) = &keys.source
        && !dots.is_random()
    {
        let has_own = keys.common.seed.is_some() && keys.common.soft.is_none();
        warn_of(
            f,
            &[(key("seed"), has_own)],
            "dots without jitter have no random places",
            "leave it out, or add jitter",
        );
    }
    let Some(keys) = keys.drawing() else { return };
    // Wide strokes are hatched too, unless the job says otherwise.
    let strokes_are_lines = matches!(keys.stroke, Some(StrokeMode::Centre | StrokeMode::Outline));
    let is_drawing = !is_bitmap(&keys.file) && strokes_are_lines;
    let lines = [
        (key("direction"), f.is_given(&key("direction"))),
        (key("cross"), keys.cross),
        (key("one_way"), keys.one_way),
        (key("contour"), keys.contour.is_some()),
    ];
    let (why, unused) = match keys.fill {
        Some(FillMode::Outline | FillMode::None) if is_drawing => {
            let spacing = [(key("pitch"), keys.pitch.is_some()), (key("inset"), keys.inset.is_some())];
            ("no area is filled", [&lines[..], &spacing[..]].concat())
        }
        Some(FillMode::Rings) if is_drawing => ("areas are filled by rings", lines.to_vec()),
        _ => return,
    };
    warn_of(f, &unused, why, "leave it out, or use fill = \"hatch\"");
}

fn extension(file: &Path) -> String {
    file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn is_bitmap(file: &Path) -> bool {
    matches!(extension(file).as_str(), "png" | "tif" | "tiff" | "bmp" | "jpg" | "jpeg")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{Job, Overrides, SAMPLE_JOB};

    /// The warnings of the sample job with texts replaced.
    fn messages(changes: &[(&str, &str)]) -> Vec<String> {
        let mut text = SAMPLE_JOB.to_owned();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        let job = Job::parse(Path::new("job.toml"), &text, &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
        assert!(job.warnings.iter().all(|d| d.place.to_string().starts_with("job.toml:")), "{:?}", job.warnings);
        job.warnings.into_iter().map(|d| d.message).collect()
    }

    #[test]
    fn a_key_without_effect_beside_another_is_reported_once_at_its_line() {
        assert_eq!(messages(&[]), [""; 0]);
        let focus = |keys: &str| messages(&[("pdof = \"0.07 mm\"", keys)]);
        assert_eq!(
            focus("pdof = \"0.07 mm\"\nfactor = 5"),
            ["focus.factor has no effect beside focus.pdof, which is the depth of focus"]
        );
        assert_eq!(focus("dof = \"0.07 mm\"\nfactor = 1.2"), [""; 0]);
        assert_eq!(focus("dof = \"0.07 mm\"\nfactor = 0.8"), [""; 0]);
        for factor in ["0.79", "1.21", "3"] {
            let found = focus(&format!("dof = \"0.07 mm\"\nfactor = {factor}"));
            assert!(matches!(&found[..], [text] if text.contains("is not between 0.8 and 1.2")), "{found:?}");
        }
    }

    #[test]
    fn keys_of_passes_are_reported() {
        let with = |table: &str, keys: &str| {
            let text = SAMPLE_JOB.to_owned();
            // Tables that the sample has are extended, others are added.
            let heading = format!("\n[{table}]\n");
            let text = match text.contains(&heading) {
                true => text.replacen(&heading, &format!("{heading}{keys}\n"), 1),
                false => format!("{text}{heading}{keys}\n"),
            };
            let job = Job::parse(Path::new("job.toml"), &text, &Overrides::default());
            job.unwrap_or_else(|e| panic!("{keys}: {e}")).warnings.into_iter().map(|d| d.message).collect::<Vec<_>>()
        };
        let rotated = with("passes", "rotate = \"60 deg\"\nshift = \"1 mm\"");
        assert_eq!(rotated, ["passes.rotate, passes.shift have no effect: the job has one pass"]);
        assert_eq!(with("passes", "count = 3\nrotate = \"60 deg\""), [""; 0]);
        // A limit that is kept anyway is not a mistake.
        assert_eq!(with("limits", "max_off_part = \"5 %\""), [""; 0]);
    }

    #[test]
    fn keys_of_the_other_kinds_of_surfaces_are_reported() {
        let with = |file: &str, keys: &str| {
            let text = SAMPLE_JOB.replacen("sample.stl", file, 1);
            let text = text.replacen("[surface]\n", &format!("[surface]\n{keys}\n"), 1);
            let job = Job::parse(Path::new("job.toml"), &text, &Overrides::default());
            job.unwrap_or_else(|e| panic!("{keys}: {e}")).warnings.into_iter().map(|d| d.message).collect::<Vec<_>>()
        };
        let edge = "max_edge = \"2 mm\"";
        assert_eq!(
            with("a.stl", edge),
            ["surface.max_edge has no effect: a .stl file is not triangulated from points"]
        );
        assert_eq!(with("a.xyz", edge), [""; 0]);
        // The sample states the unit of its facets.
        assert_eq!(with("a.png", "").len(), 1);
        assert!(with("a.png", "weld = \"1 um\"")[0].starts_with("surface.unit, surface.weld have no effect"));
    }

    #[test]
    fn keys_of_areas_that_are_not_hatched_are_reported() {
        let changed = |keys: &str| {
            let lines = SAMPLE_JOB
                .lines()
                .filter(|l| !l.starts_with("pitch") && !l.starts_with("direction") && !l.starts_with("area"));
            let text = lines.map(|l| l.replace("pattern = \"hatch\"", keys) + "\n").collect::<String>();
            let job = Job::parse(Path::new("job.toml"), &text, &Overrides::default());
            job.unwrap_or_else(|e| panic!("{keys}: {e}")).warnings.into_iter().map(|d| d.message).collect::<Vec<_>>()
        };
        let outline = "file = \"a.svg\"\nstroke = \"centre\"\nfill = \"outline\"";
        assert_eq!(changed(outline), [""; 0]);
        let found = changed(&format!("{outline}\npitch = \"0.1 mm\"\ncross = true"));
        assert_eq!(found, ["texture.0.cross, texture.0.pitch have no effect: no area is filled"]);
        // Wide strokes are hatched.
        assert_eq!(changed("file = \"a.svg\"\nfill = \"outline\"\npitch = \"0.1 mm\""), [""; 0]);
        let rings = "file = \"a.svg\"\nstroke = \"centre\"\nfill = \"rings\"\npitch = \"0.1 mm\"";
        assert_eq!(changed(rings), [""; 0]);
        assert_eq!(changed(&format!("{rings}\none_way = true")).len(), 1);
        assert_eq!(changed("pattern = \"dots\"\npitch = \"0.1 mm\"\nseed = 3\n").len(), 1);
        assert_eq!(changed("pattern = \"dots\"\npitch = \"0.1 mm\"\nseed = 3\njitter = \"10 %\""), [""; 0]);
    }
}
