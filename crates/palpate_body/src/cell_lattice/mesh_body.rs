//! The body of a lattice of cells.

use super::MeshCells;
use crate::{BodyError, Network, Skin, Surface};
use glam::{DQuat, DVec3};

/// A body made from a mesh.
#[derive(Clone, Debug)]
pub struct MeshBody {
    /// Nodes, masses and springs.
    pub network: Network,
    /// Touchable surface: the mesh, with triangles of a size that fits the cells.
    pub surface: Surface,
    /// Deformation of the given mesh with the nodes.
    pub skin: Skin,
    /// Statistics of the cells.
    pub cells: MeshCells,
    /// Maximum distance of a point of the mesh's enclosing surface from the touchable surface, m.
    pub deviation_m: f64,
}

impl MeshBody {
    /// Rotates the body by `rotation` about the origin and then translates it by `translation_m`, m.
    ///
    /// # Errors
    /// As [`Network::placed`].
    pub fn placed(mut self, rotation: DQuat, translation_m: DVec3) -> Result<Self, BodyError> {
        self.network = self.network.placed(rotation, translation_m)?;
        Ok(self)
    }
}
