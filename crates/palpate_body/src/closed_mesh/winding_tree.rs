//! Generalised winding numbers of triangles that need not close.

use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// Triangles in a hierarchy of boxes, for their generalised winding number (A. Jacobson, L. Kavan and O. Sorkine-Hornung, ACM Trans. Graph.
/// 32 (2013) 33). Distant groups are dipoles with their first derivatives (G. Barill and others, ACM Trans. Graph. 37 (2018) 43); near
/// triangles contribute their exact solid angle.
#[derive(Clone, Debug)]
pub(super) struct WindingTree {
    /// Corners, sorted so that each group is a range, m.
    triangles: Vec<[DVec3; 3]>,
    groups: Vec<Group>,
}

/// Triangles of a range.
#[derive(Clone, Debug)]
struct Group {
    begin: usize,
    end: usize,
    /// Index of the first of the two halves; 0 for a group that is not divided.
    halves: usize,
    /// Centre of area, m, and the distance from there to the farthest corner, m.
    center_m: DVec3,
    radius_m: f64,
    /// Σ a over the area vectors a of the triangles, m², and Σ a ⊗ (centroid − centre), m³.
    area_m2: DVec3,
    moment_m3: DMat3,
}

/// Maximum number of triangles of a group that is not divided.
const LEAF: usize = 8;
/// Distance from a group beyond which it is a dipole, in radii.
const FAR_RADII: f64 = 3.0;

impl WindingTree {
    pub(super) fn new(triangles: Vec<[DVec3; 3]>) -> Self {
        let mut tree = Self { triangles, groups: Vec::new() };
        if !tree.triangles.is_empty() {
            tree.groups.push(Group::of(&tree.triangles, 0, tree.triangles.len()));
            let mut undivided = vec![0];
            while let Some(index) = undivided.pop() {
                let (begin, end) = (tree.groups[index].begin, tree.groups[index].end);
                if end - begin <= LEAF {
                    continue;
                }
                let range = &mut tree.triangles[begin..end];
                let centroid = |t: &[DVec3; 3]| t[0] + t[1] + t[2];
                let low = range.iter().map(centroid).fold(DVec3::INFINITY, DVec3::min);
                let high = range.iter().map(centroid).fold(DVec3::NEG_INFINITY, DVec3::max);
                let axis = (high - low).max_position();
                let middle = range.len() / 2;
                range.select_nth_unstable_by(middle, |a, b| centroid(a)[axis].total_cmp(&centroid(b)[axis]));
                let halves = tree.groups.len();
                tree.groups.push(Group::of(&tree.triangles, begin, begin + middle));
                tree.groups.push(Group::of(&tree.triangles, begin + middle, end));
                tree.groups[index].halves = halves;
                undivided.extend([halves, halves + 1]);
            }
        }
        tree
    }

    /// Winding number around `place_m`. The error of the dipoles is below a hundredth.
    pub(super) fn winding(&self, place_m: DVec3) -> f64 {
        let mut sum = 0.0;
        self.visit(place_m, |group, is_far| {
            sum += if is_far {
                group.solid_angle(group.center_m - place_m)
            } else {
                solid_angle(&self.triangles[group.begin..group.end], place_m)
            };
        });
        sum / (2.0 * TAU)
    }

    /// Number of solid angles that [`WindingTree::winding`] adds.
    pub(super) fn term_count(&self, place_m: DVec3) -> usize {
        let mut count = 0;
        self.visit(place_m, |group, is_far| count += if is_far { 1 } else { group.end - group.begin });
        count
    }

    /// Calls `each` with every group that is a dipole at `place_m`, and with every other one that is not divided.
    fn visit(&self, place_m: DVec3, mut each: impl FnMut(&Group, bool)) {
        let mut open = [0_usize; 64];
        let mut count = usize::from(!self.groups.is_empty());
        while count > 0 {
            count -= 1;
            let group = &self.groups[open[count]];
            let is_far = (group.center_m - place_m).length_squared() > (FAR_RADII * group.radius_m).powi(2);
            if is_far || group.halves == 0 {
                each(group, is_far);
            } else {
                // Halving keeps the tree flat: two entries for each of at most 31 levels.
                (open[count], open[count + 1]) = (group.halves, group.halves + 1);
                count += 2;
            }
        }
    }
}

impl Group {
    fn of(triangles: &[[DVec3; 3]], begin: usize, end: usize) -> Self {
        let range = &triangles[begin..end];
        let area = |[a, b, c]: &[DVec3; 3]| 0.5 * (b - a).cross(c - a);
        let centroid = |[a, b, c]: &[DVec3; 3]| (a + b + c) / 3.0;
        let total: f64 = range.iter().map(|t| area(t).length()).sum();
        let center_m = if total > 0.0 {
            range.iter().map(|t| area(t).length() * centroid(t)).sum::<DVec3>() / total
        } else {
            centroid(&range[0])
        };
        let moment = |t: &[DVec3; 3]| {
            let (a, d) = (area(t), centroid(t) - center_m);
            DMat3::from_cols(a * d.x, a * d.y, a * d.z)
        };
        let far2 = range.iter().flatten().map(|x| x.distance_squared(center_m)).fold(0.0, f64::max);
        Self {
            begin,
            end,
            halves: 0,
            center_m,
            radius_m: far2.sqrt(),
            area_m2: range.iter().map(area).sum(),
            moment_m3: range.iter().map(moment).sum(),
        }
    }

    /// Solid angle of the group as a dipole at `away_m`: a·d/|d|³ and its derivative along the moments.
    fn solid_angle(&self, away_m: DVec3) -> f64 {
        let r2 = away_m.length_squared();
        let r3 = r2 * r2.sqrt();
        let trace = self.moment_m3.x_axis.x + self.moment_m3.y_axis.y + self.moment_m3.z_axis.z;
        let along = (self.moment_m3 * away_m).dot(away_m);
        self.area_m2.dot(away_m) / r3 + trace / r3 - 3.0 * along / (r3 * r2)
    }
}

/// Sum of the signed solid angles of triangles seen from `from_m` (A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125):
/// positive for a triangle that faces away. Half of each is the argument of a complex number. Numbers are multiplied as long as the sum of their
/// arguments is unambiguous, because a product takes much less time than an argument.
fn solid_angle(triangles: &[[DVec3; 3]], from_m: DVec3) -> f64 {
    let mut sum = 0.0;
    let (mut re, mut im) = (1.0_f64, 0.0_f64);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|x| x - from_m);
        let [la, lb, lc] = [a, b, c].map(DVec3::length);
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        let above = a.dot(b.cross(c));
        // Two arguments below π/2 have a sum below π.
        if re > 0.0 && below > 0.0 && re.abs() + im.abs() > TINY {
            (re, im) = (re * below - im * above, re * above + im * below);
        } else {
            sum += 2.0 * im.atan2(re);
            (re, im) = (below, above);
        }
    }
    sum + 2.0 * im.atan2(re)
}

/// Magnitude of a product far above that at which it loses digits.
const TINY: f64 = 1e-200;
