//! What may be typed.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

use crate::compare::System;
use crate::fly::servo::Protection;
use crate::spec::{FileUnit, Objective};

/// Compiles a texture on a freeform part into a stepped 3+2 job, and proves it.
#[derive(Debug, Parser)]
#[command(name = "terrace", version, about, max_term_width = 100)]
pub struct Args {
    /// Print the result as JSON.
    #[arg(long, global = true)]
    pub json: bool,
    /// Threads; default: all. Their number never changes the result.
    #[arg(short = 'j', long = "threads", global = true, value_name = "N", value_parser = threads)]
    pub threads: Option<usize>,
    /// Seed of everything that is random.
    #[arg(long, global = true, default_value_t = 0)]
    pub seed: u64,
    /// No warnings and no progress.
    #[arg(short, long, global = true)]
    pub quiet: bool,
    #[command(subcommand)]
    pub command: Command,
}

fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if (1..=1024).contains(&n) => Ok(n),
        _ => Err("give a number between 1 and 1024".into()),
    }
}

/// How a part is marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Mode {
    /// Stop by stop.
    Stepped,
    /// While the stage moves.
    OnTheFly,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a commented job file and a small sample surface that compile as they are.
    Init {
        /// Where to write.
        #[arg(default_value = ".")]
        folder: PathBuf,
        /// Print the JSON schema of job files instead.
        #[arg(long)]
        schema: bool,
    },
    /// Plan a job and check it against the machine without writing anything.
    Check {
        /// Job file, or - for standard input.
        job: PathBuf,
        #[command(flatten)]
        choice: Choice,
    },
    /// Compile a job into a job folder.
    Compile {
        /// Job file, or - for standard input.
        job: PathBuf,
        /// Folder to write; default: the job file's name with .job. A job folder that is there is
        /// replaced, anything else is not.
        #[arg(short, long, value_name = "FOLDER")]
        output: Option<PathBuf>,
        /// How the part is marked: stop by stop, or while the stage moves.
        #[arg(long, value_enum, default_value_t = Mode::Stepped)]
        mode: Mode,
        #[command(flatten)]
        choice: Choice,
    },
    /// Read a job folder back and prove that every mark lies once, in focus and inside the field.
    Verify {
        /// Job folder.
        folder: PathBuf,
        /// Folder that holds the job file and its inputs, where they have moved.
        #[arg(long, value_name = "FOLDER")]
        inputs: Option<PathBuf>,
    },
    /// Draw the layout of the blocks alone; of several passes, of the first.
    Preview {
        /// Job file, or - for standard input.
        job: PathBuf,
        /// SVG file to write, or - for standard output; default: the job file's name with .layout.svg,
        /// standard output for a job from standard input.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        #[command(flatten)]
        choice: Choice,
    },
    /// Say how the part should lean on a plain stage, in one or two set-ups, so that stage moves take the
    /// least time: a table of estimates, nothing is written.
    Orient {
        /// Job file, or - for standard input.
        job: PathBuf,
    },
    /// Mark the same part in every way there is, on paper: stepped by each method, flat, with a zoom optic, tilted,
    /// scanner and stage synchronised, five and seven axes; times, deviations and seams side by side.
    Compare {
        /// Job file, or - for standard input.
        job: PathBuf,
        /// Systems, separated by commas; default: all.
        #[arg(long, value_delimiter = ',', value_name = "NAMES", value_parser = super::compare::system)]
        systems: Vec<System>,
        /// What keeps the scanner in its field while it makes up for the stage's following error: saturate,
        /// accumulated (eq. 5 of Cui et al., which does not), or off.
        #[arg(long, default_value = "saturate", value_name = "NAME", value_parser = super::compare::protection)]
        protection: Protection,
        /// Folder to write tables and pictures to.
        #[arg(short, long, value_name = "FOLDER")]
        output: Option<PathBuf>,
    },
    /// Compile many jobs; unchanged ones are skipped, a failing one harms no other.
    Batch {
        /// Folder of job files (*.toml), or a list file with one job file a line.
        jobs: PathBuf,
        /// Folder for the job folders; default: beside each job file.
        #[arg(short, long, value_name = "FOLDER")]
        output: Option<PathBuf>,
        /// Write the report as JSON to this file too.
        #[arg(long, value_name = "FILE")]
        report: Option<PathBuf>,
    },
    /// Say what a surface, a drawing, a job file or a job folder holds.
    Inspect {
        /// The file or folder.
        file: PathBuf,
        /// Unit of a surface file that carries none.
        #[arg(long, value_parser = unit)]
        unit: Option<FileUnit>,
    },
    /// List the built-in machines, or print one as a file to start from.
    Machines {
        /// Name of a built-in machine.
        name: Option<String>,
        /// Print the JSON schema of machine files instead.
        #[arg(long, conflicts_with = "name")]
        schema: bool,
    },
    /// Print completions for a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// What goes before the job file's own keys.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Choice {
    /// What the best of several methods has least of: time or stops.
    #[arg(long, value_parser = objective)]
    pub objective: Option<Objective>,
}

fn objective(text: &str) -> Result<Objective, String> {
    match text {
        "time" => Ok(Objective::Time),
        "stops" => Ok(Objective::Stops),
        _ => Err("give time or stops".into()),
    }
}

fn unit(text: &str) -> Result<FileUnit, String> {
    match text {
        "mm" => Ok(FileUnit::Millimetre),
        "cm" => Ok(FileUnit::Centimetre),
        "m" => Ok(FileUnit::Metre),
        "in" => Ok(FileUnit::Inch),
        "um" => Ok(FileUnit::Micrometre),
        _ => Err("known units: mm, cm, m, in, um".into()),
    }
}
