//! State of an avian rigid body between two model steps, and the account of its impulses.

use super::math::{HeldResponse, Wrench, double, double_matrix, double_rotation, single};
use avian3d::math::AdjustPrecision;
use avian3d::prelude::{
    AngularVelocity, ComputedAngularInertia, ComputedCenterOfMass, ComputedMass, LinearVelocity, LockedAxes,
    Position, Rotation,
};
use bevy::ecs::query::QueryData;
use bevy::prelude::*;
use glam::{DMat3, DQuat, DVec3};
use palpate_body::RigidResponse;

/// Pose and velocity of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State {
    /// Position of the body's frame, m.
    pub(super) position_m: DVec3,
    pub(super) rotation: DQuat,
    /// Velocity of the centre of mass, m/s, and angular velocity, rad/s.
    pub(super) velocity: Wrench,
}

impl State {
    fn of(
        position: &Position,
        rotation: &Rotation,
        linear: &LinearVelocity,
        angular: &AngularVelocity,
    ) -> Self {
        Self {
            position_m: double(position.0),
            rotation: double_rotation(rotation.0),
            velocity: Wrench::new(double(linear.0), double(angular.0)),
        }
    }

    pub(super) fn center_m(&self, local_m: DVec3) -> DVec3 {
        self.position_m + self.rotation * local_m
    }

    /// The state at the fraction `share` of a motion of `duration_s` to `end` with constant accelerations.
    pub(super) fn towards(&self, end: &Self, share: f64, duration_s: f64, local_m: DVec3) -> Self {
        if share >= 1.0 {
            return *end;
        }
        let share = share.max(0.0);
        let bend_s = 0.5 * duration_s * (share * share - share);
        let change = end.velocity - self.velocity;
        let ends = [self.center_m(local_m), end.center_m(local_m)];
        let center_m = ends[0] + (ends[1] - ends[0]) * share + bend_s * change.linear;
        let rotation = DQuat::from_scaled_axis(bend_s * change.angular)
            * self.rotation.slerp(end.rotation, share).normalize();
        Self { position_m: center_m - rotation * local_m, rotation, velocity: self.velocity + change * share }
    }

    /// Whether `end` is farther away than the velocities and a tolerance explain.
    pub(super) fn has_jumped(&self, end: &Self, duration_s: f64) -> bool {
        let way = |of: fn(&Wrench) -> DVec3| {
            (of(&self.velocity).length() + of(&end.velocity).length()) * duration_s
        };
        let moved_m = self.position_m.distance(end.position_m);
        let turned = self.rotation.angle_between(end.rotation);
        let is_far = moved_m > way(|v| v.linear) + JUMP_M;
        // A rotation above half a turn has no unique angle.
        let is_turned = turned > way(|v| v.angular) + JUMP_RAD;
        is_far || is_turned
    }
}

/// Displacement, m, and rotation, rad, in a model step that count as a jump if the velocities do not explain them.
const JUMP_M: f64 = 0.02;
const JUMP_RAD: f64 = 0.3;

/// Pose and velocity components of a rigid body.
#[derive(QueryData)]
pub(super) struct Kinematics {
    position: &'static Position,
    rotation: &'static Rotation,
    linear: &'static LinearVelocity,
    angular: &'static AngularVelocity,
}

impl KinematicsItem<'_, '_> {
    pub(super) fn state(&self) -> State {
        State::of(self.position, self.rotation, self.linear, self.angular)
    }
}

/// Pose and velocity components of a rigid body that is corrected.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct StateMut {
    position: &'static mut Position,
    rotation: &'static mut Rotation,
    linear: &'static mut LinearVelocity,
    angular: &'static mut AngularVelocity,
    transform: Option<&'static mut Transform>,
    has_parent: Has<ChildOf>,
}

impl StateMutItem<'_, '_> {
    pub(super) fn state(&self) -> State {
        State::of(&self.position, &self.rotation, &self.linear, &self.angular)
    }

    /// Moves the body. A changed position of avian overrides changes of the transform until the next tick, so a move of the body by the
    /// app would be lost: the transform is moved with it, and the position does not count as changed.
    pub(super) fn place(&mut self, position_m: DVec3) {
        match self.transform.as_mut().filter(|_| !self.has_parent) {
            Some(transform) => {
                self.position.bypass_change_detection().0 = single(position_m);
                transform.translation = position_m.as_vec3();
            }
            None => self.position.0 = single(position_m),
        }
    }

    /// Turns the body about its frame's origin.
    pub(super) fn turn(&mut self, rotation: DQuat) {
        match self.transform.as_mut().filter(|_| !self.has_parent) {
            Some(transform) => {
                self.rotation.bypass_change_detection().0 = rotation.adjust_precision();
                transform.rotation = rotation.as_quat();
            }
            None => self.rotation.0 = rotation.adjust_precision(),
        }
    }

    pub(super) fn set_velocity(&mut self, velocity: Wrench) {
        (self.linear.0, self.angular.0) = (single(velocity.linear), single(velocity.angular));
    }
}

/// Components of the mass of a rigid body.
#[derive(QueryData)]
pub(super) struct MassProperties {
    mass: &'static ComputedMass,
    inertia: &'static ComputedAngularInertia,
    center: &'static ComputedCenterOfMass,
    locked: Option<&'static LockedAxes>,
}

impl MassPropertiesItem<'_, '_> {
    /// Centre of mass in the body's frame, m.
    pub(super) fn center_m(&self) -> DVec3 {
        double(self.center.0)
    }

    /// Mass, kg; 0 if it is infinite.
    pub(super) fn mass_kg(&self) -> f64 {
        let per_kg = f64::from(self.mass.inverse());
        if per_kg > 0.0 { 1.0 / per_kg } else { 0.0 }
    }

    /// Inertia tensor about the centre of mass at a rotation, kg m²; zero if it is infinite.
    pub(super) fn tensor_kg_m2(&self, rotation: DQuat) -> DMat3 {
        let r = DMat3::from_quat(rotation);
        let inverse = double_matrix(self.inertia.inverse());
        if inverse.determinant() > 0.0 { r * inverse.inverse() * r.transpose() } else { DMat3::ZERO }
    }

    pub(super) fn has_locked_axes(&self) -> bool {
        self.locked.is_some_and(|locked| locked.to_bits() != 0)
    }

    /// Response with the locked axes, as avian has it.
    pub(super) fn response(&self, rotation: DQuat) -> RigidResponse {
        let r = DMat3::from_quat(rotation);
        let locked = self.locked.copied().unwrap_or_default();
        let per_kg = f64::from(self.mass.inverse());
        let mut linear = DMat3::from_diagonal(DVec3::splat(per_kg));
        let mut angular = r * double_matrix(self.inertia.inverse()) * r.transpose();
        let is_locked = [
            (locked.is_translation_x_locked(), locked.is_rotation_x_locked()),
            (locked.is_translation_y_locked(), locked.is_rotation_y_locked()),
            (locked.is_translation_z_locked(), locked.is_rotation_z_locked()),
        ];
        for (axis, (translation, rotation)) in is_locked.into_iter().enumerate() {
            if translation {
                linear.col_mut(axis)[axis] = 0.0;
            }
            if rotation {
                *angular.col_mut(axis) = DVec3::ZERO;
                (0..3).for_each(|of| angular.col_mut(of)[axis] = 0.0);
            }
        }
        RigidResponse { linear, coupling: DMat3::ZERO, angular }
    }
}

/// Force of a soft body on a rigid body.
#[derive(Clone, Debug)]
pub(super) struct Share {
    pub(super) body: Entity,
    /// Force, N, and torque about the centre of mass, N m, that avian applies until the next model step.
    pub(super) force: Wrench,
    /// Impulse that avian has applied since the last model step, up to the present tick, N s.
    pub(super) applied: Wrench,
}

/// A tick of avian.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tick {
    pub(super) before: State,
    pub(super) after: State,
    /// Duration in avian's time and in that of the fixed main loop, s.
    pub(super) duration_s: f64,
    pub(super) fixed_s: f64,
    /// Impulse, and angular impulse about the origin, that avian applied.
    pub(super) applied: Wrench,
}

/// Account between an avian rigid body and the soft bodies that touch it.
///
/// Between model steps avian applies a constant force, the last reaction. At a model step the reaction of that interval is known,
/// and the difference corrects avian's velocity. All impulses of the soft bodies reach avian's body, and no others.
#[derive(Component, Clone, Debug, Default)]
pub(super) struct Coupling {
    /// State at the time of the last model step, or before the first tick.
    pub(super) start: Option<State>,
    /// Whether the last model step has placed the obstacle.
    pub(super) is_placed: bool,
    pub(super) tick: Option<Tick>,
    /// Time of avian since the last model step up to the present tick, s.
    pub(super) elapsed_s: f64,
    pub(super) shares: Vec<Share>,
    /// Force, N, and torque about the centre of mass, N m, that avian applies until the next model step.
    pub(super) force: Wrench,
    /// Impulse, and angular impulse about the origin, that avian has applied since the last model step up to the present tick.
    pub(super) applied: Wrench,
    /// Impulse, and angular impulse about the origin, that the soft bodies have given and avian has not applied, at the time of the
    /// last model step.
    pub(super) due: Wrench,
    /// Of the present model step.
    pub(super) step: Option<Step>,
}

/// The present model step of a coupling.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub(super) held: HeldResponse,
    /// Time of avian in the step, s.
    pub(super) elapsed_s: f64,
    /// State of avian's body at the end of the step.
    pub(super) end: State,
    /// Part of avian's present tick after the end of the step: in avian's time and in that of the fixed main loop, s.
    pub(super) ahead_s: f64,
    pub(super) fixed_ahead_s: f64,
    /// Impulse, and angular impulse about the origin, that avian applied in the step, and in the rest of its tick.
    pub(super) applied: Wrench,
    pub(super) applied_ahead: Wrench,
    /// Whether avian's body does not respond: it sleeps, is kinematic, or avian is paused.
    pub(super) is_frozen: bool,
    /// Whether the obstacle was placed without a motion.
    pub(super) has_jumped: bool,
}
