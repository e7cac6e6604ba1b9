//! One tool on two bodies in an app, in lock step: an instrument between two organs.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{ContactState, ForceError, HapticFaultKind, LocalModelStats, SimulatedBody, ToolLoop};
use palpate_haptics::{Reading, ScriptedDevice};
use palpate_tests::app::Contact::{End, Start};
use palpate_tests::app::{
    assert_no_faults, contacts, force_n as force, lockstep_app, spawn_tool, step, take_kinds,
};

/// Distance of each surface from the middle of the gap, m: the tool of 5 mm overlaps both by 1.2 mm.
const HALF_GAP_M: f32 = 0.0038;

/// A block whose top or bottom is at the gap around `at`.
fn block(app: &mut App, is_floor: bool, at: Vec3) -> Entity {
    let (face, side) = if is_floor { (BoxFace::Bottom, -1.0) } else { (BoxFace::Top, 1.0) };
    let place = Transform::from_translation(at + Vec3::Y * side * (0.05 + HALF_GAP_M));
    app.world_mut().spawn((DeformableBody::block([6; 3], 0.1), FixedRegion::Face(face), place)).id()
}

/// A hand in the gap that moves up and down by 1 mm and slides along.
fn swinging_hand() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let t = n as f64 * 1e-3;
        Ok(Reading::at(DVec3::new(0.003 + 0.004 * (3.0 * t).sin(), 0.001 * (15.0 * t).sin(), 0.004)))
    })
}

fn still_hand() -> ScriptedDevice {
    ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::new(0.003, 0.0, 0.004))))
}

/// Floor, ceiling and tool.
fn sandwich(hand: fn() -> ScriptedDevice) -> (App, [Entity; 2], Entity) {
    let mut app = lockstep_app();
    let bodies = [true, false].map(|is_floor| block(&mut app, is_floor, Vec3::ZERO));
    let tool = spawn_tool(&mut app, hand);
    (app, bodies, tool)
}

fn touched(app: &App, tool: Entity) -> TouchedBody {
    *app.world().get::<TouchedBody>(tool).unwrap()
}

fn error(app: &App, tool: Entity) -> f64 {
    app.world().get::<ForceError>(tool).unwrap().relative.unwrap()
}

/// Force of the body on its fixed nodes, N: at rest, that of the tool on the body.
fn base_n(app: &App, body: Entity) -> DVec3 {
    let body = app.world().get::<SimulatedBody>(body).unwrap().body();
    let fixed = (0..body.network().node_count()).filter(|&node| body.network().is_fixed(node));
    fixed.map(|node| body.internal_force_on_n(node)).sum()
}

#[test]
fn tool_touches_two_bodies_and_renders_the_force_of_both() {
    let (mut app, bodies, tool) = sandwich(swinging_hand);
    let mut seen = 0.0_f64;
    step(&mut app, 8);
    for _ in 0..20 {
        step(&mut app, 1);
        let TouchedBody { body, second, state } = touched(&app, tool);
        let found = [body, second].map(Option::unwrap);
        assert!(found.contains(&bodies[0]) && found.contains(&bodies[1]), "{found:?}");
        assert_eq!(state, ContactState::Touching);
        assert!(error(&app, tool) < 0.01, "{}", error(&app, tool));
        let jump_n = app.world().get::<ToolForce>(tool).unwrap().swap_force_jump_n.length();
        assert!(jump_n < 0.01, "{jump_n} N");
        seen = seen.max(force(&app, tool).y.abs());
    }
    assert!(seen > 0.15, "{seen} N");
    let running = app.world().get::<ToolLoop>(tool).unwrap();
    assert!(!running.support().is_empty() && !running.second_support().is_empty());
    let nodes = running.support().len() + running.second_support().len();
    assert_eq!(app.world().get::<LocalModelStats>(tool).unwrap().support_nodes, nodes);
    assert_eq!(contacts(&app), [Start, Start]);
    assert_no_faults(&mut app);
}

/// The hand bears the difference of what the two bodies bear, which is much smaller.
#[test]
fn clamped_tool_at_rest_has_the_sum_of_the_reactions() {
    let (mut app, bodies, tool) = sandwich(still_hand);
    step(&mut app, 60);
    let [floor, ceiling] = bodies.map(|body| base_n(&app, body));
    // Both are pushed apart; the mirrored blocks bear nearly the same.
    assert!(floor.y < -0.05 && ceiling.y > 0.05, "{floor} {ceiling}");
    assert!((floor + ceiling).y.abs() < 0.05 * ceiling.y, "{floor} {ceiling}");
    let hand = force(&app, tool);
    assert!((hand + floor + ceiling).length() < 1e-3, "{hand} {floor} {ceiling}");
    assert_no_faults(&mut app);
}

#[test]
fn lock_step_gives_the_same_bits_with_two_bodies() {
    let run = || {
        let (mut app, bodies, tool) = sandwich(swinging_hand);
        step(&mut app, 20);
        let of = |body: Entity| app.world().get::<SimulatedBody>(body).unwrap().body().positions_m().to_vec();
        (bodies.map(of), force(&app, tool))
    };
    assert!(run() == run());
}

/// One of the two bodies is despawned during the touch: the force of the other one continues.
#[test]
fn despawned_body_leaves_the_force_of_the_other_one() {
    for gone in [0, 1] {
        let (mut app, bodies, tool) = sandwich(still_hand);
        step(&mut app, 40);
        let other = bodies[1 - gone];
        let before = base_n(&app, other);
        app.world_mut().entity_mut(bodies[gone]).despawn();
        for i in 0..20 {
            step(&mut app, 1);
            assert_eq!(touched(&app, tool).body, Some(other));
            assert_eq!(touched(&app, tool).second, None);
            // The loop drops the part of the body that is gone at once, and keeps that of the other one.
            let now = force(&app, tool);
            assert!(now.y * before.y < 0.0 && now.y.abs() < 1.5 * before.y.abs(), "{i}: {now} {before}");
        }
        let settled = base_n(&app, other);
        assert!((force(&app, tool) + settled).length() < 0.02 * settled.length(), "{}", force(&app, tool));
        assert_eq!(contacts(&app), [Start, Start, End]);
        assert_no_faults(&mut app);
    }
}

/// A body that is built again with other nodes, or moved away, ends its contact alone.
#[test]
fn rebuilt_and_moved_bodies_end_their_own_contact() {
    let (mut app, bodies, tool) = sandwich(still_hand);
    step(&mut app, 10);
    app.world_mut().entity_mut(bodies[1]).insert(DeformableBody::block([7; 3], 0.1));
    step(&mut app, 20);
    assert_eq!(contacts(&app), [Start, Start, End, Start]);
    let TouchedBody { body, second, .. } = touched(&app, tool);
    assert!(body.is_some() && second.is_some());
    app.world_mut().get_mut::<Transform>(bodies[0]).unwrap().translation.y -= 0.2;
    step(&mut app, 20);
    let TouchedBody { body, second, .. } = touched(&app, tool);
    assert_eq!((body, second), (Some(bodies[1]), None));
    assert_eq!(contacts(&app), [Start, Start, End, Start, End]);
    assert!(force(&app, tool).y < -0.01, "{}", force(&app, tool));
    assert_no_faults(&mut app);
}

/// The tool wanders from the floor to the ceiling and back.
#[test]
fn hand_over_between_one_and_two_bodies_has_no_jump() {
    let hand = || {
        ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            Ok(Reading::at(DVec3::new(0.003, 0.0045 * (4.0 * t).sin(), 0.004)))
        })
    };
    let mut app = lockstep_app();
    let bodies = [true, false].map(|is_floor| {
        // A gap of 11 mm: the tool touches one of the two at a time.
        let side = if is_floor { -1.0 } else { 1.0 };
        block(&mut app, is_floor, Vec3::Y * side * (0.0055 - HALF_GAP_M))
    });
    let tool = spawn_tool(&mut app, hand);
    let (mut peak, mut max_jump) = (0.0_f64, 0.0_f64);
    step(&mut app, 3);
    let mut seen = Vec::new();
    for _ in 0..60 {
        step(&mut app, 1);
        peak = peak.max(force(&app, tool).length());
        max_jump = max_jump.max(app.world().get::<ToolForce>(tool).unwrap().swap_force_jump_n.length());
        seen.extend(touched(&app, tool).body.filter(|body| seen.last() != Some(body)));
    }
    assert!(seen.len() >= 3 && bodies.iter().all(|body| seen.contains(body)), "{seen:?}");
    assert!(peak > 0.5 && max_jump < 0.01 * peak, "{max_jump} N of {peak} N");
    assert_no_faults(&mut app);
}

#[test]
fn third_body_within_reach_is_reported_once() {
    let (mut app, _, tool) = sandwich(still_hand);
    // A second ceiling in the same place.
    block(&mut app, false, Vec3::new(0.001, 0.0, 0.0));
    step(&mut app, 30);
    let kinds = take_kinds(&mut app);
    assert!(matches!(kinds[..], [HapticFaultKind::BodiesLeftOut { reached: 3, max: 2 }]), "{kinds:?}");
    let TouchedBody { body, second, .. } = touched(&app, tool);
    assert!(body.is_some() && second.is_some() && body != second);
    assert!(force(&app, tool).is_finite());
}

/// A tool for one body passes through others; layers separate as with one body.
#[test]
fn tool_of_one_body_or_other_layers_touches_no_second_one() {
    let (mut app, bodies, tool) = sandwich(still_hand);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(bodies[1]);
    step(&mut app, 10);
    assert_eq!((touched(&app, tool).body, touched(&app, tool).second), (Some(bodies[1]), None));
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = None;
    step(&mut app, 10);
    assert!(touched(&app, tool).second.is_some());
    // A layer that separates the tool from the first body.
    app.world_mut().entity_mut(bodies[1]).insert(bevy_palpate::TouchLayers::NONE);
    step(&mut app, 10);
    assert_eq!((touched(&app, tool).body, touched(&app, tool).second), (Some(bodies[0]), None));
    assert_no_faults(&mut app);
}

/// The button closes on the nearer body, and the other contact ends.
#[test]
fn grasp_holds_the_nearer_of_two_bodies() {
    let (mut app, bodies, tool) = sandwich(|| {
        ScriptedDevice::new(|n, _| {
            let at = DVec3::new(0.003, 0.001, 0.004);
            Ok(Reading { buttons: u32::from((600..1200).contains(&n)), ..Reading::at(at) })
        })
    });
    app.world_mut().entity_mut(tool).insert(ToolGrasp::default());
    step(&mut app, 10);
    assert!(touched(&app, tool).second.is_some());
    step(&mut app, 6);
    let held = touched(&app, tool);
    assert_eq!((held.body, held.second, held.state), (Some(bodies[1]), None, ContactState::Holding));
    step(&mut app, 20);
    let after = touched(&app, tool);
    assert!(after.body.is_some() && after.second.is_some(), "{after:?}");
    assert_no_faults(&mut app);
}

/// Bodies that share no tool are stepped by themselves: a tool on one of them does not change the other.
#[test]
fn bodies_without_a_common_tool_are_independent() {
    let run = |with_other: bool| {
        let mut app = lockstep_app();
        let floor = block(&mut app, true, Vec3::ZERO);
        if with_other {
            block(&mut app, false, Vec3::X * 0.5);
        }
        let tool = spawn_tool(&mut app, swinging_hand);
        step(&mut app, 15);
        let x = app.world().get::<SimulatedBody>(floor).unwrap().body().positions_m().to_vec();
        (x, force(&app, tool))
    };
    assert!(run(true) == run(false));
}
