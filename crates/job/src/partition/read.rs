//! Decoding inputs: their points go to the buckets of a grid, from which trees are grown. What they held is judged.

use crate::partition::breakline_points::BreaklineFilter;
use crate::partition::bucket_sorter::BucketSorter;
use crate::partition::buckets::Buckets;
use crate::partition::grid::Grid;
use crate::partition::result::PointSummary;
use crate::plan::budget::network_memory;
use crate::plan::job_plan::{Plan, PlannedInput};
use crate::plan::measured_inputs::bad_input;
use crate::plan::stray_heights::unforeseen_heights;
use crate::plan::text_inputs::{allowed_malformed, stop_at};
use crate::progress::stage::Stage;
use breaklines::Breaklines;
use points::options::OnBadFile;
use points::surface::SurfaceShares;
use points::surface_warnings::no_ground;
use points::{Point, PointCounts, set_network_memory};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use sys::{Error, Result, interrupt};

/// Sums up the inputs.
///
/// # Errors
/// Where bad files are left out, [`crate::Error::OtherThanClaimed`] if one of them is bad: the job is planned again without it. Otherwise
/// [`Error::Input`] if the points of one show that its header hides nodata.
pub(crate) fn judge(plan: &Plan, by_input: ByInput) -> crate::Result<PointSummary> {
    let mut sum = PointSummary::default();
    for (index, summary) in by_input.0 {
        let input = &plan.inputs[index];
        if let Some(why) = bad_input(&input.source, &summary.counts, summary.bounds, &plan.lattice, &plan.options) {
            return Err(match plan.options.input.on_bad_file {
                OnBadFile::Skip => crate::Error::OtherThanClaimed { is_bad_file: true },
                OnBadFile::Stop => Error::input(&input.source.path, why).into(),
            });
        }
        sum += with_notes(input, plan, summary);
    }
    Ok(sum)
}

/// Adds what the user should know about an input that only reading it shows.
fn with_notes(input: &PlannedInput, plan: &Plan, mut summary: PointSummary) -> PointSummary {
    let heights = unforeseen_heights(&input.source, summary.bounds, plan);
    let counts = &mut summary.counts;
    let path = input.source.path.display();
    if counts.misplaced > 0 {
        counts.notes.push(format!(
            "{path}: {} points lie outside their cell of its octree (COPC): all points were read, to find those within [input] bounds",
            counts.misplaced
        ));
    }
    counts.notes.extend(heights.map(|what| format!("{path}: {what}")));
    counts
        .notes
        .extend(no_ground(&plan.options.input, counts).map(|what| format!("{path}: no point of it is used: {what}")));
    summary
}

/// What each input held, in the order of the inputs. Inputs without chunks are not listed, unless they are left aside.
#[derive(Default)]
pub(crate) struct ByInput(pub(crate) Vec<(usize, PointSummary)>);

impl ByInput {
    /// Adds what later chunks held.
    fn append(mut self, later: ByInput) -> ByInput {
        let mut later = later.0.into_iter();
        match (self.0.last_mut(), later.next()) {
            (Some((last, summary)), Some((first, more))) if *last == first => *summary += more,
            (_, next) => self.0.extend(next),
        }
        self.0.extend(later);
        self
    }
}

/// Decodes all chunks of these inputs in parallel and hands the points to the buckets of the grid. `malformed` records were found before.
/// What the index of an input leaves out is decoded too if the index proves wrong.
pub(crate) fn decode(
    plan: &Plan,
    inputs: impl Iterator<Item = usize>,
    malformed: u64,
    grid: &Grid,
    buckets: &Buckets,
    stage: &Stage,
) -> Result<ByInput> {
    let inputs: Vec<usize> = inputs.collect();
    let lines = plan.built_breaklines()?;
    set_network_memory(network_memory(&plan.options));
    let pass = Pass { plan, grid, buckets, lines: lines.as_deref(), malformed: AtomicU64::new(malformed) };
    let mut by_input = pass.over(inputs.iter().copied(), false, |input, chunk, sink| {
        let counts = input.source.decode(chunk, &input.rules, sink)?;
        stage.advance(counts.read);
        Ok(counts)
    })?;
    let is_wrong = |counts: &PointCounts| counts.misplaced > 0 && counts.not_decoded > 0;
    let wrong: Vec<usize> = by_input.0.iter().filter(|(_, s)| is_wrong(&s.counts)).map(|(index, _)| *index).collect();
    let rest = pass
        .over(wrong.into_iter(), true, |input, chunk, sink| input.source.decode_left_out(chunk, &input.rules, sink))?;
    for (index, more) in rest.0 {
        if let Some((_, summary)) = by_input.0.iter_mut().find(|(known, _)| *known == index) {
            summary.counts.take_back_not_decoded();
            *summary += more;
        }
    }
    for index in inputs {
        if let Some(counts) = plan.inputs[index].source.counts_left_aside() {
            stage.advance(counts.read);
            by_input.0.push((index, PointSummary { counts, bounds: None }));
        }
    }
    by_input.0.sort_by_key(|(index, _)| *index);
    Ok(by_input)
}

/// One way over inputs, chunk by chunk.
struct Pass<'a> {
    plan: &'a Plan,
    grid: &'a Grid,
    buckets: &'a Buckets<'a>,
    /// What drops points at breaklines.
    lines: Option<&'a Breaklines>,
    /// The malformed records so far.
    malformed: AtomicU64,
}

/// Takes points of an input.
type PointSink<'a> = &'a mut dyn FnMut(&[Point]) -> Result<()>;

impl Pass<'_> {
    /// Decodes all chunks of these inputs with `decode`, in parallel: what bounds leave in, or what an index leaves out.
    fn over(
        &self,
        inputs: impl Iterator<Item = usize>,
        left_out: bool,
        decode: impl Fn(&PlannedInput, usize, PointSink) -> Result<PointCounts> + Sync,
    ) -> Result<ByInput> {
        let inputs: Vec<usize> = inputs.collect();
        let read_ahead = |index: &usize| {
            let PlannedInput { source, rules, .. } = &self.plan.inputs[*index];
            source.read_ahead(rules.bounds.as_ref(), left_out)
        };
        let _ahead = inputs.iter().map(read_ahead).collect::<Result<Vec<_>>>()?;
        let chunks_of = |index: usize| (0..self.plan.inputs[index].source.chunks()).map(move |chunk| (index, chunk));
        let chunks: Vec<(usize, usize)> = inputs.into_iter().flat_map(chunks_of).collect();
        let decode_chunk = |&(index, chunk): &(usize, usize)| -> Result<ByInput> {
            interrupt::check()?;
            let input = &self.plan.inputs[index];
            let mut sorter = BucketSorter::new(self.grid, self.buckets);
            let mut filter = BreaklineFilter::new(self.lines);
            let mut counts = decode(input, chunk, &mut |points| sorter.add(filter.without_dropped(points)))?;
            let SurfaceShares { points, ground, unclassified } = filter.dropped();
            counts.drop_at_breaklines([points, ground, unclassified]);
            self.check_malformed(input, &counts)?;
            Ok(ByInput(vec![(index, PointSummary { counts, bounds: sorter.bounds() })]))
        };
        // The reduction keeps the order of the chunks.
        chunks.par_iter().with_max_len(1).map(decode_chunk).try_reduce(ByInput::default, |a, b| Ok(a.append(b)))
    }

    /// Fails if there are too many malformed records. Only a chunk with some of its own reports that: another may be sound.
    fn check_malformed(&self, input: &PlannedInput, counts: &PointCounts) -> Result<()> {
        let (plan, options) = (self.plan, &self.plan.options.input);
        let so_far = self.malformed.fetch_add(counts.malformed, Ordering::Relaxed) + counts.malformed;
        let allowed = allowed_malformed(options.max_malformed_fraction.0, plan.records);
        match options.on_bad_file {
            OnBadFile::Stop if counts.malformed > 0 && so_far > allowed => {
                Err(stop_at(&input.source, counts, std::iter::empty(), [so_far, plan.records]))
            }
            _ => Ok(()),
        }
    }
}
