//! A tool in an app that gives way, and what an app is told of its local models.

use bevy_palpate::prelude::*;
use palpate_tests::app::*;

/// Down through a 10 cm block at 0.25 m/s after 0.1 s, in which its loop gets a local model, and up again.
fn piercing_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let t = (n as f64 * 1e-3 - 0.1).max(0.0);
        let height = 0.057 - 0.25 * t.min(0.6) + 0.25 * (t - 1.0).clamp(0.0, 0.6);
        Ok(Reading::at(DVec3::new(0.012, height, 0.009)))
    })
}

/// The largest force before the safety chain over 36 model steps, and that at the end, N.
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
    // The block gives way only until its cells are inverted and its surface folds, and both are reported.
    let faults = take_faults(&mut app);
    let is_expected = |fault: &String| {
        fault.contains("cells of the body have been inverted") || fault.contains("beyond the")
    };
    assert!(faults.len() < 3 && faults.iter().all(is_expected), "{faults:?}");
    (force, last)
}

#[test]
fn a_tool_gives_way_by_default_and_only_then() {
    let ToolCoupling::Virtual { max_force_n: most_n, .. } = ToolCoupling::default() else {
        panic!("it gives way")
    };
    let (force, last) = pierce(ToolCoupling::default());
    assert!(force <= most_n * (1.0 + 1e-9) && force > 0.98 * most_n, "{force} N");
    assert_eq!(last, 0.0);
    let gentle = ToolCoupling::Virtual { stiffness_n_per_m: 5e3, max_force_n: 2.0 };
    let (force, _) = pierce(gentle);
    assert!(force <= 2.0 * (1.0 + 1e-9) && force > 1.9, "{force} N");
    let (force, _) = pierce(ToolCoupling::Rigid);
    assert!(force > 1.5 * most_n, "{force} N");
}

/// Down onto a 10 cm block, and 2 mm deep into it from 0.4 s on.
fn resting_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let height = 0.057 - 0.004 * (n as f64 * 2.5e-3).min(1.0);
        Ok(Reading::at(DVec3::new(0.012, height, 0.009)))
    })
}

#[test]
fn the_added_compliance_is_switched_while_a_tool_touches() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, resting_hand);
    let mut force_after = |change: fn(&mut bevy::prelude::EntityWorldMut)| {
        change(&mut app.world_mut().entity_mut(body));
        step(&mut app, 40);
        let is_added = app.world().get::<bevy_palpate::SimulatedBody>(body).unwrap().body().adds_compliance();
        let force_n = app.world().get::<ToolForce>(tool).unwrap().model_force_n.y;
        assert_eq!(take_faults(&mut app), [""; 0]);
        (is_added, force_n)
    };
    let (is_added, added_n) = force_after(|_| ());
    assert!(is_added && added_n > 0.1, "{added_n} N");
    let (is_added, grid_n) = force_after(|body| {
        body.insert(ContactCompliance::GridOnly);
    });
    assert!(!is_added && grid_n > 2.5 * added_n, "{grid_n} N, {added_n} N");
    // Another build of the body has it too.
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
fn a_coupling_that_makes_no_sense_is_refused_and_the_old_one_stays() {
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, pressing_hand);
    step(&mut app, 2);
    let bad = ToolCoupling::Virtual { stiffness_n_per_m: 20e3, max_force_n: -1.0 };
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().coupling = bad;
    step(&mut app, 1);
    let said = take_faults(&mut app);
    assert!(said.len() == 1 && said[0].contains("largest force of a tool's coupling is -1 N"), "{said:?}");
    let coupling = app.world().get::<bevy_palpate::ToolLoop>(tool).unwrap().contact().coupling().unwrap();
    assert_eq!(coupling.max_force_n, 10.0);
}

#[test]
fn an_app_knows_what_its_local_models_are() {
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
    // A tool that is one no longer has none.
    app.world_mut().entity_mut(tool).remove::<HapticTool>();
    step(&mut app, 1);
    assert_eq!(app.world().get::<LocalModelStats>(tool), Some(&LocalModelStats::default()));
}

#[test]
fn an_app_keeps_the_last_ticks_when_something_goes_wrong_and_when_it_asks() {
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
    app.world_mut().entity_mut(tool).insert(bevy_palpate::BlackBoxDump::in_folder(&folder));
    step(&mut app, 5);
    let files =
        |app: &bevy::app::App| app.world().get::<bevy_palpate::BlackBoxDump>(tool).unwrap().files().to_vec();
    assert_eq!(files(&app), [""; 0].map(std::path::PathBuf::from));
    step(&mut app, 3);
    assert_eq!(files(&app).len(), 1);
    let name = files(&app)[0].file_name().unwrap().to_string_lossy().into_owned();
    assert!(name.contains("the-device-failed"), "{name}");
    let ticks = palpate_haptics::Recording::read_csv(&files(&app)[0]).unwrap();
    assert!(
        ticks
            .ticks()
            .iter()
            .any(|tick| tick.read_failed == Some(palpate_haptics::RecordedDeviceError::TimedOut))
    );
    app.world_mut().get_mut::<bevy_palpate::BlackBoxDump>(tool).unwrap().request("a user asked");
    step(&mut app, 1);
    assert_eq!(files(&app).len(), 2);
    std::fs::remove_dir_all(folder).unwrap();
}
