//! Reasons why a tool has no device.

use bevy::asset::AssetLoadError;
use palpate_haptics::{DeviceError, HapticsError};
use std::sync::Arc;
use thiserror::Error;

/// Reason why a tool has no device.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DeviceFault {
    /// No device of this name is registered.
    #[error("no device is registered as \"{name}\" in HapticDevices; registered are: {registered}")]
    UnknownName {
        /// The selected name.
        name: String,
        /// The registered names, separated by commas.
        registered: String,
    },
    /// A recorded trajectory cannot be loaded.
    #[error("the recorded trajectory cannot be loaded")]
    Trajectory(#[source] Arc<AssetLoadError>),
    /// A recorded trajectory has not been loaded for 5 s. The tool starts once it is.
    #[error(
        "the recorded trajectory {trajectory} is not loaded; load it with AssetServer::load, or add it to Assets<TrajectoryAsset>"
    )]
    TrajectoryNotLoaded {
        /// Path of the trajectory, or its number if it has none.
        trajectory: String,
    },
    /// The app has no trajectories.
    #[error("the app has no assets; add Bevy's AssetPlugin, or register a ReplayDevice in HapticDevices")]
    NoTrajectories,
    /// The registered function failed.
    #[error("the device could not be created")]
    Create(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The device needs a cargo feature that is not enabled.
    #[error("this kind of device needs the feature `{feature}` of bevy_palpate, which is not enabled")]
    FeatureDisabled {
        /// Name of the feature.
        feature: &'static str,
    },
    /// The HID device is not connected, or cannot be used.
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
    /// Whether connecting or disconnecting a device may remove the fault.
    pub(crate) fn depends_on_connected_devices(&self) -> bool {
        #[cfg(feature = "hid")]
        return matches!(self, Self::Hid(_));
        #[cfg(not(feature = "hid"))]
        false
    }
}
