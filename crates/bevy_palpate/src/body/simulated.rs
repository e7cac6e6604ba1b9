//! The simulated body of an entity, and the report about its mesh.

use super::render_mesh::RenderMesh;
use super::shape::{DeformableBody, FixedRegion, Slit};
use super::tissue::Tissue;
use crate::step_watch::StepWatch;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{
    Body, BodyError, BodyPoint, ClosedMesh, ImplausibleSize, JoinedMesh, MeshAssumptions, MeshCells,
    MeshRepairs, Region, Skin, StepReport, TetrahedralReport, ThinParts,
};
use palpate_reduce::LocalModelBuilder;
use std::sync::Arc;

/// The simulated body of an entity with [`DeformableBody`], in the world frame.
///
/// Inserted when the body has been built, replaced when it is built again, and stepped at the model rate. Read-only for apps.
#[derive(Component, Debug)]
pub struct SimulatedBody {
    pub(crate) body: Body,
    pub(crate) builder: LocalModelBuilder,
    pub(crate) epoch: u64,
    pub(crate) last_step: StepReport,
    /// Persistent problems of the steps.
    pub(crate) watch: StepWatch,
    /// Number of the first build with the same nodes and the same fixed nodes.
    pub(crate) shape: u64,
    /// Number of the last move by the transform.
    pub(super) last_move: u64,
    /// Kind of the error of the last step, which is reported once.
    pub(crate) failed: Option<std::mem::Discriminant<BodyError>>,
    /// Pose of the entity when the body was built or last moved by the transform.
    pub(super) pose: GlobalTransform,
    /// Pose of the body's rest shape.
    pub(super) rest_pose: GlobalTransform,
    /// Whether the present pose of the entity was rejected and reported.
    pub(super) reported_pose: bool,
    /// The components from which the body was built.
    pub(super) built_shape: DeformableBody,
    pub(super) built_fixed: FixedRegion,
    pub(super) built_slit: Option<Slit>,
    pub(super) built_tissue: Tissue,
    /// Of a body from a mesh: the skin that moves the vertices.
    pub(super) skin: Option<Skin>,
    /// Of a body from a mesh: the closed mesh, and the regions of its parts.
    pub(super) closed: Option<Arc<JoinedMesh>>,
    /// Of a body from a mesh: repairs and cells.
    pub(super) report: Option<MeshReport>,
    /// Of a volume of tetrahedra: repairs and problems.
    pub(super) tetrahedral_report: Option<TetrahedralReport>,
    /// Comparison of the closed mesh with the current asset.
    pub(super) source: SourceMesh,
    pub(crate) drawn: RenderMesh,
    /// The sutures of the body, in the order of its ties.
    pub(crate) sutures: Vec<Entity>,
    /// The obstacles of the body with their versions, in the order of [`Body::obstacles`].
    pub(crate) obstacles: Vec<(Entity, u64)>,
    /// Whether the body has the loads of an external force.
    pub(crate) has_loads: bool,
}

impl SimulatedBody {
    /// Returns the full body: network, surface, positions, velocities and forces, in the world frame.
    #[must_use]
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Returns the number of the build or of the last move by the transform, greater than all previous ones in the app.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Identifies the nodes and their placement, to which a contact belongs. A new shape numbers its nodes differently, and a move by the
    /// transform displaces them without a motion.
    pub(crate) fn contact_key(&self) -> (u64, u64) {
        (self.shape, self.last_move)
    }

    /// Returns the closed mesh from which the body was built; `None` for a block.
    #[must_use]
    pub fn closed_mesh(&self) -> Option<&ClosedMesh> {
        self.closed.as_ref().map(|joined| &joined.mesh)
    }

    /// Returns repairs and problems of the volume from which the body was built; `None` for another body.
    #[must_use]
    pub fn tetrahedral_report(&self) -> Option<TetrahedralReport> {
        self.tetrahedral_report
    }

    /// The regions of the parts of the mesh, in the body's own frame.
    pub(crate) fn part_regions(&self) -> &[Region] {
        self.closed.as_ref().map_or(&[], |joined| &joined.regions)
    }

    /// Returns the tissue of the simulated body. It lags behind the [`Tissue`] component while a build is running.
    #[must_use]
    pub fn tissue(&self) -> Tissue {
        self.built_tissue
    }

    /// Returns the edge of a cell at rest, m; of a block the shortest edge, of tetrahedra the mean one.
    #[must_use]
    pub fn cell_m(&self) -> f64 {
        match (&self.built_shape, self.report) {
            (DeformableBody::Block { nodes, size_m }, _) => {
                let cells = nodes.map(|nodes| nodes.saturating_sub(1).max(1) as f64);
                (*size_m / DVec3::from_array(cells)).min_element()
            }
            (DeformableBody::Mesh(_), Some(report)) => report.cells.cell_m,
            (DeformableBody::Mesh(_), None) => f64::NAN,
            (DeformableBody::Tetrahedra(_), _) => {
                let rest_m = self.body.network().rest_m();
                let edges = self.body.network().edges();
                let (sum, count) = edges
                    .fold((0.0, 0), |(sum, count), [a, b]| (sum + rest_m[a].distance(rest_m[b]), count + 1));
                sum / f64::from(count)
            }
        }
    }

    /// Position of a point of the undeformed body at the entity's pose, m, world frame.
    pub(crate) fn undeformed_m(&self, point: &BodyPoint) -> DVec3 {
        let local_m = self.local_m(point.of(self.body.network().rest_m()));
        self.pose.translation().as_dvec3() + self.pose.rotation().as_dquat() * local_m
    }

    /// Position of a node at rest in the body's own frame, m.
    pub(crate) fn rest_local_m(&self, node: usize) -> DVec3 {
        self.local_m(self.body.network().rest_m()[node])
    }

    /// Transforms a place of the rest shape into the body's own frame, m.
    fn local_m(&self, rest_m: DVec3) -> DVec3 {
        let pose = &self.rest_pose;
        pose.rotation().as_dquat().inverse() * (rest_m - pose.translation().as_dvec3())
    }

    /// Whether no node is fixed.
    pub(super) fn is_unconstrained(&self) -> bool {
        self.body.network().free().len() == self.body.network().node_count()
    }

    /// Returns the longest side of the bounding box of all nodes at rest, m, along the world's axes at the pose of the build.
    #[must_use]
    pub fn longest_side_m(&self) -> f64 {
        let rest = self.body.network().rest_m().iter().copied();
        let bounds = rest.map(|x| (x, x)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        bounds.map_or(0.0, |(low, high)| (high - low).max_element())
    }

    /// Number of cells along the longest side of the mesh; `None` for a block.
    pub(crate) fn cells_along(&self) -> Option<usize> {
        self.report.map(|report| report.cells.along)
    }

    /// Returns the report about the body's mesh: repairs, cells and deviation of the touched surface; `None` for a block.
    #[must_use]
    pub fn mesh_report(&self) -> Option<MeshReport> {
        self.report
    }

    /// Returns the positions at which the nodes are drawn, m, world frame: interpolated between the last two model steps.
    #[must_use]
    pub fn drawn_m(&self) -> &[DVec3] {
        self.drawn.nodes_m(&self.body)
    }

    /// Returns the displacement of every node in column `column` of the newest local model's basis ([`LocalModelBuilder::basis_column`]);
    /// `None` if the basis has fewer columns.
    #[must_use]
    pub fn basis_column(&self, column: usize) -> Option<Vec<DVec3>> {
        self.builder.basis_column(&self.body, column)
    }

    /// Returns the report about the last model step.
    #[must_use]
    pub fn last_step(&self) -> StepReport {
        self.last_step
    }
}

/// Report about the mesh from which a body was built.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshReport {
    /// Repairs of the mesh.
    pub repairs: MeshRepairs,
    /// What was assumed about the inside of a mesh that is not closed by itself.
    pub assumptions: Option<MeshAssumptions>,
    /// The size of the body, if it is legal and implausible in metres. It is also logged.
    pub implausible_size: Option<ImplausibleSize>,
    /// Number of pieces of the mesh.
    pub piece_count: usize,
    /// Share of the body's pieces in the volume of all, from 0 to 1.
    pub piece_share: f64,
    /// Parts that are thinner than two cells. They are logged if they have more than a tenth of the volume.
    pub thin_parts: Option<ThinParts>,
    /// Cells that fill the mesh: number, size and excess mass.
    pub cells: MeshCells,
    /// Maximum distance of the surface of the mesh's inside from the surface that tools touch, m.
    pub deviation_m: f64,
}

/// Comparison of the mesh from which a body was built with the current asset of its handle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum SourceMesh {
    /// The asset has not changed.
    #[default]
    Same,
    /// The asset has changed, and the body is to be built from it.
    Changed,
    /// The asset has changed and was rejected; the body was built from the previous one.
    Rejected,
}
