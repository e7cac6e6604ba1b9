use super::*;
use crate::body::{BodyPlugin, MeshCellSize, MeshShape};
use crate::schedule::HapticSchedulePlugin;
use bevy::mesh::MeshPlugin;
use std::future::{pending, poll_fn};
use std::sync::{Arc, Mutex};
use std::task::{Poll, Waker};

/// A gate that a build waits for: whether it is open, and the task to wake.
#[derive(Clone, Default)]
struct Gate(Arc<Mutex<(bool, Option<Waker>)>>);

impl Gate {
    fn open(&self) {
        let mut gate = self.0.lock().unwrap();
        gate.0 = true;
        if let Some(waker) = gate.1.take() {
            waker.wake();
        }
    }

    async fn passed(self) {
        poll_fn(|context| {
            let mut gate = self.0.lock().unwrap();
            gate.1 = Some(context.waker().clone());
            if gate.0 { Poll::Ready(()) } else { Poll::Pending }
        })
        .await;
    }
}

fn ball(rings: u32) -> Mesh {
    Sphere::new(0.06).mesh().ico(rings).unwrap()
}

fn scene() -> (App, Handle<Mesh>, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin));
    app.add_plugins((HapticSchedulePlugin::default(), BodyPlugin));
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(ball(6));
    let shape = MeshShape { cells: MeshCellSize::Along(6), ..MeshShape::new(mesh.clone()) };
    let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
    (app, mesh, entity)
}

/// Updates until `done` returns true.
///
/// # Panics
/// After 10,000 updates.
fn update_until(app: &mut App, mut done: impl FnMut(&mut App) -> bool) {
    let is_done = (0..10_000).any(|_| {
        app.update();
        std::thread::yield_now();
        done(app)
    });
    assert!(is_done);
}

fn is_building(app: &App, entity: Entity) -> bool {
    matches!(app.world().get::<BodyBuild>(entity), Some(BodyBuild::Running(_)))
}

/// Replaces the running build by one that waits for the returned gate.
fn hold(app: &mut App, entity: Entity) -> Gate {
    let (gate, pool) = (Gate::default(), AsyncComputeTaskPool::get());
    let mut build = app.world_mut().get_mut::<BodyBuild>(entity).unwrap();
    let BodyBuild::Running(running) = &mut *build else { panic!("no build is running") };
    let task = std::mem::replace(&mut running.task, pool.spawn(pending()));
    let passed = gate.clone().passed();
    running.task = pool.spawn(async move {
        passed.await;
        task.await
    });
    gate
}

/// A body of a ball whose mesh has changed to one of 12 rings, with the build from the new mesh waiting for the gate.
fn reloading() -> (App, Handle<Mesh>, Entity, Gate) {
    let (mut app, mesh, entity) = scene();
    update_until(&mut app, |app| app.world().get::<SimulatedBody>(entity).is_some());
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&mesh, ball(12)).unwrap();
    update_until(&mut app, |app| is_building(app, entity));
    let gate = hold(&mut app, entity);
    (app, mesh, entity, gate)
}

fn vertices(app: &App, entity: Entity) -> usize {
    app.world().get::<SimulatedBody>(entity).unwrap().closed_mesh().unwrap().vertices_m().len()
}

fn density(app: &App, entity: Entity) -> f64 {
    app.world().get::<SimulatedBody>(entity).unwrap().tissue().density_kg_per_m3
}

/// Asserts that the drawn mesh has the vertices of the mesh from which the body was built.
fn assert_is_shown(app: &App, entity: Entity) {
    let shown = app.world().get::<Mesh3d>(entity).unwrap();
    let shown = app.world().resource::<Assets<Mesh>>().get(&shown.0).unwrap();
    assert_eq!(shown.count_vertices(), vertices(app, entity));
    assert!(shown.indices().unwrap().iter().all(|index| index < vertices(app, entity)));
}

#[test]
fn mesh_change_survives_component_changes_during_the_build() {
    let (mut app, _, entity, gate) = reloading();
    for i in 1..20 {
        app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = 1000.0 + f64::from(i);
        app.update();
        assert!(is_building(&app, entity) && vertices(&app, entity) == ball(6).count_vertices());
    }
    gate.open();
    update_until(&mut app, |app| vertices(app, entity) == ball(12).count_vertices());
    update_until(&mut app, |app| density(app, entity) == 1019.0);
    assert_eq!(vertices(&app, entity), ball(12).count_vertices());
    app.update();
    assert_is_shown(&app, entity);
    assert!(app.world().get::<BodyBuild>(entity).is_none());
}

#[test]
fn mesh_change_during_a_build_is_built_afterwards() {
    let (mut app, mesh, entity, gate) = reloading();
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&mesh, ball(9)).unwrap();
    (0..5).for_each(|_| app.update());
    assert!(is_building(&app, entity));
    gate.open();
    // In between the body is that of the first change, and is drawn as such.
    update_until(&mut app, |app| vertices(app, entity) != ball(6).count_vertices());
    assert_is_shown(&app, entity);
    update_until(&mut app, |app| vertices(app, entity) == ball(9).count_vertices());
    app.update();
    assert_is_shown(&app, entity);
}

#[test]
fn block_replaces_a_mesh_body_without_waiting_for_its_build() {
    let (mut app, _, entity, gate) = reloading();
    app.world_mut().entity_mut(entity).insert(DeformableBody::block([3; 3], 0.1));
    app.update();
    assert!(app.world().get::<SimulatedBody>(entity).unwrap().closed_mesh().is_none());
    gate.open();
    (0..5).for_each(|_| app.update());
    assert!(app.world().get::<SimulatedBody>(entity).unwrap().closed_mesh().is_none());
}

#[test]
fn body_removed_during_its_build_stays_removed() {
    let (mut app, _, entity) = scene();
    update_until(&mut app, |app| is_building(app, entity));
    let gate = hold(&mut app, entity);
    app.world_mut().entity_mut(entity).remove::<DeformableBody>();
    gate.open();
    (0..5).for_each(|_| app.update());
    let world = app.world();
    assert!(world.get::<SimulatedBody>(entity).is_none() && world.get::<BodyBuild>(entity).is_none());
}
