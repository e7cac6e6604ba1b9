//! Grasps and sutures in a headless app, in lock step.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{DeviceSelector, ForceError, HapticFaultKind, SimulatedBody, Slit, SutureFault, ToolLoop};
use palpate_body::BodyError;
use palpate_haptics::{Reading, ScriptedDevice};
use palpate_tests::app::Contact::{End, Start};
use palpate_tests::app::{assert_no_faults, contacts, lockstep_app, spawn_scene, step, take_kinds};

/// A device that descends onto the top of a 10 cm block within 0.2 s, to a depth of 0.3 mm. The button is pressed from 0.3 s to 0.9 s, while
/// the device moves up by 4 mm and across by 3 mm. Then it opens, waits and leaves.
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
fn grasp_pulls_and_releases() {
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
    // The body pulls back, down and across; a contact without grasp can only push.
    assert!(touch.y > 0.0 && force.force_n.y < -0.2 && force.force_n.x < -0.1, "{touch}, {force:?}");
    let moved = grasping(&app, tool).point_m - held.point_m;
    // The point follows the device, except for the coupling of 20 kN/m.
    let offset = force.model_force_n / 20e3;
    assert!((moved - DVec3::new(0.003, 0.004, 0.0) - offset).length() < 3e-5, "{moved}, {offset}");
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(body));
    let error = app.world().get::<ForceError>(tool).unwrap();
    assert!(error.relative.is_some_and(|relative| relative < 0.02), "{error:?}");
    step(&mut app, 3);
    assert_eq!(grasping(&app, tool), GraspedPoint::default());
    step(&mut app, 6);
    assert_eq!(app.world().get::<ToolForce>(tool).unwrap().force_n, DVec3::ZERO);
    // One contact includes touch and grasp; the tool may touch the released body again.
    let contacts = contacts(&app);
    assert_eq!(contacts[..2], [Start, End]);
    assert_eq!(contacts.len() % 2, 0, "{contacts:?}");
    assert_no_faults(&mut app);
}

#[test]
fn tool_grasps_again_after_a_release() {
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
fn grasp_out_of_reach_or_with_another_button_holds_nothing() {
    for grasp in [ToolGrasp { reach_m: 1e-3, ..default() }, ToolGrasp { button: 1, ..default() }] {
        let mut app = lockstep_app();
        let (_, tool) = grasping_scene(&mut app, grasp);
        step(&mut app, 12);
        assert_eq!(grasping(&app, tool), GraspedPoint::default(), "{grasp:?}");
    }
}

/// Afterwards the tool can touch again and holds nothing.
#[test]
fn every_cause_ends_the_grasp_and_the_contact() {
    type Cause = fn(&mut World, Entity, Entity);
    let causes: [(&str, Cause); 6] = [
        ("body despawned", |world, body, _| assert!(world.despawn(body))),
        ("ToolGrasp removed", |world, _, tool| {
            world.entity_mut(tool).remove::<ToolGrasp>();
        }),
        ("fewer nodes", |world, body, _| {
            world.entity_mut(body).insert(DeformableBody::block([3; 3], 0.1));
        }),
        ("another shape of tool", |world, _, tool| {
            world.get_mut::<HapticTool>(tool).unwrap().shape = ToolShape::Sphere { radius_m: 0.004 };
        }),
        ("device missing", |world, _, tool| {
            world.get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::named("none");
        }),
        ("HapticTool removed", |world, _, tool| {
            world.entity_mut(tool).remove::<HapticTool>();
        }),
    ];
    for (what, end) in causes {
        let mut app = lockstep_app();
        let (body, tool) = grasping_scene(&mut app, ToolGrasp::default());
        step(&mut app, 9);
        assert!(grasping(&app, tool).body.is_some(), "{what}");
        end(app.world_mut(), body, tool);
        step(&mut app, 2);
        assert_eq!(grasping(&app, tool), GraspedPoint::default(), "{what}");
        let held = app.world().get::<ToolLoop>(tool).and_then(|tool| tool.contact().held_point());
        assert_eq!(held, None, "{what}");
        assert_eq!(contacts(&app)[..2], [Start, End], "{what}");
    }
}

#[test]
fn change_of_scheme_keeps_the_grasp() {
    let mut app = lockstep_app();
    let (body, tool) = grasping_scene(&mut app, ToolGrasp::default());
    step(&mut app, 9);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().scheme = Scheme::Hold;
    step(&mut app, 2);
    assert_eq!(grasping(&app, tool).body, Some(body));
}

#[test]
fn grasp_of_a_fixed_point_is_a_fault() {
    let mut app = lockstep_app();
    let (body, tool) = grasping_scene(&mut app, ToolGrasp::default());
    app.world_mut().entity_mut(body).insert(FixedRegion::Face(BoxFace::Top));
    step(&mut app, 10);
    assert_eq!(grasping(&app, tool), GraspedPoint::default());
    let kinds = take_kinds(&mut app);
    assert!(matches!(kinds[..], [HapticFaultKind::Grasp(_)]), "{kinds:?}");
}

/// An app with a block, an open slit in its top, and a thread across the middle of the slit; returns app, body and suture.
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
fn taut_thread_pulls_both_lips_equally_and_a_slack_one_does_not() {
    let (mut app, _, suture) = sutured(0.02, f64::INFINITY);
    step(&mut app, 10);
    assert_eq!(force(&app, suture).tension_n, 0.0);
    app.world_mut().get_mut::<Suture>(suture).unwrap().length_m = 0.006;
    step(&mut app, 60);
    let SutureForce { tension_n, pull_n: [left, right], ends_m: [a, b], is_torn } = force(&app, suture);
    assert!((a.distance(b) - 0.006).abs() < 1e-6, "{}", a.distance(b));
    assert!(tension_n > 0.05 && !is_torn, "{tension_n} N");
    assert!((left + right).length() < 1e-3 * tension_n, "{left} and {right}");
    // The thread pulls the left lip to the right, and the body pulls it back.
    assert!((left.x / tension_n + 1.0).abs() < 1e-3, "{left}, {tension_n} N");
    assert_no_faults(&mut app);
}

#[test]
fn tension_is_stiffness_times_extension() {
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
    assert_no_faults(&mut app);
}

#[test]
fn thread_tears_at_its_limit_with_one_message() {
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
    // The slit opens again.
    assert!(after.ends_m[0].distance(after.ends_m[1]) > 0.012, "{after:?}");
    assert_eq!(app.world().resource::<Messages<SutureTorn>>().len(), 0);
}

#[test]
fn ties_follow_a_rebuilt_body_and_a_despawned_suture() {
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
    assert_no_faults(&mut app);
}

#[test]
fn thread_keeps_its_length_when_a_nan_length_is_rejected() {
    let (mut app, _, suture) = sutured(0.006, f64::INFINITY);
    step(&mut app, 20);
    app.world_mut().get_mut::<Suture>(suture).unwrap().length_m = f64::NAN;
    step(&mut app, 3);
    let kinds = take_kinds(&mut app);
    assert!(matches!(kinds[..], [HapticFaultKind::Suture(SutureFault::Thread(_))]), "{kinds:?}");
    assert!(force(&app, suture).tension_n > 0.05);
}

#[test]
fn invalid_sutures_are_reported_once_and_have_no_effect() {
    let (mut app, body, suture) = sutured(-1.0, 1.0);
    step(&mut app, 3);
    let fault = |app: &mut App| match &take_kinds(app)[..] {
        [HapticFaultKind::Suture(fault)] => fault.clone(),
        kinds => panic!("{kinds:?}"),
    };
    let negative = fault(&mut app);
    let SutureFault::Thread(BodyError::Parameter { value: -1.0, .. }) = negative else {
        panic!("{negative}")
    };
    for (body, ends_m, expected) in [
        (body, [DVec3::ZERO, DVec3::Y], SutureFault::TooFar { end_m: DVec3::Y, within_m: 0.02 }),
        (suture, [DVec3::ZERO; 2], SutureFault::NotABody { body: suture }),
    ] {
        let changed = Suture { body, ends_m, length_m: 0.01, stiffness_n_per_m: 100.0, tear_limit_n: 1.0 };
        app.world_mut().entity_mut(suture).insert(changed);
        step(&mut app, 3);
        assert_eq!(fault(&mut app), expected);
        assert_eq!(force(&app, suture), SutureForce::default());
    }
}
