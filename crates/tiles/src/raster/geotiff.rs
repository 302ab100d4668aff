//! The head of a Cloud-Optimized GeoTIFF: everything that stands before the blocks.
//!
//! The crate `tiff` writes strips, and every directory behind its image. Such a file takes directories first, for the raster and then for
//! its overviews, and the blocks of the coarsest image before those of finer ones, all of which that crate cannot do. So this file lays out
//! the container; its tests read it back with the crate.

use crate::raster::BLOCK;
use crate::raster::geokeys::{DOUBLES, RasterSystem, TEXTS};
use crate::raster::options::{RasterCompression, RasterOptions, nodata_text};
use crate::raster::products::RasterProduct;
use crate::raster::tags::{TagValues, TiffKind, push_directory};

/// What GDAL finds in front of the directories: a reader may count on it and fetch a block with its size at once.
const STRUCTURE: &str = "LAYOUT=IFDS_BEFORE_DATA\nBLOCK_ORDER=ROW_MAJOR\nBLOCK_LEADER=SIZE_AS_UINT4\n\
                         BLOCK_TRAILER=LAST_4_BYTES_REPEATED\nKNOWN_INCOMPATIBLE_EDITION=NO\n ";

/// The bytes of a block's size, in front of it.
pub(crate) const LEADER: usize = 4;

/// How many of its last bytes a block has again behind it.
pub const TRAILER: usize = 4;

/// What a raster's directories say besides where its blocks are.
#[derive(Clone, Debug)]
pub struct RasterHead<'a> {
    /// What the configuration asks for.
    pub options: RasterOptions,
    /// What the cells hold.
    pub product: RasterProduct,
    /// The x of the western and the y of the northern edge.
    pub corner: [f64; 2],
    /// The side of a cell, in units of x and y.
    pub cell_size: f64,
    /// The coordinate system.
    pub system: &'a RasterSystem,
    /// Whose the data are, if the user says.
    pub copyright: Option<&'a str>,
}

/// An image of the file: the raster itself, or an overview.
#[derive(Clone, Debug)]
pub struct RasterImage {
    /// Columns and rows.
    pub size: [u32; 2],
    /// The bytes of its blocks, row by row.
    pub lengths: Vec<u32>,
}

/// Returns the bytes of the file in front of the blocks of `images`, of which the first is the raster and others are half as fine as the
/// one before. The blocks follow, those of the last image first.
pub fn head(head: &RasterHead, images: &[RasterImage]) -> Vec<u8> {
    let blocks: u64 = images.iter().flat_map(|image| &image.lengths).map(|length| stored(*length)).sum();
    let classic = placed(head, images, TiffKind::Classic);
    match classic.len() as u64 + blocks <= u64::from(u32::MAX) {
        true => classic,
        false => placed(head, images, TiffKind::Big),
    }
}

/// Returns the bytes that a block of this length takes in the file.
fn stored(length: u32) -> u64 {
    LEADER as u64 + u64::from(length) + TRAILER as u64
}

fn placed(head: &RasterHead, images: &[RasterImage], kind: TiffKind) -> Vec<u8> {
    let nowhere: Vec<Vec<u64>> = images.iter().map(|image| vec![0; image.lengths.len()]).collect();
    let mut at = written(head, images, &nowhere, kind).len() as u64;
    let mut offsets: Vec<Vec<u64>> = Vec::with_capacity(images.len());
    for image in images.iter().rev() {
        let next = |length: &u32| {
            let offset = at + LEADER as u64;
            at += stored(*length);
            offset
        };
        offsets.push(image.lengths.iter().map(next).collect());
    }
    offsets.reverse();
    written(head, images, &offsets, kind)
}

fn written(head: &RasterHead, images: &[RasterImage], offsets: &[Vec<u64>], kind: TiffKind) -> Vec<u8> {
    let structure = format!("GDAL_STRUCTURAL_METADATA_SIZE={:06} bytes\n{STRUCTURE}", STRUCTURE.len());
    let first = (kind.magic().len() + kind.offset_bytes() + structure.len()).next_multiple_of(2);
    let mut bytes = kind.magic().to_vec();
    kind.push(first as u64, &mut bytes);
    bytes.extend_from_slice(structure.as_bytes());
    for (number, (image, offsets)) in images.iter().zip(offsets).enumerate() {
        let tags = tags(head, image, offsets, number > 0);
        push_directory(&tags, number + 1 == images.len(), kind, &mut bytes);
    }
    bytes
}

/// Returns the tags of an image, in ascending order.
fn tags(head: &RasterHead, image: &RasterImage, offsets: &[u64], is_overview: bool) -> Vec<(u16, TagValues)> {
    use TagValues::{Double, Long, Offsets, Short, Text};
    const REDUCED: u32 = 1;
    const DEFLATE: u16 = 8;
    const UNSIGNED: u16 = 1;
    const FLOATING_POINT: u16 = 3;
    const DIFFERENCES: u16 = 2;
    // The predictor for floating-point numbers has their number too.
    let [format, predictor] = match head.product.is_bytes() {
        true => [UNSIGNED, DIFFERENCES],
        false => [FLOATING_POINT; 2],
    };
    let is_packed = head.options.compression == RasterCompression::Deflate;
    let mut tags = vec![
        (254, Long(vec![if is_overview { REDUCED } else { 0 }])),
        (256, Long(vec![image.size[0]])),
        (257, Long(vec![image.size[1]])),
        (258, Short(vec![head.product.bits()])),
        (259, Short(vec![if is_packed { DEFLATE } else { 1 }])),
        (262, Short(vec![1])),
        (277, Short(vec![1])),
        (284, Short(vec![1])),
    ];
    if is_packed {
        tags.push((317, Short(vec![predictor])));
    }
    tags.extend([
        (322, Short(vec![BLOCK as u16])),
        (323, Short(vec![BLOCK as u16])),
        (324, Offsets(offsets.to_vec())),
        (325, Long(image.lengths.clone())),
        (339, Short(vec![format])),
    ]);
    if !is_overview {
        tags.extend(head.copyright.map(|text| (33432, Text(text.into()))));
        let (side, [west, north], keys) = (head.cell_size, head.corner, head.system.keys());
        tags.push((33550, Double(vec![side, side, 0.0])));
        tags.push((33922, Double(vec![0.0, 0.0, 0.0, west, north, 0.0])));
        tags.extend((!keys.directory.is_empty()).then_some((34735, Short(keys.directory))));
        tags.extend((!keys.doubles.is_empty()).then_some((DOUBLES, Double(keys.doubles))));
        tags.extend((!keys.texts.is_empty()).then_some((TEXTS, Text(keys.texts))));
    }
    tags.push((42113, Text(nodata_text(head.product.nodata(head.options.nodata.number())))));
    tags
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::block::packed;
    use std::io::Cursor;
    use tiff::decoder::{Decoder, DecodingResult};
    use tiff::tags::Tag;

    fn options(compression: &str) -> RasterOptions {
        toml::from_str(&format!("resolution = 2.5\ncompression = \"{compression}\"")).unwrap()
    }

    fn file(head: &[u8], blocks: &[&[u8]]) -> Vec<u8> {
        let mut bytes = head.to_vec();
        for block in blocks {
            bytes.extend((block.len() as u32).to_le_bytes());
            bytes.extend_from_slice(block);
            bytes.extend_from_slice(&block[block.len() - TRAILER..]);
        }
        bytes
    }

    #[test]
    fn another_reader_finds_the_blocks_the_overview_and_the_place() {
        let cells: Vec<f32> = (0..BLOCK * BLOCK).map(|n| n as f32 * 0.25).collect();
        let system = RasterSystem { code: Some(26915), metres: Some(1.0), ..RasterSystem::default() };
        for compression in ["deflate", "none"] {
            let options = options(compression);
            let packed = |cells: &[f32]| packed(cells, RasterProduct::Height, options.compression);
            let (block, coarse) = (packed(&cells), packed(&cells[..]));
            let about = RasterHead {
                options,
                product: RasterProduct::Height,
                corner: [100.0, 250.0],
                cell_size: 2.5,
                system: &system,
                copyright: None,
            };
            let lengths = vec![block.len() as u32; 2];
            let images = [
                RasterImage { size: [600, 512], lengths },
                RasterImage { size: [300, 256], lengths: vec![coarse.len() as u32] },
            ];
            let bytes = file(&head(&about, &images), &[&coarse, &block, &block]);
            let mut decoder = Decoder::new(Cursor::new(bytes)).unwrap();
            assert_eq!(decoder.dimensions().unwrap(), (600, 512));
            assert_eq!(decoder.get_tag_f64_vec(Tag::Unknown(33922)).unwrap()[3..5], [100.0, 250.0]);
            assert_eq!(decoder.get_tag_ascii_string(Tag::Unknown(42113)).unwrap(), "-9999");
            let DecodingResult::F32(read) = decoder.read_image().unwrap() else { panic!() };
            assert_eq!((read[1], read[511], read[512], read[600]), (0.25, 127.75, 0.0, 128.0), "{compression}");
            decoder.next_image().unwrap();
            assert_eq!(decoder.dimensions().unwrap(), (300, 256));
            assert!(!decoder.more_images());
        }
    }

    #[test]
    fn a_file_of_more_than_four_gigabytes_has_longer_offsets() {
        let system = RasterSystem::default();
        let about = RasterHead {
            options: options("none"),
            product: RasterProduct::Height,
            corner: [0.0; 2],
            cell_size: 2.5,
            system: &system,
            copyright: None,
        };
        let image = |blocks: usize| RasterImage { size: [512, 512 * blocks as u32], lengths: vec![1 << 20; blocks] };
        let magic = |blocks: usize| head(&about, &[image(blocks)])[..4].to_vec();
        // With leaders and trailers, 4095 blocks of a mebibyte take a little less than 2^32 bytes, and their offsets fit.
        assert_eq!((magic(4095), magic(4096)), (b"II\x2a\0".to_vec(), b"II\x2b\0".to_vec()));
        let bytes = head(&about, &[image(5000)]);
        assert_eq!(bytes[8..16], (16 + 43 + STRUCTURE.len() as u64).next_multiple_of(2).to_le_bytes());
        let mut decoder = Decoder::new(Cursor::new(bytes.clone())).unwrap();
        let offsets = decoder.get_tag_u64_vec(Tag::TileOffsets).unwrap();
        assert_eq!(offsets[0], bytes.len() as u64 + 4);
        assert_eq!(offsets[4999], bytes.len() as u64 + 4 + 4999 * ((1 << 20) + 8));
    }
}
