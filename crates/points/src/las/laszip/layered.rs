//! Chunks in layers, records of point formats 6 to 8. Only fields of points that this crate uses are decoded.

use std::io::{Read, Seek};

use crate::las::laszip::decode_error::DecodeError;
use crate::las::laszip::items::{LayeredItems, WantedLayers};
use crate::las::laszip::layers;
use crate::las::laszip::layers::{Layer, PointLayers};
use crate::las::laszip::point14;
use crate::las::laszip::point14::Point14Decoder;
use crate::las::laszip::rgb;
use crate::las::laszip::rgb::{Rgb, RgbModels};

/// A decoder of a chunk.
pub(crate) struct LayeredDecoder {
    layers: PointLayers,
    /// The first record, until it is handed out.
    first: Option<Vec<u8>>,
    point: Point14Decoder,
    /// The number of bytes of a record.
    length: usize,
    first_rgb: Option<Rgb>,
    /// Missing if all points have the first colour, or if colours are not wanted.
    colors: Option<Colors>,
}

/// A decoder of colours, by channel.
struct Colors {
    layer: Layer,
    models: [Option<Box<RgbModels>>; 4],
    last: [Rgb; 4],
    channel: usize,
}

impl LayeredDecoder {
    /// Reads the first record and the wanted layers of the chunk that `source` begins with. They all have to be in memory together, so the
    /// caller sees to it that the chunk is not too large.
    pub(crate) fn new<R: Read + Seek>(
        items: LayeredItems,
        wanted: WantedLayers,
        mut source: R,
    ) -> Result<LayeredDecoder, DecodeError> {
        let mut first = vec![0; items.record_length()];
        source.read_exact(&mut first)?;
        let (layers, rgb_layer) = layers::read(items, wanted, source)?;
        let (fields, rest) = first.split_first_chunk().ok_or(DecodeError::CutShort)?;
        let point = Point14Decoder::new(fields);
        let first_rgb = rest.first_chunk().copied().filter(|_| items.rgb);
        let colors = rgb_layer.zip(first_rgb).map(|(layer, first)| Colors::new(layer, point.channel(), first));
        Ok(LayeredDecoder { layers, length: first.len(), first: Some(first), point, first_rgb, colors })
    }

    /// Decodes the next records into `records`. `done` counts the decoded bytes, even if decoding fails.
    pub(crate) fn decode(&mut self, records: &mut [u8], done: &mut usize) -> Result<(), DecodeError> {
        for record in records.chunks_exact_mut(self.length) {
            match self.first.take() {
                Some(first) => record.copy_from_slice(&first),
                None => self.next(record)?,
            }
            *done += self.length;
        }
        Ok(())
    }

    #[inline(always)]
    fn next(&mut self, record: &mut [u8]) -> Result<(), DecodeError> {
        self.layers.refill()?;
        let Some(out) = record.first_chunk_mut() else {
            return Ok(());
        };
        let is_other_channel = self.point.next(&mut self.layers, out);
        if let Some(first) = self.first_rgb
            && let Some(out) = record.get_mut(point14::SIZE..point14::SIZE + rgb::SIZE)
        {
            // In version 3 a point of the channel of the point before counts as one of channel 0.
            let channel = if is_other_channel { self.point.channel() } else { 0 };
            out.copy_from_slice(&match &mut self.colors {
                Some(colors) => colors.next(channel)?,
                None => first,
            });
        }
        self.layers.check_end()
    }
}

impl Colors {
    /// Starts behind the first colour.
    fn new(layer: Layer, channel: usize, first: Rgb) -> Colors {
        let mut colors = Colors { layer, models: [const { None }; 4], last: [[0; rgb::SIZE]; 4], channel };
        colors.last[channel] = first;
        colors.models[channel] = Some(RgbModels::new());
        colors
    }

    /// Returns the next colour. After a change of the channel it follows the latest of the channel before, unless the channel is new; so
    /// LASzip does in version 3.
    #[inline(always)]
    fn next(&mut self, channel: usize) -> Result<Rgb, DecodeError> {
        self.layer.refill()?;
        let mut follows = self.channel;
        self.channel = channel;
        if self.models[channel].is_none() {
            self.last[channel] = self.last[follows];
            follows = channel;
        }
        let models = self.models[channel].get_or_insert_with(RgbModels::new);
        let color = models.next(&mut self.layer, self.last[follows]);
        self.last[follows] = color;
        self.layer.check_end()?;
        Ok(color)
    }
}

impl LayeredItems {
    /// Returns the number of bytes of a record.
    pub(crate) fn record_length(&self) -> usize {
        let rgb = if self.rgb { rgb::SIZE } else { 0 };
        point14::SIZE + rgb + 2 * self.infrared as usize + self.extra_bytes
    }
}
