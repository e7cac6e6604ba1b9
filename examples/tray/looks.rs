//! The looks of the rigid bodies.

use super::scene::{LUMP_M, Piece, boards};
use bevy::prelude::*;

/// Draws the pieces of the scene, in an app that draws.
pub struct LooksPlugin;

impl Plugin for LooksPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(PreUpdate, dress.run_if(resource_exists::<Assets<StandardMaterial>>));
    }
}

fn dress(
    mut commands: Commands,
    pieces: Query<(Entity, &Piece), Added<Piece>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let mut paint = |color: Color| {
        let material = StandardMaterial { base_color: color, perceptual_roughness: 0.5, ..default() };
        MeshMaterial3d(materials.add(material))
    };
    for (entity, piece) in &pieces {
        let mut entity = commands.entity(entity);
        match piece {
            Piece::Table => {}
            Piece::Tray => {
                let steel = paint(Color::srgb(0.55, 0.58, 0.62));
                entity.insert(Visibility::default()).with_children(|tray| {
                    for (size, at) in boards() {
                        let mesh = Mesh3d(meshes.add(Cuboid::from_size(size)));
                        tray.spawn((mesh, steel.clone(), Transform::from_translation(at)));
                    }
                });
            }
            Piece::Lump => {
                let mesh = Mesh3d(meshes.add(Sphere::new(LUMP_M)));
                entity.insert((mesh, paint(Color::srgb(0.95, 0.60, 0.10))));
            }
        }
    }
}
