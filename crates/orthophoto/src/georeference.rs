//! Where the pixels of a picture are.

use crate::errors::{PhotoError, if_there};
use crate::image::Image;
use crs::from_records::from_records;
use crs::geokeys::GeoKeys;
use crs::{Crs, CrsTransform, DatumNote, DatumRule, Sameness};
use sys::Warnings;
use tiff::tags::Tag;

/// The GeoKey that says what a pixel is, and its value for a point; else it is an area.
const RASTER_TYPE: (u16, u16) = (1025, 2);

/// The way from coordinates to columns and rows, which count from the upper left corner of the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelGrid {
    /// Coordinates of that corner.
    corner: [f64; 2],
    /// By how much x and y grow with a column, and with a row.
    column: [f64; 2],
    row: [f64; 2],
}

impl PixelGrid {
    /// Returns the grid of an image, or what is wrong with it.
    pub(crate) fn of(image: &mut Image) -> Result<PixelGrid, PhotoError> {
        let mut numbers = |tag| if_there(image.get_tag_f64_vec(tag));
        let (scale, tie) = (numbers(Tag::ModelPixelScaleTag)?, numbers(Tag::ModelTiepointTag)?);
        let matrix = numbers(Tag::ModelTransformationTag)?;
        let keys = if_there(image.get_tag_u16_vec(Tag::GeoKeyDirectoryTag))?;
        let grid = match (scale.as_slice(), tie.as_slice(), matrix.as_slice()) {
            (&[east, north, ..], &[column, row, _, x, y, ..], _) => {
                PixelGrid { corner: [x - column * east, y + row * north], column: [east, 0.0], row: [0.0, -north] }
            }
            (_, _, &[a, b, _, x, d, e, _, y, ..]) => PixelGrid { corner: [x, y], column: [a, d], row: [b, e] },
            _ => {
                return Err("it is not georeferenced: it has neither ModelTiepoint and ModelPixelScale nor ModelTransformation. Convert \
                            it to a GeoTIFF, for example with `gdal_translate`, which reads a world file next to it"
                    .into());
            }
        };
        let numbers = grid.corner.iter().chain(&grid.column).chain(&grid.row);
        if !numbers.clone().all(|number| number.is_finite()) || grid.area() == 0.0 {
            return Err("its georeference is invalid: georeference it again".into());
        }
        let is_point = keys
            .chunks_exact(4)
            .skip(1)
            .any(|entry| entry.starts_with(&[RASTER_TYPE.0, 0]) && entry[3] == RASTER_TYPE.1);
        Ok(if is_point { grid.moved_by_half() } else { grid })
    }

    /// Returns the grid whose pixels' middles are where this one has their corners.
    fn moved_by_half(self) -> PixelGrid {
        let corner = [0, 1].map(|axis| self.corner[axis] - 0.5 * self.column[axis] - 0.5 * self.row[axis]);
        PixelGrid { corner, ..self }
    }

    fn area(&self) -> f64 {
        self.column[0] * self.row[1] - self.column[1] * self.row[0]
    }

    /// Returns the column and the row of the pixel at a place, if it is within `size`.
    pub(crate) fn pixel(&self, [x, y]: [f64; 2], size: [u32; 2]) -> Option<[u32; 2]> {
        let [dx, dy] = [x - self.corner[0], y - self.corner[1]];
        let column = (dx * self.row[1] - dy * self.row[0]) / self.area();
        let row = (dy * self.column[0] - dx * self.column[1]) / self.area();
        Some([whole(column, size[0])?, whole(row, size[1])?])
    }
}

/// Returns the whole number that `value` begins with, if it is below `limit`.
fn whole(value: f64, limit: u32) -> Option<u32> {
    // Not the cast decides: what is below zero, too large or no number is refused before.
    (value >= 0.0 && value < f64::from(limit)).then_some(value as u32)
}

/// Returns the CRS of an image, or what is wrong with it.
pub(crate) fn crs_of(image: &mut Image, warnings: &mut Warnings) -> Result<Crs, PhotoError> {
    let directory = if_there(image.get_tag_u16_vec(Tag::GeoKeyDirectoryTag))?;
    let doubles = if_there(image.get_tag_f64_vec(Tag::GeoDoubleParamsTag))?;
    let texts = if_there(image.get_tag_ascii_string(Tag::GeoAsciiParamsTag))?;
    let keys = GeoKeys {
        directory: directory.iter().flat_map(|number| number.to_le_bytes()).collect(),
        doubles: doubles.iter().flat_map(|number| number.to_le_bytes()).collect(),
        texts: texts.into_bytes(),
    };
    from_records(std::iter::empty(), &keys, warnings).map_err(|e| e.to_string().into())
}

/// Returns the way from the CRS of points to that of a picture, `None` if it is the same one or one of them is not known, or a sentence that says
/// why there is none. Datums that are a metre or two apart are one: a pixel is seldom more exact.
pub(crate) fn way(points: &Crs, photo: &Crs, warnings: &mut Warnings) -> Result<Option<CrsTransform>, String> {
    if !photo.is_named() || !points.is_named() {
        warnings.extend(missing(points, photo));
        return Ok(None);
    }
    let [from, to] = [points, photo].map(|crs| Crs { vertical: None, vertical_system: None, ..crs.clone() });
    if from.differences(&to).is_empty() && !matches!(from.sameness(&to), Sameness::Refuted(_)) {
        return Ok(None);
    }
    let way = CrsTransform::between(&from, &to, DatumRule::Close).map_err(|why| {
        format!(
            "it cannot be transformed to the CRS of the points: {why}; reproject it, for example with `gdalwarp -t_srs`"
        )
    })?;
    match way.datums() {
        DatumNote::Same => {}
        DatumNote::Assumed(names) | DatumNote::TakenAlike(names) => {
            warnings.push(format!("{names} are treated as one datum, so colours may be a metre or two off"));
        }
    }
    Ok(Some(way))
}

/// Says which CRS is missing, if one is.
fn missing(points: &Crs, photo: &Crs) -> Option<String> {
    match (points.is_named(), photo.is_named()) {
        (true, false) => Some(format!("it has no CRS: that of the points is assumed, {}", points.label())),
        (false, true) => {
            Some(format!("it is in {}, and the points have no CRS: the same is assumed for them", photo.label()))
        }
        _ => None,
    }
}
