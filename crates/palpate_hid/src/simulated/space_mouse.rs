//! What is inside a SpaceMouse that is not there.

use super::Firmware;
use crate::SpaceMouseReport;
use std::collections::VecDeque;

/// How a cap tells push and turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpaceMouseLayout {
    /// One after the other, each in a report of its own, as models with a cable do.
    Separate,
    /// Both in one report, as wireless models do.
    Combined,
}

/// A cap that says what it has been told to say, one report at a time, and has a light.
#[derive(Clone, Debug)]
pub struct SpaceMouseFirmware {
    form: SpaceMouseLayout,
    says: VecDeque<SpaceMouseReport>,
    is_lit: bool,
    lit: u64,
}

impl SpaceMouseFirmware {
    /// A cap at rest, its light off, that has nothing to say.
    #[must_use]
    pub fn new(form: SpaceMouseLayout) -> Self {
        Self { form, says: VecDeque::new(), is_lit: false, lit: 0 }
    }

    /// Its report descriptor: two buttons, a light, and axes of ±350 counts, in the same collections as the SpaceNavigator's.
    #[must_use]
    pub fn descriptor(&self) -> Vec<u8> {
        const RANGE: [u8; 6] = [0x16, 0xA2, 0xFE, 0x26, 0x5E, 0x01];
        const PUSH: [u8; 6] = [0x09, 0x30, 0x09, 0x31, 0x09, 0x32];
        const TURN: [u8; 6] = [0x09, 0x33, 0x09, 0x34, 0x09, 0x35];
        // Desktop page, a controller with several axes.
        let mut bytes = vec![0x05, 0x01, 0x09, 0x08, 0xA1, 0x01];
        let mut axes = |id, usages: &[&[u8]]| {
            bytes.extend([0xA1, 0x00, 0x85, id]);
            bytes.extend(RANGE);
            bytes.extend(usages.concat());
            let count = if usages.len() > 1 { 6 } else { 3 };
            // Of 16 bits each.
            bytes.extend([0x75, 0x10, 0x95, count, 0x81, 0x02, 0xC0]);
        };
        match self.form {
            SpaceMouseLayout::Separate => {
                axes(1, &[&PUSH]);
                axes(2, &[&TURN]);
            }
            SpaceMouseLayout::Combined => axes(1, &[&PUSH, &TURN]),
        }
        // Report 3: buttons 1 and 2, and 14 bits of nothing.
        bytes.extend([0xA1, 0x02, 0x85, 0x03, 0x05, 0x09, 0x19, 0x01, 0x29, 0x02, 0x15, 0x00, 0x25, 0x01]);
        bytes.extend([0x75, 0x01, 0x95, 0x02, 0x81, 0x02, 0x95, 0x0E, 0x81, 0x03, 0xC0]);
        // Report 4, to the device: a light, and 7 bits of nothing.
        bytes.extend([0xA1, 0x02, 0x85, 0x04, 0x05, 0x08, 0x09, 0x4B, 0x15, 0x00, 0x25, 0x01]);
        bytes.extend([0x75, 0x01, 0x95, 0x01, 0x91, 0x02, 0x95, 0x07, 0x91, 0x03, 0xC0]);
        bytes.push(0xC0);
        bytes
    }

    /// It will say that it is pushed and turned so far, counts in its own axes: x to the right, y towards the hand's owner, z
    /// down.
    pub fn push(&mut self, push: [i16; 3], turn: [i16; 3]) {
        match self.form {
            SpaceMouseLayout::Separate => {
                self.says.extend([SpaceMouseReport::Push(push), SpaceMouseReport::Turn(turn)]);
            }
            SpaceMouseLayout::Combined => self.says.push_back(SpaceMouseReport::PushAndTurn(push, turn)),
        }
    }

    /// It will say that these buttons are pressed, bit i for button i.
    pub fn press(&mut self, buttons: u32) {
        self.says.push_back(SpaceMouseReport::Buttons(buttons));
    }

    /// How many reports it has still to say.
    #[must_use]
    pub fn pending(&self) -> usize {
        self.says.len()
    }

    /// Whether its light is on.
    #[must_use]
    pub fn is_lit(&self) -> bool {
        self.is_lit
    }

    /// How often its light went on.
    #[must_use]
    pub fn times_lit(&self) -> u64 {
        self.lit
    }
}

impl Firmware for SpaceMouseFirmware {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let Some(bytes) = self.says.pop_front().map(encode) else { return 0 };
        let Some(room) = report.get_mut(..bytes.len()) else { return 0 };
        room.copy_from_slice(&bytes);
        bytes.len()
    }

    fn output(&mut self, report: &[u8]) -> bool {
        let &[4, light] = report else { return false };
        let is_lit = light & 1 == 1;
        self.lit += u64::from(is_lit && !self.is_lit);
        self.is_lit = is_lit;
        true
    }
}

/// The report as the device sends it.
fn encode(report: SpaceMouseReport) -> Vec<u8> {
    let axes = |of: [i16; 3]| of.into_iter().flat_map(i16::to_le_bytes);
    match report {
        SpaceMouseReport::Push(push) => [1].into_iter().chain(axes(push)).collect(),
        SpaceMouseReport::Turn(turn) => [2].into_iter().chain(axes(turn)).collect(),
        SpaceMouseReport::PushAndTurn(push, turn) => {
            [1].into_iter().chain(axes(push)).chain(axes(turn)).collect()
        }
        SpaceMouseReport::Buttons(buttons) => {
            [3].into_iter().chain(buttons.to_le_bytes().into_iter().take(2)).collect()
        }
        SpaceMouseReport::Other(id) => vec![id],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulated::SimulatedBus;
    use crate::{
        HidBus, HidDevice, HidInfo, HidKind, HidOptions, HidSelector, ReportDescriptor, ReportKind, Usage,
    };
    use glam::DVec3;
    use palpate_haptics::HapticDevice;
    use std::sync::{Arc, Mutex};
    use std::time::Duration;

    /// Of all reports that a cap says, the bytes, one after the other.
    fn said(mut cap: SpaceMouseFirmware) -> Vec<Vec<u8>> {
        std::iter::from_fn(|| {
            let mut report = [0; 64];
            let length = cap.input(&mut report);
            (length > 0).then(|| report[..length].to_vec())
        })
        .collect()
    }

    #[test]
    fn it_says_the_bytes_of_the_published_layouts() {
        let mut apart = SpaceMouseFirmware::new(SpaceMouseLayout::Separate);
        apart.push([1, -2, 350], [-350, 256, 0]);
        apart.press(0b10);
        let push = [1, 1, 0, 0xFE, 0xFF, 0x5E, 0x01];
        let turn = [0xA2, 0xFE, 0x00, 0x01, 0, 0];
        let told = said(apart);
        assert_eq!(told, [push.to_vec(), [&[2][..], &turn].concat(), vec![3, 2, 0]]);
        let mut together = SpaceMouseFirmware::new(SpaceMouseLayout::Combined);
        together.push([1, -2, 350], [-350, 256, 0]);
        assert_eq!(said(together), [[&push[..], &turn].concat()]);
    }

    #[test]
    fn its_reports_are_those_of_its_descriptor() {
        for form in [SpaceMouseLayout::Separate, SpaceMouseLayout::Combined] {
            let mut cap = SpaceMouseFirmware::new(form);
            let descriptor = ReportDescriptor::parse(&cap.descriptor()).unwrap();
            assert_eq!(descriptor.applications().next(), Some(Usage::new(1, 8)));
            cap.push([1, 2, 3], [4, 5, 6]);
            cap.press(1);
            for report in said(cap) {
                let known = descriptor.report(ReportKind::Input, report[0]).unwrap();
                assert_eq!(known.bytes() + 1, report.len());
            }
            assert_eq!(descriptor.report(ReportKind::Output, 4).unwrap().bytes(), 1);
        }
    }

    #[test]
    fn behind_a_stand_in_it_moves_a_point_and_its_light_is_on_while_it_is_open() {
        for form in [SpaceMouseLayout::Separate, SpaceMouseLayout::Combined] {
            let cap = Arc::new(Mutex::new(SpaceMouseFirmware::new(form)));
            let bus = SimulatedBus::default();
            let info = HidInfo {
                path: "stand-in".into(),
                vendor: 0x256F,
                product: 0xC635,
                applications: vec![Usage::new(1, 8)],
                ..HidInfo::default()
            };
            bus.plug(info, cap.lock().unwrap().descriptor(), Arc::clone(&cap));
            let bus: Arc<dyn HidBus> = Arc::new(bus);
            let found = HidSelector::first(HidKind::SpaceMouse);
            let device = HidDevice::find(bus, &found, &HidOptions::default()).unwrap();
            let mut ms = 0;
            let mut device = device.with_clock(move || {
                ms += 1;
                Duration::from_millis(ms)
            });
            device.open().unwrap();
            assert!(cap.lock().unwrap().is_lit());
            // Full to the right, half a turn about the upright axis; then let go.
            cap.lock().unwrap().push([350, 0, 0], [0, 0, -350]);
            let moved: Vec<_> = (0..51).map(|_| device.read(Duration::ZERO).unwrap()).collect();
            let last = moved.last().unwrap();
            // The first reading has no time behind it.
            assert!((last.position_m - DVec3::X * 0.1 * 0.05).length() < 1e-12, "{last:?}");
            let turned = last.orientation.to_scaled_axis();
            assert!((turned - DVec3::Y * 1.5 * 0.05).length() < 1e-12, "{turned}");
            cap.lock().unwrap().press(1);
            assert_eq!(device.read(Duration::ZERO).unwrap().buttons, 1);
            device.close().unwrap();
            let cap = cap.lock().unwrap();
            assert!(!cap.is_lit() && cap.times_lit() == 1);
        }
    }
}
