//! Whose turn it is: reports that are owed to a board, and those that it has not asked for.

use std::time::Duration;

/// Silence after which a board is woken up, and counts as silent.
pub(super) const SILENCE_TIMEOUT: Duration = Duration::from_millis(10);

/// So many reports may wait at a board in its driver's view: after a long silence, in which it was sent a zero every now and then, a
/// board that does not take turns is answered again after as many of its own.
const MAX_EARLY_REPORTS: i64 = 64;

/// Reports that have come and gone, balanced: firmware that takes turns takes one report for each that it sends, and the rest waits.
/// Each that is sent too many would stay there, and every force after it would come a report later, for good.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ReportCredits {
    /// Reports of the board less those sent to it: 1 where one is to be answered; below 0 where as many of its next ones have been
    /// answered before they came. Never more than 1: of several that have come at once the newest is answered, as firmware that
    /// does not take turns sends more than it gets.
    owed: i64,
    /// Reports beyond that one, since it was last sent anything: nobody has answered them, unless another thread has.
    beyond: i64,
    /// Whether it has spoken since it was last sent anything.
    has_spoken: bool,
    /// The currents that the board shows, or will when it has taken all that was sent, mA.
    pub(super) shown_ma: [i16; 3],
    /// When a report was last read.
    heard_at: Duration,
    /// When one last went either way.
    exchanged_at: Duration,
    is_silent: bool,
}

impl ReportCredits {
    /// With a board that has just been opened, at `now`.
    pub(super) fn begin(now: Duration) -> Self {
        Self { heard_at: now, exchanged_at: now, ..Self::default() }
    }

    /// So many reports have come.
    pub(super) fn heard(&mut self, reports: u64, now: Duration) {
        let reports = i64::try_from(reports).unwrap_or(i64::MAX);
        let all = self.owed.saturating_add(reports);
        self.owed = all.min(1);
        self.beyond = self.beyond.saturating_add(all - self.owed);
        (self.heard_at, self.exchanged_at) = (now, now);
        (self.has_spoken, self.is_silent) = (true, false);
    }

    /// Nothing has come for [`SILENCE_TIMEOUT`]. A board that has spoken since it was last sent anything has taken all that was sent, and
    /// waits, also where a report of it was lost and nothing seems to be owed.
    pub(super) fn note_silence(&mut self) {
        if self.has_spoken {
            self.owed = 1;
        }
    }

    /// Nothing has come by `now`. Whether it is so long that the board is to be woken up.
    pub(super) fn needs_wake_up(&mut self, now: Duration) -> bool {
        self.is_silent = now.saturating_sub(self.heard_at) >= SILENCE_TIMEOUT;
        let is_still = now.saturating_sub(self.exchanged_at) >= SILENCE_TIMEOUT;
        if is_still {
            self.note_silence();
        }
        is_still
    }

    /// A report is sent at `now`, whether it arrives or not.
    pub(super) fn sending(&mut self, now: Duration) {
        self.exchanged_at = now;
    }

    /// It has been sent, and shows these currents.
    pub(super) fn sent(&mut self, currents_ma: [i16; 3]) {
        self.owed = (self.owed - 1).max(-MAX_EARLY_REPORTS);
        (self.has_spoken, self.shown_ma, self.beyond) = (false, currents_ma, 0);
    }

    /// Another thread has sent so many zeros. Each has answered a report as any other would: one that was not answered before the next
    /// came, or that which is owed, or one to come.
    pub(super) fn stopped(&mut self, zeros: u32) {
        let zeros = i64::from(zeros);
        let earlier = zeros.min(self.beyond);
        self.beyond -= earlier;
        self.owed = (self.owed - (zeros - earlier)).max(-MAX_EARLY_REPORTS);
        self.has_spoken &= self.owed > 0;
        self.shown_ma = [0; 3];
    }

    /// The link has failed.
    pub(super) fn failed(&mut self) {
        self.is_silent = true;
    }

    /// Whether a report waits for its answer.
    pub(super) fn has_credit(&self) -> bool {
        self.owed > 0
    }

    /// Whether one may be sent that was not asked for: none such waits at the board.
    pub(super) fn may_send_early(&self) -> bool {
        self.owed == 0
    }

    /// Whether nothing has come for [`SILENCE_TIMEOUT`].
    pub(super) fn is_silent(&self) -> bool {
        self.is_silent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn what_was_sent_ahead_answers_the_next_report() {
        let mut turns = ReportCredits::begin(ms(0));
        turns.heard(1, ms(1));
        turns.sent([0; 3]);
        assert!(!turns.has_credit() && turns.may_send_early());
        turns.sent([0; 3]);
        assert!(!turns.may_send_early());
        turns.heard(1, ms(2));
        assert!(!turns.has_credit() && turns.may_send_early());
        turns.heard(1, ms(3));
        assert!(turns.has_credit());
    }

    #[test]
    fn a_stop_from_another_thread_has_answered_a_report() {
        let mut turns = ReportCredits::begin(ms(0));
        turns.heard(1, ms(1));
        turns.stopped(1);
        assert!(!turns.has_credit() && turns.may_send_early());
        turns.heard(1, ms(2));
        assert!(turns.has_credit());
        turns.sent([9; 3]);
        // It had nothing to answer yet.
        turns.stopped(2);
        assert_eq!(turns.shown_ma, [0; 3]);
        turns.heard(2, ms(3));
        assert!(!turns.has_credit());
        turns.heard(1, ms(4));
        assert!(turns.has_credit());
        // It is told of only when the report after that has come, which still waits.
        turns.heard(1, ms(5));
        turns.stopped(1);
        assert!(turns.has_credit());
        turns.sent([0; 3]);
        assert!(!turns.has_credit());
        turns.heard(1, ms(6));
        assert!(turns.has_credit());
    }

    #[test]
    fn a_board_that_does_not_take_turns_is_owed_one_at_a_time() {
        let mut turns = ReportCredits::begin(ms(0));
        turns.heard(9, ms(1));
        turns.sent([0; 3]);
        assert!(!turns.has_credit());
        // It was silent for long.
        (0..1000).for_each(|_| turns.sent([0; 3]));
        turns.heard(64, ms(2));
        assert!(!turns.has_credit());
        turns.heard(1, ms(3));
        assert!(turns.has_credit());
    }

    #[test]
    fn a_board_that_falls_silent_after_it_has_spoken_waits_for_a_report() {
        let mut turns = ReportCredits::begin(ms(0));
        // One of its reports was lost.
        turns.sent([0; 3]);
        turns.heard(1, ms(1));
        assert!(!turns.needs_wake_up(ms(10)) && !turns.has_credit());
        assert!(turns.needs_wake_up(ms(11)) && turns.has_credit() && turns.is_silent());
        turns.sending(ms(11));
        turns.sent([0; 3]);
        // It has not spoken since: it may not have taken that yet.
        assert!(turns.needs_wake_up(ms(21)) && !turns.has_credit());
    }
}
