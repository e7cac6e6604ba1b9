//! A body goes where the transform of its entity goes.

use super::construct::checked_pose;
use super::pending::BodyBuilds;
use super::simulated::SimulatedBody;
use crate::fault::HapticFault;
use bevy::prelude::*;
use glam::{DQuat, DVec3};

/// Carries along the bodies whose entities have been moved. What touches them lets go: their nodes are elsewhere without
/// having moved there.
pub(super) fn follow_transforms(
    mut bodies: Query<(Entity, &mut SimulatedBody)>,
    transforms: TransformHelper,
    mut builds: ResMut<BodyBuilds>,
    mut faults: MessageWriter<HapticFault>,
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
                simulated.carried = simulated.epoch;
            }
            Err(kind) => {
                // Said once; the body stays where it was.
                if !std::mem::replace(&mut simulated.reported_pose, true) {
                    faults.write(HapticFault { entity: Some(entity), kind });
                }
            }
        }
    }
}

impl SimulatedBody {
    /// Moves all nodes from where the entity was to where it is `now`, with their shape and motion; nowhere, if that is no
    /// place for a body.
    pub(super) fn move_to(&mut self, now: GlobalTransform) {
        let (Ok((r0, t0)), Ok((r1, t1))) = (checked_pose(&self.pose), checked_pose(&now)) else { return };
        self.pose = now;
        let turn: DQuat = (r1 * r0.inverse()).normalize();
        let shift: DVec3 = t1 - turn * t0;
        if turn.is_near_identity() && shift == DVec3::ZERO {
            return;
        }
        let x: Vec<DVec3> = self.body.positions_m().iter().map(|x| turn * *x + shift).collect();
        let v: Vec<DVec3> = self.body.velocities_m_per_s().iter().map(|v| turn * *v).collect();
        // The lists are as long as they were, and finite as places of bodies are.
        let _ = self.body.set_state(&x, &v);
        self.drawn.forget_step();
    }
}
