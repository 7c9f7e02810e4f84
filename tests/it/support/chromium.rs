//! Pictures of SVG files in Chromium, which `setup.sh all` installs: `tests/browser/render.mjs` opens them as documents.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use resvg::tiny_skia::Pixmap;
use serde_json::{Value, json};
use tempfile::TempDir;

/// Millimetres of a CSS pixel.
const MM_PER_PX: f64 = 25.4 / 96.0;

/// Pixels of a picture.
#[derive(Clone, Copy)]
pub enum Scale {
    /// In a millimetre of the page that the file itself states.
    PerMm(f64),
    /// On the longer side of the page.
    Side(u32),
}

/// What is seen of a page, row by row from the top.
pub struct Ink {
    pub width: usize,
    pub height: usize,
    /// Pixels that are darker than paper.
    pub is_ink: Vec<bool>,
    /// Pixels whose neighbours have the same colour: edges, which renderers blend, are between them.
    pub is_flat: Vec<bool>,
}

/// A pixel with a channel below this is seen against white.
const DARKEST_PAPER: u8 = 250;

/// Whether neighbours have the same colour, but for rounding.
fn is_same(a: [u8; 3], b: [u8; 3]) -> bool {
    a.iter().zip(b).all(|(&a, b)| a.abs_diff(b) <= 6)
}

impl Ink {
    /// The upper left part of a picture, on white.
    pub fn new(picture: &Pixmap, [width, height]: [usize; 2]) -> Self {
        let mut colours = vec![[255; 3]; width * height];
        let (stride, data) = (picture.width() as usize, picture.data());
        for (i, colour) in colours.iter_mut().enumerate() {
            let (x, y) = (i % width, i / width);
            if let (true, Some(p)) = (x < stride, data.get(4 * (y * stride + x)..).and_then(|p| p.first_chunk::<4>())) {
                // Channels are multiplied by alpha.
                *colour = [0, 1, 2].map(|k| p[k] + (255 - p[3]));
            }
        }
        let is_ink: Vec<bool> = colours.iter().map(|c| c.iter().any(|&channel| channel < DARKEST_PAPER)).collect();
        let mut is_flat = vec![true; width * height];
        // Each pixel with the one to its right and the three below it.
        for (i, &colour) in colours.iter().enumerate() {
            let (x, y) = (i % width, i / width);
            for (dx, dy) in [(1, 0), (-1, 1), (0, 1), (1, 1)] {
                let Some(x) = x.checked_add_signed(dx).filter(|&x| x < width && y + dy < height) else { continue };
                let k = (y + dy) * width + x;
                if colours[k] != colour && (is_ink[k] != is_ink[i] || !is_same(colours[k], colour)) {
                    (is_flat[i], is_flat[k]) = (false, false);
                }
            }
        }
        Self { width, height, is_ink, is_flat }
    }

    pub fn is_blank(&self) -> bool {
        !self.is_ink.contains(&true)
    }
}

/// A rendered file.
pub struct Picture {
    /// mm, in the size that the file states; that of its viewBox in CSS pixels where it states none.
    pub page_mm: [f64; 2],
    png: PathBuf,
    scale: Scale,
}

impl Picture {
    /// The page in mm where its longer side is given.
    pub fn scaled_to(&self, side: f64) -> [f64; 2] {
        let longest = self.page_mm[0].max(self.page_mm[1]);
        self.page_mm.map(|v| v / longest * side)
    }

    /// Decodes the picture: thousands of them are not in memory at once.
    pub fn ink(&self) -> Ink {
        let longest = self.page_mm[0].max(self.page_mm[1]);
        let per_mm = match self.scale {
            Scale::PerMm(n) => n,
            Scale::Side(n) => f64::from(n) / longest,
        };
        // A page of 40 mm may measure 39.998 mm in Chromium, which lays out in 64ths of a pixel.
        let picture = Pixmap::load_png(&self.png).unwrap_or_else(|e| panic!("{}: {e}", self.png.display()));
        Ink::new(&picture, self.page_mm.map(|mm| (mm * per_mm).round() as usize))
    }
}

/// Pictures of files, in their order, in a folder that goes when it is dropped.
pub struct Pictures {
    /// Or why Chromium shows nothing of the file.
    pub list: Vec<Result<Picture, String>>,
    _folder: TempDir,
}

/// Renders files in one process of Chromium.
pub fn pictures(files: &[PathBuf], scale: Scale) -> Pictures {
    let folder = super::folder();
    let pngs: Vec<PathBuf> = (0..files.len()).map(|i| folder.path().join(format!("{i}.png"))).collect();
    let request = |(file, out): (&PathBuf, &PathBuf)| match scale {
        Scale::PerMm(n) => json!({"file": file, "out": out, "perMm": n}),
        Scale::Side(n) => json!({"file": file, "out": out, "side": n}),
    };
    let requests: Vec<Value> = files.iter().zip(&pngs).map(request).collect();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser/render.mjs");
    let mut node = Command::new("node");
    let node = node.arg(&script).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut node = node.spawn().expect("node is installed by setup.sh all");
    let mut stdin = node.stdin.take().expect("a pipe");
    // The script reads all of it before it writes.
    stdin.write_all(Value::from(requests).to_string().as_bytes()).expect("it reads its requests");
    drop(stdin);
    let out = node.wait_with_output().expect("it ends");
    assert!(out.status.success(), "{}: {}", script.display(), super::said(&out));
    let text = String::from_utf8(out.stdout).expect("text");
    let answers: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(answers.len(), files.len(), "an answer for each file");
    let picture = |(answer, png): (Value, PathBuf)| {
        if let Some(error) = answer["error"].as_str() {
            return Err(error.to_owned());
        }
        let side = |i: usize| answer["page"][i].as_f64().expect("a number") * MM_PER_PX;
        Ok(Picture { page_mm: [side(0), side(1)], png, scale })
    };
    Pictures { list: answers.into_iter().zip(pngs).map(picture).collect(), _folder: folder }
}
