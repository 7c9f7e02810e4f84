//! The formats of programs: what they are called, and what jobs they can hold. How each is written is in `emit`, how it
//! is read again to verify it in `verify`.

use serde::{Deserialize, Serialize};

/// Program formats, by the names that job files give them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// One DXF R12 file per block.
    Dxf,
    /// LinuxCNC: a stage program with a START / BUSY handshake, or an on-the-fly program.
    Linuxcnc,
    /// One CSV file of points per block.
    Csv,
    /// Plain G-code stage program that waits with M0.
    Gcode,
    /// One LightBurn project per block.
    Lightburn,
    /// One list for a BJJCZ (LMC) card per block.
    Lmc,
    /// OpenVectorFormat.
    Ovf,
    /// One CSV file with the pose of the head at every block.
    Poses,
    /// On-the-fly program for Power PMAC.
    Pmac,
    /// One text with lists for a SCANLAB RTC board per block.
    Rtc,
}

/// What a format can hold.
struct Row {
    format: Format,
    name: &'static str,
    is_stepped: bool,
    is_on_the_fly: bool,
    allows_setups: bool,
}

const STEPPED: Row =
    Row { format: Format::Dxf, name: "dxf", is_stepped: true, is_on_the_fly: false, allows_setups: true };

/// In the order in which files are written.
const ROWS: [Row; 10] = [
    STEPPED,
    Row { format: Format::Csv, name: "csv", ..STEPPED },
    Row { format: Format::Lightburn, name: "lightburn", ..STEPPED },
    Row { format: Format::Lmc, name: "lmc", ..STEPPED },
    Row { format: Format::Rtc, name: "rtc", ..STEPPED },
    Row { format: Format::Linuxcnc, name: "linuxcnc", is_on_the_fly: true, ..STEPPED },
    Row { format: Format::Gcode, name: "gcode", ..STEPPED },
    // Its planes follow on one another without a stop.
    Row { format: Format::Ovf, name: "ovf", allows_setups: false, ..STEPPED },
    Row { format: Format::Poses, name: "poses", ..STEPPED },
    Row { format: Format::Pmac, name: "pmac", is_stepped: false, is_on_the_fly: true, allows_setups: false },
];

impl Format {
    /// The formats of a stepped job that names none.
    pub const OF_STEPPED: [Self; 3] = [Self::Dxf, Self::Linuxcnc, Self::Ovf];
    /// The formats of an on-the-fly job that names none.
    pub const OF_ON_THE_FLY: [Self; 2] = [Self::Linuxcnc, Self::Pmac];

    /// All, in the order in which files are written.
    pub fn all() -> impl Iterator<Item = Self> {
        ROWS.iter().map(|row| row.format)
    }

    fn row(self) -> &'static Row {
        ROWS.iter().find(|row| row.format == self).expect("every format has a row, as a test holds")
    }

    /// The format's name in job files and messages.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Whether it can hold a stepped job.
    pub fn is_stepped(self) -> bool {
        self.row().is_stepped
    }

    /// Whether it can hold an on-the-fly job.
    pub fn is_on_the_fly(self) -> bool {
        self.row().is_on_the_fly
    }

    /// Whether the operator can move the part in the middle of a stepped job.
    pub fn allows_setups(self) -> bool {
        self.row().allows_setups
    }
}

/// The names of formats in quotes, for messages.
pub fn names(formats: impl IntoIterator<Item = Format>) -> String {
    let quoted: Vec<String> = formats.into_iter().map(|format| format!("{:?}", format.name())).collect();
    quoted.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::variants::variants;

    #[test]
    fn every_format_has_one_row_and_the_name_of_job_files() {
        let formats: Vec<Format> = variants();
        assert_eq!(formats.len(), ROWS.len());
        for format in formats {
            assert_eq!(Format::all().filter(|other| *other == format).count(), 1, "{format:?}");
            assert_eq!(serde_json::to_value(format).expect("a word"), format.name());
        }
    }

    #[test]
    fn a_job_that_names_no_format_gets_such_as_can_hold_it() {
        assert!(Format::OF_STEPPED.into_iter().all(Format::is_stepped));
        assert!(Format::OF_ON_THE_FLY.into_iter().all(Format::is_on_the_fly));
    }
}
