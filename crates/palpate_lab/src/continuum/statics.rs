//! Static equilibrium of a body by Newton's method.

use crate::error::LabError;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::{Mat, Side};
use glam::DVec3;
use palpate_body::{Body, Network, Surface, Tangent, TangentPattern};

/// A body whose equilibrium is sought.
pub(super) struct Statics {
    pub(super) body: Body,
    pattern: TangentPattern,
    tangent: Tangent,
    symbolic: SymbolicLlt<usize>,
    /// Degrees of freedom with a given position: the node, the axis and the position, m.
    held: Vec<(usize, usize, f64)>,
}

/// Maximum number of Newton iterations of a load step.
const MAX_ITERATIONS: usize = 60;
/// Change of a position, relative to the size of the body, at which the iterations end.
const CONVERGED: f64 = 1e-12;

impl Statics {
    pub(super) fn new(network: Network) -> Result<Self, LabError> {
        let body = Body::new(network, Surface::default())?;
        let pattern = TangentPattern::new(&body);
        let unknowns = pattern.symbolic().ncols();
        let symbolic = SymbolicLlt::try_new(pattern.symbolic(), Side::Lower)
            .map_err(|_| LabError::NoEquilibrium { why: format!("{unknowns} unknowns exceed the memory") })?;
        Ok(Self { tangent: pattern.zero(), pattern, body, symbolic, held: Vec::new() })
    }

    /// Holds degrees of freedom at positions. The forces that this takes are unknowns.
    pub(super) fn hold(&mut self, held: Vec<(usize, usize, f64)>) {
        self.held = held;
    }

    /// Moves the fixed nodes, and the free ones where it is their first place in the search for the equilibrium.
    pub(super) fn move_nodes(&mut self, place: impl Fn(usize, DVec3) -> DVec3) -> Result<(), LabError> {
        let x: Vec<DVec3> =
            self.body.positions_m().iter().enumerate().map(|(node, x)| place(node, *x)).collect();
        Ok(self.body.set_state(&x, &vec![DVec3::ZERO; x.len()])?)
    }

    /// Iterates to the equilibrium under the loads of the body. Returns the forces on the held degrees of freedom, N.
    pub(super) fn solve(&mut self) -> Result<Vec<f64>, LabError> {
        let size_m = self.body.network().rest_m().iter().map(|x| x.length()).fold(0.0, f64::max);
        for _ in 0..MAX_ITERATIONS {
            let (change, forces_n) = self.newton_step()?;
            let largest = change.iter().map(|u| u.length()).fold(0.0, f64::max);
            let x: Vec<DVec3> = self.body.positions_m().iter().zip(&change).map(|(x, u)| *x + *u).collect();
            self.body.set_state(&x, &vec![DVec3::ZERO; x.len()])?;
            if largest <= CONVERGED * size_m {
                return Ok(forces_n);
            }
            if !largest.is_finite() {
                break;
            }
        }
        let why = format!("not within {MAX_ITERATIONS} iterations; use a smaller load or fewer cells");
        Err(LabError::NoEquilibrium { why })
    }

    /// Displacements of all nodes by a Newton step, m, and the forces on the held degrees of freedom, N.
    fn newton_step(&mut self) -> Result<(Vec<DVec3>, Vec<f64>), LabError> {
        let mut internal = vec![DVec3::ZERO; self.body.positions_m().len()];
        self.body.internal_forces_n(&mut internal);
        let factor = self.factor()?;
        let network = self.body.network();
        let free = network.free();
        let mut rhs =
            Mat::from_fn(3 * free.len(), 1 + self.held.len(), |row, column| match column.checked_sub(1) {
                None => internal[free[row / 3]][row % 3] + self.body.loads_n()[free[row / 3]][row % 3],
                Some(held) => {
                    let (node, axis, _) = self.held[held];
                    f64::from(u8::from(free[row / 3] == node && row % 3 == axis))
                }
            });
        factor.solve_in_place(&mut rhs);
        let mut forces = vec![0.0; self.held.len()];
        if !self.held.is_empty() {
            let row = |held: usize| {
                let (node, axis, _) = self.held[held];
                3 * network.free_index(node).unwrap_or(0) + axis
            };
            let count = self.held.len();
            let compliance = Mat::from_fn(count, count, |i, j| rhs[(row(i), 1 + j)]);
            let mut gap = Mat::from_fn(count, 1, |i, _| {
                let (node, axis, at) = self.held[i];
                at - self.body.positions_m()[node][axis] - rhs[(row(i), 0)]
            });
            compliance.partial_piv_lu().solve_in_place(&mut gap);
            forces = (0..count).map(|i| gap[(i, 0)]).collect();
        }
        let mut change = vec![DVec3::ZERO; internal.len()];
        for (index, &node) in free.iter().enumerate() {
            change[node] = DVec3::from_array([0, 1, 2].map(|axis| {
                let row = 3 * index + axis;
                let held: f64 = forces.iter().enumerate().map(|(j, f)| f * rhs[(row, 1 + j)]).sum();
                rhs[(row, 0)] + held
            }));
        }
        Ok((change, forces))
    }

    /// The factor of the tangent, or of its positive part where it is indefinite.
    fn factor(&mut self) -> Result<Llt<usize, f64>, LabError> {
        for clamped in [false, true] {
            self.pattern.fill(&self.body, clamped, &mut self.tangent);
            let symbolic = self.symbolic.clone();
            if let Ok(factor) = Llt::try_new_with_symbolic(symbolic, self.tangent.stiffness(), Side::Lower) {
                return Ok(factor);
            }
        }
        Err(LabError::NoEquilibrium { why: "the body is unstable under this load; use a smaller one".into() })
    }

    /// The lowest natural frequency, Hz, of a mode that is orthogonal to `others`, by inverse iteration from the shape `start`. Adds the mode to
    /// `others`.
    pub(super) fn frequency_hz(
        &mut self,
        start: impl Fn(DVec3) -> DVec3,
        others: &mut Vec<Mat<f64>>,
    ) -> Result<f64, LabError> {
        let factor = self.factor()?;
        let network = self.body.network();
        let free = network.free();
        let mass = |row: usize| network.mass_kg()[free[row / 3]];
        let product = |a: &Mat<f64>, b: &Mat<f64>| -> f64 {
            (0..a.nrows()).map(|i| mass(i) * a[(i, 0)] * b[(i, 0)]).sum()
        };
        let of_start = |row: usize, _| start(network.rest_m()[free[row / 3]])[row % 3];
        let mut shape = Mat::from_fn(3 * free.len(), 1, of_start);
        let mut rate2 = 0.0;
        for _ in 0..MAX_ITERATIONS {
            let mut next = Mat::from_fn(shape.nrows(), 1, |row, _| mass(row) * shape[(row, 0)]);
            factor.solve_in_place(&mut next);
            for other in &*others {
                let along = product(other, &next);
                next = Mat::from_fn(next.nrows(), 1, |row, _| next[(row, 0)] - along * other[(row, 0)]);
            }
            let (before, size2) = (rate2, product(&next, &next));
            rate2 = product(&shape, &next) / size2;
            let scale = size2.sqrt();
            shape = Mat::from_fn(next.nrows(), 1, |row, _| next[(row, 0)] / scale);
            if (rate2 - before).abs() <= 1e-12 * rate2 {
                break;
            }
        }
        others.push(shape);
        Ok(rate2.sqrt() / std::f64::consts::TAU)
    }
}
