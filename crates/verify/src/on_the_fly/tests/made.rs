//! On-the-fly jobs for the tests, from job file to folder: the path of a planned program at the speed of its pens,
//! the stage a moving average of it, taken three times, the scanner the rest.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::OnceLock;
use terrace_core::math;

use crate::{Proof, verify};
use terrace_core::machine::Machine;
use terrace_core::program::{PenId, PieceId};
use terrace_input::job::{Job, Mode, Overrides};
use terrace_plan::manifest::{FlyAccuracy, FlyLengths, OnTheFlySummary};
use terrace_plan::on_the_fly::axes::motion::{Motion, Waypoint};
use terrace_plan::on_the_fly::check::Checked;
use terrace_plan::on_the_fly::path;
use terrace_plan::on_the_fly::path::height_field::HeightField;
use terrace_plan::on_the_fly::program::{Kind, Program};
use terrace_plan::ordered_strokes::OrderedStrokes;
use terrace_plan::plan::OnTheFlyPlan;
use terrace_plan::plan::{self, Inputs};
use terrace_report::job_folder::write_on_the_fly;

/// Height of a part at x, y, mm.
pub(super) type Shape = fn(f64, f64) -> f64;

/// What a made job is like.
#[derive(Clone, Copy)]
pub(super) struct Sort {
    pub(super) kind: Kind,
    pub(super) profile: &'static str,
    pub(super) shape: Shape,
    /// Half sizes of the part, mm.
    pub(super) half: [f64; 2],
    pub(super) pdof: f64,
    pub(super) textures: &'static str,
    /// Speed of the pen, and of jumps, mm/s.
    pub(super) speed: [f64; 2],
    /// Width of each of the three averages, s.
    pub(super) width: f64,
    /// Distance of the path's nodes, mm.
    pub(super) spacing: f64,
    /// Step of the height field, mm: wide enough that facets do not show in the normals.
    pub(super) height_field_step: f64,
}

/// A gentle dome, hatched.
pub(super) const DOME: Sort = Sort {
    kind: Kind::Xyzuv,
    profile: "xyz-galvo-40",
    shape: |x, y| -(x * x + y * y) / 800.0,
    half: [20.0, 12.0],
    pdof: 0.6,
    textures: "[[texture]]\npattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"20 deg\"\n\
               [[texture]]\npattern = \"circles\"\npitch = \"8 mm\"\ncell = \"5 mm\"\npen = \"deep\"\n",
    speed: [50.0, 70.0],
    width: 0.12,
    spacing: 0.1,
    height_field_step: 0.1,
};

/// A bowl on a slope, which never lies level, on seven axes.
pub(super) const BOWL: Sort = Sort {
    kind: Kind::Xyzacuv,
    profile: "xyzac-galvo-10",
    shape: |x, y| -0.25 * y - (x * x + y * y) / 200.0,
    half: [8.0, 4.0],
    pdof: 0.25,
    textures: "[[texture]]\npattern = \"hatch\"\npitch = \"1 mm\"\ndirection = \"0 deg\"\n",
    speed: [15.0, 15.0],
    width: 0.5,
    spacing: 0.05,
    height_field_step: 1.0,
};

/// A job with its motion.
pub(super) struct Bench {
    dir: tempfile::TempDir,
    pub(super) job: Job,
    pub(super) machine: Machine,
    pub(super) motion: Motion,
    pub(super) program: Program,
    lengths: FlyLengths,
}

/// A motion along the strokes of a sort's job, and the program of it.
#[derive(Clone)]
pub(super) struct Planned {
    machine: Machine,
    motion: Motion,
    program: Program,
    lengths: FlyLengths,
}

impl Planned {
    /// The one of a sort, planned once for all tests.
    fn of(sort: Sort) -> Self {
        static FIVE: OnceLock<Planned> = OnceLock::new();
        static SEVEN: OnceLock<Planned> = OnceLock::new();
        let once = if sort.kind == Kind::Xyzuv { &FIVE } else { &SEVEN };
        once.get_or_init(|| Self::new(sort)).clone()
    }

    pub(super) fn new(sort: Sort) -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let path = write_job(&sort, dir.path());
        // Strokes in the order of a stepped program, whose machine has the same field.
        let plan = plan::plan(load(&path, Mode::Stepped), &|_, _| {}).unwrap_or_else(|e| panic!("{e}"));
        let plan = plan.stepped().expect("a stepped job");
        let stepped = plan.checked.program();
        let Inputs { machine, surface, .. } =
            Inputs::load(&load(&path, Mode::OnTheFly)).unwrap_or_else(|e| panic!("{e}"));
        let height_field =
            HeightField::over(&surface, plan.passes[0].texture, sort.height_field_step, 0.0).expect("a part");
        let ordered = OrderedStrokes::of_program(stepped);
        let path = path::Path::of(&ordered, 0..ordered.strokes.len(), &surface, &height_field, sort.spacing);
        let speeds: Vec<f64> = stepped.pens.iter().map(|p| p.speed.as_mm_s()).collect();
        let motion = motion(&path, &height_field, &sort, &speeds);
        let (program, _) = Program::of(&motion, &ordered, &machine, plan.checked.origin(), sort.kind)
            .unwrap_or_else(|e| panic!("{e}"));
        let lengths = FlyLengths {
            texture_mm: plan.summary.texture_mm,
            skipped_mm: plan.summary.skipped_mm,
            ..FlyLengths::default()
        };
        Self { machine, motion, program, lengths }
    }
}

/// Writes the job of a sort with its surface, and returns its path.
fn write_job(sort: &Sort, dir: &Path) -> PathBuf {
    std::fs::write(dir.join("part.stl"), stl(sort)).expect("write");
    let text = format!(
        "surface = {{ file = \"part.stl\", unit = \"mm\" }}\nfocus = {{ pdof = \"{} mm\" }}\n\
         partition = {{ method = \"z-range\" }}\nmachine = {{ profile = {:?} }}\n{}\
         [[pen]]\nname = \"fine\"\nspeed = \"{} mm/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"\n\
         [[pen]]\nname = \"deep\"\nspeed = \"{} mm/s\"\npower = \"3 W\"\nfrequency = \"40 kHz\"\n",
        sort.pdof,
        sort.profile,
        sort.textures,
        sort.speed[0],
        sort.speed[0] * 0.8,
    );
    let path = dir.join("job.toml");
    std::fs::write(&path, text).expect("write");
    path
}

fn load(path: &Path, mode: Mode) -> Job {
    let overrides = Overrides { mode: Some(mode), ..Overrides::default() };
    Job::load(path, &overrides).unwrap_or_else(|e| panic!("{e}"))
}

impl Bench {
    pub(super) fn new(sort: Sort) -> Self {
        Self::of(sort, Planned::of(sort))
    }

    /// A folder of its own for what is planned.
    pub(super) fn of(sort: Sort, Planned { machine, motion, program, lengths }: Planned) -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let job = load(&write_job(&sort, dir.path()), Mode::OnTheFly);
        Self { dir, job, machine, motion, program, lengths }
    }

    pub(super) fn checked(&self) -> Checked {
        Checked::new(self.program.clone(), &self.machine, false).unwrap_or_else(|e| panic!("{e}"))
    }

    /// Writes a program into a folder and returns its path.
    pub(super) fn written(&self, checked: Checked) -> PathBuf {
        self.stating(checked, self.lengths)
    }

    fn stating(&self, checked: Checked, lengths: FlyLengths) -> PathBuf {
        let inputs = Arc::new(Inputs::load(&self.job).expect("inputs"));
        let laser = terrace_plan::plan::laser(&self.job, &self.machine, &checked);
        let figures = checked.figures();
        let blend_mm = terrace_plan::emit::on_the_fly::blend_us(figures) as f64 * 1e-6 * figures.corner_mm_s / 8.0;
        let accuracy = FlyAccuracy { laser, blend_mm, part_mm: inputs.surface.size_mm(), ..FlyAccuracy::default() };
        let plan = OnTheFlyPlan {
            job: self.job.clone(),
            machine: self.machine.clone(),
            summary: OnTheFlySummary::new(&checked, lengths, accuracy, None, Vec::new()),
            checked,
            left_out: Vec::new(),
            warnings: Vec::new(),
            texture: inputs.texture.clone(),
            inputs,
        };
        let folder = self.dir.path().join("made.job");
        write_on_the_fly(&plan, &folder).unwrap_or_else(|e| panic!("{e}"));
        folder
    }

    /// Changes the program, writes it unchecked with the lengths it then has, and verifies.
    pub(super) fn mutant(&self, change: impl FnOnce(&mut Program)) -> Proof {
        let mut program = self.program.clone();
        change(&mut program);
        assert_ne!(program, self.program, "the mutant is one");
        let checked = Checked::unchecked(program, &self.machine);
        let proof = |lengths| {
            let folder = self.stating(checked.clone(), lengths);
            verify(&folder, None).unwrap_or_else(|e| panic!("{e}"))
        };
        // A damaged job states the lengths that it has.
        let skipped_mm = proof(self.lengths).lengths.skipped_mm;
        proof(FlyLengths { skipped_mm, ..self.lengths })
    }

    /// Changes a file of the folder, renews its hash, and verifies.
    pub(super) fn damaged(&self, name: &str, change: impl FnOnce(&str) -> String) -> Proof {
        self.damaged_of(self.checked(), name, change)
    }

    /// The same with another program.
    pub(super) fn damaged_of(&self, checked: Checked, name: &str, change: impl FnOnce(&str) -> String) -> Proof {
        let folder = self.written(checked);
        let text = std::fs::read_to_string(folder.join(name)).expect("text");
        let changed = change(&text);
        assert_ne!(changed, text, "the damage does nothing");
        std::fs::write(folder.join(name), &changed).expect("write");
        if name != "manifest.json" {
            renew(&folder, name, changed.as_bytes());
        }
        verify(&folder, None).unwrap_or_else(|e| panic!("{e}"))
    }
}

fn renew(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join("manifest.json");
    let mut manifest: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&path).expect("bytes")).expect("a manifest");
    let files = manifest["files"].as_array_mut().expect("files");
    let entry = files.iter_mut().find(|f| f["file"] == name).expect("listed");
    entry["bytes"] = bytes.len().into();
    entry["blake3"] = blake3::hash(bytes).to_hex().to_string().into();
    std::fs::write(&path, manifest.to_string()).expect("write");
}

/// A binary STL of the shape.
fn stl(sort: &Sort) -> Vec<u8> {
    let count = 80;
    let at = |i: usize, j: usize| {
        let [x, y] = [(0, i), (1, j)].map(|(k, n)| sort.half[k] * (2.0 * n as f64 / count as f64 - 1.0));
        [x as f32, y as f32, (sort.shape)(x, y) as f32]
    };
    let mut out = vec![0; 80];
    out.extend_from_slice(&(2 * (count * count) as u32).to_le_bytes());
    for (i, j) in (0..count).flat_map(|j| (0..count).map(move |i| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        for facet in [[a, b, c], [a, c, d]] {
            out.extend_from_slice(&[0; 12]);
            facet.iter().flatten().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
            out.extend_from_slice(&[0; 2]);
        }
    }
    out
}

/// Step of the grid on which the path is averaged, s.
const STEP: f64 = 5e-4;

/// Times of the nodes at constant speeds, and the stage as an average over time.
fn motion(path: &path::Path, height_field: &HeightField, sort: &Sort, speeds: &[f64]) -> Motion {
    let lead = 2.0 * sort.width;
    let mut time = vec![lead];
    for i in 1..path.len() {
        let [a, b] = [path.nodes[i - 1].at, path.nodes[i].at];
        let speed = path.nodes[i].pen.map_or(sort.speed[1], |pen| speeds[pen.index()]);
        let way = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
        time.push(time[i - 1] + way / (0.998 * speed));
    }
    let end = time[path.len() - 1];
    let count = ((end + lead) / STEP) as usize + 2;
    let mut hint = 0;
    let mut grid: Vec<[f64; 3]> = (0..count)
        .map(|i| {
            let t = (i as f64 * STEP).clamp(lead, end);
            while hint + 2 < time.len() && time[hint + 1] < t {
                hint += 1;
            }
            let share = ((t - time[hint]) / (time[hint + 1] - time[hint]).max(1e-12)).clamp(0.0, 1.0);
            std::array::from_fn(|k| {
                path.nodes[hint].at[k] + share * (path.nodes[hint + 1].at[k] - path.nodes[hint].at[k])
            })
        })
        .collect();
    for _ in 0..3 {
        grid = averaged(&grid, (sort.width / STEP) as usize / 2);
    }
    let stage = |t: f64| {
        let i = ((t / STEP) as usize).min(count - 2);
        let share = t / STEP - i as f64;
        let [a, b] = [grid[i], grid[i + 1]];
        std::array::from_fn::<f64, 3, _>(|k| a[k] + share * (b[k] - a[k]))
    };
    let mut out = Motion::default();
    let mut node = |t: f64, p: [f64; 3], pen: Option<PenId>, stroke: PieceId| {
        let s = stage(t);
        let axes = match sort.kind {
            Kind::Xyzuv => [s[0], s[1], s[2], 0.0, 0.0, p[0] - s[0], p[1] - s[1]],
            Kind::Xyzacuv => {
                // The tool stands on the height field under the averaged path, along its normal.
                let height = height_field.at([s[0], s[1]]);
                let n = height.normal().0;
                let (a, c) = (math::acos(n[2]), math::atan2(-n[0], n[1]));
                let q = turned(a, c, [s[0], s[1], height.z]);
                let m = turned(a, c, p);
                [q[0], q[1], q[2], a, c, m[0] - q[0], m[1] - q[1]]
            }
        };
        out.waypoints.push(Waypoint { time: t, axes, pen, stroke });
    };
    let leads = (lead / 2e-3) as usize;
    for i in 0..leads {
        node(lead * i as f64 / leads as f64, path.nodes[0].at.mm, None, path.nodes[0].stroke);
    }
    for (i, &t) in time.iter().enumerate() {
        node(t, path.nodes[i].at.mm, path.nodes[i].pen, path.nodes[i].stroke);
    }
    let last = path.len() - 1;
    for i in 1..=leads {
        node(end + lead * i as f64 / leads as f64, path.nodes[last].at.mm, None, path.nodes[last].stroke);
    }
    out
}

/// Rx(a) Rz(-c) p.
fn turned(a: f64, c: f64, p: [f64; 3]) -> [f64; 3] {
    let (x, y) = (p[0] * math::cos(c) + p[1] * math::sin(c), p[1] * math::cos(c) - p[0] * math::sin(c));
    [x, y * math::cos(a) - p[2] * math::sin(a), y * math::sin(a) + p[2] * math::cos(a)]
}

/// Mean over `half` samples on either side; beyond its ends the path stands still.
fn averaged(line: &[[f64; 3]], half: usize) -> Vec<[f64; 3]> {
    let n = line.len() as i64;
    let at = |i: i64| line[i.clamp(0, n - 1) as usize];
    let width = 2 * half as i64 + 1;
    let mut sum = [0.0; 3];
    for i in -(half as i64)..=half as i64 {
        sum = [0, 1, 2].map(|k| sum[k] + at(i)[k]);
    }
    let mut out = Vec::with_capacity(line.len());
    for i in 0..n {
        out.push(sum.map(|s| s / width as f64));
        let (gone, next) = (at(i - half as i64), at(i + 1 + half as i64));
        sum = [0, 1, 2].map(|k| sum[k] + next[k] - gone[k]);
    }
    out
}
