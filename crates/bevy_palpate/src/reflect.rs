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

/// Reflection of [`palpate_haptics::DeviceFrame`].
#[bevy::reflect::reflect_remote(palpate_haptics::DeviceFrame)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReflectedDeviceFrame {
    pub rotation: DQuat,
    pub scale: f64,
    pub offset_m: DVec3,
}

/// Reflection of [`palpate_body::Damping`].
#[bevy::reflect::reflect_remote(palpate_body::Damping)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ReflectedDamping {
    Ratio(f64),
    LossFactor { loss_factor: f64, frequency_hz: f64 },
    Rayleigh { mass_per_s: f64, stiffness_s: f64 },
}

/// Reflection of [`palpate_body::ElasticLaw`].
#[bevy::reflect::reflect_remote(palpate_body::ElasticLaw)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ReflectedElasticLaw {
    CorotationalLinear,
    #[default]
    NeoHookean,
}

/// Reflection of [`palpate_body::Relaxation`].
#[bevy::reflect::reflect_remote(palpate_body::Relaxation)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ReflectedRelaxation {
    pub shares: [f64; 3],
    pub times_s: [f64; 3],
}

/// Reflection of [`palpate_body::ToolShape`].
#[bevy::reflect::reflect_remote(palpate_body::ToolShape)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ReflectedToolShape {
    Sphere { radius_m: f64 },
    FlatPunch { radius_m: f64, axis: DVec3 },
}
