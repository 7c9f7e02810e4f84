//! The exit code of the program, by what went wrong.

use super::{Error, Kind};

impl Error {
    /// The exit code: 3 for a bug of ours, else 2 for input, else 1 for limits.
    pub fn exit_code(&self) -> u8 {
        self.0
            .iter()
            .map(|d| match d.kind {
                Kind::Bug => 3,
                Kind::Input => 2,
                Kind::Limit | Kind::Warning => 1,
            })
            .max()
            .unwrap_or(3)
    }
}
