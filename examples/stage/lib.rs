//! The stage of palpate's scenes: the code that they share. A scene spawns its bodies in systems of [`SetUpScene`] and its tools in those
//! of [`SetUpHands`], and describes its view with [`Stage`]. The stage opens a window, draws pictures or runs headless, adds light, floor,
//! camera and keys, and exits in time. It belongs to the examples, not to a library.
//!
//! | key | action |
//! | --- | --- |
//! | R | restarts the scene |
//! | Space | pauses: the force fades, and resumes afterwards |
//! | S | slow motion ([`time`](mod@time)) |
//! | 1 … 6 | scheme by which the loop renders force |
//! | M | mouse, or the scene's own device or the device of `--hid` |
//! | P, G, H | panel; gizmos; help |
//!
//! The keys have no effect while a text field of the panel has the keyboard.
//!
//! With the mouse, the left button grasps and the wheel changes the depth. The right button rotates the camera, the middle one moves it,
//! Ctrl and the wheel zoom.

mod assets;
#[cfg(feature = "panel")]
mod caption;
mod device;
#[cfg(feature = "window")]
mod display;
mod hand;
#[cfg(feature = "window")]
mod instruments;
#[cfg(feature = "window")]
mod keys;
mod mesh_file;
mod options;
#[cfg(feature = "window")]
mod picture;
mod progress;
mod scene;
pub mod time;
#[cfg(feature = "window")]
mod view;
mod volume_file;

#[cfg(feature = "panel")]
pub use caption::{Plot, plot_window};
pub use hand::{HandTime, register_hand};
pub use mesh_file::{MeshFile, MeshFileError};
pub use options::{StageOptions, folder};
pub use scene::{SceneTime, SetUpHands, SetUpScene, Stage, ToolPaint, exit_on_error};
pub use volume_file::VolumeFile;
