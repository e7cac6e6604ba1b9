//! Decoding of primitives that are compressed with `KHR_draco_mesh_compression`.

use super::document::Attributes;
use crate::error::MeshFileError;

const NAME: &str = "KHR_draco_mesh_compression";

/// True where the decoder is part of this build.
pub(super) const IS_BUILT: bool = cfg!(feature = "draco");

/// A decoded primitive. Integers are as stored, not normalised.
pub(super) struct Decoded {
    pub positions: Vec<[f64; 3]>,
    pub normals: Option<Vec<[f64; 3]>>,
    pub triangles: Vec<[u32; 3]>,
}

/// Decodes `source`, whose attributes have the identifiers `attributes`.
#[cfg(feature = "draco")]
pub(super) fn decode(source: &[u8], attributes: &Attributes) -> Result<Decoded, MeshFileError> {
    use crate::piece::MAX_ELEMENTS;
    use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};

    let failed = |problem: String| MeshFileError::CannotBeDecoded { extension: NAME, problem };
    let limits = DecodeLimits::default()
        .with_max_points(MAX_ELEMENTS as u64)
        .with_max_faces(MAX_ELEMENTS as u64)
        .with_max_decoded_bytes(1 << 30);
    let mut mesh = Mesh::new();
    let mut buffer = DecoderBuffer::new(source).with_limits(limits);
    MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|cause| failed(cause.to_string()))?;
    let vectors = |identifier: usize| {
        let identifier = u32::try_from(identifier).ok();
        let attribute = identifier.and_then(|identifier| mesh.attribute_by_unique_id(identifier));
        let attribute = attribute.filter(|attribute| attribute.num_components() == 3)?;
        let numbers = attribute.read_f32s(mesh.num_points(), 3);
        Some(numbers.as_chunks::<3>().0.iter().map(|vector| vector.map(f64::from)).collect())
    };
    let Some(positions) = attributes.position.and_then(vectors) else {
        return Err(failed("it has no attribute POSITION of three components".into()));
    };
    Ok(Decoded {
        positions,
        normals: attributes.normal.and_then(vectors),
        triangles: mesh.faces().iter().map(|face| face.map(|point| point.0)).collect(),
    })
}

/// Rejects the primitive: the decoder is not part of this build.
#[cfg(not(feature = "draco"))]
pub(super) fn decode(_source: &[u8], _attributes: &Attributes) -> Result<Decoded, MeshFileError> {
    Err(MeshFileError::NeedsDecoder { extension: NAME, feature: "draco" })
}
