//! Touch deformable bodies through a force-feedback device, in Bevy.
//!
//! The full body steps at 20 Hz on Bevy's fixed schedule; a small local model ticks at 1 kHz on a thread of its
//! own that owns the device, and is renewed lock-free at every model step.
//!
//! # Getting started
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_palpate::prelude::*;
//!
//! fn main() -> AppExit {
//!     App::new().add_plugins((MinimalPlugins, PalpatePlugins)).add_systems(Startup, setup).add_systems(Update, show).run()
//! }
//!
//! fn setup(mut commands: Commands, mut devices: ResMut<HapticDevices>) {
//!     // A hand that presses 5 mm deep and leaves, twice in some four seconds.
//!     devices.register("hand", || {
//!         let height_m = |n: u64| 0.055 + 0.01 * (3e-3 * n as f64).cos();
//!         Ok(ScriptedDevice::new(move |n, _| Ok(Reading::at(DVec3::Y * height_m(n)))))
//!     });
//!     commands.spawn((
//!         DeformableBody::block([6, 6, 6], 0.1),
//!         Tissue { youngs_modulus_pa: 20e3, ..default() },
//!         FixedRegion::Face(BoxFace::Bottom),
//!     ));
//!     commands.spawn(HapticTool { device: DeviceSelector::named("hand"), ..default() });
//! }
//!
//! fn show(forces: Query<&ToolForce>, mut exit: MessageWriter<AppExit>) {
//!     for force in &forces {
//!         if force.force_n.y > 0.1 {
//!             exit.write(AppExit::Success);
//!         }
//!     }
//! }
//! ```
//!
//! With a window (feature `window`), replace `MinimalPlugins` by `DefaultPlugins`, spawn a camera and a light, give the body a material
//! and the tool a sphere; the scenes in the repository's `examples` do.
//!
//! # Contents
//!
//! * Bodies: [`DeformableBody`], a block or any closed mesh, with its partners [`Tissue`], [`FixedRegion`] and
//!   [`Inclusions`]; [`SimulatedBody`] to look inside, and at what became of a mesh ([`MeshReport`]); a [`Slit`] in a block.
//! * Threads through a body: [`Suture`]; result [`SutureForce`]; message [`SutureTorn`].
//! * Tools: [`HapticTool`] with its partner [`ToolSettings`], [`ToolGrasp`] for those that take hold; results
//!   [`ToolForce`], [`LoopTiming`],
//!   [`TouchedBody`]; messages [`ContactStart`], [`ContactEnd`]; every tick in [`TickRecording`].
//! * Devices: [`DeviceSelector`], [`HapticDevices`]; those that are plugged in (feature `hid`) by [`HidSelector`]; with the feature `window` `MouseDevicePlugin`.
//! * Time: [`ModelSchedule`], [`HapticSystems`], [`ModelRate`], [`LoopMode`].
//! * Faults: [`HapticFault`]; why a tool renders no force: [`NoForceCause`]. Costs and errors as diagnostics: [`HapticDiagnosticsPlugin`].
//! * To look at it all: `HapticPanelPlugin` with `HapticPanel` and `HapticWidgets` (feature `panel`),
//!   `HapticGizmosPlugin` with `HapticGizmos` (feature `gizmos`).
//!
//! # Feature flags
//!
//! | feature | adds |
//! | --- | --- |
//! | `hid` | devices over HID: SpaceMouse, force-feedback joysticks, 3-DOF boards (`palpate_hid`) |
//! | `gltf` | bodies from glTF and GLB files, with PNG and JPEG textures or without |
//! | `window` | a renderer and a window (Bevy's `bevy_pbr` and `bevy_winit`), the mouse as a device, and `gltf` |
//! | `panel` | a panel of plots and sliders for every tool (`bevy_egui`, `egui_plot`), and `window` |
//! | `gizmos` | lattice, contact, near field and basis drawn over the scene, and `window` |
//!
//! None is on by default: a headless app builds no renderer.
//!
//! # Headless tests
//!
//! [`testing`] makes an app in lock step and advances it by model steps. There is no thread and no sleeping: each model step runs the
//! loops by as many ticks as it is long, and the same scene gives the same bits.
//!
//! # Units, frames, signs
//!
//! SI. What is physics is `f64` (`DVec3`); `f32` begins at meshes and transforms. Forces, samples and bodies are
//! in the world's frame. Force is what the body does to the hand: along the surface normal it pushes the tool
//! out.
//!
//! # Accuracy and limits
//!
//! * With `NearFieldExact`, the default, the force between model steps is within 0.1 % RMS of the full body's at the same samples
//!   (a block that is held and moved, model steps at 20 Hz), and a touch is felt in the tick in which the tool meets the
//!   surface. With the other schemes, those of the seed paper, it is off by 1.5 % (`KrylovLinear`) to 25 % (`LowPass`), and a touch
//!   made between two model steps is felt after the next one. What it is in an app is told at every model step: [`ForceError`].
//! * A tool touches one body at a time. What several tools on a body do to each other between two model steps is felt
//!   after the next one: a local model holds what the others did constant.
//! * Moving a body's transform carries the body along at once, and what touches it lets go; a body that is to be moved while it
//!   is touched has to be pulled by what holds it.
//! * Bodies and tools are drawn between their last two model steps, so one model step late, both alike.
//! * A model step runs on the app's main thread; a large body makes frames longer, never the loop late. A step longer than its period
//!   is reported ([`SlowStep`]), and the next one does not try to catch up.
//! * A tool that renders no force where there should be one is reported after half a second, with the cause: [`NoForceCause`].
//! * The panel computes the schemes that do not run, and Bode plots, on other threads, and only while they are looked at.
//!   Such a scheme takes its local model at the tick at which the loop took its own; a Bode plot is linear about the present
//!   state, of the touched node with the greatest weight, and made for bodies of at most 2000 free nodes.
//!
//! # Glossary
//!
//! | word | meaning |
//! | --- | --- |
//! | sample | one reading of the device in the scene |
//! | tick | one turn of the haptic loop, 1 ms |
//! | model step | one step of the full body, 50 ms unless set otherwise |
//! | full body | all nodes and springs |
//! | local model | what makes force between two model steps |
//! | order | number of degrees of freedom of a local model |
//! | contact patch | where a tool touches: the mean of the surface under its pressure, as one row of the contact problem or nine |
//! | hand-over | the model side publishing a local model and the loop adopting it |
//! | oracle | the full body stepped at every tick: what every scheme is judged by |

#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod body;
mod cost;
mod device;
mod diagnostics;
mod fault;
#[cfg(feature = "gizmos")]
mod gizmos;
#[cfg(feature = "window")]
mod mouse;
#[cfg(feature = "panel")]
mod panel;
mod plugins;
mod reflect;
mod schedule;
mod slow_steps;
mod step_times;
mod step_watch;
mod suture;
pub mod testing;
mod tool;

pub use palpate_body;
pub use palpate_haptics;
#[cfg(feature = "hid")]
pub use palpate_hid;
pub use palpate_local;
pub use palpate_reduce;

pub use body::{
    BodyPlugin, BodyReady, BodyRegion, BodyState, BoxFace, ContactCompliance, DeformableBody, FixedRegion,
    Inclusion, Inclusions, MeshReport, MeshShape, SimulatedBody, Slit, Tissue,
};
pub use device::{DeviceSelector, HapticDevices, HidDeviceKind, HidSelector};
pub use diagnostics::HapticDiagnosticsPlugin;
pub use fault::{
    DeviceFault, FaultSeverity, HapticFault, HapticFaultKind, MeshFault, NoForceCause, SlowStep, StepPart,
    SutureFault, ToolSizeFault,
};
#[cfg(feature = "gizmos")]
pub use gizmos::{HapticGizmos, HapticGizmosOverride, HapticGizmosPlugin};
#[cfg(feature = "window")]
pub use mouse::{MouseDevice, MouseDevicePlugin, MouseDeviceSystems};
#[cfg(feature = "panel")]
pub use panel::{HapticPanel, HapticPanelPlugin, HapticWidgets};
pub use plugins::{FaultLogPlugin, PalpatePlugins};
pub use schedule::{
    HapticSchedulePlugin, HapticSystems, HapticUpdateSystems, LoopMode, ModelRate, ModelSchedule,
    ModelStepCount,
};
pub use suture::{Suture, SutureForce, SuturePlugin, SutureTorn};
pub use tool::{
    BlackBoxDump, ContactEnd, ContactStart, ContactState, ForceError, GraspEnd, GraspStart, GraspedPoint,
    HapticTool, LocalModelStats, LoopTiming, TickRecording, ToolContactPoint, ToolCoupling, ToolForce,
    ToolGrasp, ToolLoop, ToolPlugin, ToolSettings, TouchedBody,
};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// What an app with haptic bodies needs.
pub mod prelude {
    pub use crate::{
        BodyRegion, BoxFace, ContactCompliance, ContactEnd, ContactStart, ContactState, DeformableBody,
        DeviceSelector, FaultLogPlugin, FixedRegion, ForceError, GraspedPoint, HapticDevices, HapticFault,
        HapticSchedulePlugin, HapticSystems, HapticTool, HidDeviceKind, HidSelector, Inclusion, Inclusions,
        LocalModelStats, LoopMode, LoopTiming, MeshShape, ModelRate, ModelSchedule, PalpatePlugins, Slit,
        Suture, SutureForce, SutureTorn, Tissue, ToolCoupling, ToolForce, ToolGrasp, ToolSettings,
        TouchedBody,
    };
    pub use glam::{DQuat, DVec3};
    pub use palpate_body::ToolShape;
    pub use palpate_haptics::{
        DeviceFrame, HapticDevice, Reading, SafetySettings, ScriptedDevice, VelocityEstimator,
    };
    pub use palpate_local::Scheme;
}
