//! Whether contact gets the compliance that the grid lacks.

use super::shape::DeformableBody;
use super::simulated::SimulatedBody;
use bevy::prelude::*;

/// What gives way where a tool touches a body: put it beside [`DeformableBody`] to compare with the paper's
/// scheme. A body without this component is as with the default.
///
/// It may be changed while the body is touched, and acts from the next frame on. The force then jumps, within the limits of the
/// safety chain.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone, Hash)]
pub enum ContactCompliance {
    /// The grid, and the compliance that it lacks below the size of a cell: a small tool feels the tissue, wherever in a cell it
    /// touches. The default.
    #[default]
    Added,
    /// The grid alone, as in the paper: a tool smaller than a cell feels a force that is too large and depends on where in the
    /// cell it touches.
    GridOnly,
}

/// Sets the compliance of every body: also of one that is new, and of one whose component was removed.
pub(super) fn set_compliance(
    mut bodies: Query<(&mut SimulatedBody, Option<&ContactCompliance>), With<DeformableBody>>,
) {
    for (mut simulated, asked) in &mut bodies {
        let adds = asked.copied().unwrap_or_default() == ContactCompliance::Added;
        // A flag, and nothing else of the body.
        simulated.bypass_change_detection().body.add_compliance(adds);
    }
}
