//! Meshes of GLB and glTF files beside Bevy's loader of them, in headless apps with loops in lock step.

mod loaders;
mod scenes;
