//! A soft organ and a tool with a recorded motion.

use super::options::Options;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{BodyRegion, Inclusion, Inclusions, SimulatedBody, TickRecording};
use palpate_body::Body;
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
        app.insert_resource(Gravity::EARTH)
            .add_systems(SetUpScene, set_up)
            .add_systems(SetUpHands, set_up_hand);
    }
}

/// Height of the organ's frame when its surface just touches the table, m.
const UP_M: f32 = 0.0257;
/// Position of the organ's frame along x, m.
const ACROSS_M: f32 = 0.0190;

/// The organ at rest, before the first contact.
#[derive(Resource)]
pub struct AtRest(pub Body);

fn set_up(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn(Obstacle::half_space());
    commands.spawn(organ(&assets));
}

/// The organ: a liver of the size of a hand, with a lump of ten times the stiffness below its top. It lies on the table as it does at rest,
/// before its weight has deformed it.
fn organ(assets: &AssetServer) -> impl Bundle {
    // Young's modulus of a healthy liver. The damping lets the organ come to rest without rocking.
    let tissue = Tissue { youngs_modulus_pa: 5e3, damping: Damping::Ratio(2.0), ..default() };
    let lump = BodyRegion::Sphere { center_m: DVec3::new(-0.034, 0.013, -0.0075), radius_m: 0.010 };
    (
        DeformableBody::from_mesh(assets.load("meshes/organ.glb")),
        tissue,
        Inclusions(vec![Inclusion {
            region: lump,
            tissue: Tissue { youngs_modulus_pa: 10.0 * tissue.youngs_modulus_pa, ..default() },
        }]),
        Transform::from_xyz(ACROSS_M, UP_M, 0.0).with_rotation(Quat::from_euler(
            EulerRot::YXZ,
            0.0,
            4.0_f32.to_radians(),
            -18.8_f32.to_radians(),
        )),
    )
}

fn set_up_hand(
    mut commands: Commands,
    options: Res<Options>,
    stage: Res<StageOptions>,
    organ: Single<&SimulatedBody>,
) {
    commands.insert_resource(AtRest(organ.body().clone()));
    commands.spawn((
        HapticTool::new(RECORDED).with_scheme(stage.scheme),
        // With a window the report is about the last one or two minutes.
        TickRecording { keep: options.stage.seconds.map_or(60_000, |s| (s * 1000.0) as usize), ..default() },
    ));
}
