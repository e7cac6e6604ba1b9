//! A soft body and a tool moved by a recorded hand.

use crate::options::Options;
use bevy::prelude::*;
use bevy_palpate::TickRecording;
use bevy_palpate::prelude::*;
use palpate_stage::SetUpScene;

/// Spawns the scene.
pub struct ScenePlugin;

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(SetUpScene, set_up);
    }
}

fn set_up(mut commands: Commands, options: Res<Options>) {
    commands.spawn(body());
    commands.spawn((
        HapticTool {
            device: DeviceSelector::replay(options.trajectory.display().to_string()),
            scheme: options.stage.scheme,
            ..default()
        },
        // A window may stay open for hours: the report at its end is of the last minute or two.
        TickRecording { keep: options.stage.seconds.map_or(60_000, |s| (s * 1000.0) as usize), ..default() },
    ));
}

/// What is probed.
fn body() -> impl Bundle {
    (
        DeformableBody::block([6, 6, 6], 0.1),
        Tissue { youngs_modulus_pa: 20e3, density_kg_per_m3: 1000.0, damping_ratio: 0.5 },
        FixedRegion::Face(Face::Bottom),
    )
}
