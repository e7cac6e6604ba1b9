//! Force over depth: as it is felt, as the full body answers, as theory has it.

#![cfg(feature = "panel")]

use super::scene::{Measured, THICKNESS_M, YOUNGS_MODULUS_PA};
use super::{hand, theory};
use bevy::prelude::*;
use bevy_egui::EguiContexts;
use palpate_stage::{Plot, plot_window};

/// Shows what is felt of the tip that presses now, beside what the full body and the theory say of it.
pub fn show(mut contexts: EguiContexts, measured: Res<Measured>) -> Result {
    let tip = measured.tip();
    let modulus = theory::reduced_modulus_pa(YOUNGS_MODULUS_PA);
    let deepest = hand::DEPTHS_M[hand::DEPTHS_M.len() - 1];
    let depths = || (0..=40).map(|i| deepest * f64::from(i) / 40.0);
    let half_space = depths().map(|d| [1e3 * d, theory::half_space_n(tip, modulus, d)]).collect();
    let layer = depths()
        .map(|d| [1e3 * d, theory::half_space_n(tip, modulus, d) * theory::layer(tip, THICKNESS_M, d)])
        .collect();
    let felt = measured.curve().iter().map(|pressed| [1e3 * pressed.depth_m, pressed.felt_n]).collect();
    let full = measured.curve().iter().map(|pressed| [1e3 * pressed.depth_m, pressed.full_n]).collect();
    plot_window(
        &mut contexts,
        &Plot {
            title: tip.name(),
            axes: ["depth, mm", "force, N"],
            lines: &[
                ("half-space", [120, 160, 220], half_space),
                ("full body", [190, 190, 190], full),
                // Over the curve that it predicts, which it hardly differs from.
                ("layer", [240, 228, 66], layer),
            ],
            points: &[("felt", [255, 120, 90], felt)],
        },
    )
}
