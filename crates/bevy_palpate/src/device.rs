//! Which device a tool has, and where devices come from.

#[cfg(feature = "hid")]
mod hid;
mod hid_selector;

pub use hid_selector::{HidDeviceKind, HidSelector};

use crate::fault::DeviceFault;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use palpate_haptics::{HapticDevice, ReplayDevice, ReplayEnd, Trajectory};
use std::path::PathBuf;

/// Which device a tool has. A selector is plain data; the device itself comes from [`HapticDevices`] when the
/// tool's loop starts.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, Default, PartialEq, Hash, Clone)]
pub enum DeviceSelector {
    /// A recorded hand: a CSV file with the header `t_s,x_m,y_m,z_m`, after which buttons and an orientation may follow, and a row each
    /// millisecond; see [`Trajectory`].
    Replay {
        /// The file, from the working directory or, if it is not there, from the folder `assets` below the first of
        /// these that has it: the working directory, `BEVY_ASSET_ROOT`, `CARGO_MANIFEST_DIR`, the program's folder.
        path: String,
        /// Whether it begins anew at its end.
        repeat: bool,
    },
    /// The device registered under this name in [`HapticDevices`].
    Named(String),
    /// A device over HID that is plugged in. Needs the feature `hid`; without it, and where there is no such device, the tool has a
    /// fault that says so.
    Hid(HidSelector),
}

impl DeviceSelector {
    /// A recorded hand that is repeated for ever.
    #[must_use]
    pub fn replay(path: impl Into<String>) -> Self {
        Self::Replay { path: path.into(), repeat: true }
    }

    /// The device registered as `name`.
    #[must_use]
    pub fn named(name: impl Into<String>) -> Self {
        Self::Named(name.into())
    }
}

impl DeviceSelector {
    /// The first device over HID that is not in use: boards before joysticks before SpaceMice.
    #[must_use]
    pub fn first_hid() -> Self {
        Self::Hid(HidSelector::first())
    }
}

impl From<&str> for DeviceSelector {
    /// The device registered under that name.
    fn from(name: &str) -> Self {
        Self::named(name)
    }
}

impl From<String> for DeviceSelector {
    /// The device registered under that name.
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

/// What a registered function may fail with.
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
    /// Registers `make` under `name`; it is called whenever a tool with that name starts. A later
    /// registration of the same name takes the place of the earlier one.
    pub fn register<D: HapticDevice + 'static>(
        &mut self,
        name: impl Into<String>,
        make: impl Fn() -> Result<D, MakeError> + Send + Sync + 'static,
    ) {
        self.named.insert(name.into(), Box::new(move || Ok(Box::new(make()?))));
    }

    /// The registered names, sorted.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.named.keys().map(String::as_str).collect();
        names.sort_unstable();
        names
    }

    /// Makes the device that `selector` selects. It is not open yet.
    ///
    /// # Errors
    /// [`DeviceFault`] when there is no such name or file, or the device cannot be made.
    pub fn make(&self, selector: &DeviceSelector) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        match selector {
            DeviceSelector::Replay { path, repeat } => {
                let at_end = if *repeat { ReplayEnd::Repeat } else { ReplayEnd::Stay };
                Ok(Box::new(ReplayDevice::new(Trajectory::from_csv_file(find(path))?, at_end)))
            }
            DeviceSelector::Named(name) => match self.named.get(name) {
                Some(make) => make().map_err(DeviceFault::Make),
                None => {
                    let known = match self.names()[..] {
                        [] => "none".to_owned(),
                        ref names => names.join(", "),
                    };
                    Err(DeviceFault::UnknownName { name: name.clone(), known })
                }
            },
            #[cfg(feature = "hid")]
            DeviceSelector::Hid(choice) => Ok(Box::new(self.hid.make(choice)?)),
            #[cfg(not(feature = "hid"))]
            DeviceSelector::Hid(_) => Err(DeviceFault::FeatureDisabled { feature: "hid" }),
        }
    }
}

/// Devices over HID.
#[cfg(feature = "hid")]
impl HapticDevices {
    /// Where they come from, in place of the operating system: a `SimulatedBus` of `palpate_hid` (feature `simulated`) in a test.
    pub fn set_hid_bus(&mut self, bus: impl palpate_hid::HidBus + 'static) {
        self.hid.set_bus(std::sync::Arc::new(bus));
    }

    /// What is set for those that are made from now on: speeds, limits, kinematics of each kind. It is looked at when one is made;
    /// an option out of bounds is a fault of its tool.
    pub fn set_hid_options(&mut self, options: palpate_hid::HidOptions) {
        self.hid.options = options;
    }

    /// Those that are plugged in and known: a choice that means just that one, and what people call it. It may take a tenth of a
    /// second.
    ///
    /// # Errors
    /// [`HidError`](palpate_hid::HidError) where the operating system does not list them.
    pub fn hid_present(&self) -> Result<Vec<(HidSelector, String)>, palpate_hid::HidError> {
        self.hid.present()
    }

    /// What the device that was made last by `choice` has seen: reports skipped, the rate at which it takes forces.
    #[must_use]
    pub fn hid_counters(&self, choice: &HidSelector) -> Option<palpate_hid::HidCounters> {
        self.hid.opened(choice).map(|made| made.counters)
    }

    /// A way to calibrate the 3-DOF board that was made last by `choice`, while its loop has it; `None` for other kinds.
    #[must_use]
    pub fn hid_calibration(&self, choice: &HidSelector) -> Option<palpate_hid::BoardCalibration> {
        self.hid.opened(choice).and_then(|made| made.calibration)
    }
}

/// The file `path` as it stands or below an `assets` folder; as it stands if there is none.
fn find(path: &str) -> PathBuf {
    let of = |variable| std::env::var_os(variable).map(PathBuf::from);
    let beside = std::env::current_exe().ok().and_then(|exe| Some(exe.parent()?.to_owned()));
    let roots = [Some(PathBuf::new()), of("BEVY_ASSET_ROOT"), of("CARGO_MANIFEST_DIR"), beside];
    let below_assets = roots.into_iter().flatten().map(|root| root.join("assets").join(path));
    let mut candidates = std::iter::once(PathBuf::from(path)).chain(below_assets);
    candidates.find(|file| file.exists()).unwrap_or_else(|| path.into())
}

impl std::fmt::Debug for HapticDevices {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HapticDevices").field("names", &self.names()).finish_non_exhaustive()
    }
}
