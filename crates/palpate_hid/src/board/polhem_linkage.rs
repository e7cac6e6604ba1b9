//! Linkage of Polhem 2 and 3; the formulas are documented at [`BoardLinkage::Polhem`](super::BoardLinkage::Polhem).

use super::reach::Reach;
use glam::DVec2;

pub(super) fn reach(&[l0, l1, l2, l3, l4, l5]: &[f64; 6], b_rad: f64, c_rad: f64) -> Reach {
    let (along_b, along_c) = (DVec2::from_angle(b_rad), DVec2::from_angle(c_rad));
    let elbow = 0.5 * l0 * DVec2::X + l1 * along_b;
    let w = elbow + 0.5 * l0 * DVec2::X - l2 * along_c;
    let size = w.length();
    // Cosine of the angle from w to the outer link; ±1 where rod, outer link and w are collinear.
    let cosine =
        if size > f64::EPSILON { (size * size + l4 * l4 - l3 * l3) / (2.0 * l4 * size) } else { 2.0 };
    let held = cosine.clamp(-1.0, 1.0);
    let towards = if size > f64::EPSILON { w / size } else { along_b };
    let sine = (1.0 - held * held).sqrt();
    let outer = held * towards - sine * towards.perp();
    let tip = elbow + l5 * outer;
    // The rod, f = c − d, and L3 sin(φ − λ).
    let (rod, across) = (w - l4 * outer, size * sine);
    if !(cosine.abs() < 1.0 && across > f64::EPSILON) {
        return Reach {
            tip,
            by_b: (tip - 0.5 * l0 * DVec2::X).perp(),
            by_c: DVec2::ZERO,
            leverage: 0.0,
            is_closed: cosine.abs() <= 1.0,
        };
    }
    // L3 sin(φ − θ_C).
    let crank = along_c.perp_dot(rod);
    let turned_by_b = l1 * along_b.perp_dot(rod) / (l4 * across);
    let turned_by_c = -l2 * crank / (l4 * across);
    let stretch = tip.x / (0.5 * l0 + l1 + l5);
    Reach {
        tip,
        by_b: l1 * along_b.perp() + turned_by_b * l5 * outer.perp(),
        by_c: turned_by_c * l5 * outer.perp(),
        leverage: (stretch * along_b.perp_dot(outer)).abs() * crank.abs().min(across) / l3,
        is_closed: true,
    }
}
