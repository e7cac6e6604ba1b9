//! Conversion of Bevy's meshes to closed meshes.

use super::shape::MeshShape;
use crate::fault::MeshFault;
use bevy::mesh::{Indices, Mesh, MeshAccessError, PrimitiveTopology, VertexAttributeValues};
use glam::DVec3;
use palpate_body::{BodyError, JoinOptions, JoinedMesh, MeshClosing, MeshPart};
use std::sync::Arc;

/// The mesh from which a body is built.
pub(super) enum Source {
    /// Data of mesh assets, and how they are joined.
    Raw { parts: Vec<MeshPart>, options: JoinOptions },
    /// A mesh that has been closed before.
    Closed(Arc<JoinedMesh>),
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

    /// Converts the data to a closed mesh.
    pub(super) fn close(self) -> Result<Arc<JoinedMesh>, BodyError> {
        match self {
            Self::Closed(mesh) => Ok(mesh),
            Self::Raw { parts, options } => Ok(Arc::new(JoinedMesh::new(&parts, options)?)),
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
