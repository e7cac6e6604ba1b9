//! Published sizes of arms.

use super::woodenhaptics_linkage::LENGTH_2015_M;
use super::{BoardKinematics, BoardLinkage};
use glam::DVec3;

/// Lengths L0 to L5 of the Polhem 2 and 3, m. Source: forsslund/hfabapi at aadabaa, `hfab_polhem.h`, the only publication, which does
/// not distinguish the two.
const LENGTH_M: [f64; 6] = [0.034, 0.165, 0.025, 0.190, 0.034, 0.1308];

impl Default for BoardKinematics {
    /// [`BoardKinematics::woodenhaptics_v2015`].
    fn default() -> Self {
        Self::woodenhaptics_v2015()
    }
}

impl BoardKinematics {
    /// Arm of the WoodenHaptics of 2015. At home B points up and C to the front: counts 0, 0, 6000, θ_C = π/2.
    ///
    /// Source: `woodenhaptics_v2015` in `src/haptikfabrikenapi.h` of forsslund/haptikfabrikenapi at b8d6c94, which also gives the maximum
    /// stiffness 1,000 N/m and damping 8 N s/m.
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

    /// Arm of the Polhem 3, with its latest published sizes. At home it is folded: A is turned by 120° from the front over the right,
    /// B by 125°, C by 238°; the outer link points 30° down, and the tip is 36 mm from A's axis and 70 mm above the axes of B and C. This
    /// pose is nearly singular ([`BoardKinematics::leverage`] is 0.03), so the force is zero until the tip has been pulled out.
    ///
    /// Sources: the lengths are those of forsslund/hfabapi at aadabaa, `hfab_polhem.h`. The rest is `polhem_v3` in its `hfab_math.h` at
    /// 4224b75, dated 21 December 2020 there, and the same in its `hfab_api.cpp`, which also gives the maximum stiffness 2,000 N/m and
    /// damping 1 N s/m. Other published sizes differ:
    ///
    /// * `hfab_kinematics.cpp` in the same repository: d_c 0.01373, home of C 19,768, in a table marked as unused;
    /// * forsslund/haptikfabrikenapi at fbffb77, `src/haptikfabrikenapi.h`, of January 2020: d 0.0288, 0.0130, 0.014, home 8327, −10,926,
    ///   19,386; at 035fc25: d_c 0.010, home of C 27,140, k_a 0.321 and the origin of Polhem 2;
    /// * forsslund/polhemstylus at cb01101, `tmp/winworks-2020-11-04/polhem_teensy.ino`, of October 2020: home 8298, −10,771, 19,756.
    ///
    /// All sources with capstans agree on the angles at home within 0.1°; the effective diameter of the capstans, with cable, differs.
    /// With the wrong one of the two d_c, the computed angle of C is a third too large or too small. Verify it for an early arm.
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

    /// Arm of the Polhem 2, folded at home as the [Polhem 3](BoardKinematics::polhem_v3). Half of its published workspace is so near to A's
    /// axis that there is little or no force; a larger [`origin_m`](BoardKinematics::origin_m) shifts the centre away from the axis.
    ///
    /// Sources: the lengths as for the Polhem 3. The rest is `polhem_v2` in forsslund/hfabapi at 4224b75, `hfab_math.h`, and the same in
    /// forsslund/haptikfabrikenapi at fbffb77, `src/haptikfabrikenapi.h`, with the maximum stiffness 5,000 N/m and damping 1 N s/m. An
    /// older comment in the latter has d_b 0.0077, home of B −18,447, the origin −0.137, 0.182, −0.0217 and 2,000 N/m, marked as "originally";
    /// the angles at home are the same.
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
