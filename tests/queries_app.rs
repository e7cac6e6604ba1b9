//! Layers of tools and bodies, and queries of places on and in bodies.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{BodyQuery, BodySurfacePoint, ContactState, HapticFaultKind, NoForceCause, TouchLayers};
use palpate_body::Deformation;
use palpate_tests::app::Contact::{End, Start};
use palpate_tests::app::{
    assert_no_faults, contacts, force_n, lockstep_app, pressing_hand, resting_hand, spawn_block, spawn_tool,
    step, take_kinds,
};

const TISSUE: TouchLayers = TouchLayers::layer(0);
const BONE: TouchLayers = TouchLayers::layer(31);

fn touches(app: &App, tool: Entity) -> Option<Entity> {
    app.world().get::<TouchedBody>(tool).unwrap().body
}

#[test]
fn tool_touches_only_bodies_that_share_a_layer() {
    let mut app = lockstep_app();
    let body = spawn_block(&mut app);
    let tool = spawn_tool(&mut app, pressing_hand);
    step(&mut app, 10);
    assert_eq!((touches(&app, tool), contacts(&app)), (Some(body), vec![Start]));
    // A body of other layers is released, and touched again once they share one.
    app.world_mut().entity_mut(tool).insert(TISSUE);
    app.world_mut().entity_mut(body).insert(BONE);
    step(&mut app, 2);
    assert_eq!((touches(&app, tool), contacts(&app)), (None, vec![Start, End]));
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().state, ContactState::NoBody);
    step(&mut app, 12);
    assert_eq!(force_n(&app, tool), DVec3::ZERO);
    let kinds = take_kinds(&mut app);
    let [HapticFaultKind::NoForce(NoForceCause::OtherLayers { body: named })] = kinds[..] else {
        panic!("{kinds:?}")
    };
    assert_eq!(named, body);
    // The hand presses again after 2.4 s.
    app.world_mut().entity_mut(body).insert(TISSUE | BONE);
    step(&mut app, 36);
    assert_eq!((touches(&app, tool), contacts(&app)), (Some(body), vec![Start, End, Start]));
    assert!(force_n(&app, tool).y > 0.1);
    assert_no_faults(&mut app);
}

#[test]
fn named_body_without_a_common_layer_is_not_touched() {
    let mut app = lockstep_app();
    let body = spawn_block(&mut app);
    let tool = spawn_tool(&mut app, resting_hand);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(body);
    app.world_mut().entity_mut(body).insert(TouchLayers::NONE);
    step(&mut app, 20);
    assert_eq!((touches(&app, tool), contacts(&app)), (None, vec![]));
}

#[test]
fn nearest_body_of_the_tools_layers_is_touched() {
    let mut app = lockstep_app();
    let spawn = |app: &mut App, y: f32, layers: TouchLayers| {
        let body = (DeformableBody::block([4; 3], 0.1), FixedRegion::Face(BoxFace::Bottom));
        app.world_mut().spawn((body, layers, Transform::from_xyz(0.0, y, 0.0))).id()
    };
    let (near, far) = (spawn(&mut app, 0.01, BONE), spawn(&mut app, 0.0, TISSUE));
    let tool = spawn_tool(&mut app, pressing_hand);
    app.world_mut().entity_mut(tool).insert(TISSUE);
    step(&mut app, 10);
    assert_eq!(touches(&app, tool), Some(far));
    // The hand leaves this body, and presses it again after 2.4 s.
    app.world_mut().entity_mut(tool).insert(BONE);
    step(&mut app, 50);
    assert_eq!(touches(&app, tool), Some(near));
}

fn closest(app: &mut App, place_m: DVec3, layers: TouchLayers) -> Option<BodySurfacePoint> {
    let ask = move |mut bodies: BodyQuery| bodies.closest(place_m, 0.05, layers);
    app.world_mut().run_system_once(ask).unwrap()
}

fn deformation(app: &mut App, body: Entity, place_m: DVec3) -> Option<Deformation> {
    app.world_mut().run_system_once(move |bodies: BodyQuery| bodies.deformation(body, place_m)).unwrap()
}

#[test]
fn closest_point_has_depth_normal_and_force() {
    let mut app = lockstep_app();
    let body = spawn_block(&mut app);
    step(&mut app, 1);
    let at = |app: &mut App, y: f64| closest(app, DVec3::new(0.013, y, -0.007), TouchLayers::ALL);
    let above = at(&mut app, 0.06).unwrap();
    assert_eq!(above.body, body);
    assert!((above.point_m - DVec3::new(0.013, 0.05, -0.007)).length() < 1e-12 && above.normal == DVec3::Y);
    assert!((above.distance_m - 0.01).abs() < 1e-12 && above.force_n.length() < 1e-12);
    let below = at(&mut app, 0.045).unwrap();
    assert!((below.depth_m() - 0.005).abs() < 1e-12);
    assert_eq!(at(&mut app, 0.11), None, "beyond 5 cm");
    app.world_mut().entity_mut(body).insert(BONE);
    assert_eq!(closest(&mut app, DVec3::ZERO, TISSUE), None);
    app.world_mut().entity_mut(body).remove::<TouchLayers>();
    // Under a resting tool the tissue pushes up with the tool's force, spread over several points.
    let tool = spawn_tool(&mut app, resting_hand);
    step(&mut app, 40);
    let pressed = app.world().get::<ToolForce>(tool).unwrap().contact.unwrap().point_m;
    let point = closest(&mut app, pressed + DVec3::Y * 0.001, TouchLayers::ALL).unwrap();
    assert!(point.force_n.y > 0.1 && point.point_m.y < 0.05, "{point:?}");
}

#[test]
fn strain_below_a_tool_is_a_compression_and_zero_in_a_body_at_rest() {
    let mut app = lockstep_app();
    let body = spawn_block(&mut app);
    step(&mut app, 1);
    let place_m = DVec3::new(0.012, 0.035, 0.009);
    let rest = deformation(&mut app, body, place_m).unwrap();
    assert!(rest.strain().abs_diff_eq(glam::DMat3::ZERO, 1e-12) && (rest.rest_m - place_m).length() < 1e-12);
    spawn_tool(&mut app, resting_hand);
    step(&mut app, 40);
    let pressed = deformation(&mut app, body, place_m).unwrap();
    assert!(pressed.strain().y_axis.y < -0.02 && pressed.volume_ratio() < 1.0, "{:?}", pressed.strain());
    assert_eq!(deformation(&mut app, body, DVec3::Y * 0.06), None);
    assert_eq!(deformation(&mut app, Entity::PLACEHOLDER, place_m), None);
}

#[test]
fn closest_point_follows_a_body_that_its_transform_moves() {
    let mut app = lockstep_app();
    let body = spawn_block(&mut app);
    step(&mut app, 1);
    let place_m = DVec3::new(0.013, 0.06, -0.007);
    assert!(closest(&mut app, place_m, TouchLayers::ALL).is_some());
    app.world_mut().get_mut::<Transform>(body).unwrap().translation.y = -0.01;
    step(&mut app, 1);
    let moved = closest(&mut app, place_m, TouchLayers::ALL).unwrap();
    assert!((moved.distance_m - 0.02).abs() < 1e-7, "{moved:?}");
}
