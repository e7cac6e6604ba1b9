//! Simulated devices fulfil the contract of [`HapticDevice`].

use glam::DVec3;
use palpate_haptics::*;
use std::time::Duration;

const WITHIN: Duration = Duration::from_millis(1);

fn trajectory() -> Trajectory {
    Trajectory::from_csv("t_s,x_m,y_m,z_m\n0,1,0,0\n0.001,2,0,0\n0.002,3,0,0\n".as_bytes(), "t.csv").unwrap()
}

fn x_of(device: &mut dyn HapticDevice) -> f64 {
    device.read(WITHIN).unwrap().position_m.x
}

#[test]
fn replay_returns_rows_then_stays_or_repeats() {
    for (at_end, expected) in
        [(ReplayEnd::Stay, [1.0, 2.0, 3.0, 3.0, 3.0]), (ReplayEnd::Repeat, [1.0, 2.0, 3.0, 1.0, 2.0])]
    {
        let mut device = ReplayDevice::new(trajectory(), at_end);
        device.open().unwrap();
        assert_eq!([(); 5].map(|()| x_of(&mut device)), expected);
    }
    let description = ReplayDevice::new(trajectory(), ReplayEnd::Stay).describe();
    assert_eq!(description.workspace_m, [DVec3::X, DVec3::X * 3.0]);
}

#[test]
fn script_receives_last_written_force() {
    let mut device = ScriptedDevice::new(|n, force| Ok(Reading::at(DVec3::new(n as f64, force.y, 0.0))));
    device.open().unwrap();
    assert_eq!(device.read(WITHIN).unwrap().position_m, DVec3::ZERO);
    device.write(DVec3::Y * 2.0).unwrap();
    assert_eq!(device.read(WITHIN).unwrap().position_m, DVec3::new(1.0, 2.0, 0.0));
}

#[test]
fn closed_device_returns_not_open_and_can_be_reopened() {
    let devices: [Box<dyn HapticDevice>; 2] = [
        Box::new(ReplayDevice::new(trajectory(), ReplayEnd::Stay)),
        Box::new(ScriptedDevice::new(|n, force| Ok(Reading::at(DVec3::new(1.0 + n as f64, force.y, 0.0))))),
    ];
    for mut device in devices {
        assert_eq!(device.read(WITHIN), Err(DeviceError::NotOpen));
        assert_eq!(device.write(DVec3::ZERO), Err(DeviceError::NotOpen));
        for _ in 0..2 {
            device.open().unwrap();
            assert_eq!(device.open(), Err(DeviceError::AlreadyOpen));
            assert_eq!(
                device.read(WITHIN).unwrap().position_m,
                DVec3::X,
                "from the first row, without an old force"
            );
            device.write(DVec3::Y).unwrap();
            device.close().unwrap();
        }
        assert!(device.describe().rate_hz == 1000.0 && device.describe().max_force_n > 0.0);
    }
}

#[test]
fn detects_unusable_readings() {
    let good = Reading::at(DVec3::ONE);
    assert!(good.is_usable());
    for bad in [
        Reading::at(DVec3::new(0.0, f64::NAN, 0.0)),
        Reading::at(DVec3::INFINITY),
        Reading { velocity_m_per_s: Some(DVec3::NAN), ..good },
        Reading { orientation: glam::DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..good },
        Reading { orientation: glam::DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0), ..good },
    ] {
        assert!(!bad.is_usable());
    }
}

#[test]
fn rejects_invalid_descriptions() {
    let good = ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe();
    good.validate().unwrap();
    ReplayDevice::new(trajectory(), ReplayEnd::Stay).describe().validate().unwrap();
    for bad in [
        DeviceDescription { max_force_n: f64::NAN, ..good.clone() },
        DeviceDescription { max_force_n: -1.0, ..good.clone() },
        DeviceDescription { max_force_n: f64::INFINITY, ..good.clone() },
        DeviceDescription { rate_hz: 0.0, ..good.clone() },
        DeviceDescription { workspace_m: [DVec3::ONE, DVec3::ZERO], ..good.clone() },
        DeviceDescription { workspace_m: [DVec3::ZERO, DVec3::NAN], ..good.clone() },
    ] {
        assert!(matches!(bad.validate(), Err(HapticsError::Setting { .. })), "{bad:?}");
    }
}

#[test]
fn safety_settings_follow_from_description() {
    let of = |max_force_n: f64, rate_hz: f64| {
        let arm = ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe();
        let settings = DeviceDescription { max_force_n, rate_hz, ..arm }.safety(1e-3);
        settings.validate().unwrap();
        settings
    };
    let good = SafetySettings::default();
    assert_eq!(of(20.0, 1000.0), SafetySettings { max_force_n: 20.0, ..good });
    let weak = SafetySettings { max_force_n: 2.0, max_slew_n_per_s: 100.0, arm_below_n: 0.1, ..good };
    assert_eq!(of(2.0, 1000.0), weak);
    assert_eq!(of(20.0, 60.0).device_timeout_ticks, 50);
    assert_eq!((of(0.0, 1000.0).max_force_n, of(0.0, 1000.0).arm_below_n), (0.0, 0.0));
}

fn follow(settings: FollowerSettings, target_m: DVec3) -> (FollowerTarget, FollowerDevice) {
    let (mut target, mut device) = settings.follow().unwrap();
    device.open().unwrap();
    target.set(target_m, 0);
    (target, device)
}

#[test]
fn follower_moves_continuously_within_speed_limit_to_jumped_target() {
    let settings = FollowerSettings::default();
    let (_target, mut device) = follow(settings, DVec3::X * 0.1);
    let (mut last, mut speed) = (DVec3::ZERO, 0.0);
    for _ in 0..1000 {
        let reading = device.read(WITHIN).unwrap();
        let now = (reading.position_m - last).length() / 1e-3;
        // The velocity at the end of a tick differs from the mean by the change within the tick.
        assert!((reading.velocity_m_per_s.unwrap().length() - now).abs() < 0.1 * 1600.0 * 1e-3);
        assert!(now <= settings.max_speed_m_per_s + 1e-9, "{now} m/s");
        // The acceleration is at most that of the fully stretched spring.
        assert!((now - speed) / 1e-3 <= 0.1 * 40.0 * 40.0, "{now} m/s after {speed} m/s");
        assert!(reading.position_m.x < 0.1 + 1e-12, "critically damped: no overshoot");
        (last, speed) = (reading.position_m, now);
    }
    assert!((last.x - 0.1).abs() < 1e-9);
}

#[test]
fn follower_lags_by_two_over_omega_at_constant_speed() {
    let settings = FollowerSettings::default();
    let (mut target, mut device) = follow(settings, DVec3::ZERO);
    let speed = 0.1;
    let mut lag = 0.0;
    for tick in 1..=1000 {
        let at = speed * 1e-3 * f64::from(tick);
        target.set(DVec3::Y * at, 0);
        lag = at - device.read(WITHIN).unwrap().position_m.y;
    }
    // The target is constant within a tick, which shortens the lag by half a tick.
    let expected = speed * (2.0 / settings.rate_per_s - 0.5e-3);
    assert!((lag - expected).abs() < 1e-3 * expected, "{lag} m, not {expected} m");
}

#[test]
fn follower_yields_to_force_stays_in_workspace_and_reports_buttons() {
    let settings = FollowerSettings::default();
    let (mut target, mut device) = follow(settings, DVec3::ZERO);
    let force = DVec3::new(0.0, 2.0, 0.0);
    let settle =
        |device: &mut FollowerDevice| (0..2000).map(|_| device.read(WITHIN).unwrap()).last().unwrap();
    device.write(force).unwrap();
    let pushed = settle(&mut device).position_m;
    assert!((pushed - force / (0.2 * 40.0 * 40.0)).length() < 1e-9, "{pushed}");
    device.write(DVec3::ZERO).unwrap();
    target.set(DVec3::new(0.5, -0.3, 0.1), 0b101);
    let reading = settle(&mut device);
    assert!((reading.position_m - DVec3::new(0.2, -0.2, 0.1)).length() < 1e-9);
    assert_eq!(reading.buttons, 0b101);
    target.set(DVec3::NAN, 0);
    let kept = settle(&mut device);
    assert!(kept.is_usable() && (kept.position_m - reading.position_m).length() < 1e-9);
    for bad in [
        FollowerSettings { rate_per_s: 0.0, ..settings },
        FollowerSettings { mass_kg: f64::NAN, ..settings },
        FollowerSettings { max_speed_m_per_s: -1.0, ..settings },
        FollowerSettings { workspace_m: [DVec3::ONE, DVec3::ZERO], ..settings },
        FollowerSettings { start_m: DVec3::NAN, ..settings },
    ] {
        assert!(matches!(bad.follow(), Err(HapticsError::Setting { .. })), "{bad:?}");
    }
}
