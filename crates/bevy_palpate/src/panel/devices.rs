//! The device of a tool, chosen.

use super::recording::name_of;
use super::theme;
use crate::device::{DeviceSelector, HapticDevices, HidDeviceKind, HidSelector};
use bevy_egui::egui;

/// What may be asked for before it is plugged in.
const FIRST: [Option<HidDeviceKind>; 4] =
    [None, Some(HidDeviceKind::Board), Some(HidDeviceKind::Joystick), Some(HidDeviceKind::SpaceMouse)];

/// The devices that were found when they were last looked for.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeviceList {
    found: Vec<(DeviceSelector, String)>,
    /// What looking for them gave.
    told: Option<Result<String, String>>,
}

impl DeviceList {
    /// A list of all devices that have a name here and of those that are plugged in; whether `device` is another one now.
    pub(super) fn choose(
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
                    for choice in FIRST.iter().filter(|_| cfg!(feature = "hid")) {
                        let choice = HidSelector { kind: *choice, ..HidSelector::first() };
                        let label = choice.to_string();
                        ui.selectable_value(device, DeviceSelector::Hid(choice), label);
                    }
                    for (found, label) in &self.found {
                        ui.selectable_value(device, found.clone(), label);
                    }
                },
            );
            if ui.small_button("look").on_hover_text("looks for devices that are plugged in").clicked() {
                self.refresh(devices);
            }
        });
        match &self.told {
            Some(Ok(text)) => {
                theme::small(ui, text.as_str());
            }
            Some(Err(why)) => {
                theme::refusal(ui, why);
            }
            None => {}
        }
        *device != before
    }

    /// Looks for what is plugged in.
    pub(super) fn refresh(&mut self, devices: &HapticDevices) {
        match present(devices) {
            Ok(found) => {
                self.told = Some(Ok(match found.len() {
                    0 => "No known device is plugged in.".into(),
                    1 => "One is plugged in.".into(),
                    several => format!("{several} are plugged in."),
                }));
                self.found = found;
            }
            Err(why) => self.told = Some(Err(why)),
        }
    }

    /// What was found.
    #[cfg(test)]
    pub(super) fn found(&self) -> &[(DeviceSelector, String)] {
        &self.found
    }
}

#[cfg(feature = "hid")]
fn present(devices: &HapticDevices) -> Result<Vec<(DeviceSelector, String)>, String> {
    let found = devices.hid_present().map_err(|error| error.to_string())?;
    Ok(found.into_iter().map(|(choice, label)| (DeviceSelector::Hid(choice), label)).collect())
}

#[cfg(not(feature = "hid"))]
fn present(_: &HapticDevices) -> Result<Vec<(DeviceSelector, String)>, String> {
    Err("Devices that are plugged in need the feature hid of bevy_palpate.".into())
}

/// Of a board that does not know where its arm is: what to do about that, and a button that says that it has been done.
#[cfg(feature = "hid")]
pub(super) fn calibrate(ui: &mut egui::Ui, devices: &HapticDevices, device: &DeviceSelector) {
    let DeviceSelector::Hid(choice) = device else { return };
    let Some(calibration) = devices.hid_calibration(choice).filter(|calibration| !calibration.is_done())
    else {
        return;
    };
    ui.colored_label(theme::AMBER, "No force until the arm has been at its home.");
    if ui.small_button("It is there").on_hover_text("Hold the arm at its home, and press this.").clicked() {
        calibration.request();
    }
}

#[cfg(not(feature = "hid"))]
pub(super) fn calibrate(_: &mut egui::Ui, _: &HapticDevices, _: &DeviceSelector) {}

/// How often a device over HID takes a force, and what has come of its reports; `None` for other devices, and before one is made.
#[cfg(feature = "hid")]
pub(super) fn counted(devices: &HapticDevices, device: &DeviceSelector) -> Option<[String; 2]> {
    let DeviceSelector::Hid(choice) = device else { return None };
    let counters = devices.hid_counters(choice)?;
    let forces = counters.force_rate_hz().map_or_else(|| "none".into(), |hz| format!("{hz:.0} a second"));
    let (read, skipped, malformed) = (counters.read(), counters.skipped(), counters.malformed());
    Some([forces, format!("{read} read · {skipped} passed over for newer ones · {malformed} malformed")])
}

#[cfg(not(feature = "hid"))]
pub(super) fn counted(_: &HapticDevices, _: &DeviceSelector) -> Option<[String; 2]> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "hid")]
    #[test]
    fn what_is_plugged_in_is_found_when_it_is_looked_for() {
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
        let (mut present, mut devices) = (DeviceList::default(), HapticDevices::default());
        devices.set_hid_bus(bus);
        present.refresh(&devices);
        assert_eq!(present.told, Some(Ok("One is plugged in.".into())));
        let [(selector, label)] = present.found() else { panic!("one device") };
        assert_eq!(label, "SpaceMouse: SpaceMouse (256f:c635, serial 7)");
        assert_eq!(name_of(selector), "SpaceMouse 256f:c635 7");
        assert_eq!(counted(&devices, selector), None);
        assert!(devices.make(selector).is_ok());
        let [forces, reports] = counted(&devices, selector).expect("one was made");
        assert_eq!(forces, "none");
        assert_eq!(reports, "0 read · 0 passed over for newer ones · 0 malformed");
    }

    #[cfg(not(feature = "hid"))]
    #[test]
    fn without_the_feature_it_says_so() {
        let mut present = DeviceList::default();
        present.look(&HapticDevices::default());
        assert!(present.told.as_ref().is_some_and(|told| told.is_err()) && present.found().is_empty());
    }
}
