//! A body that has been made takes its place, that of an earlier one if there is one.

use super::build::BodyBuild;
use super::make::{BuildInput, BuildOutput};
use super::{Drawn, MeshReport, SimulatedBody, SourceMesh};
use crate::fault::{HapticFault, HapticFaultKind};
use crate::step_watch::StepWatch;
use bevy::prelude::*;
use palpate_body::{MeshRepairs, StepReport};
use std::sync::Arc;

/// What was made of what.
pub(super) struct Build {
    pub(super) plan: BuildInput,
    pub(super) made: BuildOutput,
    /// How its mesh compares with the one that there is now.
    pub(super) source: SourceMesh,
}

/// Puts a new body in its place: with shape and motion of the old one if it has the same nodes, at rest if not. It was planned
/// where the entity was then and is put where it is `at` now.
pub(super) fn put(
    commands: &mut Commands,
    faults: &mut MessageWriter<HapticFault>,
    (entity, old): (Entity, Option<&mut SimulatedBody>),
    (build, at): (Build, GlobalTransform),
    epoch: u64,
) {
    let Build { plan, made, source } = build;
    let planned = GlobalTransform::from(
        Transform::from_translation(plan.translation_m.as_vec3()).with_rotation(plan.rotation.as_quat()),
    );
    let mut new = SimulatedBody {
        body: made.body,
        builder: made.builder,
        epoch,
        last_step: StepReport::default(),
        watch: StepWatch::default(),
        shape: epoch,
        carried: 0,
        failed: None,
        place: planned,
        is_refused_place: false,
        shape_asked: plan.shape,
        fixed_asked: plan.fixed,
        slit_asked: plan.slit,
        tissue_asked: plan.tissue,
        skin: made.skin,
        closed: made.closed,
        report: made.report,
        source,
        drawn: Drawn::default(),
        sutures: Vec::new(),
    };
    let Some(old) = old else {
        tell(faults, entity, &new);
        new.carry_to(at);
        commands.entity(entity).try_insert(new);
        return;
    };
    let is_same_mesh = match (&old.closed, &new.closed) {
        (Some(old), Some(new)) => Arc::ptr_eq(old, new),
        (None, None) => true,
        _ => false,
    };
    let is_same_shape = is_same_mesh && old.shape_asked == new.shape_asked;
    if !is_same_shape {
        tell(faults, entity, &new);
    }
    let is_same = is_same_shape
        && (&old.fixed_asked, old.slit_asked) == (&new.fixed_asked, new.slit_asked)
        && old.body.positions_m().len() == new.body.positions_m().len();
    if is_same {
        // It fits, since the nodes are the same.
        let _ = new.body.set_state(old.body.positions_m(), old.body.velocities_m_per_s());
        (new.shape, new.carried, new.place) = (old.shape, old.carried, old.place);
        new.watch = old.watch;
        new.drawn = std::mem::take(&mut old.drawn);
    } else {
        new.drawn = std::mem::take(&mut old.drawn).of_another_shape();
        new.carry_to(at);
    }
    new.is_refused_place = old.is_refused_place;
    *old = new;
}

/// Forgets that a body is awaited or being made.
pub(super) fn settle(commands: &mut Commands, entity: Entity) {
    commands.entity(entity).try_remove::<BodyBuild>();
}

/// A body that weighs so much more than its mesh does is not what was asked for.
const TOO_HEAVY: f64 = 0.01;

/// Says what became of a new mesh.
fn tell(faults: &mut MessageWriter<HapticFault>, entity: Entity, body: &SimulatedBody) {
    let Some(MeshReport { repairs, cells, .. }) = body.report else { return };
    let MeshRepairs { welded, collapsed, duplicates, back_to_back, turned, pinched_edges } = repairs;
    // Vertices at one place are in every mesh with seams: that alone is no news.
    if (MeshRepairs { welded: 0, ..repairs }) != MeshRepairs::default() {
        info!(
            "{entity}: the mesh was put right: {welded} vertices welded; {collapsed} triangles without an area, {duplicates} \
             given twice and {back_to_back} back to back left out; {turned} turned; {pinched_edges} edges with four triangles \
             or more"
        );
    }
    if cells.raised_share > TOO_HEAVY {
        let kind = HapticFaultKind::MassExcess { share: cells.raised_share, cells: cells.raised };
        faults.write(HapticFault { entity: Some(entity), kind });
    }
}
