//! Kinematics of a board's arm: encoder counts to tip position, and force to motor currents.
//!
//! Sources: forsslund/haptikfabrikenapi at b8d6c94, `src/kinematics.cpp` for the formulas, `src/haptikfabrikenapi.h` for the sizes;
//! those of a Polhem are named in `presets.rs`.

use super::linkage::BoardLinkage;
use super::reach::Reach;
use crate::HidError;
use glam::{DMat3, DVec3, Vec3Swizzles};
use std::f64::consts::TAU;

/// Arm of a board: three bodies, each driven by a motor through a capstan, and the linkage from the bodies to the tip.
///
/// Body A turns about the vertical axis by θ_A and carries the linkage, which lies in a plane with that axis. Bodies B and C, at θ_B
/// and θ_C, move the tip in the plane: ρ from the axis and h up ([`BoardLinkage`] has the formulas).
///
/// * θ_i = s_i · 2π n_i / cpr_i · d_i / D_i, with the counts n, the counts per turn cpr, the diameters d of the capstan and D of
///   the body, and s = ±1;
/// * x = ρ cos θ_A − o_x, y = ρ sin θ_A − o_y, z = h − o_z;
/// * τ = JᵀF with J = ∂(x, y, z)/∂θ; the torque of a motor is s_i τ_i d_i / D_i, its current that by its torque constant k_i.
///
/// # Frame
///
/// In the formulas x points towards the user, y to the right, z up (the frame of CHAI3D). Arguments and results use palpate's device
/// frame: x to the right, y up, z towards the user, which is (y, z, x) of the formulas, as in
/// `examples/h3d/H3D24/HAPI/src/HaptikfabrikenHapticsDevice.cpp` of the source for the same frame. The origin is the centre of the
/// workspace. Forces are those exerted by the device on the hand.
///
/// # Not included
///
/// Weight of the bodies, friction, and rotation of the grip. The source disables weight compensation for a WoodenHaptics; for a Polhem
/// hfabapi adds 0.4 kg of bodies to the torques. Such a force would bypass the safety chain, so here the hand carries the weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardKinematics {
    /// Linkage from bodies B and C to the tip, with the lengths of its links.
    pub linkage: BoardLinkage,
    /// Diameters d of the capstans on the motors, m.
    pub capstan_m: [f64; 3],
    /// Diameters D of the bodies at the cable, m.
    pub body_m: [f64; 3],
    /// Whether a body turns against its counts (s = −1). `motor_and_body_aligned` of the source.
    pub is_reversed: [bool; 3],
    /// Encoder counts cpr for a turn of the motor: four for each line of the encoder.
    pub counts_per_turn: [f64; 3],
    /// Torque constants k of the motors, N m/A.
    pub torque_nm_per_a: [f64; 3],
    /// Centre o of the workspace, m, from the foot of A's axis, in the frame of the formulas.
    pub origin_m: DVec3,
    /// Radius of the workspace, m.
    pub workspace_radius_m: f64,
    /// Maximum force, N.
    pub max_force_n: f64,
    /// Counters of encoders a to f at home.
    pub home_counts: [i16; 6],
}

impl BoardKinematics {
    /// Validates the sizes, and that the linkage closes at home.
    ///
    /// # Errors
    /// [`HidError::Option`].
    pub fn validate(&self) -> Result<(), HidError> {
        let within = |what, values: [f64; 3], min: f64, max: f64, allowed| {
            let bad = values.into_iter().find(|value| !(min..=max).contains(value));
            bad.map_or(Ok(()), |bad| Err(HidError::Option { what, found: bad.to_string(), allowed }))
        };
        self.linkage.validate()?;
        within("diameter of a board's capstan, m", self.capstan_m, 1e-4, 1.0, "0.0001 to 1")?;
        within("diameter of a board's body, m", self.body_m, 1e-4, 10.0, "0.0001 to 10")?;
        within("counts for a turn of a board's motor", self.counts_per_turn, 1.0, 1e6, "1 to 1000000")?;
        within(
            "torque constant of a board's motor, N m/A",
            self.torque_nm_per_a,
            1e-4,
            10.0,
            "0.0001 to 10",
        )?;
        within("centre of a board's workspace, m", self.origin_m.to_array(), -10.0, 10.0, "-10 to 10")?;
        within("radius of a board's workspace, m", [self.workspace_radius_m; 3], 1e-3, 10.0, "0.001 to 10")?;
        within("maximum force of a board, N", [self.max_force_n; 3], 0.0, 100.0, "0 to 100")?;
        // Otherwise a counter of 16 bits is ambiguous within one turn of the body.
        within(
            "counts for a whole turn of a board's body",
            self.angle_per_count().map(|angle| TAU / angle.abs()),
            1.0,
            65_536.0,
            "at most 65536, because its counters have 16 bits",
        )?;
        if self.reach(self.home_rad()).is_closed {
            return Ok(());
        }
        let [a, b, c, ..] = self.home_counts;
        let allowed = "counts with which the bars of its linkage close";
        Err(HidError::Option { what: "home counters of a board", found: format!("{a}, {b}, {c}"), allowed })
    }

    /// Angle of each body per count, signed, rad.
    fn angle_per_count(&self) -> [f64; 3] {
        let [a, b, c] = self.transmission();
        let [m, n, o] = self.counts_per_turn;
        [a * TAU / m, b * TAU / n, c * TAU / o]
    }

    /// Turns of each body per turn of its motor, s d / D.
    fn transmission(&self) -> [f64; 3] {
        let of = |capstan: f64, body: f64, is_reversed: bool| {
            if is_reversed { -capstan / body } else { capstan / body }
        };
        let ([d, e, f], [k, l, m], [r, s, t]) = (self.capstan_m, self.body_m, self.is_reversed);
        [of(d, k, r), of(e, l, s), of(f, m, t)]
    }

    /// Counts of encoders a, b, c from 16-bit counters.
    ///
    /// The counters wrap around; those of a WoodenHaptics after two turns of a body (A has 32,000 counts per turn, B and C have 24,000).
    /// No body can turn that far, so the counts nearest to home are used, within 32,768 of it: a turn of A to either side. This also
    /// holds at the first report and after any silence.
    #[must_use]
    pub fn counts(&self, counters: [i16; 3]) -> [i32; 3] {
        let of = |counter: i16, home: i16| i32::from(home) + i32::from(counter.wrapping_sub(home));
        let ([a, b, c], [h, i, j, ..]) = (counters, self.home_counts);
        [of(a, h), of(b, i), of(c, j)]
    }

    /// Angles θ_A, θ_B, θ_C, rad, at these counts.
    #[must_use]
    pub fn angles_rad(&self, counts: [i32; 3]) -> DVec3 {
        DVec3::from(self.angle_per_count()) * DVec3::from(counts.map(f64::from))
    }

    /// Angles θ_A, θ_B, θ_C, rad, at home.
    #[must_use]
    pub fn home_rad(&self) -> DVec3 {
        let [a, b, c, ..] = self.home_counts;
        self.angles_rad([a, b, c].map(i32::from))
    }

    /// Position of the tip, m; always finite. Before calibration the bars of a Polhem may not close; then its outer link points as if
    /// they were stretched, or folded, towards each other.
    #[must_use]
    pub fn position_m(&self, angles_rad: DVec3) -> DVec3 {
        let Reach { tip, .. } = self.reach(angles_rad);
        let (sin_a, cos_a) = angles_rad.x.sin_cos();
        (DVec3::new(cos_a * tip.x, sin_a * tip.x, tip.y) - self.origin_m).yzx()
    }

    /// Jacobian J of the tip position, m/rad, one column for each of A, B, C; always finite. Where the bars of a Polhem do not close, or
    /// lie in one line, the outer link is treated as fixed to B.
    #[must_use]
    pub fn jacobian(&self, angles_rad: DVec3) -> DMat3 {
        let Reach { tip, by_b, by_c, .. } = self.reach(angles_rad);
        let (sin_a, cos_a) = angles_rad.x.sin_cos();
        DMat3::from_cols(
            DVec3::new(-sin_a * tip.x, cos_a * tip.x, 0.0).yzx(),
            DVec3::new(cos_a * by_b.x, sin_a * by_b.x, by_b.y).yzx(),
            DVec3::new(cos_a * by_c.x, sin_a * by_c.x, by_c.y).yzx(),
        )
    }

    /// Motor currents that display `force_n` in the pose `angles_rad`, A.
    #[must_use]
    pub fn currents_a(&self, angles_rad: DVec3, force_n: DVec3) -> DVec3 {
        let torques_nm = self.jacobian(angles_rad).transpose() * force_n;
        torques_nm * DVec3::from(self.transmission()) / DVec3::from(self.torque_nm_per_a)
    }

    /// Force of the motor currents `currents_a`, A, in the pose `angles_rad`, N; `None` in a singular pose.
    #[must_use]
    pub fn force_n(&self, angles_rad: DVec3, currents_a: DVec3) -> Option<DVec3> {
        if self.leverage(angles_rad) <= f64::EPSILON {
            return None;
        }
        let torques_nm = currents_a * DVec3::from(self.torque_nm_per_a) / DVec3::from(self.transmission());
        Some(self.jacobian(angles_rad).transpose().inverse() * torques_nm).filter(|force| force.is_finite())
    }

    /// Distance from singularity, 0 to 1: 0 in a singular pose, and where the bars of the linkage do not close. It is ρ relative to its
    /// maximum, times the sines of the angles between the links that must not be collinear; see [`BoardLinkage`].
    #[must_use]
    pub fn leverage(&self, angles_rad: DVec3) -> f64 {
        self.reach(angles_rad).leverage
    }

    fn reach(&self, angles_rad: DVec3) -> Reach {
        self.linkage.reach(angles_rad.y, angles_rad.z)
    }
}
