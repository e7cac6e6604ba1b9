//! Helpers of the closed-loop tests: the body and trajectory of `../data/fidelity_6x6x6.json`, and sampled motions.

use glam::DVec3;
use palpate_body::{Block, Body, BodyError, Face, UniformLattice};
use palpate_local::Sample;
use std::f64::consts::TAU;

/// The node that the tool drives, (3, 3, 5).
pub const DRIVEN_NODE: usize = 3 + 6 * (3 + 6 * 5);

/// 6 × 6 × 6 nodes, 0.1 m wide, 1 kg, 100 N/m, damping ratio 0.7, the bottom layer (−z) fixed.
///
/// # Errors
/// [`BodyError`] if the library rejects the body of the reference.
pub fn reference_body() -> Result<Body, BodyError> {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([6, 6, 6], DVec3::splat(0.1))?.fix(Face::NegZ).uniform(&lattice)?;
    Body::new(block.network, block.surface)
}

/// Offset of the driven node at time `t`, s, from its rest position, m.
#[must_use]
pub fn reference_offset(t: f64) -> DVec3 {
    let slow = 0.010 * (1.0 - (TAU * t).cos()) / 2.0;
    let late = if t > 0.3 { 0.002 * (TAU * 3.3 * t).sin() } else { 0.0 };
    DVec3::new(0.003 * (TAU * 1.7 * t).sin(), 0.0, -(slow + 0.0008 * (TAU * 9.0 * t).sin() + late))
}

/// Samples of the reference trajectory from `start_m`: 1.5 s at 1 kHz, with velocities by backward differences.
#[must_use]
pub fn reference_samples(start_m: DVec3) -> Vec<Sample> {
    samples(1500, |t| start_m + reference_offset(t))
}

/// Samples of the motion `at(t)`, one per millisecond, with velocities by backward differences.
#[must_use]
pub fn samples(ticks: usize, at: impl Fn(f64) -> DVec3) -> Vec<Sample> {
    let place = |i: usize| at(i as f64 * 1e-3);
    let velocity = |i: usize| if i == 0 { DVec3::ZERO } else { (place(i) - place(i - 1)) / 1e-3 };
    let sample = |i: usize| Sample {
        sequence: i as u64,
        time_s: i as f64 * 1e-3,
        position_m: place(i),
        velocity_m_per_s: velocity(i),
        ..Sample::default()
    };
    (0..ticks).map(sample).collect()
}

/// Maximum magnitude of the forces, N.
#[must_use]
pub fn peak(forces: &[DVec3]) -> f64 {
    forces.iter().map(|f| f.length()).fold(0.0, f64::max)
}
