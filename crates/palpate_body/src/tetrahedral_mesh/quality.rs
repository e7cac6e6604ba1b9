//! Quality of a tetrahedron.

use glam::DVec3;

/// 12 (3V)^⅔ over the sum of the squared edges: 1 for a regular tetrahedron, 0 for a flat one, below 0 for an inverted one (A. Liu and B. Joe, BIT
/// 34 (1994) 268).
pub(super) fn mean_ratio([o, a, b, c]: [DVec3; 4]) -> f64 {
    let volume3 = (a - o).dot((b - o).cross(c - o)) / 2.0;
    let squares: f64 = [a - o, b - o, c - o, b - a, c - a, c - b].iter().map(|e| e.length_squared()).sum();
    if squares > 0.0 { 12.0 * volume3.cbrt() * volume3.cbrt() * volume3.signum() / squares } else { 0.0 }
}
