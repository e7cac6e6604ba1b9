//! How the tissue of a body is represented.

use bevy::prelude::*;

/// How the tissue of a body is represented between its nodes. [`DeformableBody`](crate::DeformableBody) requires it.
///
/// A change keeps the shape and the motion of the body.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub enum ElementFamily {
    /// A hexahedral finite element for each cell, with the law, Poisson's ratio and the relaxation of the [`Tissue`](crate::Tissue).
    #[default]
    Hexahedra,
    /// Springs between each node and its 26 neighbours. Poisson's ratio is 1/4, large strain follows the springs, and stress does not relax. A model
    /// step costs less.
    Springs,
}
