//! Deformable bodies: the components that describe them, their builds, and the simulated bodies.

mod build;
mod compliance;
mod construct;
mod element_family;
mod follow_transform;
mod install;
mod mesh_assets;
mod mesh_source;
mod pending;
mod region;
mod render_mesh;
mod render_systems;
mod shape;
mod simulated;
mod state;
mod surface_trees;
mod tetrahedral_volume;
mod tissue;

pub use compliance::ContactCompliance;
pub use element_family::ElementFamily;
pub(crate) use follow_transform::CarryBodies;
pub(crate) use pending::BodyBuild;
pub use region::{BodyRegion, BoxFace};
pub use shape::{DeformableBody, FixedRegion, KinematicBody, MeshCellSize, MeshPieces, MeshShape, Slit};
pub use simulated::{MeshReport, SimulatedBody};
pub use state::{BodyReady, BodyState};
pub(crate) use surface_trees::SurfaceTrees;
pub use tetrahedral_volume::{TetrahedralShape, TetrahedralVolume};
pub use tissue::{Inclusion, Inclusions, Tissue};

use crate::cost::FrameCost;
use crate::fault::add_faults;
use crate::schedule::{HapticSystems, HapticUpdateSystems, ModelSchedule};
use bevy::asset::AssetEventSystems;
use bevy::prelude::*;

/// Builds the bodies, moves them with their transforms and updates their meshes. [`ToolPlugin`](crate::ToolPlugin) steps them, along the
/// paths of the tools.
#[derive(Clone, Copy, Debug, Default)]
pub struct BodyPlugin;

impl Plugin for BodyPlugin {
    fn build(&self, app: &mut App) {
        add_faults(app);
        // An app without assets has blocks only.
        if app.world().contains_resource::<AssetServer>() {
            app.init_asset::<TetrahedralVolume>();
        }
        #[cfg(feature = "mesh_files")]
        {
            crate::mesh_files::add_mesh_file_loader(app);
            crate::volume_files::add_tetrahedral_file_loader(app);
        }
        let cost = FrameCost::of(app);
        app.register_type::<DeformableBody>()
            .register_type::<Tissue>()
            .register_type::<ElementFamily>()
            .register_type::<TetrahedralVolume>()
            .register_type::<ContactCompliance>()
            .register_type::<FixedRegion>()
            .register_type::<Inclusions>()
            .init_resource::<pending::BodyBuilds>()
            .register_type::<Slit>()
            .register_type::<KinematicBody>()
            .register_type::<BodyState>()
            .register_type::<BodyReady>()
            .add_message::<BodyReady>()
            .add_systems(
                PreUpdate,
                (
                    cost.timed(build::poll_builds),
                    cost.timed(build::build_bodies),
                    cost.timed(compliance::set_compliance),
                    cost.timed(follow_transform::follow_transforms),
                    cost.timed(render_systems::assign_meshes),
                )
                    .chain()
                    .in_set(HapticUpdateSystems::Bodies),
            )
            .add_systems(PreStartup, warn_without_optimization)
            .add_systems(
                ModelSchedule,
                follow_transform::carry_bodies
                    .in_set(CarryBodies)
                    .after(HapticSystems::ReceiveSamples)
                    .before(HapticSystems::StepBodies),
            )
            .add_observer(remove_simulation)
            .add_systems(
                PostUpdate,
                cost.timed(render_systems::update_meshes)
                    .before(AssetEventSystems)
                    .before(TransformSystems::Propagate),
            );
    }

    #[cfg(feature = "mesh_files")]
    fn finish(&self, app: &mut App) {
        // AssetPlugin may have been added later.
        crate::mesh_files::add_mesh_file_loader(app);
    }
}

/// Logs one warning in a program whose numerical crates are not optimised.
fn warn_without_optimization() {
    if let Some(text) = optimization_warning(palpate_body::is_optimized()) {
        warn_once!("{text}");
    }
}

fn optimization_warning(is_optimized: bool) -> Option<&'static str> {
    let text = "palpate is built without optimisation: model steps take hundreds of milliseconds and the loop misses deadlines; build \
                with --release, or add [profile.dev.package.\"*\"] with opt-level = 3 to the Cargo.toml of the workspace";
    (!is_optimized).then_some(text)
}

/// Removes the simulated body and its mesh together with [`DeformableBody`], and restores the mesh that was replaced.
fn remove_simulation(
    removed: On<Remove, DeformableBody>,
    bodies: Query<(&SimulatedBody, Option<&Mesh3d>)>,
    mut commands: Commands,
) {
    let mut entity = commands.entity(removed.entity);
    entity.try_remove::<(BodyBuild, BodyState)>();
    let Ok((simulated, mesh)) = bodies.get(removed.entity) else { return };
    if mesh.is_some_and(|mesh| simulated.drawn.is_shown_by(mesh)) {
        match simulated.drawn.replaced() {
            Some(before) => entity.try_insert(Mesh3d(before.clone())),
            None => entity.try_remove::<Mesh3d>(),
        };
    }
    entity.try_remove::<SimulatedBody>();
}

#[cfg(test)]
mod tests {
    use super::optimization_warning;

    #[test]
    fn only_a_build_without_optimisation_is_warned_of() {
        assert!(optimization_warning(true).is_none());
        assert!(optimization_warning(false).is_some_and(|text| text.contains("profile.dev.package")));
    }
}
