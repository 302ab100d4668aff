//! How many points a job keeps at most, before they are read: by the boxes in the headers, and by a sample of chunks.

use crate::plan::job_plan::{Plan, PlannedInput};
use points::DecodedChunks;
use rayon::prelude::*;
use sys::{Error, Result, interrupt};

/// The chunks of a first sample: some two million points, a second of reading.
const FIRST_SAMPLE: usize = 32;
/// Reading more than this share of the chunks would cost what a refusal saves.
const MOST_SAMPLED: usize = 16;

/// An upper bound, so that no disk runs full: what the headers allow, or two standard errors above what the sample held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct KeptPoints(pub(crate) u64);

/// What `bounds`, `clip` and choices of classes and returns leave of an input, as far as its header tells.
enum Share {
    Nothing,
    Everything,
    Some,
}

impl KeptPoints {
    /// Returns all points of the inputs whose boxes `bounds` and `clip` meet.
    pub(crate) fn by_headers(plan: &Plan) -> KeptPoints {
        let inputs = plan.inputs.iter().filter(|input| !matches!(share(plan, input), Share::Nothing));
        KeptPoints(inputs.map(PlannedInput::decoded_records).sum())
    }

    /// Returns what a sample of chunks shows. It grows until the least and the most that are likely are clear to `is_clear`, or until
    /// more would take too long.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(crate) fn by_sample(plan: &Plan, is_clear: impl Fn(KeptPoints, KeptPoints) -> bool) -> Result<KeptPoints> {
        let mut certain = 0;
        let mut partly: Vec<(&PlannedInput, DecodedChunks)> = Vec::new();
        for input in &plan.inputs {
            match share(plan, input) {
                Share::Nothing => {}
                Share::Everything => certain += input.decoded_records(),
                Share::Some => partly.push((input, input.source.decoded_chunks(input.rules.bounds.as_ref()))),
            }
        }
        let mut chunks: Vec<(&PlannedInput, usize)> = Vec::new();
        for (input, decoded) in &partly {
            chunks.extend((0..decoded.len()).map(|index| (*input, decoded.chunk(index))));
        }
        let doubtful: u64 = partly.iter().map(|(_, decoded)| decoded.records).sum();
        let enough = (chunks.len() / MOST_SAMPLED).max(4 * FIRST_SAMPLE).min(chunks.len());
        let mut size = FIRST_SAMPLE.min(enough);
        loop {
            let likely = kept_share(&chunks, size)?;
            let [least, most] = likely.map(|share| KeptPoints(certain + (doubtful as f64 * share).ceil() as u64));
            if size >= enough || is_clear(least, most) {
                return Ok(most);
            }
            size = (4 * size).min(enough);
        }
    }
}

/// Tells whether the options leave out so much that a sample may matter. Noise does not.
pub(crate) fn has_filter(plan: &Plan) -> bool {
    plan.options.input.has_filter()
}

fn share(plan: &Plan, input: &PlannedInput) -> Share {
    let everything = if plan.options.input.chooses_kinds() { Share::Some } else { Share::Everything };
    let Some([xmin, ymin, xmax, ymax]) = plan.rectangle() else { return everything };
    let [low, high] = [[xmin, ymin], [xmax, ymax]];
    // A header that gives no box says nothing.
    let Some([min, max]) = input.source.claimed_rectangle() else { return Share::Some };
    let apart = (0..2).any(|axis| max[axis] < low[axis] || min[axis] > high[axis]);
    let inside = (0..2).all(|axis| min[axis] >= low[axis] && max[axis] <= high[axis]);
    match (apart, inside) {
        (true, _) => Share::Nothing,
        // Of what is in the box of a clip, any part may be in its polygons.
        (_, true) if plan.clip.is_none() => everything,
        _ => Share::Some,
    }
}

/// Returns the least and the greatest likely share of records that pass, from `size` chunks at equal distances: clouds are stored by place or by
/// time, so that neighbours are alike.
fn kept_share(chunks: &[(&PlannedInput, usize)], size: usize) -> Result<[f64; 2]> {
    if chunks.is_empty() {
        return Ok([1.0; 2]);
    }
    let picked = (0..size).into_par_iter().map(|i| chunks[(2 * i + 1) * chunks.len() / (2 * size)]);
    let shares: Vec<f64> = picked.map(|(input, chunk)| share_of_chunk(input, chunk)).collect::<Result<_>>()?;
    let count = shares.len() as f64;
    let mean = shares.iter().sum::<f64>() / count;
    if size == chunks.len() {
        return Ok([mean; 2]);
    }
    let variance = shares.iter().map(|share| (share - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let error = 2.0 * (variance / count).sqrt();
    // What no sampled chunk shows may still be there.
    Ok([(mean - error).max(0.0), (mean + error + 1.0 / count).min(1.0)])
}

fn share_of_chunk(input: &PlannedInput, chunk: usize) -> Result<f64> {
    interrupt::check()?;
    match input.source.decode(chunk, &input.rules, &mut |_| Ok(())) {
        Ok(counts) => Ok(counts.kept as f64 / (counts.read - counts.not_decoded).max(1) as f64),
        Err(Error::Interrupted) => Err(Error::Interrupted),
        // Reading the points says what is wrong.
        Err(_) => Ok(1.0),
    }
}
