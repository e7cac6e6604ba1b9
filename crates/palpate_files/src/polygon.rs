//! Triangles of polygons and strips.

/// Triangles of a polygon, as a fan about its first vertex. The signed area of a plane polygon is exact, also where it is not convex.
/// Triangles with a repeated vertex are left out.
pub(crate) fn fan(polygon: &[u32]) -> impl Iterator<Item = [u32; 3]> + '_ {
    let first = polygon.first().copied().unwrap_or_default();
    let others = polygon.get(1..).unwrap_or_default();
    others.windows(2).filter_map(move |pair| match *pair {
        [b, c] => has_three_vertices([first, b, c]),
        _ => None,
    })
}

/// Triangles of a strip, in which every second triangle is reversed. Triangles with a repeated vertex are left out.
pub(crate) fn strip(vertices: &[u32]) -> impl Iterator<Item = [u32; 3]> + '_ {
    vertices.windows(3).enumerate().filter_map(|(place, three)| match *three {
        [a, b, c] if place % 2 == 0 => has_three_vertices([a, b, c]),
        [a, b, c] => has_three_vertices([a, c, b]),
        _ => None,
    })
}

fn has_three_vertices(triangle: [u32; 3]) -> Option<[u32; 3]> {
    let [a, b, c] = triangle;
    (a != b && b != c && c != a).then_some(triangle)
}
