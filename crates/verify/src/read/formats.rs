//! What the verifier knows of a target format: the files that stand for it in a job folder, and the reader of those
//! files.
//!
//! The variant that a row holds says what a file of that format says, and so which rules are checked against it: the
//! rules take [`Strokes`], statements, work planes or a [`FlyProgram`] and know nothing of formats. Adding a target is
//! a reader next to this file and a row of [`FORMATS`]. The table is written apart from the one of the writers; a test
//! compares the two.

use std::path::Path;

use super::manifest::{BlockEntry, FileEntry};
use super::on_the_fly::FlyProgram;
use super::{BlockOf, FORMATS, Fault, Strokes, gcode, ovf, poses};
use terrace_core::diag;
use terrace_core::geom::ControllerPoint;
use terrace_core::machine::Machine;
use terrace_core::program::Pen;
use terrace_input::job::Format;

/// Largest file that is read.
const MAX_FILE: u64 = 4 << 30;

/// Files of single blocks in one format: what they hold, and in which units.
#[derive(Clone, Copy)]
pub(crate) struct BlockFiles {
    pub(crate) ending: &'static str,
    pub(crate) read: fn(&[u8], &BlockOf<'_>, &mut Strokes<'_>) -> Result<(), Fault>,
    /// A point of the controller in the units of the file.
    pub(crate) units: fn(&Machine, ControllerPoint) -> [i64; 2],
    /// Whether strokes name their pen.
    pub(crate) names_pens: bool,
    /// Whether a stroke is there as often as its pen has passes.
    pub(crate) repeats: bool,
    /// The settings that a stroke with a pen should have.
    pub(crate) settings: fn(&BlockOf<'_>, &Pen) -> Vec<i64>,
    /// The setting that a dot has besides.
    pub(crate) dwell: fn(&Pen) -> Option<i64>,
}

/// Points in nm.
pub(super) fn in_nm(_: &Machine, ControllerPoint { x, y }: ControllerPoint) -> [i64; 2] {
    [x, y].map(i64::from)
}

/// Of files that leave dwells to the marking software.
pub(super) const fn no_dwell(_: &Pen) -> Option<i64> {
    None
}

/// The dwell of a pen in units of 10 us.
pub(super) fn tens_of_us(pen: &Pen) -> Option<i64> {
    pen.dwell.map(|dwell| (dwell.as_us() / 10.0).round() as i64)
}

/// Drawings that name pens and leave their settings to the marking software.
pub(super) const fn drawing(
    ending: &'static str,
    read: fn(&[u8], &BlockOf<'_>, &mut Strokes<'_>) -> Result<(), Fault>,
) -> Option<Stepped> {
    let settings = |_: &BlockOf<'_>, _: &Pen| Vec::new();
    let dwell = no_dwell;
    Some(Stepped::Blocks(BlockFiles { ending, read, units: in_nm, names_pens: true, repeats: false, settings, dwell }))
}

/// The files of a stepped job in one format, and what they hold.
#[derive(Clone, Copy)]
pub(crate) enum Stepped {
    /// One file for every block: its strokes, in order.
    Blocks(BlockFiles),
    /// A program of the stage: its moves and what fires the laser between them, over a handshake with the scan card or
    /// by an operator.
    Stage { file: &'static str, handshake: bool, read: fn(&[u8]) -> Result<gcode::StageProgram, Fault> },
    /// The whole job: a work plane for every block, with its place, strokes and settings.
    Planes { file: &'static str, open: for<'a> fn(&'a [u8]) -> Result<ovf::OvfFile<'a>, String> },
    /// Where the head is at every block.
    Poses { file: &'static str, read: fn(&[u8]) -> Result<Vec<poses::Pose>, Fault> },
}

/// The file of an on-the-fly job in one format: what all axes and the laser do, and when.
#[derive(Clone, Copy)]
pub(crate) struct OnTheFly {
    pub(crate) file: &'static str,
    /// The machines that it is written for, by the letters of their axes.
    pub(crate) axes: &'static [&'static str],
    /// Reads a program of the axes of these letters.
    pub(crate) read: fn(&[u8], &str) -> Result<FlyProgram, Fault>,
    /// Usual servo period of its controller, s.
    pub(crate) servo_s: f64,
}

/// One format.
pub(crate) struct Row {
    pub(crate) format: Format,
    /// The name of the format in job files and manifests.
    pub(crate) name: &'static str,
    pub(crate) stepped: Option<Stepped>,
    pub(crate) on_the_fly: Option<OnTheFly>,
}

/// The formats of a stepped job that ought to be in its folder: those that the job asks for, and those that the
/// manifest lists a file of, for the whole job or for a block.
pub(crate) fn expected<'a>(
    asked: &'a [Format],
    listed: &'a [FileEntry],
    blocks: &'a [BlockEntry],
) -> impl Iterator<Item = (&'static Row, Stepped)> + 'a {
    FORMATS.iter().filter_map(|row| row.stepped.map(|files| (row, files))).filter(move |(row, files)| {
        let is_listed = match files {
            Stepped::Blocks(_) => blocks.iter().any(|b| b.files.contains_key(row.name)),
            Stepped::Stage { file, .. } | Stepped::Planes { file, .. } | Stepped::Poses { file, .. } => {
                listed.iter().any(|f| f.file == *file)
            }
        };
        is_listed || asked.contains(&row.format)
    })
}

/// The name that the file of a block has in a format with this ending.
pub(crate) fn of_block(id: &str, ending: &str) -> String {
    format!("blocks/{id}.{ending}")
}

/// The name that the frame of a block has in a format with this ending.
pub(crate) fn of_frame(id: &str, ending: &str) -> String {
    format!("frames/{id}-frame.{ending}")
}

/// The name of the frames' version of a file for the whole job.
pub(crate) fn of_frames(file: &str) -> String {
    let (stem, ending) = file.split_once('.').unwrap_or((file, ""));
    format!("frames/{stem}-frame.{ending}")
}

/// The format, and its ending, of the files by which stage programs and run sheets name a block's drawing: the first of
/// those that the job asks for; where the job cannot be had, of those that are there.
pub(crate) fn of_drawings(
    asked: &[Format],
    listed: &[FileEntry],
    blocks: &[BlockEntry],
) -> Option<(&'static str, &'static str)> {
    let of = |row: &'static Row| match row.stepped {
        Some(Stepped::Blocks(files)) => Some((row.name, files.ending)),
        _ => None,
    };
    let row = |format: &Format| FORMATS.iter().find(|row| row.format == *format);
    let first = asked.iter().filter_map(row).find_map(of);
    first.or_else(|| expected(asked, listed, blocks).find_map(|(row, _)| of(row)))
}

/// The bytes of a file of the job folder, or why they cannot be had.
pub(crate) fn bytes(folder: &Path, name: &str) -> Result<Vec<u8>, String> {
    diag::read_file(&folder.join(name), MAX_FILE)
        .map_err(|e| e.diags().first().map_or_else(|| "cannot be read".to_owned(), |d| d.message.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_plan::emit::{Files, TARGETS};

    #[test]
    fn every_target_has_one_row_with_the_same_files() {
        assert_eq!(FORMATS.len(), TARGETS.len());
        for target in &TARGETS {
            let rows: Vec<&Row> = FORMATS.iter().filter(|r| r.format == target.format).collect();
            let [row] = rows[..] else { panic!("{} has {} rows", target.name(), rows.len()) };
            assert_eq!(row.name, target.name());
            let is_same = match (row.stepped, target.stepped) {
                (None, None) => true,
                (Some(Stepped::Blocks(files)), Some(Files::Blocks(written, _))) => files.ending == written,
                (
                    Some(Stepped::Stage { file, .. } | Stepped::Planes { file, .. } | Stepped::Poses { file, .. }),
                    Some(Files::Whole(written, _)),
                ) => file == written,
                _ => false,
            };
            assert!(is_same, "stepped files of {}", row.name);
            let (read, written) = (row.on_the_fly.map(|f| f.file), target.on_the_fly.map(|f| f.name));
            assert_eq!(read, written, "on-the-fly file of {}", row.name);
            let (axes, kinds) = (row.on_the_fly.map(|f| f.axes.len()), target.on_the_fly.map(|f| f.kinds.len()));
            assert_eq!(axes, kinds, "machines of {}", row.name);
        }
    }
}
