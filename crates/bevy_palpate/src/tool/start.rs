//! A tool's loop: started and stopped.

use super::components::{ContactEnd, HapticTool, ToolSettings};
use super::convergence_watch::ConvergenceWatch;
use super::force_watch::ForceWatch;
use super::results::{ForceError, TickRecording};
use super::settings::loop_settings;
use super::tool_loop::{Driver, ToolLoop};
use crate::device::HapticDevices;
use crate::fault::{DeviceFault, HapticFault, HapticFaultKind};
use crate::schedule::{LoopMode, ModelPeriod};
use bevy::platform::cell::SyncCell;
use bevy::prelude::*;
use glam::{DMat3, DVec3};
use palpate_body::ToolContact;
use palpate_haptics::{
    HapticDevice, HapticHandle, Lockstep, LoopConfig, LoopSettings, SafetySettings, haptic_loop,
};
use palpate_local::{Capacity, HandOverSettings, NearFieldCapacity};

/// Length of a tick, s.
const TICK_S: f64 = 1e-3;

/// A tool that is a tool no longer has no loop.
pub(super) fn remove_loop(removed: On<Remove, HapticTool>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<ToolLoop>();
}

/// A tool whose device was not there.
#[derive(Debug)]
pub(super) struct RetryStart {
    tool: Entity,
    /// When it is looked for again, s of real time.
    again_s: f64,
    /// What has been told.
    told: String,
}

/// Devices that may be plugged in are looked for so often, s: it may cost a frame.
const RETRY_S: f64 = 2.0;

/// Starts a loop for every new tool, another one for a tool whose device has changed, and tries again what could
/// not be started when something has changed that may help, or, on threads, when a device may have been plugged in.
pub(super) fn start_loops(
    mut commands: Commands,
    mut tools: Query<(Entity, Ref<HapticTool>, Ref<ToolSettings>, Option<&mut ToolLoop>, Has<TickRecording>)>,
    devices: Res<HapticDevices>,
    mode: Res<LoopMode>,
    period: ModelPeriod,
    (time, mut waiting): (Option<Res<Time<Real>>>, Local<Vec<RetryStart>>),
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
                    running.release(entity).map(|message| ended.write(message));
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
            fault(HapticFaultKind::Settings(error.into()));
            continue;
        }
        let started = devices.make(&tool.device).and_then(|device| {
            let description = device.describe();
            let of_device = description.safety(TICK_S);
            let shown =
                DMat3::from_cols_array_2d(&DVec3::AXES.map(|axis| device.quantized_force_n(axis).to_array()));
            let (handle, driver) = start(device, *mode, asked(of_device))?;
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
                    contact_point: None,
                    body: None,
                    contact_key: (0, 0),
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
                    refused_body: None,
                    force_watch: ForceWatch::default(),
                    convergence: ConvergenceWatch::default(),
                    compared_sizes: None,
                    description,
                    device_resolution: shown,
                    settings: *settings,
                    device_safety: of_device,
                    emergency_stops: 0,
                    dropped_events: 0,
                    recorded_to: None,
                    dropped_records: 0,
                    device: tool.device.clone(),
                });
            }
            Err(error) => {
                let may_come = error.is_about_what_is_plugged_in() && *mode == LoopMode::Threaded;
                let kind = HapticFaultKind::Device(error.into());
                let told = kind.report();
                // Once, and again when it is another one.
                if asked_anew || waited.is_none_or(|waited| waited.told != told) {
                    fault(kind);
                }
                if may_come {
                    waiting.push(RetryStart { tool: entity, again_s: now_s + RETRY_S, told });
                }
            }
        }
    }
}

/// Room for local models of any body, which a tool may meet while its loop runs: for support sets of 27 nodes, as surfaces carried
/// by cells need them, each with eight points of the surface.
const MAX_CAPACITY: Capacity = Capacity {
    order: 96,
    near: NearFieldCapacity { nodes: 27, order: 96, ring: 400, springs: 702, points: 216, triangles: 864 },
};

fn start(
    device: Box<dyn HapticDevice>,
    mode: LoopMode,
    settings: LoopSettings,
) -> Result<(HapticHandle, Driver), DeviceFault> {
    let description = device.describe();
    description.validate()?;
    let hand_over = HandOverSettings { capacity: MAX_CAPACITY, ..HandOverSettings::default() };
    let config = LoopConfig { device: description.limits(), hand_over, ..LoopConfig::default() };
    let (handle, haptic_loop) = haptic_loop(config, settings)?;
    let driver = match mode {
        LoopMode::Threaded => Driver::Thread(haptic_loop.spawn(device)?),
        LoopMode::Lockstep => Driver::Lockstep(Box::new(SyncCell::new(Lockstep::new(haptic_loop, device)?))),
    };
    Ok((handle, driver))
}
