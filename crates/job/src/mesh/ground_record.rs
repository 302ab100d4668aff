//! The record of the ground that a job has found.

use crate::durable::columns::{ColumnReader, ColumnWriter};
use crate::records::{StepRecord, Store};
use ground::{CellNumbers, Ground, GroundColumns};
use std::ops::Range;
use sys::{Error, Result};

/// Writes the record.
///
/// # Errors
/// [`Error::Io`].
pub(crate) fn save_ground(ground: &Ground, store: &Store) -> Result<()> {
    let GroundColumns { numbers, places, cells } = ground.columns();
    let columns = ColumnWriter::default().push(&numbers).push(places).push_parts(&cells);
    columns.write(store, StepRecord::Ground)
}

/// Reads the record.
///
/// # Errors
/// [`Error::Io`], or [`Error::Broken`] if there is none.
pub(crate) fn load_ground(store: &Store) -> Result<Ground> {
    let mut columns = ColumnReader::open(store, StepRecord::Ground)?;
    let (numbers, places) = (columns.column()?, columns.column()?);
    let read = |range: Range<usize>| {
        let mut columns = ColumnReader::open(store, StepRecord::Ground)?;
        columns.skip_column::<f64>()?;
        columns.skip_column::<[i32; 2]>()?;
        columns.column_part::<CellNumbers>(range.start, range.len())
    };
    Ground::of_columns(numbers, places, read)?.ok_or_else(|| Error::Broken("the ground has no cells".into()))
}
