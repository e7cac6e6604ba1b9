use super::*;
use glam::DQuat;
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
        let reading = palpate_haptics::Reading::at(hand(sequence));
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
    write(recorder.running.take().unwrap().positions_m, &path).unwrap();
    let read = Trajectory::from_csv_file(&path).unwrap();
    for (found, sequence) in read.positions_m().iter().zip(49..) {
        assert!(found.distance(hand(sequence)) < 2e-7, "{sequence}");
    }
    // It is not overwritten.
    let error = write(vec![DVec3::ZERO; 5], &path).unwrap_err();
    assert!(error.to_string().contains("exists"), "{error}");
    assert_eq!(next_free(path.parent().unwrap()), path.with_file_name("hand-1.csv"));
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
    let positions = recorder.running.unwrap().positions_m;
    assert_eq!(positions.len(), 1 + 30 + 5);
    assert!(positions[1..31].iter().all(|p| *p == positions[0]));
    assert!(positions[31].distance(hand(40)) < 1e-12);
}

#[test]
fn what_cannot_be_written_or_read_says_which_file_and_why() {
    let nothing = write(vec![DVec3::ZERO], Path::new("never.csv")).unwrap_err();
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

#[test]
fn going_back_gives_the_first_device_however_many_replays_there_were() {
    let folder = folder("back");
    let (mut recorder, mut tool) = (Recorder::default(), HapticTool::default());
    for name in ["a.csv", "b.csv"] {
        write(vec![DVec3::X; 10], &folder.join(name)).unwrap();
        let path = folder.join(name).display().to_string();
        recorder.replay((Entity::PLACEHOLDER, &mut tool), path.clone(), &HapticDevices::default());
        assert_eq!(tool.device, DeviceSelector::replay(path));
    }
    recorder.go_back((Entity::PLACEHOLDER, &mut tool));
    assert_eq!(tool.device, DeviceSelector::default());
    std::fs::remove_dir_all(folder).ok();
}
