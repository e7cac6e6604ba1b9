//! Recording a hand to a file that the replay device reads, and replaying one.

use crate::device::{DeviceSelector, HapticDevices};
use crate::fault::HapticFaultKind;
use crate::tool::HapticTool;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{IoTaskPool, Task};
use palpate_haptics::{DeviceFrame, Reading, Trajectory};
use palpate_local::SampleHistory;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// The hand of one tool at a time.
#[derive(Default)]
pub(crate) struct Recorder {
    running: Option<Running>,
    writing: Option<Task<Result<String, String>>>,
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

    /// Ends the recording and writes it to `path`.
    pub(super) fn stop(&mut self, path: PathBuf) {
        let Some(Running { readings, .. }) = self.running.take() else { return };
        let write = async move {
            let seconds = readings.len() as f64 * Trajectory::PERIOD_S;
            write(&readings, &path)
                .map(|()| format!("{seconds:.1} s written to {}", path.display()))
                .map_err(|error| format!("{}: {error}", path.display()))
        };
        self.writing = Some(IoTaskPool::get().spawn(write));
    }

    /// Notices that a file has been written.
    pub(super) fn look(&mut self) {
        if let Some(done) = self.writing.as_mut().and_then(check_ready) {
            (self.writing, self.told) = (None, Some(done));
        }
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
            Err(error) => Err(HapticFaultKind::Device(error).chain()),
        });
    }

    /// The device that a replay has taken the place of.
    pub(super) fn device_before(&self, tool: Entity) -> Option<&DeviceSelector> {
        self.before.get(&tool)
    }

    /// Gives `tool` back the device that it had before a replay.
    pub(super) fn go_back(&mut self, (entity, tool): (Entity, &mut HapticTool)) {
        if let Some(before) = self.before.remove(&entity) {
            (tool.device, self.told) = (before, None);
        }
    }
}

/// Writes a new file; one that is there is left as it is.
fn write(readings: &[Reading], path: &Path) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let trajectory = Trajectory::from_readings(readings)?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut file = BufWriter::new(std::fs::File::create_new(path)?);
    trajectory.to_csv(&mut file)?;
    Ok(file.flush()?)
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
