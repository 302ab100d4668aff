//! The options of `[output.raster]`.

use crate::map_tiles::encoding::HeightEncoding;
use crate::raster::BLOCK;
use crate::raster::products::RasterProducts;
use lattice::shortest_decimal;
use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

/// `[output.raster]`: the terrain as a raster of heights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RasterOptions {
    /// The side of a cell.
    pub resolution: CellSize,
    /// Where a corner of a cell is; (0, 0) if the user says nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<CellOrigin>,
    /// What is written besides, or in place of, the heights.
    #[serde(default, skip_serializing_if = "RasterProducts::is_default")]
    pub products: RasterProducts,
    /// How the file is packed.
    #[serde(default)]
    pub compression: RasterCompression,
    /// What cells without a height hold.
    #[serde(default)]
    pub nodata: Nodata,
    /// The side of a file in cells, for a grid of files instead of one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cells_per_file: Option<FileSide>,
    /// How the heights are written as map tiles too; none if the user says nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pmtiles: Option<HeightEncoding>,
}

/// The side of a file of a grid of files in cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub struct FileSide(u32);

impl FileSide {
    /// Returns the number of cells.
    pub fn cells(self) -> u32 {
        self.0
    }
}

impl TryFrom<u32> for FileSide {
    type Error = String;

    fn try_from(cells: u32) -> Result<FileSide, String> {
        let fits = (BLOCK as u32..=1 << 19).contains(&cells);
        fits.then_some(FileSide(cells)).ok_or_else(|| {
            format!(
                "cells_per_file is the side of a file in cells, from {BLOCK} to 524288, such as 8192, and not {cells}"
            )
        })
    }
}

impl From<FileSide> for u32 {
    fn from(side: FileSide) -> u32 {
        side.0
    }
}

/// The side of a cell in source units: a positive decimal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub struct CellSize {
    exact: Decimal,
    /// The number that the user wrote.
    written: f64,
}

impl CellSize {
    /// Returns the side that a user wrote; `None` if it is not positive.
    pub fn of(written: f64) -> Option<CellSize> {
        let exact = shortest_decimal(written).filter(|exact| *exact > Decimal::ZERO)?;
        Some(CellSize { exact, written })
    }

    /// Returns the exact decimal.
    pub fn exact(self) -> Decimal {
        self.exact
    }

    /// Returns the nearest number.
    pub fn number(self) -> f64 {
        self.written
    }
}

impl TryFrom<toml::Value> for CellSize {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<CellSize, String> {
        let written = number(&value).unwrap_or_default();
        let what = "resolution is the side of a cell in source units, a positive number such as 0.5";
        CellSize::of(written).ok_or_else(|| what.into())
    }
}

impl From<CellSize> for toml::Value {
    fn from(size: CellSize) -> toml::Value {
        toml::Value::Float(size.written)
    }
}

/// The x and the y of a corner of a cell in source units: decimals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub struct CellOrigin {
    exact: [Decimal; 2],
    /// The numbers that the user wrote.
    written: [f64; 2],
}

impl CellOrigin {
    /// Returns the exact decimals.
    pub fn exact(self) -> [Decimal; 2] {
        self.exact
    }

    /// Returns the nearest numbers.
    pub fn numbers(self) -> [f64; 2] {
        self.written
    }
}

impl TryFrom<toml::Value> for CellOrigin {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<CellOrigin, String> {
        let numbers: Vec<f64> = value.as_array().into_iter().flatten().filter_map(number).collect();
        let is_pair = value.as_array().is_some_and(|all| all.len() == 2);
        let pair = <[f64; 2]>::try_from(numbers).ok().filter(|_| is_pair);
        let origin = pair.and_then(|written @ [x, y]| {
            let exact = [shortest_decimal(x)?, shortest_decimal(y)?];
            Some(CellOrigin { exact, written })
        });
        origin.ok_or_else(|| {
            "origin is the x and the y of a corner of a cell in source units, two numbers such as [0.5, 0.5]".into()
        })
    }
}

impl From<CellOrigin> for toml::Value {
    fn from(origin: CellOrigin) -> toml::Value {
        toml::Value::Array(origin.written.map(toml::Value::Float).into())
    }
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64))
}

/// How the blocks of the file are packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RasterCompression {
    /// DEFLATE after the predictor for floating-point numbers, without loss.
    #[default]
    Deflate,
    /// Plain numbers.
    None,
}

/// What cells without a height hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub struct Nodata(f32);

impl Default for Nodata {
    /// Programs that know no NaN know this number, and no terrain is there.
    fn default() -> Nodata {
        Nodata(-9999.0)
    }
}

impl Nodata {
    /// Returns the number.
    pub fn number(self) -> f32 {
        self.0
    }
}

/// Returns the number for no value as GDAL writes it into a file.
pub fn nodata_text(nodata: f32) -> String {
    if nodata.is_nan() { "nan".into() } else { f64::from(nodata).to_string() }
}

impl TryFrom<toml::Value> for Nodata {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<Nodata, String> {
        let number = match value {
            toml::Value::Integer(i) => i as f32,
            toml::Value::Float(f) if f.is_nan() => f32::NAN,
            // A number that is too small for single precision would become 0, which is a height.
            toml::Value::Float(f) if f != 0.0 && f as f32 == 0.0 => f32::INFINITY,
            toml::Value::Float(f) => f as f32,
            toml::Value::String(text) if text == "nan" => f32::NAN,
            _ => f32::INFINITY,
        };
        match number.is_infinite() {
            true => Err("nodata is a number that single precision can hold, such as -9999, or \"nan\"".into()),
            false => Ok(Nodata(number)),
        }
    }
}

impl From<Nodata> for toml::Value {
    fn from(nodata: Nodata) -> toml::Value {
        match nodata.0.is_nan() {
            // JSON, in which plans are written, has no such number.
            true => toml::Value::String("nan".into()),
            false => toml::Value::Float(f64::from(nodata.0)),
        }
    }
}
