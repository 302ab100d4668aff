//! Opening a text.

use crate::file::random_access::RandomAccessFile;
use crate::source::{FileFormat, PointData, Source};
use crate::text::options::TextOptions;
use crate::text::row_choice::RowChoice;
use crate::text::table::TextTable;
use crs::system::Crs;
use sys::{Result, Warnings};

impl Source {
    /// Opens a text, which is read once.
    pub(super) fn open_text(file: &RandomAccessFile, options: &TextOptions, choice: &RowChoice) -> Result<Source> {
        let mut warnings = Warnings::default();
        let table = TextTable::scan(file, options, choice, &mut warnings)?;
        Ok(Source {
            records: table.records + table.missing,
            missing: table.missing,
            min: table.min,
            max: table.max,
            grid: table.grid(),
            has_rgb: table.has_rgb(),
            has_class: table.has_class(),
            has_returns: table.has_returns(choice.returns),
            has_intensity: table.has_intensity(),
            crs: Crs { horizontal: table.unit, vertical: table.unit_z, ..Crs::default() },
            warnings,
            ..Source::of(file, FileFormat::Text, table.axes(), PointData::Text(Box::new(table)))
        })
    }
}
