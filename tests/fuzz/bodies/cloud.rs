//! A point cloud of any bytes: opened, planned for, decoded.

use std::path::Path;
use std::sync::LazyLock;

use gdt_batch::geometry::lattice::{AxisMap, REACH};
use gdt_batch::input::{Point, PointCounts, PointRules, Source, TextOptions, open};
use gdt_batch::job::options::JobOptions;
use gdt_batch::job::plan::lattice_choice::LatticeCoarsening;
use gdt_batch::job::plan::scan;
use gdt_batch::{Error, Result};

use super::with_file;

/// More points than this are not waited for: a few bytes may promise very many.
const ENOUGH: u64 = 200_000;

/// The bytes of a LAS or LAZ file.
pub(crate) fn las(bytes: &[u8]) {
    with_file(".las", bytes, |path| read(path, &TextOptions::default()));
}

/// The first byte says which options are set, the others are the text.
pub(crate) fn text(bytes: &[u8]) {
    let Some((&choice, text)) = bytes.split_first() else { return };
    let bit = |bit: u8| choice >> bit & 1 == 1;
    let columns = || ["z", "-", "x", "y", "class"].map(String::from).to_vec();
    let options = TextOptions {
        delimiter: bit(0).then_some(if bit(1) { ';' } else { ' ' }),
        header: bit(2).then_some(bit(3)),
        columns: bit(4).then(columns),
        comment: bit(5).then(|| "%".to_owned()),
    };
    with_file(".csv", text, |path| read(path, &options));
}

fn read(path: &Path, options: &TextOptions) {
    let Ok(source) = open(path, options) else { return };
    plan(path, options);
    let Some(rules) = rules(&source) else { return };
    let mut seen = 0;
    for chunk in 0..source.chunks() {
        match decode(&source, chunk, &rules, &mut seen) {
            Ok(counts) => check(&counts),
            Err(Error::Memory(_)) => return,
            Err(error) => panic!("{error}"),
        }
    }
}

/// The first step of a job on the file: whatever its header says, a plan or a sentence.
fn plan(path: &Path, options: &TextOptions) {
    static CONFIG: LazyLock<JobOptions> = LazyLock::new(|| {
        let text = b"[input]\nfiles = [\"a\"]\n[output]\ndirectory = \"out\"\n[limits]\nthreads = 1\n";
        with_file(".toml", text, |path| gdt_batch::config::load(path).expect("the least configuration"))
    });
    let mut config = CONFIG.clone();
    config.input.files = vec![path.to_str().expect("a plain path").to_owned()];
    config.input.csv = options.clone();
    if let Err(error) = scan::make_plan(&config, LatticeCoarsening::default()) {
        assert!(matches!(error.exit_code(), 2 | 3) && error.to_string().len() < 4000, "{error}");
    }
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
        bounds: None,
        first_order: 5,
        rgb: true,
    })
}

fn decode(source: &Source, chunk: usize, rules: &PointRules, seen: &mut u64) -> Result<PointCounts> {
    let (mut kept, mut next) = (0, 0);
    let mut sink = |points: &[Point]| {
        for point in points {
            assert!(point.position.iter().all(|v| (-REACH..=REACH).contains(v)));
            assert!(point.order() >= next && point.order() - rules.first_order < source.records);
            next = point.order() + 1;
        }
        kept += points.len() as u64;
        *seen += points.len() as u64;
        if *seen > ENOUGH { Err(Error::Memory("enough".into())) } else { Ok(()) }
    };
    let counts = source.decode(chunk, rules, &mut sink)?;
    assert_eq!(counts.kept, kept);
    Ok(counts)
}

fn check(counts: &PointCounts) {
    assert_eq!(
        counts.read,
        counts.withheld + counts.other_class + counts.out_of_bounds + counts.malformed + counts.kept
    );
    assert_eq!(counts.malformed > 0, !counts.examples.is_empty());
}
