//! Gravity and its scale.

use bevy::prelude::*;
use glam::DVec3;

/// Acceleration of gravity on all bodies, m/s², world frame. Zero by default: a body keeps the shape in which it was made.
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_palpate::{Gravity, prelude::*};
///
/// # let mut app = App::new();
/// app.insert_resource(Gravity::EARTH);
/// ```
///
/// A change takes effect at the next model step. With gravity a body sags from the shape in which it was made; one without a fixed part
/// falls until it meets an [`Obstacle`](crate::Obstacle).
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq, Clone)]
pub struct Gravity(pub DVec3);

impl Gravity {
    /// 9.81 m/s² along −y.
    pub const EARTH: Self = Self(DVec3::new(0.0, -9.81, 0.0));
    /// No gravity.
    pub const ZERO: Self = Self(DVec3::ZERO);
}

/// Factor of [`Gravity`] for a body; 1 without the component. 0 is a body without weight.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct GravityScale(pub f64);

impl Default for GravityScale {
    /// 1.
    fn default() -> Self {
        Self(1.0)
    }
}
