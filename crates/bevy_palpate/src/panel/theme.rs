//! Colours and sizes of the panel.

use bevy_egui::egui::{self, Color32, FontId, TextStyle};
use palpate_local::Scheme;

pub(super) const RED: Color32 = Color32::from_rgb(240, 98, 88);
pub(super) const AMBER: Color32 = Color32::from_rgb(250, 190, 70);
pub(super) const GREEN: Color32 = Color32::from_rgb(95, 205, 140);
pub(super) const FAINT: Color32 = Color32::from_rgb(150, 156, 166);
pub(super) const DARK: Color32 = Color32::from_rgb(48, 51, 58);
pub(super) const RIM: Color32 = Color32::from_rgb(90, 95, 105);
pub(super) const FULL: Color32 = Color32::from_rgb(240, 242, 246);

/// Colour of a scheme's curve, from a palette for colour-blind readers.
pub(super) fn color(scheme: Scheme) -> Color32 {
    match scheme {
        Scheme::Hold => Color32::from_rgb(150, 150, 158),
        Scheme::LowPass => Color32::from_rgb(204, 121, 167),
        Scheme::Tangent => Color32::from_rgb(240, 228, 66),
        Scheme::Neighbourhood => Color32::from_rgb(230, 110, 30),
        Scheme::KrylovLinear => Color32::from_rgb(86, 180, 233),
        Scheme::NearFieldExact => Color32::from_rgb(40, 200, 150),
    }
}

/// Name of a scheme.
pub(super) fn name(scheme: Scheme) -> &'static str {
    match scheme {
        Scheme::Hold => "hold",
        Scheme::LowPass => "low-pass",
        Scheme::Tangent => "tangent",
        Scheme::Neighbourhood => "neighbourhood",
        Scheme::KrylovLinear => "Krylov, linear",
        Scheme::NearFieldExact => "near field exact",
    }
}

/// Sets sizes of texts and spaces, and dark colours, in `ui` only; the app's own style is not changed.
pub(super) fn apply(ui: &mut egui::Ui) {
    let style = ui.style_mut();
    style.visuals = egui::Visuals::dark();
    style.visuals.override_text_color = Some(Color32::from_rgb(200, 204, 212));
    for (text, size) in [
        (TextStyle::Small, 10.5),
        (TextStyle::Body, 12.5),
        (TextStyle::Button, 12.5),
        (TextStyle::Heading, 15.0),
    ] {
        style.text_styles.insert(text, FontId::proportional(size));
    }
    style.text_styles.insert(TextStyle::Monospace, FontId::monospace(12.0));
    style.spacing.item_spacing = egui::vec2(6.0, 4.0);
    style.spacing.slider_width = 120.0;
    style.spacing.interact_size.y = 18.0;
}

/// A line of small text.
pub(super) fn small(ui: &mut egui::Ui, text: impl Into<String>) -> egui::Response {
    ui.add(egui::Label::new(egui::RichText::new(text).small().color(FAINT)).wrap())
}

/// A value, in green if it is healthy and in amber if not.
pub(super) fn healthy(ui: &mut egui::Ui, is_healthy: bool, text: String) -> egui::Response {
    ui.colored_label(if is_healthy { GREEN } else { AMBER }, text)
}

/// An error message.
pub(super) fn error(ui: &mut egui::Ui, text: &str) -> egui::Response {
    ui.add(egui::Label::new(egui::RichText::new(text).color(RED)).wrap())
}

/// A clickable name in the colour of its curve, with a piece of the curve, `thick` for the running scheme.
pub(super) fn chip(ui: &mut egui::Ui, text: &str, color: Color32, thick: bool) -> egui::Response {
    let font = TextStyle::Body.resolve(ui.style());
    let galley = ui.painter().layout_no_wrap(text.to_owned(), font, color);
    let (line, gap) = (12.0, 4.0);
    let size = egui::vec2(line + gap + galley.size().x, galley.size().y);
    let (rect, response) = ui.allocate_exact_size(size, egui::Sense::click());
    let y = rect.center().y;
    let stroke = egui::Stroke::new(if thick { 4.0 } else { 2.0 }, color);
    ui.painter().hline(rect.left()..=rect.left() + line, y, stroke);
    ui.painter().galley(rect.left_top() + egui::vec2(line + gap, 0.0), galley, color);
    response
}
