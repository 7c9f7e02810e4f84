//! The phases of a compilation, and the callback that reports them.

/// Phases of a compilation, in order, for progress displays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Reading surface and texture.
    Read,
    /// Where the texture touches the surface.
    Footprint,
    /// Cutting strokes.
    Split,
    /// Ordering strokes and stops.
    Order,
    /// Writing the folder.
    Write,
}

/// Told of every phase as it begins.
pub type Progress<'a> = &'a (dyn Fn(Phase) + Sync);
