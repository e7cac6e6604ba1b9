//! Linear second-order systems: the small motions of a body about a state, driven by the displacement of some nodes.

use crate::dense_system::DenseSystem;
use crate::dynamic_stiffness::DynamicStiffness;
use crate::state_space::{StateSpace, dynamic_block};
use crate::{ReduceError, neighbourhood};
use faer::sparse::{SparseColMat, SparseColMatRef, Triplet};
use faer::{Mat, MatRef, c64};
use palpate_body::{Body, Network, TangentPattern};

/// A linear second-order system M q̈ + B q̇ + K q = −B_rc u̇ − K_rc u, with the force that moves the tool
///
/// ```text
/// f = K_cc u + B_cc u̇ + K_cr q + B_cr q̇,    G(s) = f/u = K_cc + s B_cc − (K_cr + s B_cr)(s²M + sB + K)⁻¹(K_rc + s B_rc)
/// ```
///
/// u, m, is the displacement of the driven nodes c, node by node with one input for each axis. q is that of the other free nodes r, and
/// M is diagonal. G(0) is the static stiffness and positive; the force on the hand is −f.
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
    /// The driven nodes.
    pub driven: Vec<usize>,
}

impl SecondOrderSystem {
    /// The small motions of `body` about its current state when the nodes `driven` are displaced. Nodes move along the first `axes` axes of
    /// space, 1 to 3.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when `axes` is not 1 to 3, or `driven` is empty, has a node twice, or has a node that is not free.
    pub fn of_body(body: &Body, driven: &[usize], axes: usize) -> Result<Self, ReduceError> {
        let network = body.network();
        validate_drive(network, driven, axes)?;
        let pattern = TangentPattern::new(body);
        let mut tangent = pattern.zero();
        pattern.fill(body, false, &mut tangent);
        let on_axes = |node: usize| (0..axes).map(move |axis| (node, axis));
        let place: Vec<(usize, usize)> =
            network.free().iter().filter(|free| !driven.contains(free)).flat_map(|&n| on_axes(n)).collect();
        let inputs: Vec<(usize, usize)> = driven.iter().flat_map(|&node| on_axes(node)).collect();
        let dof = |(node, axis): (usize, usize)| 3 * network.free_index(node).unwrap_or(0) + axis;
        let mut row = vec![None; 3 * network.free().len()];
        for (i, &at) in place.iter().enumerate() {
            row[dof(at)] = Some(i);
        }
        let cut = |matrix: SparseColMatRef<'_, usize, f64>| {
            let column_of = |at: (usize, usize)| {
                matrix.row_idx_of_col(dof(at)).zip(matrix.val_of_col(dof(at)).iter().copied())
            };
            let mut entries = Vec::new();
            for (column, &at) in place.iter().enumerate() {
                let kept = column_of(at).filter_map(|(r, value)| Some((row[r]?, value)));
                entries.extend(kept.map(|(r, value)| Triplet::new(r, column, value)));
            }
            let mut rc = Mat::zeros(place.len(), inputs.len());
            for (column, &at) in inputs.iter().enumerate() {
                for (r, value) in column_of(at).filter_map(|(r, value)| Some((row[r]?, value))) {
                    rc[(r, column)] = value;
                }
            }
            let entry = |i, j| matrix.get(dof(inputs[i]), dof(inputs[j])).copied().unwrap_or(0.0);
            (square(place.len(), &entries), rc, Mat::from_fn(inputs.len(), inputs.len(), entry))
        };
        let (stiffness, stiffness_rc, stiffness_cc) = cut(tangent.stiffness());
        let (damping, damping_rc, damping_cc) = cut(tangent.damping());
        let mass = place.iter().map(|&(node, _)| network.mass_kg()[node]).collect();
        let driven = driven.to_vec();
        Ok(Self {
            mass,
            damping,
            stiffness,
            damping_rc,
            stiffness_rc,
            damping_cc,
            stiffness_cc,
            place,
            driven,
        })
    }

    /// Number of second-order unknowns, half the order in state space.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.mass.len()
    }

    /// Number of inputs, equal to the number of outputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.stiffness_cc.nrows()
    }

    /// The local linear approximation of the seed paper (its Fig. 8): the nodes within `rings` links of a driven node move, and all others
    /// are fixed. `network` is that of the body. It is a projection with V a selection of nodes: M, B and K stay symmetric positive
    /// definite.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when `rings` is zero.
    pub fn neighbourhood(&self, network: &Network, rings: usize) -> Result<Self, ReduceError> {
        if rings == 0 {
            let (what, allowed) = ("rings of nodes", "at least 1");
            return Err(ReduceError::Option { what, value: 0.0, allowed });
        }
        let mut near = vec![false; network.node_count()];
        for &driven in &self.driven {
            neighbourhood::nodes_within(network, driven, rings).iter().for_each(|&n| near[n] = true);
        }
        let kept: Vec<usize> = (0..self.unknowns()).filter(|&row| near[self.place[row].0]).collect();
        let mut new_row = vec![None; self.unknowns()];
        kept.iter().enumerate().for_each(|(new, &old)| new_row[old] = Some(new));
        let cut = |matrix: &SparseColMat<usize, f64>| {
            let entries: Vec<_> = matrix
                .triplet_iter()
                .filter_map(|t| Some(Triplet::new(new_row[t.row]?, new_row[t.col]?, *t.val)))
                .collect();
            square(kept.len(), &entries)
        };
        let rows = |matrix: &Mat<f64>| Mat::from_fn(kept.len(), self.inputs(), |i, j| matrix[(kept[i], j)]);
        Ok(Self {
            mass: kept.iter().map(|&row| self.mass[row]).collect(),
            damping: cut(&self.damping),
            stiffness: cut(&self.stiffness),
            damping_rc: rows(&self.damping_rc),
            stiffness_rc: rows(&self.stiffness_rc),
            damping_cc: self.damping_cc.clone(),
            stiffness_cc: self.stiffness_cc.clone(),
            place: kept.iter().map(|&row| self.place[row]).collect(),
            driven: self.driven.clone(),
        })
    }

    /// The system with all driven nodes displaced together, as by a rigid plate: one input for each axis, with the sum of the forces.
    #[must_use]
    pub fn driven_as_one(&self) -> Self {
        let axes = self.inputs() / self.driven.len();
        let sum = |rc: &Mat<f64>| {
            Mat::from_fn(rc.nrows(), axes, |i, axis| {
                (axis..rc.ncols()).step_by(axes).map(|j| rc[(i, j)]).sum()
            })
        };
        let sum_both = |cc: &Mat<f64>| sum(&sum(cc).transpose().to_owned()).transpose().to_owned();
        Self {
            damping_rc: sum(&self.damping_rc),
            stiffness_rc: sum(&self.stiffness_rc),
            damping_cc: sum_both(&self.damping_cc),
            stiffness_cc: sum_both(&self.stiffness_cc),
            ..self.clone()
        }
    }

    /// The projection by congruence onto the columns of `v`, unknowns × p: q = V q̃, M̃ = VᵀMV, B̃ = VᵀBV, K̃ = VᵀKV, B̃_rc = VᵀB_rc,
    /// K̃_rc = VᵀK_rc.
    ///
    /// For every V of full rank, M̃, B̃ and K̃ are symmetric and as definite as M, B and K: a passive system stays passive.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when the number of rows of `v` is not that of unknowns, or `v` has no columns.
    pub fn project(&self, v: MatRef<'_, f64>) -> Result<DenseSystem, ReduceError> {
        for (what, value, ok, allowed) in [
            ("rows of the basis", v.nrows(), v.nrows() == self.unknowns(), "the number of unknowns"),
            ("columns of the basis", v.ncols(), v.ncols() > 0, "at least 1"),
        ] {
            if !ok {
                return Err(ReduceError::Option { what, value: value as f64, allowed });
            }
        }
        let p = v.ncols();
        let weighted = Mat::from_fn(v.nrows(), p, |i, j| self.mass[i] * v[(i, j)]);
        // Exactly symmetric in spite of rounding.
        let symmetric = |m: Mat<f64>| Mat::from_fn(p, p, |i, j| 0.5 * (m[(i, j)] + m[(j, i)]));
        Ok(DenseSystem {
            mass: symmetric(v.transpose() * weighted),
            damping: symmetric(v.transpose() * (self.damping.as_ref() * v)),
            stiffness: symmetric(v.transpose() * (self.stiffness.as_ref() * v)),
            damping_rc: v.transpose() * &self.damping_rc,
            stiffness_rc: v.transpose() * &self.stiffness_rc,
            damping_cc: self.damping_cc.clone(),
            stiffness_cc: self.stiffness_cc.clone(),
        })
    }

    /// The system with full matrices.
    #[must_use]
    pub fn to_dense(&self) -> DenseSystem {
        let n = self.unknowns();
        DenseSystem {
            mass: Mat::from_fn(n, n, |i, j| if i == j { self.mass[i] } else { 0.0 }),
            damping: self.damping.to_dense(),
            stiffness: self.stiffness.to_dense(),
            damping_rc: self.damping_rc.clone(),
            stiffness_rc: self.stiffness_rc.clone(),
            damping_cc: self.damping_cc.clone(),
            stiffness_cc: self.stiffness_cc.clone(),
        }
    }

    /// The system in state space: see [`DenseSystem::state_space`].
    ///
    /// # Errors
    /// As there.
    pub fn state_space(&self) -> Result<StateSpace, ReduceError> {
        self.to_dense().state_space()
    }

    /// G(0) = K_cc − K_cr K⁻¹ K_rc, N/m, by a sparse Cholesky factorisation.
    ///
    /// # Errors
    /// [`ReduceError::Singular`] when K is not positive definite.
    pub fn static_stiffness(&self) -> Result<Mat<f64>, ReduceError> {
        if self.unknowns() == 0 {
            return Ok(self.stiffness_cc.clone());
        }
        let response = self.dynamic_stiffness().solve_real(0.0, self.stiffness_rc.as_ref())?;
        Ok(&self.stiffness_cc - self.stiffness_rc.transpose() * response)
    }

    /// G at each of the complex frequencies `s`, 1/s, by a sparse factorisation each.
    ///
    /// # Errors
    /// [`ReduceError::Symbolic`] when the pattern cannot be factorised; [`ReduceError::Pole`] when a frequency is a
    /// pole.
    pub fn response(&self, s: &[c64]) -> Result<Vec<Mat<c64>>, ReduceError> {
        let mut dynamic = self.dynamic_stiffness();
        s.iter().map(|&s| self.response_with(&mut dynamic, s)).collect()
    }

    /// M, B and K, prepared for solves with s²M + sB + K.
    pub(crate) fn dynamic_stiffness(&self) -> DynamicStiffness<'_> {
        DynamicStiffness::new(&self.mass, self.damping.as_ref(), self.stiffness.as_ref())
    }

    /// G at `s`.
    fn response_with(&self, dynamic: &mut DynamicStiffness<'_>, s: c64) -> Result<Mat<c64>, ReduceError> {
        let direct = dynamic_block(self.stiffness_cc.as_ref(), self.damping_cc.as_ref(), s);
        if self.unknowns() == 0 {
            return Ok(direct);
        }
        let coupling = dynamic_block(self.stiffness_rc.as_ref(), self.damping_rc.as_ref(), s);
        Ok(direct - coupling.transpose() * dynamic.solve_complex(s, coupling.as_ref())?)
    }
}

fn validate_drive(network: &Network, driven: &[usize], axes: usize) -> Result<(), ReduceError> {
    let reject =
        |what, value: usize, allowed| Err(ReduceError::Option { what, value: value as f64, allowed });
    if !(1..=3).contains(&axes) {
        return reject("number of axes", axes, "1 to 3");
    }
    if driven.is_empty() {
        return reject("number of driven nodes", 0, "at least 1");
    }
    for (i, &node) in driven.iter().enumerate() {
        if node >= network.node_count() || network.is_fixed(node) || driven[..i].contains(&node) {
            return reject("driven node", node, "a free node of the body, listed once");
        }
    }
    Ok(())
}

fn square(n: usize, entries: &[Triplet<usize, usize, f64>]) -> SparseColMat<usize, f64> {
    SparseColMat::try_new_from_triplets(n, n, entries).expect("indices are below n")
}
