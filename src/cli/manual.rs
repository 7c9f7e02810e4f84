//! `man`: manual pages as roff, made of the same words as the help.

use std::path::{Path, PathBuf};

use super::args::Args;
use super::{unwritable, write_file, wrote};
use terrace_core::diag::{Diag, Error, Place};

/// The page of a command, or of the program.
///
/// # Errors
/// `command-unknown`.
pub fn page(command: Option<&str>) -> Result<String, Error> {
    let all = built();
    let Some(name) = command else { return rendered(all) };
    let Some(found) = all.find_subcommand(name) else {
        let text = format!("there is no command {name:?}");
        return Err(Diag::input("command-unknown", text).hint("see `terrace help` for the commands").into());
    };
    rendered(found.clone())
}

/// Writes the pages of the program and of every command to a folder, under the names by which `man` finds them.
pub fn write(args: &Args, folder: &Path) -> Result<(), Error> {
    std::fs::create_dir_all(folder)
        .map_err(|e| unwritable("make the folder", Place::file(folder.display().to_string()), &e))?;
    let all = built();
    let commands = all.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect::<Vec<_>>();
    let mut files: Vec<PathBuf> = Vec::new();
    for command in std::iter::once(all).chain(commands) {
        let name = command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned();
        let file = folder.join(format!("{name}.1"));
        write_file(args, &file, rendered(command)?.as_bytes(), &[])?;
        files.push(file);
    }
    wrote(args, &files)
}

/// The program's arguments with those that all commands share in each.
fn built() -> clap::Command {
    let mut all = Args::described();
    all.build();
    all
}

fn rendered(command: clap::Command) -> Result<String, Error> {
    let mut out = Vec::new();
    clap_mangen::Man::new(command).render(&mut out).map_err(|e| Diag::input("output-unwritable", e.to_string()))?;
    Ok(String::from_utf8_lossy(&out).into_owned())
}
