//! `terrace inspect --nurbs`: a NURBS surface, and the three algorithms for its height.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::{Inspection, triple};
use terrace_compare::nurbs::{Convergence, Decoupled, Examination, GridSteps, Inversion, Method, Surface, examine};
use terrace_core::diag::Error;

/// How long each algorithm is timed at least.
const TIMED: Duration = Duration::from_millis(50);

/// Examines a NURBS file.
///
/// # Errors
/// Faults of the file; `nurbs-grid` where algorithm I cannot have its grid.
pub fn nurbs(path: &Path, steps: GridSteps) -> Result<Inspection, Error> {
    let surface = Surface::load(path)?;
    let found = examine(&surface, steps)?;
    let rates = Rates::of(&surface, &found);
    Ok(Inspection { text: text(&surface, &found, &rates), json: json(&surface, &found, &rates), warnings: Vec::new() })
}

/// Set-points per second of each algorithm, on one thread.
struct Rates {
    grid: f64,
    decoupled: Option<f64>,
    warm: f64,
    cold: f64,
}

impl Rates {
    fn of(surface: &Surface, found: &Examination) -> Self {
        let inversion = Inversion::new(surface, Method::GaussNewton);
        let mut warm = inversion.clone();
        let all = &found.samples;
        Self {
            grid: rate(all, |xy| found.grid.height(xy).unwrap_or_default()),
            decoupled: Decoupled::of(surface).ok().map(|decoupled| rate(all, |xy| decoupled.point(xy)[2])),
            warm: rate(all, |xy| warm.next(xy).map_or(0.0, |point| point.at[2])),
            cold: rate(all, |xy| inversion.cold(xy).map_or(0.0, |point| point.at[2])),
        }
    }
}

/// How often a second a height is found at these samples.
fn rate(samples: &[[f64; 3]], mut height: impl FnMut([f64; 2]) -> f64) -> f64 {
    let begin = Instant::now();
    let mut count = 0;
    while begin.elapsed() < TIMED {
        for &[x, y, _] in samples {
            std::hint::black_box(height([x, y]));
        }
        count += samples.len();
    }
    count as f64 / begin.elapsed().as_secs_f64()
}

fn text(surface: &Surface, found: &Examination, rates: &Rates) -> String {
    let ([pu, pv], [nu, nv], [lo, hi]) = (surface.degree(), surface.count(), surface.hull());
    let weights = if surface.is_rational() { "weights differ" } else { "equal weights" };
    let grid = found.grid_error.map_or("reaches no sample".to_owned(), |error| {
        format!("off by at most {} um at the {} samples that it reaches", um(error), found.grid_reaches)
    });
    let (is_decoupled, decoupled) = match &found.decoupled_error {
        Ok(error) => ("yes".to_owned(), format!("off by at most {} um", um(*error))),
        Err(e) => {
            let why = e.diags().first().map_or("", |d| &d.message);
            (format!("no ({})", why.trim_start_matches("the net is not decoupled: ")), "does not apply".to_owned())
        }
    };
    let millions = |rate: f64| format!("{:.2}", rate / 1e6);
    let of_ii = rates.decoupled.map_or(String::new(), |rate| format!("II {}, ", millions(rate)));
    format!(
        "NURBS surface\n\
         degrees     {pu} x {pv}\n\
         net         {nu} x {nv} control points, {weights}\n\
         size        {} mm (box of the control points)\n\
         height map  {}\n\
         decoupled   {is_decoupled}\n\
         algorithms for the height, at {} samples\n\
         I    grid of {} mm, k {} mm: {grid}\n\
         II   {decoupled}\n\
         III  from a linear guess: {}\n     \
              from the sample before: {}\n     \
              heights off by at most {} um\n     \
              full Newton steps, for comparison: {}\n\
         operations  point {}, I {}, II {}, III {} a step (full Newton {})\n\
         set-points  millions per second, measured: I {}, {of_ii}III {} from the sample before, {} from a linear guess\n",
        triple([0, 1, 2].map(|k| hi[k] - lo[k]), " x "),
        if found.is_height_map { "yes" } else { "no: x and y do not turn the same way everywhere" },
        found.samples.len(),
        plain(found.grid.step()),
        plain(found.grid.kernel()),
        convergence(&found.cold),
        convergence(&found.warm),
        um(found.cold.worst.max(found.warm.worst)),
        convergence(&found.newton),
        found.point_operations,
        found.grid_operations,
        found.decoupled_operations,
        found.step_operations,
        found.newton_step_operations,
        millions(rates.grid),
        millions(rates.warm),
        millions(rates.cold),
    )
}

/// How Newton's method converges, in words.
fn convergence(c: &Convergence) -> String {
    format!(
        "{} of {} converge, in at most {} steps, {:.2} on average",
        c.converged, c.samples, c.most_steps, c.mean_steps
    )
}

/// A length with as many digits as it has.
fn plain(mm: f64) -> f64 {
    (mm * 1e6).round() / 1e6
}

/// A length in um with three digits; what is below a picometre is rounding.
fn um(mm: f64) -> String {
    let um = 1000.0 * mm;
    if um < 1e-6 { "0.000001".to_owned() } else { format!("{um:.*}", if um < 0.01 { 6 } else { 4 }) }
}

fn convergence_json(c: &Convergence) -> Value {
    json!({"samples": c.samples, "converged": c.converged, "mean_steps": c.mean_steps, "most_steps": c.most_steps,
        "worst_um": 1000.0 * c.worst})
}

fn json(surface: &Surface, found: &Examination, rates: &Rates) -> Value {
    let [lo, hi] = surface.hull();
    let reason = found.decoupled_error.as_ref().err().and_then(|e| e.diags().first().map(|d| d.message.clone()));
    json!({
        "kind": "nurbs",
        "degree": surface.degree(),
        "control_points": surface.count(),
        "rational": surface.is_rational(),
        "lo_mm": lo,
        "hi_mm": hi,
        "height_map": found.is_height_map,
        "decoupled": found.decoupled_error.is_ok(),
        "not_decoupled": reason,
        "algorithm_i": {"grid_mm": found.grid.step(), "kernel_mm": found.grid.kernel(), "samples": found.grid_reaches,
            "worst_um": found.grid_error.map(|e| 1000.0 * e)},
        "algorithm_ii": {"worst_um": found.decoupled_error.as_ref().ok().map(|e| 1000.0 * e)},
        "algorithm_iii": {"cold": convergence_json(&found.cold),
            "warm": convergence_json(&found.warm), "full_newton": convergence_json(&found.newton)},
        "operations": {"point": found.point_operations, "algorithm_i": found.grid_operations,
            "algorithm_ii": found.decoupled_operations, "gauss_newton_step": found.step_operations,
            "newton_step": found.newton_step_operations},
        "set_points_per_s": {"algorithm_i": rates.grid, "algorithm_ii": rates.decoupled,
            "algorithm_iii_warm": rates.warm, "algorithm_iii_cold": rates.cold},
    })
}
