//! Motion of the fixed nodes with what carries them.

use super::Body;
use crate::BodyError;
use crate::obstacle::Pose;
use glam::{DQuat, DVec3};

impl Body {
    /// Moves all fixed nodes as one rigid body during the next advance, for a body that is mounted on a moving part. At
    /// the end of the advance the mount, which is at the origin at first, is at `position_m` (m) with `rotation`: a fixed
    /// node at x before any motion is then at `rotation` x + `position_m`.
    ///
    /// The position moves at constant velocity, the rotation at constant angular velocity along the shorter arc. During
    /// the advance the nodes have the velocity of the motion, and keep it until the next one, so that dampers and contacts
    /// are those of a moving mount. The free nodes follow by their springs.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the position is not finite or the rotation is not a unit quaternion within 0.001.
    pub fn move_fixed(&mut self, position_m: DVec3, rotation: DQuat) -> Result<(), BodyError> {
        let target = Pose::new(position_m, rotation)?;
        let before = self.fixed_target;
        self.fixed_target = (target != self.fixed_pose).then_some(target);
        if self.fixed_target != before {
            self.quiet_s = 0.0;
        }
        Ok(())
    }

    /// Position of the fixed nodes' mount relative to rest, m, and its rotation; see [`Body::move_fixed`].
    #[must_use]
    pub fn fixed_pose(&self) -> (DVec3, DQuat) {
        (self.fixed_pose.position_m, self.fixed_pose.rotation)
    }

    fn fixed_nodes(&self) -> impl Iterator<Item = usize> + use<> {
        let network = std::sync::Arc::clone(&self.network);
        (0..network.node_count()).filter(move |&node| network.is_fixed(node))
    }

    /// Stops the fixed nodes if they do not move in this advance.
    pub(super) fn begin_fixed_motion(&mut self) {
        if self.fixed_target.is_none() {
            self.fixed_nodes().for_each(|node| self.v[node] = DVec3::ZERO);
        }
    }

    /// Sets the velocities of the fixed nodes for the step of length `h` that ends at the fraction `along` of the advance.
    /// Returns their displacements, m.
    pub(super) fn carry_fixed(&mut self, along: f64, h: f64) -> Vec<(usize, DVec3)> {
        let Some(target) = self.fixed_target else { return Vec::new() };
        let nodes = self.fixed_nodes();
        let (pose, at) = (self.fixed_pose, self.fixed_pose.towards(&target, along));
        let carry = |node: usize| {
            let moved = at.place_m(pose.local_m(self.before.0[node])) - self.x[node];
            self.v[node] = moved / h;
            (node, moved)
        };
        nodes.map(carry).collect()
    }

    /// Adds the forces of springs and elements to the free nodes that the displacements `carried` of fixed nodes cause, to first order:
    /// an implicit step takes the forces at its end.
    pub(super) fn add_carried_tension(&mut self, carried: &[(usize, DVec3)]) {
        for &(node, moved) in carried {
            for &index in self.network.incident_links(node) {
                let link = &self.network.links()[index];
                let tangent = link.spring.tangent(self.x[link.b] - self.x[link.a], false);
                self.force[if link.a == node { link.b } else { link.a }] += tangent.stiffness * moved;
            }
            let state = (&self.x[..], &self.relaxed[..]);
            self.network.add_element_force_change(state, (node, moved), &mut self.force);
        }
    }

    /// Ends the motion of the advance.
    pub(super) fn end_fixed_motion(&mut self) {
        if let Some(target) = self.fixed_target.take() {
            self.fixed_pose = target;
        }
    }
}
