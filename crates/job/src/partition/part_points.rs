//! Reading the points: before a part is done, the inputs that it is the first to need are read whole, and their points go to the parts that
//! they reach, into a file for each.
//!
//! The part that reads inputs is called their **reader**. Its point files have its number, so every file has one writer.

use crate::durable::atomic_file::create_folder;
use crate::durable::columns::{ColumnReader, ColumnWriter};
use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::partition::breakline_points::add_line_sites;
use crate::partition::buckets::{Bucket, Buckets};
use crate::partition::parts::Parts;
use crate::partition::point_file::{PointBlock, PointFile, PointFiles};
use crate::partition::read::{decode, judge};
use crate::partition::result::{Partition, PointSummary};
use crate::partition::tree_builder::TreeBuilder;
use crate::plan::budget::read_buffer_memory;
use crate::plan::input_identity::RenamedInputs;
use crate::plan::job_plan::Plan;
use crate::plan::text_inputs::{allowed_malformed, stop_at};
use crate::progress::stage::Stage;
use crate::records::{StepRecord, Store};
use delaunay::geometry::{Bounds, Site};
use points::PointCounts;
use points::options::OnBadFile;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use sys::{Error, Result};

/// What a reader found for one part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointsForPart {
    /// The part.
    pub part: PartIndex,
    /// The number of blocks.
    blocks: u64,
    /// Their bytes.
    pub bytes: u64,
    /// The digest of these points, with `--update`.
    #[serde(default)]
    digest: u64,
}

/// What the inputs of a reader held.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct ReadInputs {
    /// Sums over these inputs.
    pub summary: PointSummary,
    /// What was found for each part that has points in them, by part.
    pub by_part: Vec<PointsForPart>,
    /// The first input that has malformed records, and what it held.
    malformed: Option<(usize, PointCounts)>,
    /// The inputs, and what they were called when they were read.
    inputs: Vec<KnownInput>,
    /// The part that needs them first.
    reader: PartIndex,
}

/// An input, and what it was called when it was read.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct KnownInput {
    index: usize,
    #[serde(with = "sys::path_text")]
    path: PathBuf,
}

impl ReadInputs {
    /// Gives the inputs the numbers that they have in the plan of `parts`: in an update, files may have come or gone since.
    pub(crate) fn renumber_inputs(&mut self, parts: &Parts) {
        let known: Vec<usize> = self.inputs.iter().map(|known| known.index).collect();
        let present = |old: usize| {
            let place = known.iter().position(|&index| index == old)?;
            parts.new_inputs(self.reader).get(place).copied()
        };
        self.inputs.iter_mut().for_each(|known| known.index = present(known.index).unwrap_or(known.index));
        if let Some((index, _)) = &mut self.malformed {
            *index = present(*index).unwrap_or(*index);
        }
    }

    /// Calls the inputs what they are called in `plan`.
    pub(crate) fn rename_inputs(&mut self, plan: &Plan) {
        let pairs = self.inputs.iter().map(|known| (&known.path, &plan.inputs[known.index].source.path));
        let renamed = RenamedInputs::of_pairs(pairs);
        for counts in [Some(&mut self.summary.counts), self.malformed.as_mut().map(|(_, counts)| counts)] {
            let texts = counts.into_iter().flat_map(|counts| counts.examples.iter_mut().chain(&mut counts.notes));
            texts.for_each(|text| renamed.rename_in(text));
        }
    }
}

/// The blocks that a reader has written, each with the number of its bucket, by part.
#[derive(Debug, Default)]
pub struct ReadBlocks {
    buckets: Vec<u32>,
    blocks: Vec<PointBlock>,
}

impl ReadBlocks {
    /// Writes the record of `reader`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store, reader: PartIndex) -> Result<()> {
        self.save_as(store, StepRecord::Read(reader))
    }

    /// Writes the record `key`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn save_as(&self, store: &Store, key: StepRecord) -> Result<()> {
        ColumnWriter::default().push(&self.buckets).push(&self.blocks).write(store, key)
    }

    /// Adds the blocks of the bucket with this number.
    pub(crate) fn add(&mut self, number: usize, blocks: &[PointBlock]) {
        self.blocks.extend(blocks);
        self.buckets.resize(self.blocks.len(), number as u32);
    }

    /// Returns the bytes of all blocks.
    pub(crate) fn bytes(&self) -> u64 {
        self.blocks.iter().map(PointBlock::bytes).sum()
    }

    /// Returns the number of blocks.
    pub(crate) fn len(&self) -> u64 {
        self.blocks.len() as u64
    }
}

/// Reads the inputs that `reader` is the first to need, where `malformed` records were found before. With `sync` it waits for the disk.
///
/// # Errors
/// [`crate::Error::OtherThanClaimed`] if a header is wrong or an input is bad and to be left out; [`Error::Input`] if too many records are
/// malformed; [`Error::Io`] if an input cannot be read or a point file cannot be written.
pub fn read_inputs(
    plan: &Plan,
    parts: &Parts,
    directory: &JobDirectory,
    reader: PartIndex,
    malformed: u64,
    sync: bool,
    stage: &Stage,
) -> crate::Result<(ReadInputs, ReadBlocks)> {
    let inputs = parts.new_inputs(reader);
    let files = parts.all().map(|part| create(parts, directory, reader, part)).collect::<Result<Vec<_>>>()?;
    let file_of = |bucket: usize| files[parts.part_of(bucket).get()].as_ref();
    let (grid, reading) = (&parts.grid, parts.read_by(reader));
    let buckets = Buckets::on(grid.in_span(reading).map(file_of).collect(), read_buffer_memory(&plan.options));
    let buckets = buckets.with_digests(plan.options.updates);
    let by_input = decode(plan, inputs.iter().copied(), malformed, &grid.within(reading), &buckets, stage);
    let filled = by_input.and_then(|by_input| Ok((by_input, buckets.finish()?)));
    let (by_input, buckets) = filled.map_err(|error| match error {
        // A point lies in a part that the header does not reach.
        Error::Broken(_) if buckets.has_refused() => crate::Error::OtherThanClaimed { is_bad_file: false },
        error => error.into(),
    })?;
    let bad = by_input.0.iter().find(|(_, summary)| summary.counts.malformed > 0);
    let malformed = bad.map(|(input, summary)| (*input, summary.counts.clone()));
    let summary = judge(plan, by_input)?;
    let broken = |bounds: Bounds<3>| {
        let [min, max] = [bounds.min, bounds.max].map(|[x, y, _]| [x, y]);
        // What lies beyond the buckets of these inputs went to the nearest of them.
        !reading.holds(grid.span_of(Bounds { min, max }))
            || plan.claims.is_some_and(|claims| claims.are_broken_by(bounds, summary.counts.max_rgb))
    };
    if summary.bounds.is_some_and(broken) {
        return Err(crate::Error::OtherThanClaimed { is_bad_file: false });
    }
    if sync {
        files.iter().flatten().try_for_each(PointFile::sync)?;
    }
    let (mut by_part, mut read) = (Vec::new(), ReadBlocks::default());
    for part in parts.all() {
        let (before, mut digest) = (read.blocks.len(), 0u64);
        for bucket in grid.in_span(reading.shared(parts.span(part))) {
            if let Some(found) = grid.number_within(reading, bucket).map(|number| &buckets[number]) {
                digest = digest.wrapping_add(found.digest);
                read.add(bucket, &found.blocks);
            }
        }
        let blocks = &read.blocks[before..];
        if !blocks.is_empty() {
            let bytes = blocks.iter().map(PointBlock::bytes).sum();
            by_part.push(PointsForPart { part, blocks: blocks.len() as u64, bytes, digest });
        }
    }
    let known = |&index: &usize| KnownInput { index, path: plan.inputs[index].source.path.clone() };
    let inputs = inputs.iter().map(known).collect();
    Ok((ReadInputs { summary, by_part, malformed, inputs, reader }, read))
}

/// Returns the number of the file with the selected points of a part. Readers, and what divides crowded buckets, have lower numbers.
pub(crate) fn file_of_selected(parts: &Parts) -> u16 {
    parts.all().len() as u16 + 1
}

/// Makes the reader's point file for `part` if one of its inputs reaches it.
fn create(parts: &Parts, directory: &JobDirectory, reader: PartIndex, part: PartIndex) -> Result<Option<PointFile>> {
    if !parts.new_inputs(reader).iter().any(|&input| parts.reaches(input, part)) {
        return Ok(None);
    }
    let directory = directory.part(part);
    create_folder(directory.points())?;
    PointFile::create(&directory.point_file(reader.0 as u16), reader.0 as u16).map(Some)
}

/// Checks that all inputs together have no more malformed records than they may. Each reader knows only its own.
///
/// # Errors
/// [`Error::Input`] names the first file with such records.
pub fn check_malformed<'a>(plan: &Plan, read: impl Iterator<Item = &'a ReadInputs> + Clone) -> Result<()> {
    let malformed = read.clone().map(|inputs| inputs.summary.counts.malformed).sum();
    let mut bad = read.filter_map(|inputs| inputs.malformed.as_ref());
    let first = bad.next();
    match first {
        // Where bad files are left out, each is judged by itself.
        Some((input, counts))
            if plan.options.input.on_bad_file == OnBadFile::Stop
                && malformed > allowed_malformed(plan.options.input.max_malformed_fraction.0, plan.records) =>
        {
            let others = bad.map(|(input, counts)| (&plan.inputs[*input].source, counts.malformed));
            Err(stop_at(&plan.inputs[*input].source, counts, others, [malformed, plan.records]))
        }
        _ => Ok(()),
    }
}

/// The points of a part, which all of its readers have found, or the selected ones.
pub struct PointsOfPart<'a> {
    plan: &'a Plan,
    parts: &'a Parts,
    part: PartIndex,
    are_selected: bool,
    /// The blocks, each with the number of its bucket.
    blocks: Vec<(u32, PointBlock)>,
    /// The digest of the points, with `--update`.
    digest: u64,
}

impl<'a> PointsOfPart<'a> {
    /// Returns no points of `part`.
    pub fn none(plan: &'a Plan, parts: &'a Parts, part: PartIndex) -> PointsOfPart<'a> {
        PointsOfPart { plan, parts, part, are_selected: false, blocks: Vec::new(), digest: 0 }
    }

    /// Returns the selected points of the part, `blocks` blocks that its `store` has.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Broken`] on the store.
    pub(crate) fn selected(mut self, store: &Store, blocks: u64) -> Result<PointsOfPart<'a>> {
        self.are_selected = true;
        self.add_blocks(store, StepRecord::Selected, 0, blocks as usize)?;
        Ok(self)
    }

    /// Adds what `reader` has found for the part, with the store of the reader.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Broken`] on the store.
    pub fn add(&mut self, reader: PartIndex, store: &Store, read: &ReadInputs) -> Result<()> {
        let mut first = 0;
        let own = read.by_part.iter().find(|found| {
            let is_own = found.part == self.part;
            first += if is_own { 0 } else { found.blocks as usize };
            is_own
        });
        let Some(own) = own else { return Ok(()) };
        self.digest = self.digest.wrapping_add(own.digest);
        self.add_blocks(store, StepRecord::Read(reader), first, own.blocks as usize)
    }

    fn add_blocks(&mut self, store: &Store, key: StepRecord, first: usize, count: usize) -> Result<()> {
        let buckets = ColumnReader::open(store, key)?.column_part::<u32>(first, count)?;
        let mut columns = ColumnReader::open(store, key)?;
        columns.skip_column::<u32>()?;
        let blocks = columns.column_part::<PointBlock>(first, count)?;
        self.blocks.extend(buckets.iter().copied().zip(blocks.iter().copied()));
        Ok(())
    }

    /// Returns the digest of the points, with `--update`: it does not depend on their order.
    pub(crate) fn digest(&self) -> u64 {
        self.digest
    }

    /// Tells whether the files of the part in `directory` hold what was written to them.
    ///
    /// # Errors
    /// [`Error::Io`] if the disk does not tell.
    pub fn are_whole(&self, directory: &JobDirectory) -> Result<bool> {
        let files = PointFiles::open(&directory.point_files()?)?;
        let whole = self.blocks.par_iter().map(|(_, block)| files.is_whole(*block));
        whole.try_reduce(|| true, |a, b| Ok(a && b))
    }

    /// Cuts the part into tiles of at most so many points. `directory` is that of the part.
    ///
    /// # Errors
    /// [`Error::Io`] on its point files, [`Error::Config`] if it would have too many tiles.
    pub fn partition(self, directory: &JobDirectory, max_points_per_tile: u64) -> Result<Partition> {
        let PointsOfPart { plan, parts, part, .. } = self;
        // Crowded buckets are divided again into a file that no reader writes.
        let (own, selected) = (parts.all().len() as u16, file_of_selected(parts));
        let mut found = directory.point_files()?;
        found.retain(|(number, _)| if self.are_selected { *number == selected } else { *number < own });
        create_folder(directory.points())?;
        let files = PointFiles::open(&found)?.and(PointFile::create(&directory.point_file(own), own)?);
        let mut builder = TreeBuilder::new(&files, max_points_per_tile, read_buffer_memory(&plan.options));
        let read_bytes: u64 = self.blocks.iter().map(|(_, block)| block.bytes()).sum();
        let (span, grid) = (parts.span(part), parts.grid.within(parts.span(part)));
        let mut buckets = vec![Bucket::default(); grid.buckets()];
        for (index, block) in self.blocks {
            let damaged = || {
                Error::Broken(format!("a block of points belongs to bucket {index}, which part {part} does not have"))
            };
            let number = parts.grid.number_within(span, index as usize).ok_or_else(damaged)?;
            let bucket = &mut buckets[number];
            bucket.points += u64::from(block.points);
            bucket.blocks.push(block);
        }
        let max_rgb = plan.claims.map_or(0, |claims| claims.max_rgb);
        let sites = Buckets::new(files.growing()?, grid.buckets(), read_buffer_memory(&plan.options));
        let is_of_part = |site: Site| parts.part_of(parts.grid.bucket(site) as usize) == part;
        add_line_sites(plan, max_rgb, &grid, &sites, is_of_part)?;
        for (bucket, sites) in buckets.iter_mut().zip(sites.finish()?) {
            bucket.points += sites.points;
            bucket.blocks.extend(sites.blocks);
        }
        let kept: u64 = buckets.iter().map(|bucket| bucket.points).sum();
        builder.grow_root(part, parts.cell(part), &grid, buckets)?;
        let (tree, blocks) = builder.finish();
        if tree.nodes.len() > PartIndex::STRIDE {
            return Err(Error::Config(format!(
                "a part of {} points has {} tiles, more than the {} that can be numbered: set a greater [triangulation] \
                 max_points_per_tile",
                kept,
                tree.leaves.len(),
                PartIndex::STRIDE / 2
            )));
        }
        let point_bytes = read_bytes + files.growing()?.bytes();
        Ok(Partition { tree, blocks, kept, point_bytes })
    }
}
