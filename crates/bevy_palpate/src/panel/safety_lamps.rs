//! The stages of the safety chain, lit when they act.

use super::theme;
use bevy_egui::egui;
use palpate_haptics::{BlackBox, SafetyAction, SafetyActions};

/// Which stages have acted lately.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SafetyLamps {
    /// Number of the newest tick that has been looked at.
    seen: u64,
    /// When each went on last, s; by [`SafetyAction::ALL`].
    lit_s: [Option<f64>; SafetyAction::ALL.len()],
}

/// How long a lamp stays lit, s: a stage that acts at a single tick must be seen.
const LATCH_S: f64 = 0.5;

impl SafetyLamps {
    /// Takes what has acted since the last look.
    pub(super) fn update(&mut self, black_box: &BlackBox, now_s: f64) {
        let ticks = black_box.ticks().rev();
        let newest = black_box.newest().map_or(0, |tick| tick.sequence);
        // A loop that began anew counts from the start again.
        let seen = if newest < self.seen { 0 } else { self.seen };
        let fresh = ticks.take_while(|tick| tick.sequence > seen);
        // After a long absence what happened then is over.
        fresh.take(RECENT).for_each(|tick| self.light(tick.acted, now_s));
        self.seen = newest;
    }

    fn light(&mut self, acted: SafetyActions, now_s: f64) {
        for (lit, action) in self.lit_s.iter_mut().zip(SafetyAction::ALL) {
            if acted.contains(action) {
                *lit = Some(now_s);
            }
        }
    }

    /// How bright the lamp of each action is, 0 to 1.
    fn brightness(&self, now_s: f64) -> [f32; SafetyAction::ALL.len()] {
        self.lit_s.map(|lit| match lit {
            Some(lit) if now_s - lit <= LATCH_S => 1.0,
            _ => 0.0,
        })
    }

    pub(super) fn show(&self, ui: &mut egui::Ui, now_s: f64) {
        let lit = self.brightness(now_s);
        egui::Grid::new("palpate_safety").num_columns(3).spacing([6.0, 4.0]).min_col_width(104.0).show(
            ui,
            |ui| {
                for (i, (action, lit)) in SafetyAction::ALL.into_iter().zip(lit).enumerate() {
                    let (label, hint) = words(action);
                    lamp(ui, label, lit > 0.0).on_hover_text(hint);
                    if i % 3 == 2 {
                        ui.end_row();
                    }
                }
            },
        );
    }
}

/// Ticks of one look at most.
const RECENT: usize = 512;

fn lamp(ui: &mut egui::Ui, label: &str, lit: bool) -> egui::Response {
    ui.horizontal(|ui| {
        let (rect, _) = ui.allocate_exact_size(egui::vec2(10.0, 10.0), egui::Sense::hover());
        let color = if lit { theme::AMBER } else { theme::DARK };
        if lit {
            ui.painter().circle_filled(rect.center(), 7.0, color.gamma_multiply(0.25));
        }
        ui.painter().circle(rect.center(), 4.5, color, egui::Stroke::new(1.0, theme::RIM));
        let text = egui::RichText::new(label);
        ui.label(if lit { text.color(egui::Color32::WHITE) } else { text.color(theme::FAINT) });
    })
    .response
}

fn words(action: SafetyAction) -> (&'static str, &'static str) {
    match action {
        SafetyAction::NotFinite => ("finite", "a force that was not finite became zero"),
        SafetyAction::Waiting => ("start", "waits for a small force before any is written"),
        SafetyAction::Gains => ("gains", "start-up ramp or a fade makes the force smaller"),
        SafetyAction::Stale => ("stale model", "no new local model has come for too long"),
        SafetyAction::Silent => ("silent device", "the device has given no reading for too long"),
        SafetyAction::VelocityGuard => ("velocity", "what pushes a hand along that is too fast fades"),
        SafetyAction::Passivity => ("passivity", "damps, because the hand got more energy than it gave"),
        SafetyAction::Magnitude => ("magnitude", "the force was longer than the limit"),
        SafetyAction::Slew => ("growth", "the force grew faster than the limit"),
        _ => (action.name(), "another stage"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_that_acted_at_one_tick_stays_lit_for_half_a_second() {
        let mut lamps = SafetyLamps::default();
        let at = |lamps: &SafetyLamps, now_s| lamps.brightness(now_s);
        assert_eq!(at(&lamps, 0.0), [0.0; 9]);
        lamps.light([SafetyAction::Slew, SafetyAction::Gains].into_iter().collect(), 3.0);
        let mut expected = [0.0; 9];
        (expected[2], expected[8]) = (1.0, 1.0);
        assert_eq!((at(&lamps, 3.0), at(&lamps, 3.49)), (expected, expected));
        assert_eq!(at(&lamps, 3.51), [0.0; 9]);
    }

    #[test]
    fn every_action_has_words_of_its_own() {
        let labels: std::collections::BTreeSet<&str> =
            SafetyAction::ALL.into_iter().map(|action| words(action).0).collect();
        assert_eq!(labels.len(), SafetyAction::ALL.len());
    }
}
