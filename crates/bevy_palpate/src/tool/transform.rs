//! Transforms of tools: interpolated between the last two model steps, like bodies.

use super::tool_loop::{Pose, ToolLoop};
use crate::model_time::ModelOverstep;
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

/// Sets the transform of every tool in every frame to its pose at the time of the drawn bodies, between the last two model steps.
pub(super) fn interpolate_tool_transforms(
    mut tools: Query<(&mut ToolLoop, &mut Transform, Option<&ChildOf>)>,
    parents: Query<&GlobalTransform>,
    overstep: ModelOverstep,
) {
    let share = overstep.share();
    for (mut tool, mut transform, child_of) in &mut tools {
        let ToolLoop { handle, poses, .. } = &mut *tool;
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
        let pose = Transform {
            translation: (sample.position_m + proxy_offset_m).as_vec3(),
            rotation: sample.orientation.as_quat(),
            scale: transform.scale,
        };
        // With a parent the transform is relative to it.
        let parent = child_of.and_then(|child_of| parents.get(child_of.parent()).ok());
        let pose = match parent {
            Some(parent) => GlobalTransform::from(pose).reparented_to(parent),
            None => pose,
        };
        if pose.is_finite() {
            transform.set_if_neq(pose);
        }
    }
}
