//! What happens in a model step: avian's rigid bodies move as obstacles, and the reactions of the soft bodies correct them.

use super::coupling::{
    Coupling, Kinematics, MassProperties, MassPropertiesItem, Share, State, StateMut, StateMutItem, Step,
};
use super::math::{HeldResponse, Wrench};
use super::supports::Supports;
use crate::body::SimulatedBody;
use crate::model_time::{ModelClock, ModelRate};
use crate::surroundings::CoupledObstacle;
use avian3d::prelude::{RigidBody, SleepTimer, Sleeping};
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use glam::{DMat3, DQuat, DVec3};
use palpate_body::{CoupledMotion, RigidResponse};

/// Share of the model step below which avian counts as paused, and above which part of its motion is left out.
const PAUSED: f64 = 0.01;
const LATE: f64 = 1.5;
/// Deviation of avian's time from that of the model step, as a share of it, that is rounding.
const IN_TIME: f64 = 0.01;
/// Change of velocity in a model step, m/s, and of angular velocity, rad/s, by a change of the reaction that wakes a sleeping body.
const WAKE_M_PER_S: f64 = 5e-3;
const WAKE_RAD_PER_S: f64 = 0.05;

/// Sets the motion of every coupled obstacle in the present model step, from avian's state at its beginning and its end.
pub(super) fn begin_step(
    mut bodies: Query<(
        Entity,
        &mut Coupling,
        &mut CoupledObstacle,
        &RigidBody,
        Kinematics,
        MassProperties,
        Has<Sleeping>,
    )>,
    supports: Supports,
    clock: Res<ModelClock>,
    time: Res<Time>,
) {
    let (span_s, fixed_ahead_s) = (time.delta_secs_f64(), clock.ahead().as_secs_f64());
    for (entity, mut coupling, mut obstacle, kind, kinematics, mass, is_asleep) in &mut bodies {
        let coupling = &mut *coupling;
        let (now, local_m) = (kinematics.state(), mass.center_m());
        // The present tick continues after the end of the model step.
        let (end, ahead) = match &coupling.tick {
            Some(tick) if tick.fixed_s > 0.0 => {
                let ahead = (fixed_ahead_s / tick.fixed_s).clamp(0.0, 1.0);
                (tick.before.towards(&tick.after, 1.0 - ahead, tick.duration_s, local_m), ahead)
            }
            _ => (now, 0.0),
        };
        let (ahead_s, applied_ahead) = coupling
            .tick
            .as_ref()
            .map_or((0.0, Wrench::ZERO), |tick| (ahead * tick.duration_s, tick.applied * ahead));
        let elapsed_s = coupling.elapsed_s - ahead_s;
        let start = coupling.start.filter(|start| !start.has_jumped(&end, elapsed_s.max(0.0)));
        let is_paused = elapsed_s < PAUSED * span_s;
        let (start, has_jumped) = match start {
            Some(start) if elapsed_s > LATE * span_s => {
                (start.towards(&end, 1.0 - span_s / elapsed_s, elapsed_s, local_m), true)
            }
            Some(start) => (start, !coupling.is_placed),
            None => (end, true),
        };
        let is_frozen = is_asleep || is_paused || !kind.is_dynamic() || coupling.start.is_none();
        let free = if is_frozen { RigidResponse::ZERO } else { mass.response(end.rotation) };
        let mut held = HeldResponse::new(free);
        if !is_frozen {
            supports.hold(entity, end.center_m(local_m), end.velocity, &mut held);
        }
        coupling.is_placed = true;
        let change = end.velocity - start.velocity;
        // Frames that are late leave out time of the soft bodies, for which their forces count as given.
        let lateness = elapsed_s / span_s;
        let part = if (lateness - 1.0).abs() > IN_TIME && lateness > PAUSED { 1.0 / lateness } else { 1.0 };
        let is_moving = !(is_asleep || is_paused);
        obstacle.start = (start.position_m, start.rotation);
        obstacle.has_jumped = has_jumped;
        obstacle.motion = CoupledMotion {
            position_m: end.position_m,
            rotation: end.rotation,
            center_m: local_m,
            velocity_change_m_per_s: if is_moving { change.linear } else { DVec3::ZERO },
            angular_velocity_change_rad_per_s: if is_moving { change.angular } else { DVec3::ZERO },
            expected_ns: DVec3::ZERO,
            expected_nms: DVec3::ZERO,
            response: held.rounded(&free),
        };
        obstacle.expected = coupling
            .shares
            .iter()
            .map(|share| {
                let applied = (share.applied - share.force * ahead_s) * part;
                (share.body, applied.linear, applied.angular)
            })
            .collect();
        coupling.step = Some(Step {
            elapsed_s,
            held,
            end,
            ahead_s,
            fixed_ahead_s,
            applied: (coupling.applied - applied_ahead) * part,
            applied_ahead,
            is_frozen,
            has_jumped,
        });
    }
}

/// Sum of the reactions of the soft bodies on a rigid body in a model step.
#[derive(Default)]
struct Reaction {
    /// Impulse and angular impulse about the origin, of each body.
    of_bodies: Vec<(Entity, Wrench)>,
    displacement_m: DVec3,
    turn_rad: DVec3,
    is_unsettled: bool,
    /// Whether a body that sleeps touches it, and none that is awake.
    is_resting: bool,
}

/// Corrects avian's rigid bodies by the difference between the reactions in the model step and the forces that avian has applied,
/// and sets the forces until the next one.
pub(super) fn end_step(
    mut commands: Commands,
    bodies: Query<(Entity, &SimulatedBody)>,
    obstacles: Query<(Entity, &CoupledObstacle)>,
    mut rigid: Query<(
        Entity,
        &mut Coupling,
        MassProperties,
        StateMut,
        Option<&mut SleepTimer>,
        Has<Sleeping>,
    )>,
    rate: Res<ModelRate>,
    time: Res<Time>,
) {
    let mut reactions = sum_reactions(&bodies, &obstacles);
    let span_s = time.delta_secs_f64();
    for (entity, mut coupling, mass, mut state, sleep_timer, is_asleep) in &mut rigid {
        let Ok((_, obstacle)) = obstacles.get(entity) else { continue };
        let coupling = &mut *coupling;
        let reaction = reactions.remove(&entity).unwrap_or_default();
        let Some(step) = coupling.step.take() else { continue };
        if let (Some(mut timer), true) = (sleep_timer, reaction.is_unsettled && !is_asleep) {
            timer.0 = 0.0;
        }
        let end_center_m = step.end.center_m(mass.center_m());
        let total = reaction.of_bodies.iter().fold(Wrench::ZERO, |sum, (_, of)| sum + *of);
        coupling.elapsed_s = step.ahead_s;
        if let Some(tick) = &mut coupling.tick {
            (tick.before, tick.duration_s, tick.fixed_s) = (step.end, step.ahead_s, step.fixed_ahead_s);
            tick.applied = step.applied_ahead;
        }
        let before = coupling.start.replace(step.end);
        if step.is_frozen {
            if is_asleep
                && wakes(total.about(end_center_m) - coupling.force * span_s, &mass, step.end.rotation)
            {
                commands.entity(entity).try_remove::<Sleeping>();
            }
            coupling.applied = Wrench::ZERO;
            if !is_asleep {
                (coupling.force, coupling.due) = (Wrench::ZERO, Wrench::ZERO);
                coupling.shares.clear();
            }
            coupling.shares.iter_mut().for_each(|share| share.applied = Wrench::ZERO);
            continue;
        }
        let total_force = total.about(end_center_m) * (1.0 / span_s);
        if reaction.is_resting && hold_at_rest(coupling, (&step, before), total_force, &mass, &mut state) {
            continue;
        }
        // The account at the end of the model step, without bodies that are gone.
        let gone: Wrench = obstacle
            .expected
            .iter()
            .filter(|(body, ..)| !bodies.contains(*body))
            .fold(Wrench::ZERO, |sum, (_, p, l)| sum + Wrench::new(*p, *l).about_origin(end_center_m));
        coupling.due += total + gone - step.applied;
        coupling.applied = step.applied_ahead;
        let force_before = std::mem::take(&mut coupling.shares);
        let borne = correct(coupling, &step, &reaction, &mass, &mut state);
        let acting = reaction.of_bodies.iter().filter(|(_, of)| *of != Wrench::ZERO);
        coupling.shares = acting
            .map(|(body, of)| {
                let before = force_before.iter().find(|share| share.body == *body);
                let applied = before.map_or(Wrench::ZERO, |share| share.force * step.ahead_s);
                let force = step.held.free_part(of.about(end_center_m)) * (1.0 / span_s);
                Share { body: *body, force, applied }
            })
            .collect();
        coupling.force =
            coupling.shares.iter().fold(borne * (1.0 / rate.period_s()), |sum, share| sum + share.force);
        if !(coupling.force.is_finite() && coupling.due.is_finite()) {
            (coupling.force, coupling.due) = (Wrench::ZERO, Wrench::ZERO);
            coupling.shares.clear();
        }
    }
}

/// Sums the reactions on every coupled obstacle.
fn sum_reactions(
    bodies: &Query<(Entity, &SimulatedBody)>,
    obstacles: &Query<(Entity, &CoupledObstacle)>,
) -> EntityHashMap<Reaction> {
    let mut sums: EntityHashMap<Reaction> = EntityHashMap::default();
    let mut sorted: Vec<(Entity, &SimulatedBody)> = bodies.iter().collect();
    sorted.sort_unstable_by_key(|(body, _)| *body);
    for (body, simulated) in sorted {
        for ((entity, _), reaction) in simulated.obstacles.iter().zip(simulated.body.obstacle_reactions()) {
            let Ok((_, obstacle)) = obstacles.get(*entity) else { continue };
            let expected = obstacle.expected.iter().find(|(of, ..)| *of == body);
            let sum = sums.entry(*entity).or_default();
            if simulated.failed.is_some() {
                // The body did not move, so its reaction is unknown.
                if let Some((_, p, l)) = expected {
                    let center_m =
                        obstacle.motion.position_m + obstacle.motion.rotation * obstacle.motion.center_m;
                    sum.of_bodies.push((body, Wrench::new(*p, *l).about_origin(center_m)));
                }
                continue;
            }
            let impulse = Wrench::new(reaction.impulse_ns, reaction.moment_nms);
            if impulse == Wrench::ZERO && expected.is_none() {
                continue;
            }
            let share = 1.0 / obstacle.share_count(body) as f64;
            sum.of_bodies.push((body, impulse));
            sum.displacement_m += share * reaction.displacement_m;
            sum.turn_rad += share * reaction.turn_rad;
            let is_asleep = simulated.last_step.is_asleep;
            sum.is_resting = is_asleep && (sum.is_resting || sum.of_bodies.len() == 1);
            sum.is_unsettled |= !simulated.body.is_settled();
        }
    }
    sums
}

/// Holds avian's body where it was, at rest: the soft bodies that touch it sleep, and bear whatever changes its velocity by less than
/// what wakes it. Returns whether it does.
fn hold_at_rest(
    coupling: &mut Coupling,
    (step, before): (&Step, Option<State>),
    reaction: Wrench,
    mass: &MassPropertiesItem<'_, '_>,
    body: &mut StateMutItem<'_, '_>,
) -> bool {
    let Some(before) = before.filter(|_| !step.has_jumped) else { return false };
    let velocity = step.end.velocity;
    if velocity.linear.length() > WAKE_M_PER_S || velocity.angular.length() > WAKE_RAD_PER_S {
        return false;
    }
    let change = velocity - before.velocity;
    let momentum =
        Wrench::new(mass.mass_kg() * change.linear, mass.tensor_kg_m2(step.end.rotation) * change.angular);
    let unbalanced = step.held.free_part(momentum) * (1.0 / step.elapsed_s);
    // What grows little by little is not held for ever.
    if wakes((coupling.force - unbalanced - reaction) * step.elapsed_s, mass, step.end.rotation) {
        return false;
    }
    coupling.force -= unbalanced;
    let parts = coupling.shares.len() as f64;
    for share in &mut coupling.shares {
        share.force -= unbalanced * (1.0 / parts);
        share.applied = Wrench::ZERO;
    }
    (coupling.applied, coupling.due) = (Wrench::ZERO, Wrench::ZERO);
    body.turn(before.rotation);
    body.place(before.position_m);
    body.set_velocity(Wrench::ZERO);
    let at_rest = State { velocity: Wrench::ZERO, ..before };
    coupling.start = Some(at_rest);
    if let Some(tick) = &mut coupling.tick {
        (tick.before, tick.after) = (at_rest, at_rest);
    }
    true
}

/// Whether a change of the reaction on a sleeping body would move it.
fn wakes(change: Wrench, mass: &MassPropertiesItem<'_, '_>, rotation: DQuat) -> bool {
    let velocity = HeldResponse::new(mass.response(rotation)).velocity(change);
    velocity.linear.length() > WAKE_M_PER_S || velocity.angular.length() > WAKE_RAD_PER_S
}

/// Applies the free part of what is due to avian's body, and moves it to where the soft bodies have pushed it. Returns the impulse
/// and angular impulse about the centre of mass that other bodies of avian bear; they are applied until the next model step.
fn correct(
    coupling: &mut Coupling,
    step: &Step,
    reaction: &Reaction,
    mass: &MassPropertiesItem<'_, '_>,
    body: &mut StateMutItem<'_, '_>,
) -> Wrench {
    let (local_m, mass_kg) = (mass.center_m(), mass.mass_kg());
    let now = body.state();
    let center_m = now.center_m(local_m);
    let due = coupling.due.about(center_m);
    let free = step.held.free_part(due);
    let change = step.held.velocity(free);
    let moved_m = reaction.displacement_m + step.ahead_s * change.linear;
    let turned_rad = reaction.turn_rad + step.ahead_s * change.angular;
    if change == Wrench::ZERO && moved_m == DVec3::ZERO && turned_rad == DVec3::ZERO {
        return due - free;
    }
    if turned_rad != DVec3::ZERO {
        body.turn((DQuat::from_scaled_axis(turned_rad) * now.rotation).normalize());
    }
    let turned = body.state().rotation;
    body.place(center_m + moved_m - turned * local_m);
    let after = body.state();
    let (tensors, velocity) =
        ([now.rotation, turned].map(|rotation| mass.tensor_kg_m2(rotation)), now.velocity + change);
    let is_free = !step.held.is_held() && !mass.has_locked_axes() && tensors[0] != DMat3::ZERO;
    let mut spin = velocity.angular;
    if is_free {
        // The displacement changes the angular momentum about the origin, and the rotation the inertia.
        let moment = (after.center_m(local_m) - center_m).cross(mass_kg * velocity.linear);
        spin = tensors[1].inverse() * (tensors[0] * now.velocity.angular + free.angular - moment);
    }
    body.set_velocity(Wrench::new(velocity.linear, spin));
    let after = body.state();
    coupling.due = (due - free).about_origin(center_m);
    if is_free {
        let momentum = |of: &State, tensor: DMat3| {
            let p = mass_kg * of.velocity.linear;
            Wrench::new(p, tensor * of.velocity.angular).about_origin(of.center_m(local_m))
        };
        // What rounding has left.
        coupling.due +=
            free.about_origin(center_m) - (momentum(&after, tensors[1]) - momentum(&now, tensors[0]));
    }
    let turn = DQuat::from_scaled_axis(reaction.turn_rad);
    let end = &step.end;
    let turned_end = (turn * end.rotation).normalize();
    let start = State {
        position_m: end.center_m(local_m) + reaction.displacement_m - turned_end * local_m,
        rotation: turned_end,
        velocity: end.velocity + (after.velocity - now.velocity),
    };
    coupling.start = Some(start);
    if let Some(tick) = &mut coupling.tick {
        (tick.before, tick.after) = (start, after);
    }
    due - free
}
