//! A slider with a number.

use crate::body::Tissue;
use bevy_egui::egui;
use glam::DVec3;
use palpate_body::{Block, BodyError};
use std::ops::RangeInclusive;

/// A slider with a number. The range limits the slider only; a typed number may be any, and is validated by its type.
pub(super) struct NumberField {
    label: &'static str,
    unit: &'static str,
    /// Value of one unit.
    scale: f64,
    range: RangeInclusive<f64>,
    is_log: bool,
    is_whole: bool,
    /// Meaning of the value `f64::MAX`.
    unlimited: Option<&'static str>,
}

impl NumberField {
    pub(super) fn new(
        label: &'static str,
        unit: &'static str,
        scale: f64,
        range: RangeInclusive<f64>,
    ) -> Self {
        Self { label, unit, scale, range, is_log: false, is_whole: false, unlimited: None }
    }

    pub(super) fn log(self) -> Self {
        Self { is_log: true, ..self }
    }

    pub(super) fn whole(self) -> Self {
        Self { is_whole: true, ..self }
    }

    pub(super) fn unlimited(self, meaning: &'static str) -> Self {
        Self { unlimited: Some(meaning), ..self }
    }

    /// Shows `value` and changes it.
    pub(super) fn show(self, ui: &mut egui::Ui, value: &mut f64) {
        let Self { label, unit, scale, range, is_log, is_whole, unlimited } = self;
        ui.label(label);
        ui.horizontal(|ui| {
            let is_limited = unlimited.is_none() || *value < f64::MAX;
            if is_limited {
                let mut shown = *value / scale;
                let mut slider = egui::Slider::new(&mut shown, range.clone())
                    .logarithmic(is_log)
                    .clamping(egui::SliderClamping::Never)
                    .update_while_editing(false);
                slider = if is_whole { slider.integer() } else { slider.max_decimals(3) };
                if !unit.is_empty() {
                    slider = slider.suffix(format!(" {unit}"));
                }
                if ui.add(slider).changed() {
                    *value = shown * scale;
                }
            }
            let Some(meaning) = unlimited else { return };
            let mut checked = is_limited;
            let label = if is_limited { "" } else { meaning };
            if ui.checkbox(&mut checked, label).on_hover_text(format!("off: {meaning}")).changed() {
                *value = if checked { 0.5 * range.end() * scale } else { f64::MAX };
            }
        });
    }
}

/// Validates `tissue`, as far as that does not depend on the body.
///
/// # Errors
/// [`BodyError::Parameter`].
pub(super) fn check_tissue(tissue: &Tissue) -> Result<(), BodyError> {
    let tissue = palpate_body::Tissue::from(*tissue);
    Block::new([2; 3], DVec3::splat(0.01))?.allow_unconstrained().elements(&tissue).map(|_| ())
}
