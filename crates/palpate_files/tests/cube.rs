//! The unit cube from which most tests make their files.

use palpate_files::MeshPiece;

/// Corner `i` has the coordinates of the bits of `i`: x the lowest.
pub const VERTICES: [[f32; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
];

/// Faces, counter-clockwise seen from outside.
pub const QUADS: [[u32; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// Each face as a fan about its first corner.
pub fn triangles() -> Vec<[u32; 3]> {
    QUADS.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect()
}

/// Volume inside, positive where the triangles are counter-clockwise seen from outside.
pub fn volume(piece: &MeshPiece) -> f32 {
    let corner = |index: u32| piece.vertices[index as usize];
    let six_fold = piece.triangles.iter().map(|[a, b, c]| {
        let (a, b, c) = (corner(*a), corner(*b), corner(*c));
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    });
    six_fold.sum::<f32>() / 6.0
}

/// The coordinates in the order of the vertices, lowest byte first.
pub fn position_bytes(vertices: &[[f32; 3]]) -> Vec<u8> {
    vertices.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
}
