//! Lamps of the stages of the safety chain.

use super::theme;
use bevy_egui::egui;
use palpate_haptics::{BlackBox, SafetyAction, SafetyActions};

/// Stages that have acted recently.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SafetyLamps {
    /// Number of the newest tick that has been read.
    read: u64,
    /// Time of each stage's last action, s, in the order of [`SafetyAction::ALL`].
    lit_s: [Option<f64>; SafetyAction::ALL.len()],
}

/// Time for which a lamp stays lit, s. It makes an action of a single tick visible.
const LATCH_S: f64 = 0.5;

impl SafetyLamps {
    /// Reads the actions since the last call.
    pub(super) fn update(&mut self, black_box: &BlackBox, now_s: f64) {
        let ticks = black_box.ticks().rev();
        let newest = black_box.newest().map_or(0, |tick| tick.sequence);
        // A restarted loop counts from zero.
        let read = if newest < self.read { 0 } else { self.read };
        let fresh = ticks.take_while(|tick| tick.sequence > read);
        // Older actions are not recent any more.
        fresh.take(RECENT).for_each(|tick| self.light(tick.acted, now_s));
        self.read = newest;
    }

    fn light(&mut self, acted: SafetyActions, now_s: f64) {
        for (lit, action) in self.lit_s.iter_mut().zip(SafetyAction::ALL) {
            if acted.contains(action) {
                *lit = Some(now_s);
            }
        }
    }

    /// Brightness of each action's lamp, 0 to 1.
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
                    let (label, hint) = label_and_hint(action);
                    lamp(ui, label, lit > 0.0).on_hover_text(hint);
                    if i % 3 == 2 {
                        ui.end_row();
                    }
                }
            },
        );
    }
}

/// Maximum number of ticks that are read at once.
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

fn label_and_hint(action: SafetyAction) -> (&'static str, &'static str) {
    match action {
        SafetyAction::NotFinite => ("finite", "a force that was not finite was set to zero"),
        SafetyAction::Waiting => ("start", "the force starts once it is below the threshold"),
        SafetyAction::Gains => ("gains", "the start-up ramp or a fade reduces the force"),
        SafetyAction::Stale => ("stale model", "the local model is too old"),
        SafetyAction::Silent => ("silent device", "the device has sent no reading for too long"),
        SafetyAction::VelocityGuard => {
            ("velocity", "suppresses force that would accelerate a hand already above the speed limit")
        }
        SafetyAction::Passivity => {
            ("passivity", "damps, because the tool returned more energy than it received")
        }
        SafetyAction::Magnitude => ("magnitude", "the force exceeded the maximum force"),
        SafetyAction::Slew => ("slew rate", "the force grew faster than the limit"),
        _ => (action.name(), "another stage"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn action_of_one_tick_stays_lit_for_half_a_second() {
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
    fn every_action_has_its_own_label() {
        let labels: std::collections::BTreeSet<&str> =
            SafetyAction::ALL.into_iter().map(|action| label_and_hint(action).0).collect();
        assert_eq!(labels.len(), SafetyAction::ALL.len());
    }
}
