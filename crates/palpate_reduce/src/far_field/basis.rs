//! The basis V of the far field, orthonormal with respect to the mass matrix.

use crate::obstacle_constraints::ObstacleConstraints;
use faer::linalg::matmul::{matmul, triangular};
use faer::{Accum, Mat, MatRef, Par, Side};
use glam::{DMat3, DVec3};
use palpate_body::{BarrierTetrahedron, Body, Network, Tangent};
use std::ops::Range;
use triangular::BlockStructure::{Rectangular, TriangularLower};

/// The columns of V over the far nodes: the free nodes that are not in S.
#[derive(Debug)]
pub(crate) struct Basis {
    /// Far nodes, and their √m.
    nodes: Vec<(usize, f64)>,
    /// First row of each free node; `None` in S.
    row: Vec<Option<usize>>,
    /// Index of each node among the free nodes; `None` for a fixed one.
    free_index: Vec<Option<usize>>,
    /// Number p of columns.
    order: usize,
    /// M^½ V in the first p columns, 3 × `nodes` numbers each. The number of columns is the capacity.
    columns: Mat<f64>,
    /// V by rows, 3 × `nodes` of p, written by [`Basis::finish`].
    rows: Vec<f64>,
    constraints: ObstacleConstraints,
    /// The column that moves the points in contact with moving obstacles.
    carried: Option<usize>,
}

/// Factor by which the column of points in contact is heavier than they are, so that it keeps its velocity.
const CARRIED_MASS: f64 = 1e8;

impl Basis {
    /// An empty basis of at most `max_columns` columns, which satisfy `constraints`.
    pub(crate) fn new(
        network: &Network,
        is_support: &[bool],
        max_columns: usize,
        constraints: ObstacleConstraints,
    ) -> Self {
        let mut row = vec![None; is_support.len()];
        let mut nodes = Vec::new();
        for (index, &node) in network.free().iter().enumerate().filter(|(index, _)| !is_support[*index]) {
            row[index] = Some(3 * nodes.len());
            nodes.push((node, network.mass_kg()[node].sqrt()));
        }
        let free_index = (0..network.node_count()).map(|node| network.free_index(node)).collect();
        let columns = Mat::zeros(3 * nodes.len(), max_columns.min(3 * nodes.len()));
        Self { nodes, row, free_index, order: 0, columns, rows: Vec::new(), constraints, carried: None }
    }

    /// Number p of columns.
    pub(crate) fn order(&self) -> usize {
        self.order
    }

    /// Number of columns that can still be added.
    pub(crate) fn columns_left(&self) -> usize {
        self.columns.ncols() - self.order
    }

    /// Whether the free node of this index is a far node.
    pub(crate) fn is_far(&self, index: usize) -> bool {
        self.row[index].is_some()
    }

    /// M^½ times the columns of `matrix`, from all free degrees of freedom to those of the far nodes.
    pub(crate) fn weighted(&self, matrix: MatRef<'_, f64>) -> Mat<f64> {
        let mut weighted = Mat::zeros(3 * self.nodes.len(), matrix.ncols());
        for (to, from) in weighted.col_iter_mut().zip(matrix.col_iter()) {
            let (mut to, far) =
                (to, self.row.iter().enumerate().filter_map(|(index, row)| Some((index, (*row)?))));
            for ((index, row), (_, root)) in far.zip(&self.nodes) {
                (0..3).for_each(|axis| to[row + axis] = root * from[3 * index + axis]);
            }
        }
        weighted
    }

    /// Adds the columns of `matrix`, given over all free degrees of freedom, orthonormalised by QR with column pivoting: the most
    /// independent first. Drops columns whose independent part is below `tolerance` of their length, or that exceed the capacity. What
    /// violates the constraints is removed before.
    pub(crate) fn extend(&mut self, matrix: MatRef<'_, f64>, tolerance: f64) {
        self.add(matrix, tolerance, true);
    }

    /// Adds a column for the motion of the points in contact as in `velocity`, after its other part has been added. The points keep that
    /// velocity. The column is orthogonal to all that satisfy the constraints.
    pub(crate) fn add_carried(&mut self, velocity: MatRef<'_, f64>, tolerance: f64) {
        let before = self.order;
        self.add(velocity, tolerance, false);
        self.carried = (self.order > before).then_some(before);
    }

    fn add(&mut self, matrix: MatRef<'_, f64>, tolerance: f64, is_constrained: bool) {
        if self.columns_left() == 0 {
            return;
        }
        let weighted = self.weighted(matrix);
        let lengths: Vec<f64> = weighted.col_iter().map(|column| column.norm_l2()).collect();
        let nonzero: Vec<usize> =
            (0..lengths.len()).filter(|&j| lengths[j].is_finite() && lengths[j] > 0.0).collect();
        let mut new = Mat::from_fn(weighted.nrows(), nonzero.len(), |i, j| {
            weighted[(i, nonzero[j])] / lengths[nonzero[j]]
        });
        if is_constrained && !self.constraints.is_empty() {
            let place = |index: usize| self.row[index].map(|first| (first, self.nodes[first / 3].1));
            self.constraints.project(&mut new, place);
        }
        self.project_out(&mut new);
        let factors = new.col_piv_qr();
        let r = factors.thin_R();
        let independent = (0..r.nrows()).take_while(|&i| r[(i, i)].abs() >= tolerance).count();
        let added = independent.min(self.columns_left());
        let mut q = factors.compute_thin_Q().subcols(0, added).to_owned();
        // A second projection removes the rounding of the first from columns of which little was left.
        self.project_out(&mut q);
        self.columns.subcols_mut(self.order, added).copy_from(&q);
        self.order += added;
    }

    /// Subtracts from `new` its projection onto the columns of the basis.
    fn project_out(&self, new: &mut Mat<f64>) {
        let own = self.columns.subcols(0, self.order);
        let mut along = Mat::zeros(self.order, new.ncols());
        matmul(&mut along, Accum::Replace, own.transpose(), &*new, 1.0, Par::Seq);
        matmul(new, Accum::Add, own, &along, -1.0, Par::Seq);
    }

    /// Writes the rows of V, after the last column has been added.
    pub(crate) fn finish(&mut self) {
        let p = self.order;
        self.rows = vec![0.0; 3 * self.nodes.len() * p];
        for (j, column) in self.columns.subcols(0, p).col_iter().enumerate() {
            let scale = if self.carried == Some(j) { 1.0 / CARRIED_MASS.sqrt() } else { 1.0 };
            for (i, value) in column.iter().enumerate() {
                self.rows[i * p + j] = scale * value / self.nodes[i / 3].1;
            }
        }
    }

    /// Range of the 3 × p entries of `node` in `rows`; `None` for a node of S or a fixed one.
    fn rows_of(&self, node: usize) -> Option<Range<usize>> {
        let first = self.row[self.free_index[node]?]?;
        let p = self.order();
        Some(first * p..(first + 3) * p)
    }

    /// Calls `visit` with axis, column and entry of the rows of V of `node`; the entries of a node of S or a fixed one are zero.
    pub(crate) fn for_each_entry(&self, node: usize, mut visit: impl FnMut(usize, usize, f64)) {
        let (p, rows) = (self.order(), self.rows_of(node).map(|rows| &self.rows[rows]));
        for axis in 0..3 {
            (0..p).for_each(|j| visit(axis, j, rows.map_or(0.0, |rows| rows[axis * p + j])));
        }
    }

    /// Calls `visit` with column and entries of Vᵀ f and Vᵀ g, for a force f on the nodes and their momentum g.
    pub(crate) fn project(
        &self,
        f: impl Fn(usize) -> DVec3,
        g: impl Fn(usize) -> DVec3,
        mut visit: impl FnMut(usize, f64, f64),
    ) {
        let p = self.order();
        let (mut f_q, mut g_q) = (vec![0.0; p], vec![0.0; p]);
        for (i, &(node, _)) in self.nodes.iter().enumerate() {
            let (f, g) = (f(node), g(node));
            for axis in 0..3 {
                let row = &self.rows[(3 * i + axis) * p..(3 * i + axis + 1) * p];
                for ((f_q, g_q), v) in f_q.iter_mut().zip(&mut g_q).zip(row) {
                    *f_q += v * f[axis];
                    *g_q += v * g[axis];
                }
            }
        }
        if let Some(carried) = self.carried {
            g_q[carried] *= CARRIED_MASS;
        }
        f_q.iter().zip(&g_q).enumerate().for_each(|(j, (f, g))| visit(j, *f, *g));
    }

    /// Vᵀ f of a vector over all free degrees of freedom.
    pub(crate) fn transposed(&self, network: &Network, f: &[f64]) -> Vec<f64> {
        let force = |node: usize| {
            network.free_index(node).map_or(DVec3::ZERO, |i| DVec3::from_slice(&f[3 * i..3 * i + 3]))
        };
        let mut f_q = vec![0.0; self.order()];
        self.project(force, |_| DVec3::ZERO, |j, f, _| f_q[j] = f);
        f_q
    }

    /// V q over all free degrees of freedom; zero in S.
    pub(crate) fn expand(&self, network: &Network, q: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; 3 * network.free().len()];
        for (index, row) in self.row.iter().enumerate() {
            let Some(first) = row else { continue };
            for axis in 0..3 {
                let start = (first + axis) * self.order();
                all[3 * index + axis] = dot(&self.rows[start..start + self.order()], q);
            }
        }
        all
    }

    /// Subtracts V_iᵀ `block`ᵀ of the node `node` from `coupling`, p × 3.
    pub(crate) fn subtract_coupling(&self, node: usize, block: DMat3, coupling: &mut [f64]) {
        let p = self.order();
        let Some(rows) = self.rows_of(node).map(|rows| &self.rows[rows]) else { return };
        for j in 0..p {
            let t = block * DVec3::new(rows[j], rows[p + j], rows[2 * p + j]);
            coupling[3 * j..3 * j + 3].iter_mut().zip(t.to_array()).for_each(|(to, t)| *to -= t);
        }
    }

    /// Writes Vᵀ K V and Vᵀ B V into `stiffness` and `damping`, by rows. K and B are those of the springs that are not `is_near`, plus the
    /// volume barriers of `tetrahedra`.
    pub(crate) fn congruence(
        &self,
        body: &Body,
        (is_near, tetrahedra): (&[bool], &[BarrierTetrahedron]),
        clamped: bool,
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) {
        let (p, x) = (self.order(), body.positions_m());
        // K V and B V by rows.
        let mut products = [vec![0.0; self.rows.len()], vec![0.0; self.rows.len()]];
        let (mut stretch, mut force) = (vec![0.0; 3 * p], vec![0.0; 3 * p]);
        for (link, _) in body.network().links().iter().zip(is_near).filter(|(_, is_near)| !**is_near) {
            let ends = [(link.a, -1.0), (link.b, 1.0)].map(|(node, sign)| Some((self.rows_of(node)?, sign)));
            match &ends {
                [None, None] => continue,
                [Some((rows, sign)), None] | [None, Some((rows, sign))] => {
                    stretch.iter_mut().zip(&self.rows[rows.clone()]).for_each(|(to, v)| *to = sign * v);
                }
                [Some((a, _)), Some((b, _))] => {
                    let rows = self.rows[a.clone()].iter().zip(&self.rows[b.clone()]);
                    stretch.iter_mut().zip(rows).for_each(|(to, (a, b))| *to = b - a);
                }
            }
            let tangent = link.spring.tangent(x[link.b] - x[link.a], clamped);
            for (block, product) in [tangent.stiffness, tangent.damping].into_iter().zip(&mut products) {
                multiply(block, &stretch, &mut force);
                for (rows, sign) in ends.iter().flatten() {
                    product[rows.clone()].iter_mut().zip(&force).for_each(|(to, f)| *to += sign * f);
                }
            }
        }
        let [on_rows, _] = &mut products;
        for tetrahedron in tetrahedra {
            let rows = tetrahedron.nodes.map(|node| self.rows_of(node));
            for (to, blocks) in rows.iter().zip(tetrahedron.stiffness(x, clamped)) {
                let Some(to) = to else { continue };
                for (from, block) in rows.iter().zip(blocks) {
                    let Some(from) = from else { continue };
                    multiply(block, &self.rows[from.clone()], &mut force);
                    on_rows[to.clone()].iter_mut().zip(&force).for_each(|(to, f)| *to += f);
                }
            }
        }
        self.write_congruences(&products, [stiffness, damping]);
    }

    /// Writes Vᵀ K V and Vᵀ B V of the whole tangent over the far nodes into `stiffness` and `damping`, by rows.
    pub(crate) fn congruence_of_tangent(
        &self,
        tangent: &Tangent,
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) {
        let p = self.order();
        let row = |dof: usize| self.row[dof / 3].map(|first| first + dof % 3);
        let products = [tangent.stiffness(), tangent.damping()].map(|matrix| {
            let mut product = vec![0.0; self.rows.len()];
            for column in 0..matrix.ncols() {
                let Some(from) = row(column) else { continue };
                let from = &self.rows[from * p..(from + 1) * p];
                for (dof, value) in matrix.row_idx_of_col(column).zip(matrix.val_of_col(column)) {
                    let Some(to) = row(dof) else { continue };
                    let to = &mut product[to * p..(to + 1) * p];
                    to.iter_mut().zip(from).for_each(|(to, v)| *to += value * v);
                }
            }
            product
        });
        self.write_congruences(&products, [stiffness, damping]);
    }

    /// Writes Vᵀ times each of `products`, K V and B V by rows, into `matrices`, by rows.
    fn write_congruences(&self, products: &[Vec<f64>; 2], matrices: [&mut [f64]; 2]) {
        let p = self.order();
        let transposed = |rows| MatRef::from_column_major_slice(rows, p, 3 * self.nodes.len());
        for (matrix, product) in matrices.into_iter().zip(products) {
            let mut lower = Mat::<f64>::zeros(p, p);
            let [v, kv] = [&self.rows, product].map(|rows| transposed(rows));
            triangular::matmul(
                &mut lower,
                TriangularLower,
                Accum::Replace,
                v,
                Rectangular,
                kv.transpose(),
                Rectangular,
                1.0,
                Par::Seq,
            );
            for i in 0..p {
                for j in 0..=i {
                    (matrix[i * p + j], matrix[j * p + i]) = (lower[(i, j)], lower[(i, j)]);
                }
            }
        }
    }
}

/// The `count` leading right singular vectors of `matrix`, as columns: the inputs of the largest gain.
pub(super) fn leading_inputs(matrix: MatRef<'_, f64>, count: usize) -> Option<Mat<f64>> {
    let n = matrix.ncols();
    let mut gram = Mat::zeros(n, n);
    triangular::matmul(
        &mut gram,
        TriangularLower,
        Accum::Replace,
        matrix.transpose(),
        Rectangular,
        matrix,
        Rectangular,
        1.0,
        Par::Seq,
    );
    let eigen = gram.self_adjoint_eigen(Side::Lower).ok()?;
    // Eigenvalues are ascending.
    Some(eigen.U().subcols(n - count.min(n), count.min(n)).to_owned())
}

/// F = S G for matrices G and F of 3 × p, by rows.
fn multiply(s: DMat3, g: &[f64], f: &mut [f64]) {
    let p = g.len() / 3;
    let (x, rest) = g.split_at(p);
    let (y, z) = rest.split_at(p);
    for (row, f) in f.chunks_exact_mut(p.max(1)).enumerate() {
        let s = s.row(row);
        for (((f, x), y), z) in f.iter_mut().zip(x).zip(y).zip(z) {
            *f = s.x * x + s.y * y + s.z * z;
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    for (a, b) in a.chunks(4).zip(b.chunks(4)) {
        sums.iter_mut().zip(a).zip(b).for_each(|((sum, a), b)| *sum += a * b);
    }
    sums.iter().sum()
}
