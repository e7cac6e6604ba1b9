//! The surface of a near field: the triangles of S, the nearest others, and the contact patches.

use super::support::SupportSet;
use crate::ReduceError;
use glam::DVec3;
use palpate_body::{Body, Grid, ToolContact};
use palpate_laws::{MAX_PATCHES, Neighbour, PATCH_ROWS, Patch, SurfacePlace};
use palpate_local::{LocalModelError, NearField, NearPatch, NearPoint, NearTriangle};
use std::collections::{HashMap, HashSet};

/// Maximum distance of a triangle from the tool, m: a tool at 15 m/s travels it in 0.1 s.
const MAX_DISTANCE_M: f64 = 1.5;

/// Writes the surface and the contact patches into `field`, whose nodes and ring have been written. The tool is at `at_m`.
pub(super) fn write(
    body: &Body,
    contact: &ToolContact,
    (support, ring): (&SupportSet, &[usize]),
    at_m: DVec3,
    field: &mut NearField,
) -> Result<(), ReduceError> {
    (field.points, field.triangles, field.contact.count) = (0, 0, 0);
    if contact.shape().is_none() {
        return Ok(());
    }
    field.contact.scale = body.patch_scale();
    field.contact.poissons_ratio = body.network().grid().map_or(0.0, Grid::poissons_ratio);
    field.contact.adds_compliance = body.adds_compliance();
    let s = support.nodes.len();
    if field.contact.adds_compliance {
        for (i, &a) in support.nodes.iter().enumerate() {
            for (j, &b) in support.nodes.iter().enumerate() {
                field.compliance[s * i + j] = body.grid_compliance_per_m(a, b).unwrap_or(0.0);
            }
        }
    }
    let x = body.positions_m();
    let local_node: HashMap<usize, usize> =
        support.nodes.iter().chain(ring).enumerate().map(|(index, &node)| (node, index)).collect();
    let surface = body.contact_surface();
    let capacity = field.capacity();
    // The triangles of S, which must fit, then those nearest to the tool, which it may reach before the next hand-over.
    let mut triangles = support.triangles.clone();
    let points_m: Vec<DVec3> = surface.points().iter().map(|point| point.of(x)).collect();
    let centroid = |triangle: usize| -> DVec3 {
        surface.triangles()[triangle].iter().map(|&point| points_m[point]).sum::<DVec3>() / 3.0
    };
    let mut near: Vec<(f64, usize)> = (0..surface.triangles().len())
        .map(|triangle| (centroid(triangle).distance(at_m), triangle))
        .filter(|(distance_m, triangle)| {
            *distance_m < MAX_DISTANCE_M && !support.triangles.contains(triangle)
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    triangles.extend(near.into_iter().map(|(_, triangle)| triangle).take(capacity.triangles));
    let mut points: HashSet<usize> = HashSet::new();
    let mut chosen: Vec<(usize, bool)> = Vec::new();
    for (rank, triangle) in triangles.into_iter().enumerate() {
        let corners = surface.triangles()[triangle];
        let new = corners.iter().filter(|point| !points.contains(point)).count();
        let is_of_support = rank < support.triangles.len();
        if chosen.len() == capacity.triangles || points.len() + new > capacity.points {
            if is_of_support {
                let (found, capacity) = (points.len() + new, capacity.points);
                return Err(
                    LocalModelError::Capacity { what: "points of the surface", found, capacity }.into()
                );
            }
            continue;
        }
        points.extend(corners);
        chosen.push((triangle, is_of_support));
    }
    // Of places on a common edge both sides choose the triangle with the lower number, so the order is that of the body.
    chosen.sort_unstable();
    let mut local_point: HashMap<usize, usize> = HashMap::new();
    let mut local_triangle: HashMap<usize, u32> = HashMap::new();
    for (triangle, is_of_support) in chosen {
        let corners = surface.triangles()[triangle];
        let mut nodes = corners.iter().flat_map(|&point| surface.points()[point].nodes());
        let is_reachable = is_of_support || nodes.all(|(node, _)| body.network().is_fixed(*node));
        let points = corners.map(|point| {
            *local_point.entry(point).or_insert_with(|| {
                let mut to = NearPoint {
                    modulus_pa: body.contact_modulus_pa(point).unwrap_or(0.0),
                    ..NearPoint::default()
                };
                let mut free = to.nodes.iter_mut();
                for &(node, w) in surface.points()[point].nodes() {
                    match local_node.get(&node) {
                        Some(&index) => {
                            if let Some(to) = free.next() {
                                *to = (index, w);
                            }
                        }
                        None => to.fixed_m += w * x[node],
                    }
                }
                field.point[field.points] = to;
                field.points += 1;
                field.points - 1
            })
        });
        local_triangle.insert(triangle, field.triangles as u32);
        let rest_normal = surface.rest_normal(triangle);
        field.triangle[field.triangles] =
            NearTriangle { points, neighbours: Default::default(), rest_normal, is_reachable };
        field.triangles += 1;
    }
    for (&triangle, &index) in &local_triangle {
        let local = |Neighbour { triangle, is_crease }: Neighbour| {
            let triangle = triangle.and_then(|triangle| local_triangle.get(&(triangle as usize)).copied());
            Neighbour { triangle, is_crease }
        };
        field.triangle[index as usize].neighbours = surface.neighbours(triangle).map(local);
    }
    for touched in contact.touched().chunk_by(|a, b| a.patch == b.patch).take(MAX_PATCHES) {
        let Some(first) = touched.first() else { continue };
        let SurfacePlace { triangle, weights } = first.patch.foot;
        let Some(&index) = local_triangle.get(&triangle) else { continue };
        let mut row_n = [0.0; PATCH_ROWS];
        let mut force_n = [DVec3::ZERO; PATCH_ROWS];
        for row in touched {
            (row_n[row.row], force_n[row.row]) = (row.pressing_n(), row.force_n());
        }
        let foot = SurfacePlace { triangle: index as usize, weights };
        field.contact.patches[field.contact.count] = NearPatch {
            patch: Patch { foot, ..first.patch },
            rest_normal: first.rest_normal,
            row_n,
            force_n,
        };
        field.contact.count += 1;
    }
    Ok(())
}
