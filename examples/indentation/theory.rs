//! Forces on rigid tools pressed into an elastic body.

use super::scene::{POISSONS_RATIO as NU, Tip};
use std::f64::consts::PI;

/// E/(1 − ν²), Pa.
pub fn reduced_modulus_pa(youngs_modulus_pa: f64) -> f64 {
    youngs_modulus_pa / (1.0 - NU * NU)
}

/// Force of a half-space, N: Hertz, F = 4/3 E* √R d^1.5, for the ball; F = 2 E* a d for the punch.
pub fn half_space_n(tip: Tip, modulus_pa: f64, depth_m: f64) -> f64 {
    let (r, d) = (tip.radius_m(), depth_m.max(0.0));
    match tip {
        Tip::Ball => 4.0 / 3.0 * modulus_pa * r.sqrt() * d.powf(1.5),
        Tip::Punch => 2.0 * modulus_pa * r * d,
    }
}

/// Ratio of the force of a layer of `thickness_m` with a fixed bottom to that of the half-space: E. K. Dimitriadis, F. Horkay, J. Maresca,
/// B. Kachar, R. S. Chadwick, Biophys. J. 82 (2002) 2798, for the ball with a contact of radius √(R d); for the punch to first order in
/// its radius.
pub fn layer(tip: Tip, thickness_m: f64, depth_m: f64) -> f64 {
    let alpha = -(1.2876 - 1.4678 * NU + 1.3442 * NU * NU) / (1.0 - NU);
    let beta = (0.6387 - 1.0277 * NU + 1.5164 * NU * NU) / (1.0 - NU);
    match tip {
        Tip::Ball => {
            let chi = (tip.radius_m() * depth_m.max(0.0)).sqrt() / thickness_m;
            1.0 - 2.0 * alpha / PI * chi + 4.0 * (alpha / PI * chi).powi(2)
                - 8.0 / PI.powi(3) * (alpha.powi(3) + 4.0 * PI * PI / 15.0 * beta) * chi.powi(3)
                + 16.0 * alpha / PI.powi(4) * (alpha.powi(3) + 0.6 * PI * PI * beta) * chi.powi(4)
        }
        Tip::Punch => 1.0 / (1.0 + 2.0 * alpha / PI * tip.radius_m() / thickness_m),
    }
}
