//! What the black box knows of the safety chain. This file is the only one that has to follow when the chain gets another
//! stage.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::SafetyReport;
use std::fmt::{Display, Formatter};

/// What acted at a tick.
pub(super) fn actions_of(report: &SafetyReport) -> SafetyActions {
    let happened = [
        (SafetyAction::NotFinite, report.not_finite),
        (SafetyAction::Waiting, report.waiting),
        (SafetyAction::Gains, report.gain < 1.0),
        (SafetyAction::Stale, report.stale),
        (SafetyAction::Silent, report.silent),
        (SafetyAction::VelocityGuard, report.speed_guarded),
        (SafetyAction::Passivity, report.damping_ns_per_m > 0.0),
        (SafetyAction::Magnitude, report.magnitude_limited),
        (SafetyAction::Slew, report.slew_limited),
    ];
    happened.into_iter().filter(|(_, acted)| *acted).map(|(action, _)| action).collect()
}

/// Something that the safety chain did, or found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum SafetyAction {
    /// A force that was not finite became zero.
    NotFinite,
    /// The start waited for a small force.
    Waiting,
    /// The gains, of start-up, fades and pause, made the force smaller.
    Gains,
    /// The local model was too old.
    Stale,
    /// The device had been silent for too long.
    Silent,
    /// The velocity guard made the force smaller.
    VelocityGuard,
    /// The passivity stage damped.
    Passivity,
    /// The force was longer than the limit.
    Magnitude,
    /// The force grew faster than the limit.
    Slew,
}

impl SafetyAction {
    /// All of them, in the chain's order.
    pub const ALL: [Self; 9] = [
        Self::NotFinite,
        Self::Waiting,
        Self::Gains,
        Self::Stale,
        Self::Silent,
        Self::VelocityGuard,
        Self::Passivity,
        Self::Magnitude,
        Self::Slew,
    ];

    /// Its name in a file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NotFinite => "not_finite",
            Self::Waiting => "waiting",
            Self::Gains => "gains",
            Self::Stale => "stale",
            Self::Silent => "silent",
            Self::VelocityGuard => "velocity_guard",
            Self::Passivity => "passivity",
            Self::Magnitude => "magnitude",
            Self::Slew => "slew",
        }
    }
}

/// A set of [`SafetyAction`]s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SafetyActions(u16);

impl SafetyActions {
    /// Whether `action` is among them.
    #[must_use]
    pub fn contains(self, action: SafetyAction) -> bool {
        self.0 & 1 << action as u16 != 0
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Those that are among them, in the chain's order.
    pub fn iter(self) -> impl Iterator<Item = SafetyAction> {
        SafetyAction::ALL.into_iter().filter(move |action| self.contains(*action))
    }

    /// Those of the names in `text`, with `+` between them.
    pub(crate) fn named(text: &str) -> Option<Self> {
        let named = |name: &str| SafetyAction::ALL.into_iter().find(|action| action.name() == name);
        if text.is_empty() { Some(Self::default()) } else { text.split('+').map(named).collect() }
    }
}

impl FromIterator<SafetyAction> for SafetyActions {
    fn from_iter<T: IntoIterator<Item = SafetyAction>>(actions: T) -> Self {
        Self(actions.into_iter().fold(0, |all, action| all | 1 << action as u16))
    }
}

impl Display for SafetyActions {
    /// Their names with `+` between them; nothing where there is none.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        for (i, action) in self.iter().enumerate() {
            write!(f, "{}{}", if i > 0 { "+" } else { "" }, action.name())?;
        }
        Ok(())
    }
}
