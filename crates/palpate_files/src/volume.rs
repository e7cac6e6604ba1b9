//! The volume that a reader builds: nodes, elements and regions.

mod element_counts;
mod node_numbers;
mod region;
mod shape;

use crate::error::MeshFileError;
use crate::piece::MAX_ELEMENTS;
use std::collections::{BTreeMap, HashMap};

pub use element_counts::ElementCounts;
pub(crate) use node_numbers::NodeNumbers;
pub use region::TetrahedralRegion;
pub(crate) use shape::Shape;

/// The numbers of the region of an element in a file: the physical group and the entity in Gmsh files, one number and 0 in others.
pub(crate) type RegionKey = [i64; 2];

/// The tetrahedra of a file.
pub(crate) struct Volume {
    pub vertices: Vec<[f64; 3]>,
    pub tetrahedra: Vec<[u32; 4]>,
    pub regions: Vec<u32>,
    pub region_list: Vec<TetrahedralRegion>,
    pub counts: ElementCounts,
}

/// Collects nodes and elements of a file.
pub(crate) struct VolumeBuilder {
    format: &'static str,
    nodes: Vec<[f64; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    /// Index into `keys` of each tetrahedron.
    key_of: Vec<u32>,
    keys: Vec<RegionKey>,
    key_index: HashMap<RegionKey, u32>,
    counts: ElementCounts,
}

impl VolumeBuilder {
    pub fn new(format: &'static str) -> Self {
        Self {
            format,
            nodes: Vec::new(),
            tetrahedra: Vec::new(),
            key_of: Vec::new(),
            keys: Vec::new(),
            key_index: HashMap::new(),
            counts: ElementCounts::default(),
        }
    }

    /// The nodes of the file.
    pub fn nodes(&self) -> &[[f64; 3]] {
        &self.nodes
    }

    /// Adds the node with the next index.
    pub fn push_node(&mut self, position: [f64; 3]) {
        self.nodes.push(position);
    }

    /// Rejects a stated number of nodes or elements that is too large, and converts it.
    pub fn check_count(what: &'static str, value: u64) -> Result<usize, MeshFileError> {
        let max = MAX_ELEMENTS as u64;
        match usize::try_from(value) {
            Ok(count) if value <= max => Ok(count),
            _ => Err(MeshFileError::TooLarge { what, value, max }),
        }
    }

    /// Counts an element of less than three dimensions, which is left out.
    pub fn leave_out(&mut self, shape: Shape) {
        match shape {
            Shape::Point => self.counts.points += 1,
            Shape::Line => self.counts.lines += 1,
            _ => self.counts.faces += 1,
        }
    }

    /// Adds an element with the `corners` of its shape, which are indices of nodes. Other shapes than tetrahedra are split.
    pub fn push(
        &mut self,
        shape: Shape,
        corners: &[u32],
        has_more_nodes: bool,
        region: RegionKey,
    ) -> Result<(), MeshFileError> {
        if let Some(corner) = corners.iter().find(|corner| **corner as usize >= self.nodes.len()) {
            return Err(self.node_missing(u64::from(*corner)));
        }
        match shape {
            Shape::Point | Shape::Line | Shape::Face => {
                self.leave_out(shape);
                return Ok(());
            }
            Shape::Tetrahedron => {}
            Shape::Hexahedron => self.counts.hexahedra += 1,
            Shape::Prism => self.counts.prisms += 1,
            Shape::Pyramid => self.counts.pyramids += 1,
        }
        self.counts.high_order += usize::from(has_more_nodes);
        let key = self.key(region);
        shape.split(corners, |tetrahedron| {
            let [a, b, c, d] = tetrahedron;
            if a == b || a == c || a == d || b == c || b == d || c == d {
                self.counts.collapsed += 1;
            } else {
                self.tetrahedra.push(tetrahedron);
                self.key_of.push(key);
            }
        });
        Self::check_count("number of tetrahedra", self.tetrahedra.len() as u64)?;
        Ok(())
    }

    /// The error of an element with the node `node`, as the file numbers it.
    pub fn node_missing(&self, node: u64) -> MeshFileError {
        MeshFileError::NodeNotFound { format: self.format, node, node_count: self.nodes.len() }
    }

    /// The index of a region in `keys`.
    fn key(&mut self, region: RegionKey) -> u32 {
        // Most elements have the region of the one before.
        if let Some(last) = self.key_of.last().filter(|last| self.keys[**last as usize] == region) {
            return *last;
        }
        let next = self.keys.len() as u32;
        let key = *self.key_index.entry(region).or_insert(next);
        if key == next {
            self.keys.push(region);
        }
        key
    }

    /// Regions of the tetrahedra.
    pub fn region_keys(&self) -> &[RegionKey] {
        &self.keys
    }

    /// The volume without unused nodes. `region` is the region of a key; regions with the same number are one.
    pub fn finish(self, region: impl Fn(RegionKey) -> TetrahedralRegion) -> Result<Volume, MeshFileError> {
        let Self { format, nodes, mut tetrahedra, key_of, keys, mut counts, .. } = self;
        if tetrahedra.is_empty() {
            return Err(MeshFileError::NoTetrahedra { format, content: counts.to_string() });
        }
        let mut vertex_of = vec![u32::MAX; nodes.len()];
        tetrahedra.iter().flatten().for_each(|node| vertex_of[*node as usize] = 0);
        let mut vertices = Vec::new();
        for (node, position) in vertex_of.iter_mut().zip(&nodes).filter(|(vertex, _)| **vertex == 0) {
            if let Some(x) = position.iter().find(|x| !x.is_finite()) {
                let problem = format!("a coordinate of a node of an element is {x}; it must be finite");
                return Err(MeshFileError::VolumeNotValid { format, problem });
            }
            *node = vertices.len() as u32;
            vertices.push(*position);
        }
        counts.unused_nodes = nodes.len() - vertices.len();
        drop(nodes);
        tetrahedra.iter_mut().flatten().for_each(|node| *node = vertex_of[*node as usize]);

        let mut is_used = vec![false; keys.len()];
        key_of.iter().for_each(|key| is_used[*key as usize] = true);
        let of_key: Vec<TetrahedralRegion> = keys.into_iter().map(region).collect();
        let used = of_key.iter().zip(is_used).filter(|(_, is_used)| *is_used);
        let by_number: BTreeMap<i64, &TetrahedralRegion> =
            used.map(|(region, _)| (region.number, region)).collect();
        let index: HashMap<i64, u32> = by_number.keys().copied().zip(0..).collect();
        let regions = key_of
            .into_iter()
            .map(|key| index.get(&of_key[key as usize].number).copied().unwrap_or_default())
            .collect();
        let region_list = by_number.into_values().cloned().collect();
        Ok(Volume { vertices, tetrahedra, regions, region_list, counts })
    }
}
