//! The components that describe a tool, and the messages about its contacts.

use super::results::{ForceError, LocalModelStats, LoopTiming, ToolForce, TouchedBody};
use crate::device::DeviceSelector;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{BodyError, ToolContact, ToolShape, VirtualCoupling};
use palpate_haptics::{DeviceFrame, SafetySettings, VelocityEstimator};
use palpate_local::Scheme;

/// A haptic interface point: a sphere, or the end of a punch, at the place of its device. Its partners come by themselves; among them
/// the results [`ToolForce`], [`LocalModelStats`], [`ForceError`], [`LoopTiming`] and [`TouchedBody`].
///
/// Spawning it starts a loop, removing it stops the loop with zero force and joins its thread. Its
/// [`Transform`] is where it is in the picture: between the last two model steps, as the bodies are drawn, and behind its
/// coupling. Spawn it without a parent.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[require(ToolSettings, ToolForce, LocalModelStats, ForceError, LoopTiming, TouchedBody, Transform)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct HapticTool {
    /// Which device moves it. A change starts another loop.
    pub device: DeviceSelector,
    /// How the loop makes force between two model steps. A change acts at the next model step.
    #[reflect(remote = crate::reflect::ReflectedScheme)]
    pub scheme: Scheme,
    /// What touches, in the world's frame: it does not turn with the device. A change ends a touch.
    #[reflect(remote = crate::reflect::ReflectedToolShape)]
    pub shape: ToolShape,
    /// Coefficient of friction between the tool and what it touches. A change ends a touch.
    pub friction: f64,
    /// What holds the tool to the device. A change ends a touch.
    pub coupling: ToolCoupling,
    /// The body that it can touch; `None`: the one that is nearest while it touches nothing. A change ends a touch; how the next
    /// one begins is at [`TouchedBody`].
    #[entities]
    pub body: Option<Entity>,
}

impl Default for HapticTool {
    /// The device `"default"`, [`Scheme::NearFieldExact`], a sphere of 5 mm, friction 0.3, a coupling that gives way, the nearest body.
    fn default() -> Self {
        Self {
            device: DeviceSelector::default(),
            scheme: Scheme::default(),
            shape: ToolShape::Sphere { radius_m: 0.005 },
            friction: 0.3,
            coupling: ToolCoupling::default(),
            body: None,
        }
    }
}

impl HapticTool {
    /// A tool that `device` moves, with the other values of [`HapticTool::default`]. A string selects the device that is registered under
    /// that name.
    ///
    /// ```
    /// use bevy_palpate::prelude::*;
    ///
    /// let tool = HapticTool::new("hand").with_shape(ToolShape::Sphere { radius_m: 0.01 }).with_friction(0.0);
    /// assert_eq!(tool.device, DeviceSelector::named("hand"));
    /// ```
    #[must_use]
    pub fn new(device: impl Into<DeviceSelector>) -> Self {
        Self { device: device.into(), ..Self::default() }
    }

    /// The same tool with another scheme.
    #[must_use]
    pub fn with_scheme(self, scheme: Scheme) -> Self {
        Self { scheme, ..self }
    }

    /// The same tool with another shape.
    #[must_use]
    pub fn with_shape(self, shape: ToolShape) -> Self {
        Self { shape, ..self }
    }

    /// The same tool with another coefficient of friction.
    #[must_use]
    pub fn with_friction(self, friction: f64) -> Self {
        Self { friction, ..self }
    }

    /// The same tool with another coupling.
    #[must_use]
    pub fn with_coupling(self, coupling: ToolCoupling) -> Self {
        Self { coupling, ..self }
    }

    /// The same tool for one body only.
    #[must_use]
    pub fn with_body(self, body: Entity) -> Self {
        Self { body: Some(body), ..self }
    }

    /// A contact of its shape, which touches nothing yet.
    ///
    /// # Errors
    /// [`BodyError`] when shape, friction or coupling make no sense.
    pub fn contact(&self) -> Result<ToolContact, BodyError> {
        self.coupling.apply_to(ToolContact::touch(self.shape, self.friction)?)
    }
}

/// What holds a tool to its device.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, Default, PartialEq, Clone)]
pub enum ToolCoupling {
    /// It is where the device is, whatever that takes: a hand can drag a body through itself. For measuring fidelity.
    Rigid,
    /// A stiff spring whose force saturates: a hand that goes deeper than the body can leaves the tool on its surface.
    Virtual {
        /// Stiffness, N/m: below the largest force the tool is F/k behind the device.
        stiffness_n_per_m: f64,
        /// The largest force, N: more is neither felt nor done to the body.
        max_force_n: f64,
    },
}

impl ToolCoupling {
    /// `contact` behind this coupling.
    pub(crate) fn apply_to(self, contact: ToolContact) -> Result<ToolContact, BodyError> {
        match self {
            Self::Rigid => Ok(contact),
            Self::Virtual { stiffness_n_per_m, max_force_n: most_n } => {
                contact.with_coupling(VirtualCoupling { stiffness_n_per_m, max_force_n: most_n })
            }
        }
    }
}

impl Default for ToolCoupling {
    /// 20 kN/m, so a quarter of a millimetre at 5 N; 10 N.
    fn default() -> Self {
        Self::Virtual { stiffness_n_per_m: 20e3, max_force_n: 10.0 }
    }
}

/// What can be set of a tool's loop while it runs.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ToolSettings {
    /// How the device lies in the scene.
    #[reflect(remote = crate::reflect::ReflectedDeviceFrame)]
    pub frame: DeviceFrame,
    /// Limits of the safety chain. As long as nothing of them is set they follow from the device's description
    /// ([`palpate_haptics::DeviceDescription::safety`]).
    #[reflect(remote = crate::reflect::ReflectedSafetySettings)]
    pub safety: SafetySettings,
    /// Where the samples' velocity comes from.
    #[reflect(remote = crate::reflect::ReflectedVelocityEstimator)]
    pub velocity: VelocityEstimator,
}

/// A tool has come into contact with a body. Each is followed by one [`ContactEnd`], whatever ends the contact.
///
/// Like [`ContactEnd`], [`GraspStart`] and [`GraspEnd`] it is a message, readable in the same model step after
/// [`HapticSystems::StepBodies`](crate::HapticSystems::StepBodies), and an event for observers of the tool, which run in [`Last`]. In a model step a
/// tool ends at most one contact and then starts at most one; observers run in that order, ends before starts. A pause of the app ends a
/// contact of a loop on a thread, because the hand may have moved; it starts again after the pause.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_palpate::prelude::*;
/// # let mut app = App::new();
/// app.add_observer(|start: On<ContactStart>| info!("{} touches {} at {}", start.tool, start.body, start.point_m));
/// ```
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct ContactStart {
    /// The tool.
    #[event_target]
    pub tool: Entity,
    /// The body.
    pub body: Entity,
    /// Where, m, world.
    pub point_m: DVec3,
    /// Unit normal of the body there, out of it.
    pub normal: DVec3,
}

/// A contact of a tool with a body has ended.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct ContactEnd {
    /// The tool.
    #[event_target]
    pub tool: Entity,
    /// The body.
    pub body: Entity,
}

/// Put it on a tool that can grasp. While its button is pressed the tool holds the point of the surface that was nearest to it
/// when it closed, pushing and pulling; it touches again when the button is released.
///
/// The button is looked at once in a model step, at the newest sample that the body was moved along: a press shorter than that may
/// not be noticed. On the hand a grasp begins and ends with the hand-over after it. What ends a grasp from outside, a body
/// that is rebuilt with other nodes for instance, needs another press to begin it again.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[require(GraspedPoint)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ToolGrasp {
    /// The button that closes it: bit i of a reading's buttons.
    pub button: u32,
    /// How far from the tool's position the surface may be to be grasped, m.
    pub reach_m: f64,
}

impl Default for ToolGrasp {
    /// The first button, 10 mm.
    fn default() -> Self {
        Self { button: 0, reach_m: 0.01 }
    }
}

/// What a tool with [`ToolGrasp`] holds.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct GraspedPoint {
    /// The body; `None` while it holds nothing.
    pub body: Option<Entity>,
    /// Where the held point is, m, world.
    pub point_m: DVec3,
}

/// A tool with [`ToolGrasp`] has grasped a point of a body. Each is followed by one [`GraspEnd`].
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct GraspStart {
    /// The tool.
    #[event_target]
    pub tool: Entity,
    /// The body.
    pub body: Entity,
    /// The grasped point, m, world frame.
    pub point_m: DVec3,
}

/// A tool has released the point that it grasped.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct GraspEnd {
    /// The tool.
    #[event_target]
    pub tool: Entity,
    /// The body.
    pub body: Entity,
}
