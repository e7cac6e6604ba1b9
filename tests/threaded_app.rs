//! A Bevy app with loops on threads: assertions that hold under any load of the machine.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    FaultSeverity, HapticFaultKind, HapticSystems, ModelSchedule, ModelStepCount, SimulatedBody, SlowStep,
    TickRecording, ToolLoop,
};
use palpate_haptics::{
    DeviceDescription, DeviceError, HapticDevice, LoopEventKind, Reading, ScriptedDevice, TickRecord,
};
use palpate_tests::app::Contact::{End, Start};
use palpate_tests::app::{
    collect_messages, contacts, force_n, spawn_block, spawn_tool, take_faults, take_kinds, update_until,
};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A device that moves to a depth of 8 mm within 0.1 s after a second, stays for four seconds, leaves and repeats. Counts its calls.
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
        assert!(!self.panics.load(Ordering::SeqCst), "an intended panic of the device");
        // The force starts when it is small: the device waits above the surface for the first local models. It repeats that, because lost
        // samples on a busy machine end the contact.
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
    collect_messages(&mut app);
    let hand = Hand::default();
    let device = hand.clone();
    spawn_block(&mut app);
    let tool = spawn_tool(&mut app, move || device.clone());
    (app, hand, tool)
}

fn force(app: &App, tool: Entity) -> f64 {
    force_n(app, tool).y
}

/// Kinds of the faults since the last call that do not depend on the machine's load.
fn kinds(app: &mut App) -> Vec<HapticFaultKind> {
    take_kinds(app).into_iter().filter(|kind| kind.severity() > FaultSeverity::Load).collect()
}

#[test]
fn removing_a_tool_leaves_zero_force_a_closed_device_and_no_thread() {
    for despawn in [true, false] {
        let (mut app, hand, tool) = scene();
        update_until(&mut app, "the hand is pushed back", |app| force(app, tool) > 0.5);
        // The loop may detect a contact before the next model step.
        update_until(&mut app, "a model step detects the contact", |app| {
            app.world().get::<TouchedBody>(tool).unwrap().body.is_some()
        });
        if despawn {
            app.world_mut().despawn(tool);
        } else {
            app.world_mut().entity_mut(tool).remove::<HapticTool>();
        }
        assert_eq!(*hand.last_force.lock().unwrap(), DVec3::ZERO);
        assert_eq!(hand.closed.load(Ordering::SeqCst), 1);
        // The thread has been joined, and reads no more.
        let reads = hand.reads.load(Ordering::SeqCst);
        (0..5).for_each(|_| app.update());
        assert_eq!(hand.reads.load(Ordering::SeqCst), reads);
        let kinds = kinds(&mut app);
        assert!(kinds.is_empty(), "{kinds:?}");
        // Lost samples on a busy machine end a contact early; each start is followed by an end.
        let contacts = contacts(&app);
        let alternates = contacts.chunks(2).all(|pair| *pair == [Start, End]);
        assert!(!contacts.is_empty() && alternates, "{contacts:?}");
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
fn pause_fades_the_force_without_a_fault() {
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
    // The device moved into the body during the pause, and has to leave it first.
    hand.reads.store(0, Ordering::SeqCst);
    update_until(&mut app, "the hand is pushed back again", |app| force(app, tool) > 0.3);
    // The pause has ended the contact. Another one starts; the loop may detect it before the next model step.
    update_until(&mut app, "a contact after that of the pause", |app| contacts(app).len() >= 3);
    let contacts = contacts(&app);
    assert!(contacts.chunks(2).all(|pair| [Start, End].starts_with(pair)), "{contacts:?}");
    // A busy machine may lose a few samples at any time; those of the pause must not count as lost.
    let lost = |kind: HapticFaultKind| match kind {
        HapticFaultKind::SamplesLost { lost } => Some(lost),
        _ => None,
    };
    let max = take_kinds(&mut app).into_iter().filter_map(lost).max().unwrap_or(0);
    assert!(max < 500, "{max} samples were lost");
}

#[test]
fn relative_speed_other_than_one_fades_the_force_and_is_a_fault() {
    let (mut app, _hand, tool) = scene();
    update_until(&mut app, "the hand is pushed back", |app| force(app, tool) > 0.5);
    app.world_mut().resource_mut::<Time<Virtual>>().set_relative_speed(0.5);
    update_until(&mut app, "the force has faded", |app| force(app, tool) == 0.0);
    let kinds = kinds(&mut app);
    assert!(matches!(kinds[..], [HapticFaultKind::UnsupportedTimeScale { speed: 0.5 }]), "{kinds:?}");
}

#[test]
fn panic_of_a_device_ends_its_loop_and_the_tool_can_be_started_again() {
    let (mut app, hand, tool) = scene();
    update_until(&mut app, "the hand is pushed back", |app| force(app, tool) > 0.5);
    hand.panics.store(true, Ordering::SeqCst);
    update_until(&mut app, "the loop is gone", |app| app.world().get::<ToolLoop>(tool).is_none());
    assert_eq!(*hand.last_force.lock().unwrap(), DVec3::ZERO);
    assert_eq!((force(&app, tool), app.world().get::<TouchedBody>(tool).unwrap().body), (0.0, None));
    // The loop's last event, and the end of its thread.
    let kinds = kinds(&mut app);
    let is_panic =
        matches!(kinds[..], [HapticFaultKind::Loop(LoopEventKind::Panicked), HapticFaultKind::LoopEnded]);
    assert!(is_panic, "{kinds:?}");
    let steps = |app: &mut App| {
        let mut bodies = app.world_mut().query::<&SimulatedBody>();
        bodies.single(app.world()).unwrap().last_step().ticks
    };
    update_until(&mut app, "the body is stepped without the tool", |app| steps(app) == 50);
    hand.panics.store(false, Ordering::SeqCst);
    hand.reads.store(0, Ordering::SeqCst);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().set_changed();
    update_until(&mut app, "the hand is pushed back again", |app| force(app, tool) > 0.5);
}

/// Reported slow model steps, the maximum number of a body's ticks in a step, and the maximum number of steps in a frame.
#[derive(Resource, Default)]
struct Slow {
    reported: Vec<SlowStep>,
    max_ticks: usize,
    steps_before: u64,
    max_steps: u64,
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
            slow.reported.push(step);
        }
    }
    let ticks = bodies.iter().map(|body| body.last_step().ticks).max().unwrap_or(0);
    slow.max_ticks = slow.max_ticks.max(ticks);
    slow.max_steps = slow.max_steps.max(steps.0 - slow.steps_before);
    slow.steps_before = steps.0;
}

/// A model step of 150 ms makes the local model older, not the loop late. It is reported once, and the body does not catch up.
#[test]
fn slow_model_step_ages_the_local_model_without_delaying_the_loop() {
    let (mut app, hand, tool) = scene();
    #[expect(clippy::disallowed_methods, reason = "the model step is slow")]
    let slow = || std::thread::sleep(Duration::from_millis(150));
    app.add_systems(ModelSchedule, slow.in_set(HapticSystems::First));
    app.init_resource::<Slow>().add_systems(Last, collect_slow);
    app.world_mut().entity_mut(tool).insert(TickRecording::default());
    // Long enough for ten steps, and a contact.
    update_until(&mut app, "several slow model steps", |_| hand.reads.load(Ordering::SeqCst) > 2000);
    let recording = app.world().get::<TickRecording>(tool).unwrap();
    let age = |record: &TickRecord| Some(record.sample?.sequence - record.rendered.model?.sequence);
    let oldest = recording.records.iter().filter_map(age).max().unwrap_or(0);
    assert!(oldest >= 150, "{oldest} ms");
    // Even on a machine on which the loop has a fifth of its ticks, a step of 150 ms has 30 ticks.
    let steps = app.world().resource::<ModelStepCount>().0 as usize;
    assert!(recording.records.len() > 20 * steps, "{} ticks in {steps} steps", recording.records.len());
    let slow = app.world().resource::<Slow>();
    let [step] = slow.reported[..] else { panic!("{:?}", slow.reported) };
    assert!(step.step_ms >= 150.0 && (step.period_ms - 50.0).abs() < 1e-9 && step.nodes == 216, "{step:?}");
    assert!(step.other_ms() >= 149.0 && step.suggested_cells_along.is_none(), "{step:?}");
    // One step in a frame; the body catches up at most one period, and none after a slow step.
    assert_eq!(slow.max_steps, 1);
    assert!(slow.max_ticks <= 100, "{} ticks", slow.max_ticks);
    assert!(app.world().get::<TouchedBody>(tool).unwrap().body.is_some(), "the tool is in contact");
}
