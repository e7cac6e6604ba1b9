//! Benchmarks of palpate, one in each file, and their common mesh.

use glam::DVec3;

/// Positions, m, and triangles of a lump 0.12 m long with about `vertices` vertices, on circles of latitude from pole to pole.
#[must_use]
pub fn lump(vertices: usize) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let rings = (vertices as f64 / 2.0).sqrt() as usize;
    let round = 2 * rings;
    let place = |u: f64, v: f64| {
        let x = DVec3::new(u.sin() * v.cos(), u.cos(), u.sin() * v.sin());
        x * DVec3::new(0.06, 0.03, 0.04) * (1.0 + 0.15 * (3.0 * x.x + 2.0 * x.z).sin())
    };
    let mut at = vec![place(0.0, 0.0)];
    for ring in 1..=rings {
        let u = std::f64::consts::PI * ring as f64 / (rings + 1) as f64;
        at.extend((0..round).map(|i| place(u, std::f64::consts::TAU * i as f64 / round as f64)));
    }
    at.push(place(std::f64::consts::PI, 0.0));
    let on = |ring: usize, i: usize| 1 + ring * round + i % round;
    let last = at.len() - 1;
    let mut triangles = Vec::new();
    for i in 0..round {
        triangles.extend([[0, on(0, i + 1), on(0, i)], [last, on(rings - 1, i), on(rings - 1, i + 1)]]);
        for ring in 0..rings - 1 {
            let [a, b, c, d] = [on(ring, i), on(ring, i + 1), on(ring + 1, i + 1), on(ring + 1, i)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    (at, triangles)
}
