use super::*;
use std::collections::HashMap;

/// A square plate with `n` × `n` fields and a thickness, with a point at every corner of a field.
fn plate(n: usize, thickness_m: f64) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let m = n + 1;
    let at = |i: usize, j: usize, top: bool| i + m * j + if top { m * m } else { 0 };
    let mut points = Vec::new();
    for top in [0.0, thickness_m] {
        for j in 0..m {
            points.extend((0..m).map(|i| DVec3::new(i as f64, j as f64, 0.0) / n as f64 + top * DVec3::Z));
        }
    }
    let mut triangles = Vec::new();
    let mut quad = |a, b, c, d| triangles.extend([[a, b, c], [a, c, d]]);
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        quad(at(i, j, true), at(i + 1, j, true), at(i + 1, j + 1, true), at(i, j + 1, true));
        quad(at(i, j, false), at(i, j + 1, false), at(i + 1, j + 1, false), at(i + 1, j, false));
    }
    for i in 0..n {
        quad(at(i, 0, false), at(i + 1, 0, false), at(i + 1, 0, true), at(i, 0, true));
        quad(at(i + 1, n, false), at(i, n, false), at(i, n, true), at(i + 1, n, true));
        quad(at(0, i + 1, false), at(0, i, false), at(0, i, true), at(0, i + 1, true));
        quad(at(n, i, false), at(n, i + 1, false), at(n, i + 1, true), at(n, i, true));
    }
    (points, triangles)
}

/// Whether every directed edge occurs as often as its reverse.
fn is_closed(triangles: &[[usize; 3]]) -> bool {
    let mut balance = HashMap::new();
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *balance.entry((from.min(to), from.max(to))).or_insert(0) += if from < to { 1 } else { -1 };
        }
    }
    balance.values().all(|sum| *sum == 0)
}

fn volume(triangles: &[[usize; 3]], points: &[DVec3]) -> f64 {
    let of = |t: &[usize; 3]| {
        let [a, b, c] = t.map(|p| points[p]);
        a.dot(b.cross(c)) / 6.0
    };
    triangles.iter().map(of).sum()
}

fn clustered(triangles: &[[usize; 3]], points: &[DVec3], spacing: f64) -> cluster::Clustered {
    let normals: Vec<DVec3> =
        vertex_normals(triangles, points).iter().map(|n| n.normalize_or_zero()).collect();
    cluster::cluster(triangles, points, &normals, &vec![spacing; points.len()])
}

#[test]
fn two_sides_of_a_thin_plate_stay_separate() {
    let (points, triangles) = plate(40, 0.01);
    let made = clustered(&triangles, &points, 0.1);
    let kept: Vec<DVec3> = made.kept.iter().map(|&p| points[p]).collect();
    assert!(is_closed(&made.triangles));
    assert!(made.kept.len() < points.len() / 8, "{} of {}", made.kept.len(), points.len());
    // Clustering rounds the corners of the plate by at most the spacing; the thickness is unchanged.
    let volume = volume(&made.triangles, &kept);
    assert!(volume > 0.85 * 0.01 && volume <= 0.01 + 1e-12, "{volume}");
    for (i, a) in kept.iter().enumerate() {
        let near = kept[..i].iter().filter(|b| b.z == a.z).map(|b| a.distance(*b));
        assert!(near.fold(1.0, f64::min) >= 0.1 - 1e-12);
    }
    assert!(deviation(&points, &made.triangles, &kept) < 0.1);
}

#[test]
fn coarse_surface_is_kept_and_long_edges_are_halved() {
    let (mut points, triangles) = plate(1, 0.5);
    let made = clustered(&triangles, &points, 0.1);
    assert_eq!(made.kept, (0..8).collect::<Vec<_>>());
    assert_eq!(made.triangles.len(), 12);
    assert_eq!(deviation(&points, &made.triangles, &points), 0.0);
    let finer = subdivide::subdivide(made.triangles, &mut points, 0.26);
    assert!(is_closed(&finer));
    assert!((volume(&finer, &points) - 0.5).abs() < 1e-14);
    for [a, b, c] in &finer {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            assert!(points[*a].distance(points[*b]) <= 0.26);
        }
    }
}

#[test]
fn clustered_plate_has_no_slivers_and_no_folds() {
    let mut slivers = 0;
    for (n, spacing) in [(20, 0.1), (24, 0.1), (24, 0.13), (33, 0.1), (40, 0.11)] {
        let (points, triangles) = plate(n, 0.3);
        let normals: Vec<DVec3> =
            vertex_normals(&triangles, &points).iter().map(|n| n.normalize_or_zero()).collect();
        let mut made = clustered(&triangles, &points, spacing);
        let kept: Vec<DVec3> = made.kept.iter().map(|&p| points[p]).collect();
        let kept_normals: Vec<DVec3> = made.kept.iter().map(|&p| normals[p]).collect();
        // Area along the mean normal, divided by the square of the longest edge.
        let shape = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|p| kept[p]);
            let normal = t.iter().map(|&p| kept_normals[p]).sum::<DVec3>().normalize();
            let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
            0.5 * (b - a).cross(c - a).dot(normal) / longest
        };
        slivers += made.triangles.iter().filter(|t| shape(t) < 0.01).count();
        let before = volume(&made.triangles, &kept);
        let (edges, count) = (edge_count(&made.triangles), made.triangles.len());
        flip::flip(&mut made.triangles, &kept, &kept_normals);
        assert!(is_closed(&made.triangles));
        assert_eq!((edge_count(&made.triangles), made.triangles.len()), (edges, count));
        let is_on_top = |t: &&[usize; 3]| t.iter().all(|&p| kept[p].z > 0.0);
        let poorest = made.triangles.iter().filter(is_on_top).map(shape).fold(f64::INFINITY, f64::min);
        assert!(poorest > 0.01, "{n}, {spacing}: {poorest}");
        let after = volume(&made.triangles, &kept);
        assert!((after / before - 1.0).abs() < 0.02, "{before} m³, {after} m³");
    }
    assert!(slivers > 0);
}

/// Number of different edges.
fn edge_count(triangles: &[[usize; 3]]) -> usize {
    let edges = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    edges.map(|(a, b)| (a.min(b), a.max(b))).collect::<std::collections::HashSet<_>>().len()
}
