//! Gizmos: lattice, contact, near field, basis and force, drawn over the scene.

mod colors;

use crate::body::SimulatedBody;
use crate::cost::FrameCost;
use crate::model_time::ModelStepCount;
use crate::tool::{HapticTool, ToolForce, ToolLoop};
use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{ToolContact, ToolShape};

/// Draws the parts of bodies and tools that [`HapticGizmos`] selects.
///
/// ```no_run
/// use bevy::prelude::*;
/// use bevy_palpate::{HapticGizmos, HapticGizmosPlugin, prelude::*};
///
/// fn setup(mut store: ResMut<GizmoConfigStore>) {
///     let (config, parts) = store.config_mut::<HapticGizmos>();
///     config.line.width = 1.5;
///     parts.lattice = true;
///     parts.basis = Some(0);
/// }
///
/// # let mut app = App::new();
/// app.add_plugins((DefaultPlugins, PalpatePlugins, HapticGizmosPlugin)).add_systems(Startup, setup);
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct HapticGizmosPlugin;

impl HapticGizmosPlugin {
    /// Time to draw a frame's gizmos, on the main thread, ms.
    pub const COST: DiagnosticPath = DiagnosticPath::const_new("palpate/gizmos_cost");
}

/// Gizmo group that selects the drawn parts. Its [`GizmoConfig`] has line width, depth bias and visibility; the default draws in front of
/// the scene.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, GizmoConfigGroup)]
#[reflect(Debug, Default, PartialEq, Clone)]
pub struct HapticGizmos {
    /// Draws springs, and the edges of elements: blue under compression, red under tension, fading with the strain.
    pub lattice: bool,
    /// Strain at which a spring or an edge has its full colour.
    pub strain: f32,
    /// Draws the von Mises stress instead of the strain, from dark (0) to bright (this stress, Pa).
    pub stress_pa: Option<f32>,
    /// Draws fixed nodes.
    pub fixed: bool,
    /// Draws rows of contact patches with their normals, and the nodes to which they are attached.
    pub contact: bool,
    /// Draws the support set of the newest local model, its neighbouring nodes, and the springs with their exact law.
    pub near_field: bool,
    /// Draws this column of the newest local model's basis instead of the strain: colours from dark (unmoved) to bright (largest
    /// displacement) on nodes and springs, as in Fig. 6 of the seed paper. Columns are in order of importance.
    pub basis: Option<usize>,
    /// Draws the device, the proxy, and the force on the hand.
    pub force: bool,
    /// Length of the force's arrow, m/N.
    pub force_m_per_n: f32,
}

impl Default for HapticGizmos {
    /// Contact and force, 2 cm/N; full colours at 5 % strain.
    fn default() -> Self {
        Self {
            lattice: false,
            strain: 0.05,
            stress_pa: None,
            fixed: false,
            contact: true,
            near_field: false,
            basis: None,
            force: true,
            force_m_per_n: 0.02,
        }
    }
}

/// Parts drawn of one body or tool, which override the group's configuration. With all parts off, the entity has no gizmos.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_palpate::{HapticGizmos, HapticGizmosOverride, prelude::*};
/// # fn setup(mut commands: Commands) {
/// let parts = HapticGizmos { lattice: true, ..default() };
/// commands.spawn((DeformableBody::block([6; 3], 0.1), HapticGizmosOverride(parts)));
/// # }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct HapticGizmosOverride(pub HapticGizmos);

/// Time to draw this frame's gizmos.
#[derive(Resource, Default)]
struct GizmosCost(FrameCost);

impl Plugin for HapticGizmosPlugin {
    fn build(&self, app: &mut App) {
        let cost = FrameCost::default();
        let line = GizmoLineConfig { width: 1.5, ..GizmoLineConfig::default() };
        let in_front = GizmoConfig { depth_bias: -1.0, line, ..GizmoConfig::default() };
        app.register_type::<HapticGizmos>()
            .register_type::<HapticGizmosOverride>()
            .insert_gizmo_config(HapticGizmos::default(), in_front)
            .insert_resource(GizmosCost(cost.clone()))
            .register_diagnostic(Diagnostic::new(Self::COST).with_suffix(" ms"))
            // Of coincident lines the first one is visible: that of the near field, not that of the lattice.
            .add_systems(
                PostUpdate,
                (cost.timed(draw_tools), cost.timed(draw_bodies)).chain().before(TransformSystems::Propagate),
            )
            .add_systems(Last, record_cost);
    }
}

fn record_cost(cost: Res<GizmosCost>, mut diagnostics: Diagnostics) {
    diagnostics.add_measurement(&HapticGizmosPlugin::COST, || cost.0.take_ms());
}

/// A body's basis vector: epoch, model step and column, and the relative displacement of each node, 0 to 1; `None` without such a column.
type BasisShown = ((u64, u64, usize), Option<Vec<f32>>);
/// The stress of a body: epoch and model step, and the von Mises stress of each node, Pa.
type StressShown = ((u64, u64), Vec<f32>);

fn draw_bodies(
    mut gizmos: Gizmos<HapticGizmos>,
    store: Res<GizmoConfigStore>,
    bodies: Query<(Entity, &SimulatedBody, Option<&HapticGizmosOverride>)>,
    steps: Res<ModelStepCount>,
    (mut shown, mut stresses): (Local<EntityHashMap<BasisShown>>, Local<EntityHashMap<StressShown>>),
) {
    let (config, group) = store.config::<HapticGizmos>();
    if !config.enabled {
        return;
    }
    let parts_of = |own: Option<&HapticGizmosOverride>| own.map_or(*group, |own| own.0);
    shown.retain(|entity, _| bodies.get(*entity).is_ok_and(|(.., own)| parts_of(own).basis.is_some()));
    stresses.retain(|entity, _| bodies.get(*entity).is_ok_and(|(.., own)| parts_of(own).stress_pa.is_some()));
    for (entity, simulated, own) in &bodies {
        let parts = parts_of(own);
        let body = simulated.body();
        let (network, x) = (body.network(), simulated.drawn_m());
        let at = |node: usize| x[node].as_vec3();
        let size = cross_size(simulated);
        if let Some(column) = parts.basis {
            let of = (simulated.epoch(), steps.0, column);
            if shown.get(&entity).is_none_or(|(cached, _)| *cached != of) {
                let shares = simulated.basis_column(column).map(|moves| colors::shares(&moves));
                shown.insert(entity, (of, shares));
            }
        }
        if let Some(shares) = shown.get(&entity).and_then(|(_, shares)| shares.as_ref()) {
            let color = |node: usize| colors::bright(shares.get(node).copied().unwrap_or(0.0));
            for [a, b] in network.edges() {
                gizmos.line_gradient(at(a), at(b), color(a), color(b));
            }
            (0..x.len()).for_each(|node| gizmos.cross(at(node), size, color(node)));
        } else if let Some(full_pa) = parts.stress_pa {
            let now = (simulated.epoch(), steps.0);
            let (of, stress_pa) = stresses.entry(entity).or_default();
            if *of != now || stress_pa.len() != x.len() {
                let states = body.node_stresses();
                (*of, *stress_pa) = (now, states.iter().map(|state| state.von_mises_pa() as f32).collect());
            }
            let color = |node: usize| colors::bright(stress_pa[node] / full_pa);
            for [a, b] in network.edges() {
                gizmos.line_gradient(at(a), at(b), color(a), color(b));
            }
        } else if parts.lattice {
            let rest_m = network.rest_m();
            for [a, b] in network.edges() {
                let strain = (x[b].distance(x[a]) / rest_m[b].distance(rest_m[a]) - 1.0) as f32;
                gizmos.line(at(a), at(b), colors::strained(strain / parts.strain));
            }
        }
        if parts.fixed {
            for node in (0..x.len()).filter(|&node| network.is_fixed(node)) {
                let here = Transform::from_translation(at(node)).with_scale(Vec3::splat(size));
                gizmos.cube(here, colors::FIXED);
            }
        }
    }
}

/// Half the size of a node's cross, m: a part of an edge.
fn cross_size(simulated: &SimulatedBody) -> f32 {
    let network = simulated.body().network();
    let length_m = network.edges().next().map(|[a, b]| network.rest_m()[a].distance(network.rest_m()[b]));
    length_m.map_or(1e-3, |length_m| 0.12 * length_m as f32)
}

fn draw_tools(
    mut gizmos: Gizmos<HapticGizmos>,
    store: Res<GizmoConfigStore>,
    tools: Query<(&HapticTool, &ToolLoop, &ToolForce, &Transform, Option<&HapticGizmosOverride>)>,
    bodies: Query<&SimulatedBody>,
) {
    let (config, group) = store.config::<HapticGizmos>();
    if !config.enabled {
        return;
    }
    for (described, tool, force, transform, own) in &tools {
        let parts = own.map_or(*group, |own| own.0);
        let proxy = transform.translation;
        let radius = radius_m(described.shape);
        if parts.force {
            let device = proxy - tool.proxy_offset_m().as_vec3();
            if proxy.distance(device) > 1e-5 {
                draw_shape(&mut gizmos, described.shape, device, colors::DEVICE);
                gizmos.line(device, proxy, colors::DEVICE);
            }
            draw_shape(&mut gizmos, described.shape, proxy, colors::TOOL);
            let arrow = parts.force_m_per_n * force.force_n.as_vec3();
            if arrow.length() > 1e-4 {
                gizmos.arrow(proxy, proxy + arrow, colors::FORCE).with_tip_length(0.15 * arrow.length());
            }
        }
        for ((body, contact), support) in tool.contacts().zip([tool.support(), tool.second_support()]) {
            let Ok(simulated) = bodies.get(body) else { continue };
            if parts.near_field {
                draw_near_field(&mut gizmos, simulated, support);
            }
            if parts.contact {
                draw_contact(&mut gizmos, simulated, contact, radius);
            }
        }
    }
}

fn radius_m(shape: ToolShape) -> f32 {
    match shape {
        ToolShape::Sphere { radius_m } | ToolShape::FlatPunch { radius_m, .. } => radius_m as f32,
    }
}

/// Draws a sphere, or the end of a punch and a part of its shaft.
fn draw_shape(gizmos: &mut Gizmos<HapticGizmos>, shape: ToolShape, at: Vec3, color: Color) {
    let radius = radius_m(shape);
    match shape {
        ToolShape::Sphere { .. } => {
            gizmos.sphere(at, radius, color).resolution(20);
        }
        ToolShape::FlatPunch { axis, .. } => {
            let axis = axis.as_vec3();
            let facing = Quat::from_rotation_arc(Vec3::Z, axis);
            for back in [0.0, 2.0 * radius] {
                gizmos.circle(Isometry3d::new(at - back * axis, facing), radius, color);
            }
        }
    }
}

fn draw_near_field(gizmos: &mut Gizmos<HapticGizmos>, simulated: &SimulatedBody, support: &[usize]) {
    let body = simulated.body();
    let (network, x) = (body.network(), simulated.drawn_m());
    let at = |node: usize| x.get(node).copied().unwrap_or(DVec3::ZERO).as_vec3();
    let size = cross_size(simulated);
    // The node numbers are those of the body at the last model step; out of range, they belong to another body.
    let support = if support.iter().all(|&node| node < x.len()) { support } else { &[] };
    for &node in support {
        gizmos.cross(at(node), 1.6 * size, colors::SUPPORT);
        if network.is_fixed(node) {
            continue;
        }
        for other in network.neighbours(node).filter(|other| !support.contains(other) || *other > node) {
            let is_ring = !support.contains(&other);
            gizmos.line(at(node), at(other), if is_ring { colors::RING } else { colors::SUPPORT });
            if is_ring {
                gizmos.cross(at(other), 0.8 * size, colors::RING);
            }
        }
    }
}

fn draw_contact(
    gizmos: &mut Gizmos<HapticGizmos>,
    simulated: &SimulatedBody,
    contact: &ToolContact,
    radius: f32,
) {
    let x = simulated.drawn_m();
    if contact.validate(simulated.body()).is_err() {
        return;
    }
    for touched in contact.touched() {
        let point = touched.body_point().of(x).as_vec3();
        let normal = touched.normal.as_vec3();
        let facing = Isometry3d::new(point, Quat::from_rotation_arc(Vec3::Z, normal));
        gizmos.circle(facing, 0.3 * radius, colors::CONTACT);
        gizmos.arrow(point, point + 2.0 * radius * normal, colors::CONTACT).with_tip_length(0.4 * radius);
    }
    for (node, _) in contact.points().iter().flat_map(|point| point.nodes()) {
        gizmos.cross(x[*node].as_vec3(), cross_size(simulated), colors::CONTACT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;
    use crate::{DeviceSelector, HapticSchedulePlugin, LoopMode};
    use bevy::gizmos::GizmoAsset;
    use bevy::time::TimeUpdateStrategy;
    use palpate_haptics::{Reading, ScriptedDevice};
    use std::time::Duration;

    /// Two blocks of `nodes`³ nodes, one pressed by a tool, with the basis drawn; an update is a model step.
    fn app(nodes: usize) -> (App, [Entity; 2]) {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default()))
            .init_asset::<GizmoAsset>()
            .add_plugins(PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep)))
            .add_plugins(HapticGizmosPlugin)
            .insert_resource(Time::<Fixed>::from_hz(20.0))
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
        app.world_mut().resource_mut::<HapticDevices>().register("hand", || {
            Ok(ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::new(0.0, 0.054, 0.0)))))
        });
        app.world_mut().resource_mut::<GizmoConfigStore>().config_mut::<HapticGizmos>().1.basis = Some(0);
        let block = |app: &mut App, x: f32| {
            let body = (DeformableBody::block([nodes; 3], 0.1), FixedRegion::Face(BoxFace::Bottom));
            app.world_mut().spawn((body, Transform::from_xyz(x, 0.0, 0.0))).id()
        };
        let bodies = [block(&mut app, 0.0), block(&mut app, 0.5)];
        let device = DeviceSelector::named("hand");
        app.world_mut().spawn(HapticTool { device, body: Some(bodies[0]), ..default() });
        (app, bodies)
    }

    #[test]
    fn draws_a_body_refined_during_a_pause() {
        let (mut app, bodies) = app(4);
        (0..5).for_each(|_| app.update());
        assert!(app.world().get::<SimulatedBody>(bodies[0]).unwrap().basis_column(0).is_some());
        app.world_mut().resource_mut::<Time<Virtual>>().pause();
        app.update();
        let steps = app.world().resource::<ModelStepCount>().0;
        for body in bodies {
            app.world_mut().entity_mut(body).insert(DeformableBody::block([7; 3], 0.1));
        }
        (0..3).for_each(|_| app.update());
        assert_eq!(app.world().resource::<ModelStepCount>().0, steps);
        assert_eq!(app.world().get::<SimulatedBody>(bodies[0]).unwrap().body().network().node_count(), 343);
        app.world_mut().resource_mut::<Time<Virtual>>().unpause();
        (0..3).for_each(|_| app.update());
    }
}
