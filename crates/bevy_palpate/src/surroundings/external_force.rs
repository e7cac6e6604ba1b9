//! External forces on bodies and tools.

use crate::body::BodyRegion;
use bevy::prelude::*;
use glam::DVec3;

/// Constant external forces on a body or a tool, N, world frame, until they are changed or the component is removed.
///
/// On a body each load acts on the free nodes of its region, in proportion to their masses. On a tool the sum of the loads acts on the hand
/// through the device, for example as the weight of an instrument; regions are ignored. It passes the safety chain as every force does.
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_palpate::{BodyRegion, ExternalForce, prelude::*};
///
/// fn setup(mut commands: Commands) {
///     // A weight of 0.5 N hangs at the right end of a strip.
///     let end = BodyRegion::HalfSpace { point_m: DVec3::X * 0.09, outward: DVec3::NEG_X };
///     commands.spawn((
///         DeformableBody::block_of_size([11, 3, 3], DVec3::new(0.2, 0.04, 0.04)),
///         FixedRegion::Face(BoxFace::Left),
///         ExternalForce::within(end, DVec3::NEG_Y * 0.5),
///     ));
/// }
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ExternalForce(pub Vec<Load>);

/// One of the loads of an [`ExternalForce`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Debug, Default, PartialEq, Clone)]
pub struct Load {
    /// Region of the body at rest, in its own frame; `None` for the whole body.
    pub region: Option<BodyRegion>,
    /// Total force, N, world frame.
    pub force_n: DVec3,
}

impl ExternalForce {
    /// Returns a force on the whole body, or on a tool, N, world frame.
    #[must_use]
    pub fn new(force_n: DVec3) -> Self {
        Self(vec![Load { region: None, force_n }])
    }

    /// Returns a force on a region of a body, N, world frame.
    #[must_use]
    pub fn within(region: BodyRegion, force_n: DVec3) -> Self {
        Self(vec![Load { region: Some(region), force_n }])
    }

    /// Returns these forces and another one on a region of a body, N, world frame.
    #[must_use]
    pub fn with_load(mut self, region: BodyRegion, force_n: DVec3) -> Self {
        self.0.push(Load { region: Some(region), force_n });
        self
    }

    /// Returns the sum of the loads, N.
    #[must_use]
    pub fn total_n(&self) -> DVec3 {
        self.0.iter().map(|load| load.force_n).sum()
    }
}
