//! Affine maps of nodes.

use super::document::Node;

/// An affine map: columns of its matrix, and the image of the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transform {
    columns: [[f64; 3]; 3],
    origin: [f64; 3],
}

impl Transform {
    pub const IDENTITY: Self =
        Self { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], origin: [0.0; 3] };

    /// The map from a node to its parent.
    pub fn of(node: &Node) -> Self {
        if let Some(m) = node.matrix {
            return Self {
                columns: [[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]],
                origin: [m[12], m[13], m[14]],
            };
        }
        let [x, y, z, w] = unit(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
        let [sx, sy, sz] = node.scale.unwrap_or([1.0; 3]);
        let columns = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)].map(|v| v * sx),
            [2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)].map(|v| v * sy),
            [2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)].map(|v| v * sz),
        ];
        Self { columns, origin: node.translation.unwrap_or_default() }
    }

    /// The map that applies `inner` first.
    pub fn after(&self, inner: &Self) -> Self {
        Self { columns: inner.columns.map(|column| self.vector(column)), origin: self.point(inner.origin) }
    }

    pub fn point(&self, point: [f64; 3]) -> [f64; 3] {
        let vector = self.vector(point);
        std::array::from_fn(|axis| vector[axis] + self.origin[axis])
    }

    fn vector(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = &self.columns;
        std::array::from_fn(|axis| a[axis] * x + b[axis] * y + c[axis] * z)
    }

    /// Direction of the normal of a mapped plane, not of length 1. It stays on the same side of the plane under a mirror image.
    pub fn normal(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = self.columns;
        let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
        let sign = if self.is_mirror() { -1.0 } else { 1.0 };
        std::array::from_fn(|axis| sign * (bc[axis] * x + ca[axis] * y + ab[axis] * z))
    }

    /// True where the map turns a right hand into a left one.
    pub fn is_mirror(&self) -> bool {
        let [a, b, c] = self.columns;
        let normal = cross(a, b);
        normal[0] * c[0] + normal[1] * c[1] + normal[2] * c[2] < 0.0
    }
}

/// `quaternion` with length 1: rounded to `f32` in a file, it would scale as well. One that has no direction is no rotation.
fn unit(quaternion: [f64; 4]) -> [f64; 4] {
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() { quaternion.map(|x| x / length) } else { [0.0, 0.0, 0.0, 1.0] }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
