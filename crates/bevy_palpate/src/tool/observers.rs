//! Triggers the observers of the messages about contacts, grasps and faults.

use super::components::{ContactEnd, ContactStart, GraspEnd, GraspStart};
use crate::fault::HapticFault;
use bevy::prelude::*;

/// Triggers the observers of every message of the frame: ends before starts.
pub(super) fn trigger_observers(
    mut commands: Commands,
    (mut grasps_ended, mut contacts_ended): (MessageReader<GraspEnd>, MessageReader<ContactEnd>),
    (mut contacts_started, mut grasps_started): (MessageReader<ContactStart>, MessageReader<GraspStart>),
    mut faults: MessageReader<HapticFault>,
) {
    grasps_ended.read().for_each(|event| commands.trigger(*event));
    contacts_ended.read().for_each(|event| commands.trigger(*event));
    contacts_started.read().for_each(|event| commands.trigger(*event));
    grasps_started.read().for_each(|event| commands.trigger(*event));
    faults.read().for_each(|fault| commands.trigger(fault.clone()));
}
