//! Constraint rows of obstacles.

use super::Body;
use super::constraint::{Constraint, ConstraintSource, is_prescribed};
use super::substep::Substep;
use crate::impulse_response::RigidPoint;
use glam::DVec3;
use palpate_laws::{ConstraintLaw, MAX_CORRECTION_SPEED_M_PER_S};

/// A pair of a point and an obstacle in a substep.
pub(super) struct NearPoint {
    point: usize,
    obstacle: usize,
    /// Position of the point without the motion of responding nodes in this step, m, and its given displacement.
    at_m: DVec3,
    given_m: DVec3,
    /// Gap to the obstacle at the beginning of the step, and to the obstacle at the end of the step, m.
    before_m: f64,
    gap_m: f64,
    normal: DVec3,
    rigid: Option<RigidPoint>,
    is_active: bool,
}

impl Body {
    /// Adds a row for every point that would be inside an obstacle at the end of the step.
    pub(super) fn activate_obstacle_contacts(
        &mut self,
        step: &Substep<'_>,
        near: &mut Vec<NearPoint>,
        rows: &mut Vec<Constraint>,
    ) {
        if self.obstacles.is_empty() {
            return;
        }
        let v = std::mem::take(&mut self.v);
        let searched = self.update_candidates(step, &v);
        self.v = v;
        if searched || near.len() != self.candidates.pairs.len() {
            *near = self.near_points(step, near);
        }
        let h = step.h;
        for of in near.iter_mut().filter(|of| !of.is_active) {
            let nodes = self.obstacle_points.points[of.point].nodes();
            let own: DVec3 = nodes
                .iter()
                .filter(|(node, _)| !is_prescribed(&self.network, step.drive, *node))
                .map(|&(node, w)| w * self.v[node])
                .sum();
            let velocity = of.rigid.map_or(own, |rigid| own - rigid.velocity_m_per_s(&step.obstacles));
            if of.gap_m + h * velocity.dot(of.normal) >= 0.0 {
                continue;
            }
            let motion = &step.obstacles[of.obstacle];
            let law = self.obstacles[of.obstacle].law(&motion.to, of.at_m, of.normal);
            let Some(law) = law else { continue };
            of.is_active = true;
            // The part that existed before the step is closed slowly; the obstacle's own motion is followed.
            let initial_violation_m = of.before_m.max(-h * MAX_CORRECTION_SPEED_M_PER_S);
            let moved = motion.from.displacement_m(&motion.to, of.at_m);
            let slid = moved - of.given_m;
            let across = slid - slid.dot(of.normal) * of.normal;
            let gap_m = initial_violation_m - (of.before_m - of.gap_m);
            rows.push(Constraint {
                source: ConstraintSource::Obstacle {
                    point: of.point,
                    obstacle: of.obstacle,
                    apart_m: of.gap_m,
                    normal: of.normal,
                    at_m: of.at_m,
                },
                nodes: nodes.to_vec(),
                rigid: of.rigid,
                law: ConstraintLaw::Unilateral { coulomb: law, series: None },
                gap: gap_m * of.normal - across,
                initial_violation: initial_violation_m.min(0.0) * of.normal,
            });
        }
    }

    /// The candidates with their gaps; those of `known` that are active stay active.
    fn near_points(&self, step: &Substep<'_>, known: &[NearPoint]) -> Vec<NearPoint> {
        let pair = |&(point, obstacle): &(usize, usize)| {
            let (what, motion) = (&self.obstacles[obstacle], &step.obstacles[obstacle]);
            let at_m = self.obstacle_points.points[point].of(&self.x);
            let (gap_m, normal) = what.gap_at(&motion.to, at_m, f64::INFINITY)?;
            let given_m = step.given_m(self.obstacle_points.points[point].nodes());
            let before_m = if motion.from == motion.to && given_m == DVec3::ZERO {
                gap_m
            } else {
                what.gap_at(&motion.from, at_m - given_m, f64::INFINITY)?.0
            };
            let rigid =
                motion.rigid.as_ref().map(|rigid| RigidPoint { obstacle, arm_m: at_m - rigid.center_m });
            let same = |of: &&NearPoint| (of.point, of.obstacle) == (point, obstacle);
            let is_active = known.iter().find(same).is_some_and(|of| of.is_active);
            Some(NearPoint { point, obstacle, at_m, given_m, before_m, gap_m, normal, rigid, is_active })
        };
        self.candidates.pairs.iter().filter_map(pair).collect()
    }
}
