//! Transforms of tools: interpolated between the last two model steps, like bodies.

use super::tool_loop::{Pose, ToolLoop};
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::model_time::ModelOverstep;
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use glam::DVec3;

/// Records the pose of every tool at a model step.
pub(super) fn record_poses(mut tools: Query<&mut ToolLoop>) {
    for mut tool in &mut tools {
        let ToolLoop { path, contact, consumed, poses, .. } = &mut *tool;
        if let (Some(point), Some(sequence)) = (path.last(), *consumed) {
            let proxy_offset_m = contact.proxy_m(point.position_m) - point.position_m;
            let now = Pose { sequence, proxy_offset_m };
            *poses = Some([poses.map_or(now, |[_, last]| last), now]);
        }
    }
}

/// Sets the transform of every tool in every frame to its pose at the time of the drawn bodies, between the last two model steps. With a
/// parent the transform is relative to it. The scale stays that of the app.
pub(super) fn interpolate_tool_transforms(
    mut transforms: ParamSet<(TransformHelper, Query<(Entity, &mut ToolLoop, &mut Transform)>)>,
    children: Query<(Entity, &ChildOf), With<ToolLoop>>,
    mut parents: Local<EntityHashMap<GlobalTransform>>,
    overstep: ModelOverstep,
    mut faults: FaultWriter,
) {
    parents.clear();
    let helper = transforms.p0();
    // A parent without a transform is none.
    parents.extend(children.iter().filter_map(|(entity, child_of)| {
        Some((entity, helper.compute_global_transform(child_of.parent()).ok()?))
    }));
    let share = overstep.share();
    for (entity, mut tool, mut transform) in &mut transforms.p1() {
        let ToolLoop { handle, poses, reported_parent, .. } = &mut *tool;
        // `latest_tick` and `samples` read the same buffer without consuming it.
        let samples = handle.samples();
        let (sample, proxy_offset_m) = match poses {
            Some([from, to]) => {
                let ticks = (share * to.sequence.saturating_sub(from.sequence) as f64).round();
                let sample = samples.get(from.sequence + ticks as u64).or(samples.newest());
                (sample, from.proxy_offset_m.lerp(to.proxy_offset_m, share))
            }
            None => (samples.newest(), DVec3::ZERO),
        };
        let Some(sample) = sample else { continue };
        let world = Transform {
            translation: (sample.position_m + proxy_offset_m).as_vec3(),
            rotation: sample.orientation.as_quat(),
            scale: transform.scale,
        };
        let pose = parents.get(&entity).map_or(world, |parent| relative_to(world, parent));
        let is_valid = pose.is_finite();
        if is_valid {
            transform.set_if_neq(pose);
        }
        // Reported once; the tool stays where it was drawn last.
        if !is_valid && !*reported_parent {
            faults.write(entity, HapticFaultKind::ToolParent);
        }
        *reported_parent = !is_valid;
    }
}

/// Position and rotation of `world` relative to `parent`, with the same scale. Not finite if the parent's transform cannot be inverted.
fn relative_to(world: Transform, parent: &GlobalTransform) -> Transform {
    Transform {
        translation: parent.affine().inverse().transform_point3(world.translation),
        rotation: parent.rotation().inverse() * world.rotation,
        ..world
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pose_relative_to_a_parent_gives_the_same_place_and_the_same_scale() {
        let world = Transform::from_xyz(0.01, 0.06, -0.02)
            .with_rotation(Quat::from_rotation_y(0.4))
            .with_scale(Vec3::splat(0.5));
        for scale in [Vec3::ONE, Vec3::splat(3.0), Vec3::new(1.0, 2.0, 0.5)] {
            let parent = Transform::from_xyz(1.0, -2.0, 0.5)
                .with_rotation(Quat::from_euler(EulerRot::XYZ, 0.3, -0.8, 1.1))
                .with_scale(scale);
            let child = relative_to(world, &parent.into());
            let seen = GlobalTransform::from(parent) * child;
            assert!((seen.translation() - world.translation).length() < 1e-6, "{scale}: {seen:?}");
            assert_eq!(child.scale, world.scale);
            assert!((parent.rotation * child.rotation).angle_between(world.rotation) < 1e-3);
        }
        let flat = GlobalTransform::from(Transform::from_scale(Vec3::new(1.0, 0.0, 1.0)));
        assert!(!relative_to(world, &flat).is_finite());
    }
}
