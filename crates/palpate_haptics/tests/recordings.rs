//! Files of black boxes and recordings of whole runs: writing, reading, errors, numbered files.

use glam::{DQuat, DVec3};
use palpate_haptics::*;
use palpate_local::{Contact, ModelId, Scheme};
use std::path::PathBuf;

/// An empty folder for the test `name`.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A loop in lock step with a swinging hand, a device that fails occasionally, and a local model from tick 100 on.
fn run(ticks: usize, settings: LoopSettings) -> (HapticHandle, Lockstep<ScriptedDevice>) {
    run_with(ticks, settings, LoopConfig::default())
}

fn run_with(
    ticks: usize,
    settings: LoopSettings,
    config: LoopConfig,
) -> (HapticHandle, Lockstep<ScriptedDevice>) {
    let device = ScriptedDevice::new(|n, _| match n {
        0..3 => Err(DeviceError::TimedOut),
        50 => Err(DeviceError::Os(-5)),
        60 => Err(DeviceError::Protocol("too short")),
        70 => Ok(Reading::at(DVec3::NAN)),
        _ => Ok(Reading {
            orientation: DQuat::from_rotation_y(0.3),
            buttons: 5,
            ..Reading::at(DVec3::new(0.01 * (n as f64 * 0.013).sin(), -0.0, 1.0 / 3.0))
        }),
    });
    let (mut handle, haptic_loop) = haptic_loop(config, settings).unwrap();
    let mut lockstep = Lockstep::new(haptic_loop, Box::new(device)).unwrap();
    lockstep.run(ticks.min(100));
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) =
        (Scheme::Hold, Contact::Held, DVec3::new(0.1, -30.0, 1e-9));
    model.id = ModelId { body: 7, epoch: 2, sequence: 100 };
    handle.publish_model();
    lockstep.run(ticks.saturating_sub(100));
    (handle, lockstep)
}

fn text(black_box: &BlackBox) -> String {
    let mut text = Vec::new();
    black_box.to_csv(&mut text).unwrap();
    String::from_utf8(text).unwrap()
}

#[test]
fn written_black_box_is_read_bit_for_bit() {
    let (mut handle, _lockstep) = run(400, LoopSettings::default());
    let path = folder("round_trip").join("box.csv");
    handle.black_box().write_csv(&path).unwrap();
    let read = Recording::read_csv(&path).unwrap();
    let here: Vec<BlackBoxTick> = handle.black_box().ticks().copied().collect();
    assert_eq!(read.ticks(), here);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text(handle.black_box()));
    // The debug text also compares the signs of zeros.
    assert_eq!(format!("{:?}", read.ticks()), format!("{here:?}"));
    let faults: Vec<_> = [1, 51, 61, 71, 72].map(|n| read.ticks()[n - 1].read_failed).into();
    let [timed_out, os] = [RecordedDeviceError::TimedOut, RecordedDeviceError::Os(-5)];
    assert_eq!(
        faults,
        [
            Some(timed_out),
            Some(os),
            Some(RecordedDeviceError::Protocol),
            Some(RecordedDeviceError::Unusable),
            None
        ]
    );
    assert_eq!((read.ticks()[0].sample, read.ticks()[0].model), (None, None));
}

/// Covers infinities, extreme numbers and the sign of zero.
#[test]
fn numbers_round_trip_exactly() {
    let (mut handle, _lockstep) = run(150, LoopSettings::default());
    let text = text(handle.black_box());
    let row = text.lines().nth(120).unwrap();
    for number in ["inf", "-inf", "5e-324", "1.7976931348623157e308", "-0.0", "0.30000000000000004"] {
        let mut fields: Vec<&str> = row.split(',').collect();
        fields[18] = number;
        let changed = format!("{}\n{}\n", text.lines().next().unwrap(), fields.join(","));
        let read = Recording::from_csv(changed.as_bytes(), "box.csv").unwrap();
        assert_eq!(read.ticks()[0].before_n.x.to_bits(), number.parse::<f64>().unwrap().to_bits());
    }
}

#[test]
fn errors_name_file_and_line() {
    let (mut handle, _lockstep) = run(102, LoopSettings::default());
    let good = text(handle.black_box());
    let (header, last) = (good.lines().next().unwrap(), good.lines().last().unwrap());
    let with = |column: &str, value: &str| {
        let at = header.split(',').position(|name| name == column).unwrap();
        let mut fields: Vec<&str> = last.split(',').collect();
        fields[at] = value;
        format!("{header}\n{}\n", fields.join(","))
    };
    for (text, expected) in [
        (String::new(), "box.csv:1: column 1 is \"\"; it must be \"sequence\""),
        (header.replace("time_s", "t"), "box.csv:1: column 2 is \"t\"; it must be \"time_s\""),
        (format!("{header},more"), "box.csv:1: column 46 is \"more\"; it must be \"\""),
        (format!("{header}\n1,2\n"), "box.csv:2: 2 fields; a row has 45"),
        (with("sequence", "-1"), "box.csv:2: sequence is \"-1\"; it must be a whole number"),
        (with("time_s", "abc"), "box.csv:2: time_s is \"abc\"; it must be a number"),
        (with("origin", ""), "box.csv:2: origin is \"\"; it must be measured, interpolated or repeated"),
        (with("y_m", ""), "box.csv:2: y_m is \"\"; it must be a number"),
        (
            with("buttons", "4294967296"),
            "box.csv:2: buttons is \"4294967296\"; it must be a whole number below 2^32",
        ),
        (with("model_body", ""), "box.csv:2: model_body is \"\"; it must be a whole number"),
        (with("passivity_y_n", ""), "box.csv:2: passivity_y_n is \"\"; it must be a number"),
        (
            with("acted", "gains+luck"),
            "box.csv:2: acted is \"gains+luck\"; it must be names of stages with + between them, or empty",
        ),
        (
            with("read_error", "os:x"),
            "box.csv:2: read_error is \"os:x\"; it must be the name of a device error, or empty",
        ),
        (format!("{good}{last}\n"), "box.csv:104: sequence is 102; rows ascend, so it must be above 102"),
    ] {
        let error = Recording::from_csv(text.as_bytes(), "box.csv").unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
    let bytes = [header.as_bytes(), b"\n1,\xff\xfe\n"].concat();
    let error = Recording::from_csv(bytes.as_slice(), "box.csv").unwrap_err();
    assert!(matches!(error, BlackBoxError::Csv(CsvError::Syntax { line: 2, .. })), "{error}");
    assert!(std::error::Error::source(&error).unwrap().is::<csv::Error>());
    for path in [folder("no_file").join("such.csv"), folder("no_file")] {
        let error = Recording::read_csv(&path).unwrap_err();
        assert_eq!(error.to_string(), format!("{}: cannot be read or written", path.display()));
        assert!(std::error::Error::source(&error).is_some());
    }
    assert!(matches!(
        handle.black_box().write_csv(folder("no_file")),
        Err(BlackBoxError::Csv(CsvError::File { .. }))
    ));
    assert!(Recording::from_csv(header.as_bytes(), "box.csv").unwrap().ticks().is_empty());
}

#[test]
fn writer_numbers_files_up_to_its_maximum_and_never_overwrites() {
    let folder = folder("keeper").join("made");
    let (mut handle, _lockstep) = run(120, LoopSettings::default());
    let mut writer = BlackBoxWriter::new(&folder).with_max_files(3);
    let mut write = |reason: &str| writer.write(&mut handle, reason).unwrap();
    assert_eq!(write("the device failed"), Some(folder.join("blackbox-1-the-device-failed.csv")));
    std::fs::write(folder.join("blackbox-7-of-another-run.csv"), "").unwrap();
    std::fs::write(folder.join("notes.txt"), "").unwrap();
    assert_eq!(write("../../Etc é"), Some(folder.join("blackbox-8-etc.csv")));
    assert_eq!(write(""), Some(folder.join("blackbox-9-asked.csv")));
    assert_eq!(write("once more"), None);
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 5);
    assert_eq!(Recording::read_csv(folder.join("blackbox-9-asked.csv")).unwrap().ticks().len(), 120);
    let blocked = BlackBoxWriter::new(folder.join("notes.txt")).write(&mut handle, "").unwrap_err();
    assert!(
        matches!(&blocked, BlackBoxError::Csv(CsvError::File { path, .. }) if path.ends_with("notes.txt")),
        "{blocked}"
    );
}

#[test]
fn recorded_run_contains_every_tick() {
    let settings = LoopSettings { record: true, ..LoopSettings::default() };
    let path = folder("recorder").join("run.csv");
    let mut recorder = Recorder::create(&path).unwrap();
    let (mut handle, mut lockstep) = run(300, settings);
    assert_eq!(recorder.take(&mut handle).unwrap(), 300);
    assert_eq!(Recording::read_csv(&path).unwrap().ticks().len(), 300, "the file is flushed");
    for _ in 0..10 {
        lockstep.run(700);
        recorder.take(&mut handle).unwrap();
    }
    drop(lockstep);
    assert_eq!(recorder.take(&mut handle).unwrap(), 0);
    assert_eq!((recorder.written(), recorder.dropped()), (7300, 0));
    let read = Recording::read_csv(recorder.path()).unwrap();
    assert!(read.ticks().iter().map(|tick| tick.sequence).eq(1..=7300));
    let newest: Vec<BlackBoxTick> = handle.black_box().ticks().copied().collect();
    assert_eq!(read.ticks()[7300 - 4096..], newest, "the same rows as in the black box");
    let error = Recorder::create(&path).unwrap_err();
    assert!(
        matches!(error, BlackBoxError::Csv(CsvError::File { .. })),
        "an existing recording is not overwritten"
    );
}

#[test]
fn records_beyond_queue_capacity_are_dropped_and_counted() {
    let settings = LoopSettings { record: true, ..LoopSettings::default() };
    let config = LoopConfig { record_capacity: 100, ..LoopConfig::default() };
    let (mut handle, mut lockstep) = run_with(250, settings, config);
    let mut recorder = Recorder::create(folder("dropped").join("run.csv")).unwrap();
    assert_eq!(recorder.take(&mut handle).unwrap(), 100);
    lockstep.run(50);
    drop(lockstep);
    assert_eq!(recorder.take(&mut handle).unwrap(), 50);
    assert_eq!((recorder.written(), recorder.dropped()), (150, 150));
    let read = Recording::read_csv(recorder.path()).unwrap();
    assert!(read.ticks().iter().map(|tick| tick.sequence).eq((1..=100).chain(251..=300)));
}
