//! Simulated HID devices in memory: for tests of drivers, and for an app on a machine without the device. Feature `simulated`.

mod board;
mod bus;
mod firmware;
mod joystick;
mod space_mouse;

pub use board::BoardFirmware;
pub use bus::SimulatedBus;
pub use firmware::Firmware;
pub use joystick::{JoystickFirmware, SimulatedStick};
pub use space_mouse::{SpaceMouseFirmware, SpaceMouseLayout};
