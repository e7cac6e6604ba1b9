//! Weighted sums over nodes.

/// Nodes and weights of a row.
pub(crate) type Weights = Vec<(usize, f64)>;

/// Adds `weight` to the weight of `node`.
pub(crate) fn add_weight(weights: &mut Weights, node: usize, weight: f64) {
    match weights.iter_mut().find(|(known, _)| *known == node) {
        Some((_, sum)) => *sum += weight,
        None => weights.push((node, weight)),
    }
}
