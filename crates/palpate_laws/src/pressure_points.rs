//! Quadrature points of a contact's pressure.

use crate::Pressure;

/// Maximum number of rows of a patch: its middle and eight sides.
pub const PATCH_ROWS: usize = 9;

/// A quadrature point of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressurePoint {
    /// Position in units of the contact radius.
    pub place: [f64; 2],
    /// Distance from the middle in units of the contact radius.
    pub distance: f64,
    /// Portions that belong to the middle and to the eight sides. They sum to 1.
    pub portions: [f64; PATCH_ROWS],
}

/// Rings of the quadrature over a disc. The pattern has the symmetries of a square.
const RINGS: [Ring; 4] = [
    Ring { s: 0.183_434_642_495_649_8, weight: 0.362_683_783_378_362, radius: 0.983_031_907_891_342_6 },
    Ring { s: 0.525_532_409_916_329, weight: 0.313_706_645_877_887_3, radius: 0.850_773_580_999_983_6 },
    Ring { s: 0.796_666_477_413_626_7, weight: 0.222_381_034_453_374_5, radius: 0.604_419_162_308_214_1 },
    Ring { s: 0.960_289_856_497_536_3, weight: 0.101_228_536_290_376_3, radius: 0.279_004_285_823_607_3 },
];
const POINTS_ON_RING: usize = 12;
/// Number of quadrature points.
pub const PRESSURE_POINTS: usize = RINGS.len() * POINTS_ON_RING;

/// Positive nodes s of the Gauss-Legendre rule of order 8 on (−1, 1), and their weights. With r² = a² (1 − s²), the
/// weight per ds is s² for Hertz's pressure and 1 for a punch.
#[derive(Clone, Copy)]
struct Ring {
    s: f64,
    weight: f64,
    /// (1 − s²)^½.
    radius: f64,
}

/// Cosines of the multiples of 1/24 turn.
const COSINES: [f64; 24] = {
    let quarter = [
        1.0,
        0.965_925_826_289_068_3,
        0.866_025_403_784_438_6,
        std::f64::consts::FRAC_1_SQRT_2,
        0.5,
        0.258_819_045_102_520_74,
        0.0,
    ];
    let mut all = [0.0; 24];
    let mut i = 0;
    while i <= 6 {
        all[i] = quarter[i];
        all[12 - i] = -quarter[i];
        all[(24 - i) % 24] = quarter[i];
        all[12 + i] = -quarter[i];
        i += 1;
    }
    all[6] = 0.0;
    all[18] = 0.0;
    all
};

/// The points, ring by ring. They are the same in every step and are computed at compile time.
static POINTS: [PressurePoint; PRESSURE_POINTS] = {
    let mut all = [PressurePoint::MIDDLE; PRESSURE_POINTS];
    let mut i = 0;
    while i < PRESSURE_POINTS {
        let (ring, on_ring) = (i / POINTS_ON_RING, i % POINTS_ON_RING);
        let Ring { s, radius, .. } = RINGS[ring];
        // Every other ring is rotated by half a step, 1/24 turn.
        let turn = 2 * on_ring + ring % 2;
        let middle = s * s * s * s;
        let mut portions = [middle, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut side = 0;
        while side < 8 {
            // cos² of twice the angle to the side, for angles below 1/8 turn.
            let off = (turn + 24 - 3 * side) % 24;
            portions[1 + side] = (1.0 - middle)
                * match off {
                    0 => 1.0,
                    1 | 23 => 0.75,
                    2 | 22 => 0.25,
                    _ => 0.0,
                };
            side += 1;
        }
        let place = [radius * COSINES[turn], radius * COSINES[(turn + 18) % 24]];
        all[i] = PressurePoint { place, distance: radius, portions };
        i += 1;
    }
    all
};
const BALL_SHARES: [f64; RINGS.len()] = shares(Pressure::Ball);
const PUNCH_SHARES: [f64; RINGS.len()] = shares(Pressure::Punch);

/// Share of the force of a point of each ring.
const fn shares(pressure: Pressure) -> [f64; RINGS.len()] {
    let (mut shares, mut sum, mut ring) = ([0.0; RINGS.len()], 0.0, 0);
    while ring < RINGS.len() {
        let Ring { s, weight, .. } = RINGS[ring];
        shares[ring] = match pressure {
            Pressure::Ball => weight * s * s,
            Pressure::Punch => weight,
        };
        sum += shares[ring];
        ring += 1;
    }
    while ring > 0 {
        ring -= 1;
        shares[ring] = shares[ring] / sum / POINTS_ON_RING as f64;
    }
    shares
}

impl PressurePoint {
    /// The middle of a contact.
    pub const MIDDLE: Self =
        Self { place: [0.0; 2], distance: 0.0, portions: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
}

impl Pressure {
    /// Points of the unit disc with their shares of the force. The shares sum to 1.
    pub fn points(self) -> impl Iterator<Item = (&'static PressurePoint, f64)> {
        let shares = match self {
            Self::Ball => BALL_SHARES,
            Self::Punch => PUNCH_SHARES,
        };
        POINTS.iter().zip(shares.into_iter().flat_map(|share| [share; POINTS_ON_RING]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

    /// Portions of a point in closed form.
    fn portions([x, y]: [f64; 2]) -> [f64; PATCH_ROWS] {
        let middle = (1.0 - (x * x + y * y)).powi(2);
        let mut all = [middle; PATCH_ROWS];
        for (side, to) in all[1..].iter_mut().enumerate() {
            let off = (y.atan2(x) / FRAC_PI_4 - side as f64 + 12.0).rem_euclid(8.0) - 4.0;
            *to = (1.0 - middle) * (off.abs().min(1.0) * FRAC_PI_2).cos().powi(2);
        }
        all
    }

    #[test]
    fn points_of_a_pressure_have_its_moments() {
        for (pressure, second, fourth) in
            [(Pressure::Ball, 0.4, 8.0 / 35.0), (Pressure::Punch, 2.0 / 3.0, 8.0 / 15.0)]
        {
            let sum = |f: &dyn Fn(f64, f64) -> f64| {
                pressure.points().map(|(point, w)| w * f(point.place[0], point.place[1])).sum::<f64>()
            };
            assert_eq!(pressure.points().count(), PRESSURE_POINTS);
            assert!((sum(&|_, _| 1.0) - 1.0).abs() < 1e-14);
            assert!((sum(&|x, y| x * x + y * y) - second).abs() < 1e-14);
            assert!((sum(&|x, y| (x * x + y * y).powi(2)) - fourth).abs() < 1e-14);
            assert!(sum(&|x, y| x + y + x * y * x).abs() < 1e-14);
        }
    }

    #[test]
    fn the_table_of_points_is_the_closed_form() {
        for (i, point) in POINTS.iter().enumerate() {
            let Ring { s, radius, .. } = RINGS[i / POINTS_ON_RING];
            assert!((radius - (1.0 - s * s).sqrt()).abs() < 1e-15);
            let turned = 0.5 * ((i / POINTS_ON_RING) % 2) as f64;
            let angle = TAU * ((i % POINTS_ON_RING) as f64 + turned) / POINTS_ON_RING as f64;
            let [x, y] = point.place;
            assert!((x - radius * angle.cos()).abs() < 1e-15 && (y - radius * angle.sin()).abs() < 1e-15);
            assert!((x.hypot(y) - point.distance).abs() < 1e-15);
            for (found, wanted) in point.portions.iter().zip(portions(point.place)) {
                assert!((found - wanted).abs() < 1e-14, "{found} {wanted} of {i}");
            }
        }
    }

    #[test]
    fn portions_of_a_point_sum_to_one_and_have_the_symmetry_of_the_square() {
        for point in &POINTS {
            let [x, y] = point.place;
            let turned = POINTS
                .iter()
                .find(|other| (other.place[0] + y).abs() < 1e-12 && (other.place[1] - x).abs() < 1e-12);
            let (at, turned) = (point.portions, turned.unwrap().portions);
            assert!((at.iter().sum::<f64>() - 1.0).abs() < 1e-12 && at.iter().all(|p| *p >= 0.0));
            for side in 0..8 {
                assert!((at[1 + side] - turned[1 + (side + 2) % 8]).abs() < 1e-12, "({x}, {y}), {side}");
            }
        }
    }
}
