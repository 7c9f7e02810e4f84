//! How hot a line gets under the beam, and again under a second exposure at a seam: an order of magnitude.
//!
//! Consumes a material, a beam and an absorptivity; promises the temperature of the surface of a half space without
//! melting, with constant properties and without losses, under a Gaussian beam that has moved for ever. Units: SI and
//! degC inside, as names say outside.
//!
//! # Source
//! Eagar and Tsai, Welding Journal 62 (1983) 346-s, eq. 12, for t to infinity:
//! T - T0 = A P / (pi rho c sqrt(4 pi a)) * integral over tau from 0 to infinity of
//! tau^(-1/2) / (2 a tau + s^2) * exp(-((x + v tau)^2 + y^2) / (4 a tau + 2 s^2)), with a = k / (rho c) and s half of the
//! 1/e^2 radius. Cui et al. (2021) give temperatures at a seam (eq. 6 and 7) without the spot and the absorptivity.

use std::f64::consts::PI;
use terrace_core::math;

/// Temperature of the part before it is marked, degC.
const BEFORE: f64 = 20.0;

/// A material, with properties that do not change with temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Material {
    /// Thermal conductivity, W/(m K).
    pub conductivity_w_m_k: f64,
    /// Density, kg/m³.
    pub density_kg_m3: f64,
    /// Specific heat, J/(kg K).
    pub heat_j_kg_k: f64,
}

/// A nickel alloy, the material of Cui et al. (2021), by the properties of handbooks.
pub(crate) const NICKEL_ALLOY: Material =
    Material { conductivity_w_m_k: 25.0, density_kg_m3: 8190.0, heat_j_kg_k: 600.0 };

/// A beam that moves over the part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// Power, W.
    pub power_w: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Radius at 1/e², um.
    pub radius_um: f64,
}

impl Beam {
    /// Rise of the temperature, K, of the surface `behind_m` behind the beam's centre on its line, if all power is absorbed.
    pub fn rise(&self, material: &Material, behind_m: f64) -> f64 {
        // With sqrt(tau) = s / sqrt(2 a) * tan(angle), dtau / sqrt(tau) = 2 s / sqrt(2 a) / cos^2(angle) dangle and
        // 2 a tau + s^2 = s^2 / cos^2(angle): their quotient is the constant 2 / (s sqrt(2 a)), and what is left of the
        // integrand is bounded and smooth.
        const STEPS: u32 = 2000;
        let Material { conductivity_w_m_k: k, density_kg_m3: rho, heat_j_kg_k: c } = *material;
        let (a, s) = (k / (rho * c), self.radius_um * 1e-6 / 2.0);
        let step = PI / 2.0 / f64::from(STEPS);
        let sum: f64 = (0..STEPS)
            .map(|i| {
                let root = s / (2.0 * a).sqrt() * math::tan((f64::from(i) + 0.5) * step);
                let tau = root * root;
                math::exp(-(self.speed_m_s * tau - behind_m).powi(2) / (4.0 * a * tau + 2.0 * s * s))
            })
            .sum();
        self.power_w / (PI * rho * c * (4.0 * PI * a).sqrt()) * sum * step * 2.0 / (s * (2.0 * a).sqrt())
    }

    /// The most of that on the line, K.
    pub fn peak(&self, material: &Material) -> f64 {
        // It lies within some radii behind the centre, and the rise has one maximum.
        let (mut lo, mut hi) = (0.0, 3e-6 * self.radius_um);
        for _ in 0..40 {
            let [a, b] = [1.0, 2.0].map(|third| lo + third * (hi - lo) / 3.0);
            if self.rise(material, a) < self.rise(material, b) { lo = a } else { hi = b }
        }
        self.rise(material, f64::midpoint(lo, hi))
    }

    /// The absorptivity with which the line peaks at a temperature, degC.
    pub fn absorptivity(&self, material: &Material, peak_degc: f64) -> f64 {
        (peak_degc - BEFORE) / self.peak(material)
    }
}

/// A row of [`fits`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Assumed radius of the beam at 1/e², um.
    pub radius_um: f64,
    /// The absorptivity that gives the printed temperature.
    pub absorptivity: f64,
    /// Peak of a second exposure of the same line, [`AFTER_S`] after the first, degC.
    pub second_exposure_degc: [f64; 3],
}

/// Times between two exposures, s.
pub(crate) const AFTER_S: [f64; 3] = [0.01, 0.1, 1.0];

/// Temperature that Cui et al. (2021) print for a first exposure, degC, and the power and speed of their beam.
pub const PRINTED: f64 = 2002.0;
const POWER: f64 = 100.0;
const SPEED: f64 = 0.1;

/// Which absorptivity explains the printed temperature, for radii of the beam, which is not published: any will do.
pub fn fits() -> [Fit; 4] {
    [25.0, 50.0, 100.0, 200.0].map(|radius_um| {
        let beam = Beam { power_w: POWER, speed_m_s: SPEED, radius_um };
        let absorptivity = beam.absorptivity(&NICKEL_ALLOY, PRINTED);
        // What is left of the first exposure adds to the second.
        let second_exposure_degc =
            AFTER_S.map(|after| PRINTED + absorptivity * beam.rise(&NICKEL_ALLOY, SPEED * after));
        Fit { radius_um, absorptivity, second_exposure_degc }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_printed_temperature_is_explained_by_any_absorptivity_from_0_03_to_0_4() {
        let found = fits().map(|fit| (1000.0 * fit.absorptivity).round() / 1000.0);
        assert_eq!(found, [0.034, 0.073, 0.165, 0.395]);
        for fit in fits() {
            let hot = fit.second_exposure_degc;
            assert!(hot[0] > hot[1] && hot[1] > hot[2] && hot[2] > PRINTED, "{hot:?}");
        }
    }

    #[test]
    fn a_resting_beam_heats_as_the_closed_form_has_it() {
        // At rest the centre rises by A P / (w k sqrt(2 pi)), w the 1/e² radius.
        for radius_um in [10.0, 100.0] {
            let beam = Beam { power_w: 3.0, speed_m_s: 1e-9, radius_um };
            let k = NICKEL_ALLOY.conductivity_w_m_k;
            let want = 3.0 / (radius_um * 1e-6 * k * (2.0 * PI).sqrt());
            let got = beam.rise(&NICKEL_ALLOY, 0.0);
            assert!((got / want - 1.0).abs() < 1e-3, "{got} {want}");
            // Moving it heats less, and most behind its centre.
            let moving = Beam { speed_m_s: 1.0, ..beam };
            let peak = moving.peak(&NICKEL_ALLOY);
            assert!(peak < want && peak >= moving.rise(&NICKEL_ALLOY, 0.0) && peak > moving.rise(&NICKEL_ALLOY, -1e-5));
        }
    }
}
