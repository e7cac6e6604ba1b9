//! The local linear approximation of the seed paper (its Fig. 8): the nodes near the tool move, and all others are fixed.

use crate::ReduceError;
use crate::tangent_block::tangent_block;
use faer::sparse::SparseColMatRef;
use glam::DVec3;
use palpate_body::{Body, Network, Tangent};
use palpate_local::LocalModel;
use std::collections::HashSet;

/// Buffers for a neighbourhood and its matrices.
#[derive(Debug)]
pub(crate) struct Workspace {
    /// The nodes within the rings, without the driven one.
    nodes: Vec<usize>,
    /// Index of each degree of freedom among the selected ones.
    local: Vec<Option<usize>>,
    implicit: Vec<f64>,
    force: Vec<DVec3>,
}

impl Workspace {
    pub(crate) fn new(body: &Body) -> Self {
        let nodes = body.network().node_count();
        Self {
            nodes: Vec::new(),
            local: vec![None; 3 * body.network().free().len()],
            implicit: Vec::new(),
            force: vec![DVec3::ZERO; nodes],
        }
    }

    /// Maximum order: three times the maximum number of free nodes within `rings` of a free node.
    pub(crate) fn max_order(body: &Body, rings: usize) -> usize {
        let network = body.network();
        let orders = network.free().iter().map(|&node| 3 * nodes_within(network, node, rings).len());
        orders.max().unwrap_or(0)
    }

    /// Writes the reduced system of the nodes around `node` into `model`.
    pub(crate) fn build(
        &mut self,
        body: &Body,
        tangent: &Tangent,
        node: usize,
        rings: usize,
        tick_s: f64,
        model: &mut LocalModel,
    ) -> Result<(), ReduceError> {
        let network = body.network();
        self.nodes = nodes_within(network, node, rings);
        let dof =
            |node: usize, axis: usize| 3 * network.free_index(node).expect("selected nodes are free") + axis;
        let p = 3 * self.nodes.len();
        let capacity = model.reduced.capacity();
        if p > capacity {
            return Err(palpate_local::LocalModelError::Order { order: p, capacity }.into());
        }
        self.local.fill(None);
        for (i, &selected) in self.nodes.iter().enumerate() {
            (0..3).for_each(|axis| self.local[dof(selected, axis)] = Some(3 * i + axis));
        }
        body.internal_forces_n(&mut self.force);
        self.implicit.resize(p * p, 0.0);
        let (k, b, r) = (tangent.stiffness(), tangent.damping(), &mut model.reduced);
        r.order = p;
        r.step_s = tick_s;
        for (i, &selected) in self.nodes.iter().enumerate() {
            for axis in 0..3 {
                let column = 3 * i + axis;
                for (matrix, cut) in [(k, &mut r.stiffness), (b, &mut r.damping)] {
                    (0..p).for_each(|row| cut[row * p + column] = 0.0);
                    for (row, value) in self.column(matrix, dof(selected, axis)) {
                        cut[row * p + column] = value;
                    }
                }
                r.force[column] = self.force[selected][axis] + body.outer_force_on_n(selected)[axis];
                r.velocity[column] = body.velocities_m_per_s()[selected][axis];
            }
        }
        for axis in 0..3 {
            for (matrix, cut) in [(k, &mut r.stiffness_rc), (b, &mut r.damping_rc)] {
                (0..p).for_each(|row| cut[3 * row + axis] = 0.0);
                for (row, value) in self.column(matrix, dof(node, axis)) {
                    cut[3 * row + axis] = value;
                }
            }
        }
        let own = dof(node, 0) / 3;
        model.stiffness_n_per_m = tangent_block(k, own, own);
        model.damping_ns_per_m = tangent_block(b, own, own);
        for (entry, value) in self.implicit[..p * p].iter_mut().enumerate() {
            let (row, column) = (entry / p, entry % p);
            let inertia = if row == column { network.mass_kg()[self.nodes[row / 3]] / tick_s } else { 0.0 };
            *value = inertia + r.damping[entry] + tick_s * r.stiffness[entry];
        }
        Ok(r.implicit.factorise(p, &self.implicit)?)
    }

    /// The entries of one column in the selected rows.
    fn column<'a>(
        &'a self,
        matrix: SparseColMatRef<'a, usize, f64>,
        column: usize,
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        let entries = matrix.row_idx_of_col(column).zip(matrix.val_of_col(column));
        entries.filter_map(|(row, &value)| self.local[row].map(|row| (row, value)))
    }
}

/// The free nodes within `rings` links of `node` without itself, nearest first. Paths through fixed nodes do not count.
pub(crate) fn nodes_within(network: &Network, node: usize, rings: usize) -> Vec<usize> {
    let mut seen = HashSet::from([node]);
    let mut within = Vec::new();
    let mut front = vec![node];
    for _ in 0..rings {
        let mut next: Vec<usize> = front
            .iter()
            .flat_map(|&node| network.neighbours(node))
            .filter(|&other| !network.is_fixed(other) && seen.insert(other))
            .collect();
        next.sort_unstable();
        within.extend(&next);
        front = next;
    }
    within
}
