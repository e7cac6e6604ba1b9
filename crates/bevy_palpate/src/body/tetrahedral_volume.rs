//! Volumes of tetrahedra as shapes of bodies.

use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{TetrahedralMesh, TetrahedralMeshError};

/// Tetrahedra of which a body is made: an asset, from a file or from an app's own data.
///
/// With the feature `mesh_files`, which is on by default, `assets.load("liver.msh")` is the volume of a Gmsh, VTK, VTU or TetGen file;
/// `TetrahedralFileLoader` has the details.
#[derive(Asset, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Debug, Default, PartialEq, Clone)]
pub struct TetrahedralVolume {
    /// Vertices, in the unit of [`TetrahedralShape::metres_per_unit`].
    pub vertices: Vec<DVec3>,
    /// Vertices of each tetrahedron. Inverted ones are reoriented.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Region of each tetrahedron, an index of [`Self::region_names`]; empty where all are in region 0.
    pub regions: Vec<u32>,
    /// Names of the regions, for messages.
    pub region_names: Vec<String>,
}

/// A volume of tetrahedra as the shape of a body. Its elements are those of the file, and its surface is their boundary.
///
/// [`BodyRegion::Part`](crate::BodyRegion::Part) names a region of the volume, for a tissue or a fixed part. The body is of tetrahedral elements;
/// [`ElementFamily`](crate::ElementFamily) has no effect.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_palpate::{BodyRegion, Inclusion, Inclusions, TetrahedralShape, prelude::*};
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     // A liver in millimetres, whose second region is a tumour.
///     let shape = TetrahedralShape { metres_per_unit: 0.001, ..TetrahedralShape::new(assets.load("liver.msh")) };
///     let tumour = Tissue { youngs_modulus_pa: 100e3, ..Tissue::LIVER };
///     let inclusion = Inclusion { region: BodyRegion::Part(1), tissue: tumour };
///     commands.spawn((DeformableBody::Tetrahedra(shape), Tissue::LIVER, Inclusions(vec![inclusion])));
/// }
/// ```
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
pub struct TetrahedralShape {
    /// The volume.
    pub volume: Handle<TetrahedralVolume>,
    /// Length of a unit of the volume, m: 0.001 for millimetres.
    pub metres_per_unit: f64,
}

impl TetrahedralShape {
    /// `volume` in metres.
    #[must_use]
    pub fn new(volume: Handle<TetrahedralVolume>) -> Self {
        Self { volume, metres_per_unit: 1.0 }
    }
}

impl TetrahedralVolume {
    /// The elements in metres, after repairs. The region of an element is its index in the list of tetrahedra, because repairs leave some out.
    pub(super) fn checked(&self, metres_per_unit: f64) -> Result<TetrahedralMesh, TetrahedralMeshError> {
        let vertices_m = self.vertices.iter().map(|x| metres_per_unit * *x).collect();
        let elements: Vec<[usize; 4]> =
            self.tetrahedra.iter().map(|of| of.map(|vertex| vertex as usize)).collect();
        let (found, elements_count) = (self.regions.len(), elements.len());
        if found != 0 && found != elements_count {
            return Err(TetrahedralMeshError::Regions { found, elements: elements_count });
        }
        let own: Vec<u32> = (0..elements_count as u32).collect();
        TetrahedralMesh::new(vertices_m, &elements, &own)
    }

    /// Region of the tetrahedron at `index`.
    pub(super) fn region_of(&self, index: u32) -> usize {
        self.regions.get(index as usize).map_or(0, |region| *region as usize)
    }

    /// Number of regions.
    pub(super) fn region_count(&self) -> usize {
        self.regions.iter().max().map_or(1, |last| *last as usize + 1)
    }
}
