//! Compressed files: the LASzip record, the chunk table and the chunks wrong in turn, in both kinds of compression; truncated files.

use super::{Case, Gives, Read, Refused, case};
use crate::las_file::{LasFile, points_at};

const COUNT: u64 = 1000;

fn number(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

/// Returns a sound file of the older, pointwise compression or of the newer, layered one.
fn sound(layered: bool) -> LasFile {
    if layered { LasFile::new(4, 7, 0, COUNT as usize) } else { LasFile::new(2, 3, 0, COUNT as usize) }
}

/// Returns name, position, wrong value and its result, for the fields of the LASzip record.
fn record_fields() -> Vec<(&'static str, usize, Vec<u8>, Gives)> {
    let damaged = |words| Refused(3, words);
    vec![
        ("compressor 0", 0, vec![0, 0], damaged("LASzip record that")),
        ("compressor 9", 0, vec![9, 0], damaged("LASzip record that")),
        ("coder", 2, vec![0xff; 2], Read(COUNT, 0, "")),
        ("version", 4, vec![0xff; 4], Read(COUNT, 0, "")),
        ("options", 8, vec![0xff; 4], Read(COUNT, 0, "")),
        ("special points", 16, vec![0xff; 16], Read(COUNT, 0, "")),
        ("no items", 32, vec![0; 2], damaged("points of 0 bytes")),
        ("too many items", 32, vec![0xff; 2], damaged("LASzip record that")),
        ("unknown item", 34, vec![99, 0], damaged("LASzip record that")),
        ("item of another size", 36, vec![1, 0], damaged("LASzip record that")),
        ("item of another version", 38, vec![77, 0], damaged("version 77")),
    ]
}

fn patched(bytes: &[u8], at: usize, value: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + value.len()].copy_from_slice(value);
    bytes
}

pub(super) fn cases() -> Vec<Case> {
    [false, true].into_iter().flat_map(|layered| of_kind(layered, &sound(layered).laz(&[300], false))).collect()
}

fn of_kind(layered: bool, bytes: &[u8]) -> Vec<Case> {
    let kind = if layered { "layered" } else { "pointwise" };
    let header = u16::from_le_bytes(bytes[94..96].try_into().unwrap()) as usize;
    let record = header + 54;
    let points = points_at(bytes);
    let table = number(bytes, points) as usize;
    let add = |cases: &mut Vec<Case>, name: &str, bytes: Vec<u8>, gives| {
        cases.push(case(format!("{kind}, {name}"), ".laz", bytes, gives));
    };
    let mut cases = Vec::new();
    for (name, at, value, gives) in record_fields() {
        add(&mut cases, name, patched(bytes, record + at, &value), gives);
    }
    let one_by_one = || Read(COUNT, 0, "found one by one");
    for (name, at, value, gives) in [
        ("no LASzip record", header + 18, vec![0, 0], Refused(3, "no LASzip record")),
        ("LASzip record too long", header + 20, vec![0xff; 2], Refused(3, "no LASzip record")),
        ("LASzip record too short", header + 20, vec![20, 0], Refused(3, "20 bytes of at least 34")),
        ("table nowhere", points, vec![0xff; 8], one_by_one()),
        ("table at 0", points, vec![0; 8], one_by_one()),
        ("table beyond", points, (bytes.len() as u64 * 2).to_le_bytes().to_vec(), one_by_one()),
        ("table of another version", table, vec![9, 0, 0, 0], Read(COUNT, 0, "")),
        ("table of too many", table + 4, vec![0xff; 4], one_by_one()),
        ("table of none", table + 4, vec![0; 4], one_by_one()),
        ("table of fewer", table + 4, vec![2, 0, 0, 0], one_by_one()),
    ] {
        add(&mut cases, name, patched(bytes, at, &value), gives);
    }
    if !layered {
        let value = [1, 0];
        let gives = Refused(3, "unusual LASzip record");
        add(
            &mut cases,
            "colours of another version than times",
            patched(bytes, record + 34 + 2 * 6 + 4, &value),
            gives,
        );
    }
    let mut noise = bytes.to_vec();
    noise[table + 8..].fill(0x5a);
    add(&mut cases, "table of noise", noise, one_by_one());
    let mut zeros = bytes.to_vec();
    zeros[table..].fill(0);
    add(&mut cases, "table of zeros", zeros, one_by_one());
    let mut zeros = bytes.to_vec();
    zeros[points + 8 + 40..table].fill(0);
    // Pointwise compression has nothing to check: zeros decode to some points.
    let gives = if layered { Refused(3, "malformed") } else { Read(COUNT, 0, "") };
    add(&mut cases, "zeros for chunks", zeros, gives);
    for sixth in 0..6 {
        let cut = points + (bytes.len() - points) * sixth / 6;
        add(&mut cases, &format!("cut at {sixth} of 6"), bytes[..cut].to_vec(), Refused(3, ""));
    }
    add(&mut cases, "cut in the LASzip record", bytes[..record + 20].to_vec(), Refused(3, "damaged or cut short"));
    cases
}
