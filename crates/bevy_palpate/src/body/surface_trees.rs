//! Surface trees of bodies, kept from one model step to the next.

use super::simulated::SimulatedBody;
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use palpate_body::SurfaceTree;

/// Surface trees of bodies.
#[derive(Default)]
pub(crate) struct SurfaceTrees {
    trees: EntityHashMap<FittedTree>,
}

struct FittedTree {
    /// Number of the body's shape.
    shape: u64,
    /// Epoch and model step of the last fit.
    fitted: (u64, u64),
    tree: SurfaceTree,
}

impl SurfaceTrees {
    /// Removes the trees of bodies for which `exists` is false.
    pub(crate) fn retain(&mut self, exists: impl Fn(Entity) -> bool) {
        self.trees.retain(|entity, _| exists(*entity));
    }

    /// The tree of the body of `entity` in its shape after model step `step`.
    pub(crate) fn of(&mut self, entity: Entity, simulated: &SimulatedBody, step: u64) -> &SurfaceTree {
        let fitted = (simulated.epoch, step);
        let kept = self.trees.remove(&entity).filter(|kept| kept.shape == simulated.shape);
        let kept = match kept {
            Some(mut kept) => {
                if kept.fitted != fitted {
                    kept.tree.refit(simulated.body());
                    kept.fitted = fitted;
                }
                kept
            }
            None => FittedTree { shape: simulated.shape, fitted, tree: SurfaceTree::new(simulated.body()) },
        };
        &self.trees.entry(entity).insert(kept).into_mut().tree
    }
}
