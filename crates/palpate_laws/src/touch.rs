//! Where a tool and a triangulated surface touch.

use crate::{CLOSING_M_PER_S, LawError};
use glam::DVec3;

/// Most nodes that carry a point of a surface: those of a cell.
pub const POINT_NODES: usize = 8;

/// The part of a tool that touches, rigid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolShape {
    /// A ball round the tool's position.
    Sphere {
        /// Its radius, m.
        radius_m: f64,
    },
    /// A flat disc round the tool's position, the end of a cylinder: everything behind it is tool.
    FlatPunch {
        /// Its radius, m.
        radius_m: f64,
        /// Unit vector along the cylinder, the way it presses.
        axis: DVec3,
    },
}

/// A place where a tool and a triangle may touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feature {
    /// The point of the triangle, Σ w_i x_i over its corners; exactly 0 for corners that it does not lie on.
    pub weights: [f64; 3],
    /// Unit vector along which the tool pushes, into the surface.
    pub normal: DVec3,
    /// How far the point is from the tool against the normal, m; negative inside.
    pub gap_m: f64,
}

/// Edges shorter than that share of a sphere's radius are fine: between its corners such a triangle is at most 1/96 of the
/// radius inside the sphere.
const FINE_FOR_SPHERE: f64 = 0.25;
/// The weights of a triangle's corners.
const CORNERS: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// A triangle that looks less along a punch than that stands upright beside it.
const UPRIGHT: f64 = 1e-6;
/// A point with less weight than that on nodes that can move is as good as fixed: to move it they would have to go far. Less
/// is enough for what is touched already, so that a touch near what is fixed does not come and go.
const LEAST_LEVER: f64 = 0.3;
const LEAST_LEVER_TOUCHED: f64 = 0.1;
/// Points on the rim of a punch that touch where no corner of the surface does.
const RIM: u32 = 8;
/// What is not farther behind the rim of a punch than that share of its radius is still met by its face.
const RIM_SHARE: f64 = 0.05;
/// Corners on the rim count as under the punch.
const RIM_TOLERANCE: f64 = 1e-9;

/// The gap between a tool and a feature in a step, m, for the rows of [`crate::solve_rows`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureGap {
    /// Along the normal, as far as it is to be closed in this step.
    pub normal_m: f64,
    /// The whole, with what the tool moves across the normal.
    pub gap_m: DVec3,
    /// The part of it that was there before: positions close it, velocities keep nothing of that.
    pub overdue_m: DVec3,
}

impl Feature {
    /// Whether nodes that can move have too little weight in it, where `free_share` tells how much they have in each corner and
    /// `is_touched` whether it was touched in the step before.
    #[must_use]
    pub fn is_out_of_reach(&self, free_share: [f64; 3], is_touched: bool) -> bool {
        let free: f64 = (0..3).map(|i| free_share[i] * self.weights[i]).sum();
        free < if is_touched { LEAST_LEVER_TOUCHED } else { LEAST_LEVER }
    }

    /// The gap in a step of length `h`, s, in which the tool moves by `moved_m` to where it is: the tool's own motion is
    /// followed at once, what is left from before at the closing speed.
    #[must_use]
    pub fn gap(&self, moved_m: DVec3, h: f64) -> FeatureGap {
        let push = self.normal;
        let before = self.gap_m + moved_m.dot(push);
        let overdue = before.clamp(-h * CLOSING_M_PER_S, 0.0);
        let normal_m = if before < 0.0 { overdue + self.gap_m - before } else { self.gap_m };
        let gap_m = normal_m * push - moved_m.reject_from_normalized(push);
        FeatureGap { normal_m, gap_m, overdue_m: overdue * push }
    }
}

impl ToolShape {
    /// Refuses a shape that makes no sense.
    ///
    /// # Errors
    /// [`LawError::Radius`] when the radius is not finite and above 0, [`LawError::Normal`] when the axis is not of unit
    /// length.
    pub fn validate(&self) -> Result<(), LawError> {
        let radius_m = self.radius_m();
        if !(radius_m.is_finite() && radius_m > 0.0) {
            return Err(LawError::Radius(radius_m));
        }
        match self {
            Self::FlatPunch { axis, .. } if !axis.is_normalized() => Err(LawError::Normal(axis.length())),
            _ => Ok(()),
        }
    }

    /// Radius, m.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        match *self {
            Self::Sphere { radius_m } | Self::FlatPunch { radius_m, .. } => radius_m,
        }
    }

    /// A point that is well inside the tool when the tool is at `center_m`, and outside of any body it touches.
    #[must_use]
    pub fn core_m(&self, center_m: DVec3) -> DVec3 {
        match *self {
            Self::Sphere { .. } => center_m,
            Self::FlatPunch { radius_m, axis } => center_m - radius_m * axis,
        }
    }

    /// Tells `found` where the tool at `center_m` may touch the triangle with corners `corners_m`, counter-clockwise seen
    /// from outside, whose longest edge at rest is `longest_m`. A triangle whose outside the tool does not face is not
    /// touched.
    ///
    /// A sphere touches at the triangle's point nearest to it, or where triangles are small beside it, edges shorter than a
    /// quarter of its radius, at their corners, so that a dent as wide as many triangles is not a polyhedron's. A punch touches at the corners under it, and where not all of
    /// them are, with its centre and eight points of its rim. Corners that come from beside a punch are met by its side, along
    /// which it is as long as its radius.
    pub fn features(
        &self,
        center_m: DVec3,
        corners_m: [DVec3; 3],
        longest_m: f64,
        mut found: impl FnMut(Feature),
    ) {
        let [a, b, c] = corners_m;
        let outward = (b - a).cross(c - a);
        match *self {
            Self::Sphere { radius_m } => {
                if (center_m - a).dot(outward) < 0.0 {
                    return;
                }
                let mut place = |weights: [f64; 3]| {
                    let away = weighted(weights, corners_m) - center_m;
                    if let Some(normal) = away.try_normalize() {
                        found(Feature { weights, normal, gap_m: away.length() - radius_m });
                    }
                };
                if longest_m < FINE_FOR_SPHERE * radius_m {
                    CORNERS.into_iter().for_each(&mut place);
                } else {
                    place(nearest_weights(center_m, corners_m));
                }
            }
            Self::FlatPunch { radius_m, axis } => {
                let facing = axis.dot(outward) / outward.length();
                if facing.is_nan() || facing > UPRIGHT {
                    return;
                }
                let across = |x: DVec3| (x - center_m) - (x - center_m).dot(axis) * axis;
                // How far behind the face and how far within the rim every corner is.
                let behind = corners_m.map(|x| (center_m - x).dot(axis));
                let within = corners_m.map(|x| radius_m * (1.0 + RIM_TOLERANCE) - across(x).length());
                for i in 0..3 {
                    // What is that far behind the face is another part of the body.
                    let is_beside = behind[i] > within[i].max(0.0) + RIM_SHARE * radius_m;
                    if is_beside && behind[i] < radius_m {
                        let side = across(corners_m[i]).try_normalize();
                        // The side is met by what looks at it.
                        if let Some(normal) = side.filter(|normal| normal.dot(outward) < 0.0) {
                            found(Feature { weights: CORNERS[i], normal, gap_m: -within[i] });
                        }
                    } else if !is_beside && within[i] >= 0.0 && facing < -UPRIGHT {
                        found(Feature { weights: CORNERS[i], normal: axis, gap_m: -behind[i] });
                    }
                }
                let under = within.map(|within| within >= 0.0);
                // What stands upright is met by its upper corners, which belong to others too.
                if under == [true; 3] || facing >= -UPRIGHT {
                    return;
                }
                let (u, v) = axis.any_orthonormal_pair();
                let rim = (0..RIM).map(|i| {
                    let angle = f64::from(i) * std::f64::consts::TAU / f64::from(RIM);
                    radius_m * (angle.cos() * u + angle.sin() * v)
                });
                for point in std::iter::once(DVec3::ZERO).chain(rim) {
                    let corners = corners_m.map(|x| across(x) - point);
                    let on = inside(corners, axis).filter(|w| (0..3).any(|i| w[i] > 0.0 && !under[i]));
                    if let Some(weights) = on {
                        let gap_m = (weighted(weights, corners_m) - center_m).dot(axis);
                        if gap_m > -radius_m {
                            found(Feature { weights, normal: axis, gap_m });
                        }
                    }
                }
            }
        }
    }
}

fn weighted(weights: [f64; 3], corners: [DVec3; 3]) -> DVec3 {
    weights[0] * corners[0] + weights[1] * corners[1] + weights[2] * corners[2]
}

/// Barycentric weights of the origin in a triangle that lies across `axis`, if it is inside.
fn inside(corners: [DVec3; 3], axis: DVec3) -> Option<[f64; 3]> {
    let [a, b, c] = corners;
    let parts = [b.cross(c).dot(axis), c.cross(a).dot(axis), a.cross(b).dot(axis)];
    let sum: f64 = parts.iter().sum();
    let weights = parts.map(|part| part / sum);
    (sum != 0.0 && weights.iter().all(|&w| w >= 0.0)).then_some(weights)
}

/// Barycentric weights of the point of a triangle nearest to `p`: on a corner, an edge or the face, by the regions of
/// C. Ericson, Real-Time Collision Detection (2005), section 5.1.5.
#[must_use]
pub fn nearest_weights(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(p - a), ac.dot(p - a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (d3, d4) = (ab.dot(p - b), ac.dot(p - b));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let (d5, d6) = (ab.dot(p - c), ac.dot(p - c));
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

    const TRIANGLE: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    fn features(shape: ToolShape, center: DVec3) -> Vec<Feature> {
        let mut all = Vec::new();
        shape.features(center, TRIANGLE, std::f64::consts::SQRT_2, |feature| all.push(feature));
        all
    }

    fn vector(size: f64) -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
    }

    proptest! {
        #[test]
        fn no_point_of_a_triangle_is_nearer_than_the_nearest(
            p in vector(2.0), corners in prop::array::uniform3(vector(1.0)), other in prop::array::uniform3(0.01..1.0f64),
        ) {
            let weights = nearest_weights(p, corners);
            prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9 && weights.iter().all(|&w| w >= 0.0));
            let sum: f64 = other.iter().sum();
            let rival = weighted(other.map(|w| w / sum), corners);
            prop_assert!(weighted(weights, corners).distance(p) <= rival.distance(p) + 1e-9);
        }
    }

    #[test]
    fn a_sphere_touches_where_it_is_nearest_and_only_from_outside() {
        let sphere = ToolShape::Sphere { radius_m: 0.3 };
        let [above] = features(sphere, DVec3::new(0.25, 0.25, 0.2))[..] else { panic!("one") };
        assert!((above.gap_m + 0.1).abs() < 1e-15 && (above.normal + DVec3::Z).length() < 1e-15);
        assert!((above.weights[0] - 0.5).abs() < 1e-15);
        let [corner] = features(sphere, DVec3::new(-0.3, -0.4, 0.0))[..] else { panic!("one") };
        assert_eq!(corner.weights, [1.0, 0.0, 0.0]);
        assert!((corner.normal - DVec3::new(0.6, 0.8, 0.0)).length() < 1e-15);
        assert_eq!(features(sphere, DVec3::new(0.25, 0.25, -0.1)), vec![]);
    }

    #[test]
    fn a_punch_touches_corners_under_it_and_else_with_its_rim_and_centre() {
        let down = |radius_m| ToolShape::FlatPunch { radius_m, axis: -DVec3::Z };
        let wide = features(down(2.0), DVec3::new(0.3, 0.3, -0.1));
        let corners: Vec<_> = wide.iter().map(|f| f.weights).collect();
        assert_eq!(corners, CORNERS);
        assert!(wide.iter().all(|f| f.normal == -DVec3::Z && (f.gap_m + 0.1).abs() < 1e-15));
        // All nine points of a small one.
        let small = features(down(0.1), DVec3::new(0.3, 0.3, 0.05));
        assert_eq!(small.len(), 9);
        assert!(small.iter().all(|f| (f.gap_m - 0.05).abs() < 1e-15));
        for feature in &small {
            let at = weighted(feature.weights, TRIANGLE).truncate();
            let out = at.distance(glam::DVec2::splat(0.3));
            assert!(out < 1e-12 || (out - 0.1).abs() < 1e-12, "{out}");
        }
        // From below, and from far behind, it is not touched.
        let up = ToolShape::FlatPunch { radius_m: 0.1, axis: DVec3::Z };
        assert_eq!(features(up, DVec3::new(0.3, 0.3, 0.0)), vec![]);
        assert_eq!(features(down(0.1), DVec3::new(0.3, 0.3, -0.5)), vec![]);
        // An upright wall that a punch is moved into is met by its side.
        let wall = [DVec3::ZERO, DVec3::Y, DVec3::Z].map(|x| x - DVec3::new(0.05, 0.5, 0.3));
        let mut met = Vec::new();
        down(0.1).features(DVec3::new(0.02, -0.5, -0.35), wall, 1.5, |f| met.push(f));
        let beside = met.iter().find(|f| f.gap_m < 0.0).unwrap();
        assert!((beside.normal + DVec3::X).length() < 1e-12 && beside.weights == CORNERS[0]);
        assert!((beside.gap_m + 0.03).abs() < 1e-9);
    }

    #[test]
    fn tools_that_make_no_sense_are_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(ToolShape::Sphere { radius_m: bad }.validate(), Err(LawError::Radius(_))));
        }
        let long = ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::Z * 2.0 };
        assert_eq!(long.validate(), Err(LawError::Normal(2.0)));
        assert!(ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::NAN }.validate().is_err());
        assert_eq!(ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::X }.validate(), Ok(()));
    }
}
