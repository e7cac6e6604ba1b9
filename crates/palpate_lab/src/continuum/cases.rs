//! The solutions of the cases.

use super::grid::{network, punch_m};
use super::options::{Case, Continuum};
use super::statics::Statics;
use crate::error::LabError;
use glam::{DQuat, DVec3};

/// The solution of a case on one grid.
pub(super) struct Solution {
    pub(super) value: f64,
    pub(super) elements: usize,
    pub(super) nodes: usize,
    pub(super) modes_hz: Vec<(&'static str, f64)>,
}

/// Shapes near the lowest modes of a block whose bottom is fixed.
const MODES: [(&str, fn(DVec3) -> DVec3); 4] = [
    ("sway x", |x| DVec3::X * x.z * x.z),
    ("sway y", |x| DVec3::Y * x.z * x.z),
    ("torsion", |x| x.z * DVec3::Z.cross(x)),
    ("axial", |x| DVec3::Z * x.z),
];

/// Maximum strain, and maximum angle in radians, of a load step.
const STEP: f64 = 0.025;

/// Solves the case of `options` with `cells` cells along the longest edge.
pub(super) fn solve(options: &Continuum, cells: usize) -> Result<Solution, LabError> {
    let network = network(options, cells)?;
    let counts = [network.links().len(), network.hexahedra().len(), network.tetrahedra().len()];
    let (elements, nodes) = (counts.into_iter().sum(), network.node_count());
    let mut statics = Statics::new(network)?;
    let mut modes_hz = Vec::new();
    let value = match options.case {
        Case::BondedCube => bonded(options, &mut statics)?,
        Case::Twist => twist(options, &mut statics)?,
        Case::Punch | Case::Layer => punch(options, &mut statics)?,
        Case::Cantilever => cantilever(options, &mut statics)?,
        Case::Modes => {
            let mut modes = Vec::new();
            for (name, start) in MODES {
                modes_hz.push((name, statics.frequency_hz(start, &mut modes)?));
            }
            modes_hz.first().map_or(0.0, |(_, sway)| *sway)
        }
    };
    Ok(Solution { value, elements, nodes, modes_hz })
}

/// Number of load steps for the largest strain or angle of a load.
fn steps(largest: f64) -> u32 {
    (largest.abs() / STEP).ceil().max(1.0) as u32
}

/// Moves the fixed nodes of the top in steps of `place`, which has the share of the load and the place at rest, with the equilibrium at each
/// step. The free nodes follow in proportion to their height.
fn lower_top(
    statics: &mut Statics,
    steps: u32,
    place: impl Fn(f64, DVec3) -> DVec3,
) -> Result<Vec<(DVec3, DVec3)>, LabError> {
    let rest = statics.body.network().rest_m().to_vec();
    let top_m = rest.iter().map(|x| x.z).fold(0.0, f64::max);
    let is_top = |node: usize| rest[node].z > top_m - 1e-9;
    for step in 1..=steps {
        let [before, now] = [step - 1, step].map(|step| f64::from(step) / f64::from(steps));
        statics.move_nodes(|node, x| {
            // The guess moves with the layer, as far as its height is of that of the top.
            let height = rest[node].z / top_m;
            if is_top(node) {
                place(now, rest[node])
            } else {
                let lifted = DVec3::new(rest[node].x, rest[node].y, top_m);
                x + height * (place(now, lifted) - place(before, lifted))
            }
        })?;
        statics.solve()?;
    }
    let mut force = vec![DVec3::ZERO; rest.len()];
    statics.body.internal_forces_n(&mut force);
    let x = statics.body.positions_m();
    Ok((0..rest.len()).filter(|&node| is_top(node)).map(|node| (x[node], force[node])).collect())
}

/// Force on the top of a bonded body, N, positive where it is pushed down.
fn bonded(options: &Continuum, statics: &mut Statics) -> Result<f64, LabError> {
    let down_m = options.load_or_default().unwrap_or(0.0);
    let steps = steps(down_m / options.size_m().z);
    let on_top = lower_top(statics, steps, |share, x| x - share * down_m * DVec3::Z)?;
    Ok(on_top.iter().map(|(_, force)| force.z).sum())
}

/// Torque that turns the top of a bonded body, N m.
fn twist(options: &Continuum, statics: &mut Statics) -> Result<f64, LabError> {
    let angle = options.load_or_default().unwrap_or(0.0).to_radians();
    let turned = |share: f64, x: DVec3| DQuat::from_rotation_z(share * angle) * x;
    let on_top = lower_top(statics, steps(angle), turned)?;
    Ok(-on_top.iter().map(|(x, force)| x.cross(*force).z).sum::<f64>())
}

/// Force of a flat frictionless punch, N.
fn punch(options: &Continuum, statics: &mut Statics) -> Result<f64, LabError> {
    let (size, down_m) = (options.size_m(), options.load_or_default().unwrap_or(0.0));
    let half_m = punch_m(options).unwrap_or(0.0) + 1e-9;
    let rest = statics.body.network().rest_m().to_vec();
    let is_below = |x: DVec3| x.z > size.z - 1e-9 && x.x.abs() <= half_m && x.y.abs() <= half_m;
    let below: Vec<usize> = (0..rest.len()).filter(|&node| is_below(rest[node])).collect();
    let mut force_n = 0.0;
    let steps = steps(down_m / size.z);
    for step in 1..=steps {
        let down_m = down_m * f64::from(step) / f64::from(steps);
        statics.hold(below.iter().map(|&node| (node, 2, rest[node].z - down_m)).collect());
        force_n = -statics.solve()?.iter().sum::<f64>();
    }
    Ok(force_n)
}

/// Mean deflection of the end of a cantilever along z, m.
fn cantilever(options: &Continuum, statics: &mut Statics) -> Result<f64, LabError> {
    let (size, force_n) = (options.size_m(), options.load_or_default().unwrap_or(0.0));
    let rest = statics.body.network().rest_m().to_vec();
    let is_at = |value: f64, side: f64| (value.abs() - 0.5 * side).abs() < 1e-9;
    // The share of each node of the end face in its area: the cells are equal.
    let share = |x: DVec3| {
        let of_edge = |value: f64, side: f64| if is_at(value, side) { 0.5 } else { 1.0 };
        if x.x > size.x - 1e-9 { of_edge(x.y, size.y) * of_edge(x.z, size.z) } else { 0.0 }
    };
    let total: f64 = rest.iter().map(|x| share(*x)).sum();
    // The strain at the clamped end by beam theory.
    let strain = 6.0 * force_n * size.x / (size.y * size.z * size.z * options.youngs_pa);
    let steps = steps(strain);
    for step in 1..=steps {
        let force_n = force_n * f64::from(step) / f64::from(steps);
        let loads: Vec<DVec3> = rest.iter().map(|x| DVec3::Z * (force_n * share(*x) / total)).collect();
        statics.body.set_loads(&loads)?;
        statics.solve()?;
    }
    let moved = statics.body.positions_m().iter().zip(&rest);
    Ok(moved.map(|(x, rest)| share(*rest) / total * (x.z - rest.z)).sum())
}
