//! Stand-in devices keep the contract that real ones must keep.

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
fn a_replay_gives_its_rows_and_then_stays_or_begins_anew() {
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
fn a_script_hears_the_force_that_was_written_last() {
    let mut device = ScriptedDevice::new(|n, force| Ok(Reading::at(DVec3::new(n as f64, force.y, 0.0))));
    device.open().unwrap();
    assert_eq!(device.read(WITHIN).unwrap().position_m, DVec3::ZERO);
    device.write(DVec3::Y * 2.0).unwrap();
    assert_eq!(device.read(WITHIN).unwrap().position_m, DVec3::new(1.0, 2.0, 0.0));
}

#[test]
fn a_closed_device_says_so_and_can_be_opened_again() {
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
            assert_eq!(device.read(WITHIN).unwrap().position_m, DVec3::X, "from the beginning, no old force");
            device.write(DVec3::Y).unwrap();
            device.close().unwrap();
        }
        assert!(device.describe().rate_hz == 1000.0 && device.describe().max_force_n > 0.0);
    }
}

#[test]
fn readings_that_are_no_readings_are_seen() {
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
fn descriptions_that_make_no_sense_are_refused() {
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
fn the_safety_chain_s_settings_follow_from_the_description() {
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

fn follow(hand: FollowerSettings, place_m: DVec3) -> (FollowerTarget, FollowerDevice) {
    let (mut place, mut device) = hand.follow().unwrap();
    device.open().unwrap();
    place.set(place_m, 0);
    (place, device)
}

#[test]
fn a_hand_follows_a_place_that_jumps_without_a_jump_and_no_faster_than_it_may() {
    let hand = FollowerSettings::default();
    let (_place, mut device) = follow(hand, DVec3::X * 0.1);
    let (mut last, mut speed) = (DVec3::ZERO, 0.0);
    for _ in 0..1000 {
        let reading = device.read(WITHIN).unwrap();
        let now = (reading.position_m - last).length() / 1e-3;
        // At the end of a tick it is as fast as during it, but for what it gains or loses meanwhile.
        assert!((reading.velocity_m_per_s.unwrap().length() - now).abs() < 0.1 * 1600.0 * 1e-3);
        assert!(now <= hand.max_speed_m_per_s + 1e-9, "{now} m/s");
        // No more acceleration than the spring, stretched by all of it, can give.
        assert!((now - speed) / 1e-3 <= 0.1 * 40.0 * 40.0, "{now} m/s after {speed} m/s");
        assert!(reading.position_m.x < 0.1 + 1e-12, "critically damped: it does not go beyond");
        (last, speed) = (reading.position_m, now);
    }
    assert!((last.x - 0.1).abs() < 1e-9);
}

#[test]
fn a_hand_lags_by_two_over_omega_behind_an_even_motion() {
    let hand = FollowerSettings::default();
    let (mut place, mut device) = follow(hand, DVec3::ZERO);
    let speed = 0.1;
    let mut lag = 0.0;
    for tick in 1..=1000 {
        let at = speed * 1e-3 * f64::from(tick);
        place.set(DVec3::Y * at, 0);
        lag = at - device.read(WITHIN).unwrap().position_m.y;
    }
    // The place stands still within a tick, so the lag is that of a motion half a tick ahead.
    let expected = speed * (2.0 / hand.rate_per_s - 0.5e-3);
    assert!((lag - expected).abs() < 1e-3 * expected, "{lag} m, not {expected} m");
}

#[test]
fn a_hand_that_follows_yields_to_force_keeps_its_workspace_and_tells_its_buttons() {
    let hand = FollowerSettings::default();
    let (mut place, mut device) = follow(hand, DVec3::ZERO);
    let force = DVec3::new(0.0, 2.0, 0.0);
    let settle =
        |device: &mut FollowerDevice| (0..2000).map(|_| device.read(WITHIN).unwrap()).last().unwrap();
    device.write(force).unwrap();
    let beside = settle(&mut device).position_m;
    assert!((beside - force / (0.2 * 40.0 * 40.0)).length() < 1e-9, "{beside}");
    device.write(DVec3::ZERO).unwrap();
    place.set(DVec3::new(0.5, -0.3, 0.1), 0b101);
    let reading = settle(&mut device);
    assert!((reading.position_m - DVec3::new(0.2, -0.2, 0.1)).length() < 1e-9);
    assert_eq!(reading.buttons, 0b101);
    place.set(DVec3::NAN, 0);
    let there = settle(&mut device);
    assert!(there.is_usable() && (there.position_m - reading.position_m).length() < 1e-9);
    for bad in [
        FollowerSettings { rate_per_s: 0.0, ..hand },
        FollowerSettings { mass_kg: f64::NAN, ..hand },
        FollowerSettings { max_speed_m_per_s: -1.0, ..hand },
        FollowerSettings { workspace_m: [DVec3::ONE, DVec3::ZERO], ..hand },
        FollowerSettings { start_m: DVec3::NAN, ..hand },
    ] {
        assert!(matches!(bad.follow(), Err(HapticsError::Setting { .. })), "{bad:?}");
    }
}
