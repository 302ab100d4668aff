//! Points that all have one height: those of a map without heights, or of a text whose column of heights is another.

use crate::plan::extent::Extent;
use crate::plan::height_range::HeightSample;
use crate::plan::suspect_heights::own_height;
use lattice::Lattice;
use points::Source;

/// Fewer points may be a plate.
const FEWEST: usize = 10;

/// Returns a warning if all points of a job have one height, as far as a sample shows, which saw all of them or agrees with the headers.
pub(crate) fn flat_points(
    sources: &[Source],
    extent: &Extent,
    sample: &HeightSample,
    lattice: &Lattice,
) -> Option<String> {
    let steps = sample.only_height().filter(|_| sample.points.len() >= FEWEST)?;
    let is_claimed = extent.min[2] == extent.max[2] && extent.boxes.iter().all(Option::is_some);
    let points = match sample.saw_all() {
        true => format!("all {} points", sample.points.len()),
        false if is_claimed => "all points".into(),
        false => return None,
    };
    let height = own_height(sources.first()?, lattice, steps.into());
    let is_text = sources.iter().any(|source| source.format.is_text());
    let column = if is_text { "[input.csv] columns for the column of heights, or " } else { "" };
    Some(format!(
        "{points} have the height {height}, so the terrain is flat; fix: if the {} has no heights, {column}{} with heights",
        if sources.len() == 1 { "file" } else { "input" },
        if sources.len() == 1 { "another file" } else { "other files" }
    ))
}
