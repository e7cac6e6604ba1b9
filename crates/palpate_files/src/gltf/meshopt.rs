//! Decoding of views that are compressed with `EXT_meshopt_compression`.

use super::document::Meshopt;
use crate::error::MeshFileError;

pub(super) const EXT_NAME: &str = "EXT_meshopt_compression";
pub(super) const KHR_NAME: &str = "KHR_meshopt_compression";

/// True where the decoder is part of this build.
pub(super) const IS_BUILT: bool = cfg!(feature = "meshopt");

/// Maximum ratio of decoded to compressed bytes. The format spends at least two bits on each byte of 256 elements.
#[cfg(feature = "meshopt")]
const MAX_RATIO: usize = 1024;

/// Content of the view `compressed`, of `source`.
#[cfg(feature = "meshopt")]
pub(super) fn decode(
    compressed: &Meshopt,
    source: &[u8],
    extension: &'static str,
) -> Result<Vec<u8>, MeshFileError> {
    use meshoptimizer_rs::Workspace;
    use meshoptimizer_rs::codec::{
        BufferView, Filter, Mode, decode_filter_exp, decode_filter_oct, decode_filter_quat,
        decode_vertex_buffer,
    };

    let failed = |problem: String| MeshFileError::CannotBeDecoded { extension, problem };
    let filter = compressed.filter.as_deref().unwrap_or("NONE");
    if filter == "COLOR" {
        return Err(failed("a position, normal or index has the filter COLOR".into()));
    }
    let rejected = |cause: meshoptimizer_rs::Error| failed(cause.to_string());
    let mode = Mode::parse(&compressed.mode).map_err(rejected)?;
    let filter = Filter::parse(filter).map_err(rejected)?;
    let view = BufferView::new(mode, filter, compressed.count, compressed.byte_stride).map_err(rejected)?;
    if view.byte_length() / MAX_RATIO > source.len() {
        let (stated, held) = (view.byte_length(), source.len());
        return Err(failed(format!("{stated} bytes cannot be held in {held} compressed ones")));
    }
    let workspace = &mut Workspace::default();
    if mode != Mode::Attributes {
        return view.decode(source, workspace).map_err(rejected);
    }
    // `BufferView::decode` reads only version 0 of vertices; `KHR_meshopt_compression` has version 1 as well.
    let (count, stride) = (compressed.count, compressed.byte_stride);
    let mut content = decode_vertex_buffer(count, stride, source, workspace).map_err(rejected)?;
    let filtered = match filter {
        Filter::None => Ok(()),
        Filter::Octahedral => decode_filter_oct(&mut content, count, stride, workspace),
        Filter::Quaternion => decode_filter_quat(&mut content, count, stride, workspace),
        Filter::Exponential => decode_filter_exp(&mut content, count, stride, workspace),
    };
    filtered.map_err(rejected)?;
    Ok(content)
}

/// Rejects the view: the decoder is not part of this build.
#[cfg(not(feature = "meshopt"))]
pub(super) fn decode(
    _compressed: &Meshopt,
    _source: &[u8],
    extension: &'static str,
) -> Result<Vec<u8>, MeshFileError> {
    Err(MeshFileError::NeedsDecoder { extension, feature: "meshopt" })
}
