//! Faults that need the loop's own thread.

use super::outcome::Expected;
use super::scene::{FAULT_TICK, LIMITS, SceneRun, TICKS, config, hand_m, settings, write_model};
use crate::error::LabError;
use glam::DVec3;
use palpate_haptics::{
    DeviceDescription, DeviceError, EmergencyStop, HapticDevice, HapticHandle, LoopEventKind, Reading,
    haptic_loop,
};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Fault of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DeviceFault {
    /// No fault.
    None,
    /// A read blocks for this time, ms.
    ReadBlocks(u64),
    /// Writes fail for this time, ms; the device keeps its force.
    WriteFails(u64),
    /// The device is unplugged for this time, ms.
    Unplugged(u64),
    /// The driver panics.
    DriverPanics,
}

/// Fault of the app.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AppFault {
    /// No fault.
    None,
    /// The model side panics while it writes a local model; another replaces it after 0.8 s.
    ModelSidePanics,
    /// The app drops the loop without stopping it.
    Drops,
}

/// Name, expected outcome and run of a fault.
pub(crate) type ThreadedFault = (&'static str, Expected, Scenario);

/// Run of a fault, on any thread.
type Scenario = Box<dyn Fn() -> Result<SceneRun, LabError> + Send + Sync>;

/// Additional time allowed on a busy machine, ms: threads run in wall-clock time.
const BUSY: u64 = 150;

/// All faults on a thread.
pub(crate) fn all() -> Vec<ThreadedFault> {
    let scene = |fault: DeviceFault, can_be_stopped: bool, app: AppFault| -> Scenario {
        Box::new(move || run(fault, can_be_stopped, app))
    };
    let expected = |zero_within, recovers, reports: Option<fn(&LoopEventKind) -> bool>| Expected {
        zero_within: Some(zero_within),
        recovers,
        reports,
    };
    vec![
        (
            "read_blocks_with_emergency_stop",
            expected(50 + BUSY, true, Some(|event| *event == LoopEventKind::EmergencyStopped)),
            scene(DeviceFault::ReadBlocks(400), true, AppFault::None),
        ),
        (
            "read_blocks_without_emergency_stop",
            // Until then only the device's firmware can end the force.
            expected(400 + BUSY, true, Some(|event| *event == LoopEventKind::NoEmergencyStop)),
            scene(DeviceFault::ReadBlocks(400), false, AppFault::None),
        ),
        (
            "write_error_for_good",
            expected(50 + BUSY, true, Some(|event| *event == LoopEventKind::EmergencyStopped)),
            scene(DeviceFault::WriteFails(800), true, AppFault::None),
        ),
        (
            "unplug_and_replug",
            expected(
                120 + BUSY,
                true,
                Some(|event| *event == LoopEventKind::DeviceFailed(DeviceError::Disconnected)),
            ),
            scene(DeviceFault::Unplugged(600), true, AppFault::None),
        ),
        (
            "driver_panics",
            expected(BUSY, false, Some(|event| *event == LoopEventKind::Panicked)),
            scene(DeviceFault::DriverPanics, true, AppFault::None),
        ),
        (
            "model_side_panics",
            expected(300 + BUSY, true, Some(|event| matches!(event, LoopEventKind::ModelStale(_)))),
            scene(DeviceFault::None, true, AppFault::ModelSidePanics),
        ),
        (
            "app_dropped_without_stop",
            expected(BUSY, false, None),
            scene(DeviceFault::None, true, AppFault::Drops),
        ),
    ]
}

/// Forces of a device: ms since the start, and force, N.
type Forces = Arc<Mutex<Vec<(u64, DVec3)>>>;

/// Simulated device that moves with the scene's hand in wall-clock time and has a fault.
struct FaultyDevice {
    start: Instant,
    fault: DeviceFault,
    can_be_stopped: bool,
    is_plugged: bool,
    forces: Forces,
}

impl FaultyDevice {
    fn ms(&self) -> u64 {
        self.start.elapsed().as_millis() as u64
    }

    /// Whether the device is plugged in now.
    fn is_present(&self) -> bool {
        match self.fault {
            DeviceFault::Unplugged(ms) => !(FAULT_TICK..FAULT_TICK + ms).contains(&self.ms()),
            _ => true,
        }
    }
}

impl HapticDevice for FaultyDevice {
    fn describe(&self) -> DeviceDescription {
        DeviceDescription {
            name: "a faulty device".into(),
            workspace_m: [DVec3::splat(-0.1), DVec3::splat(0.1)],
            max_force_n: LIMITS.force_n,
            rate_hz: 1000.0,
        }
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        if !self.is_present() {
            return Err(DeviceError::Disconnected);
        }
        self.is_plugged = true;
        Ok(())
    }

    fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
        let ms = self.ms();
        self.is_plugged &= self.is_present();
        if !self.is_plugged {
            return Err(DeviceError::Disconnected);
        }
        match self.fault {
            DeviceFault::ReadBlocks(blocked) if (FAULT_TICK..FAULT_TICK + 20).contains(&ms) => {
                wait(blocked);
            }
            DeviceFault::DriverPanics if ms >= FAULT_TICK => panic!("injected panic of the driver"),
            _ => {}
        }
        Ok(Reading::at(hand_m(self.ms())))
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        if matches!(self.fault, DeviceFault::WriteFails(ms) if (FAULT_TICK..FAULT_TICK + ms).contains(&self.ms()))
        {
            return Err(DeviceError::TimedOut);
        }
        // An unplugged device exerts no force.
        let shown = if self.is_plugged { force_n } else { DVec3::ZERO };
        self.forces.lock().unwrap_or_else(PoisonError::into_inner).push((self.ms(), shown));
        if self.is_plugged { Ok(()) } else { Err(DeviceError::Disconnected) }
    }

    fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
        let (start, forces) = (self.start, Arc::clone(&self.forces));
        self.can_be_stopped.then(|| Box::new(DirectStop { start, forces }) as Box<dyn EmergencyStop>)
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// Emergency stop of the simulated device.
struct DirectStop {
    start: Instant,
    forces: Forces,
}

impl EmergencyStop for DirectStop {
    fn stop(&mut self) -> Result<(), DeviceError> {
        let ms = self.start.elapsed().as_millis() as u64;
        self.forces.lock().unwrap_or_else(PoisonError::into_inner).push((ms, DVec3::ZERO));
        Ok(())
    }
}

#[expect(clippy::disallowed_methods, reason = "threads run in wall-clock time")]
fn now() -> Instant {
    Instant::now()
}

#[expect(clippy::disallowed_methods, reason = "a device hangs, and the model side has a period")]
fn wait(ms: u64) {
    std::thread::sleep(Duration::from_millis(ms));
}

fn run(fault: DeviceFault, can_be_stopped: bool, app: AppFault) -> Result<SceneRun, LabError> {
    let forces = Forces::default();
    let (handle, haptic_loop) = haptic_loop(config(), settings())?;
    let handle = Mutex::new(handle);
    let start = now();
    let device =
        FaultyDevice { start, fault, can_be_stopped, is_plugged: false, forces: Arc::clone(&forces) };
    let mut thread = haptic_loop.spawn(Box::new(device))?;
    let mut scene_run = SceneRun { ticks: TICKS, ..SceneRun::default() };
    let ms = || start.elapsed().as_millis() as u64;
    while ms() < TICKS && thread.is_running() {
        wait(50);
        match app {
            AppFault::Drops if ms() >= FAULT_TICK => break,
            AppFault::ModelSidePanics if (FAULT_TICK..FAULT_TICK + 800).contains(&ms()) => {
                if !handle.is_poisoned() {
                    panic_in_model_step(&handle);
                }
            }
            AppFault::None | AppFault::ModelSidePanics | AppFault::Drops => model_step(&mut lock(&handle)),
        }
        read_events(&mut scene_run, &mut lock(&handle));
    }
    if app == AppFault::Drops {
        drop((handle, thread));
    } else {
        thread.stop();
        read_events(&mut scene_run, &mut lock(&handle));
    }
    scene_run.forces = std::mem::take(&mut forces.lock().unwrap_or_else(PoisonError::into_inner));
    Ok(scene_run)
}

/// The app's side of the loop, even after a thread that held it has panicked.
fn lock(handle: &Mutex<HapticHandle>) -> MutexGuard<'_, HapticHandle> {
    handle.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Lets a thread of the model side panic while it writes a local model.
fn panic_in_model_step(handle: &Mutex<HapticHandle>) {
    let result = std::thread::scope(|scope| {
        let side = scope.spawn(|| {
            let mut handle = lock(handle);
            handle.model_slot().force_n = DVec3::NAN;
            panic!("injected panic of the model side");
        });
        side.join()
    });
    debug_assert!(result.is_err());
}

/// Model step: publishes a local model of the surface at the newest sample.
fn model_step(handle: &mut HapticHandle) {
    if let Some(sample) = handle.samples().newest().copied() {
        write_model(handle.model_slot(), sample.position_m, sample.sequence);
        handle.publish_model();
    }
}

/// Reads the queued events: faults and the lack of an emergency stop. Missed deadlines are left out; they are faults of the machine.
fn read_events(run: &mut SceneRun, handle: &mut HapticHandle) {
    while let Some(event) = handle.next_event() {
        match event.kind {
            LoopEventKind::DeadlinesMissed(_) | LoopEventKind::Gap(_) => {}
            kind if kind.is_fault() || kind == LoopEventKind::NoEmergencyStop => run.events.push(kind),
            _ => {}
        }
    }
}
