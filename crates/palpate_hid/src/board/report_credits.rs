//! Bookkeeping of the report exchange: pending reports of the board, and reports sent early.

use std::time::Duration;

/// Time without a report after which the board counts as silent and is woken up.
pub(super) const SILENCE_TIMEOUT: Duration = Duration::from_millis(10);

/// Maximum number of early reports in the balance. A board that does not wait for replies gets zero reports during a long silence; it
/// is replied to again after this many reports of its own.
const MAX_EARLY_REPORTS: i64 = 64;

/// Balance of received and sent reports. Firmware that waits for replies takes one report for each that it sends and queues the rest.
/// Every surplus report would stay in the queue and delay all later forces by one report.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ReportCredits {
    /// Received minus sent reports: 1 where a report waits for its reply, negative where later reports were replied to early. At most
    /// 1: of several reports received at once only the latest is replied to, as firmware that does not wait sends more than it gets.
    balance: i64,
    /// Reports beyond that one since the last report was sent. They have no reply, except for stop reports of another thread.
    unreplied: i64,
    /// Whether a report has arrived since the last one was sent.
    has_received: bool,
    /// Currents that the board displays after it has processed all sent reports, mA.
    pub(super) displayed_ma: [i16; 3],
    /// Time of the last received report.
    received_at: Duration,
    /// Time of the last report in either direction.
    exchanged_at: Duration,
    is_silent: bool,
}

impl ReportCredits {
    /// Balance for a board opened at `now`.
    pub(super) fn begin(now: Duration) -> Self {
        Self { received_at: now, exchanged_at: now, ..Self::default() }
    }

    /// Counts received reports.
    pub(super) fn received(&mut self, reports: u64, now: Duration) {
        let reports = i64::try_from(reports).unwrap_or(i64::MAX);
        let all = self.balance.saturating_add(reports);
        self.balance = all.min(1);
        self.unreplied = self.unreplied.saturating_add(all - self.balance);
        (self.received_at, self.exchanged_at) = (now, now);
        (self.has_received, self.is_silent) = (true, false);
    }

    /// Notes [`SILENCE_TIMEOUT`] without a report. A board that has sent a report since the last one to it has processed everything and
    /// waits for a reply, also if its own report was lost and the balance shows none pending.
    pub(super) fn note_silence(&mut self) {
        if self.has_received {
            self.balance = 1;
        }
    }

    /// Notes that no report has arrived by `now`. Returns whether the board has to be woken up.
    pub(super) fn needs_wake_up(&mut self, now: Duration) -> bool {
        self.is_silent = now.saturating_sub(self.received_at) >= SILENCE_TIMEOUT;
        let is_idle = now.saturating_sub(self.exchanged_at) >= SILENCE_TIMEOUT;
        if is_idle {
            self.note_silence();
        }
        is_idle
    }

    /// Notes an attempt to send a report at `now`, successful or not.
    pub(super) fn sending(&mut self, now: Duration) {
        self.exchanged_at = now;
    }

    /// Counts a sent report that displays `currents_ma`.
    pub(super) fn sent(&mut self, currents_ma: [i16; 3]) {
        self.balance = (self.balance - 1).max(-MAX_EARLY_REPORTS);
        (self.has_received, self.displayed_ma, self.unreplied) = (false, currents_ma, 0);
    }

    /// Counts zero reports sent by another thread. Each replies to a report: one without reply before the latest, the pending one, or a
    /// later one.
    pub(super) fn stops_sent(&mut self, zeros: u32) {
        let zeros = i64::from(zeros);
        let earlier = zeros.min(self.unreplied);
        self.unreplied -= earlier;
        self.balance = (self.balance - (zeros - earlier)).max(-MAX_EARLY_REPORTS);
        self.has_received &= self.balance > 0;
        self.displayed_ma = [0; 3];
    }

    /// Notes a failure of the link.
    pub(super) fn link_failed(&mut self) {
        self.is_silent = true;
    }

    /// Whether a report of the board waits for a reply.
    pub(super) fn has_credit(&self) -> bool {
        self.balance > 0
    }

    /// Whether a report may be sent early: none is in the board's queue.
    pub(super) fn may_send_early(&self) -> bool {
        self.balance == 0
    }

    /// Whether no report has arrived for [`SILENCE_TIMEOUT`].
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
    fn early_report_is_the_reply_to_the_next_report() {
        let mut credits = ReportCredits::begin(ms(0));
        credits.received(1, ms(1));
        credits.sent([0; 3]);
        assert!(!credits.has_credit() && credits.may_send_early());
        credits.sent([0; 3]);
        assert!(!credits.may_send_early());
        credits.received(1, ms(2));
        assert!(!credits.has_credit() && credits.may_send_early());
        credits.received(1, ms(3));
        assert!(credits.has_credit());
    }

    #[test]
    fn stop_from_another_thread_counts_as_a_reply() {
        let mut credits = ReportCredits::begin(ms(0));
        credits.received(1, ms(1));
        credits.stops_sent(1);
        assert!(!credits.has_credit() && credits.may_send_early());
        credits.received(1, ms(2));
        assert!(credits.has_credit());
        credits.sent([9; 3]);
        // No report is pending for these two.
        credits.stops_sent(2);
        assert_eq!(credits.displayed_ma, [0; 3]);
        credits.received(2, ms(3));
        assert!(!credits.has_credit());
        credits.received(1, ms(4));
        assert!(credits.has_credit());
        // The stop is counted only after the next report, which is still pending.
        credits.received(1, ms(5));
        credits.stops_sent(1);
        assert!(credits.has_credit());
        credits.sent([0; 3]);
        assert!(!credits.has_credit());
        credits.received(1, ms(6));
        assert!(credits.has_credit());
    }

    #[test]
    fn several_reports_at_once_get_one_reply() {
        let mut credits = ReportCredits::begin(ms(0));
        credits.received(9, ms(1));
        credits.sent([0; 3]);
        assert!(!credits.has_credit());
        // A long silence with many wake-ups.
        (0..1000).for_each(|_| credits.sent([0; 3]));
        credits.received(64, ms(2));
        assert!(!credits.has_credit());
        credits.received(1, ms(3));
        assert!(credits.has_credit());
    }

    #[test]
    fn silence_after_a_report_means_that_the_board_waits_for_a_reply() {
        let mut credits = ReportCredits::begin(ms(0));
        // A report of the board was lost.
        credits.sent([0; 3]);
        credits.received(1, ms(1));
        assert!(!credits.needs_wake_up(ms(10)) && !credits.has_credit());
        assert!(credits.needs_wake_up(ms(11)) && credits.has_credit() && credits.is_silent());
        credits.sending(ms(11));
        credits.sent([0; 3]);
        // Without a report since, the board may not have processed the last one yet.
        assert!(credits.needs_wake_up(ms(21)) && !credits.has_credit());
    }
}
