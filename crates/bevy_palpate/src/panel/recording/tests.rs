use super::*;
use crate::tool::{GraspedPoint, ToolForce, ToolLoop};
use glam::{DQuat, DVec3};
use palpate_local::Sample;

fn frame() -> DeviceFrame {
    DeviceFrame {
        rotation: DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 0.8),
        scale: 2.5,
        offset_m: DVec3::new(0.1, 0.2, -0.3),
    }
}

/// Where the hand is at a tick, in the device's frame, m.
fn hand(sequence: u64) -> DVec3 {
    DVec3::new(1e-4 * sequence as f64, 0.01 * (0.01 * sequence as f64).sin(), -0.02)
}

fn push(history: &mut SampleHistory, sequences: std::ops::Range<u64>) {
    for sequence in sequences {
        let reading = Reading::at(hand(sequence));
        let position_m = frame().to_scene(&reading).position_m;
        history.push(Sample { sequence, position_m, ..Sample::default() });
    }
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("palpate-panel-{}-{name}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    folder
}

#[test]
fn what_was_recorded_through_a_frame_is_what_the_device_did() {
    let (mut recorder, mut history) = (Recorder::default(), SampleHistory::with_capacity(512).unwrap());
    recorder.start(Entity::PLACEHOLDER);
    for step in 1..=20 {
        push(&mut history, 50 * (step - 1)..50 * step);
        recorder.record(&history, &frame());
    }
    // From the newest sample of the first look on.
    assert!((recorder.duration_s() - 0.951).abs() < 1e-12, "{}", recorder.duration_s());
    let path = folder("frame").join("a/hand.csv");
    write(&recorder.running.take().unwrap().readings, path.clone()).unwrap();
    let read = Trajectory::from_csv_file(&path).unwrap();
    for (found, sequence) in read.positions_m().iter().zip(49..) {
        assert!(found.distance(hand(sequence)) < 2e-7, "{sequence}");
    }
    // It is not overwritten.
    let beside = write(&[Reading::at(DVec3::ZERO); 5], path.clone()).unwrap();
    assert_eq!(beside, path.with_file_name("hand-1.csv"));
    assert_eq!(Trajectory::from_csv_file(&path).unwrap().positions_m().len(), read.positions_m().len());
    assert_eq!(next_free(path.parent().unwrap()), path.with_file_name("hand-2.csv"));
    std::fs::remove_dir_all(folder("frame")).ok();
}

#[test]
fn a_hole_in_the_samples_is_time_in_which_the_hand_stays() {
    let (mut recorder, mut history) = (Recorder::default(), SampleHistory::with_capacity(512).unwrap());
    recorder.start(Entity::PLACEHOLDER);
    push(&mut history, 0..10);
    recorder.record(&history, &frame());
    push(&mut history, 40..45);
    recorder.record(&history, &frame());
    let readings = recorder.running.unwrap().readings;
    assert_eq!(readings.len(), 1 + 30 + 5);
    assert!(readings[1..31].iter().all(|reading| *reading == readings[0]));
    assert!(readings[31].position_m.distance(hand(40)) < 1e-12);
}

/// An app in lock step with a block and a tool that grasps, moved by `device`.
fn grasping_app(device: DeviceSelector) -> (App, Entity) {
    use crate::prelude::*;
    let mut app = App::new();
    app.add_plugins(MinimalPlugins)
        .add_plugins(PalpatePlugins.set(HapticSchedulePlugin { mode: LoopMode::Lockstep, ..default() }))
        .insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(std::time::Duration::from_millis(
            50,
        )));
    // Comes down on the top, closes there, pulls up and turns, opens, closes again.
    app.world_mut().resource_mut::<HapticDevices>().register("surgeon", || {
        Ok(ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            let part = |from: f64, to: f64| ((t - from) / (to - from)).clamp(0.0, 1.0);
            let y = 0.0597 - 0.005 * part(0.0, 0.2) + 0.004 * part(0.4, 0.6);
            let orientation = DQuat::from_rotation_y(part(0.3, 0.9));
            let buttons = u32::from((0.3..0.7).contains(&t) || t > 1.0);
            Ok(Reading { buttons, orientation, ..Reading::at(DVec3::new(0.012, y, 0.009)) })
        }))
    });
    app.world_mut().spawn((
        DeformableBody::block([4; 3], 0.1),
        Tissue { youngs_modulus_pa: 20e3, ..default() },
        FixedRegion::Face(BoxFace::Bottom),
    ));
    let tool = HapticTool { device, ..default() };
    let tool = app.world_mut().spawn((tool, ToolGrasp::default())).id();
    app.update();
    (app, tool)
}

/// Whether it holds, where, and what is felt, after each of `steps` model steps that `look` has seen.
fn held(
    app: &mut App,
    tool: Entity,
    steps: usize,
    mut look: impl FnMut(&mut ToolLoop),
) -> Vec<(bool, DVec3, DVec3)> {
    (0..steps)
        .map(|_| {
            app.update();
            look(&mut app.world_mut().get_mut::<ToolLoop>(tool).unwrap());
            let grasping = app.world().get::<GraspedPoint>(tool).unwrap();
            let force = app.world().get::<ToolForce>(tool).unwrap();
            (grasping.body.is_some(), grasping.point_m, force.force_n)
        })
        .collect()
}

#[test]
fn a_recorded_grasp_is_replayed() {
    let path = folder("grasp").join("hand.csv");
    let mut recorder = Recorder::default();
    let (mut app, tool) = grasping_app(DeviceSelector::named("surgeon"));
    recorder.start(tool);
    // All of it: a recording begins with the newest sample.
    recorder.running.as_mut().unwrap().newest = Some(0);
    let live = held(&mut app, tool, 26, |tool| {
        let frame = tool.settings.frame;
        recorder.record(tool.handle.samples(), &frame);
    });
    let readings = recorder.running.take().unwrap().readings;
    write(&readings, path.clone()).unwrap();
    assert!(std::fs::read_to_string(&path).unwrap().starts_with("t_s,x_m,y_m,z_m,buttons,qx,"));
    let (mut app, tool) = grasping_app(DeviceSelector::replay(path.display().to_string()));
    let replayed = held(&mut app, tool, 26, |_| ());
    let closed: Vec<bool> = live.iter().map(|(closed, ..)| *closed).collect();
    assert!(closed.contains(&true) && closed.windows(2).filter(|pair| pair[0] != pair[1]).count() >= 3);
    for (step, ((held, point_m, force_n), (again, there_m, felt_n))) in live.iter().zip(&replayed).enumerate()
    {
        assert_eq!(held, again, "step {step}");
        assert!(point_m.distance(*there_m) < 1e-6, "step {step}: {point_m}, {there_m}");
        assert!(force_n.distance(*felt_n) < 0.02, "step {step}: {force_n}, {felt_n}");
    }
    std::fs::remove_dir_all(folder("grasp")).ok();
}

#[test]
fn what_cannot_be_written_or_read_says_which_file_and_why() {
    let nothing = write(&[Reading::at(DVec3::ZERO)], "never.csv".into()).unwrap_err();
    assert!(nothing.to_string().contains("at least 2"), "{nothing}");
    let mut recorder = Recorder::default();
    let mut tool = HapticTool::default();
    let devices = HapticDevices::default();
    recorder.replay((Entity::PLACEHOLDER, &mut tool), "no/such/hand.csv".into(), &devices);
    let why = recorder.told.as_ref().unwrap().as_ref().unwrap_err();
    assert!(why.contains("no/such/hand.csv"), "{why}");
    assert_eq!(tool, HapticTool::default());
    assert!(recorder.device_before(Entity::PLACEHOLDER).is_none());
}

/// A recorder that has recorded 1 s.
fn recorded() -> Recorder {
    let (mut recorder, mut history) = (Recorder::default(), SampleHistory::with_capacity(2048).unwrap());
    recorder.start(Entity::PLACEHOLDER);
    recorder.running.as_mut().unwrap().newest = Some(0);
    push(&mut history, 0..1001);
    recorder.record(&history, &frame());
    recorder
}

/// Waits for the file.
fn wait(recorder: &mut Recorder) {
    let task = recorder.writing.take().unwrap();
    let done = bevy::tasks::block_on(task);
    recorder.writing = Some(IoTaskPool::get().spawn(async move { done }));
    while recorder.is_writing() {
        std::thread::yield_now();
        recorder.poll();
    }
}

#[test]
fn what_cannot_be_written_is_kept_until_it_is() {
    IoTaskPool::get_or_init(Default::default);
    let folder = folder("kept");
    std::fs::create_dir_all(&folder).unwrap();
    // A file where a folder must be: nobody may write there.
    let in_the_way = folder.join("file");
    std::fs::write(&in_the_way, "").unwrap();
    let mut recorder = recorded();
    recorder.stop(in_the_way.join("hand.csv"));
    assert!(recorder.tool().is_none() && recorder.is_writing());
    for _ in 0..2 {
        wait(&mut recorder);
        let why = recorder.told.clone().unwrap().unwrap_err();
        assert!(why.contains("hand.csv") && recorder.written.is_none(), "{why}");
        assert_eq!(recorder.unwritten_s(), Some(1.0));
        recorder.write_again(in_the_way.join("hand.csv"));
    }
    wait(&mut recorder);
    recorder.write_again(folder.join("hand.csv"));
    wait(&mut recorder);
    assert!(recorder.told.as_ref().unwrap().is_ok() && recorder.unwritten_s().is_none());
    assert_eq!(recorder.written, Some(folder.join("hand.csv")));
    let read = Trajectory::from_csv_file(folder.join("hand.csv")).unwrap();
    assert!(read.positions_m().len() == 1000 && read.positions_m()[999].distance(hand(1000)) < 2e-7);
    // A name that has been taken meanwhile: the next that is free.
    let mut recorder = recorded();
    recorder.stop(folder.join("hand.csv"));
    wait(&mut recorder);
    assert_eq!(recorder.written, Some(folder.join("hand-1.csv")));
    std::fs::remove_dir_all(folder).ok();
}

#[test]
fn a_recording_that_no_file_can_hold_is_not_kept() {
    IoTaskPool::get_or_init(Default::default);
    let mut recorder = Recorder::default();
    recorder.start(Entity::PLACEHOLDER);
    recorder.stop("never.csv".into());
    wait(&mut recorder);
    assert!(recorder.told.clone().unwrap().unwrap_err().contains("at least 2"));
    assert!(recorder.unwritten_s().is_none() && !Path::new("never.csv").exists());
}

#[test]
fn what_could_not_be_written_can_be_thrown_away() {
    let mut recorder = Recorder { unwritten: vec![Reading::at(DVec3::X); 10], ..Recorder::default() };
    assert_eq!(recorder.unwritten_s(), Some(0.01));
    recorder.discard();
    assert_eq!(recorder.unwritten_s(), None);
}

#[test]
fn going_back_gives_the_first_device_however_many_replays_there_were() {
    let folder = folder("back");
    let (mut recorder, mut tool) = (Recorder::default(), HapticTool::default());
    for name in ["a.csv", "b.csv"] {
        write(&[Reading::at(DVec3::X); 10], folder.join(name)).unwrap();
        let path = folder.join(name).display().to_string();
        recorder.replay((Entity::PLACEHOLDER, &mut tool), path.clone(), &HapticDevices::default());
        assert_eq!(tool.device, DeviceSelector::replay(path));
    }
    recorder.restore_device((Entity::PLACEHOLDER, &mut tool));
    assert_eq!(tool.device, DeviceSelector::default());
    std::fs::remove_dir_all(folder).ok();
}
