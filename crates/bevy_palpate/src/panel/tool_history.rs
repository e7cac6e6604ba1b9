//! Collects the curves of the shown tool at every model step while they are visible.

mod background;

use super::history::{Curve, Trace, index_of};
use super::recording::Recorder;
use super::scheme_comparison::StepInput;
use super::state::HapticPanel;
use crate::body::SimulatedBody;
use crate::tool::{HapticTool, ToolLoop};
use background::{BodeTask, ComparisonTask};
use bevy::prelude::*;
use palpate_body::ToolContact;
use palpate_haptics::BlackBox;
use palpate_local::{ModelId, Sample};
use palpate_reduce::Bode;

/// Curves and background tasks of the shown tool.
#[derive(Resource, Default)]
pub(crate) struct ToolHistory {
    /// Curves that were visible in the last frame.
    requested: Requested,
    /// Curves that are visible in this frame.
    pub(super) drawn: Requested,
    tool: Option<Entity>,
    body: Option<Entity>,
    /// The newest sample in the curves.
    pub(super) newest: Option<u64>,
    pub(super) full: Curve,
    /// Forces in the order of [`Scheme::ALL`](palpate_local::Scheme::ALL): of the loop for the running scheme, computed for the others.
    pub(super) schemes: [Curve; 6],
    /// Error of each scheme over the last second, relative to the full body's force.
    pub(super) errors: [Trace; 6],
    /// Reason why a scheme has no curve.
    pub(super) notes: [Option<String>; 6],
    comparison: ComparisonTask,
    bode: BodeTask,
    pub(super) recorder: Recorder,
}

/// Visible curves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Requested {
    /// Force or error.
    pub(super) forces: bool,
    pub(super) bode: bool,
}

/// Number of ticks over which an error is computed.
pub(super) const ERROR_TICKS: u64 = 1000;

impl ToolHistory {
    fn clear_forces(&mut self) {
        self.full.clear();
        self.schemes.iter_mut().for_each(Curve::clear);
        self.errors.iter_mut().for_each(|trace| trace.points.clear());
        self.notes = Default::default();
        self.comparison.reset();
        self.newest = None;
    }

    /// Time to compute all schemes at the last model step, ms, and number of model steps that were skipped because it was too long.
    pub(super) fn comparison_cost(&self) -> (f64, u64) {
        (self.comparison.cost_ms, self.comparison.skipped)
    }

    pub(super) fn bode(&self) -> Option<&Result<Bode, String>> {
        self.bode.newest.as_ref()
    }

    /// Adds the results of the background tasks.
    fn take(&mut self) {
        for (scheme, result) in self.comparison.take() {
            let at = index_of(scheme);
            match result {
                Ok(forces) => {
                    self.notes[at] = None;
                    let newest = self.schemes[at].newest();
                    for (sequence, force_n) in forces {
                        if newest.is_none_or(|newest| sequence > newest) {
                            self.schemes[at].push(sequence, force_n);
                        }
                    }
                    self.compare_errors(at);
                }
                Err(reason) => self.notes[at] = Some(reason),
            }
        }
        self.bode.take();
    }

    fn compare_errors(&mut self, at: usize) {
        let Some(newest) = self.schemes[at].newest() else { return };
        let error = self.schemes[at].error_against(&self.full, newest.saturating_sub(ERROR_TICKS));
        let trace = &mut self.errors[at];
        let is_new = trace.points.back().is_none_or(|(last, _)| *last < newest);
        // A relative error of hardly any force is not meaningful.
        if let Some(relative) = error.relative.filter(|share| is_new && error.rms_n > MIN_FORCE_N * share) {
            trace.push(newest, relative);
        }
    }
}

/// Minimum force for a relative error, N.
const MIN_FORCE_N: f64 = 0.01;

/// Requests the curves that were visible in the last frame, and adds the results of the background tasks.
pub(super) fn start_frame(mut history: ResMut<ToolHistory>) {
    let history = &mut *history;
    history.requested = std::mem::take(&mut history.drawn);
    history.take();
    history.recorder.poll();
}

/// Adds the results of a model step to the requested curves.
pub(super) fn update_history(
    panel: Res<HapticPanel>,
    mut history: ResMut<ToolHistory>,
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop)>,
    bodies: Query<&SimulatedBody>,
    time: Res<Time<Real>>,
) {
    let history = &mut *history;
    if let Some((_, _, mut tool)) = history.recorder.tool().and_then(|tool| tools.get_mut(tool).ok()) {
        let frame = tool.settings.frame;
        history.recorder.record(tool.handle.samples(), &frame);
    }
    let shown = panel.shown(tools.iter().map(|(entity, ..)| entity));
    let on = shown.and_then(|tool| tools.get(tool).ok()?.2.body);
    let other_tools = tools.iter().filter(|(entity, ..)| Some(*entity) != shown);
    let on_body = |tool: &ToolLoop| -> Vec<ToolContact> {
        tool.contacts().filter(|(body, _)| Some(*body) == on).map(|(_, contact)| contact.clone()).collect()
    };
    let compares = history.requested.forces && panel.compare && on.is_some();
    let mut others: Vec<ToolContact> =
        if compares { other_tools.flat_map(|(.., tool)| on_body(tool)).collect() } else { Vec::new() };
    let Some((entity, described, mut tool)) = shown.and_then(|tool| tools.get_mut(tool).ok()) else {
        history.clear_forces();
        return;
    };
    let tool = &mut *tool;
    let is_other_tool = history.tool.replace(entity) != Some(entity);
    let is_other_body = std::mem::replace(&mut history.body, tool.body) != tool.body;
    if is_other_tool || is_other_body || history.newest > tool.consumed || !history.requested.forces {
        history.clear_forces();
    }
    let (Some(consumed), Some(body)) = (tool.consumed, tool.body) else { return };
    let Ok(simulated) = bodies.get(body) else { return };
    if history.requested.bode {
        let now_s = time.elapsed_secs_f64();
        if let Some(point) = tool.path.last() {
            history.bode.request(now_s, simulated.body(), &tool.contact, *point, described.scheme);
        }
    }
    if !history.requested.forces || tool.full_forces_n.is_empty() {
        return;
    }
    let first = consumed + 1 - (tool.full_forces_n.len() as u64).min(consumed);
    for (sequence, full_n) in (first..).zip(&tool.full_forces_n) {
        history.full.push(sequence, *full_n);
    }
    let running = index_of(described.scheme);
    let rendered = tool.handle.displayed();
    for (sequence, force_n) in (first..=consumed).filter_map(|s| Some((s, rendered.get(s)?))) {
        history.schemes[running].push(sequence, force_n);
    }
    history.newest = Some(consumed);
    history.compare_errors(running);
    // The comparison is that of one body.
    let touches_two = tool.second().is_some_and(|(_, contact)| !contact.touched().is_empty());
    if panel.compare && !touches_two {
        let id = ModelId { body: body.to_bits(), epoch: simulated.epoch(), sequence: consumed };
        let all_samples = tool.handle.samples();
        let samples: Vec<Sample> = (first..=consumed).filter_map(|s| all_samples.get(s).copied()).collect();
        let adopted = adoptions(tool.handle.black_box(), first, id.body);
        let (body, contact) = (simulated.body().clone(), tool.contact.clone());
        others.retain(|contact| contact.validate(&body).is_ok());
        let settings = tool.handle.config().hand_over;
        history.comparison.push(StepInput { body, contact, others, samples, adopted, id }, settings);
    } else {
        history.comparison.reset();
    }
    history.take();
}

/// Adoptions of local models of `body` from tick `first` on: (sample of the model, tick of the adoption).
fn adoptions(black_box: &BlackBox, first: u64, body: u64) -> Vec<(u64, u64)> {
    let mut adopted = Vec::new();
    // From the newest tick back: a tick whose model differs from that of the tick before.
    let mut later: Option<(u64, u64)> = None;
    for tick in black_box.ticks().rev() {
        let model = tick.model.filter(|model| model.body == body).map(|model| model.sequence);
        if let Some((of_later, sequence)) = later.filter(|(of_later, _)| model != Some(*of_later)) {
            adopted.push((of_later, sequence));
        }
        later = model.map(|model| (model, tick.sequence));
        if tick.sequence < first {
            break;
        }
    }
    adopted.reverse();
    adopted
}
