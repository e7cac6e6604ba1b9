//! Records the motion of a device to a file for the replay device, and replays a file.

use crate::device::{DeviceSelector, TrajectoryAsset};
use crate::fault::DeviceFault;
use crate::tool::HapticTool;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{IoTaskPool, Task};
use palpate_haptics::{DeviceFrame, HapticsError, Reading, Trajectory};
use palpate_local::SampleHistory;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Recorder of one tool at a time.
#[derive(Default)]
pub(crate) struct Recorder {
    running: Option<Recording>,
    writing: Option<Task<(Result<PathBuf, WriteError>, Vec<Reading>)>>,
    /// A recording that could not be written, until it is written or discarded.
    unwritten: Vec<Reading>,
    /// The newest file, until the panel has read it.
    pub(super) written: Option<PathBuf>,
    /// Message about the last recording or replay.
    pub(super) message: Option<Result<String, String>>,
    /// The devices that were replaced by a replay.
    before: HashMap<Entity, DeviceSelector>,
}

/// A running recording.
struct Recording {
    tool: Entity,
    /// The newest recorded sample.
    newest: Option<u64>,
    /// Position, buttons and orientation of each millisecond, device frame.
    readings: Vec<Reading>,
}

/// Reason why a recording is not in a file.
#[derive(Debug, Error)]
enum WriteError {
    /// The readings are no valid trajectory.
    #[error(transparent)]
    Trajectory(#[from] HapticsError),
    /// The file cannot be written; another path may be valid.
    #[error("{}: {error}", path.display())]
    File { path: PathBuf, error: std::io::Error },
}

/// Maximum length of a recording, ms.
const MAX_READINGS: usize = 600_000;

impl Recorder {
    /// The tool that is being recorded.
    pub(super) fn tool(&self) -> Option<Entity> {
        self.running.as_ref().map(|running| running.tool)
    }

    /// Duration of the running recording, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.running.as_ref().map_or(0.0, |running| running.readings.len() as f64 * Trajectory::PERIOD_S)
    }

    pub(super) fn is_writing(&self) -> bool {
        self.writing.is_some()
    }

    /// Duration of the recording that could not be written, s.
    pub(super) fn unwritten_s(&self) -> Option<f64> {
        (!self.unwritten.is_empty()).then_some(self.unwritten.len() as f64 * Trajectory::PERIOD_S)
    }

    pub(super) fn start(&mut self, tool: Entity) {
        self.running = Some(Recording { tool, newest: None, readings: Vec::new() });
        self.message = None;
    }

    /// Adds the new samples of the tool, mapped to the device by `frame`.
    pub(super) fn record(&mut self, samples: &SampleHistory, frame: &DeviceFrame) {
        let Some(Recording { newest, readings, .. }) = &mut self.running else { return };
        let (Some(last), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) else { return };
        let first = newest.map_or(last.sequence, |newest| newest + 1);
        // A gap, because the loop restarted or the app did not run, repeats the last reading.
        if let (Some(&repeated), Some(gap)) = (readings.last(), oldest.checked_sub(first)) {
            let gap = (gap as usize).min(MAX_READINGS.saturating_sub(readings.len()));
            readings.extend(std::iter::repeat_n(repeated, gap));
        }
        let new = (first.max(oldest)..=last.sequence).filter_map(|sequence| samples.get(sequence));
        readings.extend(new.map(|sample| Reading {
            buttons: sample.buttons,
            orientation: frame.orientation_to_device(sample.orientation),
            ..Reading::at(frame.position_to_device_m(sample.position_m))
        }));
        readings.truncate(MAX_READINGS);
        // A restarted loop counts from zero.
        *newest = Some(last.sequence);
    }

    /// Whether the recording has its maximum length.
    pub(super) fn is_full(&self) -> bool {
        self.running.as_ref().is_some_and(|running| running.readings.len() >= MAX_READINGS)
    }

    /// Ends the recording and writes it to `path`, or to the next free name in the same folder if the file exists.
    pub(super) fn stop(&mut self, path: PathBuf) {
        let Some(Recording { readings, .. }) = self.running.take() else { return };
        self.write(readings, path);
    }

    /// Retries to write the recording that could not be written.
    pub(super) fn write_again(&mut self, path: PathBuf) {
        let readings = std::mem::take(&mut self.unwritten);
        self.write(readings, path);
    }

    /// Discards the recording that could not be written.
    pub(super) fn discard(&mut self) {
        (self.unwritten, self.message) = (Vec::new(), None);
    }

    fn write(&mut self, readings: Vec<Reading>, path: PathBuf) {
        self.message = None;
        self.writing = Some(IoTaskPool::get().spawn(async move { (write(&readings, path), readings) }));
    }

    /// Reads the result of the write task.
    pub(super) fn poll(&mut self) {
        let Some((done, readings)) = self.writing.as_mut().and_then(check_ready) else { return };
        self.writing = None;
        let seconds = readings.len() as f64 * Trajectory::PERIOD_S;
        if matches!(done, Err(WriteError::File { .. })) {
            self.unwritten = readings;
        }
        let message = done.as_ref().map(|path| format!("{seconds:.1} s written to {}", path.display()));
        self.message = Some(message.map_err(ToString::to_string));
        self.written = done.ok();
    }

    /// Replaces the device of `tool` by the recording at `path`, if it can be read. The path is not one of Bevy's asset folder: recordings
    /// are written anywhere.
    pub(super) fn replay(
        &mut self,
        (entity, tool): (Entity, &mut HapticTool),
        path: &str,
        trajectories: Option<&mut Assets<TrajectoryAsset>>,
    ) {
        self.message = Some(match (Trajectory::from_csv_file(path), trajectories) {
            (Ok(trajectory), Some(trajectories)) => {
                self.before.entry(entity).or_insert_with(|| tool.device.clone());
                tool.device = trajectories.add(TrajectoryAsset(trajectory)).into();
                Ok(format!("Replays {path} repeatedly."))
            }
            (Err(error), _) => Err(palpate_haptics::report(&error)),
            (_, None) => Err(DeviceFault::NoTrajectories.to_string()),
        });
    }

    /// The device that was replaced by a replay.
    pub(super) fn device_before(&self, tool: Entity) -> Option<&DeviceSelector> {
        self.before.get(&tool)
    }

    /// Restores the device of `tool` that was replaced by a replay.
    pub(super) fn restore_device(&mut self, (entity, tool): (Entity, &mut HapticTool)) {
        if let Some(before) = self.before.remove(&entity) {
            (tool.device, self.message) = (before, None);
        }
    }
}

/// Writes a new file, `path` or the next free name in the same folder; never overwrites a file.
fn write(readings: &[Reading], path: PathBuf) -> Result<PathBuf, WriteError> {
    let trajectory = Trajectory::from_readings(readings)?;
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    let path = if path.exists() { next_free(&folder) } else { path };
    let file_error = |error| WriteError::File { path: path.clone(), error };
    std::fs::create_dir_all(&folder).map_err(file_error)?;
    let file = std::fs::File::create_new(&path).map_err(file_error)?;
    let mut file = BufWriter::new(file);
    let written = trajectory.to_csv(&mut file).and_then(|()| file.flush());
    if let Err(error) = written {
        // Removes the incomplete file.
        let _ = std::fs::remove_file(&path);
        return Err(WriteError::File { path, error });
    }
    Ok(path)
}

/// The first of `hand-1.csv`, `hand-2.csv` and so on that does not exist in `folder`.
pub(super) fn next_free(folder: &Path) -> PathBuf {
    let path = |number: u32| folder.join(format!("hand-{number}.csv"));
    (1..).map(path).find(|path| !path.exists()).unwrap_or_else(|| path(0))
}

/// Label of a device.
pub(super) fn name_of(device: &DeviceSelector) -> String {
    match device {
        DeviceSelector::Replay { trajectory, .. } => match trajectory.path() {
            Some(path) => format!("replay of {path}"),
            None => "replay of a recording".into(),
        },
        DeviceSelector::Named(name) => name.clone(),
        DeviceSelector::Hid(selector) => selector.to_string(),
    }
}

#[cfg(test)]
mod tests;
