//! A threaded run, replayed in lockstep from its records, is reproduced bit by bit.

use palpate_body::{Body, SemiImplicitEuler, ToolContact, ToolPoint};
use palpate_haptics::*;
use palpate_local::{ModelId, Sample, Scheme};
use palpate_reduce::{BuilderOptions, LocalModelBuilder};
use palpate_tests_without_bevy::{DRIVEN_NODE, reference_body, reference_offset};

/// The model side of a run: the body, stepped along the samples, and the local models built from it.
struct ModelSide {
    body: Body,
    contact: ToolContact,
    builder: LocalModelBuilder,
    at: Option<(u64, ToolPoint)>,
}

impl ModelSide {
    fn new() -> Self {
        let body = reference_body().unwrap();
        let start = body.positions_m()[DRIVEN_NODE];
        let contact = ToolContact::hold(&body, DRIVEN_NODE, start).unwrap();
        let builder = LocalModelBuilder::new(&body, BuilderOptions::default()).unwrap();
        Self { body, contact, builder, at: None }
    }

    /// Steps the body along the samples up to `sequence`, and publishes a local model.
    fn step(&mut self, sequence: u64, sample: impl Fn(u64) -> Sample, handle: &mut HapticHandle) {
        let point = |s: &Sample| ToolPoint { position_m: s.position_m, velocity_m_per_s: s.velocity_m_per_s };
        let (from, first) = self.at.unwrap_or_else(|| (sequence, point(&sample(sequence))));
        let mut path = vec![first];
        path.extend((from + 1..=sequence).map(|s| point(&sample(s))));
        let last = path[path.len() - 1];
        let along = Some((&mut self.contact, path.as_slice()));
        self.body.advance(along, path.len() - 1, SemiImplicitEuler::default()).unwrap();
        self.at = Some((sequence, last));
        let id = ModelId { body: 1, epoch: 0, sequence };
        let model = handle.model_slot();
        self.builder.build(Scheme::Neighbourhood, &self.body, &self.contact, last, id, model).unwrap();
        handle.publish_model();
    }
}

fn device() -> ScriptedDevice {
    let start = reference_body().unwrap().positions_m()[DRIVEN_NODE];
    ScriptedDevice::new(move |n, _| match n {
        // Device errors, whose consequences are replayed too.
        300..303 => Err(DeviceError::TimedOut),
        _ => Ok(Reading::at(start + reference_offset(n as f64 * 1e-3))),
    })
}

fn settings() -> LoopSettings {
    LoopSettings { record: true, ..LoopSettings::default() }
}

/// Minimum number of local models that the loop adopts in the run, on a loaded machine too.
const MIN_MODELS: usize = 12;

/// Runs the loop on a thread for at least `ticks` ticks and [`MIN_MODELS`] models. Returns the records, and the sequence numbers of the model steps.
#[expect(clippy::disallowed_methods, reason = "the model side waits for samples of a real thread")]
fn record(ticks: usize) -> (Vec<TickRecord>, Vec<u64>) {
    let (mut handle, haptic_loop) = haptic_loop(LoopConfig::default(), settings()).unwrap();
    let mut thread = haptic_loop.spawn(Box::new(device())).unwrap();
    let (mut model_side, mut records, mut steps) = (ModelSide::new(), Vec::new(), Vec::new());
    let swaps = |records: &[TickRecord]| records.iter().filter(|r| r.rendered.swap.is_some()).count();
    while records.len() < ticks || swaps(&records) < MIN_MODELS && records.len() < 60_000 {
        std::thread::sleep(std::time::Duration::from_millis(37));
        let samples = handle.samples().clone();
        if let Some(newest) = samples.newest() {
            let sequence = newest.sequence;
            steps.push(sequence);
            model_side.step(sequence, |s| *samples.get(s).unwrap(), &mut handle);
        }
        records.extend(std::iter::from_fn(|| handle.next_record()));
        // Changes the device frame during the run.
        if records.len() > 600 && handle.settings().frame == DeviceFrame::default() {
            let frame = DeviceFrame { offset_m: glam::DVec3::X * 1e-3, ..DeviceFrame::default() };
            handle.set_settings(LoopSettings { frame, ..settings() }).unwrap();
        }
    }
    thread.stop();
    records.extend(std::iter::from_fn(|| handle.next_record()));
    assert_eq!(handle.report().dropped_records, 0);
    (records, steps)
}

#[test]
fn threaded_run_is_reproduced_bit_by_bit() {
    let (records, steps) = record(1200);
    let (mut handle, mut haptic_loop) = haptic_loop(LoopConfig::default(), settings()).unwrap();
    let (mut model_side, mut samples) = (ModelSide::new(), std::collections::HashMap::new());
    let mut steps = steps.into_iter().peekable();
    assert!(records.iter().any(|r| r.settings.is_some()), "the settings change during the run");
    let (mut swaps, mut max_force_n) = (0, 0.0_f64);
    for recorded in &records {
        if let Some(model) = recorded.new_model {
            // All model steps up to the accepted one; the loop has not read those in between.
            while let Some(sequence) = steps.next_if(|&s| s <= model.sequence) {
                model_side.step(sequence, |s| samples[&s], &mut handle);
            }
        }
        if let Some((_, settings)) = recorded.settings {
            handle.set_settings(settings).unwrap();
        }
        let ticked = haptic_loop.tick(recorded.elapsed, recorded.reading);
        haptic_loop.finish_tick(ticked, None, Ok(()));
        let again = ticked.complete(recorded.written, recorded.timing);
        assert_eq!(again, *recorded);
        for (a, b) in again.force_n.to_array().iter().zip(recorded.force_n.to_array()) {
            assert_eq!(a.to_bits(), b.to_bits());
        }
        for (_, sample) in samples_of(&mut handle) {
            samples.insert(sample.sequence, sample);
        }
        swaps += usize::from(recorded.rendered.swap.is_some());
        max_force_n = max_force_n.max(recorded.force_n.length());
    }
    assert!(swaps >= MIN_MODELS && max_force_n > 1.0, "{swaps} models, {max_force_n} N");
}

/// The samples of the newest tick, including those that bridge missed ticks before it.
fn samples_of(handle: &mut HapticHandle) -> Vec<(u64, Sample)> {
    let elapsed = handle.latest_tick().map_or(1, |record| record.elapsed);
    let samples = handle.samples();
    let newest = samples.newest().map_or(0, |s| s.sequence);
    (newest.saturating_sub(elapsed)..=newest).filter_map(|s| Some((s, *samples.get(s)?))).collect()
}
