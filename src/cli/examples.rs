//! Examples of use, for the help and the manual page of each command.

use std::fmt::Write;

/// What is typed, and what it does.
type Example = (&'static str, &'static str);

/// Examples by command; "" is the program itself.
pub const EXAMPLES: &[(&str, &[Example])] = &[
    (
        "",
        &[
            ("terrace init try", "A job to start from, with samples"),
            ("terrace compile try/job.toml", "Writes try/job.job"),
            ("terrace verify try/job.job", "Reads it back and checks every mark"),
            ("terrace explain travel", "What the message error[travel] means"),
        ],
    ),
    (
        "init",
        &[
            ("terrace init try", "Writes try/job.toml and the files that it names"),
            ("terrace init insert --tutorial", "Writes the files of the tutorial"),
            ("terrace init --schema -o job.schema.json", "The JSON schema for an editor"),
        ],
    ),
    (
        "check",
        &[
            ("terrace check job.toml", "Stops, times and warnings of the job"),
            ("terrace check job.toml --objective stops", "With as few stops as possible"),
            ("terrace check job.toml --json", "For a program"),
        ],
    ),
    (
        "compile",
        &[
            ("terrace compile job.toml", "Writes job.job"),
            ("terrace compile job.toml --verify", "Writes it once it is verified"),
            ("terrace compile job.toml -o panel.job", "Writes another folder"),
            ("terrace compile job.toml --mode on-the-fly", "Writes job.fly.job: scanner and stage move together"),
            ("terrace compile - -o panel.job < job.toml", "A job from standard input"),
        ],
    ),
    (
        "verify",
        &[
            ("terrace verify job.job", "Checks every rule; exit code 1 if one is broken"),
            ("terrace verify job.job --inputs moved/", "The job file and its inputs lie elsewhere now"),
        ],
    ),
    #[cfg(feature = "run")]
    (
        "run",
        &[
            (
                "terrace run job.job --with shop.toml",
                "Dry run: moves the stage, marks nothing; the pilot laser shows each block",
            ),
            ("terrace run job.job --with shop.toml --frames B0012", "Shows the frame of one block"),
            ("terrace run job.job --with shop.toml --arm", "Marks the part"),
            ("terrace run job.job --with shop.toml --arm --go-on", "Goes on after an interruption"),
        ],
    ),
    (
        "preview",
        &[
            ("terrace preview job.toml", "Writes job.layout.svg"),
            ("terrace preview job.toml -o layout.pdf", "A page to print"),
            ("terrace preview job.toml -o layout.png --width 2400", "Pixels"),
            ("terrace preview job.toml -o view.html", "The job in 3D"),
        ],
    ),
    (
        "orient",
        &[
            ("terrace orient job.toml", "Stage times for several fixture angles"),
            ("terrace orient job.toml --apply", "Lays the part: writes placement.rotate into the job file"),
            ("terrace orient job.toml --up 0,1,0", "The side that looks along y of the surface file"),
            ("terrace orient job.toml --json", "For a program"),
        ],
    ),
    (
        "probe",
        &[
            ("terrace probe job.toml", "The points that save most stops, and the program of the touch probe"),
            (
                "terrace probe job.toml --sigma \"5 um\"",
                "So many that the height is known to 5 um wherever something is marked",
            ),
            ("terrace probe job.toml --sensor \"3 um\" --points 60", "A list for a distance sensor along the beam"),
        ],
    ),
    (
        "register",
        &[
            ("terrace register job.toml", "Where the part lies, how surely, and how far each point is off"),
            (
                "terrace register job.toml probe.log",
                "Makes the table of points of the log of the machine's probe first",
            ),
            (
                "terrace register job.toml probe.log --radius \"1 mm\" --noise \"2 um\" --add",
                "Of another probe, added to the table that is there",
            ),
            ("terrace register job.toml --json", "For a program: with the covariance"),
        ],
    ),
    #[cfg(feature = "compare")]
    (
        "compare",
        &[
            ("terrace compare job.toml", "All systems, as a table"),
            ("terrace compare job.toml -o compare", "Writes tables and charts too; open compare/compare.html"),
            ("terrace compare job.toml --systems flat,z-range,sync", "Three systems only"),
        ],
    ),
    (
        "sweep",
        &[
            ("terrace sweep job.toml --set focus.pdof=0.05..0.2mm/4", "Four values, evenly spaced"),
            (
                "terrace sweep job.toml --set focus.pdof=70um,140um --set partition.method=contour,z-range -o sweep.csv",
                "All combinations, as a CSV file",
            ),
            (
                "terrace sweep job.toml --set machine.profile=xyz-galvo-40,xyz-galvo-100,xyz-zoom-40",
                "Ranks lenses and heads by stops and time",
            ),
        ],
    ),
    (
        "resume",
        &[
            ("terrace resume job.job --from B0020 -o rest.job", "Blocks B0020 to the last"),
            ("terrace resume job.job --only B0020,B0025-B0031 -o rest.job", "These blocks"),
            ("terrace resume job.job --done done.txt -o rest.job", "Blocks that the file does not list"),
        ],
    ),
    (
        "batch",
        &[
            ("terrace batch jobs -o out", "Every *.toml of the folder; unchanged jobs are skipped"),
            ("terrace batch jobs -o out --verify --report out/batch.json", "Verifies each, writes a report"),
            ("terrace batch jobs -o out --index out/index.html", "A page with a picture of every job"),
            ("terrace batch jobs -o out --engine dask --scheduler tcp://first:8786", "By the workers of a fleet"),
            ("terrace batch jobs -o out --plan units.jsonl", "For another engine: writes the jobs as units"),
            ("terrace batch --units units.jsonl --unit 3/40", "Works on the third of forty shares of them"),
            ("terrace batch --collect units.jsonl", "One report of all units"),
        ],
    ),
    (
        "diff",
        &[
            ("terrace diff before.job after.job", "Figures, warnings and files that differ"),
            ("terrace diff before.job after.job -o both.html", "A page with both views and one camera"),
        ],
    ),
    (
        "doctor",
        &[
            ("terrace doctor", "What is there, and how to install what is not"),
            ("terrace doctor --json", "For a program"),
        ],
    ),
    (
        "inspect",
        &[
            ("terrace inspect part.stl --unit mm", "Size and place of a surface"),
            ("terrace inspect leather.svg", "Size and strokes of a drawing"),
            ("terrace inspect job.job", "What a job folder holds"),
            #[cfg(feature = "compare")]
            ("terrace inspect --nurbs dish.nurbs.json", "A NURBS surface and the ways to its height"),
        ],
    ),
    (
        "import",
        &[
            ("terrace import part.step", "Writes part.ply"),
            ("terrace import part.step -o fine.ply --tolerance \"2 um\"", "Facets within 2 um of the surface"),
        ],
    ),
    (
        "machines",
        &[
            ("terrace machines", "Lists them"),
            ("terrace machines xyz-galvo-40 -o our-machine.toml", "A machine file to start from"),
        ],
    ),
    (
        "explain",
        &[
            ("terrace explain travel", "What error[travel] means and what to do"),
            ("terrace explain steep --json", "For a program"),
        ],
    ),
    (
        "completions",
        &[
            ("terrace completions bash > ~/.local/share/bash-completion/completions/terrace", "For bash"),
            ("terrace completions zsh > ~/.zfunc/_terrace", "For zsh; the folder must be in fpath"),
            ("terrace completions fish > ~/.config/fish/completions/terrace.fish", "For fish"),
        ],
    ),
    (
        "man",
        &[
            ("terrace man compile | man -l -", "Reads a page"),
            ("terrace man -o ~/.local/share/man/man1", "Writes the pages of all commands, then: man terrace-compile"),
        ],
    ),
];

/// The names of all commands.
pub fn commands() -> Vec<&'static str> {
    EXAMPLES.iter().map(|(name, _)| *name).filter(|name| !name.is_empty()).collect()
}

/// The end of a command's help: what each example does, and below it what is typed.
pub fn help(examples: &[Example]) -> String {
    let mut text = "Examples:".to_owned();
    for (typed, does) in examples {
        let _ = write!(text, "\n  {does}:\n    {typed}");
    }
    text
}
