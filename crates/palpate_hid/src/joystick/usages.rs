//! HID usages of a force-feedback joystick.
//!
//! Source: *Device Class Definition for Physical Interface Devices (PID)*, version 1.0, USB Implementers' Forum, chapter 4, and
//! *HID Usage Tables*, pages 1, 9, 0x0A and 0x0F.

use crate::Usage;

/// A usage with its name in the usage tables.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Named {
    pub(crate) usage: Usage,
    pub(crate) name: &'static str,
}

const fn named(page: u16, id: u16, name: &'static str) -> Named {
    Named { usage: Usage::new(page, id), name }
}

const fn pid(id: u16, name: &'static str) -> Named {
    named(0x0F, id, name)
}

pub(crate) const JOYSTICK: Named = named(1, 0x04, "Joystick");
pub(crate) const GAME_PAD: Named = named(1, 0x05, "Game Pad");
pub(crate) const X: Named = named(1, 0x30, "X");
pub(crate) const Y: Named = named(1, 0x31, "Y");
/// The page of buttons; the number is that of the button, from 1.
pub(crate) const BUTTONS: u16 = 9;
/// The first of several fields of the same meaning.
pub(crate) const FIRST_INSTANCE: Usage = Usage::new(0x0A, 1);

pub(crate) const SET_EFFECT: Named = pid(0x21, "Set Effect Report");
pub(crate) const INDEX: Named = pid(0x22, "Effect Block Index");
pub(crate) const ET_CONSTANT: Named = pid(0x26, "ET Constant Force");
pub(crate) const DURATION: Named = pid(0x50, "Duration");
pub(crate) const GAIN: Named = pid(0x52, "Gain");
pub(crate) const TRIGGER_BUTTON: Named = pid(0x53, "Trigger Button");
pub(crate) const AXES_ENABLE: Named = pid(0x55, "Axes Enable");
pub(crate) const DIRECTION_ENABLE: Named = pid(0x56, "Direction Enable");
pub(crate) const DIRECTION: Named = pid(0x57, "Direction");

pub(crate) const SET_CONSTANT_FORCE: Named = pid(0x73, "Set Constant Force Report");
pub(crate) const MAGNITUDE: Named = pid(0x70, "Magnitude");

pub(crate) const OPERATION_REPORT: Named = pid(0x77, "Effect Operation Report");
pub(crate) const OP_START: Named = pid(0x79, "Op Effect Start");
#[cfg(feature = "simulated")]
pub(crate) const OP_START_SOLO: Named = pid(0x7A, "Op Effect Start Solo");
pub(crate) const OP_STOP: Named = pid(0x7B, "Op Effect Stop");
pub(crate) const LOOP_COUNT: Named = pid(0x7C, "Loop Count");

pub(crate) const GAIN_REPORT: Named = pid(0x7D, "Device Gain Report");
pub(crate) const DEVICE_GAIN: Named = pid(0x7E, "Device Gain");

pub(crate) const POOL_REPORT: Named = pid(0x7F, "PID Pool Report");
pub(crate) const MAX_EFFECTS: Named = pid(0x83, "Simultaneous Effects Max");
pub(crate) const DEVICE_MANAGED: Named = pid(0xA9, "Device Managed Pool");

pub(crate) const CREATE_EFFECT: Named = pid(0xAB, "Create New Effect Report");
pub(crate) const BLOCK_LOAD: Named = pid(0x89, "PID Block Load Report");
pub(crate) const LOAD_SUCCESS: Named = pid(0x8C, "Block Load Success");
pub(crate) const LOAD_FULL: Named = pid(0x8D, "Block Load Full");
pub(crate) const LOAD_ERROR: Named = pid(0x8E, "Block Load Error");
pub(crate) const BLOCK_FREE: Named = pid(0x90, "PID Block Free Report");

pub(crate) const CONTROL: Named = pid(0x96, "PID Device Control");
pub(crate) const ENABLE_ACTUATORS: Named = pid(0x97, "DC Enable Actuators");
pub(crate) const DISABLE_ACTUATORS: Named = pid(0x98, "DC Disable Actuators");
pub(crate) const STOP_ALL: Named = pid(0x99, "DC Stop All Effects");
pub(crate) const RESET: Named = pid(0x9A, "DC Device Reset");
#[cfg(feature = "simulated")]
pub(crate) const PAUSE: Named = pid(0x9B, "DC Device Pause");
pub(crate) const CONTINUE: Named = pid(0x9C, "DC Device Continue");
