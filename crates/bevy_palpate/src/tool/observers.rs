//! Triggers the observers of the messages about contacts, grasps and faults.

use super::components::{ContactEnd, ContactStart, GraspEnd, GraspStart};
use crate::fault::HapticFault;
use bevy::prelude::*;

/// Triggers the observers of all messages of the frame: grasp ends, contact ends, contact starts, grasp starts, faults.
pub(super) fn trigger_observers(
    mut commands: Commands,
    (mut grasp_ends, mut contact_ends): (MessageReader<GraspEnd>, MessageReader<ContactEnd>),
    (mut contact_starts, mut grasp_starts): (MessageReader<ContactStart>, MessageReader<GraspStart>),
    mut faults: MessageReader<HapticFault>,
) {
    grasp_ends.read().for_each(|event| commands.trigger(*event));
    contact_ends.read().for_each(|event| commands.trigger(*event));
    contact_starts.read().for_each(|event| commands.trigger(*event));
    grasp_starts.read().for_each(|event| commands.trigger(*event));
    faults.read().for_each(|fault| commands.trigger(fault.clone()));
}
