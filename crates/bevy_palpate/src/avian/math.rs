//! Conversions from avian's precision, and six-dimensional vectors and matrices.

use avian3d::math::{AdjustPrecision, Matrix3, Quaternion, SymmetricMatrix3, Vector};
use glam::{DMat3, DQuat, DVec3};
use palpate_body::RigidResponse;

/// The vector in double precision.
pub(super) fn double(v: Vector) -> DVec3 {
    DVec3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

/// The rotation in double precision.
pub(super) fn double_rotation(q: Quaternion) -> DQuat {
    let q = DQuat::from_xyzw(f64::from(q.x), f64::from(q.y), f64::from(q.z), f64::from(q.w));
    // The bits of an exact unit quaternion stay.
    if q.length_squared() == 1.0 { q } else { q.normalize() }
}

/// The symmetric matrix in double precision.
pub(super) fn double_matrix(m: SymmetricMatrix3) -> DMat3 {
    let m = Matrix3::from(m);
    DMat3::from_cols(double(m.x_axis), double(m.y_axis), double(m.z_axis))
}

/// The vector in avian's precision.
pub(super) fn single(v: DVec3) -> Vector {
    v.adjust_precision()
}

/// A linear and an angular vector: an impulse and an angular impulse, or a velocity and an angular velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Wrench {
    pub(super) linear: DVec3,
    pub(super) angular: DVec3,
}

impl Wrench {
    pub(super) const ZERO: Self = Self { linear: DVec3::ZERO, angular: DVec3::ZERO };

    pub(super) fn new(linear: DVec3, angular: DVec3) -> Self {
        Self { linear, angular }
    }

    pub(super) fn dot(self, other: Self) -> f64 {
        self.linear.dot(other.linear) + self.angular.dot(other.angular)
    }

    pub(super) fn is_finite(self) -> bool {
        self.linear.is_finite() && self.angular.is_finite()
    }

    /// An impulse with its angular impulse about the origin, with that about `center_m`.
    pub(super) fn about(self, center_m: DVec3) -> Self {
        Self { angular: self.angular - center_m.cross(self.linear), ..self }
    }

    /// An impulse with its angular impulse about `center_m`, with that about the origin.
    pub(super) fn about_origin(self, center_m: DVec3) -> Self {
        Self { angular: self.angular + center_m.cross(self.linear), ..self }
    }
}

impl std::ops::Add for Wrench {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { linear: self.linear + other.linear, angular: self.angular + other.angular }
    }
}

impl std::ops::Sub for Wrench {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { linear: self.linear - other.linear, angular: self.angular - other.angular }
    }
}

impl std::ops::Mul<f64> for Wrench {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { linear: self.linear * factor, angular: self.angular * factor }
    }
}

impl std::ops::AddAssign for Wrench {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl std::ops::SubAssign for Wrench {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

/// Response of a rigid body that other bodies hold at some points.
///
/// Each row g of a constraint allows no velocity g·(v, ω). With the inverse mass W, the constraint impulse of an impulse j is
/// −g gᵀW j / gᵀW g, so W loses W g gᵀ W / gᵀ W g, and the free part of j is j minus that.
#[derive(Clone, Debug)]
pub(super) struct HeldResponse {
    pub(super) response: RigidResponse,
    /// For every row: the free part of it by the rows before, and the velocity that it gives, divided by their product.
    rows: Vec<(Wrench, Wrench)>,
}

/// Mobility along a row, relative to that without other rows, below which the row is already held.
const HELD: f64 = 1e-6;

impl HeldResponse {
    pub(super) fn new(free: RigidResponse) -> Self {
        Self { response: free, rows: Vec::new() }
    }

    pub(super) fn velocity(&self, impulse: Wrench) -> Wrench {
        let (linear, angular) = self.response.change(impulse.linear, impulse.angular);
        Wrench { linear, angular }
    }

    /// Holds the body along `row`, whose mobility alone is `alone`.
    pub(super) fn hold(&mut self, row: Wrench, alone: f64) {
        let velocity = self.velocity(row);
        let mobility = row.dot(velocity);
        if !(mobility > HELD * alone && mobility.is_finite()) {
            return;
        }
        let free = self.free_part(row);
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z) * (1.0 / mobility);
        let Wrench { linear, angular } = velocity;
        self.response.linear -= outer(linear, linear);
        self.response.coupling -= outer(linear, angular);
        self.response.angular -= outer(angular, angular);
        self.rows.push((free, velocity * (1.0 / mobility)));
    }

    /// The part of an impulse that moves the body; the rest is borne by those that hold it.
    pub(super) fn free_part(&self, impulse: Wrench) -> Wrench {
        // Every row subtracts with the response of the rows before it, applied to the whole impulse.
        self.rows.iter().fold(impulse, |rest, (free, along)| rest - *free * along.dot(impulse))
    }

    pub(super) fn is_held(&self) -> bool {
        !self.rows.is_empty()
    }

    /// The response without what rounding left along held axes, which may be negative.
    pub(super) fn rounded(&self, alone: &RigidResponse) -> RigidResponse {
        let RigidResponse { mut linear, mut coupling, mut angular } = self.response;
        for axis in 0..3 {
            if linear.col(axis)[axis] <= HELD * alone.linear.col(axis)[axis] {
                *linear.col_mut(axis) = DVec3::ZERO;
                (0..3).for_each(|of| linear.col_mut(of)[axis] = 0.0);
                (0..3).for_each(|of| coupling.col_mut(of)[axis] = 0.0);
            }
            if angular.col(axis)[axis] <= HELD * alone.angular.col(axis)[axis] {
                *angular.col_mut(axis) = DVec3::ZERO;
                (0..3).for_each(|of| angular.col_mut(of)[axis] = 0.0);
                *coupling.col_mut(axis) = DVec3::ZERO;
            }
        }
        RigidResponse { linear, coupling, angular }
    }
}

#[cfg(test)]
mod tests;
