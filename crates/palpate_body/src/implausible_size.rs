//! Sizes that are legal and implausible, probably because of a unit.

use std::fmt;

/// Minimum and maximum plausible length of the longest side of a body of soft tissue, m.
const PLAUSIBLE_M: [f64; 2] = [0.005, 0.6];
/// Range of the sizes that an advised unit gives, m.
const COMMON_M: [f64; 2] = [0.02, 0.6];
/// Size that is advised where no unit gives a common one, m.
const USUAL_M: f64 = 0.1;
/// Units that are read as metres, m, and metres that are read as another unit, in the order of their frequency: millimetres, centimetres,
/// micrometres.
const FACTORS: [f64; 6] = [1e-3, 1e-2, 1e3, 1e2, 1e-6, 1e6];

/// A size of a body that is legal and implausible in metres.
///
/// `Display` writes it as one sentence. The remedy depends on the place where the unit is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImplausibleSize {
    /// Length of the longest side, m.
    pub size_m: f64,
    /// A factor that gives a body of a common size: that of a common unit where there is one.
    pub factor: f64,
}

impl ImplausibleSize {
    /// A description of the size of a body whose longest side is `size_m`, m; `None` if it is between 5 mm and 0.6 m.
    #[must_use]
    pub fn of(size_m: f64) -> Option<Self> {
        let [least, most] = PLAUSIBLE_M;
        (!(least..=most).contains(&size_m)).then(|| Self { size_m, factor: common_factor(size_m) })
    }
}

impl fmt::Display for ImplausibleSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { size_m, factor } = *self;
        let [least, most] = PLAUSIBLE_M;
        write!(
            f,
            "the body is {size_m:.3} m long, and bodies of soft tissue are usually {least} m to {most} m long; "
        )?;
        let unit = if factor == 1e-3 {
            "a file in millimetres needs the factor"
        } else if factor == 1e-2 {
            "a file in centimetres needs the factor"
        } else {
            "a common size needs, for example, the factor"
        };
        write!(f, "{unit} {factor:.3}, which gives {:.3} m", factor * size_m)
    }
}

/// A factor that gives a body of a common size when a body of `size_m`, m, is scaled by it.
pub(crate) fn common_factor(size_m: f64) -> f64 {
    let [least, most] = COMMON_M;
    let unit = FACTORS.into_iter().find(|factor| (least..=most).contains(&(factor * size_m)));
    unit.unwrap_or(USUAL_M / size_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_beyond_those_of_organs_are_implausible() {
        assert_eq!([0.005, 0.1, 0.6].map(ImplausibleSize::of), [None; 3]);
        for (size_m, factor) in
            [(6.4, 1e-2), (57.0, 1e-3), (1.0, 0.1), (0.0049, 1e2), (0.002, 1e2), (0.3e-3, 1e3)]
        {
            let size = ImplausibleSize::of(size_m).unwrap();
            assert!(size.size_m == size_m && (size.factor / factor - 1.0).abs() < 1e-12, "{size:?}");
        }
    }

    #[test]
    fn sentence_names_the_likely_unit() {
        let text = |size_m| ImplausibleSize::of(size_m).unwrap().to_string();
        assert_eq!(
            text(6.386),
            "the body is 6.386 m long, and bodies of soft tissue are usually 0.005 m to 0.6 m long; a file in centimetres needs the \
             factor 0.010, which gives 0.064 m"
        );
        assert!(text(57.0).contains("a file in millimetres needs the factor 0.001, which gives 0.057 m"));
        assert!(text(0.002).ends_with("for example, the factor 100.000, which gives 0.200 m"));
    }
}
