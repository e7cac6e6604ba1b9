//! A tool on several bodies.

use crate::{ToolContact, ToolPoint};
use glam::DVec3;
use palpate_laws::ToolMove;

/// A rigid tool with its contacts during a joint advance; see [`crate::advance_bodies`].
#[derive(Debug)]
pub struct SharedTool<'a> {
    /// Index of each body that the tool may touch, with the contact. Several contacts of a tool have the same shape, friction and
    /// coupling, and none of them holds.
    pub contacts: Vec<(usize, &'a mut ToolContact)>,
    /// `path[0]` is the tool's point at the end of the previous step, `path[i]` at the end of tick i.
    pub path: &'a [ToolPoint],
}

impl SharedTool<'_> {
    /// The contact with the body `index`.
    pub(super) fn contact(&self, index: usize) -> Option<&ToolContact> {
        self.contacts.iter().find(|(body, _)| *body == index).map(|(_, contact)| &**contact)
    }

    /// The contact with the body `index`, mutable.
    pub(super) fn contact_mut(&mut self, index: usize) -> Option<&mut ToolContact> {
        self.contacts.iter_mut().find(|(body, _)| *body == index).map(|(_, contact)| &mut **contact)
    }

    /// Whether the tool acts on the body `index`. The proxy of a tool with several contacts may be held back by another body.
    pub(super) fn acts_on(&self, index: usize) -> bool {
        let acts =
            |contact: &ToolContact| if self.contacts.len() > 1 { contact.touches() } else { contact.acts() };
        self.contact(index).is_some_and(acts)
    }

    /// Position of the proxy, m; `None` if it is at the device.
    pub(super) fn proxy_m(&self) -> Option<DVec3> {
        self.contacts.iter().find_map(|(_, contact)| contact.proxy_m)
    }

    /// Sets the position of the proxy in all contacts.
    pub(super) fn set_proxy(&mut self, proxy_m: Option<DVec3>) {
        self.contacts.iter_mut().for_each(|(_, contact)| contact.proxy_m = proxy_m);
    }

    /// Motion of the tool while its device moves between the positions `device_m`.
    pub(super) fn way(&self, device_m: (DVec3, DVec3)) -> ToolMove {
        let contact = self.contacts.first().map(|(_, contact)| &**contact);
        let radius_m = contact.and_then(ToolContact::shape).map(|(shape, _)| shape.radius_m());
        let proxy_m = self.proxy_m().unwrap_or(device_m.0);
        ToolMove::new(contact.and_then(ToolContact::coupling), device_m, proxy_m, radius_m)
    }
}
