//! A tool's loop: started, set and stopped.

use super::{HapticTool, TickRecording, ToolSettings};
use crate::device::{DeviceSelector, HapticDevices};
use crate::fault::{DeviceFault, HapticFault, HapticFaultKind};
use crate::schedule::{HapticClock, ModelRate};
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::platform::cell::SyncCell;
use bevy::prelude::*;
use palpate_body::{ToolContact, ToolPoint};
use palpate_haptics::{
    HapticDevice, HapticHandle, Lockstep, LoopConfig, LoopSettings, LoopThread, Stop, haptic_loop,
};

/// The running loop of a tool, and the model side's account of it. Removing it stops the loop.
#[derive(Component, Debug)]
#[component(on_remove = stop_loop)]
pub struct ToolLoop {
    pub(super) handle: HapticHandle,
    pub(super) driver: Driver,
    pub(super) contact: ToolContact,
    /// The body it touches or can touch.
    pub(super) body: Option<Entity>,
    /// Sequence number of the sample up to which the body has been moved.
    pub(super) consumed: Option<u64>,
    /// The path since then: where it began and one point for each tick.
    pub(super) path: Vec<ToolPoint>,
    /// A local model waits to be published.
    pub(super) built: bool,
    /// The body that was refused to it, so that it is said once.
    pub(super) refused_body: Option<Entity>,
    /// Settings that were refused, so that it is said once.
    refused_settings: Option<ToolSettings>,
    device: DeviceSelector,
    pub(super) said_ended: bool,
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
                Stop::Joined(_) | Stop::AlreadyStopped => None,
                Stop::Panicked => Some(HapticFaultKind::LoopEnded),
                Stop::Detached => Some(HapticFaultKind::LoopDetached),
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
}

/// A device that does not let its loop end must not go unnoticed.
fn stop_loop(mut world: DeferredWorld, HookContext { entity, .. }: HookContext) {
    let Some(mut tool) = world.get_mut::<ToolLoop>(entity) else { return };
    if let Some(kind) = tool.driver.stop()
        && let Some(mut faults) = world.get_resource_mut::<Messages<HapticFault>>()
    {
        faults.write(HapticFault { entity: Some(entity), kind });
    }
}

/// A tool that is a tool no longer has no loop.
pub(super) fn remove_loop(removed: On<Remove, HapticTool>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<ToolLoop>();
}

/// Starts a loop for every new tool, and another one for a tool whose device has changed.
pub(super) fn start_loops(
    mut commands: Commands,
    mut tools: Query<(Entity, &HapticTool, &ToolSettings, Option<&mut ToolLoop>), Changed<HapticTool>>,
    devices: Res<HapticDevices>,
    clock: Res<HapticClock>,
    rate: Res<ModelRate>,
    mut faults: MessageWriter<HapticFault>,
) {
    for (entity, tool, settings, running) in &mut tools {
        let contact = match ToolContact::touch(tool.radius_m) {
            Ok(contact) => contact,
            Err(error) => {
                faults.write(HapticFault { entity: Some(entity), kind: HapticFaultKind::Tool(error) });
                continue;
            }
        };
        if let Some(mut running) = running {
            if running.device == tool.device {
                if !matches!(running.contact, ToolContact::Touch { radius_m, .. } if radius_m == tool.radius_m)
                {
                    running.contact = contact;
                }
                continue;
            }
            // The old loop ends before its device is asked for again.
            if let Some(kind) = running.driver.stop() {
                faults.write(HapticFault { entity: Some(entity), kind });
            }
            commands.entity(entity).remove::<ToolLoop>();
        }
        let started = devices
            .make(&tool.device)
            .and_then(|device| start(device, *clock, loop_settings(settings, *rate, None, false, false)));
        match started {
            Ok((handle, driver)) => {
                let device = tool.device.clone();
                commands.entity(entity).insert(ToolLoop {
                    handle,
                    driver,
                    contact,
                    body: None,
                    consumed: None,
                    path: Vec::with_capacity(256),
                    built: false,
                    refused_body: None,
                    refused_settings: None,
                    device,
                    said_ended: false,
                });
            }
            Err(error) => {
                faults.write(HapticFault { entity: Some(entity), kind: HapticFaultKind::Device(error) });
            }
        }
    }
}

fn start(
    device: Box<dyn HapticDevice>,
    clock: HapticClock,
    settings: LoopSettings,
) -> Result<(HapticHandle, Driver), DeviceFault> {
    let description = device.describe();
    description.validate()?;
    let config = LoopConfig { device_limit_n: description.max_force_n, ..LoopConfig::default() };
    let (handle, haptic_loop) = haptic_loop(config, settings)?;
    let driver = match clock {
        HapticClock::Thread => Driver::Thread(haptic_loop.spawn(device)?),
        HapticClock::Lockstep => {
            Driver::Lockstep(Box::new(SyncCell::new(Lockstep::new(haptic_loop, device)?)))
        }
    };
    Ok((handle, driver))
}

/// Sets every loop to what its tool's components and the app ask for.
pub(super) fn set_loops(
    mut tools: Query<(Entity, &ToolSettings, &mut ToolLoop, Has<TickRecording>)>,
    bodies: Query<&crate::body::SimulatedBody>,
    time: Res<Time<Virtual>>,
    rate: Res<ModelRate>,
    mut faults: MessageWriter<HapticFault>,
) {
    for (entity, settings, mut tool, record) in &mut tools {
        let body = tool.body.and_then(|body| Some((body.to_bits(), bodies.get(body).ok()?.epoch())));
        let asked = loop_settings(settings, *rate, body, time.is_paused(), record);
        if asked == *tool.handle.settings() || tool.refused_settings == Some(*settings) {
            continue;
        }
        tool.refused_settings = None;
        if let Err(error) = tool.handle.set(asked) {
            tool.refused_settings = Some(*settings);
            faults.write(HapticFault { entity: Some(entity), kind: HapticFaultKind::Settings(error) });
        }
    }
}

fn loop_settings(
    tool: &ToolSettings,
    rate: ModelRate,
    body: Option<(u64, u64)>,
    paused: bool,
    record: bool,
) -> LoopSettings {
    let ToolSettings { frame, safety, velocity } = *tool;
    LoopSettings { frame, safety, velocity, model_period_s: rate.period_s(), body, paused, record }
}
