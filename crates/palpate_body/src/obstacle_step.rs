//! Motion of an obstacle in a substep.

use crate::obstacle::Coupled;
use crate::obstacle::Pose;
use crate::{Obstacle, ObstacleReaction, RigidMass, RigidMotion, RigidResponse};
use glam::{DMat3, DQuat, DVec3};

/// Motion of an obstacle in a substep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObstacleStep {
    /// Pose at the beginning of the step, and at the end of it for a moved or coupled obstacle without the impulses of the
    /// advance so far unequal to the expected ones.
    pub(crate) from: Pose,
    pub(crate) to: Pose,
    pub(crate) rigid: Option<RigidStep>,
}

/// A rigid body in a substep. Of a coupled one the velocity is that of its deviation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RigidStep {
    /// Centre of mass at the beginning of the step, m.
    pub(crate) center_m: DVec3,
    pub(crate) response: RigidResponse,
    /// Velocity at the beginning of the step.
    before: RigidVelocity,
    /// Velocity with the impulses applied so far.
    pub(crate) velocity: RigidVelocity,
    /// If it moves freely.
    free: Option<FreeRigid>,
}

/// What a free rigid body needs beside its response.
#[derive(Clone, Copy, Debug)]
struct FreeRigid {
    mass: RigidMass,
    acceleration_m_per_s2: DVec3,
    /// Inertia tensor at the beginning of the step, kg m².
    inertia_kg_m2: DMat3,
}

/// Velocity of the centre of mass, m/s, and angular velocity, rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RigidVelocity {
    pub(crate) linear: DVec3,
    pub(crate) angular: DVec3,
}

impl RigidVelocity {
    /// Velocity of the point at `arm_m` from the centre of mass, m/s.
    pub(crate) fn at(&self, arm_m: DVec3) -> DVec3 {
        self.linear + self.angular.cross(arm_m)
    }
}

impl ObstacleStep {
    /// Motion of `obstacle` in the step of length `h` between the fractions `along` of the advance.
    pub(crate) fn new(obstacle: &Obstacle, along: (f64, f64), h: f64) -> Self {
        if let Some(coupled) = &obstacle.coupled {
            let end = obstacle.target.as_ref().unwrap_or(&obstacle.pose);
            let (from, center_m) = coupled.pose(&obstacle.pose, end, along.0);
            let (to, _) = coupled.pose(&obstacle.pose, end, along.1);
            let rigid = RigidStep::coupled(coupled, center_m, along.1 - along.0);
            return Self { from, to, rigid: Some(rigid) };
        }
        let (from, to) = match &obstacle.target {
            Some(target) => (obstacle.pose.towards(target, along.0), obstacle.pose.towards(target, along.1)),
            None => (obstacle.pose, obstacle.pose),
        };
        let rigid = obstacle.rigid.map(|(mass, motion)| RigidStep::new(obstacle, mass, &motion, h));
        Self { from, to, rigid }
    }

    /// Upper bound of the displacement of points of the obstacle within `radius_m` of `center_m`, m.
    pub(crate) fn max_displacement_m(&self, center_m: DVec3, radius_m: f64, h: f64) -> f64 {
        match &self.rigid {
            Some(rigid) => {
                let arm_m = (center_m - rigid.center_m).length() + radius_m;
                h * (rigid.velocity.linear.length() + rigid.velocity.angular.length() * arm_m)
                    + self.from.max_displacement_m(&self.to, center_m, radius_m)
            }
            None => self.from.max_displacement_m(&self.to, center_m, radius_m),
        }
    }

    /// Mean velocity in the step of the obstacle's material point at `at_m`, and its velocity at the end of the step,
    /// m/s.
    pub(crate) fn velocities_m_per_s(&self, at_m: DVec3, h: f64) -> (DVec3, DVec3) {
        let carried = match &self.rigid {
            Some(RigidStep { free: Some(_), .. }) => DVec3::ZERO,
            _ => self.from.displacement_m(&self.to, at_m) / h,
        };
        self.rigid.as_ref().map_or((carried, carried), |rigid| {
            let arm_m = at_m - rigid.center_m;
            let end = rigid.velocity.at(arm_m);
            (carried + 0.5 * (rigid.before.at(arm_m) + end), carried + end)
        })
    }
}

impl RigidStep {
    fn new(obstacle: &Obstacle, mass: RigidMass, motion: &RigidMotion, h: f64) -> Self {
        let (inertia_kg_m2, angular) = mass.turned(obstacle.pose.rotation);
        let acceleration_m_per_s2 = motion.acceleration_m_per_s2;
        let before =
            RigidVelocity { linear: motion.velocity_m_per_s, angular: motion.angular_velocity_rad_per_s };
        Self {
            center_m: obstacle.pose.place_m(mass.center_m()),
            response: RigidResponse {
                linear: DMat3::from_diagonal(DVec3::splat(1.0 / mass.mass_kg())),
                coupling: DMat3::ZERO,
                angular,
            },
            before,
            velocity: RigidVelocity { linear: before.linear + h * acceleration_m_per_s2, ..before },
            free: Some(FreeRigid { mass, acceleration_m_per_s2, inertia_kg_m2 }),
        }
    }

    /// The deviation of `coupled` in a step that is the fraction `share` of its advance. The expected impulse is part of its
    /// path.
    fn coupled(coupled: &Coupled, center_m: DVec3, share: f64) -> Self {
        let Coupled { motion, velocity_m_per_s: linear, angular_velocity_rad_per_s: angular, .. } = *coupled;
        let before = RigidVelocity { linear, angular };
        let expected = motion.response.change(motion.expected_ns * share, motion.expected_nms * share);
        let velocity = RigidVelocity { linear: linear - expected.0, angular: angular - expected.1 };
        Self { center_m, response: motion.response, before, velocity, free: None }
    }

    /// Changes of the velocity by the impulse `impulse_ns` at the arm `arm_m`.
    pub(crate) fn change(&self, arm_m: DVec3, impulse_ns: DVec3) -> RigidVelocity {
        let (linear, angular) = self.response.change(impulse_ns, arm_m.cross(impulse_ns));
        RigidVelocity { linear, angular }
    }

    /// Pose and motion of a free body after the step of length `h`, in which it moves with `closing`; `None` for a coupled one.
    ///
    /// The angular momentum stays the same while the inertia tensor turns, so the rotation is stable at any step: its
    /// energy is bounded by the least and the greatest moment of inertia. The angular velocity of the step is that at
    /// half of the rotation, which is exact to second order.
    pub(crate) fn end(&self, rotation: DQuat, closing: RigidVelocity, h: f64) -> Option<(Pose, RigidMotion)> {
        let FreeRigid { mass, acceleration_m_per_s2, inertia_kg_m2 } = self.free?;
        let center_m = self.center_m + h * closing.linear;
        let mut motion = RigidMotion {
            velocity_m_per_s: self.velocity.linear,
            angular_velocity_rad_per_s: self.velocity.angular,
            acceleration_m_per_s2,
        };
        let mut turned = rotation;
        if closing.angular != DVec3::ZERO {
            let half = DQuat::from_scaled_axis(0.5 * h * closing.angular) * rotation;
            let middle = mass.turned(half).1 * (inertia_kg_m2 * closing.angular);
            turned = (DQuat::from_scaled_axis(h * middle) * rotation).normalize();
            motion.angular_velocity_rad_per_s =
                mass.turned(turned).1 * (inertia_kg_m2 * self.velocity.angular);
        }
        Some((Pose { position_m: center_m - turned * mass.center_m(), rotation: turned }, motion))
    }

    /// Moves the deviation of a coupled body by a step of length `h` with the velocity `closing`.
    pub(crate) fn end_coupled(&self, coupled: &mut Coupled, closing: RigidVelocity, h: f64) {
        coupled.displacement_m += h * closing.linear;
        if closing.angular != DVec3::ZERO {
            coupled.turn = (DQuat::from_scaled_axis(h * closing.angular) * coupled.turn).normalize();
        }
        coupled.velocity_m_per_s = self.velocity.linear;
        coupled.angular_velocity_rad_per_s = self.velocity.angular;
    }
}

impl ObstacleReaction {
    /// Adds the impulse `impulse_ns` on the obstacle at `at_m` in a step.
    pub(crate) fn add(&mut self, step: &ObstacleStep, at_m: DVec3, impulse_ns: DVec3) {
        self.impulse_ns += impulse_ns;
        self.angular_impulse_nms += (at_m - step.from.position_m).cross(impulse_ns);
        self.moment_nms += at_m.cross(impulse_ns);
        if let Some(rigid) = &step.rigid {
            let change = rigid.change(at_m - rigid.center_m, impulse_ns);
            self.velocity_change_m_per_s += change.linear;
            self.angular_velocity_change_rad_per_s += change.angular;
        }
    }
}
