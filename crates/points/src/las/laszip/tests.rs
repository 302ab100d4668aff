//! The `laz` crate is the oracle: what it encodes comes out as it decodes it, and damage has the same consequences.

use std::io::{Cursor, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};

use laz::record::{
    LayeredPointRecordCompressor, LayeredPointRecordDecompressor, RecordCompressor, RecordDecompressor,
    SequentialPointRecordCompressor, SequentialPointRecordDecompressor,
};
use laz::{DecompressionSelection, LazItem, LazItemRecordBuilder, LazVlr};

use crate::las::laszip::decode_error::DecodeError;
use crate::las::laszip::items::{KnownItems, PointwiseItems, WantedLayers, can_fill_the_stack};
use crate::las::laszip::layered::LayeredDecoder;
use crate::las::laszip::pointwise::PointwiseDecoder;
use crate::las::laszip::tests::records::{Random, length, records};

mod hostile;
mod real_files;
mod records;

const FORMATS: [u8; 9] = [0, 1, 2, 3, 4, 5, 6, 7, 8];

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
    for format in [0, 1, 2, 3, 4, 5] {
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

/// Returns items of these types, sizes and versions.
fn items(items: &[[u16; 3]]) -> Vec<LazItem> {
    let mut record = vec![0; 32];
    record[0] = 2;
    record.extend((items.len() as u16).to_le_bytes());
    record.extend(items.iter().flatten().flat_map(|number| number.to_le_bytes()));
    LazVlr::from_buffer(record).unwrap().items().clone()
}

const fn point(version: u16) -> [u16; 3] {
    [6, 20, version]
}

const fn time(version: u16) -> [u16; 3] {
    [7, 8, version]
}

const RGB: [u16; 3] = [8, 6, 2];

const fn wave_packet(version: u16) -> [u16; 3] {
    [9, 29, version]
}

const EXTRA_BYTES: [u16; 3] = [0, 5, 2];

#[test]
fn wave_packets_are_known_in_both_versions() {
    let known = |rgb, extra_bytes| PointwiseItems { time: true, rgb, wave_packet: true, extra_bytes };
    for version in [1, 2] {
        for (list, expected) in [
            (items(&[point(2), time(2), wave_packet(version)]), known(false, 0)),
            (items(&[point(2), time(2), RGB, wave_packet(version), EXTRA_BYTES]), known(true, 5)),
        ] {
            assert_eq!(KnownItems::of(&list), Some(KnownItems::Pointwise(expected)));
            assert!(!can_fill_the_stack(&list));
        }
    }
    let mut random = Random(5);
    let mut chunk = Chunk::encode(4, 0, &records(4, 0, 500, &mut random));
    chunk.items = items(&[point(2), time(2), wave_packet(1)]);
    assert_eq!(chunk.compare(ALL), Outcome::Complete);
}

#[test]
fn other_records_are_left_to_the_crate_unless_they_can_harm() {
    let usual = |format| LazItemRecordBuilder::default_for_point_format_id(format, 1).unwrap();
    assert!(KnownItems::of(&usual(3)).is_some());
    for list in [
        usual(9),
        usual(10),
        items(&[point(1), time(1), [8, 6, 1]]),
        items(&[point(2), time(1)]),
        items(&[point(2), EXTRA_BYTES, RGB]),
        Vec::new(),
    ] {
        assert_eq!((KnownItems::of(&list), can_fill_the_stack(&list)), (None, false), "{list:?}");
    }
    for list in [
        items(&[point(2), RGB, time(2)]),
        items(&[point(1), time(2)]),
        items(&[point(2), time(2), [8, 6, 1]]),
        items(&[point(2), time(2), wave_packet(1), RGB]),
        items(&[point(2), time(2), EXTRA_BYTES, EXTRA_BYTES]),
        items(&[point(2), time(1), time(2)]),
    ] {
        assert!(can_fill_the_stack(&list), "{list:?}");
    }
}
