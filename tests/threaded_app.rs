//! A Bevy app whose loops run on threads of their own: what must hold whatever the machine's load.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticFaultKind, ModelStepCount, SimulatedBody, SlowStep, TickRecording, ToolLoop};
use palpate_haptics::{DeviceDescription, DeviceError, TickRecord};
use palpate_tests::app::{Contacts, listen, take_faults, update_until};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A hand that after a second goes 8 mm deep within 0.1 s and stays for four seconds, comes out and begins anew; and what was done to
/// its device.
#[derive(Clone, Default)]
struct Hand {
    last_force: Arc<Mutex<DVec3>>,
    reads: Arc<AtomicU64>,
    closed: Arc<AtomicU64>,
    panics: Arc<AtomicBool>,
}

impl HapticDevice for Hand {
    fn describe(&self) -> DeviceDescription {
        ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe()
    }
    fn open(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
    fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
        assert!(!self.panics.load(Ordering::SeqCst), "a rehearsed panic of the device");
        // Force begins when it is small: it waits above the surface for its first local models; and again, for a machine so busy
        // that samples were lost has let go of it.
        let n = (self.reads.fetch_add(1, Ordering::SeqCst) % 5000).saturating_sub(1000).min(100);
        Ok(Reading::at(DVec3::new(0.012, 0.057 - 1e-4 * n as f64, 0.009)))
    }
    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        *self.last_force.lock().unwrap() = force_n;
        Ok(())
    }
    fn close(&mut self) -> Result<(), DeviceError> {
        self.closed.fetch_add(1, Ordering::SeqCst);
        Ok(())
    }
}

fn scene() -> (App, Hand, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins));
    listen(&mut app);
    let hand = Hand::default();
    let device = hand.clone();
    app.world_mut().resource_mut::<HapticDevices>().register("hand", move || Ok(device.clone()));
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom)));
    let tool = HapticTool { device: DeviceSelector::named("hand"), ..default() };
    let tool = app.world_mut().spawn(tool).id();
    (app, hand, tool)
}

fn force(app: &App, tool: Entity) -> f64 {
    app.world().get::<ToolForce>(tool).unwrap().force_n.y
}

/// Faults that are no matter of the machine's load.
fn faults(app: &mut App) -> Vec<String> {
    let load = [
        "deadlines were missed",
        "samples were lost",
        "local model rejected",
        "no new local model has come",
        "a model step takes",
    ];
    take_faults(app).into_iter().filter(|fault| !load.iter().any(|l| fault.contains(l))).collect()
}

#[test]
fn removing_a_tool_leaves_zero_force_a_closed_device_and_no_thread() {
    for despawn in [true, false] {
        let (mut app, hand, tool) = scene();
        update_until(&mut app, "the hand is pushed back", |app| force(app, tool) > 0.5);
        // The loop may know of a touch before the next model step does.
        update_until(&mut app, "a model step has seen it", |app| {
            app.world().get::<TouchedBody>(tool).unwrap().body.is_some()
        });
        if despawn {
            app.world_mut().despawn(tool);
        } else {
            app.world_mut().entity_mut(tool).remove::<HapticTool>();
        }
        assert_eq!(*hand.last_force.lock().unwrap(), DVec3::ZERO);
        assert_eq!(hand.closed.load(Ordering::SeqCst), 1);
        // The thread has been joined, so nobody reads any more.
        let reads = hand.reads.load(Ordering::SeqCst);
        (0..5).for_each(|_| app.update());
        assert_eq!(hand.reads.load(Ordering::SeqCst), reads);
        assert_eq!(faults(&mut app), [""; 0]);
        // A machine so busy that samples are lost lets go and touches again; what has begun has ended all the same.
        let told = &app.world().resource::<Contacts>().0;
        let count = |what: &str| told.iter().filter(|told| **told == what).count();
        assert!(count("began") >= 1 && count("began") == count("ended"), "{told:?}");
    }
}

#[test]
fn dropping_the_app_leaves_zero_force() {
    let (mut app, hand, tool) = scene();
    update_until(&mut app, "the hand is pushed back", |app| force(app, tool) > 0.5);
    drop(app);
    assert_eq!(*hand.last_force.lock().unwrap(), DVec3::ZERO);
    assert_eq!(hand.closed.load(Ordering::SeqCst), 1);
}

#[test]
fn a_pause_fades_the_force_is_seen_and_is_no_fault() {
    let (mut app, hand, tool) = scene();
    update_until(&mut app, "the hand is pushed back", |app| force(app, tool) > 0.5);
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    update_until(&mut app, "the force has faded", |app| force(app, tool) == 0.0);
    assert_eq!(*hand.last_force.lock().unwrap(), DVec3::ZERO);
    assert!(app.world().get::<ToolForce>(tool).unwrap().safety_limited);
    let reads = hand.reads.load(Ordering::SeqCst);
    update_until(&mut app, "a long pause", |_| hand.reads.load(Ordering::SeqCst) > reads + 700);
    take_faults(&mut app);
    app.world_mut().resource_mut::<Time<Virtual>>().unpause();
    // It went deep into the body while that stood still, so it has to come out first.
    hand.reads.store(0, Ordering::SeqCst);
    update_until(&mut app, "the hand is pushed back again", |app| force(app, tool) > 0.3);
    // A busy machine may lose a few samples at any time; those of the pause must not count as lost.
    let lost = |fault: &String| {
        let number = fault.strip_suffix(" samples were lost before the body could be moved along them")?;
        number.parse::<u64>().ok()
    };
    let most = take_faults(&mut app).iter().filter_map(lost).max().unwrap_or(0);
    assert!(most < 500, "{most} samples were lost");
}

#[test]
fn another_speed_than_real_time_fades_the_force_and_is_said() {
    let (mut app, _hand, tool) = scene();
    update_until(&mut app, "the hand is pushed back", |app| force(app, tool) > 0.5);
    app.world_mut().resource_mut::<Time<Virtual>>().set_relative_speed(0.5);
    update_until(&mut app, "the force has faded", |app| force(app, tool) == 0.0);
    let said = faults(&mut app);
    assert!(said.len() == 1 && said[0].contains("0.5 times real time"), "{said:?}");
}

#[test]
fn a_device_that_panics_ends_its_loop_and_can_be_started_again() {
    let (mut app, hand, tool) = scene();
    update_until(&mut app, "the hand is pushed back", |app| force(app, tool) > 0.5);
    hand.panics.store(true, Ordering::SeqCst);
    update_until(&mut app, "the loop is gone", |app| app.world().get::<ToolLoop>(tool).is_none());
    assert_eq!(*hand.last_force.lock().unwrap(), DVec3::ZERO);
    assert_eq!((force(&app, tool), app.world().get::<TouchedBody>(tool).unwrap().body), (0.0, None));
    let said = faults(&mut app);
    // The loop's last word, and what is left to the app.
    assert!(said.len() == 2 && said[0].contains("panicked"), "{said:?}");
    assert!(said[1].contains("thread has ended"), "{said:?}");
    let steps = |app: &mut App| {
        let mut bodies = app.world_mut().query::<&SimulatedBody>();
        bodies.single(app.world()).unwrap().last_step().ticks
    };
    update_until(&mut app, "the body goes on without it", |app| steps(app) == 50);
    hand.panics.store(false, Ordering::SeqCst);
    hand.reads.store(0, Ordering::SeqCst);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().set_changed();
    update_until(&mut app, "the hand is pushed back again", |app| force(app, tool) > 0.5);
}

/// What a slow model step is reported with, and the longest step of a body in ticks.
#[derive(Resource, Default)]
struct Slow {
    told: Vec<SlowStep>,
    most_ticks: usize,
    steps_before: u64,
    most_steps: u64,
}

fn collect_slow(
    mut faults: MessageReader<HapticFault>,
    bodies: Query<&SimulatedBody>,
    steps: Res<ModelStepCount>,
    mut slow: ResMut<Slow>,
) {
    for fault in faults.read() {
        if let HapticFaultKind::SlowStep(step) = fault.kind {
            assert!(fault.entity.is_some_and(|body| bodies.contains(body)));
            slow.told.push(step);
        }
    }
    let ticks = bodies.iter().map(|body| body.last_step().ticks).max().unwrap_or(0);
    slow.most_ticks = slow.most_ticks.max(ticks);
    slow.most_steps = slow.most_steps.max(steps.0 - slow.steps_before);
    slow.steps_before = steps.0;
}

/// A frame, and with it a model step, that takes 150 ms makes the local model older, not the loop late. It is reported once, and the
/// body does not try to catch up.
#[test]
fn a_slow_model_step_makes_the_local_model_older_and_not_the_loop_late() {
    let (mut app, hand, tool) = scene();
    #[expect(clippy::disallowed_methods, reason = "the model step is slow")]
    let slow = || std::thread::sleep(Duration::from_millis(150));
    app.add_systems(ModelSchedule, slow.in_set(HapticSystems::First));
    app.init_resource::<Slow>().add_systems(Last, collect_slow);
    app.world_mut().entity_mut(tool).insert(TickRecording::default());
    // Long enough for ten steps, and a touch.
    update_until(&mut app, "several slow model steps", |_| hand.reads.load(Ordering::SeqCst) > 2000);
    let recording = app.world().get::<TickRecording>(tool).unwrap();
    let age = |record: &TickRecord| Some(record.sample?.sequence - record.rendered.model?.sequence);
    let oldest = recording.records.iter().filter_map(age).max().unwrap_or(0);
    assert!(oldest >= 150, "{oldest} ms");
    // Even on a machine that leaves the loop every fifth of its ticks, a step of 150 ms has 30 of them.
    let steps = app.world().resource::<ModelStepCount>().0 as usize;
    assert!(recording.records.len() > 20 * steps, "{} ticks in {steps} steps", recording.records.len());
    let slow = app.world().resource::<Slow>();
    let [told] = slow.told[..] else { panic!("{:?}", slow.told) };
    assert!(told.step_ms >= 150.0 && (told.period_ms - 50.0).abs() < 1e-9 && told.nodes == 216, "{told:?}");
    assert!(told.other_ms() >= 149.0 && told.cells_along.is_none(), "{told:?}");
    // One step a frame; its body two periods at most, and one after a slow step.
    assert_eq!(slow.most_steps, 1);
    assert!(slow.most_ticks <= 100, "{} ticks", slow.most_ticks);
    assert!(app.world().get::<TouchedBody>(tool).unwrap().body.is_some(), "it touches all the same");
}
