//! Causes of a missing force.

use bevy::prelude::*;
use glam::DVec3;
use palpate_haptics::SafetyAction;
use palpate_local::Scheme;
use thiserror::Error;

/// Cause of a missing force, with the remedy.
///
/// Points and forces are in the world frame unless a field states otherwise. With the first five causes no body is within reach. With the
/// next three the tool overlaps a body without a contact. With the others the full body computes a force of which less than 1 %
/// reaches the device.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum NoForceCause {
    /// The world has no [`DeformableBody`](crate::DeformableBody).
    #[error("the world has no body; spawn an entity with DeformableBody")]
    NoBody,
    /// No body that the tool may touch has one of its [`TouchLayers`](crate::TouchLayers).
    #[error("body {body} has none of the tool's TouchLayers; add a layer of the one to the other")]
    OtherLayers {
        /// One of the bodies.
        body: Entity,
    },
    /// Every body that the tool may touch was rejected.
    #[error(
        "body {body} was rejected; correct its components as its own fault describes (BodyState::Rejected)"
    )]
    BodyRejected {
        /// One of the rejected bodies.
        body: Entity,
    },
    /// The body's mesh is still being loaded, or the body is still being built.
    #[error(
        "body {body} is not built after {waited_s:.1} s; check that its mesh is loaded (a headless app needs AssetPlugin, MeshPlugin \
         and, for GLB files, App::finish), or use larger cells (MeshShape::cells)"
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
        /// The body nearest to the workspace.
        body: Entity,
        /// Distance between workspace and body minus the tool's radius, m.
        distance_m: f64,
    },
    /// The tool was inside the body when one of them appeared, and has not left it since
    /// ([`ContactState::Inside`](crate::ContactState::Inside)).
    #[error(
        "the tool appeared inside body {body}; move it out of the body once, or start the device or place the body elsewhere"
    )]
    Inside {
        /// The body.
        body: Entity,
    },
    /// The tool overlaps the body only where its nodes are fixed. A fixed surface has no contact.
    #[error(
        "the surface of body {body} is fixed at {point_m}; fix another part with FixedRegion, or touch another part"
    )]
    FixedSurface {
        /// The body.
        body: Entity,
        /// Point of the surface nearest to the tool, m.
        point_m: DVec3,
    },
    /// The tool overlaps a surface that is free to move, and the full body detects no contact.
    #[error("body {body} detects no contact at {point_m}; record a black box (BlackBoxDump) and report it")]
    NoContact {
        /// The body.
        body: Entity,
        /// Point of the surface nearest to the tool, m.
        point_m: DVec3,
    },
    /// The maximum force of the device is zero or nearly zero.
    #[error(
        "the maximum force of the device is {max_force_n} N; use a device with motors, or correct \
         DeviceDescription::max_force_n in its driver"
    )]
    DeviceLimit {
        /// [`DeviceDescription::max_force_n`](palpate_haptics::DeviceDescription::max_force_n), N.
        max_force_n: f64,
    },
    /// The force limit of the safety chain is zero or nearly zero.
    #[error("max_force_n of ToolSettings::safety is {max_force_n} N; raise it")]
    ForceLimit {
        /// [`SafetySettings::max_force_n`](palpate_haptics::SafetySettings::max_force_n), N.
        max_force_n: f64,
    },
    /// The start-up ramp is so long that the force is still nearly zero.
    #[error("ramp_s of ToolSettings::safety is {ramp_s} s; shorten it")]
    StartRamp {
        /// [`SafetySettings::ramp_s`](palpate_haptics::SafetySettings::ramp_s), s.
        ramp_s: f64,
    },
    /// The loop started, or resumed, in contact; the force starts once it is below the threshold.
    #[error(
        "the loop started in contact with {force_n:.3} N and waits for less than {arm_below_n} N; lift the tool once, or raise \
         arm_below_n of ToolSettings::safety"
    )]
    StartThreshold {
        /// Force of the local model, N.
        force_n: f64,
        /// [`SafetySettings::arm_below_n`](palpate_haptics::SafetySettings::arm_below_n), N.
        arm_below_n: f64,
    },
    /// The limit of the force's rate of change is so low that the force is still nearly zero.
    #[error("max_slew_n_per_s of ToolSettings::safety is {max_slew_n_per_s} N/s; raise it")]
    GrowthLimit {
        /// [`SafetySettings::max_slew_n_per_s`](palpate_haptics::SafetySettings::max_slew_n_per_s), N/s.
        max_slew_n_per_s: f64,
    },
    /// Another stage of the safety chain suppresses the force.
    #[error("the safety stage {} suppresses the force; change its settings in ToolSettings::safety", .stage.name())]
    SafetyStage {
        /// The stage.
        stage: SafetyAction,
    },
    /// The force lies along axes for which the device has no motor.
    #[error(
        "the device has no motor along {force_n} (device frame); change rotation of ToolSettings::frame, or touch from another side"
    )]
    MissingAxes {
        /// Mean force sent to the device, N, device frame.
        force_n: DVec3,
    },
    /// The local model computes no force although the full body does.
    #[error(
        "the local model of scheme {} computes no force; use Scheme::NearFieldExact, raise ModelRate or move slower",
        .scheme.name()
    )]
    LocalModel {
        /// The scheme of the local model.
        scheme: Scheme,
    },
}

impl NoForceCause {
    /// Whether no body is within reach, as opposed to a force that is missing in contact.
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

    /// Whether `other` is the same cause at the same body, regardless of its numbers.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        (std::mem::discriminant(self), self.body()) == (std::mem::discriminant(other), other.body())
    }

    /// The body that the cause concerns, if any.
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
