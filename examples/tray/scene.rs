//! Table, tray and lump of avian, and a soft organ.

use super::hand;
use avian3d::prelude::{
    Collider, ColliderDensity, Friction, Gravity as RigidGravity, LinearVelocity, PhysicsPlugins, RigidBody,
};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use palpate_stage::{SetUpHands, SetUpScene, StageOptions, register_hand};

/// Sides of the tray and height and thickness of its rim, m.
pub const TRAY_M: Vec3 = Vec3::new(0.26, 0.008, 0.18);
const RIM_M: [f32; 2] = [0.016, 0.006];
/// Radius of the lump, m.
pub const LUMP_M: f32 = 0.018;
/// Sides of the organ, a slab of cells of a centimetre, m.
pub const ORGAN_M: [f64; 3] = [0.11, 0.04, 0.08];
/// Place of the organ across, m.
const ACROSS_M: f32 = -0.03;
/// Height of the top of the organ at rest on the tray, m.
pub const TOP_M: f32 = TRAY_M.y + ORGAN_M[1] as f32;

/// Adds avian, and the bodies of the scene.
pub struct ScenePlugin;

/// A rigid body of the scene.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece {
    Table,
    Tray,
    Lump,
}

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(PhysicsPlugins::default())
            .insert_resource(Gravity::EARTH)
            .insert_resource(RigidGravity::default())
            // Five ticks of avian in a model step.
            .insert_resource(Time::<Fixed>::from_hz(100.0))
            .add_systems(SetUpScene, set_up)
            .add_systems(SetUpHands, (set_up_hand, set_up_lump));
        register_hand(app.world_mut(), "hand", hand::reading);
    }
}

fn set_up(mut commands: Commands, previous: Query<Entity, With<Piece>>) {
    previous.iter().for_each(|entity| commands.entity(entity).try_despawn());
    commands.spawn((
        Piece::Table,
        RigidBody::Static,
        Collider::cuboid(2.0, 0.2, 2.0),
        Transform::from_xyz(0.0, -0.1, 0.0),
    ));
    commands.spawn((
        Piece::Tray,
        RigidBody::Dynamic,
        Collider::compound(
            boards().map(|(size, at)| (at, Quat::IDENTITY, Collider::from(Cuboid::from_size(size)))).to_vec(),
        ),
        ColliderDensity(900.0),
        Friction::new(0.6),
        Transform::from_xyz(0.0, 0.5 * TRAY_M.y, 0.0),
    ));
    let [length, height, width] = ORGAN_M;
    commands.spawn((
        DeformableBody::block_of_size([12, 5, 9], DVec3::new(length, height, width)),
        Tissue { youngs_modulus_pa: 15e3, ..Tissue::SOFT },
        Transform::from_xyz(ACROSS_M, TRAY_M.y + 0.5 * height as f32, 0.0),
    ));
}

/// Sizes and places of the boards of the tray, m: the bottom and four rims.
pub fn boards() -> [(Vec3, Vec3); 5] {
    let [height, thickness] = RIM_M;
    let half = 0.5 * TRAY_M;
    let (long, short) = (Vec3::new(TRAY_M.x, height, thickness), Vec3::new(thickness, height, TRAY_M.z));
    let up = half.y + 0.5 * height;
    [
        (TRAY_M, Vec3::ZERO),
        (long, Vec3::new(0.0, up, half.z)),
        (long, Vec3::new(0.0, up, -half.z)),
        (short, Vec3::new(half.x, up, 0.0)),
        (short, Vec3::new(-half.x, up, 0.0)),
    ]
}

/// Spawns the lump on the organ, on its way across.
fn set_up_lump(mut commands: Commands) {
    commands.spawn((
        Piece::Lump,
        RigidBody::Dynamic,
        Collider::sphere(LUMP_M),
        ColliderDensity(1200.0),
        LinearVelocity(Vec3::X * 0.13),
        Transform::from_xyz(0.0, TOP_M + LUMP_M + 0.001, 0.012),
    ));
}

fn set_up_hand(mut commands: Commands, options: Res<StageOptions>) {
    let shape = ToolShape::Sphere { radius_m: hand::RADIUS_M };
    commands.spawn(HapticTool::new("hand").with_scheme(options.scheme).with_shape(shape));
}
