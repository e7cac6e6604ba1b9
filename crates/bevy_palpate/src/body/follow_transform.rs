//! Moves a body with the transform of its entity.

use super::construct::checked_pose;
use super::pending::BodyBuilds;
use super::shape::KinematicBody;
use super::simulated::SimulatedBody;
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::model_time::Model;
use bevy::prelude::*;
use glam::{DQuat, DVec3};
use palpate_body::Body;

/// The systems that carry kinematic bodies, before a step.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct CarryBodies;

/// Moves the fixed regions of kinematic bodies to the poses of their entities during the next step; after a jump, the whole bodies at once.
pub(super) fn carry_bodies(
    mut bodies: Query<(Entity, &mut SimulatedBody), With<KinematicBody>>,
    transforms: TransformHelper,
    time: Res<Time<Model>>,
    mut builds: ResMut<BodyBuilds>,
    mut faults: FaultWriter,
) {
    for (entity, mut simulated) in &mut bodies {
        let Ok(now) = transforms.compute_global_transform(entity) else { continue };
        if now == simulated.pose || simulated.is_unconstrained() {
            continue;
        }
        let (rotation, shift) = match motion_between(&simulated.pose, &now) {
            Ok(motion) => motion,
            Err(kind) => {
                simulated.report_pose(entity, kind, &mut faults);
                continue;
            }
        };
        simulated.reported_pose = false;
        let moved = |x: &DVec3| (rotation * *x + shift).distance(*x);
        let farthest_m = simulated.body.positions_m().iter().map(moved).fold(0.0, f64::max);
        if farthest_m > Body::MAX_CARRIED_M_PER_S * time.delta_secs_f64() {
            simulated.jump_to(now, &mut builds);
            continue;
        }
        let (position_m, turned) = simulated.body.fixed_pose();
        // Cannot fail: the pose is finite.
        let _ = simulated.body.move_fixed(rotation * position_m + shift, rotation * turned);
        simulated.pose = now;
    }
}

/// Moves the bodies whose entities have been moved. Contacts with them end, because the nodes are displaced without a motion.
pub(super) fn follow_transforms(
    mut bodies: Query<(Entity, &mut SimulatedBody, Has<KinematicBody>)>,
    transforms: TransformHelper,
    mut builds: ResMut<BodyBuilds>,
    mut faults: FaultWriter,
) {
    for (entity, mut simulated, is_kinematic) in &mut bodies {
        if is_kinematic && !simulated.is_unconstrained() {
            continue;
        }
        let Ok(now) = transforms.compute_global_transform(entity) else { continue };
        if now == simulated.pose {
            simulated.bypass_change_detection().reported_pose = false;
            continue;
        }
        match checked_pose(&now) {
            Ok(_) => {
                simulated.jump_to(now, &mut builds);
                simulated.reported_pose = false;
            }
            Err(kind) => simulated.report_pose(entity, kind, &mut faults),
        }
    }
}

/// The rigid motion x → rotation · x + shift from one pose to another; the pose that is rejected otherwise.
fn motion_between(from: &GlobalTransform, to: &GlobalTransform) -> Result<(DQuat, DVec3), HapticFaultKind> {
    let ((r0, t0), (r1, t1)) = (checked_pose(from)?, checked_pose(to)?);
    let rotation = (r1 * r0.inverse()).normalize();
    Ok((rotation, t1 - rotation * t0))
}

impl SimulatedBody {
    /// Reports a rejected pose once; the body stays where it was.
    fn report_pose(&mut self, entity: Entity, kind: HapticFaultKind, faults: &mut FaultWriter) {
        if !std::mem::replace(&mut self.reported_pose, true) {
            faults.write(entity, kind);
        }
    }

    /// Moves all nodes at once to the pose `now`, which ends the contacts of tools.
    fn jump_to(&mut self, now: GlobalTransform, builds: &mut BodyBuilds) {
        self.move_to(now);
        self.epoch = builds.next();
        self.last_move = self.epoch;
    }

    /// Moves all nodes rigidly from the previous pose of the entity to the pose `now`, with their velocities. Does nothing if the pose is
    /// rejected.
    pub(super) fn move_to(&mut self, now: GlobalTransform) {
        let Ok((rotation, shift)) = motion_between(&self.pose, &now) else { return };
        self.pose = now;
        if rotation.is_near_identity() && shift == DVec3::ZERO {
            return;
        }
        let x: Vec<DVec3> = self.body.positions_m().iter().map(|x| rotation * *x + shift).collect();
        let v: Vec<DVec3> = self.body.velocities_m_per_s().iter().map(|v| rotation * *v).collect();
        // Cannot fail: the lengths are unchanged and the values are finite.
        let _ = self.body.set_state(&x, &v);
        self.drawn.discard_step();
    }
}
