//! Shapes of elements, and their division into tetrahedra.

/// The shape of an element.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Shape {
    Point,
    Line,
    /// A triangle, a quadrangle or another polygon.
    Face,
    Tetrahedron,
    /// Corners 0 to 3 of one face, then 4 to 7 opposite to them.
    Hexahedron,
    /// Corners 0 to 2 of one triangle, then 3 to 5 opposite to them.
    Prism,
    /// Corners 0 to 3 of the base, then the apex.
    Pyramid,
}

impl Shape {
    /// Whether an element of this shape has a volume.
    pub fn is_solid(self) -> bool {
        !matches!(self, Self::Point | Self::Line | Self::Face)
    }

    /// Number of corners. Polygons have at least 3.
    pub fn corner_count(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Line => 2,
            Self::Face => 3,
            Self::Tetrahedron => 4,
            Self::Pyramid => 5,
            Self::Prism => 6,
            Self::Hexahedron => 8,
        }
    }

    /// Faces of a shape that is split, counter-clockwise seen from outside.
    fn faces(self) -> &'static [&'static [usize]] {
        match self {
            Self::Hexahedron => {
                &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]]
            }
            Self::Prism => &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]],
            Self::Pyramid => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
            _ => &[],
        }
    }

    /// Calls `push` with each tetrahedron of an element with `corners`.
    ///
    /// Each face with four corners is divided by the diagonal from its lowest node, as in J. Dompierre and others, How to subdivide
    /// pyramids, prisms, and hexahedra into tetrahedra (1999). Two elements with a common face therefore have common triangles. The
    /// tetrahedra connect the lowest node of the element with the triangles of the faces that do not have it.
    pub fn split(self, corners: &[u32], mut push: impl FnMut([u32; 4])) {
        if let (Self::Tetrahedron, [a, b, c, d]) = (self, corners) {
            push([*a, *b, *c, *d]);
            return;
        }
        let node = |place: &usize| corners.get(*place).copied().unwrap_or_default();
        let Some(apex) = (0..corners.len()).min_by_key(node) else { return };
        for face in self.faces().iter().filter(|face| !face.contains(&apex)) {
            let lowest = (0..face.len()).min_by_key(|place| node(&face[*place])).unwrap_or_default();
            let turned = |step: usize| node(&face[(lowest + step) % face.len()]);
            (1..face.len() - 1).for_each(|step| {
                push([node(&apex), turned(0), turned(step), turned(step + 1)]);
            });
        }
    }
}
