//! The options of `[input]`.

use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::points::classes::{IGNORED_GROUND, is_noise};
use crate::points::kept_heights::KeptHeights;
use crate::points::nodata_choice::NodataChoice;
use crate::points::optional_fields::OptionalFields;
use crate::points::returns::KeptReturns;
use crate::remote::name::{is_url, public_name};
use crate::surface::{MeshOf, Surface};
use crate::text::options::TextOptions;
use crate::text::row_choice::RowChoice;
use crs::choice::CrsChoice;
use crs::target::{NamedCrs, TargetCrs};
use crs::transform::datum_rule::DatumRule;
use crs::unit::Unit;
use ground::GroundSizes;
use lattice::shortest_decimal;

/// Tells whether a name in the options is a URL and no path.
pub fn is_by_url(name: &str) -> bool {
    is_url(name)
}

/// `[input]`: which points a job reads.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputOptions {
    /// Paths, folders or globs, relative to the configuration file, or URLs, with dots in place of their queries.
    pub files: Vec<String>,
    /// Which surface the job makes: a choice of classes or returns.
    #[serde(default)]
    pub surface: Surface,
    /// Keep only these returns of each pulse.
    #[serde(default)]
    pub returns: KeptReturns,
    /// Keep only these classes. The default is all classes but noise (7, 18), and with breaklines also without ignored ground (20).
    #[serde(default)]
    pub classes: Option<Vec<u8>>,
    /// Whether the default leaves out class 20 too: points near breaklines, which these stand for. That follows from `[[breaklines]]`, and
    /// what a user writes here does not count.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub without_ignored_ground: bool,
    /// Keep only the points within this rectangle, in the system of the job: with `to_crs`, in that.
    #[serde(default)]
    pub bounds: Option<SourceBounds>,
    /// Keep only the points within the polygons of this file: its path, relative to the configuration file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clip: Option<String>,
    /// The box of these polygons in source units, once the job knows it: [xmin, ymin, xmax, ymax].
    #[serde(skip)]
    pub clip_box: Option<[f64; 4]>,
    /// Keep only the points between these heights, in the unit of the files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heights: Option<KeptHeights>,
    /// Which heights are left out because they stand for nodata.
    #[serde(default, skip_serializing_if = "NodataChoice::is_auto")]
    pub nodata: NodataChoice,
    /// Which of several points with the same x and y the job keeps.
    #[serde(default)]
    pub duplicates: Duplicates,
    /// The coordinate reference system of all files.
    #[serde(default)]
    pub crs: CrsChoice,
    /// The coordinate reference system of the files that name none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing_crs: Option<NamedCrs>,
    /// The coordinate reference system that all points are transformed into. Without it, none are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_crs: Option<TargetCrs>,
    /// Which datums are one when points are transformed.
    #[serde(default, skip_serializing_if = "DatumRule::is_default")]
    pub datums: DatumRule,
    /// What the job does if points lie far outside the area that their coordinate reference system is made for.
    #[serde(default, skip_serializing_if = "OutsideCrsArea::is_default")]
    pub outside_crs_area: OutsideCrsArea,
    /// The unit of x and y.
    #[serde(default)]
    pub unit: UnitChoice,
    /// The unit of z.
    #[serde(default, skip_serializing_if = "UnitChoice::is_auto")]
    pub height_unit: UnitChoice,
    /// The step of the lattice in x and y.
    #[serde(default)]
    pub resolution: ResolutionChoice,
    /// The step of the lattice in z.
    #[serde(default)]
    pub resolution_z: ResolutionChoice,
    /// The fraction of malformed records or lines up to which the job goes on.
    #[serde(default, alias = "malformed_share")]
    pub max_malformed_fraction: Fraction,
    /// What the job does with a file that cannot be used.
    #[serde(default)]
    pub on_bad_file: OnBadFile,
    /// How the program finds the ground by itself.
    #[serde(default, skip_serializing_if = "GroundSizes::is_default")]
    pub bare_earth: GroundSizes,
    /// How text files are laid out, if detection gets it wrong.
    #[serde(default)]
    pub csv: TextOptions,
}

impl InputOptions {
    /// Puts public names in place of URLs, so that no query can be written down.
    ///
    /// # Errors
    /// A sentence about a URL that cannot be read.
    pub fn hide_queries(&mut self) -> Result<(), String> {
        for file in self.files.iter_mut().filter(|file| is_url(file)) {
            *file = public_name(file)?;
        }
        Ok(())
    }

    /// Returns which of the 256 classification codes the job keeps.
    pub fn kept_classes(&self) -> [bool; 256] {
        match &self.classes {
            Some(classes) => {
                let mut kept = [false; 256];
                classes.iter().for_each(|&class| kept[class as usize] = true);
                kept
            }
            None => std::array::from_fn(|class| {
                let class = class as u8;
                let is_kept = self.surface.classes().map_or(!is_noise(class), |classes| classes.contains(&class));
                is_kept && !(class == IGNORED_GROUND && self.without_ignored_ground)
            }),
        }
    }

    /// Tells whether the program finds the ground by itself.
    pub fn finds_ground(&self) -> bool {
        self.surface == Surface::BareEarth
    }

    /// Returns whether the options choose classes, so that it matters if a text has none.
    pub fn chooses_classes(&self) -> bool {
        self.classes.is_some() || self.surface.classes().is_some()
    }

    /// Returns which returns the job keeps.
    pub fn kept_returns(&self) -> KeptReturns {
        match self.surface.returns() {
            KeptReturns::All => self.returns,
            returns => returns,
        }
    }

    /// Returns which points the mesh is made of, for a sentence about it.
    pub fn mesh_of(&self) -> MeshOf {
        match (&self.classes, self.kept_returns(), self.surface) {
            (_, _, Surface::BareEarth) => MeshOf::Surface(Surface::BareEarth),
            (None, KeptReturns::All, surface) => MeshOf::Surface(surface),
            (None, KeptReturns::First, Surface::All | Surface::First) => MeshOf::Surface(Surface::First),
            (None, KeptReturns::Last, Surface::All | Surface::Last) => MeshOf::Surface(Surface::Last),
            _ => MeshOf::Chosen,
        }
    }

    /// Returns whether the options leave out points of some place, class or return. Noise does not count.
    pub fn has_filter(&self) -> bool {
        self.bounds.is_some() || self.clip.is_some() || self.chooses_kinds()
    }

    /// Returns the rectangle that `bounds` and the box of `clip` share, [xmin, ymin, xmax, ymax]; inside out if they are apart. Outside of
    /// it no point is wanted.
    pub fn rectangle(&self) -> Option<[f64; 4]> {
        let bounds = self.bounds.map(|bounds| bounds.0);
        match (bounds, self.clip_box) {
            (Some(a), Some(b)) => Some([a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])]),
            _ => bounds.or(self.clip_box),
        }
    }

    /// Returns whether the options leave out points of some class or return. Noise does not count.
    pub fn chooses_kinds(&self) -> bool {
        self.finds_ground() || self.chooses_classes() || self.kept_returns() != KeptReturns::All
    }

    /// Returns what contradicts `surface`, if something does. `classes` may take some of the classes of the ground, and `returns` some
    /// of its returns.
    pub fn contradiction(&self) -> Option<String> {
        let is_other = |class: &&u8| self.surface.classes().is_some_and(|ground| !ground.contains(class));
        if let Some(class) = self.classes.iter().flatten().find(is_other) {
            return Some(format!(
                "surface = \"ground\" keeps ground and water (classes 2, 8, 9 and 20), and class {class} in classes is neither: leave \
                 out one of the two keys"
            ));
        }
        if self.bare_earth != GroundSizes::default() && !self.finds_ground() {
            return Some("bare_earth only applies with surface = \"bare-earth\": set that, or remove the table".into());
        }
        let returns = self.surface.returns();
        let is_open = [returns, self.returns].contains(&KeptReturns::All) || returns.is_same(self.returns);
        (!is_open).then(|| "surface and returns choose different returns: leave out one of the two keys".into())
    }

    /// Tells whether the job needs the numbers of points, to know which was read first.
    pub fn needs_numbers(&self) -> bool {
        self.duplicates == Duplicates::First
    }

    /// Returns which rows of a text the job wants, and which `fields` of them.
    pub fn row_choice(&self, fields: OptionalFields) -> RowChoice {
        RowChoice {
            // Bounds are in the system of the job, which the rows of a text may have to be transformed into.
            bounds: self.bounds.filter(|_| self.to_crs.is_none()).map(|bounds| bounds.0),
            is_transformed: self.to_crs.is_some(),
            has_unit: self.unit.unit() != Unit::Unknown,
            is_crs_stated: self.missing_crs.is_some() || !matches!(self.crs, CrsChoice::Auto | CrsChoice::First),
            is_foot_stated: matches!(self.unit, UnitChoice::Foot | UnitChoice::UsFoot),
            classes: self.kept_classes(),
            strict_classes: self.chooses_classes(),
            returns: self.kept_returns(),
            heights: self.heights,
            nodata: self.nodata.clone(),
            use_index: self.bounds.is_some() || self.clip.is_some(),
            fields,
        }
    }
}

/// Which of several points with the same x and y the job keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Duplicates {
    /// The one with the least z.
    #[default]
    Lowest,
    /// The one with the greatest z.
    Highest,
    /// The one that is read first, in the order of the files.
    First,
}

/// What the job does with a file that is not a point cloud, is damaged, or has too many malformed records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OnBadFile {
    /// It stops with an error.
    #[default]
    Stop,
    /// It leaves the whole file out and says so.
    Skip,
}

/// What the job does if points lie far outside the area of use of their coordinate reference system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutsideCrsArea {
    /// It stops with an error.
    #[default]
    Stop,
    /// It goes on with a warning.
    Warn,
}

impl OutsideCrsArea {
    /// Returns whether the job does what the program does by itself.
    pub(crate) fn is_default(&self) -> bool {
        *self == OutsideCrsArea::Stop
    }
}

/// A unit that the user chooses: of x and y of points, or of heights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UnitChoice {
    /// The unit that the CRS says; where there is none, metres for x and y, and for heights the unit of those of the points.
    #[default]
    Auto,
    /// The metre.
    Metre,
    /// The international foot, 0.3048 m.
    Foot,
    /// The US survey foot, 1200/3937 m.
    UsFoot,
}

impl UnitChoice {
    /// Tells whether the files decide.
    fn is_auto(&self) -> bool {
        *self == UnitChoice::Auto
    }

    /// Returns the unit that is chosen, or [`Unit::Unknown`].
    pub fn unit(self) -> Unit {
        match self {
            UnitChoice::Auto => Unit::Unknown,
            UnitChoice::Metre => Unit::Metre,
            UnitChoice::Foot => Unit::Foot,
            UnitChoice::UsFoot => Unit::UsFoot,
        }
    }

    /// Returns its length in metres, if one is chosen.
    pub fn metres(self) -> Option<f64> {
        self.unit().metres_per_unit()
    }
}

/// What is wrong with the value of an option.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidValue {
    /// Not a rectangle.
    #[error("bounds are [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax, not {0:?}")]
    Bounds([f64; 4]),
    /// Another number of numbers.
    #[error("bounds are four numbers, [xmin, ymin, xmax, ymax], without heights, and not {0}")]
    BoundsCount(usize),
    /// Not a range of heights.
    #[error("heights are two numbers, [lowest, highest] with lowest < highest, not {0:?}")]
    Heights(Vec<f64>),
    /// Not a step.
    #[error("resolution is \"auto\" or a positive number of source units, such as 0.01")]
    Resolution,
    /// Not a fraction.
    #[error("a fraction lies between 0 and 1, not {0}")]
    Fraction(f64),
}

/// A rectangle [xmin, ymin, xmax, ymax] in source units, borders included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>")]
pub struct SourceBounds(pub [f64; 4]);

impl TryFrom<Vec<f64>> for SourceBounds {
    type Error = InvalidValue;

    fn try_from(numbers: Vec<f64>) -> Result<SourceBounds, InvalidValue> {
        let b: [f64; 4] = numbers.try_into().map_err(|numbers: Vec<f64>| InvalidValue::BoundsCount(numbers.len()))?;
        if b.iter().any(|v| !v.is_finite()) || b[0] >= b[2] || b[1] >= b[3] {
            return Err(InvalidValue::Bounds(b));
        }
        Ok(SourceBounds(b))
    }
}

/// A step of the lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "String")]
pub enum ResolutionChoice {
    /// The job chooses it from the steps of its inputs.
    #[default]
    Auto,
    /// This step in source units, above 0.
    Step(Decimal),
}

impl ResolutionChoice {
    /// Returns the user's step, if there is one.
    pub fn step(self) -> Option<Decimal> {
        match self {
            ResolutionChoice::Auto => None,
            ResolutionChoice::Step(step) => Some(step),
        }
    }
}

/// A user writes a number. A step that a program wrote down is text, so that no digit is lost.
impl TryFrom<Vec<f64>> for KeptHeights {
    type Error = InvalidValue;

    fn try_from(numbers: Vec<f64>) -> Result<KeptHeights, InvalidValue> {
        match <[f64; 2]>::try_from(numbers) {
            Ok([low, high]) if low.is_finite() && high.is_finite() && low < high => Ok(KeptHeights([low, high])),
            Ok(heights) => Err(InvalidValue::Heights(heights.to_vec())),
            Err(numbers) => Err(InvalidValue::Heights(numbers)),
        }
    }
}

impl TryFrom<toml::Value> for ResolutionChoice {
    type Error = InvalidValue;

    fn try_from(value: toml::Value) -> Result<ResolutionChoice, InvalidValue> {
        let number = match value {
            toml::Value::String(text) if text == "auto" => return Ok(ResolutionChoice::Auto),
            toml::Value::String(text) => Decimal::from_str_exact(&text).ok(),
            toml::Value::Integer(number) => Some(Decimal::from(number)),
            toml::Value::Float(number) => shortest_decimal(number),
            _ => None,
        };
        let step = number.filter(|step| *step > Decimal::ZERO).ok_or(InvalidValue::Resolution)?;
        Ok(ResolutionChoice::Step(step))
    }
}

impl From<ResolutionChoice> for String {
    fn from(resolution: ResolutionChoice) -> String {
        resolution.step().map_or("auto".into(), |step| step.to_string())
    }
}

/// A number from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f64")]
pub struct Fraction(pub f64);

impl TryFrom<f64> for Fraction {
    type Error = InvalidValue;

    fn try_from(fraction: f64) -> Result<Fraction, InvalidValue> {
        if (0.0..=1.0).contains(&fraction) { Ok(Fraction(fraction)) } else { Err(InvalidValue::Fraction(fraction)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mesh_is_that_of_a_surface_or_of_what_is_listed() {
        for (text, mesh) in [
            ("", MeshOf::Surface(Surface::All)),
            ("surface = \"ground\"", MeshOf::Surface(Surface::Ground)),
            ("returns = \"last\"", MeshOf::Surface(Surface::Last)),
            ("surface = \"first\"", MeshOf::Surface(Surface::First)),
            ("classes = [6]", MeshOf::Chosen),
            ("surface = \"first\"\nclasses = [2]", MeshOf::Chosen),
            ("returns = [2]", MeshOf::Chosen),
        ] {
            let options: InputOptions = toml::from_str(&format!("files = [\"a\"]\n{text}")).unwrap();
            assert_eq!(options.mesh_of(), mesh, "{text}");
        }
    }

    #[test]
    fn points_have_numbers_where_their_order_decides() {
        for (text, needed) in [
            ("", false),
            ("duplicates = \"lowest\"", false),
            ("duplicates = \"highest\"\non_bad_file = \"stop\"", false),
            ("duplicates = \"first\"", true),
            ("on_bad_file = \"skip\"", false),
        ] {
            let options: InputOptions = toml::from_str(&format!("files = [\"a\"]\n{text}")).unwrap();
            assert_eq!(options.needs_numbers(), needed, "{text}");
        }
    }

    #[test]
    fn heights_are_a_lower_and_a_higher_one() {
        for wrong in [vec![1.0], vec![2.0, 1.0], vec![1.0, 1.0], vec![0.0, f64::NAN], vec![0.0, 1.0, 2.0]] {
            assert!(KeptHeights::try_from(wrong).is_err());
        }
    }

    #[test]
    fn options_are_read_back_as_they_were_written() {
        for resolution in ["0.01", "1e-7", "25", "\"auto\""] {
            let text = format!(
                "files = [\"a\"]\nclasses = [2, 9]\nbounds = [0.1, 0, 1e300, 4]\nresolution = {resolution}\n\
                 max_malformed_fraction = 0.3\ncsv = {{ delimiter = \";\" }}"
            );
            let options: InputOptions = toml::from_str(&text).unwrap();
            let written = serde_json::to_string(&options).unwrap();
            let read: InputOptions = serde_json::from_str(&written).unwrap();
            assert_eq!((read.resolution, read.bounds), (options.resolution, options.bounds), "{written}");
            assert_eq!(serde_json::to_string(&read).unwrap(), written);
        }
    }
}
