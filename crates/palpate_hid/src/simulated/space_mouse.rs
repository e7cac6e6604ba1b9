//! Simulated SpaceMouse.

use super::Firmware;
use crate::SpaceMouseReport;
use std::collections::VecDeque;

/// Distribution of the six axes over input reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpaceMouseLayout {
    /// Push and turn in separate reports, as in models with a cable.
    Separate,
    /// Push and turn in one report, as in wireless models.
    Combined,
}

/// Simulated firmware of a SpaceMouse: sends queued reports, one at a time, and has a light.
#[derive(Clone, Debug)]
pub struct SpaceMouseFirmware {
    layout: SpaceMouseLayout,
    queue: VecDeque<SpaceMouseReport>,
    is_lit: bool,
    lit: u64,
}

impl SpaceMouseFirmware {
    /// A cap at rest with an empty queue and the light off.
    #[must_use]
    pub fn new(layout: SpaceMouseLayout) -> Self {
        Self { layout, queue: VecDeque::new(), is_lit: false, lit: 0 }
    }

    /// Report descriptor: two buttons, a light, and axes of ±350 counts, in the same collections as the SpaceNavigator's.
    #[must_use]
    pub fn descriptor(&self) -> Vec<u8> {
        const RANGE: [u8; 6] = [0x16, 0xA2, 0xFE, 0x26, 0x5E, 0x01];
        const PUSH: [u8; 6] = [0x09, 0x30, 0x09, 0x31, 0x09, 0x32];
        const TURN: [u8; 6] = [0x09, 0x33, 0x09, 0x34, 0x09, 0x35];
        // Generic Desktop page, Multi-axis Controller.
        let mut bytes = vec![0x05, 0x01, 0x09, 0x08, 0xA1, 0x01];
        let mut axes = |id, usages: &[&[u8]]| {
            bytes.extend([0xA1, 0x00, 0x85, id]);
            bytes.extend(RANGE);
            bytes.extend(usages.concat());
            let count = if usages.len() > 1 { 6 } else { 3 };
            // Of 16 bits each.
            bytes.extend([0x75, 0x10, 0x95, count, 0x81, 0x02, 0xC0]);
        };
        match self.layout {
            SpaceMouseLayout::Separate => {
                axes(1, &[&PUSH]);
                axes(2, &[&TURN]);
            }
            SpaceMouseLayout::Combined => axes(1, &[&PUSH, &TURN]),
        }
        // Report 3: buttons 1 and 2, and 14 bits of padding.
        bytes.extend([0xA1, 0x02, 0x85, 0x03, 0x05, 0x09, 0x19, 0x01, 0x29, 0x02, 0x15, 0x00, 0x25, 0x01]);
        bytes.extend([0x75, 0x01, 0x95, 0x02, 0x81, 0x02, 0x95, 0x0E, 0x81, 0x03, 0xC0]);
        // Report 4, output: a light, and 7 bits of padding.
        bytes.extend([0xA1, 0x02, 0x85, 0x04, 0x05, 0x08, 0x09, 0x4B, 0x15, 0x00, 0x25, 0x01]);
        bytes.extend([0x75, 0x01, 0x95, 0x01, 0x91, 0x02, 0x95, 0x07, 0x91, 0x03, 0xC0]);
        bytes.push(0xC0);
        bytes
    }

    /// Queues reports of a push and a turn, counts in the axes of the cap: x to the right, y towards the user, z down.
    pub fn push(&mut self, push: [i16; 3], turn: [i16; 3]) {
        match self.layout {
            SpaceMouseLayout::Separate => {
                self.queue.extend([SpaceMouseReport::Push(push), SpaceMouseReport::Turn(turn)]);
            }
            SpaceMouseLayout::Combined => self.queue.push_back(SpaceMouseReport::PushAndTurn(push, turn)),
        }
    }

    /// Queues a report of pressed buttons, bit i for button i.
    pub fn press(&mut self, buttons: u32) {
        self.queue.push_back(SpaceMouseReport::Buttons(buttons));
    }

    /// Queues report 1C of the Enterprise: numbers of pressed buttons, from 1; 0 for none.
    pub fn press_numbers(&mut self, pressed: [u16; 6]) {
        self.queue.push_back(SpaceMouseReport::ButtonNumbers(0x1C, pressed));
    }

    /// Number of queued reports.
    #[must_use]
    pub fn pending(&self) -> usize {
        self.queue.len()
    }

    /// Whether the light is on.
    #[must_use]
    pub fn is_lit(&self) -> bool {
        self.is_lit
    }

    /// Number of times the light was switched on.
    #[must_use]
    pub fn times_lit(&self) -> u64 {
        self.lit
    }
}

impl Firmware for SpaceMouseFirmware {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let Some(bytes) = self.queue.pop_front().map(encode) else { return 0 };
        let Some(space) = report.get_mut(..bytes.len()) else { return 0 };
        space.copy_from_slice(&bytes);
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

/// Encodes an input report.
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
        SpaceMouseReport::ButtonNumbers(id, pressed) => {
            [id].into_iter().chain(pressed.into_iter().flat_map(u16::to_le_bytes)).collect()
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

    /// Bytes of all queued reports.
    fn encoded_reports(mut cap: SpaceMouseFirmware) -> Vec<Vec<u8>> {
        std::iter::from_fn(|| {
            let mut report = [0; 64];
            let length = cap.input(&mut report);
            (length > 0).then(|| report[..length].to_vec())
        })
        .collect()
    }

    #[test]
    fn encodes_the_published_layouts() {
        let mut separate = SpaceMouseFirmware::new(SpaceMouseLayout::Separate);
        separate.push([1, -2, 350], [-350, 256, 0]);
        separate.press(0b10);
        let push = [1, 1, 0, 0xFE, 0xFF, 0x5E, 0x01];
        let turn = [0xA2, 0xFE, 0x00, 0x01, 0, 0];
        let reports = encoded_reports(separate);
        assert_eq!(reports, [push.to_vec(), [&[2][..], &turn].concat(), vec![3, 2, 0]]);
        let mut combined = SpaceMouseFirmware::new(SpaceMouseLayout::Combined);
        combined.push([1, -2, 350], [-350, 256, 0]);
        assert_eq!(encoded_reports(combined), [[&push[..], &turn].concat()]);
    }

    #[test]
    fn reports_match_the_descriptor() {
        for layout in [SpaceMouseLayout::Separate, SpaceMouseLayout::Combined] {
            let mut cap = SpaceMouseFirmware::new(layout);
            let descriptor = ReportDescriptor::parse(&cap.descriptor()).unwrap();
            assert_eq!(descriptor.applications().next(), Some(Usage::new(1, 8)));
            cap.push([1, 2, 3], [4, 5, 6]);
            cap.press(1);
            for report in encoded_reports(cap) {
                let declared = descriptor.report(ReportKind::Input, report[0]).unwrap();
                assert_eq!(declared.bytes() + 1, report.len());
            }
            assert_eq!(descriptor.report(ReportKind::Output, 4).unwrap().bytes(), 1);
        }
    }

    #[test]
    fn moves_a_point_and_lights_up_while_open() {
        for layout in [SpaceMouseLayout::Separate, SpaceMouseLayout::Combined] {
            let cap = Arc::new(Mutex::new(SpaceMouseFirmware::new(layout)));
            let bus = SimulatedBus::default();
            let info = HidInfo {
                path: "simulated".into(),
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
            // Full deflection to the right, and about the vertical axis; then released.
            cap.lock().unwrap().push([350, 0, 0], [0, 0, -350]);
            let moved: Vec<_> = (0..51).map(|_| device.read(Duration::ZERO).unwrap()).collect();
            let last = moved.last().unwrap();
            // The first reading covers no time.
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
