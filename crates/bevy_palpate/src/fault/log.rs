//! The log of faults.

use super::{FaultSeverity, HapticFault, HapticFaultKind};
use bevy::log::Level;
use bevy::prelude::*;
use palpate_haptics::LoopEventKind;

/// Writes every fault to the log: errors as errors, others as warnings; missed deadlines, which a busy machine produces, at debug level.
pub(crate) fn log_faults(mut faults: MessageReader<HapticFault>) {
    for fault in faults.read() {
        let of = fault.entity.map(|entity| format!("{entity}: ")).unwrap_or_default();
        match log_level(fault) {
            Level::ERROR => error!("{of}{}", fault.report()),
            Level::DEBUG => debug!("{of}{}", fault.report()),
            _ => warn!("{of}{}", fault.report()),
        }
    }
}

/// Level at which the fault is logged.
fn log_level(fault: &HapticFault) -> Level {
    match fault.severity() {
        FaultSeverity::Error => Level::ERROR,
        _ if matches!(fault.kind, HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(_))) => Level::DEBUG,
        FaultSeverity::Warning | FaultSeverity::Load => Level::WARN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_logged_as_errors_and_degraded_states_as_warnings() {
        for (kind, level) in [
            (HapticFaultKind::LoopEnded, Level::ERROR),
            (HapticFaultKind::InvertedCells { cells: 2 }, Level::WARN),
            (HapticFaultKind::SamplesLost { lost: 1 }, Level::WARN),
            (HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(3)), Level::DEBUG),
        ] {
            assert_eq!(log_level(&HapticFault::new(None, kind.clone())), level, "{kind}");
        }
    }
}
