//! The linkage of Polhem 2 and 3, and their sizes; its formulas are at [`BoardLinkage::Polhem`].

use super::BoardKinematics;
use super::linkage::{BoardLinkage, Reach};
use glam::{DVec2, DVec3};

/// L0 to L5, m. Source: forsslund/hfabapi at aadabaa, `hfab_polhem.h`, the only place where they are published; it does not tell
/// Polhem 2 from Polhem 3.
const LENGTH_M: [f64; 6] = [0.034, 0.165, 0.025, 0.190, 0.034, 0.1308];

pub(super) fn reach(&[l0, l1, l2, l3, l4, l5]: &[f64; 6], b_rad: f64, c_rad: f64) -> Reach {
    let (along_b, along_c) = (DVec2::from_angle(b_rad), DVec2::from_angle(c_rad));
    let elbow = 0.5 * l0 * DVec2::X + l1 * along_b;
    let w = elbow + 0.5 * l0 * DVec2::X - l2 * along_c;
    let size = w.length();
    // The cosine of the angle from w to the outer link; 1 and -1 where rod, outer link and w lie in one line.
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

impl BoardKinematics {
    /// The Polhem 3, by its newest published numbers. At home it is folded: A is turned by 120° from the front over the right, B by
    /// 125°, C by 238°; the outer link points 30° down, and the tip is 36 mm from A's axis and 70 mm above the axes of B and C.
    /// So near to the axis it is nearly singular ([`BoardKinematics::leverage`] is 0.03), and no force is shown before the tip has
    /// been drawn out.
    ///
    /// Sources: the lengths are those of forsslund/hfabapi at aadabaa, `hfab_polhem.h`; the rest is `polhem_v3` in its `hfab_math.h` at
    /// 4224b75, dated 21 December 2020 there, and the same in its `hfab_api.cpp`. It also gives 2,000 N/m and 1 N s/m as the most that it
    /// should show. They disagree with
    ///
    /// * `hfab_kinematics.cpp` beside it: d_c 0.01373, home of C 19,768, in a table that it says is not used;
    /// * forsslund/haptikfabrikenapi at fbffb77, `src/haptikfabrikenapi.h`, of January 2020: d 0.0288, 0.0130, 0.014, home 8327, −10,926,
    ///   19,386; at 035fc25: d_c 0.010, home of C 27,140, k_a 0.321 and the origin of Polhem 2;
    /// * forsslund/polhemstylus at cb01101, `tmp/winworks-2020-11-04/polhem_teensy.ino`, of October 2020: home 8298, −10,771, 19,756.
    ///
    /// The angles at home are the same within 0.1° in all that name capstans: what changed is how thick the capstans are, with the cable
    /// on them. An arm that is taken for one with the other of the two d_c turns C by a third too much or too little: whoever has an
    /// early one must try.
    #[must_use]
    pub fn polhem_v3() -> Self {
        Self {
            linkage: BoardLinkage::Polhem { length_m: LENGTH_M },
            capstan_m: [0.028_853_4, 0.013_698_1, 0.013_728_1],
            body_m: [0.175, 0.100, 0.100],
            is_reversed: [false, true, false],
            counts_per_turn: [4096.0; 3],
            torque_nm_per_a: [0.0603, 0.0538, 0.0538],
            origin_m: DVec3::new(0.2045, 0.0, 0.0325),
            workspace_radius_m: 0.150,
            max_force_n: 5.0,
            home_counts: [8312, -10_366, 19_764, 0, 30, 0],
        }
    }

    /// The Polhem 2, folded at home as the [Polhem 3](BoardKinematics::polhem_v3) is. Half of what it calls its workspace is so near to
    /// A's axis that there is little or no force; a larger [`origin_m`](BoardKinematics::origin_m) moves the middle to where there is.
    ///
    /// Sources: the lengths as for Polhem 3; the rest is `polhem_v2` in forsslund/hfabapi at 4224b75, `hfab_math.h`, and the same in
    /// forsslund/haptikfabrikenapi at fbffb77, `src/haptikfabrikenapi.h`, with 5,000 N/m and 1 N s/m as the most that it should show.
    /// A comment in the latter, older than the numbers, has d_b 0.0077, home of B −18,447, the origin −0.137, 0.182, −0.0217 and 2,000
    /// N/m. They are what it was "originally", as the source says; the angles at home are the same.
    #[must_use]
    pub fn polhem_v2() -> Self {
        Self {
            capstan_m: [0.0288, 0.0130, 0.010],
            torque_nm_per_a: [0.321, 0.0538, 0.0538],
            origin_m: DVec3::new(0.137, 0.0, 0.0),
            home_counts: [8327, -10_926, 27_140, 0, 30, 0],
            ..Self::polhem_v3()
        }
    }
}
