//! Times from rest to rest, by arithmetic of the verifier's own. Units: mm, s.

use terrace_core::math;
/// Turns sharper than this make the spot rest, rad.
pub(super) const CORNER: f64 = 0.26;

/// From rest to rest by the symmetric profile that is fastest under its limits. At the peak speed p each ramp takes
/// p/a + a/j, or 2 sqrt(p/j) where the acceleration is never reached, and covers half of p times that.
pub(super) fn profile_time(way: f64, v: f64, a: f64, j: Option<f64>) -> f64 {
    if way == 0.0 {
        return 0.0;
    }
    let Some(j) = j else {
        let peak = v.min((way * a).sqrt());
        return peak / a + way / peak;
    };
    let reaches = |p: f64| p >= a * a / j;
    let ramp = |p: f64| if reaches(p) { p / a + a / j } else { 2.0 * (p / j).sqrt() };
    // p (p/a + a/j) = way, or 2 p sqrt(p/j) = way.
    let slow = a / j;
    let long = a / 2.0 * ((slow * slow + 4.0 * way / a).sqrt() - slow);
    let peak = if reaches(long) { long } else { math::cbrt(way * way * j / 4.0) };
    let peak = peak.min(v);
    ramp(peak) + way / peak
}
