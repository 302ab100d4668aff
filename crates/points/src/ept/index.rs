//! The index of an EPT: the file `ept.json`.

use std::collections::HashSet;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use crate::ept::binary::BinaryLayout;
use crate::ept::dimension::Dimension;
use crate::las::header::axis_of;
use crate::points::axis::{AXIS_NAMES, Axis};
use crs::from_records::from_records;
use crs::geokeys::GeoKeys;
use crs::{Crs, NamedCrs};
use sys::{Error, Result, Warnings};

/// The most points of a data set: their numbers must fit 40 bits.
const MOST_POINTS: u64 = 1 << 40;

/// What the file says.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct IndexFile {
    bounds: [f64; 6],
    #[serde(default)]
    bounds_conforming: Option<[f64; 6]>,
    data_type: String,
    #[serde(default)]
    hierarchy_type: Option<String>,
    points: u64,
    schema: Vec<Dimension>,
    #[serde(default)]
    srs: Option<SystemOfIndex>,
    #[serde(default)]
    version: Value,
}

/// The coordinate reference system. A data set without one has an empty object.
#[derive(Deserialize)]
struct SystemOfIndex {
    #[serde(default)]
    horizontal: Value,
    #[serde(default)]
    vertical: Value,
    #[serde(default)]
    wkt: Option<String>,
}

/// How nodes hold their points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DataType {
    /// As LAZ.
    Laszip,
    /// As records.
    Binary,
    /// As records that are compressed together.
    Zstandard,
}

/// The index, checked.
pub(crate) struct EptIndex {
    pub(crate) data_type: DataType,
    pub(crate) points: u64,
    /// The cube of the octree: least x, y, z, and its sides.
    pub(crate) cube: ([f64; 3], [f64; 3]),
    /// Least and greatest x, y, z of the points.
    pub(crate) bounds: [[f64; 3]; 2],
    pub(crate) axes: [Axis; 3],
    pub(crate) has_rgb: bool,
    /// The records of nodes that are not LAZ.
    pub(crate) layout: BinaryLayout,
    pub(crate) crs: Crs,
}

impl EptIndex {
    /// Reads the text of the index at `path`.
    ///
    /// # Errors
    /// [`Error::Input`] if it is none, or points are held in a way that is not read.
    pub(crate) fn parse(path: &Path, text: &[u8], warnings: &mut Warnings) -> Result<EptIndex> {
        let refused = |what: String| Error::input(path, what);
        let file: IndexFile =
            serde_json::from_slice(text).map_err(|error| refused(format!("is not a readable EPT index: {error}")))?;
        if !is_known_version(&file.version) {
            return Err(refused(format!(
                "has the version {} of EPT: only versions 1.0 to 1.x are supported",
                file.version
            )));
        }
        let data_type = match file.data_type.as_str() {
            "laszip" => DataType::Laszip,
            "binary" => DataType::Binary,
            "zstandard" => DataType::Zstandard,
            other => {
                let what = format!(
                    "has nodes of the type {other:?}: only \"laszip\", \"binary\" and \"zstandard\" are supported"
                );
                return Err(refused(what));
            }
        };
        if let Some(other) = file.hierarchy_type.as_ref().filter(|kind| *kind != "json") {
            return Err(refused(format!("has a hierarchy of the type {other:?}: only \"json\" is supported")));
        }
        if file.points >= MOST_POINTS {
            return Err(refused(format!("claims {} points, more than one job can hold", file.points)));
        }
        let axes = [0, 1, 2].map(|axis| axis_in(&file.schema, axis).map_err(refused));
        let [x, y, z] = axes;
        let mut names = HashSet::new();
        if let Some(twice) = file.schema.iter().find(|dimension| !names.insert(&dimension.name)) {
            return Err(refused(format!("has the dimension {} twice in its schema", twice.name)));
        }
        let [min, max] = corners(file.bounds);
        let side = [0, 1, 2].map(|axis| max[axis] - min[axis]);
        if side.iter().any(|side| !(side.is_finite() && *side > 0.0)) {
            return Err(refused(format!("has bounds that are not a cube: {:?}", file.bounds)));
        }
        let bounds = match file.bounds_conforming.map(corners) {
            Some(conforming) if are_within(conforming, [min, max]) => conforming,
            Some(conforming) => {
                warnings.push(format!(
                    "has boundsConforming {conforming:?}, which are not within its bounds {:?} and are ignored",
                    [min, max]
                ));
                [min, max]
            }
            None => [min, max],
        };
        let has = |name: &str| file.schema.iter().any(|dimension| dimension.name == name);
        Ok(EptIndex {
            data_type,
            points: file.points,
            cube: (min, side),
            bounds,
            axes: [x?, y?, z?],
            has_rgb: ["Red", "Green", "Blue"].into_iter().all(has),
            layout: BinaryLayout::of(&file.schema).map_err(refused)?,
            crs: file.srs.map_or(Ok(Crs::default()), |srs| srs.system(warnings))?,
        })
    }
}

/// Returns the least and the greatest corner of a box, which are written one after the other.
fn corners([xmin, ymin, zmin, xmax, ymax, zmax]: [f64; 6]) -> [[f64; 3]; 2] {
    [[xmin, ymin, zmin], [xmax, ymax, zmax]]
}

/// Tells whether a box lies within the cube, or reaches beyond it by less than a thousandth of its side, as rounding may do.
fn are_within([least, greatest]: [[f64; 3]; 2], [min, max]: [[f64; 3]; 2]) -> bool {
    (0..3).all(|axis| {
        let slack = (max[axis] - min[axis]) / 1024.0;
        least[axis] >= min[axis] - slack && greatest[axis] <= max[axis] + slack && least[axis] <= greatest[axis]
    })
}

/// Tells whether an index of this version can be read. Some writers leave it out.
fn is_known_version(version: &Value) -> bool {
    let text = match version {
        Value::Null => return true,
        Value::String(text) => text.trim().to_string(),
        other => other.to_string(),
    };
    text == "1" || text.starts_with("1.")
}

/// Returns what the integers of an axis mean. Without a scale they are whole units.
fn axis_in(schema: &[Dimension], axis: usize) -> std::result::Result<Axis, String> {
    let name = ["X", "Y", "Z"][axis];
    let dimension = schema.iter().find(|dimension| dimension.name == name);
    let dimension = dimension.ok_or_else(|| format!("has no dimension {name} in its schema"))?;
    if !["signed", "unsigned"].contains(&dimension.kind.as_str()) {
        return Err(format!(
            "has {name} as {} numbers without a scale, so they are on no lattice: build it again with a scale, for example with \
             `entwine build \
             --scale 0.01`",
            dimension.kind
        ));
    }
    axis_of(dimension.scale.unwrap_or(1.0), dimension.offset.unwrap_or(0.0)).map_err(|(what, value)| {
        format!("has {value:e} as the {what} of {} in its schema, which is not a usable number", AXIS_NAMES[axis])
    })
}

impl SystemOfIndex {
    /// Returns the system of the well-known text, or else of the codes.
    fn system(self, warnings: &mut Warnings) -> Result<Crs> {
        let keys = GeoKeys { directory: Vec::new(), doubles: Vec::new(), texts: Vec::new() };
        let texts = self.wkt.as_ref().map(|text| Ok(text.clone().into_bytes()));
        let crs = from_records(texts.into_iter(), &keys, warnings)?;
        let [horizontal, vertical] = [&self.horizontal, &self.vertical].map(code_of);
        let Some(horizontal) = horizontal.filter(|_| crs == Crs::default()) else { return Ok(crs) };
        let codes = vertical.map_or(horizontal.clone(), |vertical| format!("{horizontal}+{vertical}"));
        match NamedCrs::try_from(format!("EPSG:{codes}")) {
            Ok(named) => Ok(*named.crs),
            Err(why) => {
                warnings.push(format!("its coordinate system (EPSG:{codes}) is unknown ({why}); fix: [input] crs"));
                Ok(crs)
            }
        }
    }
}

/// Returns the digits of a code, which are a text, or a number.
fn code_of(value: &Value) -> Option<String> {
    let text = match value {
        Value::String(text) => text.trim().to_string(),
        Value::Number(number) => number.to_string(),
        _ => return None,
    };
    (!text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())).then_some(text)
}
