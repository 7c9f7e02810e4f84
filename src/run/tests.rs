//! The moves of a run against the stage program of the same job, and what journals say.
