//! A point of a body as a weighted sum of its nodes.

use crate::BodyError;
use crate::error::check;
use crate::weights::add_weight;
use glam::DVec3;

/// A point Σ w_i x_i of a body: a node, a place on a triangle or a place inside a cell.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BodyPoint {
    nodes: Vec<(usize, f64)>,
}

/// Maximum number of nodes of a point.
const MAX_NODES: usize = 32;

impl BodyPoint {
    /// The point at node `node`.
    #[must_use]
    pub fn node(node: usize) -> Self {
        Self { nodes: vec![(node, 1.0)] }
    }

    /// Creates the point Σ w_i x_i from pairs of node and weight.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if there are no nodes or more than 32, a weight is not finite, the weights do not sum
    /// to 1, or a node occurs twice.
    pub fn new(nodes: Vec<(usize, f64)>) -> Result<Self, BodyError> {
        let count = nodes.len();
        check("nodes of a point", count as f64, (1..=MAX_NODES).contains(&count), "1 to 32")?;
        let sum: f64 = nodes.iter().map(|(_, w)| w).sum();
        check("sum of the weights of a point", sum, (sum - 1.0).abs() < 1e-9, "1 within 1e-9")?;
        for (i, &(node, _)) in nodes.iter().enumerate() {
            let once = nodes[..i].iter().all(|(other, _)| *other != node);
            check("node of a point", node as f64, once, "named once")?;
        }
        Ok(Self { nodes })
    }

    /// Nodes and weights.
    #[must_use]
    pub fn nodes(&self) -> &[(usize, f64)] {
        &self.nodes
    }

    /// The point Σ w_i p_i of points p_i. Points of weight 0 are omitted.
    pub(crate) fn between(points: [(&Self, f64); 3]) -> Self {
        let mut nodes: Vec<(usize, f64)> = Vec::new();
        for (point, share) in points.into_iter().filter(|(_, share)| *share != 0.0) {
            point.nodes.iter().for_each(|&(node, w)| add_weight(&mut nodes, node, share * w));
        }
        Self { nodes }
    }

    /// Rejects nodes that a body of `nodes` nodes does not have.
    pub(crate) fn validate(&self, nodes: usize) -> Result<(), BodyError> {
        match self.nodes.iter().find(|(node, _)| *node >= nodes) {
            Some(&(index, _)) => Err(BodyError::Surface { index, below: nodes }),
            None => Ok(()),
        }
    }

    /// The point with the given nodes and weights, which must sum to 1.
    pub(crate) fn carried_by(nodes: Vec<(usize, f64)>) -> Self {
        Self { nodes }
    }

    /// The nodes without their weights.
    pub(crate) fn named(&self) -> Vec<usize> {
        self.nodes.iter().map(|(node, _)| *node).collect()
    }

    /// Weighted sum Σ w_i `values[i]` of a quantity given for every node, for example positions or velocities.
    ///
    /// # Panics
    /// If a node of the point has no value.
    #[must_use]
    pub fn of(&self, values: &[DVec3]) -> DVec3 {
        self.nodes.iter().map(|&(node, w)| w * values[node]).sum()
    }
}
