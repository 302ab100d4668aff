//! What to say about numbers with digits that are noise.

use std::ops::Range;

use rust_decimal::Decimal;

use crate::file::random_access::RandomAccessFile;
use crate::text::columns::Columns;
use crate::text::lines::{TextLine, for_each_line};
use crate::text::noise;
use crate::text::role::ColumnRole;
use crate::text::row::RowReader;
use crate::text::survey::Findings;
use sys::Result;

/// Returns a warning about numbers with digits that are noise. `noisy` are the bytes of the first chunk with such a number; rows begin
/// at byte `start`.
pub(crate) fn noise_warning(
    file: &RandomAccessFile,
    columns: &Columns,
    found: &Findings,
    start: u64,
    noisy: Option<Range<u64>>,
) -> Result<Option<String>> {
    let (Some(first), Some(chunk)) = (found.noise, noisy) else { return Ok(None) };
    let Some(meant) = noise::meaning(&first) else { return Ok(None) };
    let meant = Decimal::new(meant.number.mantissa, meant.number.decimals.into());
    let mut written = None;
    let mut reader = RowReader::new(columns);
    for_each_line(file, start, chunk, |_, line| {
        if let (None, TextLine::Whole(line)) = (&written, line)
            && !columns.skips(line)
            && reader.read(line).is_ok()
            && let Some(axis) = reader.numbers.iter().position(|number| *number == first)
        {
            let column = columns.roles.iter().position(|role| *role == ColumnRole::Coordinate(axis));
            let fields = columns.delimiter.fields(line);
            let field = column.and_then(|column| fields.get(column).copied()).unwrap_or_default();
            written = Some(String::from_utf8_lossy(field).into_owned());
        }
        Ok(())
    })?;
    let written = written.unwrap_or_else(|| Decimal::new(first.mantissa, first.decimals.into()).to_string());
    Ok(Some(format!(
        "{} numbers have more digits than floating point holds, such as {written}: read as {meant}",
        found.noisy
    )))
}
