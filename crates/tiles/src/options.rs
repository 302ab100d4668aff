//! The options of `[output]`.

use crate::attributes::AttributeChoice;
use crate::compression::{Compression, CompressionChoice};
use crate::contour_options::ContourOptions;
use crate::imagery_url::ImageryUrl;
use crate::page::{NOT_BUILT_IN, is_built_in};
use crate::raster::options::RasterOptions;
use crate::terrain_options::TerrainOptions;
use crs::geoid::option::HeightOffset;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// `[output]`: where the results go, and what they are.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputOptions {
    /// The directory to write to, relative to the configuration file.
    #[serde(with = "sys::path_text")]
    pub directory: PathBuf,
    /// Where vertex colours come from.
    #[serde(default)]
    pub color: ColorChoice,
    /// What vertices carry of their points, for viewers to style by.
    #[serde(default, skip_serializing_if = "AttributeChoice::is_none")]
    pub attributes: AttributeChoice,
    /// Whether vertices have normals.
    #[serde(default = "yes")]
    pub normals: bool,
    /// The files for viewers.
    #[serde(default)]
    pub format: OutputFormat,
    /// Whether 3D Tiles have coarser levels above the exact tiles.
    #[serde(default = "yes")]
    pub levels: bool,
    /// The most sites in a coarser tile.
    #[serde(default, alias = "level_sites")]
    pub max_points_per_level_tile: MaxPointsPerLevelTile,
    /// What to add to heights so that they count from the ellipsoid, where 3D Tiles are placed on the globe.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_offset: Option<HeightOffset>,
    /// How tiles are packed.
    #[serde(default)]
    pub compression: CompressionChoice,
    /// How far a point may be from the mesh. `None` is a mesh of all points.
    #[serde(default, skip_serializing_if = "MaxError::is_none")]
    pub max_error: MaxError,
    /// Whether the job writes its inputs with the classes that it has found.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub classified: bool,
    /// The longest edge of a triangle that is not left out.
    #[serde(default)]
    pub max_edge: MaxEdge,
    /// Whether slivers along the hull are left out.
    #[serde(default)]
    pub hull: Hull,
    /// The formats of other programs that the mesh is written in too.
    #[serde(default, skip_serializing_if = "ExportChoice::is_empty")]
    pub export: ExportChoice,
    /// Whose the data are: viewers show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copyright: Option<Copyright>,
    /// Whether a page that shows the terrain is written beside it.
    #[serde(default, deserialize_with = "page")]
    pub page: bool,
    /// The map tiles that the page drapes over the terrain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imagery: Option<ImageryUrl>,
    /// The raster of heights, if there is to be one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub raster: Option<RasterOptions>,
    /// The contour lines, if there are to be some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contours: Option<ContourOptions>,
    /// The terrain tiles for globes, if there are to be some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<TerrainOptions>,
}

impl OutputOptions {
    /// Returns whose the data are, if the user says.
    pub fn copyright(&self) -> Option<&str> {
        self.copyright.as_ref().map(|copyright| copyright.0.as_str())
    }

    /// Tells whether vertices are selected from the points.
    pub fn selects(&self) -> bool {
        !self.max_error.is_none()
    }

    /// Returns how tiles are packed.
    pub fn packing(&self) -> Compression {
        match (self.compression, self.format) {
            (CompressionChoice::Auto, OutputFormat::Tiles3d) | (CompressionChoice::Meshopt, _) => Compression::Meshopt,
            (CompressionChoice::Auto, _) | (CompressionChoice::Quantized, _) => Compression::Quantized,
            (CompressionChoice::None, _) => Compression::None,
        }
    }
}

/// The longest [`Copyright`] in characters. Every file has it.
const LONGEST_COPYRIGHT: usize = 500;

/// Whose the data are: one line of text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Copyright(String);

impl TryFrom<String> for Copyright {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Copyright, String> {
        let is_line = !text.trim().is_empty() && !text.chars().any(is_no_text);
        match is_line && text.chars().count() <= LONGEST_COPYRIGHT {
            true => Ok(Copyright(text)),
            false => Err(format!(
                "copyright is one line of 1 to {LONGEST_COPYRIGHT} characters, without tabs and other characters that break \
                 or turn a line, such as \
                 \"(c) 2024 City of Example, CC BY 4.0\""
            )),
        }
    }
}

/// Tells whether a character is none of a line of text: a control character, a separator of lines or paragraphs, or one that turns round the
/// direction of what follows, also in the line that a viewer puts it into.
fn is_no_text(character: char) -> bool {
    let turns = matches!(character, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    character.is_control() || turns || matches!(character, '\u{2028}' | '\u{2029}')
}

impl From<Copyright> for String {
    fn from(copyright: Copyright) -> String {
        copyright.0
    }
}

/// Reads `page`, which only some builds of the program can write.
fn page<'de, D: Deserializer<'de>>(value: D) -> Result<bool, D::Error> {
    let wanted = bool::deserialize(value)?;
    if wanted && !is_built_in() {
        return Err(D::Error::custom(NOT_BUILT_IN));
    }
    Ok(wanted)
}

fn yes() -> bool {
    true
}

/// The files for viewers. The exact tiles are written in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutputFormat {
    /// Both if the terrain fits one file that viewers open, else 3D Tiles.
    #[default]
    Auto,
    /// One file, `terrain.glb`.
    Glb,
    /// 3D Tiles, `tileset.json`.
    #[serde(rename = "3dtiles", alias = "tiles")]
    Tiles3d,
}

/// A format of other programs that the exact mesh can be written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ExportFormat {
    /// LandXML 1.2.
    Landxml,
    /// DXF.
    Dxf,
    /// Wavefront OBJ.
    Obj,
    /// PLY.
    Ply,
}

impl ExportFormat {
    /// All formats, in the order in which they are written.
    pub const ALL: [ExportFormat; 4] = [ExportFormat::Landxml, ExportFormat::Dxf, ExportFormat::Obj, ExportFormat::Ply];

    /// Returns the word for the format.
    pub fn name(self) -> &'static str {
        match self {
            ExportFormat::Landxml => "landxml",
            ExportFormat::Dxf => "dxf",
            ExportFormat::Obj => "obj",
            ExportFormat::Ply => "ply",
        }
    }

    /// Returns the name of the file.
    pub fn file_name(self) -> &'static str {
        match self {
            ExportFormat::Landxml => "terrain.xml",
            ExportFormat::Dxf => "terrain.dxf",
            ExportFormat::Obj => "terrain.obj",
            ExportFormat::Ply => "terrain.ply",
        }
    }
}

/// The formats of other programs that the mesh is written in. Their order does not matter.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct ExportChoice(BTreeSet<ExportFormat>);

impl ExportChoice {
    /// Tells whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the formats in their order.
    pub fn formats(&self) -> impl Iterator<Item = ExportFormat> {
        self.0.iter().copied()
    }
}

impl TryFrom<Vec<String>> for ExportChoice {
    type Error = String;

    fn try_from(names: Vec<String>) -> std::result::Result<ExportChoice, String> {
        let format = |name: String| {
            let known = ExportFormat::ALL.into_iter().find(|format| format.name() == name);
            known.ok_or_else(|| {
                let all = ExportFormat::ALL.map(|format| format!("\"{}\"", format.name()));
                let near = if name.eq_ignore_ascii_case("dwg") { ": programs that know DWG open \"dxf\"" } else { "" };
                let [first, ..] = &all;
                format!("export is a list of {}, such as [{first}], not {name:?}{near}", all.join(", "))
            })
        };
        names.into_iter().map(format).collect::<std::result::Result<_, _>>().map(ExportChoice)
    }
}

impl From<ExportChoice> for Vec<String> {
    fn from(choice: ExportChoice) -> Vec<String> {
        choice.formats().map(|format| format.name().to_owned()).collect()
    }
}

/// Where vertex colours come from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum ColorChoice {
    /// The points' own colours, or elevation if they have none.
    #[default]
    Auto,
    /// The points' own colours.
    Rgb,
    /// A ramp over the heights.
    Elevation,
    /// A colour per class.
    Class,
    /// No colours.
    None,
    /// The pixels of an orthophoto, a GeoTIFF.
    Photo(PathBuf),
}

impl ColorChoice {
    /// Returns whether these may be the points' own colours.
    pub fn may_be_own(&self) -> bool {
        matches!(self, ColorChoice::Auto | ColorChoice::Rgb)
    }

    /// Returns the orthophoto, if colours come from one.
    pub fn photo(&self) -> Option<&Path> {
        match self {
            ColorChoice::Photo(path) => Some(path),
            _ => None,
        }
    }

    /// Returns the orthophoto, to be named otherwise.
    pub fn photo_mut(&mut self) -> Option<&mut PathBuf> {
        match self {
            ColorChoice::Photo(path) => Some(path),
            _ => None,
        }
    }
}

impl TryFrom<String> for ColorChoice {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<ColorChoice, String> {
        Ok(match text.as_str() {
            "auto" => ColorChoice::Auto,
            "rgb" => ColorChoice::Rgb,
            "elevation" => ColorChoice::Elevation,
            "class" => ColorChoice::Class,
            "none" => ColorChoice::None,
            name if is_name_of_tiff(name) => ColorChoice::Photo(PathBuf::from(text)),
            _ => {
                return Err(format!(
                    "color is \"auto\", \"rgb\", \"elevation\", \"class\", \"none\" or an orthophoto such as \"ortho.tif\", not {text:?}"
                ));
            }
        })
    }
}

impl From<ColorChoice> for String {
    fn from(choice: ColorChoice) -> String {
        match choice {
            ColorChoice::Auto => "auto".into(),
            ColorChoice::Rgb => "rgb".into(),
            ColorChoice::Elevation => "elevation".into(),
            ColorChoice::Class => "class".into(),
            ColorChoice::None => "none".into(),
            ColorChoice::Photo(path) => path.to_string_lossy().into_owned(),
        }
    }
}

/// Tells whether a text is the name of a TIFF, as a word for colours never is.
fn is_name_of_tiff(text: &str) -> bool {
    // A URL may have a query.
    let name = if text.contains("://") { text.split(['?', '#']).next().unwrap_or_default() } else { text };
    let ending = Path::new(name).extension().map(|ending| ending.to_ascii_lowercase());
    ending.is_some_and(|ending| ending == "tif" || ending == "tiff")
}

/// What becomes of the slivers along the hull: flat triangles with an edge much longer than the spacing of the points, between the points
/// at the edge of the terrain and the convex hull around them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Hull {
    /// They are left out.
    #[default]
    Trimmed,
    /// They stay, and the terrain reaches to the convex hull.
    Whole,
}

/// How far a point may be from the mesh along the vertical, in source units of height. Only points that this takes are vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub enum MaxError {
    /// All points are vertices.
    #[default]
    None,
    /// So many units.
    Units(f64),
}

impl MaxError {
    /// Tells whether all points are vertices.
    pub fn is_none(&self) -> bool {
        *self == MaxError::None
    }
}

impl TryFrom<toml::Value> for MaxError {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<MaxError, String> {
        let units = match value {
            toml::Value::String(s) if s == "none" => return Ok(MaxError::None),
            toml::Value::Integer(i) => i as f64,
            toml::Value::Float(f) => f,
            _ => -1.0,
        };
        match units > 0.0 && units.is_finite() {
            true => Ok(MaxError::Units(units)),
            false => Err("max_error is \"none\" or a positive number of source units of height, such as 0.1".into()),
        }
    }
}

impl From<MaxError> for toml::Value {
    fn from(max_error: MaxError) -> toml::Value {
        match max_error {
            MaxError::None => toml::Value::String("none".into()),
            MaxError::Units(units) => toml::Value::Float(units),
        }
    }
}

/// How long an edge of a triangle may be in the plane. Triangles with a longer edge are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub enum MaxEdge {
    /// Any length: no triangle is left out.
    #[default]
    None,
    /// Ten times the local spacing of the sites.
    Auto,
    /// This many source units.
    Length(f64),
}

impl TryFrom<toml::Value> for MaxEdge {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<MaxEdge, String> {
        let length = match value {
            toml::Value::String(s) if s == "none" => return Ok(MaxEdge::None),
            toml::Value::String(s) if s == "auto" => return Ok(MaxEdge::Auto),
            toml::Value::Integer(i) => i as f64,
            toml::Value::Float(f) => f,
            _ => 0.0,
        };
        match length > 0.0 && length.is_finite() {
            true => Ok(MaxEdge::Length(length)),
            false => Err("max_edge is \"none\", \"auto\" or a positive number of source units, such as 30.0".into()),
        }
    }
}

impl From<MaxEdge> for toml::Value {
    fn from(max_edge: MaxEdge) -> toml::Value {
        match max_edge {
            MaxEdge::None => toml::Value::String("none".into()),
            MaxEdge::Auto => toml::Value::String("auto".into()),
            MaxEdge::Length(length) => toml::Value::Float(length),
        }
    }
}

/// The most sites in a coarser tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub struct MaxPointsPerLevelTile(pub u64);

impl Default for MaxPointsPerLevelTile {
    /// Returns the default of the exact tiles.
    fn default() -> MaxPointsPerLevelTile {
        MaxPointsPerLevelTile(50_000)
    }
}

impl TryFrom<toml::Value> for MaxPointsPerLevelTile {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<MaxPointsPerLevelTile, String> {
        match value {
            toml::Value::String(s) if s == "auto" => Ok(MaxPointsPerLevelTile::default()),
            toml::Value::Integer(sites @ 100..=10_000_000) => Ok(MaxPointsPerLevelTile(sites as u64)),
            _ => Err("max_points_per_level_tile is \"auto\" or a whole number from 100 to 10000000".into()),
        }
    }
}

impl From<MaxPointsPerLevelTile> for toml::Value {
    fn from(points: MaxPointsPerLevelTile) -> toml::Value {
        toml::Value::Integer(points.0 as i64)
    }
}
