//! Linkage of a WoodenHaptics; the formulas are documented at [`BoardLinkage::WoodenHaptics`](super::BoardLinkage::WoodenHaptics).

use super::reach::Reach;
use glam::DVec2;

/// L_n, L_b, L_c of the WoodenHaptics of 2015, m. Source: forsslund/haptikfabrikenapi at b8d6c94, `src/haptikfabrikenapi.h`.
pub(super) const LENGTH_2015_M: [f64; 3] = [0.080, 0.205, 0.245];

pub(super) fn reach(&[l_n, l_b, l_c]: &[f64; 3], b_rad: f64, c_rad: f64) -> Reach {
    let ((sin_b, cos_b), (sin_c, cos_c)) = (b_rad.sin_cos(), c_rad.sin_cos());
    let out = l_b * sin_b + l_c * sin_c;
    Reach {
        tip: DVec2::new(out, l_n + l_b * cos_b - l_c * cos_c),
        // B moves the tip out and down, C out and up.
        by_b: DVec2::new(l_b * cos_b, -l_b * sin_b),
        by_c: DVec2::new(l_c * cos_c, l_c * sin_c),
        leverage: (out / (l_b + l_c) * (b_rad + c_rad).sin()).abs(),
        is_closed: true,
    }
}
