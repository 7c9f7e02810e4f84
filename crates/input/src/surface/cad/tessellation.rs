//! How finely exact surfaces become facets.

/// How finely exact surfaces become facets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tessellation {
    /// Chord tolerance: how far facets may lie off the surface, mm.
    pub chord_mm: f64,
    /// Largest angle between neighbouring segments of an edge, rad.
    pub angle_rad: f64,
}

impl Tessellation {
    /// For a job: facets may use a tenth of the processing depth of focus.
    pub(crate) fn of_pdof(pdof_mm: f64) -> Self {
        Self::within(pdof_mm / 10.0)
    }

    /// With this chord tolerance, and an angle of 5 deg.
    pub fn within(chord_mm: f64) -> Self {
        Self { chord_mm, angle_rad: 5f64.to_radians() }
    }
}
