//! A model step that takes longer than its period, and the times of its parts.

use std::fmt::{Display, Formatter};

/// Durations of a model step that took longer than its period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlowStep {
    /// Duration of the step, ms.
    pub step_ms: f64,
    /// Time between two model steps, ms.
    pub period_ms: f64,
    /// Time spent in stepping bodies, ms.
    pub bodies_ms: f64,
    /// Time spent in building local models, ms.
    pub local_models_ms: f64,
    /// Number of nodes of the largest body, which is the fault's entity.
    pub nodes: usize,
    /// Suggested number of cells along the longest side of that body ([`MeshShape::cells`](crate::MeshShape::cells)); `None` for a block. An
    /// estimate, with a time proportional to the number of cells.
    pub suggested_cells_along: Option<usize>,
}

/// Part of a model step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StepPart {
    /// Stepping the bodies.
    Bodies,
    /// Building the local models.
    LocalModels,
    /// Everything else, including the app's own systems in [`ModelSchedule`](crate::ModelSchedule).
    Other,
}

impl SlowStep {
    /// Time spent neither in bodies nor in local models, ms.
    #[must_use]
    pub fn other_ms(&self) -> f64 {
        (self.step_ms - self.bodies_ms - self.local_models_ms).max(0.0)
    }

    /// The part that took the most time.
    #[must_use]
    pub fn largest(&self) -> StepPart {
        let (bodies, local, other) = (self.bodies_ms, self.local_models_ms, self.other_ms());
        if other > bodies.max(local) {
            StepPart::Other
        } else if local > bodies {
            StepPart::LocalModels
        } else {
            StepPart::Bodies
        }
    }
}

impl Display for SlowStep {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { step_ms, period_ms, bodies_ms, local_models_ms, nodes, suggested_cells_along } = self;
        write!(
            f,
            "a model step takes {step_ms:.0} ms of {period_ms:.0} ms: bodies {bodies_ms:.0} ms, local models \
             {local_models_ms:.0} ms, other {:.0} ms; the largest body has {nodes} nodes; ",
            self.other_ms()
        )?;
        match (self.largest(), suggested_cells_along) {
            (StepPart::Other, _) => f.write_str("shorten the app's own systems in ModelSchedule"),
            (_, Some(cells)) => {
                write!(f, "set MeshShape::cells to MeshCellSize::Along({cells}), or lower ModelRate")
            }
            (_, None) => f.write_str("use fewer nodes, or lower ModelRate"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remedy_follows_the_largest_part() {
        let step = SlowStep {
            step_ms: 100.0,
            period_ms: 50.0,
            bodies_ms: 60.0,
            local_models_ms: 30.0,
            nodes: 991,
            suggested_cells_along: Some(6),
        };
        assert_eq!((step.largest(), step.other_ms()), (StepPart::Bodies, 10.0));
        let text = step.to_string();
        assert!(
            text.ends_with("set MeshShape::cells to MeshCellSize::Along(6), or lower ModelRate"),
            "{text}"
        );
        let local = SlowStep { bodies_ms: 20.0, local_models_ms: 70.0, suggested_cells_along: None, ..step };
        assert_eq!(local.largest(), StepPart::LocalModels);
        assert!(local.to_string().ends_with("use fewer nodes, or lower ModelRate"), "{local}");
        let other = SlowStep { bodies_ms: 20.0, local_models_ms: 10.0, ..step };
        assert_eq!(other.largest(), StepPart::Other);
    }
}
