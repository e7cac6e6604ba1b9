//! Layers that decide which tools can touch which bodies.

use bevy::prelude::*;

/// Layers of a tool or of a body, one in each bit. A tool can touch a body if they have a layer in common; without the component an entity
/// is in all layers.
///
/// A change that separates a tool from its body ends their contact. A tool whose [`HapticTool::body`](crate::HapticTool::body) has none of
/// its layers touches nothing.
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_palpate::{TouchLayers, prelude::*};
///
/// const TISSUE: TouchLayers = TouchLayers::layer(0);
/// const BONE: TouchLayers = TouchLayers::layer(1);
///
/// fn setup(mut commands: Commands) {
///     commands.spawn((DeformableBody::block([6; 3], 0.1), FixedRegion::Face(BoxFace::Bottom), TISSUE));
///     commands.spawn((HapticTool::new("needle"), TISSUE));
///     commands.spawn((HapticTool::new("drill"), TISSUE | BONE));
/// }
/// # assert!(TISSUE.touches(TISSUE | BONE) && !TISSUE.touches(BONE));
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone, Hash)]
pub struct TouchLayers(pub u32);

impl TouchLayers {
    /// All layers.
    pub const ALL: Self = Self(u32::MAX);
    /// No layer: touches nothing.
    pub const NONE: Self = Self(0);

    /// Returns the layer of bit `index`, 0 to 31.
    ///
    /// # Panics
    /// If `index` is above 31.
    #[must_use]
    pub const fn layer(index: u32) -> Self {
        assert!(index < 32, "the index of a layer must be 0 to 31");
        Self(1 << index)
    }

    /// Whether two entities with these components have a layer in common; an entity without the component is in all layers.
    pub(crate) fn are_shared(a: Option<&Self>, b: Option<&Self>) -> bool {
        a.copied().unwrap_or_default().touches(b.copied().unwrap_or_default())
    }

    /// Returns whether the two have a layer in common.
    #[must_use]
    pub const fn touches(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}

impl Default for TouchLayers {
    /// All layers.
    fn default() -> Self {
        Self::ALL
    }
}

impl core::ops::BitOr for TouchLayers {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}
