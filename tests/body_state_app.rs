//! States of bodies, and the event of a body that is ready.

use crate::observed_events::Received::{Fault, Ready};
use crate::observed_events::{events, observe, observed_app};
use bevy::asset::{AssetPlugin, Handle};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{BodyReady, BodyState, FaultSeverity, SimulatedBody};
use palpate_tests::app::{
    assert_no_faults, collect_messages, lockstep_app, spawn_block, step, take_faults, update_until,
};
use palpate_tests::mesh::{add, ball, mesh_app, replace, spawn_of, torn};

fn state(app: &App, body: Entity) -> BodyState {
    app.world().get::<BodyState>(body).unwrap().clone()
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
