//! Contacts of avian that hold a rigid body while soft bodies push it.

use super::coupling::Kinematics;
use super::math::{HeldResponse, Wrench, double};
use avian3d::collision::contact_types::ContactGraph;
use avian3d::prelude::{RigidBody, RigidBodyColliders};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use glam::DVec3;

/// Relative velocity along a contact up to which friction holds, m/s.
const STICKING_M_PER_S: f64 = 0.01;

/// Contacts of avian's rigid bodies.
#[derive(SystemParam)]
pub(super) struct Supports<'w, 's> {
    contacts: Option<Res<'w, ContactGraph>>,
    colliders: Query<'w, 's, &'static RigidBodyColliders>,
    others: Query<'w, 's, (&'static RigidBody, Kinematics)>,
}

impl Supports<'_, '_> {
    /// Holds a rigid body at its loaded contacts with bodies that are not dynamic: along the normal, and across it if the contact has
    /// friction and does not slide. `velocity` is that of the body, with its centre of mass at `center_m`.
    ///
    /// A contact counts for a whole model step and in both directions. Dynamic bodies do not hold: their reaction follows in avian.
    pub(super) fn hold(&self, entity: Entity, center_m: DVec3, velocity: Wrench, held: &mut HeldResponse) {
        let (Some(contacts), Ok(colliders)) = (&self.contacts, self.colliders.get(entity)) else { return };
        let alone = held.clone();
        let mut hold = |normal: DVec3, arm_m: DVec3| {
            let row = Wrench::new(normal, arm_m.cross(normal));
            held.hold(row, row.dot(alone.velocity(row)));
        };
        for pair in colliders.iter().flat_map(|collider| contacts.contact_pairs_with(collider)) {
            if !(pair.is_touching() && pair.generates_constraints()) {
                continue;
            }
            let other = if pair.body1 == Some(entity) { pair.body2 } else { pair.body1 };
            let Some((_, kinematics)) =
                other.and_then(|other| self.others.get(other).ok()).filter(|(kind, _)| !kind.is_dynamic())
            else {
                continue;
            };
            let other = kinematics.state();
            for manifold in &pair.manifolds {
                let normal = double(manifold.normal);
                for point in manifold.points.iter().filter(|point| point.normal_impulse > 0.0) {
                    let at_m = double(point.point);
                    let arm_m = at_m - center_m;
                    hold(normal, arm_m);
                    let slip = velocity.linear + velocity.angular.cross(arm_m)
                        - other.velocity.linear
                        - other.velocity.angular.cross(at_m - other.position_m);
                    if manifold.friction > 0.0 && slip.reject_from(normal).length() < STICKING_M_PER_S {
                        let (along, across) = normal.any_orthonormal_pair();
                        hold(along, arm_m);
                        hold(across, arm_m);
                    }
                }
            }
        }
    }
}
