//! A soft slab with a wound, and its threads.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{ModelRate, SimulatedBody, Slit};
use palpate_body::{BodyPoint, SurfaceTree};

/// Height of the slab's top, m.
pub const TOP_M: f64 = 0.015;
/// Distance of the wound's edges at rest, m.
const OPENING_M: f64 = 0.010;
/// Positions of the stitches along the wound, m.
const STITCHES_M: [f64; 3] = [-0.014, 0.0, 0.014];
/// Distance of the stitches from the edge, m.
const INSET_M: f64 = 0.003;
/// Final length of the threads, m.
const TIGHT_M: f64 = 0.005;
/// Stiffness of a thread, N/m: an extension of a millimetre at 0.3 N.
pub const STIFFNESS_N_PER_M: f64 = 300.0;
/// Speed at which the threads are tightened, m/s: slow, to limit the change in a model step.
const TIGHTENED_M_PER_S: f64 = 0.005;

/// The slab: 12 by 3 by 12 cm, of 5 kPa, with a fixed bottom, cut along its middle.
pub fn slab() -> impl Bundle {
    (
        DeformableBody::block_of_size([13, 4, 13], DVec3::new(0.12, 2.0 * TOP_M, 0.12)),
        Tissue { youngs_modulus_pa: 5e3, damping: Damping::Ratio(0.6), ..default() },
        Slit { length_m: 0.06, depth_m: 0.02, opening_m: OPENING_M },
        FixedRegion::Face(BoxFace::Bottom),
    )
}

/// Positions of the wound's two edges at `along_m`, m: of the surface points that are nearest to them at rest.
pub fn edges_m(body: &SimulatedBody, along_m: f64) -> [DVec3; 2] {
    let body = body.body();
    [-0.5, 0.5].map(|side| {
        let edge = DVec3::new(side * OPENING_M, TOP_M, along_m);
        let apart = |point: &BodyPoint| point.of(body.network().rest_m()).distance(edge);
        let nearest = body.surface().points.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
        nearest.map_or(edge, |point| point.of(body.positions_m()))
    })
}

/// Three threads across the wound, with the present distance of their ends as length: without tension until they are tightened.
pub fn stitches(entity: Entity, body: &SimulatedBody, tear_limit_n: f64) -> Vec<Suture> {
    let surface = SurfaceTree::new(body.body());
    let pierced_m = |end_m: DVec3| {
        let closest = surface.closest(end_m, Suture::WITHIN_M);
        closest.map_or(end_m, |closest| closest.point_m)
    };
    let stitch = |&along_m: &f64| {
        let [left, right] = edges_m(body, along_m);
        let ends_m = [left - INSET_M * DVec3::X, right + INSET_M * DVec3::X];
        let [from_m, to_m] = ends_m.map(pierced_m);
        let length_m = from_m.distance(to_m).max(TIGHT_M);
        Suture { body: entity, ends_m, length_m, stiffness_n_per_m: STIFFNESS_N_PER_M, tear_limit_n }
    };
    STITCHES_M.iter().map(stitch).collect()
}

/// Tightens the threads while the tool holds nothing.
pub fn tighten(mut sutures: Query<&mut Suture>, tools: Query<&GraspedPoint>, rate: Res<ModelRate>) {
    if tools.iter().any(|grasped| grasped.body.is_some()) {
        return;
    }
    for mut suture in &mut sutures {
        if suture.length_m > TIGHT_M {
            suture.length_m = (suture.length_m - TIGHTENED_M_PER_S * rate.period_s()).max(TIGHT_M);
        }
    }
}
