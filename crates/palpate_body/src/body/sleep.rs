//! Advances of a body at rest without a tool near it, which cost nothing.

use super::shared_tool::SharedTool;
use super::{Body, QUIET_M_PER_S, StepReport};
use crate::{ObstacleReaction, Tie};
use glam::DVec3;

impl Body {
    /// Whether an advance of this body, the one at `index`, with `tools` changes nothing.
    pub(super) fn may_sleep(&self, index: usize, tools: &[SharedTool<'_>]) -> bool {
        self.is_settled()
            && self.fixed_target.is_none()
            && tools.iter().all(|tool| self.is_out_of_reach(index, tool))
            && !self.ties.iter().any(Tie::is_moving)
            && !self.has_moving_obstacle(QUIET_M_PER_S)
    }

    /// Whether a tool neither acts on the body nor comes near its surface.
    fn is_out_of_reach(&self, index: usize, tool: &SharedTool<'_>) -> bool {
        let Some(contact) = tool.contact(index) else { return true };
        let Some((shape, _)) = contact.shape().filter(|_| !tool.acts_on(index)) else { return false };
        let steps = tool.path.windows(2).map(|pair| pair[0].position_m.distance(pair[1].position_m));
        // As far as contact is searched, and once more.
        let reach_m = 3.0 * (shape.radius_m() + steps.fold(0.0, f64::max));
        let bounds = |places: &mut dyn Iterator<Item = DVec3>| {
            places.map(|x| (x, x)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
        };
        // Another body may hold the proxy back.
        let path = bounds(&mut tool.path.iter().map(|point| point.position_m).chain(tool.proxy_m()));
        let surface = bounds(&mut self.surface.points.iter().map(|point| point.of(&self.x)));
        let (Some(path), Some(surface)) = (path, surface) else { return tool.path.is_empty() };
        !((path.0 - reach_m).cmple(surface.1).all() && (path.1 + reach_m).cmpge(surface.0).all())
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
            reaction.moment_nms += at_m.cross(impulse_ns);
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
