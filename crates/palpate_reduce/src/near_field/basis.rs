//! The basis V of the far field, orthonormal in the masses.

use faer::Mat;
use glam::{DMat3, DVec3};
use palpate_body::{Body, Network};

/// Columns over the free nodes that are not in S.
#[derive(Debug)]
pub(super) struct Basis {
    /// Free nodes that are not in S, and their √m.
    nodes: Vec<(usize, f64)>,
    /// Where each free node's rows begin; `None` in S.
    row: Vec<Option<usize>>,
    /// Of each node: its place among the free.
    free_index: Vec<Option<usize>>,
    /// M^½ times the columns that have been taken, each of 3 × `nodes` numbers.
    groups: Vec<Vec<Vec<f64>>>,
    /// p.
    order: usize,
    /// V by rows, after it has been made orthonormal: 3 × `nodes` of p.
    rows: Vec<f64>,
}

impl Basis {
    pub(super) fn new(network: &Network, is_support: &[bool]) -> Self {
        let mut row = vec![None; is_support.len()];
        let mut nodes = Vec::new();
        for (index, &node) in network.free().iter().enumerate().filter(|(index, _)| !is_support[*index]) {
            row[index] = Some(3 * nodes.len());
            nodes.push((node, network.mass_kg()[node].sqrt()));
        }
        let free_index = (0..network.node_count()).map(|node| network.free_index(node)).collect();
        Self { nodes, row, free_index, groups: Vec::new(), order: 0, rows: Vec::new() }
    }

    /// p.
    pub(super) fn order(&self) -> usize {
        self.order
    }

    /// Whether the free node of this index is not in S.
    pub(super) fn is_far(&self, index: usize) -> bool {
        self.row[index].is_some()
    }

    /// Takes the columns of `matrix`, over all free degrees of freedom.
    pub(super) fn take(&mut self, matrix: &Mat<f64>) {
        let mut group = Vec::with_capacity(matrix.ncols());
        for column in 0..matrix.ncols() {
            let mut taken = Vec::with_capacity(3 * self.nodes.len());
            for (index, _) in self.row.iter().enumerate().filter(|(_, row)| row.is_some()) {
                let root = self.nodes[taken.len() / 3].1;
                taken.extend((0..3).map(|axis| root * matrix[(3 * index + axis, column)]));
            }
            group.push(taken);
        }
        self.groups.push(group);
    }

    /// Makes the columns orthonormal, one matrix that was taken after the other and in each the most independent first, and
    /// leaves out those that add less than `tolerance` of their length, or come after `most`.
    pub(super) fn orthonormalise(&mut self, tolerance: f64, most: usize) {
        let mut done: Vec<Vec<f64>> = Vec::new();
        for group in std::mem::take(&mut self.groups) {
            // What is left of each column, and the square of its length.
            let mut rest: Vec<(f64, Vec<f64>)> = Vec::new();
            for mut column in group {
                let length = dot(&column, &column).sqrt();
                if length.is_finite() && length > 0.0 {
                    column.iter_mut().for_each(|v| *v /= length);
                    done.iter().for_each(|done| subtract(&mut column, done));
                    rest.push((dot(&column, &column), column));
                }
            }
            while done.len() < most {
                let longest = rest.iter().enumerate().max_by(|a, b| a.1.0.total_cmp(&b.1.0)).map(|(i, _)| i);
                let Some(longest) = longest else { break };
                let (_, mut column) = rest.swap_remove(longest);
                // Twice is enough.
                done.iter().for_each(|done| subtract(&mut column, done));
                let length = dot(&column, &column).sqrt();
                if length < tolerance {
                    break;
                }
                column.iter_mut().for_each(|v| *v /= length);
                for (length, other) in &mut rest {
                    subtract(other, &column);
                    *length = dot(other, other);
                }
                done.push(column);
            }
        }
        let p = done.len();
        self.rows = vec![0.0; 3 * self.nodes.len() * p];
        for (j, column) in done.iter().enumerate() {
            for (i, value) in column.iter().enumerate() {
                self.rows[i * p + j] = value / self.nodes[i / 3].1;
            }
        }
        self.order = p;
    }

    /// The rows of V of `node`, 3 × p; none for a node of S or a fixed one.
    fn rows_of(&self, node: usize) -> Option<&[f64]> {
        let first = self.row[self.free_index[node]?]?;
        let p = self.order();
        Some(&self.rows[first * p..(first + 3) * p])
    }

    /// Tells `found` the rows of V of `node`: axis, column, entry; zero for a node of S or a fixed one.
    pub(super) fn write_rows(&self, node: usize, mut found: impl FnMut(usize, usize, f64)) {
        let (p, rows) = (self.order(), self.rows_of(node));
        for axis in 0..3 {
            (0..p).for_each(|j| found(axis, j, rows.map_or(0.0, |rows| rows[axis * p + j])));
        }
    }

    /// Tells `found` Vᵀ f and Vᵀ g, entry by entry, of two fields of vectors over the nodes.
    pub(super) fn project(
        &self,
        f: impl Fn(usize) -> DVec3,
        g: impl Fn(usize) -> DVec3,
        mut found: impl FnMut(usize, f64, f64),
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
        f_q.iter().zip(&g_q).enumerate().for_each(|(j, (f, g))| found(j, *f, *g));
    }

    /// Vᵀ f of a vector over all free degrees of freedom.
    pub(super) fn transposed(&self, network: &Network, f: &[f64]) -> Vec<f64> {
        let force = |node: usize| {
            network.free_index(node).map_or(DVec3::ZERO, |i| DVec3::from_slice(&f[3 * i..3 * i + 3]))
        };
        let mut f_q = vec![0.0; self.order()];
        self.project(force, |_| DVec3::ZERO, |j, f, _| f_q[j] = f);
        f_q
    }

    /// V q over all free degrees of freedom; zero in S.
    pub(super) fn columns(&self, network: &Network, q: &[f64]) -> Vec<f64> {
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

    /// Takes V_iᵀ `block` of the node `node` away from `coupling`, p × 3.
    pub(super) fn subtract_coupling(&self, node: usize, block: DMat3, coupling: &mut [f64]) {
        let p = self.order();
        let Some(rows) = self.rows_of(node) else { return };
        for j in 0..p {
            let t = block * DVec3::new(rows[j], rows[p + j], rows[2 * p + j]);
            coupling[3 * j..3 * j + 3].iter_mut().zip(t.to_array()).for_each(|(to, t)| *to -= t);
        }
    }

    /// Vᵀ K V and Vᵀ B V of the springs that are not `is_near`, row by row, into `stiffness` and `damping`.
    pub(super) fn congruence(
        &self,
        body: &Body,
        is_near: &[bool],
        clamped: bool,
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) {
        let (p, x) = (self.order(), body.positions_m());
        stiffness[..p * p].fill(0.0);
        damping[..p * p].fill(0.0);
        let mut stretch = vec![0.0; 3 * p];
        for (link, _) in body.network().links().iter().zip(is_near).filter(|(_, is_near)| !**is_near) {
            let ends = (self.rows_of(link.a), self.rows_of(link.b));
            match ends {
                (None, None) => continue,
                (Some(rows), None) | (None, Some(rows)) => stretch.copy_from_slice(rows),
                (Some(a), Some(b)) => {
                    stretch.iter_mut().zip(a).zip(b).for_each(|((to, a), b)| *to = b - a);
                }
            }
            let tangent = link.spring.tangent(x[link.b] - x[link.a], clamped);
            for (block, sum) in [(tangent.stiffness, &mut *stiffness), (tangent.damping, &mut *damping)] {
                add(&stretch, block, sum);
            }
        }
        // The lower half has been summed.
        for matrix in [stiffness, damping] {
            for i in 0..p {
                for j in i + 1..p {
                    matrix[i * p + j] = matrix[j * p + i];
                }
            }
        }
    }
}

/// Adds the lower half of Gᵀ S G to a matrix; G is 3 × p and S symmetric.
fn add(g: &[f64], s: DMat3, sum: &mut [f64]) {
    let p = g.len() / 3;
    let (x, rest) = g.split_at(p);
    let (y, z) = rest.split_at(p);
    for i in 0..p {
        let t = s * DVec3::new(x[i], y[i], z[i]);
        let row = &mut sum[i * p..=i * p + i];
        for (((to, x), y), z) in row.iter_mut().zip(x).zip(y).zip(z) {
            *to += t.x * x + t.y * y + t.z * z;
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

/// Takes its part along the unit column `unit` away from `column`.
fn subtract(column: &mut [f64], unit: &[f64]) {
    let along = dot(column, unit);
    column.iter_mut().zip(unit).for_each(|(v, u)| *v -= along * u);
}
