//! The running loop of a tool, with its state on the model side.

use super::components::{ContactEnd, GraspEnd, GraspedPoint, ToolSettings};
use super::convergence_watch::ConvergenceWatch;
use super::force_watch::ForceWatch;
use super::results::{
    ContactState, ForceError, LocalModelStats, TickRecording, ToolContactPoint, ToolForce, TouchedBody,
};
use super::second_contact::SecondContact;
use crate::device::DeviceSelector;
use crate::fault::{FaultLimits, HapticFault, HapticFaultKind};
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::platform::cell::SyncCell;
use bevy::prelude::*;
use glam::{DMat3, DVec3};
use palpate_body::{ToolContact, ToolPoint, ToolShape};
use palpate_haptics::{
    DeviceDescription, FollowedTool, HapticDevice, HapticHandle, Lockstep, LoopEventKind, LoopReport,
    LoopThread, SafetySettings, StopOutcome,
};

/// The running loop of a tool, with its state on the model side. Removing the component stops the loop.
#[derive(Component, Debug)]
#[component(on_remove = stop_loop)]
pub struct ToolLoop {
    pub(crate) handle: HapticHandle,
    pub(super) driver: Driver,
    pub(crate) contact: ToolContact,
    /// The same contact before it touches or holds a point.
    pub(super) untouched: ToolContact,
    /// Whether the grasp button was pressed at the last model step.
    pub(super) was_pressed: bool,
    /// Contact with the body after the last model step.
    pub(super) contact_point: Option<ToolContactPoint>,
    /// The body that the tool touches or can touch.
    pub(crate) body: Option<Entity>,
    /// [`SimulatedBody::contact_key`](crate::SimulatedBody) of the body to which the contact belongs.
    pub(super) contact_key: (u64, u64),
    /// A second body that the tool can touch at the same time.
    pub(crate) second: Option<SecondContact>,
    /// Slot in which the loop publishes its force for other loops.
    pub(super) slot: Option<usize>,
    /// The other tool whose force the newest local model follows.
    pub(super) followed: Option<FollowedTool>,
    /// Whether bodies beyond the second have been reported.
    pub(super) reported_left_out: bool,
    /// Sequence number of the sample up to which the body has been stepped.
    pub(crate) consumed: Option<u64>,
    /// Path of the last model step: the start and one point for each tick.
    pub(crate) path: Vec<ToolPoint>,
    /// Support set of the last local model, in the node numbers of the body at that time.
    pub(super) support: Vec<usize>,
    /// Whether the last local model had a support set, which may be empty.
    pub(super) has_support: bool,
    /// Whether contact beyond the support set has been reported.
    pub(super) reported_beyond_support: bool,
    /// Force of the full body at each tick of the last model step, N.
    pub(crate) full_forces_n: Vec<DVec3>,
    /// Difference between these forces and those of the loop.
    pub(super) error: ForceError,
    /// Poses at the last two model steps.
    pub(super) poses: Option<[Pose; 2]>,
    /// Whether a local model waits to be published.
    pub(super) built: bool,
    /// Whether the app was paused since the last model step.
    pub(super) was_paused: bool,
    /// The entity without a body that has been reported.
    pub(super) rejected_body: Option<Entity>,
    /// Whether a parent whose transform cannot be inverted has been reported.
    pub(super) reported_parent: bool,
    /// Time without a rendered force, and its cause.
    pub(super) force_watch: ForceWatch,
    /// Ticks of the last second at which the loop's contact solver did not converge.
    pub(super) convergence: ConvergenceWatch,
    /// The body, its shape and the tool's shape whose sizes have been compared.
    pub(super) compared_sizes: Option<ComparedSizes>,
    /// Description of the device at the start of the loop.
    pub(super) description: DeviceDescription,
    /// The force that the device can render for a unit force along each axis, device frame.
    pub(super) device_resolution: DMat3,
    /// The newest valid settings.
    pub(crate) settings: ToolSettings,
    /// The safety chain's settings that follow from the device's description.
    pub(crate) device_safety: SafetySettings,
    /// Number of emergency stops by the watchdog that have been reported.
    pub(super) emergency_stops: u64,
    /// Number of dropped events that have been reported.
    pub(super) dropped_events: u64,
    /// Sequence number of the newest recorded sample.
    pub(super) recorded_to: Option<u64>,
    /// Number of dropped records that have been added to the recording.
    pub(super) dropped_records: u64,
    pub(crate) device: DeviceSelector,
}

/// Runner of a loop.
pub(super) enum Driver {
    Thread(LoopThread),
    Lockstep(Box<SyncCell<Lockstep<dyn HapticDevice>>>),
    Stopped,
}

impl Driver {
    /// Stops the loop with zero force; returns the fault of a thread that panicked or did not stop.
    pub(super) fn stop(&mut self) -> Option<HapticFaultKind> {
        match std::mem::replace(self, Self::Stopped) {
            Self::Thread(mut thread) => match thread.stop() {
                StopOutcome::Joined | StopOutcome::AlreadyStopped => None,
                StopOutcome::Panicked => Some(HapticFaultKind::LoopEnded),
                StopOutcome::Detached => Some(HapticFaultKind::LoopDetached),
            },
            // Dropping it writes zero force and closes the device.
            Self::Lockstep(_) | Self::Stopped => None,
        }
    }
}

impl std::fmt::Debug for Driver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Thread(_) => "Thread",
            Self::Lockstep(_) => "Lockstep",
            Self::Stopped => "Stopped",
        })
    }
}

impl ToolLoop {
    /// Returns the body that the tool touches or can touch.
    #[must_use]
    pub fn body(&self) -> Option<Entity> {
        self.body
    }

    /// Returns the contact of the tool with that body.
    #[must_use]
    pub fn contact(&self) -> &ToolContact {
        &self.contact
    }

    /// Returns the second body that the tool touches or can touch, with the contact; `None` if only one is within its reach.
    #[must_use]
    pub fn second(&self) -> Option<(Entity, &ToolContact)> {
        self.second.as_ref().map(|second| (second.body, &second.contact))
    }

    /// Returns all bodies that the tool touches or can touch, with the contacts.
    pub fn contacts(&self) -> impl Iterator<Item = (Entity, &ToolContact)> {
        self.body.map(|body| (body, &self.contact)).into_iter().chain(self.second())
    }

    /// Whether the tool touches or holds a point of a body.
    pub(super) fn is_in_contact(&self) -> bool {
        self.is_in_contact_with_first() || self.second.as_ref().is_some_and(SecondContact::is_touched)
    }

    /// Whether the tool touches or holds a point of [`Self::body`].
    pub(super) fn is_in_contact_with_first(&self) -> bool {
        !self.contact.touched().is_empty() || self.contact.held_point().is_some()
    }

    /// Exchanges the first and the second body.
    pub(super) fn exchange_bodies(&mut self) {
        let (Some(first), Some(second)) = (&mut self.body, &mut self.second) else { return };
        std::mem::swap(first, &mut second.body);
        std::mem::swap(&mut self.contact, &mut second.contact);
        std::mem::swap(&mut self.contact_key, &mut second.contact_key);
        std::mem::swap(&mut self.support, &mut second.support);
        std::mem::swap(&mut self.has_support, &mut second.has_support);
        std::mem::swap(&mut self.reported_beyond_support, &mut second.reported_beyond_support);
    }

    /// Ends the contact with the second body, which the tool no longer can touch; returns the message to be written if there was a
    /// contact.
    #[must_use]
    pub(super) fn drop_second(&mut self, tool: Entity) -> Option<ContactEnd> {
        let second = self.second.take()?;
        second.is_touched().then_some(ContactEnd { tool, body: second.body })
    }

    /// Returns the support set of the newest local model, as node numbers of the body; empty for a scheme without one.
    #[must_use]
    pub fn support(&self) -> &[usize] {
        if self.has_support { &self.support } else { &[] }
    }

    /// Returns the support set on the second body; empty without one.
    #[must_use]
    pub fn second_support(&self) -> &[usize] {
        self.second.as_ref().filter(|second| second.has_support).map_or(&[], |second| &second.support)
    }

    /// Returns the settings of the safety chain: those of the device with [`ToolSettings::safety`].
    #[must_use]
    pub fn safety(&self) -> SafetySettings {
        self.settings.safety.apply_to(self.device_safety)
    }

    /// Returns the loop's newest report: counters and histograms since its start.
    pub fn report(&mut self) -> &LoopReport {
        self.handle.report()
    }

    /// Ends the contacts with both bodies, and resets them to the state of a tool that has just been started; returns the messages to be
    /// written.
    pub(super) fn reset_contacts(&mut self, tool: Entity) -> impl Iterator<Item = ContactEnd> + use<> {
        let ends = [self.reset_first(tool), self.reset_second(tool)];
        ends.into_iter().flatten()
    }

    /// Ends the contact with the first body, and resets it; returns the message to be written if there was a contact.
    #[must_use]
    pub(super) fn reset_first(&mut self, tool: Entity) -> Option<ContactEnd> {
        let end = self.release_first(tool);
        self.contact = self.untouched.clone();
        end
    }

    /// Ends the contact with the second body, and resets it; returns the message to be written if there was a contact.
    #[must_use]
    pub(super) fn reset_second(&mut self, tool: Entity) -> Option<ContactEnd> {
        let second = self.second.as_mut()?;
        let touched = second.is_touched();
        *second = SecondContact {
            contact_key: second.contact_key,
            ..SecondContact::new(second.body, &self.untouched)
        };
        touched.then_some(ContactEnd { tool, body: second.body })
    }

    /// Ends the contacts with both bodies; returns the messages to be written.
    pub(super) fn release(&mut self, tool: Entity) -> impl Iterator<Item = ContactEnd> + use<> {
        let ends = [self.release_first(tool), self.reset_second(tool)];
        ends.into_iter().flatten()
    }

    /// Ends the contact with the first body; returns the message to be written if there was one.
    #[must_use]
    fn release_first(&mut self, tool: Entity) -> Option<ContactEnd> {
        self.has_support = false;
        let held = self.contact.held_point().is_some();
        if held {
            self.contact = self.untouched.clone();
        }
        let touched = self.contact.release();
        self.contact_point = None;
        self.body.filter(|_| touched || held).map(|body| ContactEnd { tool, body })
    }
}

impl ToolLoop {
    pub(super) fn contact_state(&self) -> ContactState {
        if self.body.is_none() {
            ContactState::NoBody
        } else if self.contact.held_point().is_some() {
            ContactState::Holding
        } else if self.is_in_contact() {
            ContactState::Touching
        } else if self.contact.is_clear() {
            ContactState::Clear
        } else {
            ContactState::Inside
        }
    }

    /// Returns the vector from the device to the proxy at the last model step, m, world frame.
    #[must_use]
    pub fn proxy_offset_m(&self) -> DVec3 {
        self.poses.map_or(DVec3::ZERO, |[_, last]| last.proxy_offset_m)
    }
}

/// Pose of a tool at a model step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    /// Sequence number of the sample.
    pub(super) sequence: u64,
    /// Vector from the device to the proxy, m, world frame.
    pub(super) proxy_offset_m: DVec3,
}

/// A body, the number of its shape and a tool's shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ComparedSizes {
    pub(super) body: Entity,
    pub(super) shape: u64,
    pub(super) tool: ToolShape,
}

impl ToolLoop {
    /// Reads the loop's events, passes the faults among them to `fault`, and logs recoveries of `tool`.
    pub(super) fn take_faults(&mut self, tool: Entity, fault: &mut impl FnMut(HapticFaultKind)) {
        while let Some(event) = self.handle.next_event() {
            match event.kind {
                kind if kind.is_fault() => fault(HapticFaultKind::Loop(kind)),
                LoopEventKind::RealTime(_)
                | LoopEventKind::NoEmergencyStop
                | LoopEventKind::Reconnected
                | LoopEventKind::DeviceRecovered(_) => info!("{tool}: {}", event.kind),
                _ => {}
            }
        }
        // A loop that hangs writes no event.
        if let Driver::Thread(thread) = &self.driver {
            let stops = thread.emergency_stops();
            if std::mem::replace(&mut self.emergency_stops, stops) < stops {
                fault(HapticFaultKind::EmergencyStopped);
            }
        }
        let dropped = self.handle.report().dropped_events;
        if dropped > self.dropped_events {
            self.dropped_events = dropped;
            fault(HapticFaultKind::EventsDropped { dropped });
        }
    }

    /// Adds new samples and records to `recording`.
    pub(super) fn record(&mut self, recording: &mut TickRecording) {
        let samples = self.handle.samples();
        if let (Some(newest), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) {
            let first = self.recorded_to.map_or(oldest, |last| oldest.max(last + 1));
            self.recorded_to = Some(newest.sequence);
            recording.samples.extend((first..=newest.sequence).filter_map(|sequence| samples.get(sequence)));
        }
        recording.records.extend(std::iter::from_fn(|| self.handle.next_record()));
        let dropped = self.handle.report().dropped_records;
        recording.dropped += dropped - std::mem::replace(&mut self.dropped_records, dropped);
        recording.discard_old();
    }
}

/// Stops the loop when the component is removed: resets the results, ends contact and grasp, and reports the last faults and ticks.
fn stop_loop(mut world: DeferredWorld, HookContext { entity, .. }: HookContext) {
    let Some(mut tool) = world.get_mut::<ToolLoop>(entity) else { return };
    let (fault, contact_ends) = (tool.driver.stop(), tool.release(entity));
    // Events and ticks between the last poll and the stop.
    let (mut kinds, mut rest) = (Vec::from_iter(fault), TickRecording::default());
    tool.take_faults(entity, &mut |kind| kinds.push(kind));
    tool.record(&mut rest);
    if let Some(mut recording) = world.get_mut::<TickRecording>(entity) {
        recording.samples.append(&mut rest.samples);
        recording.records.append(&mut rest.records);
        recording.dropped += rest.dropped;
    }
    let now_s = world.get_resource::<Time<Real>>().map_or(0.0, Time::elapsed_secs_f64);
    let faults = world.get_resource_mut::<FaultLimits>().map(|mut limits| {
        let limited = kinds.into_iter().filter_map(|kind| limits.limit(Some(entity), kind, now_s));
        limited.collect::<Vec<_>>()
    });
    if let (Some(faults), Some(mut messages)) = (faults, world.get_resource_mut::<Messages<HapticFault>>()) {
        messages.write_batch(faults);
    }
    if let Some(mut messages) = world.get_resource_mut::<Messages<ContactEnd>>() {
        messages.write_batch(contact_ends);
    }
    if let Some(mut force) = world.get_mut::<ToolForce>(entity) {
        *force = ToolForce::default();
    }
    if let Some(mut touching) = world.get_mut::<TouchedBody>(entity) {
        *touching = TouchedBody::default();
    }
    if let Some(mut grasped) = world.get_mut::<GraspedPoint>(entity)
        && let Some(body) = std::mem::take(&mut *grasped).body
        && let Some(mut messages) = world.get_resource_mut::<Messages<GraspEnd>>()
    {
        messages.write(GraspEnd { tool: entity, body });
    }
    if let Some(mut newest) = world.get_mut::<LocalModelStats>(entity) {
        *newest = LocalModelStats::default();
    }
    if let Some(mut error) = world.get_mut::<ForceError>(entity) {
        *error = ForceError::default();
    }
}
