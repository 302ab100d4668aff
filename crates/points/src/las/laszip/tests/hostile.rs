//! Chunks that are made to harm.

use std::io::Cursor;

use laz::compressors::IntegerCompressorBuilder;
use laz::encoders::ArithmeticEncoder;
use laz::models::ArithmeticModelBuilder;

use crate::las::laszip::tests::records::{Random, length, records};
use crate::las::laszip::tests::{ALL, Chunk, Outcome};

#[test]
fn a_number_outside_of_the_interval_is_nonsense() {
    for format in [0, 6] {
        let mut chunk = Chunk::encode(format, 0, &records(format, 0, 100, &mut Random(3)));
        let data = if chunk.is_layered { chunk.length + 4 + 4 * 9 } else { chunk.length };
        chunk.bytes[data..].fill(255);
        assert_eq!(chunk.by_ours(ALL), (Vec::new(), Outcome::Nonsense));
    }
}

/// Such a time makes the crate call itself for each leap. A million leaps fill the stack, and take a hundred bytes.
#[test]
fn a_time_that_leaps_from_sequence_to_sequence_is_nonsense() {
    for format in [1, 3, 4, 5] {
        for leaps in [9, 100] {
            let length = length(format, 0);
            let mut chunk = Chunk::encode(format, 0, &vec![0; length]);
            chunk.records = 2;
            chunk.bytes.truncate(length);
            chunk.bytes.extend(unchanged_point_and_leaps(leaps));
            assert_eq!(chunk.by_ours(ALL), (vec![0; length], Outcome::Nonsense), "format {format}, {leaps} leaps");
        }
    }
}

/// Returns the data of a point as the one before, and of a time that leaps so often.
fn unchanged_point_and_leaps(leaps: usize) -> Vec<u8> {
    let mut encoder = ArithmeticEncoder::new(Cursor::new(Vec::new()));
    let model = |symbols| ArithmeticModelBuilder::new(symbols).with_compression(true).build();
    encoder.encode_symbol(&mut model(64), 0).unwrap();
    for contexts in [2, 22, 20] {
        let mut integers = IntegerCompressorBuilder::new().bits(32).contexts(contexts).build_initialized();
        integers.compress(&mut encoder, 0, 0, 0).unwrap();
    }
    let mut time = model(6);
    (0..leaps).for_each(|_| encoder.encode_symbol(&mut time, 3).unwrap());
    encoder.done().unwrap();
    encoder.into_inner().into_inner()
}
