//! Search of the points of a body that may touch an obstacle.

use super::Body;
use super::obstacle_candidates::ObstacleCandidates;
use super::substep::Substep;
use glam::DVec3;

/// Distance up to which pairs are searched: in steps at the current speed, plus a share of the spacing of the points.
const MARGIN_STEPS: f64 = 4.0;
const MARGIN_SPACINGS: f64 = 0.1;

impl Body {
    /// Searches the candidates if the current ones do not cover this step with the node velocities `v`. Returns whether
    /// they were searched.
    pub(super) fn update_candidates(&mut self, step: &Substep<'_>, v: &[DVec3]) -> bool {
        let step_m = self.max_approach_m(step, v);
        let searches = !self.candidates.covers(step_m);
        if searches {
            let margin_m = MARGIN_STEPS * step_m + MARGIN_SPACINGS * self.obstacle_points.spacing_m;
            self.search_candidates(step, margin_m);
        }
        self.candidates.step_m = step_m;
        searches
    }

    /// Whether a point may touch an obstacle in this step.
    pub(super) fn is_near_obstacle(&mut self, step: &Substep<'_>) -> bool {
        let v = std::mem::take(&mut self.v);
        self.update_candidates(step, &v);
        self.v = v;
        !self.candidates.pairs.is_empty()
    }

    /// Upper bound of the approach of any point and obstacle in this step with the node velocities `v`, m.
    pub(super) fn max_approach_m(&self, step: &Substep<'_>, v: &[DVec3]) -> f64 {
        // Four independent maxima take half the time of one.
        let mut fastest2 = [0.0_f64; 4];
        for four in v.chunks(4) {
            for (most, v) in fastest2.iter_mut().zip(four) {
                let speed2 = v.length_squared();
                *most = if speed2 > *most { speed2 } else { *most };
            }
        }
        let fastest2 = fastest2.into_iter().fold(0.0, f64::max);
        let of_points_m = step.h * self.obstacle_points.max_speed_ratio * fastest2.sqrt();
        let is_moving = step.obstacles.iter().any(|of| of.rigid.is_some() || of.from != of.to);
        if !is_moving {
            return of_points_m;
        }
        let (center_m, half_m) = bounds(&self.x);
        let radius_m = half_m.length() * self.obstacle_points.max_speed_ratio;
        let of_obstacle = step.obstacles.iter().map(|of| of.max_displacement_m(center_m, radius_m, step.h));
        of_points_m + of_obstacle.fold(0.0, f64::max)
    }

    fn search_candidates(&mut self, step: &Substep<'_>, margin_m: f64) {
        let mut found = ObstacleCandidates { safe_m: f64::INFINITY, ..ObstacleCandidates::default() };
        let places_m: Vec<DVec3> =
            self.obstacle_points.points.iter().map(|point| point.of(&self.x)).collect();
        let (center_m, half_m) = bounds(&places_m);
        let driven = step.drive.map(|(node, _)| node);
        let is_movable = |&(node, _): &(usize, f64)| !self.network.is_fixed(node) && driven != Some(node);
        for (obstacle, what) in self.obstacles.iter().enumerate() {
            let of = &step.obstacles[obstacle];
            let apart_m = what.box_gap_m(&of.from, center_m, half_m);
            if apart_m > margin_m {
                found.safe_m = found.safe_m.min(apart_m);
                continue;
            }
            found.safe_m = found.safe_m.min(margin_m);
            for (point, &at_m) in places_m.iter().enumerate() {
                let gap_m = what.gap_at(&of.from, at_m, margin_m);
                let moves = || self.obstacle_points.points[point].nodes().iter().any(is_movable);
                if gap_m.is_some_and(|(gap_m, _)| gap_m <= margin_m) && (of.rigid.is_some() || moves()) {
                    found.pairs.push((point, obstacle));
                }
            }
        }
        found.pairs.sort_unstable();
        self.candidates = found;
    }
}

/// Centre and half sides of the box around `places_m`, m.
fn bounds(places_m: &[DVec3]) -> (DVec3, DVec3) {
    let low = places_m.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = places_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    (0.5 * (low + high), 0.5 * (high - low))
}
