//! An app with avian, and what its tests measure.

use avian3d::math::{AdjustPrecision, Vector};
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::prelude::{BoxFace, DVec3, DeformableBody, FixedRegion};
use bevy_palpate::{HapticFaultKind, LoopMode, ModelStepCount, ObstacleForce, SimulatedBody, testing};

/// Gravity of both solvers, m/s².
pub const G: f64 = 9.81;

/// An app without gravity, whose fixed main loop runs at `hz`.
pub fn app(hz: f64) -> App {
    let mut app = testing::headless_app();
    app.add_plugins(PhysicsPlugins::default());
    app.insert_resource(Time::<Fixed>::from_hz(hz)).insert_resource(Gravity::ZERO);
    assert_eq!(*app.world().resource::<LoopMode>(), LoopMode::Lockstep);
    let tick = app.world().resource::<Time<Fixed>>().timestep();
    app.insert_resource(TimeUpdateStrategy::ManualDuration(tick));
    app.finish();
    app.cleanup();
    app.update();
    app
}

/// An app with the gravity of the earth for both solvers.
pub fn heavy_app() -> App {
    let mut app = app(64.0);
    app.insert_resource(Gravity(vector(DVec3::NEG_Y * G)));
    app.insert_resource(bevy_palpate::Gravity(DVec3::NEG_Y * G));
    app
}

/// Runs the app until `steps` more model steps have run.
pub fn step(app: &mut App, steps: u64) {
    let end = app.world().resource::<ModelStepCount>().0 + steps;
    while app.world().resource::<ModelStepCount>().0 < end {
        app.update();
    }
}

pub fn vector(v: DVec3) -> Vector {
    v.adjust_precision()
}

pub fn double(v: Vector) -> DVec3 {
    DVec3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

pub fn body(app: &App, entity: Entity) -> &palpate_body::Body {
    app.world().get::<SimulatedBody>(entity).unwrap().body()
}

pub fn is_asleep(app: &App, entity: Entity) -> bool {
    app.world().get::<SimulatedBody>(entity).unwrap().last_step().is_asleep
}

pub fn position(app: &App, entity: Entity) -> DVec3 {
    double(app.world().get::<Position>(entity).unwrap().0)
}

pub fn velocity(app: &App, entity: Entity) -> DVec3 {
    double(app.world().get::<LinearVelocity>(entity).unwrap().0)
}

pub fn mass(app: &App, entity: Entity) -> f64 {
    f64::from(app.world().get::<ComputedMass>(entity).unwrap().value())
}

/// Momentum and angular momentum about the origin of a soft body.
pub fn soft_momentum(app: &App, entity: Entity) -> (DVec3, DVec3) {
    let body = body(app, entity);
    let nodes = body.positions_m().iter().zip(body.velocities_m_per_s()).zip(body.network().mass_kg());
    nodes.fold((DVec3::ZERO, DVec3::ZERO), |(p, l), ((x, v), m)| (p + *m * *v, l + x.cross(*m * *v)))
}

/// Momentum and angular momentum about the origin of a rigid body with an isotropic inertia.
pub fn rigid_momentum(app: &App, entity: Entity) -> (DVec3, DVec3) {
    let world = app.world();
    let p = mass(app, entity) * velocity(app, entity);
    let inertia = f64::from(world.get::<ComputedAngularInertia>(entity).unwrap().tensor().m00);
    let spin = inertia * double(world.get::<AngularVelocity>(entity).unwrap().0);
    (p, position(app, entity).cross(p) + spin)
}

/// Spawns a block of 10 cm whose bottom at y = −0.05 m is fixed.
pub fn fixed_block(app: &mut App) -> Entity {
    app.world_mut().spawn((DeformableBody::block([6; 3], 0.1), FixedRegion::Face(BoxFace::Bottom))).id()
}

/// Spawns a loose block of 10 cm, its lower face at height `y_m`.
pub fn loose_block(app: &mut App, y_m: f32) -> Entity {
    let transform = Transform::from_xyz(0.0, 0.05 + y_m, 0.0);
    app.world_mut().spawn((DeformableBody::block([6; 3], 0.1), transform)).id()
}

/// Weight of a block of 10 cm with the density of water, N.
pub const BLOCK_N: f64 = G;

pub fn center(app: &App, entity: Entity) -> DVec3 {
    let body = body(app, entity);
    let mass = body.network().mass_kg();
    let sum: DVec3 = body.positions_m().iter().zip(mass).map(|(x, m)| *m * *x).sum();
    sum / mass.iter().sum::<f64>()
}

pub fn max_speed(app: &App, entity: Entity) -> f64 {
    body(app, entity).velocities_m_per_s().iter().map(|v| v.length()).fold(0.0, f64::max)
}

pub fn force(app: &App, entity: Entity) -> ObstacleForce {
    *app.world().get::<ObstacleForce>(entity).unwrap()
}

pub fn is_rigid_asleep(app: &App, entity: Entity) -> bool {
    app.world().get::<Sleeping>(entity).is_some()
}

/// The kinds of the faults so far.
pub fn take_faults(app: &mut App) -> Vec<HapticFaultKind> {
    testing::take_faults(app).into_iter().map(|fault| fault.kind).collect()
}
