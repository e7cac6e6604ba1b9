//! Applies gravity, loads and obstacles to the bodies before a step, and writes the forces on the obstacles after it.

use super::coupled::CoupledObstacle;
use super::external_force::ExternalForce;
use super::gravity::{Gravity, GravityScale};
use super::obstacle::ObstacleForce;
use super::prepare::{PreparedObstacle, pose};
use crate::body::SimulatedBody;
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::layers::TouchLayers;
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use glam::{DQuat, DVec3};
use palpate_body::BodyError;

/// Sets the gravity of every body. A value that is not finite is reported once, and leaves the previous one.
pub(super) fn apply_gravity(
    mut bodies: Query<(Entity, &mut SimulatedBody, Option<&GravityScale>)>,
    gravity: Res<Gravity>,
    mut rejected: Local<EntityHashMap<()>>,
    mut faults: FaultWriter,
) {
    rejected.retain(|body, ()| bodies.contains(*body));
    for (entity, mut simulated, scale) in &mut bodies {
        let wanted = gravity.0 * scale.copied().unwrap_or_default().0;
        if simulated.body.gravity_m_per_s2() == wanted {
            rejected.remove(&entity);
            continue;
        }
        match simulated.body.set_gravity(wanted) {
            Ok(()) => drop(rejected.remove(&entity)),
            Err(error) => {
                if rejected.insert(entity, ()).is_none() {
                    faults.write(entity, HapticFaultKind::Gravity(error));
                }
            }
        }
    }
}

/// Sets the loads of every body whose [`ExternalForce`] or shape has changed.
pub(super) fn apply_loads(
    mut bodies: Query<(Entity, &mut SimulatedBody, Option<Ref<ExternalForce>>)>,
    mut faults: FaultWriter,
) {
    for (entity, mut simulated, loads) in &mut bodies {
        let is_changed = loads.as_ref().is_some_and(|loads| loads.is_changed());
        let has_loads = loads.is_some();
        if simulated.has_loads == has_loads && !is_changed {
            continue;
        }
        simulated.has_loads = has_loads;
        let set = node_loads(&simulated, loads.as_deref()).and_then(|(per_node, empty)| {
            if let Some(index) = empty {
                faults.write(entity, HapticFaultKind::EmptyLoad { index });
            }
            simulated.body.set_loads(&per_node)
        });
        if let Err(error) = set {
            faults.write(entity, HapticFaultKind::ExternalForce(error));
        }
    }
}

/// Force on every node, N, and the index of the first load whose region contains no free node.
fn node_loads(
    simulated: &SimulatedBody,
    loads: Option<&ExternalForce>,
) -> Result<(Vec<DVec3>, Option<usize>), BodyError> {
    let network = simulated.body.network();
    let mut per_node = vec![DVec3::ZERO; network.node_count()];
    let mut empty = None;
    for (index, load) in loads.iter().flat_map(|loads| &loads.0).enumerate() {
        let region = load.region.map(|region| region.of(simulated.part_regions())).transpose()?;
        let is_loaded = |node: &&usize| {
            region.as_ref().is_none_or(|region| region.contains(simulated.rest_local_m(**node)))
        };
        let mass: f64 = network.free().iter().filter(is_loaded).map(|&node| network.mass_kg()[node]).sum();
        if mass == 0.0 {
            empty.get_or_insert(index);
            continue;
        }
        for &node in network.free().iter().filter(is_loaded) {
            per_node[node] += load.force_n * (network.mass_kg()[node] / mass);
        }
    }
    Ok((per_node, empty))
}

/// An obstacle at its place in the present step.
struct Placed<'a> {
    entity: Entity,
    version: u64,
    obstacle: &'a palpate_body::Obstacle,
    layers: Option<&'a TouchLayers>,
    /// Position, m, and rotation: now, or at the beginning of the step if it is coupled.
    pose: (DVec3, DQuat),
    coupled: Option<&'a CoupledObstacle>,
}

/// Gives every body the obstacles that share a layer with it, and moves them to their present places during the step.
pub(super) fn place_obstacles(
    mut bodies: Query<(Entity, &mut SimulatedBody, Option<&TouchLayers>)>,
    obstacles: Query<(Entity, &PreparedObstacle, Option<&TouchLayers>)>,
    coupled: Query<(Entity, &CoupledObstacle, Option<&TouchLayers>)>,
    transforms: TransformHelper,
) {
    let standing = obstacles.iter().filter_map(|(entity, prepared, layers)| {
        let (_, position_m, rotation) = pose(&transforms.compute_global_transform(entity).ok()?);
        let PreparedObstacle { obstacle, version, .. } = prepared;
        let pose = (position_m, rotation);
        Some(Placed { entity, version: *version, obstacle, layers, pose, coupled: None })
    });
    let moving = coupled.iter().map(|(entity, of, layers)| {
        let (obstacle, version, pose) = (&of.obstacle, of.version, of.start);
        Placed { entity, version, obstacle, layers, pose, coupled: Some(of) }
    });
    let is_finite = |of: &Placed| of.pose.0.is_finite() && of.pose.1.is_finite();
    let mut placed: Vec<Placed> = standing.chain(moving).filter(is_finite).collect();
    placed.sort_unstable_by_key(|of| of.entity);
    for (body, mut simulated, layers) in &mut bodies {
        let wanted = || {
            placed.iter().filter(move |of| of.entity != body && TouchLayers::are_shared(of.layers, layers))
        };
        let keys = || wanted().map(|of| (of.entity, of.version));
        let is_same = keys().eq(simulated.obstacles.iter().copied());
        if !is_same {
            let shapes =
                wanted().filter_map(|of| of.obstacle.clone().with_pose(of.pose.0, of.pose.1).ok()).collect();
            simulated.obstacles = keys().collect();
            simulated.body.set_obstacles(shapes);
        }
        for (index, of) in wanted().enumerate() {
            // Cannot fail: the obstacle exists, has no mass, and its pose is finite.
            if let Some(coupled) = of.coupled {
                if coupled.has_jumped {
                    let _ = simulated.body.place_obstacle(index, of.pose.0, of.pose.1);
                }
                let _ = simulated.body.couple_obstacle(index, coupled.motion_for(body));
            } else if is_same {
                let _ = simulated.body.move_obstacle(index, of.pose.0, of.pose.1);
            }
        }
    }
}

/// Writes the sum of the reactions of all bodies on each obstacle, if it differs.
pub(super) fn write_forces(
    bodies: Query<&SimulatedBody>,
    mut obstacles: Query<(Entity, &mut ObstacleForce)>,
) {
    let mut sums: EntityHashMap<ObstacleForce> = EntityHashMap::default();
    for simulated in &bodies {
        for ((entity, _), reaction) in simulated.obstacles.iter().zip(simulated.body.obstacle_reactions()) {
            let sum = sums.entry(*entity).or_default();
            sum.force_n += reaction.force_n();
            sum.torque_nm += reaction.torque_nm();
        }
    }
    for (entity, mut force) in &mut obstacles {
        force.set_if_neq(sums.get(&entity).copied().unwrap_or_default());
    }
}
