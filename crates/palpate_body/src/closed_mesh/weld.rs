//! Welding of coincident vertices.

use glam::{DVec3, I64Vec3};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// The welded point of each vertex that a triangle uses. A mesh has millions of vertices, so indices are 32 bits wide.
#[derive(Clone, Debug)]
pub(super) struct PointOfVertex(Vec<u32>);

impl PointOfVertex {
    /// The point of `vertex`; `None` for one that no triangle uses.
    pub(super) fn of(&self, vertex: usize) -> Option<usize> {
        Some(self.0[vertex] as usize).filter(|point| *point != NONE as usize)
    }
}

pub(super) struct Welded {
    pub point_of: PointOfVertex,
    /// Positions relative to the centre, m.
    pub points_m: Vec<DVec3>,
    /// Number of vertices that coincide with an earlier one.
    pub count: usize,
}

/// Welds the vertices of `triangles` that are within `tolerance_m` of each other. The first of them in vertex order
/// defines the point. `tolerance_m` is at least a millionth of the largest coordinate relative to `center_m`.
pub(super) fn weld(
    vertices_m: &[DVec3],
    triangles: &[[usize; 3]],
    center_m: DVec3,
    tolerance_m: f64,
) -> Welded {
    let mut named = vec![false; vertices_m.len()];
    triangles.iter().flatten().for_each(|&vertex| named[vertex] = true);
    let mut welded =
        Welded { point_of: PointOfVertex(vec![NONE; vertices_m.len()]), points_m: Vec::new(), count: 0 };
    // Boxes are much wider than the tolerance, so that few points are close to a side.
    let box_m = 16.0 * tolerance_m;
    let box_of = |x: DVec3| (x / box_m).floor().as_i64vec3();
    // The latest point of each box, and the one before each point in its box.
    let count = named.iter().filter(|is_named| **is_named).count();
    let mut latest: HashMap<u64, u32, BuildHasherDefault<BoxHasher>> =
        HashMap::with_capacity_and_hasher(count, BuildHasherDefault::default());
    let mut before: Vec<u32> = Vec::new();
    for vertex in (0..vertices_m.len()).filter(|&vertex| named[vertex]) {
        let x = vertices_m[vertex] - center_m;
        let first_in = |key: I64Vec3| {
            let points =
                std::iter::successors(latest.get(&number(key)), |point| before.get(**point as usize));
            let near = points
                .map(|point| *point as usize)
                .take_while(|point| *point != NONE as usize)
                .filter(|point| welded.points_m[*point].distance(x) <= tolerance_m);
            near.last()
        };
        let found = boxes_between(box_of(x - tolerance_m), box_of(x + tolerance_m)).find_map(first_in);
        welded.count += usize::from(found.is_some());
        let point = found.unwrap_or_else(|| {
            let point = welded.points_m.len();
            before.push(latest.insert(number(box_of(x)), point as u32).unwrap_or(NONE));
            welded.points_m.push(x);
            point
        });
        welded.point_of.0[vertex] = point as u32;
    }
    welded
}

/// No point: the end of the list of a box, and the point of a vertex that no triangle uses.
const NONE: u32 = u32::MAX;

/// Number of a box: 21 bits along each axis, of which a mesh takes 17.
fn number(key: I64Vec3) -> u64 {
    let [x, y, z] = key.to_array().map(|along| along as u64 & 0x1F_FFFF);
    x | y << 21 | z << 42
}

/// Mixes the numbers of boxes (D. Stafford's variant 13 of the finalizer of MurmurHash3).
#[derive(Default)]
struct BoxHasher(u64);

impl Hasher for BoxHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_u64(self.0 << 8 | u64::from(*byte)));
    }

    fn write_u64(&mut self, number: u64) {
        let z = (number ^ number >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        self.0 = z ^ z >> 31;
    }
}

fn boxes_between(low: I64Vec3, high: I64Vec3) -> impl Iterator<Item = I64Vec3> {
    (low.x..=high.x).flat_map(move |x| {
        (low.y..=high.y).flat_map(move |y| (low.z..=high.z).map(move |z| I64Vec3::new(x, y, z)))
    })
}
