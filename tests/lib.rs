//! Helpers of the tests in headless apps: apps, meshes, GLB files.

pub mod glb;
pub mod mesh;
pub mod mesh_files;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

/// Headless apps: in lock step with one model step per update, or with loops on threads.
pub mod app {
    use bevy::ecs::schedule::{LogLevel, ScheduleBuildSettings};
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
        // The order of palpate's own systems leaves nothing to chance.
        app.edit_schedule(bevy_palpate::ModelSchedule, |schedule| {
            schedule.set_build_settings(ScheduleBuildSettings {
                ambiguity_detection: LogLevel::Error,
                ..default()
            });
        });
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

    /// A device that presses 5 mm into the top of a 10 cm block within 0.2 s and stays.
    #[must_use]
    pub fn resting_hand() -> ScriptedDevice {
        ScriptedDevice::new(|n, _| {
            let depth_m = 0.006 * (n as f64 / 200.0).min(1.0) - 0.001;
            Ok(Reading::at(DVec3::new(0.011, 0.055 - depth_m, 0.009)))
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
