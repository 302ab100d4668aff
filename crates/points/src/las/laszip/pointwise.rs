//! Chunks in which the fields of a record follow each other, records of point formats 0 to 5.

use std::io::{Read, Seek};

use crate::las::laszip::decode_error::DecodeError;
use crate::las::laszip::extra_bytes::ExtraBytesDecoder;
use crate::las::laszip::gps_time;
use crate::las::laszip::gps_time::GpsTimeDecoder;
use crate::las::laszip::items::PointwiseItems;
use crate::las::laszip::point10;
use crate::las::laszip::point10::Point10Decoder;
use crate::las::laszip::range_decoder::RangeDecoder;
use crate::las::laszip::rgb;
use crate::las::laszip::rgb::{Rgb, RgbModels};
use crate::las::laszip::wave_packet;
use crate::las::laszip::wave_packet::WavePacketDecoder;

/// A decoder of a chunk.
pub(crate) struct PointwiseDecoder<R> {
    /// Taken while records are decoded, since the compiler keeps a local one in registers; not put back if they are damaged.
    data: Option<RangeDecoder<R>>,
    /// The number of bytes of a record.
    length: usize,
    /// The first record, until it is handed out.
    first: Option<Vec<u8>>,
    point: Point10Decoder,
    time: Option<GpsTimeDecoder>,
    rgb: Option<(Box<RgbModels>, Rgb)>,
    wave_packet: Option<Box<WavePacketDecoder>>,
    extra_bytes: Option<ExtraBytesDecoder>,
}

impl<R: Read> PointwiseDecoder<R> {
    /// Reads the first record of the chunk that `source` begins with.
    pub(crate) fn new(items: PointwiseItems, mut source: R) -> Result<PointwiseDecoder<R>, DecodeError> {
        let mut first = vec![0; items.record_length()];
        source.read_exact(&mut first)?;
        let mut rest = &first[point10::SIZE..];
        let mut time = None;
        if items.time
            && let Some((first, after)) = rest.split_first_chunk()
        {
            (time, rest) = (Some(GpsTimeDecoder::new(*first)), after);
        }
        let mut rgb = None;
        if items.rgb
            && let Some((first, after)) = rest.split_first_chunk()
        {
            (rgb, rest) = (Some((RgbModels::new(), *first)), after);
        }
        let mut wave_packet = None;
        if items.wave_packet
            && let Some((first, after)) = rest.split_first_chunk()
        {
            (wave_packet, rest) = (Some(Box::new(WavePacketDecoder::new(first))), after);
        }
        let extra_bytes = (!rest.is_empty()).then(|| ExtraBytesDecoder::new(rest));
        let (point, length) = (Point10Decoder::new(&first), first.len());
        let data = RangeDecoder::new(source)?;
        let (data, first) = (Some(data), Some(first));
        Ok(PointwiseDecoder { data, length, first, point, time, rgb, wave_packet, extra_bytes })
    }

    /// Decodes the next records into `records`. `done` counts the decoded bytes, even if decoding fails.
    pub(crate) fn decode(&mut self, records: &mut [u8], done: &mut usize) -> Result<(), DecodeError> {
        let mut data = self.data.take().ok_or(DecodeError::CutShort)?;
        for record in records.chunks_exact_mut(self.length) {
            match self.first.take() {
                Some(first) => record.copy_from_slice(&first),
                None => self.next(&mut data, record)?,
            }
            *done += self.length;
        }
        self.data = Some(data);
        Ok(())
    }

    #[inline(always)]
    fn next(&mut self, data: &mut RangeDecoder<R>, record: &mut [u8]) -> Result<(), DecodeError> {
        data.refill()?;
        let Some((point, mut rest)) = record.split_first_chunk_mut() else {
            return Ok(());
        };
        self.point.next(data, point);
        if let Some(time) = &mut self.time
            && let Some(out) = rest.split_off_mut(..gps_time::SIZE)
        {
            out.copy_from_slice(&time.next(data)?);
        }
        if let Some((models, last)) = &mut self.rgb
            && let Some(out) = rest.split_off_mut(..rgb::SIZE)
        {
            *last = models.next(data, *last);
            out.copy_from_slice(last);
        }
        if let Some(wave_packet) = &mut self.wave_packet
            && let Some(out) = rest.split_off_mut(..wave_packet::SIZE)
        {
            out.copy_from_slice(&wave_packet.next(data));
        }
        if let Some(extra_bytes) = &mut self.extra_bytes {
            extra_bytes.next(data, rest)?;
        }
        data.check_end()
    }
}

impl<R: Read + Seek> PointwiseDecoder<R> {
    /// Returns the source behind the records that were decoded.
    pub(crate) fn into_source(self) -> Result<R, DecodeError> {
        let data = self.data.ok_or(DecodeError::CutShort)?;
        Ok(data.into_source()?)
    }
}

impl PointwiseItems {
    /// Returns the number of bytes of a record.
    pub(crate) fn record_length(&self) -> usize {
        let time = if self.time { gps_time::SIZE } else { 0 };
        let rgb = if self.rgb { rgb::SIZE } else { 0 };
        let wave_packet = if self.wave_packet { wave_packet::SIZE } else { 0 };
        point10::SIZE + time + rgb + wave_packet + self.extra_bytes
    }
}
