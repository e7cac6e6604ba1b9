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

/// Position at a tick, m, device frame.
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
fn recording_through_a_frame_is_in_the_device_frame() {
    let (mut recorder, mut history) = (Recorder::default(), SampleHistory::with_capacity(512).unwrap());
    recorder.start(Entity::PLACEHOLDER);
    for step in 1..=20 {
        push(&mut history, 50 * (step - 1)..50 * step);
        recorder.record(&history, &frame());
    }
    // The recording starts with the newest sample of the first call.
    assert!((recorder.duration_s() - 0.951).abs() < 1e-12, "{}", recorder.duration_s());
    let path = folder("frame").join("a/hand.csv");
    write(&recorder.running.take().unwrap().readings, path.clone()).unwrap();
    let read = Trajectory::from_csv_file(&path).unwrap();
    for (position_m, sequence) in read.positions_m().iter().zip(49..) {
        assert!(position_m.distance(hand(sequence)) < 2e-7, "{sequence}");
    }
    // The file is not overwritten.
    let other = write(&[Reading::at(DVec3::ZERO); 5], path.clone()).unwrap();
    assert_eq!(other, path.with_file_name("hand-1.csv"));
    assert_eq!(Trajectory::from_csv_file(&path).unwrap().positions_m().len(), read.positions_m().len());
    assert_eq!(next_free(path.parent().unwrap()), path.with_file_name("hand-2.csv"));
    std::fs::remove_dir_all(folder("frame")).ok();
}

#[test]
fn gap_in_the_samples_repeats_the_last_reading() {
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

/// An app in lock step with a block and a tool with a grasp, moved by `device`.
fn grasping_app(device: DeviceSelector) -> (App, Entity) {
    use crate::prelude::*;
    use crate::{HapticSchedulePlugin, LoopMode};
    use glam::DQuat;
    use palpate_haptics::{Reading, ScriptedDevice};
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default()))
        .add_plugins(PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep)))
        .insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(std::time::Duration::from_millis(
            50,
        )));
    // Presses on the top, closes there, pulls up and rotates, opens, closes again.
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
    let tool = app.world_mut().spawn((HapticTool::new(device), ToolGrasp::default())).id();
    app.update();
    (app, tool)
}

/// Grasp, grasped point and force after each of `steps` model steps; `inspect` is called after each.
fn grasps(
    app: &mut App,
    tool: Entity,
    steps: usize,
    mut inspect: impl FnMut(&mut ToolLoop),
) -> Vec<(bool, DVec3, DVec3)> {
    (0..steps)
        .map(|_| {
            app.update();
            inspect(&mut app.world_mut().get_mut::<ToolLoop>(tool).unwrap());
            let grasped = app.world().get::<GraspedPoint>(tool).unwrap();
            let force = app.world().get::<ToolForce>(tool).unwrap();
            (grasped.body.is_some(), grasped.point_m, force.force_n)
        })
        .collect()
}

#[test]
fn replay_of_a_recorded_grasp_grasps_the_same() {
    let path = folder("grasp").join("hand.csv");
    let mut recorder = Recorder::default();
    let (mut app, tool) = grasping_app(DeviceSelector::named("surgeon"));
    recorder.start(tool);
    // From the first sample on, instead of the newest one.
    recorder.running.as_mut().unwrap().newest = Some(0);
    let live = grasps(&mut app, tool, 26, |tool| {
        let frame = tool.settings.frame;
        recorder.record(tool.handle.samples(), &frame);
    });
    let readings = recorder.running.take().unwrap().readings;
    write(&readings, path.clone()).unwrap();
    assert!(std::fs::read_to_string(&path).unwrap().starts_with("t_s,x_m,y_m,z_m,buttons,qx,"));
    let (mut app, tool) = grasping_app(DeviceSelector::default());
    let read = Trajectory::from_csv_file(&path).unwrap();
    let handle = app.world_mut().resource_mut::<Assets<TrajectoryAsset>>().add(TrajectoryAsset(read));
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().device = handle.into();
    let replayed = grasps(&mut app, tool, 26, |_| ());
    let closed: Vec<bool> = live.iter().map(|(closed, ..)| *closed).collect();
    assert!(closed.contains(&true) && closed.windows(2).filter(|pair| pair[0] != pair[1]).count() >= 3);
    for (step, (live, replayed)) in live.iter().zip(&replayed).enumerate() {
        assert_eq!(live.0, replayed.0, "step {step}");
        assert!(live.1.distance(replayed.1) < 1e-6, "step {step}: {}, {}", live.1, replayed.1);
        assert!(live.2.distance(replayed.2) < 0.02, "step {step}: {}, {}", live.2, replayed.2);
    }
    std::fs::remove_dir_all(folder("grasp")).ok();
}

#[test]
fn errors_of_writing_and_reading_have_file_and_reason() {
    let too_short = write(&[Reading::at(DVec3::ZERO)], "never.csv".into());
    assert!(matches!(too_short, Err(WriteError::Trajectory(_))), "{too_short:?}");
    let mut recorder = Recorder::default();
    let mut tool = HapticTool::default();
    recorder.replay((Entity::PLACEHOLDER, &mut tool), "no/such/hand.csv", Some(&mut Assets::default()));
    let reason = recorder.message.as_ref().unwrap().as_ref().unwrap_err();
    assert!(reason.contains("no/such/hand.csv"), "{reason}");
    assert_eq!(tool, HapticTool::default());
    assert!(recorder.device_before(Entity::PLACEHOLDER).is_none());
}

/// A recorder with a recording of 1 s.
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
fn recording_that_cannot_be_written_is_kept_until_it_is_written() {
    IoTaskPool::get_or_init(Default::default);
    let folder = folder("kept");
    std::fs::create_dir_all(&folder).unwrap();
    // A file where a folder must be: no file can be created there.
    let in_the_way = folder.join("file");
    std::fs::write(&in_the_way, "").unwrap();
    let mut recorder = recorded();
    recorder.stop(in_the_way.join("hand.csv"));
    assert!(recorder.tool().is_none() && recorder.is_writing());
    for _ in 0..2 {
        wait(&mut recorder);
        let reason = recorder.message.clone().unwrap().unwrap_err();
        assert!(reason.contains("hand.csv") && recorder.written.is_none(), "{reason}");
        assert_eq!(recorder.unwritten_s(), Some(1.0));
        recorder.write_again(in_the_way.join("hand.csv"));
    }
    wait(&mut recorder);
    recorder.write_again(folder.join("hand.csv"));
    wait(&mut recorder);
    assert!(recorder.message.as_ref().unwrap().is_ok() && recorder.unwritten_s().is_none());
    assert_eq!(recorder.written, Some(folder.join("hand.csv")));
    let read = Trajectory::from_csv_file(folder.join("hand.csv")).unwrap();
    assert!(read.positions_m().len() == 1000 && read.positions_m()[999].distance(hand(1000)) < 2e-7);
    // The file exists by now: the next free name.
    let mut recorder = recorded();
    recorder.stop(folder.join("hand.csv"));
    wait(&mut recorder);
    assert_eq!(recorder.written, Some(folder.join("hand-1.csv")));
    std::fs::remove_dir_all(folder).ok();
}

#[test]
fn recording_without_a_trajectory_is_discarded() {
    IoTaskPool::get_or_init(Default::default);
    let mut recorder = Recorder::default();
    recorder.start(Entity::PLACEHOLDER);
    recorder.stop("never.csv".into());
    wait(&mut recorder);
    assert!(recorder.message.clone().unwrap().is_err());
    assert!(recorder.unwritten_s().is_none() && !Path::new("never.csv").exists());
}

#[test]
fn unwritten_recording_can_be_discarded() {
    let mut recorder = Recorder { unwritten: vec![Reading::at(DVec3::X); 10], ..Recorder::default() };
    assert_eq!(recorder.unwritten_s(), Some(0.01));
    recorder.discard();
    assert_eq!(recorder.unwritten_s(), None);
}

#[test]
fn restoring_after_several_replays_returns_the_first_device() {
    let folder = folder("back");
    let (mut recorder, mut tool) = (Recorder::default(), HapticTool::default());
    let mut trajectories = Assets::default();
    for name in ["a.csv", "b.csv"] {
        write(&[Reading::at(DVec3::X); 10], folder.join(name)).unwrap();
        let path = folder.join(name).display().to_string();
        recorder.replay((Entity::PLACEHOLDER, &mut tool), &path, Some(&mut trajectories));
        let DeviceSelector::Replay { trajectory, repeat: true } = &tool.device else { panic!("no replay") };
        assert_eq!(trajectories.get(trajectory).unwrap().0.positions_m(), [DVec3::X; 10]);
    }
    recorder.restore_device((Entity::PLACEHOLDER, &mut tool));
    assert_eq!(tool.device, DeviceSelector::default());
    std::fs::remove_dir_all(folder).ok();
}
