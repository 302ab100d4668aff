//! The fuzz targets on the stable toolchain: every input of `tests/corpus`, which holds seeds and all that fuzzing has found, and a
//! bounded number of mutations of them, the same in every run. `GDT_MUTATIONS=n` makes n of each test.

mod bodies;
#[path = "../common/random.rs"]
mod random;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use random::Random;

/// Bytes that are often at the limit of something.
const ODD: [u8; 8] = [0, 1, 0x7f, 0x80, 0xff, b'\n', b'"', b'['];

/// Runs `body` over the corpus of `target` and this many changed copies.
#[track_caller]
fn fuzz(target: &str, mutations: usize, body: fn(&[u8])) {
    let seeds = corpus(target);
    assert!(seeds.len() >= 3, "only {} seeds of {target}", seeds.len());
    for (path, bytes) in &seeds {
        assert!(survives(body, bytes), "{}", path.display());
    }
    let mutations = std::env::var("GDT_MUTATIONS").map_or(mutations, |number| number.parse().unwrap());
    let mut random = Random(20);
    for number in 0..mutations {
        let any = |random: &mut Random| seeds[random.below(seeds.len() as u64) as usize].1.as_slice();
        let mut bytes = any(&mut random).to_vec();
        for _ in 0..=random.below(4) {
            let other = any(&mut random);
            mutate(&mut bytes, other, &mut random);
        }
        if !survives(body, &bytes) {
            let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{target}-{number}"));
            fs::write(&kept, &bytes).unwrap();
            panic!("mutation {number}, kept as {}: add it to tests/corpus/{target} with its cure", kept.display());
        }
    }
}

/// The files of a target, in order.
fn corpus(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(target);
    let mut paths: Vec<PathBuf> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), fs::read(path).unwrap())).collect()
}

fn survives(body: fn(&[u8]), bytes: &[u8]) -> bool {
    catch_unwind(AssertUnwindSafe(|| body(bytes))).is_ok()
}

/// One small change to `bytes`.
fn mutate(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    if bytes.is_empty() || other.is_empty() {
        return bytes.extend_from_slice(other);
    }
    let at = random.below(bytes.len() as u64) as usize;
    let length = 1 + random.below(16.min((bytes.len() - at) as u64)) as usize;
    match random.below(8) {
        0 => bytes[at] ^= 1 << random.below(8),
        1 => bytes[at] = random.below(256) as u8,
        2 => bytes[at..at + length].fill(ODD[random.below(ODD.len() as u64) as usize]),
        3 => drop(bytes.drain(at..at + length)),
        4 => bytes.truncate(at),
        5 => {
            let copy = bytes[at..at + length].to_vec();
            bytes.splice(at..at, copy);
        }
        6 => {
            let from = random.below(other.len() as u64) as usize;
            bytes.truncate(at);
            bytes.extend_from_slice(&other[from..]);
        }
        _ => bytes[at] = bytes[at].wrapping_add(random.below(9) as u8).wrapping_sub(4),
    }
}

#[test]
fn las() {
    fuzz("las", 4000, bodies::cloud::las_without_job);
}

#[test]
fn text() {
    fuzz("text", 4000, bodies::cloud::text_without_job);
}

#[test]
fn config() {
    fuzz("config", 4000, bodies::config::config_without_job);
}

#[test]
fn sites() {
    fuzz("sites", 2000, bodies::sites::sites);
}

#[test]
fn jobs_on_las() {
    fuzz("las", 200, bodies::cloud::las);
}

#[test]
fn jobs_on_text() {
    fuzz("text", 300, bodies::cloud::text);
}

#[test]
fn jobs_on_config() {
    fuzz("config", 300, bodies::config::config);
}
