//! A headless app in lock step: the full pipeline inside Bevy, without threads, sleeps or a renderer.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    DeviceSelector, ForceError, HapticFaultKind, ModelStepCount, SimulatedBody, TickRecording, ToolLoop,
};
use palpate_haptics::{Reading, ScriptedDevice};
use palpate_tests::app::Contact::{End, Start};
use palpate_tests::app::{
    assert_no_faults, contacts, force_n, lockstep_app, pressing_hand, spawn_scene, step, take_kinds,
};

/// Forces on the hand after each of `steps` model steps, N.
fn forces(app: &mut App, tool: Entity, steps: u64) -> Vec<DVec3> {
    (0..steps)
        .map(|_| {
            step(app, 1);
            force_n(app, tool)
        })
        .collect()
}

#[test]
fn block_pushes_a_pressing_hand_back() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    let forces = forces(&mut app, tool, 26);
    assert!(forces.iter().all(|f| f.is_finite() && f.y >= 0.0));
    let peak = forces.iter().map(|f| f.y).fold(0.0, f64::max);
    assert!((0.5..5.0).contains(&peak), "{peak} N");
    assert_eq!((forces[0], forces[25]), (DVec3::ZERO, DVec3::ZERO));
    assert_no_faults(&mut app);
    let simulated = app.world().get::<SimulatedBody>(body).unwrap();
    assert!(simulated.last_step().substeps >= 4);
    assert_eq!(app.world().resource::<ModelStepCount>().0, 26);
}

#[test]
fn force_error_is_measured_at_every_model_step() {
    let worst = |scheme| {
        let mut app = lockstep_app();
        let (_, tool) = spawn_scene(&mut app, scheme, pressing_hand);
        let mut errors = Vec::new();
        for _ in 0..26 {
            step(&mut app, 1);
            errors.push(*app.world().get::<ForceError>(tool).unwrap());
        }
        // Fifty ticks in a step, except before the first local model.
        assert!(errors[2..].iter().all(|error| error.ticks == 50), "{errors:?}");
        let store = app.world().resource::<bevy::diagnostic::DiagnosticsStore>();
        let diagnostic = store.get(&bevy_palpate::HapticDiagnosticsPlugin::FORCE_ERROR).unwrap();
        assert_eq!(diagnostic.value(), errors.last().map(|error| error.rms_n));
        let relative: Vec<f64> = errors.iter().filter_map(|error| error.relative).collect();
        let jnd_ratio: Vec<f64> = errors.iter().filter_map(|error| error.jnd_ratio).collect();
        assert!(relative.len() > 10 && (jnd_ratio[0] - relative[0] / 0.07).abs() < 1e-12);
        relative.iter().skip(1).copied().fold(0.0, f64::max)
    };
    let (near, hold) = (worst(Scheme::NearFieldExact), worst(Scheme::Hold));
    assert!(near < 0.02 && hold > 0.2, "near field exact {near}, hold {hold}");
}

#[test]
fn contact_beyond_the_support_set_is_a_fault() {
    let mut app = lockstep_app();
    // Onto one side of the block, and across it at 1 m/s.
    let hand = || {
        ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            let x = -0.035 + (t - 0.5).clamp(0.0, 0.07);
            Ok(Reading::at(DVec3::new(x, 0.055 - 0.002 * (t / 0.3).min(1.0), 0.001)))
        })
    };
    spawn_scene(&mut app, Scheme::NearFieldExact, hand);
    step(&mut app, 10);
    assert_no_faults(&mut app);
    step(&mut app, 10);
    let kinds = take_kinds(&mut app);
    assert!(matches!(kinds[..], [HapticFaultKind::BeyondSupport { nodes: 16 }]), "{kinds:?}");
}

#[test]
fn contact_has_one_start_and_one_end_message() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Hold, pressing_hand);
    app.add_systems(Update, move |mut starts: MessageReader<ContactStart>| {
        for message in starts.read() {
            assert_eq!((message.body, message.tool), (body, tool));
            assert!((message.normal - DVec3::Y).length() < 0.1, "{}", message.normal);
            assert!((message.point_m - DVec3::new(0.01, 0.05, 0.01)).length() < 0.01);
        }
    });
    step(&mut app, 10);
    assert_eq!(contacts(&app), [Start]);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(body));
    step(&mut app, 16);
    assert_eq!(contacts(&app), [Start, End]);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, None);
}

/// Afterwards no force is rendered.
#[test]
fn every_end_of_a_contact_has_a_message() {
    type Cause = fn(&mut World, Entity, Entity);
    let causes: [(&str, Cause); 8] = [
        ("body despawned", |world, body, _| assert!(world.despawn(body))),
        ("tool despawned", |world, _, tool| assert!(world.despawn(tool))),
        ("DeformableBody removed", |world, body, _| {
            world.entity_mut(body).remove::<DeformableBody>();
        }),
        ("HapticTool removed", |world, _, tool| {
            world.entity_mut(tool).remove::<HapticTool>();
        }),
        ("device missing", |world, _, tool| {
            world.get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::named("none");
        }),
        ("entity without body selected", |world, _, tool| {
            world.get_mut::<HapticTool>(tool).unwrap().body = Some(tool);
        }),
        ("fewer nodes", |world, body, _| {
            world.entity_mut(body).insert(DeformableBody::block([3; 3], 0.1));
        }),
        ("the touched node fixed", |world, body, _| {
            world.entity_mut(body).insert(FixedRegion::Faces(vec![BoxFace::Top, BoxFace::Bottom]));
        }),
    ];
    for (what, end) in causes {
        let mut app = lockstep_app();
        let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
        step(&mut app, 10);
        assert!(force_n(&app, tool).y > 0.1);
        assert_eq!(contacts(&app), [Start]);
        end(app.world_mut(), body, tool);
        step(&mut app, 2);
        assert_eq!(contacts(&app)[..2], [Start, End], "{what}");
        let again = contacts(&app).len() > 2;
        if let (Some(touched), Some(force)) =
            (app.world().get::<TouchedBody>(tool), app.world().get::<ToolForce>(tool))
        {
            assert_eq!(touched.body.is_some(), again, "{what}");
            assert!(again || force.force_n == DVec3::ZERO, "{what}: {force:?}");
        }
        let kinds = take_kinds(&mut app);
        let is_expected = match what {
            "device missing" => matches!(kinds[..], [HapticFaultKind::Device(_)]),
            "entity without body selected" => matches!(kinds[..], [HapticFaultKind::NotABody { .. }]),
            _ => kinds.is_empty(),
        };
        assert!(is_expected, "{what}: {kinds:?}");
    }
}

/// All bits of a run: the force of every tick, and the final state of the body.
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
fn scene_gives_the_same_bits_in_every_run() {
    for scheme in Scheme::ALL {
        let first = bits(scheme);
        assert!(first.iter().any(|&b| f64::from_bits(b) > 0.5), "some force is above 0.5 N");
        for _ in 0..2 {
            assert!(first == bits(scheme), "{}", scheme.name());
        }
    }
}

#[test]
fn pause_changes_no_bit() {
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
fn body_inserted_again_renders_force() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    step(&mut app, 4);
    app.world_mut().get_mut::<Tissue>(body).unwrap().youngs_modulus_pa *= 1.5;
    step(&mut app, 2);
    app.world_mut().entity_mut(body).remove::<DeformableBody>().insert(DeformableBody::block([5, 5, 5], 0.1));
    step(&mut app, 4);
    assert!(app.world().get::<ToolForce>(tool).unwrap().force_n.y > 0.3);
    assert_no_faults(&mut app);
}

#[test]
fn recording_continues_after_a_change_of_device() {
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
fn tissue_change_during_contact_keeps_the_shape() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    step(&mut app, 12);
    let before = app.world().get::<SimulatedBody>(body).unwrap().body().positions_m().to_vec();
    let soft = force_n(&app, tool).y;
    let epoch = app.world().get::<SimulatedBody>(body).unwrap().epoch();
    app.world_mut().get_mut::<Tissue>(body).unwrap().youngs_modulus_pa *= 2.0;
    step(&mut app, 1);
    let simulated = app.world().get::<SimulatedBody>(body).unwrap();
    assert!(simulated.epoch() > epoch);
    let moved =
        simulated.body().positions_m().iter().zip(&before).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(moved < 3e-3, "{moved} m");
    step(&mut app, 2);
    let stiff = force_n(&app, tool).y;
    assert!(stiff > 1.5 * soft, "{soft} N, then {stiff} N");
    assert_no_faults(&mut app);
}

#[test]
fn drawn_mesh_follows_the_body_in_the_frame_of_the_entity() {
    use bevy::mesh::VertexAttributeValues;
    let mut app = lockstep_app();
    app.add_plugins((TransformPlugin, AssetPlugin::default(), bevy::mesh::MeshPlugin));
    app.finish();
    app.world_mut().resource_mut::<HapticDevices>().register("hand", || {
        Ok(ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            // Onto the node at (1.01, 0.05, 0.01) m.
            Ok(Reading::at(DVec3::new(1.01, 0.057 - 0.01 * t.min(0.8), 0.01)))
        }))
    });
    let block = (
        DeformableBody::block([6, 6, 6], 0.1),
        FixedRegion::Face(BoxFace::Bottom),
        Transform::from_xyz(1.0, 0.0, 0.0),
    );
    let body = app.world_mut().spawn(block).id();
    let tool = app.world_mut().spawn(HapticTool::new("hand")).id();
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
    // The cells yield by a part of the depth; the rest is below the size of a cell.
    let depth = 0.05 - (height - 0.005);
    assert!((0.2..0.9).contains(&(deepest / depth)), "{deepest} m of {depth} m");
}

#[test]
fn removed_tool_and_body_are_not_simulated() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::Hold, pressing_hand);
    step(&mut app, 3);
    app.world_mut().entity_mut(tool).remove::<HapticTool>();
    app.world_mut().entity_mut(body).remove::<DeformableBody>();
    app.update();
    assert!(app.world().get::<ToolLoop>(tool).is_none() && app.world().get::<SimulatedBody>(body).is_none());
    step(&mut app, 2);
    assert_no_faults(&mut app);
}

#[test]
fn change_of_device_starts_another_loop() {
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::Hold, pressing_hand);
    step(&mut app, 10);
    assert!(app.world().get::<TouchedBody>(tool).unwrap().body.is_some());
    let away = || Ok(ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::Y * 0.5))));
    app.world_mut().resource_mut::<HapticDevices>().register("away", away);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::named("away");
    step(&mut app, 4);
    assert_eq!(app.world().get::<Transform>(tool).unwrap().translation, Vec3::Y * 0.5);
    assert_eq!(force_n(&app, tool), DVec3::ZERO);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, None);
}
