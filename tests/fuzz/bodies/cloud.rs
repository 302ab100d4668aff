//! A point cloud of any bytes: opened, planned for, decoded, and put through a whole job.

use std::path::Path;
use std::sync::LazyLock;

use ::job::options::JobOptions;
use delaunay::geometry::REACH;
use lattice::AxisMap;
use points::{KeptReturns, OptionalFields, Point, PointCounts, PointRules, Source, TextOptions, open};
use sys::{Error, Result};

use super::{job, with_file};

/// Decoding stops at this many points, since a few bytes may promise very many.
const MOST_DECODED: u64 = 200_000;

/// A job on more points is not run, since it takes too long.
const MOST_IN_A_JOB: u64 = 20_000;

/// Lines of `[output]`, to try everything that is written.
const OUTPUTS: [&str; 5] = [
    "compression = \"meshopt\"\nmax_edge = \"auto\"",
    "compression = \"quantized\"\nnormals = false",
    "compression = \"none\"\ncolor = \"class\"",
    "format = \"glb\"\ncolor = \"none\"\nlevels = false",
    "",
];

/// The bytes of a LAS or LAZ file, with a whole job.
pub(crate) fn las(bytes: &[u8]) {
    with_las(bytes, job::run_and_verify);
}

/// The same up to the decoded points, which takes a tenth of the time.
pub(crate) fn las_without_job(bytes: &[u8]) {
    with_las(bytes, drop);
}

/// The first byte says which options are set, the others are the text. With a whole job.
pub(crate) fn text(bytes: &[u8]) {
    with_text(bytes, job::run_and_verify);
}

/// The same up to the decoded points, which takes a tenth of the time.
pub(crate) fn text_without_job(bytes: &[u8]) {
    with_text(bytes, drop);
}

fn with_las(bytes: &[u8], run: fn(JobOptions)) {
    with_file(".las", bytes, |path| read(path, &TextOptions::default(), bytes.len(), run));
}

fn with_text(bytes: &[u8], run: fn(JobOptions)) {
    let Some((&choice, text)) = bytes.split_first() else { return };
    let bit = |bit: u8| choice >> bit & 1 == 1;
    let columns = || ["z", "-", "x", "y", "class"].map(String::from).to_vec();
    let options = TextOptions {
        delimiter: bit(0).then_some(if bit(1) { ';' } else { ' ' }),
        header: bit(2).then_some(bit(3)),
        columns: bit(4).then(columns),
        comment: bit(5).then(|| "%".to_owned()),
    };
    with_file(".csv", text, |path| read(path, &options, text.len(), run));
}

/// Reads the file and calls `run` if there is a job of a reasonable size; `choice` picks the output options.
fn read(path: &Path, text: &TextOptions, choice: usize, run: fn(JobOptions)) {
    let Ok(source) = open(path, text) else { return };
    let options = options(path, text, choice);
    let has_job = job::preflight(&options);
    let points = rules(&source).map_or(Some(0), |rules| decode_all(&source, &rules));
    if has_job && points.is_some_and(|points| points <= MOST_IN_A_JOB) {
        run(options);
    }
}

fn options(path: &Path, text: &TextOptions, choice: usize) -> JobOptions {
    static OPTIONS: LazyLock<[JobOptions; OUTPUTS.len()]> = LazyLock::new(|| {
        OUTPUTS.map(|lines| job::options(&job::OPTIONS.replace("[output]", &format!("[output]\n{lines}"))))
    });
    let mut options = OPTIONS[choice % OUTPUTS.len()].clone();
    options.input.files = vec![path.to_str().expect("a plain path").to_owned()];
    options.input.csv = text.clone();
    options.input.max_malformed_fraction.0 = [0.0, 1.0][choice % 2];
    options
}

/// A lattice that is the file's own steps.
fn rules(source: &Source) -> Option<PointRules> {
    let map = |axis: usize| {
        let own = source.axes[axis];
        AxisMap::new(own.offset, own.scale, own.offset, own.scale)
    };
    Some(PointRules {
        maps: [map(0)?, map(1)?, map(2)?],
        classes: [true; 256],
        returns: KeptReturns::All,
        bounds: None,
        clip: None,
        first_order: 5,
        numbered: true,
        fields: OptionalFields { rgb: true, intensity: true },
    })
}

/// Returns the number of points, or `None` if there are more than [`MOST_DECODED`].
fn decode_all(source: &Source, rules: &PointRules) -> Option<u64> {
    let mut decoded = 0;
    for chunk in 0..source.chunks() {
        match decode(source, chunk, rules, &mut decoded) {
            Ok(counts) => check(&counts),
            Err(Error::Memory(_)) => return None,
            Err(error) => panic!("{error}"),
        }
    }
    Some(decoded)
}

fn decode(source: &Source, chunk: usize, rules: &PointRules, decoded: &mut u64) -> Result<PointCounts> {
    let (mut kept, mut next) = (0, 0);
    let mut sink = |points: &[Point]| {
        for point in points {
            assert!(point.position.iter().all(|v| (-REACH..=REACH).contains(v)));
            assert!(point.order() >= next && point.order() - rules.first_order < source.records);
            next = point.order() + 1;
        }
        kept += points.len() as u64;
        *decoded += points.len() as u64;
        if *decoded > MOST_DECODED { Err(Error::Memory("enough".into())) } else { Ok(()) }
    };
    let counts = source.decode(chunk, rules, &mut sink)?;
    assert_eq!(counts.kept, kept);
    Ok(counts)
}

fn check(counts: &PointCounts) {
    assert_eq!(
        counts.read,
        counts.withheld
            + counts.other_class
            + counts.other_return
            + counts.out_of_bounds
            + counts.nodata
            + counts.malformed
            + counts.kept
    );
    assert_eq!(counts.malformed > 0, !counts.examples.is_empty());
}
