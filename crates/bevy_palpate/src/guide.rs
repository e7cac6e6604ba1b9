//! Guide: from the first body to a driver of your own. Every program in it is compiled and run as a test.
//!
//! 1. [Concepts](concepts): full body, local model, proxy, scheme, model step, hand-over.
//! 2. [First body](first_body): a block, a tool and its force; the same in a window.
//! 3. [First device](first_device): devices by name, the frame of a device, units and signs.
//! 4. [Choosing a scheme](schemes): error, cost, and when to take which.
//! 5. [Meshes](meshes): bodies of your own meshes, and what is rejected.
//! 6. [Grasps and sutures](grasping): tools that hold, threads that pull.
//! 7. [Gravity, tables and loads](surroundings): what acts on a body beside tools.
//! 8. `avian`, with the feature of that name: rigid bodies of avian3d.
//! 9. [Tuning](tuning): model rate, nodes, coupling, friction, tissue; what costs what.
//! 10. [Safety: before you touch](safety): the safety chain, the first minutes with a motor.
//! 11. [Diagnostics and faults](diagnostics): results, severities, causes of a missing force, the black box.
//! 12. [Headless tests](headless_tests): a scene that gives the same bits in every run.
//! 13. [Writing a driver](drivers): a complete device.
//! 14. [Accuracy](accuracy): how close the force is to that of the full body, and to theory; limits.
//! 15. [Tools](tools): the command `palpate-lab`.
//! 16. [Glossary](glossary): the terms, their items and their sources.
//!
//! Programs of a guide page import `bevy::prelude::*` and [`bevy_palpate::prelude::*`](crate::prelude). Items that are not in the prelude
//! are imported by name, from `bevy_palpate` or from the crates that it re-exports, such as [`palpate_haptics`].

#[doc = include_str!("guide/concepts.md")]
pub mod concepts {}

#[doc = include_str!("guide/first_body.md")]
pub mod first_body {}

#[doc = include_str!("guide/first_device.md")]
pub mod first_device {}

#[doc = include_str!("guide/schemes.md")]
pub mod schemes {}

#[doc = include_str!("guide/meshes.md")]
pub mod meshes {}

#[doc = include_str!("guide/grasping.md")]
pub mod grasping {}

#[doc = include_str!("guide/surroundings.md")]
pub mod surroundings {}

#[cfg(feature = "avian")]
#[doc = include_str!("guide/avian.md")]
pub mod avian {}

#[doc = include_str!("guide/tuning.md")]
pub mod tuning {}

#[doc = include_str!("guide/safety.md")]
pub mod safety {}

#[doc = include_str!("guide/diagnostics.md")]
pub mod diagnostics {}

#[doc = include_str!("guide/headless_tests.md")]
pub mod headless_tests {}

#[doc = include_str!("guide/drivers.md")]
pub mod drivers {}

#[doc = include_str!("guide/accuracy.md")]
pub mod accuracy {}

#[doc = include_str!("guide/tools.md")]
pub mod tools {}

#[doc = include_str!("guide/glossary.md")]
pub mod glossary {}
