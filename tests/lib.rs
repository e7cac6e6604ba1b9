//! Helpers of the closed-loop tests: meshes, GLB files, apps, and the body and trajectory of `data/fidelity_6x6x6.json`.

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
/// [`BodyError`] if the library rejects the body of the reference.
pub fn reference_body() -> Result<Body, BodyError> {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([6, 6, 6], DVec3::splat(0.1))?.fix(Face::NegZ).uniform(&lattice)?;
    Body::new(block.network, block.surface)
}

/// Offset of the driven node at time `t`, s, from its rest position, m.
#[must_use]
pub fn reference_offset(t: f64) -> DVec3 {
    let slow = 0.010 * (1.0 - (TAU * t).cos()) / 2.0;
    let late = if t > 0.3 { 0.002 * (TAU * 3.3 * t).sin() } else { 0.0 };
    DVec3::new(0.003 * (TAU * 1.7 * t).sin(), 0.0, -(slow + 0.0008 * (TAU * 9.0 * t).sin() + late))
}

/// Samples of the reference trajectory from `start_m`: 1.5 s at 1 kHz, with velocities by backward differences.
#[must_use]
pub fn reference_samples(start_m: DVec3) -> Vec<Sample> {
    samples(1500, |t| start_m + reference_offset(t))
}

/// Headless apps: in lock step with one model step per update, or with loops on threads.
pub mod app {
    use bevy::prelude::*;
    use bevy::time::TimeUpdateStrategy;
    use bevy_palpate::prelude::*;
    use bevy_palpate::{HapticFaultKind, HapticSchedulePlugin, LoopMode, NoForceCause};
    use palpate_haptics::{HapticDevice, Reading, ScriptedDevice};
    use std::time::Duration;

    /// Faults of an app, in order.
    #[derive(Resource, Default)]
    struct Faults {
        all: Vec<HapticFault>,
        /// Causes of missing forces, each with its tool.
        causes: Vec<(Entity, NoForceCause)>,
    }

    fn collect_faults(mut messages: MessageReader<HapticFault>, mut faults: ResMut<Faults>) {
        for fault in messages.read() {
            if let (Some(tool), HapticFaultKind::NoForce(cause)) = (fault.entity, &fault.kind) {
                faults.causes.push((tool, *cause));
            }
            faults.all.push(fault.clone());
        }
    }

    /// Returns the causes of missing forces since the last call, each with its tool. They are in [`take_faults`] too.
    pub fn take_causes(app: &mut App) -> Vec<(Entity, NoForceCause)> {
        std::mem::take(&mut app.world_mut().resource_mut::<Faults>().causes)
    }

    /// Returns the faults since the last call.
    pub fn take_faults(app: &mut App) -> Vec<HapticFault> {
        std::mem::take(&mut app.world_mut().resource_mut::<Faults>().all)
    }

    /// Returns the kinds of the faults since the last call.
    pub fn take_kinds(app: &mut App) -> Vec<HapticFaultKind> {
        take_faults(app).into_iter().map(|fault| fault.kind).collect()
    }

    /// Returns the texts of the faults since the last call, with their causes.
    pub fn take_reports(app: &mut App) -> Vec<String> {
        take_faults(app).iter().map(|fault| fault.kind.report()).collect()
    }

    /// Asserts that there was no fault since the last call of [`take_faults`] or a function that uses it.
    ///
    /// # Panics
    /// With the texts of the faults.
    #[track_caller]
    pub fn assert_no_faults(app: &mut App) {
        let reports = take_reports(app);
        assert!(reports.is_empty(), "{reports:?}");
    }

    /// Start or end of a contact.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Contact {
        /// [`ContactStart`].
        Start,
        /// [`ContactEnd`].
        End,
    }

    /// Contact messages of an app, in order.
    #[derive(Resource, Default)]
    pub struct Contacts(pub Vec<Contact>);

    fn collect_contacts(
        mut starts: MessageReader<ContactStart>,
        mut ends: MessageReader<ContactEnd>,
        mut contacts: ResMut<Contacts>,
    ) {
        // Within an update a contact ends before another one starts.
        contacts.0.extend(ends.read().map(|_| Contact::End));
        contacts.0.extend(starts.read().map(|_| Contact::Start));
    }

    /// Returns the contact messages of `app` since its start.
    #[must_use]
    pub fn contacts(app: &App) -> Vec<Contact> {
        app.world().get_resource::<Contacts>().map(|contacts| contacts.0.clone()).unwrap_or_default()
    }

    /// Returns an app with palpate in lock step at 20 Hz, whose clock advances by 50 ms at every update.
    pub fn lockstep_app() -> App {
        let mut app = App::new();
        app.add_plugins(MinimalPlugins)
            .add_plugins(PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep)))
            .insert_resource(Time::<Fixed>::from_hz(20.0))
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
        collect_messages(&mut app);
        app
    }

    /// Collects the app's faults and contact messages.
    pub fn collect_messages(app: &mut App) {
        app.init_resource::<Faults>()
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

    /// Updates an app with loops on threads until `done` returns true, for at most twenty seconds.
    ///
    /// # Panics
    /// After twenty seconds.
    #[expect(clippy::disallowed_methods, reason = "a test of threads has to wait for them")]
    pub fn update_until(app: &mut App, what: &str, mut done: impl FnMut(&mut App) -> bool) {
        for _ in 0..4000 {
            app.update();
            if done(app) {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("not within twenty seconds: {what}");
    }

    /// Updates an app without sleeping until `done` returns true; returns false after 10,000 updates.
    pub fn update_until_done(app: &mut App, mut done: impl FnMut(&mut App) -> bool) -> bool {
        (0..10_000).any(|_| {
            app.update();
            std::thread::yield_now();
            done(app)
        })
    }

    /// A device that descends from 2 mm above the top of a 10 cm block to a depth of 6 mm and ascends, within 1.2 s.
    #[must_use]
    pub fn pressing_hand() -> ScriptedDevice {
        ScriptedDevice::new(|n, _| {
            let t = n as f64 * 1e-3;
            let depth = 0.002 - 0.008 * (std::f64::consts::PI * t / 1.2).sin();
            Ok(Reading::at(DVec3::new(0.012, 0.055 + depth, 0.009)))
        })
    }

    /// Spawns a block with 6 × 6 × 6 nodes and edges of 10 cm at the origin, fixed at its bottom.
    pub fn spawn_block(app: &mut App) -> Entity {
        app.world_mut().spawn((DeformableBody::block([6; 3], 0.1), FixedRegion::Face(BoxFace::Bottom))).id()
    }

    /// Registers `device` as "hand" and spawns a tool with it.
    pub fn spawn_tool<D: HapticDevice + 'static>(
        app: &mut App,
        device: impl Fn() -> D + Send + Sync + 'static,
    ) -> Entity {
        app.world_mut().resource_mut::<HapticDevices>().register("hand", move || Ok(device()));
        app.world_mut().spawn(HapticTool::new("hand")).id()
    }

    /// Spawns a block and a tool with `device`; returns body and tool.
    pub fn spawn_scene(app: &mut App, scheme: Scheme, device: fn() -> ScriptedDevice) -> (Entity, Entity) {
        let (body, tool) = (spawn_block(app), spawn_tool(app, device));
        if let Some(mut described) = app.world_mut().get_mut::<HapticTool>(tool) {
            described.scheme = scheme;
        }
        (body, tool)
    }

    /// Returns the force on the hand, N.
    ///
    /// # Panics
    /// If the entity is no tool.
    #[must_use]
    pub fn force_n(app: &App, tool: Entity) -> DVec3 {
        app.world().entity(tool).get::<ToolForce>().map_or(DVec3::NAN, |force| force.force_n)
    }
}

/// Samples of the motion `at(t)`, one per millisecond, with velocities by backward differences.
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

/// Maximum magnitude of the forces, N.
#[must_use]
pub fn peak(forces: &[DVec3]) -> f64 {
    forces.iter().map(|f| f.length()).fold(0.0, f64::max)
}
