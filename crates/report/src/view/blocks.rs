//! The data of the groups as columns: what the page says of a block.

use serde_json::{Map, Value, json};
use terrace_plan::emit::Target;

use crate::scene::{Frame, Scene};
use terrace_core::geom::{NM_PER_MM, P3};
use terrace_core::program::Program;
use terrace_plan::emit::Files;
use terrace_plan::manifest;
use terrace_plan::plan::SteppedPlan;

/// Columns of one entry for each group.
pub(super) struct Columns(Map<String, Value>);

impl Columns {
    fn put(&mut self, name: &str, values: impl Iterator<Item = Value>) {
        self.0.insert(name.into(), values.collect());
    }

    pub(super) fn text(self) -> String {
        Value::Object(self.0).to_string()
    }

    /// What groups of both modes have.
    fn of_groups(scene: &Scene) -> Self {
        let mut out = Self(Map::new());
        out.put("frame", scene.groups.iter().map(|g| axes_and_origin(&g.frame)));
        out.put("origin", scene.groups.iter().map(|g| json!(g.frame.origin)));
        for (k, name) in ["begin", "start", "end"].into_iter().enumerate() {
            out.put(name, scene.groups.iter().map(|g| json!(g.clock_s[k])));
        }
        out.put("strokes", scene.groups.iter().map(|g| json!(g.marks.len())));
        out.put("name_at", scene.groups.iter().map(|g| json!(nearest_to_the_middle(g))));
        out
    }

    /// Runs of marks on the fly.
    pub(super) fn on_the_fly(scene: &Scene) -> Self {
        let mut out = Self::of_groups(scene);
        let groups = &scene.groups;
        let length = |g: &crate::scene::Group| g.marks.iter().map(|m| m.length_mm).sum::<f64>();
        out.put("id", (1..=groups.len()).map(|i| json!(i.to_string())));
        for name in ["pass", "setup"] {
            out.put(name, groups.iter().map(|_| json!(1)));
        }
        for name in ["section", "level", "stage", "lift", "files", "turn", "shift", "tilt", "stretch", "dose"] {
            out.put(name, groups.iter().map(|_| Value::Null));
        }
        out.put("centre", groups.iter().map(|g| json!([g.frame.origin[0], g.frame.origin[1]])));
        out.put("focus", groups.iter().map(|g| json!(g.frame.origin[2])));
        out.put("z", groups.iter().map(|g| json!(heights(g))));
        out.put("mark_mm", groups.iter().map(|g| json!(length(g))));
        out.put("jump_mm", groups.iter().map(|_| Value::Null));
        out.put("incidence", groups.iter().map(|g| json!(incidences(g))));
        out.put("pens", groups.iter().map(|g| json!(pens(g))));
        out
    }

    /// The blocks of a stepped job.
    pub(super) fn stepped(plan: &SteppedPlan, scene: &Scene) -> Self {
        let checked = &plan.checked;
        let machine = &plan.machine;
        let program = checked.program();
        let mut out = Self::of_groups(scene);
        let blocks = || program.blocks.iter();
        let slopes = || plan.figures.iter().map(|f| f.slope);
        out.put("id", (0..program.blocks.len()).map(|i| json!(program.id(i).to_string())));
        out.put("pass", blocks().map(|b| json!(b.pass.number())));
        out.put("setup", blocks().map(|b| json!(b.setup.number())));
        out.put("section", blocks().map(|b| json!(b.stop.section.0)));
        out.put("level", blocks().map(|b| json!(b.stop.level)));
        out.put("centre", blocks().map(|b| json!(b.stop.centre.mm())));
        out.put("focus", blocks().map(|b| json!(b.stop.lpfl.mm())));
        out.put("tilt", blocks().map(|b| json!(b.stop.tilt.deg())));
        out.put("turn", blocks().map(|b| rotation_and_shift(plan, b)));
        out.put("stage", blocks().map(|b| json!(b.stage.mm())));
        out.put("lift", (0..program.blocks.len()).map(|i| json!(manifest::lift_mm(machine, checked, i))));
        out.put("shift", blocks().map(|b| json!(b.focus_shift.mm())));
        out.put("z", blocks().map(|b| json!([b.z_lo.mm(), b.z_hi.mm()])));
        out.put("mark_mm", blocks().map(|b| json!(program.mark_mm(b))));
        out.put("jump_mm", blocks().map(|b| json!(program.jump_mm(b))));
        out.put("incidence", slopes().map(|s| json!(s.incidence_deg())));
        out.put("stretch", slopes().map(|s| json!(s.stretch())));
        out.put("dose", slopes().map(|s| json!(s.dose())));
        out.put("pens", blocks().map(|b| program.pens_of(b).into_iter().map(|p| json!(p.0)).collect()));
        out.put("files", (0..program.blocks.len()).map(|i| files(plan, i)));
        out
    }
}

/// Where a group lies in the part: rotation by rows, then the origin, mm; null where its axes are those of the part.
fn axes_and_origin(frame: &Frame) -> Value {
    if frame.is_upright() {
        return Value::Null;
    }
    let rows = [0, 1, 2].map(|i| [0, 1, 2].map(|k| frame.axes[k][i]));
    json!(rows.concat().into_iter().chain(frame.origin).collect::<Vec<f64>>())
}

/// How the part is turned at a block: rotation by rows, then where the origin of the part comes to lie, mm; null where
/// the part is not turned.
fn rotation_and_shift(plan: &SteppedPlan, block: &terrace_core::program::Block) -> Value {
    if block.stop.tilt.is_upright() {
        return Value::Null;
    }
    let turn = crate::scene::turn_at(block, plan);
    let shift = turn.apply(P3::new([0.0; 3])).at;
    // Columns of the rotation: where the directions of x, y and z come to point.
    let columns = [0, 1, 2].map(|k| {
        // A metre along the axis: the rounding of a coordinate, far below a nanometre, is nothing against it.
        let mut on_axis = [0.0; 3];
        on_axis[k] = 1e9;
        let turned = turn.apply(P3::new(on_axis)).at;
        [0, 1, 2].map(|i| (turned[i] - shift[i]) / 1e9)
    });
    let rows = [0, 1, 2].map(|i| [0, 1, 2].map(|k| columns[k][i]));
    let all: Vec<f64> = rows.concat().into_iter().chain(shift.map(|v| v / NM_PER_MM)).collect();
    json!(all)
}

/// The files of a block, by format.
fn files(plan: &SteppedPlan, index: usize) -> Value {
    let id = plan.checked.program().id(index);
    let of_block = plan.job.formats.iter().map(|&f| Target::of(f)).filter_map(|t| match t.stepped {
        Some(Files::Blocks(ending, _)) => Some((t.name().to_owned(), json!(Program::block_file(id, ending)))),
        _ => None,
    });
    Value::Object(of_block.collect())
}

/// The point of a group's marks that is nearest to the middle of all, part frame, mm: where its name stands.
fn nearest_to_the_middle(group: &crate::scene::Group) -> Option<[f64; 3]> {
    let count = group.points.len().max(1) as f64;
    let middle = [0, 1, 2].map(|k| group.points.iter().map(|p| f64::from(p.at[k])).sum::<f64>() / count);
    let away = |at: [i32; 3]| (0..3).map(|k| (f64::from(at[k]) - middle[k]).powi(2)).sum::<f64>();
    let nearest = group.points.iter().min_by(|p, q| away(p.at).total_cmp(&away(q.at)))?;
    Some(group.frame.part_from_group(nearest.at))
}

/// Lowest and highest point of a group, part frame, mm.
fn heights(group: &crate::scene::Group) -> [f64; 2] {
    let z = group.points.iter().map(|p| group.frame.part_from_group(p.at)[2]);
    z.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], z| [lo.min(z), hi.max(z)])
}

/// Mean over the points and largest incidence of a group, deg.
fn incidences(group: &crate::scene::Group) -> [f64; 2] {
    let all = || group.points.iter().map(|p| f64::from(p.incidence_deg));
    [all().sum::<f64>() / all().count().max(1) as f64, all().fold(0.0, f64::max)]
}

/// Indices of the pens of a group, rising.
fn pens(group: &crate::scene::Group) -> Vec<u16> {
    let mut all: Vec<u16> = group.marks.iter().map(|m| m.pen.0).collect();
    all.sort_unstable();
    all.dedup();
    all
}
