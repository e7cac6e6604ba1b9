//! Tools: what the user asks for, and what is computed.

mod black_box;
mod convergence;
mod grasp;
mod model;
mod no_force;
mod overlap;
mod receive;
mod results;
mod settings;
mod size;
mod start;

pub use black_box::BlackBoxDump;
pub use grasp::{GraspedPoint, ToolGrasp};
pub use results::{
    ContactState, ForceError, LocalModelStats, LoopTiming, TickRecording, ToolForce, TouchedBody,
};
pub use start::ToolLoop;

use crate::body::HapticUpdateSystems;
use crate::device::{DeviceSelector, HapticDevices};
use crate::diagnostics::FrameCost;
use crate::fault::HapticFault;
use crate::schedule::{HapticSystems, LoopMode, ModelRate, ModelSchedule};
use crate::step_time::StepTimes;
use crate::suture::SutureSystems;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{BodyError, ToolContact, ToolShape, VirtualCoupling};
use palpate_haptics::{DeviceFrame, SafetySettings, VelocityEstimator};
use palpate_local::Scheme;

/// A haptic interface point: a sphere, or the end of a punch, at the place of its device. Its partners come by themselves; among them
/// the results [`ToolForce`], [`LocalModelBuild`], [`LocalModelError`], [`LoopTiming`] and [`Touching`].
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
    /// one begins is at [`Touching`].
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

/// A tool has touched a body. Each of these is followed by one [`ContactEnded`], whatever ends the contact.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct ContactStart {
    /// The tool.
    pub tool: Entity,
    /// The body.
    pub body: Entity,
    /// Where, m, world.
    pub point_m: DVec3,
    /// Unit normal of the body there, out of it.
    pub normal: DVec3,
}

/// A tool has let go of a body.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct ContactEnd {
    /// The tool.
    pub tool: Entity,
    /// The body.
    pub body: Entity,
}

/// Runs the tools: devices, loops, the bodies' steps along their samples, local models, results.
#[derive(Clone, Copy, Debug, Default)]
pub struct ToolPlugin;

impl Plugin for ToolPlugin {
    fn build(&self, app: &mut App) {
        let cost = FrameCost::of(app);
        let times = StepTimes::of(app);
        app.init_resource::<HapticDevices>()
            .register_type::<HapticTool>()
            .register_type::<ToolSettings>()
            .register_type::<ToolGrasp>()
            .register_type::<GraspedPoint>()
            .register_type::<ToolForce>()
            .register_type::<LocalModelStats>()
            .register_type::<ForceError>()
            .register_type::<LoopTiming>()
            .register_type::<TouchedBody>()
            .register_type::<ContactState>()
            .register_type::<TickRecording>()
            .register_type::<ContactStart>()
            .register_type::<ContactEnd>()
            .add_message::<HapticFault>()
            .add_message::<ContactStart>()
            .add_message::<ContactEnd>()
            .configure_sets(PreUpdate, (HapticUpdateSystems::Bodies, HapticUpdateSystems::Tools).chain())
            .add_systems(
                PreUpdate,
                (
                    cost.timed(start::start_loops),
                    cost.timed(receive::poll_loops),
                    cost.timed(settings::check_settings),
                    cost.timed(settings::set_loops),
                    cost.timed(results::write_results),
                )
                    .chain()
                    .in_set(HapticUpdateSystems::Tools),
            )
            .add_systems(
                ModelSchedule,
                (
                    (receive::receive, receive::select_bodies, settings::set_loops)
                        .chain()
                        .in_set(HapticSystems::ReceiveSamples),
                    (times.bodies.timed(model::step_bodies), model::measure_force_error, grasp::grasp)
                        .chain()
                        .in_set(HapticSystems::StepBodies)
                        .after(SutureSystems::Sew)
                        .before(SutureSystems::Tell),
                    times
                        .local_models
                        .timed(model::build_local_models)
                        .in_set(HapticSystems::BuildLocalModels),
                    model::publish_local_models.in_set(HapticSystems::PublishLocalModels),
                    (
                        receive::poll_loops,
                        results::write_results,
                        results::record_poses,
                        results::write_errors,
                        no_force::report_missing_force,
                        convergence::report_unconverged,
                        size::report_sizes,
                    )
                        .chain()
                        .in_set(HapticSystems::Writeback),
                ),
            )
            .add_observer(start::remove_loop)
            .add_systems(
                PostUpdate,
                cost.timed(results::interpolate_tool_transforms).before(TransformSystems::Propagate),
            );
    }

    fn finish(&self, app: &mut App) {
        let world = app.world();
        let needed = [
            (world.contains_resource::<ModelRate>(), "HapticSchedulePlugin, or the resource ModelRate"),
            (world.contains_resource::<LoopMode>(), "HapticSchedulePlugin, or the resource HapticClock"),
            (
                world.contains_resource::<Time<Virtual>>(),
                "Bevy's TimePlugin (it is in MinimalPlugins and DefaultPlugins)",
            ),
        ];
        for (there, what) in needed {
            assert!(there, "palpate's ToolPlugin needs {what}");
        }
    }
}
