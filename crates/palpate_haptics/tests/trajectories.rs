//! Trajectories: valid files, invalid files and the generator.

use glam::{DQuat, DVec3};
use palpate_haptics::*;

fn read(text: &str) -> Result<Trajectory, TrajectoryError> {
    Trajectory::from_csv(text.as_bytes(), "hand.csv")
}

fn message(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

#[test]
fn written_file_is_read_within_rounding() {
    let written = Probe::default().trajectory().unwrap();
    let mut text = Vec::new();
    written.to_csv(&mut text).unwrap();
    let read = Trajectory::from_csv(text.as_slice(), "probe.csv").unwrap();
    assert_eq!(read.positions_m().len(), 5000);
    assert_eq!(read.duration_s(), 5.0);
    for (a, b) in read.positions_m().iter().zip(written.positions_m()) {
        assert!((*a - *b).abs().max_element() <= 0.51e-7);
    }
}

#[test]
fn committed_trajectory_equals_generated_one() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/trajectories/probe.csv");
    let mut expected = Vec::new();
    Probe::default().trajectory().unwrap().to_csv(&mut expected).unwrap();
    let committed = std::fs::read(path).unwrap();
    assert!(
        committed == expected,
        "run `cargo run -p palpate_haptics --example make_probe` to write it again"
    );
}

#[test]
fn accepts_any_start_time() {
    let late = read("t_s,x_m,y_m,z_m\n12.5,0,0,0\n12.501,0,0,0.001\n").unwrap();
    assert_eq!(late.positions_m(), [DVec3::ZERO, DVec3::Z * 0.001]);
    assert!(read("t_s,x_m,y_m,z_m\n1700000000.000,0,0,0\n1700000000.001,0,0,0\n").is_ok());
    assert!(read("t_s,x_m,y_m,z_m\n1700000000,0,0,0\n1700000001,0,0,0\n").is_err());
}

#[test]
fn errors_name_file_and_line() {
    let ok = "t_s,x_m,y_m,z_m\n0,0,0,0\n0.001,0,0,0\n";
    for (text, expected) in [
        (
            "x,y,z\n0,0,0\n",
            "hand.csv:1: the header is \"x,y,z\"; it must be \"t_s,x_m,y_m,z_m\", after which \"buttons\" and \"qx,qy,qz,qw\" may follow",
        ),
        (
            "",
            "hand.csv:1: the header is \"\"; it must be \"t_s,x_m,y_m,z_m\", after which \"buttons\" and \"qx,qy,qz,qw\" may follow",
        ),
        (&format!("{ok}0.002,0,abc,0\n"), "hand.csv:4: y_m is \"abc\"; it must be a finite number"),
        (&format!("{ok}0.002,NaN,0,0\n"), "hand.csv:4: x_m is \"NaN\"; it must be a finite number"),
        (&format!("{ok}0.002,0,0,inf\n"), "hand.csv:4: z_m is \"inf\"; it must be a finite number"),
        (&format!("{ok}0.002,0,0\n"), "hand.csv:4: 3 fields; a row has 4"),
        (&format!("{ok}0.002,0,0,0,0\n"), "hand.csv:4: 5 fields; a row has 4"),
        (&format!("{ok}0.003,0,0,0\n"), "hand.csv:4: t_s is 0.003; rows are 1 ms apart, so it must be 0.002"),
        (&format!("{ok}0.001,0,0,0\n"), "hand.csv:4: t_s is 0.001; rows are 1 ms apart, so it must be 0.002"),
        (&format!("{ok}0.002,0,55,0\n"), "hand.csv:4: y_m is 55 m; positions lie within 10 m of the origin"),
        (
            "t_s,x_m,y_m,z_m\n1000,0,0,0\n1000,0,0,0\n",
            "hand.csv:3: t_s is 1000; rows are 1 ms apart, so it must be 1000.001",
        ),
        ("t_s,x_m,y_m,z_m\n0,0,0,0\n", "hand.csv: 1 rows; a trajectory has at least 2"),
    ] {
        assert_eq!(message(text), expected);
    }
    assert!(read(ok).is_ok());
}

#[test]
fn buttons_and_orientations_are_optional_columns() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turned = DQuat::from_xyzw(0.0, half, 0.0, half);
    let readings: Vec<Reading> = (0..20)
        .map(|i| Reading {
            buttons: u32::from(i > 9) << 1,
            orientation: if i > 14 { turned } else { DQuat::IDENTITY },
            ..Reading::at(DVec3::X * 1e-3 * f64::from(i))
        })
        .collect();
    let written = |readings: &[Reading]| {
        let mut text = Vec::new();
        Trajectory::from_readings(readings).unwrap().to_csv(&mut text).unwrap();
        String::from_utf8(text).unwrap()
    };
    let text = written(&readings);
    assert!(text.starts_with("t_s,x_m,y_m,z_m,buttons,qx,qy,qz,qw\n0.000,0.0000000,"), "{text}");
    let hand = read(&text).unwrap();
    for (row, reading) in readings.iter().enumerate() {
        let found = hand.reading(row).unwrap();
        assert!(found.is_usable() && found.buttons == reading.buttons);
        assert!(found.position_m.distance(reading.position_m) < 1e-9);
        assert!(found.orientation.angle_between(reading.orientation) < 1e-6);
    }
    assert_eq!(hand.reading(20), None);
    // A replay includes buttons and repeats the trajectory.
    let mut device = ReplayDevice::new(hand, ReplayEnd::Repeat);
    device.open().unwrap();
    let buttons: Vec<u32> =
        (0..40).map(|_| device.read(std::time::Duration::ZERO).unwrap().buttons).collect();
    assert_eq!(buttons, [[0; 10], [2; 10], [0; 10], [2; 10]].concat());
    // Absent columns are not written.
    assert!(written(&readings[..10]).starts_with("t_s,x_m,y_m,z_m\n"));
    assert!(written(&readings[..15]).starts_with("t_s,x_m,y_m,z_m,buttons\n"));
    assert!(written(&readings[15..]).starts_with("t_s,x_m,y_m,z_m,buttons,q"));
    assert!(read("t_s,x_m,y_m,z_m,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n0.001,0,0,0,0,0,1,0\n").is_ok());
}

#[test]
fn rejects_invalid_buttons_and_orientations() {
    let row = |buttons: &str, orientation: &str| {
        let header = "t_s,x_m,y_m,z_m,buttons,qx,qy,qz,qw";
        read(&format!("{header}\n0,0,0,0,1,0,0,0,1\n0.001,0,0,0,{buttons},{orientation}\n")).unwrap_err()
    };
    for buttons in ["-1", "0.5"] {
        let error = row(buttons, "0,0,0,1");
        assert!(
            matches!(&error, TrajectoryError::Buttons { line: 3, found, .. } if found == buttons),
            "{error}"
        );
    }
    let error = row("0", "0,0,0,2");
    assert!(matches!(error, TrajectoryError::Orientation { line: 3, found: 2.0, .. }), "{error}");
    let error = row("0", "0,x,0,1");
    assert!(
        matches!(&error, TrajectoryError::Number { line: 3, column, found, .. } if column == "qy" && found == "x"),
        "{error}"
    );
    let error = row("0", "0,0,0");
    assert!(
        matches!(error, TrajectoryError::Csv(CsvError::Fields { line: 3, found: 8, expected: 9, .. })),
        "{error}"
    );
    for header in
        ["t_s,x_m,y_m,z_m,button", "t_s,x_m,y_m,z_m,qx,qy,qz", "t_s,x_m,y_m,z_m,qx,qy,qz,qw,buttons"]
    {
        let error = read(&format!("{header}\n0,0,0,0,0\n")).unwrap_err();
        assert!(matches!(&error, TrajectoryError::Header { found, .. } if found == header), "{error}");
    }
    let not_unit = Reading { orientation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.5), ..Reading::at(DVec3::ZERO) };
    assert!(Trajectory::from_readings(&[not_unit, not_unit]).is_err());
}

#[test]
fn rejects_text_that_is_not_utf_8_with_its_line() {
    let bytes = b"t_s,x_m,y_m,z_m\n0,0,0,0\n0.001,0,\xff\xfe,0\n";
    let error = Trajectory::from_csv(bytes.as_slice(), "hand.csv").unwrap_err();
    assert!(matches!(error, TrajectoryError::Csv(CsvError::Syntax { line: 3, .. })), "{error}");
    assert!(std::error::Error::source(&error).unwrap().is::<csv::Error>());
}

#[test]
fn missing_file_is_reported_with_path_and_cause() {
    let error = Trajectory::from_csv_file("no/such.csv").unwrap_err();
    assert_eq!(error.to_string(), "no/such.csv: cannot be read or written");
    assert!(std::error::Error::source(&error).is_some());
}

#[test]
fn generated_trajectory_has_plausible_speed_tremor_and_depth() {
    let probe = Probe::default();
    let still = Probe { tremor_m: 0.0, ..probe }.trajectory().unwrap();
    let hand = probe.trajectory().unwrap();
    let positions = hand.positions_m();
    let step = |i: usize| (positions[(i + 1) % positions.len()] - positions[i]).length();
    let fastest = (0..positions.len()).map(step).fold(0.0, f64::max) / Trajectory::PERIOD_S;
    assert!(fastest < 0.25, "no jump, not even at the repetition: {fastest} m/s");
    let tremor = positions.iter().zip(still.positions_m()).map(|(a, b)| (*a - *b).length_squared() / 3.0);
    let rms = (tremor.sum::<f64>() / positions.len() as f64).sqrt();
    assert!((rms - 1e-4).abs() < 1e-9, "{rms} m");
    // The last probe is the deepest. The oscillation of a dwell adds 8 % of its depth.
    let deepest = still.positions_m().iter().map(|p| depth_m(&probe, *p)).fold(0.0, f64::max);
    assert!((deepest / probe.depth_m - 1.08).abs() < 5e-3, "{deepest} m");
    assert_ne!(Probe { seed: 2, ..probe }.trajectory().unwrap(), hand);
}

/// Depth of `at` below the surface of `probe`, m: the distance from the surface's closest point, by Newton steps along the normal.
fn depth_m(probe: &Probe, at: DVec3) -> f64 {
    let [x, z] = probe.curvature_per_m;
    let mut foot = at;
    for _ in 0..20 {
        let from_top = foot - probe.top_m;
        let fall_m = 0.5 * (x * from_top.x * from_top.x + z * from_top.z * from_top.z);
        foot.y = probe.top_m.y - fall_m;
        let normal = DVec3::new(x * from_top.x, 1.0, z * from_top.z).normalize();
        let across = (at - foot) - (at - foot).dot(normal) * normal;
        foot += across;
    }
    let normal_y = (at - foot).y;
    -at.distance(foot).copysign(normal_y)
}

#[test]
fn probes_a_dome_at_the_same_depths_as_a_plane() {
    let dome = Probe { tremor_m: 0.0, ..Probe::default() };
    let plane = Probe { curvature_per_m: [0.0; 2], ..dome };
    let (over_dome, over_plane) = (dome.trajectory().unwrap(), plane.trajectory().unwrap());
    for (a, b) in over_dome.positions_m().iter().zip(over_plane.positions_m()) {
        let (on_dome_m, on_plane_m) = (depth_m(&dome, *a), plane.top_m.y - b.y);
        assert!((on_dome_m - on_plane_m).abs() < 1e-6, "{on_dome_m} m, {on_plane_m} m");
    }
}

#[test]
fn slides_along_the_circle_while_it_dwells() {
    let probe = Probe { tremor_m: 0.0, curvature_per_m: [0.0; 2], ..Probe::default() };
    let hand = probe.trajectory().unwrap();
    let across_m = |tick: usize| {
        let at = hand.positions_m()[tick];
        DVec3::new(at.x - probe.center_m[0], 0.0, at.z - probe.center_m[1])
    };
    for probed in 0..4 {
        let [from, to] = [350, 650].map(|tick| across_m(1250 * probed + tick));
        assert!((from.distance(to) - probe.slide_m).abs() < 1e-9);
        assert!(((0.5 * (from + to)).length() - probe.radius_m).abs() < 1e-9);
        assert!((to - from).dot(from + to).abs() < 1e-9, "along the tangent");
    }
}

#[test]
fn rejects_probe_parameters_out_of_range() {
    let good = Probe::default();
    for bad in [
        Probe { probes: 0, ..good },
        Probe { probes: 1001, ..good },
        Probe { depth_m: f64::NAN, ..good },
        Probe { depth_m: -0.01, ..good },
        Probe { tremor_m: f64::INFINITY, ..good },
        Probe { top_m: DVec3::new(0.0, f64::NAN, 0.0), ..good },
        Probe { top_m: DVec3::X * 1.5, ..good },
        Probe { curvature_per_m: [0.0, f64::NAN], ..good },
        Probe { curvature_per_m: [-101.0, 0.0], ..good },
        Probe { center_m: [0.0, -2.0], ..good },
        Probe { center_m: [f64::NAN, 0.0], ..good },
        Probe { radius_m: -0.01, ..good },
        Probe { slide_m: 0.2, ..good },
    ] {
        assert!(matches!(bad.trajectory(), Err(HapticsError::Setting { .. })), "{bad:?}");
    }
}

#[test]
fn rejects_invalid_positions() {
    assert!(Trajectory::from_positions(vec![DVec3::ZERO, DVec3::ONE]).is_ok());
    for bad in [vec![DVec3::ZERO], vec![DVec3::ZERO, DVec3::NAN], vec![DVec3::ZERO, DVec3::X * 11.0]] {
        assert!(matches!(Trajectory::from_positions(bad), Err(HapticsError::Setting { .. })));
    }
}
