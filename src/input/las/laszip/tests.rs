//! The `laz` crate is the oracle: what it encodes comes out as it decodes it, and damage has the same consequences.

use std::io::{Cursor, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};

use laz::compressors::IntegerCompressorBuilder;
use laz::encoders::ArithmeticEncoder;
use laz::models::ArithmeticModelBuilder;
use laz::record::{
    LayeredPointRecordCompressor, LayeredPointRecordDecompressor, RecordCompressor, RecordDecompressor,
    SequentialPointRecordCompressor, SequentialPointRecordDecompressor,
};
use laz::{DecompressionSelection, LazItem, LazItemRecordBuilder};

use crate::input::las::laszip::decode_error::DecodeError;
use crate::input::las::laszip::items::{KnownItems, WantedLayers};
use crate::input::las::laszip::layered::LayeredDecoder;
use crate::input::las::laszip::pointwise::PointwiseDecoder;

mod real_files;

const FORMATS: [u8; 7] = [0, 1, 2, 3, 6, 7, 8];

const ALL: WantedLayers = WantedLayers { intensity: true, rgb: true };

/// The number of records that are decoded at once.
const BLOCK: usize = 7;

/// How the records of a chunk end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Complete,
    CutShort,
    /// The crate panics, or these decoders say that LASzip has not written the chunk.
    Nonsense,
}

/// A chunk, and what is needed to decode it.
struct Chunk {
    items: Vec<LazItem>,
    length: usize,
    is_layered: bool,
    bytes: Vec<u8>,
    records: usize,
}

/// A generator of numbers (xorshift64*), the same on every machine.
struct Random(u64);

impl Random {
    /// Returns a number less than `end`.
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 32) % end
    }

    /// Returns a step that is usually small.
    fn step(&mut self) -> i64 {
        let bits = self.below(10) * self.below(4);
        self.below(1 << (bits + 1)) as i64 - (1 << bits)
    }
}

/// Returns records that change as those of a scanner do, with leaps in between.
fn records(format: u8, extra_bytes: usize, count: usize, random: &mut Random) -> Vec<u8> {
    let time_at = [None, Some(20), None, Some(20), None, None, Some(22), Some(22), Some(22)][format as usize];
    let rgb_at = [None, None, Some(20), Some(28), None, None, None, Some(30), Some(30)][format as usize];
    let length = length(format, extra_bytes);
    let mut record = vec![0; length];
    let (mut place, mut times, mut rgb, mut steps) = ([0i64; 3], [0i64; 4], [0u16; 3], [1i64; 4]);
    let mut all = Vec::new();
    for _ in 0..count {
        for (axis, coordinate) in place.iter_mut().enumerate() {
            *coordinate += random.step();
            record[4 * axis..4 * axis + 4].copy_from_slice(&(*coordinate as i32).to_le_bytes());
        }
        for byte in &mut record[12..if format >= 6 { 22 } else { 20 }] {
            if random.below(4) == 0 {
                *byte = byte.wrapping_add(random.step() as u8);
            }
        }
        if let Some(at) = time_at {
            let sequence = random.below(40).min(3) as usize;
            match random.below(30) {
                0 => times[sequence] = (random.below(1 << 31) << 32) as i64,
                1..4 => steps[sequence] = random.step(),
                4..10 => {}
                _ => times[sequence] += steps[sequence] * [1, 1, 1, 2, 30, 600, -3, -40][random.below(8) as usize],
            }
            record[at..at + 8].copy_from_slice(&times[sequence].to_le_bytes());
        }
        if let Some(at) = rgb_at {
            let is_grey = random.below(3) == 0;
            for band in 0..3 {
                rgb[band] = if is_grey { rgb[0] } else { rgb[band].wrapping_add(random.step() as u16) };
                record[at + 2 * band..at + 2 * band + 2].copy_from_slice(&rgb[band].to_le_bytes());
            }
        }
        for byte in &mut record[length - extra_bytes..] {
            *byte = byte.wrapping_add(random.below(3) as u8);
        }
        all.extend(&record);
    }
    all
}

fn length(format: u8, extra_bytes: usize) -> usize {
    [20, 28, 26, 34, 0, 0, 30, 36, 38][format as usize] + extra_bytes
}

impl Chunk {
    /// Has the crate encode these records.
    fn encode(format: u8, extra_bytes: usize, records: &[u8]) -> Chunk {
        let items = LazItemRecordBuilder::default_for_point_format_id(format, extra_bytes as u16).unwrap();
        let (length, is_layered) = (length(format, extra_bytes), format >= 6);
        let mut encoder: Box<dyn RecordCompressor<Cursor<Vec<u8>>>> = match is_layered {
            true => Box::new(LayeredPointRecordCompressor::new(Cursor::default())),
            false => Box::new(SequentialPointRecordCompressor::new(Cursor::default())),
        };
        encoder.set_fields_from(&items).unwrap();
        encoder.compress_many(records).unwrap();
        encoder.done().unwrap();
        let bytes = encoder.box_into_inner().into_inner();
        Chunk { items, length, is_layered, bytes, records: records.len() / length }
    }

    fn by_crate(&self, wanted: WantedLayers) -> (Vec<u8>, Outcome) {
        let source = Cursor::new(self.bytes.as_slice());
        let mut decoder: Box<dyn RecordDecompressor<Cursor<&[u8]>>> = match self.is_layered {
            true => Box::new(LayeredPointRecordDecompressor::new(source)),
            false => Box::new(SequentialPointRecordDecompressor::new(source)),
        };
        let selection = DecompressionSelection::base().decompress_z().decompress_classification().decompress_flags();
        let selection = if wanted.intensity { selection.decompress_intensity() } else { selection };
        decoder.set_fields_from(&self.items).unwrap();
        decoder.set_selection(if wanted.rgb { selection.decompress_rgb() } else { selection });
        let mut records = Vec::new();
        for _ in 0..self.records {
            let mut record = vec![0; self.length];
            match catch_unwind(AssertUnwindSafe(|| decoder.decompress_next(&mut record))) {
                Ok(Ok(())) => records.extend(record),
                Ok(Err(error)) if error.kind() == ErrorKind::UnexpectedEof => return (records, Outcome::CutShort),
                _ => return (records, Outcome::Nonsense),
            }
        }
        (records, Outcome::Complete)
    }

    fn by_ours(&self, wanted: WantedLayers) -> (Vec<u8>, Outcome) {
        let source = Cursor::new(self.bytes.as_slice());
        let (mut records, mut done) = (vec![0; self.records * self.length], 0);
        let mut blocks = records.chunks_mut(BLOCK * self.length);
        let result = match KnownItems::of(&self.items).unwrap() {
            KnownItems::Pointwise(items) => PointwiseDecoder::new(items, source)
                .and_then(|mut decoder| blocks.try_for_each(|block| decoder.decode(block, &mut done))),
            KnownItems::Layered(items) => LayeredDecoder::new(items, wanted, source)
                .and_then(|mut decoder| blocks.try_for_each(|block| decoder.decode(block, &mut done))),
        };
        records.truncate(done);
        let outcome = match result {
            Ok(()) => Outcome::Complete,
            Err(DecodeError::CutShort) => Outcome::CutShort,
            Err(DecodeError::Nonsense) => Outcome::Nonsense,
            Err(DecodeError::Read(error)) => panic!("{error}"),
        };
        (records, outcome)
    }

    /// Asserts that both decode the chunk alike. Returns how it ends.
    fn compare(&self, wanted: WantedLayers) -> Outcome {
        let (theirs, their_outcome) = self.by_crate(wanted);
        let (ours, our_outcome) = self.by_ours(wanted);
        // Data that LASzip has not written may make one of the two give up earlier than the other.
        let count = match their_outcome == Outcome::Nonsense || our_outcome == Outcome::Nonsense {
            true => theirs.len().min(ours.len()),
            false => {
                assert_eq!((theirs.len(), their_outcome), (ours.len(), our_outcome));
                ours.len()
            }
        };
        for (i, (theirs, ours)) in
            theirs[..count].chunks(self.length).zip(ours[..count].chunks(self.length)).enumerate()
        {
            let all = 0..self.length;
            let ranges =
                if self.is_layered { [0..17, 30..(30 + 6 * self.has_rgb(wanted) as usize)] } else { [all, 0..0] };
            for range in ranges {
                assert_eq!(theirs[range.clone()], ours[range], "record {i}");
            }
        }
        our_outcome
    }

    fn has_rgb(&self, wanted: WantedLayers) -> bool {
        wanted.rgb && matches!(KnownItems::of(&self.items), Some(KnownItems::Layered(items)) if items.rgb)
    }
}

#[test]
fn records_come_out_as_they_went_in() {
    let mut random = Random(1);
    for format in FORMATS {
        for (extra_bytes, count) in [(0, 20_000), (3, 3000), (0, 1), (200, 2)] {
            let records = records(format, extra_bytes, count, &mut random);
            let chunk = Chunk::encode(format, extra_bytes, &records);
            for wanted in [ALL, WantedLayers { intensity: false, rgb: false }] {
                assert_eq!(chunk.compare(wanted), Outcome::Complete, "format {format}");
            }
            if format < 6 {
                assert!(chunk.by_ours(ALL).0 == records, "format {format}");
            }
        }
    }
}

#[test]
fn a_chunk_ends_where_the_next_begins() {
    let mut random = Random(4);
    for format in [0, 1, 2, 3] {
        let chunks = [2000, 1].map(|count| Chunk::encode(format, 1, &records(format, 1, count, &mut random)));
        let bytes = [chunks[0].bytes.as_slice(), &chunks[1].bytes].concat();
        let Some(KnownItems::Pointwise(items)) = KnownItems::of(&chunks[0].items) else {
            panic!("format {format} is not known");
        };
        let mut decoder = PointwiseDecoder::new(items, Cursor::new(bytes.as_slice())).unwrap();
        decoder.decode(&mut vec![0; 2000 * chunks[0].length], &mut 0).unwrap();
        let source = decoder.into_source().unwrap();
        assert_eq!(source.position() as usize, chunks[0].bytes.len(), "format {format}");
    }
}

#[test]
fn layers_without_bytes_keep_their_fields() {
    for format in [6, 7, 8] {
        let record: Vec<u8> = (0..length(format, 2) as u8).collect();
        let chunk = Chunk::encode(format, 2, &record.repeat(1000));
        assert_eq!(chunk.compare(ALL), Outcome::Complete);
        let (records, _) = chunk.by_ours(ALL);
        assert!(records.chunks(chunk.length).all(|other| other[..17] == record[..17]));
    }
}

#[test]
fn damage_has_the_same_consequences() {
    let mut random = Random(2);
    let mut outcomes = [0; 3];
    for format in FORMATS {
        let records = records(format, 1, 400, &mut random);
        let mut chunk = Chunk::encode(format, 1, &records);
        let whole = chunk.bytes.clone();
        // Longer layers than the chunk has are found before.
        let head = if chunk.is_layered { chunk.length + 4 + 4 * (9 + 4) } else { 0 };
        for _ in 0..150 {
            chunk.bytes.clone_from(&whole);
            for _ in 0..random.below(4) {
                let at = head + random.below((whole.len() - head) as u64) as usize;
                chunk.bytes[at] = [random.below(256) as u8, 0, 255][random.below(3) as usize];
            }
            if random.below(2) == 0 {
                chunk.bytes.truncate(random.below(whole.len() as u64 + 1) as usize);
            }
            outcomes[chunk.compare(ALL) as usize] += 1;
        }
    }
    assert!(outcomes[0] > 100 && outcomes[1] > 100, "{outcomes:?}");
}

#[test]
fn a_number_outside_of_the_interval_is_nonsense() {
    for format in [0, 6] {
        let mut chunk = Chunk::encode(format, 0, &records(format, 0, 100, &mut Random(3)));
        let data = if chunk.is_layered { chunk.length + 4 + 4 * 9 } else { chunk.length };
        chunk.bytes[data..].fill(255);
        assert_eq!(chunk.by_ours(ALL), (Vec::new(), Outcome::Nonsense));
    }
}

/// Such a time makes the crate call itself for each leap, until the stack is full if there are many.
#[test]
fn a_time_that_leaps_from_sequence_to_sequence_is_nonsense() {
    let mut chunk = Chunk::encode(1, 0, &[0; 28]);
    chunk.records = 2;
    let mut encoder = ArithmeticEncoder::new(Cursor::new(Vec::new()));
    let model = |symbols| ArithmeticModelBuilder::new(symbols).with_compression(true).build();
    encoder.encode_symbol(&mut model(64), 0).unwrap();
    for contexts in [2, 22, 20] {
        let mut integers = IntegerCompressorBuilder::new().bits(32).contexts(contexts).build_initialized();
        integers.compress(&mut encoder, 0, 0, 0).unwrap();
    }
    let mut time = model(6);
    (0..100).for_each(|_| encoder.encode_symbol(&mut time, 3).unwrap());
    encoder.done().unwrap();
    chunk.bytes.truncate(28);
    chunk.bytes.extend(encoder.into_inner().into_inner());
    assert_eq!(chunk.by_ours(ALL), (vec![0; 28], Outcome::Nonsense));
}

#[test]
fn other_records_are_left_to_the_crate() {
    let items = |format, extra_bytes| LazItemRecordBuilder::default_for_point_format_id(format, extra_bytes).unwrap();
    assert!(KnownItems::of(&items(3, 1)).is_some());
    assert!(KnownItems::of(&items(9, 0)).is_none());
    assert!(KnownItems::of(&[]).is_none());
}
