//! Values of the flags of `palpate-lab probe`, read from text.

use crate::error::{LabError, check, number, whole};
use clap::ValueEnum;

/// Number of nodes along x, y and z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nodes(pub(super) [usize; 3]);

/// Built-in body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum BuiltinBody {
    /// A box of cubic cells
    Block,
}

/// Rigid tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Tool {
    Sphere { radius_m: f64 },
    Punch { radius_m: f64 },
}

/// Connection between the hand and the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum CouplingKind {
    /// The tool is at the position of the hand
    Rigid,
    /// A spring of 20 kN/m whose force saturates at 10 N, the plugin's default
    Virtual,
}

/// Integrator of the body and of the local model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum IntegratorKind {
    /// Semi-implicit Euler in both
    Explicit,
    /// Linearly implicit Euler in both
    Implicit,
    /// Semi-implicit Euler in the body; in the local model the cheaper one, as in the plugin
    Auto,
}

/// A place of the top, mm from its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) x_mm: f64,
    pub(super) z_mm: f64,
}

/// Places along x, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scan {
    pub(super) from_mm: f64,
    pub(super) to_mm: f64,
    pub(super) step_mm: f64,
}

/// A sphere of other tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lump {
    /// Centre, mm: x and z from the centre of the top, y from the top, so negative inside.
    pub(super) center_mm: [f64; 3],
    pub(super) radius_mm: f64,
    pub(super) youngs_pa: f64,
}

impl Tool {
    pub(super) fn radius_m(self) -> f64 {
        match self {
            Self::Sphere { radius_m } | Self::Punch { radius_m } => radius_m,
        }
    }
}

impl Scan {
    /// Number of places; the last one may lie up to a step before the end.
    pub(super) fn count(self) -> usize {
        ((self.to_mm - self.from_mm) / self.step_mm + 1e-9).floor() as usize + 1
    }

    /// Places at `z_mm`.
    pub(super) fn places(self, z_mm: f64) -> impl Iterator<Item = Place> {
        (0..self.count()).map(move |i| Place { x_mm: self.from_mm + self.step_mm * i as f64, z_mm })
    }
}

impl Lump {
    pub(super) fn validate(self) -> Result<(), LabError> {
        let far = self
            .center_mm
            .into_iter()
            .fold(0.0, |far: f64, x| if x.is_finite() { far.max(x.abs()) } else { x });
        check("coordinate of --lump, mm", far, far.abs() <= 1e4, "-10000 to 10000")?;
        check("radius of --lump, mm", self.radius_mm, self.radius_mm > 0.0, "finite and above 0")?;
        check(
            "Young's modulus of --lump, Pa",
            self.youngs_pa,
            (1.0..=1e9).contains(&self.youngs_pa),
            "1 to 1e9",
        )
    }
}

pub(super) fn nodes(text: &str) -> Result<Nodes, &'static str> {
    let list: Vec<usize> = text.split(',').map(whole).collect::<Result<_, _>>()?;
    list.try_into().map(Nodes).map_err(|_| "it must be three numbers, as in 6,6,6")
}

pub(super) fn tool(text: &str) -> Result<Tool, &'static str> {
    let problem = "it must be sphere:RADIUS_M or punch:RADIUS_M, as in sphere:0.005";
    let (shape, radius) = text.trim().split_once(':').ok_or(problem)?;
    let radius_m = number(radius).map_err(|_| problem)?;
    match shape {
        "sphere" => Ok(Tool::Sphere { radius_m }),
        "punch" => Ok(Tool::Punch { radius_m }),
        _ => Err(problem),
    }
}

pub(super) fn place(text: &str) -> Result<Place, &'static str> {
    let [x_mm, z_mm] = numbers(text, ',').ok_or("it must be X_MM,Z_MM, as in 4.3,1")?;
    Ok(Place { x_mm, z_mm })
}

pub(super) fn scan(text: &str) -> Result<Scan, &'static str> {
    let [from_mm, to_mm, step_mm] = numbers(text, ':').ok_or("it must be FROM:TO:STEP, as in -20:20:2")?;
    Ok(Scan { from_mm, to_mm, step_mm })
}

pub(super) fn lump(text: &str) -> Result<Lump, &'static str> {
    let problem = "it must be X_MM,Y_MM,Z_MM:RADIUS_MM:YOUNGS_PA, as in 0,-15,0:8:100000";
    let [center, radius, youngs]: [&str; 3] =
        text.split(':').collect::<Vec<_>>().try_into().map_err(|_| problem)?;
    let center_mm = numbers(center, ',').ok_or(problem)?;
    let (radius_mm, youngs_pa) =
        number(radius).and_then(|r| Ok((r, number(youngs)?))).map_err(|_| problem)?;
    Ok(Lump { center_mm, radius_mm, youngs_pa })
}

/// Exactly `N` numbers between separators.
fn numbers<const N: usize>(text: &str, separator: char) -> Option<[f64; N]> {
    let list: Vec<f64> = text.split(separator).map(number).collect::<Result<_, _>>().ok()?;
    list.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scan_includes_its_end_where_steps_meet_it() {
        let scan = scan("-2:2:0.1").unwrap();
        assert_eq!(scan.count(), 41);
        let last = scan.places(3.0).last().unwrap();
        assert!((last.x_mm - 2.0).abs() < 1e-12 && last.z_mm == 3.0);
        assert_eq!(Scan { from_mm: 0.0, to_mm: 1.0, step_mm: 0.3 }.count(), 4);
    }

    #[test]
    fn texts_of_other_forms_are_rejected() {
        for text in ["sphere", "cube:1", "sphere:x", "punch:0.1:2"] {
            assert!(tool(text).is_err(), "{text}");
        }
        assert!(place("1").is_err() && place("1,2,3").is_err() && place("1;2").is_err());
        assert!(scan("0:1").is_err() && lump("0,0,0:1").is_err() && lump("0,0:1:1").is_err());
        assert_eq!(tool("punch:0.005"), Ok(Tool::Punch { radius_m: 0.005 }));
    }
}
