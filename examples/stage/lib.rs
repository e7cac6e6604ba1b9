//! The stage of palpate's scenes: what they would otherwise all repeat. A scene brings its bodies in systems of
//! [`SetUpScene`], its hands in those of [`SetUpHands`], and a [`Stage`] that says what is to be seen; the stage opens a window, draws pictures or runs headless, gives
//! light, floor, camera and keys, and ends in time. It is part of the examples and of no library.
//!
//! | key | does |
//! | --- | --- |
//! | R | body and hand as at the start |
//! | Space | pause: the force fades, and comes back after it |
//! | S | slow motion, see [`time`](mod@time) |
//! | 1 … 6 | the scheme with which the loop makes force |
//! | M | the mouse or the scene's own hand, or the device of `--hid` |
//! | P, G, H | panel; force and contact, lattice, nothing; help |
//!
//! While a field of the panel is typed into, keys do nothing else.
//!
//! With the mouse, the left button grasps and the wheel is depth. The right mouse button turns the camera, the middle one moves it, Ctrl and the wheel bring it nearer.

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

#[cfg(feature = "panel")]
pub use caption::{Plot, plot_window};
pub use hand::{HandTime, register_hand};
pub use mesh_file::{MeshFile, MeshFileError};
pub use options::{StageOptions, folder};
pub use scene::{SceneTime, SetUpHands, SetUpScene, Stage, ToolPaint};
