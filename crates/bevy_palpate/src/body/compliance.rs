//! Added compliance of contacts.

use super::shape::DeformableBody;
use super::simulated::SimulatedBody;
use bevy::prelude::*;

/// Compliance of the contact between a tool and a body.
///
/// Insert the component on the entity with [`DeformableBody`]; without it the default applies. A change during contact takes effect in the
/// next frame and makes the force jump, within the limits of the safety chain.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone, Hash)]
pub enum ContactCompliance {
    /// The lattice's compliance plus the compliance that it lacks below the size of a cell. The force on a small tool is that of the
    /// tissue, independent of the place within the cell. The default.
    #[default]
    Added,
    /// The lattice's compliance alone, as in the seed paper. The force on a tool smaller than a cell is too large and depends on the place
    /// within the cell.
    GridOnly,
}

/// Sets the compliance of every body, including new ones and those whose component was removed.
pub(super) fn set_compliance(
    mut bodies: Query<(&mut SimulatedBody, Option<&ContactCompliance>), With<DeformableBody>>,
) {
    for (mut simulated, compliance) in &mut bodies {
        let adds = compliance.copied().unwrap_or_default() == ContactCompliance::Added;
        // Sets a flag that does not count as a change of the body.
        simulated.bypass_change_detection().body.add_compliance(adds);
    }
}
