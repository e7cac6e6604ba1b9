//! Contacts with obstacles as constraints on the free nodes of a body, for the time until the next local model.

use faer::Mat;
use glam::{DMat3, DVec3};
use palpate_body::{Body, ObstacleContact, Tangent};

/// The contacts of a body with obstacles that bear force. They hold until the next local model: a contact neither opens nor closes, and slips
/// only if it slips now. An obstacle with a mass holds in the directions in which it gives way much less than the body; in the others the
/// force is constant.
#[derive(Clone, Debug, Default)]
pub(crate) struct ObstacleConstraints {
    rows: Vec<Row>,
    /// Whether a point in contact moves faster than [`MOVING_M_PER_S`].
    is_moving: bool,
}

/// A point in contact.
#[derive(Clone, Debug)]
struct Row {
    /// Indices among the free nodes, with the weights of the point.
    nodes: Vec<(usize, f64)>,
    /// Orthonormal directions in which the point cannot move relative to the obstacle: the normal, or all.
    directions: Vec<DVec3>,
}

/// Response of an obstacle, relative to that of the whole body as a rigid mass, up to which it holds.
const HOLDING_RESPONSE: f64 = 0.05;
/// Share of the limit of friction up to which a contact sticks.
const STICKING: f64 = 0.99;
/// Weight of a node above which a contact holds it.
const HOLDING_WEIGHT: f64 = 0.5;
/// Speed of a point above which the obstacles count as moving, m/s.
const MOVING_M_PER_S: f64 = 1e-3;
/// Stiffness of a constraint relative to the largest diagonal entry of K at its nodes.
const PENALTY: f64 = 1e4;
/// Maximum number of sweeps over the rows, and the change of a column of unit length at which they end.
const MAX_SWEEPS: usize = 100;
const SWEEP_TOLERANCE: f64 = 1e-10;

impl ObstacleConstraints {
    /// The constraints of `body` after its last step.
    pub(crate) fn of(body: &Body) -> Self {
        let network = body.network();
        let mut is_moving = false;
        let mass_kg: f64 = network.mass_kg().iter().sum();
        let row = |contact: &ObstacleContact| {
            let obstacle = &body.obstacles()[contact.obstacle];
            let pressing_ns = contact.impulse_ns.dot(contact.normal);
            if pressing_ns <= 0.0 {
                return None;
            }
            let nodes = body.obstacle_points()[contact.point].nodes();
            let nodes: Vec<(usize, f64)> =
                nodes.iter().filter_map(|&(node, w)| Some((network.free_index(node)?, w))).collect();
            is_moving |= contact.velocity_m_per_s.length() > MOVING_M_PER_S;
            let across_ns = (contact.impulse_ns - pressing_ns * contact.normal).length();
            let is_sticking =
                across_ns <= STICKING * obstacle.friction() * pressing_ns && obstacle.friction() > 0.0;
            let (along, across) = contact.normal.any_orthonormal_pair();
            let mut directions =
                if is_sticking { vec![contact.normal, along, across] } else { vec![contact.normal] };
            directions.retain(|d| mass_kg * d.dot(contact.response_per_kg * *d) <= HOLDING_RESPONSE);
            (!(nodes.is_empty() || directions.is_empty())).then_some(Row { nodes, directions })
        };
        let rows = body.contacts().iter().filter_map(row).collect();
        Self { rows, is_moving }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Whether points in contact move.
    pub(crate) fn is_moving(&self) -> bool {
        self.is_moving
    }

    /// Indices of the free nodes that contacts hold in all directions.
    pub(crate) fn held_nodes(&self) -> impl Iterator<Item = usize> {
        let sticking = self.rows.iter().filter(|row| row.directions.len() == 3);
        sticking.flat_map(|row| row.nodes.iter().filter(|(_, w)| *w > HOLDING_WEIGHT).map(|(node, _)| *node))
    }

    /// The constraints on the nodes for which `is_far` is true. A point mostly on other nodes is left out.
    pub(crate) fn on(&self, is_far: impl Fn(usize) -> bool) -> Self {
        let mut rows = self.rows.clone();
        rows.retain_mut(|row| {
            let total: f64 = row.nodes.iter().map(|(_, w)| w.abs()).sum();
            row.nodes.retain(|(node, _)| is_far(*node));
            row.nodes.iter().map(|(_, w)| w.abs()).sum::<f64>() > 0.5 * total
        });
        Self { rows, is_moving: self.is_moving }
    }

    /// Adds the constraints to K of `tangent` as stiff springs.
    pub(crate) fn add_to(&self, tangent: &mut Tangent) {
        let k = tangent.stiffness();
        let diagonal = |dof: usize| k.get(dof, dof).copied().unwrap_or(0.0);
        let largest = |row: &Row| {
            let dofs = row.nodes.iter().flat_map(|(node, _)| (0..3).map(move |axis| 3 * node + axis));
            PENALTY * dofs.map(diagonal).fold(0.0, f64::max)
        };
        let stiffness: Vec<f64> = self.rows.iter().map(largest).collect();
        for (Row { nodes, directions }, stiffness) in self.rows.iter().zip(stiffness) {
            let block = directions.iter().fold(DMat3::ZERO, |sum, d| sum + outer(*d));
            for &(row, w_row) in nodes {
                for &(column, w_column) in nodes {
                    tangent.add_to_stiffness(row, column, stiffness * w_row * w_column * block);
                }
            }
        }
    }

    /// Removes from each column of `columns` what violates the constraints, by projections orthogonal with respect to the mass. Columns are
    /// M^½ times a displacement of the far nodes. `place` is the first row of a free node and its √m.
    ///
    /// S. Kaczmarz, Bull. Int. Acad. Pol. Sci. Lett. A 35 (1937) 355: one row after the other. Rows without a common node need one sweep.
    pub(crate) fn project(&self, columns: &mut Mat<f64>, place: impl Fn(usize) -> Option<(usize, f64)>) {
        let weighted = |row: &Row| -> (Vec<(usize, f64)>, f64) {
            let entries: Vec<(usize, f64)> = row
                .nodes
                .iter()
                .filter_map(|&(node, w)| place(node).map(|(first, root)| (first, w / root)))
                .collect();
            let square = entries.iter().map(|(_, w)| w * w).sum();
            (entries, square)
        };
        let rows: Vec<(Vec<(usize, f64)>, f64)> = self.rows.iter().map(weighted).collect();
        for mut column in columns.col_iter_mut() {
            for _ in 0..MAX_SWEEPS {
                let mut largest: f64 = 0.0;
                for ((entries, square), Row { directions, .. }) in rows.iter().zip(&self.rows) {
                    if *square == 0.0 {
                        continue;
                    }
                    for d in directions {
                        let along =
                            |first: usize| (0..3).map(|axis| d[axis] * column[first + axis]).sum::<f64>();
                        let moved = entries.iter().map(|&(first, w)| w * along(first)).sum::<f64>() / square;
                        largest = largest.max((moved * moved * square).sqrt());
                        for &(first, w) in entries {
                            (0..3).for_each(|axis| column[first + axis] -= w * moved * d[axis]);
                        }
                    }
                }
                if largest <= SWEEP_TOLERANCE {
                    break;
                }
            }
        }
    }
}

fn outer(d: DVec3) -> DMat3 {
    DMat3::from_cols(d * d.x, d * d.y, d * d.z)
}
