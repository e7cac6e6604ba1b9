//! One part of a mesh file, as placed.

/// Maximum number of vertices, and of triangles, of a file. A piece that is placed several times counts as often.
pub(crate) const MAX_ELEMENTS: usize = 20_000_000;

/// One primitive, group or solid of a file, as it is placed in the scene.
///
/// The coordinates have the unit and the axes of the file. glTF prescribes metres with y upward; OBJ, STL and PLY prescribe nothing, and
/// anatomical models in these formats are usually in millimetres. Values that are not finite are not rejected.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshPiece {
    /// Name of the node that places the piece (glTF), of the object or group (OBJ), or of the solid (STL).
    pub node: Option<String>,
    /// Index of the mesh (glTF), of the object or group (OBJ) or of the solid (STL) in the file, from 0.
    pub mesh: usize,
    /// Name of the mesh (glTF); otherwise the same as [`MeshPiece::node`].
    pub mesh_name: Option<String>,
    /// Index of the primitive in its mesh (glTF), or of the material in its object (OBJ), from 0.
    pub primitive: usize,
    /// Name of the material.
    pub material: Option<String>,
    /// Positions of the vertices, in the unit of the file.
    pub vertices: Vec<[f32; 3]>,
    /// Normals of the vertices, as many as vertices, if the file has one for each. They have length 1 unless the file has a zero normal.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Vertices of each triangle, counter-clockwise seen from outside. Each index is below the number of vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl MeshPiece {
    /// Smallest and largest coordinates of the vertices, in the unit of the file. `None` without vertices. NaN is left out.
    pub fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        bounds(self.vertices.iter())
    }
}

impl std::fmt::Display for MeshPiece {
    /// Writes one line for a list of the content of a file.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = |name: &Option<String>| name.clone().unwrap_or_else(|| "-".into());
        write!(
            f,
            "mesh {} primitive {}  node {}  mesh name {}  material {}  {} triangles",
            self.mesh,
            self.primitive,
            name(&self.node),
            name(&self.mesh_name),
            name(&self.material),
            self.triangles.len()
        )
    }
}

/// Smallest and largest coordinates of `points`.
pub(crate) fn bounds<'a>(points: impl Iterator<Item = &'a [f32; 3]>) -> Option<[[f32; 3]; 2]> {
    points.fold(None, |bounds, point| {
        let [low, high] = bounds.unwrap_or([*point, *point]);
        Some([
            [low[0].min(point[0]), low[1].min(point[1]), low[2].min(point[2])],
            [high[0].max(point[0]), high[1].max(point[1]), high[2].max(point[2])],
        ])
    })
}

/// `vector` with length 1, in the precision of a piece. A vector of length 0, or one that is not finite, stays as it is.
pub(crate) fn unit(vector: [f64; 3]) -> [f32; 3] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    let divisor = if length > 0.0 && length.is_finite() { length } else { 1.0 };
    vector.map(|x| (x / divisor) as f32)
}
