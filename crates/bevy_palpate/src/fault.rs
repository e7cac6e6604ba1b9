//! What went wrong, as a message.

mod no_force;
mod slow_step;

pub use no_force::NoForceCause;
pub use slow_step::{SlowStep, StepPart};

use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use palpate_body::BodyError;
use palpate_haptics::{BlackBoxError, DeviceError, HapticsError, LoopEventKind, TrajectoryError};
use palpate_reduce::ReduceError;
use std::sync::Arc;
use thiserror::Error;

/// A fault of a body, a tool or its loop. Everything that is not affected continues.
///
/// It is a message, and an event for observers, which run in [`Last`]. [`FaultLogPlugin`](crate::FaultLogPlugin) writes faults to the log;
/// with `MinimalPlugins` add Bevy's `LogPlugin` to see them.
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_palpate::{FaultSeverity, prelude::*};
///
/// fn alarm(fault: On<HapticFault>) {
///     if fault.severity() == FaultSeverity::Error {
///         eprintln!("{:?}: {}", fault.entity, fault.kind.report());
///     }
/// }
/// # let mut app = App::new();
/// app.add_observer(alarm);
/// ```
#[derive(Event, Message, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Message, Debug, Clone)]
pub struct HapticFault {
    /// The body or tool; `None` if the fault concerns the whole app.
    pub entity: Option<Entity>,
    /// The fault, with its cause.
    pub kind: HapticFaultKind,
}

impl HapticFault {
    /// Severity of the fault.
    #[must_use]
    pub fn severity(&self) -> FaultSeverity {
        self.kind.severity()
    }
}

/// Severity of a fault, in ascending order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Reflect)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum FaultSeverity {
    /// A loaded machine produces it now and then; the force is hardly affected: missed deadlines, lost samples, a late local model.
    Load,
    /// The force or the simulation is less accurate than it should be, or a setting does not suit the scene.
    Warning,
    /// A body, a tool, a suture or a device does not work until something is changed.
    Error,
}

/// The kind of a fault, with its cause.
#[derive(Clone, Debug, Error)]
#[non_exhaustive]
pub enum HapticFaultKind {
    /// A body could not be built. Correct its components; until then it is not simulated, or as it was.
    #[error("the body cannot be built")]
    BuildBody(#[source] BodyError),
    /// A mesh could not be read, so no body was made of it.
    #[error("no body can be made of the mesh")]
    Mesh(#[source] MeshFault),
    /// A body of a mesh weighs more than the mesh does, by `share` of it: cells that hold next to nothing count as filled to a
    /// hundredth. It is simulated all the same.
    #[error(
        "the body is {percent:.1} % heavier than its mesh, because {cells} of its cells hold next to nothing: take smaller cells \
         (more cells_along), or thicken what is thin",
        percent = .share * 100.0
    )]
    MassExcess {
        /// By which share of the mesh's volume.
        share: f64,
        /// How many such cells there are.
        cells: usize,
    },
    /// A body's entity is scaled. Give the size to [`crate::DeformableBody`] and leave the scale at 1; a body that was there
    /// before stays where and as it was, and a new one is built once the scale is 1.
    #[error(
        "the body's transform has scale {scale}, is mirrored or is sheared by its parents; its scale must be 1: give the size to \
         the body itself"
    )]
    NonUnitScale {
        /// The scale found.
        scale: Vec3,
    },
    /// A body's transform, or that of a parent, is not finite.
    #[error("the body's transform, or that of a parent, is not finite: place it again")]
    NonFiniteTransform,
    /// A body could not be stepped. It is as it was before the step, at rest, and has let go of the tool.
    #[error("the body cannot be stepped")]
    StepBody(#[source] BodyError),
    /// No local model could be built; the loop goes on with the last one, which fades when it gets old.
    #[error("no local model can be built")]
    LocalModel(#[source] ReduceError),
    /// A tool has no device. Correct [`crate::HapticTool::device`].
    #[error("the tool has no device")]
    Device(#[source] Arc<DeviceFault>),
    /// A tool's settings make no sense; the old ones stay in force.
    #[error("the tool's settings are refused")]
    Settings(#[source] Arc<HapticsError>),
    /// A tool's radius, friction or coupling makes no sense; a new tool does not start, a running one keeps the old ones.
    #[error("the tool is refused")]
    Tool(#[source] BodyError),
    /// A tool cannot hold what its grasp has closed on: it is fixed. It goes on touching.
    #[error("the tool cannot hold what it has grasped")]
    Grasp(#[source] BodyError),
    /// A suture cannot be sewn; it does nothing until it, or the shape of its body, is changed.
    #[error("the suture cannot be sewn")]
    Suture(#[source] SutureFault),
    /// The loop reports a fault.
    #[error("the haptic loop reports a fault")]
    Loop(#[source] LoopEventKind),
    /// The loop's thread has ended without being asked to: its device could not be opened, or panicked. The tool is
    /// without a loop; change its [`crate::HapticTool`] (`set_changed` will do) to start another one.
    #[error("the haptic loop's thread has ended")]
    LoopEnded,
    /// The loop's thread did not end within 200 ms of being asked to, because its device blocks; it is left to
    /// itself and stops with zero force when the device lets it.
    #[error("the haptic loop's thread does not end: its device blocks; it is left to itself")]
    LoopDetached,
    /// The last ticks of a loop could not be written to a file.
    #[error("the black box cannot be written")]
    BlackBox(#[source] Arc<BlackBoxError>),
    /// The loop hangs in its device, and the watchdog has stopped the device. When the device lets the loop go on, force comes
    /// back once it is small.
    #[error("the haptic loop hangs in its device, which has been stopped: check its cable and driver")]
    EmergencyStopped,
    /// The model side was so late that samples are lost; the body goes on from the oldest that is left.
    #[error("{lost} samples were lost before the body could be moved along them")]
    SamplesLost {
        /// How many.
        lost: u64,
    },
    /// The tool came to touch nodes that its local model did not hold: it moved farther between two model steps than was foreseen. Until the
    /// next local model the surface there stood still, without friction, or was not felt where the loop had no room for it. Move slower,
    /// raise the model rate, or make the mesh coarser.
    #[error(
        "the tool touched beyond the {nodes} nodes of its local model, and the surface there stood still until the next: move slower, raise \
         ModelRate, or make the mesh coarser"
    )]
    BeyondSupport {
        /// How many nodes the local model held.
        nodes: usize,
    },
    /// The entity that a tool should touch is no simulated body; it touches nothing.
    #[error("the tool should touch {body}, which is no body")]
    NotABody {
        /// The entity.
        body: Entity,
    },
    /// The loop had more to tell than its queue holds, because the app did not listen for so long.
    #[error("{dropped} events of the haptic loop were dropped: the app did not listen")]
    EventsDropped {
        /// How many.
        dropped: u64,
    },
    /// The app's clock runs at another speed than real time, which a loop on a thread cannot; the force fades.
    #[error(
        "the app's clock runs at {speed} times real time; a loop on a thread cannot: use the lock step clock"
    )]
    UnsupportedTimeScale {
        /// The relative speed.
        speed: f64,
    },
    /// A tool overlaps a body or has no body to touch, and no force is rendered: for half a second, or for 5 s where a body is
    /// still to be built. Reported once until the force is there again, a body is within reach again or the cause changes.
    #[error("the tool renders no force")]
    NoForce(#[source] NoForceCause),
    /// A model step took longer than its period, with loops on threads. Reported once until all steps of a second were in time;
    /// the entity is the largest body.
    #[error("{0}")]
    SlowStep(SlowStep),
    /// The loop's contact solver stopped at its limit in more than 1 % of a second's touching ticks: those forces are less
    /// accurate. Reported once until a second is better.
    #[error(
        "the contact solver of the haptic loop did not converge in {ticks} of {touching} touching ticks; use fewer nodes under \
         the tool, a smaller tool or less friction"
    )]
    Unconverged {
        /// Ticks without convergence.
        ticks: u64,
        /// Touching ticks in the same time.
        touching: u64,
    },
    /// The contact solver of the full body stopped at its limit in more than 1 % of the steps that it made in a second while tools,
    /// obstacles or sutures acted: their forces, and the local models, are less accurate. Reported once until a second is better;
    /// the entity is the body.
    #[error(
        "the contact solver of the body did not converge in {steps} of {of} steps; use less friction, a smaller tool, a softer \
         coupling (HapticTool::coupling) or threads that stretch"
    )]
    UnconvergedSteps {
        /// Steps without convergence; a tick is at least one step.
        steps: u64,
        /// Steps with contact in the same time.
        of: u64,
    },
    /// Cells of a body have been inverted for half a second: at that place its force is no longer that of the tissue. Reported once
    /// until there have been none for a second; the entity is the body.
    #[error(
        "{cells} cells of the body have been inverted for half a second or longer: press less deep, take finer cells, or give \
         the tool a softer coupling (HapticTool::coupling)"
    )]
    InvertedCells {
        /// How many are inverted now.
        cells: usize,
    },
    /// A tool touches a body whose cells or size do not suit it; its force is computed all the same. Reported once for each body
    /// and shape of the tool.
    #[error("the tool does not suit the body it touches")]
    ToolSize(#[source] ToolSizeFault),
}

/// A tool and a body of sizes that do not suit each other.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ToolSizeFault {
    /// The tool's radius is less than a tenth of a cell: nearly all that gives way under it is the added compliance of a smooth surface, and
    /// what the cells do is hardly felt; where none is added ([`ContactCompliance`](crate::ContactCompliance)), the force depends on the place in the cell.
    #[error(
        "the radius of HapticTool::shape is {radius_m} m; it must be at least a tenth of the {cell_m} m of a cell of body {body}: \
         use a larger tool, or more nodes or cells along the body (DeformableBody)"
    )]
    TooSmall {
        /// Radius of the tool, m.
        radius_m: f64,
        /// Edge of a cell, m.
        cell_m: f64,
        /// The body.
        body: Entity,
    },
    /// The tool is wider than the body is long.
    #[error(
        "the radius of HapticTool::shape is {radius_m} m; it must be at most half of the longest side of body {body}, {side_m} m"
    )]
    TooLarge {
        /// Radius of the tool, m.
        radius_m: f64,
        /// Longest side of the body at rest, m.
        side_m: f64,
        /// The body.
        body: Entity,
    },
}

/// Why a mesh cannot be read. What is wrong with its surface is a [`palpate_body::MeshError`].
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MeshFault {
    /// The app has no meshes at all.
    #[error("the app has no meshes: add Bevy's AssetPlugin and MeshPlugin")]
    NoMeshes,
    /// The asset could not be loaded.
    #[error("the mesh cannot be loaded: {0}")]
    NotLoaded(String),
    /// Lines, points or strips.
    #[error("the mesh is a {0:?}; a body is made of a TriangleList")]
    Topology(PrimitiveTopology),
    /// No positions, or not three numbers each.
    #[error("the mesh has no positions of three numbers each")]
    NoPositions,
    /// Corners that make no whole number of triangles.
    #[error("the mesh has {0} corners, which is no whole number of triangles; export it again, triangulated")]
    Incomplete(usize),
    /// It lives on the graphics card only.
    #[error("the mesh is not in main memory any more: load it with RenderAssetUsages::MAIN_WORLD")]
    NotInMemory,
    /// A factor that makes no sense.
    #[error("the mesh is scaled by {0}; it must be finite and above 0")]
    Scale(f64),
}

/// Why a suture cannot be sewn.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SutureFault {
    /// Its entity is no body.
    #[error("{body} is no body")]
    NotABody {
        /// The entity.
        body: Entity,
    },
    /// No surface is near one of its ends.
    #[error("the body's surface is not within {within_m} m of the end at {end_m}")]
    TooFar {
        /// The place asked for, m, world.
        end_m: glam::DVec3,
        /// How near the surface must be, m.
        within_m: f64,
    },
    /// Both ends pierce the body at the same point.
    #[error("both ends of Suture::ends_m pierce the surface at {at_m}; they must be apart")]
    SamePoint {
        /// The point, m, world.
        at_m: glam::DVec3,
    },
    /// Both ends pierce the body where it is fixed, so the thread moves nothing.
    #[error(
        "the body is fixed at both ends of Suture::ends_m, {} and {}; at least one must be free to move (FixedRegion)",
        .ends_m[0],
        .ends_m[1]
    )]
    FixedEnds {
        /// The pierced points, m, world.
        ends_m: [glam::DVec3; 2],
    },
    /// Its length or its limit makes no sense.
    #[error(transparent)]
    Thread(#[from] BodyError),
}

/// Why a tool has no device.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DeviceFault {
    /// No device of this name is registered.
    #[error("there is no device named \"{name}\"; registered are: {known}")]
    UnknownName {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The recorded hand cannot be read.
    #[error("the recorded hand cannot be read")]
    Trajectory(#[from] TrajectoryError),
    /// The registered function failed.
    #[error("the device could not be made")]
    Make(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The device needs a feature with which this was not built.
    #[error("such a device needs the feature `{feature}` of bevy_palpate, with which this was not built")]
    FeatureDisabled {
        /// Which.
        feature: &'static str,
    },
    /// The device over HID is not there, or cannot be used.
    #[cfg(feature = "hid")]
    #[error(transparent)]
    Hid(#[from] palpate_hid::HidError),
    /// The loop could not be set up.
    #[error("the loop could not be set up")]
    Loop(#[from] HapticsError),
    /// The device could not be opened.
    #[error("the device could not be opened")]
    Open(#[from] DeviceError),
}

impl DeviceFault {
    /// Whether plugging something in, or out, may end it.
    pub(crate) fn is_about_what_is_plugged_in(&self) -> bool {
        #[cfg(feature = "hid")]
        return matches!(self, Self::Hid(_));
        #[cfg(not(feature = "hid"))]
        false
    }
}

impl HapticFaultKind {
    /// Severity of the fault.
    #[must_use]
    pub fn severity(&self) -> FaultSeverity {
        match self {
            Self::SamplesLost { .. } | Self::SlowStep(_) | Self::EventsDropped { .. } => FaultSeverity::Load,
            Self::Loop(event) => match event {
                LoopEventKind::DeadlinesMissed(_)
                | LoopEventKind::Gap(_)
                | LoopEventKind::ModelRefused(_)
                | LoopEventKind::ModelStale(_) => FaultSeverity::Load,
                LoopEventKind::Panicked | LoopEventKind::EmergencyStopped => FaultSeverity::Error,
                _ => FaultSeverity::Warning,
            },
            Self::MassExcess { .. }
            | Self::LocalModel(_)
            | Self::Settings(_)
            | Self::Grasp(_)
            | Self::BlackBox(_)
            | Self::BeyondSupport { .. }
            | Self::UnsupportedTimeScale { .. }
            | Self::Unconverged { .. }
            | Self::UnconvergedSteps { .. }
            | Self::InvertedCells { .. }
            | Self::ToolSize(_) => FaultSeverity::Warning,
            Self::BuildBody(_)
            | Self::Mesh(_)
            | Self::NonUnitScale { .. }
            | Self::NonFiniteTransform
            | Self::StepBody(_)
            | Self::Device(_)
            | Self::Tool(_)
            | Self::Suture(_)
            | Self::LoopEnded
            | Self::LoopDetached
            | Self::EmergencyStopped
            | Self::NotABody { .. }
            | Self::NoForce(_) => FaultSeverity::Error,
        }
    }

    /// The message and those of its causes, in one line.
    #[must_use]
    pub fn report(&self) -> String {
        let mut text = self.to_string();
        let mut cause = std::error::Error::source(self);
        while let Some(error) = cause {
            text.push_str(": ");
            text.push_str(&error.to_string());
            cause = error.source();
        }
        text
    }
}

/// Writes every fault to the log: errors and warnings as warnings, load as debug where the machine is the cause and may be busy.
pub(crate) fn log_faults(mut faults: MessageReader<HapticFault>) {
    for HapticFault { entity, kind } in faults.read() {
        match entity {
            Some(entity) if matches!(kind, HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(_))) => {
                debug!("{entity}: {}", kind.report());
            }
            Some(entity) => warn!("{entity}: {}", kind.report()),
            None => warn!("{}", kind.report()),
        }
    }
}
