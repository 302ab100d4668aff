//! The layers of a chunk: each field's data apart, so that those of unwanted fields need not even be read.

use std::io::{Cursor, Read, Seek, SeekFrom};

use crate::las::laszip::decode_error::DecodeError;
use crate::las::laszip::items::{LayeredItems, WantedLayers};
use crate::las::laszip::range_decoder::RangeDecoder;
use sys::bytes::uint32;

/// A decoder of the data of a layer.
pub(super) type Layer = RangeDecoder<Cursor<Vec<u8>>>;

/// The layers of the fields of point format 6. A field whose layer is missing does not change.
pub(super) struct PointLayers {
    /// Scanner channel, return, x and y.
    pub(super) place: Layer,
    pub(super) height: Option<Layer>,
    pub(super) class: Option<Layer>,
    pub(super) flags: Option<Layer>,
    pub(super) intensity: Option<Layer>,
}

/// The layers of the fields of point format 6 that are never wanted: scan angle, user data, source, time.
const UNWANTED: usize = 4;

/// Reads the layers of a chunk one after the other.
struct LayerReader<R> {
    source: R,
    /// The sizes of all layers, and which comes next.
    sizes: Vec<u8>,
    next: usize,
}

/// Reads the wanted layers of the chunk whose first record has just been read from `source`. The last one is that of the colours. The
/// caller has checked that the layers fit in the chunk.
pub(super) fn read<R: Read + Seek>(
    items: LayeredItems,
    wanted: WantedLayers,
    mut source: R,
) -> Result<(PointLayers, Option<Layer>), DecodeError> {
    // The number of records comes before the sizes. The layers of infrared and of extra bytes come last.
    let mut sizes = vec![0; 4 + 4 * (5 + UNWANTED + items.rgb as usize + items.infrared as usize + items.extra_bytes)];
    source.read_exact(&mut sizes)?;
    let mut layers = LayerReader { source, sizes, next: 1 };
    let place = match layers.read(true)? {
        Some(place) => place,
        None => Layer::over_nothing(Cursor::default()),
    };
    let (height, class, flags) = (layers.read(true)?, layers.read(true)?, layers.read(true)?);
    let intensity = layers.read(wanted.intensity)?;
    for _ in 0..UNWANTED {
        layers.read(false)?;
    }
    let rgb = if items.rgb { layers.read(wanted.rgb)? } else { None };
    Ok((PointLayers { place, height, class, flags, intensity }, rgb))
}

impl<R: Read + Seek> LayerReader<R> {
    /// Returns the next layer if it is wanted and has bytes; otherwise skips it.
    fn read(&mut self, wanted: bool) -> Result<Option<Layer>, DecodeError> {
        let size = uint32(&self.sizes, 4 * self.next) as u64;
        self.next += 1;
        if !wanted {
            self.source.seek(SeekFrom::Current(size as i64))?;
            return Ok(None);
        }
        let mut bytes = vec![0; size as usize];
        self.source.read_exact(&mut bytes)?;
        Ok(if bytes.is_empty() { None } else { Some(Layer::new(Cursor::new(bytes))?) })
    }
}

impl PointLayers {
    /// Makes sure that all layers have the bytes of a record in their windows.
    #[inline(always)]
    pub(super) fn refill(&mut self) -> Result<(), DecodeError> {
        self.place.refill()?;
        refill(&mut self.height)?;
        refill(&mut self.class)?;
        refill(&mut self.flags)?;
        refill(&mut self.intensity)
    }

    /// Fails if bytes of any layer were used that it does not have.
    #[inline(always)]
    pub(super) fn check_end(&self) -> Result<(), DecodeError> {
        self.place.check_end()?;
        check_end(&self.height)?;
        check_end(&self.class)?;
        check_end(&self.flags)?;
        check_end(&self.intensity)
    }
}

#[inline(always)]
fn refill(layer: &mut Option<Layer>) -> Result<(), DecodeError> {
    layer.as_mut().map_or(Ok(()), Layer::refill)
}

#[inline(always)]
fn check_end(layer: &Option<Layer>) -> Result<(), DecodeError> {
    layer.as_ref().map_or(Ok(()), Layer::check_end)
}
