//! Stress and strain below a tool: numbers at its contact, a section through the body as a colour map, and a file with all nodes.

use super::theme;
use crate::body::SimulatedBody;
use bevy::prelude::*;
use bevy_egui::egui::{self, Color32};
use glam::DVec3;
use palpate_body::StressState;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Number of columns and rows of the section.
const COLUMNS: usize = 36;
const ROWS: usize = 20;
/// Width of the section relative to the longest side of the body.
const WIDTH: f64 = 1.1;

/// A section through a body along the normal of a contact, with the von Mises stress on a grid.
#[derive(Clone, Debug, Default)]
pub(crate) struct StressSection {
    /// Body, epoch and model step of the section.
    of: Option<(Entity, u64, u64)>,
    /// State at the contact, a fifth of a cell below the surface.
    at_contact: Option<StressState>,
    /// Von Mises stress, Pa, by rows from the surface down; `None` outside the body.
    von_mises_pa: Vec<Option<f64>>,
    /// Maximum of the section, Pa.
    max_pa: f64,
    /// File that was written last, or the reason why not.
    written: Option<Result<PathBuf, String>>,
}

impl StressSection {
    /// Computes the section of `body` below the contact at `point_m` with the outward `normal`, unless it is that of this model step.
    pub(super) fn refresh(
        &mut self,
        (entity, step): (Entity, u64),
        simulated: &SimulatedBody,
        (point_m, normal): (DVec3, DVec3),
    ) {
        let now = (entity, simulated.epoch(), step);
        if self.of.replace(now) == Some(now) {
            return;
        }
        let body = simulated.body();
        let along = normal.any_orthonormal_vector();
        let cell_m = WIDTH * simulated.longest_side_m() / COLUMNS as f64;
        let place = |index: usize| {
            let (row, column) = ((index / COLUMNS) as f64, (index % COLUMNS) as f64);
            point_m + along * cell_m * (column + 0.5 - 0.5 * COLUMNS as f64) - normal * cell_m * (row + 0.5)
        };
        let places: Vec<DVec3> = (0..COLUMNS * ROWS).map(place).collect();
        let of_nodes = body.node_stresses();
        let von_mises_pa: Vec<f64> = of_nodes.iter().map(StressState::von_mises_pa).collect();
        let found = body.points_within(&places);
        let mean = |point: &palpate_body::BodyPoint| {
            point.nodes().iter().map(|(node, w)| w * von_mises_pa[*node]).sum()
        };
        self.von_mises_pa = found.iter().map(|point| point.as_ref().map(mean)).collect();
        self.max_pa = self.von_mises_pa.iter().flatten().copied().fold(0.0, f64::max);
        let below = body.point_within(point_m - normal * 0.2 * simulated.cell_m());
        self.at_contact = below.map(|point| {
            StressState::mean(point.nodes().iter().map(|&(node, weight)| (weight, of_nodes[node])))
        });
    }

    /// Draws the numbers and the section.
    pub(super) fn draw(&mut self, ui: &mut egui::Ui, simulated: &SimulatedBody, folder: &Path) {
        if let Some(state) = self.at_contact {
            super::settings::grid(ui, "palpate_stress", |ui| {
                for (label, text) in rows(&state) {
                    ui.label(label);
                    ui.monospace(text);
                    ui.end_row();
                }
            });
        }
        let width = ui.available_width().min(320.0);
        let cell = width / COLUMNS as f32;
        let size = egui::vec2(width, cell * ROWS as f32);
        let (rect, response) = ui.allocate_exact_size(size, egui::Sense::hover());
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 0.0, theme::DARK);
        for (index, value) in self.von_mises_pa.iter().enumerate() {
            let Some(value) = value else { continue };
            let at = egui::vec2((index % COLUMNS) as f32, (index / COLUMNS) as f32) * cell;
            let share = if self.max_pa > 0.0 { (value / self.max_pa) as f32 } else { 0.0 };
            let square = egui::Rect::from_min_size(rect.min + at, egui::Vec2::splat(cell + 0.5));
            painter.rect_filled(square, 0.0, color(share));
        }
        if let Some(at) = response.hover_pos() {
            let place = (at - rect.min) / cell;
            let (column, row) = (place.x as usize, place.y as usize);
            let value = self.von_mises_pa.get(row * COLUMNS + column.min(COLUMNS - 1)).copied().flatten();
            if let Some(value) = value {
                response.on_hover_text(pascals(value));
            }
        }
        theme::small(
            ui,
            format!(
                "von Mises stress in a section below the contact, dark 0 to bright {}",
                pascals(self.max_pa)
            ),
        );
        ui.horizontal(|ui| {
            let hint = "writes position, stress and strain of every node";
            if ui.button("save all nodes (CSV)").on_hover_text(hint).clicked() {
                self.written = Some(write(simulated, folder).map_err(|error| error.to_string()));
            }
        });
        match &self.written {
            Some(Ok(path)) => drop(theme::small(ui, format!("written: {}", path.display()))),
            Some(Err(error)) => drop(theme::error(ui, error)),
            None => {}
        }
    }
}

/// Labels and values of a state.
fn rows(state: &StressState) -> [(&'static str, String); 4] {
    let [first, second, third] = state.principal_stresses_pa();
    let strains = state.principal_strains().map(|strain| format!("{:.1} %", 100.0 * strain));
    [
        ("von Mises stress", pascals(state.von_mises_pa())),
        ("pressure", pascals(state.pressure_pa())),
        ("principal stresses", format!("{}, {}, {}", pascals(first), pascals(second), pascals(third))),
        ("principal strains", strains.join(", ")),
    ]
}

/// A stress with its unit.
fn pascals(stress_pa: f64) -> String {
    if stress_pa.abs() < 1000.0 {
        format!("{stress_pa:.0} Pa")
    } else {
        format!("{:.2} kPa", 1e-3 * stress_pa)
    }
}

/// Writes the stresses of all nodes to the next free file in `folder`.
fn write(simulated: &SimulatedBody, folder: &Path) -> std::io::Result<PathBuf> {
    std::fs::create_dir_all(folder)?;
    let path = |number: u32| folder.join(format!("stress-{number}.csv"));
    let path = (1..).map(path).find(|path| !path.exists()).unwrap_or_else(|| path(0));
    simulated.body().write_stress_csv(BufWriter::new(File::create(&path)?))?;
    Ok(path)
}

/// Colour of a share, 0 to 1: dark violet, green, yellow.
fn color(share: f32) -> Color32 {
    let [r, g, b] = crate::color_map::bright(share).map(|part| (255.0 * part) as u8);
    Color32::from_rgb(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;
    use crate::testing;
    use palpate_haptics::{Reading, ScriptedDevice};

    #[test]
    fn section_below_a_contact_is_stressed_and_ends_at_the_body() {
        let mut app = testing::headless_app();
        app.world_mut().resource_mut::<HapticDevices>().register("hand", || {
            let down_m = |n: u64| 0.008 * (n as f64 / 500.0).min(1.0);
            Ok(ScriptedDevice::new(move |n, _| Ok(Reading::at(DVec3::Y * (0.056 - down_m(n))))))
        });
        let block = (DeformableBody::block([6; 3], 0.1), FixedRegion::Face(BoxFace::Bottom));
        let body = app.world_mut().spawn(block).id();
        let tool = app.world_mut().spawn(HapticTool::new("hand")).id();
        testing::advance_model_steps(&mut app, 20);
        let contact = app.world().get::<ToolForce>(tool).unwrap().contact.unwrap();
        let simulated = app.world().get::<SimulatedBody>(body).unwrap();
        let mut section = StressSection::default();
        section.refresh((body, 20), simulated, (contact.point_m, contact.normal));
        let state = section.at_contact.unwrap();
        assert!(state.principal_stresses_pa()[2] < -500.0, "{state:?}");
        // The section is a tenth wider than the block, and deeper than half of it.
        let row = &section.von_mises_pa[5 * COLUMNS..6 * COLUMNS];
        assert!(row[0].is_none() && row[COLUMNS - 1].is_none() && row[COLUMNS / 2].is_some());
        let filled = section.von_mises_pa.iter().flatten().count();
        assert!(filled > COLUMNS * ROWS * 8 / 10, "{filled}");
        // The stress falls with the depth.
        let below = |row: usize| section.von_mises_pa[row * COLUMNS + COLUMNS / 2].unwrap();
        assert!(section.max_pa >= below(2) && below(2) > 1.2 * below(15), "{} {}", below(2), below(15));
        assert_eq!((pascals(740.2), pascals(-1500.0)), ("740 Pa".into(), "-1.50 kPa".into()));
        let folder = std::env::temp_dir().join(format!("palpate-stress-{}", std::process::id()));
        let written = write(simulated, &folder).unwrap();
        assert_eq!(std::fs::read_to_string(written).unwrap().lines().count(), 217);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
