//! Faults of bodies, tools, sutures and loops, as messages.

mod device;
mod log;
mod no_force;
mod slow_step;
mod writer;

pub use device::DeviceFault;
pub(crate) use log::log_faults;
pub use no_force::NoForceCause;
pub use slow_step::{SlowStep, StepPart};
pub(crate) use writer::{FaultLimits, FaultWriter, add_faults};

use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use palpate_body::BodyError;
use palpate_haptics::{BlackBoxError, HapticsError, LoopEventKind};
use palpate_reduce::ReduceError;
use std::sync::Arc;
use thiserror::Error;

/// Fault of a body, a tool, a suture or a loop. Whatever the fault does not affect continues.
///
/// A fault is a message, and an event for observers, which run in [`Last`]. [`FaultLogPlugin`](crate::FaultLogPlugin) writes faults to the
/// log; with `MinimalPlugins` add Bevy's `LogPlugin` to see them.
///
/// Faults that recur by themselves, such as lost samples, missed deadlines or a stale local model, are written at most once in 5 s of real
/// time for each entity and kind; [`Self::suppressed_count`] counts the others.
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
    /// The body, tool or suture; `None` if the fault concerns the whole app.
    pub entity: Option<Entity>,
    /// The fault, with its cause.
    pub kind: HapticFaultKind,
    /// Number of faults of the same entity and kind that were suppressed since the last one that was written.
    pub suppressed_count: u32,
}

impl HapticFault {
    /// Returns a fault without suppressed ones.
    #[must_use]
    pub fn new(entity: Option<Entity>, kind: HapticFaultKind) -> Self {
        Self { entity, kind, suppressed_count: 0 }
    }

    /// The fault's message and those of its causes as one line, with the number of suppressed faults.
    #[must_use]
    pub fn report(&self) -> String {
        let report = self.kind.report();
        match self.suppressed_count {
            0 => report,
            count => format!("{report} (and {count} more since the last report)"),
        }
    }

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
    /// Expected now and then on a loaded machine, with little effect on the force: missed deadlines, lost samples, a late local model.
    Load,
    /// The force or the simulation is less accurate than intended, or a setting does not suit the scene.
    Warning,
    /// A body, tool, suture or device does not work until the app or the user changes something.
    Error,
}

/// Kind of a fault, with its cause.
#[derive(Clone, Debug, Error)]
#[non_exhaustive]
pub enum HapticFaultKind {
    /// A body cannot be built from its components. Until they are corrected, its previous version stays simulated, if there was one.
    #[error("the body cannot be built")]
    BuildBody(#[source] BodyError),
    /// The mesh of a body cannot be read.
    #[error("no body can be built from the mesh")]
    Mesh(#[source] MeshFault),
    /// A body is heavier than its mesh by more than 1 %, because nearly empty cells count as filled to a hundredth. It is simulated.
    #[error(
        "the body is {percent:.1} % heavier than its mesh, because {cells} of its cells are nearly empty; use smaller cells (change \
         MeshShape::cells), or thicken the thin parts of the mesh",
        percent = .share * 100.0
    )]
    MassExcess {
        /// Excess of the body's mass, as a share of the mesh's.
        share: f64,
        /// Number of nearly empty cells.
        cells: usize,
    },
    /// The transform of a body is scaled, mirrored or sheared. Set the size in [`crate::DeformableBody`]. An existing body stays as and
    /// where it was; a new one is built once the scale is 1.
    #[error(
        "the body's transform has scale {scale}, or is mirrored or sheared by its parents; its scale must be 1: set the size in \
         DeformableBody"
    )]
    NonUnitScale {
        /// Scale of the transform along its axes.
        scale: Vec3,
    },
    /// The transform of a body, or of a parent, is not finite.
    #[error("the body's transform, or that of a parent, is not finite; set it to a finite pose")]
    NonFiniteTransform,
    /// A body cannot be stepped. It keeps the positions before the step, is brought to rest, and its contacts end.
    #[error("the body cannot be stepped")]
    StepBody(#[source] BodyError),
    /// No local model can be built. The loop keeps the previous one, whose force fades once it is stale.
    #[error("no local model can be built")]
    LocalModel(#[source] ReduceError),
    /// A tool has no device. Correct [`crate::HapticTool::device`].
    #[error("the tool has no device")]
    Device(#[source] Arc<DeviceFault>),
    /// A value of [`ToolSettings`](crate::ToolSettings) is out of range. The previous settings stay in effect.
    #[error("the tool's settings are rejected")]
    Settings(#[source] Arc<HapticsError>),
    /// Shape, friction or coupling of a tool are out of range. A new tool does not start; a running one keeps its previous values.
    #[error("the tool is rejected")]
    Tool(#[source] BodyError),
    /// A tool cannot grasp the point under it, for example because that point is fixed. It continues to touch.
    #[error("the tool cannot hold the point that it grasps")]
    Grasp(#[source] BodyError),
    /// A suture cannot be sewn. It has no effect until it, or the shape of its body, changes.
    #[error("the suture cannot be sewn")]
    Suture(#[source] SutureFault),
    /// The loop reports a fault.
    #[error("the haptic loop reports a fault")]
    Loop(#[source] LoopEventKind),
    /// The loop's thread ended by itself: its device could not be opened, or panicked. The tool has no loop; change its
    /// [`crate::HapticTool`] (`set_changed` is enough) to start another one.
    #[error("the haptic loop's thread has ended")]
    LoopEnded,
    /// The loop's thread did not end within 200 ms of its stop request, because its device blocks. The thread is detached and stops with
    /// zero force once the device returns.
    #[error("the haptic loop's thread does not stop, because its device blocks; the thread is detached")]
    LoopDetached,
    /// The last ticks of a loop cannot be written to a file.
    #[error("the black box cannot be written")]
    BlackBox(#[source] Arc<BlackBoxError>),
    /// The loop hangs in its device, and the watchdog has stopped the device. Once the device returns, the force resumes when it is
    /// small.
    #[error(
        "the haptic loop hangs in its device, which has been stopped; check the device's cable and driver"
    )]
    EmergencyStopped,
    /// Samples were overwritten before the model step read them. The body continues from the oldest sample that is left.
    #[error("{lost} samples were lost before the body could be stepped along them")]
    SamplesLost {
        /// Number of lost samples.
        lost: u64,
    },
    /// The tool touched nodes outside the support set of its local model: it moved farther between two model steps than predicted. Until
    /// the next local model the surface there was rigid and frictionless, or was missing where the loop had no capacity for it.
    #[error(
        "the tool touched nodes beyond the {nodes} of its local model, where the surface was rigid until the next one; move slower, \
         raise ModelRate, or use a coarser mesh"
    )]
    BeyondSupport {
        /// Number of nodes of the local model.
        nodes: usize,
    },
    /// The tool reaches more bodies than it can touch at once. It touches the nearest ones.
    #[error(
        "the tool reaches {reached} bodies; it can touch at most {max} at once, the nearest. Join bodies that belong together, or separate \
         others from the tool by TouchLayers or HapticTool::body"
    )]
    BodiesLeftOut {
        /// Number of bodies within reach.
        reached: usize,
        /// Maximum number of bodies that it touches at once.
        max: usize,
    },
    /// [`HapticTool::body`](crate::HapticTool::body) is an entity without a body. The tool touches nothing.
    #[error("HapticTool::body is {body}, which has no DeformableBody")]
    NotABody {
        /// The entity.
        body: Entity,
    },
    /// The transform of a tool's parent is not finite, or has a scale of zero. The tool works, but stays where it was drawn last.
    #[error(
        "the transform of the tool's parent cannot be inverted, so the tool cannot be drawn; give the parents a finite transform with \
         a scale other than 0, or remove ChildOf"
    )]
    ToolParent,
    /// The event queue of a loop was full, because the app did not read it for too long.
    #[error("{dropped} loop events were dropped: the event queue was full")]
    EventsDropped {
        /// Number of events dropped since the loop's start.
        dropped: u64,
    },
    /// The app's clock does not run at real time, which a loop on a thread requires. The force fades.
    #[error(
        "the relative speed of Time<Virtual> is {speed}; it must be 1 for loops on threads: use LoopMode::Lockstep for other speeds"
    )]
    UnsupportedTimeScale {
        /// Relative speed of the app's clock.
        speed: f64,
    },
    /// The gravity on a body is not finite. The previous one acts.
    #[error("the gravity on a body is not finite; change Gravity or GravityScale")]
    Gravity(#[source] BodyError),
    /// An obstacle was rejected. Bodies pass through it until its components change.
    #[error("the obstacle is rejected; change Obstacle, its mesh or its Transform")]
    Obstacle(#[source] BodyError),
    /// The shape of a collider of avian3d is no obstacle. Soft bodies pass through it.
    #[error(
        "a collider is a {shape}, which is no obstacle; use a solid shape or a triangle mesh, add an Obstacle to its entity, or exclude it by \
         NotAnObstacle"
    )]
    UnsupportedCollider {
        /// Kind of the shape.
        shape: &'static str,
    },
    /// A load of an [`ExternalForce`](crate::ExternalForce) is not finite. The previous loads act.
    #[error("a load is not finite; change ExternalForce")]
    ExternalForce(#[source] BodyError),
    /// The region of a load contains no free node of the body. The load has no effect.
    #[error("load {index} of ExternalForce contains no free node of the body; move or enlarge its region")]
    EmptyLoad {
        /// Index of the load.
        index: usize,
    },
    /// The model rate is above the rate of Bevy's fixed main loop, in which the model steps run. They run at the lower rate.
    #[error(
        "the model rate is {model_hz:.0} Hz, and Bevy's fixed main loop runs at {fixed_hz:.0} Hz; with loops on threads the model steps run at the \
         lower rate: insert Time::<Fixed>::from_hz({model_hz:.0}.0), or lower ModelRate"
    )]
    ModelRateLimited {
        /// Rate of the resource [`ModelRate`](crate::ModelRate), Hz.
        model_hz: f64,
        /// Rate of Bevy's fixed main loop, Hz.
        fixed_hz: f64,
    },
    /// A tool overlaps a body or has no body to touch, and renders no force: for half a second, or for 5 s while a body is being built.
    /// Reported once, and again after the force or a body in reach has returned or the cause has changed.
    #[error("the tool renders no force")]
    NoForce(#[source] NoForceCause),
    /// A model step took longer than its period, with loops on threads. Reported once, and again after a second without slow steps.
    /// The entity is the largest body.
    #[error("{0}")]
    SlowStep(SlowStep),
    /// The loop's contact solver reached its iteration limit in more than 1 % of the ticks in contact within a second; these forces are
    /// less accurate. Reported once, and again after a better second.
    #[error(
        "the contact solver of the haptic loop did not converge in {ticks} of {touching} ticks in contact; use fewer nodes under the \
         tool, a smaller tool or less friction"
    )]
    Unconverged {
        /// Ticks without convergence.
        ticks: u64,
        /// Ticks in contact in the same time.
        touching: u64,
    },
    /// The contact solver of the full body reached its iteration limit in more than 1 % of the steps within a second in which tools,
    /// obstacles or sutures acted. Their forces, and the local models, are less accurate. Reported once, and again after a better second.
    /// The entity is the body.
    #[error(
        "the contact solver of the body did not converge in {steps} of {of} steps; use less friction, a smaller tool, a softer \
         coupling (HapticTool::coupling) or threads that stretch (Suture::stiffness_n_per_m)"
    )]
    UnconvergedSteps {
        /// Steps without convergence; a tick is at least one step.
        steps: u64,
        /// Steps with contact in the same time.
        of: u64,
    },
    /// Cells of a body have been inverted for half a second; the force there is not that of the tissue. Reported once, and again after
    /// a second without inverted cells. The entity is the body.
    #[error(
        "{cells} cells of the body have been inverted for half a second or longer; press less deep, use smaller cells, or a softer \
         coupling (HapticTool::coupling)"
    )]
    InvertedCells {
        /// Number of cells that are inverted now.
        cells: usize,
    },
    /// The size of a tool does not suit the cells or the size of the body that it touches. The force is computed nevertheless. Reported
    /// once for each body and shape of the tool.
    #[error("the size of the tool does not suit the body that it touches")]
    ToolSize(#[source] ToolSizeFault),
}

/// Sizes of a tool and a body that do not suit each other.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ToolSizeFault {
    /// The tool's radius is less than a tenth of a cell. Nearly all of the indentation is then the added compliance of a smooth surface
    /// ([`ContactCompliance`](crate::ContactCompliance)); without it the force depends on the place within the cell.
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
    /// The tool's diameter exceeds the longest side of the body.
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

/// Reason why a mesh cannot be read. Errors of its surface are [`palpate_body::MeshError`].
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MeshFault {
    /// The app has no mesh assets.
    #[error("the app has no mesh assets; add Bevy's AssetPlugin and MeshPlugin")]
    NoMeshes,
    /// The mesh asset cannot be loaded.
    #[error("the mesh cannot be loaded: {0}")]
    NotLoaded(String),
    /// No asset loader reads the file as a mesh.
    #[error(
        "no asset loader reads `{0}` as a mesh; enable the feature `mesh_files` of bevy_palpate, which reads glb, gltf, obj, stl and ply \
         files, and msh, vtk, vtu, node and ele files of tetrahedra, or add a loader of its format"
    )]
    NoLoader(String),
    /// The volume of tetrahedra is rejected.
    #[error(transparent)]
    Tetrahedra(#[from] palpate_body::TetrahedralMeshError),
    /// The mesh consists of lines, points or strips.
    #[error("the topology of the mesh is {0:?}; it must be TriangleList")]
    Topology(PrimitiveTopology),
    /// The mesh has no positions, or positions that are not three numbers each.
    #[error("the mesh has no positions of three numbers each")]
    NoPositions,
    /// The number of corners is not a multiple of three.
    #[error(
        "the mesh has {0} corners; their number must be a multiple of three: export the mesh triangulated"
    )]
    Incomplete(usize),
    /// The mesh is in the memory of the graphics card only.
    #[error("the mesh is no longer in main memory; load it with RenderAssetUsages::MAIN_WORLD")]
    NotInMemory,
    /// `metres_per_unit` of [`MeshShape`](crate::MeshShape) or [`TetrahedralShape`](crate::TetrahedralShape) is out of range.
    #[error("metres_per_unit is {0}; it must be finite and above 0")]
    Scale(f64),
}

/// Reason why a suture cannot be sewn.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SutureFault {
    /// [`Suture::body`](crate::Suture::body) is an entity without a body.
    #[error("Suture::body is {body}, which has no DeformableBody")]
    NotABody {
        /// The entity.
        body: Entity,
    },
    /// An end of the suture is too far from the body's surface.
    #[error("an end of Suture::ends_m is {end_m}; it must be within {within_m} m of the body's surface")]
    TooFar {
        /// The end, m, world frame.
        end_m: glam::DVec3,
        /// Maximum distance from the surface, m.
        within_m: f64,
    },
    /// Both ends pierce the body at the same point.
    #[error("both ends of Suture::ends_m pierce the surface at {at_m}; they must be apart")]
    SamePoint {
        /// The point, m, world frame.
        at_m: glam::DVec3,
    },
    /// Both ends pierce the body where it is fixed, so the thread has no effect.
    #[error(
        "the body is fixed at both ends of Suture::ends_m, {} and {}; at least one must be free to move (FixedRegion)",
        .ends_m[0],
        .ends_m[1]
    )]
    FixedEnds {
        /// The pierced points, m, world frame.
        ends_m: [glam::DVec3; 2],
    },
    /// Length, stiffness or tear limit of the thread is out of range.
    #[error(transparent)]
    Thread(#[from] BodyError),
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
                | LoopEventKind::ModelRejected(_)
                | LoopEventKind::ModelStale(_) => FaultSeverity::Load,
                LoopEventKind::Panicked | LoopEventKind::EmergencyStopped | LoopEventKind::OpenFailed(_) => {
                    FaultSeverity::Error
                }
                _ => FaultSeverity::Warning,
            },
            Self::MassExcess { .. }
            | Self::LocalModel(_)
            | Self::Settings(_)
            | Self::Grasp(_)
            | Self::BlackBox(_)
            | Self::BeyondSupport { .. }
            | Self::BodiesLeftOut { .. }
            | Self::UnsupportedTimeScale { .. }
            | Self::EmptyLoad { .. }
            | Self::ModelRateLimited { .. }
            | Self::Unconverged { .. }
            | Self::UnconvergedSteps { .. }
            | Self::InvertedCells { .. }
            | Self::ToolParent
            | Self::ToolSize(_) => FaultSeverity::Warning,
            Self::BuildBody(_)
            | Self::Mesh(_)
            | Self::NonUnitScale { .. }
            | Self::NonFiniteTransform
            | Self::Gravity(_)
            | Self::Obstacle(_)
            | Self::UnsupportedCollider { .. }
            | Self::ExternalForce(_)
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

    /// The fault's message and those of its causes, as one line.
    #[must_use]
    pub fn report(&self) -> String {
        palpate_haptics::report(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn report_has_the_number_of_suppressed_faults() {
        let fault = HapticFault::new(None, HapticFaultKind::SamplesLost { lost: 1 });
        assert_eq!(fault.report(), fault.kind.report());
        let report = HapticFault { suppressed_count: 29, ..fault }.report();
        assert!(report.ends_with("(and 29 more since the last report)"), "{report}");
    }
}
