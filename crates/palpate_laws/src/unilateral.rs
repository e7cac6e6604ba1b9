//! The unilateral condition of contact.

use glam::DVec3;

/// Force of a unilateral contact on the hand: `force_n` while its component along the outward `normal` is positive,
/// else zero (section 6 of the seed paper).
///
/// `force_n` is the force of the body on the hand, N; `normal` is the outward unit normal of the body.
#[must_use]
pub fn unilateral_force(force_n: DVec3, normal: DVec3) -> DVec3 {
    if force_n.dot(normal) > 0.0 { force_n } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_pushes_and_never_pulls() {
        let push = DVec3::new(0.3, 0.1, 2.0);
        assert_eq!(unilateral_force(push, DVec3::Z), push);
        assert_eq!(unilateral_force(-push, DVec3::Z), DVec3::ZERO);
        assert_eq!(unilateral_force(DVec3::X, DVec3::Z), DVec3::ZERO);
    }

    #[test]
    fn nan_force_becomes_zero() {
        assert_eq!(unilateral_force(DVec3::NAN, DVec3::Z), DVec3::ZERO);
    }
}
