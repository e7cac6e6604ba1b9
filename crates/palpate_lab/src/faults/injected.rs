//! The faults that can be injected in lock step.

use super::outcome::Expected;
use super::scene::{BREAKS_AT, PERIOD, Scene, hand, settings};
use glam::DVec3;
use palpate_haptics::{DeviceError, LoopSettings, Reading};

/// A name, what must come of it, and the scene.
pub(crate) type Injected = (&'static str, Expected, Scene);

/// It goes on, and the app is told `told`.
const fn bridged(told: &'static str) -> Expected {
    Expected { zero_within: None, recovers: true, told }
}

/// Zero force within so many ticks, and another touch is felt again.
const fn fades(within: u64, told: &'static str) -> Expected {
    Expected { zero_within: Some(within), recovers: true, told }
}

/// As `fades`, for good.
const fn ends(within: u64, told: &'static str) -> Expected {
    Expected { zero_within: Some(within), recovers: false, told }
}

fn is_broken(tick: u64, ticks: u64) -> bool {
    (BREAKS_AT..BREAKS_AT.saturating_add(ticks)).contains(&tick)
}

/// A scene whose device gives `error` for so many ticks.
fn reads(ticks: u64, error: DeviceError) -> Scene {
    Scene {
        read: Box::new(move |tick, reading| if is_broken(tick, ticks) { Err(error) } else { Ok(reading) }),
        ..Scene::default()
    }
}

/// A scene whose readings are changed for so many ticks.
fn changed(ticks: u64, change: impl Fn(u64, Reading) -> Reading + 'static) -> Scene {
    Scene {
        read: Box::new(move |tick, reading| {
            Ok(if is_broken(tick, ticks) { change(tick, reading) } else { reading })
        }),
        ..Scene::default()
    }
}

/// A scene whose device does not take so many forces.
fn writes(ticks: u64, error: DeviceError) -> Scene {
    Scene {
        write: Box::new(move |tick| if is_broken(tick, ticks) { Err(error) } else { Ok(()) }),
        ..Scene::default()
    }
}

/// The reading of that number.
fn numbered(tick: u64) -> Reading {
    Reading { sequence: Some(tick), ..Reading::at(hand(tick)) }
}

/// The number of the other of two in a row.
fn swapped(tick: u64) -> u64 {
    if tick.is_multiple_of(2) { tick + 1 } else { tick - 1 }
}

/// A scene whose local models are changed from the fault on, until the second touch.
fn models(change: impl Fn(&mut palpate_local::LocalModel) -> bool + 'static) -> Scene {
    Scene {
        model: Box::new(move |tick, model| if is_broken(tick, 1200) { change(model) } else { true }),
        ..Scene::default()
    }
}

/// The silence that is bridged, 20 ticks, the fade of 100, and a tick to be seen.
const SILENT: u64 = 122;
/// Three model periods of 50 ticks and what the last model was old already, and the fade.
const STALE: u64 = 302;

/// Every fault.
pub(crate) fn all() -> Vec<Injected> {
    let jump = DVec3::X * 0.05;
    let far = |f: fn(u64, Reading) -> Reading| f;
    vec![
        (
            "read_error_once",
            bridged("the device failed: the device did not answer"),
            reads(1, DeviceError::TimedOut),
        ),
        ("read_error_20_ticks", bridged("the device failed"), reads(20, DeviceError::TimedOut)),
        ("read_error_for_good", ends(SILENT, "the device failed"), reads(u64::MAX, DeviceError::TimedOut)),
        (
            "short_sample",
            bridged("the device broke its protocol: a short report"),
            reads(3, DeviceError::Protocol("a short report")),
        ),
        (
            "repeated_sample",
            bridged("the device repeats its last report"),
            changed(40, |_, _| numbered(BREAKS_AT)),
        ),
        (
            "reordered_samples",
            bridged("the device's reports came out of order"),
            changed(40, far(|tick, _| numbered(swapped(tick)))),
        ),
        // Where a device does not number its reports they cannot be told from a hand.
        ("repeated_sample_unnumbered", bridged(""), changed(40, |_, _| Reading::at(hand(BREAKS_AT)))),
        (
            "reordered_samples_unnumbered",
            bridged(""),
            changed(40, far(|tick, _| Reading::at(hand(swapped(tick))))),
        ),
        (
            "non_finite_sample",
            bridged("the reading is not finite"),
            changed(10, |_, reading| Reading {
                position_m: DVec3::new(f64::NAN, 0.0, f64::INFINITY),
                ..reading
            }),
        ),
        (
            "jump_of_50_mm_once",
            bridged("the position jumped farther than a hand can move"),
            changed(2, move |_, reading| Reading { position_m: reading.position_m + jump, ..reading }),
        ),
        (
            "jump_of_50_mm_in_a_silence",
            fades(11, "the hand jumped by 0.05"),
            Scene {
                read: Box::new(move |tick, reading| match tick {
                    BREAKS_AT.. if tick < BREAKS_AT + 10 => Err(DeviceError::TimedOut),
                    BREAKS_AT.. => Ok(Reading { position_m: reading.position_m + jump, ..reading }),
                    _ => Ok(reading),
                }),
                ..Scene::default()
            },
        ),
        (
            "jump_of_50_mm_for_good",
            fades(7, "the position jumped farther than a hand can move"),
            changed(u64::MAX, move |_, reading| Reading { position_m: reading.position_m + jump, ..reading }),
        ),
        (
            "write_error",
            bridged("the device failed: the device is disconnected"),
            writes(30, DeviceError::Disconnected),
        ),
        // The device goes on with what it has until it is stopped beside the loop, for which there has to be a thread.
        (
            "write_error_300_ticks",
            fades(301, "the device failed: the device did not answer"),
            writes(300, DeviceError::TimedOut),
        ),
        (
            "model_stalled_10_s",
            fades(STALE, "no new local model has come"),
            Scene { ticks: 13_000, model: Box::new(|tick, _| !is_broken(tick, 10_000)), ..Scene::default() },
        ),
        (
            "local_model_with_nan",
            fades(STALE, "a local model was refused"),
            models(|model| {
                model.force_n.y = f64::NAN;
                true
            }),
        ),
        // Every number of it is finite, and what comes of them is not.
        (
            "local_model_that_overflows",
            fades(PERIOD, "the force of a local model is not finite"),
            models(|model| {
                model.stiffness_n_per_m.z_axis.z = f64::MAX;
                model.position_m.z += 1e3;
                true
            }),
        ),
        (
            "local_model_with_wrong_sizes",
            fades(STALE, "a local model was refused"),
            models(|model| {
                (model.scheme, model.reduced.order) = (palpate_local::Scheme::Neighbourhood, usize::MAX);
                true
            }),
        ),
        (
            "local_model_of_the_wrong_body",
            fades(STALE, "the tool touches another"),
            models(|model| {
                model.id.body = 99;
                true
            }),
        ),
        (
            "settings_flood",
            bridged(""),
            Scene {
                app: Box::new(|tick, handle| {
                    for record in
                        [true, false].into_iter().cycle().take(if is_broken(tick, 1000) { 100 } else { 0 })
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
        // All threads stand still for 10 s, the loop's too; the hand goes on where it was.
        (
            "app_stopped_in_a_debugger",
            fades(1, "deadlines were missed in a row"),
            Scene {
                elapsed: Box::new(|tick| if tick == BREAKS_AT { 10_000 } else { 1 }),
                ..Scene::default()
            },
        ),
        (
            "app_paused",
            fades(102, ""),
            Scene {
                app: Box::new(|tick, handle| {
                    if tick == BREAKS_AT || tick == BREAKS_AT + 800 {
                        let paused = tick == BREAKS_AT;
                        let set = handle.set_settings(LoopSettings { paused, ..settings() });
                        debug_assert!(set.is_ok());
                    }
                }),
                ..Scene::default()
            },
        ),
    ]
}
