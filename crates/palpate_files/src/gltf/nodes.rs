//! The nodes that place meshes.

use super::document::Document;
use super::invalid::not_valid;
use super::transform::Transform;
use crate::error::MeshFileError;

/// A mesh as a node places it.
pub(super) struct Placement {
    /// The node. `None` where no node places any mesh, so that each mesh is in its own frame.
    pub node: Option<usize>,
    pub mesh: usize,
    pub transform: Transform,
}

/// Placements of the meshes: those of the default scene, or the first; without any, those of all nodes; without any, each mesh once.
pub(super) fn placements(document: &Document) -> Result<Vec<Placement>, MeshFileError> {
    let scene = document.scene.unwrap_or_default();
    if let Some(scene) = document.scenes.get(scene) {
        let placements = below(document, &scene.nodes)?;
        if !placements.is_empty() {
            return Ok(placements);
        }
    } else if document.scene.is_some() {
        return Err(not_valid(format!("scene {scene} does not exist")));
    }
    let mut is_root = vec![true; document.nodes.len()];
    for child in document.nodes.iter().flat_map(|node| &node.children) {
        if let Some(is_root) = is_root.get_mut(*child) {
            *is_root = false;
        }
    }
    let roots: Vec<usize> = (0..document.nodes.len()).filter(|node| is_root[*node]).collect();
    let placements = below(document, &roots)?;
    if !placements.is_empty() {
        return Ok(placements);
    }
    let meshes = 0..document.meshes.len();
    Ok(meshes.map(|mesh| Placement { node: None, mesh, transform: Transform::IDENTITY }).collect())
}

/// Placements of the nodes `roots` and their descendants, each node before its children.
fn below(document: &Document, roots: &[usize]) -> Result<Vec<Placement>, MeshFileError> {
    let mut placements = Vec::new();
    let mut is_reached = vec![false; document.nodes.len()];
    let mut next: Vec<(usize, Transform)> =
        roots.iter().rev().map(|root| (*root, Transform::IDENTITY)).collect();
    while let Some((index, parent)) = next.pop() {
        let (Some(node), Some(is_reached)) = (document.nodes.get(index), is_reached.get_mut(index)) else {
            return Err(not_valid(format!("node {index} does not exist")));
        };
        if std::mem::replace(is_reached, true) {
            return Err(not_valid(format!(
                "node {index} is below itself or has two parents; it must have one"
            )));
        }
        let transform = parent.after(&Transform::of(node));
        placements.extend(node.mesh.map(|mesh| Placement { node: Some(index), mesh, transform }));
        next.extend(node.children.iter().rev().map(|child| (*child, transform)));
    }
    Ok(placements)
}
