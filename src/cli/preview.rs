//! `terrace preview`: the picture of a job as a file, in the format that its name asks for.

use std::path::Path;

use super::args::{Args, Choice};
use super::{load, planned, print, refuse_input, write_file, wrote};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::units::Share;
use terrace_report::job_folder::{self, Pictures};
use terrace_report::report;

/// What a preview is written as, by the ending of its file's name.
#[derive(Clone, Copy, PartialEq)]
enum Format {
    Svg,
    Png,
    Pdf,
    Html,
}

impl Format {
    const ALL: [(&str, Self); 4] = [("svg", Self::Svg), ("png", Self::Png), ("pdf", Self::Pdf), ("html", Self::Html)];

    fn of(path: &Path) -> Result<Self, Error> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let found = Self::ALL.iter().find(|(name, _)| *name == extension).map(|(_, format)| *format);
        found.ok_or_else(|| {
            let text = match extension.as_str() {
                "" => "the name of the picture has no ending that says what to write".to_owned(),
                ending => format!("the preview cannot be written as .{ending}"),
            };
            let d = Diag::input("preview-format", text).at(Place::file(path.display().to_string()));
            d.hint(
                "name a file that ends in .svg (opens in any browser), .png (pixels), .pdf (to print) or .html (in 3D)",
            )
            .into()
        })
    }
}

/// Width of a PNG picture without --width, px.
const WIDTH: u32 = 1600;

/// Draws a job without writing its folder.
pub(super) fn preview(
    args: &Args,
    path: &Path,
    output: Option<&Path>,
    width: Option<u32>,
    choice: &Choice,
) -> Result<(), Error> {
    let mut job = load(args, path, choice)?;
    let dash = Path::new("-");
    let file = match output {
        Some(o) => (o != dash).then(|| o.to_owned()),
        None => (path != dash).then(|| path.with_extension("layout.svg")),
    };
    let inputs = job_folder::input_paths(&job);
    let format = match &file {
        Some(file) => refuse_input(file, &inputs).and_then(|()| Format::of(file))?,
        None => Format::Svg,
    };
    if width.is_some() && format != Format::Png {
        let d = Diag::input("preview-format", "--width is of a picture in pixels");
        return Err(d.hint("name a file that ends in .png, or leave --width out: other pictures have no width").into());
    }
    // What is refused for it is what one wants to see.
    let most = std::mem::replace(&mut job.limits.max_off_part, Share::percent(100.0));
    let plan = planned(args, job, &mut |_| {})?;
    let pictures = Pictures::of(&plan)?;
    let fault = plan.stepped().and_then(|plan| plan.off_part.fault(most));
    let refused = fault.map_or(Ok(()), |fault| Err(fault.into()));
    let Some(file) = file else { return print(&pictures.layout_svg()).and(refused) };
    let bytes = match format {
        Format::Svg => pictures.layout_svg().into_bytes(),
        Format::Png => report::png(&pictures.layout_svg(), width.unwrap_or(WIDTH))?,
        Format::Pdf => report::pdf(&pictures.layout_svg())?,
        Format::Html => pictures.view_html().into_bytes(),
    };
    write_file(args, &file, &bytes, &inputs)?;
    if refused.is_ok() || !args.json {
        wrote(args, &[file])?;
    }
    refused
}
