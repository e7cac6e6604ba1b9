//! Reflection for the settings of the other crates, which do not depend on Bevy.

use glam::{DQuat, DVec3};

/// Reflection of [`palpate_local::Scheme`].
#[bevy::reflect::reflect_remote(palpate_local::Scheme)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) enum ReflectedScheme {
    Hold,
    LowPass,
    Tangent,
    Neighbourhood,
    KrylovLinear,
    #[default]
    NearFieldExact,
}

/// Reflection of [`palpate_haptics::VelocityEstimator`].
#[bevy::reflect::reflect_remote(palpate_haptics::VelocityEstimator)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ReflectedVelocityEstimator {
    BackwardDifference,
    TwoPole { cutoff_hz: f64 },
    Device,
}

/// Reflection of [`palpate_haptics::SafetySettings`].
#[bevy::reflect::reflect_remote(palpate_haptics::SafetySettings)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReflectedSafetySettings {
    pub arm_below_n: f64,
    pub ramp_s: f64,
    pub stale_after_periods: f64,
    pub device_timeout_ticks: u64,
    pub fade_s: f64,
    pub max_speed_m_per_s: f64,
    pub passivity_damping_ns_per_m: f64,
    pub passivity_tolerance_j: f64,
    pub max_force_n: f64,
    pub max_slew_n_per_s: f64,
}

/// Reflection of [`palpate_haptics::DeviceFrame`].
#[bevy::reflect::reflect_remote(palpate_haptics::DeviceFrame)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReflectedDeviceFrame {
    pub rotation: DQuat,
    pub scale: f64,
    pub offset_m: DVec3,
}

/// Reflection of [`palpate_body::ToolShape`].
#[bevy::reflect::reflect_remote(palpate_body::ToolShape)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ReflectedToolShape {
    Sphere { radius_m: f64 },
    FlatPunch { radius_m: f64, axis: DVec3 },
}
