//! The plugin's own instruments over a scene: the one place where they are added.

use bevy::prelude::*;

/// Adds what the features bring.
pub(crate) fn add(_app: &mut App) {}
