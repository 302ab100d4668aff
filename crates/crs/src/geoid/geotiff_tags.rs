//! What the tags of a GeoTIFF say of a geoid grid: where its nodes are, and whether it holds heights of a geoid at all.

use crate::geoid::node_grid::NodeGrid;
use std::io::{Read, Seek};
use tiff::decoder::Decoder;
use tiff::tags::Tag;

/// GDAL's description of the image, as XML.
const GDAL_METADATA: Tag = Tag::Unknown(42112);

/// The GeoKey of the kind of coordinates, and its value for longitude and latitude.
const MODEL_TYPE: (u16, u16) = (1024, 2);

/// The GeoKey that says what a pixel is, and its value for a point; else it is an area.
const RASTER_TYPE: (u16, u16) = (1025, 2);

/// What a grid of geoid heights says of its kind in PROJ's convention for GeoTIFF grids.
const KIND: &str = "VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL";

/// Returns the grid of an image with these columns and rows, or a sentence that says why it is none.
pub(super) fn grid_of<R: Read + Seek>(image: &mut Decoder<R>, size: [u64; 2]) -> Result<NodeGrid, String> {
    if image.find_tag(Tag::ModelTransformationTag).ok().flatten().is_some() {
        return Err(
            "it has a ModelTransformation, which is not supported; ModelTiepoint and ModelPixelScale are".into()
        );
    }
    let keys = image.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap_or_default();
    if geo_key(&keys, MODEL_TYPE.0).is_some_and(|kind| kind != MODEL_TYPE.1) {
        return Err("its coordinates are not longitude and latitude".into());
    }
    let numbers = |image: &mut Decoder<R>, tag| image.get_tag_f64_vec(tag).unwrap_or_default();
    let scale = numbers(image, Tag::ModelPixelScaleTag);
    let tie = numbers(image, Tag::ModelTiepointTag);
    let (&[east, north, ..], &[column, row, _, x, y, _]) = (scale.as_slice(), tie.as_slice()) else {
        return Err("it is not georeferenced: one ModelTiepoint and a ModelPixelScale are missing".into());
    };
    let is_point = geo_key(&keys, RASTER_TYPE.0) == Some(RASTER_TYPE.1);
    // The middle of a pixel is half a pixel from its corner, to which the tie point belongs if pixels are areas.
    let half = if is_point { 0.0 } else { 0.5 };
    let (west, north_most) = (x + (half - column) * east, y - (half - row) * north);
    let south = north_most - size[1].saturating_sub(1) as f64 * north;
    NodeGrid::new([west, south], [east, north], size)
}

/// Says why what GDAL's description tells is no grid of geoid heights in metres. An image without a description may be one.
pub(super) fn check_kind<R: Read + Seek>(image: &mut Decoder<R>) -> Result<(), String> {
    let text = image.get_tag_ascii_string(GDAL_METADATA).unwrap_or_default();
    let items = || text.split("<Item ").skip(1).filter_map(item);
    if let Some((_, kind)) = items().find(|(name, value)| name.contains("name=\"TYPE\"") && *value != KIND) {
        return Err(format!("it is a grid of the type {kind}, not of heights of a geoid ({KIND})"));
    }
    let is_metre = |unit: &str| ["metre", "meter", "m"].contains(&unit);
    if let Some((_, unit)) = items().find(|(name, value)| name.contains("UNITTYPE") && !is_metre(value)) {
        return Err(format!("its heights are in {unit}, not in metres"));
    }
    let scaled = |(name, value): &(&str, &str)| {
        let plain = if name.contains("role=\"scale\"") { 1.0 } else { 0.0 };
        let is_scale = name.contains("role=\"scale\"") || name.contains("role=\"offset\"");
        is_scale && value.parse() != Ok(plain)
    };
    match items().find(scaled) {
        Some((_, value)) => Err(format!("its values are scaled or shifted ({value}), which is not supported")),
        None => Ok(()),
    }
}

/// Returns the value that stands where there is no height, if the image names one.
pub(super) fn no_height<R: Read + Seek>(image: &mut Decoder<R>) -> Option<f32> {
    image.get_tag_ascii_string(Tag::GdalNodata).ok()?.trim_matches(['\0', ' ']).parse().ok()
}

/// Returns the attributes and the content of an item of GDAL's description.
fn item(text: &str) -> Option<(&str, &str)> {
    let (attributes, rest) = text.split_once('>')?;
    Some((attributes, rest.split_once("</Item>")?.0.trim()))
}

/// Returns the value of a short GeoKey. An entry of the directory has the key, the place (0: here), the count and the value.
fn geo_key(directory: &[u16], wanted: u16) -> Option<u16> {
    let mut entries = directory.chunks_exact(4).skip(1);
    entries.find(|entry| entry[0] == wanted && entry[1] == 0).map(|entry| entry[3])
}
