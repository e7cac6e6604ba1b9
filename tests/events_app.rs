//! State of bodies, observers, contact results and schedule options in an app, in lock step.

use crate::observed_events::Received::{Fault, Grasp, Leave, Ready, Release, Torn, Touch};
use crate::observed_events::{Received, events, observed_app};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    DeviceSelector, FaultSeverity, HapticFaultKind, HidSelector, ToolContactPoint, ToolCoupling,
};
use palpate_haptics::{DeviceError, LoopEventKind, Reading, ScriptedDevice};
use palpate_tests::app::{
    assert_no_faults, force_n, lockstep_app, pressing_hand, resting_hand, spawn_block, spawn_scene,
    spawn_tool, step, take_faults, take_kinds,
};

fn tool_force(app: &App, tool: Entity) -> ToolForce {
    *app.world().get::<ToolForce>(tool).unwrap()
}

fn contact(app: &App, tool: Entity) -> ToolContactPoint {
    tool_force(app, tool).contact.expect("a contact")
}

/// A device that rests on the surface with its button pressed from 0.3 s to 0.6 s.
fn grasping_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let t = n as f64 * 1e-3;
        let down = (t / 0.2).min(1.0) * (1.0 - ((t - 0.7) / 0.1).clamp(0.0, 1.0));
        let buttons = u32::from((0.3..0.6).contains(&t));
        Ok(Reading { buttons, ..Reading::at(DVec3::new(0.012, 0.0597 - 0.005 * down, 0.009)) })
    })
}

#[test]
fn contact_observers_of_the_tool_and_global_ones_run_once() {
    #[derive(Resource, Default)]
    struct OfTool(Vec<(Entity, f64)>);
    let mut app = observed_app();
    app.init_resource::<OfTool>();
    let (body, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, pressing_hand);
    app.world_mut().entity_mut(tool).observe(|start: On<ContactStart>, mut seen: ResMut<OfTool>| {
        seen.0.push((start.body, start.normal.y));
    });
    step(&mut app, 10);
    assert_eq!(events(&mut app), [Ready(body), Touch(tool, body)]);
    let seen = &app.world().resource::<OfTool>().0;
    assert!(matches!(seen[..], [(on, normal)] if on == body && normal > 0.99), "{seen:?}");
    step(&mut app, 20);
    assert_eq!(events(&mut app), [Leave(tool, body)]);
}

#[test]
fn grasp_observers_run_within_the_contact() {
    let mut app = observed_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, grasping_hand);
    app.world_mut().entity_mut(tool).insert(ToolGrasp::default());
    step(&mut app, 24);
    let seen = events(&mut app);
    let expected = [Ready(body), Touch(tool, body), Grasp(tool, body), Release(tool, body)];
    assert_eq!(seen[..4], expected, "{seen:?}");
    // After the release the contact ends, and may start and end again.
    assert_eq!(seen[4], Leave(tool, body), "{seen:?}");
    let again: Vec<Received> = seen[5..].to_vec();
    assert!(again.chunks(2).all(|pair| pair == [Touch(tool, body), Leave(tool, body)]), "{seen:?}");
}

/// In the frame of a change of the body, the end of the old contact precedes the start of the new one.
#[test]
fn end_is_observed_before_the_start_of_the_same_model_step() {
    let mut app = observed_app();
    // The centre stays outside the body, so a contact with a new body starts at once.
    let (body, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, || {
        ScriptedDevice::new(|n, _| {
            Ok(Reading::at(DVec3::new(0.012, 0.06 - 0.0085 * (n as f64 / 300.0).min(1.0), 0.009)))
        })
    });
    step(&mut app, 16);
    assert_eq!(events(&mut app), [Ready(body), Touch(tool, body)]);
    app.world_mut().entity_mut(body).insert(DeformableBody::block([7, 7, 7], 0.1));
    step(&mut app, 1);
    assert_eq!(events(&mut app), [Ready(body), Leave(tool, body), Touch(tool, body)]);
}

/// Each start is followed by one end, also without the tool or the body.
#[test]
fn despawn_in_contact_or_grasp_triggers_the_ends() {
    for is_grasp in [false, true] {
        for is_tool in [false, true] {
            let mut app = observed_app();
            let device = if is_grasp { grasping_hand } else { resting_hand };
            let (body, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, device);
            app.world_mut().entity_mut(tool).insert(ToolGrasp::default());
            step(&mut app, 9);
            let mut starts = vec![Ready(body), Touch(tool, body)];
            starts.extend(is_grasp.then_some(Grasp(tool, body)));
            let what = format!("grasp {is_grasp}, tool {is_tool}");
            assert_eq!(events(&mut app), starts, "{what}");
            assert!(app.world_mut().despawn(if is_tool { tool } else { body }));
            step(&mut app, 2);
            let mut ends: Vec<Received> = is_grasp.then_some(Release(tool, body)).into_iter().collect();
            ends.push(Leave(tool, body));
            assert_eq!(events(&mut app), ends, "{what}");
        }
    }
}

#[test]
fn suture_observer_runs_once_when_the_thread_tears() {
    let mut app = observed_app();
    let body = spawn_block(&mut app);
    let ends_m = [DVec3::new(-0.02, 0.05, 0.0), DVec3::new(0.02, 0.05, 0.0)];
    let suture = Suture { body, ends_m, length_m: 0.02, stiffness_n_per_m: 1e3, tear_limit_n: 0.01 };
    let suture = app.world_mut().spawn(suture).id();
    step(&mut app, 10);
    let seen = events(&mut app);
    assert_eq!(seen, [Ready(body), Torn(suture, body)]);
    assert!(app.world().get::<SutureForce>(suture).unwrap().is_torn);
}

#[test]
fn fault_observer_receives_entity_and_severity() {
    let mut app = observed_app();
    let tool = app.world_mut().spawn(HapticTool::new("missing")).id();
    app.update();
    assert_eq!(events(&mut app), [Fault(Some(tool), FaultSeverity::Error)]);
}

#[test]
fn severities_are_ordered_and_follow_the_kind() {
    assert!(FaultSeverity::Load < FaultSeverity::Warning && FaultSeverity::Warning < FaultSeverity::Error);
    for (kind, expected) in [
        (HapticFaultKind::SamplesLost { lost: 1 }, FaultSeverity::Load),
        (HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(3)), FaultSeverity::Load),
        (HapticFaultKind::Loop(LoopEventKind::ForceNotFinite), FaultSeverity::Warning),
        (HapticFaultKind::Loop(LoopEventKind::Panicked), FaultSeverity::Error),
        (HapticFaultKind::InvertedCells { cells: 2 }, FaultSeverity::Warning),
        (HapticFaultKind::NonFiniteTransform, FaultSeverity::Error),
        (HapticFaultKind::LoopEnded, FaultSeverity::Error),
    ] {
        let fault = HapticFault::new(None, kind);
        assert_eq!((fault.severity(), fault.kind.severity()), (expected, expected), "{fault:?}");
    }
}

/// The place of the tool in the world, from its transform and those of its parents.
fn world_place(app: &mut App, tool: Entity) -> Vec3 {
    let place =
        |In(tool): In<Entity>, helper: TransformHelper| helper.compute_global_transform(tool).unwrap();
    app.world_mut().run_system_cached_with(place, tool).unwrap().translation()
}

#[test]
fn tool_with_a_parent_is_drawn_where_its_device_is() {
    let mut app = lockstep_app();
    let device_m = DVec3::new(0.3, 0.1, -0.2);
    spawn_block(&mut app);
    let tool = spawn_tool(&mut app, move || ScriptedDevice::new(move |_, _| Ok(Reading::at(device_m))));
    app.world_mut().get_mut::<Transform>(tool).unwrap().scale = Vec3::splat(0.5);
    let parent = Transform::from_xyz(1.0, -2.0, 0.5)
        .with_rotation(Quat::from_euler(EulerRot::XYZ, 0.3, -0.8, 1.1))
        .with_scale(Vec3::splat(2.0));
    let root = app.world_mut().spawn(Transform::from_xyz(0.0, 0.4, 0.0).with_scale(Vec3::splat(3.0))).id();
    let parent = app.world_mut().spawn((parent, ChildOf(root))).id();
    app.world_mut().entity_mut(tool).insert(ChildOf(parent));
    for _ in 0..10 {
        // A parent that moves in every frame does not move the tool.
        app.world_mut().get_mut::<Transform>(root).unwrap().translation.x += 0.1;
        step(&mut app, 1);
        let place = world_place(&mut app, tool);
        assert!((place - device_m.as_vec3()).length() < 1e-5, "{place}");
        assert_eq!(app.world().get::<Transform>(tool).unwrap().scale, Vec3::splat(0.5));
    }
    assert_eq!(tool_force(&app, tool).device_position_m, device_m);
    assert_no_faults(&mut app);
    // A parent that cannot be inverted is reported once, and the tool stays.
    let before = *app.world().get::<Transform>(tool).unwrap();
    app.world_mut().get_mut::<Transform>(root).unwrap().scale.y = 0.0;
    step(&mut app, 3);
    let kinds: Vec<HapticFaultKind> = take_faults(&mut app).into_iter().map(|fault| fault.kind).collect();
    assert!(matches!(kinds[..], [HapticFaultKind::ToolParent]), "{kinds:?}");
    assert_eq!(*app.world().get::<Transform>(tool).unwrap(), before);
    app.world_mut().entity_mut(tool).remove::<ChildOf>();
    step(&mut app, 1);
    assert_eq!(app.world().get::<Transform>(tool).unwrap().translation, device_m.as_vec3());
    assert_no_faults(&mut app);
}

/// A device that fails once in 100 ms: each failure and each recovery is an event of the loop.
#[test]
fn failure_ten_times_a_second_is_reported_once_in_five_seconds() {
    let mut app = lockstep_app();
    let tool = spawn_tool(&mut app, || {
        ScriptedDevice::new(|n, _| match n % 100 {
            50 => Err(DeviceError::Protocol("a test")),
            _ => Ok(Reading::at(DVec3::Y)),
        })
    });
    step(&mut app, 240);
    let is_failure = |fault: &HapticFault| {
        fault.entity == Some(tool)
            && matches!(fault.kind, HapticFaultKind::Loop(LoopEventKind::DeviceFailed(_)))
    };
    let faults: Vec<HapticFault> = take_faults(&mut app).into_iter().filter(is_failure).collect();
    let counts: Vec<u32> = faults.iter().map(|fault| fault.suppressed_count).collect();
    assert!(matches!(counts[..], [0, 45..=55, 45..=55]), "{counts:?}");
}

#[test]
fn tool_force_has_sample_device_position_and_contact() {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, resting_hand);
    assert_eq!(tool_force(&app, tool).contact, None);
    step(&mut app, 30);
    let force = tool_force(&app, tool);
    // One sample per tick, 50 per model step.
    assert!((1499..=1500).contains(&force.sample), "{}", force.sample);
    assert!((force.device_position_m - DVec3::new(0.011, 0.05, 0.009)).length() < 1e-12, "{force:?}");
    let contact = contact(&app, tool);
    assert!((contact.normal - DVec3::Y).length() < 0.05, "{contact:?}");
    assert!(force.force_n.dot(contact.normal) > 0.5, "{force:?}");
    // The surface yields by a part of the depth of 5 mm.
    assert!((5e-4..5e-3).contains(&contact.depth_m), "{contact:?}");
    let top_m = contact.point_m.y + contact.depth_m;
    assert!((top_m - 0.05).abs() < 1e-4, "undeformed, the point is on the top: {contact:?}");
    assert!((contact.point_m - force.device_position_m).with_y(0.0).length() < 1e-3, "{contact:?}");
    app.world_mut().despawn(body);
    step(&mut app, 2);
    assert_eq!(tool_force(&app, tool).contact, None);
}

#[test]
fn tool_force_changes_only_when_a_value_differs() {
    #[derive(Resource, Default)]
    struct Changes(usize);
    let mut app = lockstep_app();
    app.init_resource::<Changes>().add_systems(
        Last,
        |changed: Query<(), Changed<ToolForce>>, mut changes: ResMut<Changes>| {
            changes.0 += changed.iter().count();
        },
    );
    spawn_scene(&mut app, Scheme::NearFieldExact, resting_hand);
    step(&mut app, 10);
    let changes = app.world().resource::<Changes>().0;
    assert!((9..=12).contains(&changes), "{changes}: the sample differs at every model step");
    // Without model steps no value differs.
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    (0..3).for_each(|_| app.update());
    app.world_mut().resource_mut::<Changes>().0 = 0;
    (0..10).for_each(|_| app.update());
    assert_eq!(app.world().resource::<Changes>().0, 0);
}

/// The depth is the displacement from the undeformed body at its present pose, not at that of the build.
#[test]
fn contact_depth_is_independent_of_a_move_by_the_transform() {
    let pose = Transform::from_xyz(0.03, 0.02, -0.01).with_rotation(Quat::from_rotation_z(0.4));
    let to_world = move |local_m: DVec3| pose.rotation.as_dquat() * local_m + pose.translation.as_dvec3();
    // Presses along the normal of the top, in the frame of the body at rest or of the moved body.
    let run = |is_moved: bool| {
        let mut app = lockstep_app();
        let body = spawn_block(&mut app);
        let tool = spawn_tool(&mut app, move || {
            ScriptedDevice::new(move |n, _| {
                let depth_m = 0.006 * ((n as f64 - 200.0) / 200.0).clamp(0.0, 1.0) - 0.001;
                let local_m = DVec3::new(0.011, 0.055 - depth_m, 0.009);
                Ok(Reading::at(if is_moved { to_world(local_m) } else { local_m }))
            })
        });
        step(&mut app, 2);
        if is_moved {
            app.world_mut().entity_mut(body).insert(pose);
        }
        step(&mut app, 28);
        assert_no_faults(&mut app);
        (contact(&app, tool), force_n(&app, tool).length())
    };
    let (still, still_n) = run(false);
    let (moved, moved_n) = run(true);
    assert!(still.depth_m > 5e-4, "{still:?}");
    assert!((moved.depth_m / still.depth_m - 1.0).abs() < 1e-2, "{moved:?}, {still:?}");
    assert!((moved_n / still_n - 1.0).abs() < 1e-2, "{moved_n} N, {still_n} N");
    assert!((moved.normal - pose.rotation.as_dquat() * still.normal).length() < 1e-2, "{moved:?}, {still:?}");
    assert!((moved.point_m - to_world(still.point_m)).length() < 1e-4, "{moved:?}, {still:?}");
}

#[test]
fn new_tool_selects_the_named_device_and_keeps_the_defaults() {
    let tool = HapticTool::new("x");
    assert_eq!(tool, HapticTool { device: DeviceSelector::named("x"), ..HapticTool::default() });
    let body = Entity::PLACEHOLDER;
    let shape = ToolShape::Sphere { radius_m: 0.01 };
    let changed = HapticTool::new(String::from("y"))
        .with_shape(shape)
        .with_friction(0.1)
        .with_scheme(Scheme::Hold)
        .with_coupling(ToolCoupling::Rigid)
        .with_body(body);
    let expected = HapticTool {
        device: DeviceSelector::named("y"),
        scheme: Scheme::Hold,
        shape,
        friction: 0.1,
        coupling: ToolCoupling::Rigid,
        body: Some(body),
    };
    assert_eq!(changed, expected);
    assert_eq!(HapticTool::new(HidSelector::first()).device, DeviceSelector::first_hid());
}

#[test]
fn kinds_of_one_frame_are_observed_and_written_as_messages() {
    let mut app = observed_app();
    app.world_mut().spawn(HapticTool::new("missing"));
    app.world_mut().spawn(DeformableBody::block([1, 6, 6], 0.1));
    app.update();
    let kinds = take_kinds(&mut app);
    assert_eq!((kinds.len(), events(&mut app).len()), (2, 2), "{kinds:?}");
}
