//! Generator of a probing trajectory, as in `assets/trajectories/probe.csv`.

use super::Trajectory;
use crate::HapticsError;
use crate::error::check;
use glam::DVec3;
use std::f64::consts::TAU;

/// Parameters of a trajectory that presses into several places of a horizontal surface (normal +y), one after the other.
///
/// # The generator
///
/// One probe takes 1.25 s: down 350 ms, dwell 300 ms with a small oscillation of the depth, up 350 ms, across to the next place
/// 250 ms. Each movement has minimum jerk, s(τ) = 10τ³ − 15τ⁴ + 6τ⁵ (Flash and Hogan, Journal of
/// Neuroscience 5 (1985) 1688). Added to it is physiological tremor: on each axis five sinusoids between
/// 8 and 12 Hz (the band of the hand's tremor: Elble and Randall, Electroencephalography and Clinical
/// Neurophysiology 44 (1978) 72) of 0.1 mm RMS together, with phases from a seed. All frequencies are whole
/// multiples of the inverse of the duration: the trajectory ends where it begins and can be repeated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Height of the tool's centre when the tool just touches the surface, m.
    pub surface_m: f64,
    /// Number of probed places.
    pub probes: u32,
    /// Depth of the deepest probe, m.
    pub depth_m: f64,
    /// RMS amplitude of the tremor on each axis, m.
    pub tremor_m: f64,
    /// Seed of the tremor's phases.
    pub seed: u64,
}

impl Default for Probe {
    /// A 10 cm block round the origin and a tool of 5 mm radius: four probes, 5 s, up to 10 mm deep.
    fn default() -> Self {
        Self { surface_m: 0.055, probes: 4, depth_m: 0.010, tremor_m: 1e-4, seed: 1 }
    }
}

/// Ticks of the phases down, dwell, up, across.
const PHASES: [f64; 4] = [350.0, 300.0, 350.0, 250.0];
/// Height above the surface between two probes, m.
const HOVER_M: f64 = 0.006;
/// Centre and radius of the circle of the probed places, m. No place coincides with a node of the 6 x 6 x 6 block.
const CIRCLE_M: (DVec3, f64) = (DVec3::new(0.008, 0.0, 0.007), 0.022);

impl Probe {
    /// Generates the trajectory.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for a number that is not finite, a number of probes other than 1 to 1000, and a depth or tremor
    /// other than 0 to 0.1 m.
    pub fn trajectory(&self) -> Result<Trajectory, HapticsError> {
        let probes = self.probes;
        check("number of probes", f64::from(probes), (1..=1000).contains(&probes), "1 to 1000")?;
        check(
            "height of the surface, m",
            self.surface_m,
            self.surface_m.abs() <= 1.0,
            "within 1 m of the origin",
        )?;
        for (what, value) in [("depth of the probes, m", self.depth_m), ("tremor, m", self.tremor_m)] {
            check(what, value, (0.0..=0.1).contains(&value), "0 to 0.1")?;
        }
        let cycle = PHASES.iter().sum::<f64>() as usize;
        let total = cycle * self.probes as usize;
        let tremor = self.tremor(total as f64 * Trajectory::PERIOD_S);
        let positions_m = (0..total)
            .map(|i| {
                let probe = (i / cycle) as f64;
                let t = i as f64 * Trajectory::PERIOD_S;
                self.intended(probe, (i % cycle) as f64) + tremor(t)
            })
            .collect();
        Trajectory::from_positions(positions_m)
    }

    /// Position without tremor, m, at `tick` of probe number `probe`.
    fn intended(&self, probe: f64, tick: f64) -> DVec3 {
        let place = |n: f64| {
            let angle = TAU * (n / f64::from(self.probes) + 0.1);
            CIRCLE_M.0 + CIRCLE_M.1 * DVec3::new(angle.cos(), 0.0, angle.sin())
        };
        // Depths increase to `depth_m` at the last probe.
        let depth = self.depth_m * (0.5 + 0.5 * (probe + 1.0) / f64::from(self.probes));
        let (hover, deep) = (self.surface_m + HOVER_M, self.surface_m - depth);
        let [down, dwell, up, across] = PHASES;
        let (height, along) = match tick {
            t if t < down => (hover + (deep - hover) * minimum_jerk(t / down), 0.0),
            t if t < down + dwell => {
                let oscillation = 0.08 * depth * (TAU * 2.0 * (t - down) / dwell).sin();
                (deep + oscillation, 0.0)
            }
            t if t < down + dwell + up => {
                (deep + (hover - deep) * minimum_jerk((t - down - dwell) / up), 0.0)
            }
            t => (hover, minimum_jerk((t - down - dwell - up) / across)),
        };
        let at = place(probe).lerp(place(probe + 1.0), along);
        DVec3::new(at.x, height, at.z)
    }

    fn tremor(&self, duration_s: f64) -> impl Fn(f64) -> DVec3 {
        const TONES: usize = 5;
        let mut state = self.seed;
        let amplitude = self.tremor_m * (2.0 / TONES as f64).sqrt();
        let tones: Vec<[(f64, f64); 3]> = (0..TONES)
            .map(|n| {
                let hz = 8.25 + 0.85 * n as f64;
                let whole = (hz * duration_s).round() / duration_s;
                [0, 1, 2].map(|axis| {
                    let shifted = whole + axis as f64 / duration_s;
                    (TAU * shifted, TAU * unit(&mut state))
                })
            })
            .collect();
        move |t| {
            let mut sum = DVec3::ZERO;
            for tone in &tones {
                for (axis, (omega, phase)) in tone.iter().enumerate() {
                    sum[axis] += amplitude * (omega * t + phase).sin();
                }
            }
            sum
        }
    }
}

/// 10τ³ − 15τ⁴ + 6τ⁵.
fn minimum_jerk(tau: f64) -> f64 {
    tau.powi(3) * (10.0 - 15.0 * tau + 6.0 * tau * tau)
}

/// The next number in [0, 1) of the `SplitMix64` sequence (Steele, Lea and Flood, OOPSLA 2014).
fn unit(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}
