//! How much a near field of a body may hold.

use crate::BuilderOptions;
use palpate_body::{Body, ToolContact};
use palpate_local::NearFieldCapacity;
use std::collections::BTreeSet;

/// The room that near fields of `body` with support sets of `nodes` and bases of `order` need.
pub(crate) fn capacity(body: &Body, nodes: usize, order: usize) -> NearFieldCapacity {
    let network = body.network();
    let degree = network.free().iter().map(|&node| network.incident_links(node).len()).max().unwrap_or(0);
    let springs = (nodes * degree).min(network.links().len());
    let surface = body.contact_surface();
    let points = surface.points().len().min(POINTS_OF_A_NODE * nodes + POINTS_BESIDE);
    NearFieldCapacity {
        nodes,
        order: order.min(3 * network.free().len()),
        ring: springs.min(network.node_count()),
        springs,
        points,
        // Of a closed surface twice as many as points.
        triangles: surface.triangles().len().min(2 * points),
    }
}

/// So many points of the surface have room for each node of S, and for those beside S.
const POINTS_OF_A_NODE: usize = 8;
const POINTS_BESIDE: usize = 128;

/// The most nodes of S, and columns of V, for a near field with `room` about `contact`: those of the options, and more where a
/// large tool touches more nodes than these, for what is beside it comes next.
pub(super) fn limits(
    contact: &ToolContact,
    options: &BuilderOptions,
    room: NearFieldCapacity,
) -> (usize, usize) {
    let touched: BTreeSet<usize> =
        contact.touched().iter().flat_map(|t| t.nodes.iter().map(|n| n.0)).collect();
    let nodes = options.support_nodes.max(touched.len() + touched.len() / 3).min(room.nodes);
    let order = if nodes > options.support_nodes { 4 * nodes } else { 0 };
    (nodes, options.order_limit.max(order).min(room.order))
}
