//! State of bodies, observers, contact results and schedule options in an app, in lock step.

use bevy::asset::{AssetPlugin, Handle};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    BodyReady, BodyState, DeviceSelector, FaultSeverity, GraspEnd, GraspStart, HapticFaultKind,
    HapticSchedulePlugin, HidSelector, LoopMode, ModelRate, ModelSchedule, ModelStepCount, SimulatedBody,
    ToolContactPoint, ToolCoupling, ToolPlugin, testing,
};
use palpate_haptics::{DeviceError, LoopEventKind, Reading, ScriptedDevice};
use palpate_tests::app::{
    assert_no_faults, collect_messages, force_n, lockstep_app, pressing_hand, spawn_block, spawn_scene,
    spawn_tool, step, take_faults, take_kinds, update_until,
};
use palpate_tests::mesh::{add, ball, mesh_app, replace, spawn_of, torn};
use std::time::Duration;

/// An event that an observer has received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Received {
    Touch(Entity, Entity),
    Leave(Entity, Entity),
    Grasp(Entity, Entity),
    Release(Entity, Entity),
    Torn(Entity, Entity),
    Ready(Entity),
    Fault(Option<Entity>, FaultSeverity),
}
use Received::{Fault, Grasp, Leave, Ready, Release, Torn, Touch};

/// Events of global observers, in order.
#[derive(Resource, Default)]
struct Events(Vec<Received>);

/// Adds global observers for all events.
fn observe(app: &mut App) {
    app.init_resource::<Events>()
        .add_observer(|e: On<ContactStart>, mut all: ResMut<Events>| all.0.push(Touch(e.tool, e.body)))
        .add_observer(|e: On<ContactEnd>, mut all: ResMut<Events>| all.0.push(Leave(e.tool, e.body)))
        .add_observer(|e: On<GraspStart>, mut all: ResMut<Events>| all.0.push(Grasp(e.tool, e.body)))
        .add_observer(|e: On<GraspEnd>, mut all: ResMut<Events>| all.0.push(Release(e.tool, e.body)))
        .add_observer(|e: On<SutureTorn>, mut all: ResMut<Events>| all.0.push(Torn(e.suture, e.body)))
        .add_observer(|e: On<HapticFault>, mut all: ResMut<Events>| all.0.push(Fault(e.entity, e.severity())))
        .add_observer(|e: On<BodyReady>, bodies: Query<&SimulatedBody>, mut all: ResMut<Events>| {
            assert!(bodies.contains(e.body), "an observer of BodyReady finds the simulated body");
            all.0.push(Ready(e.body));
        });
}

fn events(app: &mut App) -> Vec<Received> {
    std::mem::take(&mut app.world_mut().resource_mut::<Events>().0)
}

fn observed_app() -> App {
    let mut app = lockstep_app();
    observe(&mut app);
    app
}

fn state(app: &App, body: Entity) -> BodyState {
    app.world().get::<BodyState>(body).unwrap().clone()
}

fn tool_force(app: &App, tool: Entity) -> ToolForce {
    *app.world().get::<ToolForce>(tool).unwrap()
}

fn contact(app: &App, tool: Entity) -> ToolContactPoint {
    tool_force(app, tool).contact.expect("a contact")
}

/// A device that presses 5 mm into the top of a 10 cm block within 0.2 s and stays.
fn resting_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let depth_m = 0.006 * (n as f64 / 200.0).min(1.0) - 0.001;
        Ok(Reading::at(DVec3::new(0.011, 0.055 - depth_m, 0.009)))
    })
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
fn block_is_ready_rejected_and_ready_again() {
    let mut app = observed_app();
    let body = spawn_block(&mut app);
    assert_eq!(state(&app, body), BodyState::Loading);
    app.update();
    assert_eq!((state(&app, body), events(&mut app)), (BodyState::Ready, vec![Ready(body)]));
    let epoch = |app: &App| app.world().get::<SimulatedBody>(body).unwrap().epoch();
    let first = epoch(&app);
    // A rejected change keeps the simulated body.
    app.world_mut().get_mut::<Tissue>(body).unwrap().density_kg_per_m3 = -1.0;
    app.update();
    let faults = take_faults(&mut app);
    let [HapticFault { entity: Some(entity), kind, .. }] = &faults[..] else { panic!("{faults:?}") };
    assert_eq!((*entity, state(&app, body)), (body, BodyState::Rejected(kind.report())));
    assert_eq!((epoch(&app), events(&mut app)), (first, vec![Fault(Some(body), FaultSeverity::Error)]));
    app.world_mut().get_mut::<Tissue>(body).unwrap().density_kg_per_m3 = 900.0;
    app.update();
    assert_eq!((state(&app, body), events(&mut app)), (BodyState::Ready, vec![Ready(body)]));
    assert!(epoch(&app) > first);
    // Without the component there is no state.
    app.world_mut().entity_mut(body).remove::<DeformableBody>();
    app.update();
    assert_eq!(app.world().get::<BodyState>(body), None);
    assert_no_faults(&mut app);
}

#[test]
fn rejected_transform_is_a_rejected_state_until_it_is_corrected() {
    let mut app = observed_app();
    let scaled = Transform::from_scale(Vec3::splat(2.0));
    let body = app.world_mut().spawn((DeformableBody::block([4; 3], 0.1), scaled)).id();
    app.update();
    assert!(matches!(state(&app, body), BodyState::Rejected(reason) if !reason.is_empty()));
    assert_eq!(events(&mut app), [Fault(Some(body), FaultSeverity::Error)]);
    app.world_mut().get_mut::<Transform>(body).unwrap().scale = Vec3::ONE;
    app.update();
    assert_eq!((state(&app, body), events(&mut app)), (BodyState::Ready, vec![Ready(body)]));
}

#[test]
fn mesh_is_loading_until_it_is_added_and_rejected_with_holes() {
    let mut app = mesh_app();
    observe(&mut app);
    let mesh: Handle<Mesh> = app.world().resource::<Assets<Mesh>>().reserve_handle();
    let body = spawn_of(&mut app, mesh.clone());
    step(&mut app, 3);
    assert_eq!((state(&app, body), events(&mut app)), (BodyState::Loading, vec![]));
    replace(&mut app, &mesh, ball());
    step(&mut app, 2);
    assert_eq!((state(&app, body), events(&mut app)), (BodyState::Ready, vec![Ready(body)]));
    replace(&mut app, &mesh, torn(ball()));
    step(&mut app, 2);
    assert!(matches!(state(&app, body), BodyState::Rejected(_)));
    assert_eq!(events(&mut app), [Fault(Some(body), FaultSeverity::Error)]);
    replace(&mut app, &mesh, ball());
    step(&mut app, 2);
    assert_eq!((state(&app, body), events(&mut app)), (BodyState::Ready, vec![Ready(body)]));
}

/// The state does not count as changed while a mesh is being loaded.
#[test]
fn state_changes_only_when_it_differs() {
    #[derive(Resource, Default)]
    struct Changes(usize);
    let mut app = mesh_app();
    app.init_resource::<Changes>().add_systems(
        Last,
        |changed: Query<(), Changed<BodyState>>, mut changes: ResMut<Changes>| {
            changes.0 += changed.iter().count();
        },
    );
    let mesh: Handle<Mesh> = app.world().resource::<Assets<Mesh>>().reserve_handle();
    spawn_of(&mut app, mesh);
    step(&mut app, 10);
    assert!(app.world().resource::<Changes>().0 <= 2, "{} changes", app.world().resource::<Changes>().0);
}

#[test]
fn background_build_is_in_the_state_building() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins, AssetPlugin::default(), MeshPlugin));
    collect_messages(&mut app);
    observe(&mut app);
    let mesh = add(&mut app, ball());
    let body = spawn_of(&mut app, mesh);
    // The task ends after the update that starts it at the earliest.
    app.update();
    assert_eq!(state(&app, body), BodyState::Building);
    assert!(app.world().get::<SimulatedBody>(body).is_none());
    update_until(&mut app, "the body is built", |app| state(app, body) == BodyState::Ready);
    assert!(events(&mut app).contains(&Ready(body)));
    // A change of the tissue is built in the background too; the previous body stays.
    app.world_mut().get_mut::<Tissue>(body).unwrap().density_kg_per_m3 = 900.0;
    app.update();
    assert_eq!(state(&app, body), BodyState::Building);
    assert!(app.world().get::<SimulatedBody>(body).is_some());
    update_until(&mut app, "the body is built again", |app| state(app, body) == BodyState::Ready);
}

#[test]
fn body_ready_is_also_a_message() {
    let mut app = lockstep_app();
    let body = spawn_block(&mut app);
    app.update();
    let messages: Vec<BodyReady> = app.world_mut().resource_mut::<Messages<BodyReady>>().drain().collect();
    assert_eq!(messages, [BodyReady { body }]);
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

#[test]
fn testing_collects_faults_and_waits_for_rejections() {
    let mut app = testing::headless_app();
    let body = spawn_block(&mut app);
    testing::wait_for_body(&mut app, body);
    testing::assert_no_faults(&mut app, FaultSeverity::Load);
    let empty = app.world_mut().spawn(DeformableBody::block([0; 3], 0.1)).id();
    let reason = testing::wait_for_rejection(&mut app, empty);
    // The faults of several model steps are collected.
    let tool = app.world_mut().spawn(HapticTool::new("missing")).id();
    testing::advance_model_steps(&mut app, 10);
    let faults = testing::take_faults(&mut app);
    assert_eq!(faults.iter().map(|fault| fault.entity).collect::<Vec<_>>(), [Some(empty), Some(tool)]);
    assert_eq!((faults[0].kind.report(), faults[0].report()), (reason.clone(), reason));
    assert_eq!(testing::take_faults(&mut app).len(), 0);
    testing::assert_no_faults(&mut app, FaultSeverity::Load);
}

#[test]
#[should_panic(expected = "faults of severity Warning or above")]
fn testing_asserts_the_severity() {
    let mut app = testing::headless_app();
    app.world_mut().spawn(HapticTool::new("missing"));
    testing::advance_model_steps(&mut app, 1);
    testing::assert_no_faults(&mut app, FaultSeverity::Warning);
}

#[test]
#[should_panic(expected = "expected to be rejected")]
fn testing_waits_for_a_rejection_only() {
    let mut app = testing::headless_app();
    let body = spawn_block(&mut app);
    testing::wait_for_rejection(&mut app, body);
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
fn model_steps_run_in_the_selected_schedule() {
    #[derive(Resource, Default)]
    struct Order(Vec<&'static str>);
    for is_post in [false, true] {
        let mut app = App::new();
        let mut schedule = HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep);
        if is_post {
            schedule = schedule.in_schedule(FixedPostUpdate);
        }
        let step_s = Duration::from_millis(50);
        app.add_plugins((MinimalPlugins, PalpatePlugins.set(schedule)))
            .insert_resource(Time::<Fixed>::from_hz(20.0))
            .insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(step_s))
            .init_resource::<Order>()
            .add_systems(FixedPreUpdate, |mut order: ResMut<Order>| order.0.push("pre"))
            .add_systems(FixedPostUpdate, |mut order: ResMut<Order>| order.0.push("post"))
            .add_systems(FixedLast, |mut order: ResMut<Order>| order.0.push("last"))
            .add_systems(ModelSchedule, |mut order: ResMut<Order>| order.0.push("model"));
        (0..3).for_each(|_| app.update());
        let order = &app.world().resource::<Order>().0;
        let place = |name: &str| order.iter().position(|other| *other == name).unwrap();
        assert_eq!(order.iter().filter(|name| **name == "model").count(), 2, "{order:?}");
        assert!(place("pre") < place("model") && place("model") < place("last"), "{order:?}");
        if !is_post {
            assert!(place("model") < place("post"), "{order:?}");
        }
    }
}

/// A system ordered after all of [`FixedUpdate`] precedes the model step in [`FixedPostUpdate`].
#[test]
fn model_step_in_fixed_post_update_reads_the_results_of_fixed_update() {
    #[derive(Resource, Default)]
    struct Order(Vec<&'static str>);
    let schedule = HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep).in_schedule(FixedPostUpdate);
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins.set(schedule)))
        .insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)))
        .init_resource::<Order>()
        .add_systems(FixedUpdate, |mut order: ResMut<Order>| order.0.push("update"))
        .add_systems(ModelSchedule, |mut order: ResMut<Order>| order.0.push("model"));
    (0..3).for_each(|_| app.update());
    assert_eq!(app.world().resource::<Order>().0, ["update", "model", "update", "model"]);
}

#[test]
fn tool_plugin_adds_the_schedule_plugin() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins.build().disable::<HapticSchedulePlugin>()));
    app.finish();
    app.cleanup();
    assert!(app.is_plugin_added::<HapticSchedulePlugin>() && app.is_plugin_added::<ToolPlugin>());
    assert_eq!(*app.world().resource::<ModelRate>(), ModelRate::default());
    assert_eq!(*app.world().resource::<LoopMode>(), LoopMode::Threaded);
    app.insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
    let body = spawn_block(&mut app);
    (0..10).for_each(|_| app.update());
    assert!(app.world().resource::<ModelStepCount>().0 > 3);
    assert!(app.world().get::<SimulatedBody>(body).is_some());
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
fn testing_helpers_wait_for_the_body_and_count_model_steps() {
    let mut app = testing::headless_app();
    let body = spawn_block(&mut app);
    let tool = spawn_tool(&mut app, resting_hand);
    testing::wait_for_body(&mut app, body);
    assert_eq!(state(&app, body), BodyState::Ready);
    let count = |app: &App| app.world().resource::<ModelStepCount>().0;
    for steps in [1, 3, 20] {
        let before = count(&app);
        testing::advance_model_steps(&mut app, steps);
        assert_eq!(count(&app), before + steps);
    }
    assert!(force_n(&app, tool).y > 0.5, "{}", force_n(&app, tool));
}

#[test]
#[should_panic(expected = "has no DeformableBody")]
fn wait_for_body_panics_without_deformable_body() {
    let mut app = testing::headless_app();
    let entity = app.world_mut().spawn_empty().id();
    testing::wait_for_body(&mut app, entity);
}

#[test]
#[should_panic(expected = "is rejected")]
fn wait_for_body_panics_if_the_body_is_rejected() {
    let mut app = testing::headless_app();
    let body = app.world_mut().spawn(DeformableBody::block([1, 6, 6], 0.1)).id();
    testing::wait_for_body(&mut app, body);
}

#[test]
#[should_panic(expected = "no model step")]
fn advance_model_steps_panics_if_the_time_is_paused() {
    let mut app = testing::headless_app();
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    testing::advance_model_steps(&mut app, 1);
}

#[test]
#[should_panic(expected = "no model step")]
fn advance_model_steps_panics_without_palpate() {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins);
    testing::advance_model_steps(&mut app, 1);
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
