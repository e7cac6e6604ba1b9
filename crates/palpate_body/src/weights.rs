//! Weighted sums over nodes.

/// Nodes and weights of a row, only those that can move.
pub(crate) type Weights = Vec<(usize, f64)>;

/// Adds `weight` to that of `node`.
pub(crate) fn add_weight(weights: &mut Weights, node: usize, weight: f64) {
    match weights.iter_mut().find(|(known, _)| *known == node) {
        Some((_, sum)) => *sum += weight,
        None => weights.push((node, weight)),
    }
}
