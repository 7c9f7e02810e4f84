//! Arguments of the command line.

use std::io::IsTerminal;
#[cfg(feature = "run")]
use std::path::Path;
use std::path::PathBuf;
use std::sync::LazyLock;

use clap::builder::{PossibleValue, PossibleValuesParser, StringValueParser, TypedValueParser};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use super::{examples, explain};

use crate::batch::units::UnitSelection;
#[cfg(feature = "compare")]
use terrace_compare::compare::{SYSTEMS, System};
use terrace_core::machine::PROFILES;
use terrace_core::program::BlockId;
use terrace_core::units::{Angle, Length};
use terrace_input::job::{FileUnit, KnownKey, Mode, Objective, Setting, known_keys};
#[cfg(feature = "compare")]
use terrace_plan::on_the_fly::axes::following_error::Protection;
use terrace_plan::probe::MOST as MOST_POINTS;

/// Compiles a texture on a freeform part into a stepped 3+2 job, and verifies it.
#[derive(Debug, Parser)]
#[command(name = "terrace", version, about, max_term_width = 100)]
pub struct Args {
    /// Print the result as JSON.
    #[arg(long, global = true)]
    pub json: bool,
    /// Number of threads; default: all. It does not affect the result.
    #[arg(short = 'j', long = "threads", global = true, value_name = "N", value_parser = threads)]
    pub threads: Option<usize>,
    /// Random seed for cuts in a seam zone (partition.zone).
    #[arg(long, global = true, default_value_t = 0)]
    pub seed: u64,
    /// No warnings and no progress.
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Colours in messages and help: on a terminal (not with NO_COLOR or TERM=dumb), always or never.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto", value_parser = one_of(&Colors::ALL, Colors::name))]
    pub color: Colors,
    /// Do not flush output to disk: faster, but files may be lost on a power failure.
    #[arg(long, global = true)]
    pub no_sync: bool,
    #[command(subcommand)]
    pub command: Command,
}

/// A command with its examples below its help; `name` is empty for the program itself.
fn with_examples(command: clap::Command, name: &str) -> clap::Command {
    match examples::EXAMPLES.iter().find(|(n, _)| *n == name) {
        Some((_, list)) => command.after_help(examples::help(list)),
        None => command,
    }
}

/// How many points, and what measures them.
#[derive(clap::Args, Debug)]
pub struct PointsArgs {
    /// How many points; default: as many as save stops worth their time.
    #[arg(long, value_name = "N", value_parser = point_count)]
    pub points: Option<usize>,
    /// As many points as it takes for the height to have this standard deviation at worst where something is marked.
    #[arg(long, value_name = "LENGTH", value_parser = positive_length, conflicts_with = "points")]
    pub sigma: Option<Length>,
    /// How far the part may lie from where placement.origin says, in any direction; default: 2 mm.
    #[arg(long, value_name = "LENGTH", value_parser = positive_length)]
    pub search: Option<Length>,
    /// Standard deviation of a distance sensor along the beam, which measures in place of the touch probe.
    #[arg(long, value_name = "LENGTH", value_parser = positive_length)]
    pub sensor: Option<Length>,
}

/// A number of points that a probe can touch in a shift.
fn point_count(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count @ 3..=MOST_POINTS) => Ok(count),
        _ => Err(format!("give a number from 3 to {MOST_POINTS}")),
    }
}

/// A length above zero, up to 50 mm.
fn positive_length(text: &str) -> Result<Length, String> {
    let length: Length = text.parse()?;
    let is_usable = length.as_mm() >= 1e-6 && length.as_mm() <= 50.0;
    if is_usable { Ok(length) } else { Err("give a length between 1 nm and 50 mm".to_owned()) }
}

/// What is known of the probe whose log makes a table: each, unless it is given, is as the machine file says.
#[derive(clap::Args, Debug)]
pub struct ProbeArgs {
    /// Radius of the probe's tip.
    #[arg(long, value_name = "LENGTH", requires = "log")]
    pub radius: Option<Length>,
    /// Standard deviation of a touch.
    #[arg(long, value_name = "LENGTH", requires = "log")]
    pub noise: Option<Length>,
    /// How far the tip moves on after it has touched until the controller knows.
    #[arg(long, value_name = "LENGTH", requires = "log")]
    pub pretravel: Option<Length>,
    /// Where the centre of the tip lies from the focus of the beam, in the directions of the table frame, mm.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple, requires = "log")]
    pub offset: Option<[f64; 3]>,
    /// Where the zero of G54 lies in the positions of the log, mm, where the log of GRBL does not say it.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple, requires = "log")]
    pub zero: Option<[f64; 3]>,
    /// Replace the table that is there.
    #[arg(long, requires = "log")]
    pub force: bool,
    /// Add the touches to the table that is there.
    #[arg(long, requires = "log", conflicts_with = "force")]
    pub add: bool,
}

impl Args {
    /// The program's arguments with the examples of every command.
    pub fn described() -> clap::Command {
        let mut all = with_examples(Self::command(), "");
        let names: Vec<String> = all.get_subcommands().map(|c| c.get_name().to_owned()).collect();
        for name in names {
            all = all.mut_subcommand(&name, |command| with_examples(command, &name));
        }
        // An option that all commands take is not shown where it has no effect: a command with a hidden copy of its own
        // does not get the global one, and accepts it all the same.
        for (option, commands) in [("seed", &OF_SEED[..]), ("threads", &OF_THREADS[..])] {
            let hidden = all.get_arguments().find(|arg| arg.get_id() == option).cloned().map(|arg| arg.hide(true));
            for name in examples::commands().into_iter().filter(|name| !commands.contains(name)) {
                all = all.mut_subcommand(name, |command| command.args(hidden.clone()));
            }
        }
        all
    }

    /// What was typed, from the program's name on.
    pub fn of<I, T>(typed: I) -> Result<Self, clap::Error>
    where
        I: IntoIterator<Item = T>,
        T: Into<std::ffi::OsString> + Clone,
    {
        let typed: Vec<std::ffi::OsString> = typed.into_iter().map(Into::into).collect();
        let mut all = Self::described().color(Colors::typed(&typed).choice());
        Self::from_arg_matches(&all.try_get_matches_from_mut(typed)?).map_err(|e| e.format(&mut all))
    }
}

/// Commands on which the seed has an effect: those that cut strokes.
const OF_SEED: [&str; 7] = ["check", "compile", "preview", "orient", "compare", "sweep", "batch"];

/// Commands that use several threads.
const OF_THREADS: [&str; 11] =
    ["check", "compile", "verify", "run", "preview", "orient", "compare", "sweep", "resume", "batch", "inspect"];

/// When messages and help are coloured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colors {
    /// On a terminal that takes them.
    Auto,
    /// Wherever they go.
    Always,
    /// Never.
    Never,
}

impl Colors {
    const ALL: [Self; 3] = [Self::Auto, Self::Always, Self::Never];

    fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Always => "always",
            Self::Never => "never",
        }
    }

    /// What a command line asks for that is not parsed yet, and may not be well-formed: its own errors are coloured
    /// too.
    fn typed(typed: &[std::ffi::OsString]) -> Self {
        let mut words = typed.iter().map(|word| word.to_string_lossy()).take_while(|word| word != "--");
        let mut found = Self::Auto;
        while let Some(word) = words.next() {
            let value = match word.strip_prefix("--color") {
                Some("") => words.next(),
                Some(rest) => rest.strip_prefix('=').map(|value| value.to_owned().into()),
                None => None,
            };
            found = value.and_then(|value| Self::ALL.into_iter().find(|one| one.name() == value)).unwrap_or(found);
        }
        found
    }

    fn choice(self) -> clap::ColorChoice {
        match self {
            Self::Auto if !environment_takes_colors() => clap::ColorChoice::Never,
            Self::Auto => clap::ColorChoice::Auto,
            Self::Always => clap::ColorChoice::Always,
            Self::Never => clap::ColorChoice::Never,
        }
    }

    /// Whether messages on stderr are coloured.
    pub fn on_stderr(self) -> bool {
        match self {
            Self::Auto => environment_takes_colors() && std::io::stderr().is_terminal(),
            Self::Always => true,
            Self::Never => false,
        }
    }
}

/// Whether the environment leaves colours to the terminal (no-color.org, terminfo).
fn environment_takes_colors() -> bool {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !is_set("NO_COLOR") && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if (1..=1024).contains(&n) => Ok(n),
        _ => Err("give a number between 1 and 1024".into()),
    }
}

/// Which blocks of a job are left.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = true)]
pub struct Left {
    /// The first block that is left, such as B0133.
    #[arg(long, value_name = "BLOCK", value_parser = str::parse::<BlockId>)]
    pub from: Option<BlockId>,
    /// Blocks and ranges of blocks, such as B0133,B0200-B0210.
    #[arg(long, value_name = "BLOCKS", value_delimiter = ',', value_parser = crate::resume::range)]
    pub only: Vec<[BlockId; 2]>,
    /// Leave out the blocks that this file lists.
    #[arg(long, value_name = "FILE")]
    pub done: Option<PathBuf>,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a commented job file with a small sample surface and drawing; it compiles as it is.
    Init {
        /// Where to write.
        #[arg(default_value = ".")]
        folder: PathBuf,
        /// Write the files of the tutorial instead: a mould insert, a grain, a machine, a focus ladder.
        #[arg(long, conflicts_with = "schema")]
        tutorial: bool,
        /// Print the JSON schema of job files instead.
        #[arg(long)]
        schema: bool,
        /// Write the schema to this file.
        #[arg(short, long, value_name = "FILE", requires = "schema")]
        output: Option<PathBuf>,
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
        /// Folder to write; default: the job file's name with .job, with .fly.job for an on-the-fly job. An existing
        /// job folder of the same mode is replaced; anything else is refused.
        #[arg(short, long, value_name = "FOLDER")]
        output: Option<PathBuf>,
        /// Verify the folder before it takes its place; its report then says that it is verified.
        #[arg(long)]
        verify: bool,
        /// Draw no layout, maps, report and view.
        #[arg(long)]
        no_pictures: bool,
        #[command(flatten)]
        choice: Choice,
    },
    /// Read a job folder back and check that every mark is made exactly once, in focus and inside the field.
    Verify {
        /// Job folder.
        folder: PathBuf,
        /// Folder that holds the job file and its inputs, where they have moved.
        #[arg(long, value_name = "FOLDER")]
        inputs: Option<PathBuf>,
    },
    /// Mark a job: move the stage from block to block and hand each to the laser; without --arm a dry run with the
    /// pilot laser, or without laser.
    #[cfg(feature = "run")]
    Run(RunArgs),
    /// Draw only the layout (of the first pass, if there are several).
    Preview {
        /// Job file, or - for standard input.
        job: PathBuf,
        /// File to write: .svg, .png, .pdf or .html (in 3D) by its name, or - for SVG on standard output; default: the
        /// job file's name with .layout.svg, standard output for a job from standard input.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Width of a .png, in px; default: 1600.
        #[arg(long, value_name = "PX")]
        width: Option<u32>,
        #[command(flatten)]
        choice: Choice,
    },
    /// Lay the part: find the side that faces the lens and the fixture angle that minimises stage time, for one or two
    /// set-ups; prints estimates, and writes them into the job file on request.
    Orient {
        /// Job file, or - for standard input.
        job: PathBuf,
        /// The direction in the surface file that is to look at the lens; default: the side that its facets face.
        #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple, conflicts_with = "lie_on")]
        up: Option<[f64; 3]>,
        /// A point of the surface file, in its unit: the facet there is to lie on the table.
        #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple)]
        lie_on: Option<[f64; 3]>,
        /// Write the rotations of the best single set-up into the job file (placement.rotate).
        #[arg(long)]
        apply: bool,
    },
    /// Choose where to measure the part: the points that save most stops, or make the height as sure as is asked; writes a
    /// folder with the program of the touch probe of the machine file, a list, a map and what to do.
    Probe {
        /// Job file, or - for standard input.
        job: PathBuf,
        /// Folder to write; default: the job file's name with .probe.
        #[arg(short, long, value_name = "FOLDER")]
        output: Option<PathBuf>,
        #[command(flatten)]
        points: PointsArgs,
    },
    /// Fit the part to its measured points ([placement.measured]): where it lies, how surely, and how far each point is
    /// off; with the log of a probe it makes the table of points first.
    Register {
        /// Job file, or - for standard input.
        job: PathBuf,
        /// Log of the controller: the file that LinuxCNC has written after (PROBEOPEN ...), or what GRBL has answered.
        log: Option<PathBuf>,
        /// A place of the part, mm before placement.turn: print where the axes stand with the focus on it, to look there
        /// with the pilot laser.
        #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple)]
        at: Option<[f64; 3]>,
        #[command(flatten)]
        probe: ProbeArgs,
    },
    /// Estimate the same job on several systems: stepped by each method, flat, with a zoom optic, tilted, scanner and
    /// stage synchronised, five and seven axes, and a fast tool servo; times, deviations and seams side by side.
    #[cfg(feature = "compare")]
    Compare {
        /// Job file, or - for standard input.
        job: PathBuf,
        /// Systems, separated by commas; default: all.
        #[arg(long, value_delimiter = ',', value_name = "NAMES", value_parser = one_of(&SYSTEMS, |system| system.name))]
        systems: Vec<&'static System>,
        /// How the scanner command is limited while it compensates the stage's following error (saturate: clipped to
        /// the field; accumulated: eq. 5 of Cui et al., which does not keep it in the field; off: not limited).
        #[arg(long, default_value = "saturate", value_name = "NAME", value_parser = one_of(&Protection::ALL, Protection::name))]
        protection: Protection,
        /// The exact surface of the placed part, as a NURBS file (docs/reference/cli.md, inspect): the system
        /// tool-servo needs it.
        #[arg(long, value_name = "FILE")]
        nurbs: Option<PathBuf>,
        /// Folder to write tables and pictures to.
        #[arg(short, long, value_name = "FOLDER")]
        output: Option<PathBuf>,
    },
    /// Plan a job with keys set to many values, and compare stops, times and seams; writes no job folder.
    Sweep {
        /// Job file, or - for standard input.
        job: PathBuf,
        /// A key and its values: focus.pdof=0.05..0.3mm/12 (12 values, evenly spaced; 6 without /12), or
        /// partition.method=z-range,window. Several settings are combined.
        #[arg(long, required = true, value_name = "KEY=VALUES", value_parser = KnownSettings, hide_possible_values = true)]
        set: Vec<Setting>,
        /// Write the table as CSV to this file.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Draw stops and times over the first setting to this SVG file.
        #[arg(long, value_name = "FILE")]
        plot: Option<PathBuf>,
        #[command(flatten)]
        fleet: FleetArgs,
        #[command(flatten)]
        choice: Choice,
    },
    /// Write a job folder of what is left of a job that was marked in part. Blocks keep their names and bytes; the
    /// stage lifts before the first one.
    Resume {
        /// Job folder.
        folder: PathBuf,
        #[command(flatten)]
        left: Left,
        /// Also blocks that `terrace run` has marked: the rest is for another part.
        #[arg(long)]
        again: bool,
        /// Folder to write. An existing job folder is replaced; anything else is refused.
        #[arg(short, long, value_name = "FOLDER")]
        output: PathBuf,
    },
    /// Compile many jobs; skip unchanged ones and continue after a failure.
    Batch(Batch),
    /// Compare two job folders, such as before and after a change of the job: figures, warnings, files, and a page with
    /// both views side by side.
    Diff {
        /// Job folder before the change.
        before: PathBuf,
        /// Job folder after it.
        after: PathBuf,
        /// Write a page (HTML) with both views, which one camera moves. The page loads the folders' view.html.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
    },
    /// Say what a surface, a drawing, a job file or a job folder holds.
    Inspect {
        /// The file or folder.
        file: PathBuf,
        /// Unit of a surface file that carries none; default: sizes are printed without a unit.
        #[arg(long, value_parser = one_of(&FileUnit::ALL, FileUnit::name))]
        unit: Option<FileUnit>,
        #[cfg(feature = "compare")]
        /// The file is a NURBS surface (JSON): examine it and the three algorithms for its height.
        #[arg(long, conflicts_with = "unit")]
        nurbs: bool,
        #[cfg(feature = "compare")]
        /// Distance of the nodes of algorithm I's grid; default: a hundredth of the shorter side.
        #[arg(long, value_name = "LENGTH", requires = "nurbs")]
        grid: Option<Length>,
        #[cfg(feature = "compare")]
        /// Kernel k of algorithm I's weights; default: 0.9 of the distance of the nodes.
        #[arg(long, value_name = "LENGTH", requires = "nurbs")]
        kernel: Option<Length>,
    },
    /// Convert a STEP or IGES file into facets within a chord tolerance, and write them as PLY in mm. A job can name
    /// the STEP or IGES file itself: its chord tolerance is then a tenth of focus.pdof.
    Import {
        /// STEP (.step, .stp) or IGES (.iges, .igs) file.
        file: PathBuf,
        /// PLY file to write; default: the file's name with .ply.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Chord tolerance: how far facets may lie off the surface.
        #[arg(long, value_name = "LENGTH", default_value = "0.01 mm")]
        tolerance: Length,
        /// Largest angle between neighbouring segments of an edge.
        #[arg(long, value_name = "ANGLE", default_value = "5 deg")]
        angle: Angle,
    },
    /// Say which optional parts are there on this computer: converter for STEP and IGES, fleet, serial ports, scan card.
    Doctor,
    /// List the built-in machines, or print one as a file to start from.
    Machines {
        /// Name of a built-in machine.
        #[arg(value_parser = NameParser(|| PROFILES.iter().map(|(name, _)| *name).collect()))]
        name: Option<String>,
        /// Print the JSON schema of machine files instead.
        #[arg(long, conflicts_with = "name")]
        schema: bool,
        /// Write the machine, or the schema, to this file.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
    },
    /// Explain the code of a message, such as travel in `error[travel]`.
    Explain {
        /// The code.
        #[arg(hide_possible_values = true, value_parser = NameParser(|| explain::sections().map(|s| s.code).collect()))]
        code: String,
    },
    /// Print completions for a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Print a manual page, for `man -l`, or write all to a folder.
    Man {
        /// Of a command; of terrace itself without.
        #[arg(hide_possible_values = true, value_parser = NameParser(examples::commands))]
        command: Option<String>,
        /// Folder to write the pages of terrace and of every command to: terrace.1, terrace-compile.1 and so on.
        #[arg(short, long, value_name = "FOLDER", conflicts_with = "command")]
        output: Option<PathBuf>,
    },
}

/// Arguments of `batch`.
#[derive(Debug, clap::Args)]
pub struct Batch {
    /// Folders of job files (*.toml), list files with one job file per line, or job files (*.toml).
    #[arg(required_unless_present_any = ["units", "collect"])]
    pub jobs: Vec<PathBuf>,
    /// Folder for the job folders; default: next to each job file.
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// Verify every folder, unchanged ones too; one that breaks a rule is a failed job.
    #[arg(long)]
    pub verify: bool,
    /// Draw no layouts, maps, reports and views.
    #[arg(long)]
    pub no_pictures: bool,
    /// Write the report as JSON to this file too, when the batch ends.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Append one line of JSON to this file as each job ends.
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// Write a page (HTML) with a picture of every job to this file when the batch ends.
    #[arg(long, value_name = "FILE")]
    pub index: Option<PathBuf>,
    /// Compile nothing: write the jobs as units to this file (JSON lines), for an engine; with --engine, keep the file.
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// A file of units that --plan has written.
    #[arg(long, value_name = "FILE", requires = "unit", conflicts_with_all = ["jobs", "output", "verify", "plan", "engine", "index", "report", "log"])]
    pub units: Option<PathBuf>,
    /// Work on these units (0-9,12), or on a share of all (3/40: the third of forty); each leaves a report beside the
    /// file of units.
    #[arg(long, value_name = "UNITS", requires = "units", group = "apart", value_parser = str::parse::<UnitSelection>)]
    pub unit: Option<UnitSelection>,
    /// Compile nothing: make one report of what the units of this file have left.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["jobs", "output", "verify", "plan", "units", "engine", "log"])]
    pub collect: Option<PathBuf>,
    #[command(flatten)]
    pub fleet: FleetArgs,
    #[command(flatten)]
    pub choice: Choice,
}

/// Where units are worked on.
#[derive(Debug, clap::Args)]
pub struct FleetArgs {
    /// Have the work done by the workers of this engine; they need the same folders at the same place.
    #[arg(long, value_name = "NAME", group = "apart", value_parser = one_of(Engine::ALL, Engine::name))]
    pub engine: Option<Engine>,
    /// Address of the engine's scheduler.
    #[arg(long, value_name = "ADDRESS", default_value = "tcp://127.0.0.1:8786", requires = "engine")]
    pub scheduler: String,
    /// Limit of memory of a unit of --engine or --unit, such as 4GB; it is then worked on in a process of its own. 0:
    /// no limit. Default with --engine: the memory of the worker divided by its threads.
    #[arg(long, value_name = "SIZE", requires = "apart", value_parser = bytes)]
    pub memory: Option<u64>,
}

/// Engines that carry units to other machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Dask, of Python.
    #[cfg(feature = "fleet")]
    Dask,
}

impl Engine {
    /// Those that this build has.
    pub const ALL: &'static [Self] = &[
        #[cfg(feature = "fleet")]
        Self::Dask,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            #[cfg(feature = "fleet")]
            Self::Dask => "dask",
        }
    }
}

/// A size such as 500MB, 4GB or 0, in bytes.
fn bytes(text: &str) -> Result<u64, String> {
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let unit = match text[end..].trim().to_ascii_uppercase().as_str() {
        "" if text == "0" => 1.0,
        "MB" => 1e6,
        "GB" => 1e9,
        "" => return Err("add a unit: 500MB or 4GB".into()),
        // As workers say it.
        "B" => 1.0,
        _ => return Err("give a size such as 500MB or 4GB".into()),
    };
    let number: f64 = text[..end].parse().map_err(|_| "give a size such as 500MB or 4GB".to_owned())?;
    Ok((number * unit) as u64)
}

/// What is to be run, and how.
#[derive(Debug, clap::Args)]
pub struct RunArgs {
    /// Job folder; it must verify.
    #[arg(required_unless_present = "schema")]
    folder: Option<PathBuf>,
    /// Run file: the machine with its stage and laser drivers.
    #[arg(long, value_name = "RUN.toml", required_unless_present = "schema")]
    with: Option<PathBuf>,
    /// Print the JSON schema of run files instead.
    #[arg(long, exclusive = true)]
    pub schema: bool,
    /// Fire the laser.
    #[arg(long)]
    pub arm: bool,
    /// Show frames instead of marking, each until you press Enter: first the registration points, then the blocks of
    /// the outline; or only the blocks named (B0133,B0200-B0210). With --arm the laser fires each once, with its pen.
    #[arg(long, value_name = "BLOCKS", num_args = 0..=1, value_delimiter = ',', value_parser = crate::resume::range, conflicts_with_all = ["journal", "go_on"])]
    pub frames: Option<Vec<[BlockId; 2]>>,
    /// Folder that holds the job file and its inputs, where they have moved.
    #[arg(long, value_name = "FOLDER")]
    pub inputs: Option<PathBuf>,
    /// Journal of what is marked; default: the folder's name with .run.jsonl in place of .job.
    #[arg(long, value_name = "FILE", requires = "arm")]
    pub journal: Option<PathBuf>,
    /// Append a log to this file, as JSON lines.
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// Go on after the blocks that the journal has as marked.
    #[arg(long, requires = "arm")]
    pub go_on: bool,
    /// Mark the block in doubt, such as B0133, again.
    #[arg(long, value_name = "BLOCK", requires = "go_on", conflicts_with = "skip")]
    pub redo: Option<String>,
    /// Take the block in doubt, such as B0133, as marked.
    #[arg(long, value_name = "BLOCK", requires = "go_on")]
    pub skip: Option<String>,
    /// Mark another part of a series from its first block on; the journal counts the parts.
    #[arg(long, requires = "arm", conflicts_with_all = ["go_on", "frames"])]
    pub again: bool,
}

#[cfg(feature = "run")]
impl RunArgs {
    /// The job folder.
    pub fn folder(&self) -> &Path {
        self.folder.as_deref().expect("required without --schema")
    }

    /// The run file.
    pub fn with(&self) -> &Path {
        self.with.as_deref().expect("required without --schema")
    }
}

/// Options that override keys of the job file.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct Choice {
    /// How the part is marked; default: mode of the job file, stepped where it has none.
    #[arg(long, value_parser = one_of(&[Mode::Stepped, Mode::OnTheFly], Mode::name))]
    pub mode: Option<Mode>,
    /// What `auto` minimises: estimated job time or number of stops; default: partition.objective of the job file, time
    /// where it has none.
    #[arg(long, value_parser = one_of(&[Objective::Time, Objective::Stops], Objective::name))]
    pub objective: Option<Objective>,
}

/// A value of a closed set by its name, with all names in help and completions.
fn one_of<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
) -> impl clap::builder::TypedValueParser<Value = T> {
    let names = all.iter().map(|&value| name(value));
    PossibleValuesParser::new(names)
        .map(move |typed| all.iter().copied().find(|&value| name(value) == typed).expect("one of the names"))
}

/// A name of a set that help and completions list; another is refused by the command, which knows what is near.
#[derive(Clone)]
struct NameParser(fn() -> Vec<&'static str>);

impl TypedValueParser for NameParser {
    type Value = String;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&clap::Arg>,
        value: &std::ffi::OsStr,
    ) -> Result<String, clap::Error> {
        StringValueParser::new().parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new((self.0)().into_iter().map(PossibleValue::new)))
    }
}

/// A setting of a job file; completions list all keys and the values that have names.
#[derive(Clone)]
struct KnownSettings;

impl TypedValueParser for KnownSettings {
    type Value = Setting;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&clap::Arg>,
        value: &std::ffi::OsStr,
    ) -> Result<Setting, clap::Error> {
        let parse: fn(&str) -> Result<Setting, String> = str::parse;
        parse.parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        static TYPED: LazyLock<Vec<String>> =
            LazyLock::new(|| known_keys().into_iter().flat_map(typed_settings).collect());
        Some(Box::new(TYPED.iter().map(|typed| PossibleValue::new(typed.as_str()))))
    }
}

/// A key with each of its values that have names; with nothing behind it where others are to be typed.
fn typed_settings(KnownKey { key, names, takes_others }: KnownKey) -> impl Iterator<Item = String> {
    let open = takes_others.then_some(String::new());
    names.into_iter().chain(open).map(move |value| format!("{key}={value}"))
}

/// Three numbers separated by commas.
fn triple(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>().ok().filter(|v| v.is_finite()))
        .collect::<Option<_>>()
        .unwrap_or_default();
    numbers.try_into().map_err(|_| "give three numbers, such as 0,0,1".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_well_formed() {
        Args::described().debug_assert();
    }

    #[test]
    fn every_command_has_examples_and_each_can_be_typed() {
        let all = Args::described();
        for (name, list) in examples::EXAMPLES {
            assert!(name.is_empty() || all.find_subcommand(name).is_some(), "{name} is not a command");
            assert!(!list.is_empty(), "{name}");
            for (typed, _) in *list {
                // The shell takes what follows a pipe or a redirection, and quotes.
                let words = typed.split(" > ").next().and_then(|t| t.split(['|', '<']).next()).expect("a command");
                let quoted = words.split('"').enumerate();
                let words: Vec<&str> = quoted
                    .flat_map(|(i, part)| if i % 2 == 1 { vec![part] } else { part.split_whitespace().collect() })
                    .collect();
                let args = Args::of(&words).unwrap_or_else(|e| panic!("{typed}: {e}"));
                let is_of = |args: &Args| format!("{:?}", args.command).to_lowercase().starts_with(name);
                assert!(name.is_empty() || is_of(&args), "{typed} is not an example of {name}");
            }
        }
        for command in all.get_subcommands() {
            let help = command.clone().render_help().to_string();
            assert!(help.contains("\nExamples:\n"), "{}: {help}", command.get_name());
        }
    }

    #[test]
    fn colours_are_read_from_a_command_line_that_is_not_well_formed() {
        let asked = |line: &str| Colors::typed(&line.split(' ').map(Into::into).collect::<Vec<_>>());
        for (line, colors) in [
            ("terrace check job.toml", Colors::Auto),
            ("terrace --color never check job.toml", Colors::Never),
            ("terrace check --color=always --what", Colors::Always),
            ("terrace check --color=always --color=never", Colors::Never),
            ("terrace check --color sometimes", Colors::Auto),
            ("terrace check -- --color=never", Colors::Auto),
        ] {
            assert_eq!(asked(line), colors, "{line}");
        }
        assert_eq!(Args::of(["terrace", "--color", "never", "machines"]).expect("well-formed").color, Colors::Never);
    }

    #[test]
    fn help_shows_options_where_they_have_an_effect() {
        let mut all = Args::described();
        all.build();
        let shows = |command: &str, option: &str| {
            let mut found = all.find_subcommand(command).expect("a command").clone();
            found.render_long_help().to_string().contains(option)
        };
        for (command, seed, threads) in [("run", false, true), ("machines", false, false), ("compile", true, true)] {
            assert_eq!((shows(command, "--seed"), shows(command, "--threads")), (seed, threads), "{command}");
        }
        // It is taken all the same.
        assert_eq!(Args::of(["terrace", "machines", "--seed", "3"]).expect("well-formed").seed, 3);
    }

    #[test]
    fn every_argument_has_a_help_and_says_its_values() {
        for command in Args::described().get_subcommands() {
            for arg in command.get_arguments() {
                let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(!help.is_empty(), "{} {}", command.get_name(), arg.get_id());
            }
        }
    }
}
