//! Ties that hold points of a body: grasps, threads and sutures.

use crate::error::{check, check_positive};
use crate::{BodyError, BodyPoint};
use glam::DVec3;

/// A tie between a point of a body and an anchor, or between two points.
///
/// Ties are rigid, except threads [with a stiffness](Tie::with_stiffness). The force of a rigid tie is meaningless if
/// it cannot be satisfied, for example when it presses a node into an obstacle; [`crate::StepReport::unconverged`]
/// counts such steps.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Tie {
    pub(crate) kind: TieKind,
    pub(crate) a: BodyPoint,
    pub(crate) b: TieEnd,
    /// Force beyond which the tie tears, N; `None` for infinity, which not every file format can store.
    pub(crate) tear_limit_n: Option<f64>,
    /// Force at which it tore, N.
    pub(crate) torn_at_n: Option<f64>,
    /// Impulse λ on `a` in the last step, N s, and the length of that step, s.
    pub(crate) last: (DVec3, f64),
}

#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum TieEnd {
    Point(BodyPoint),
    /// A position set by the user: now, and at the end of the next advance.
    Anchor {
        from_m: DVec3,
        to_m: DVec3,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum TieKind {
    /// Bilateral: the ends coincide.
    Joint,
    /// Tension only: the ends are at most that far apart, or a spring acts beyond that length.
    Thread { length_m: f64, stiffness_n_per_m: Option<f64> },
}

impl Tie {
    /// Creates a grasp: a bilateral tie that moves `point` to `anchor_m`, m.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the position is not finite.
    pub fn grasp(point: BodyPoint, anchor_m: DVec3) -> Result<Self, BodyError> {
        let b = anchor(anchor_m)?;
        Ok(Self::new(TieKind::Joint, point, b))
    }

    /// Creates a thread of length `length_m` from `point` to `anchor_m`, m, which only pulls.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the length is not above zero or the position is not finite.
    pub fn thread_to(point: BodyPoint, anchor_m: DVec3, length_m: f64) -> Result<Self, BodyError> {
        let length_m = check_positive("length of a thread, m", length_m)?;
        Ok(Self::new(TieKind::Thread { length_m, stiffness_n_per_m: None }, point, anchor(anchor_m)?))
    }

    /// Creates a thread of length `length_m` between two points, which only pulls. It is inextensible without
    /// [`Self::with_stiffness`].
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the length is not above zero.
    pub fn thread(a: BodyPoint, b: BodyPoint, length_m: f64) -> Result<Self, BodyError> {
        let length_m = check_positive("length of a thread, m", length_m)?;
        Ok(Self::new(TieKind::Thread { length_m, stiffness_n_per_m: None }, a, TieEnd::Point(b)))
    }

    /// Creates a suture: it draws two points together at 1 m/s and holds them until its force exceeds `tear_limit_n`.
    /// The force needed for closing does not count.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the limit is not above zero; it may be infinite.
    pub fn suture(a: BodyPoint, b: BodyPoint, tear_limit_n: f64) -> Result<Self, BodyError> {
        Self::new(TieKind::Joint, a, TieEnd::Point(b)).with_tear_limit(tear_limit_n)
    }

    /// Sets the force above which the tie tears, N. The force needed to close a gap does not count.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the limit is not above zero; it may be infinite.
    pub fn with_tear_limit(self, tear_limit_n: f64) -> Result<Self, BodyError> {
        check("tear limit of a tie, N", tear_limit_n, tear_limit_n > 0.0, "above 0")?;
        Ok(Self { tear_limit_n: tear_limit_n.is_finite().then_some(tear_limit_n), ..self })
    }

    /// Makes a thread elastic: beyond its length its tension is `stiffness_n_per_m` times the additional distance of
    /// its ends, else zero. The force is evaluated at the end of the step, so no stiffness needs shorter steps. An
    /// infinite stiffness is an inextensible thread.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the stiffness is not above zero, or the tie is no thread.
    pub fn with_stiffness(self, stiffness_n_per_m: f64) -> Result<Self, BodyError> {
        let what = "stiffness of a thread, N/m";
        check(what, stiffness_n_per_m, stiffness_n_per_m > 0.0, "above 0")?;
        let TieKind::Thread { length_m, .. } = self.kind else {
            return Err(BodyError::Parameter { what, value: stiffness_n_per_m, allowed: "that of a thread" });
        };
        let stiffness_n_per_m = stiffness_n_per_m.is_finite().then_some(stiffness_n_per_m);
        Ok(Self { kind: TieKind::Thread { length_m, stiffness_n_per_m }, ..self })
    }

    fn new(kind: TieKind, a: BodyPoint, b: TieEnd) -> Self {
        Self { kind, a, b, tear_limit_n: None, torn_at_n: None, last: (DVec3::ZERO, 0.0) }
    }

    /// First point.
    #[must_use]
    pub fn point(&self) -> &BodyPoint {
        &self.a
    }

    /// Whether the tie is an elastic thread.
    pub(crate) fn stretches(&self) -> bool {
        matches!(self.kind, TieKind::Thread { stiffness_n_per_m: Some(_), .. })
    }

    /// Whether it has torn.
    #[must_use]
    pub fn is_torn(&self) -> bool {
        self.torn_at_n.is_some()
    }

    /// Force at which the tie tore, N; `None` while it holds.
    #[must_use]
    pub fn torn_at_n(&self) -> Option<f64> {
        self.torn_at_n
    }

    /// Force λ/h on the first point in the last step, N. The force on the other end is its negative.
    #[must_use]
    pub fn force_n(&self) -> DVec3 {
        let (impulse, h) = self.last;
        if h > 0.0 { impulse / h } else { DVec3::ZERO }
    }

    /// Adds the forces on its ends in the last step, N.
    pub(crate) fn add_force_n(&self, force_n: &mut [DVec3]) {
        let f = self.force_n();
        self.a.nodes().iter().for_each(|&(node, w)| force_n[node] += w * f);
        if let TieEnd::Point(b) = &self.b {
            b.nodes().iter().for_each(|&(node, w)| force_n[node] -= w * f);
        }
    }

    /// Moves the anchor. It moves at constant speed and reaches `to_m` at the end of the next advance. Returns whether
    /// that changes its motion.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the position is not finite or the tie has no anchor.
    pub(crate) fn move_to(&mut self, to_m: DVec3) -> Result<bool, BodyError> {
        let TieEnd::Anchor { to_m: target, .. } = &mut self.b else {
            return Err(BodyError::Parameter { what: "anchors of the tie", value: 0.0, allowed: "1" });
        };
        check("place of an anchor, m", to_m.abs().max_element(), to_m.is_finite(), "finite")?;
        Ok(std::mem::replace(target, to_m) != to_m)
    }

    /// Weight of `node` in the row: that in the first point minus that in the second.
    pub(crate) fn weight(&self, node: usize) -> f64 {
        let of = |point: &BodyPoint| point.nodes().iter().find(|(n, _)| *n == node).map_or(0.0, |(_, w)| *w);
        let other = match &self.b {
            TieEnd::Point(b) => of(b),
            TieEnd::Anchor { .. } => 0.0,
        };
        of(&self.a) - other
    }

    /// Nodes of both ends, each once.
    pub(crate) fn nodes(&self) -> Vec<usize> {
        let mut nodes = self.a.named();
        if let TieEnd::Point(b) = &self.b {
            nodes.extend(b.named());
        }
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Whether the anchor moves during the next advance.
    pub(crate) fn is_moving(&self) -> bool {
        matches!(self.b, TieEnd::Anchor { from_m, to_m } if from_m != to_m)
    }

    /// Ends the motion of the anchor.
    pub(crate) fn arrive(&mut self) {
        if let TieEnd::Anchor { from_m, to_m } = &mut self.b {
            *from_m = *to_m;
        }
    }

    /// Checks a tie that may come from a file: its nodes must exist, and its parameters must be valid.
    pub(crate) fn validate(&self, nodes: usize) -> Result<(), BodyError> {
        BodyPoint::new(self.a.nodes().to_vec())?;
        match &self.b {
            TieEnd::Point(b) => drop(BodyPoint::new(b.nodes().to_vec())?),
            TieEnd::Anchor { from_m, to_m } => {
                let finite = from_m.is_finite() && to_m.is_finite();
                check("place of an anchor, m", from_m.abs().max(to_m.abs()).max_element(), finite, "finite")?;
            }
        }
        if let TieKind::Thread { length_m, stiffness_n_per_m } = self.kind {
            check_positive("length of a thread, m", length_m)?;
            check_positive("stiffness of a thread, N/m", stiffness_n_per_m.unwrap_or(1.0))?;
        }
        if let Some(limit) = self.tear_limit_n {
            check_positive("tear limit of a tie, N", limit)?;
        }
        let of_b = match &self.b {
            TieEnd::Point(b) => b.nodes(),
            TieEnd::Anchor { .. } => &[],
        };
        match self.a.nodes().iter().chain(of_b).find(|(node, _)| *node >= nodes) {
            Some(&(node, _)) => Err(BodyError::InvalidNode { node, reason: "there is no such node" }),
            None => Ok(()),
        }
    }
}

fn anchor(at_m: DVec3) -> Result<TieEnd, BodyError> {
    check("place of an anchor, m", at_m.abs().max_element(), at_m.is_finite(), "finite")?;
    Ok(TieEnd::Anchor { from_m: at_m, to_m: at_m })
}
