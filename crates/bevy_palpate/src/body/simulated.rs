//! The simulated body of an entity, and what became of the mesh that it was built of.

use super::render_mesh::RenderMesh;
use super::shape::{DeformableBody, FixedRegion, Slit};
use super::tissue::Tissue;
use crate::step_watch::StepWatch;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{Body, BodyError, BodyPoint, ClosedMesh, MeshCells, MeshRepairs, Skin, StepReport};
use palpate_reduce::LocalModelBuilder;
use std::sync::Arc;

/// The simulated body, in the world's frame: made from [`DeformableBody`] and its partners, stepped at the
/// model rate. Read it to look inside.
#[derive(Component, Debug)]
pub struct SimulatedBody {
    pub(crate) body: Body,
    pub(crate) builder: LocalModelBuilder,
    pub(crate) epoch: u64,
    pub(crate) last_step: StepReport,
    /// What has been wrong with its steps for some time.
    pub(crate) watch: StepWatch,
    /// The first build with these nodes, and these fixed.
    pub(crate) shape: u64,
    /// The last carrying along.
    pub(super) carried: u64,
    /// Why the last step failed, so that it is said once.
    pub(crate) failed: Option<std::mem::Discriminant<BodyError>>,
    /// Where the entity was when the body was built or last carried along.
    pub(super) pose: GlobalTransform,
    /// The pose at which its nodes are at rest.
    pub(super) rest_pose: GlobalTransform,
    /// The entity is at a place that was refused, and that has been said.
    pub(super) reported_pose: bool,
    /// What it was built of.
    pub(super) built_shape: DeformableBody,
    pub(super) built_fixed: FixedRegion,
    pub(super) built_slit: Option<Slit>,
    pub(super) built_tissue: Tissue,
    /// Of a mesh: how it is drawn, itself, what became of it, and how it compares with the mesh that there is now.
    pub(super) skin: Option<Skin>,
    pub(super) closed: Option<Arc<ClosedMesh>>,
    pub(super) report: Option<MeshReport>,
    pub(super) source: SourceMesh,
    pub(crate) drawn: RenderMesh,
    /// The sutures in it, in the order of the body's ties.
    pub(crate) sutures: Vec<Entity>,
}

impl SimulatedBody {
    /// The full body: network, surface, positions, velocities, forces.
    #[must_use]
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Which build it is: every build of a body in an app, and every carrying along, has a higher number than those before.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// What a contact belongs to: nodes of another shape have other numbers, and those of a body that was carried along are
    /// elsewhere without having moved there.
    pub(crate) fn contact_key(&self) -> (u64, u64) {
        (self.shape, self.carried)
    }

    /// The closed mesh that it fills; `None` for a block.
    #[must_use]
    pub fn closed_mesh(&self) -> Option<&ClosedMesh> {
        self.closed.as_deref()
    }

    /// What it is made of now; while it is being made of another tissue, the one before.
    #[must_use]
    pub fn tissue(&self) -> Tissue {
        self.built_tissue
    }

    /// Edge of a cell at rest, m; of a block's cells the shortest edge.
    #[must_use]
    pub fn cell_m(&self) -> f64 {
        match (&self.built_shape, self.report) {
            (DeformableBody::Block { nodes, size_m }, _) => {
                let cells = nodes.map(|nodes| nodes.saturating_sub(1).max(1) as f64);
                (*size_m / DVec3::from_array(cells)).min_element()
            }
            (DeformableBody::Mesh(_), Some(report)) => report.cells.cell_m,
            (DeformableBody::Mesh(_), None) => f64::NAN,
        }
    }

    /// Place of a point of the body if it were not deformed, m, world frame.
    pub(crate) fn undeformed_m(&self, point: &BodyPoint) -> DVec3 {
        let rest_m = point.of(self.body.network().rest_m());
        let (from, to) = (&self.rest_pose, &self.pose);
        let turn = |pose: &GlobalTransform| pose.rotation().as_dquat();
        let local_m = turn(from).inverse() * (rest_m - from.translation().as_dvec3());
        to.translation().as_dvec3() + turn(to) * local_m
    }

    /// Longest side of the box round all nodes at rest, m, along the world's axes as the body stood when it was built.
    #[must_use]
    pub fn longest_side_m(&self) -> f64 {
        let rest = self.body.network().rest_m().iter().copied();
        let bounds = rest.map(|x| (x, x)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        bounds.map_or(0.0, |(low, high)| (high - low).max_element())
    }

    /// Value of [`MeshShape::cells_along_longest_axis`] of which the body was made; `None` for a block.
    pub(crate) fn cells_along(&self) -> Option<usize> {
        self.built_shape.mesh().map(|shape| shape.cells_along_longest_axis)
    }

    /// What became of that mesh: repairs, cells, and how far from it the body is touched; `None` for a block.
    #[must_use]
    pub fn mesh_report(&self) -> Option<MeshReport> {
        self.report
    }

    /// Where the nodes are drawn now, m, in the world's frame: on their way between the last two model steps.
    #[must_use]
    pub fn drawn_m(&self) -> &[DVec3] {
        self.drawn.nodes_m(&self.body)
    }

    /// How every node moves with column `column` of the newest local model's basis; `None` where there is no such column. See
    /// [`LocalModelBuilder::basis_column`].
    #[must_use]
    pub fn basis_column(&self, column: usize) -> Option<Vec<DVec3>> {
        self.builder.basis_column(&self.body, column)
    }

    /// What the last model step did.
    #[must_use]
    pub fn last_step(&self) -> StepReport {
        self.last_step
    }
}

/// What became of the mesh that a body was made of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshReport {
    /// What was put right in the mesh.
    pub repairs: MeshRepairs,
    /// The cells that fill it: how many, how wide, and how much heavier than the mesh they are.
    pub cells: MeshCells,
    /// The greatest distance of a vertex of the mesh from the surface that tools touch, m.
    pub deviation_m: f64,
}

/// How the mesh that a body was made of compares with what its handle names now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum SourceMesh {
    /// It is that.
    #[default]
    Same,
    /// It has changed since, and is to be made a body of.
    Changed,
    /// It has changed since, and no body can be made of it; the body is of the one before.
    Rejected,
}
