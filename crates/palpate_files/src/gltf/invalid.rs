//! The error of a glTF file that contradicts its format.

use crate::error::MeshFileError;

pub(crate) const NAME: &str = "glTF";

pub(super) fn not_valid(problem: String) -> MeshFileError {
    MeshFileError::NotValid { format: NAME, problem }
}
