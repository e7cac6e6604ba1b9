//! Installs a finished build as the simulated body of its entity.

use super::construct::{BuildInput, BuildOutput};
use super::pending::BodyBuild;
use super::render_mesh::RenderMesh;
use super::shape::DeformableBody;
use super::simulated::{MeshReport, SimulatedBody, SourceMesh};
use super::state::{BodyReady, BodyState};
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::step_watch::StepWatch;
use bevy::prelude::*;
use palpate_body::{ImplausibleSize, MeshRepairs, StepReport, ThinParts};
use std::sync::Arc;

/// A finished build with its input.
pub(super) struct FinishedBuild {
    pub(super) input: BuildInput,
    pub(super) output: BuildOutput,
    /// Comparison of the build's mesh with the current asset.
    pub(super) source: SourceMesh,
}

/// Replaces the simulated body of `entity`: in the state of the `old` one if the new one has the same nodes, otherwise at rest.
/// Moves the new body from the pose of its build to the present pose `at`.
pub(super) fn install(
    commands: &mut Commands,
    faults: &mut FaultWriter,
    (entity, old): (Entity, Option<&mut SimulatedBody>),
    (build, at): (FinishedBuild, GlobalTransform),
    epoch: u64,
) {
    let FinishedBuild { input, output, source } = build;
    let build_pose = GlobalTransform::from(
        Transform::from_translation(input.translation_m.as_vec3()).with_rotation(input.rotation.as_quat()),
    );
    let mut new = SimulatedBody {
        body: output.body,
        builder: output.builder,
        epoch,
        last_step: StepReport::default(),
        watch: StepWatch::default(),
        shape: epoch,
        last_move: 0,
        failed: None,
        pose: build_pose,
        rest_pose: build_pose,
        reported_pose: false,
        built_shape: input.shape,
        built_fixed: input.fixed,
        built_slit: input.slit,
        built_tissue: input.tissue,
        skin: output.skin,
        closed: output.closed,
        report: output.report,
        tetrahedral_report: output.tetrahedral_report,
        source,
        drawn: RenderMesh::default(),
        sutures: Vec::new(),
        obstacles: Vec::new(),
        has_loads: false,
    };
    if old.as_ref().is_none_or(|old| old.built_fixed != new.built_fixed) && new.is_unconstrained() {
        info!(
            "the body of {entity} has no fixed part and floats; add a FixedRegion unless it is meant to move"
        );
    }
    let Some(old) = old else {
        report_shape(faults, entity, &new);
        new.move_to(at);
        commands.entity(entity).try_insert((new, BodyState::Ready));
        send_ready(commands, entity);
        return;
    };
    commands.entity(entity).try_insert(BodyState::Ready);
    send_ready(commands, entity);
    let is_same_mesh = match (&old.closed, &new.closed) {
        (Some(old), Some(new)) => Arc::ptr_eq(old, new),
        (None, None) => true,
        _ => false,
    };
    let is_same_shape = is_same_mesh && old.built_shape == new.built_shape;
    if !is_same_shape {
        report_shape(faults, entity, &new);
    }
    let is_same = is_same_shape
        && (&old.built_fixed, old.built_slit) == (&new.built_fixed, new.built_slit)
        && old.body.positions_m().len() == new.body.positions_m().len();
    if is_same {
        // Cannot fail: both bodies have the same nodes.
        let _ = new.body.adopt_motion(&old.body);
        (new.shape, new.last_move, new.pose) = (old.shape, old.last_move, old.pose);
        new.watch = old.watch;
        new.drawn = std::mem::take(&mut old.drawn);
    } else {
        new.drawn = std::mem::take(&mut old.drawn).for_new_shape();
        new.move_to(at);
    }
    new.reported_pose = old.reported_pose;
    *old = new;
}

/// Writes the message and triggers the observers, once the commands before it have been applied.
fn send_ready(commands: &mut Commands, body: Entity) {
    let ready = BodyReady { body };
    commands.write_message(ready);
    commands.trigger(ready);
}

/// Removes the pending build of a body.
pub(super) fn clear_build(commands: &mut Commands, entity: Entity) {
    commands.entity(entity).try_remove::<BodyBuild>();
}

/// Maximum relative excess of a body's mass over that of its mesh that is not reported.
const MAX_MASS_EXCESS: f64 = 0.01;

/// Logs an implausible size of a new body, and the repairs of its mesh, and reports a body that is too heavy.
fn report_shape(faults: &mut FaultWriter, entity: Entity, body: &SimulatedBody) {
    if let DeformableBody::Block { size_m, .. } = body.built_shape
        && let Some(size) = ImplausibleSize::of(size_m.max_element())
    {
        warn!("{entity}: {size}; change size_m of DeformableBody::Block");
    }
    if let Some(report) = body.tetrahedral_report {
        if let Some(size) = ImplausibleSize::of(body.longest_side_m()) {
            warn!("{entity}: {size}; change TetrahedralShape::metres_per_unit");
        }
        if !report.is_clean() {
            warn!("{entity}: {report}");
        }
    }
    let Some(report) = body.report else { return };
    let MeshReport {
        repairs,
        assumptions,
        implausible_size,
        piece_count,
        piece_share,
        thin_parts,
        cells,
        ..
    } = report;
    if let Some(thin) = thin_parts.filter(|thin| thin.share > ThinParts::MAX_SHARE) {
        warn!("{entity}: {thin}: MeshShape::cells");
    }
    if let Some(size) = implausible_size {
        warn!("{entity}: {size}; change MeshShape::metres_per_unit");
    }
    if let Some(assumptions) = assumptions {
        warn!("{entity}: {assumptions}");
    }
    if piece_share < 1.0 {
        let percent = 100.0 * piece_share;
        warn!(
            "{entity}: the mesh has {piece_count} pieces; one with {percent:.1} % of the volume is the body: MeshShape::pieces selects others"
        );
    }
    let MeshRepairs { welded, collapsed, duplicates, back_to_back, turned, pinched_edges } = repairs;
    // Every mesh with seams has coincident vertices: these alone are not logged.
    if (MeshRepairs { welded: 0, ..repairs }) != MeshRepairs::default() {
        info!(
            "{entity}: the mesh was repaired: {welded} vertices welded; {collapsed} triangles without area, {duplicates} \
             duplicates and {back_to_back} back-to-back triangles removed; {turned} triangles reversed; {pinched_edges} edges with \
             four or more triangles"
        );
    }
    if cells.raised_share > MAX_MASS_EXCESS {
        let kind = HapticFaultKind::MassExcess { share: cells.raised_share, cells: cells.raised };
        faults.write(entity, kind);
    }
}
