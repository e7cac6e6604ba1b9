//! Tools that grasp and threads that are sewn, in a headless app in lock step.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{SimulatedBody, ToolLoop};
use palpate_tests::app::{Contacts, lockstep_app, spawn_scene, step, take_faults};

/// A hand that comes down beside the middle of the top of a 10 cm block for 0.2 s, touching it by 0.3 mm, closes there from 0.3 s
/// to 0.9 s, and meanwhile goes up by 4 mm and across by 3 mm; it opens, waits, and goes away.
fn grasping_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let t = n as f64 * 1e-3;
        let part = |from: f64, to: f64| ((t - from) / (to - from)).clamp(0.0, 1.0);
        let down = DVec3::new(0.012, 0.0597 - 0.005 * part(0.0, 0.2), 0.009);
        let pull = DVec3::new(0.003, 0.004, 0.0) * part(0.4, 0.6);
        let buttons = u32::from((0.3..0.9).contains(&t));
        Ok(Reading { buttons, ..Reading::at(down + pull + DVec3::Y * 0.02 * part(1.0, 1.2)) })
    })
}

fn grasping_scene(app: &mut App, grasp: ToolGrasp) -> (Entity, Entity) {
    let (body, tool) = spawn_scene(app, Scheme::NearFieldExact, grasping_hand);
    app.world_mut().entity_mut(tool).insert(grasp);
    (body, tool)
}

fn grasping(app: &App, tool: Entity) -> GraspedPoint {
    *app.world().get::<GraspedPoint>(tool).unwrap()
}

#[test]
fn a_tool_that_grasps_pulls_and_lets_go() {
    let mut app = lockstep_app();
    let (body, tool) = grasping_scene(&mut app, ToolGrasp::default());
    step(&mut app, 6);
    assert_eq!(grasping(&app, tool), GraspedPoint::default());
    let touch = app.world().get::<ToolForce>(tool).unwrap().force_n;
    step(&mut app, 2);
    let held = grasping(&app, tool);
    assert_eq!(held.body, Some(body));
    step(&mut app, 8);
    let force = *app.world().get::<ToolForce>(tool).unwrap();
    // The body pulls back, down and across; a touch can only push.
    assert!(touch.y > 0.0 && force.force_n.y < -0.2 && force.force_n.x < -0.1, "{touch}, {force:?}");
    let moved = grasping(&app, tool).point_m - held.point_m;
    // The point goes with the hand, but for the coupling: 20 kN/m.
    let behind = force.model_force_n / 20e3;
    assert!((moved - DVec3::new(0.003, 0.004, 0.0) - behind).length() < 3e-5, "{moved}, {behind}");
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(body));
    let error = app.world().get::<ForceError>(tool).unwrap();
    assert!(error.relative.is_some_and(|relative| relative < 0.02), "{error:?}");
    step(&mut app, 3);
    assert_eq!(grasping(&app, tool), GraspedPoint::default());
    step(&mut app, 6);
    assert_eq!(app.world().get::<ToolForce>(tool).unwrap().force_n, DVec3::ZERO);
    let told = &app.world().resource::<Contacts>().0;
    // One contact for touch and grasp; after it the tool may touch what it has let go of.
    assert_eq!(told[..2], ["began", "ended"]);
    assert_eq!(told.len() % 2, 0, "{told:?}");
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn a_tool_that_has_let_go_grasps_again() {
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, || {
        ScriptedDevice::new(|n, _| {
            let buttons = u32::from(n % 400 >= 200);
            Ok(Reading { buttons, ..Reading::at(DVec3::new(0.012, 0.0552, 0.009)) })
        })
    });
    app.world_mut().entity_mut(tool).insert(ToolGrasp::default());
    let held: Vec<bool> = (0..16)
        .map(|_| {
            step(&mut app, 1);
            grasping(&app, tool).body.is_some()
        })
        .collect();
    assert_eq!(held, [[false; 4], [true; 4], [false; 4], [true; 4]].concat());
}

#[test]
fn a_grasp_beyond_its_reach_or_with_another_button_holds_nothing() {
    for grasp in [ToolGrasp { reach_m: 1e-3, ..default() }, ToolGrasp { button: 1, ..default() }] {
        let mut app = lockstep_app();
        let (_, tool) = grasping_scene(&mut app, grasp);
        step(&mut app, 12);
        assert_eq!(grasping(&app, tool), GraspedPoint::default(), "{grasp:?}");
    }
}

/// However a grasp ends, its tool can touch again and nothing is held.
#[test]
fn every_end_of_a_grasp_lets_go() {
    type End = fn(&mut World, Entity, Entity);
    let ends: [(&str, End); 6] = [
        ("body despawned", |world, body, _| assert!(world.despawn(body))),
        ("it grasps no longer", |world, _, tool| {
            world.entity_mut(tool).remove::<ToolGrasp>();
        }),
        ("fewer nodes", |world, body, _| {
            world.entity_mut(body).insert(DeformableBody::block([3; 3], 0.1));
        }),
        ("another shape of tool", |world, _, tool| {
            world.get_mut::<HapticTool>(tool).unwrap().shape = ToolShape::Sphere { radius_m: 0.004 };
        }),
        ("device gone", |world, _, tool| {
            world.get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::named("none");
        }),
        ("tool is a tool no longer", |world, _, tool| {
            world.entity_mut(tool).remove::<HapticTool>();
        }),
    ];
    for (what, end) in ends {
        let mut app = lockstep_app();
        let (body, tool) = grasping_scene(&mut app, ToolGrasp::default());
        step(&mut app, 9);
        assert!(grasping(&app, tool).body.is_some(), "{what}");
        end(app.world_mut(), body, tool);
        step(&mut app, 2);
        assert_eq!(grasping(&app, tool), GraspedPoint::default(), "{what}");
        let held = app.world().get::<ToolLoop>(tool).and_then(|tool| tool.contact().held_point());
        assert_eq!(held, None, "{what}");
        assert_eq!(app.world().resource::<Contacts>().0[..2], ["began", "ended"], "{what}");
    }
}

#[test]
fn a_scheme_that_is_switched_keeps_the_grasp() {
    let mut app = lockstep_app();
    let (body, tool) = grasping_scene(&mut app, ToolGrasp::default());
    step(&mut app, 9);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().scheme = Scheme::Hold;
    step(&mut app, 2);
    assert_eq!(grasping(&app, tool).body, Some(body));
}

#[test]
fn what_is_fixed_cannot_be_grasped_and_that_is_told() {
    let mut app = lockstep_app();
    let (body, tool) = grasping_scene(&mut app, ToolGrasp::default());
    app.world_mut().entity_mut(body).insert(FixedRegion::Face(BoxFace::Top));
    step(&mut app, 10);
    assert_eq!(grasping(&app, tool), GraspedPoint::default());
    let said = take_faults(&mut app);
    assert!(said.len() == 1 && said[0].starts_with("the tool cannot hold what it has grasped"), "{said:?}");
}

/// A block with a gaping slit in its top, and a thread across its middle.
fn sutured(length_m: f64, tear_limit_n: f64) -> (App, Entity, Entity) {
    let mut app = lockstep_app();
    let slit = Slit { length_m: 0.06, depth_m: 0.02, opening_m: 0.01 };
    let block = DeformableBody::block_of_size([9, 5, 11], DVec3::new(0.08, 0.04, 0.1));
    let tissue = Tissue { youngs_modulus_pa: 5e3, ..default() };
    let body = app.world_mut().spawn((block, tissue, slit, FixedRegion::Face(BoxFace::Bottom))).id();
    let ends_m = [DVec3::new(-0.007, 0.02, 0.0), DVec3::new(0.007, 0.02, 0.0)];
    let stiffness_n_per_m = f64::INFINITY;
    let suture = Suture { body, ends_m, length_m, stiffness_n_per_m, tear_limit_n };
    let suture = app.world_mut().spawn(suture).id();
    (app, body, suture)
}

fn force(app: &App, suture: Entity) -> SutureForce {
    *app.world().get::<SutureForce>(suture).unwrap()
}

#[test]
fn a_thread_pulls_both_lips_alike_and_a_slack_one_not_at_all() {
    let (mut app, _, suture) = sutured(0.02, f64::INFINITY);
    step(&mut app, 10);
    assert_eq!(force(&app, suture).tension_n, 0.0);
    app.world_mut().get_mut::<Suture>(suture).unwrap().length_m = 0.006;
    step(&mut app, 60);
    let SutureForce { tension_n, pull_n: [left, right], ends_m: [a, b], is_torn } = force(&app, suture);
    assert!((a.distance(b) - 0.006).abs() < 1e-6, "{}", a.distance(b));
    assert!(tension_n > 0.05 && !is_torn, "{tension_n} N");
    assert!((left + right).length() < 1e-3 * tension_n, "{left} and {right}");
    // The left lip is drawn to the right and pulls back.
    assert!((left.x / tension_n + 1.0).abs() < 1e-3, "{left}, {tension_n} N");
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn a_thread_that_stretches_pulls_with_its_stiffness_times_its_lengthening() {
    let (mut app, _, suture) = sutured(0.006, f64::INFINITY);
    for stiffness_n_per_m in [30.0, 300.0] {
        app.world_mut().get_mut::<Suture>(suture).unwrap().stiffness_n_per_m = stiffness_n_per_m;
        step(&mut app, 80);
        let SutureForce { tension_n, pull_n: [left, right], ends_m: [a, b], .. } = force(&app, suture);
        let expected = stiffness_n_per_m * (a.distance(b) - 0.006);
        assert!(
            tension_n > 0.05 && (tension_n / expected - 1.0).abs() < 1e-3,
            "{tension_n} N, not {expected} N"
        );
        assert!((left + right).length() < 1e-3 * tension_n, "{left} and {right}");
    }
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn a_thread_tears_at_its_limit_and_is_told_once() {
    let (mut app, body, suture) = sutured(0.006, f64::INFINITY);
    step(&mut app, 60);
    let held = force(&app, suture).tension_n;
    let limit = 0.9 * held;
    app.world_mut().get_mut::<Suture>(suture).unwrap().tear_limit_n = limit;
    step(&mut app, 1);
    let torn: Vec<SutureTorn> = app.world_mut().resource_mut::<Messages<SutureTorn>>().drain().collect();
    assert_eq!(torn.len(), 1);
    assert_eq!((torn[0].suture, torn[0].body), (suture, body));
    assert!(torn[0].tension_n > limit && torn[0].tension_n < 1.05 * held, "{torn:?}, {held} N");
    step(&mut app, 40);
    let after = force(&app, suture);
    assert!(after.is_torn && after.tension_n == 0.0, "{after:?}");
    // The wound gapes again.
    assert!(after.ends_m[0].distance(after.ends_m[1]) > 0.012, "{after:?}");
    assert_eq!(app.world().resource::<Messages<SutureTorn>>().len(), 0);
}

#[test]
fn a_thread_that_is_taken_out_or_whose_body_changes_holds_what_is_left() {
    let (mut app, body, suture) = sutured(0.006, f64::INFINITY);
    step(&mut app, 20);
    let ties = |app: &App| app.world().get::<SimulatedBody>(body).unwrap().body().ties().len();
    assert_eq!(ties(&app), 1);
    // The same nodes, of another tissue: sewn again where it was.
    app.world_mut().get_mut::<Tissue>(body).unwrap().youngs_modulus_pa = 10e3;
    step(&mut app, 40);
    assert!(ties(&app) == 1 && force(&app, suture).tension_n > 0.1);
    app.world_mut().despawn(suture);
    step(&mut app, 1);
    assert_eq!(ties(&app), 0);
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn a_thread_that_is_given_a_senseless_length_keeps_the_old_one() {
    let (mut app, _, suture) = sutured(0.006, f64::INFINITY);
    step(&mut app, 20);
    app.world_mut().get_mut::<Suture>(suture).unwrap().length_m = f64::NAN;
    step(&mut app, 3);
    assert_eq!(take_faults(&mut app).len(), 1);
    assert!(force(&app, suture).tension_n > 0.05);
}

#[test]
fn sutures_that_make_no_sense_are_told_once_and_do_nothing() {
    let (mut app, body, suture) = sutured(-1.0, 1.0);
    step(&mut app, 3);
    let said = take_faults(&mut app);
    assert!(said.len() == 1 && said[0].contains("length of a thread, m is -1"), "{said:?}");
    for (change, expected) in [
        ((body, [DVec3::ZERO, DVec3::Y], 0.01), "the body's surface is not within 0.02 m"),
        ((suture, [DVec3::ZERO; 2], 0.01), "is no body"),
    ] {
        let (body, ends_m, length_m) = change;
        let again = Suture { body, ends_m, length_m, stiffness_n_per_m: 100.0, tear_limit_n: 1.0 };
        app.world_mut().entity_mut(suture).insert(again);
        step(&mut app, 3);
        let said = take_faults(&mut app);
        assert!(said.len() == 1 && said[0].contains(expected), "{said:?}");
        assert_eq!(force(&app, suture), SutureForce::default());
    }
}
