//! The facts of a small job, for tests.

use std::path::Path;

use super::*;
use terrace_core::diag::Diag;
use terrace_core::geom::{Nm, P2};
use terrace_core::machine::Origin;
use terrace_core::program::{BlockFigures, Program, sample};
use terrace_input::job::{Overrides, SAMPLE_JOB};

/// The machine of the sample.
pub fn machine() -> Machine {
    Machine::built_in("xyz-galvo-40").expect("profile")
}

/// The facts of the sample program, given to `use_them`.
pub fn with_sample<R>(use_them: impl FnOnce(&Facts<'_>) -> R) -> R {
    with_facts(sample::program(), &machine(), use_them)
}

/// The facts of a program on a machine, given to `use_them`.
pub fn with_facts<R>(
    (program, origin): (Program, Origin),
    machine: &Machine,
    use_them: impl FnOnce(&Facts<'_>) -> R,
) -> R {
    let figures = vec![BlockFigures { time_s: 0.125, ..BlockFigures::default() }; program.blocks.len()];
    let checked = Checked::unchecked(program, origin);
    let job = Job::parse(Path::new("hood.toml"), SAMPLE_JOB, &Overrides::default()).expect("sample job");
    let sections = Sections { origin: P2::new(-20_000_000, -20_000_001), pitch: [Nm(40_000_000); 2], count: [2, 1] };
    let summary = Summary {
        stops: 3,
        method: "contour".into(),
        warnings: vec![Message::from(&Diag::warning("steep", "steep places"))],
        ..Summary::default()
    };
    use_them(&Facts {
        job_file: "../hood.toml",
        job: &job,
        machine,
        checked: &checked,
        passes: vec![(&sections, None)],
        depth_mm: 0.07,
        tessellation_mm: None,
        measured: None,
        fixtures: &[],
        figures: &figures,
        summary: &summary,
    })
}
