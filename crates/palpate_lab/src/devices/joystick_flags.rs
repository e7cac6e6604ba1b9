//! Command-line flags for the options of a joystick.

use clap::ValueEnum;
use palpate_hid::{PidArrayBase, PidArrayBases};

/// Axes whose force is reversed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Reverse {
    /// x
    X,
    /// y
    Y,
    /// x and y
    Xy,
}

impl Reverse {
    /// Whether the force of x and of y is reversed.
    pub(super) fn axes(self) -> [bool; 2] {
        [self != Self::Y, self != Self::X]
    }
}

/// Parses the bases of PID arrays: `minimum` or `one` for all, or a list such as `control=one,operation=minimum`.
pub(super) fn pid_arrays(text: &str) -> Result<PidArrayBases, String> {
    let mut bases = PidArrayBases::default();
    for item in text.split(',') {
        let (array, base) = item.split_once('=').unwrap_or(("", item));
        let base = match base {
            "minimum" => PidArrayBase::LogicalMinimum,
            "one" => PidArrayBase::One,
            _ => return Err(format!("the base is {base}; it must be minimum or one")),
        };
        match array {
            "" => bases = PidArrayBases::all(base),
            "control" => bases.control = Some(base),
            "operation" => bases.operation = Some(base),
            "type" => bases.effect_type = Some(base),
            "status" => bases.load_status = Some(base),
            _ => return Err(format!("the array is {array}; it must be control, operation, type or status")),
        }
    }
    Ok(bases)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pid_arrays_have_one_base_or_one_each() {
        let (minimum, one) = (PidArrayBase::LogicalMinimum, PidArrayBase::One);
        assert_eq!(pid_arrays("one"), Ok(PidArrayBases::all(one)));
        assert_eq!(pid_arrays("minimum"), Ok(PidArrayBases::all(minimum)));
        let control =
            PidArrayBases { control: Some(one), operation: Some(minimum), ..PidArrayBases::default() };
        assert_eq!(pid_arrays("control=one,operation=minimum"), Ok(control));
        let all_but_one = PidArrayBases { load_status: Some(minimum), ..PidArrayBases::all(one) };
        assert_eq!(pid_arrays("one,status=minimum"), Ok(all_but_one));
        assert_eq!(pid_arrays("2").unwrap_err(), "the base is 2; it must be minimum or one");
        let unknown = "the array is x; it must be control, operation, type or status";
        assert_eq!(pid_arrays("x=one").unwrap_err(), unknown);
    }
}
