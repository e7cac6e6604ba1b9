//! Numbers that a file gives to its nodes.

use crate::error::MeshFileError;
use std::collections::HashMap;

/// Indices of nodes by their numbers.
pub(crate) enum NodeNumbers {
    /// Indices of the numbers from `first` on; `u32::MAX` where a number is not used.
    Dense { first: u64, indices: Vec<u32> },
    /// Numbers with large gaps.
    Sparse(HashMap<u64, u32>),
}

impl NodeNumbers {
    /// The numbers of the nodes at `positions`. Nodes of the same number must be at the same position.
    pub fn new(format: &'static str, numbers: &[u64], positions: &[[f64; 3]]) -> Result<Self, MeshFileError> {
        let first = numbers.iter().min().copied().unwrap_or_default();
        let last = numbers.iter().max().copied().unwrap_or_default();
        let mut result = if last - first < 4 * numbers.len() as u64 {
            Self::Dense { first, indices: vec![u32::MAX; (last - first) as usize + 1] }
        } else {
            Self::Sparse(HashMap::with_capacity(numbers.len()))
        };
        for (number, index) in numbers.iter().zip(0..) {
            let known = match &mut result {
                Self::Dense { first, indices } => &mut indices[(number - *first) as usize],
                Self::Sparse(indices) => indices.entry(*number).or_insert(u32::MAX),
            };
            if *known == u32::MAX {
                *known = index;
            } else if positions.get(*known as usize) != positions.get(index as usize) {
                let problem = format!("two nodes have the number {number}; they must have different numbers");
                return Err(MeshFileError::VolumeNotValid { format, problem });
            }
        }
        Ok(result)
    }

    /// Index of the node with the number `number`.
    pub fn index(&self, number: u64) -> Option<u32> {
        match self {
            Self::Dense { first, indices } => {
                let place = usize::try_from(number.checked_sub(*first)?).ok()?;
                indices.get(place).copied().filter(|index| *index != u32::MAX)
            }
            Self::Sparse(indices) => indices.get(&number).copied(),
        }
    }
}
