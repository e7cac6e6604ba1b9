//! A headless app in lock step: the whole ring inside Bevy, without threads, sleeps or a renderer.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{ModelStepCount, SimulatedBody, TickRecording, ToolLoop};
use palpate_tests::app::{Contacts, lockstep_app, pressing_hand, spawn_scene, step, take_faults};

fn forces(app: &mut App, tool: Entity, steps: u64) -> Vec<DVec3> {
    (0..steps)
        .map(|_| {
            step(app, 1);
            app.world().get::<ToolForce>(tool).unwrap().force_n
        })
        .collect()
}

#[test]
fn a_hand_that_presses_a_block_is_pushed_back_and_let_go() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    let forces = forces(&mut app, tool, 26);
    assert!(forces.iter().all(|f| f.is_finite() && f.y >= 0.0));
    let peak = forces.iter().map(|f| f.y).fold(0.0, f64::max);
    assert!((0.5..5.0).contains(&peak), "{peak} N");
    assert_eq!((forces[0], forces[25]), (DVec3::ZERO, DVec3::ZERO));
    assert_eq!(take_faults(&mut app), [""; 0]);
    let simulated = app.world().get::<SimulatedBody>(body).unwrap();
    assert!(simulated.last_step().substeps >= 4);
    assert_eq!(app.world().resource::<ModelStepCount>().0, 26);
}

#[test]
fn the_error_against_the_full_body_is_told_at_every_model_step() {
    let worst = |scheme| {
        let mut app = lockstep_app();
        let (_, tool) = spawn_scene(&mut app, scheme, pressing_hand);
        let mut errors = Vec::new();
        for _ in 0..26 {
            step(&mut app, 1);
            errors.push(*app.world().get::<ForceError>(tool).unwrap());
        }
        // Fifty ticks a step, but for those before the first local model.
        assert!(errors[2..].iter().all(|error| error.ticks == 50), "{errors:?}");
        let store = app.world().resource::<bevy::diagnostic::DiagnosticsStore>();
        let told = store.get(&bevy_palpate::HapticDiagnosticsPlugin::LOCAL_MODEL_ERROR).unwrap();
        assert_eq!(told.value(), errors.last().map(|error| error.rms_n));
        let felt: Vec<f64> = errors.iter().filter_map(|error| error.relative).collect();
        let share: Vec<f64> = errors.iter().filter_map(|error| error.jnd_ratio).collect();
        assert!(felt.len() > 10 && (share[0] - felt[0] / 0.07).abs() < 1e-12);
        felt.iter().skip(1).copied().fold(0.0, f64::max)
    };
    let (near, hold) = (worst(Scheme::NearFieldExact), worst(Scheme::Hold));
    assert!(near < 0.02 && hold > 0.2, "near field exact {near}, hold {hold}");
}

#[test]
fn a_tool_that_outruns_its_local_model_is_told() {
    let mut app = lockstep_app();
    // Down on one side of the block, and across it at 1 m/s.
    let hand = || {
        ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            let x = -0.035 + (t - 0.5).clamp(0.0, 0.07);
            Ok(Reading::at(DVec3::new(x, 0.055 - 0.002 * (t / 0.3).min(1.0), 0.001)))
        })
    };
    spawn_scene(&mut app, Scheme::NearFieldExact, hand);
    step(&mut app, 10);
    assert_eq!(take_faults(&mut app), [""; 0]);
    step(&mut app, 10);
    let said = take_faults(&mut app);
    assert!(said.len() == 1 && said[0].starts_with("the tool touched beyond the 16 nodes"), "{said:?}");
}

#[test]
fn touching_and_letting_go_are_told_once_each() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Hold, pressing_hand);
    app.add_systems(Update, move |mut began: MessageReader<ContactStart>| {
        for message in began.read() {
            assert_eq!((message.body, message.tool), (body, tool));
            assert!((message.normal - DVec3::Y).length() < 0.1, "{}", message.normal);
            assert!((message.point_m - DVec3::new(0.01, 0.05, 0.01)).length() < 0.01);
        }
    });
    step(&mut app, 10);
    assert_eq!(told(&app), ["began"]);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(body));
    step(&mut app, 16);
    assert_eq!(told(&app), ["began", "ended"]);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, None);
}

fn told(app: &App) -> Vec<&'static str> {
    app.world().resource::<Contacts>().0.clone()
}

/// However a contact ends, it is told that it has, and nothing is displayed any more.
#[test]
fn every_end_of_a_contact_is_told() {
    type End = fn(&mut World, Entity, Entity);
    let ends: [(&str, End); 8] = [
        ("body despawned", |world, body, _| assert!(world.despawn(body))),
        ("tool despawned", |world, _, tool| assert!(world.despawn(tool))),
        ("body is a body no longer", |world, body, _| {
            world.entity_mut(body).remove::<DeformableBody>();
        }),
        ("tool is a tool no longer", |world, _, tool| {
            world.entity_mut(tool).remove::<HapticTool>();
        }),
        ("device gone", |world, _, tool| {
            world.get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::named("none");
        }),
        ("another body asked for", |world, _, tool| {
            world.get_mut::<HapticTool>(tool).unwrap().body = Some(tool);
        }),
        ("fewer nodes", |world, body, _| {
            world.entity_mut(body).insert(DeformableBody::block([3; 3], 0.1));
        }),
        ("the touched node fixed", |world, body, _| {
            world.entity_mut(body).insert(FixedRegion::Faces(vec![BoxFace::Top, BoxFace::Bottom]));
        }),
    ];
    for (what, end) in ends {
        let mut app = lockstep_app();
        let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
        step(&mut app, 10);
        assert!(app.world().get::<ToolForce>(tool).unwrap().force_n.y > 0.1);
        assert_eq!(told(&app), ["began"]);
        end(app.world_mut(), body, tool);
        step(&mut app, 2);
        assert_eq!(told(&app)[..2], ["began", "ended"], "{what}");
        let again = told(&app).len() > 2;
        if let (Some(touching), Some(force)) =
            (app.world().get::<TouchedBody>(tool), app.world().get::<ToolForce>(tool))
        {
            assert_eq!(touching.body.is_some(), again, "{what}");
            assert!(again || force.force_n == DVec3::ZERO, "{what}: {force:?}");
        }
        let faults = take_faults(&mut app);
        let expected = ["device gone", "another body asked for"].contains(&what);
        assert_eq!(faults.len(), usize::from(expected), "{what}: {faults:?}");
    }
}

/// All bits of a run: every tick's force, and the body at the end.
fn bits(scheme: Scheme) -> Vec<u64> {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, scheme, pressing_hand);
    app.world_mut().entity_mut(tool).insert(TickRecording::default());
    step(&mut app, 20);
    let recording = app.world().get::<TickRecording>(tool).unwrap();
    assert_eq!((recording.records.len(), recording.dropped), (1000, 0));
    let forces = recording.records.iter().flat_map(|r| (r.force_n + r.rendered.force_n).to_array());
    let body = app.world().get::<SimulatedBody>(body).unwrap().body();
    let state = body.positions_m().iter().chain(body.velocities_m_per_s()).flat_map(|v| v.to_array());
    forces.chain(state).map(f64::to_bits).collect()
}

#[test]
fn the_same_scene_gives_the_same_bits() {
    for scheme in Scheme::ALL {
        let first = bits(scheme);
        assert!(first.iter().any(|&b| f64::from_bits(b) > 0.5), "something happens");
        for _ in 0..2 {
            assert!(first == bits(scheme), "{}", scheme.name());
        }
    }
}

#[test]
fn a_second_of_app_time_is_twenty_model_steps_whatever_the_fixed_rate() {
    for hz in [64.0, 20.0, 100.0, 7.0] {
        let mut app = lockstep_app();
        app.insert_resource(Time::<Fixed>::from_hz(hz));
        for _ in 0..=200 {
            app.update();
        }
        let steps = app.world().resource::<ModelStepCount>().0;
        let expected = (10.0 - 1.0 / hz) * 20.0;
        assert!((steps as f64) > expected - 1.0 && steps <= 200, "{steps} steps at {hz} Hz");
        assert_eq!(
            app.world().resource::<Time<Fixed>>().timestep().as_secs_f64(),
            Time::<Fixed>::from_hz(hz).timestep().as_secs_f64()
        );
    }
}

#[test]
fn a_pause_in_lock_step_changes_no_bit() {
    let run = |pause: bool| {
        let mut app = lockstep_app();
        let (_, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
        let mut forces = forces(&mut app, tool, 10);
        if pause {
            app.world_mut().resource_mut::<Time<Virtual>>().pause();
            let before = app.world().resource::<ModelStepCount>().0;
            (0..5).for_each(|_| app.update());
            assert_eq!(app.world().resource::<ModelStepCount>().0, before);
            app.world_mut().resource_mut::<Time<Virtual>>().unpause();
        }
        forces.extend(self::forces(&mut app, tool, 5));
        forces
    };
    let forces = run(true);
    assert_eq!(forces, run(false));
    assert!(forces[14].y > 0.5);
}

#[test]
fn a_body_that_is_put_there_anew_is_felt() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    step(&mut app, 4);
    app.world_mut().get_mut::<Tissue>(body).unwrap().youngs_modulus_pa *= 1.5;
    step(&mut app, 2);
    app.world_mut().entity_mut(body).remove::<DeformableBody>().insert(DeformableBody::block([5, 5, 5], 0.1));
    step(&mut app, 4);
    assert!(app.world().get::<ToolForce>(tool).unwrap().force_n.y > 0.3);
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn a_recording_goes_on_over_a_change_of_device() {
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    app.world_mut().entity_mut(tool).insert(TickRecording::default());
    step(&mut app, 10);
    app.world_mut().resource_mut::<HapticDevices>().register("other", || Ok(pressing_hand()));
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::named("other");
    step(&mut app, 10);
    let recording = app.world().get::<TickRecording>(tool).unwrap();
    assert_eq!((recording.records.len(), recording.samples.len(), recording.dropped), (1000, 1000, 0));
}

#[test]
fn material_changed_under_the_tool_acts_and_keeps_the_shape() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    step(&mut app, 12);
    let before = app.world().get::<SimulatedBody>(body).unwrap().body().positions_m().to_vec();
    let soft = app.world().get::<ToolForce>(tool).unwrap().force_n.y;
    app.world_mut().get_mut::<Tissue>(body).unwrap().youngs_modulus_pa *= 2.0;
    step(&mut app, 1);
    let simulated = app.world().get::<SimulatedBody>(body).unwrap();
    assert_eq!(simulated.epoch(), 2, "the second build of this app");
    let moved =
        simulated.body().positions_m().iter().zip(&before).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(moved < 3e-3, "{moved} m");
    step(&mut app, 2);
    let hard = app.world().get::<ToolForce>(tool).unwrap().force_n.y;
    assert!(hard > 1.5 * soft, "{soft} N, then {hard} N");
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn bodies_that_make_no_sense_are_faults_with_a_cause() {
    let mut app = lockstep_app();
    app.world_mut().spawn(DeformableBody::block([1, 6, 6], 0.1));
    app.world_mut().spawn(DeformableBody::block([6, 6, 6], f64::NAN));
    app.world_mut()
        .spawn((DeformableBody::block([6, 6, 6], 0.1), Tissue { density_kg_per_m3: 0.0, ..default() }));
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), Transform::from_scale(Vec3::splat(2.0))));
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), Transform::from_xyz(f32::NAN, 0.0, 0.0)));
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), Transform::from_scale(Vec3::ZERO)));
    let mirrored = Transform::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), mirrored));
    app.world_mut().spawn(DeformableBody::block([40, 40, 40], 0.1));
    let fixed = FixedRegion::Vertices(vec![true, false, true]);
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), fixed));
    app.world_mut()
        .spawn((DeformableBody::block([5, 5, 5], 0.001), Tissue { youngs_modulus_pa: 1e12, ..default() }));
    app.update();
    assert_eq!(
        take_faults(&mut app),
        [
            "the body cannot be built: a block needs 2 to 128 nodes along each axis; it was given [1, 6, 6]",
            "the body cannot be built: size along x, m is NaN; it must be finite and above 0",
            "the body cannot be built: density, kg/m3 is 0; it must be finite and above 0",
            "the body's transform has scale [2, 2, 2], is mirrored or is sheared by its parents; its scale must be 1: give the size to \
             the body itself",
            "the body's transform, or that of a parent, is not finite: place it again",
            "the body's transform has scale [0, 0, 0], is mirrored or is sheared by its parents; its scale must be 1: give the size to \
             the body itself",
            "the body's transform has scale [1, 1, 1], is mirrored or is sheared by its parents; its scale must be 1: give the size to \
             the body itself",
            "the body cannot be built: nodes of a block in all is 64000; it must be at most 10000: no more could be stepped in time",
            "the body cannot be built: fixed vertices of a block is 2; it must be 0: fix its faces, or what is within regions",
            "the body cannot be built: 440836 substeps of a tick are needed; at most 1000 are allowed: soften the \
             springs or use fewer nodes (or raise `max_substeps`)",
        ]
    );
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app), [""; 0], "said once");
    let mut scaled = app.world_mut().query_filtered::<(Entity, &mut Transform), Without<SimulatedBody>>();
    let (entity, mut transform) = scaled.iter_mut(app.world_mut()).find(|(_, t)| t.scale.x == 2.0).unwrap();
    transform.scale = Vec3::ONE;
    app.update();
    assert!(app.world().get::<SimulatedBody>(entity).is_some(), "put right, it is built");
}

#[test]
fn tools_that_make_no_sense_are_faults_with_a_cause() {
    let mut app = lockstep_app();
    let spawn = |app: &mut App, tool: HapticTool| app.world_mut().spawn(tool).id();
    spawn(&mut app, HapticTool::default());
    app.update();
    app.world_mut().resource_mut::<HapticDevices>().register("a", || Ok(pressing_hand()));
    app.world_mut()
        .resource_mut::<HapticDevices>()
        .register("broken", || -> Result<ScriptedDevice, _> { Err("no cable".into()) });
    for device in ["b", "broken"] {
        spawn(&mut app, HapticTool { device: DeviceSelector::named(device), ..default() });
    }
    spawn(&mut app, HapticTool { device: DeviceSelector::replay("no/such.csv"), ..default() });
    spawn(
        &mut app,
        HapticTool {
            device: DeviceSelector::named("a"),
            shape: ToolShape::Sphere { radius_m: 0.0 },
            ..default()
        },
    );
    spawn(&mut app, HapticTool { device: DeviceSelector::named("a"), ..default() });
    app.update();
    let said = take_faults(&mut app);
    assert_eq!(
        said,
        [
            "the tool has no device: there is no device named \"default\"; registered are: none",
            // Devices have been registered, so it is tried again.
            "the tool has no device: there is no device named \"default\"; registered are: a, broken",
            "the tool has no device: there is no device named \"b\"; registered are: a, broken",
            "the tool has no device: the device could not be made: no cable",
            "the tool has no device: the recorded hand cannot be read: no/such.csv: cannot be read or written: No such \
             file or directory (os error 2)",
            "the tool is refused: radius of a tool is 0 m; it must be finite and above 0",
        ]
    );
    step(&mut app, 3);
    assert_eq!(take_faults(&mut app), [""; 0], "said once");
}

#[test]
fn settings_that_make_no_sense_are_said_once_and_the_rest_goes_on() {
    for bad in [-1.0, f64::NAN] {
        let mut app = lockstep_app();
        let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
        step(&mut app, 10);
        app.world_mut().get_mut::<ToolSettings>(tool).unwrap().safety.max_slew_n_per_s = bad;
        app.world_mut().get_mut::<Tissue>(body).unwrap().youngs_modulus_pa *= 1.1;
        step(&mut app, 4);
        let said = take_faults(&mut app);
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].starts_with("the tool's settings are refused: largest growth of the force, N/s is "));
        assert!(app.world().get::<ToolForce>(tool).unwrap().force_n.y > 0.5, "the old settings serve");
    }
    // A tool that was spawned with them starts when they have been put right.
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    app.world_mut().get_mut::<ToolSettings>(tool).unwrap().frame.scale = 0.0;
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app).len(), 1);
    assert!(app.world().get::<ToolLoop>(tool).is_none());
    app.world_mut().get_mut::<ToolSettings>(tool).unwrap().frame.scale = 1.0;
    step(&mut app, 1);
    assert!(app.world().get::<ToolLoop>(tool).is_some());
}

#[test]
fn the_mesh_follows_the_body_where_the_entity_stands() {
    use bevy::mesh::VertexAttributeValues;
    let mut app = lockstep_app();
    app.add_plugins((TransformPlugin, AssetPlugin::default(), bevy::mesh::MeshPlugin));
    app.finish();
    app.world_mut().resource_mut::<HapticDevices>().register("hand", || {
        Ok(ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            // Onto the node at (1.01, 0.05, 0.01).
            Ok(Reading::at(DVec3::new(1.01, 0.057 - 0.01 * t.min(0.8), 0.01)))
        }))
    });
    let block = (
        DeformableBody::block([6, 6, 6], 0.1),
        FixedRegion::Face(BoxFace::Bottom),
        Transform::from_xyz(1.0, 0.0, 0.0),
    );
    let body = app.world_mut().spawn(block).id();
    let tool = app.world_mut().spawn(HapticTool { device: DeviceSelector::named("hand"), ..default() }).id();
    let vertices = |app: &App| {
        let mesh = app.world().get::<Mesh3d>(body).unwrap();
        let meshes = app.world().resource::<Assets<Mesh>>();
        match meshes.get(&mesh.0).unwrap().attribute(Mesh::ATTRIBUTE_POSITION).unwrap() {
            VertexAttributeValues::Float32x3(positions) => positions.clone(),
            _ => unreachable!(),
        }
    };
    step(&mut app, 1);
    let rest = vertices(&app);
    assert_eq!(rest.len(), 6 * 36);
    assert!(rest.iter().flatten().all(|v| v.abs() <= 0.0500001));
    step(&mut app, 18);
    let pressed = vertices(&app);
    let deepest = rest.iter().zip(&pressed).map(|(a, b)| a[1] - b[1]).fold(0.0, f32::max);
    let height = app.world().get::<Transform>(tool).unwrap().translation.y;
    // The cells give way by a part of the depth; the rest is finer than they are.
    let depth = 0.05 - (height - 0.005);
    assert!((0.2..0.9).contains(&(deepest / depth)), "{deepest} m of {depth} m");
}

#[test]
fn a_removed_tool_or_body_is_simulated_no_more() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Hold, pressing_hand);
    step(&mut app, 3);
    app.world_mut().entity_mut(tool).remove::<HapticTool>();
    app.world_mut().entity_mut(body).remove::<DeformableBody>();
    app.update();
    assert!(app.world().get::<ToolLoop>(tool).is_none() && app.world().get::<SimulatedBody>(body).is_none());
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn another_device_means_another_loop() {
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::Hold, pressing_hand);
    step(&mut app, 10);
    assert!(app.world().get::<TouchedBody>(tool).unwrap().body.is_some());
    let away = || Ok(ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::Y * 0.5))));
    app.world_mut().resource_mut::<HapticDevices>().register("away", away);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::named("away");
    step(&mut app, 4);
    assert_eq!(app.world().get::<Transform>(tool).unwrap().translation, Vec3::Y * 0.5);
    assert_eq!(app.world().get::<ToolForce>(tool).unwrap().force_n, DVec3::ZERO);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, None);
}

#[test]
fn model_rates_are_whole_ticks() {
    for (hz, ticks) in [(20.0, 50), (25.0, 40), (100.0, 10), (1000.0, 1), (5.0, 200)] {
        assert_eq!(ModelRate::try_from_hz(hz).unwrap().ticks(), ticks);
        assert_eq!(ModelRate::every_ticks(ticks).unwrap(), ModelRate::try_from_hz(hz).unwrap());
    }
    for hz in [0.0, -20.0, 30.0, 4.0, 2000.0, f64::NAN, f64::INFINITY] {
        let error = ModelRate::try_from_hz(hz).unwrap_err().to_string();
        assert!(
            error.ends_with("it must be 5 to 1000, with a whole number of milliseconds between two steps")
        );
    }
    assert!(ModelRate::every_ticks(0).is_err() && ModelRate::every_ticks(201).is_err());
}

#[test]
fn systems_that_were_added_before_the_plugin_run() {
    #[derive(Resource, Default)]
    struct Runs(u32);
    let mut app = App::new();
    let count = |mut runs: ResMut<Runs>| runs.0 += 1;
    app.init_resource::<Runs>().add_systems(ModelSchedule, count.in_set(HapticSystems::Last));
    let lockstep = HapticSchedulePlugin { mode: LoopMode::Lockstep, ..default() };
    let step_s = std::time::Duration::from_millis(50);
    app.add_plugins((MinimalPlugins, PalpatePlugins.set(lockstep)))
        .insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(step_s));
    step(&mut app, 3);
    assert_eq!(app.world().resource::<Runs>().0, 3);
}

#[test]
#[should_panic(expected = "palpate's ToolPlugin needs HapticSchedulePlugin")]
fn a_group_without_its_schedule_says_what_is_missing() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins.build().disable::<HapticSchedulePlugin>()));
    app.finish();
}

#[test]
#[should_panic(expected = "ambigu")]
fn ambiguous_systems_in_a_model_step_are_an_error() {
    let mut app = lockstep_app();
    app.add_systems(
        ModelSchedule,
        (|_: Query<&mut ToolForce>| (), |_: Query<&mut ToolForce>| ()).in_set(HapticSystems::Last),
    );
    spawn_scene(&mut app, Scheme::Hold, pressing_hand);
    step(&mut app, 1);
}
