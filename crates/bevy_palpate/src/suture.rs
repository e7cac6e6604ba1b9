//! Sutures: threads through bodies.

use crate::body::{DeformableBody, SimulatedBody};
use crate::fault::{FaultWriter, HapticFaultKind, SutureFault, add_faults};
use crate::schedule::{HapticSystems, ModelSchedule};
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{Body, BodyError, BodyPoint, SurfaceTree, Tie};

/// A thread between two points of a body's surface, on an entity of its own. Despawning the entity removes the thread. Requires
/// [`SutureForce`].
///
/// The thread is a unilateral spring: its tension is the stiffness times the distance of its ends beyond the thread's length, and zero
/// below that length. With an infinite stiffness the length is a unilateral constraint of the distance.
///
/// The pierced points are computed when the suture is inserted, and when its ends or its body change, on the body's present shape. A change
/// of length, stiffness or limit takes effect at the next model step: a shorter inextensible thread pulls its ends together at 1 m/s. A
/// thread whose ends are one point, or are both fixed, is rejected ([`SutureFault`]).
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[require(SutureForce, Sewn)]
#[reflect(Component, Debug, PartialEq, Clone)]
pub struct Suture {
    /// The body.
    #[entities]
    pub body: Entity,
    /// Ends of the thread, m, world frame. The nearest points of the surface within [`Suture::WITHIN_M`] are pierced.
    pub ends_m: [DVec3; 2],
    /// Length of the unloaded thread, m.
    pub length_m: f64,
    /// Stiffness of the thread, N/m; infinite for an inextensible thread.
    pub stiffness_n_per_m: f64,
    /// Tension at which the thread tears, N; may be infinite.
    pub tear_limit_n: f64,
}

impl Suture {
    /// Maximum distance of [`Self::ends_m`] from the surface, m.
    pub const WITHIN_M: f64 = 0.02;
}

/// Force and ends of a suture, updated at every model step.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct SutureForce {
    /// Tension of the thread in the last step, N.
    pub tension_n: f64,
    /// Force of the body's springs on each end, N, world frame. At rest the two are opposite, with the tension as their magnitude.
    pub pull_n: [DVec3; 2],
    /// Positions of the pierced points, m, world frame.
    pub ends_m: [DVec3; 2],
    /// Whether the thread has torn. A torn thread has no effect.
    pub is_torn: bool,
}

/// A suture has torn: a message, and an event for observers of the suture, which run in the model step.
#[derive(EntityEvent, Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct SutureTorn {
    /// The suture.
    #[event_target]
    pub suture: Entity,
    /// The body.
    pub body: Entity,
    /// Tension at which the thread tore, N.
    pub tension_n: f64,
}

/// Points at which a suture pierces its body.
#[derive(Component, Clone, Debug, Default)]
struct Sewn {
    stitch: Option<Stitch>,
    /// Number of the body's shape at the last rejection, which is reported once for each shape.
    rejected_shape: Option<u64>,
}

#[derive(Clone, Debug, PartialEq)]
struct Stitch {
    body: Entity,
    ends_m: [DVec3; 2],
    /// Number of the body's shape to whose nodes the points belong.
    shape: u64,
    points: [BodyPoint; 2],
}

/// Adds the sutures to the bodies and writes their results.
#[derive(Clone, Copy, Debug, Default)]
pub struct SuturePlugin;

/// The sets of [`SuturePlugin`]'s systems, before and after the step of the bodies.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum SutureSystems {
    /// Before the bodies are stepped.
    Sew,
    /// After the bodies are stepped.
    Report,
}

impl Plugin for SuturePlugin {
    fn build(&self, app: &mut App) {
        add_faults(app);
        app.register_type::<Suture>()
            .register_type::<SutureForce>()
            .register_type::<SutureTorn>()
            .add_message::<SutureTorn>()
            .configure_sets(
                ModelSchedule,
                (SutureSystems::Sew, SutureSystems::Report).chain().in_set(HapticSystems::StepBodies),
            )
            .add_systems(
                ModelSchedule,
                (sew.in_set(SutureSystems::Sew), report.in_set(SutureSystems::Report)),
            );
    }
}

/// Sets the ties of every body whose sutures have changed.
fn sew(
    mut sutures: Query<(Entity, Ref<Suture>, &mut Sewn, &mut SutureForce)>,
    mut bodies: Query<(Entity, &mut SimulatedBody)>,
    described_bodies: Query<(), With<DeformableBody>>,
    mut changed: Local<Vec<Entity>>,
    mut faults: FaultWriter,
) {
    changed.clear();
    for (entity, suture, mut sewn, mut force) in &mut sutures {
        let shape = bodies.get(suture.body).ok().map(|(_, body)| body.shape);
        let fits = |stitch: &Stitch| {
            (stitch.body, stitch.ends_m) == (suture.body, suture.ends_m) && shape == Some(stitch.shape)
        };
        let was_sewn = sewn.stitch.is_some();
        if sewn.stitch.as_ref().is_some_and(fits) {
            if suture.is_changed() {
                changed.push(suture.body);
            }
            continue;
        }
        // A body of another shape may have a surface near the ends, or nodes that are free to move.
        let is_reshaped = shape.is_some() && sewn.rejected_shape.is_some() && shape != sewn.rejected_shape;
        // A body that is not built yet is no fault.
        if shape.is_none() && described_bodies.contains(suture.body)
            || !(suture.is_changed() || was_sewn || is_reshaped || force.is_added())
        {
            continue;
        }
        changed.extend(sewn.stitch.take().map(|stitch| stitch.body));
        let stitch = bodies
            .get(suture.body)
            .map_err(|_| SutureFault::NotABody { body: suture.body })
            .and_then(|(_, simulated)| pierce(&suture, simulated));
        match stitch {
            Ok(stitch) => {
                changed.push(suture.body);
                *force = SutureForce::default();
                *sewn = Sewn { stitch: Some(stitch), rejected_shape: None };
            }
            Err(error) => {
                *force = SutureForce::default();
                sewn.rejected_shape = shape;
                faults.write(entity, HapticFaultKind::Suture(error));
            }
        }
    }
    for (body, mut simulated) in &mut bodies {
        let mut sewn_here: Vec<(Entity, &Suture, &[BodyPoint; 2])> = sutures
            .iter()
            .filter(|(.., force)| !force.is_torn)
            .filter_map(|(entity, suture, sewn, _)| {
                let stitch = sewn.stitch.as_ref().filter(|stitch| stitch.body == body)?;
                Some((entity, suture.into_inner(), &stitch.points))
            })
            .collect();
        sewn_here.sort_by_key(|(entity, ..)| *entity);
        let same = sewn_here.iter().map(|(entity, ..)| entity).eq(&simulated.sutures);
        if same && !changed.contains(&body) {
            continue;
        }
        let ties: Result<Vec<Tie>, (Entity, BodyError)> = sewn_here
            .iter()
            .map(|&(entity, suture, points)| tie(suture, points).map_err(|e| (entity, e)))
            .collect();
        let entities: Vec<Entity> = sewn_here.iter().map(|(entity, ..)| *entity).collect();
        let set = ties.and_then(|ties| simulated.body.set_ties(ties).map_err(|e| (body, e)));
        if set.is_ok() {
            simulated.sutures = entities;
        }
        if let Err((entity, error)) = set {
            let kind = HapticFaultKind::Suture(SutureFault::Thread(error));
            faults.write(entity, kind);
        }
    }
}

fn tie(suture: &Suture, [a, b]: &[BodyPoint; 2]) -> Result<Tie, BodyError> {
    Tie::thread(a.clone(), b.clone(), suture.length_m)?
        .with_stiffness(suture.stiffness_n_per_m)?
        .with_tear_limit(suture.tear_limit_n)
}

/// Computes the points at which the suture pierces the surface.
fn pierce(suture: &Suture, simulated: &SimulatedBody) -> Result<Stitch, SutureFault> {
    let tree = SurfaceTree::new(&simulated.body);
    let pierced = |end_m: DVec3| {
        let closest = tree.closest(end_m, Suture::WITHIN_M);
        let too_far = SutureFault::TooFar { end_m, within_m: Suture::WITHIN_M };
        closest.map(|closest| closest.body_point(simulated.body.surface())).ok_or(too_far)
    };
    let [a, b] = suture.ends_m;
    let points = [pierced(a)?, pierced(b)?];
    tie(suture, &points)?;
    has_effect(&points, &simulated.body)?;
    Ok(Stitch { body: suture.body, ends_m: suture.ends_m, shape: simulated.shape, points })
}

/// Maximum difference of equal weights.
const SAME_WEIGHT: f64 = 1e-9;

/// Rejects a thread whose ends cannot move relative to each other.
fn has_effect([a, b]: &[BodyPoint; 2], body: &Body) -> Result<(), SutureFault> {
    let weight = |point: &BodyPoint, node: usize| {
        point.nodes().iter().find(|(other, _)| *other == node).map_or(0.0, |(_, weight)| *weight)
    };
    let mut apart = a.nodes().iter().chain(b.nodes()).map(|(node, _)| *node);
    let mut apart_free = apart.clone().filter(|node| !body.network().is_fixed(*node));
    let differs = |node: usize| (weight(a, node) - weight(b, node)).abs() > SAME_WEIGHT;
    let at_m = |point: &BodyPoint| point.of(body.positions_m());
    if !apart.any(differs) {
        Err(SutureFault::SamePoint { at_m: at_m(a) })
    } else if !apart_free.any(differs) {
        Err(SutureFault::FixedEnds { ends_m: [at_m(a), at_m(b)] })
    } else {
        Ok(())
    }
}

/// Writes the results of every suture, and reports those that have torn.
fn report(
    mut sutures: Query<(Entity, &Sewn, &mut SutureForce)>,
    bodies: Query<&SimulatedBody>,
    mut commands: Commands,
    mut torn: MessageWriter<SutureTorn>,
) {
    for (entity, sewn, mut force) in &mut sutures {
        let Some(stitch) = &sewn.stitch else { continue };
        let Ok(simulated) = bodies.get(stitch.body) else {
            *force = SutureForce::default();
            continue;
        };
        let body: &Body = &simulated.body;
        let index = simulated.sutures.iter().position(|&suture| suture == entity);
        let tie = index.and_then(|index| body.ties().get(index));
        let tension_n = tie.map_or(0.0, |tie| tie.force_n().length());
        if let Some(tension_n) = tie.and_then(Tie::torn_at_n).filter(|_| !force.is_torn) {
            let event = SutureTorn { suture: entity, body: stitch.body, tension_n };
            torn.write(event);
            commands.trigger(event);
            force.is_torn = true;
        }
        force.tension_n = tension_n;
        force.pull_n = stitch.points.each_ref().map(|point| point.internal_force_n(body));
        force.ends_m = stitch.points.each_ref().map(|point| point.of(body.positions_m()));
    }
}
