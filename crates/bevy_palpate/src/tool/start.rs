//! A tool's loop: started and stopped.

use super::convergence::ConvergenceWatch;
use super::no_force::ForceWatch;
use super::results::Pose;
use super::settings::loop_settings;
use super::size::ComparedSizes;
use super::{
    ContactEnd, ForceError, GraspedPoint, HapticTool, LocalModelStats, TickRecording, ToolForce,
    ToolSettings, TouchedBody,
};
use crate::device::{DeviceSelector, HapticDevices};
use crate::fault::{DeviceFault, HapticFault, HapticFaultKind};
use crate::schedule::{LoopMode, ModelPeriod};
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::platform::cell::SyncCell;
use bevy::prelude::*;
use glam::{DMat3, DVec3};
use palpate_body::{ToolContact, ToolPoint};
use palpate_haptics::{
    DeviceDescription, HapticDevice, HapticHandle, Lockstep, LoopConfig, LoopReport, LoopSettings,
    LoopThread, SafetySettings, StopOutcome, haptic_loop,
};
use palpate_local::{Capacity, HandOverSettings, NearFieldCapacity};

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
    /// The body it touches or can touch.
    pub(crate) body: Option<Entity>,
    /// The shape and place of that body to which the contact belongs.
    pub(super) touched_as: (u64, u64),
    /// Sequence number of the sample up to which the body has been moved.
    pub(crate) consumed: Option<u64>,
    /// The path since then: where it began and one point for each tick.
    pub(crate) path: Vec<ToolPoint>,
    /// The support set of the last local model, of the body's shape of then.
    pub(super) support: Vec<usize>,
    /// Whether there was one: nothing within reach is a support set too.
    pub(super) has_support: bool,
    /// It has been said that the tool touched beyond that.
    pub(super) was_beyond: bool,
    /// What the full body displayed over the last model step, tick by tick, N.
    pub(crate) full_n: Vec<DVec3>,
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
    pub(super) shown: DMat3,
    /// The newest settings that make sense.
    pub(crate) settings: ToolSettings,
    /// The safety chain's settings that follow from the device's description.
    pub(crate) of_device: SafetySettings,
    /// How often the device has been stopped by the watchdog, as far as that has been said.
    pub(super) emergency_stops: u64,
    /// Events lost, as far as that has been said.
    pub(super) dropped_events: u64,
    /// Sequence number of the newest sample that has been recorded, and records lost so far.
    pub(super) recorded_to: Option<u64>,
    pub(super) dropped_records: u64,
    pub(crate) device: DeviceSelector,
}

/// Length of a tick, s.
const TICK_S: f64 = 1e-3;

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
    pub(super) fn forget_contact(&mut self, tool: Entity) -> Option<ContactEnd> {
        let ended = self.let_go(tool);
        self.contact = self.untouched.clone();
        ended
    }

    /// Lets go of what is touched or held; the message to be written if something was.
    #[must_use]
    pub(super) fn let_go(&mut self, tool: Entity) -> Option<ContactEnd> {
        self.has_support = false;
        let held = self.contact.held_point().is_some();
        if held {
            self.contact = self.untouched.clone();
        }
        let touched = self.contact.release();
        self.body.filter(|_| touched || held).map(|body| ContactEnd { tool, body })
    }
}

/// What a loop leaves behind: zero force, no contact, and a word about a device that did not let it end.
fn stop_loop(mut world: DeferredWorld, HookContext { entity, .. }: HookContext) {
    let Some(mut tool) = world.get_mut::<ToolLoop>(entity) else { return };
    let (fault, ended) = (tool.driver.stop(), tool.let_go(entity));
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
    if let Some(mut grasping) = world.get_mut::<GraspedPoint>(entity) {
        *grasping = GraspedPoint::default();
    }
    if let Some(mut newest) = world.get_mut::<LocalModelStats>(entity) {
        *newest = LocalModelStats::default();
    }
    if let Some(mut error) = world.get_mut::<ForceError>(entity) {
        *error = ForceError::default();
    }
}

/// A tool that is a tool no longer has no loop.
pub(super) fn remove_loop(removed: On<Remove, HapticTool>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<ToolLoop>();
}

/// A tool whose device was not there.
#[derive(Debug)]
pub(super) struct Waiting {
    tool: Entity,
    /// When it is looked for again, s of real time.
    again_s: f64,
    /// What has been told.
    told: String,
}

/// Devices that may be plugged in are looked for so often, s: it may cost a frame.
const LOOK_S: f64 = 2.0;

/// Starts a loop for every new tool, another one for a tool whose device has changed, and tries again what could
/// not be started when something has changed that may help, or, on threads, when a device may have been plugged in.
pub(super) fn start_loops(
    mut commands: Commands,
    mut tools: Query<(Entity, Ref<HapticTool>, Ref<ToolSettings>, Option<&mut ToolLoop>, Has<TickRecording>)>,
    devices: Res<HapticDevices>,
    clock: Res<LoopMode>,
    period: ModelPeriod,
    (time, mut waiting): (Option<Res<Time<Real>>>, Local<Vec<Waiting>>),
    (mut ended, mut faults): (MessageWriter<ContactEnd>, MessageWriter<HapticFault>),
) {
    let now_s = time.map_or(0.0, |time| time.elapsed_secs_f64());
    waiting.retain(|waiting| tools.get(waiting.tool).is_ok_and(|(.., running, _)| running.is_none()));
    for (entity, tool, settings, running, record) in &mut tools {
        let helped = running.is_none() && (settings.is_changed() || devices.is_changed());
        let asked_anew = tool.is_changed() || helped;
        let waited = waiting.iter().position(|waiting| waiting.tool == entity);
        let is_due = waited.is_some_and(|i| waiting[i].again_s <= now_s);
        if !(asked_anew || is_due) {
            continue;
        }
        let waited = waited.map(|i| waiting.swap_remove(i));
        let mut fault = |kind| {
            faults.write(HapticFault { entity: Some(entity), kind });
        };
        let contact = match tool.contact() {
            Ok(contact) => contact,
            Err(error) => {
                fault(HapticFaultKind::Tool(error));
                continue;
            }
        };
        if let Some(mut running) = running {
            if running.device == tool.device {
                let is_same =
                    |a: &ToolContact, b: &ToolContact| (a.shape(), a.coupling()) == (b.shape(), b.coupling());
                if !is_same(&running.untouched, &contact) {
                    running.let_go(entity).map(|message| ended.write(message));
                    running.untouched = contact.clone();
                    running.contact = contact;
                }
                continue;
            }
            // The old loop ends before its device is asked for again.
            running.driver.stop().map(&mut fault);
            commands.entity(entity).remove::<ToolLoop>();
        }
        let asked = |of_device| LoopSettings { record, ..loop_settings(&settings, of_device, period.s()) };
        if let Err(error) = asked(SafetySettings::default()).validate() {
            fault(HapticFaultKind::Settings(error));
            continue;
        }
        let started = devices.make(&tool.device).and_then(|device| {
            let description = device.describe();
            let of_device = description.safety(TICK_S);
            let shown =
                DMat3::from_cols_array_2d(&DVec3::AXES.map(|axis| device.quantized_force_n(axis).to_array()));
            let (handle, driver) = start(device, *clock, asked(of_device))?;
            Ok((handle, driver, of_device, description, shown))
        });
        match started {
            Ok((handle, driver, of_device, description, shown)) => {
                commands.entity(entity).try_insert(ToolLoop {
                    handle,
                    driver,
                    untouched: contact.clone(),
                    contact,
                    was_pressed: false,
                    body: None,
                    touched_as: (0, 0),
                    consumed: None,
                    path: Vec::with_capacity(256),
                    support: Vec::new(),
                    has_support: false,
                    was_beyond: false,
                    full_n: Vec::with_capacity(256),
                    error: ForceError::default(),
                    poses: None,
                    built: false,
                    was_paused: false,
                    refused_body: None,
                    force_watch: ForceWatch::default(),
                    convergence: ConvergenceWatch::default(),
                    compared_sizes: None,
                    description,
                    shown,
                    settings: *settings,
                    of_device,
                    emergency_stops: 0,
                    dropped_events: 0,
                    recorded_to: None,
                    dropped_records: 0,
                    device: tool.device.clone(),
                });
            }
            Err(error) => {
                let may_come = error.is_about_what_is_plugged_in() && *clock == LoopMode::Thread;
                let kind = HapticFaultKind::Device(error);
                let told = kind.report();
                // Once, and again when it is another one.
                if asked_anew || waited.is_none_or(|waited| waited.told != told) {
                    fault(kind);
                }
                if may_come {
                    waiting.push(Waiting { tool: entity, again_s: now_s + LOOK_S, told });
                }
            }
        }
    }
}

/// Room for local models of any body, which a tool may meet while its loop runs: for support sets of 27 nodes, as surfaces carried
/// by cells need them, each with eight points of the surface.
const ROOM: Capacity = Capacity {
    order: 96,
    near: NearFieldCapacity { nodes: 27, order: 96, ring: 400, springs: 702, points: 216, triangles: 864 },
};

fn start(
    device: Box<dyn HapticDevice>,
    clock: LoopMode,
    settings: LoopSettings,
) -> Result<(HapticHandle, Driver), DeviceFault> {
    let description = device.describe();
    description.validate()?;
    let hand_over = HandOverSettings { capacity: ROOM, ..HandOverSettings::default() };
    let config = LoopConfig { device: description.limits(), hand_over, ..LoopConfig::default() };
    let (handle, haptic_loop) = haptic_loop(config, settings)?;
    let driver = match clock {
        LoopMode::Thread => Driver::Thread(haptic_loop.spawn(device)?),
        LoopMode::Lockstep => Driver::Lockstep(Box::new(SyncCell::new(Lockstep::new(haptic_loop, device)?))),
    };
    Ok((handle, driver))
}
