use super::*;
use crate::body::{BodyPlugin, MeshShape};
use crate::schedule::HapticSchedulePlugin;
use bevy::mesh::MeshPlugin;
use std::future::{pending, poll_fn};
use std::sync::{Arc, Mutex};
use std::task::{Poll, Waker};

/// What a build waits for: whether it may end, and whom to tell then.
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
    let shape = MeshShape { cells_along_longest_axis: 6, ..MeshShape::new(mesh.clone()) };
    let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
    (app, mesh, entity)
}

/// Updates until `done`; panics when it does not come to that.
fn until(app: &mut App, mut done: impl FnMut(&mut App) -> bool) {
    let is_done = (0..10_000).any(|_| {
        app.update();
        std::thread::yield_now();
        done(app)
    });
    assert!(is_done);
}

fn is_making(app: &App, entity: Entity) -> bool {
    matches!(app.world().get::<BodyBuild>(entity), Some(BodyBuild::Running(_)))
}

/// Holds back the build that is under way.
fn hold(app: &mut App, entity: Entity) -> Gate {
    let (gate, pool) = (Gate::default(), AsyncComputeTaskPool::get());
    let mut build = app.world_mut().get_mut::<BodyBuild>(entity).unwrap();
    let BodyBuild::Running(making) = &mut *build else { panic!("nothing is being made") };
    let task = std::mem::replace(&mut making.task, pool.spawn(pending()));
    let passed = gate.clone().passed();
    making.task = pool.spawn(async move {
        passed.await;
        task.await
    });
    gate
}

/// A body of a ball whose mesh has changed to one of 12 rings, which is being made and held back.
fn reloading() -> (App, Handle<Mesh>, Entity, Gate) {
    let (mut app, mesh, entity) = scene();
    until(&mut app, |app| app.world().get::<SimulatedBody>(entity).is_some());
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&mesh, ball(12)).unwrap();
    until(&mut app, |app| is_making(app, entity));
    let gate = hold(&mut app, entity);
    (app, mesh, entity, gate)
}

fn vertices(app: &App, entity: Entity) -> usize {
    app.world().get::<SimulatedBody>(entity).unwrap().closed_mesh().unwrap().vertices_m().len()
}

fn density(app: &App, entity: Entity) -> f64 {
    app.world().get::<SimulatedBody>(entity).unwrap().tissue().density_kg_per_m3
}

/// What it shows has as many vertices as it is made of.
fn assert_is_shown(app: &App, entity: Entity) {
    let shown = app.world().get::<Mesh3d>(entity).unwrap();
    let shown = app.world().resource::<Assets<Mesh>>().get(&shown.0).unwrap();
    assert_eq!(shown.count_vertices(), vertices(app, entity));
    assert!(shown.indices().unwrap().iter().all(|index| index < vertices(app, entity)));
}

#[test]
fn a_new_mesh_is_not_lost_when_something_else_changes_while_it_is_made() {
    let (mut app, _, entity, gate) = reloading();
    for i in 1..20 {
        app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = 1000.0 + f64::from(i);
        app.update();
        assert!(is_making(&app, entity) && vertices(&app, entity) == ball(6).count_vertices());
    }
    gate.open();
    until(&mut app, |app| vertices(app, entity) == ball(12).count_vertices());
    until(&mut app, |app| density(app, entity) == 1019.0);
    assert_eq!(vertices(&app, entity), ball(12).count_vertices());
    app.update();
    assert_is_shown(&app, entity);
    assert!(app.world().get::<BodyBuild>(entity).is_none());
}

#[test]
fn a_mesh_that_changes_while_an_earlier_one_is_made_is_made_next() {
    let (mut app, mesh, entity, gate) = reloading();
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&mesh, ball(9)).unwrap();
    (0..5).for_each(|_| app.update());
    assert!(is_making(&app, entity));
    gate.open();
    // In between it is a body of a mesh that is not there any more, and shown as that.
    until(&mut app, |app| vertices(app, entity) != ball(6).count_vertices());
    assert_is_shown(&app, entity);
    until(&mut app, |app| vertices(app, entity) == ball(9).count_vertices());
    app.update();
    assert_is_shown(&app, entity);
}

#[test]
fn a_block_does_not_wait_for_the_mesh_that_it_takes_the_place_of() {
    let (mut app, _, entity, gate) = reloading();
    app.world_mut().entity_mut(entity).insert(DeformableBody::block([3; 3], 0.1));
    app.update();
    assert!(app.world().get::<SimulatedBody>(entity).unwrap().closed_mesh().is_none());
    gate.open();
    (0..5).for_each(|_| app.update());
    assert!(app.world().get::<SimulatedBody>(entity).unwrap().closed_mesh().is_none());
}

#[test]
fn a_body_that_is_taken_away_while_it_is_made_does_not_come_back() {
    let (mut app, _, entity) = scene();
    until(&mut app, |app| is_making(app, entity));
    let gate = hold(&mut app, entity);
    app.world_mut().entity_mut(entity).remove::<DeformableBody>();
    gate.open();
    (0..5).for_each(|_| app.update());
    let world = app.world();
    assert!(world.get::<SimulatedBody>(entity).is_none() && world.get::<BodyBuild>(entity).is_none());
}
