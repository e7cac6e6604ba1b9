//! Selection of a tool's device.

use super::recording::name_of;
use super::theme;
use crate::device::{DeviceSelector, HapticDevices, HidDeviceKind, HidSelector};
use bevy_egui::egui;

/// Kinds of HID devices that can be selected before they are connected.
const FIRST: [Option<HidDeviceKind>; 4] =
    [None, Some(HidDeviceKind::Board), Some(HidDeviceKind::Joystick), Some(HidDeviceKind::SpaceMouse)];

/// Connected devices of the last search.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeviceList {
    found: Vec<(DeviceSelector, String)>,
    /// Message about the last search.
    message: Option<Result<String, String>>,
}

impl DeviceList {
    /// Shows the registered and the connected devices; returns whether another one than `device` was selected.
    pub(super) fn select(
        &mut self,
        ui: &mut egui::Ui,
        device: &mut DeviceSelector,
        devices: &HapticDevices,
    ) -> bool {
        let before = device.clone();
        ui.horizontal(|ui| {
            egui::ComboBox::from_id_salt("palpate_device").selected_text(name_of(device)).truncate().show_ui(
                ui,
                |ui| {
                    for name in devices.names() {
                        ui.selectable_value(device, DeviceSelector::named(name), name);
                    }
                    for kind in FIRST.iter().filter(|_| cfg!(feature = "hid")) {
                        let selector = HidSelector { kind: *kind, ..HidSelector::first() };
                        let label = selector.to_string();
                        ui.selectable_value(device, DeviceSelector::Hid(selector), label);
                    }
                    for (found, label) in &self.found {
                        ui.selectable_value(device, found.clone(), label);
                    }
                },
            );
            if ui.small_button("search").on_hover_text("searches for connected devices").clicked() {
                self.refresh(devices);
            }
        });
        match &self.message {
            Some(Ok(text)) => {
                theme::small(ui, text.as_str());
            }
            Some(Err(reason)) => {
                theme::error(ui, reason);
            }
            None => {}
        }
        *device != before
    }

    /// Searches for connected devices.
    pub(super) fn refresh(&mut self, devices: &HapticDevices) {
        match connected(devices) {
            Ok(found) => {
                self.message = Some(Ok(match found.len() {
                    0 => "No supported device is connected.".into(),
                    1 => "One device is connected.".into(),
                    several => format!("{several} devices are connected."),
                }));
                self.found = found;
            }
            Err(reason) => self.message = Some(Err(reason)),
        }
    }

    /// The devices of the last search.
    #[cfg(test)]
    pub(super) fn found(&self) -> &[(DeviceSelector, String)] {
        &self.found
    }
}

#[cfg(feature = "hid")]
fn connected(devices: &HapticDevices) -> Result<Vec<(DeviceSelector, String)>, String> {
    let found = devices.hid_present().map_err(|error| error.to_string())?;
    Ok(found.into_iter().map(|(selector, label)| (DeviceSelector::Hid(selector), label)).collect())
}

#[cfg(not(feature = "hid"))]
fn connected(_: &HapticDevices) -> Result<Vec<(DeviceSelector, String)>, String> {
    Err("HID devices need the feature `hid` of bevy_palpate, which is not enabled.".into())
}

/// Of a board that does not know where its arm is: what to do about that, and a button that says that it has been done.
#[cfg(feature = "hid")]
pub(super) fn calibrate(ui: &mut egui::Ui, devices: &HapticDevices, device: &DeviceSelector) {
    let DeviceSelector::Hid(selector) = device else { return };
    let Some(calibration) = devices.hid_calibration(selector).filter(|calibration| !calibration.is_done())
    else {
        return;
    };
    ui.colored_label(theme::AMBER, "Not calibrated: no force until the arm has been in its home position.");
    if ui.small_button("Calibrate").on_hover_text("Hold the arm in its home position and click.").clicked() {
        calibration.request();
    }
}

#[cfg(not(feature = "hid"))]
pub(super) fn calibrate(_: &mut egui::Ui, _: &HapticDevices, _: &DeviceSelector) {}

/// Rate of forces and counters of reports of a HID device; `None` for other devices, and before one is created.
#[cfg(feature = "hid")]
pub(super) fn counters(devices: &HapticDevices, device: &DeviceSelector) -> Option<[String; 2]> {
    let DeviceSelector::Hid(selector) = device else { return None };
    let counters = devices.hid_counters(selector)?;
    let forces = counters.force_rate_hz().map_or_else(|| "none".into(), |hz| format!("{hz:.0} per second"));
    let (read, skipped, malformed) = (counters.read(), counters.skipped(), counters.malformed());
    Some([forces, format!("{read} read · {skipped} skipped for newer ones · {malformed} malformed")])
}

#[cfg(not(feature = "hid"))]
pub(super) fn counters(_: &HapticDevices, _: &DeviceSelector) -> Option<[String; 2]> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "hid")]
    #[test]
    fn search_finds_a_connected_device() {
        use palpate_hid::simulated::{Firmware, SimulatedBus};
        use palpate_hid::{HidInfo, Usage};

        struct Silent;
        impl Firmware for Silent {
            fn input(&mut self, _: &mut [u8]) -> usize {
                0
            }

            fn output(&mut self, _: &[u8]) -> bool {
                true
            }
        }
        let bus = SimulatedBus::default();
        let info = HidInfo {
            path: "cap".into(),
            vendor: 0x256F,
            product: 0xC635,
            serial: "7".into(),
            name: "SpaceMouse".into(),
            interface: None,
            applications: vec![Usage::new(1, 8)],
        };
        bus.plug(info, Vec::new(), Silent);
        let (mut list, mut devices) = (DeviceList::default(), HapticDevices::default());
        devices.set_hid_bus(bus);
        list.refresh(&devices);
        assert_eq!(list.message, Some(Ok("One device is connected.".into())));
        let [(selector, label)] = list.found() else { panic!("one device") };
        assert_eq!(label, "SpaceMouse: SpaceMouse (256f:c635, serial 7)");
        assert_eq!(name_of(selector), "SpaceMouse 256f:c635 7");
        assert_eq!(counters(&devices, selector), None);
        assert!(devices.make(selector, None).is_ok());
        let [forces, reports] = counters(&devices, selector).expect("one was created");
        assert_eq!(forces, "none");
        assert_eq!(reports, "0 read · 0 skipped for newer ones · 0 malformed");
    }

    #[cfg(not(feature = "hid"))]
    #[test]
    fn search_without_the_feature_is_an_error() {
        let mut list = DeviceList::default();
        list.refresh(&HapticDevices::default());
        assert!(list.message.as_ref().is_some_and(Result::is_err) && list.found().is_empty());
    }
}
