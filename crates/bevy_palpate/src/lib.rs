//! Touch deformable bodies through a force-feedback device, in Bevy.
//!
//! The full body steps at 20 Hz on Bevy's fixed schedule. A thread of its own owns the device and computes force at 1 kHz from a small
//! local model of the body, which every model step replaces without locks. [Concepts](guide::concepts) has the picture.
//!
//! # Getting started
//!
//! A tool presses 5 mm into a block, in lock step: without a thread, by simulated time.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_palpate::palpate_haptics::{Reading, ScriptedDevice};
//! use bevy_palpate::{prelude::*, testing};
//!
//! fn setup(mut commands: Commands, mut devices: ResMut<HapticDevices>) {
//!     devices.register("script", || {
//!         Ok(ScriptedDevice::new(|n, _| Ok(Reading::at(DVec3::Y * (0.06 - 1e-5 * n.min(1000) as f64)))))
//!     });
//!     commands.spawn((DeformableBody::block([6; 3], 0.1), FixedRegion::Face(BoxFace::Bottom)));
//!     commands.spawn(HapticTool::new("script"));
//! }
//!
//! let mut app = testing::headless_app();
//! app.add_systems(Startup, setup);
//! testing::advance_model_steps(&mut app, 30);
//! let mut tools = app.world_mut().query::<&ToolForce>();
//! assert!(tools.single(app.world()).unwrap().force_n.y > 0.3);
//! ```
//!
//! An app for a device adds [`PalpatePlugins`] to `DefaultPlugins`, or to `MinimalPlugins` with `LogPlugin` and a pause between frames
//! ([First body](guide::first_body)). Build it with optimisation: `--release`, or in its `Cargo.toml`
//!
//! ```toml
//! [profile.dev.package."*"]
//! opt-level = 3
//! ```
//!
//! # Contents
//!
//! The [guide] goes from the first body to a driver of your own. The items by topic; the [`prelude`] has those that nearly every app names,
//! all others are at the root of the crate:
//!
//! * Bodies: [`DeformableBody`], a block, a mesh ([`MeshShape`], [`MeshCellSize`], [`MeshPieces`]) or a volume of tetrahedra
//!   ([`TetrahedralShape`] of a [`TetrahedralVolume`]), with [`Tissue`], [`ElementFamily`], [`FixedRegion`] of a [`BoxFace`] or of
//!   [`BodyRegion`]s, [`Inclusions`] of [`Inclusion`]s, [`Slit`], [`KinematicBody`] and [`ContactCompliance`]; their state [`BodyState`], [`BodyReady`]; the
//!   full body [`SimulatedBody`]; repairs of a mesh [`MeshReport`]; places on and in bodies [`BodyQuery`], [`BodySurfacePoint`]; with the
//!   feature `mesh_files` the loader of mesh files `MeshFileLoader` with `MeshFileSettings` and `MeshFileLoadError`, `mesh_of_pieces`, and that of
//!   tetrahedra `TetrahedralFileLoader` with `TetrahedralFileLoadError`, `volume_of`.
//! * Surroundings: [`Gravity`] and [`GravityScale`]; [`Obstacle`] of an [`ObstacleShape`], with the result [`ObstacleForce`];
//!   [`ExternalForce`] of [`Load`]s;
//!   with the feature `avian` the rigid bodies of avian3d: `AvianPlugin`, `NotAnObstacle`.
//! * Sutures: [`Suture`]; result [`SutureForce`]; message [`SutureTorn`].
//! * Tools: [`HapticTool`] with [`ToolSettings`], [`SafetyOverrides`], [`ToolCoupling`] and [`TouchLayers`]; [`ToolGrasp`] for tools that hold; results
//!   [`ToolForce`] with [`ToolContactPoint`], [`TouchedBody`] with [`ContactState`], [`GraspedPoint`], [`ForceError`], [`LocalModelStats`],
//!   [`LoopTiming`]; messages and events [`ContactStart`], [`ContactEnd`], [`GraspStart`], [`GraspEnd`]; every tick in [`TickRecording`],
//!   the last ones in [`BlackBoxDump`]; the running loop [`ToolLoop`].
//! * Devices: [`DeviceSelector`], [`HapticDevices`], [`HidSelector`], [`HidDeviceKind`]; recorded trajectories [`TrajectoryAsset`],
//!   [`TrajectoryLoader`]; with the feature `window` `MouseDevicePlugin`, `MouseDevice` and `MouseDeviceSystems`. A driver implements
//!   [`palpate_haptics::HapticDevice`].
//! * Time: [`ModelSchedule`], [`HapticSystems`], [`HapticUpdateSystems`], the time [`Model`], [`ModelRate`], [`ModelStepCount`], [`LoopMode`].
//! * Faults: [`HapticFault`] with [`HapticFaultKind`] and [`FaultSeverity`]; their causes [`NoForceCause`], [`DeviceFault`], [`MeshFault`],
//!   [`SutureFault`], [`ToolSizeFault`], [`SlowStep`] with [`StepPart`].
//! * Plugins: [`PalpatePlugins`], of [`HapticSchedulePlugin`], [`BodyPlugin`], [`ToolPlugin`], [`SurroundingsPlugin`], [`SuturePlugin`],
//!   [`HapticDiagnosticsPlugin`] (costs and errors as diagnostics) and [`FaultLogPlugin`].
//! * Tests: [`testing`].
//! * Display: `HapticPanelPlugin` with `HapticPanel` and `HapticWidgets` (feature `panel`), `HapticGizmosPlugin` with `HapticGizmos` and
//!   `HapticGizmosOverride` (feature `gizmos`).
//! * The crates below: [`palpate_haptics`], [`palpate_body`], [`palpate_local`], [`palpate_reduce`], `palpate_files` (feature
//!   `mesh_files`) and `palpate_hid` (feature `hid`).
//!
//! # Feature flags
//!
//! | feature | adds |
//! | --- | --- |
//! | `hid` | devices over HID: SpaceMouse, force-feedback joysticks, 3-DOF boards (`palpate_hid`) |
//! | `mesh_files` | bodies from GLB, glTF, OBJ, STL and PLY files, and of tetrahedra from Gmsh, VTK and TetGen files, without Bevy's loaders (`palpate_files`); on by default |
//! | `draco` | decoder of glTF files with `KHR_draco_mesh_compression`, and `mesh_files` |
//! | `meshopt` | decoder of glTF files with `EXT_meshopt_compression` or `KHR_meshopt_compression`, and `mesh_files` |
//! | `vtu` | reader of VTU files, and `mesh_files` |
//! | `gltf` | Bevy's loader of glTF and GLB files: primitives with their materials, with PNG and JPEG textures or without |
//! | `avian` | the colliders of [avian3d](https://docs.rs/avian3d/0.7) 0.7 are obstacles, and its dynamic bodies receive the reaction |
//! | `window` | a renderer and a window (Bevy's `bevy_pbr` and `bevy_winit`), the mouse as a device, and `gltf` |
//! | `panel` | a panel of plots and sliders for every tool (`bevy_egui`, `egui_plot`), and `window` |
//! | `gizmos` | lattice, contact, near field and basis drawn over the scene, and `window` |
//!
//! The others are off by default: a headless app builds no renderer.
//!
//! # Units, frames, signs
//!
//! SI. Physics is `f64` (`DVec3`); `f32` begins at meshes and transforms. Forces, samples and bodies are in the world frame. Force is what
//! the body does to the hand: along the outward normal of the surface. [Accuracy](guide::accuracy) has errors and limits,
//! [Safety](guide::safety) what to read before you touch a motor, the [glossary](guide::glossary) the terms.

#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(feature = "avian")]
mod avian;
mod body;
mod body_query;
#[cfg(any(feature = "gizmos", feature = "panel"))]
mod color_map;
mod cost;
mod device;
mod diagnostics;
mod fault;
#[cfg(feature = "gizmos")]
mod gizmos;
pub mod guide;
mod layers;
#[cfg(feature = "mesh_files")]
mod mesh_files;
mod model_time;
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
mod surroundings;
mod suture;
pub mod testing;
mod tool;
#[cfg(feature = "mesh_files")]
mod volume_files;

pub use palpate_body;
#[cfg(feature = "mesh_files")]
pub use palpate_files;
pub use palpate_haptics;
#[cfg(feature = "hid")]
pub use palpate_hid;
pub use palpate_local;
pub use palpate_reduce;

#[cfg(feature = "avian")]
pub use avian::{AvianPlugin, NotAnObstacle};
pub use body::{
    BodyPlugin, BodyReady, BodyRegion, BodyState, BoxFace, ContactCompliance, DeformableBody, ElementFamily,
    FixedRegion, Inclusion, Inclusions, KinematicBody, MeshCellSize, MeshPieces, MeshReport, MeshShape,
    SimulatedBody, Slit, TetrahedralShape, TetrahedralVolume, Tissue,
};
pub use body_query::{BodyQuery, BodySurfacePoint};
pub use device::{
    DeviceSelector, HapticDevices, HidDeviceKind, HidSelector, TrajectoryAsset, TrajectoryLoader,
};
pub use diagnostics::HapticDiagnosticsPlugin;
pub use fault::{
    DeviceFault, FaultSeverity, HapticFault, HapticFaultKind, MeshFault, NoForceCause, SlowStep, StepPart,
    SutureFault, ToolSizeFault,
};
#[cfg(feature = "gizmos")]
pub use gizmos::{HapticGizmos, HapticGizmosOverride, HapticGizmosPlugin};
pub use layers::TouchLayers;
#[cfg(feature = "mesh_files")]
pub use mesh_files::{MeshFileLoadError, MeshFileLoader, MeshFileSettings, mesh_of_pieces};
pub use model_time::{LoopMode, Model, ModelRate, ModelStepCount};
#[cfg(feature = "window")]
pub use mouse::{MouseDevice, MouseDevicePlugin, MouseDeviceSystems};
#[cfg(feature = "panel")]
pub use panel::{HapticPanel, HapticPanelPlugin, HapticWidgets};
pub use plugins::{FaultLogPlugin, PalpatePlugins};
pub use schedule::{HapticSchedulePlugin, HapticSystems, HapticUpdateSystems, ModelSchedule};
pub use surroundings::{
    ExternalForce, Gravity, GravityScale, Load, Obstacle, ObstacleForce, ObstacleShape, SurroundingsPlugin,
};
pub use suture::{Suture, SutureForce, SuturePlugin, SutureTorn};
pub use tool::{
    BlackBoxDump, ContactEnd, ContactStart, ContactState, ForceError, GraspEnd, GraspStart, GraspedPoint,
    HapticTool, LocalModelStats, LoopTiming, SafetyOverrides, TickRecording, ToolContactPoint, ToolCoupling,
    ToolForce, ToolGrasp, ToolLoop, ToolPlugin, ToolSettings, TouchedBody,
};
#[cfg(feature = "mesh_files")]
pub use volume_files::{TetrahedralFileLoadError, TetrahedralFileLoader, volume_of};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// What nearly every app with haptic bodies names: the plugins, the components of bodies, tools and sutures, their messages, and the values
/// in them. Everything else is at the root of the crate or of [`palpate_haptics`]; the [front page](crate#contents) lists it.
pub mod prelude {
    pub use crate::{
        BodyReady, BoxFace, ContactEnd, ContactStart, DeformableBody, ElementFamily, FixedRegion, GraspEnd,
        GraspStart, GraspedPoint, Gravity, HapticDevices, HapticFault, HapticTool, Obstacle, PalpatePlugins,
        Suture, SutureForce, SutureTorn, Tissue, ToolForce, ToolGrasp, ToolSettings, TouchedBody,
    };
    pub use glam::DVec3;
    pub use palpate_body::{Damping, ToolShape};
    pub use palpate_local::Scheme;
}
