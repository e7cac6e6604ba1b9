//! Moves a body with the transform of its entity.

use super::construct::checked_pose;
use super::pending::BodyBuilds;
use super::simulated::SimulatedBody;
use crate::fault::FaultWriter;
use bevy::prelude::*;
use glam::{DQuat, DVec3};

/// Moves the bodies whose entities have been moved. Contacts with them end, because the nodes are displaced without a motion.
pub(super) fn follow_transforms(
    mut bodies: Query<(Entity, &mut SimulatedBody)>,
    transforms: TransformHelper,
    mut builds: ResMut<BodyBuilds>,
    mut faults: FaultWriter,
) {
    for (entity, mut simulated) in &mut bodies {
        let Ok(now) = transforms.compute_global_transform(entity) else { continue };
        if now == simulated.pose {
            simulated.bypass_change_detection().reported_pose = false;
            continue;
        }
        match checked_pose(&now) {
            Ok(_) => {
                simulated.move_to(now);
                simulated.reported_pose = false;
                simulated.epoch = builds.next();
                simulated.last_move = simulated.epoch;
            }
            Err(kind) => {
                // Reported once; the body stays where it was.
                if !std::mem::replace(&mut simulated.reported_pose, true) {
                    faults.write(entity, kind);
                }
            }
        }
    }
}

impl SimulatedBody {
    /// Moves all nodes rigidly from the previous pose of the entity to the pose `now`, with their velocities. Does nothing if the pose is
    /// rejected.
    pub(super) fn move_to(&mut self, now: GlobalTransform) {
        let (Ok((r0, t0)), Ok((r1, t1))) = (checked_pose(&self.pose), checked_pose(&now)) else { return };
        self.pose = now;
        let rotation: DQuat = (r1 * r0.inverse()).normalize();
        let shift: DVec3 = t1 - rotation * t0;
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
