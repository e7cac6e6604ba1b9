//! Conversion of assets to closed meshes and checked volumes.

use super::shape::MeshShape;
use super::tetrahedral_volume::{TetrahedralShape, TetrahedralVolume};
use crate::fault::{HapticFaultKind, MeshFault};
use bevy::mesh::{Indices, Mesh, MeshAccessError, PrimitiveTopology, VertexAttributeValues};
use glam::DVec3;
use palpate_body::{JoinOptions, JoinedMesh, MeshClosing, MeshPart, TetrahedralMesh};
use std::sync::Arc;

/// The mesh or the volume from which a body is built.
pub(super) enum Source {
    /// Data of mesh assets, and how they are joined.
    Raw { parts: Vec<MeshPart>, options: JoinOptions },
    /// A mesh that has been closed before.
    Closed(Arc<JoinedMesh>),
    /// Data of a volume asset, and the length of its unit, m.
    Volume { volume: TetrahedralVolume, metres_per_unit: f64 },
}

/// A source that has been checked.
pub(super) enum CheckedSource {
    Mesh(Arc<JoinedMesh>),
    Volume { volume: TetrahedralVolume, mesh: Box<TetrahedralMesh> },
}

impl Source {
    /// The data of the parts of a mesh.
    pub(super) fn raw(parts: Vec<MeshPart>, shape: &MeshShape) -> Result<Self, MeshFault> {
        let scale_m = shape.metres_per_unit;
        let closing = if shape.strict {
            MeshClosing::Strict
        } else {
            MeshClosing::Enclose { thickness_m: shape.thickness_m }
        };
        if scale_m.is_finite() && scale_m > 0.0 {
            let options =
                JoinOptions { scale_m, closing, pieces: shape.pieces.into(), cells: shape.cells.into() };
            Ok(Self::Raw { parts, options })
        } else {
            Err(MeshFault::Scale(scale_m))
        }
    }

    /// The data of a volume.
    pub(super) fn volume(volume: &TetrahedralVolume, shape: &TetrahedralShape) -> Result<Self, MeshFault> {
        let metres_per_unit = shape.metres_per_unit;
        if metres_per_unit.is_finite() && metres_per_unit > 0.0 {
            Ok(Self::Volume { volume: volume.clone(), metres_per_unit })
        } else {
            Err(MeshFault::Scale(metres_per_unit))
        }
    }

    /// Converts the data to a closed mesh, or checks the volume.
    pub(super) fn check(self) -> Result<CheckedSource, HapticFaultKind> {
        match self {
            Self::Closed(mesh) => Ok(CheckedSource::Mesh(mesh)),
            Self::Raw { parts, options } => match JoinedMesh::new(&parts, options) {
                Ok(mesh) => Ok(CheckedSource::Mesh(Arc::new(mesh))),
                Err(error) => Err(HapticFaultKind::BuildBody(error.into())),
            },
            Self::Volume { volume, metres_per_unit } => match volume.checked(metres_per_unit) {
                Ok(mesh) => Ok(CheckedSource::Volume { volume, mesh: Box::new(mesh) }),
                Err(error) => Err(HapticFaultKind::Mesh(MeshFault::Tetrahedra(error))),
            },
        }
    }
}

/// Reads the data of `mesh`.
pub(super) fn read(mesh: &Mesh) -> Result<MeshPart, MeshFault> {
    if mesh.primitive_topology() != PrimitiveTopology::TriangleList {
        return Err(MeshFault::Topology(mesh.primitive_topology()));
    }
    let vectors = |id| match mesh.try_attribute(id) {
        Ok(VertexAttributeValues::Float32x3(values)) => Ok(values),
        Err(MeshAccessError::ExtractedToRenderWorld) => Err(MeshFault::NotInMemory),
        Ok(_) | Err(MeshAccessError::NotFound) => Err(MeshFault::NoPositions),
    };
    let to_f64 = |v: &[f32; 3]| DVec3::from_array(v.map(f64::from));
    let vertices = vectors(Mesh::ATTRIBUTE_POSITION)?.clone();
    let normals = vectors(Mesh::ATTRIBUTE_NORMAL).ok().map(|normals| normals.iter().map(to_f64).collect());
    let corners: Vec<usize> = match mesh.try_indices() {
        Ok(Indices::U16(indices)) => indices.iter().map(|&i| i.into()).collect(),
        Ok(Indices::U32(indices)) => indices.iter().map(|&i| i as usize).collect(),
        Err(_) => (0..vertices.len()).collect(),
    };
    if !corners.len().is_multiple_of(3) {
        return Err(MeshFault::Incomplete(corners.len()));
    }
    let triangles = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    Ok(MeshPart { vertices, triangles, normals })
}
