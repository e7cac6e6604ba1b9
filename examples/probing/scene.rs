//! A soft organ and a tool with a recorded motion.

use crate::options::Options;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{BodyRegion, Inclusion, Inclusions, TickRecording};
use palpate_haptics::{Reading, Trajectory};
use palpate_stage::{SetUpHands, SetUpScene, StageOptions, register_hand};
use std::sync::Arc;

/// Spawns the scene.
pub struct ScenePlugin {
    /// The trajectory, which repeats.
    pub hand: Trajectory,
}

/// Name of the device.
const RECORDED: &str = "recorded hand";

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        let hand = Arc::new(self.hand.clone());
        register_hand(app.world_mut(), RECORDED, move |t| {
            let row = (t / Trajectory::PERIOD_S).round() as usize % hand.positions_m().len();
            hand.reading(row).unwrap_or(Reading::at(DVec3::ZERO))
        });
        app.add_systems(SetUpScene, set_up).add_systems(SetUpHands, set_up_hand);
    }
}

/// Height at which the recorded trajectory touches the organ, m.
const UP_M: f32 = 0.024;

fn set_up(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn(organ(&assets));
}

/// The organ: a liver of the size of a hand, with a lump of ten times the stiffness below its top.
fn organ(assets: &AssetServer) -> impl Bundle {
    let lump = BodyRegion::Sphere { center_m: DVec3::new(-0.010, 0.018, -0.006), radius_m: 0.010 };
    (
        DeformableBody::from_mesh(assets.load("meshes/organ.glb#Mesh0/Primitive0")),
        Tissue { youngs_modulus_pa: 10e3, density_kg_per_m3: 1000.0, damping_ratio: 0.5 },
        Inclusions(vec![Inclusion {
            region: lump,
            tissue: Tissue { youngs_modulus_pa: 100e3, ..default() },
        }]),
        // The support of the organ.
        FixedRegion::Regions(vec![BodyRegion::HalfSpace {
            point_m: DVec3::new(0.0, -0.015, 0.0),
            outward: DVec3::Y,
        }]),
        Transform::from_xyz(0.0, UP_M, 0.0),
    )
}

fn set_up_hand(mut commands: Commands, options: Res<Options>, stage: Res<StageOptions>) {
    commands.spawn((
        HapticTool::new(RECORDED).with_scheme(stage.scheme),
        // With a window the report is about the last one or two minutes.
        TickRecording { keep: options.stage.seconds.map_or(60_000, |s| (s * 1000.0) as usize), ..default() },
    ));
}
