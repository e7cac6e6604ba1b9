//! The static stiffness of a body against a tool: K condensed onto the points on which the tool acts.

use crate::ReduceError;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::{Mat, Side};
use glam::{DMat3, DVec3};
use palpate_body::{Body, BodyPoint, Tangent, TangentPattern, TouchedPoint};

/// Computes D = K_cc − K_cr K_rr⁻¹ K_rc on the nodes c of the points, and from it the stiffness against a motion of the tool.
///
/// With K̂ = K + P on the degrees of freedom of c, (K̂⁻¹)_cc = (D + P)⁻¹. One factorisation of K̂, whose pattern does not depend on c, and
/// three solves for each node therefore give D. K̂ is positive definite whenever K_rr and D + P are, which includes a body that would
/// buckle without the tool.
#[derive(Debug)]
pub(crate) struct StaticStiffness {
    symbolic: SymbolicLlt<usize>,
    /// Regularisation σ₀² m of every degree of freedom, N/m.
    regularisation: Vec<f64>,
    shift: Vec<f64>,
}

/// P as a multiple of the maximum diagonal stiffness at the nodes: large enough for a buckling body, and small enough to lose at most two
/// digits when it is subtracted again.
const PENALTY: f64 = 4.0;

impl StaticStiffness {
    pub(crate) fn new(pattern: &TangentPattern, body: &Body, sigma_per_s: f64) -> Result<Self, ReduceError> {
        let unknowns = pattern.symbolic().ncols();
        let symbolic = SymbolicLlt::try_new(pattern.symbolic(), Side::Lower)
            .map_err(|_| ReduceError::Symbolic { unknowns })?;
        let network = body.network();
        let regularisation = network
            .free()
            .iter()
            .flat_map(|&node| [sigma_per_s * sigma_per_s * network.mass_kg()[node]; 3])
            .collect();
        Ok(Self { symbolic, regularisation, shift: vec![0.0; unknowns] })
    }

    /// The stiffness against a motion of the tool that `points` follow, N/m.
    ///
    /// The points follow in all directions, or only along `normals`, one a point, where these are given. If `touched` has the contacts of the
    /// points, the compliance of each contact is in series. Adds the regularisation and P to K of `tangent`.
    pub(crate) fn at(
        &mut self,
        tangent: &mut Tangent,
        body: &Body,
        points: &[BodyPoint],
        (normals, touched): (Option<&[DVec3]>, &[TouchedPoint]),
    ) -> Result<DMat3, ReduceError> {
        let mut nodes: Vec<usize> = points
            .iter()
            .flat_map(|point| point.nodes().iter().filter_map(|(node, _)| body.network().free_index(*node)))
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        let dofs: Vec<usize> =
            nodes.iter().flat_map(|index| [0, 1, 2].map(|axis| 3 * index + axis)).collect();
        let penalty = PENALTY * dofs.iter().map(|&dof| diagonal(tangent, dof)).fold(0.0, f64::max);
        self.shift.copy_from_slice(&self.regularisation);
        dofs.iter().for_each(|&dof| self.shift[dof] += penalty);
        tangent.add_to_stiffness_diagonal(&self.shift);
        let factor = Llt::try_new_with_symbolic(self.symbolic.clone(), tangent.stiffness(), Side::Lower)
            .map_err(|error| match error {
                LltError::Numeric(faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot {
                    index,
                }) => ReduceError::Singular { pivot: index },
                LltError::Generic(_) => ReduceError::Symbolic { unknowns: self.shift.len() },
            })?;
        let n = dofs.len();
        let mut solution = Mat::zeros(self.shift.len(), n);
        dofs.iter().enumerate().for_each(|(column, &dof)| solution[(dof, column)] = 1.0);
        factor.solve_in_place(&mut solution);
        let compliance = Mat::from_fn(n, n, |i, j| solution[(dofs[i], j)]);
        let stiffness = compliance.partial_piv_lu().solve(Mat::<f64>::identity(n, n));
        // D x = Hᵀ λ, H x = E: the forces λ on the rows for a unit motion of the tool along each axis.
        let rows = rows(points, (normals, touched), |node| {
            body.network().free_index(node).and_then(|index| nodes.binary_search(&index).ok())
        });
        let m = rows.len();
        let saddle = Mat::from_fn(n + m, n + m, |i, j| match (i < n, j < n) {
            (true, true) => stiffness[(i, j)] - if i == j { penalty } else { 0.0 },
            (true, false) => -rows[j - n].weight(i),
            (false, true) => rows[i - n].weight(j),
            // Regularises redundant rows, which then share their force.
            (false, false) if i == j => REDUNDANT_ROW_COMPLIANCE / penalty + rows[i - n].compliance_m_per_n,
            (false, false) => 0.0,
        });
        let along = |row: usize, axis: usize| if row < n { 0.0 } else { rows[row - n].along[axis] };
        let moved = saddle.partial_piv_lu().solve(Mat::from_fn(n + m, 3, along));
        let column =
            |axis: usize| -> DVec3 { (0..m).map(|row| rows[row].along * moved[(n + row, axis)]).sum() };
        Ok(DMat3::from_cols(column(0), column(1), column(2)))
    }
}

/// Relative compliance of a row that regularises redundant rows.
const REDUNDANT_ROW_COMPLIANCE: f64 = 1e-10;

/// A row of H: a point that follows the tool along a direction.
struct AlongRow {
    /// Index among the nodes c, and weight.
    nodes: Vec<(usize, f64)>,
    along: DVec3,
    /// Compliance in series with the nodes along the direction, m/N.
    compliance_m_per_n: f64,
}

impl AlongRow {
    fn weight(&self, dof: usize) -> f64 {
        let node = self.nodes.iter().find(|(place, _)| *place == dof / 3);
        node.map_or(0.0, |(_, w)| w * self.along[dof % 3])
    }
}

fn rows(
    points: &[BodyPoint],
    (normals, touched): (Option<&[DVec3]>, &[TouchedPoint]),
    place: impl Fn(usize) -> Option<usize>,
) -> Vec<AlongRow> {
    let mut rows = Vec::new();
    for (i, point) in points.iter().enumerate() {
        let nodes: Vec<(usize, f64)> =
            point.nodes().iter().filter_map(|&(node, w)| Some((place(node)?, w))).collect();
        let all = DVec3::AXES;
        let along = normals.map_or(&all[..], |normals| &normals[i..=i]);
        rows.extend(along.iter().map(|&along| {
            let compliance_m_per_n = touched.get(i).map_or(0.0, |touched| compliance(touched, along));
            AlongRow { nodes: nodes.clone(), along, compliance_m_per_n }
        }));
    }
    rows
}

/// Compliance of a contact in series with its nodes along a unit vector, m/N.
fn compliance(touched: &TouchedPoint, along: DVec3) -> f64 {
    let Some(series) = touched.series else { return 0.0 };
    let (force_n, cos) = (touched.pressing_n(), along.dot(touched.normal));
    let across = (1.0 - cos * cos).max(0.0);
    cos * cos * series.slope_m_per_n(force_n) + across * series.tangential_m_per_n(force_n)
}

fn diagonal(tangent: &Tangent, dof: usize) -> f64 {
    tangent.stiffness().get(dof, dof).copied().unwrap_or(0.0).abs()
}
