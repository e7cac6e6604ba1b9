//! Distances between the points of a grid.

/// Squared distance, in spacings, from each point of a grid of `counts` points, x fastest, to the nearest one for which `is_in` holds; infinite
/// if it holds for none (P. F. Felzenszwalb and D. P. Huttenlocher, Theory of Computing 8 (2012) 415).
pub(super) fn squared_distances(counts: [usize; 3], is_in: impl Fn(usize) -> bool) -> Vec<f64> {
    let total = counts.iter().product();
    let mut distances: Vec<f64> =
        (0..total).map(|point| if is_in(point) { 0.0 } else { f64::INFINITY }).collect();
    let strides = [1, counts[0], counts[0] * counts[1]];
    let mut line = Vec::new();
    for axis in 0..3 {
        for first in (0..total).filter(|point| (point / strides[axis]).is_multiple_of(counts[axis])) {
            let points = (0..counts[axis]).map(|along| first + along * strides[axis]);
            line.clear();
            line.extend(points.clone().map(|point| distances[point]));
            let envelope = lower_envelope(&line);
            for (at, point) in points.enumerate() {
                distances[point] = distance_at(&envelope, at as f64);
            }
        }
    }
    distances
}

/// A parabola (x − at)² + low that is the lowest one from `from` on.
struct Parabola {
    at: f64,
    low: f64,
    from: f64,
}

/// The lowest parabolas over a line with the squared distances `line` in the other directions.
fn lower_envelope(line: &[f64]) -> Vec<Parabola> {
    let mut envelope: Vec<Parabola> = Vec::new();
    for (at, &low) in line.iter().enumerate().filter(|(_, low)| low.is_finite()) {
        let at = at as f64;
        let mut from = f64::NEG_INFINITY;
        while let Some(last) = envelope.last() {
            from = ((low + at * at) - (last.low + last.at * last.at)) / (2.0 * (at - last.at));
            if from > last.from {
                break;
            }
            envelope.pop();
            from = f64::NEG_INFINITY;
        }
        envelope.push(Parabola { at, low, from });
    }
    envelope
}

fn distance_at(envelope: &[Parabola], at: f64) -> f64 {
    let after = envelope.partition_point(|parabola| parabola.from <= at);
    after.checked_sub(1).map_or(f64::INFINITY, |index| {
        let Parabola { at: middle, low, .. } = envelope[index];
        (at - middle).powi(2) + low
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_all_pairs() {
        let counts = [7, 5, 6];
        let is_in = |point: usize| point % 37 == 5 || point == 101;
        let place = |point: usize| [point % 7, point / 7 % 5, point / 35].map(|n| n as f64);
        let found = squared_distances(counts, is_in);
        for (point, found) in found.iter().enumerate() {
            let to = |other: usize| (0..3).map(|i| (place(point)[i] - place(other)[i]).powi(2)).sum::<f64>();
            let expected = (0..210).filter(|other| is_in(*other)).map(to).fold(f64::INFINITY, f64::min);
            assert_eq!(*found, expected);
        }
        assert!(squared_distances(counts, |_| false).iter().all(|d| *d == f64::INFINITY));
    }
}
