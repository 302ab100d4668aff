//! Files whose points are all (0, 0, 0): a writer has made their records, and no coordinates.

use crate::plan::extent::Extent;
use crate::plan::height_range::HeightSample;
use lattice::Lattice;
use points::Source;
use sys::{Error, Result};

/// Fails if all points of one of several files are (0, 0, 0), as far as it claims, and a sample of them is.
///
/// # Errors
/// [`Error::Input`] names the first such file.
pub(crate) fn refuse_zero_points(
    sources: &[Source],
    extent: &Extent,
    sample: &HeightSample,
    lattice: &Lattice,
) -> Result<()> {
    let is_zero = |source: &Source| {
        let is_origin = |axis: usize, steps: &i32| lattice.world(axis, *steps) == 0.0;
        sample.by_file.get(&source.path).is_some_and(|found| {
            let planes = found.plane.iter().enumerate();
            !found.heights.is_empty()
                && found.heights.iter().all(|steps| is_origin(2, steps))
                && planes.into_iter().all(|(axis, values)| values.iter().all(|steps| is_origin(axis, steps)))
        })
    };
    let mut claims = sources.iter().zip(&extent.boxes);
    let only_zeros = |(source, claim): &(&Source, &_)| **claim == Some([[0.0; 3]; 2]) && is_zero(source);
    let Some((source, _)) = claims.find(only_zeros).filter(|_| extent.min != extent.max) else { return Ok(()) };
    let points = if source.records == 1 { "its only point is" } else { "all of its points are" };
    Err(Error::input(
        &source.path,
        format!(
            "{points} (0, 0, 0), so it holds no coordinates: write it again, leave it out of [input] files, or set on_bad_file = \"skip\""
        ),
    ))
}
