//! Why a tool renders no force.

use bevy::prelude::*;
use glam::DVec3;
use palpate_haptics::SafetyAction;
use palpate_local::Scheme;
use thiserror::Error;

/// The cause of a force that is missing, with what to change.
///
/// Forces and lengths are in the world's frame unless a field states otherwise. The first four causes say that no body is within
/// reach, the next three that a tool overlaps a body without a contact. With the others the full body computes a force of which
/// less than 1 % reaches the device.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum NoForceCause {
    /// The world has no [`DeformableBody`](crate::DeformableBody).
    #[error("the world has no body; spawn an entity with DeformableBody")]
    NoBody,
    /// Every body that the tool may touch was rejected; this is one of them.
    #[error("body {body} is not simulated; correct what its own fault names")]
    BodyRejected {
        /// The rejected body.
        body: Entity,
    },
    /// A body still waits for its mesh or is still being built.
    #[error(
        "body {body} is not built after {waited_s:.1} s; check that its mesh is loaded (a headless app needs AssetPlugin, MeshPlugin \
         and, for GLB files, App::finish), or reduce MeshShape::cells_along_longest_axis"
    )]
    BodyNotReady {
        /// The body.
        body: Entity,
        /// Time for which the tool has had no other body, s.
        waited_s: f64,
    },
    /// The device's workspace, as [`ToolSettings::frame`](crate::ToolSettings::frame) maps it, contains no point of a body.
    #[error(
        "the device's workspace ends {distance_m:.3} m from body {body}; change rotation, scale or offset_m of ToolSettings::frame, or \
         move the body"
    )]
    OutOfWorkspace {
        /// The body that is nearest to the workspace.
        body: Entity,
        /// Distance between workspace and body, less the tool's radius, m.
        distance_m: f64,
    },
    /// The tool was inside the body when one of them appeared, and waits to leave it:
    /// [`ContactState::Inside`](crate::ContactState::Inside).
    #[error(
        "the tool appeared inside body {body}; move it out of the body once, or start the device or place the body elsewhere"
    )]
    Inside {
        /// The body.
        body: Entity,
    },
    /// The tool meets the body only where its nodes are fixed. A surface that cannot move is not touched.
    #[error(
        "the surface of body {body} is fixed at {point_m}; fix another part with FixedRegion, or touch another part"
    )]
    FixedSurface {
        /// The body.
        body: Entity,
        /// The point of the surface that is nearest to the tool, m.
        point_m: DVec3,
    },
    /// The tool overlaps a surface that is free to move, and the body finds no contact.
    #[error("body {body} computes no contact at {point_m}; keep a black box (BlackBoxDump) and report it")]
    NoContact {
        /// The body.
        body: Entity,
        /// The point of the surface that is nearest to the tool, m.
        point_m: DVec3,
    },
    /// The device's description allows no force, or next to none.
    #[error(
        "the device's largest force is {max_force_n} N; use a device with motors, or correct the max_force_n that its driver \
         describes"
    )]
    DeviceLimit {
        /// [`DeviceDescription::max_force_n`](palpate_haptics::DeviceDescription::max_force_n), N.
        max_force_n: f64,
    },
    /// The user's limit allows no force, or next to none.
    #[error("max_force_n of ToolSettings::safety is {max_force_n} N; raise it")]
    ForceLimit {
        /// [`SafetySettings::max_force_n`](palpate_haptics::SafetySettings::max_force_n), N.
        max_force_n: f64,
    },
    /// The start-up ramp is so long that the force is still next to zero.
    #[error("ramp_s of ToolSettings::safety is {ramp_s} s; shorten it")]
    StartRamp {
        /// [`SafetySettings::ramp_s`](palpate_haptics::SafetySettings::ramp_s), s.
        ramp_s: f64,
    },
    /// The loop started, or started again, in the middle of a touch; the force starts once it is small.
    #[error(
        "the loop started in a touch of {force_n:.3} N and waits for less than {start_below_n} N; lift the tool once, or raise \
         start_below_n of ToolSettings::safety"
    )]
    StartThreshold {
        /// Force of the local model, N.
        force_n: f64,
        /// [`SafetySettings::start_below_n`](palpate_haptics::SafetySettings::start_below_n), N.
        start_below_n: f64,
    },
    /// The force may grow so slowly that it is still next to zero.
    #[error("max_slew_n_per_s of ToolSettings::safety is {max_slew_n_per_s} N/s; raise it")]
    GrowthLimit {
        /// [`SafetySettings::max_slew_n_per_s`](palpate_haptics::SafetySettings::max_slew_n_per_s), N/s.
        max_slew_n_per_s: f64,
    },
    /// Another stage of the safety chain takes the force away.
    #[error("the safety stage {} takes it away; see its settings in ToolSettings::safety", .stage.name())]
    SafetyStage {
        /// The stage.
        stage: SafetyAction,
    },
    /// The force lies along axes for which the device has no motor.
    #[error(
        "the device has no motor along {force_n}, its own frame; turn rotation of ToolSettings::frame, or touch from another side"
    )]
    MissingAxes {
        /// Mean force sent to the device, N, the device's own frame.
        force_n: DVec3,
    },
    /// The local model computes no force where the full body does.
    #[error(
        "the local model {} computes none; use Scheme::NearFieldExact, raise ModelRate or move slower", .scheme.name()
    )]
    LocalModel {
        /// The scheme of the local model.
        scheme: Scheme,
    },
}

impl NoForceCause {
    /// Whether no body is within reach, as opposed to a force that is missing in a touch.
    #[must_use]
    pub fn is_about_reach(&self) -> bool {
        matches!(
            self,
            Self::NoBody
                | Self::BodyRejected { .. }
                | Self::BodyNotReady { .. }
                | Self::OutOfWorkspace { .. }
        )
    }

    /// Whether `other` is the same cause at the same body, whatever its figures.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        (std::mem::discriminant(self), self.body()) == (std::mem::discriminant(other), other.body())
    }

    /// The body that the cause is about, if it is about one.
    #[must_use]
    pub fn body(&self) -> Option<Entity> {
        match *self {
            Self::BodyRejected { body }
            | Self::BodyNotReady { body, .. }
            | Self::OutOfWorkspace { body, .. }
            | Self::Inside { body }
            | Self::FixedSurface { body, .. }
            | Self::NoContact { body, .. } => Some(body),
            _ => None,
        }
    }
}
