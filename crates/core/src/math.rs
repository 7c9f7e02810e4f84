//! Elementary functions that give the same bits on every processor and operating system.
//!
//! Those of `f64` call the C library of the system, whose last bits depend on its version and on the instructions
//! of the processor (glibc picks other code where there is fused multiply-add). Programs and manifests rest on them,
//! so they come from the `libm` crate, which is compiled in. The lint `disallowed_methods` (clippy.toml) keeps the
//! others out. Rounding, `sqrt`, `abs` and `mul_add` are exact by IEEE 754, and `powi` multiplies.

pub use libm::{
    acos, asin, atan, atan2, cbrt, cos, exp, exp2, log as ln, log2, log10, pow, sin, sincos as sin_cos, tan,
};

/// Squares of lengths between these bounds lose nothing but what rounds.
const SQUARES: std::ops::RangeInclusive<f64> = 1e-280..=1e300;

/// The length of a vector, to two units in the last place; infinite where a component is, as `f64::hypot`.
#[inline]
pub fn hypot(x: f64, y: f64) -> f64 {
    let square = x * x + y * y;
    if SQUARES.contains(&square) {
        square.sqrt()
    } else {
        // Too long or too short for its square, zero, or not a number.
        libm::hypot(x, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Function = fn(f64) -> f64;

    #[test]
    fn length_holds_for_vectors_whose_squares_do_not() {
        for scale in [1.0, 1e-300, 1e-160, 1e-140, 1e140, 1e160, 1e300] {
            let length = hypot(3.0 * scale, -4.0 * scale);
            assert!((length / scale - 5.0).abs() < 8.0 * f64::EPSILON, "{length} at {scale}");
        }
        assert_eq!(hypot(0.0, -0.0), 0.0);
        assert_eq!(hypot(f64::NEG_INFINITY, f64::NAN), f64::INFINITY);
        assert!(hypot(1.0, f64::NAN).is_nan());
    }

    #[test]
    fn functions_have_the_bits_that_they_have_everywhere() {
        // One argument in several hundred rounds otherwise in some C library; a sum over many shows it.
        let bits =
            |f: Function| (1..4000).fold(0_u64, |sum, k| sum.rotate_left(7) ^ f(f64::from(k) * 0.000_731).to_bits());
        let functions: [(&str, Function, u64); 13] = [
            ("sin", sin, 0xb7ab_0058_8966_a6a9),
            ("cos", cos, 0x5473_b9f9_1605_1256),
            ("tan", tan, 0x7e02_894b_e608_6f91),
            ("atan", atan, 0xbd50_ab5b_40bd_7e9d),
            ("atan2", |x| atan2(x, 0.7), 0xd684_4dee_938a_c146),
            ("acos", |x| acos(x / 3.0), 0x1bf2_1099_124c_ff4d),
            ("asin", |x| asin(x / 3.0), 0xe840_122d_7940_281a),
            ("exp", exp, 0x5b49_9e17_68b7_88ea),
            ("ln", ln, 0xa50b_fed2_8fda_141c),
            ("pow", |x| pow(x, 1.7), 0xb394_a879_40cb_1efc),
            ("cbrt", cbrt, 0x9deb_b62d_85d0_9d4e),
            ("hypot", |x| hypot(x, 0.3), 0x6a3b_2c4f_b508_d5be),
            ("log10", log10, 0xe5f1_b334_5f27_25f1),
        ];
        for (name, f, sum) in functions {
            assert_eq!(bits(f), sum, "{name}: {:#x}", bits(f));
        }
    }

    /// Steps of the last place between two numbers of one sign.
    fn last_places(a: f64, b: f64) -> u64 {
        if a == b || (a.is_nan() && b.is_nan()) {
            return 0;
        }
        assert_eq!(a.is_sign_negative(), b.is_sign_negative(), "{a} and {b}");
        a.to_bits().abs_diff(b.to_bits())
    }

    /// The verifier computes with the same functions as the planner, so a fault in them would be in both: here they
    /// stand beside those of the system, another implementation.
    #[test]
    #[allow(clippy::disallowed_methods, reason = "they are what is compared with")]
    fn functions_agree_with_those_of_the_system_to_two_last_places() {
        let pairs: [(&str, Function, Function); 17] = [
            ("sin", sin, f64::sin),
            ("cos", cos, f64::cos),
            ("tan", tan, f64::tan),
            ("sin_cos.0", |x| sin_cos(x).0, f64::sin),
            ("sin_cos.1", |x| sin_cos(x).1, f64::cos),
            ("asin", asin, f64::asin),
            ("acos", acos, f64::acos),
            ("atan", atan, f64::atan),
            ("atan2", |x| atan2(x, -0.7), |x| f64::atan2(x, -0.7)),
            ("exp", exp, f64::exp),
            ("exp2", exp2, f64::exp2),
            ("ln", ln, f64::ln),
            ("log2", log2, f64::log2),
            ("log10", log10, f64::log10),
            ("pow", |x| pow(x, 1.7), |x| f64::powf(x, 1.7)),
            ("cbrt", cbrt, f64::cbrt),
            ("hypot", |x| hypot(x, 0.3), |x| f64::hypot(x, 0.3)),
        ];
        // Arguments from 1e-12 to 1e3, of both signs, the golden ratio apart.
        let arguments = (0..200_000_u32).flat_map(|k| {
            let size = libm::pow(10.0, (f64::from(k) * 0.618_033_988_749_894_9).fract() * 15.0 - 12.0);
            [size, -size]
        });
        for x in arguments {
            for (name, ours, systems) in pairs {
                let (a, b) = (ours(x), systems(x));
                assert!(last_places(a, b) <= 2, "{name}({x:e}): {a:e} beside {b:e}");
            }
        }
    }
}
