//! The sample that `terrace init` writes: a commented job file, a small freeform surface and a drawing.

use terrace_core::math;
/// File name of the sample surface.
pub const SAMPLE_SURFACE_NAME: &str = "sample.stl";

/// The commented job file.
pub const SAMPLE_JOB: &str = include_str!("sample.toml");

/// File name of the sample drawing.
pub const SAMPLE_DRAWING_NAME: &str = "sample.svg";

/// A leaf with its veins on a page of 10 x 10 mm.
pub const SAMPLE_DRAWING: &str = include_str!("sample.svg");

/// File name of the JSON schema that the job file names in its first line.
pub const SCHEMA_NAME: &str = "job.schema.json";

/// A gently curved 60 x 50 mm panel as binary STL in mm: z = 1.2 - (x/60)² - 0.8 (y/50)² + 0.15 sin(x/9).
pub fn sample_surface() -> Vec<u8> {
    let (nx, ny) = (60u32, 50u32);
    let mut out = Vec::with_capacity(84 + (2 * nx * ny * 50) as usize);
    let mut header = [b' '; 80];
    header[..20].copy_from_slice(b"terrace sample panel");
    out.extend_from_slice(&header);
    out.extend_from_slice(&(2 * nx * ny).to_le_bytes());
    for j in 0..ny {
        for i in 0..nx {
            let (a, b, c, d) =
                (sample_node(i, j), sample_node(i + 1, j), sample_node(i + 1, j + 1), sample_node(i, j + 1));
            for facet in [[a, b, c], [a, c, d]] {
                // The normal may be left zero: readers derive it from the corners.
                out.extend_from_slice(&[0; 12]);
                for v in facet.iter().flatten() {
                    out.extend_from_slice(&v.to_le_bytes());
                }
                out.extend_from_slice(&[0; 2]);
            }
        }
    }
    out
}

/// Node (i, j) of the panel, whose cells are 1 mm wide.
fn sample_node(i: u32, j: u32) -> [f32; 3] {
    let (x, y) = (f64::from(i) - 30.0, f64::from(j) - 25.0);
    let z = 1.2 - (x / 60.0).powi(2) - 0.8 * (y / 50.0).powi(2) + 0.15 * math::sin(x / 9.0);
    [x as f32, y as f32, z as f32]
}
