//! Orientation of the triangles of a surface.

use crate::{BodyError, Network, Surface};
use glam::DVec3;
use std::collections::{BTreeMap, HashMap};
use std::f64::consts::TAU;

/// Minimum cosine between a triangle's normal and the direction to the tissue, averaged over springs, for an
/// unambiguous side.
const CLEAR_COSINE: f64 = 0.1;
/// Minimum share of a part's area with tissue on the same side, and maximum share of that area with tissue on the
/// other side.
const CLEAR_AREA: (f64, f64) = (0.6, 0.1);
/// Minimum volume of a closed part, as a multiple of its area to the power 3/2.
const MIN_VOLUME: f64 = 1e-9;
/// Maximum number of places of a part that are tested for being within another part.
const MAX_PLACES: usize = 8;
/// Winding numbers below which a place is outside, and above which it is inside.
const CLEAR_WINDING: (f64, f64) = (0.1, 0.9);

/// One side of a triangle.
struct Side {
    /// Lower and higher point of the edge.
    edge: (usize, usize),
    triangle: usize,
    /// +1 if the triangle runs from the lower to the higher point, else −1.
    sign: i32,
}

/// A part of a surface: triangles connected by edges of two triangles each.
#[derive(Default)]
struct Part {
    triangles: Vec<usize>,
    /// Whether it has no boundary, once its triangles are consistent.
    is_closed: bool,
    area_m2: f64,
    volume_m3: f64,
    low_m: DVec3,
    high_m: DVec3,
}

/// A surface at rest, in consistently oriented parts.
struct Parts<'a> {
    surface: &'a Surface,
    network: &'a Network,
    /// Position of each point at rest, m.
    x: Vec<DVec3>,
    /// Whether each triangle was flipped.
    is_turned: Vec<bool>,
    parts: Vec<Part>,
    /// An identifier of the connected sheet of every node that carries triangles.
    sheet: Vec<Option<usize>>,
}

impl Surface {
    /// Flips triangles to face away from the tissue; see [`crate::Body::new`]. The order of the triangles and the
    /// first vertex of each stay.
    ///
    /// # Errors
    /// [`BodyError::OneSidedSurface`].
    pub(crate) fn facing_outward(mut self, network: &Network) -> Result<Self, BodyError> {
        let mut parts = Parts::new(&self, network)?;
        for index in 0..parts.parts.len() {
            let is_inward = parts.is_inward_by_tissue(index).or_else(|| parts.is_inward_by_volume(index));
            let Part { triangles, .. } = &parts.parts[index];
            let is_wrong = is_inward.unwrap_or_else(|| {
                // Neither side is inside: keep the majority of the given windings.
                2 * triangles.iter().filter(|&&t| parts.is_turned[t]).count() > triangles.len()
            });
            if is_wrong {
                triangles.iter().for_each(|&t| parts.is_turned[t] ^= true);
            }
        }
        let is_turned = parts.is_turned;
        self.triangles.iter_mut().zip(is_turned).filter(|(_, is)| *is).for_each(|(t, _)| t.swap(1, 2));
        Ok(self)
    }
}

impl<'a> Parts<'a> {
    fn new(surface: &'a Surface, network: &'a Network) -> Result<Self, BodyError> {
        let count = surface.triangles.len();
        let sides = sides(surface);
        let mut beside: Vec<Vec<(usize, bool)>> = vec![Vec::new(); count];
        let mut has_edges = vec![false; count];
        for group in sides.chunk_by(|a, b| a.edge == b.edge) {
            group.iter().for_each(|side| has_edges[side.triangle] = true);
            if let [a, b] = group {
                beside[a.triangle].push((b.triangle, a.sign != b.sign));
                beside[b.triangle].push((a.triangle, a.sign != b.sign));
            }
        }
        let mut turned: Vec<Option<bool>> = vec![None; count];
        let mut part_of = vec![usize::MAX; count];
        let mut parts: Vec<Part> = Vec::new();
        for start in (0..count).filter(|&t| has_edges[t]) {
            if turned[start].is_some() {
                continue;
            }
            turned[start] = Some(false);
            let (mut front, mut triangles) = (vec![start], Vec::new());
            while let Some(triangle) = front.pop() {
                part_of[triangle] = parts.len();
                triangles.push(triangle);
                let own = turned[triangle].unwrap_or_default();
                for &(other, agree) in &beside[triangle] {
                    match turned[other] {
                        None => {
                            turned[other] = Some(own == agree);
                            front.push(other);
                        }
                        Some(is) if is != (own == agree) => {
                            return Err(BodyError::OneSidedSurface { triangle: other });
                        }
                        Some(_) => {}
                    }
                }
            }
            triangles.sort_unstable();
            parts.push(Part { triangles, is_closed: true, ..Part::default() });
        }
        let is_turned: Vec<bool> = turned.into_iter().map(Option::unwrap_or_default).collect();
        // A part is closed if its triangles run along every edge equally often in both directions.
        for group in sides.chunk_by(|a, b| a.edge == b.edge) {
            let mut sums = BTreeMap::new();
            for side in group {
                let sign = if is_turned[side.triangle] { -side.sign } else { side.sign };
                *sums.entry(part_of[side.triangle]).or_insert(0) += sign;
            }
            sums.into_iter().for_each(|(part, sum)| parts[part].is_closed &= sum == 0);
        }
        let x = surface.points.iter().map(|point| point.of(network.rest_m())).collect();
        let mut made =
            Self { surface, network, x, is_turned, parts: Vec::new(), sheet: sheets(surface, network) };
        for part in &mut parts {
            made.measure(part);
        }
        made.parts = parts;
        Ok(made)
    }

    /// Corners of a triangle at rest, m, in its current winding.
    fn corners_m(&self, triangle: usize) -> [DVec3; 3] {
        let [a, b, c] = self.surface.corners(triangle).map(|point| self.x[point]);
        if self.is_turned[triangle] { [a, c, b] } else { [a, b, c] }
    }

    fn measure(&self, part: &mut Part) {
        let Some(&first) = part.triangles.first() else { return };
        let origin = self.corners_m(first)[0];
        (part.low_m, part.high_m) = (origin, origin);
        for &triangle in &part.triangles {
            let [a, b, c] = self.corners_m(triangle);
            part.area_m2 += 0.5 * (b - a).cross(c - a).length();
            part.volume_m3 += (a - origin).dot((b - origin).cross(c - origin)) / 6.0;
            part.low_m = part.low_m.min(a).min(b).min(c);
            part.high_m = part.high_m.max(a).max(b).max(c);
        }
    }

    /// Whether a part faces the tissue, if that is unambiguous: nodes joined to its own by springs, and not part of
    /// it or of a sheet that touches it, lie mostly on one side. Points of a closed part within a cell are ignored,
    /// because the nodes of their cell lie on both sides.
    fn is_inward_by_tissue(&self, part: usize) -> Option<bool> {
        let Part { triangles, is_closed, area_m2, .. } = &self.parts[part];
        let points = &self.surface.points;
        let [mut before, mut behind] = [0.0; 2];
        for &triangle in triangles {
            let corners = self.surface.corners(triangle).map(|point| &points[point]);
            if *is_closed && corners.iter().any(|point| point.nodes().len() > 1) {
                continue;
            }
            let [a, b, c] = self.corners_m(triangle);
            let (center, twice_area) = ((a + b + c) / 3.0, (b - a).cross(c - a));
            let normal = twice_area.normalize_or_zero();
            let (mut sum, mut count) = (0.0, 0);
            for &(node, _) in corners.iter().flat_map(|point| point.nodes()) {
                let sheet = self.sheet[node];
                for other in self.network.neighbours(node).filter(|&other| self.sheet[other] != sheet) {
                    sum += normal.dot((self.network.rest_m()[other] - center).normalize_or_zero());
                    count += 1;
                }
            }
            let cosine = if count > 0 { sum / f64::from(count) } else { 0.0 };
            let area = 0.5 * twice_area.length();
            if cosine > CLEAR_COSINE {
                before += area;
            } else if cosine < -CLEAR_COSINE {
                behind += area;
            }
        }
        let (most, other) = CLEAR_AREA;
        if before.max(behind) < most * area_m2 || before.min(behind) > other * before.max(behind) {
            return None;
        }
        (before != behind).then_some(before > behind)
    }

    /// Whether a closed part faces its interior; the reverse for a cavity, which lies within an odd number of other
    /// parts.
    fn is_inward_by_volume(&self, part: usize) -> Option<bool> {
        let own = &self.parts[part];
        if !own.is_closed || own.volume_m3.abs() <= MIN_VOLUME * own.area_m2.powf(1.5) {
            return None;
        }
        let mut is_cavity = false;
        for (index, other) in self.parts.iter().enumerate() {
            if index == part || !other.is_closed || !meet(own, other) {
                continue;
            }
            is_cavity ^= self.is_within(own, other)?;
        }
        Some((own.volume_m3 < 0.0) != is_cavity)
    }

    /// Whether `part` lies within `other`, if that is unambiguous.
    fn is_within(&self, part: &Part, other: &Part) -> Option<bool> {
        let step = part.triangles.len().div_ceil(MAX_PLACES).max(1);
        let (mut sum, mut count) = (0.0, 0);
        for &triangle in part.triangles.iter().step_by(step) {
            let place = self.corners_m(triangle).into_iter().sum::<DVec3>() / 3.0;
            let angles = other.triangles.iter().map(|&t| solid_angle(self.corners_m(t).map(|x| x - place)));
            sum += (angles.sum::<f64>() / (2.0 * TAU)).abs();
            count += 1;
        }
        let (outside, inside) = CLEAR_WINDING;
        let winding = sum / f64::from(count.max(1));
        (winding < outside || winding > inside).then_some(winding > inside)
    }
}

/// For every node that carries triangles, the first node of its connected sheet.
fn sheets(surface: &Surface, network: &Network) -> Vec<Option<usize>> {
    let mut joined: Vec<usize> = (0..network.node_count()).collect();
    let first_of = |joined: &mut Vec<usize>, mut node: usize| {
        while joined[node] != node {
            joined[node] = joined[joined[node]];
            node = joined[node];
        }
        node
    };
    let mut carries = vec![false; network.node_count()];
    for triangle in 0..surface.triangles.len() {
        let mut earlier = None;
        for point in surface.corners(triangle) {
            for &(node, _) in surface.points[point].nodes() {
                carries[node] = true;
                let own = first_of(&mut joined, node);
                let other = first_of(&mut joined, earlier.unwrap_or(node));
                joined[own.max(other)] = own.min(other);
                earlier = Some(node);
            }
        }
    }
    (0..joined.len()).map(|node| carries[node].then(|| first_of(&mut joined, node))).collect()
}

/// Whether the bounding boxes of two parts overlap.
fn meet(a: &Part, b: &Part) -> bool {
    a.low_m.cmple(b.high_m).all() && b.low_m.cmple(a.high_m).all()
}

/// Signed solid angle of a triangle seen from the origin (A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng.
/// 30 (1983) 125).
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let [x, y, z] = [a, b, c].map(DVec3::length);
    2.0 * a.dot(b.cross(c)).atan2(x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y)
}

/// Sides of all non-degenerate triangles, sorted by edge. Points with the same nodes and weights count as one.
fn sides(surface: &Surface) -> Vec<Side> {
    let mut first: HashMap<Vec<(usize, u64)>, usize> = HashMap::with_capacity(surface.points.len());
    let point_of: Vec<usize> = (surface.points.iter().enumerate())
        .map(|(index, point)| {
            let mut key: Vec<_> = point.nodes().iter().map(|&(node, w)| (node, w.to_bits())).collect();
            key.sort_unstable();
            *first.entry(key).or_insert(index)
        })
        .collect();
    let mut sides = Vec::with_capacity(3 * surface.triangles.len());
    for triangle in 0..surface.triangles.len() {
        let t = surface.corners(triangle).map(|point| point_of[point]);
        if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
            continue;
        }
        for corner in 0..3 {
            let (a, b) = (t[corner], t[(corner + 1) % 3]);
            let sign = if a < b { 1 } else { -1 };
            sides.push(Side { edge: (a.min(b), a.max(b)), triangle, sign });
        }
    }
    sides.sort_unstable_by_key(|side| (side.edge, side.triangle));
    sides
}
