//! A contact patch: the region in which a tool presses on a triangulated surface.
//!
//! A patch has one normal and one point, the pressure-weighted mean of the surface. Both change continuously as the
//! tool moves over triangles of any shape. The normal is that of a ring about one cell wide. The pressure acts on the
//! points of a disc, which are projected onto the surface.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod projection;

use crate::patch_surface::weighted;
use crate::{
    PRESSURE_POINTS, PatchSurface, Pressure, PressurePoint, SurfacePlace, ToolShape, nearest_weights,
};
use glam::{DQuat, DVec2, DVec3};
use projection::{Edges, Projected, Projection};
use std::f64::consts::FRAC_1_SQRT_2;

/// A contact patch of a tool on a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Patch {
    /// Place of the surface under the tool.
    pub foot: SurfacePlace,
    /// Outward unit normal of the surface, against which the tool pushes.
    pub normal: DVec3,
    /// Direction in which the tool is projected onto the surface. It is the normal, or, while the tool's middle is
    /// below the surface, the normal with which it entered.
    pub axis: DVec3,
    /// Offset from the tool's position to its deepest point along the normal, m.
    pub tip_m: DVec3,
    /// Normal force, averaged over some milliseconds, N.
    pub averaged_n: f64,
}

/// Start of the search for a patch: the patch of the previous step, or a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchStart {
    /// Place of the surface at which the search starts; see [`Patch::foot`].
    pub foot: SurfacePlace,
    /// Outward unit normal at the start; see [`Patch::normal`].
    pub normal: DVec3,
    /// Direction of projection at the start; see [`Patch::axis`].
    pub axis: DVec3,
    /// Contact radius, m.
    pub contact_m: f64,
    /// Averaged normal force, N; see [`Patch::averaged_n`].
    pub averaged_n: f64,
    /// Penetration depth in tool radii.
    pub depth_ratio: f64,
    is_new: bool,
}

impl PatchStart {
    /// Start at a place of a triangle with that normal.
    #[must_use]
    pub fn on(foot: SurfacePlace, normal: DVec3) -> Self {
        Self { foot, normal, axis: normal, contact_m: 0.0, averaged_n: 0.0, depth_ratio: 0.0, is_new: true }
    }
}

impl Patch {
    /// Averaged force after `span_s` seconds under a force of `force_n`, N.
    pub(crate) fn eased(&self, force_n: f64, span_s: f64) -> f64 {
        self.averaged_n + (force_n - self.averaged_n) * -(-span_s / EASING_S).exp_m1()
    }

    /// Start of the next step's search.
    pub(crate) fn after(&self, contact_m: f64, averaged_n: f64, depth_ratio: f64) -> PatchStart {
        let Self { foot, normal, axis, .. } = *self;
        PatchStart { foot, normal, axis, contact_m, averaged_n, depth_ratio, is_new: false }
    }
}

/// Scales and axes that a body gives to its contact patches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchScale {
    /// Side of a cell of the body, m.
    pub cell_m: f64,
    /// Minimum radius over which the pressure of a small contact is spread, m: [`PatchScale::SPREAD_CELLS`] cells, or
    /// 0.
    pub spread_m: f64,
    /// Three orthogonal unit vectors that rotate with the body. Tangential directions derive from them.
    pub axes: [DVec3; 3],
    /// Whether the cells soften under compression, as springs do.
    pub softens: bool,
}

impl PatchScale {
    /// Minimum radius in cells over which the pressure of a small contact is spread, on bodies with added compliance.
    /// It makes the force nearly independent of the position within a cell. Measured with balls of half a cell to two
    /// cells.
    pub const SPREAD_CELLS: f64 = 0.7;
}

/// Radius of the ring that defines the normal: in cells, or for wide contacts in contact radii plus cells. The ring
/// is wider than the contact, because within the contact the surface has the shape of the tool and does not define a
/// place.
const RING_CELLS: f64 = 1.2;
const RING_RADII: f64 = 1.3;
const RING_MORE_CELLS: f64 = 0.6;
const RING_POINTS: [DVec2; 8] = [
    DVec2::X,
    DVec2::splat(FRAC_1_SQRT_2),
    DVec2::Y,
    DVec2::new(-FRAC_1_SQRT_2, FRAC_1_SQRT_2),
    DVec2::NEG_X,
    DVec2::splat(-FRAC_1_SQRT_2),
    DVec2::NEG_Y,
    DVec2::new(FRAC_1_SQRT_2, -FRAC_1_SQRT_2),
];
/// Time constant of the averaged force that determines the softening of springs, s. In one tick the tissue hardly
/// moves, and an immediate feedback of the force would oscillate.
const EASING_S: f64 = 8e-3;
/// Iterations that alternate between foot and normal: of a new patch, and of an existing one.
const BALL_ROUNDS: [usize; 2] = [6, 2];
const PUNCH_ROUNDS: [usize; 2] = [3, 1];
/// Share of the new normal in an iteration of a ball after the first one. An iteration without relaxation multiplies the error of the normal
/// by −r/R, with the height r of the ball's middle and the radius of curvature R of the surface, and does not converge on a surface that is
/// more curved than the ball.
const RELAXATION: f64 = 0.5;
/// Change of the normal below which the iteration ends.
const NORMAL_TOLERANCE: f64 = 1e-12;
/// A foot further aside than this fraction of the tool's radius lies on an edge.
const ON_EDGE: f64 = 1e-9;
/// Minimum height of a ball's centre, as a fraction of its way above the surface, with which the normal turns over an
/// edge.
const MIN_HEIGHT: f64 = 0.5;
/// Points further beyond an edge than this fraction of the contact radius carry no pressure.
const FADE: f64 = 0.3;
/// Cosine of the angle to the other side of an edge at which a tool inside the body changes sides.
const CHANGE_SIDE_COSINE: f64 = 0.98;
/// Height of the tool's middle above the surface, as a fraction of its radius, at which the direction of projection
/// follows the normal.
const TURNING: f64 = 0.25;
/// Tilt angle, rad, at which a flat punch touches with its rim.
const TILT: f64 = 0.2;
/// Minimum fraction of the radius of a tilted punch that is in contact.
const RIM_SHARE: f64 = 0.25;
/// Rounding of the rim of a punch beyond an edge, as a fraction of its radius.
const RIM: f64 = 0.1;

/// Two unit vectors perpendicular to `normal` that rotate with the body: the two of the three `axes` that are least
/// along the normal, rotated as the third one is onto the normal.
fn tangents(normal: DVec3, axes: [DVec3; 3]) -> [DVec3; 2] {
    let [x, y, z] = axes;
    let along = axes.map(|axis| axis.dot(normal));
    let [along_x, along_y, along_z] = along;
    let [a, b, c] = along.map(f64::abs);
    let (from, sign, others) = if c >= a && c >= b {
        (z, along_z, [x, y])
    } else if a >= b {
        (x, along_x, [y, z])
    } else {
        (y, along_y, [z, x])
    };
    let turn = DQuat::from_rotation_arc(from * sign.signum(), normal);
    let [u, v] = others.map(|axis| turn * axis);
    // Counter-clockwise about the normal.
    if sign < 0.0 { [v, u] } else { [u, v] }
}

impl ToolShape {
    /// Offset from the tool's position to the middle of its possible contact with a surface of unit normal `normal`,
    /// m, and the distance of the surface from there along the normal, m. The deeper a punch is (`depth_ratio`, in radii),
    /// the less it touches with its rim.
    fn support(&self, normal: DVec3, depth_ratio: f64) -> (DVec3, f64) {
        match *self {
            Self::Sphere { radius_m } => (DVec3::ZERO, radius_m),
            Self::FlatPunch { radius_m, axis } => {
                let along = -normal.dot(axis);
                let aside = -normal - along * axis;
                // From the middle of the face to its rim as the punch tilts, and on to the end of its side.
                let tilt = TILT + depth_ratio;
                let rim = aside / (aside.length_squared() + tilt * tilt).sqrt();
                let behind = (0.5 - 0.5 * along / TILT).clamp(0.0, 1.0);
                let tip = radius_m * (rim - behind * axis);
                let (exact, least) = (aside.length() * radius_m, tip.dot(-normal));
                // The smoothed tip is slightly less deep than the rim.
                (tip, (exact + radius_m * (-along).max(0.0) - least).max(0.0))
            }
        }
    }

    /// Pressure distribution of the tool on a surface with unit normal `normal`, and its maximum radius, m.
    #[must_use]
    pub fn pressure(&self, normal: DVec3) -> (Pressure, f64) {
        match *self {
            Self::Sphere { radius_m } => (Pressure::Ball, radius_m),
            Self::FlatPunch { radius_m, axis } => {
                // A tilted punch touches with part of its rim.
                let aside = normal.reject_from(axis).length_squared();
                let share = 1.0 - (aside / (aside + TILT * TILT)).sqrt();
                (Pressure::Punch, radius_m * share.max(RIM_SHARE))
            }
        }
    }
}

/// Unit normal of a ring on the surface around a place, without the surface beyond sharp edges. Falls back to the
/// normal of the triangle if the ring has no area.
fn ring_normal<S: PatchSurface>(
    along: &mut Projection<'_, S>,
    (place, at_m): (SurfacePlace, DVec3),
    corners_m: [DVec3; 3],
    contact_m: f64,
    scale: &PatchScale,
) -> Option<DVec3> {
    let wide = RING_RADII * contact_m + RING_MORE_CELLS * scale.cell_m;
    let ring_m = wide.max(RING_CELLS * scale.cell_m);
    let middle = along.seen(at_m);
    // Each point starts from the one before.
    let mut near = place;
    let ring = RING_POINTS.map(|point| {
        let found = along.find(near, middle + ring_m * point).map(|found| found.place);
        near = found.unwrap_or(near);
        found.and_then(|found| along.at_m(found)).map_or(DVec3::ZERO, |found_m| found_m - at_m)
    });
    let next = ring.iter().cycle().skip(1);
    let area: DVec3 = ring.iter().zip(next).map(|(point, next)| point.cross(*next)).sum();
    // Twice the area of a degenerate ring.
    if area.length() > 1e-6 * ring_m * ring_m {
        return area.try_normalize();
    }
    let [a, b, c] = corners_m;
    (b - a).cross(c - a).try_normalize()
}

/// The triangle across a sharp edge under `place` whose normal is closer to `normal` than `base` is, and the place on
/// it.
fn over_crease(
    surface: &impl PatchSurface,
    (place, at_m): (SurfacePlace, DVec3),
    (normal, base): (DVec3, DVec3),
    least: f64,
) -> Option<SurfacePlace> {
    let edges = [(0, 2), (1, 0), (2, 1)];
    let beside = surface.neighbours(place.triangle);
    let on_edge =
        edges.into_iter().filter(|(_, opposite)| place.weights.get(*opposite).is_some_and(|w| *w <= 0.0));
    on_edge
        .filter_map(|(edge, _)| beside.get(edge).copied())
        .filter(|neighbour| neighbour.is_crease)
        .filter_map(|neighbour| {
            let triangle = neighbour.triangle? as usize;
            let corners @ [a, b, c] = surface.corners_m(triangle)?;
            let outward = (b - a).cross(c - a).try_normalize()?;
            let along = normal.dot(outward);
            let is_nearer = along > normal.dot(base).max(least);
            is_nearer.then_some(SurfacePlace { triangle, weights: nearest_weights(at_m, corners) })
        })
        .next()
}

impl Patch {
    /// The patch of a tool of `shape` at `center_m`, m, searched from `start`. `None` if the surface has no place
    /// there.
    #[must_use]
    pub fn find(
        surface: &impl PatchSurface,
        shape: &ToolShape,
        center_m: DVec3,
        start: &PatchStart,
        scale: &PatchScale,
    ) -> Option<Self> {
        let PatchStart { foot: start, normal, axis, contact_m, averaged_n, depth_ratio, is_new } = *start;
        let (mut foot, mut normal, mut is_on_edge) = (start, normal, false);
        let mut along = axis;
        let is_ball = matches!(shape, ToolShape::Sphere { .. });
        let [of_new, of_old] = if is_ball { BALL_ROUNDS } else { PUNCH_ROUNDS };
        for round in 0..if is_new { of_new } else { of_old } {
            let (reach, _) = shape.support(normal, depth_ratio);
            let middle = center_m + reach;
            let direction = (along, tangents(along, scale.axes));
            let mut seen = Projection::new(surface, Edges::Smooth, middle, direction);
            let Projected { place, off_m } = seen.find(foot, DVec2::ZERO)?;
            let corners_m = surface.corners_m(place.triangle)?;
            let at_m = weighted(place.weights, corners_m);
            foot = place;
            let base = ring_normal(&mut seen, (place, at_m), corners_m, contact_m, scale)?;
            let away = middle - at_m;
            let height = away.dot(base);
            let aside = away - height * base;
            let mut next = base;
            is_on_edge = off_m > ON_EDGE * shape.radius_m();
            if is_on_edge {
                let beyond_m = aside.length();
                if let ToolShape::Sphere { radius_m } = *shape {
                    // A ball rolls over the edge: the normal turns from that of one side to that of the other.
                    let least = MIN_HEIGHT * (radius_m - beyond_m).max(0.0);
                    next = (height.max(least) * base + aside).try_normalize().unwrap_or(base);
                    // A ball deep inside stays on its side until it has left.
                    let turned = if height >= 0.0 { -1.0 } else { CHANGE_SIDE_COSINE };
                    if let Some(other) = over_crease(surface, (place, at_m), (next, base), turned) {
                        foot = other;
                    }
                }
            }
            if is_ball && round > 0 {
                next = normal.lerp(next, RELAXATION).try_normalize().unwrap_or(next);
            }
            // Far below the surface a small rotation of the direction would lead to a different place.
            let level = match shape {
                ToolShape::Sphere { .. } => height,
                ToolShape::FlatPunch { radius_m, .. } => height + radius_m,
            };
            let free = (level / (TURNING * shape.radius_m())).clamp(0.0, 1.0);
            along = (axis * (1.0 - free) + next * free).try_normalize().unwrap_or(next);
            let change = next.distance(normal);
            normal = next;
            if change <= NORMAL_TOLERANCE {
                break;
            }
        }
        let (reach, depth) = shape.support(normal, depth_ratio);
        let raised = match *shape {
            ToolShape::FlatPunch { radius_m, axis } if is_on_edge => {
                let away = (surface.place_m(foot)? - center_m).reject_from_normalized(normal);
                let along = away.dot(axis);
                let aside = (away - along * axis).length();
                rim_m(aside - radius_m, radius_m) + rim_m(along, radius_m)
            }
            _ => 0.0,
        };
        Some(Self { foot, normal, axis: along, tip_m: reach - (depth - raised) * normal, averaged_n })
    }

    /// Two unit vectors perpendicular to the normal that rotate with the body.
    pub(crate) fn tangents(&self, scale: &PatchScale) -> [DVec3; 2] {
        tangents(self.normal, scale.axes)
    }

    /// Spreads the pressure of a contact of radius `radius_m` over the surface. Calls `add` with each place, its
    /// share of the force and its pressure point. The shares sum to 1.
    pub(crate) fn spread(
        &self,
        surface: &impl PatchSurface,
        (pressure, radius_m): (Pressure, f64),
        scale: &PatchScale,
        mut add: impl FnMut(SurfacePlace, f64, &PressurePoint),
    ) {
        let foot = surface.corners_m(self.foot.triangle).filter(|_| radius_m > 0.0);
        let Some(corners_m) = foot else { return add(self.foot, 1.0, &PressurePoint::MIDDLE) };
        // As seen from the foot along the normal.
        let direction = (self.normal, self.tangents(scale));
        let mut seen =
            Projection::new(surface, Edges::All, weighted(self.foot.weights, corners_m), direction);
        let mut sum = 0.0;
        let mut places = [(SurfacePlace::default(), 0.0, &PressurePoint::MIDDLE); PRESSURE_POINTS];
        for (to, (point, share)) in places.iter_mut().zip(pressure.points()) {
            let [x, y] = point.place;
            if let Some(Projected { place, off_m }) = seen.find(self.foot, radius_m * DVec2::new(x, y)) {
                // Points beyond an edge carry less, and further out nothing.
                let share = share * (1.0 - off_m / (FADE * radius_m)).max(0.0);
                *to = (place, share, point);
                sum += share;
            }
        }
        if sum > 0.0 {
            let kept = places.iter().filter(|(_, share, _)| *share > 0.0);
            kept.for_each(|(place, share, point)| add(*place, share / sum, point));
        } else {
            add(self.foot, 1.0, &PressurePoint::MIDDLE);
        }
    }
}

/// Height by which the rounded rim of a punch is raised at a place `beyond_m` beyond its end, m; unbounded far
/// outside.
fn rim_m(beyond_m: f64, radius_m: f64) -> f64 {
    let rounded = RIM * radius_m;
    let out = (beyond_m + rounded).clamp(0.0, rounded * (1.0 - 1e-9));
    rounded * out * out / (rounded * rounded - out * out)
}
