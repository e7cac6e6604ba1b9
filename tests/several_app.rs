//! Several tools and several bodies in one app, in lock step: what comes and goes while it is touched.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{NoForceCause, SimulatedBody, ToolLoop};
use palpate_tests::app::{Contacts, lockstep_app, step, take_causes, take_faults};

/// Presses the top of a 10 cm block round `center` at (x, z), 5 mm deep within 0.2 s, and stays.
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
    app.world_mut().spawn(HapticTool { device: DeviceSelector::named(name), ..default() }).id()
}

fn block(app: &mut App, x: f32) -> Entity {
    let place = Transform::from_xyz(x, 0.0, 0.0);
    app.world_mut()
        .spawn((DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom), place))
        .id()
}

fn force(app: &App, tool: Entity) -> DVec3 {
    app.world().get::<ToolForce>(tool).unwrap().force_n
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
fn two_hands_on_one_body_feel_each_other() {
    let (mut app, body, tools) = two_on_one();
    for tool in tools {
        assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(body));
        assert!(force(&app, tool).y > 0.2, "{}", force(&app, tool));
        assert!(error(&app, tool) < 5e-3, "{}", error(&app, tool));
    }
    let beside = force(&app, tools[0]).y;
    // What the base bears is what both hands give.
    let simulated = app.world().get::<SimulatedBody>(body).unwrap();
    let network = simulated.body().network();
    let fixed = (0..network.node_count()).filter(|&node| network.is_fixed(node));
    let base: DVec3 = fixed.map(|node| simulated.body().internal_force_on_n(node)).sum();
    let hands = force(&app, tools[0]) + force(&app, tools[1]);
    assert!((base + hands).length() < 0.02 * hands.length(), "{base} {hands}");
    // Alone the same place is stiffer, for the other one has pressed it down.
    app.world_mut().entity_mut(tools[1]).despawn();
    step(&mut app, 20);
    let alone = force(&app, tools[0]).y;
    assert!(alone > 1.02 * beside, "{alone} N alone, {beside} N beside another");
    assert!(error(&app, tools[0]) < 5e-3);
    assert_eq!(take_faults(&mut app), [""; 0]);
    assert_eq!(app.world().resource::<Contacts>().0, ["began", "began", "ended"]);
}

#[test]
fn the_same_two_hands_give_the_same_bits() {
    let bits = || {
        let (app, body, tools) = two_on_one();
        let x = app.world().get::<SimulatedBody>(body).unwrap().body().positions_m().to_vec();
        let of = |v: DVec3| v.to_array().map(f64::to_bits);
        (x.into_iter().map(of).collect::<Vec<_>>(), tools.map(|tool| of(force(&app, tool))))
    };
    assert_eq!(bits(), bits());
}

#[test]
fn a_body_that_goes_while_two_touch_it_leaves_them_without_force() {
    let (mut app, body, tools) = two_on_one();
    app.world_mut().entity_mut(body).despawn();
    step(&mut app, 12);
    for tool in tools {
        assert_eq!(force(&app, tool), DVec3::ZERO);
        assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, None);
        assert!(app.world().get::<ToolLoop>(tool).is_some(), "the loop goes on");
    }
    assert_eq!(app.world().resource::<Contacts>().0, ["began", "began", "ended", "ended"]);
    // Half a second without any body is reported for each.
    let causes = take_causes(&mut app);
    assert!(tools.iter().all(|tool| causes.contains(&(*tool, NoForceCause::NoBody))), "{causes:?}");
    assert_eq!(take_faults(&mut app).len(), 2);
}

#[test]
fn material_that_changes_under_two_hands_is_felt_by_both() {
    let (mut app, body, tools) = two_on_one();
    let before = tools.map(|tool| force(&app, tool).y);
    app.world_mut().get_mut::<Tissue>(body).unwrap().youngs_modulus_pa *= 0.5;
    step(&mut app, 20);
    for (tool, before) in tools.into_iter().zip(before) {
        let share = force(&app, tool).y / before;
        assert!((share - 0.5).abs() < 0.02, "{share}");
        assert!(force(&app, tool).is_finite());
    }
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn every_hand_finds_the_body_that_is_nearest() {
    let mut app = lockstep_app();
    let bodies = [0.0, 0.3, 0.6].map(|x| block(&mut app, x));
    let at = |x: f64| presser(DVec3::X * x, 0.01, 0.004);
    let tools = [hand(&mut app, "a", at(0.6)), hand(&mut app, "b", at(0.0)), hand(&mut app, "c", at(0.3))];
    step(&mut app, 12);
    for (tool, body) in tools.into_iter().zip([bodies[2], bodies[0], bodies[1]]) {
        assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(body));
        assert!(force(&app, tool).y > 0.5);
    }
    // They are alike, and so are what they give, however far from the origin.
    let forces = tools.map(|tool| force(&app, tool));
    assert!(forces.iter().all(|f| (*f - forces[0]).length() < 1e-5), "{forces:?}");
    // One goes; the others do not notice.
    app.world_mut().entity_mut(bodies[0]).despawn();
    step(&mut app, 10);
    assert!(force(&app, tools[0]).y > 0.5 && force(&app, tools[2]).y > 0.5);
    // The hand without a body is taken by the nearest that is left, which its device does not reach.
    assert_eq!(force(&app, tools[1]), DVec3::ZERO);
    let causes = take_causes(&mut app);
    let [(told, NoForceCause::OutOfWorkspace { body, distance_m })] = causes[..] else {
        panic!("{causes:?}")
    };
    // From 0.2 m to 0.25 m, less the tool's radius.
    assert!((told, body) == (tools[1], bodies[1]) && (distance_m - 0.045).abs() < 1e-3, "{distance_m} m");
    assert_eq!(take_faults(&mut app).len(), 1);
}

#[test]
fn a_cloned_scene_has_a_hand_for_its_own_body() {
    use bevy::ecs::entity::EntityHashMap;

    let (body, copy) = (Entity::from_raw_u32(1).unwrap(), Entity::from_raw_u32(2).unwrap());
    let mut tool = HapticTool { body: Some(body), ..default() };
    let mut map: EntityHashMap<Entity> = [(body, copy)].into_iter().collect();
    <HapticTool as Component>::map_entities(&mut tool, &mut map);
    assert_eq!(tool.body, Some(copy));
}

#[test]
fn a_hand_that_goes_from_one_body_to_another_touches_that() {
    let mut app = lockstep_app();
    let first = block(&mut app, 0.0);
    // Down on the first one, up, over to the second within half a second, and down on that.
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
    // One that comes when the hand has a body already.
    let second = block(&mut app, 0.3);
    step(&mut app, 30);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(second));
    let here = force(&app, tool);
    assert!((here - there).length() < 0.02 * there.length(), "{there}, then {here}");
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn a_pause_while_two_hands_touch_fades_nothing_in_and_changes_no_bit() {
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
