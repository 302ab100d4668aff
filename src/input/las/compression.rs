//! How the points of a LAZ file are compressed, as its LASzip record says.

use std::ops::Range;

use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr};

use crate::Result;
use crate::input::file::bytes::{uint16, uint32};
use crate::input::file::random_access::RandomAccessFile;
use crate::input::file::range::FileRange;
use crate::input::las::header::LasHeader;

/// How the records of a file are compressed.
#[derive(Clone, Debug)]
pub(crate) struct LazCompression {
    items: Vec<LazItem>,
    /// The layers of a chunk; `None` for pointwise compression.
    pub(crate) layers: Option<Layers>,
    /// Whether the points are cut in chunks at all.
    pub(crate) chunked: bool,
    /// Records of a chunk, where all but the last have the same number.
    pub(crate) chunk_size: Option<u64>,
}

impl LazCompression {
    /// Reads and checks the data of the LASzip record.
    pub(crate) fn parse(bytes: &[u8], header: &LasHeader) -> std::result::Result<LazCompression, String> {
        let broken = |what: String| format!("has a LASzip record that {what}; the file is damaged or of a newer kind");
        if bytes.len() < 34 {
            return Err(broken(format!("has {} bytes of at least 34", bytes.len())));
        }
        let vlr = LazVlr::from_buffer(bytes).map_err(|error| broken(format!("cannot be read ({error})")))?;
        let (compressor, chunk_size) = (uint16(bytes, 0), uint32(bytes, 12));
        let items = vlr.items().clone();
        let size: u64 = items.iter().map(|item| item.size() as u64).sum();
        if size != header.record_length as u64 {
            return Err(broken(format!(
                "describes points of {size} bytes, while the header says {}",
                header.record_length
            )));
        }
        if let Some(item) = items.iter().find(|item| !known(item, compressor == 3)) {
            return Err(broken(format!("has {:?} in version {} in it", item.item_type(), item.version())));
        }
        let point = if header.format >= 6 { LazItemType::Point14 } else { LazItemType::Point10 };
        if !(1..=3).contains(&compressor) || items.first().is_none_or(|item| item.item_type() != point) {
            return Err(broken(format!(
                "has compressor {compressor}, which does not go with point format {}",
                header.format
            )));
        }
        Ok(LazCompression {
            layers: (compressor == 3).then(|| Layers { record: size, count: items.iter().map(layers_of).sum() }),
            chunked: compressor != 1,
            chunk_size: (chunk_size != u32::MAX && chunk_size != 0).then_some(chunk_size as u64),
            items,
        })
    }

    pub(crate) fn decoder(
        &self,
        window: FileRange,
        selection: DecompressionSelection,
    ) -> laz::Result<Box<dyn RecordDecompressor<FileRange>>> {
        let mut decoder: Box<dyn RecordDecompressor<FileRange>> = match self.layers {
            Some(_) => Box::new(LayeredPointRecordDecompressor::new(window)),
            None => Box::new(SequentialPointRecordDecompressor::new(window)),
        };
        decoder.set_fields_from(&self.items)?;
        decoder.set_selection(selection);
        Ok(decoder)
    }
}

/// Whether the decoders take `item`, whose size must be that of its type.
fn known(item: &LazItem, layered: bool) -> bool {
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

/// The number of layers an item of layered compression has.
fn layers_of(item: &LazItem) -> u64 {
    match item.item_type() {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => count as u64,
        _ => 1,
    }
}

/// The head of a layered chunk: its first record as it is, the number of records, the size of every layer.
#[derive(Clone, Debug)]
pub(crate) struct Layers {
    /// Bytes of a record.
    pub(crate) record: u64,
    /// Number of layers.
    pub(crate) count: u64,
}

impl Layers {
    /// The number of records and of bytes of the chunk at the start of `range`; `None` where it does not fit in there.
    pub(crate) fn read(&self, file: &RandomAccessFile, range: Range<u64>) -> Result<Option<(u64, u64)>> {
        let head = self.record + 4 + 4 * self.count;
        if range.end.saturating_sub(range.start) < head {
            return Ok(None);
        }
        let numbers = file.bytes(range.start + self.record..range.start + head)?;
        let layers: u64 = (1..=self.count as usize).map(|layer| uint32(&numbers, 4 * layer) as u64).sum();
        let fits = head + layers <= range.end - range.start;
        Ok(fits.then_some((uint32(&numbers, 0) as u64, head + layers)))
    }
}
