//! Writing many elements in chunks: all threads format, and the chunks come out in their order.

use crate::mesh::Output;
use rayon::prelude::*;
use std::ops::Range;
use sys::{Result, interrupt};

/// The elements of a chunk. As text they take some megabytes at most.
const CHUNK: u64 = 1 << 14;

/// Writes `count` elements. `format` returns the bytes of some of them.
///
/// # Errors
/// Those of `format` and `out`, and [`sys::Error::Interrupted`].
pub(crate) fn write_chunks(
    count: u64,
    format: &(dyn Fn(Range<u64>) -> Result<Vec<u8>> + Sync),
    out: &mut Output,
) -> Result<()> {
    let together = CHUNK * rayon::current_num_threads().max(1) as u64;
    let mut first = 0;
    while first < count {
        interrupt::check()?;
        let last = count.min(first + together);
        let starts: Vec<u64> = (first..last).step_by(CHUNK as usize).collect();
        let chunk = |&start: &u64| format(start..last.min(start + CHUNK));
        let chunks: Vec<Vec<u8>> = starts.par_iter().with_max_len(1).map(chunk).collect::<Result<_>>()?;
        chunks.iter().try_for_each(|chunk| out(chunk))?;
        first = last;
    }
    Ok(())
}
