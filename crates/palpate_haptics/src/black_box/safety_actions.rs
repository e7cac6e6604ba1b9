//! Actions of the safety chain, as recorded by the black box. A new stage of the chain needs changes here only.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::SafetyReport;
use std::fmt::{Display, Formatter};

/// Actions of the safety chain at one tick.
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

/// Action or finding of the safety chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum SafetyAction {
    /// A force that was not finite was replaced by zero.
    NotFinite,
    /// The start stage waited for a small force.
    Waiting,
    /// The gains of start-up, fades and pause reduced the force.
    Gains,
    /// The local model was stale.
    Stale,
    /// The device timeout had passed without a reading or write.
    Silent,
    /// The velocity guard reduced the force.
    VelocityGuard,
    /// The passivity stage added damping.
    Passivity,
    /// The force exceeded the magnitude limit.
    Magnitude,
    /// The growth of the force exceeded its limit.
    Slew,
}

impl SafetyAction {
    /// All actions, in the order of the chain.
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

    /// Name of the action in a file.
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
    /// Whether the set contains `action`.
    #[must_use]
    pub fn contains(self, action: SafetyAction) -> bool {
        self.0 & 1 << action as u16 != 0
    }

    /// Whether the set is empty.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The actions of the set, in the order of the chain.
    pub fn iter(self) -> impl Iterator<Item = SafetyAction> {
        SafetyAction::ALL.into_iter().filter(move |action| self.contains(*action))
    }

    /// Parses names joined by `+`; an empty text is the empty set.
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
    /// The names joined by `+`; nothing for the empty set.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        for (i, action) in self.iter().enumerate() {
            write!(f, "{}{}", if i > 0 { "+" } else { "" }, action.name())?;
        }
        Ok(())
    }
}
