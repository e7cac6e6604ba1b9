//! The nearest point of a triangle.

use glam::DVec3;

/// Barycentric weights of the point of a triangle nearest to `p`.
#[must_use]
pub fn nearest_weights(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let of = |x: DVec3| (ab.dot(p - x), ac.dot(p - x));
    weights_of_products(of(a), of(b), of(c))
}

/// Barycentric weights of the point of a triangle nearest to p, on a corner, an edge or the face, by the regions of
/// C. Ericson, Real-Time Collision Detection (2005), section 5.1.5. The arguments are the scalar products of the
/// edges AB and AC with the vectors from A, B and C to p.
#[inline]
pub(crate) fn weights_of_products(
    (d1, d2): (f64, f64),
    (d3, d4): (f64, f64),
    (d5, d6): (f64, f64),
) -> [f64; 3] {
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(size: f64) -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
    }

    proptest! {
        #[test]
        fn nearest_point_is_at_most_as_far_as_any_other(
            p in vector(2.0), corners in prop::array::uniform3(vector(1.0)), other in prop::array::uniform3(0.01..1.0f64),
        ) {
            let weights = nearest_weights(p, corners);
            prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9 && weights.iter().all(|&w| w >= 0.0));
            let sum: f64 = other.iter().sum();
            let place = |weights: [f64; 3]| corners.iter().zip(weights).map(|(x, w)| *x * w).sum::<DVec3>();
            prop_assert!(place(weights).distance(p) <= place(other.map(|w| w / sum)).distance(p) + 1e-9);
        }
    }
}
