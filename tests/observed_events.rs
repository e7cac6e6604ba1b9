//! Events that the observers of an app have received.

use Received::{Fault, Grasp, Leave, Ready, Release, Torn, Touch};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{BodyReady, FaultSeverity, GraspEnd, GraspStart, SimulatedBody};
use palpate_tests::app::lockstep_app;

/// An event that an observer has received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    Touch(Entity, Entity),
    Leave(Entity, Entity),
    Grasp(Entity, Entity),
    Release(Entity, Entity),
    Torn(Entity, Entity),
    Ready(Entity),
    Fault(Option<Entity>, FaultSeverity),
}

/// Events of global observers, in order.
#[derive(Resource, Default)]
pub struct Events(Vec<Received>);

/// Adds global observers for all events.
pub fn observe(app: &mut App) {
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

pub fn events(app: &mut App) -> Vec<Received> {
    std::mem::take(&mut app.world_mut().resource_mut::<Events>().0)
}

pub fn observed_app() -> App {
    let mut app = lockstep_app();
    observe(&mut app);
    app
}
