//! Published sizes of arms.

use super::woodenhaptics_linkage::LENGTH_2015_M;
use super::{BoardKinematics, BoardLinkage};
use glam::DVec3;

/// L0 to L5, m. Source: forsslund/hfabapi at aadabaa, `hfab_polhem.h`, the only place where they are published; it does not tell
/// Polhem 2 from Polhem 3.
const LENGTH_M: [f64; 6] = [0.034, 0.165, 0.025, 0.190, 0.034, 0.1308];

impl Default for BoardKinematics {
    /// [`BoardKinematics::woodenhaptics_v2015`].
    fn default() -> Self {
        Self::woodenhaptics_v2015()
    }
}

impl BoardKinematics {
    /// The WoodenHaptics of 2015. At home B points up and C to the front: counts 0, 0, 6000, θ_C = π/2.
    ///
    /// Source: `woodenhaptics_v2015` in `src/haptikfabrikenapi.h`, which also gives 1,000 N/m and 8 N s/m as the most that it should
    /// show.
    #[must_use]
    pub fn woodenhaptics_v2015() -> Self {
        Self {
            linkage: BoardLinkage::WoodenHaptics { length_m: LENGTH_2015_M },
            capstan_m: [0.010; 3],
            body_m: [0.160, 0.120, 0.120],
            is_reversed: [false; 3],
            counts_per_turn: [2000.0; 3],
            torque_nm_per_a: [0.0259; 3],
            origin_m: DVec3::new(0.220, 0.0, 0.080),
            workspace_radius_m: 0.100,
            max_force_n: 5.0,
            home_counts: [0, 0, 6000, 0, 0, 0],
        }
    }

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
