//! A linear second-order system: a body's small motions about a state, moved by the displacement of one node.

use crate::ReduceError;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, MatRef, c64};
use palpate_body::{Body, TangentPattern};

/// M q̈ + B q̇ + K q = −B_rc u̇ − K_rc u, with the force that moves the tool
///
/// ```text
/// f = K_cc u + B_cc u̇ + K_cr q + B_cr q̇,    G(s) = f/u = K_cc + s B_cc − (K_cr + s B_cr)(s²M + sB + K)⁻¹(K_rc + s B_rc)
/// ```
///
/// u is the displacement of the driven node c (m, one input for each axis), q that of the other free nodes r,
/// and M diagonal. G(0) is the static stiffness, positive; the force on the hand is −f.
#[derive(Clone, Debug)]
pub struct SecondOrderSystem {
    /// Diagonal of M, kg.
    pub mass: Vec<f64>,
    /// B_rr, N s/m.
    pub damping: SparseColMat<usize, f64>,
    /// K_rr, N/m.
    pub stiffness: SparseColMat<usize, f64>,
    /// B_rc, N s/m.
    pub damping_rc: Mat<f64>,
    /// K_rc, N/m.
    pub stiffness_rc: Mat<f64>,
    /// B_cc, N s/m.
    pub damping_cc: Mat<f64>,
    /// K_cc, N/m.
    pub stiffness_cc: Mat<f64>,
    /// Node and axis of each row of q.
    pub place: Vec<(usize, usize)>,
}

impl SecondOrderSystem {
    /// The small motions of `body` about its present state when `node` is driven, along the first `axes` axes (1
    /// to 3) of space; along the others nothing moves.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when `axes` is not 1 to 3 or `node` is not a free node.
    pub fn of_body(body: &Body, node: usize, axes: usize) -> Result<Self, ReduceError> {
        let network = body.network();
        let refuse =
            |what, value: usize, allowed| Err(ReduceError::Option { what, value: value as f64, allowed });
        if !(1..=3).contains(&axes) {
            return refuse("number of axes", axes, "1 to 3");
        }
        if node >= network.node_count() || network.is_fixed(node) {
            return refuse("driven node", node, "a free node of the body");
        }
        let pattern = TangentPattern::new(body);
        let mut tangent = pattern.zero();
        pattern.fill(body, false, &mut tangent);
        let place: Vec<(usize, usize)> = network
            .free()
            .iter()
            .filter(|&&free| free != node)
            .flat_map(|&free| (0..axes).map(move |axis| (free, axis)))
            .collect();
        let mut row = vec![None; 3 * network.free().len()];
        let dof = |(node, axis): (usize, usize)| 3 * network.free_index(node).unwrap_or(0) + axis;
        for (i, &at) in place.iter().enumerate() {
            row[dof(at)] = Some(i);
        }
        let n = place.len();
        let cut = |matrix: faer::sparse::SparseColMatRef<'_, usize, f64>| {
            let mut entries = Vec::new();
            for (column, &at) in place.iter().enumerate() {
                for (r, &value) in matrix.row_idx_of_col(dof(at)).zip(matrix.val_of_col(dof(at))) {
                    if let Some(r) = row[r] {
                        entries.push(Triplet::new(r, column, value));
                    }
                }
            }
            let rr = SparseColMat::try_new_from_triplets(n, n, &entries).expect("indices are below n");
            let mut rc = Mat::zeros(n, axes);
            for axis in 0..axes {
                let column = dof((node, axis));
                for (r, &value) in matrix.row_idx_of_col(column).zip(matrix.val_of_col(column)) {
                    if let Some(r) = row[r] {
                        rc[(r, axis)] = value;
                    }
                }
            }
            let entry = |i, j| matrix.get(dof((node, i)), dof((node, j))).copied().unwrap_or(0.0);
            (rr, rc, Mat::from_fn(axes, axes, entry))
        };
        let (stiffness, stiffness_rc, stiffness_cc) = cut(tangent.stiffness());
        let (damping, damping_rc, damping_cc) = cut(tangent.damping());
        let mass = place.iter().map(|&(node, _)| network.mass_kg()[node]).collect();
        Ok(Self { mass, damping, stiffness, damping_rc, stiffness_rc, damping_cc, stiffness_cc, place })
    }

    /// Number of second-order unknowns; the order of the system in state space is twice that.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.mass.len()
    }

    /// Number of inputs, which is that of outputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.stiffness_cc.nrows()
    }

    /// G at each of the complex frequencies `s` (1/s), by a sparse factorisation at each.
    ///
    /// # Errors
    /// [`ReduceError::Symbolic`] when the pattern cannot be factorised; [`ReduceError::Pole`] when one of the
    /// frequencies is a pole.
    pub fn response(&self, s: &[c64]) -> Result<Vec<Mat<c64>>, ReduceError> {
        let n = self.unknowns();
        let dynamic = |s: c64| -> Vec<Triplet<usize, usize, c64>> {
            let of = |matrix: &SparseColMat<usize, f64>, factor: c64| -> Vec<Triplet<usize, usize, c64>> {
                matrix.triplet_iter().map(|t| Triplet::new(t.row, t.col, factor * *t.val)).collect()
            };
            let mut entries = of(&self.stiffness, c64::new(1.0, 0.0));
            entries.extend(of(&self.damping, s));
            entries.extend(self.mass.iter().enumerate().map(|(i, &m)| Triplet::new(i, i, s * s * m)));
            entries
        };
        let mut symbolic = None;
        let mut responses = Vec::with_capacity(s.len());
        for &s in s {
            let matrix = SparseColMat::try_new_from_triplets(n, n, &dynamic(s)).expect("indices are below n");
            let symbolic: &SymbolicLu<usize> = match &symbolic {
                Some(symbolic) => symbolic,
                None => symbolic.insert(
                    SymbolicLu::try_new(matrix.symbolic())
                        .map_err(|_| ReduceError::Symbolic { unknowns: n })?,
                ),
            };
            let lu = Lu::try_new_with_symbolic(symbolic.clone(), matrix.as_ref())
                .map_err(|_| ReduceError::Pole { re: s.re, im: s.im })?;
            let coupling = combine(self.stiffness_rc.as_ref(), self.damping_rc.as_ref(), s);
            let inner = coupling.transpose() * lu.solve(&coupling);
            responses.push(combine(self.stiffness_cc.as_ref(), self.damping_cc.as_ref(), s) - inner);
        }
        Ok(responses)
    }
}

/// K + s B.
pub(crate) fn combine(k: MatRef<'_, f64>, b: MatRef<'_, f64>, s: c64) -> Mat<c64> {
    Mat::from_fn(k.nrows(), k.ncols(), |i, j| c64::new(k[(i, j)], 0.0) + s * b[(i, j)])
}
