//! The options of `[[breaklines]]`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::options::UnitChoice;
use breaklines::FeatureKind;
use crs::choice::CrsChoice;
use crs::system::Crs;

/// `[[breaklines]]`: files of lines that become edges of the mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineOptions {
    /// Paths or globs, relative to the configuration file.
    pub files: Vec<String>,
    /// What all features are. Without this and `kind_field` they are lines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<FeatureKind>,
    /// The attribute that says what a feature is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind_field: Option<String>,
    /// What the values of `kind_field` mean. Features with other values are left out. Without it, the values are names of kinds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kinds: Option<BTreeMap<String, FeatureKind>>,
    /// About how long an edge along a line is.
    #[serde(default)]
    pub spacing: LineSpacing,
    /// Where heights come from.
    #[serde(default)]
    pub heights: LineHeights,
    /// The attribute with the height of a feature, which takes the place of the heights of its vertices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_field: Option<String>,
    /// The unit of the heights of these files, of their vertices and of `height_field`.
    #[serde(default)]
    pub height_unit: UnitChoice,
    /// The layer of a GeoPackage, if it has several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layer: Option<String>,
    /// The coordinate reference system of these files.
    #[serde(default)]
    pub crs: LineCrs,
    /// What the files are read for.
    #[serde(skip)]
    pub purpose: LinePurpose,
}

/// What files of lines and polygons are read for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinePurpose {
    /// The edges of `[[breaklines]]`.
    #[default]
    Breaklines,
    /// The area of `[input] clip`. Only polygons are read, and no heights.
    Clip,
    /// Places on a written terrain, which a command lists with their names.
    Places,
}

impl LinePurpose {
    /// Tells whether the names of features are read.
    pub(crate) fn has_names(self) -> bool {
        self == LinePurpose::Places
    }

    /// Returns what messages call the features.
    pub fn features(self) -> &'static str {
        match self {
            LinePurpose::Breaklines => "lines",
            LinePurpose::Clip => "polygons",
            LinePurpose::Places => "features",
        }
    }

    /// Returns what messages say of the geometries that are taken.
    pub(crate) fn requirement(self) -> &'static str {
        match self {
            LinePurpose::Breaklines => "breaklines are lines or areas",
            LinePurpose::Clip => "the area of a clip is polygons",
            LinePurpose::Places => "only lines and areas are taken",
        }
    }

    /// Returns what to do about the file at `path` if it has the coordinates of points without a CRS.
    pub fn remedy_of_local(self, path: &Path) -> String {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        match (self, ending.as_deref()) {
            (LinePurpose::Breaklines, _) => "set crs = \"points\" in [[breaklines]]".into(),
            (_, Some("gpkg" | "shp")) => {
                format!("write it without a CRS, for example with `ogr2ogr -a_srs none local.gpkg {}`", path.display())
            }
            _ => "write the member \"crs\": null into it".into(),
        }
    }

    /// Returns what to do about the file at `path` if it states no CRS that can be used.
    pub fn remedy_of_crs(self, path: &Path) -> String {
        match self {
            LinePurpose::Breaklines => "set crs in [[breaklines]] to the CRS of the lines".into(),
            LinePurpose::Clip | LinePurpose::Places => {
                format!(
                    "write the right one into it, for example with `ogr2ogr -a_srs EPSG:26915 corrected.gpkg {}`",
                    path.display()
                )
            }
        }
    }
}

impl LineOptions {
    /// Returns the options of the file at `path` whose polygons are the area of a job.
    pub fn of_clip(path: &Path) -> LineOptions {
        LineOptions {
            files: vec![path.to_string_lossy().into_owned()],
            kind: None,
            kind_field: None,
            kinds: None,
            spacing: LineSpacing::default(),
            heights: LineHeights::Points,
            height_field: None,
            height_unit: UnitChoice::default(),
            layer: None,
            crs: LineCrs::default(),
            purpose: LinePurpose::Clip,
        }
    }

    /// Returns the options for a file whose lines and areas are used as they are, without their heights, but with their names.
    pub fn of_named_places(path: &Path) -> LineOptions {
        LineOptions {
            files: vec![path.display().to_string()],
            kind: None,
            kind_field: None,
            kinds: None,
            spacing: LineSpacing::Auto,
            heights: LineHeights::Points,
            height_field: None,
            height_unit: UnitChoice::Auto,
            layer: None,
            crs: LineCrs::Auto,
            purpose: LinePurpose::Places,
        }
    }

    /// Returns a sentence about options that contradict each other, or that say nothing.
    pub fn contradiction(&self) -> Option<&'static str> {
        if self.files.is_empty() {
            return Some("[[breaklines]] files is empty: name at least one Shapefile, GeoPackage or GeoJSON file");
        }
        if self.heights == LineHeights::Points && self.height_field.is_some() {
            return Some("[[breaklines]] heights = \"points\" and height_field are both set: keep one of them");
        }
        if self.heights == LineHeights::Points && self.height_unit != UnitChoice::Auto {
            return Some("[[breaklines]] heights = \"points\" and height_unit are both set: keep one of them");
        }
        match (&self.kind, &self.kind_field, &self.kinds) {
            (Some(_), Some(_), _) => Some("[[breaklines]] kind and kind_field are both set: keep one of them"),
            (_, None, Some(_)) => Some("[[breaklines]] kinds maps the values of kind_field: set kind_field too"),
            _ => None,
        }
    }
}

/// Returns the kind of this name, in small or capital letters.
pub(crate) fn kind_of_name(name: &str) -> Option<FeatureKind> {
    match name.to_lowercase().as_str() {
        "line" => Some(FeatureKind::Line),
        "river" => Some(FeatureKind::River),
        "lake" => Some(FeatureKind::Lake),
        _ => None,
    }
}

/// About how long an edge along a line is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub enum LineSpacing {
    /// As long as the points are apart on average, as their headers claim.
    #[default]
    Auto,
    /// This length in source units, above 0.
    Length(f64),
}

impl TryFrom<toml::Value> for LineSpacing {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<LineSpacing, String> {
        let length = match value {
            toml::Value::String(text) if text == "auto" => return Ok(LineSpacing::Auto),
            toml::Value::Integer(number) => Some(number as f64),
            toml::Value::Float(number) => Some(number),
            _ => None,
        };
        let length = length.filter(|length| length.is_finite() && *length > 0.0).map(LineSpacing::Length);
        length.ok_or_else(|| "spacing is \"auto\" or a positive number of source units, such as 1.5".into())
    }
}

impl From<LineSpacing> for toml::Value {
    fn from(spacing: LineSpacing) -> toml::Value {
        match spacing {
            LineSpacing::Auto => toml::Value::String("auto".into()),
            LineSpacing::Length(length) => toml::Value::Float(length),
        }
    }
}

/// Where the heights of lines come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LineHeights {
    /// From the files.
    #[default]
    File,
    /// From the points of the cloud around, whatever the files say.
    Points,
}

impl LineCrs {
    /// Returns whether it counts what a file says. If not, what it says may be wrong, and is not read.
    pub(super) fn is_read(&self) -> bool {
        *self == LineCrs::Auto
    }
}

/// The coordinate reference system of files of lines.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum LineCrs {
    /// What each file says.
    #[default]
    Auto,
    /// That of the points, whatever the files say.
    OfPoints,
    /// This one, whatever the files say.
    Given {
        /// As the user wrote it: codes or well-known text.
        text: String,
        /// What it means.
        crs: Box<Crs>,
    },
}

impl TryFrom<String> for LineCrs {
    type Error = String;

    fn try_from(text: String) -> Result<LineCrs, String> {
        let refused = |text: &str| {
            format!(
                "crs of [[breaklines]] is \"auto\", \"points\" (that of the points, which overrides the files), an EPSG code such as \
                 \"EPSG:26915\", or well-known text, not {text:?}"
            )
        };
        if text.trim() == "points" {
            return Ok(LineCrs::OfPoints);
        }
        match CrsChoice::try_from(text.clone()) {
            Ok(CrsChoice::Auto) => Ok(LineCrs::Auto),
            Ok(CrsChoice::Given { text, crs }) => Ok(LineCrs::Given { text, crs }),
            Err(what) if what.starts_with("crs: ") => Err(what),
            _ => Err(refused(&text)),
        }
    }
}

impl From<LineCrs> for String {
    fn from(crs: LineCrs) -> String {
        match crs {
            LineCrs::Auto => "auto".into(),
            LineCrs::OfPoints => "points".into(),
            LineCrs::Given { text, .. } => text,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(rest: &str) -> Result<LineOptions, String> {
        toml::from_str(&format!("files = [\"a.shp\"]\n{rest}")).map_err(|error| error.to_string())
    }

    #[test]
    fn options_are_read_back_as_they_were_written() {
        for text in [
            "",
            "kind = \"river\"\nspacing = 2",
            "kind_field = \"T\"\nkinds = { \"1\" = \"lake\" }\nspacing = \"auto\"\nheight_field = \"Z\"\ncrs = \"points\"",
            "height_unit = \"us-foot\"\nlayer = \"banks\"\nspacing = 0.5\ncrs = \"EPSG:26915\"",
        ] {
            let read = options(text).unwrap();
            assert_eq!(read.contradiction(), None);
            let written = serde_json::to_string(&read).unwrap();
            assert_eq!(serde_json::from_str::<LineOptions>(&written).unwrap(), read, "{written}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        for (text, word) in [
            ("kind = \"pond\"", "river"),
            ("spacing = 0", "positive"),
            ("spacing = nan", "positive"),
            ("crs = \"first\"", "points"),
            ("crs = \"EPSG:1\"", "EPSG:1 is not"),
            ("kinds = { a = \"creek\" }", "river"),
            ("height_unit = \"feet\"", "us-foot"),
        ] {
            let error = options(text).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
        assert!(options("kind = \"line\"\nkind_field = \"T\"").unwrap().contradiction().is_some());
        assert!(options("kinds = { a = \"lake\" }").unwrap().contradiction().is_some());
        assert!(options("heights = \"points\"\nheight_unit = \"foot\"").unwrap().contradiction().is_some());
        assert!(toml::from_str::<LineOptions>("files = []").unwrap().contradiction().is_some());
        assert_eq!(kind_of_name("RIVER"), Some(FeatureKind::River));
    }
}
