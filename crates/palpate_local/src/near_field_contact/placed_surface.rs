//! The near field's surface at the current state: the positions of its points, computed once a tick and on demand.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::NearField;
use crate::dense::vec3_at;
use glam::DVec3;
use palpate_laws::{Neighbour, PatchSurface};
use std::cell::Cell;

/// The motion of the nodes: δx_S and v_S (then q and q̇), and the displacements of the ring, three numbers a node.
#[derive(Clone, Copy)]
pub(crate) struct NodeMotion<'a> {
    pub(crate) z: &'a [f64],
    pub(crate) z_dot: &'a [f64],
    pub(crate) ring_dx: &'a [f64],
}

impl NodeMotion<'_> {
    /// Position of a node of S (an index below s) or of the ring (s + i), m.
    fn node_m(&self, field: &NearField, node: usize) -> DVec3 {
        match node.checked_sub(field.nodes) {
            None => field.node_m.get(node).copied().unwrap_or_default() + vec3_at(self.z, node),
            Some(i) => field.ring_m.get(i).copied().unwrap_or_default() + vec3_at(self.ring_dx, i),
        }
    }
}

/// Positions of the surface points, each computed when it is first used in a tick: few points are near the tool.
#[derive(Debug)]
pub(super) struct PointCache {
    /// The tick in which each point was last computed, and its position then, m.
    entries: Vec<(u64, DVec3)>,
    tick: u64,
}

impl PointCache {
    pub(super) fn with_capacity(points: usize) -> Self {
        Self { entries: vec![(0, DVec3::ZERO); points], tick: 1 }
    }

    /// Invalidates all positions.
    pub(super) fn invalidate(&mut self) {
        self.tick = self.tick.wrapping_add(1);
    }

    /// The surface of `field` with its nodes displaced by `motion`.
    pub(super) fn surface<'a>(
        &'a mut self,
        field: &'a NearField,
        motion: &'a NodeMotion<'a>,
    ) -> PlacedSurface<'a> {
        let entries = Cell::from_mut(&mut self.entries[..]).as_slice_of_cells();
        PlacedSurface { field, motion, entries, tick: self.tick }
    }
}

/// The surface of a near field with its points at their current positions.
#[derive(Clone, Copy)]
pub(super) struct PlacedSurface<'a> {
    pub(super) field: &'a NearField,
    pub(super) motion: &'a NodeMotion<'a>,
    /// The entries of the [`PointCache`].
    entries: &'a [Cell<(u64, DVec3)>],
    tick: u64,
}

impl PlacedSurface<'_> {
    /// Position of a point, m.
    pub(super) fn point_m(&self, point: usize) -> Option<DVec3> {
        let entry = self.entries.get(point)?;
        let (tick, x) = entry.get();
        if tick == self.tick {
            return Some(x);
        }
        let near_point = self.field.point.get(point)?;
        let carriers = near_point.nodes.iter().filter(|(_, w)| *w != 0.0);
        let x = carriers.map(|(node, w)| *w * self.motion.node_m(self.field, *node)).sum::<DVec3>()
            + near_point.fixed_m;
        entry.set((self.tick, x));
        Some(x)
    }
}

impl PatchSurface for PlacedSurface<'_> {
    fn corners_m(&self, triangle: usize) -> Option<[DVec3; 3]> {
        let [a, b, c] = self.field.triangle.get(triangle).filter(|_| triangle < self.field.triangles)?.points;
        Some([self.point_m(a)?, self.point_m(b)?, self.point_m(c)?])
    }

    fn neighbours(&self, triangle: usize) -> [Neighbour; 3] {
        self.field.triangle.get(triangle).map_or([Neighbour::default(); 3], |triangle| triangle.neighbours)
    }
}
