//! Reads whole files, for tests of the input.

use std::path::Path;

use delaunay::geometry::REACH;
use lattice::{AxisMap, Lattice};
use points::{KeptReturns, OptionalFields, Point, PointCounts, PointRules, Source, TextOptions, open};
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use sys::Result;

/// A file, all its points, and the lattice on which they lie.
pub(crate) struct Cloud {
    pub(crate) source: Source,
    pub(crate) lattice: Lattice,
    pub(crate) points: Vec<Point>,
    pub(crate) counts: PointCounts,
}

/// Returns a lattice around the middle of `source`. Its step is the finer of the steps in x and y if that fits, else the coarser.
pub(crate) fn lattice(source: &Source) -> Lattice {
    let middle = |axis: usize| {
        let value = (source.min[axis] + source.max[axis]) / 2.0;
        Decimal::try_from(value).unwrap_or_default().round()
    };
    let extent = (source.max[0] - source.min[0]).max(source.max[1] - source.min[1]);
    let [x, y] = [source.axes[0].scale, source.axes[1].scale];
    let fits = extent / x.min(y).to_f64().unwrap() < 2.0 * REACH as f64;
    let resolution = if fits { x.min(y) } else { x.max(y) };
    Lattice { offset: [middle(0), middle(1), Decimal::ZERO], resolution, resolution_z: source.axes[2].scale }
}

/// Returns rules that keep every point of `source` on `lattice`.
pub(crate) fn rules(source: &Source, lattice: &Lattice) -> PointRules {
    let map = |axis: usize| {
        let own = source.axes[axis];
        AxisMap::new(own.offset, own.scale, lattice.offset[axis], lattice.step(axis)).unwrap()
    };
    PointRules {
        maps: [map(0), map(1), map(2)],
        classes: [true; 256],
        returns: KeptReturns::All,
        bounds: None,
        clip: None,
        first_order: 0,
        numbered: true,
        fields: OptionalFields::RGB,
    }
}

/// Decodes all chunks in order and checks that the counts agree with the points.
pub(crate) fn decode(source: &Source, rules: &PointRules) -> Result<(Vec<Point>, PointCounts)> {
    let (mut points, mut counts) = (Vec::new(), PointCounts::default());
    for chunk in 0..source.chunks() {
        counts += source.decode(chunk, rules, &mut |slice| {
            assert!(!slice.is_empty() && slice.len() <= 65_536);
            points.extend_from_slice(slice);
            Ok(())
        })?;
    }
    let dropped = counts.withheld + counts.other_class + counts.other_return + counts.out_of_bounds + counts.malformed;
    assert_eq!(counts.read, dropped + counts.nodata + counts.kept);
    assert_eq!(counts.kept, points.len() as u64);
    assert_eq!(counts.read, source.records);
    Ok((points, counts))
}

pub(crate) fn read_with(path: &Path, options: &TextOptions) -> Result<Cloud> {
    let source = open(path, options)?;
    let lattice = lattice(&source);
    let (points, counts) = decode(&source, &rules(&source, &lattice))?;
    Ok(Cloud { source, lattice, points, counts })
}

pub(crate) fn read(path: &Path) -> Result<Cloud> {
    read_with(path, &TextOptions::default())
}

/// Writes `bytes` to a file whose name ends in `extension`. Dropping the path removes the file.
pub(crate) fn file(extension: &str, bytes: &[u8]) -> tempfile::TempPath {
    let file = tempfile::Builder::new().suffix(extension).tempfile().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    file.into_temp_path()
}

pub(crate) fn read_bytes(extension: &str, bytes: &[u8]) -> Result<Cloud> {
    read(&file(extension, bytes))
}

/// Opens and decodes `bytes`, which must not panic or hang.
pub(crate) fn survives(extension: &str, bytes: &[u8]) {
    let path = file(extension, bytes);
    let Ok(source) = open(&path, &TextOptions::default()) else { return };
    let axis = |axis: usize| {
        AxisMap::new(Decimal::ZERO, Decimal::ONE, Decimal::ZERO, source.axes[axis].scale.max(Decimal::ONE))
    };
    let map = AxisMap::new(Decimal::ZERO, Decimal::ONE, Decimal::ZERO, Decimal::ONE).unwrap();
    let maps = [0, 1, 2].map(|i| axis(i).unwrap_or(map));
    let rules = PointRules {
        maps,
        classes: [true; 256],
        returns: KeptReturns::All,
        bounds: None,
        clip: None,
        first_order: 0,
        numbered: true,
        fields: OptionalFields::RGB,
    };
    for chunk in 0..source.chunks().min(64) {
        let _ = source.decode(chunk, &rules, &mut |_| Ok(()));
    }
}
