//! The inputs that are left out, in words.

use crate::plan::job_plan::SkippedInput;
use std::fmt;
use sys::terminal::{name, one_line};

/// Writes how many inputs are left out, and each of them with its reason. Writes nothing if none is.
pub(crate) fn write_skipped(f: &mut fmt::Formatter<'_>, used: usize, skipped: &[SkippedInput]) -> fmt::Result {
    if let Some(summary) = skipped_summary(used, skipped) {
        writeln!(f, "\n{summary}:")?;
    }
    skipped.iter().try_for_each(|bad| writeln!(f, "  {}: {}", name(&bad.file), one_line(&bad.why)))
}

/// Returns a sentence about the inputs that are left out; `None` if none is. `used` is the number of the others.
pub fn skipped_summary(used: usize, skipped: &[SkippedInput]) -> Option<String> {
    let (bad, all) = (skipped.len(), used + skipped.len());
    (bad > 0).then(|| format!("LEFT OUT: {bad} of {all} input files, because they are bad and on_bad_file = \"skip\""))
}
