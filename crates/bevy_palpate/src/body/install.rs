//! Installs a finished build as the simulated body of its entity.

use super::construct::{BuildInput, BuildOutput};
use super::pending::BodyBuild;
use super::render_mesh::RenderMesh;
use super::simulated::{MeshReport, SimulatedBody, SourceMesh};
use super::state::{BodyReady, BodyState};
use crate::fault::{HapticFault, HapticFaultKind};
use crate::step_watch::StepWatch;
use bevy::prelude::*;
use palpate_body::{MeshRepairs, StepReport};
use std::sync::Arc;

/// A finished build with its input.
pub(super) struct FinishedBuild {
    pub(super) input: BuildInput,
    pub(super) output: BuildOutput,
    /// How its mesh compares with the asset as it is now.
    pub(super) source: SourceMesh,
}

/// Replaces the simulated body of `entity`: with the shape and motion of the `old` one if the new one has the same nodes, at rest if not.
/// The build has the pose that the entity had then, and is moved to the pose `at` that it has now.
pub(super) fn install(
    commands: &mut Commands,
    faults: &mut MessageWriter<HapticFault>,
    (entity, old): (Entity, Option<&mut SimulatedBody>),
    (build, at): (FinishedBuild, GlobalTransform),
    epoch: u64,
) {
    let FinishedBuild { input, output, source } = build;
    let planned = GlobalTransform::from(
        Transform::from_translation(input.translation_m.as_vec3()).with_rotation(input.rotation.as_quat()),
    );
    let mut new = SimulatedBody {
        body: output.body,
        builder: output.builder,
        epoch,
        last_step: StepReport::default(),
        watch: StepWatch::default(),
        shape: epoch,
        carried: 0,
        failed: None,
        pose: planned,
        rest_pose: planned,
        reported_pose: false,
        built_shape: input.shape,
        built_fixed: input.fixed,
        built_slit: input.slit,
        built_tissue: input.tissue,
        skin: output.skin,
        closed: output.closed,
        report: output.report,
        source,
        drawn: RenderMesh::default(),
        sutures: Vec::new(),
    };
    commands.entity(entity).try_insert(BodyState::Ready);
    commands.trigger(BodyReady { body: entity });
    let Some(old) = old else {
        report_mesh(faults, entity, &new);
        new.move_to(at);
        commands.entity(entity).try_insert(new);
        return;
    };
    let is_same_mesh = match (&old.closed, &new.closed) {
        (Some(old), Some(new)) => Arc::ptr_eq(old, new),
        (None, None) => true,
        _ => false,
    };
    let is_same_shape = is_same_mesh && old.built_shape == new.built_shape;
    if !is_same_shape {
        report_mesh(faults, entity, &new);
    }
    let is_same = is_same_shape
        && (&old.built_fixed, old.built_slit) == (&new.built_fixed, new.built_slit)
        && old.body.positions_m().len() == new.body.positions_m().len();
    if is_same {
        // It fits, since the nodes are the same.
        let _ = new.body.set_state(old.body.positions_m(), old.body.velocities_m_per_s());
        (new.shape, new.carried, new.pose) = (old.shape, old.carried, old.pose);
        new.watch = old.watch;
        new.drawn = std::mem::take(&mut old.drawn);
    } else {
        new.drawn = std::mem::take(&mut old.drawn).of_another_shape();
        new.move_to(at);
    }
    new.reported_pose = old.reported_pose;
    *old = new;
}

/// Forgets that a body is awaited or being output.
pub(super) fn clear_build(commands: &mut Commands, entity: Entity) {
    commands.entity(entity).try_remove::<BodyBuild>();
}

/// Maximum relative excess of a body's mass over that of its mesh.
const MAX_MASS_EXCESS: f64 = 0.01;

/// Logs the repairs of a new mesh, and reports a body that is too heavy.
fn report_mesh(faults: &mut MessageWriter<HapticFault>, entity: Entity, body: &SimulatedBody) {
    let Some(MeshReport { repairs, cells, .. }) = body.report else { return };
    let MeshRepairs { welded, collapsed, duplicates, back_to_back, turned, pinched_edges } = repairs;
    // Every mesh with seams has vertices at the same place: that alone is not logged.
    if (MeshRepairs { welded: 0, ..repairs }) != MeshRepairs::default() {
        info!(
            "{entity}: the mesh was repaired: {welded} vertices welded; {collapsed} triangles without an area, {duplicates} \
             given twice and {back_to_back} back to back left out; {turned} turned; {pinched_edges} edges with four triangles \
             or more"
        );
    }
    if cells.raised_share > MAX_MASS_EXCESS {
        let kind = HapticFaultKind::MassExcess { share: cells.raised_share, cells: cells.raised };
        faults.write(HapticFault { entity: Some(entity), kind });
    }
}
