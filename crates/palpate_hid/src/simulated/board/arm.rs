//! Simulated arm, with kinematics independent of the driver's.

use crate::{BoardKinematics, BoardLinkage};
use glam::{DMat3, DQuat, DVec3, Vec3Swizzles};
use std::f64::consts::TAU;

/// Step of the finite differences, rad; their error, of third order, is about 1e-11 of a link's length.
const DIFFERENCE_RAD: f64 = 1e-5;
/// Mass of the tip, kg.
const MASS_KG: f64 = 0.2;
/// Stiffness of the hand, N/m.
const STIFFNESS_N_PER_M: f64 = 400.0;
/// Damping of the hand, N s/m.
const DAMPING_NS_PER_M: f64 = 10.0;

/// Links, motors and encoders, and the hand's hold. Internally x points towards the user, y to the right, z up, from the foot of the
/// first axis; arguments and results are in the device frame.
pub(super) struct Arm {
    sizes: BoardKinematics,
    angles_rad: DVec3,
    tip_m: DVec3,
    velocity_m_per_s: DVec3,
}

impl Arm {
    pub(super) fn at_home(sizes: &BoardKinematics) -> Self {
        let mut arm = Self {
            sizes: *sizes,
            angles_rad: DVec3::ZERO,
            tip_m: DVec3::ZERO,
            velocity_m_per_s: DVec3::ZERO,
        };
        let home = [0, 1, 2].map(|i| f64::from(sizes.home_counts[i]) / arm.counts_per_rad(i));
        arm.angles_rad = DVec3::from(home);
        arm.tip_m = arm.tip(arm.angles_rad);
        arm
    }

    /// Position of the tip, m.
    pub(super) fn tip_m(&self) -> DVec3 {
        (self.tip_m - self.sizes.origin_m).yzx()
    }

    /// Encoder counts since the angles were zero.
    pub(super) fn counts(&self) -> [i32; 3] {
        [0, 1, 2].map(|i| (self.angles_rad[i] * self.counts_per_rad(i)).round() as i32)
    }

    /// Force of the motors on the hand, N.
    pub(super) fn force_n(&self, currents_ma: [i16; 3]) -> DVec3 {
        let torques_nm = [0, 1, 2].map(|i| {
            let motor_nm = 1e-3 * f64::from(currents_ma[i]) * self.sizes.torque_nm_per_a[i];
            motor_nm * self.turns(i)
        });
        // Virtual work: τ · dθ = F · dx for every dθ.
        (self.jacobian(self.angles_rad).transpose().inverse() * DVec3::from(torques_nm)).yzx()
    }

    /// Advances the tip by an implicit step with the hand at `hand_m` and the motor force `force_n`, then solves for the angles.
    pub(super) fn advance(&mut self, hand_m: DVec3, force_n: DVec3, step_s: f64) {
        let hand_m = hand_m.zxy() + self.sizes.origin_m;
        let pull_n = force_n.zxy() + STIFFNESS_N_PER_M * (hand_m - self.tip_m);
        let inertia_kg = MASS_KG + step_s * DAMPING_NS_PER_M + step_s * step_s * STIFFNESS_N_PER_M;
        self.velocity_m_per_s = (MASS_KG * self.velocity_m_per_s + step_s * pull_n) / inertia_kg;
        self.tip_m += step_s * self.velocity_m_per_s;
        for _ in 0..8 {
            let off_m = self.tip_m - self.tip(self.angles_rad);
            self.angles_rad += self.jacobian(self.angles_rad).inverse() * off_m;
        }
    }

    /// Turns of a motor for one of its body, signed.
    fn turns(&self, i: usize) -> f64 {
        let turns = self.sizes.body_m[i] / self.sizes.capstan_m[i];
        if self.sizes.is_reversed[i] { -turns } else { turns }
    }

    fn counts_per_rad(&self, i: usize) -> f64 {
        self.turns(i) * self.sizes.counts_per_turn[i] / TAU
    }

    /// Position of the tip: that in the plane of the linkage, rotated by A.
    fn tip(&self, angles_rad: DVec3) -> DVec3 {
        let in_plane = match self.sizes.linkage {
            BoardLinkage::WoodenHaptics { length_m } => two_links(length_m, angles_rad),
            BoardLinkage::Polhem { length_m } => five_bars(length_m, angles_rad),
        };
        DQuat::from_rotation_z(angles_rad.x) * in_plane
    }

    /// Derivatives of the tip with respect to the angles, m/rad.
    fn jacobian(&self, angles_rad: DVec3) -> DMat3 {
        let along = |axis: DVec3| {
            let (after, before) = (angles_rad + DIFFERENCE_RAD * axis, angles_rad - DIFFERENCE_RAD * axis);
            (self.tip(after) - self.tip(before)) / (2.0 * DIFFERENCE_RAD)
        };
        DMat3::from_cols(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
    }
}

/// Two links in series: B from upright, C from hanging down, both rotated to the front.
fn two_links([l_n, l_b, l_c]: [f64; 3], angles_rad: DVec3) -> DVec3 {
    let b = DQuat::from_rotation_y(angles_rad.y) * (l_b * DVec3::Z);
    let c = DQuat::from_rotation_y(-angles_rad.z) * (-l_c * DVec3::Z);
    l_n * DVec3::Z + b + c
}

/// Upper arm and crank from their axes, then the outer link by the length of the rod. With t = tan(λ/2) this is a quadratic equation
/// (Freudenstein's); one of its roots is the assembled arm. Bars that cannot close are treated as just touching.
fn five_bars([l0, l1, l2, l3, l4, l5]: [f64; 6], angles_rad: DVec3) -> DVec3 {
    let turned = |angle: f64| DQuat::from_rotation_y(-angle) * DVec3::X;
    let elbow = 0.5 * l0 * DVec3::X + l1 * turned(angles_rad.y);
    let crank = -0.5 * l0 * DVec3::X + l2 * turned(angles_rad.z);
    let w = elbow - crank;
    // |w − L4 u(λ)| = L3: w · u(λ) = k.
    let k = (w.length_squared() + l4 * l4 - l3 * l3) / (2.0 * l4);
    let root = (w.length_squared() - k * k).max(0.0).sqrt();
    elbow + l5 * turned(2.0 * (w.z - root).atan2(k + w.x))
}
