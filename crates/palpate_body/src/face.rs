//! The sides of a box.

use glam::DVec3;

/// A side of a block or of a mesh, named by the axis of its outward normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Face {
    /// The side towards −x.
    NegX,
    /// The side towards +x.
    PosX,
    /// The side towards −y.
    NegY,
    /// The side towards +y.
    PosY,
    /// The side towards −z.
    NegZ,
    /// The side towards +z.
    PosZ,
}

impl Face {
    /// All six faces.
    pub const ALL: [Self; 6] = [Self::NegX, Self::PosX, Self::NegY, Self::PosY, Self::NegZ, Self::PosZ];

    /// Axis of the normal: 0 for x, 1 for y, 2 for z.
    #[must_use]
    pub fn axis(self) -> usize {
        self as usize / 2
    }

    /// Whether the normal points in the positive direction of its axis.
    #[must_use]
    pub fn is_positive(self) -> bool {
        self as usize % 2 == 1
    }

    /// Outward unit normal.
    #[must_use]
    pub fn normal(self) -> DVec3 {
        if self.is_positive() { DVec3::AXES[self.axis()] } else { -DVec3::AXES[self.axis()] }
    }
}
