//! The trajectories of tools that replay one.

use crate::device::{DeviceSelector, TrajectoryAsset};
use crate::fault::DeviceFault;
use bevy::asset::LoadState;
use bevy::ecs::message::MessageCursor;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

/// The trajectories of the app, and those that have changed.
#[derive(SystemParam)]
pub(super) struct Trajectories<'w, 's> {
    assets: Option<Res<'w, Assets<TrajectoryAsset>>>,
    server: Option<Res<'w, AssetServer>>,
    events: Option<Res<'w, Messages<AssetEvent<TrajectoryAsset>>>>,
    cursor: Local<'s, MessageCursor<AssetEvent<TrajectoryAsset>>>,
    added: Local<'s, Vec<AssetId<TrajectoryAsset>>>,
    modified: Local<'s, Vec<AssetId<TrajectoryAsset>>>,
}

impl Trajectories<'_, '_> {
    /// Collects the trajectories that were added or modified since the last call.
    pub(super) fn update(&mut self) {
        self.added.clear();
        self.modified.clear();
        let Some(events) = &self.events else { return };
        for event in self.cursor.read(events) {
            match event {
                AssetEvent::Added { id } => self.added.push(*id),
                AssetEvent::Modified { id } => self.modified.push(*id),
                _ => {}
            }
        }
    }

    /// Whether the trajectory of `device` was modified between the last two calls of [`Self::update`].
    pub(super) fn is_modified(&self, device: &DeviceSelector) -> bool {
        is_of(device, &self.modified)
    }

    /// Whether the trajectory of `device` was added between the last two calls of [`Self::update`].
    pub(super) fn is_added(&self, device: &DeviceSelector) -> bool {
        is_of(device, &self.added)
    }

    /// Whether `device` does not have to wait for a trajectory that is still being loaded.
    ///
    /// # Errors
    /// [`DeviceFault`] if the trajectory cannot be loaded.
    pub(super) fn is_ready(&self, device: &DeviceSelector) -> Result<bool, DeviceFault> {
        let DeviceSelector::Replay { trajectory, .. } = device else { return Ok(true) };
        let assets = self.assets.as_ref().ok_or(DeviceFault::NoTrajectories)?;
        if assets.contains(trajectory) {
            return Ok(true);
        }
        match self.server.as_ref().and_then(|server| server.get_load_state(trajectory)) {
            Some(LoadState::Failed(error)) => Err(DeviceFault::Trajectory(error)),
            _ => Ok(false),
        }
    }

    /// The loaded trajectories.
    pub(super) fn assets(&self) -> Option<&Assets<TrajectoryAsset>> {
        self.assets.as_deref()
    }
}

/// Whether the trajectory of `device` is one of `ids`.
fn is_of(device: &DeviceSelector, ids: &[AssetId<TrajectoryAsset>]) -> bool {
    matches!(device, DeviceSelector::Replay { trajectory, .. } if ids.contains(&trajectory.id()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::TrajectoryAsset;
    use crate::fault::{HapticFault, HapticFaultKind};
    use crate::prelude::*;
    use crate::testing;
    use crate::tool::ToolLoop;
    use crate::{DeviceSelector, HapticSchedulePlugin, LoopMode};
    use bevy::asset::io::memory::{Dir, MemoryAssetReader};
    use bevy::asset::io::{AssetSourceBuilder, AssetSourceId};
    use bevy::time::TimeUpdateStrategy;
    use palpate_haptics::{Reading, ScriptedDevice, Trajectory};
    use std::path::Path;
    use std::time::Duration;

    /// An app with the files of `dir` as assets, in lock step.
    fn app(dir: &Dir) -> App {
        let (root, schedule) = (dir.clone(), HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep));
        let source = AssetSourceBuilder::new(move || Box::new(MemoryAssetReader { root: root.clone() }));
        let mut app = App::new();
        app.register_asset_source(AssetSourceId::Default, source)
            .add_plugins((MinimalPlugins, AssetPlugin::default(), PalpatePlugins.set(schedule)))
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(10)));
        app.world_mut().spawn((DeformableBody::block([4; 3], 0.1), FixedRegion::Face(BoxFace::Bottom)));
        app
    }

    /// Places the tool `x_m` from the origin.
    fn file(dir: &Dir, x_m: f64) {
        let rows = format!("t_s,x_m,y_m,z_m\n0,{x_m},0.2,0\n0.001,{x_m},0.2,0\n");
        dir.insert_asset_text(Path::new("hand.csv"), &rows);
    }

    /// Updates the app until the tool has a loop and its newest sample is at `x_m`.
    fn wait_for_x(app: &mut App, tool: Entity, x_m: f64) {
        let is_there = |app: &App| {
            let force = app.world().get::<ToolForce>(tool);
            force.is_some_and(|force| (force.device_position_m.x - x_m).abs() < 1e-9)
        };
        let has_come = (0..10_000).any(|_| {
            testing::advance_model_steps(app, 1);
            std::thread::yield_now();
            is_there(app) && app.world().get::<ToolLoop>(tool).is_some()
        });
        assert!(has_come, "{:?}", app.world().get::<ToolForce>(tool));
    }

    /// The device faults since the last call.
    fn device_faults(app: &mut App) -> Vec<String> {
        let faults = app.world_mut().resource_mut::<Messages<HapticFault>>().drain().collect::<Vec<_>>();
        let is_device = |fault: &&HapticFault| matches!(fault.kind, HapticFaultKind::Device(_));
        faults.iter().filter(is_device).map(|fault| fault.kind.report()).collect()
    }

    #[test]
    fn tool_starts_when_its_file_is_loaded_and_restarts_when_it_is_reloaded() {
        let dir = Dir::default();
        file(&dir, 0.01);
        let mut app = app(&dir);
        let trajectory = app.world().resource::<AssetServer>().load::<TrajectoryAsset>("hand.csv");
        let tool = app.world_mut().spawn(HapticTool::new(trajectory.clone())).id();
        wait_for_x(&mut app, tool, 0.01);
        file(&dir, 0.02);
        app.world().resource::<AssetServer>().reload("hand.csv");
        wait_for_x(&mut app, tool, 0.02);
        // A running tool has a copy.
        app.world_mut().resource_mut::<Assets<TrajectoryAsset>>().remove(&trajectory);
        testing::advance_model_steps(&mut app, 3);
        assert!(app.world().get::<ToolLoop>(tool).is_some());
        assert_eq!(device_faults(&mut app), [""; 0]);
    }

    #[test]
    fn failed_load_is_a_fault_with_its_cause_and_the_tool_starts_once_it_is_corrected() {
        let dir = Dir::default();
        dir.insert_asset_text(Path::new("hand.csv"), "t_s,x_m,y_m,z_m\n0,0,0,0\n");
        let mut app = app(&dir);
        let trajectory = app.world().resource::<AssetServer>().load::<TrajectoryAsset>("hand.csv");
        let tool = app.world_mut().spawn(HapticTool::new(trajectory)).id();
        let faults = (0..10_000).find_map(|_| {
            app.update();
            std::thread::yield_now();
            Some(device_faults(&mut app)).filter(|faults| !faults.is_empty())
        });
        let [fault] = &faults.expect("a fault")[..] else { panic!("one fault") };
        assert!(fault.contains("hand.csv: 1 rows; a trajectory has at least 2"), "{fault}");
        for _ in 0..20 {
            app.update();
            assert_eq!(device_faults(&mut app), [""; 0]);
        }
        file(&dir, 0.03);
        app.world().resource::<AssetServer>().reload("hand.csv");
        wait_for_x(&mut app, tool, 0.03);
    }

    #[test]
    fn trajectory_that_is_not_loaded_for_5_s_is_one_fault() {
        let mut app = app(&Dir::default());
        app.update();
        let id = app.world().resource::<Assets<TrajectoryAsset>>().reserve_handle();
        let tool = app.world_mut().spawn(HapticTool::new(id.clone())).id();
        let faults: Vec<String> = (0..1200)
            .flat_map(|_| {
                app.update();
                device_faults(&mut app)
            })
            .collect();
        assert!(matches!(&faults[..], [fault] if fault.contains("is not loaded")), "{faults:?}");
        let still = Trajectory::from_positions(vec![DVec3::new(0.04, 0.2, 0.0); 2]).unwrap();
        let mut assets = app.world_mut().resource_mut::<Assets<TrajectoryAsset>>();
        assets.insert(id.id(), TrajectoryAsset(still)).unwrap();
        wait_for_x(&mut app, tool, 0.04);
    }

    #[test]
    fn replay_without_assets_is_a_fault_and_other_devices_run() {
        let mut app = App::new();
        let schedule = HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep);
        app.add_plugins((MinimalPlugins, PalpatePlugins.set(schedule)))
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(10)));
        app.world_mut()
            .resource_mut::<HapticDevices>()
            .register("hand", || Ok(ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::X * 0.05)))));
        app.world_mut().spawn(HapticTool::new(DeviceSelector::replay(Handle::default())));
        let tool = app.world_mut().spawn(HapticTool::new("hand")).id();
        app.update();
        let faults = device_faults(&mut app);
        assert!(matches!(&faults[..], [fault] if fault.contains("AssetPlugin")), "{faults:?}");
        wait_for_x(&mut app, tool, 0.05);
    }
}
