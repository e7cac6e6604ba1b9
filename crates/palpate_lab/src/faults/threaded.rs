//! The faults that need the loop's own thread.

use super::outcome::Expected;
use super::scene::{BREAKS_AT, LIMITS, TICKS, Turned, config, hand, settings, write_model};
use crate::error::LabError;
use glam::DVec3;
use palpate_haptics::{
    DeviceDescription, DeviceError, EmergencyStop, HapticDevice, HapticHandle, LoopEventKind, Reading,
    haptic_loop,
};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What a device does when it breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Break {
    /// Nothing.
    Nothing,
    /// Its read does not come back for so many milliseconds.
    Blocks(u64),
    /// It takes no force for so many milliseconds, and goes on with what it has.
    TakesNone(u64),
    /// It is unplugged for so many milliseconds.
    Unplugged(u64),
    /// Its driver panics.
    Panics,
}

/// What the app does then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum App {
    /// It goes on.
    GoesOn,
    /// Its model side panics in the middle of a local model; another begins in its place after 0.8 s.
    Panics,
    /// It goes away without stopping the loop.
    GoesAway,
}

/// A name, what must come of it, and its run.
pub(crate) type Threaded = (&'static str, Expected, Box<dyn Fn() -> Result<Turned, LabError>>);

/// What a busy machine may take besides, ms: threads are judged by the clock.
const BUSY: u64 = 150;

/// Every fault.
pub(crate) fn all() -> Vec<Threaded> {
    let scene =
        |breaks: Break, can_be_stopped: bool, app: App| -> Box<dyn Fn() -> Result<Turned, LabError>> {
            Box::new(move || run(breaks, can_be_stopped, app))
        };
    let expected = |zero_within, recovers, told| Expected { zero_within: Some(zero_within), recovers, told };
    vec![
        (
            "read_blocks_with_emergency_stop",
            expected(50 + BUSY, true, "the device was stopped"),
            scene(Break::Blocks(400), true, App::GoesOn),
        ),
        (
            "read_blocks_without_emergency_stop",
            // Until then the device's firmware has to end the force.
            expected(400 + BUSY, true, "offers no emergency stop"),
            scene(Break::Blocks(400), false, App::GoesOn),
        ),
        (
            "write_error_for_good",
            expected(50 + BUSY, true, "the device was stopped"),
            scene(Break::TakesNone(800), true, App::GoesOn),
        ),
        (
            "unplug_and_replug",
            expected(120 + BUSY, true, "the device is disconnected"),
            scene(Break::Unplugged(600), true, App::GoesOn),
        ),
        (
            "driver_panics",
            expected(BUSY, false, "the driver panicked"),
            scene(Break::Panics, true, App::GoesOn),
        ),
        (
            "model_side_panics",
            expected(300 + BUSY, true, "no new local model has come"),
            scene(Break::Nothing, true, App::Panics),
        ),
        ("app_dropped_without_stop", expected(BUSY, false, ""), scene(Break::Nothing, true, App::GoesAway)),
    ]
}

/// What a device's hand felt: ms since it was opened, and force, N.
type Felt = Arc<Mutex<Vec<(u64, DVec3)>>>;

/// A stand-in that plays the scene's hand by the clock and breaks.
struct Stand {
    began: Instant,
    breaks: Break,
    can_be_stopped: bool,
    is_plugged: bool,
    felt: Felt,
}

impl Stand {
    fn ms(&self) -> u64 {
        self.began.elapsed().as_millis() as u64
    }

    /// Whether the unplugged time is over, or has not begun.
    fn is_there(&self) -> bool {
        match self.breaks {
            Break::Unplugged(ms) => !(BREAKS_AT..BREAKS_AT + ms).contains(&self.ms()),
            _ => true,
        }
    }
}

impl HapticDevice for Stand {
    fn describe(&self) -> DeviceDescription {
        DeviceDescription {
            name: "a stand-in that breaks".into(),
            workspace_m: [DVec3::splat(-0.1), DVec3::splat(0.1)],
            max_force_n: LIMITS.force_n,
            rate_hz: 1000.0,
        }
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        if !self.is_there() {
            return Err(DeviceError::Disconnected);
        }
        self.is_plugged = true;
        Ok(())
    }

    fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
        let ms = self.ms();
        self.is_plugged &= self.is_there();
        if !self.is_plugged {
            return Err(DeviceError::Disconnected);
        }
        match self.breaks {
            Break::Blocks(blocked) if (BREAKS_AT..BREAKS_AT + 20).contains(&ms) => {
                wait(blocked);
            }
            Break::Panics if ms >= BREAKS_AT => panic!("the driver panics"),
            _ => {}
        }
        Ok(Reading::at(hand(self.ms())))
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        if matches!(self.breaks, Break::TakesNone(ms) if (BREAKS_AT..BREAKS_AT + ms).contains(&self.ms())) {
            return Err(DeviceError::TimedOut);
        }
        // An unplugged device shows nothing.
        let shown = if self.is_plugged { force_n } else { DVec3::ZERO };
        self.felt.lock().unwrap_or_else(PoisonError::into_inner).push((self.ms(), shown));
        if self.is_plugged { Ok(()) } else { Err(DeviceError::Disconnected) }
    }

    fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
        let (began, felt) = (self.began, Arc::clone(&self.felt));
        self.can_be_stopped.then(|| Box::new(Brake { began, felt }) as Box<dyn EmergencyStop>)
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// The stand-in's way to zero force beside its driver.
struct Brake {
    began: Instant,
    felt: Felt,
}

impl EmergencyStop for Brake {
    fn stop(&mut self) -> Result<(), DeviceError> {
        let ms = self.began.elapsed().as_millis() as u64;
        self.felt.lock().unwrap_or_else(PoisonError::into_inner).push((ms, DVec3::ZERO));
        Ok(())
    }
}

#[expect(clippy::disallowed_methods, reason = "what a thread does is judged by the clock")]
fn now() -> Instant {
    Instant::now()
}

#[expect(clippy::disallowed_methods, reason = "a device hangs, and a model side takes its time")]
fn wait(ms: u64) {
    std::thread::sleep(Duration::from_millis(ms));
}

fn run(breaks: Break, can_be_stopped: bool, app: App) -> Result<Turned, LabError> {
    let felt = Felt::default();
    let (handle, haptic_loop) = haptic_loop(config(), settings())?;
    let handle = Mutex::new(handle);
    let began = now();
    let device = Stand { began, breaks, can_be_stopped, is_plugged: false, felt: Arc::clone(&felt) };
    let mut thread = haptic_loop.spawn(Box::new(device))?;
    let mut turned = Turned { ticks: TICKS, ..Turned::default() };
    let ms = || began.elapsed().as_millis() as u64;
    while ms() < TICKS && thread.is_running() {
        wait(50);
        match app {
            App::GoesAway if ms() >= BREAKS_AT => break,
            App::Panics if (BREAKS_AT..BREAKS_AT + 800).contains(&ms()) => {
                if !handle.is_poisoned() {
                    panic_in_model_step(&handle);
                }
            }
            App::GoesOn | App::Panics | App::GoesAway => model_step(&mut handle_of(&handle)),
        }
        listen(&mut turned, &mut handle_of(&handle));
    }
    if app == App::GoesAway {
        drop((handle, thread));
    } else {
        thread.stop();
        listen(&mut turned, &mut handle_of(&handle));
    }
    turned.forces = std::mem::take(&mut felt.lock().unwrap_or_else(PoisonError::into_inner));
    Ok(turned)
}

/// The app's half of the loop, whatever became of who had it before.
fn handle_of(handle: &Mutex<HapticHandle>) -> MutexGuard<'_, HapticHandle> {
    handle.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The model side's thread panics while it writes a local model.
fn panic_in_model_step(handle: &Mutex<HapticHandle>) {
    let ended = std::thread::scope(|scope| {
        let side = scope.spawn(|| {
            let mut handle = handle_of(handle);
            handle.model_slot().force_n = DVec3::NAN;
            panic!("the model side panics");
        });
        side.join()
    });
    debug_assert!(ended.is_err());
}

/// A model step: a local model of the surface from the newest sample.
fn model_step(handle: &mut HapticHandle) {
    if let Some(sample) = handle.samples().newest().copied() {
        write_model(handle.model_slot(), sample.position_m, sample.sequence);
        handle.publish_model();
    }
}

/// Takes what the loop has told, and whether it has no emergency stop; a busy machine's missed deadlines are not the fault.
fn listen(turned: &mut Turned, handle: &mut HapticHandle) {
    while let Some(event) = handle.next_event() {
        match event.kind {
            LoopEventKind::DeadlinesMissed(_) | LoopEventKind::Gap(_) => {}
            kind if kind.is_fault() || kind == LoopEventKind::NoEmergencyStop => turned.tell(&kind),
            _ => {}
        }
    }
}
