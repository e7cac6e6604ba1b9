//! Motion of an obstacle in a substep.

use crate::obstacle::Pose;
use crate::{Obstacle, ObstacleReaction, RigidMass, RigidMotion};
use glam::{DMat3, DQuat, DVec3};

/// Motion of an obstacle in a substep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObstacleStep {
    /// Pose at the beginning of the step, and at the end of it for a moved obstacle.
    pub(crate) from: Pose,
    pub(crate) to: Pose,
    pub(crate) rigid: Option<RigidStep>,
}

/// A rigid body in a substep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RigidStep {
    mass: RigidMass,
    acceleration_m_per_s2: DVec3,
    /// Centre of mass at the beginning of the step, m.
    pub(crate) center_m: DVec3,
    pub(crate) per_kg: f64,
    /// Inertia tensor at the beginning of the step, kg m², and its inverse.
    inertia_kg_m2: DMat3,
    pub(crate) inverse: DMat3,
    /// Velocity at the beginning of the step.
    before: RigidVelocity,
    /// Velocity with the impulses applied so far.
    pub(crate) velocity: RigidVelocity,
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
            }
            None => self.from.max_displacement_m(&self.to, center_m, radius_m),
        }
    }

    /// Mean velocity in the step of the obstacle's material point at `at_m`, and its velocity at the end of the step,
    /// m/s.
    pub(crate) fn velocities_m_per_s(&self, at_m: DVec3, h: f64) -> (DVec3, DVec3) {
        match &self.rigid {
            Some(rigid) => {
                let arm_m = at_m - rigid.center_m;
                let end = rigid.velocity.at(arm_m);
                (0.5 * (rigid.before.at(arm_m) + end), end)
            }
            None => {
                let mean = self.from.displacement_m(&self.to, at_m) / h;
                (mean, mean)
            }
        }
    }
}

impl RigidStep {
    fn new(obstacle: &Obstacle, mass: RigidMass, motion: &RigidMotion, h: f64) -> Self {
        let (inertia_kg_m2, inverse) = mass.turned(obstacle.pose.rotation);
        let before =
            RigidVelocity { linear: motion.velocity_m_per_s, angular: motion.angular_velocity_rad_per_s };
        Self {
            mass,
            acceleration_m_per_s2: motion.acceleration_m_per_s2,
            center_m: obstacle.pose.place_m(mass.center_m()),
            per_kg: 1.0 / mass.mass_kg(),
            inertia_kg_m2,
            inverse,
            before,
            velocity: RigidVelocity { linear: before.linear + h * motion.acceleration_m_per_s2, ..before },
        }
    }

    /// Changes of the velocity by the impulse `impulse_ns` at the arm `arm_m`.
    pub(crate) fn change(&self, arm_m: DVec3, impulse_ns: DVec3) -> RigidVelocity {
        RigidVelocity { linear: self.per_kg * impulse_ns, angular: self.inverse * arm_m.cross(impulse_ns) }
    }

    /// Pose and motion after the step of length `h`, in which the body moves with `closing`.
    ///
    /// The angular momentum stays the same while the inertia tensor turns, so the rotation is stable at any step: its
    /// energy is bounded by the least and the greatest moment of inertia. The angular velocity of the step is that at
    /// half of the rotation, which is exact to second order.
    pub(crate) fn end(&self, rotation: DQuat, closing: RigidVelocity, h: f64) -> (Pose, RigidMotion) {
        let center_m = self.center_m + h * closing.linear;
        let mut motion = RigidMotion {
            velocity_m_per_s: self.velocity.linear,
            angular_velocity_rad_per_s: self.velocity.angular,
            acceleration_m_per_s2: self.acceleration_m_per_s2,
        };
        let mut turned = rotation;
        if closing.angular != DVec3::ZERO {
            let half = DQuat::from_scaled_axis(0.5 * h * closing.angular) * rotation;
            let middle = self.mass.turned(half).1 * (self.inertia_kg_m2 * closing.angular);
            turned = (DQuat::from_scaled_axis(h * middle) * rotation).normalize();
            motion.angular_velocity_rad_per_s =
                self.mass.turned(turned).1 * (self.inertia_kg_m2 * self.velocity.angular);
        }
        (Pose { position_m: center_m - turned * self.mass.center_m(), rotation: turned }, motion)
    }
}

impl ObstacleReaction {
    /// Adds the impulse `impulse_ns` on the obstacle at `at_m` in a step.
    pub(crate) fn add(&mut self, step: &ObstacleStep, at_m: DVec3, impulse_ns: DVec3) {
        self.impulse_ns += impulse_ns;
        self.angular_impulse_nms += (at_m - step.from.position_m).cross(impulse_ns);
        if let Some(rigid) = &step.rigid {
            let change = rigid.change(at_m - rigid.center_m, impulse_ns);
            self.velocity_change_m_per_s += change.linear;
            self.angular_velocity_change_rad_per_s += change.angular;
        }
    }
}
