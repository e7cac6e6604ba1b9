//! Faults in lock step.

use super::outcome::Expected;
use super::scene::{FAULT_TICK, PERIOD, Scene, hand_m, settings};
use glam::DVec3;
use palpate_haptics::{DeviceError, LoopEventKind, LoopSettings, Reading};

/// Name, expected outcome and scene of a fault.
pub(crate) type InjectedFault = (&'static str, Expected, Scene);

/// Test for the event that reports a fault.
type EventTest = fn(&LoopEventKind) -> bool;

/// The force continues.
const fn bridged(reports: Option<EventTest>) -> Expected {
    Expected { zero_within: None, recovers: true, reports }
}

/// Zero force within `within` ticks; the second touch has its force.
const fn fades(within: u64, reports: Option<EventTest>) -> Expected {
    Expected { zero_within: Some(within), recovers: true, reports }
}

/// Zero force within `within` ticks until the end.
const fn ends(within: u64, reports: Option<EventTest>) -> Expected {
    Expected { zero_within: Some(within), recovers: false, reports }
}

fn is_faulty(tick: u64, ticks: u64) -> bool {
    (FAULT_TICK..FAULT_TICK.saturating_add(ticks)).contains(&tick)
}

/// Scene whose device fails to read with `error` for `ticks` ticks.
fn read_fails(ticks: u64, error: DeviceError) -> Scene {
    Scene {
        read: Box::new(move |tick, reading| if is_faulty(tick, ticks) { Err(error) } else { Ok(reading) }),
        ..Scene::default()
    }
}

/// Scene whose readings are changed for `ticks` ticks.
fn readings_changed(ticks: u64, change: impl Fn(u64, Reading) -> Reading + 'static) -> Scene {
    Scene {
        read: Box::new(move |tick, reading| {
            Ok(if is_faulty(tick, ticks) { change(tick, reading) } else { reading })
        }),
        ..Scene::default()
    }
}

/// Scene whose device fails to write with `error` for `ticks` ticks.
fn write_fails(ticks: u64, error: DeviceError) -> Scene {
    Scene {
        write: Box::new(move |tick| if is_faulty(tick, ticks) { Err(error) } else { Ok(()) }),
        ..Scene::default()
    }
}

/// Intact reading of `tick` with its sequence number.
fn numbered(tick: u64) -> Reading {
    Reading { sequence: Some(tick), ..Reading::at(hand_m(tick)) }
}

/// Tick number with each pair of ticks swapped.
fn swapped(tick: u64) -> u64 {
    if tick.is_multiple_of(2) { tick + 1 } else { tick - 1 }
}

/// Scene whose local models are changed from the fault until the second touch.
fn models_changed(change: impl Fn(&mut palpate_local::LocalModel) -> bool + 'static) -> Scene {
    Scene {
        model: Box::new(move |tick, model| if is_faulty(tick, 1200) { change(model) } else { true }),
        ..Scene::default()
    }
}

const DEVICE_FAILED: Option<EventTest> = Some(|event| matches!(event, LoopEventKind::DeviceFailed(_)));
const JUMPED: Option<EventTest> = Some(|event| *event == LoopEventKind::DeviceFailed(DeviceError::Jumped));
const MODEL_REFUSED: Option<EventTest> = Some(|event| matches!(event, LoopEventKind::ModelRejected(_)));

/// Ticks until zero force without readings: 20 that are bridged, 100 of fading, and a margin.
const READ_TIMEOUT: u64 = 122;
/// Ticks until zero force without local models: three model periods of 50, the age of the last model, and the fade.
const STALE: u64 = 302;

/// All faults in lock step.
pub(crate) fn all() -> Vec<InjectedFault> {
    let jump = DVec3::X * 0.05;
    let far = |f: fn(u64, Reading) -> Reading| f;
    vec![
        (
            "read_error_once",
            bridged(Some(|event| *event == LoopEventKind::DeviceFailed(DeviceError::TimedOut))),
            read_fails(1, DeviceError::TimedOut),
        ),
        ("read_error_20_ticks", bridged(DEVICE_FAILED), read_fails(20, DeviceError::TimedOut)),
        (
            "read_error_for_good",
            ends(READ_TIMEOUT, DEVICE_FAILED),
            read_fails(u64::MAX, DeviceError::TimedOut),
        ),
        (
            "short_sample",
            bridged(Some(|event| {
                *event == LoopEventKind::DeviceFailed(DeviceError::Protocol("a short report"))
            })),
            read_fails(3, DeviceError::Protocol("a short report")),
        ),
        (
            "repeated_sample",
            bridged(Some(|event| *event == LoopEventKind::DeviceFailed(DeviceError::Repeated))),
            readings_changed(40, |_, _| numbered(FAULT_TICK)),
        ),
        (
            "reordered_samples",
            bridged(Some(|event| *event == LoopEventKind::DeviceFailed(DeviceError::Reordered))),
            readings_changed(40, far(|tick, _| numbered(swapped(tick)))),
        ),
        // Without sequence numbers these are indistinguishable from movements of a hand.
        (
            "repeated_sample_unnumbered",
            bridged(None),
            readings_changed(40, |_, _| Reading::at(hand_m(FAULT_TICK))),
        ),
        (
            "reordered_samples_unnumbered",
            bridged(None),
            readings_changed(40, far(|tick, _| Reading::at(hand_m(swapped(tick))))),
        ),
        (
            "non_finite_sample",
            bridged(Some(|event| *event == LoopEventKind::DeviceFailed(DeviceError::Unusable))),
            readings_changed(10, |_, reading| Reading {
                position_m: DVec3::new(f64::NAN, 0.0, f64::INFINITY),
                ..reading
            }),
        ),
        (
            "jump_of_50_mm_once",
            bridged(JUMPED),
            readings_changed(2, move |_, reading| Reading {
                position_m: reading.position_m + jump,
                ..reading
            }),
        ),
        (
            "jump_of_50_mm_in_a_silence",
            fades(11, Some(|event| matches!(event, LoopEventKind::HandJumped(m) if (m - 0.05).abs() < 5e-3))),
            Scene {
                read: Box::new(move |tick, reading| match tick {
                    FAULT_TICK.. if tick < FAULT_TICK + 10 => Err(DeviceError::TimedOut),
                    FAULT_TICK.. => Ok(Reading { position_m: reading.position_m + jump, ..reading }),
                    _ => Ok(reading),
                }),
                ..Scene::default()
            },
        ),
        (
            "jump_of_50_mm_for_good",
            fades(7, JUMPED),
            readings_changed(u64::MAX, move |_, reading| Reading {
                position_m: reading.position_m + jump,
                ..reading
            }),
        ),
        (
            "write_error",
            bridged(Some(|event| *event == LoopEventKind::DeviceFailed(DeviceError::Disconnected))),
            write_fails(30, DeviceError::Disconnected),
        ),
        // The device keeps its force until the watchdog stops it, which needs a thread.
        (
            "write_error_300_ticks",
            fades(301, Some(|event| *event == LoopEventKind::DeviceFailed(DeviceError::TimedOut))),
            write_fails(300, DeviceError::TimedOut),
        ),
        (
            "model_stalled_10_s",
            fades(STALE, Some(|event| matches!(event, LoopEventKind::ModelStale(_)))),
            Scene { ticks: 13_000, model: Box::new(|tick, _| !is_faulty(tick, 10_000)), ..Scene::default() },
        ),
        (
            "local_model_with_nan",
            fades(STALE, MODEL_REFUSED),
            models_changed(|model| {
                model.force_n.y = f64::NAN;
                true
            }),
        ),
        // All its numbers are finite, and its force is not.
        (
            "local_model_that_overflows",
            fades(PERIOD, Some(|event| *event == LoopEventKind::ForceNotFinite)),
            models_changed(|model| {
                model.stiffness_n_per_m.z_axis.z = f64::MAX;
                model.position_m.z += 1e3;
                true
            }),
        ),
        (
            "local_model_with_wrong_sizes",
            fades(STALE, MODEL_REFUSED),
            models_changed(|model| {
                (model.scheme, model.reduced.order) = (palpate_local::Scheme::Neighbourhood, usize::MAX);
                true
            }),
        ),
        (
            "local_model_of_the_wrong_body",
            fades(STALE, Some(|event| matches!(event, LoopEventKind::WrongBody(id) if id.body == 99))),
            models_changed(|model| {
                model.id.body = 99;
                true
            }),
        ),
        (
            "settings_flood",
            bridged(None),
            Scene {
                app: Box::new(|tick, handle| {
                    for record in
                        [true, false].into_iter().cycle().take(if is_faulty(tick, 1000) { 100 } else { 0 })
                    {
                        let good = handle
                            .set_settings(LoopSettings { record: record && tick % 7 == 0, ..settings() });
                        let bad =
                            handle.set_settings(LoopSettings { model_period_s: f64::NAN, ..settings() });
                        debug_assert!(good.is_ok() && bad.is_err());
                    }
                }),
                ..Scene::default()
            },
        ),
        // All threads stop for 10 s, the loop's included; the hand continues where it was.
        (
            "app_stopped_in_a_debugger",
            fades(1, Some(|event| matches!(event, LoopEventKind::Gap(_)))),
            Scene {
                elapsed: Box::new(|tick| if tick == FAULT_TICK { 10_000 } else { 1 }),
                ..Scene::default()
            },
        ),
        (
            "app_paused",
            fades(102, None),
            Scene {
                app: Box::new(|tick, handle| {
                    if tick == FAULT_TICK || tick == FAULT_TICK + 800 {
                        let paused = tick == FAULT_TICK;
                        let set = handle.set_settings(LoopSettings { paused, ..settings() });
                        debug_assert!(set.is_ok());
                    }
                }),
                ..Scene::default()
            },
        ),
    ]
}
