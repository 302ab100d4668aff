//! Reading the points of a job of several parts: before a part is done, the inputs that it is the first to need are read whole, and their
//! points go to the files of all parts that they reach.

use crate::job::durable::atomic_file::create_folder;
use crate::job::durable::columns::{ColumnReader, ColumnWriter};
use crate::job::durable::directory::JobDirectory;
use crate::job::index::PartIndex;
use crate::job::partition::buckets::{Bucket, Buckets};
use crate::job::partition::parts::Parts;
use crate::job::partition::point_file::{PointBlock, PointFile};
use crate::job::partition::read::{JudgedInputs, decode, judge};
use crate::job::partition::result::{Partition, PointSummary};
use crate::job::partition::tree_builder::TreeBuilder;
use crate::job::plan::budget::read_buffer_memory;
use crate::job::plan::job_plan::Plan;
use crate::job::progress::stage::Stage;
use crate::job::records::{RecordRef, StepRecord, Store};
use crate::{Error, Result};
use rayon::prelude::*;

/// What the inputs that one part needs first held.
#[derive(Debug, Default)]
pub struct ReadBatch {
    /// The blocks that were written, each with the number of its bucket.
    pub blocks: Vec<(u32, PointBlock)>,
    /// Sums over these inputs.
    pub summary: PointSummary,
}

impl ReadBatch {
    /// Writes the record of the batch that `part` needs.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store, part: PartIndex) -> Result<RecordRef> {
        let summary = serde_json::to_vec(&self.summary);
        let summary = summary.map_err(|e| Error::Broken(format!("what was read cannot be written down: {e}")))?;
        let (buckets, blocks): (Vec<u32>, Vec<PointBlock>) = self.blocks.iter().copied().unzip();
        ColumnWriter::default().push(&summary).push(&buckets).push(&blocks).write(store, StepRecord::Read(part))
    }

    /// Reads the record of the batch that `part` needs.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if there is none.
    pub fn load(store: &Store, part: PartIndex) -> Result<ReadBatch> {
        let key = StepRecord::Read(part);
        let mut columns = ColumnReader::open(store, key)?;
        let broken = |e: serde_json::Error| Error::Broken(format!("{}: {e}", store.path(key).display()));
        let summary = serde_json::from_slice(&columns.column::<u8>()?).map_err(broken)?;
        let (buckets, blocks) = (columns.column::<u32>()?, columns.column::<PointBlock>()?);
        Ok(ReadBatch { blocks: buckets.iter().copied().zip(blocks.iter().copied()).collect(), summary })
    }
}

/// The points of all parts, as far as they have been read.
pub struct PartPoints<'a> {
    plan: &'a Plan,
    parts: &'a Parts,
    blocks: Vec<Vec<PointBlock>>,
    /// What has been read.
    pub summary: PointSummary,
}

impl<'a> PartPoints<'a> {
    /// Returns the state before anything has been read.
    pub fn new(plan: &'a Plan, parts: &'a Parts) -> PartPoints<'a> {
        PartPoints { plan, parts, blocks: vec![Vec::new(); parts.grid.buckets()], summary: PointSummary::default() }
    }

    /// Reads the inputs that `part` is the first to need, where parts before it are done. With `sync` it waits for the disk.
    ///
    /// # Errors
    /// [`Error::NeedsOnePart`] if a header is wrong or an input is bad and to be left out; [`Error::Input`] if too many records are
    /// malformed; [`Error::Io`] if an input cannot be read or a point file cannot be written.
    pub fn read(&self, directory: &JobDirectory, part: PartIndex, sync: bool, stage: &Stage) -> Result<ReadBatch> {
        let (plan, parts) = (self.plan, self.parts);
        let inputs = parts.new_inputs(part);
        create_folder(&directory.points_by_part())?;
        let files: Vec<Option<PointFile>> =
            parts.all().map(|p| self.open(directory, part, p, inputs)).collect::<Result<_>>()?;
        let file_of = |bucket: usize| files[parts.part_of(bucket).get()].as_ref();
        let buckets = Buckets::on((0..parts.grid.buckets()).map(file_of).collect(), read_buffer_memory(&plan.options));
        let malformed = self.summary.counts.malformed;
        let by_input = decode(plan, inputs.iter().copied(), malformed, &parts.grid, &buckets, stage)?;
        let buckets = buckets.finish()?;
        let JudgedInputs { summary, skipped, .. } = judge(plan, by_input);
        let broken = |bounds| plan.claims.is_some_and(|claims| claims.are_broken_by(bounds, summary.counts.max_rgb));
        if !skipped.is_empty() || summary.bounds.is_some_and(broken) {
            return Err(Error::NeedsOnePart);
        }
        if sync {
            files.iter().flatten().try_for_each(PointFile::sync)?;
        }
        let blocks =
            (0..).zip(buckets).flat_map(|(index, bucket)| bucket.blocks.into_iter().map(move |block| (index, block)));
        Ok(ReadBatch { blocks: blocks.collect(), summary })
    }

    /// Opens the file of `other` if it is not done before `part` and one of `inputs` reaches it.
    fn open(
        &self,
        directory: &JobDirectory,
        part: PartIndex,
        other: PartIndex,
        inputs: &[usize],
    ) -> Result<Option<PointFile>> {
        if other < part || !inputs.iter().any(|&input| self.parts.reaches(input, other)) {
            return Ok(None);
        }
        PointFile::append_to(&directory.part(other).points(), self.blocks_of(other)).map(Some)
    }

    fn blocks_of(&self, part: PartIndex) -> impl Iterator<Item = &PointBlock> {
        self.parts.buckets_of(part).flat_map(|bucket| &self.blocks[bucket])
    }

    /// Tells whether the file of `part` holds what was written to it.
    pub fn are_whole(&self, directory: &JobDirectory, part: PartIndex) -> bool {
        let blocks: Vec<PointBlock> = self.blocks_of(part).copied().collect();
        let file = PointFile::open(&directory.part(part).points());
        blocks.is_empty() || file.is_ok_and(|file| blocks.par_iter().all(|&block| file.is_whole(block)))
    }

    /// Returns the bytes of the points of `part`.
    pub fn bytes(&self, part: PartIndex) -> u64 {
        self.blocks_of(part).map(PointBlock::bytes).sum()
    }

    /// Adds what has been read.
    pub fn add(&mut self, batch: ReadBatch) {
        batch.blocks.into_iter().for_each(|(bucket, block)| self.blocks[bucket as usize].push(block));
        self.summary += batch.summary;
    }

    /// Cuts `part`, whose points have all been read, into tiles.
    ///
    /// # Errors
    /// [`Error::Io`] on its point file, [`Error::Config`] if it would have too many tiles.
    pub fn partition(&self, directory: &JobDirectory, part: PartIndex) -> Result<Partition> {
        let (plan, parts) = (self.plan, self.parts);
        let file = PointFile::append_to(&directory.part(part).points(), self.blocks_of(part))?;
        let max_points_per_tile = plan.options.triangulation.max_points_per_tile.0;
        let mut builder = TreeBuilder::repeatable(&file, max_points_per_tile, read_buffer_memory(&plan.options));
        let mut buckets = vec![Bucket::default(); parts.grid.buckets()];
        for bucket in parts.buckets_of(part) {
            let blocks = self.blocks[bucket].clone();
            buckets[bucket] = Bucket { points: blocks.iter().map(|block| u64::from(block.points)).sum(), blocks };
        }
        let mut summary = PointSummary::default();
        summary.counts.kept = buckets.iter().map(|bucket| bucket.points).sum();
        builder.grow_root(part, parts.cell(part), &parts.grid, parts.span(part), buckets)?;
        let (tree, blocks) = builder.finish();
        if tree.nodes.len() > PartIndex::STRIDE {
            return Err(Error::Config(format!(
                "a part of {} points has {} tiles, more than the {} that can be numbered: set a greater [triangulation] \
                 max_points_per_tile",
                summary.counts.kept,
                tree.leaves.len(),
                PartIndex::STRIDE / 2
            )));
        }
        Ok(Partition { tree, blocks, summary, point_bytes: file.bytes(), skipped: Vec::new() })
    }
}
