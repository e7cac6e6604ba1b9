//! What can be set in the panel. It acts at once; nonsense is refused in the words of its own type, and what was stays.

mod number_field;

use super::theme;
use crate::body::Tissue;
use crate::schedule::ModelRate;
use crate::tool::ToolSettings;
use bevy::math::EulerRot;
use bevy::prelude::*;
use bevy_egui::egui;
use glam::{DQuat, DVec3};
use number_field::{NumberField, check_tissue};
use palpate_haptics::{DeviceFrame, SafetySettings};
use palpate_local::Scheme;

/// What the panel itself remembers.
#[derive(Clone, Debug, Default)]
pub(crate) struct View {
    pub(super) along: super::history::ForceComponent,
    /// File of the next recording or replay.
    pub(super) file: String,
    pub(super) lamps: super::safety_lamps::SafetyLamps,
    /// Why the last change was refused, by part.
    refused: [Option<String>; 4],
    /// The turn of the device frame in degrees, and the rotation that it is.
    angles: Option<(DVec3, DQuat)>,
    trial: Option<PendingChange>,
}

/// A material that the panel has set and that the body has not been made of yet: it may still be refused, however long the body
/// takes to make.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PendingChange {
    body: Entity,
    /// What the body is made of.
    good: Tissue,
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
    /// What a body that refuses its material was made of before, if the panel has set that material.
    pub(super) fn revert_tissue(&mut self, body: Entity, now: Tissue, why: &str) -> Option<Tissue> {
        let trial = self.trial.take_if(|trial| trial.body == body)?;
        // Somebody else has set another since.
        if trial.set != now {
            return None;
        }
        self.refused[Part::Material as usize] = Some(format!("{why}. The material before is back."));
        Some(trial.good)
    }

    /// Ends a trial once the body is made of what was set.
    pub(super) fn confirm_tissue(&mut self, made_of: impl FnOnce(Entity) -> Option<Tissue>) {
        self.trial.take_if(|trial| made_of(trial.body) == Some(trial.set));
    }

    /// Takes `draft` for `value` if it differs and makes sense; if not, notes why.
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
        self.refused[part as usize] = checked.as_ref().err().map(|why| format!("{why}. It stays as it was."));
        checked.is_ok().then_some(draft)
    }

    fn show_refusal(&self, ui: &mut egui::Ui, part: Part) {
        if let Some(why) = &self.refused[part as usize] {
            theme::refusal(ui, why);
        }
    }

    /// A chooser of the scheme; the new one if it was changed.
    pub(super) fn scheme(ui: &mut egui::Ui, scheme: Scheme) -> Option<Scheme> {
        let mut chosen = scheme;
        egui::ComboBox::from_id_salt("palpate_scheme")
            .selected_text(theme::name(scheme))
            .width(150.0)
            .show_ui(ui, |ui| {
                for other in Scheme::ALL {
                    ui.selectable_value(&mut chosen, other, theme::name(other));
                }
            });
        (chosen != scheme).then_some(chosen)
    }

    /// Ticks between two model steps; the new rate if it was changed and makes sense.
    pub(super) fn rate(&mut self, ui: &mut egui::Ui, rate: ModelRate) -> Option<ModelRate> {
        let mut ticks = f64::from(rate.ticks());
        NumberField::new("model step", "ms", 1.0, 5.0..=200.0).whole().show(ui, &mut ticks);
        ui.label(format!("{:.1} Hz", 1e3 / ticks));
        ui.end_row();
        let mut made = Ok(rate);
        let accepted = self.accept(Part::Rate, &f64::from(rate.ticks()), ticks, |ticks| {
            let whole = if (0.0..=1e6).contains(ticks) { ticks.round() as u32 } else { 0 };
            made = ModelRate::every_ticks(whole);
            made.as_ref().map(|_| ())
        });
        accepted.and(made.ok())
    }

    pub(super) fn rate_refusal(&self, ui: &mut egui::Ui) {
        self.show_refusal(ui, Part::Rate);
    }

    /// What a body is made of.
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
            NumberField::new("damping ratio", "", 1.0, 0.0..=2.0).show(ui, &mut draft.damping_ratio);
            ui.end_row();
        });
        if let Some(tissue_now) = self.accept(Part::Material, &before, draft, check_tissue) {
            self.try_tissue(body, before, tissue_now);
            **tissue = tissue_now;
        }
        self.show_refusal(ui, Part::Material);
    }

    /// Notes that the panel sets the material of a body.
    pub(super) fn try_tissue(&mut self, body: Entity, before: Tissue, set: Tissue) {
        // What was before the first of several changes in a row is known to be good.
        let good = self.trial.filter(|trial| trial.body == body).map_or(before, |trial| trial.good);
        self.trial = Some(PendingChange { body, good, set });
    }

    /// Limits of the safety chain. As long as nothing was set those of the device are in force; the first change sets them all.
    pub(super) fn limits(
        &mut self,
        ui: &mut egui::Ui,
        settings: &mut Mut<ToolSettings>,
        of_device: SafetySettings,
    ) {
        let is_unset = settings.safety == SafetySettings::default();
        if is_unset {
            theme::small(ui, "as the device asks for; a change sets them all");
        } else if ui.button("as the device asks for").clicked() {
            settings.safety = SafetySettings::default();
        }
        let in_force = if settings.safety == SafetySettings::default() { of_device } else { settings.safety };
        let mut draft = in_force;
        grid(ui, "palpate_limits", |ui| {
            let of_device = "the device's own limit";
            NumberField::new("force", "N", 1.0, 0.5..=20.0)
                .unlimited(of_device)
                .show(ui, &mut draft.max_force_n);
            ui.end_row();
            NumberField::new("growth of force", "N/s", 1.0, 10.0..=5000.0)
                .log()
                .show(ui, &mut draft.max_slew_n_per_s);
            ui.end_row();
            NumberField::new("speed of the hand", "m/s", 1.0, 0.2..=5.0)
                .unlimited("never fades")
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
            NumberField::new("passivity", "N s/m", 1.0, 0.0..=20.0).show(ui, damping);
            ui.end_row();
            NumberField::new("its tolerance", "mJ", 1e-3, 0.0..=20.0)
                .show(ui, &mut draft.passivity_tolerance_j);
            ui.end_row();
        });
        if let Some(safety) = self.accept(Part::Limits, &in_force, draft, SafetySettings::validate) {
            settings.safety = safety;
        }
        self.show_refusal(ui, Part::Limits);
    }

    /// How the device lies in the scene.
    pub(super) fn frame(&mut self, ui: &mut egui::Ui, settings: &mut Mut<ToolSettings>) {
        let before = settings.frame;
        let mut draft = before;
        // Angles are kept as they were set: those of a rotation are not unique.
        let known = self.angles.filter(|(_, rotation)| *rotation == before.rotation);
        let degrees = known.map_or_else(|| degrees_of(before.rotation), |(degrees, _)| degrees);
        let mut turned = degrees;
        grid(ui, "palpate_frame", |ui| {
            three(ui, "offset", " mm", 0.5, 1e3, draft.offset_m.as_mut());
            three(ui, "turn about x y z", "°", 1.0, 1.0, turned.as_mut());
            NumberField::new("scale", "×", 1.0, 0.1..=10.0).log().show(ui, &mut draft.scale);
            ui.end_row();
        });
        if turned != degrees {
            draft.rotation = rotation_of(turned);
        }
        if let Some(frame) = self.accept(Part::Frame, &before, draft, DeviceFrame::validate) {
            (settings.frame, self.angles) = (frame, Some((turned, frame.rotation)));
        }
        self.show_refusal(ui, Part::Frame);
    }
}

/// Three numbers in a row.
fn three(ui: &mut egui::Ui, label: &str, suffix: &str, speed: f64, per_unit: f64, values: &mut [f64; 3]) {
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

/// Turns about x, y and z, degrees: about z first, then x, then y.
fn degrees_of(rotation: DQuat) -> DVec3 {
    let (y, x, z) = rotation.to_euler(EulerRot::YXZ);
    // Adding zero turns −0 into 0.
    DVec3::new(x, y, z).map(|angle| angle.to_degrees() + 0.0)
}

fn rotation_of(degrees: DVec3) -> DQuat {
    let DVec3 { x, y, z } = degrees.map(f64::to_radians);
    DQuat::from_euler(EulerRot::YXZ, y, x, z)
}

#[cfg(test)]
mod tests;
