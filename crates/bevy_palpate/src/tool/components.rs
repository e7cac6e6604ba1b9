//! The components that describe a tool, and the messages about its contacts and grasps.

use super::results::{ForceError, LocalModelStats, LoopTiming, ToolForce, TouchedBody};
use super::safety::SafetyOverrides;
use crate::device::DeviceSelector;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{BodyError, ToolContact, ToolShape, VirtualCoupling};
use palpate_haptics::{DeviceFrame, VelocityEstimator};
use palpate_local::Scheme;

/// A haptic tool: a sphere, or the end of a flat punch, at the position of its device. Requires [`ToolSettings`] and the results
/// [`ToolForce`], [`LocalModelStats`], [`ForceError`], [`LoopTiming`] and [`TouchedBody`].
///
/// Inserting it starts a loop; removing it stops the loop with zero force and joins its thread. The [`Transform`] is that of the proxy,
/// interpolated between the last two model steps like the bodies; its scale is the app's. Parents do not move the tool: whatever their
/// place, rotation and scale, the transform relative to them puts the tool where its device is. A parent whose transform cannot be inverted
/// is a fault ([`HapticFaultKind::ToolParent`](crate::HapticFaultKind::ToolParent)).
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[require(ToolSettings, ToolForce, LocalModelStats, ForceError, LoopTiming, TouchedBody, Transform)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct HapticTool {
    /// Device that moves the tool. A change starts another loop.
    pub device: DeviceSelector,
    /// Scheme by which the loop renders force between two model steps. A change takes effect at the next model step.
    #[reflect(remote = crate::reflect::ReflectedScheme)]
    pub scheme: Scheme,
    /// Shape of the tool, in the world frame: it does not rotate with the device. A change ends a contact.
    #[reflect(remote = crate::reflect::ReflectedToolShape)]
    pub shape: ToolShape,
    /// Coefficient of friction between the tool and the body. A change ends a contact.
    pub friction: f64,
    /// Coupling of the tool to the device. A change ends a contact.
    pub coupling: ToolCoupling,
    /// Body that the tool can touch; `None` for all bodies that share a layer with it: the nearest one, and a second one that it reaches
    /// at the same time. A touched body is replaced only without contact. A change ends contacts; [`TouchedBody`] describes how the next
    /// one starts.
    #[entities]
    pub body: Option<Entity>,
}

impl Default for HapticTool {
    /// The device `"default"`, [`Scheme::NearFieldExact`], a sphere of radius 5 mm, friction 0.3, a virtual coupling, all bodies.
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
    /// Returns a tool moved by `device`, with the other values of [`HapticTool::default`]. A string selects the device registered under
    /// that name in [`HapticDevices`](crate::HapticDevices).
    ///
    /// ```
    /// use bevy_palpate::{DeviceSelector, prelude::*};
    ///
    /// let tool = HapticTool::new("hand").with_shape(ToolShape::Sphere { radius_m: 0.01 }).with_friction(0.0);
    /// assert_eq!(tool.device, DeviceSelector::named("hand"));
    /// ```
    #[must_use]
    pub fn new(device: impl Into<DeviceSelector>) -> Self {
        Self { device: device.into(), ..Self::default() }
    }

    /// Returns the tool with another scheme.
    #[must_use]
    pub fn with_scheme(self, scheme: Scheme) -> Self {
        Self { scheme, ..self }
    }

    /// Returns the tool with another shape.
    #[must_use]
    pub fn with_shape(self, shape: ToolShape) -> Self {
        Self { shape, ..self }
    }

    /// Returns the tool with another coefficient of friction.
    #[must_use]
    pub fn with_friction(self, friction: f64) -> Self {
        Self { friction, ..self }
    }

    /// Returns the tool with another coupling.
    #[must_use]
    pub fn with_coupling(self, coupling: ToolCoupling) -> Self {
        Self { coupling, ..self }
    }

    /// Returns the tool for one body only.
    #[must_use]
    pub fn with_body(self, body: Entity) -> Self {
        Self { body: Some(body), ..self }
    }

    /// Returns a contact of the tool's shape, friction and coupling that touches nothing yet.
    ///
    /// # Errors
    /// [`BodyError`] if shape, friction or coupling are out of range.
    pub fn contact(&self) -> Result<ToolContact, BodyError> {
        self.coupling.apply_to(ToolContact::touch(self.shape, self.friction)?)
    }
}

/// Coupling of a tool to its device: rigid, or a virtual coupling as in [`VirtualCoupling`].
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, Default, PartialEq, Clone)]
pub enum ToolCoupling {
    /// The tool is at the device's position, without a limit of the force: it can pull a body through itself. For measuring fidelity.
    Rigid,
    /// A stiff spring with a maximum force. When the device penetrates deeper than the body can yield, the tool stays on the surface.
    Virtual {
        /// Stiffness, N/m. Below the maximum force F the distance between tool and device is F / stiffness.
        stiffness_n_per_m: f64,
        /// Maximum force on the hand and on the body, N.
        max_force_n: f64,
    },
}

impl ToolCoupling {
    /// Returns `contact` with this coupling.
    pub(crate) fn apply_to(self, contact: ToolContact) -> Result<ToolContact, BodyError> {
        match self {
            Self::Rigid => Ok(contact),
            Self::Virtual { stiffness_n_per_m, max_force_n } => {
                contact.with_coupling(VirtualCoupling { stiffness_n_per_m, max_force_n })
            }
        }
    }
}

impl Default for ToolCoupling {
    /// A virtual coupling of 20 kN/m, which is 0.25 mm at 5 N, and at most 10 N.
    fn default() -> Self {
        Self::Virtual { stiffness_n_per_m: 20e3, max_force_n: 10.0 }
    }
}

/// Settings of a tool's loop that can change while it runs.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ToolSettings {
    /// Mapping from the device frame to the world frame: rotation, scale and offset.
    #[reflect(remote = crate::reflect::ReflectedDeviceFrame)]
    pub frame: DeviceFrame,
    /// Limits of the safety chain that differ from those of the device. [`ToolLoop::safety`](crate::ToolLoop::safety) returns all that
    /// are in effect.
    pub safety: SafetyOverrides,
    /// Source of the samples' velocity.
    #[reflect(remote = crate::reflect::ReflectedVelocityEstimator)]
    pub velocity: VelocityEstimator,
}

/// A contact of a tool with a body has started. Exactly one [`ContactEnd`] follows each, for any cause of the end.
///
/// Like [`ContactEnd`], [`GraspStart`] and [`GraspEnd`] it is a message, readable in the same model step after
/// [`HapticSystems::StepBodies`](crate::HapticSystems::StepBodies), and an event for observers of the tool, which run in [`Last`]. In a
/// model step a tool ends at most one contact with each body and then starts at most one; observers run in that order, ends before starts.
/// A tool has at most two contacts at once, each with a start and an end of its own. A pause of the
/// app ends a contact of a loop on a thread, in the first model step after the pause, because the device may have moved. The contact starts
/// again in that step or later; [`TouchedBody`] states when. In lock step a pause has no effect on contacts.
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
    /// Point of the body's surface, m, world frame.
    pub point_m: DVec3,
    /// Unit normal of the surface there, out of the body, world frame.
    pub normal: DVec3,
}

/// A contact of a tool with a body has ended. If the tool was despawned, observers of that entity do not run, but global observers do.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct ContactEnd {
    /// The tool.
    #[event_target]
    pub tool: Entity,
    /// The body.
    pub body: Entity,
}

/// Ability of a tool to grasp. While the button is pressed the tool holds the point of the surface that was nearest when the grasp
/// closed, against pushing and pulling. When the button is released the tool touches again.
///
/// The button is read once in a model step, at the newest sample along which the body was stepped: a shorter press may be missed. The
/// rendered force follows with the next local model. When something else ends a grasp, for example a body that is built again with
/// other nodes, the button must be pressed again.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[require(GraspedPoint)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ToolGrasp {
    /// Button that closes the grasp: its bit number in the buttons of a reading.
    pub button: u32,
    /// Maximum distance between the device's position and the grasped surface, m.
    pub reach_m: f64,
}

impl Default for ToolGrasp {
    /// The first button, 10 mm.
    fn default() -> Self {
        Self { button: 0, reach_m: 0.01 }
    }
}

/// Point of a body that a tool with [`ToolGrasp`] holds, updated at every model step.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct GraspedPoint {
    /// The held body; `None` while the tool holds nothing.
    pub body: Option<Entity>,
    /// Position of the held point, m, world frame.
    pub point_m: DVec3,
}

/// A tool with [`ToolGrasp`] has grasped a point of a body. Exactly one [`GraspEnd`] follows each.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct GraspStart {
    /// The tool.
    #[event_target]
    pub tool: Entity,
    /// The body.
    pub body: Entity,
    /// Position of the grasped point, m, world frame.
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
