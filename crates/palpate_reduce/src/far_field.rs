//! The far field of a local model: the forces on it, and the basis V onto which it is projected.

pub(crate) mod basis;

use crate::ReduceError;
use crate::obstacle_constraints::ObstacleConstraints;
use crate::options::BuilderOptions;
use basis::{Basis, leading_inputs};
use faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Mat, MatRef, Side};
use glam::DVec3;
use palpate_body::{Body, Network, Tangent, TangentPattern, ToolContact};

/// The symbolic factorisation of a body's tangent, the forces at the model step, and the basis of the last local model.
#[derive(Debug)]
pub(crate) struct FarField {
    symbolic: SymbolicLlt<usize>,
    matrix: Vec<f64>,
    internal_n: Vec<DVec3>,
    external_n: Vec<DVec3>,
    constraints: ObstacleConstraints,
    basis: Option<Basis>,
}

impl FarField {
    pub(crate) fn new(body: &Body, pattern: &TangentPattern) -> Result<Self, ReduceError> {
        let unknowns = pattern.symbolic().ncols();
        let symbolic = SymbolicLlt::try_new(pattern.symbolic(), Side::Lower)
            .map_err(|_| ReduceError::Symbolic { unknowns })?;
        let nodes = body.network().node_count();
        Ok(Self {
            symbolic,
            matrix: vec![0.0; pattern.symbolic().row_idx().len()],
            internal_n: vec![DVec3::ZERO; nodes],
            external_n: vec![DVec3::ZERO; nodes],
            constraints: ObstacleConstraints::default(),
            basis: None,
        })
    }

    /// Reads the internal and external forces on all nodes, the latter with those of the `others`, the other tools on the body, and the
    /// contacts with obstacles.
    pub(crate) fn read_forces(&mut self, body: &Body, others: &[&ToolContact]) {
        body.internal_forces_n(&mut self.internal_n);
        body.outer_forces_n(&mut self.external_n);
        others.iter().for_each(|other| other.add_force_n(&mut self.external_n));
        self.constraints = ObstacleConstraints::of(body);
    }

    /// The contacts with obstacles.
    pub(crate) fn constraints(&self) -> &ObstacleConstraints {
        &self.constraints
    }

    /// Internal force on every node, N.
    pub(crate) fn internal_n(&self) -> &[DVec3] {
        &self.internal_n
    }

    /// External force on every node, N.
    pub(crate) fn external_n(&self) -> &[DVec3] {
        &self.external_n
    }

    /// Stores the basis of the last local model; `None` for a model without one.
    pub(crate) fn set_basis(&mut self, basis: Option<Basis>) {
        self.basis = basis;
    }

    /// Number of columns of the basis of the last local model.
    pub(crate) fn order(&self) -> usize {
        self.basis.as_ref().map_or(0, Basis::order)
    }

    /// A column of the basis of the last local model, over all free degrees of freedom.
    pub(crate) fn column(&self, network: &Network, column: usize) -> Option<Vec<f64>> {
        let basis = self.basis.as_ref().filter(|basis| column < basis.order())?;
        let unit: Vec<f64> = (0..basis.order()).map(|j| if j == column { 1.0 } else { 0.0 }).collect();
        Some(basis.expand(network, &unit))
    }

    /// Builds V for the support set `support`, with at most `max_columns` columns: a rational Krylov basis of second order.
    ///
    /// In order of importance, it spans the static response to S and to the forces, v_N, the responses at the shifts, and the
    /// high-frequency end of the response. All satisfy the contacts with obstacles; if the obstacles move, one more column carries the points
    /// in contact. See [`crate::SecondOrderSystem::krylov_basis`] for the sources of the method.
    pub(crate) fn build_basis(
        &mut self,
        body: &Body,
        tangent: &Tangent,
        support: &[usize],
        options: &BuilderOptions,
        max_columns: usize,
    ) -> Result<Basis, ReduceError> {
        let network = body.network();
        let free: Vec<usize> = support.iter().filter_map(|&node| network.free_index(node)).collect();
        let (unknowns, coupled) = (3 * network.free().len(), 3 * free.len());
        let (k, b) = (tangent.stiffness(), tangent.damping());
        let mut is_support = vec![false; network.free().len()];
        free.iter().for_each(|&index| is_support[index] = true);
        let in_support = |dof: usize| is_support[dof / 3];
        // K_rS, then F_r.
        let mut static_rhs = Mat::zeros(unknowns, coupled + 1);
        for (i, &index) in free.iter().enumerate() {
            for axis in 0..3 {
                let column = 3 * index + axis;
                for (row, &value) in k.row_idx_of_col(column).zip(k.val_of_col(column)) {
                    if !in_support(row) {
                        static_rhs[(row, 3 * i + axis)] = value;
                    }
                }
            }
        }
        let constraints = self.constraints.on(|index| !is_support[index]);
        let held = (!constraints.is_empty()).then(|| {
            let mut held = tangent.clone();
            constraints.add_to(&mut held);
            held
        });
        let held_k = held.as_ref().map_or(k, Tangent::stiffness);
        let moves = constraints.is_moving();
        let mut basis = Basis::new(network, &is_support, max_columns, constraints);
        for (index, &node) in network.free().iter().enumerate().filter(|(index, _)| !is_support[*index]) {
            let force = self.internal_n[node] + self.external_n[node];
            (0..3).for_each(|axis| static_rhs[(3 * index + axis, coupled)] = force[axis]);
        }
        let sigma0 = options.regularisation_per_s;
        let mut solve = |sigma: f64, rhs: &mut Mat<f64>| -> Result<(), ReduceError> {
            let symbolic = tangent.stiffness().symbolic();
            // The regularisation alone at rest; inertia and dampers at a shift.
            let (mass, damping) = if sigma == 0.0 { (sigma0 * sigma0, 0.0) } else { (sigma * sigma, sigma) };
            for column in 0..unknowns {
                let m = mass * network.mass_kg()[network.free()[column / 3]];
                let range = symbolic.col_range(column);
                for (entry, &row) in range.clone().zip(&symbolic.row_idx()[range]) {
                    self.matrix[entry] = match (row == column, in_support(row) || in_support(column)) {
                        (true, true) => 1.0,
                        (false, true) => 0.0,
                        (diagonal, false) => {
                            held_k.val()[entry] + damping * b.val()[entry] + if diagonal { m } else { 0.0 }
                        }
                    };
                }
            }
            let factor = factorise(&self.symbolic, symbolic, &self.matrix)?;
            factor.solve_in_place(rhs);
            Ok(())
        };
        let tolerance = options.basis_tolerance;
        let coupling = static_rhs.subcols(0, coupled).to_owned();
        solve(0.0, &mut static_rhs)?;
        // Without columns for all motions of S, those for the motions that loads cause.
        let loads = (coupled + 1 > basis.columns_left())
            .then(|| load_motions(k, &free, coupling.as_ref(), static_rhs.subcols(0, coupled)))
            .flatten();
        let of_loads = loads.as_ref().map(|loads| static_rhs.subcols(0, coupled) * loads);
        // The `count` motions of S, as columns, whose static response moves most mass; of the motions by loads where there are any.
        let leading_motions = |basis: &Basis, count: usize| {
            let response = of_loads.as_ref().map_or(static_rhs.subcols(0, coupled), Mat::as_ref);
            let leading = leading_inputs(basis.weighted(response).as_ref(), count)?;
            Some(loads.as_ref().map_or_else(|| leading.clone(), |loads| loads * &leading))
        };
        if loads.is_some() {
            basis.extend(static_rhs.subcols(coupled, 1), tolerance);
            let response = static_rhs.subcols(0, coupled);
            let motions = leading_motions(&basis, 3 * basis.columns_left() / 5);
            basis.extend(
                motions.map_or(response.to_owned(), |motions| response * motions).as_ref(),
                tolerance,
            );
        } else {
            basis.extend(static_rhs.as_ref(), tolerance);
        }
        let v = body.velocities_m_per_s();
        let velocity = Mat::from_fn(unknowns, 1, |dof, _| v[network.free()[dof / 3]][dof % 3]);
        basis.extend(velocity.as_ref(), tolerance);
        if moves {
            basis.add_carried(velocity.as_ref(), tolerance);
        }
        for shift_hz in options.shifts_hz.into_iter().flatten() {
            if basis.columns_left() == 0 {
                break;
            }
            // A shift adds A⁻¹(σ²M + σB) times the static response. With few columns left, the motions of S that move most mass are selected.
            let left = basis.columns_left();
            let count = if loads.is_some() { left / 2 + 1 } else { left };
            let few = (left < coupled).then(|| leading_motions(&basis, count)).flatten();
            let mut shifted = few.map_or_else(|| coupling.clone(), |few| &coupling * few);
            solve(std::f64::consts::TAU * shift_hz, &mut shifted)?;
            basis.extend(shifted.as_ref(), tolerance);
        }
        basis.extend(coupling.as_ref(), tolerance);
        basis.finish();
        Ok(basis)
    }
}

/// Motions of S by unit static loads on its degrees of freedom: the inverse of K_SS − K_Sr K_rr⁻¹ K_rS. `coupling` is K_rS, and `response`
/// K_rr⁻¹ K_rS.
fn load_motions(
    k: SparseColMatRef<'_, usize, f64>,
    free: &[usize],
    coupling: MatRef<'_, f64>,
    response: MatRef<'_, f64>,
) -> Option<Mat<f64>> {
    let n = 3 * free.len();
    let mut condensed = -(coupling.transpose() * response);
    for i in 0..n {
        for j in 0..n {
            let dof = |at: usize| 3 * free[at / 3] + at % 3;
            condensed[(i, j)] += k.get(dof(i), dof(j)).copied().unwrap_or(0.0);
        }
    }
    let factor = condensed.llt(Side::Lower).ok()?;
    let mut motions = Mat::identity(n, n);
    factor.solve_in_place(&mut motions);
    Some(motions)
}

fn factorise(
    symbolic: &SymbolicLlt<usize>,
    pattern: SymbolicSparseColMatRef<'_, usize>,
    values: &[f64],
) -> Result<Llt<usize, f64>, ReduceError> {
    let matrix = SparseColMatRef::new(pattern, values);
    Llt::try_new_with_symbolic(symbolic.clone(), matrix, Side::Lower).map_err(|error| match error {
        LltError::Numeric(NonPositivePivot { index }) => ReduceError::Singular { pivot: index },
        LltError::Generic(_) => ReduceError::Symbolic { unknowns: matrix.ncols() },
    })
}
