//! LAS and LAZ files made in memory.

use std::io::{Cursor, Write};

use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr, LazVlrBuilder};

/// The least record length of each point format.
const LENGTHS: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// A LAS file of version 1.`minor`, with records of point format `format` that have `extra` more bytes each.
#[derive(Clone)]
pub(crate) struct LasFile {
    pub(crate) minor: u8,
    pub(crate) format: u8,
    pub(crate) extra: u16,
    /// The number of bytes between the header and the points that belong to no record.
    pub(crate) stray: usize,
    pub(crate) records: Vec<u8>,
}

impl LasFile {
    /// Makes `count` points along a spiral, with classes, colours and flags. Every 17th point is withheld.
    pub(crate) fn new(minor: u8, format: u8, extra: u16, count: usize) -> LasFile {
        let length = (LENGTHS[format as usize] + extra) as usize;
        let mut records = Vec::with_capacity(count * length);
        for i in 0..count {
            records.extend(record(format, length, i as i32));
        }
        LasFile { minor, format, extra, stray: 0, records }
    }

    pub(crate) fn length(&self) -> u16 {
        LENGTHS[self.format as usize] + self.extra
    }

    pub(crate) fn count(&self) -> usize {
        self.records.len() / self.length() as usize
    }

    fn header_size(&self) -> usize {
        [227, 227, 227, 235, 375, 393][self.minor as usize]
    }

    fn header(&self, vlr_bytes: usize, compressed: bool) -> Vec<u8> {
        let mut bytes = vec![0; self.header_size()];
        let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
        put(0, b"LASF");
        put(24, &[1, self.minor]);
        put(94, &(self.header_size() as u16).to_le_bytes());
        put(96, &((self.header_size() + vlr_bytes + self.stray) as u32).to_le_bytes());
        put(100, &((vlr_bytes > 0) as u32).to_le_bytes());
        put(104, &[self.format | (compressed as u8) << 7]);
        put(105, &self.length().to_le_bytes());
        put(107, &(self.count() as u32).to_le_bytes());
        for axis in 0..3 {
            put(131 + 8 * axis, &0.01f64.to_le_bytes());
            put(155 + 8 * axis, &[500_000.0f64, 4_000_000.0, 0.0][axis].to_le_bytes());
        }
        if self.minor >= 4 {
            put(107, &[0; 4]);
            put(247, &(self.count() as u64).to_le_bytes());
        }
        bytes
    }

    /// Returns the bytes of the file, not compressed.
    pub(crate) fn las(&self) -> Vec<u8> {
        let mut bytes = self.header(0, false);
        bytes.extend(std::iter::repeat_n(0xdd, self.stray));
        bytes.extend(&self.records);
        bytes
    }

    /// Returns the bytes of the file, compressed: in chunks of these numbers of points if `variable`, else in chunks of the first
    /// number of points.
    pub(crate) fn laz(&self, chunks: &[usize], variable: bool) -> Vec<u8> {
        let items = LazItemRecordBuilder::default_for_point_format_id(self.format, self.extra).unwrap();
        let builder = LazVlrBuilder::new(items);
        let vlr = if variable {
            builder.with_variable_chunk_size().build()
        } else {
            builder.with_fixed_chunk_size(chunks[0] as u32).build()
        };
        let mut data = Vec::new();
        vlr.write_to(&mut data).unwrap();
        let mut bytes = self.header(54 + data.len(), true);
        bytes.extend([0, 0]);
        bytes.extend(name::<16>(LazVlr::USER_ID));
        bytes.extend(LazVlr::RECORD_ID.to_le_bytes());
        bytes.extend((data.len() as u16).to_le_bytes());
        bytes.extend([0; 32]);
        bytes.extend(data);
        bytes.extend(std::iter::repeat_n(0xdd, self.stray));
        if self.records.is_empty() {
            // Without points, the compressor would write its table over the header.
            return bytes;
        }
        let mut out = Cursor::new(Vec::new());
        out.write_all(&bytes).unwrap();
        let mut compressor = LasZipCompressor::new(&mut out, vlr).unwrap();
        let mut rest = self.records.as_slice();
        for &chunk in chunks.iter().take_while(|_| variable) {
            let (now, later) = rest.split_at((chunk * self.length() as usize).min(rest.len()));
            compressor.compress_many(now).unwrap();
            compressor.finish_current_chunk().unwrap();
            rest = later;
        }
        compressor.compress_many(rest).unwrap();
        compressor.done().unwrap();
        drop(compressor);
        out.into_inner()
    }
}

/// Returns the position of the point data in a file, as its header says.
pub(crate) fn points_at(bytes: &[u8]) -> usize {
    u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize
}

fn name<const N: usize>(text: &str) -> [u8; N] {
    let mut bytes = [0; N];
    bytes[..text.len()].copy_from_slice(text.as_bytes());
    bytes
}

fn record(format: u8, length: usize, i: i32) -> Vec<u8> {
    let mut bytes = vec![0; length];
    let angle = i as f64 * 0.1;
    let x = (angle.cos() * 10.0 * i as f64) as i32;
    let y = (angle.sin() * 10.0 * i as f64) as i32;
    for (at, value) in [(0, x), (4, y), (8, i % 97 - 40)] {
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    bytes[12..14].copy_from_slice(&((i * 7 % 3000) as u16).to_le_bytes());
    let withheld = (i % 17 == 3) as u8;
    if format >= 6 {
        bytes[14] = 0x11;
        bytes[15] = withheld << 2 | ((i / 50 % 2) as u8) << 4;
        bytes[16] = (i % 70) as u8;
    } else {
        bytes[14] = 0x09;
        bytes[15] = (i % 19) as u8 | withheld << 7;
    }
    let rest = if format >= 6 { 22 } else { 20 };
    for (at, byte) in bytes.iter_mut().enumerate().skip(rest) {
        *byte = (i as usize * 31 + at * 7) as u8;
    }
    bytes
}
