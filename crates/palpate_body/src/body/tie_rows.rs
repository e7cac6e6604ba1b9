//! Constraint rows of ties.

use super::Body;
use super::constraint::{Constraint, ConstraintSource};
use super::substep::Substep;
use crate::tie::{TieEnd, TieKind};
use crate::weights::add_weight;
use glam::DVec3;
use palpate_laws::{ConstraintLaw, MAX_CORRECTION_SPEED_M_PER_S};

impl Body {
    /// Rows of all ties that have not torn.
    pub(super) fn tie_rows(&mut self, step: &Substep<'_>) -> Vec<Constraint> {
        let (h, drive) = (step.h, step.drive);
        let mut rows = Vec::new();
        for (index, tie) in self.ties.iter_mut().enumerate() {
            tie.last = (DVec3::ZERO, h);
            if tie.is_torn() {
                continue;
            }
            let mut nodes = tie.a.nodes().to_vec();
            let at = tie.a.of(&self.x);
            // Position of the other end, and its prescribed displacement in this step.
            let (other, moved) = match &tie.b {
                TieEnd::Point(b) => {
                    b.nodes().iter().for_each(|&(node, w)| add_weight(&mut nodes, node, -w));
                    (b.of(&self.x), DVec3::ZERO)
                }
                TieEnd::Anchor { from_m, to_m } => {
                    let place = |share: f64| *from_m + (*to_m - *from_m) * share;
                    (place(step.along.0), place(step.along.1) - place(step.along.0))
                }
            };
            // A driven or moved node is already at its position of the end of the step.
            let pulled = step.given_m(&nodes);
            let (apart, moved) = (at - other - pulled, moved - pulled);
            nodes.retain(|(node, _)| drive.is_none_or(|(driven, _)| driven != *node));
            let (law, gap, initial_violation) = match tie.kind {
                TieKind::Joint => {
                    let closing = apart.clamp_length_max(h * MAX_CORRECTION_SPEED_M_PER_S);
                    (ConstraintLaw::Bilateral, closing - moved, closing)
                }
                TieKind::Thread { length_m, stiffness_n_per_m } => {
                    // Along the predicted line between the ends at the end of the step.
                    let Some(along) = (apart - moved).try_normalize() else { continue };
                    let slack = length_m - (apart - moved).length();
                    match stiffness_n_per_m {
                        // The stretch of an elastic thread is no gap to be closed.
                        Some(k) => {
                            let law = ConstraintLaw::Tension { along, compliance_per_kg: 1.0 / (k * h * h) };
                            (law, -slack * along, DVec3::ZERO)
                        }
                        None => {
                            let law = ConstraintLaw::Tension { along, compliance_per_kg: 0.0 };
                            let slack = slack.max(-h * MAX_CORRECTION_SPEED_M_PER_S - moved.length());
                            let before =
                                (length_m - apart.length()).clamp(-h * MAX_CORRECTION_SPEED_M_PER_S, 0.0);
                            (law, -slack * along, -before * along)
                        }
                    }
                }
            };
            rows.push(Constraint {
                source: ConstraintSource::Tie(index),
                nodes,
                rigid: None,
                law,
                gap,
                initial_violation,
            });
        }
        rows
    }
}
