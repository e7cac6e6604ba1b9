//! How firmware numbers the usages of a PID array.

use crate::Field;

/// First number of an array whose Logical Minimum is 0.
///
/// HID 1.11 (6.2.2.5) numbers the usages of an array from its Logical Minimum. Linux (`hid-pidff.c`) numbers them from 1, whatever the
/// minimum is, and some firmware does the same. With a minimum of 1, which is usual, both give the same numbers. With a minimum of 0 the
/// number that disables the actuators in one reading enables them in the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PidArrayBase {
    /// The usages are numbered from the Logical Minimum, which is 0.
    LogicalMinimum,
    /// The usages are numbered from 1.
    One,
}

/// First numbers of the arrays of a joystick, each for an array whose Logical Minimum is 0; `None` rejects such an array. Other arrays
/// have one reading, and ignore the value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PidArrayBases {
    /// Base of the commands of PID Device Control.
    pub control: Option<PidArrayBase>,
    /// Base of the operations of the Effect Operation Report.
    pub operation: Option<PidArrayBase>,
    /// Base of the effect types of the Set Effect and Create New Effect Reports.
    pub effect_type: Option<PidArrayBase>,
    /// Base of the statuses of the PID Block Load Report.
    pub load_status: Option<PidArrayBase>,
}

impl PidArrayBases {
    /// The base `base` for all arrays.
    #[must_use]
    pub const fn all(base: PidArrayBase) -> Self {
        let base = Some(base);
        Self { control: base, operation: base, effect_type: base, load_status: base }
    }
}

/// Whether firmware may number the usages of `field` in two ways.
pub(crate) fn is_ambiguous(field: &Field) -> bool {
    field.is_array && field.logical[0] == 0
}

/// Difference between the numbers of `field` and those that its Logical Minimum gives.
pub(crate) fn offset(field: &Field, base: Option<PidArrayBase>) -> i64 {
    i64::from(is_ambiguous(field) && base == Some(PidArrayBase::One))
}
