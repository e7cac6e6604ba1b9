//! The tick of the near fields of all bodies under a tool: they share the tool's proxy.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::joint_contact::JointContacts;
use crate::near_field_state::NearFieldState;
use crate::{Capacity, MAX_BODIES, NearField, Sample, Support};
use glam::DVec3;
use palpate_laws::ToolMove;

/// The states of the near fields under a tool, and the tool.
#[derive(Clone, Debug)]
pub(crate) struct NearFieldsState {
    of_body: [NearFieldState; MAX_BODIES],
    contacts: JointContacts,
    /// Position of the device at the last sample, m.
    device_m: DVec3,
    /// Position of the tool behind its coupling, m.
    proxy_m: DVec3,
    /// Force of the tool on each body, N: the mean of its impulses over the last tick.
    applied_n: [DVec3; MAX_BODIES],
    /// Force on the hand, N.
    displayed_n: DVec3,
}

/// The near fields of the bodies under a tool; empty ones are skipped.
pub(crate) type NearFields<'a> = [&'a NearField; MAX_BODIES];

impl NearFieldsState {
    pub(crate) fn with_capacity(capacity: Capacity) -> Self {
        Self {
            of_body: [capacity.near, capacity.second].map(NearFieldState::with_capacity),
            contacts: JointContacts::new(),
            device_m: DVec3::ZERO,
            proxy_m: DVec3::ZERO,
            applied_n: [DVec3::ZERO; MAX_BODIES],
            displayed_n: DVec3::ZERO,
        }
    }

    /// Resets to the model step, with `force_n` as the displayed force.
    pub(crate) fn start(&mut self, fields: NearFields<'_>, force_n: DVec3) {
        self.of_body.iter_mut().zip(fields).for_each(|(state, field)| state.start(field));
        if let Some(field) = tool_of(fields) {
            (self.device_m, self.proxy_m) = (field.start_m, field.proxy_m);
        }
        self.displayed_n = force_n;
        // Those of the body's last step, until the first tick.
        self.applied_n = fields.map(|field| match field.support {
            Support::Touched { .. } => field.contact.patches().iter().flat_map(|patch| patch.force_n).sum(),
            Support::Held | Support::Driven => -force_n,
        });
    }

    /// Force of the tool on each body, N: the mean of its impulses over the last tick.
    pub(crate) fn applied_n(&self) -> [DVec3; MAX_BODIES] {
        self.applied_n
    }

    /// Whether the contact solver failed to converge in the last tick, or dropped contacts because a buffer was full.
    pub(crate) fn is_unconverged(&self, fields: NearFields<'_>) -> bool {
        let mut states = self.of_body.iter().zip(fields).filter(|(_, field)| !field.is_empty());
        self.contacts.is_unconverged() || states.any(|(state, _)| state.is_full())
    }

    /// Number of row updates of the contact solver in the last tick.
    pub(crate) fn row_updates(&self) -> usize {
        self.contacts.row_updates()
    }

    /// Force on the hand, N.
    pub(crate) fn displayed_n(&self) -> DVec3 {
        self.displayed_n
    }

    /// Advances the states by one tick to `sample`.
    pub(crate) fn advance(&mut self, fields: NearFields<'_>, sample: &Sample) {
        let Some(tool_field) = tool_of(fields) else { return };
        let (from, to) = (self.device_m, sample.position_m);
        // The same for all fields: see `LocalModel::validate`.
        let substeps = tool_field.integrator.substeps();
        let h = tool_field.tick_s / f64::from(substeps);
        let Self { of_body, contacts, proxy_m, applied_n, .. } = self;
        *applied_n = [DVec3::ZERO; MAX_BODIES];
        let mut bodies = of_body.each_mut();
        let mut states = bodies.iter_mut().zip(fields).filter(|(_, field)| !field.is_empty());
        let tool = |device_m: (DVec3, DVec3), proxy_m: DVec3| {
            ToolMove::new(tool_field.coupling, device_m, proxy_m, tool_radius_m(tool_field))
        };
        let of_tick = tool((from, to), *proxy_m);
        let mut count = 0;
        for (state, field) in states.by_ref() {
            state.begin_tick(field, &of_tick);
            count += 1;
        }
        contacts.begin_tick(count);
        for i in 1..=substeps {
            let at = |i: u32| from + (to - from) * (f64::from(i) / f64::from(substeps));
            let device_m = (at(i - 1), at(i));
            for (state, field) in bodies.iter_mut().zip(fields).filter(|(_, field)| !field.is_empty()) {
                state.begin_step(field, device_m.1, sample, h);
            }
            let mut fields_left = fields.into_iter();
            let mut in_step = bodies.each_mut().map(|state| {
                let field = fields_left.next().filter(|field| !field.is_empty())?;
                state.in_step(field)
            });
            let is_corrected;
            (is_corrected, *proxy_m) = contacts.resolve(&mut in_step, &tool(device_m, *proxy_m), h);
            let states = bodies.iter_mut().zip(fields).zip(&mut *applied_n);
            for ((state, field), applied_n) in states.filter(|((_, field), _)| !field.is_empty()) {
                state.end_step(field, is_corrected, h);
                *applied_n += state.applied_n() / f64::from(substeps);
            }
        }
        self.device_m = to;
        let states = self.of_body.iter_mut().zip(fields).filter(|(_, field)| !field.is_empty());
        let force_n = states.map(|(state, field)| state.force_n(field, h)).reduce(|a, b| a + b);
        // The coupling limits the force on the hand, not its parts.
        let force_n = force_n.unwrap_or_default();
        self.displayed_n = tool_field.coupling.map_or(force_n, |coupling| coupling.limit(force_n));
    }

    /// Energy of all bodies in this state, J; see [`NearFieldState::energy_j`].
    pub(crate) fn energy_j(&self, fields: NearFields<'_>) -> f64 {
        let states = self.of_body.iter().zip(fields).filter(|(_, field)| !field.is_empty());
        states.map(|(state, field)| state.energy_j(field)).reduce(|a, b| a + b).unwrap_or(0.0)
    }
}

/// The first field that is not empty: all such fields have the same tool.
fn tool_of(fields: NearFields<'_>) -> Option<&NearField> {
    fields.into_iter().find(|field| !field.is_empty())
}

/// Radius of a touching tool, m; `None` for a tool that drives or holds.
fn tool_radius_m(field: &NearField) -> Option<f64> {
    match field.support {
        Support::Touched { shape, .. } => Some(shape.radius_m()),
        Support::Driven | Support::Held => None,
    }
}
