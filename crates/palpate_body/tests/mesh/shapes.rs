//! Closed test meshes with their geometry.

use glam::{DQuat, DVec3};
use palpate_body::{ClosedMesh, MeshError};
use std::collections::HashMap;

#[derive(Clone, Default)]
pub struct Shape {
    pub vertices: Vec<DVec3>,
    pub triangles: Vec<[usize; 3]>,
}

impl Shape {
    pub fn close(&self) -> Result<ClosedMesh, MeshError> {
        ClosedMesh::new(self.vertices.clone(), self.triangles.clone())
    }

    pub fn and(mut self, other: &Self) -> Self {
        let first = self.vertices.len();
        self.vertices.extend(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
        self
    }

    pub fn inside_out(mut self) -> Self {
        self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        self
    }

    pub fn map(mut self, of: impl Fn(DVec3) -> DVec3) -> Self {
        self.vertices.iter_mut().for_each(|x| *x = of(*x));
        self
    }

    pub fn moved(self, by: DVec3) -> Self {
        self.map(|x| x + by)
    }

    pub fn turned(self, by: DQuat) -> Self {
        self.map(|x| by * x)
    }

    /// Separate vertices for every triangle, as in flat shading.
    pub fn split(&self) -> Self {
        let vertices = self.triangles.iter().flatten().map(|&v| self.vertices[v]).collect();
        Self {
            vertices,
            triangles: (0..self.triangles.len()).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        }
    }

    pub fn volume(&self) -> f64 {
        let of = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|v| self.vertices[v] - self.vertices[0]);
            a.dot(b.cross(c)) / 6.0
        };
        self.triangles.iter().map(of).sum()
    }
}

/// A box around the origin with `n` fields along each edge, welded.
pub fn cuboid(size: DVec3, n: [usize; 3]) -> Shape {
    let mut shape = Shape::default();
    let mut known = HashMap::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0, n[axis]] {
            let mut at = |p: usize, q: usize| {
                let mut ijk = [0; 3];
                (ijk[axis], ijk[u], ijk[v]) = (side, p, q);
                *known.entry(ijk).or_insert_with(|| {
                    let share = DVec3::from_array([0, 1, 2].map(|i| ijk[i] as f64 / n[i] as f64 - 0.5));
                    shape.vertices.push(size * share);
                    shape.vertices.len() - 1
                })
            };
            for (p, q) in (0..n[u]).flat_map(|p| (0..n[v]).map(move |q| (p, q))) {
                let [a, b, c, d] = [at(p, q), at(p + 1, q), at(p + 1, q + 1), at(p, q + 1)];
                let both = [[a, b, c], [a, c, d]];
                shape.triangles.extend(both.map(|[a, b, c]| if side == 0 { [a, c, b] } else { [a, b, c] }));
            }
        }
    }
    shape
}

pub fn cube(size: f64) -> Shape {
    cuboid(DVec3::splat(size), [1; 3])
}

/// A cube with `n` fields along its edges, projected onto a sphere.
pub fn sphere(radius: f64, n: usize) -> Shape {
    cuboid(DVec3::splat(2.0), [n; 3])
        .map(|x| radius * (x * std::f64::consts::FRAC_PI_4).map(f64::tan).normalize())
}

/// A torus around the z axis.
pub fn torus(radius: f64, tube: f64, round: usize, across: usize) -> Shape {
    let mut shape = Shape::default();
    for (i, j) in (0..round).flat_map(|i| (0..across).map(move |j| (i, j))) {
        let (u, v) = (i as f64 / round as f64, j as f64 / across as f64);
        let (sin, cos) = (u * std::f64::consts::TAU).sin_cos();
        let (up, out) = (v * std::f64::consts::TAU).sin_cos();
        let from_axis = radius + tube * out;
        shape.vertices.push(DVec3::new(from_axis * cos, from_axis * sin, tube * up));
        let at = |i: usize, j: usize| i % round * across + j % across;
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        shape.triangles.extend([[a, b, c], [a, c, d]]);
    }
    shape
}
