//! What a comparison has found, for people and programs.

use crate::written::{WrittenDifference, short_name};
use overlay::{FixedSum, Totals};
use serde::Serialize;
use std::fmt;
use sys::{ShownWarning, Warnings};
use terrain::TerrainSystem;

/// The difference of two terrains. Lengths are in metres, areas in square metres, volumes in cubic metres.
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// The output directory of the earlier terrain.
    pub before: String,
    /// The output directory of the later terrain.
    pub after: String,
    /// The CRS of both; `None` if it is unknown.
    pub crs: Option<String>,
    /// The unit of x and y of both.
    pub unit: String,
    /// The unit of heights of both.
    pub unit_z: String,
    /// Metres in a unit of x and y.
    pub metres_per_unit: f64,
    /// Metres in a unit of heights.
    pub metres_per_unit_z: f64,
    /// Smaller changes are left out of cut and fill, in units of heights.
    pub threshold: f64,
    /// The figures of the whole common area.
    #[serde(flatten)]
    pub figures: Figures,
    /// The area that only the earlier terrain covers.
    pub area_before_only: f64,
    /// The area that only the later terrain covers.
    pub area_after_only: f64,
    /// The figures within each polygon; `None` if none were given.
    pub areas: Option<Vec<AreaDifference>>,
    /// The files of the difference; `None` if none were wanted.
    pub written: Option<WrittenDifference>,
    /// What the user should know.
    pub warnings: Warnings,
}

/// Areas and volumes, in metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The common area.
    pub area: f64,
    /// What was removed.
    pub cut: f64,
    /// What was added.
    pub fill: f64,
    /// `fill - cut`.
    pub net: f64,
    /// The greatest rise, or 0.
    pub max_rise: f64,
    /// The greatest fall, or 0.
    pub max_fall: f64,
}

/// The figures within a polygon.
#[derive(Clone, Debug, Serialize)]
pub struct AreaDifference {
    /// The number of the feature in its file.
    pub number: u64,
    /// Its name, if it has one.
    pub name: Option<String>,
    /// The figures.
    #[serde(flatten)]
    pub figures: Figures,
}

/// The lengths of lattice steps in metres: in x and y, and in z.
pub(crate) struct Scale {
    plane: f64,
    up: f64,
}

impl Scale {
    /// `steps` are lattice steps in source units.
    pub(crate) fn new(steps: [f64; 2], system: &TerrainSystem) -> Scale {
        Scale { plane: steps[0] * system.metres[0], up: steps[1] * system.metres[1] }
    }

    /// Returns figures in metres; `None` if a sum was too large.
    pub(crate) fn figures(&self, totals: &Totals) -> Option<Figures> {
        let square = self.plane * self.plane;
        let cube = square * self.up;
        Some(Figures {
            area: totals.area.value()? * square,
            cut: totals.cut.value()? * cube,
            fill: totals.fill.value()? * cube,
            net: totals.fill.without(totals.cut).value()? * cube,
            max_rise: totals.max_rise * self.up,
            max_fall: totals.max_fall * self.up,
        })
    }

    /// Returns the square metres of an area outside the common area. What may be rounding of the latter is no area.
    pub(crate) fn area_only(&self, area: FixedSum, common: FixedSum) -> Option<f64> {
        const ROUNDING: f64 = 1e-12;
        let only = area.without(common).value()?;
        let is_rounding = only <= ROUNDING * area.value()?;
        Some(if is_rounding { 0.0 } else { only * self.plane * self.plane })
    }
}

impl Difference {
    /// Returns square and cubic metres in the square and the cubic unit, if heights have the unit of x and y and that is not the metre.
    fn unit_sizes(&self) -> Option<[f64; 3]> {
        let length = self.metres_per_unit;
        let has_own = self.unit == self.unit_z && length != 1.0;
        has_own.then_some([length, length * length, length * length * length])
    }

    fn row(&self, f: &mut fmt::Formatter<'_>, name: &str, value: f64, power: usize) -> fmt::Result {
        let sign = ["m", "m²", "m³"][power];
        let digits = 3;
        match self.unit_sizes() {
            None => writeln!(f, "{name:<24}{value:>22.digits$} {sign}"),
            Some(sizes) => {
                let unit = format!("{}{}", short_name(&self.unit), ["", "²", "³"][power]);
                let own = value / sizes[power];
                writeln!(f, "{name:<24}{value:>22.digits$} {sign:<4}{own:>22.digits$} {unit}")
            }
        }
    }

    fn rows(&self, f: &mut fmt::Formatter<'_>, figures: &Figures) -> fmt::Result {
        self.row(f, "common area", figures.area, 1)?;
        self.row(f, "cut", figures.cut, 2)?;
        self.row(f, "fill", figures.fill, 2)?;
        self.row(f, "net (fill - cut)", figures.net, 2)?;
        self.row(f, "greatest rise", figures.max_rise, 0)?;
        self.row(f, "greatest fall", figures.max_fall, 0)
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<24}{}", "before", self.before)?;
        writeln!(f, "{:<24}{}", "after", self.after)?;
        writeln!(f, "{:<24}{}", "CRS", self.crs.as_deref().unwrap_or("unknown"))?;
        if self.threshold > 0.0 {
            writeln!(
                f,
                "{:<24}changes below {} {} are left out of cut and fill",
                "threshold", self.threshold, self.unit_z
            )?;
        }
        self.rows(f, &self.figures)?;
        self.row(f, "area only before", self.area_before_only, 1)?;
        self.row(f, "area only after", self.area_after_only, 1)?;
        for area in self.areas.iter().flatten() {
            let name = area.name.as_deref().unwrap_or_default();
            writeln!(f, "\narea {} {name}", area.number)?;
            self.rows(f, &area.figures)?;
        }
        self.written.iter().try_for_each(|written| write!(f, "{written}"))?;
        self.warnings.iter().try_for_each(|warning| writeln!(f, "{}", ShownWarning(warning)))
    }
}
