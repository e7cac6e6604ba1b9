//! Damping of a tissue.

use crate::BodyError;
use crate::error::{check, check_damping_ratio};
use std::f64::consts::TAU;

/// Damping of a tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damping {
    /// Damping ratio ζ of vibrations as short as the cells, at least 0: 0.5 is a tissue that hardly oscillates. Their damping does not depend on
    /// the cell size; longer vibrations are damped less.
    ///
    /// The damper parallel to a spring k between the masses m_a and m_b is ζ √(k · 2 m_a m_b/(m_a + m_b)). An element of size h has the damping
    /// of [`Self::LossFactor`] with β = ζ √(15/8) h √(ρ/E), that of the springs along the sides of a lattice of the same cells.
    Ratio(f64),
    /// Loss factor η = tan δ in shear at a frequency f, as rheometry and elastography measure it: dampers are β = η/(2π f) times the stiffness.
    /// The loss factor is proportional to the frequency.
    ///
    /// Of the elastic parameter λ of elements at most μ is damped. Otherwise the volume of nearly incompressible tissue would be damped so
    /// strongly that explicit steps become short.
    LossFactor {
        /// Loss factor η, at least 0.
        loss_factor: f64,
        /// Frequency f, Hz, above 0.
        frequency_hz: f64,
    },
    /// Rayleigh damping, B = α M + β K with the mass matrix M and the stiffness matrix K at rest. The mass-proportional part resists motion
    /// relative to the world.
    Rayleigh {
        /// Mass-proportional coefficient α, 1/s, at least 0.
        mass_per_s: f64,
        /// Stiffness-proportional coefficient β, s, at least 0.
        stiffness_s: f64,
    },
}

impl Default for Damping {
    /// A damping ratio of 0.5.
    fn default() -> Self {
        Self::Ratio(0.5)
    }
}

/// Damping as coefficients that add up, so that the damping of a mixture is a weighted mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct DampingCoefficients {
    /// Damping ratio.
    pub(crate) ratio: f64,
    /// β of the shear stiffness, and of as much of λ, s.
    pub(crate) shear_s: f64,
    /// β of the whole stiffness, s.
    pub(crate) stiffness_s: f64,
    /// α, 1/s.
    pub(crate) mass_per_s: f64,
}

impl Damping {
    /// Checks the parameters.
    pub(crate) fn validate(&self) -> Result<(), BodyError> {
        let at_least_0 = |what, value: f64| {
            check(what, value, value.is_finite() && value >= 0.0, "finite and at least 0").map(drop)
        };
        match *self {
            Self::Ratio(ratio) => check_damping_ratio(ratio).map(drop),
            Self::LossFactor { loss_factor, frequency_hz } => {
                let is_positive = frequency_hz.is_finite() && frequency_hz > 0.0;
                check("frequency of the loss factor, Hz", frequency_hz, is_positive, "finite and above 0")?;
                at_least_0("loss factor", loss_factor)
            }
            Self::Rayleigh { mass_per_s, stiffness_s } => {
                at_least_0("mass-proportional damping, 1/s", mass_per_s)?;
                at_least_0("stiffness-proportional damping, s", stiffness_s)
            }
        }
    }

    pub(crate) fn coefficients(&self) -> DampingCoefficients {
        let none = DampingCoefficients::default();
        match *self {
            Self::Ratio(ratio) => DampingCoefficients { ratio, ..none },
            Self::LossFactor { loss_factor, frequency_hz } => {
                DampingCoefficients { shear_s: loss_factor / (TAU * frequency_hz), ..none }
            }
            Self::Rayleigh { mass_per_s, stiffness_s } => {
                DampingCoefficients { mass_per_s, stiffness_s, ..none }
            }
        }
    }
}

impl DampingCoefficients {
    /// Damper parallel to a spring of `stiffness_n_per_m` between two masses, N s/m.
    pub(crate) fn of_spring(&self, stiffness_n_per_m: f64, (m_a, m_b): (f64, f64)) -> f64 {
        let of_ratio = self.ratio * (stiffness_n_per_m * 2.0 * m_a * m_b / (m_a + m_b)).sqrt();
        of_ratio + (self.shear_s + self.stiffness_s) * stiffness_n_per_m
    }

    /// The sum with `share` times `other`.
    pub(crate) fn plus(&self, share: f64, other: &Self) -> Self {
        Self {
            ratio: self.ratio + share * other.ratio,
            shear_s: self.shear_s + share * other.shear_s,
            stiffness_s: self.stiffness_s + share * other.stiffness_s,
            mass_per_s: self.mass_per_s + share * other.mass_per_s,
        }
    }

    /// These coefficients, multiplied by `factor`.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        Self::default().plus(factor, self)
    }
}
