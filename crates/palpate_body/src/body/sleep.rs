//! Advances of a body at rest, which cost nothing.

use super::{Body, QUIET_M_PER_S, StepReport};
use crate::{ObstacleReaction, Tie};
use glam::DVec3;

impl Body {
    /// Whether an advance without tools changes nothing.
    pub(super) fn may_sleep(&self) -> bool {
        self.is_settled()
            && self.fixed_target.is_none()
            && !self.ties.iter().any(Tie::is_moving)
            && !self.has_moving_obstacle(QUIET_M_PER_S)
    }

    /// Advances by `ticks` ticks of together `duration_s` without a motion. Velocities become zero; obstacles bear the
    /// forces of the last step.
    pub(super) fn sleep(&mut self, ticks: usize, duration_s: f64) -> StepReport {
        self.v.fill(DVec3::ZERO);
        let reaction = ObstacleReaction { duration_s, ..ObstacleReaction::default() };
        self.reactions = vec![reaction; self.obstacles.len()];
        for contact in self.contacts.iter().filter(|contact| contact.step_s > 0.0) {
            let impulse_ns = -contact.impulse_ns * (duration_s / contact.step_s);
            let at_m = self.obstacle_points.points[contact.point].of(&self.x);
            let arm_m = at_m - self.obstacles[contact.obstacle].position_m();
            let reaction = &mut self.reactions[contact.obstacle];
            reaction.impulse_ns += impulse_ns;
            reaction.angular_impulse_nms += arm_m.cross(impulse_ns);
        }
        for (obstacle, reaction) in self.obstacles.iter_mut().zip(&mut self.reactions) {
            let Some((mass, motion)) = &mut obstacle.rigid else { continue };
            motion.velocity_m_per_s = DVec3::ZERO;
            motion.angular_velocity_rad_per_s = DVec3::ZERO;
            let rotation = obstacle.pose.rotation;
            let about_center =
                reaction.angular_impulse_nms - (rotation * mass.center_m()).cross(reaction.impulse_ns);
            reaction.velocity_change_m_per_s = reaction.impulse_ns / mass.mass_kg();
            reaction.angular_velocity_change_rad_per_s = mass.turned(rotation).1 * about_center;
        }
        StepReport { ticks, is_asleep: true, contacts: self.contacts.len(), ..StepReport::default() }
    }
}
