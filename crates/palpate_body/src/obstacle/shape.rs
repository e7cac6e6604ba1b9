//! Shapes of obstacles in their own frame: distance and normal at a point.

use super::pose::Pose;
use super::triangle_mesh::TriangleMesh;
use glam::DVec3;
use std::sync::Arc;

/// A shape in the frame of its obstacle.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// Bounded by the plane through the origin.
    HalfSpace {
        normal: DVec3,
    },
    Sphere {
        radius_m: f64,
    },
    Cuboid {
        half_m: DVec3,
    },
    /// The points within a radius of the segment from −y to +y.
    Capsule {
        half_length_m: f64,
        radius_m: f64,
    },
    Mesh(Arc<TriangleMesh>),
    /// The points within a margin of another shape.
    Rounded {
        shape: Arc<Shape>,
        margin_m: f64,
    },
    /// The union of parts; at least one.
    Compound(Arc<[Part]>),
}

/// A part of a compound.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) shape: Shape,
    pub(super) pose: Pose,
    pub(super) friction: f64,
}

/// Distance from an edge, relative to the size of the shape, below which a point counts as being on it.
const ON_EDGE: f64 = 1e-12;

impl Shape {
    /// Distance of `x_m` from the shape, m, negative inside, and the outward unit normal. `None` if the distance
    /// exceeds `within_m`; not every shape checks it.
    pub(super) fn gap_m(&self, x_m: DVec3, within_m: f64) -> Option<(f64, DVec3)> {
        match self {
            Self::HalfSpace { normal } => Some((x_m.dot(*normal), *normal)),
            Self::Sphere { radius_m } => {
                Some((x_m.length() - radius_m, x_m.try_normalize().unwrap_or(DVec3::Z)))
            }
            Self::Cuboid { half_m } => Some(of_cuboid(x_m, *half_m)),
            Self::Capsule { half_length_m, radius_m } => {
                let out = x_m - DVec3::Y * x_m.y.clamp(-half_length_m, *half_length_m);
                Some((out.length() - radius_m, out.try_normalize().unwrap_or(DVec3::Z)))
            }
            Self::Mesh(mesh) => mesh.gap_m(x_m, within_m),
            Self::Rounded { shape, margin_m } => {
                let (gap_m, normal) = shape.gap_m(x_m, within_m + margin_m)?;
                Some((gap_m - margin_m, normal))
            }
            Self::Compound(parts) => nearest(parts, x_m, within_m).map(|(_, gap)| gap),
        }
    }

    /// Distance of the farthest point from `center_m`, m; 1 m for a half-space.
    pub(super) fn reach_m(&self, center_m: DVec3) -> f64 {
        match self {
            Self::HalfSpace { .. } => 1.0,
            Self::Sphere { radius_m } => center_m.length() + radius_m,
            Self::Cuboid { half_m } => (center_m.abs() + half_m).length(),
            Self::Capsule { half_length_m, radius_m } => center_m.length() + half_length_m + radius_m,
            Self::Mesh(mesh) => mesh.reach_m(center_m),
            Self::Rounded { shape, margin_m } => shape.reach_m(center_m) + margin_m,
            Self::Compound(parts) => {
                let of = |part: &Part| part.shape.reach_m(part.pose.local_m(center_m));
                parts.iter().map(of).fold(0.0, f64::max)
            }
        }
    }

    /// Coefficient of friction of the part of a compound that is nearest to `x_m`; `None` for other shapes.
    pub(super) fn friction(&self, x_m: DVec3) -> Option<f64> {
        match self {
            Self::Compound(parts) => Some(nearest(parts, x_m, f64::INFINITY)?.0.friction),
            _ => None,
        }
    }
}

/// The part with the smallest gap at `x_m`, the first of equal ones, and gap and normal there.
fn nearest(parts: &[Part], x_m: DVec3, within_m: f64) -> Option<(&Part, (f64, DVec3))> {
    let gap = |part: &Part| {
        let (gap_m, normal) = part.shape.gap_m(part.pose.local_m(x_m), within_m)?;
        Some((gap_m, part.pose.rotation * normal))
    };
    let gaps = parts.iter().filter_map(|part| Some((part, gap(part)?)));
    gaps.reduce(|best, next| if next.1.0 < best.1.0 { next } else { best })
}

/// Gap and normal of a box. On an edge and in a corner the normal is the mean of the adjacent faces. Inside it is that
/// of the nearest face; of equally near ones that along z, then y.
fn of_cuboid(x_m: DVec3, half_m: DVec3) -> (f64, DVec3) {
    let (beyond, sign) = (x_m.abs() - half_m, DVec3::ONE.copysign(x_m));
    let out = beyond.max(DVec3::ZERO);
    if let (Some(normal), true) = (out.try_normalize(), out.max_element() > 0.0) {
        return (out.length(), normal * sign);
    }
    let (deepest, on) = (beyond.max_element(), ON_EDGE * half_m.max_element());
    if deepest >= -on {
        let faces = DVec3::from_array(beyond.to_array().map(|d| f64::from(d >= -on)));
        return (deepest, faces.normalize() * sign);
    }
    let axis = if beyond.z == deepest {
        DVec3::Z
    } else if beyond.y == deepest {
        DVec3::Y
    } else {
        DVec3::X
    };
    (deepest, axis * sign)
}
