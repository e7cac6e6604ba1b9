//! Convex hull of points.

use glam::DVec3;

/// Distance from a face, relative to the size of the hull, up to which a point counts as lying on it.
const ON_FACE: f64 = 1e-12;
/// Thickness of the points, relative to their size, up to which they count as flat.
const FLAT: f64 = 1e-9;

/// The triangles of the convex hull of `points_m` as indices, counter-clockwise as seen from outside. If the points
/// have no volume, returns the thickness relative to the size, or 0.
///
/// Points are added one by one: the faces that a point sees are replaced by the cone from their rim to the point.
pub(super) fn convex_hull(points_m: &[DVec3]) -> Result<Vec<[usize; 3]>, f64> {
    let first = first_tetrahedron(points_m)?;
    let size_m = farthest(points_m, |x| x.distance(points_m[first[0]])).1;
    let mut faces: Vec<Face> = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        .into_iter()
        .map(|face| Face::new(points_m, face.map(|corner| first[corner])))
        .collect();
    for (point, &x) in points_m.iter().enumerate().filter(|(point, _)| !first.contains(point)) {
        let (seen, kept): (Vec<Face>, Vec<Face>) =
            faces.iter().partition(|face| face.height_m(x) > ON_FACE * size_m);
        if seen.is_empty() {
            continue;
        }
        let edges: Vec<(usize, usize)> = seen.iter().flat_map(Face::edges).collect();
        faces = kept;
        for &(a, b) in edges.iter().filter(|(a, b)| !edges.contains(&(*b, *a))) {
            faces.push(Face::new(points_m, [a, b, point]));
        }
    }
    Ok(faces.into_iter().map(|face| face.corners).collect())
}

#[derive(Clone, Copy)]
struct Face {
    corners: [usize; 3],
    origin_m: DVec3,
    normal: DVec3,
}

impl Face {
    fn new(points_m: &[DVec3], corners: [usize; 3]) -> Self {
        let [a, b, c] = corners.map(|corner| points_m[corner]);
        Self { corners, origin_m: a, normal: (b - a).cross(c - a).normalize_or_zero() }
    }

    fn height_m(&self, x_m: DVec3) -> f64 {
        (x_m - self.origin_m).dot(self.normal)
    }

    fn edges(&self) -> [(usize, usize); 3] {
        let [a, b, c] = self.corners;
        [(a, b), (b, c), (c, a)]
    }
}

/// Four points that span a volume, the first three counter-clockwise as seen from outside.
fn first_tetrahedron(points_m: &[DVec3]) -> Result<[usize; 4], f64> {
    if points_m.is_empty() {
        return Err(0.0);
    }
    let a = farthest(points_m, |x| -x.x).0;
    let (b, size_m) = farthest(points_m, |x| x.distance(points_m[a]));
    let along = (points_m[b] - points_m[a]).normalize_or_zero();
    let (c, width_m) = farthest(points_m, |x| (x - points_m[a]).cross(along).length());
    let normal = (points_m[b] - points_m[a]).cross(points_m[c] - points_m[a]).normalize_or_zero();
    let (d, thick_m) = farthest(points_m, |x| (x - points_m[a]).dot(normal).abs());
    let least_m = thick_m.min(width_m);
    if !(size_m > 0.0 && least_m > FLAT * size_m) {
        return Err(if size_m > 0.0 { least_m / size_m } else { 0.0 });
    }
    let is_above = (points_m[d] - points_m[a]).dot(normal) > 0.0;
    Ok(if is_above { [a, c, b, d] } else { [a, b, c, d] })
}

/// The first point of the largest measure, and that measure.
fn farthest(points_m: &[DVec3], measure: impl Fn(DVec3) -> f64) -> (usize, f64) {
    let mut found = (0, f64::NEG_INFINITY);
    for (point, &x) in points_m.iter().enumerate() {
        let size = measure(x);
        if size > found.1 {
            found = (point, size);
        }
    }
    found
}
