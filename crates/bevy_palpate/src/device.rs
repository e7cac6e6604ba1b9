//! Selection of devices, and the registry that creates them.

#[cfg(feature = "hid")]
mod hid;
mod hid_selector;

pub use hid_selector::{HidDeviceKind, HidSelector};

use crate::fault::DeviceFault;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use palpate_haptics::{HapticDevice, ReplayDevice, ReplayEnd, Trajectory};
use std::path::PathBuf;

/// Selects the device of a tool. A selector is plain data; [`HapticDevices`] creates the device when the tool's loop starts.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, Default, PartialEq, Hash, Clone)]
pub enum DeviceSelector {
    /// Replays a recorded trajectory: a CSV file with the header `t_s,x_m,y_m,z_m`, optional buttons and orientation, and one row per
    /// millisecond ([`Trajectory`]).
    Replay {
        /// Path of the file, relative to the working directory. If there is none, the folder `assets` below the first of these that has the
        /// file: the working directory, `BEVY_ASSET_ROOT`, `CARGO_MANIFEST_DIR`, the program's folder.
        path: String,
        /// Whether the trajectory starts again at its end.
        repeat: bool,
    },
    /// The device registered under this name in [`HapticDevices`].
    Named(String),
    /// A connected HID device. Needs the feature `hid`. Without the feature, or without a matching device, the tool reports a fault.
    Hid(HidSelector),
}

impl DeviceSelector {
    /// Selects a recorded trajectory that repeats.
    #[must_use]
    pub fn replay(path: impl Into<String>) -> Self {
        Self::Replay { path: path.into(), repeat: true }
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

    /// Creates the device that `selector` selects, without opening it.
    ///
    /// # Errors
    /// [`DeviceFault`] if the name is not registered, the file cannot be read, or the device cannot be created.
    pub fn make(&self, selector: &DeviceSelector) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        match selector {
            DeviceSelector::Replay { path, repeat } => {
                let at_end = if *repeat { ReplayEnd::Repeat } else { ReplayEnd::Stay };
                Ok(Box::new(ReplayDevice::new(Trajectory::from_csv_file(find(path))?, at_end)))
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

/// Returns the existing file `path`, or the file below an `assets` folder; `path` if there is none.
fn find(path: &str) -> PathBuf {
    let of = |variable| std::env::var_os(variable).map(PathBuf::from);
    let program = std::env::current_exe().ok().and_then(|exe| Some(exe.parent()?.to_owned()));
    let roots = [Some(PathBuf::new()), of("BEVY_ASSET_ROOT"), of("CARGO_MANIFEST_DIR"), program];
    let below_assets = roots.into_iter().flatten().map(|root| root.join("assets").join(path));
    let mut candidates = std::iter::once(PathBuf::from(path)).chain(below_assets);
    candidates.find(|file| file.exists()).unwrap_or_else(|| path.into())
}

impl std::fmt::Debug for HapticDevices {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HapticDevices").field("names", &self.names()).finish_non_exhaustive()
    }
}
