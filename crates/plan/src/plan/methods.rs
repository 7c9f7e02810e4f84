//! The table of partition methods: how each divides a job, and what its stops are like.
//!
//! A method is a function from a [`Site`] to stops, a variant of [`Method`] and a row here.

use super::site::Site;
use super::tilted_stops;
use crate::partition::{self, Stops};
use terrace_core::machine::Machine;
use terrace_core::progress::Task;
use terrace_input::job::{Job, Method};

/// One method.
pub(super) struct MethodRow {
    pub(super) method: Method,
    /// Whether `auto` tries it for this job on this machine.
    pub(super) is_tried: fn(&Job, &Machine) -> bool,
    /// The stops; None where it cannot be used on this job.
    pub(super) divide: fn(&Site<'_>, Task<'_>) -> Option<Stops>,
    /// Stops are upright boxes of one size: what the lower bound speaks of.
    pub(super) has_bound: bool,
    /// Whether the method chooses levels so that figures stay whole where they can.
    pub(super) keeps_figures: bool,
    /// Stops stand on a grid of sections, whose borders figures may lie across.
    pub(super) has_borders: bool,
}

/// All methods, in the order in which `auto` tries them.
pub(super) static METHODS: [MethodRow; 4] = [
    MethodRow {
        method: Method::Contour,
        is_tried: |_, _| true,
        divide: |site, _| Some(site.on_sections(partition::contour)),
        has_bound: true,
        keeps_figures: false,
        has_borders: true,
    },
    MethodRow {
        method: Method::ZRange,
        is_tried: |_, _| true,
        divide: |site, _| Some(site.on_sections(partition::z_range)),
        has_bound: true,
        keeps_figures: true,
        has_borders: true,
    },
    MethodRow {
        method: Method::Window,
        is_tried: |_, _| true,
        divide: |site, task| site.free_windows(task),
        has_bound: true,
        keeps_figures: true,
        has_borders: false,
    },
    MethodRow {
        method: Method::Tilt,
        is_tried: |job, machine| machine.tilt.is_some() && job.setups.is_none(),
        divide: |site, task| tilted_stops::divide(site.sweep, site.machine, site.grid, task),
        has_bound: false,
        keeps_figures: true,
        has_borders: true,
    },
];

/// The row of a method.
///
/// # Panics
/// For `auto`, which stands for several.
pub(super) fn row(method: Method) -> &'static MethodRow {
    METHODS.iter().find(|row| row.method == method).expect("auto is resolved to methods before any is asked for")
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::variants::variants;

    #[test]
    fn every_method_but_auto_has_one_row() {
        for method in variants::<Method>().into_iter().filter(|method| *method != Method::Auto) {
            assert_eq!(METHODS.iter().filter(|row| row.method == method).count(), 1, "{}", method.name());
        }
        assert!(METHODS.iter().all(|row| row.method != Method::Auto));
    }
}
