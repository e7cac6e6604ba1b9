//! Tools that press where triangles meet, in an app: the contact solver converges, and the force is steady.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    HapticSystems, LocalModelStats, LoopTiming, MeshCellSize, MeshShape, ModelSchedule, SimulatedBody,
    TickRecording, testing,
};
use palpate_haptics::{DeviceDescription, DeviceError, HapticDevice, Reading, ScriptedDevice, TickRecord};
use palpate_tests::app::{assert_no_faults, collect_messages, lockstep_app, spawn_tool, step, update_until};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Sums over the body's steps.
#[derive(Resource, Default)]
struct Steps {
    count: usize,
    touching: usize,
    unconverged: usize,
    max_iterations: usize,
}

fn collect_steps(bodies: Query<&SimulatedBody>, mut steps: ResMut<Steps>) {
    for body in &bodies {
        let report = body.last_step();
        steps.count += 1;
        steps.touching += usize::from(report.touched > 0);
        steps.unconverged += report.unconverged;
        steps.max_iterations = steps.max_iterations.max(report.iterations);
    }
}

/// Spawns the README's body and tool; every tick and every step is recorded.
fn spawn<D: HapticDevice + 'static>(app: &mut App, device: impl Fn() -> D + Send + Sync + 'static) -> Entity {
    app.init_resource::<Steps>().add_systems(ModelSchedule, collect_steps.in_set(HapticSystems::Last));
    app.world_mut().spawn((
        DeformableBody::block([6, 6, 6], 0.1),
        Tissue { youngs_modulus_pa: 20e3, ..Tissue::SOFT },
        FixedRegion::Face(BoxFace::Bottom),
    ));
    let tool = spawn_tool(app, device);
    app.world_mut().entity_mut(tool).insert(TickRecording::default());
    tool
}

fn records(app: &App, tool: Entity) -> &[TickRecord] {
    &app.world().get::<TickRecording>(tool).unwrap().records
}

fn is_touching(record: &TickRecord) -> bool {
    record.rendered.force_n != DVec3::ZERO
}

#[test]
fn contact_of_the_readme_program_converges_in_every_tick_and_step() {
    let mut app = lockstep_app();
    let tool = spawn(&mut app, || {
        ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            Ok(Reading::at(DVec3::Y * (0.06 + 0.01 * (3.0 * t).cos())))
        })
    });
    step(&mut app, 60);
    let records = records(&app, tool);
    let touching = records.iter().filter(|record| is_touching(record)).count();
    let unconverged = records.iter().filter(|record| record.rendered.unconverged).count();
    assert!(records.len() >= 2900 && touching > 800, "{} ticks, {touching} in contact", records.len());
    assert_eq!(unconverged, 0);
    assert_eq!(app.world().get::<LoopTiming>(tool).unwrap().unconverged_ticks, 0);
    let steps = app.world().resource::<Steps>();
    assert!(steps.touching > 15, "{} of {}", steps.touching, steps.count);
    assert_eq!(steps.unconverged, 0);
    assert_no_faults(&mut app);
}

/// Number of local models that are built in contact, and of those whose support set is truncated, for a tool that presses 5 mm deep, rests,
/// slides by 20 mm at 0.1 m/s and rests again.
fn truncated(of_mesh: bool, radius_m: f64) -> (usize, usize) {
    let mut app = testing::headless_app();
    let device = move || {
        ScriptedDevice::new(move |n, _| {
            let t = n as f64 * 1e-3;
            let depth_m = (0.02 * t - 2e-3).min(5e-3);
            let slid_m = (0.1 * (t - 0.5).max(0.0)).min(0.02);
            Ok(Reading::at(DVec3::new(slid_m, 0.05 + radius_m - depth_m, 0.009)))
        })
    };
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.1, 0.1, 0.1));
    let block = DeformableBody::block([6; 3], 0.1);
    let shape = MeshShape { cells: MeshCellSize::Along(10), ..MeshShape::new(mesh) };
    let body = if of_mesh { DeformableBody::Mesh(shape) } else { block };
    let body = app.world_mut().spawn((body, FixedRegion::Face(BoxFace::Bottom))).id();
    testing::wait_for_body(&mut app, body);
    let tool = spawn_tool(&mut app, device);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().shape = ToolShape::Sphere { radius_m };
    let (mut built, mut truncated) = (0, 0);
    for _ in 0..20 {
        testing::advance_model_steps(&mut app, 1);
        if app.world().get::<TouchedBody>(tool).unwrap().body.is_some() {
            built += 1;
            truncated += usize::from(app.world().get::<LocalModelStats>(tool).unwrap().support_truncated);
        }
    }
    (built, truncated)
}

#[test]
fn support_set_is_truncated_only_under_a_wide_tool() {
    for of_mesh in [false, true] {
        assert_eq!(truncated(of_mesh, 0.005), (18, 0), "{of_mesh}");
    }
    // A ball of 9 cm under which lie more nodes than a support set has.
    let (built, truncated) = truncated(true, 0.045);
    assert!(built == 18 && truncated > 9, "{truncated} of {built}");
}

/// Maximum number of iterations in a step while a tool presses to a depth of 5 mm and rests.
fn max_iterations(x_m: f64, z_m: f64) -> usize {
    let mut app = lockstep_app();
    let tool = spawn(&mut app, move || {
        ScriptedDevice::new(move |n, _| {
            let depth_m = (2e-5 * n as f64 - 2e-3).min(5e-3);
            Ok(Reading::at(DVec3::new(x_m, 0.055 - depth_m, z_m)))
        })
    });
    step(&mut app, 40);
    assert!(is_touching(records(&app, tool).last().unwrap()));
    let steps = app.world().resource::<Steps>();
    assert_eq!(steps.unconverged, 0, "at ({x_m}, {z_m}) m");
    steps.max_iterations
}

/// Counts the work of a step instead of its time.
#[test]
fn contact_where_triangles_meet_needs_at_most_twice_the_sweeps() {
    let inside = max_iterations(4.3e-3, 1e-3);
    for (x_m, z_m) in [(0.0, 0.0), (0.0, 1e-3), (0.01, 0.01), (0.01, 0.0), (-4e-3, 4e-3)] {
        let iterations = max_iterations(x_m, z_m);
        assert!(iterations <= 2 * inside, "{iterations} at ({x_m}, {z_m}) m, {inside} inside a triangle");
    }
}

/// A device at x = z = 0 that waits for a second, descends and stays at a depth of 5 mm.
#[derive(Clone, Default)]
struct Held(Arc<AtomicU64>);

impl HapticDevice for Held {
    fn describe(&self) -> DeviceDescription {
        ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe()
    }
    fn open(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
    fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
        // Lost samples on a busy machine end the contact: the device leaves the body every five seconds.
        let n = (self.0.fetch_add(1, Ordering::SeqCst) % 5000).saturating_sub(1000);
        let depth_m = (2e-5 * n as f64 - 2e-3).min(5e-3);
        Ok(Reading::at(DVec3::Y * (0.055 - depth_m)))
    }
    fn write(&mut self, _: DVec3) -> Result<(), DeviceError> {
        Ok(())
    }
    fn close(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// With the loop on a thread: a force that changes by less than 10 % over 500 consecutive ticks.
#[test]
fn force_at_rest_where_triangles_meet_is_steady() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins));
    collect_messages(&mut app);
    let hand = Held::default();
    let tool = spawn(&mut app, move || hand.clone());
    update_until(&mut app, "500 ticks at rest with a steady force", |app| {
        let records = records(app, tool);
        let last = &records[records.len().saturating_sub(500)..];
        let is_held = |record: &TickRecord| {
            record.sample.is_some_and(|sample| (sample.position_m.y - 0.05).abs() < 1e-9)
        };
        let forces = || last.iter().map(|record| record.force_n.y);
        let (min, max) = (forces().fold(f64::MAX, f64::min), forces().fold(0.0, f64::max));
        last.len() == 500 && last.iter().all(is_held) && min > 0.5 && min > 0.9 * max
    });
    assert!(records(&app, tool).iter().all(|record| !record.rendered.unconverged));
    assert_eq!(app.world().resource::<Steps>().unconverged, 0);
}
