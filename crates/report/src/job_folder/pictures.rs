//! The pictures of a plan: what they share is made once.

use std::path::Path;

use crate::report::{self, Marks};
use crate::scene::{self, Relief, Scene};
use crate::view;
use terrace_core::diag::Error;
use terrace_core::geom::Box2;
use terrace_core::parallel;
use terrace_core::progress::Task;
use terrace_plan::plan::{OnTheFlyPlan, Pass, Plan, SteppedPlan};

/// The pictures of a plan.
pub struct Pictures<'a> {
    /// Name of the job.
    name: String,
    part: Box2,
    relief: Relief,
    scene: Scene,
    plan: PlanRef<'a>,
}

/// The plan of either mode.
enum PlanRef<'a> {
    Stepped(&'a SteppedPlan),
    OnTheFly(&'a OnTheFlyPlan),
}

/// Writes one file of a folder.
pub(super) type WriteFile<'a> = dyn FnMut(&str, &[u8]) -> Result<(), Error> + 'a;

/// Where the pictures go.
struct Files<'a, 'b> {
    write_file: &'a mut WriteFile<'a>,
    /// Counts files.
    drawing: &'a Task<'b>,
}

impl Files<'_, '_> {
    fn write(&mut self, name: &str, text: &str) -> Result<(), Error> {
        (self.write_file)(name, text.as_bytes())?;
        self.drawing.step();
        Ok(())
    }
}

impl<'a> Pictures<'a> {
    /// Of a plan.
    ///
    /// # Errors
    /// Those of a machine that does not have the axes of an on-the-fly program.
    pub fn of(plan: &'a Plan) -> Result<Self, Error> {
        match plan {
            Plan::Stepped(plan) => Ok(Self::of_stepped(plan)),
            Plan::OnTheFly(plan) => Self::of_on_the_fly(plan),
        }
    }

    pub(super) fn of_stepped(plan: &'a SteppedPlan) -> Self {
        let part = plan.inputs.part_box_nm(&plan.job);
        let texture = plan.passes[0].texture;
        let relief = Relief::under(&plan.inputs.surface, report::relief_area(part, texture), report::RELIEF_CELLS);
        let scene = scene::of_stepped(plan, &relief);
        Self { name: file_name(&plan.job.path), part, relief, scene, plan: PlanRef::Stepped(plan) }
    }

    pub(super) fn of_on_the_fly(plan: &'a OnTheFlyPlan) -> Result<Self, Error> {
        let part = plan.inputs.part_box_nm(&plan.job);
        let texture = plan.texture.bounds();
        let relief = Relief::under(&plan.inputs.surface, report::relief_area(part, texture), report::RELIEF_CELLS);
        let scene = scene::of_on_the_fly(plan, &relief)?;
        Ok(Self { name: file_name(&plan.job.path), part, relief, scene, plan: PlanRef::OnTheFly(plan) })
    }

    /// How many files [`Pictures::write`] writes.
    pub(super) fn count(&self) -> usize {
        match self.plan {
            PlanRef::Stepped(plan) => plan.passes.len() + 4 + usize::from(plan.inputs.measured.is_some()),
            PlanRef::OnTheFly(_) => 4,
        }
    }

    /// Writes all of them; `drawing` counts files.
    pub(super) fn write(&self, write_file: &mut WriteFile<'_>, drawing: &Task<'_>) -> Result<(), Error> {
        let mut out = Files { write_file, drawing };
        match self.plan {
            PlanRef::Stepped(plan) => self.write_stepped(plan, &mut out),
            PlanRef::OnTheFly(plan) => self.write_on_the_fly(plan, &mut out),
        }
    }

    fn write_stepped(&self, plan: &SteppedPlan, out: &mut Files<'_, '_>) -> Result<(), Error> {
        let pass = &plan.passes[0];
        let marks = Marks::of(&self.scene, pass.blocks.clone());
        let layout = self.stepped(plan, pass, &marks);
        let layouts = || report::layout_svgs(&layout, [report::Shade::Height, report::Shade::Incidence]);
        let others = || {
            let energy = report::EnergyMap::of(&layout);
            [report::energy_svg(layout.job, &energy), report::report_html(&layout, &energy), self.view_html()]
        };
        let ([by_height, by_slope], [energy, report, view]) = parallel::both(layouts, others);
        out.write("view.html", &view)?;
        out.write("layout.svg", &by_height)?;
        out.write("slope.svg", &by_slope)?;
        out.write("energy.svg", &energy)?;
        out.write("report.html", &report)?;
        if let Some(part) = &plan.inputs.measured {
            let sigmas = plan.job.placement.measured.as_ref().map_or(0.0, |measured| measured.sigmas);
            out.write("measured.svg", &report::measured_svg(&self.name, part, pass.texture, sigmas))?;
        }
        for (k, pass) in (0..).zip(&plan.passes).skip(1) {
            let marks = Marks::of(&self.scene, pass.blocks.clone());
            out.write(&report::pass_file(k), &report::layout_svg(&self.stepped(plan, pass, &marks)))?;
        }
        Ok(())
    }

    fn write_on_the_fly(&self, plan: &OnTheFlyPlan, out: &mut Files<'_, '_>) -> Result<(), Error> {
        let marks = Marks::of(&self.scene, 0..self.scene.groups.len());
        let layout = self.on_the_fly(plan, &marks);
        out.write("view.html", &self.view_html())?;
        out.write("layout.svg", &report::on_the_fly_svg(&layout))?;
        let energy = report::EnergyMap::of_moves(&layout);
        out.write("energy.svg", &report::energy_svg(layout.job, &energy))?;
        out.write("report.html", &report::on_the_fly_html(&layout, &energy))
    }

    /// `layout.svg`; of several passes that of the first.
    pub fn layout_svg(&self) -> String {
        match self.plan {
            PlanRef::Stepped(plan) => {
                let pass = &plan.passes[0];
                report::layout_svg(&self.stepped(plan, pass, &Marks::of(&self.scene, pass.blocks.clone())))
            }
            PlanRef::OnTheFly(plan) => {
                let marks = Marks::of(&self.scene, 0..self.scene.groups.len());
                report::on_the_fly_svg(&self.on_the_fly(plan, &marks))
            }
        }
    }

    /// `view.html`.
    pub fn view_html(&self) -> String {
        match self.plan {
            PlanRef::Stepped(plan) => view::of_stepped(plan, &self.scene, &self.name),
            PlanRef::OnTheFly(plan) => view::of_on_the_fly(plan, &self.scene, &self.name),
        }
    }

    /// What is drawn of a pass of a stepped job.
    fn stepped(&'a self, plan: &'a SteppedPlan, pass: &'a Pass, marks: &'a Marks) -> report::Layout<'a> {
        report::Layout {
            job: &self.name,
            checked: &plan.checked,
            blocks: pass.blocks.clone(),
            passes: plan.summary.passes,
            machine: &plan.machine,
            sections: pass.sections,
            map: &pass.map,
            part: self.part,
            texture: pass.texture,
            scene: &self.scene,
            relief: &self.relief,
            marks,
            turn_rad: plan.job.placement.turn.as_rad(),
            figures: &plan.figures,
            drawn: report::drawn(&plan.checked, &plan.machine),
            shade: report::Shade::Height,
            measured: plan.inputs.measured.as_ref(),
            fixtures: &plan.inputs.fixtures,
            summary: &plan.summary,
        }
    }

    /// What is drawn of an on-the-fly job.
    fn on_the_fly(&'a self, plan: &'a OnTheFlyPlan, marks: &'a Marks) -> report::OnTheFlyLayout<'a> {
        report::OnTheFlyLayout {
            job: &self.name,
            program: plan.checked.program(),
            power_by_speed: plan.checked.power_by_speed(),
            machine: &plan.machine,
            part: self.part,
            texture: plan.texture.bounds(),
            scene: &self.scene,
            relief: &self.relief,
            marks,
            turn_rad: plan.job.placement.turn.as_rad(),
            summary: &plan.summary,
        }
    }
}

pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}
