//! Relaxed stress of single elements in the list of a body.

use palpate_laws::RelaxedStress;

/// The relaxed stress of an element whose stress has not relaxed.
const FRESH: RelaxedStress = [[0.0; 6]; palpate_laws::MAX_PRONY_TERMS];

/// The relaxed stress at `index`. The list of a body whose elements do not relax is empty, and domains of tetrahedra have no entry.
pub(crate) fn relaxed_of(relaxed: &[RelaxedStress], index: usize) -> &RelaxedStress {
    relaxed.get(index).unwrap_or(&FRESH)
}
