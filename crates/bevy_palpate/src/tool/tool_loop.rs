//! The running loop of a tool, and what the model side keeps of it.

use super::components::{ContactEnd, GraspEnd, GraspedPoint, ToolSettings};
use super::convergence_watch::ConvergenceWatch;
use super::force_watch::ForceWatch;
use super::results::{
    ContactState, ForceError, LocalModelStats, TickRecording, ToolContactPoint, ToolForce, TouchedBody,
};
use crate::device::DeviceSelector;
use crate::fault::{HapticFault, HapticFaultKind};
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::platform::cell::SyncCell;
use bevy::prelude::*;
use glam::{DMat3, DVec3};
use palpate_body::{ToolContact, ToolPoint, ToolShape};
use palpate_haptics::{
    DeviceDescription, HapticDevice, HapticHandle, Lockstep, LoopEventKind, LoopReport, LoopThread,
    SafetySettings, StopOutcome,
};

/// The running loop of a tool, and the model side's account of it. Removing it stops the loop.
#[derive(Component, Debug)]
#[component(on_remove = stop_loop)]
pub struct ToolLoop {
    pub(crate) handle: HapticHandle,
    pub(super) driver: Driver,
    pub(crate) contact: ToolContact,
    /// The same contact before it touches or holds anything.
    pub(super) untouched: ToolContact,
    /// The button that grasps was pressed when it was last looked at.
    pub(super) was_pressed: bool,
    /// The contact with that body after the last model step.
    pub(super) contact_point: Option<ToolContactPoint>,
    /// The body it touches or can touch.
    pub(crate) body: Option<Entity>,
    /// The shape and place of that body to which the contact belongs.
    pub(super) contact_key: (u64, u64),
    /// Sequence number of the sample up to which the body has been moved.
    pub(crate) consumed: Option<u64>,
    /// The path since then: where it began and one point for each tick.
    pub(crate) path: Vec<ToolPoint>,
    /// The support set of the last local model, of the body's shape of then.
    pub(super) support: Vec<usize>,
    /// Whether there was one: nothing within reach is a support set too.
    pub(super) has_support: bool,
    /// It has been said that the tool touched beyond that.
    pub(super) reported_beyond_support: bool,
    /// What the full body displayed over the last model step, tick by tick, N.
    pub(crate) full_forces_n: Vec<DVec3>,
    /// How far the loop was from that.
    pub(super) error: ForceError,
    /// Where the tool was at the last two model steps.
    pub(super) poses: Option<[Pose; 2]>,
    /// A local model waits to be published.
    pub(super) built: bool,
    /// There has been a pause since the last model step.
    pub(super) was_paused: bool,
    /// The entity that was refused to it as a body, so that it is said once.
    pub(super) refused_body: Option<Entity>,
    /// Why no force is rendered, if none is.
    pub(super) force_watch: ForceWatch,
    /// Ticks of the last second at which the loop's contact solver did not converge.
    pub(super) convergence: ConvergenceWatch,
    /// The body, its shape and the tool's shape whose sizes have been compared.
    pub(super) compared_sizes: Option<ComparedSizes>,
    /// Description of the device at the start of the loop.
    pub(super) description: DeviceDescription,
    /// The force that the device can show of a unit force along each axis, its own frame.
    pub(super) device_resolution: DMat3,
    /// The newest settings that make sense.
    pub(crate) settings: ToolSettings,
    /// The safety chain's settings that follow from the device's description.
    pub(crate) device_safety: SafetySettings,
    /// How often the device has been stopped by the watchdog, as far as that has been said.
    pub(super) emergency_stops: u64,
    /// Events lost, as far as that has been said.
    pub(super) dropped_events: u64,
    /// Sequence number of the newest sample that has been recorded, and records lost so far.
    pub(super) recorded_to: Option<u64>,
    pub(super) dropped_records: u64,
    pub(crate) device: DeviceSelector,
}

/// What makes the loop tick.
pub(super) enum Driver {
    Thread(LoopThread),
    Lockstep(Box<SyncCell<Lockstep<dyn HapticDevice>>>),
    Stopped,
}

impl Driver {
    /// Ends the loop with zero force; what did not go well is a fault.
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
    /// The body that the tool touches or can touch.
    #[must_use]
    pub fn body(&self) -> Option<Entity> {
        self.body
    }

    /// How the tool acts on that body now.
    #[must_use]
    pub fn contact(&self) -> &ToolContact {
        &self.contact
    }

    /// Whether it touches or holds something.
    pub(super) fn is_in_contact(&self) -> bool {
        !self.contact.touched().is_empty() || self.contact.held_point().is_some()
    }

    /// The support set of its newest local model, as the body numbers its nodes; empty for a scheme that has none.
    #[must_use]
    pub fn support(&self) -> &[usize] {
        if self.has_support { &self.support } else { &[] }
    }

    /// The loop's newest account of itself: counters and histograms since its start.
    pub fn report(&mut self) -> &LoopReport {
        self.handle.report()
    }

    /// Lets go, and begins again as a tool that has just met its body; the message to be written if something was touched or held.
    #[must_use]
    pub(super) fn reset_contact(&mut self, tool: Entity) -> Option<ContactEnd> {
        let ended = self.release(tool);
        self.contact = self.untouched.clone();
        ended
    }

    /// Lets go of what is touched or held; the message to be written if something was.
    #[must_use]
    pub(super) fn release(&mut self, tool: Entity) -> Option<ContactEnd> {
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
        } else if !self.contact.touched().is_empty() {
            ContactState::Touching
        } else if self.contact.is_clear() {
            ContactState::Clear
        } else {
            ContactState::Inside
        }
    }

    /// From the device to the tool behind its coupling, m, at the last model step. The tool's [`Transform`] is where the tool is.
    #[must_use]
    pub fn proxy_offset_m(&self) -> DVec3 {
        self.poses.map_or(DVec3::ZERO, |[_, last]| last.proxy_offset_m)
    }
}

/// Where a tool was at a model step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    /// The sample's number.
    pub(super) sequence: u64,
    /// From the device to the tool behind its coupling, m.
    pub(super) proxy_offset_m: DVec3,
}

/// A body, its shape ([`SimulatedBody::shape`]) and a tool's shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ComparedSizes {
    pub(super) body: Entity,
    pub(super) shape: u64,
    pub(super) tool: ToolShape,
}

impl ToolLoop {
    /// Takes the events there are and gives the faults among them to `fault`.
    pub(super) fn take_faults(&mut self, fault: &mut impl FnMut(HapticFaultKind)) {
        while let Some(event) = self.handle.next_event() {
            if event.kind.is_fault() {
                fault(HapticFaultKind::Loop(event.kind));
            } else if let LoopEventKind::RealTime(_) | LoopEventKind::NoEmergencyStop = event.kind {
                info!("haptic loop: {}", event.kind);
            }
        }
        // A loop that hangs cannot tell.
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

    /// Adds to `recording` what it has not got yet.
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
        recording.forget();
    }
}

/// What a loop leaves behind: zero force, no contact, and a word about a device that did not let it end.
fn stop_loop(mut world: DeferredWorld, HookContext { entity, .. }: HookContext) {
    let Some(mut tool) = world.get_mut::<ToolLoop>(entity) else { return };
    let (fault, ended) = (tool.driver.stop(), tool.release(entity));
    // Its last words, and its last ticks.
    let (mut kinds, mut rest) = (Vec::from_iter(fault), TickRecording::default());
    tool.take_faults(&mut |kind| kinds.push(kind));
    tool.record(&mut rest);
    if let Some(mut recording) = world.get_mut::<TickRecording>(entity) {
        recording.samples.append(&mut rest.samples);
        recording.records.append(&mut rest.records);
        recording.dropped += rest.dropped;
    }
    if let Some(mut faults) = world.get_resource_mut::<Messages<HapticFault>>() {
        faults.write_batch(kinds.into_iter().map(|kind| HapticFault { entity: Some(entity), kind }));
    }
    if let (Some(ended), Some(mut messages)) = (ended, world.get_resource_mut::<Messages<ContactEnd>>()) {
        messages.write(ended);
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
