//! Settings in the panel. They take effect at once; values out of range are rejected with the error of their type, and the previous
//! value stays.

mod number_field;

use super::theme;
use crate::body::Tissue;
use crate::model_time::ModelRate;
use crate::tool::{SafetyOverrides, ToolSettings};
use bevy::math::EulerRot;
use bevy::prelude::*;
use bevy_egui::egui;
use glam::{DQuat, DVec3};
use number_field::{NumberField, check_tissue};
use palpate_body::Damping;
use palpate_haptics::{DeviceFrame, SafetySettings};
use palpate_local::Scheme;

/// State of the panel's inputs.
#[derive(Clone, Debug, Default)]
pub(crate) struct View {
    pub(super) along: super::history::ForceComponent,
    /// File of the next recording or replay.
    pub(super) file: String,
    pub(super) lamps: super::safety_lamps::SafetyLamps,
    /// Reason of the last rejected change, by part.
    rejected: [Option<String>; 4],
    /// Angles of the device frame, degrees, and the rotation computed from them.
    angles: Option<(DVec3, DQuat)>,
    pending: Option<PendingChange>,
}

/// A tissue that the panel has set and with which the body has not been built yet. The build may still reject it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PendingChange {
    body: Entity,
    /// The tissue of the simulated body.
    valid: Tissue,
    set: Tissue,
}

/// The parts of the settings.
#[derive(Clone, Copy, Debug)]
enum Part {
    Rate,
    Material,
    Limits,
    Frame,
}

impl View {
    /// Returns the tissue to restore after the build of `body` with the tissue `now` was rejected, if the panel has set that tissue.
    pub(super) fn revert_tissue(&mut self, body: Entity, now: Tissue, reason: &str) -> Option<Tissue> {
        let pending = self.pending.take_if(|pending| pending.body == body)?;
        // The app has set another tissue since.
        if pending.set != now {
            return None;
        }
        self.rejected[Part::Material as usize] =
            Some(format!("{reason}. The previous material is restored."));
        Some(pending.valid)
    }

    /// Ends a pending change once the body has been built with it.
    pub(super) fn confirm_tissue(&mut self, built_tissue: impl FnOnce(Entity) -> Option<Tissue>) {
        self.pending.take_if(|pending| built_tissue(pending.body) == Some(pending.set));
    }

    /// Returns `draft` if it differs from `value` and is valid; stores the reason if it is not.
    fn accept<T: PartialEq, E: std::fmt::Display>(
        &mut self,
        part: Part,
        value: &T,
        draft: T,
        check: impl FnOnce(&T) -> Result<(), E>,
    ) -> Option<T> {
        if draft == *value {
            return None;
        }
        let checked = check(&draft);
        self.rejected[part as usize] =
            checked.as_ref().err().map(|error| format!("{error}. The previous value is kept."));
        checked.is_ok().then_some(draft)
    }

    fn show_rejection(&self, ui: &mut egui::Ui, part: Part) {
        if let Some(reason) = &self.rejected[part as usize] {
            theme::error(ui, reason);
        }
    }

    /// Shows a list of the schemes; returns the selected one if it changed.
    pub(super) fn scheme(ui: &mut egui::Ui, scheme: Scheme) -> Option<Scheme> {
        let mut selected = scheme;
        egui::ComboBox::from_id_salt("palpate_scheme")
            .selected_text(theme::name(scheme))
            .width(150.0)
            .show_ui(ui, |ui| {
                for other in Scheme::ALL {
                    ui.selectable_value(&mut selected, other, theme::name(other));
                }
            });
        (selected != scheme).then_some(selected)
    }

    /// Shows the ticks between two model steps; returns the new rate if it changed and is valid.
    pub(super) fn rate(&mut self, ui: &mut egui::Ui, rate: ModelRate) -> Option<ModelRate> {
        let mut ticks = f64::from(rate.ticks());
        NumberField::new("model step", "ms", 1.0, 5.0..=200.0).whole().show(ui, &mut ticks);
        ui.label(format!("{:.1} Hz", 1e3 / ticks));
        ui.end_row();
        let mut new_rate = Ok(rate);
        let accepted = self.accept(Part::Rate, &f64::from(rate.ticks()), ticks, |ticks| {
            let whole = if (0.0..=1e6).contains(ticks) { ticks.round() as u32 } else { 0 };
            new_rate = ModelRate::every_ticks(whole);
            new_rate.as_ref().map(|_| ())
        });
        accepted.and(new_rate.ok())
    }

    pub(super) fn show_rate_rejection(&self, ui: &mut egui::Ui) {
        self.show_rejection(ui, Part::Rate);
    }

    /// Shows the tissue of a body and applies changes.
    pub(super) fn tissue(&mut self, ui: &mut egui::Ui, body: Entity, tissue: &mut Mut<Tissue>) {
        let before = **tissue;
        let mut draft = before;
        grid(ui, "palpate_tissue", |ui| {
            NumberField::new("Young's modulus", "kPa", 1e3, 1.0..=200.0)
                .log()
                .show(ui, &mut draft.youngs_modulus_pa);
            ui.end_row();
            NumberField::new("density", "kg/m³", 1.0, 200.0..=4000.0)
                .log()
                .show(ui, &mut draft.density_kg_per_m3);
            ui.end_row();
            NumberField::new("Poisson's ratio", "", 1.0, 0.0..=0.49).show(ui, &mut draft.poissons_ratio);
            ui.end_row();
            damping_rows(ui, &mut draft.damping);
        });
        if let Some(tissue_now) = self.accept(Part::Material, &before, draft, check_tissue) {
            self.start_change(body, before, tissue_now);
            **tissue = tissue_now;
        }
        self.show_rejection(ui, Part::Material);
    }

    /// Records that the panel sets the tissue of a body.
    pub(super) fn start_change(&mut self, body: Entity, before: Tissue, set: Tissue) {
        // Of several pending changes the first one started from a valid tissue.
        let valid =
            self.pending.filter(|pending| pending.body == body).map_or(before, |pending| pending.valid);
        self.pending = Some(PendingChange { body, valid, set });
    }

    /// Shows the limits of the safety chain and applies changes. A change sets one limit; the others stay those of the device.
    pub(super) fn limits(
        &mut self,
        ui: &mut egui::Ui,
        settings: &mut Mut<ToolSettings>,
        of_device: SafetySettings,
    ) {
        let is_unset = settings.safety == SafetyOverrides::default();
        if is_unset {
            theme::small(ui, "the device's limits");
        } else if ui.button("use the device's limits").clicked() {
            settings.safety = SafetyOverrides::default();
        }
        let overrides = settings.safety;
        let active = overrides.apply_to(of_device);
        let mut draft = active;
        grid(ui, "palpate_limits", |ui| {
            NumberField::new("maximum force", "N", 1.0, 0.5..=20.0)
                .unlimited("the device's own limit")
                .show(ui, &mut draft.max_force_n);
            ui.end_row();
            NumberField::new("slew rate", "N/s", 1.0, 10.0..=5000.0)
                .log()
                .show(ui, &mut draft.max_slew_n_per_s);
            ui.end_row();
            NumberField::new("maximum speed", "m/s", 1.0, 0.2..=5.0)
                .unlimited("no limit")
                .show(ui, &mut draft.max_speed_m_per_s);
            ui.end_row();
            NumberField::new("start below", "N", 1.0, 0.0..=5.0)
                .unlimited("starts at once")
                .show(ui, &mut draft.arm_below_n);
            ui.end_row();
            NumberField::new("start-up ramp", "s", 1.0, 0.0..=3.0).show(ui, &mut draft.ramp_s);
            ui.end_row();
            NumberField::new("fade", "s", 1.0, 0.0..=1.0).show(ui, &mut draft.fade_s);
            ui.end_row();
            NumberField::new("stale after", "steps", 1.0, 1.0..=10.0)
                .show(ui, &mut draft.stale_after_periods);
            ui.end_row();
            let damping = &mut draft.passivity_damping_ns_per_m;
            NumberField::new("passivity damping", "N s/m", 1.0, 0.0..=20.0).show(ui, damping);
            ui.end_row();
            NumberField::new("passivity tolerance", "mJ", 1e-3, 0.0..=20.0)
                .show(ui, &mut draft.passivity_tolerance_j);
            ui.end_row();
        });
        if let Some(safety) = self.accept(Part::Limits, &active, draft, SafetySettings::validate) {
            settings.safety = overrides.with_changes(&active, &safety);
        }
        self.show_rejection(ui, Part::Limits);
    }

    /// Shows the device frame and applies changes.
    pub(super) fn frame(&mut self, ui: &mut egui::Ui, settings: &mut Mut<ToolSettings>) {
        let before = settings.frame;
        let mut draft = before;
        // Angles are kept as set, because those of a rotation are not unique.
        let kept = self.angles.filter(|(_, rotation)| *rotation == before.rotation);
        let degrees = kept.map_or_else(|| degrees_of(before.rotation), |(degrees, _)| degrees);
        let mut new_degrees = degrees;
        grid(ui, "palpate_frame", |ui| {
            vector_row(ui, "offset", " mm", 0.5, 1e3, draft.offset_m.as_mut());
            vector_row(ui, "rotation about x y z", "°", 1.0, 1.0, new_degrees.as_mut());
            NumberField::new("scale", "×", 1.0, 0.1..=10.0).log().show(ui, &mut draft.scale);
            ui.end_row();
        });
        if new_degrees != degrees {
            draft.rotation = rotation_of(new_degrees);
        }
        if let Some(frame) = self.accept(Part::Frame, &before, draft, DeviceFrame::validate) {
            (settings.frame, self.angles) = (frame, Some((new_degrees, frame.rotation)));
        }
        self.show_rejection(ui, Part::Frame);
    }
}

/// Rows of the numbers of `damping`.
fn damping_rows(ui: &mut egui::Ui, damping: &mut Damping) {
    match damping {
        Damping::Ratio(ratio) => NumberField::new("damping ratio", "", 1.0, 0.0..=2.0).show(ui, ratio),
        Damping::LossFactor { loss_factor, frequency_hz } => {
            NumberField::new("loss factor", "", 1.0, 0.0..=1.0).show(ui, loss_factor);
            ui.end_row();
            NumberField::new("at frequency", "Hz", 1.0, 0.1..=100.0).log().show(ui, frequency_hz);
        }
        Damping::Rayleigh { mass_per_s, stiffness_s } => {
            NumberField::new("mass damping", "1/s", 1.0, 0.0..=50.0).show(ui, mass_per_s);
            ui.end_row();
            NumberField::new("stiffness damping", "ms", 1e-3, 0.0..=20.0).show(ui, stiffness_s);
        }
    }
    ui.end_row();
}

/// A row of three numbers.
fn vector_row(
    ui: &mut egui::Ui,
    label: &str,
    suffix: &str,
    speed: f64,
    per_unit: f64,
    values: &mut [f64; 3],
) {
    ui.label(label);
    ui.horizontal(|ui| {
        for value in values {
            let mut shown = *value * per_unit;
            let drag = egui::DragValue::new(&mut shown)
                .speed(speed)
                .max_decimals(1)
                .suffix(suffix)
                .update_while_editing(false);
            if ui.add_sized([62.0, 18.0], drag).changed() {
                *value = shown / per_unit;
            }
        }
    });
    ui.end_row();
}

pub(super) fn grid(ui: &mut egui::Ui, id: &str, rows: impl FnOnce(&mut egui::Ui)) {
    egui::Grid::new(id).num_columns(2).min_col_width(100.0).spacing([8.0, 3.0]).show(ui, rows);
}

/// Rotations about x, y and z, degrees: about z first, then x, then y.
fn degrees_of(rotation: DQuat) -> DVec3 {
    let (y, x, z) = rotation.to_euler(EulerRot::YXZ);
    // Adding zero converts −0 to 0.
    DVec3::new(x, y, z).map(|angle| angle.to_degrees() + 0.0)
}

fn rotation_of(degrees: DVec3) -> DQuat {
    let DVec3 { x, y, z } = degrees.map(f64::to_radians);
    DQuat::from_euler(EulerRot::YXZ, y, x, z)
}

#[cfg(test)]
mod tests;
