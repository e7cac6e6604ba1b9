//! Obstacles of a body: their motion and the reaction on them.

use super::Body;
use crate::error::check;
use crate::obstacle::{Coupled, Pose};
use crate::obstacle_step::ObstacleStep;
use crate::{BodyError, BodyPoint, CoupledMotion, Obstacle, ObstacleContact, ObstacleReaction, RigidMotion};
use glam::{DQuat, DVec3};

impl Body {
    /// Maximum speed of moved obstacles and fixed nodes, m/s. A faster motion counts as a jump.
    pub const MAX_CARRIED_M_PER_S: f64 = 25.0;

    /// Obstacles of the body.
    #[must_use]
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// Sets the obstacles. A point inside an obstacle is pushed out at 1 m/s. Setting equal obstacles changes nothing.
    pub fn set_obstacles(&mut self, obstacles: Vec<Obstacle>) {
        if self.obstacles == obstacles {
            return;
        }
        self.reactions = vec![ObstacleReaction::default(); obstacles.len()];
        self.obstacles = obstacles;
        self.contacts.clear();
        self.quiet_s = 0.0;
    }

    /// Moves the obstacle at `index` during the next advance: it reaches `position_m` (m) and `rotation` at its end.
    /// The position moves at constant velocity, the rotation at constant angular velocity along the shorter arc.
    ///
    /// An obstacle that would move faster than 25 m/s where the body is has jumped: it is at its target during the
    /// whole advance, and pushes out what it covers at 1 m/s.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if there is no such obstacle, it has a mass, the position is not finite or the rotation
    /// is not a unit quaternion within 0.001. The obstacle is then unchanged.
    pub fn move_obstacle(
        &mut self,
        index: usize,
        position_m: DVec3,
        rotation: DQuat,
    ) -> Result<(), BodyError> {
        let target = Pose::new(position_m, rotation)?;
        let obstacle = self.obstacle_mut(index)?;
        obstacle.check_massless()?;
        let before = obstacle.target;
        obstacle.coupled = None;
        obstacle.target = (target != obstacle.pose).then_some(target);
        if obstacle.target != before {
            self.quiet_s = 0.0;
        }
        Ok(())
    }

    /// Places the obstacle at `index` at `position_m` (m) with `rotation`, without a motion. Points that it covers are
    /// pushed out at 1 m/s.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if there is no such obstacle, the position is not finite or the rotation is not a unit
    /// quaternion within 0.001. The obstacle is then unchanged.
    pub fn place_obstacle(
        &mut self,
        index: usize,
        position_m: DVec3,
        rotation: DQuat,
    ) -> Result<(), BodyError> {
        let pose = Pose::new(position_m, rotation)?;
        let obstacle = self.obstacle_mut(index)?;
        obstacle.coupled = None;
        if (obstacle.pose, obstacle.target) != (pose, None) {
            (obstacle.pose, obstacle.target) = (pose, None);
            self.quiet_s = 0.0;
        }
        Ok(())
    }

    /// Moves the obstacle at `index` during the next advance as another solver has moved a rigid body, and lets it respond to
    /// the impulses of this body. The reaction ([`Body::obstacle_reactions`]) has the impulse and the deviation from the given
    /// motion, by which the other solver corrects its own. A jump is treated as in [`Body::move_obstacle`].
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if there is no such obstacle, it has a mass, a value is not finite or the rotation is not a
    /// unit quaternion within 0.001. The obstacle is then unchanged.
    pub fn couple_obstacle(&mut self, index: usize, motion: CoupledMotion) -> Result<(), BodyError> {
        motion.validate()?;
        let (target, coupled) = (Pose::new(motion.position_m, motion.rotation)?, Coupled::new(motion));
        let obstacle = self.obstacle_mut(index)?;
        obstacle.check_massless()?;
        (obstacle.target, obstacle.coupled) = (Some(target), Some(coupled));
        Ok(())
    }

    /// Sets the motion of the obstacle at `index`, which must have a mass.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if there is no such obstacle, it has no mass or the motion is not finite. The obstacle
    /// is then unchanged.
    pub fn set_rigid_motion(&mut self, index: usize, motion: RigidMotion) -> Result<(), BodyError> {
        motion.validate()?;
        let Some((_, of)) = &mut self.obstacle_mut(index)?.rigid else {
            return Err(BodyError::Parameter {
                what: "mass of an obstacle, kg",
                value: 0.0,
                allowed: "above 0",
            });
        };
        if *of != motion {
            *of = motion;
            self.quiet_s = 0.0;
        }
        Ok(())
    }

    fn obstacle_mut(&mut self, index: usize) -> Result<&mut Obstacle, BodyError> {
        self.obstacles.get_mut(index).ok_or(BodyError::Parameter {
            what: "index of an obstacle",
            value: index as f64,
            allowed: "that of one of the body's obstacles",
        })
    }

    /// Points of the body that touch obstacles: points of its surface, at most one in a cell, or all nodes if it has no
    /// surface.
    #[must_use]
    pub fn obstacle_points(&self) -> &[BodyPoint] {
        &self.obstacle_points.points
    }

    /// Contacts with obstacles that gave an impulse in the last step.
    #[must_use]
    pub fn contacts(&self) -> &[ObstacleContact] {
        &self.contacts
    }

    /// Reaction on each obstacle in the last advance.
    #[must_use]
    pub fn obstacle_reactions(&self) -> &[ObstacleReaction] {
        &self.reactions
    }

    /// Sets the duration of the next advance for coupled obstacles, s.
    pub(super) fn set_coupling_duration(&mut self, duration_s: f64) {
        let coupled = self.obstacles.iter_mut().filter_map(|obstacle| obstacle.coupled.as_mut());
        coupled.for_each(|coupled| coupled.duration_s = duration_s);
    }

    /// Prepares the obstacles for an advance of `duration_s`.
    pub(super) fn begin_obstacles(&mut self, duration_s: f64) {
        self.candidates.forget();
        let reaction = ObstacleReaction { duration_s, ..ObstacleReaction::default() };
        self.reactions = vec![reaction; self.obstacles.len()];
        let middle = self.x.iter().sum::<DVec3>() / self.x.len() as f64;
        for obstacle in &mut self.obstacles {
            let Some(target) = obstacle.target else { continue };
            let radius_m = self.x.iter().map(|x| x.distance(middle)).fold(0.0, f64::max);
            let moved_m = obstacle.pose.max_displacement_m(&target, middle, radius_m);
            if moved_m > Self::MAX_CARRIED_M_PER_S * duration_s {
                obstacle.pose = target;
                if let Some(coupled) = &mut obstacle.coupled {
                    coupled.motion.velocity_change_m_per_s = DVec3::ZERO;
                    coupled.motion.angular_velocity_change_rad_per_s = DVec3::ZERO;
                }
            }
        }
    }

    /// Moves the rigid bodies among the obstacles to the end of the step, with their velocities for the position update.
    pub(super) fn end_obstacle_step(
        &mut self,
        step: &[ObstacleStep],
        closing: Option<&[Option<crate::obstacle_step::RigidVelocity>]>,
        h: f64,
    ) {
        for (index, (obstacle, of)) in self.obstacles.iter_mut().zip(step).enumerate() {
            let Some(rigid) = &of.rigid else { continue };
            let closing = closing.and_then(|closing| closing[index]).unwrap_or(rigid.velocity);
            if let Some(coupled) = &mut obstacle.coupled {
                rigid.end_coupled(coupled, closing, h);
            }
            if let (Some((_, motion)), Some(end)) =
                (&mut obstacle.rigid, rigid.end(obstacle.pose.rotation, closing, h))
            {
                (obstacle.pose, *motion) = end;
            }
        }
        self.candidates.end_step();
    }

    /// Ends the motions of the advance.
    pub(super) fn end_obstacles(&mut self) {
        for (obstacle, reaction) in self.obstacles.iter_mut().zip(&mut self.reactions) {
            let Some(target) = obstacle.target.take() else { continue };
            let end = obstacle.coupled.take().map(|coupled| {
                reaction.displacement_m = coupled.displacement_m;
                reaction.turn_rad = coupled.turn.to_scaled_axis();
                coupled.pose(&target, &target, 1.0).0
            });
            obstacle.pose = end.unwrap_or(target);
        }
    }

    /// Whether an obstacle moves: it is moved, or it is a rigid body faster than `below_m_per_s`.
    pub(super) fn has_moving_obstacle(&self, below_m_per_s: f64) -> bool {
        self.obstacles.iter().any(|obstacle| {
            let is_moved = obstacle.target.is_some() && obstacle.coupled.is_none();
            is_moved || obstacle.speed_m_per_s() > below_m_per_s
        })
    }
}

/// Rejects a pose that is not finite.
pub(super) fn check_finite(obstacles: &[Obstacle]) -> Result<(), BodyError> {
    let what = "position or velocity of a rigid obstacle";
    for obstacle in obstacles {
        let at = obstacle.position_m();
        check(what, at.abs().max_element(), at.is_finite() && obstacle.rotation().is_finite(), "finite")?;
        if let Some(of) = &obstacle.coupled {
            let is_finite = of.displacement_m.is_finite()
                && of.velocity_m_per_s.is_finite()
                && of.angular_velocity_rad_per_s.is_finite()
                && of.turn.is_finite();
            check(what, of.displacement_m.abs().max_element(), is_finite, "finite")?;
        }
        let Some(motion) = obstacle.rigid_motion() else { continue };
        motion.validate()?;
    }
    Ok(())
}
