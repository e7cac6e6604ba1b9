//! Selection of devices, and the registry that creates them.

#[cfg(feature = "hid")]
mod hid;
mod hid_selector;
mod trajectory;

pub use hid_selector::{HidDeviceKind, HidSelector};
pub(crate) use trajectory::add_trajectory_assets;
pub use trajectory::{TrajectoryAsset, TrajectoryLoader};

use crate::fault::DeviceFault;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use palpate_haptics::{HapticDevice, ReplayDevice, ReplayEnd};

/// Selects the device of a tool. A selector is plain data; [`HapticDevices`] creates the device when the tool's loop starts.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, Default, PartialEq, Hash, Clone)]
pub enum DeviceSelector {
    /// Replays a recorded trajectory. The tool starts once the asset is loaded; [`TrajectoryAsset`] describes later changes of it.
    Replay {
        /// The trajectory.
        trajectory: Handle<TrajectoryAsset>,
        /// Whether the trajectory starts again at its end.
        repeat: bool,
    },
    /// The device registered under this name in [`HapticDevices`].
    Named(String),
    /// A connected HID device. Needs the feature `hid`. Without the feature, or without a matching device, the tool reports a fault.
    Hid(HidSelector),
}

impl DeviceSelector {
    /// Selects a recorded trajectory that repeats, for example `DeviceSelector::replay(asset_server.load("hand.csv"))`.
    #[must_use]
    pub fn replay(trajectory: Handle<TrajectoryAsset>) -> Self {
        Self::Replay { trajectory, repeat: true }
    }

    /// Selects the device registered as `name`.
    #[must_use]
    pub fn named(name: impl Into<String>) -> Self {
        Self::Named(name.into())
    }

    /// Selects the first HID device that is not in use: boards before joysticks before SpaceMice.
    #[must_use]
    pub fn first_hid() -> Self {
        Self::Hid(HidSelector::first())
    }
}

impl From<&str> for DeviceSelector {
    /// Selects the device registered under that name.
    fn from(name: &str) -> Self {
        Self::named(name)
    }
}

impl From<String> for DeviceSelector {
    /// Selects the device registered under that name.
    fn from(name: String) -> Self {
        Self::Named(name)
    }
}

impl From<Handle<TrajectoryAsset>> for DeviceSelector {
    /// Selects the trajectory, which repeats.
    fn from(trajectory: Handle<TrajectoryAsset>) -> Self {
        Self::replay(trajectory)
    }
}

impl From<HidSelector> for DeviceSelector {
    fn from(selector: HidSelector) -> Self {
        Self::Hid(selector)
    }
}

impl Default for DeviceSelector {
    /// The device registered as `"default"`.
    fn default() -> Self {
        Self::named("default")
    }
}

/// Error of a registered function.
type MakeError = Box<dyn std::error::Error + Send + Sync>;
type Make = dyn Fn() -> Result<Box<dyn HapticDevice>, MakeError> + Send + Sync;

/// The devices that tools can select by name.
#[derive(Resource, Default)]
pub struct HapticDevices {
    named: HashMap<String, Box<Make>>,
    #[cfg(feature = "hid")]
    hid: hid::Hid,
}

impl HapticDevices {
    /// Registers `make` under `name`; it is called whenever a tool that selects the name starts. A later registration of the same name
    /// replaces the earlier one.
    pub fn register<D: HapticDevice + 'static>(
        &mut self,
        name: impl Into<String>,
        make: impl Fn() -> Result<D, MakeError> + Send + Sync + 'static,
    ) {
        self.named.insert(name.into(), Box::new(move || Ok(Box::new(make()?))));
    }

    /// Returns the registered names, sorted.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.named.keys().map(String::as_str).collect();
        names.sort_unstable();
        names
    }

    /// Creates the device that `selector` selects, without opening it. `trajectories` are the app's, if it has any.
    ///
    /// # Errors
    /// [`DeviceFault`] if the name is not registered, the trajectory is not loaded, or the device cannot be created.
    pub fn make(
        &self,
        selector: &DeviceSelector,
        trajectories: Option<&Assets<TrajectoryAsset>>,
    ) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        match selector {
            DeviceSelector::Replay { trajectory, repeat } => {
                let TrajectoryAsset(loaded) = trajectories
                    .ok_or(DeviceFault::NoTrajectories)?
                    .get(trajectory)
                    .ok_or_else(|| trajectory::not_loaded(trajectory))?;
                let at_end = if *repeat { ReplayEnd::Repeat } else { ReplayEnd::Stay };
                Ok(Box::new(ReplayDevice::new(loaded.clone(), at_end)))
            }
            DeviceSelector::Named(name) => match self.named.get(name) {
                Some(make) => make().map_err(DeviceFault::Create),
                None => {
                    let registered = match self.names()[..] {
                        [] => "none".to_owned(),
                        ref names => names.join(", "),
                    };
                    Err(DeviceFault::UnknownName { name: name.clone(), registered })
                }
            },
            #[cfg(feature = "hid")]
            DeviceSelector::Hid(selector) => Ok(Box::new(self.hid.make(selector)?)),
            #[cfg(not(feature = "hid"))]
            DeviceSelector::Hid(_) => Err(DeviceFault::FeatureDisabled { feature: "hid" }),
        }
    }
}

/// HID devices.
#[cfg(feature = "hid")]
impl HapticDevices {
    /// Sets the bus of the HID devices, instead of the operating system's; for example a `SimulatedBus` of
    /// `palpate_hid` (feature `simulated`) in a test.
    pub fn set_hid_bus(&mut self, bus: impl palpate_hid::HidBus + 'static) {
        self.hid.set_bus(std::sync::Arc::new(bus));
    }

    /// Sets the options of HID devices that are created afterwards: speeds, limits, kinematics of each kind. An option out of range is
    /// reported as a fault of the tool.
    pub fn set_hid_options(&mut self, options: palpate_hid::HidOptions) {
        self.hid.options = options;
    }

    /// Returns the supported HID devices that are connected: a selector for each one alone, and its label. May take a tenth of a second.
    ///
    /// # Errors
    /// [`HidError`](palpate_hid::HidError) if the operating system cannot list the devices.
    pub fn hid_present(&self) -> Result<Vec<(HidSelector, String)>, palpate_hid::HidError> {
        self.hid.present()
    }

    /// Returns the counters of the newest device created for `choice`: skipped reports, and the rate of written forces.
    #[must_use]
    pub fn hid_counters(&self, choice: &HidSelector) -> Option<palpate_hid::HidCounters> {
        self.hid.newest(choice).map(|created| created.counters)
    }

    /// Returns the calibration of the newest 3-DOF board created for `choice`, usable while its loop runs; `None` for other kinds.
    #[must_use]
    pub fn hid_calibration(&self, choice: &HidSelector) -> Option<palpate_hid::BoardCalibration> {
        self.hid.newest(choice).and_then(|created| created.calibration)
    }
}

impl std::fmt::Debug for HapticDevices {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HapticDevices").field("names", &self.names()).finish_non_exhaustive()
    }
}
