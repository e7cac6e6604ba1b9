//! The arm of a WoodenHaptics: from encoder counts to the place of its tip, and from a force to the currents of its motors.
//!
//! Sources: forsslund/haptikfabrikenapi at b8d6c94, `src/kinematics.cpp` for the formulas, `src/haptikfabrikenapi.h` for the numbers.

use crate::HidError;
use glam::{DMat3, DVec3, Vec3Swizzles};
use std::f64::consts::TAU;

/// Which of the two linkages an arm has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BoardLinkage {
    /// Two links, each turned from the base: WoodenHaptics, AluHaptics, Polhem 1.
    #[default]
    WoodenHaptics,
    /// Five bars: Polhem 2 and 3, variant 3 of the interface. It is refused with [`HidError::Unsupported`]: the lengths of its
    /// capstans and its home differ between what has been published, and the wrong ones would turn forces.
    Polhem,
}

/// The arm of a WoodenHaptics: three bodies, each turned by a motor through a capstan.
///
/// Body A turns about the vertical by θ_A; on it turn B, from the vertical, by θ_B, and C, from straight down, by θ_C:
///
/// * θ_i = s_i · 2π n_i / cpr_i · d_i / D_i, with the counts n, the counts for a turn cpr, the diameters d of the capstan and D of
///   the body, and s = ±1;
/// * x = cos θ_A (L_b sin θ_B + L_c sin θ_C) − o_x,
///   y = sin θ_A (L_b sin θ_B + L_c sin θ_C) − o_y,
///   z = L_n + L_b cos θ_B − L_c cos θ_C − o_z;
/// * τ = JᵀF with J = ∂(x, y, z)/∂θ; the torque of a motor is s_i τ_i d_i / D_i, its current that by its torque constant k_i.
///
/// # Frame
///
/// The formulas have x towards the hand's owner, y to the right, z up (the frame of CHAI3D). What is given and taken here is in
/// palpate's frame of devices, x to the right, y up, z towards the owner: (y, z, x) of the formulas, as
/// `examples/h3d/H3D24/HAPI/src/HaptikfabrikenHapticsDevice.cpp` of the source has it for the same frame. The zero is the middle of
/// the workspace. Force is what the device does to the hand.
///
/// # Not in it
///
/// The weight of the bodies (the source's numbers switch its compensation off as well), friction, and the turning of the grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardKinematics {
    /// L_n, L_b, L_c: height of the shoulder, lengths of the two links, m.
    pub length_m: [f64; 3],
    /// d: diameters of the capstans on the motors, m.
    pub capstan_m: [f64; 3],
    /// D: diameters of the bodies where the cable runs, m.
    pub body_m: [f64; 3],
    /// s: whether a body turns against its counts. The source's `motor_and_body_aligned`.
    pub is_reversed: [bool; 3],
    /// cpr: counts for a turn of the motor, four for each line of the encoder.
    pub counts_per_turn: [f64; 3],
    /// k: torque constants of the motors, N m/A.
    pub torque_nm_per_a: [f64; 3],
    /// o: the middle of the workspace, m, from the foot of A's axis; in the frame of the formulas.
    pub origin_m: DVec3,
    /// Radius of the workspace, m.
    pub workspace_radius_m: f64,
    /// The largest force that it should show, N.
    pub max_force_n: f64,
    /// What the counters of encoders a to f are at home.
    pub home_counts: [i16; 6],
}

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
            length_m: [0.080, 0.205, 0.245],
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

    /// Refuses an arm that cannot be.
    ///
    /// # Errors
    /// [`HidError::Option`].
    pub fn validate(&self) -> Result<(), HidError> {
        let within = |what, values: [f64; 3], least: f64, most: f64, allowed| {
            let bad = values.into_iter().find(|value| !(least..=most).contains(value));
            bad.map_or(Ok(()), |bad| Err(HidError::Option { what, found: bad.to_string(), allowed }))
        };
        within("length of a board's links, m", self.length_m, 0.0, 10.0, "0 to 10")?;
        let [_, b, c] = self.length_m;
        within("length of a board's outer links, m", [b, c, c], 1e-3, 10.0, "0.001 to 10")?;
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
        within("middle of a board's workspace, m", self.origin_m.to_array(), -10.0, 10.0, "-10 to 10")?;
        within("radius of a board's workspace, m", [self.workspace_radius_m; 3], 1e-3, 10.0, "0.001 to 10")?;
        within("largest force of a board, N", [self.max_force_n; 3], 0.0, 100.0, "0 to 100")?;
        // So that a counter of 16 bits names one place of the body.
        within(
            "counts for a whole turn of a board's body",
            self.angle_per_count().map(|angle| TAU / angle.abs()),
            1.0,
            65_536.0,
            "at most 65536, or its counters could not be told apart",
        )
    }

    /// Angle of each body for one count, with its sign, rad.
    fn angle_per_count(&self) -> [f64; 3] {
        let [a, b, c] = self.transmission();
        let [m, n, o] = self.counts_per_turn;
        [a * TAU / m, b * TAU / n, c * TAU / o]
    }

    /// s d / D: turns of each body for one of its motor.
    fn transmission(&self) -> [f64; 3] {
        let of = |capstan: f64, body: f64, is_reversed: bool| {
            if is_reversed { -capstan / body } else { capstan / body }
        };
        let ([d, e, f], [k, l, m], [r, s, t]) = (self.capstan_m, self.body_m, self.is_reversed);
        [of(d, k, r), of(e, l, s), of(f, m, t)]
    }

    /// Counts of encoders a, b, c from counters of 16 bits.
    ///
    /// The counters wrap around, those of a WoodenHaptics after two turns of a body (A has 32,000 counts for one, B and C have
    /// 24,000). As no body can turn that far, the counts are the ones nearest to home, within 32,768 of it: a turn of A to either
    /// side. That holds at the first report as well, and over any silence.
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

    /// Place of the tip, m.
    #[must_use]
    pub fn position_m(&self, angles_rad: DVec3) -> DVec3 {
        let Reach { out, up, .. } = self.reach(angles_rad);
        let (sin_a, cos_a) = angles_rad.x.sin_cos();
        (DVec3::new(cos_a * out, sin_a * out, up) - self.origin_m).yzx()
    }

    /// J: how the tip moves when A, B, C turn, m/rad; a column for each.
    #[must_use]
    pub fn jacobian(&self, angles_rad: DVec3) -> DMat3 {
        let Reach { out, b, c, .. } = self.reach(angles_rad);
        let (sin_a, cos_a) = angles_rad.x.sin_cos();
        // B goes out and down, C out and up.
        DMat3::from_cols(
            DVec3::new(-sin_a * out, cos_a * out, 0.0).yzx(),
            DVec3::new(cos_a * b.y, sin_a * b.y, -b.x).yzx(),
            DVec3::new(cos_a * c.y, sin_a * c.y, c.x).yzx(),
        )
    }

    /// Currents of the motors, A, that show `force_n` there.
    #[must_use]
    pub fn currents_a(&self, angles_rad: DVec3, force_n: DVec3) -> DVec3 {
        let torques_nm = self.jacobian(angles_rad).transpose() * force_n;
        torques_nm * DVec3::from(self.transmission()) / DVec3::from(self.torque_nm_per_a)
    }

    /// The force, N, that these currents show there, A; `None` where the arm is singular.
    #[must_use]
    pub fn force_n(&self, angles_rad: DVec3, currents_a: DVec3) -> Option<DVec3> {
        if self.leverage(angles_rad) <= f64::EPSILON {
            return None;
        }
        let torques_nm = currents_a * DVec3::from(self.torque_nm_per_a) / DVec3::from(self.transmission());
        Some(self.jacobian(angles_rad).transpose().inverse() * torques_nm).filter(|force| force.is_finite())
    }

    /// How far the arm is from where it is singular: 0 there, 1 at most. The determinant of J is ρ L_b L_c sin(θ_B + θ_C), where ρ
    /// is the distance of the tip from A's axis; this is the product of ρ/(L_b + L_c) and the sine, without signs.
    #[must_use]
    pub fn leverage(&self, angles_rad: DVec3) -> f64 {
        let [_, l_b, l_c] = self.length_m;
        let out = self.reach(angles_rad).out / (l_b + l_c);
        (out * (angles_rad.y + angles_rad.z).sin()).abs()
    }

    fn reach(&self, angles_rad: DVec3) -> Reach {
        let [l_n, l_b, l_c] = self.length_m;
        let ((sin_b, cos_b), (sin_c, cos_c)) = (angles_rad.y.sin_cos(), angles_rad.z.sin_cos());
        let (b, c) = (Link { x: l_b * sin_b, y: l_b * cos_b }, Link { x: l_c * sin_c, y: l_c * cos_c });
        Reach { out: b.x + c.x, up: l_n + b.y - c.y, b, c }
    }
}

/// L sin θ and L cos θ of a link, m.
struct Link {
    x: f64,
    y: f64,
}

/// The tip in the plane of B and C, m: how far from A's axis, ρ, and how high.
struct Reach {
    out: f64,
    up: f64,
    b: Link,
    c: Link,
}
