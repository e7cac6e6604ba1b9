//! Recording a hand to a file that the replay device reads, and replaying one.

use crate::device::{DeviceSelector, HapticDevices};
use crate::fault::HapticFaultKind;
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

/// The hand of one tool at a time.
#[derive(Default)]
pub(crate) struct Recorder {
    running: Option<Running>,
    writing: Option<Task<(Result<PathBuf, WriteError>, Vec<Reading>)>>,
    /// What could not be written, until it is or is thrown away.
    unwritten: Vec<Reading>,
    /// The file that was written last, until the panel has taken note.
    pub(super) written: Option<PathBuf>,
    /// What came of the last recording or replay, in words.
    pub(super) told: Option<Result<String, String>>,
    /// The devices that replays have taken the place of.
    before: HashMap<Entity, DeviceSelector>,
}

struct Running {
    tool: Entity,
    /// The newest sample that has been taken.
    newest: Option<u64>,
    /// In the device's frame, one each millisecond: positions, buttons and orientations.
    readings: Vec<Reading>,
}

/// Why a recording is not in a file.
#[derive(Debug, Error)]
enum WriteError {
    /// It makes no trajectory, wherever it is written to.
    #[error(transparent)]
    Trajectory(#[from] HapticsError),
    /// Another name may do.
    #[error("{}: {error}", path.display())]
    File { path: PathBuf, error: std::io::Error },
}

/// The longest recording, ms.
const LONGEST: usize = 600_000;

impl Recorder {
    /// The tool whose hand is being recorded.
    pub(super) fn tool(&self) -> Option<Entity> {
        self.running.as_ref().map(|running| running.tool)
    }

    /// How long it has been, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.running.as_ref().map_or(0.0, |running| running.readings.len() as f64 * Trajectory::PERIOD_S)
    }

    pub(super) fn is_writing(&self) -> bool {
        self.writing.is_some()
    }

    /// How long what could not be written is, s.
    pub(super) fn unwritten_s(&self) -> Option<f64> {
        (!self.unwritten.is_empty()).then_some(self.unwritten.len() as f64 * Trajectory::PERIOD_S)
    }

    pub(super) fn start(&mut self, tool: Entity) {
        self.running = Some(Running { tool, newest: None, readings: Vec::new() });
        self.told = None;
    }

    /// Takes the new samples of the tool, seen through `frame`.
    pub(super) fn record(&mut self, samples: &SampleHistory, frame: &DeviceFrame) {
        let Some(Running { newest, readings, .. }) = &mut self.running else { return };
        let (Some(last), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) else { return };
        let first = newest.map_or(last.sequence, |newest| newest + 1);
        // A hole, because the loop began anew or the app stood still, becomes time in which the hand stays.
        if let (Some(&stays), Some(hole)) = (readings.last(), oldest.checked_sub(first)) {
            let hole = (hole as usize).min(LONGEST.saturating_sub(readings.len()));
            readings.extend(std::iter::repeat_n(stays, hole));
        }
        let new = (first.max(oldest)..=last.sequence).filter_map(|sequence| samples.get(sequence));
        readings.extend(new.map(|sample| Reading {
            buttons: sample.buttons,
            orientation: frame.orientation_to_device(sample.orientation),
            ..Reading::at(frame.position_to_device_m(sample.position_m))
        }));
        readings.truncate(LONGEST);
        // A loop that began anew counts from the start again.
        *newest = Some(last.sequence);
    }

    /// Whether it is as long as a recording can be.
    pub(super) fn is_full(&self) -> bool {
        self.running.as_ref().is_some_and(|running| running.readings.len() >= LONGEST)
    }

    /// Ends the recording and writes it to `path`, or to the next free name beside it if there is such a file.
    pub(super) fn stop(&mut self, path: PathBuf) {
        let Some(Running { readings, .. }) = self.running.take() else { return };
        self.write(readings, path);
    }

    /// Tries again to write what could not be written.
    pub(super) fn write_again(&mut self, path: PathBuf) {
        let readings = std::mem::take(&mut self.unwritten);
        self.write(readings, path);
    }

    /// Throws away what could not be written.
    pub(super) fn discard(&mut self) {
        (self.unwritten, self.told) = (Vec::new(), None);
    }

    fn write(&mut self, readings: Vec<Reading>, path: PathBuf) {
        self.told = None;
        self.writing = Some(IoTaskPool::get().spawn(async move { (write(&readings, path), readings) }));
    }

    /// Notices that a file has been written, or why not.
    pub(super) fn poll(&mut self) {
        let Some((done, readings)) = self.writing.as_mut().and_then(check_ready) else { return };
        self.writing = None;
        let seconds = readings.len() as f64 * Trajectory::PERIOD_S;
        if matches!(done, Err(WriteError::File { .. })) {
            self.unwritten = readings;
        }
        let told = done.as_ref().map(|path| format!("{seconds:.1} s written to {}", path.display()));
        self.told = Some(told.map_err(ToString::to_string));
        self.written = done.ok();
    }

    /// Puts the recorded hand at `path` in the place of `tool`'s device, if it can be read.
    pub(super) fn replay(
        &mut self,
        (entity, tool): (Entity, &mut HapticTool),
        path: String,
        devices: &HapticDevices,
    ) {
        let selector = DeviceSelector::replay(path);
        self.told = Some(match devices.make(&selector) {
            Ok(device) => {
                self.before.entry(entity).or_insert_with(|| tool.device.clone());
                tool.device = selector;
                Ok(format!("Replays {}, again and again.", device.describe().name))
            }
            Err(error) => Err(HapticFaultKind::Device(error.into()).report()),
        });
    }

    /// The device that a replay has taken the place of.
    pub(super) fn device_before(&self, tool: Entity) -> Option<&DeviceSelector> {
        self.before.get(&tool)
    }

    /// Gives `tool` back the device that it had before a replay.
    pub(super) fn restore_device(&mut self, (entity, tool): (Entity, &mut HapticTool)) {
        if let Some(before) = self.before.remove(&entity) {
            (tool.device, self.told) = (before, None);
        }
    }
}

/// Writes a new file, `path` or the next free name beside it; what is there is left as it is.
fn write(readings: &[Reading], path: PathBuf) -> Result<PathBuf, WriteError> {
    let trajectory = Trajectory::from_readings(readings)?;
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    let path = if path.exists() { next_free(&folder) } else { path };
    let refused = |error| WriteError::File { path: path.clone(), error };
    std::fs::create_dir_all(&folder).map_err(refused)?;
    let file = std::fs::File::create_new(&path).map_err(refused)?;
    let mut file = BufWriter::new(file);
    let written = trajectory.to_csv(&mut file).and_then(|()| file.flush());
    if let Err(error) = written {
        // Half a recording is none.
        let _ = std::fs::remove_file(&path);
        return Err(WriteError::File { path, error });
    }
    Ok(path)
}

/// The first of `hand-1.csv`, `hand-2.csv` and so on that is not in `folder` yet.
pub(super) fn next_free(folder: &Path) -> PathBuf {
    let path = |number: u32| folder.join(format!("hand-{number}.csv"));
    (1..).map(path).find(|path| !path.exists()).unwrap_or_else(|| path(0))
}

/// A device as people call it.
pub(super) fn name_of(device: &DeviceSelector) -> String {
    match device {
        DeviceSelector::Replay { path, .. } => format!("replay of {path}"),
        DeviceSelector::Named(name) => name.clone(),
        DeviceSelector::Hid(choice) => choice.to_string(),
    }
}

#[cfg(test)]
mod tests;
