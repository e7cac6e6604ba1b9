//! Generator of a probing trajectory, as in `assets/trajectories/probe.csv`.

use super::Trajectory;
use crate::HapticsError;
use crate::error::check;
use glam::DVec3;
use std::f64::consts::TAU;

/// Parameters of a trajectory that presses into several places of a curved surface, one after the other, and slides along it.
///
/// # The generator
///
/// The surface is y = y₀ − ½ (κₓ (x − x₀)² + κ_z (z − z₀)²), with (x₀, y₀, z₀) its top and κ its curvature. The hand presses along the
/// surface's normal at places on a circle.
///
/// One probe takes 1.25 s: down 350 ms, dwell 300 ms with a small oscillation of the depth and a slide along the circle's tangent, up
/// 350 ms, across to the next place 250 ms. Each movement has minimum jerk, s(τ) = 10τ³ − 15τ⁴ + 6τ⁵ (Flash and Hogan, Journal of
/// Neuroscience 5 (1985) 1688). Added to it is physiological tremor: on each axis five sinusoids between
/// 8 and 12 Hz (the band of the hand's tremor: Elble and Randall, Electroencephalography and Clinical
/// Neurophysiology 44 (1978) 72) of 0.1 mm RMS together, with phases from a seed. All frequencies are whole
/// multiples of the inverse of the duration: the trajectory ends where it begins and can be repeated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Position of the tool's centre when the tool just touches the top of the surface, m.
    pub top_m: DVec3,
    /// Curvature of the surface along x and z at its top, 1/m; positive on a dome, zero on a plane.
    pub curvature_per_m: [f64; 2],
    /// Centre of the circle of the probed places, its x and z, m.
    pub center_m: [f64; 2],
    /// Radius of the circle of the probed places, m.
    pub radius_m: f64,
    /// Number of probed places.
    pub probes: u32,
    /// Depth of the deepest probe, m.
    pub depth_m: f64,
    /// Length of the slide during a dwell, m.
    pub slide_m: f64,
    /// RMS amplitude of the tremor on each axis, m.
    pub tremor_m: f64,
    /// Seed of the tremor's phases.
    pub seed: u64,
}

impl Default for Probe {
    /// The organ of the scene `probing` at rest on its table, and a tool of 5 mm radius: four probes, 5 s, up to 10 mm deep, with slides of
    /// 8 mm.
    fn default() -> Self {
        Self {
            top_m: DVec3::new(-0.008, 0.0572, 0.0),
            curvature_per_m: [14.0, 20.0],
            center_m: [0.004, 0.0041],
            radius_m: 0.018,
            probes: 4,
            depth_m: 0.010,
            slide_m: 0.008,
            tremor_m: 1e-4,
            seed: 1,
        }
    }
}

/// Ticks of the phases down, dwell, up, across.
const PHASES: [f64; 4] = [350.0, 300.0, 350.0, 250.0];
/// Height above the surface between two probes, m.
const HOVER_M: f64 = 0.006;

impl Probe {
    /// Generates the trajectory.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for a number that is not finite, a number of probes other than 1 to 1000, coordinates other than
    /// −1 to 1 m, a radius other than 0 to 1 m, a curvature other than −100 to 100, and a depth, slide or tremor other than 0 to 0.1 m.
    pub fn trajectory(&self) -> Result<Trajectory, HapticsError> {
        let probes = self.probes;
        check("number of probes", f64::from(probes), (1..=1000).contains(&probes), "1 to 1000")?;
        let [x, y, z] = self.top_m.to_array();
        let [circle_x, circle_z] = self.center_m;
        for (what, value) in [
            ("x of the surface's top, m", x),
            ("y of the surface's top, m", y),
            ("z of the surface's top, m", z),
            ("x of the circle of places, m", circle_x),
            ("z of the circle of places, m", circle_z),
        ] {
            check(what, value, value.abs() <= 1.0, "-1 to 1")?;
        }
        let radius_m = self.radius_m;
        check("radius of the circle of places, m", radius_m, (0.0..=1.0).contains(&radius_m), "0 to 1")?;
        for curvature in self.curvature_per_m {
            check("curvature, 1/m", curvature, curvature.abs() <= 100.0, "-100 to 100")?;
        }
        for (what, value) in [
            ("depth of the probes, m", self.depth_m),
            ("slide, m", self.slide_m),
            ("tremor, m", self.tremor_m),
        ] {
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
        // Place of probe `n` across, `slid` of its slide after it, from -0.5 to 0.5.
        let place = |n: f64, slid: f64| {
            let (sin, cos) = (TAU * (n / f64::from(self.probes) + 0.1)).sin_cos();
            let [x, z] = self.center_m;
            let along_m = slid * self.slide_m;
            DVec3::new(x + self.radius_m * cos - along_m * sin, 0.0, z + self.radius_m * sin + along_m * cos)
        };
        // Depths increase to `depth_m` at the last probe.
        let depth = self.depth_m * (0.5 + 0.5 * (probe + 1.0) / f64::from(self.probes));
        let (hover, deep) = (HOVER_M, -depth);
        let [down, dwell, up, across] = PHASES;
        let (height, at) = match tick {
            t if t < down => (hover + (deep - hover) * minimum_jerk(t / down), place(probe, -0.5)),
            t if t < down + dwell => {
                let dwelt = (t - down) / dwell;
                let oscillation = 0.08 * depth * (TAU * 2.0 * dwelt).sin();
                (deep + oscillation, place(probe, minimum_jerk(dwelt) - 0.5))
            }
            t if t < down + dwell + up => {
                (deep + (hover - deep) * minimum_jerk((t - down - dwell) / up), place(probe, 0.5))
            }
            t => {
                let along = minimum_jerk((t - down - dwell - up) / across);
                (hover, place(probe, 0.5).lerp(place(probe + 1.0, -0.5), along))
            }
        };
        self.above(at, height)
    }

    /// Position at `height` above the surface along its normal, m, at the x and z of `at`.
    fn above(&self, at: DVec3, height: f64) -> DVec3 {
        let [x, z] = self.curvature_per_m;
        let from_top = at - self.top_m;
        let normal = DVec3::new(x * from_top.x, 1.0, z * from_top.z).normalize();
        let fall = 0.5 * (x * from_top.x * from_top.x + z * from_top.z * from_top.z);
        DVec3::new(at.x, self.top_m.y - fall, at.z) + height * normal
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
