//! Virtual coupling, contact compliance, statistics of local models and the black box in an app, in lock step.

use bevy_palpate::prelude::*;
use bevy_palpate::{
    BlackBoxDump, ContactCompliance, HapticFaultKind, LocalModelStats, SimulatedBody, ToolCoupling, ToolLoop,
};
use palpate_body::BodyError;
use palpate_haptics::{Reading, ScriptedDevice};
use palpate_laws::LawError;
use palpate_tests::app::*;

/// A device that moves through a 10 cm block at 0.25 m/s and back, from 0.1 s on, when its loop has a local model.
fn piercing_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let t = (n as f64 * 1e-3 - 0.1).max(0.0);
        let height = 0.057 - 0.25 * t.min(0.6) + 0.25 * (t - 1.0).clamp(0.0, 0.6);
        Ok(Reading::at(DVec3::new(0.012, height, 0.009)))
    })
}

/// Maximum force before the safety chain over 36 model steps, and the force at the end, N.
fn pierce(coupling: ToolCoupling) -> (f64, f64) {
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, piercing_hand);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().coupling = coupling;
    let (mut force, mut last) = (0.0_f64, 0.0);
    for _ in 0..36 {
        step(&mut app, 1);
        last = app.world().get::<ToolForce>(tool).unwrap().model_force_n.length();
        force = force.max(last);
    }
    // Some cells are inverted and the surface folds; both are reported.
    let kinds = take_kinds(&mut app);
    let is_expected = |kind: &HapticFaultKind| {
        matches!(kind, HapticFaultKind::InvertedCells { .. } | HapticFaultKind::BeyondSupport { .. })
    };
    assert!(kinds.len() < 3 && kinds.iter().all(is_expected), "{kinds:?}");
    (force, last)
}

#[test]
fn virtual_coupling_is_the_default_and_limits_the_force() {
    let ToolCoupling::Virtual { max_force_n, .. } = ToolCoupling::default() else {
        panic!("the default is a virtual coupling")
    };
    let (force, last) = pierce(ToolCoupling::default());
    assert!(force <= max_force_n * (1.0 + 1e-9) && force > 0.98 * max_force_n, "{force} N");
    assert_eq!(last, 0.0);
    let gentle = ToolCoupling::Virtual { stiffness_n_per_m: 5e3, max_force_n: 2.0 };
    let (force, _) = pierce(gentle);
    assert!(force <= 2.0 * (1.0 + 1e-9) && force > 1.9, "{force} N");
    let (force, _) = pierce(ToolCoupling::Rigid);
    assert!(force > 1.5 * max_force_n, "{force} N");
}

/// A device that descends onto a 10 cm block and rests at a depth of 2 mm from 0.4 s on.
fn resting_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let height = 0.057 - 0.004 * (n as f64 * 2.5e-3).min(1.0);
        Ok(Reading::at(DVec3::new(0.012, height, 0.009)))
    })
}

#[test]
fn contact_compliance_switches_during_contact() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, resting_hand);
    let mut force_after = |change: fn(&mut bevy::prelude::EntityWorldMut)| {
        change(&mut app.world_mut().entity_mut(body));
        step(&mut app, 40);
        let is_added = app.world().get::<SimulatedBody>(body).unwrap().body().adds_compliance();
        let force_n = app.world().get::<ToolForce>(tool).unwrap().model_force_n.y;
        assert_no_faults(&mut app);
        (is_added, force_n)
    };
    let (is_added, added_n) = force_after(|_| ());
    assert!(is_added && added_n > 0.1, "{added_n} N");
    let (is_added, grid_n) = force_after(|body| {
        body.insert(ContactCompliance::GridOnly);
    });
    assert!(!is_added && grid_n > 2.5 * added_n, "{grid_n} N, {added_n} N");
    // A rebuilt body keeps it.
    let (is_added, rebuilt_n) =
        force_after(|body| body.get_mut::<Tissue>().unwrap().density_kg_per_m3 *= 1.01);
    assert!(!is_added && (rebuilt_n / grid_n - 1.0).abs() < 0.02, "{rebuilt_n} N, {grid_n} N");
    let (is_added, back_n) = force_after(|body| {
        *body.get_mut::<ContactCompliance>().unwrap() = ContactCompliance::Added;
    });
    assert!(is_added && (back_n / added_n - 1.0).abs() < 0.02, "{back_n} N, {added_n} N");
    force_after(|body| {
        body.insert(ContactCompliance::GridOnly);
    });
    let (is_added, without_n) = force_after(|body| {
        body.remove::<ContactCompliance>();
    });
    assert!(is_added && (without_n / added_n - 1.0).abs() < 0.02, "{without_n} N, {added_n} N");
}

#[test]
fn coupling_with_negative_force_is_rejected_and_the_previous_one_stays() {
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, pressing_hand);
    step(&mut app, 2);
    let bad = ToolCoupling::Virtual { stiffness_n_per_m: 20e3, max_force_n: -1.0 };
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().coupling = bad;
    step(&mut app, 1);
    let kinds = take_kinds(&mut app);
    let is_force =
        matches!(kinds[..], [HapticFaultKind::Tool(BodyError::Tool(LawError::CouplingForce(-1.0)))]);
    assert!(is_force, "{kinds:?}");
    let coupling = app.world().get::<ToolLoop>(tool).unwrap().contact().coupling().unwrap();
    assert_eq!(coupling.max_force_n, 10.0);
}

#[test]
fn local_model_stats_describe_the_newest_local_model() {
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, pressing_hand);
    assert_eq!(app.world().get::<LocalModelStats>(tool), Some(&LocalModelStats::default()));
    step(&mut app, 10);
    let near = *app.world().get::<LocalModelStats>(tool).unwrap();
    assert!((9..40).contains(&near.support_nodes) && near.states > 27 && !near.tangent_clamped, "{near:?}");
    assert!(near.time_s > 0.0 && near.error_bound.is_some_and(|bound| bound < 0.1), "{near:?}");
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().scheme = Scheme::Hold;
    step(&mut app, 1);
    let hold = *app.world().get::<LocalModelStats>(tool).unwrap();
    assert_eq!((hold.states, hold.error_bound), (0, None));
    // Without the tool the component is reset.
    app.world_mut().entity_mut(tool).remove::<HapticTool>();
    step(&mut app, 1);
    assert_eq!(app.world().get::<LocalModelStats>(tool), Some(&LocalModelStats::default()));
}

#[test]
fn black_box_is_written_at_a_device_failure_and_on_request() {
    let folder = std::env::temp_dir().join(format!("palpate-black-box-{}", std::process::id()));
    let mut app = lockstep_app();
    // A device that fails once, at the 300th tick.
    let hand = || {
        ScriptedDevice::new(|n, _| match n {
            300 => Err(palpate_haptics::DeviceError::TimedOut),
            _ => Ok(Reading::at(DVec3::new(0.0, 0.06, 0.0))),
        })
    };
    let (_, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, hand);
    app.world_mut().entity_mut(tool).insert(BlackBoxDump::in_folder(&folder));
    step(&mut app, 5);
    let files = |app: &bevy::app::App| app.world().get::<BlackBoxDump>(tool).unwrap().files().to_vec();
    assert_eq!(files(&app), [""; 0].map(std::path::PathBuf::from));
    step(&mut app, 3);
    assert_eq!(files(&app).len(), 1);
    // The name contains the reported fault.
    let report = take_reports(&mut app).remove(0).to_lowercase();
    let words: Vec<&str> =
        report.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let name = files(&app)[0].file_name().unwrap().to_string_lossy().into_owned();
    assert!(name.contains(&words[..5].join("-")), "{name}, {report}");
    let ticks = palpate_haptics::Recording::read_csv(&files(&app)[0]).unwrap();
    assert!(
        ticks
            .ticks()
            .iter()
            .any(|tick| tick.read_failed == Some(palpate_haptics::RecordedDeviceError::TimedOut))
    );
    app.world_mut().get_mut::<BlackBoxDump>(tool).unwrap().request("user request");
    step(&mut app, 1);
    assert_eq!(files(&app).len(), 2);
    let name = files(&app)[1].file_name().unwrap().to_string_lossy().into_owned();
    assert!(name.contains("user-request"), "{name}");
    std::fs::remove_dir_all(folder).unwrap();
}
