//! How the points of a LAZ file are compressed, as its LASzip record says.

use std::ops::Range;

use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr};
use serde::{Deserialize, Serialize};

use crate::file::random_access::RandomAccessFile;
use crate::file::range::FileRange;
use crate::las::header::LasHeader;
use crate::las::laszip::items::{KnownItems, can_fill_the_stack};
use sys::Result;
use sys::bytes::{uint16, uint32};

/// The number of bytes of a LASzip record before its items, which follow their 16-bit count.
const RECORD_HEAD: usize = 32;

/// What is wrong with a LASzip record.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LaszipError {
    #[error("has a LASzip record that {0}; the file is damaged or of a newer kind")]
    Broken(String),
    #[error(
        "has an unusual LASzip record ({0}), which is not supported for points with GPS times; write the file again, for example with \
         `pdal translate` or `las2las`"
    )]
    Unusual(String),
}

/// How the records of a file are compressed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct LazCompression {
    #[serde(with = "item_list")]
    items: Vec<LazItem>,
    /// The form of a layered chunk; `None` for pointwise compression.
    pub(crate) layers: Option<LayeredChunkForm>,
    /// Whether the points are cut into chunks at all.
    pub(crate) chunked: bool,
    /// The number of records of a chunk, if it is the same for all chunks but the last.
    pub(crate) chunk_size: Option<u64>,
}

impl LazCompression {
    /// Reads and checks the data of the LASzip record.
    pub(crate) fn parse(bytes: &[u8], header: &LasHeader) -> std::result::Result<LazCompression, LaszipError> {
        let broken = LaszipError::Broken;
        if bytes.len() < RECORD_HEAD + 2 {
            return Err(broken(format!("has {} bytes of at least {}", bytes.len(), RECORD_HEAD + 2)));
        }
        let vlr = LazVlr::from_buffer(bytes).map_err(|error| broken(format!("cannot be read ({error})")))?;
        let (compressor, chunk_size) = (uint16(bytes, 0), uint32(bytes, 12));
        let items = vlr.items().clone();
        let size: u64 = items.iter().map(|item| item.size() as u64).sum();
        if size != header.record_length as u64 {
            return Err(broken(format!(
                "describes points of {size} bytes, but the header gives {}",
                header.record_length
            )));
        }
        if let Some(item) = items.iter().find(|item| !is_known(item, compressor == 3)) {
            return Err(broken(format!("has {:?} in version {} in it", item.item_type(), item.version())));
        }
        let point = if header.format >= 6 { LazItemType::Point14 } else { LazItemType::Point10 };
        if !(1..=3).contains(&compressor) || items.first().is_none_or(|item| item.item_type() != point) {
            return Err(broken(format!(
                "has compressor {compressor}, which does not go with point format {}",
                header.format
            )));
        }
        if can_fill_the_stack(&items) {
            return Err(LaszipError::Unusual(named(&items)));
        }
        let layers = items.iter().map(layers_of).sum();
        Ok(LazCompression {
            layers: (compressor == 3).then_some(LayeredChunkForm { record: size, layers }),
            chunked: compressor != 1,
            chunk_size: (chunk_size != u32::MAX && chunk_size != 0).then_some(chunk_size as u64),
            items,
        })
    }

    /// Returns what the decoders of this crate have to know of the records; `None` if they do not know them.
    pub(crate) fn known_items(&self) -> Option<KnownItems> {
        KnownItems::of(&self.items)
    }

    /// Returns a decoder of the `laz` crate for the records in `range`.
    pub(crate) fn decoder(
        &self,
        range: FileRange,
        selection: DecompressionSelection,
    ) -> laz::Result<Box<dyn RecordDecompressor<FileRange>>> {
        let mut decoder: Box<dyn RecordDecompressor<FileRange>> = match self.layers {
            Some(_) => Box::new(LayeredPointRecordDecompressor::new(range)),
            None => Box::new(SequentialPointRecordDecompressor::new(range)),
        };
        decoder.set_fields_from(&self.items)?;
        decoder.set_selection(selection);
        Ok(decoder)
    }
}

/// Returns whether the decoders know `item`, whose size must be the size of its type.
fn is_known(item: &LazItem, layered: bool) -> bool {
    let size = match item.item_type() {
        LazItemType::Byte(size) | LazItemType::Byte14(size) => size,
        LazItemType::Point10 => 20,
        LazItemType::GpsTime | LazItemType::RGBNIR14 => 8,
        LazItemType::RGB12 | LazItemType::RGB14 => 6,
        LazItemType::WavePacket13 | LazItemType::WavePacket14 => 29,
        LazItemType::Point14 => 30,
    };
    let versions = if layered { 3..=4 } else { 1..=2 };
    item.size() == size && versions.contains(&item.version())
}

/// Returns the first items in words; a damaged file may have thousands.
fn named(items: &[LazItem]) -> String {
    let mut names: Vec<String> =
        items.iter().take(6).map(|item| format!("{:?} in version {}", item.item_type(), item.version())).collect();
    if items.len() > names.len() {
        names.push("and others".to_string());
    }
    names.join(", ")
}

/// Returns the number of layers of an item in layered compression.
fn layers_of(item: &LazItem) -> u64 {
    match item.item_type() {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => count as u64,
        _ => 1,
    }
}

/// The form of a layered chunk. A chunk begins with a head: its first record uncompressed, the number of its records, the size of
/// every layer. The layers follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct LayeredChunkForm {
    /// The number of bytes of a record.
    record: u64,
    /// The number of layers.
    layers: u64,
}

/// What the head of a layered chunk says.
pub(crate) struct ChunkHead {
    /// The number of records.
    pub(crate) records: u64,
    /// The number of bytes of the chunk, head and layers.
    pub(crate) bytes: u64,
}

impl LayeredChunkForm {
    /// Reads the head of the chunk at the start of `range`; `None` if the chunk does not fit into the range.
    pub(crate) fn read_head(&self, file: &RandomAccessFile, range: Range<u64>) -> Result<Option<ChunkHead>> {
        let head = self.record + 4 + 4 * self.layers;
        if range.end.saturating_sub(range.start) < head {
            return Ok(None);
        }
        let numbers = file.bytes(range.start + self.record..range.start + head)?;
        let layers: u64 = (1..=self.layers as usize).map(|layer| uint32(&numbers, 4 * layer) as u64).sum();
        let fits = head + layers <= range.end - range.start;
        Ok(fits.then_some(ChunkHead { records: uint32(&numbers, 0) as u64, bytes: head + layers }))
    }
}

/// The items are written as triples of type, size and version, as the LASzip record has them.
mod item_list {
    use laz::{LazItem, LazVlr};
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    use super::RECORD_HEAD;

    pub(super) fn serialize<S: Serializer>(items: &[LazItem], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(items.iter().map(|item| [u16::from(item.item_type()), item.size(), item.version()]))
    }

    /// The `laz` crate makes items of any version only from a record, so one is put together.
    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<LazItem>, D::Error> {
        let items = Vec::<[u16; 3]>::deserialize(deserializer)?;
        let count = u16::try_from(items.len()).map_err(D::Error::custom)?;
        let mut record = vec![0; RECORD_HEAD];
        // A compressor that the crate knows; the items do not depend on it.
        record[0] = 2;
        record.extend(count.to_le_bytes());
        record.extend(items.iter().flatten().flat_map(|number| number.to_le_bytes()));
        let vlr = LazVlr::from_buffer(&record).map_err(D::Error::custom)?;
        Ok(vlr.items().clone())
    }
}
