//! Obstacles that another solver moves.

use bevy::prelude::*;
use glam::{DQuat, DVec3};
use palpate_body::CoupledMotion;

/// A rigid body of another solver as an obstacle, with its motion during the present model step.
#[derive(Component, Debug)]
pub(crate) struct CoupledObstacle {
    pub(crate) obstacle: palpate_body::Obstacle,
    /// Greater than the versions of all obstacles before.
    pub(crate) version: u64,
    /// Pose at the beginning of the model step.
    pub(crate) start: (DVec3, DQuat),
    /// Whether it is at its start without a motion from its previous place.
    pub(crate) has_jumped: bool,
    /// Motion during the model step, without the expected impulse.
    pub(crate) motion: CoupledMotion,
    /// Impulse and angular impulse about the centre of mass that the motion contains, of each body.
    pub(crate) expected: Vec<(Entity, DVec3, DVec3)>,
}

impl CoupledObstacle {
    /// Number of bodies that share the response, with `body`.
    pub(crate) fn share_count(&self, body: Entity) -> usize {
        let others = self.expected.iter().filter(|(of, ..)| *of != body).count();
        others + 1
    }

    /// The motion as `body` meets it. Each of several bodies moves an equal part of the mass: solved alone, they would together
    /// move it too far.
    pub(crate) fn motion_for(&self, body: Entity) -> CoupledMotion {
        let expected = self.expected.iter().find(|(of, ..)| *of == body);
        let (expected_ns, expected_nms) = expected.map_or_else(Default::default, |(_, p, l)| (*p, *l));
        let response = self.motion.response * self.share_count(body) as f64;
        CoupledMotion { expected_ns, expected_nms, response, ..self.motion }
    }
}
