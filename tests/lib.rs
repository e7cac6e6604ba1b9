//! Furniture shared by the closed-loop tests: meshes and files of them, apps, the body and the trajectory of `data/fidelity_6x6x6.json`.

pub mod glb;
pub mod mesh;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

use glam::DVec3;
use palpate_body::{Block, Body, BodyError, Face, UniformLattice};
use palpate_local::Sample;
use std::f64::consts::TAU;

/// The node that the tool drives, (3, 3, 5).
pub const DRIVEN_NODE: usize = 3 + 6 * (3 + 6 * 5);

/// 6 × 6 × 6 nodes, 0.1 m wide, 1 kg, 100 N/m, damping ratio 0.7, the bottom layer (−z) fixed.
///
/// # Errors
/// Never, unless the library refuses the reference's own body.
pub fn reference_body() -> Result<Body, BodyError> {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([6, 6, 6], DVec3::splat(0.1))?.fix(Face::NegZ).uniform(&lattice)?;
    Body::new(block.network, block.surface)
}

/// Offset of the driven node at time `t` (s), m.
#[must_use]
pub fn reference_offset(t: f64) -> DVec3 {
    let slow = 0.010 * (1.0 - (TAU * t).cos()) / 2.0;
    let late = if t > 0.3 { 0.002 * (TAU * 3.3 * t).sin() } else { 0.0 };
    DVec3::new(0.003 * (TAU * 1.7 * t).sin(), 0.0, -(slow + 0.0008 * (TAU * 9.0 * t).sin() + late))
}

/// The reference's 1.5 s at 1 kHz, with backward differences as velocities, starting at `start_m`.
#[must_use]
pub fn reference_samples(start_m: DVec3) -> Vec<Sample> {
    samples(1500, |t| start_m + reference_offset(t))
}

/// A headless app in lock step whose every update is one model step, with a body and a hand.
pub mod app {
    use bevy::prelude::*;
    use bevy::time::TimeUpdateStrategy;
    use bevy_palpate::prelude::*;
    use bevy_palpate::{HapticFaultKind, NoForceCause};
    use std::time::Duration;

    /// Every fault that an app has told, in order, with its causes.
    #[derive(Resource, Default)]
    pub struct Faults(pub Vec<String>);

    /// Every cause of a missing force that an app has told, in order, with its tool.
    #[derive(Resource, Default)]
    struct Causes(Vec<(Entity, NoForceCause)>);

    fn collect_faults(
        mut faults: MessageReader<HapticFault>,
        mut collected: ResMut<Faults>,
        mut causes: ResMut<Causes>,
    ) {
        for fault in faults.read() {
            collected.0.push(fault.kind.report());
            if let (Some(tool), HapticFaultKind::NoForce(cause)) = (fault.entity, &fault.kind) {
                causes.0.push((tool, *cause));
            }
        }
    }

    /// The causes of missing forces told since the last call, each with its tool. They are among [`take_faults`] too.
    pub fn take_causes(app: &mut App) -> Vec<(Entity, NoForceCause)> {
        std::mem::take(&mut app.world_mut().resource_mut::<Causes>().0)
    }

    /// The faults told since the last call.
    pub fn take_faults(app: &mut App) -> Vec<String> {
        std::mem::take(&mut app.world_mut().resource_mut::<Faults>().0)
    }

    /// Every contact message, in order: `"began"` or `"ended"`.
    #[derive(Resource, Default)]
    pub struct Contacts(pub Vec<&'static str>);

    fn collect_contacts(
        mut began: MessageReader<ContactStart>,
        mut ended: MessageReader<ContactEnd>,
        mut told: ResMut<Contacts>,
    ) {
        // Within one update a contact ends before another begins.
        told.0.extend(ended.read().map(|_| "ended"));
        told.0.extend(began.read().map(|_| "began"));
    }

    /// An app with palpate in lock step, at 20 Hz, and a clock that advances 50 ms at every update.
    pub fn lockstep_app() -> App {
        let mut app = App::new();
        app.add_plugins(MinimalPlugins)
            .add_plugins(PalpatePlugins.set(HapticSchedulePlugin { mode: LoopMode::Lockstep, ..default() }))
            .insert_resource(Time::<Fixed>::from_hz(20.0))
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
        listen(&mut app);
        app
    }

    /// Collects the app's faults and contact messages.
    pub fn listen(app: &mut App) {
        app.init_resource::<Faults>()
            .init_resource::<Causes>()
            .init_resource::<Contacts>()
            .add_systems(Last, (collect_faults, collect_contacts));
    }

    /// Runs `steps` model steps. The first update of an app only starts its clock.
    pub fn step(app: &mut App, steps: u64) {
        let count = |app: &App| app.world().resource::<bevy_palpate::ModelStepCount>().0;
        let until = count(app) + steps;
        while count(app) < until {
            app.update();
        }
    }

    /// Updates an app whose loops are on threads until `done`, for twenty seconds at most.
    ///
    /// # Panics
    /// When it is not done by then.
    #[expect(clippy::disallowed_methods, reason = "a test of threads has to wait for them")]
    pub fn update_until(app: &mut App, what: &str, mut done: impl FnMut(&mut App) -> bool) {
        for _ in 0..4000 {
            app.update();
            if done(app) {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("it did not happen within twenty seconds: {what}");
    }

    /// A hand that comes down from 2 mm above the top of a 10 cm block, presses 6 mm deep and leaves, 1.2 s.
    #[must_use]
    pub fn pressing_hand() -> ScriptedDevice {
        ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            let depth = 0.002 - 0.008 * (std::f64::consts::PI * t / 1.2).sin();
            Ok(Reading::at(DVec3::new(0.012, 0.055 + depth, 0.009)))
        })
    }

    /// Spawns a block fixed at its bottom and a tool with `device`; returns body and tool.
    pub fn spawn_scene(app: &mut App, scheme: Scheme, device: fn() -> ScriptedDevice) -> (Entity, Entity) {
        app.world_mut().resource_mut::<HapticDevices>().register("hand", move || Ok(device()));
        let block = (DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom));
        let body = app.world_mut().spawn(block).id();
        let tool = HapticTool { device: DeviceSelector::named("hand"), scheme, ..default() };
        (body, app.world_mut().spawn(tool).id())
    }
}

/// A hand that is `at(t)` at every millisecond, its velocity by backward differences.
#[must_use]
pub fn samples(ticks: usize, at: impl Fn(f64) -> DVec3) -> Vec<Sample> {
    let place = |i: usize| at(i as f64 * 1e-3);
    let velocity = |i: usize| if i == 0 { DVec3::ZERO } else { (place(i) - place(i - 1)) / 1e-3 };
    let sample = |i: usize| Sample {
        sequence: i as u64,
        time_s: i as f64 * 1e-3,
        position_m: place(i),
        velocity_m_per_s: velocity(i),
        ..Sample::default()
    };
    (0..ticks).map(sample).collect()
}

/// The length of the greatest force, N.
#[must_use]
pub fn peak(forces: &[DVec3]) -> f64 {
    forces.iter().map(|f| f.length()).fold(0.0, f64::max)
}
