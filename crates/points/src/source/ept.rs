//! Opening an EPT.

use crate::ept::index::EptIndex;
use crate::ept::points::EptPoints;
use crate::file::random_access::RandomAccessFile;
use crate::source::{FileFormat, PointData, Source};
use crate::text::row_choice::RowChoice;
use crs::plausible::plausible;
use sys::{Error, Result, Warnings};

/// The most bytes of an index.
const LARGEST: u64 = 1 << 24;

impl Source {
    /// Opens the EPT whose index is `file`. With bounds, only those nodes count that they meet.
    pub(super) fn open_ept(file: &RandomAccessFile, choice: &RowChoice) -> Result<Source> {
        if file.size() > LARGEST {
            return Err(Error::input(file.path(), "is too long for the index of an EPT"));
        }
        let mut warnings = Warnings::default();
        let index = EptIndex::parse(file.path(), &file.bytes(0..file.size())?, &mut warnings)?;
        let points = EptPoints::read(file.path(), &index, choice.bounds, choice.use_index)?;
        if points.missing > 0 {
            let (all, held) = (index.points, index.points - points.missing);
            warnings.push(format!("the index gives {all} points, but its hierarchy has only {held}"));
        }
        let [min, max] = index.bounds;
        if min.iter().chain(&max).any(|value| !value.is_finite()) {
            return Err(Error::input(file.path(), "has bounds that are not finite numbers"));
        }
        let source = Source {
            records: index.points,
            missing: points.missing,
            min,
            max,
            has_rgb: index.has_rgb,
            crs: plausible(index.crs, min, max, &mut warnings),
            warnings,
            ..Source::of(file, FileFormat::Ept, index.axes, PointData::Ept(Box::new(points)))
        };
        source.with_choice(choice)
    }
}
