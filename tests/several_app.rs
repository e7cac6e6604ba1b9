//! Several tools and several bodies in an app, in lock step: spawned and despawned during contact.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{ForceError, NoForceCause, SimulatedBody, ToolLoop};
use palpate_haptics::{Reading, ScriptedDevice};
use palpate_tests::app::Contact::{End, Start};
use palpate_tests::app::{
    assert_no_faults, contacts, force_n as force, lockstep_app, step, take_causes, take_faults,
};

/// A device that presses the top of a 10 cm block centred at `center` at (x, z), to a depth of 5 mm within 0.2 s.
fn presser(center: DVec3, x: f64, z: f64) -> impl Fn() -> ScriptedDevice + Send + Sync + 'static {
    move || {
        ScriptedDevice::new(move |n, _| {
            let depth = 0.005 * (n as f64 / 200.0).min(1.0) - 0.001;
            Ok(Reading::at(center + DVec3::new(x, 0.055 - depth, z)))
        })
    }
}

fn hand(
    app: &mut App,
    name: &'static str,
    device: impl Fn() -> ScriptedDevice + Send + Sync + 'static,
) -> Entity {
    app.world_mut().resource_mut::<HapticDevices>().register(name, move || Ok(device()));
    app.world_mut().spawn(HapticTool::new(name)).id()
}

fn block(app: &mut App, x: f32) -> Entity {
    let place = Transform::from_xyz(x, 0.0, 0.0);
    app.world_mut()
        .spawn((DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom), place))
        .id()
}

fn error(app: &App, tool: Entity) -> f64 {
    app.world().get::<ForceError>(tool).unwrap().relative.unwrap()
}

fn two_on_one() -> (App, Entity, [Entity; 2]) {
    let mut app = lockstep_app();
    let body = block(&mut app, 0.0);
    let left = hand(&mut app, "left", presser(DVec3::ZERO, -0.025, 0.004));
    let right = hand(&mut app, "right", presser(DVec3::ZERO, 0.025, -0.003));
    step(&mut app, 12);
    (app, body, [left, right])
}

#[test]
fn two_tools_on_one_body_influence_each_other() {
    let (mut app, body, tools) = two_on_one();
    for tool in tools {
        assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(body));
        assert!(force(&app, tool).y > 0.2, "{}", force(&app, tool));
        assert!(error(&app, tool) < 5e-3, "{}", error(&app, tool));
    }
    let with_other = force(&app, tools[0]).y;
    // The force on the fixed base equals the sum of both tools.
    let simulated = app.world().get::<SimulatedBody>(body).unwrap();
    let network = simulated.body().network();
    let fixed = (0..network.node_count()).filter(|&node| network.is_fixed(node));
    let base: DVec3 = fixed.map(|node| simulated.body().internal_force_on_n(node)).sum();
    let hands = force(&app, tools[0]) + force(&app, tools[1]);
    assert!((base + hands).length() < 0.02 * hands.length(), "{base} {hands}");
    // Without the other tool, which pressed the surface down, the force is larger.
    app.world_mut().entity_mut(tools[1]).despawn();
    step(&mut app, 20);
    let alone = force(&app, tools[0]).y;
    assert!(alone > 1.02 * with_other, "{alone} N alone, {with_other} N with another tool");
    assert!(error(&app, tools[0]) < 5e-3);
    assert_no_faults(&mut app);
    assert_eq!(contacts(&app), [Start, Start, End]);
}

/// Tools 20 mm apart, both of which move: with forces of each other that are constant between model steps, the error would be 3 %.
#[test]
fn moving_tools_feel_each_other_between_model_steps() {
    let mut app = lockstep_app();
    block(&mut app, 0.0);
    let swinger = |x: f64, rate: f64| {
        move || {
            ScriptedDevice::new(move |n, _| {
                let t = n as f64 * 1e-3;
                let depth = 0.005 * (t / 0.2).min(1.0) + 0.002 * (rate * t).sin();
                Ok(Reading::at(DVec3::new(x, 0.055 - depth, 0.004)))
            })
        }
    };
    let tools = [hand(&mut app, "left", swinger(-0.01, 14.0)), hand(&mut app, "right", swinger(0.01, 23.0))];
    step(&mut app, 8);
    for _ in 0..20 {
        step(&mut app, 1);
        for tool in tools {
            assert!(error(&app, tool) < 0.01, "{}", error(&app, tool));
        }
    }
    assert_no_faults(&mut app);
}

#[test]
fn two_tools_give_the_same_bits_in_every_run() {
    let bits = || {
        let (app, body, tools) = two_on_one();
        let x = app.world().get::<SimulatedBody>(body).unwrap().body().positions_m().to_vec();
        let of = |v: DVec3| v.to_array().map(f64::to_bits);
        (x.into_iter().map(of).collect::<Vec<_>>(), tools.map(|tool| of(force(&app, tool))))
    };
    assert_eq!(bits(), bits());
}

#[test]
fn despawned_body_leaves_two_tools_without_force() {
    let (mut app, body, tools) = two_on_one();
    app.world_mut().entity_mut(body).despawn();
    step(&mut app, 12);
    for tool in tools {
        assert_eq!(force(&app, tool), DVec3::ZERO);
        assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, None);
        assert!(app.world().get::<ToolLoop>(tool).is_some(), "the loop continues");
    }
    assert_eq!(contacts(&app), [Start, Start, End, End]);
    // Half a second without a body is reported for each tool.
    let causes = take_causes(&mut app);
    assert!(tools.iter().all(|tool| causes.contains(&(*tool, NoForceCause::NoBody))), "{causes:?}");
    assert_eq!(take_faults(&mut app).len(), 2);
}

#[test]
fn tissue_change_during_contact_acts_on_two_tools() {
    let (mut app, body, tools) = two_on_one();
    let before = tools.map(|tool| force(&app, tool).y);
    app.world_mut().get_mut::<Tissue>(body).unwrap().youngs_modulus_pa *= 0.5;
    step(&mut app, 20);
    for (tool, before) in tools.into_iter().zip(before) {
        let share = force(&app, tool).y / before;
        assert!((share - 0.5).abs() < 0.02, "{share}");
        assert!(force(&app, tool).is_finite());
    }
    assert_no_faults(&mut app);
}

#[test]
fn every_tool_selects_the_nearest_body() {
    let mut app = lockstep_app();
    let bodies = [0.0, 0.3, 0.6].map(|x| block(&mut app, x));
    let at = |x: f64| presser(DVec3::X * x, 0.01, 0.004);
    let tools = [hand(&mut app, "a", at(0.6)), hand(&mut app, "b", at(0.0)), hand(&mut app, "c", at(0.3))];
    step(&mut app, 12);
    for (tool, body) in tools.into_iter().zip([bodies[2], bodies[0], bodies[1]]) {
        assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(body));
        assert!(force(&app, tool).y > 0.5);
    }
    // Equal scenes give equal forces, at any distance from the origin.
    let forces = tools.map(|tool| force(&app, tool));
    assert!(forces.iter().all(|f| (*f - forces[0]).length() < 1e-5), "{forces:?}");
    // The despawned body does not influence the others.
    app.world_mut().entity_mut(bodies[0]).despawn();
    step(&mut app, 10);
    assert!(force(&app, tools[0]).y > 0.5 && force(&app, tools[2]).y > 0.5);
    // The tool without a body selects the nearest remaining one, which its device does not reach.
    assert_eq!(force(&app, tools[1]), DVec3::ZERO);
    let causes = take_causes(&mut app);
    let [(tool, NoForceCause::OutOfWorkspace { body, distance_m })] = causes[..] else {
        panic!("{causes:?}")
    };
    // From 0.2 m to 0.25 m, minus the tool's radius.
    assert!((tool, body) == (tools[1], bodies[1]) && (distance_m - 0.045).abs() < 1e-3, "{distance_m} m");
    assert_eq!(take_faults(&mut app).len(), 1);
}

#[test]
fn cloned_tool_refers_to_the_cloned_body() {
    use bevy::ecs::entity::EntityHashMap;

    let (body, copy) = (Entity::from_raw_u32(1).unwrap(), Entity::from_raw_u32(2).unwrap());
    let mut tool = HapticTool { body: Some(body), ..default() };
    let mut map: EntityHashMap<Entity> = [(body, copy)].into_iter().collect();
    <HapticTool as Component>::map_entities(&mut tool, &mut map);
    assert_eq!(tool.body, Some(copy));
}

#[test]
fn tool_that_moves_to_another_body_touches_it() {
    let mut app = lockstep_app();
    let first = block(&mut app, 0.0);
    // Presses on the first body, moves up and over to the second within half a second, and presses on it.
    let tool = hand(&mut app, "wanderer", || {
        ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            let way = ((t - 0.6) / 0.5).clamp(0.0, 1.0);
            let down = if t < 0.6 { (t / 0.2).min(1.0) } else { ((t - 1.3) / 0.2).clamp(0.0, 1.0) };
            Ok(Reading::at(DVec3::new(0.3 * way + 0.01, 0.06 - 0.01 * down, 0.004)))
        })
    });
    step(&mut app, 11);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(first));
    let there = force(&app, tool);
    assert!(there.y > 0.5, "{there}");
    // A body that is spawned while the tool has another one.
    let second = block(&mut app, 0.3);
    step(&mut app, 30);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(second));
    let here = force(&app, tool);
    assert!((here - there).length() < 0.02 * there.length(), "{there}, then {here}");
    assert_no_faults(&mut app);
}

#[test]
fn pause_with_two_tools_in_contact_changes_no_bit() {
    let run = |pause: bool| {
        let (mut app, body, tools) = two_on_one();
        if pause {
            app.world_mut().resource_mut::<Time<Virtual>>().pause();
            (0..10).for_each(|_| app.update());
            app.world_mut().resource_mut::<Time<Virtual>>().unpause();
        }
        step(&mut app, 3);
        let x = app.world().get::<SimulatedBody>(body).unwrap().body().positions_m().to_vec();
        (x, tools.map(|tool| force(&app, tool)))
    };
    assert_eq!(run(true), run(false));
}
