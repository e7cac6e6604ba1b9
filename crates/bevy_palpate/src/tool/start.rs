//! Starts the loops of tools.

use super::components::{ContactEnd, HapticTool, ToolSettings};
use super::convergence_watch::ConvergenceWatch;
use super::force_slots::{ForceSlots, UsedSlots};
use super::force_watch::ForceWatch;
use super::results::{ForceError, TickRecording};
use super::settings::loop_settings;
use super::tool_loop::{Driver, ToolLoop};
use super::trajectories::Trajectories;
use crate::device::HapticDevices;
use crate::fault::{DeviceFault, FaultWriter, HapticFaultKind};
use crate::model_time::{LoopMode, ModelPeriod};
use bevy::platform::cell::SyncCell;
use bevy::prelude::*;
use glam::{DMat3, DVec3};
use palpate_body::ToolContact;
use palpate_haptics::{
    ForceBoard, HapticDevice, HapticHandle, Lockstep, LoopConfig, LoopSettings, SafetySettings, haptic_loop,
};
use palpate_local::{Capacity, HandOverSettings, NearFieldCapacity};
use std::sync::Arc;

/// Length of a tick, s.
const TICK_S: f64 = 1e-3;

/// Stops the loop when [`HapticTool`] is removed.
pub(super) fn remove_loop(removed: On<Remove, HapticTool>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<ToolLoop>();
}

/// A tool whose device is not connected, or whose trajectory is not loaded.
#[derive(Debug)]
pub(super) struct RetryStart {
    tool: Entity,
    /// Time of the first attempt, s of real time.
    since_s: f64,
    /// Time of the next attempt, s of real time.
    again_s: f64,
    /// The reported fault; empty if there is none.
    reported: String,
}

/// Time between two attempts to find a device that is not connected, s. An attempt may take as long as a frame.
const RETRY_S: f64 = 2.0;

/// Time after which a trajectory that is not loaded is a fault, s.
const MAX_LOAD_S: f64 = 5.0;

/// Starts a loop for every new tool, and another one for a tool whose device or trajectory has changed. Retries a failed start when
/// settings or registered devices have changed, when its trajectory is loaded or, on threads, when a device may have been connected.
pub(super) fn start_loops(
    mut commands: Commands,
    mut tools: Query<(Entity, Ref<HapticTool>, Ref<ToolSettings>, Option<&mut ToolLoop>, Has<TickRecording>)>,
    (devices, mut trajectories, mut slots): (Res<HapticDevices>, Trajectories, ResMut<ForceSlots>),
    mode: Res<LoopMode>,
    period: ModelPeriod,
    (time, mut waiting): (Option<Res<Time<Real>>>, Local<Vec<RetryStart>>),
    (mut ends, mut faults): (MessageWriter<ContactEnd>, FaultWriter),
) {
    let now_s = time.map_or(0.0, |time| time.elapsed_secs_f64());
    let mut used = UsedSlots::default();
    tools.iter().filter_map(|(.., running, _)| running?.slot).for_each(|slot| used.add(slot));
    trajectories.update();
    waiting.retain(|waiting| tools.get(waiting.tool).is_ok_and(|(.., running, _)| running.is_none()));
    for (entity, tool, settings, running, record) in &mut tools {
        let is_modified = trajectories.is_modified(&tool.device);
        let may_start = running.is_none()
            && (settings.is_changed() || devices.is_changed() || trajectories.is_added(&tool.device));
        let is_changed = tool.is_changed() || may_start || is_modified;
        let retry = waiting.iter().position(|waiting| waiting.tool == entity);
        let is_due = retry.is_some_and(|i| waiting[i].again_s <= now_s);
        if !(is_changed || is_due) {
            continue;
        }
        let retry = retry.map(|i| waiting.swap_remove(i));
        let mut fault = |kind| {
            faults.write(entity, kind);
        };
        let contact = match tool.contact() {
            Ok(contact) => contact.with_identity(entity.to_bits()),
            Err(error) => {
                fault(HapticFaultKind::Tool(error));
                continue;
            }
        };
        if let Some(mut running) = running {
            if running.device == tool.device && !is_modified {
                let is_same =
                    |a: &ToolContact, b: &ToolContact| (a.shape(), a.coupling()) == (b.shape(), b.coupling());
                if !is_same(&running.untouched, &contact) {
                    ends.write_batch(running.release(entity));
                    running.untouched = contact.clone();
                    running.contact = contact;
                    // The next selection of bodies finds it again.
                    running.second = None;
                }
                continue;
            }
            // The old loop ends before its device is opened again.
            running.driver.stop().map(&mut fault);
            commands.entity(entity).remove::<ToolLoop>();
        }
        let settings_for = |safety| LoopSettings { record, ..loop_settings(&settings, safety, period.s()) };
        if let Err(error) = settings_for(SafetySettings::default()).validate() {
            fault(HapticFaultKind::Settings(error.into()));
            continue;
        }
        let since_s = retry.as_ref().filter(|_| !is_changed).map_or(now_s, |retry| retry.since_s);
        let is_ready = trajectories.is_ready(&tool.device);
        if matches!(is_ready, Ok(false)) && now_s - since_s < MAX_LOAD_S {
            waiting.push(RetryStart { tool: entity, since_s, again_s: now_s, reported: String::new() });
            continue;
        }
        let device = is_ready.and_then(|_| devices.make(&tool.device, trajectories.assets()));
        let started = device.and_then(|device| {
            let description = device.describe();
            let device_safety = description.safety(TICK_S);
            let device_resolution = DMat3::from_cols_array_2d(
                &DVec3::AXES.map(|axis| device.displayable_force_n(axis).to_array()),
            );
            let place = slots.place(used).map(|(board, slot)| (board, slot, entity.to_bits()));
            let slot = place.as_ref().map(|(_, slot, _)| *slot);
            let (handle, driver) = start(device, *mode, settings_for(device_safety), place)?;
            slot.into_iter().for_each(|slot| used.add(slot));
            Ok((slot, handle, driver, device_safety, description, device_resolution))
        });
        match started {
            Ok((slot, handle, driver, device_safety, description, device_resolution)) => {
                commands.entity(entity).try_insert(ToolLoop {
                    handle,
                    driver,
                    untouched: contact.clone(),
                    contact,
                    was_pressed: false,
                    contact_point: None,
                    body: None,
                    contact_key: (0, 0),
                    second: None,
                    reported_left_out: false,
                    slot,
                    followed: None,
                    consumed: None,
                    path: Vec::with_capacity(256),
                    support: Vec::new(),
                    has_support: false,
                    reported_beyond_support: false,
                    full_forces_n: Vec::with_capacity(256),
                    error: ForceError::default(),
                    poses: None,
                    built: false,
                    was_paused: false,
                    rejected_body: None,
                    reported_parent: false,
                    force_watch: ForceWatch::default(),
                    convergence: ConvergenceWatch::default(),
                    compared_sizes: None,
                    description,
                    device_resolution,
                    settings: *settings,
                    device_safety,
                    emergency_stops: 0,
                    dropped_events: 0,
                    recorded_to: None,
                    dropped_records: 0,
                    device: tool.device.clone(),
                });
            }
            Err(error) => {
                let may_connect = error.depends_on_connected_devices() && *mode == LoopMode::Threaded;
                // A trajectory is checked in every frame, because it may still fail to load.
                let may_load = matches!(error, DeviceFault::TrajectoryNotLoaded { .. });
                let kind = HapticFaultKind::Device(error.into());
                let reported = kind.report();
                // Reported once, and again if another fault takes its place.
                if is_changed || retry.is_none_or(|retry| retry.reported != reported) {
                    fault(kind);
                }
                if may_connect || may_load {
                    let again_s = if may_load { now_s } else { now_s + RETRY_S };
                    waiting.push(RetryStart { tool: entity, since_s, again_s, reported });
                }
            }
        }
    }
}

/// Capacity for the local models of any two bodies that a tool may touch while its loop runs.
const MAX_CAPACITY: Capacity = Capacity { order: 192, near: OF_BODY, second: OF_BODY };

/// Capacity for a body: for support sets of 64 nodes, as surfaces embedded in cells need them under a large tool, and ten points of the
/// surface for each.
const OF_BODY: NearFieldCapacity = NearFieldCapacity {
    nodes: 64,
    order: 192,
    ring: 950,
    springs: 1664,
    hexahedra: 512,
    domains: 2048,
    domain_nodes: 12_288,
    points: 640,
    triangles: 1280,
};

fn start(
    device: Box<dyn HapticDevice>,
    mode: LoopMode,
    settings: LoopSettings,
    place: Option<(Arc<ForceBoard>, usize, u64)>,
) -> Result<(HapticHandle, Driver), DeviceFault> {
    let description = device.describe();
    description.validate()?;
    let hand_over = HandOverSettings { capacity: MAX_CAPACITY, ..HandOverSettings::default() };
    let config = LoopConfig { device: description.limits(), hand_over, ..LoopConfig::default() };
    let (handle, mut haptic_loop) = haptic_loop(config, settings)?;
    if let Some((board, slot, tool)) = place {
        haptic_loop.connect(board, slot, tool);
    }
    let driver = match mode {
        LoopMode::Threaded => Driver::Thread(haptic_loop.spawn(device)?),
        LoopMode::Lockstep => Driver::Lockstep(Box::new(SyncCell::new(Lockstep::new(haptic_loop, device)?))),
    };
    Ok((handle, driver))
}
