//! Check of the measured motion against the written force: a motor that is wired the other way draws the hand in where it should push it
//! away.
//!
//! To the loop such a motor looks like a hand that presses in, because the energy that it computes from the written force seems to come
//! from the hand. Only a change of the force distinguishes them: a motor of the right sign accelerates the stick along the change.
//!
//! While nothing is known about an axis and 2 mJ have seemingly come from the hand in one touch, the force alternates between its value
//! and 0.3 of it, in phases of 40 ms, so it is never larger than the loop's. For each phase the mean velocity, less the velocity before,
//! is compared with the change of the force. The mean over pairs of phases, in which a steady acceleration by the hand cancels, has the
//! sign of the motor. It counts once it exceeds six times its standard error, and the velocity that the force would give to 5 kg. An axis
//! that has the right sign is not checked again until the device is opened again.

use palpate_haptics::DeviceError;
use std::time::Duration;

/// Energy seemingly received from the hand in a touch at which the check begins, J.
const SUSPECT_J: f64 = 2e-3;
/// Time without force that ends a touch.
const TOUCH_ENDS: Duration = Duration::from_millis(100);
/// Smallest force that is checked, N, and smallest change of it that counts.
const MIN_FORCE_N: f64 = 0.25;
const MIN_CHANGE_N: f64 = 0.1;
/// Part of the force in the weaker phases.
const WEAK_GAIN: f64 = 0.3;
/// Duration of a phase, and the time after its beginning at which its force acts and is measured.
const PHASE: Duration = Duration::from_millis(40);
const LAG: Duration = Duration::from_millis(5);
/// Time before the phase over which the velocity is measured.
const BEFORE: Duration = Duration::from_millis(16);
/// Numbers of pairs of phases after which a result counts, and after which the check is given up for a while.
const MIN_PAIRS: u32 = 5;
const MAX_PAIRS: u32 = 20;
/// Time until the next attempt.
const RETRY: Duration = Duration::from_secs(3);
/// Number of standard errors, and the smallest standard error, m/s.
const MIN_SIGNIFICANCE: f64 = 6.0;
const MIN_ERROR_M_PER_S: f64 = 2e-4;
/// Largest mass that a hand and a stick have, kg.
const MAX_MASS_KG: f64 = 5.0;
/// Part of the travel beyond which the stick is at its end, and motion there that counts as none, m.
const END: f64 = 0.98;
const AT_REST_M: f64 = 2e-4;
/// Number of phases at rest at its end after which the force is removed.
const RESTING_PHASES: u32 = 20;
/// Duration of the fade of the force after a fault.
const FADE: Duration = Duration::from_millis(100);
/// Time in which the whole force may return in a stronger phase, as the loop's limit of growth.
const GROWTH: Duration = Duration::from_millis(20);
/// Number of positions kept.
const KEPT: usize = 128;

/// A fault that the check has found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DirectionFault {
    /// The force of the axis with this index acts the other way.
    Reversed(usize),
    /// A force along the axis with this index acts along the other one.
    Across(usize),
    /// The stick rests at its end against the force.
    AtEnd,
}

impl DirectionFault {
    /// The fault for the loop, with its remedy.
    pub(super) fn error(self) -> DeviceError {
        DeviceError::Unavailable(match self {
            Self::Reversed(0) => {
                "a force along its x moves it the opposite way; invert the first value of `JoystickOptions::reverse`, and check it with palpate-lab devices --test"
            }
            Self::Reversed(_) => {
                "a force along its y moves it the opposite way; invert the second value of `JoystickOptions::reverse`, and check it with palpate-lab devices --test"
            }
            Self::Across(0) => {
                "a force along its x moves it along y; exchange the directions of `JoystickOptions::plane`, and check it with palpate-lab devices --test"
            }
            Self::Across(_) => {
                "a force along its y moves it along x; for a wheel set `JoystickOptions::use_y` to false, and check it with palpate-lab devices --test"
            }
            Self::AtEnd => {
                "it rests at its end against the force, which is removed until it leaves the end; if the force drew it there, invert `JoystickOptions::reverse`"
            }
        })
    }
}

/// Mean of pairs of phases, for one axis.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    pairs: u32,
    sum: f64,
    sum_of_squares: f64,
    /// Sum of the changes of the force, N.
    changes_n: f64,
}

impl Mean {
    fn add(&mut self, value: f64, change_n: f64) {
        self.pairs += 1;
        self.sum += value;
        self.sum_of_squares += value * value;
        self.changes_n += change_n;
    }

    /// Mean velocity along the changes of the force, m/s, if it is significant.
    fn significant(&self) -> Option<f64> {
        if self.pairs < MIN_PAIRS {
            return None;
        }
        let n = f64::from(self.pairs);
        let mean = self.sum / n;
        let variance = ((self.sum_of_squares - n * mean * mean) / (n - 1.0)).max(0.0);
        let error = (variance / n).sqrt().max(MIN_ERROR_M_PER_S);
        // A mass m in alternating phases of the time T has the velocity ΔF T / 4 m.
        let of_max_mass = self.changes_n / n * PHASE.as_secs_f64() / (4.0 * MAX_MASS_KG);
        (mean.abs() > (MIN_SIGNIFICANCE * error).max(of_max_mass)).then_some(mean)
    }
}

/// A phase of constant gain.
#[derive(Clone, Copy, Debug)]
struct Phase {
    began_at: Duration,
    is_strong: bool,
    /// Sum of the forces of the phase, N, and their number.
    sum_n: [f64; 2],
    count: u32,
    /// Mean force of the phase before, N.
    before_n: Option<[f64; 2]>,
    /// Velocities along the change of the force in the phase before, m/s, and the changes, N.
    unpaired: Option<[[f64; 2]; 2]>,
}

/// Alternating phases of a touch.
#[derive(Clone, Copy, Debug)]
struct Probe {
    phase: Phase,
    phases: u32,
    /// Of each axis: along the changes of its own force, and along those of the other axis while it has none.
    own: [Mean; 2],
    across: [Mean; 2],
    /// Number of phases since the stick last moved.
    resting: u32,
    /// Smallest and largest positions of this phase, m.
    bounds_m: [[f64; 2]; 2],
}

#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "a tick does not allocate")]
enum State {
    Watching {
        not_before: Duration,
    },
    Probing(Probe),
    /// The force fades since this time, and is then zero.
    Fading(DirectionFault, Duration),
}

/// The check of a joystick.
#[derive(Clone, Debug)]
pub(super) struct DirectionCheck {
    travel_m: [f64; 2],
    max_force_n: f64,
    /// Newest positions, m, with their times; a ring.
    positions: [(Duration, [f64; 2]); KEPT],
    next: usize,
    count: usize,
    state: State,
    /// Axes whose force has the right sign.
    is_right: [bool; 2],
    /// Energy seemingly received from the hand in this touch, J.
    received_j: f64,
    /// Force and position of the last tick, and the time of the last force.
    last_force_n: [f64; 2],
    last_position_m: Option<[f64; 2]>,
    force_at: Duration,
    /// Gain and time of the last tick.
    gain: f64,
    at: Duration,
}

impl DirectionCheck {
    pub(super) fn new(travel_m: [f64; 2], max_force_n: f64) -> Self {
        Self {
            travel_m,
            max_force_n,
            positions: [(Duration::ZERO, [0.0; 2]); KEPT],
            next: 0,
            count: 0,
            state: State::Watching { not_before: Duration::ZERO },
            is_right: [false; 2],
            received_j: 0.0,
            last_force_n: [0.0; 2],
            last_position_m: None,
            force_at: Duration::ZERO,
            gain: 1.0,
            at: Duration::ZERO,
        }
    }

    /// Notes a position, m, along the axes of the joystick.
    pub(super) fn note_position(&mut self, at: Duration, position_m: [f64; 2]) {
        if let Some(place) = self.positions.get_mut(self.next) {
            *place = (at, position_m);
        }
        self.next = (self.next + 1) % KEPT;
        self.count = (self.count + 1).min(KEPT);
    }

    /// Gain, 0 to 1, for `force_n`, the force that is to be written, N, along the axes of the joystick.
    ///
    /// # Errors
    /// The fault, after its force has faded to zero. At its end, only while the stick is there.
    pub(super) fn gain(&mut self, now: Duration, force_n: [f64; 2]) -> Result<f64, DirectionFault> {
        let Some(position_m) = self.newest() else { return Ok(1.0) };
        self.observe_energy(now, position_m);
        match self.state {
            State::Watching { not_before } => {
                if self.is_suspect(force_n) && now >= not_before {
                    self.state = State::Probing(Probe::begin(now, position_m));
                }
                self.approach(1.0, now, force_n);
            }
            State::Probing(mut probe) => {
                self.state = State::Probing(probe);
                if let Some(next) = self.advance(&mut probe, now, position_m, force_n) {
                    self.state = next;
                } else {
                    self.state = State::Probing(probe);
                    self.approach(if probe.phase.is_strong { 1.0 } else { WEAK_GAIN }, now, force_n);
                }
            }
            State::Fading(fault, since) => {
                let left = 1.0 - now.saturating_sub(since).as_secs_f64() / FADE.as_secs_f64();
                self.gain = self.gain.min(left.max(0.0));
                if fault == DirectionFault::AtEnd && !self.is_at_end(position_m) {
                    self.state = State::Watching { not_before: now };
                } else if self.gain == 0.0 {
                    return Err(fault);
                }
            }
        }
        self.at = now;
        self.last_force_n = force_n.map(|force_n| self.gain * force_n);
        if self.last_force_n != [0.0; 2] {
            self.force_at = now;
        }
        if let State::Probing(probe) = &mut self.state {
            probe.phase.note_force(now, self.last_force_n);
        }
        Ok(self.gain)
    }

    fn newest(&self) -> Option<[f64; 2]> {
        let at = (self.next + KEPT - 1) % KEPT;
        self.positions.get(at).filter(|_| self.count > 0).map(|&(_, position_m)| position_m)
    }

    /// Adds the energy that the hand seemingly gave since the last tick; a touch begins at zero.
    fn observe_energy(&mut self, now: Duration, position_m: [f64; 2]) {
        if now.saturating_sub(self.force_at) > TOUCH_ENDS {
            self.received_j = 0.0;
        }
        if let Some(last_m) = self.last_position_m.replace(position_m) {
            let moved = position_m.iter().zip(last_m).map(|(now, last)| now - last);
            self.received_j -=
                moved.zip(self.last_force_n).map(|(moved_m, force_n)| moved_m * force_n).sum::<f64>();
        }
    }

    /// Whether the hand seemingly gave energy under the force of an axis about which nothing is known.
    fn is_suspect(&self, force_n: [f64; 2]) -> bool {
        let is_unknown = |(force_n, is_right): (&f64, &bool)| force_n.abs() >= MIN_FORCE_N && !is_right;
        self.received_j >= SUSPECT_J && force_n.iter().zip(&self.is_right).any(is_unknown)
    }

    fn is_at_end(&self, position_m: [f64; 2]) -> bool {
        position_m.iter().zip(self.travel_m).any(|(at_m, travel_m)| at_m.abs() >= END * travel_m)
    }

    /// Sets the gain to `target`: at once if it is smaller, otherwise as fast as the loop's forces grow.
    fn approach(&mut self, target: f64, now: Duration, force_n: [f64; 2]) {
        let length_n = force_n[0].hypot(force_n[1]);
        let growth_n =
            self.max_force_n * now.saturating_sub(self.at).min(GROWTH).as_secs_f64() / GROWTH.as_secs_f64();
        let growth = if length_n > growth_n { growth_n / length_n } else { 1.0 };
        self.gain = target.min(self.gain + growth);
    }

    /// Position at the time `at`, m, interpolated; `None` if it is no longer kept.
    fn position_at(&self, at: Duration) -> Option<[f64; 2]> {
        let mut later: Option<(Duration, [f64; 2])> = None;
        for back in 1..=self.count {
            let &(time, position_m) = self.positions.get((self.next + KEPT - back) % KEPT)?;
            if time <= at {
                let Some((end, end_m)) = later.filter(|(end, _)| *end > time) else {
                    return Some(position_m);
                };
                let part = (at - time).as_secs_f64() / (end - time).as_secs_f64();
                let [x, y] = position_m;
                return Some([x + part * (end_m[0] - x), y + part * (end_m[1] - y)]);
            }
            later = Some((time, position_m));
        }
        None
    }

    /// Mean velocity from `from` to `to`, m/s.
    fn velocity(&self, from: Duration, to: Duration) -> Option<[f64; 2]> {
        let ([x, y], [to_x, to_y]) = (self.position_at(from)?, self.position_at(to)?);
        let time_s = to.saturating_sub(from).as_secs_f64();
        (time_s > 0.0).then(|| [(to_x - x) / time_s, (to_y - y) / time_s])
    }

    /// Velocity gained in a phase that ends at `now`, m/s: the mean one less that before.
    fn gained(&self, phase: &Phase, now: Duration) -> Option<[f64; 2]> {
        let begin = phase.began_at + LAG;
        let [x, y] = self.velocity(begin, now)?;
        let [before_x, before_y] = self.velocity(begin.checked_sub(BEFORE)?, begin)?;
        Some([x - before_x, y - before_y])
    }

    /// Ends the phase if it is over. Returns the next state if the check is over.
    fn advance(
        &mut self,
        probe: &mut Probe,
        now: Duration,
        position_m: [f64; 2],
        force_n: [f64; 2],
    ) -> Option<State> {
        let watching = |not_before| Some(State::Watching { not_before });
        if force_n[0].hypot(force_n[1]) < MIN_CHANGE_N {
            // The touch is over.
            return watching(now);
        }
        probe.note_position(position_m);
        if now.saturating_sub(probe.phase.began_at) < PHASE {
            return None;
        }
        let gained = self.gained(&probe.phase, now);
        probe.end_phase(now, gained);
        probe.note_rest(position_m);
        for axis in 0..2 {
            if let Some(fault) = probe.fault(axis) {
                return Some(State::Fading(fault, now));
            }
            if let Some(is_right) = self.is_right.get_mut(axis) {
                *is_right |= probe.is_right(axis);
            }
        }
        if !self.is_suspect(force_n) && self.received_j >= SUSPECT_J {
            return watching(now);
        }
        if self.is_at_end(position_m) && probe.resting >= RESTING_PHASES {
            return Some(State::Fading(DirectionFault::AtEnd, now));
        }
        if probe.phases < 2 * MAX_PAIRS { None } else { watching(now + RETRY) }
    }
}

impl Phase {
    fn begin(now: Duration, is_strong: bool) -> Self {
        Self { began_at: now, is_strong, sum_n: [0.0; 2], count: 0, before_n: None, unpaired: None }
    }

    fn note_force(&mut self, now: Duration, [x, y]: [f64; 2]) {
        if now.saturating_sub(self.began_at) >= LAG {
            let [sum_x, sum_y] = self.sum_n;
            self.sum_n = [sum_x + x, sum_y + y];
            self.count += 1;
        }
    }

    fn mean_n(&self) -> Option<[f64; 2]> {
        (self.count > 0).then(|| self.sum_n.map(|sum_n| sum_n / f64::from(self.count)))
    }
}

impl Probe {
    fn begin(now: Duration, position_m: [f64; 2]) -> Self {
        Self {
            phase: Phase::begin(now, true),
            phases: 0,
            own: [Mean::default(); 2],
            across: [Mean::default(); 2],
            resting: 0,
            bounds_m: [position_m; 2],
        }
    }

    fn note_position(&mut self, [x, y]: [f64; 2]) {
        let [[low_x, low_y], [high_x, high_y]] = self.bounds_m;
        self.bounds_m = [[low_x.min(x), low_y.min(y)], [high_x.max(x), high_y.max(y)]];
    }

    fn is_at_rest(&self) -> bool {
        let [[low_x, low_y], [high_x, high_y]] = self.bounds_m;
        high_x - low_x <= AT_REST_M && high_y - low_y <= AT_REST_M
    }

    /// Counts the phases at rest; the next one begins at `position_m`.
    fn note_rest(&mut self, position_m: [f64; 2]) {
        self.resting = if self.is_at_rest() { self.resting + 1 } else { 0 };
        self.bounds_m = [position_m; 2];
    }

    /// Begins the next phase after one in which the stick gained the velocity `gained`, m/s, if it is known.
    fn end_phase(&mut self, now: Duration, gained: Option<[f64; 2]>) {
        let ended = self.phase;
        self.phases += 1;
        self.phase = Phase::begin(now, !ended.is_strong);
        self.phase.before_n = ended.mean_n();
        let (Some([x, y]), Some([before_x, before_y]), Some([gained_x, gained_y])) =
            (ended.mean_n(), ended.before_n, gained)
        else {
            return;
        };
        let [change_x, change_y] = [x - before_x, y - before_y];
        let entry = [[gained_x, gained_y], [change_x, change_y]];
        // A steady acceleration by the hand adds the same velocity to both phases of a pair, whose changes are opposite.
        let Some([[first_x, first_y], [first_change_x, first_change_y]]) = ended.unpaired else {
            self.phase.unpaired = Some(entry);
            return;
        };
        let along = |gained: f64, change: f64| gained * change.signum();
        let pair = |gained: [f64; 2], changes: [f64; 2]| {
            let [first, second] = changes;
            let is_opposite = first * second < 0.0 && first.abs().min(second.abs()) >= MIN_CHANGE_N;
            let mean = 0.5 * (along(gained[0], first) + along(gained[1], second));
            is_opposite.then_some((mean, 0.5 * (first.abs() + second.abs())))
        };
        let (of_x, of_y) = ([first_x, gained_x], [first_y, gained_y]);
        let (by_x, by_y) = ([first_change_x, change_x], [first_change_y, change_y]);
        let is_unforced =
            |changes: [f64; 2]| changes.iter().all(|change: &f64| change.abs() < 0.5 * MIN_CHANGE_N);
        let [own_x, own_y] = &mut self.own;
        let [across_x, across_y] = &mut self.across;
        for (mean, found) in [
            (own_x, pair(of_x, by_x)),
            (own_y, pair(of_y, by_y)),
            (across_x, pair(of_y, by_x).filter(|_| is_unforced(by_y))),
            (across_y, pair(of_x, by_y).filter(|_| is_unforced(by_x))),
        ] {
            if let Some((value, change_n)) = found {
                mean.add(value, change_n);
            }
        }
    }

    fn own_velocity(&self, axis: usize) -> Option<f64> {
        self.own.get(axis)?.significant()
    }

    fn is_right(&self, axis: usize) -> bool {
        self.own_velocity(axis).is_some_and(|velocity| velocity > 0.0)
    }

    fn fault(&self, axis: usize) -> Option<DirectionFault> {
        match self.own_velocity(axis) {
            Some(velocity) if velocity < 0.0 => Some(DirectionFault::Reversed(axis)),
            Some(_) => None,
            None => {
                self.across.get(axis)?.significant()?;
                Some(DirectionFault::Across(axis))
            }
        }
    }
}
