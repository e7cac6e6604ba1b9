//! The second body that a tool can touch.

use bevy::prelude::*;
use palpate_body::ToolContact;

/// The second body that a tool can touch, with the contact. The tool is one rigid body: both contacts have the same proxy.
#[derive(Debug)]
pub(crate) struct SecondContact {
    pub(crate) body: Entity,
    pub(crate) contact: ToolContact,
    /// [`SimulatedBody::contact_key`](crate::SimulatedBody) of the body to which the contact belongs.
    pub(super) contact_key: (u64, u64),
    /// Support set of the body in the last local model, in the node numbers of the body at that time.
    pub(super) support: Vec<usize>,
    /// Whether the last local model had this body with a support set.
    pub(super) has_support: bool,
    /// Whether contact beyond the support set has been reported.
    pub(super) reported_beyond_support: bool,
}

impl SecondContact {
    /// A second body that the tool does not touch yet; `untouched` is the tool's contact with nothing.
    pub(super) fn new(body: Entity, untouched: &ToolContact) -> Self {
        Self {
            body,
            contact: untouched.clone(),
            contact_key: (0, 0),
            support: Vec::new(),
            has_support: false,
            reported_beyond_support: false,
        }
    }

    /// Whether the tool touches the body.
    pub(super) fn is_touched(&self) -> bool {
        !self.contact.touched().is_empty()
    }
}
