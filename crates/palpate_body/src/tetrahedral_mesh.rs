//! Meshes of tetrahedra from files or other programs, and the bodies made of them.

mod checks;
mod error;
mod faces;
mod quality;
mod report;

pub use error::TetrahedralMeshError;
pub use report::TetrahedralReport;

use crate::{BodyError, BodyPoint, Face, Network, NetworkBuilder, Region, Surface, Tissue};
use glam::DVec3;
use std::collections::BTreeMap;

/// A mesh of four-node tetrahedra that becomes a body.
///
/// | problem | treatment |
/// |--|--|
/// | inverted element | reoriented |
/// | repeated element, element with a vertex twice | left out |
/// | flat element at the boundary | left out, where the boundary stays a surface |
/// | flat element inside | rejected |
/// | vertex without element | left out |
/// | face of more than two elements, edge or vertex where the boundary is no surface, separate parts, slivers | reported |
///
/// ```
/// use glam::DVec3;
/// use palpate_body::{Face, TetrahedralMesh, Tissue};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let vertices_m = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE].map(|x| 0.1 * x).to_vec();
/// let mesh = TetrahedralMesh::new(vertices_m, &[[0, 1, 2, 3], [1, 2, 3, 4]], &[])?;
/// assert_eq!(mesh.report().elements, 2);
/// let body = mesh.fix_face(Face::NegZ, 0.0).build(&Tissue::SOFT)?;
/// assert_eq!(body.surface.triangles.len(), 6);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct TetrahedralMesh {
    vertices_m: Vec<DVec3>,
    /// Index of each vertex in the list given.
    given: Vec<usize>,
    elements: Vec<[usize; 4]>,
    /// Region of each element.
    regions: Vec<u32>,
    /// Boundary faces, counter-clockwise as seen from outside.
    boundary: Vec<[usize; 3]>,
    report: TetrahedralReport,
    tissues: BTreeMap<u32, Tissue>,
    fixed: Vec<bool>,
    empty_fixed: Option<usize>,
    allow_free: bool,
}

/// The network and the surface of a mesh of tetrahedra.
#[derive(Clone, Debug)]
pub struct TetrahedralBody {
    /// Network. Node i is vertex `given_vertex[i]` of the lists that the mesh was made of.
    pub network: Network,
    /// Boundary faces.
    pub surface: Surface,
    /// Index of the given vertex of each node.
    pub given_vertex: Vec<usize>,
    /// Report of the mesh.
    pub report: TetrahedralReport,
}

impl TetrahedralMesh {
    /// Creates a mesh of `elements` between vertices at `vertices_m`, m, after repairs. `regions` has a region for each element, or is empty where
    /// all are in region 0.
    ///
    /// # Errors
    /// [`TetrahedralMeshError`] for an index beyond the vertices, a position that is not finite, a list of another length, no element of a volume,
    /// or a flat element inside.
    pub fn new(
        vertices_m: Vec<DVec3>,
        elements: &[[usize; 4]],
        regions: &[u32],
    ) -> Result<Self, TetrahedralMeshError> {
        let (count, mut report) = (vertices_m.len(), TetrahedralReport::default());
        let mut kept = checks::elements(&vertices_m, elements, regions)?;
        checks::leave_out_repeated(&mut kept, &mut report);
        checks::reorient(&vertices_m, &mut kept, &mut report);
        checks::leave_out_flat(&vertices_m, &mut kept, &mut report)?;
        let given = checks::compact(count, &mut kept);
        report.unused_vertices = count - given.len();
        let vertices_m: Vec<DVec3> = given.iter().map(|vertex| vertices_m[*vertex]).collect();
        let elements: Vec<[usize; 4]> = kept.iter().map(|of| of.nodes).collect();
        let boundary = faces::boundary(&elements, &mut report);
        report.measure(&vertices_m, &elements);
        Ok(Self {
            fixed: vec![false; vertices_m.len()],
            regions: kept.iter().map(|of| of.region).collect(),
            tissues: BTreeMap::new(),
            empty_fixed: None,
            allow_free: false,
            vertices_m,
            given,
            elements,
            boundary,
            report,
        })
    }

    /// Number of repairs and problems.
    #[must_use]
    pub fn report(&self) -> &TetrahedralReport {
        &self.report
    }

    /// Vertices that elements use, m: the nodes of the body.
    #[must_use]
    pub fn vertices_m(&self) -> &[DVec3] {
        &self.vertices_m
    }

    /// Elements as indices of [`TetrahedralMesh::vertices_m`].
    #[must_use]
    pub fn elements(&self) -> &[[usize; 4]] {
        &self.elements
    }

    /// Region of each element.
    #[must_use]
    pub fn regions(&self) -> &[u32] {
        &self.regions
    }

    /// Boundary faces as indices of [`TetrahedralMesh::vertices_m`], counter-clockwise as seen from outside.
    #[must_use]
    pub fn boundary(&self) -> &[[usize; 3]] {
        &self.boundary
    }

    /// Minimum and maximum coordinates, m.
    #[must_use]
    pub fn bounds_m(&self) -> [DVec3; 2] {
        let least = self.vertices_m.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        [least, self.vertices_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max)]
    }

    /// Fills the elements of `region` with `tissue`.
    #[must_use]
    pub fn region(mut self, region: u32, tissue: Tissue) -> Self {
        self.tissues.insert(region, tissue);
        self
    }

    /// Fixes the nodes within `share` of the extent of the mesh from its side `face`; a share of 0 fixes the outermost ones.
    #[must_use]
    pub fn fix_face(self, face: Face, share: f64) -> Self {
        let bounds_m = self.bounds_m();
        let extent_m = (bounds_m[1] - bounds_m[0])[face.axis()];
        self.fix_within(&Region::layer(bounds_m, face, (share.max(0.0) + ROUNDING) * extent_m))
    }

    /// Fixes the nodes in `region`.
    #[must_use]
    pub fn fix_within(mut self, region: &Region) -> Self {
        for (fixed, x) in self.fixed.iter_mut().zip(&self.vertices_m) {
            *fixed |= region.contains(*x);
        }
        self
    }

    /// Fixes the nodes of the elements of `region`.
    #[must_use]
    pub fn fix_region(mut self, region: u32) -> Self {
        for (nodes, _) in self.elements.iter().zip(&self.regions).filter(|(_, of)| **of == region) {
            nodes.iter().for_each(|node| self.fixed[*node] = true);
        }
        self
    }

    /// Fixes the vertices with these indices in the given list, where elements use them. An index beyond the list is reported by
    /// [`TetrahedralMesh::build`].
    #[must_use]
    pub fn fix_vertices(mut self, vertices: impl IntoIterator<Item = usize>) -> Self {
        let given_count = self.given.len() + self.report.unused_vertices;
        for vertex in vertices {
            match self.given.binary_search(&vertex) {
                Ok(node) => self.fixed[node] = true,
                Err(_) if vertex < given_count => {}
                Err(_) => self.empty_fixed = Some(vertex),
            }
        }
        self
    }

    /// Allows a body without fixed nodes, and separate parts.
    #[must_use]
    pub fn allow_unconstrained(mut self) -> Self {
        self.allow_free = true;
        self
    }

    /// Creates the body. Elements of regions without a tissue of their own get `tissue`.
    ///
    /// # Errors
    /// [`BodyError`] if a tissue is invalid, a fixed vertex does not exist, all nodes are fixed, or, without
    /// [`TetrahedralMesh::allow_unconstrained`], none is or there are separate parts.
    pub fn build(&self, tissue: &Tissue) -> Result<TetrahedralBody, BodyError> {
        if let Some(node) = self.empty_fixed {
            return Err(BodyError::Fixed { node, nodes: self.given.len() + self.report.unused_vertices });
        }
        let mut network = NetworkBuilder::new();
        self.vertices_m.iter().for_each(|x| {
            network.node(*x, 0.0);
        });
        for (nodes, region) in self.elements.iter().zip(&self.regions) {
            network.tetrahedra(&[*nodes], self.tissues.get(region).unwrap_or(tissue));
        }
        let fixed = self.fixed.iter().enumerate().filter(|(_, fixed)| **fixed).map(|(node, _)| node);
        let network = network.fix(fixed);
        let network = if self.allow_free { network.allow_unconstrained() } else { network }.build()?;
        Ok(TetrahedralBody {
            network,
            surface: self.surface(),
            given_vertex: self.given.clone(),
            report: self.report,
        })
    }

    /// The boundary faces as a surface.
    fn surface(&self) -> Surface {
        let mut surface = Surface::default();
        let mut point_of: Vec<Option<usize>> = vec![None; self.vertices_m.len()];
        for face in &self.boundary {
            let corners = face.map(|node| {
                *point_of[node].get_or_insert_with(|| {
                    surface.points.push(BodyPoint::node(node));
                    surface.points.len() - 1
                })
            });
            surface.triangles.push(corners);
        }
        surface.vertices = (0..surface.points.len()).collect();
        surface
    }
}

/// Share of the extent within which a vertex is on a face.
const ROUNDING: f64 = 1e-6;
