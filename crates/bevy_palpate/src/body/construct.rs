//! Builds a body from its components: plain computation without access to the app, so that a background task can run it.

use super::element_family::ElementFamily;
use super::mesh_source::{CheckedSource, Source};
use super::region::{BodyRegion, BoxFace};
use super::shape::{DeformableBody, FixedRegion, Slit};
use super::simulated::MeshReport;
use super::tetrahedral_volume::TetrahedralVolume;
use super::tissue::{Inclusion, Tissue};
use crate::fault::HapticFaultKind;
use bevy::prelude::*;
use glam::{DQuat, DVec3};
use palpate_body::{
    Block, Body, BodyError, CellLattice, ClosedMesh, Face, ImplausibleSize, JoinedMesh, MeshBody, Region,
    SemiImplicitEuler, Skin, TetrahedralMesh, TetrahedralReport,
};
use palpate_reduce::{BuilderOptions, LocalModelBuilder, ReduceError};
use std::sync::Arc;

/// Copies of the components that describe a body.
pub(super) struct BuildInput {
    pub(super) shape: DeformableBody,
    pub(super) tissue: Tissue,
    pub(super) family: ElementFamily,
    pub(super) fixed: FixedRegion,
    pub(super) slit: Option<Slit>,
    pub(super) inclusions: Vec<Inclusion>,
    pub(super) rotation: DQuat,
    pub(super) translation_m: DVec3,
}

/// A body that has been built.
pub(super) struct BuildOutput {
    pub(super) body: Body,
    pub(super) builder: LocalModelBuilder,
    /// Of a body from a mesh: the skin that moves its vertices, and the closed mesh.
    pub(super) skin: Option<Skin>,
    pub(super) closed: Option<Arc<JoinedMesh>>,
    pub(super) report: Option<MeshReport>,
    /// Of a volume of tetrahedra: repairs and problems.
    pub(super) tetrahedral_report: Option<TetrahedralReport>,
}

/// Reason why a build failed.
pub(super) struct BuildError {
    pub(super) kind: HapticFaultKind,
    /// Whether the mesh itself was rejected, independently of the other components.
    pub(super) is_mesh_error: bool,
}

/// Rotation and translation of a body; rejects a transform that is not finite, or is scaled, mirrored or sheared.
pub(super) fn checked_pose(transform: &GlobalTransform) -> Result<(DQuat, DVec3), HapticFaultKind> {
    let affine = transform.affine();
    let (x, y, z) = (affine.x_axis, affine.y_axis, affine.z_axis);
    if !(affine.matrix3.is_finite() && affine.translation.is_finite()) {
        return Err(HapticFaultKind::NonFiniteTransform);
    }
    let scale = Vec3::new(x.length(), y.length(), z.length());
    let is_skew = [x.dot(y), y.dot(z), z.dot(x)].iter().any(|product| product.abs() > 1e-4);
    if (scale - Vec3::ONE).abs().max_element() > 1e-4 || is_skew || affine.matrix3.determinant() < 0.0 {
        return Err(HapticFaultKind::NonUnitScale { scale });
    }
    let (_, rotation, translation) = transform.to_scale_rotation_translation();
    Ok((rotation.as_dquat().normalize(), translation.as_dvec3()))
}

impl BuildInput {
    /// Builds the body; a body from a mesh from `source`.
    pub(super) fn build(&self, source: Option<Source>) -> Result<BuildOutput, BuildError> {
        let kind = |error| match error {
            ReduceError::Body(error) => HapticFaultKind::BuildBody(error),
            error => HapticFaultKind::LocalModel(error),
        };
        let checked = match source.map(Source::check).transpose() {
            Ok(checked) => checked,
            Err(kind) => return Err(BuildError { kind, is_mesh_error: true }),
        };
        let build = || -> Result<BuildOutput, ReduceError> {
            let (mut skin, mut report, mut tetrahedral_report) = (None, None, None);
            let body = match (&self.shape, &checked) {
                (DeformableBody::Block { nodes, size_m }, _) => self.block(*nodes, *size_m)?,
                (DeformableBody::Mesh(_), Some(CheckedSource::Mesh(closed))) => {
                    let (body, of_mesh, found) = self.mesh(closed)?;
                    (skin, report) = (Some(of_mesh), Some(found));
                    body
                }
                (DeformableBody::Tetrahedra(_), Some(CheckedSource::Volume { volume, mesh })) => {
                    tetrahedral_report = Some(*mesh.report());
                    self.tetrahedra(volume, mesh)?
                }
                // Shapes of assets always come with their source.
                _ => return Err(BodyError::NoNodes.into()),
            };
            let closed = match &checked {
                Some(CheckedSource::Mesh(closed)) => Some(Arc::clone(closed)),
                _ => None,
            };
            // Rejects a body that cannot be stepped here instead of at its first step.
            SemiImplicitEuler::default().substeps(&body)?;
            let builder = LocalModelBuilder::new(&body, BuilderOptions::of(&body))?;
            Ok(BuildOutput { body, builder, skin, closed, report, tetrahedral_report })
        };
        build().map_err(|error| BuildError { kind: kind(error), is_mesh_error: false })
    }

    fn block(&self, nodes: [usize; 3], size_m: DVec3) -> Result<Body, BodyError> {
        let fixed_vertices = match &self.fixed {
            FixedRegion::Vertices(vertices) => vertices.iter().filter(|is_fixed| **is_fixed).count().max(1),
            _ => 0,
        };
        let node_count = nodes.iter().fold(1_usize, |product, n| product.saturating_mul(*n));
        for (what, value, max, allowed) in [
            (
                "number of fixed vertices of a block",
                fixed_vertices,
                0,
                "0: use FixedRegion::Faces or FixedRegion::Regions",
            ),
            (
                "number of nodes of a block",
                node_count,
                CellLattice::MAX_NODES,
                "at most 10000, the most that can be stepped in time",
            ),
        ] {
            // `Block::new` rejects too few or too many nodes along one side, with an error of its own.
            if value > max && nodes.iter().all(|n| (2..=Block::MAX_NODES_PER_SIDE).contains(n)) {
                return Err(BodyError::Parameter { what, value: value as f64, allowed });
            }
        }
        let mut block = Block::new(nodes, size_m)?;
        let (low, high) = (ClosedMesh::MIN_SIZE_M, ClosedMesh::MAX_SIZE_M);
        let longest_m = size_m.max_element();
        if !(low..=high).contains(&longest_m) {
            let (what, allowed) =
                ("longest side of a block, m", "0.001 to 10, as of a mesh: check the unit of DeformableBody");
            return Err(BodyError::Parameter { what, value: longest_m, allowed });
        }
        for &face in self.fixed.faces() {
            block = block.fix(face.into());
        }
        for &region in self.fixed.regions() {
            block = block.fix_within(region.of(&[])?);
        }
        if let Some((side, share)) = base(&self.fixed)? {
            let side = Face::from(side);
            // A plane through nodes contains them.
            let depth_m = (share + 1e-9) * size_m[side.axis()];
            block = block.fix(side).fix_within(Region::layer([-0.5 * size_m, 0.5 * size_m], side, depth_m));
        }
        if self.fixed.is_none() {
            block = block.allow_unconstrained();
        }
        if let Some(Slit { length_m, depth_m, opening_m }) = self.slit {
            block = block.slit(palpate_body::Slit { length_m, depth_m, opening_m });
        }
        for &Inclusion { region, tissue } in &self.inclusions {
            block = block.region(region.of(&[])?, tissue.into());
        }
        let tissue = self.tissue.into();
        let built = match self.family {
            ElementFamily::Hexahedra => block.elements(&tissue)?,
            ElementFamily::Springs => block.tissue(&tissue)?,
        };
        let built = built.placed(self.rotation, self.translation_m)?;
        Body::new(built.network, built.surface)
    }

    fn tetrahedra(&self, volume: &TetrahedralVolume, mesh: &TetrahedralMesh) -> Result<Body, BodyError> {
        if let Some(slit) = self.slit {
            let (what, allowed) = ("length of a slit in a volume, m", "absent: only a block can have a Slit");
            return Err(BodyError::Parameter { what, value: slit.length_m, allowed });
        }
        let (found, max) = (mesh.vertices_m().len(), CellLattice::MAX_NODES);
        if found > max {
            let (what, allowed) = (
                "number of nodes of a volume",
                "at most 10000, the most that can be stepped in time: remesh it coarser",
            );
            return Err(BodyError::Parameter { what, value: found as f64, allowed });
        }
        let part = |index: usize| {
            let (what, allowed) = ("index in BodyRegion::Part", "below the number of regions of the volume");
            let is_valid = index < volume.region_count();
            if is_valid {
                Ok(index)
            } else {
                Err(BodyError::Parameter { what, value: index as f64, allowed })
            }
        };
        // The region of an element of `mesh` is its index in the volume.
        let elements = || mesh.elements().iter().zip(mesh.regions());
        let mut made = mesh.clone();
        for &Inclusion { region, tissue } in &self.inclusions {
            let mut is_empty = true;
            let region = match region {
                BodyRegion::Part(index) => Err(part(index)?),
                region => Ok(region.of(&[])?),
            };
            for (nodes, index) in elements() {
                let middle_m = nodes.iter().map(|node| mesh.vertices_m()[*node]).sum::<DVec3>() / 4.0;
                let is_inside = match &region {
                    Ok(region) => region.contains(middle_m),
                    Err(part) => volume.region_of(*index) == *part,
                };
                if is_inside {
                    made = made.region(*index, tissue.into());
                    is_empty = false;
                }
            }
            if is_empty {
                let (what, allowed) = ("number of elements in an inclusion", "at least 1");
                return Err(BodyError::Parameter { what, value: 0.0, allowed });
            }
        }
        for &face in self.fixed.faces() {
            made = made.fix_face(face.into(), 0.0);
        }
        for &region in self.fixed.regions() {
            if let BodyRegion::Part(index) = region {
                let index = part(index)?;
                for (_, element) in elements().filter(|(_, element)| volume.region_of(**element) == index) {
                    made = made.fix_region(*element);
                }
            } else {
                made = made.fix_within(&region.of(&[])?);
            }
        }
        if let Some((side, share)) = base(&self.fixed)? {
            made = made.fix_face(side.into(), share);
        }
        if let FixedRegion::Vertices(vertices) = &self.fixed {
            if vertices.len() != volume.vertices.len() {
                let (what, allowed) =
                    ("length of FixedRegion::Vertices", "the number of vertices of the volume");
                return Err(BodyError::Parameter { what, value: vertices.len() as f64, allowed });
            }
            let fixed = vertices.iter().enumerate().filter(|(_, is_fixed)| **is_fixed);
            made = made.fix_vertices(fixed.map(|(vertex, _)| vertex));
        }
        if self.fixed.is_none() {
            made = made.allow_unconstrained();
        }
        let built = made.build(&self.tissue.into())?;
        Body::new(built.network.placed(self.rotation, self.translation_m)?, built.surface)
    }

    fn mesh(&self, joined: &JoinedMesh) -> Result<(Body, Skin, MeshReport), BodyError> {
        let (closed, parts) = (&joined.mesh, &joined.regions);
        if let Some(slit) = self.slit {
            let (what, allowed) = ("length of a slit in a mesh, m", "absent: only a block can have a Slit");
            return Err(BodyError::Parameter { what, value: slit.length_m, allowed });
        }
        let mut lattice = joined.lattice()?;
        for &face in self.fixed.faces() {
            lattice = lattice.fix_outermost(face.into());
        }
        for &region in self.fixed.regions() {
            lattice = lattice.fix(region.of(parts)?);
        }
        if let Some((side, share)) = base(&self.fixed)? {
            lattice = lattice.fix_base(side.into(), share);
        }
        if let FixedRegion::Vertices(vertices) = &self.fixed {
            lattice = lattice.fix_vertices(vertices)?;
        }
        if self.fixed.is_none() {
            lattice = lattice.allow_unconstrained();
        }
        for &Inclusion { region, tissue } in &self.inclusions {
            lattice = lattice.region(region.of(parts)?, tissue.into());
        }
        let tissue = self.tissue.into();
        let built = match self.family {
            ElementFamily::Hexahedra => lattice.elements(&tissue)?,
            ElementFamily::Springs => lattice.tissue(&tissue)?,
        };
        let built = built.placed(self.rotation, self.translation_m)?;
        let MeshBody { cells, deviation_m, .. } = built;
        let (repairs, assumptions) = (closed.repairs(), closed.assumptions());
        let JoinedMesh { piece_count, piece_share, .. } = *joined;
        let [low, high] = closed.bounds_m();
        let implausible_size = ImplausibleSize::of((high - low).max_element());
        let report = MeshReport {
            repairs,
            assumptions,
            implausible_size,
            piece_count,
            piece_share,
            thin_parts: Some(lattice.thin_parts()).filter(|thin| thin.share > 0.0),
            cells,
            deviation_m,
        };
        Ok((Body::new(built.network, built.surface)?, built.skin, report))
    }
}

/// Side and share of [`FixedRegion::Base`].
fn base(fixed: &FixedRegion) -> Result<Option<(BoxFace, f64)>, BodyError> {
    match *fixed {
        FixedRegion::Base { share, .. } if !(share > 0.0 && share < 1.0) => {
            let (what, allowed) = ("share of FixedRegion::Base", "above 0 and below 1");
            Err(BodyError::Parameter { what, value: share, allowed })
        }
        FixedRegion::Base { side, share } => Ok(Some((side, share))),
        _ => Ok(None),
    }
}
