//! The surface of a near field: the triangles on which the tool may touch, and those beside them.

use super::support::SupportSet;
use crate::ReduceError;
use glam::DVec3;
use palpate_body::{Body, Grid, ToolContact};
use palpate_laws::{MAX_PATCHES, Neighbour, PATCH_ROWS, Patch, SurfacePlace};
use palpate_local::{LocalModelError, NearField, NearPatch, NearPoint, NearTriangle};
use std::collections::HashMap;

/// How far a hand at 15 m/s comes in a tenth of a second, m: triangles farther away are not known to the loop.
const MAX_WAY_M: f64 = 1.5;

/// Writes the surface of S and about it, and the patches that the tool touches, into `field`, whose nodes and ring are written; the tool is
/// at `at_m`.
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
    let places: HashMap<usize, usize> =
        support.nodes.iter().chain(ring).enumerate().map(|(place, &node)| (node, place)).collect();
    let surface = body.contact_surface();
    let room = field.capacity();
    // Those of S first: they must find room. Then the nearest to the tool, which it may come to before the next hand-over.
    let mut triangles = support.triangles.clone();
    let places_m: Vec<DVec3> = surface.points().iter().map(|point| point.of(x)).collect();
    let middle = |triangle: usize| -> DVec3 {
        surface.triangles()[triangle].iter().map(|&point| places_m[point]).sum::<DVec3>() / 3.0
    };
    let mut near: Vec<(f64, usize)> = (0..surface.triangles().len())
        .map(|triangle| (middle(triangle).distance(at_m), triangle))
        .filter(|(distance_m, triangle)| *distance_m < MAX_WAY_M && !support.triangles.contains(triangle))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    triangles.extend(near.into_iter().map(|(_, triangle)| triangle).take(room.triangles));
    let mut place_of_point: HashMap<usize, usize> = HashMap::new();
    let mut place_of_triangle: HashMap<usize, u32> = HashMap::new();
    for triangle in triangles {
        let corners = surface.triangles()[triangle];
        let new = corners.iter().filter(|point| !place_of_point.contains_key(point)).count();
        let is_of_support = field.triangles < support.triangles.len();
        let mut nodes = corners.iter().flat_map(|&point| surface.points()[point].nodes());
        let is_reachable = is_of_support || nodes.all(|(node, _)| body.network().is_fixed(*node));
        if field.triangles == room.triangles || field.points + new > room.points {
            if is_of_support {
                let (found, room) = (field.points + new, room.points);
                return Err(LocalModelError::Room { what: "points of the surface", found, room }.into());
            }
            continue;
        }
        let points = corners.map(|point| {
            *place_of_point.entry(point).or_insert_with(|| {
                let mut to = NearPoint {
                    modulus_pa: body.contact_modulus_pa(point).unwrap_or(0.0),
                    ..NearPoint::default()
                };
                let mut free = to.nodes.iter_mut();
                for &(node, w) in surface.points()[point].nodes() {
                    match places.get(&node) {
                        Some(&place) => {
                            if let Some(to) = free.next() {
                                *to = (place, w);
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
        place_of_triangle.insert(triangle, field.triangles as u32);
        let rest_normal = surface.rest_normal(triangle);
        field.triangle[field.triangles] =
            NearTriangle { points, neighbours: Default::default(), rest_normal, is_reachable };
        field.triangles += 1;
    }
    for (&triangle, &place) in &place_of_triangle {
        let local = |Neighbour { triangle, is_crease }: Neighbour| {
            let triangle = triangle.and_then(|triangle| place_of_triangle.get(&(triangle as usize)).copied());
            Neighbour { triangle, is_crease }
        };
        field.triangle[place as usize].neighbours = surface.neighbours(triangle).map(local);
    }
    for touched in contact.touched().chunk_by(|a, b| a.patch == b.patch).take(MAX_PATCHES) {
        let Some(first) = touched.first() else { continue };
        let SurfacePlace { triangle, weights } = first.patch.foot;
        let Some(&place) = place_of_triangle.get(&triangle) else { continue };
        let mut row_n = [0.0; PATCH_ROWS];
        let mut force_n = [DVec3::ZERO; PATCH_ROWS];
        for row in touched {
            (row_n[row.row], force_n[row.row]) = (row.pressing_n(), row.force_n());
        }
        let foot = SurfacePlace { triangle: place as usize, weights };
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
