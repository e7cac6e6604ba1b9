//! Accessors: vectors and indices of any number type, with sparse replacements.

use super::buffers::Buffers;
use super::document::{Accessor, Document, Sparse};
use super::invalid::not_valid;
use crate::error::MeshFileError;
use crate::piece::MAX_ELEMENTS;

/// Maximum number of elements of an accessor without a view, which are zeros that no byte of the file stands for.
const MAX_ZEROS: usize = 4_000_000;

/// The type of the components of an accessor.
#[derive(Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn new(code: u32) -> Result<Self, MeshFileError> {
        Ok(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => {
                return Err(not_valid(format!(
                    "a component type is {code}; it must be 5120 to 5126 without 5124"
                )));
            }
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The component at the beginning of `bytes`. The numbers are exact. Missing bytes are 0.
    fn read(self, bytes: &[u8]) -> f64 {
        match self {
            Self::I8 => i8::from_le_bytes(first(bytes)).into(),
            Self::U8 => u8::from_le_bytes(first(bytes)).into(),
            Self::I16 => i16::from_le_bytes(first(bytes)).into(),
            Self::U16 => u16::from_le_bytes(first(bytes)).into(),
            Self::U32 => u32::from_le_bytes(first(bytes)).into(),
            Self::F32 => f32::from_le_bytes(first(bytes)).into(),
        }
    }

    /// The integer that is 1 when normalised.
    fn largest(self) -> Option<f64> {
        match self {
            Self::I8 => Some(i8::MAX.into()),
            Self::U8 => Some(u8::MAX.into()),
            Self::I16 => Some(i16::MAX.into()),
            Self::U16 => Some(u16::MAX.into()),
            Self::U32 => Some(u32::MAX.into()),
            Self::F32 => None,
        }
    }
}

fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

/// A normalised integer as a fraction from -1 to 1, by the code of its type; every other number as it is.
pub(super) fn denormalized(value: f64, accessor: &Accessor) -> Result<f64, MeshFileError> {
    let largest = Component::new(accessor.component_type)?.largest().filter(|_| accessor.normalized);
    Ok(largest.map_or(value, |largest| (value / largest).max(-1.0)))
}

pub(super) fn accessor(document: &Document, index: usize) -> Result<&Accessor, MeshFileError> {
    document.accessors.get(index).ok_or_else(|| not_valid(format!("accessor {index} does not exist")))
}

/// Vectors of the accessor `index`.
pub(super) fn vectors(
    document: &Document,
    buffers: &Buffers,
    index: usize,
) -> Result<Vec<[f64; 3]>, MeshFileError> {
    let accessor = accessor(document, index)?;
    if accessor.shape != "VEC3" {
        return Err(not_valid(format!("accessor {index} has the type {}; it must be VEC3", accessor.shape)));
    }
    let mut vectors = elements::<3>(accessor, buffers, index)?;
    for value in vectors.iter_mut().flatten() {
        *value = denormalized(*value, accessor)?;
    }
    Ok(vectors)
}

/// Indices of the accessor `index`.
pub(super) fn indices(
    document: &Document,
    buffers: &Buffers,
    index: usize,
) -> Result<Vec<u32>, MeshFileError> {
    let accessor = accessor(document, index)?;
    if accessor.shape != "SCALAR" || !matches!(accessor.component_type, 5121 | 5123 | 5125) {
        let (shape, code) = (&accessor.shape, accessor.component_type);
        let must = "it must be SCALAR of 5121, 5123 or 5125";
        return Err(not_valid(format!("accessor {index} of indices has the type {shape} of {code}; {must}")));
    }
    Ok(elements::<1>(accessor, buffers, index)?.into_iter().map(|[value]| value as u32).collect())
}

/// Elements of `N` components, as stored.
fn elements<const N: usize>(
    accessor: &Accessor,
    buffers: &Buffers,
    index: usize,
) -> Result<Vec<[f64; N]>, MeshFileError> {
    let component = Component::new(accessor.component_type)?;
    let max = if accessor.buffer_view.is_some() { MAX_ELEMENTS } else { MAX_ZEROS };
    if accessor.count > max {
        let (value, max) = (accessor.count as u64, max as u64);
        return Err(MeshFileError::TooLarge { what: "number of elements of an accessor", value, max });
    }
    let mut elements = match accessor.buffer_view {
        Some(view) => stored(buffers, view, accessor.byte_offset, accessor.count, component)
            .map_err(|error| of_accessor(error, index))?,
        None => vec![[0.0; N]; accessor.count],
    };
    if let Some(sparse) = &accessor.sparse {
        replace(&mut elements, sparse, component, buffers).map_err(|error| of_accessor(error, index))?;
    }
    Ok(elements)
}

/// `count` elements of a view from `offset`.
fn stored<const N: usize>(
    buffers: &Buffers,
    view: usize,
    offset: usize,
    count: usize,
    component: Component,
) -> Result<Vec<[f64; N]>, MeshFileError> {
    let (bytes, stride) = buffers.view(view)?;
    let size = component.size() * N;
    let stride = stride.unwrap_or(size);
    if stride < size {
        return Err(not_valid(format!(
            "buffer view {view} has elements every {stride} bytes; they have {size}"
        )));
    }
    let length = count.checked_sub(1).map_or(Some(0), |steps| steps.checked_mul(stride)?.checked_add(size));
    let end = length.and_then(|length| length.checked_add(offset));
    let Some(bytes) = end.and_then(|end| bytes.get(offset..end)) else {
        let held = bytes.len();
        return Err(not_valid(format!(
            "{count} elements from byte {offset} exceed buffer view {view} of {held} bytes"
        )));
    };
    let elements = bytes.chunks(stride).map(|element| {
        let mut components = element.chunks(component.size());
        std::array::from_fn(|_| component.read(components.next().unwrap_or_default()))
    });
    Ok(elements.take(count).collect())
}

/// Replaces the elements that a sparse accessor lists.
fn replace<const N: usize>(
    elements: &mut [[f64; N]],
    sparse: &Sparse,
    component: Component,
    buffers: &Buffers,
) -> Result<(), MeshFileError> {
    let indices = &sparse.indices;
    let index_type = Component::new(indices.component_type)?;
    let places = stored::<1>(buffers, indices.buffer_view, indices.byte_offset, sparse.count, index_type)?;
    let values = &sparse.values;
    let values = stored::<N>(buffers, values.buffer_view, values.byte_offset, sparse.count, component)?;
    let count = elements.len();
    for ([place], value) in places.into_iter().zip(values) {
        let element = elements.get_mut(place as usize).ok_or_else(|| {
            not_valid(format!("it replaces element {place}; the index must be below {count}"))
        })?;
        *element = value;
    }
    Ok(())
}

/// `error` with the accessor that it concerns.
fn of_accessor(error: MeshFileError, index: usize) -> MeshFileError {
    match error {
        MeshFileError::NotValid { format, problem } => {
            MeshFileError::NotValid { format, problem: format!("accessor {index}: {problem}") }
        }
        other => other,
    }
}
