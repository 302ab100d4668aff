//! Going on with an interrupted job: which of its steps stay, and which must run again.
//!
//! A step stays if everything that it wrote is there and whole, or if nothing needs that any more. The output of a step depends on
//! nothing but the job. So a step that runs again writes the same as before, and the steps after it stay.

use crate::durable::atomic_file::remove_file;
use crate::durable::directory::JobDirectory;
use crate::durable::journal;
use crate::durable::journal::PublishedFile;
use crate::index::{NodeIndex, TileIndex};
use crate::options::JobOptions;
use crate::partition::point_file::PointFiles;
use crate::partition::result::Partition;
use crate::plan::fingerprint::{Fingerprint, JobChange, JobHeader, PLAN_AGAIN};
use crate::plan::job_plan::Plan;
use crate::plan::lattice_choice::LatticeCoarsening;
use crate::progress::stage::{ProgressOutput, Stage};
use crate::records::{JobStep, Journal, JournalEntry, Store};
use crate::report::job_report::Report;
use crate::run::part_entries::{PartHeader, StepsOfParts, open_store, records_of};
use crate::run::single_process::SingleProcess;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::time::SystemTime;
use sys::{Error, Result, interrupt};
use tiles::options::MaxEdge;

/// An earlier run of a job in the same directory, as its journal tells. The journal is read once.
pub(crate) struct EarlierRun {
    /// `None` if another version of the program wrote the journal, or it is damaged.
    pub(super) header: Option<JobHeader>,
    pub(super) entries: Vec<JournalEntry>,
    /// What the journals of its parts name.
    pub(super) of_parts: StepsOfParts,
    /// The submission that started the job over; 0 if none did.
    pub(crate) submission: u64,
    /// Whether all its results are in place.
    is_complete: bool,
}

impl EarlierRun {
    /// Reads the journal in the job directory, if there is one.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read.
    pub(crate) fn read(directory: &JobDirectory) -> Result<Option<EarlierRun>> {
        let run = journal::read::<JobHeader, JobStep, _>(directory)?;
        let Some((header, entries)) = run else { return Ok(None) };
        let submission = header.as_ref().map_or(0, |header| header.submission);
        let of_parts = match &header {
            Some(JobHeader { id: id @ 1.., .. }) => StepsOfParts::of(directory, *id)?,
            _ => StepsOfParts::default(),
        };
        Ok(Some(EarlierRun { submission, header, entries, of_parts, is_complete: false }))
    }

    fn has_report(&self) -> bool {
        self.entries.iter().any(|entry| entry.step == JobStep::Report)
    }

    /// Puts the results in place if the run had written them all. From then on they are what the output directory holds, whatever
    /// this run does.
    ///
    /// # Errors
    /// As [`JobDirectory::replace_results`].
    pub(crate) fn place_whole_results(&mut self, directory: &JobDirectory) -> Result<()> {
        let is_whole = |file: &PublishedFile| {
            interrupt::check()?;
            Ok(file.is_whole(directory) || file.is_in_place(directory))
        };
        if !self.has_report() || !self.results(directory).try_fold(true, |all, file| Ok(all && is_whole(file)?))? {
            return Ok(());
        }
        self.is_complete = true;
        directory.replace_results(&self.results(directory).map(|file| file.name.clone()).collect())
    }

    fn results<'a>(&'a self, directory: &'a JobDirectory) -> impl Iterator<Item = &'a PublishedFile> {
        let files = self.entries.iter().flat_map(|entry| &entry.files).chain(&self.of_parts.files);
        files.filter(|file| directory.is_result(&file.name))
    }

    /// Returns the fingerprint `now` of the job with the inputs as they were when tasks planned it: machines may see other times and names.
    /// Also says which inputs seem to have been modified since: the points are read, and only the user knows whether they are old.
    ///
    /// # Errors
    /// [`Error::Config`] if the job has changed since.
    pub(crate) fn as_planned(&self, now: Fingerprint) -> Result<(Fingerprint, Option<String>)> {
        let Some(planned) = &self.header else { return Ok((now, None)) };
        if let Some(what) = now.since_planned(&planned.fingerprint) {
            return Err(Error::Config(format!("{what}: changed since the job was planned; {PLAN_AGAIN}")));
        }
        let modified = now.modified_since(planned).map(|files| {
            format!(
                "{files}: modified after the job was planned; if the content has changed, the terrain may show the old one: submit the job \
                 with --restart"
            )
        });
        let other_time = || {
            let files = now.with_other_times(&planned.fingerprint)?;
            Some(format!(
                "{files}: the time of its last change is another one than when the job was planned; `gdt-batch verify OUT --input FILE` \
                 proves whether its points have changed"
            ))
        };
        let warning = modified.or_else(other_time);
        Ok((now.with_names_of(&planned.fingerprint), warning))
    }

    /// Tells whether its journal can be read.
    pub(crate) fn is_readable(&self) -> bool {
        self.header.is_some()
    }

    /// Returns when the job was begun, if it is one of several parts.
    pub(crate) fn begun(&self) -> Option<SystemTime> {
        self.header.as_ref().and_then(|header| header.begun)
    }

    /// Forgets all steps, so that the job starts over.
    pub(crate) fn forget(&mut self) {
        self.header = None;
        self.entries.clear();
        self.of_parts = StepsOfParts::default();
        self.is_complete = false;
    }

    /// Returns how much coarser the lattice became, if the job with this fingerprint has the same mesh.
    pub(crate) fn coarsening(&self, fingerprint: &Fingerprint) -> Option<LatticeCoarsening> {
        let header = self.header.as_ref()?;
        let is_same = !matches!(fingerprint.since(&header.fingerprint), JobChange::Mesh(_));
        is_same.then_some(header.coarsening)
    }

    /// Returns the plan that the run wrote, with the present `options`, if it is whole and the mesh is that of the job with
    /// `header`.
    pub(crate) fn plan(&self, directory: &JobDirectory, header: &JobHeader, options: &JobOptions) -> Option<Plan> {
        let entry = self.entries.iter().find(|entry| matches!(entry.step, JobStep::Partition | JobStep::Plan))?;
        let is_same = self.coarsening(&header.fingerprint) == Some(header.coarsening);
        let plan = is_same && entry.files.iter().all(|file| file.is_whole(directory));
        let mut plan = plan.then(|| Plan::read(&directory.plan()).ok())??;
        plan.options = options.clone();
        plan.rename_inputs(&header.fingerprint.renamed_inputs(&self.header.as_ref()?.fingerprint));
        Some(plan)
    }

    /// Returns the report of the job with `header` if the run was interrupted only while it cleaned up.
    ///
    /// # Errors
    /// [`Error::Io`] if the report cannot be read.
    pub(crate) fn complete_report(&self, directory: &JobDirectory, header: &JobHeader) -> Result<Option<Report>> {
        let is_same = self.header.as_ref().is_some_and(|old| {
            old.coarsening == header.coarsening && header.fingerprint.since(&old.fingerprint) == JobChange::Nothing
        });
        if !is_same || !self.is_complete {
            return Ok(None);
        }
        let path = directory.results().report();
        let text = std::fs::read(&path).map_err(Error::io("read", &path))?;
        Ok(serde_json::from_slice(&text).ok())
    }
}

/// Puts the results of a job in place that has just written its report.
///
/// # Errors
/// As [`JobDirectory::replace_results`]; [`Error::Io`] if the journal cannot be read, or does not name the report: then it does not
/// name all results either.
pub(crate) fn place_results_of_finished_job(directory: &JobDirectory) -> Result<()> {
    let (mut names, mut has_report) = (HashSet::new(), false);
    let mut visit = |step, files: Vec<PublishedFile>| {
        has_report |= step == JobStep::Report;
        names.extend(files.into_iter().map(|file| file.name).filter(|name| directory.is_result(name)));
    };
    journal::visit_files::<JobHeader, JobStep>(directory, &mut visit)?;
    // There are no folders but those of this job: it has removed all others.
    for part in directory.folders_of_parts()? {
        journal::visit_files::<PartHeader, JobStep>(&part, &mut visit)?;
    }
    if !has_report {
        let damaged = io::Error::new(ErrorKind::InvalidData, "it has changed since the job wrote it");
        return Err(Error::io("read", directory.journal())(damaged));
    }
    directory.replace_results(&names)
}

/// Where a run begins.
pub(crate) struct RunStart<'a> {
    /// What the finished steps stored.
    pub(crate) store: Store,
    /// Which steps are finished.
    pub(crate) journal: Journal<'a>,
    /// What reading the points found, if that is finished.
    pub(crate) partition: Option<Partition>,
    /// Tells the folders of this job's parts from those of others.
    pub(crate) job_id: u64,
    /// The number of finished steps of parts.
    pub(crate) resumed: u64,
}

/// Begins a run of the job with `header` in its locked directory: takes over what is the same and whole from the earlier run, and
/// removes everything else.
///
/// # Errors
/// [`Error::Io`] on the job directory.
pub(crate) fn start<'a>(
    directory: &'a JobDirectory,
    header: &JobHeader,
    earlier: Option<EarlierRun>,
    max_edge: MaxEdge,
    progress: ProgressOutput,
) -> Result<RunStart<'a>> {
    let kept = earlier.map(|earlier| review(directory, header, earlier, max_edge, progress)).transpose()?;
    let KeptSteps { entries, mut files, partition, names } = kept.flatten().unwrap_or_default();
    if !entries.is_empty() {
        progress.note(&format!("going on with an interrupted run: {} steps are done", entries.len()));
    }
    let records = records_of(&entries);
    let header = JobHeader { fingerprint: names.unwrap_or(header.fingerprint.clone()), ..*header };
    // What does not stay is removed first: it may fill the disk, and the new journal needs room. Until the new journal is there, the
    // old one names steps whose output is gone; after a kill the next run notices. If no step stays, the old journal is removed too.
    if entries.is_empty() {
        remove_file(&directory.journal())?;
    }
    directory.clear_parts()?;
    // A task that is killed finds its note again.
    files.extend(SingleProcess::notes(directory)?);
    directory.clear(&files)?;
    let journal = Journal::begin(directory, &header, entries)?;
    Ok(RunStart { store: open_store(directory, &records)?, journal, partition, job_id: 0, resumed: 0 })
}

/// The steps that stay, and what they left.
#[derive(Default)]
pub(super) struct KeptSteps {
    pub(super) entries: Vec<JournalEntry>,
    /// The files that later steps need, as the journal names them.
    pub(super) files: HashSet<PathBuf>,
    pub(super) partition: Option<Partition>,
    /// The fingerprint of the job with the names of the inputs that these steps know.
    names: Option<Fingerprint>,
}

/// Returns the steps of an earlier run that stay, or `None` if the job starts over.
fn review(
    directory: &JobDirectory,
    header: &JobHeader,
    earlier: EarlierRun,
    max_edge: MaxEdge,
    progress: ProgressOutput,
) -> Result<Option<KeptSteps>> {
    let EarlierRun { header: old, mut entries, .. } = earlier;
    let Some(old) = old else { return Ok(None) };
    if entries.is_empty() || old.coarsening != header.coarsening {
        return Ok(None);
    }
    let change = header.fingerprint.since(&old.fingerprint);
    match &change {
        JobChange::Nothing => {}
        JobChange::Raster(what) => {
            progress.note(&format!("changed since the interrupted run: {what}; the tiles stay"));
            entries.retain(|entry| !matches!(entry.step, JobStep::Raster | JobStep::Publish | JobStep::Report));
        }
        JobChange::Style(what) => {
            progress.note(&format!("changed since the interrupted run: {what}; the tiles are written again"));
            let is_mesh = |step| matches!(step, JobStep::Partition | JobStep::Leaf(_) | JobStep::Merge(_));
            entries.retain(|entry| is_mesh(entry.step));
        }
        JobChange::Mesh(what) => {
            progress.note(&format!("changed since the interrupted run: {what}; starting over"));
            return Ok(None);
        }
    }
    if header.fingerprint.memory != old.fingerprint.memory {
        // Coarser tiles that do not fit the memory are left out.
        entries.retain(|entry| !matches!(entry.step, JobStep::Level(_) | JobStep::Publish | JobStep::Report));
    }
    let stage = progress.stage("check", entries.len() as u64, "steps");
    let counts_leaves = max_edge == MaxEdge::Auto;
    let mut kept = ResumeReview::of(directory, entries, counts_leaves, &stage)?.map(ResumeReview::into_kept);
    stage.finish();
    if let Some(kept) = kept.as_mut() {
        let renamed = header.fingerprint.renamed_inputs(&old.fingerprint);
        kept.partition.iter_mut().for_each(|partition| partition.rename_inputs(&renamed));
        kept.names = Some(header.fingerprint.with_names_of(&old.fingerprint));
    }
    if kept.is_none() {
        let why = match change {
            JobChange::Style(_) => {
                "the interrupted run has freed what that takes ([limits] keep_steps), or it is damaged"
            }
            _ => "what the interrupted run left is damaged",
        };
        progress.note(&format!("{why}; starting over"));
    }
    Ok(kept)
}

/// A look at what an interrupted run left.
pub(super) struct ResumeReview {
    directory: JobDirectory,
    partition: Partition,
    entries: HashMap<JobStep, JournalEntry>,
    /// The steps whose records and files are all there and whole.
    whole: HashSet<JobStep>,
    /// Whether all tiles are written and whole.
    all_written: bool,
    /// Whether the sites of all leaves are counted before the next tile is written.
    counts_leaves: bool,
}

impl ResumeReview {
    /// Returns `None` if the points are gone, though a leaf needs them, or if the partition is damaged.
    pub(super) fn of(
        directory: &JobDirectory,
        entries: Vec<JournalEntry>,
        counts_leaves: bool,
        stage: &Stage,
    ) -> Result<Option<ResumeReview>> {
        let records = entries.iter().flat_map(|entry| &entry.records);
        let Ok(store) = Store::open(directory.store(), records) else { return Ok(None) };
        let is_whole = |entry: &JournalEntry| {
            entry.records.iter().all(|record| store.is_whole(record))
                && entry.files.iter().all(|file| file.is_whole(directory))
        };
        let check = |entry: &JournalEntry| {
            interrupt::check()?;
            stage.advance(1);
            Ok(is_whole(entry).then_some(entry.step))
        };
        let whole =
            entries.par_iter().filter_map(|entry| check(entry).transpose()).collect::<Result<HashSet<JobStep>>>()?;
        if !whole.contains(&JobStep::Partition) {
            return Ok(None);
        }
        let partition = Partition::load(&store)?;
        let entries = entries.into_iter().map(|entry| (entry.step, entry)).collect();
        let directory = directory.clone();
        let mut review = ResumeReview { directory, partition, entries, whole, all_written: false, counts_leaves };
        review.all_written = review.partition.tree.tiles().all(|tile| review.whole.contains(&JobStep::WriteTile(tile)));
        Ok(review.has_needed_points().then_some(review))
    }

    /// Tells whether `step` is finished, and whole if it is `needed`.
    fn stays(&self, step: JobStep, needed: bool) -> bool {
        if needed { self.whole.contains(&step) } else { self.entries.contains_key(&step) }
    }

    fn merge_stays(&self, node: NodeIndex) -> bool {
        self.stays(JobStep::Merge(node), !self.all_written)
    }

    fn border_stays(&self, tile: TileIndex) -> bool {
        self.stays(JobStep::BorderNormals(tile), !self.all_written)
    }

    fn leaf_stays(&self, tile: TileIndex) -> bool {
        let tree = &self.partition.tree;
        let mut above = tree.merges_above(tree.leaf(tile));
        let is_used_up = self.whole.contains(&JobStep::WriteTile(tile))
            && (self.all_written || !self.counts_leaves)
            && self.border_stays(tile)
            && above.next().is_none_or(|node| self.merge_stays(node));
        self.stays(JobStep::Leaf(tile), !is_used_up)
    }

    /// Tells whether the point files still hold the points of all leaves that are to be done.
    fn has_needed_points(&self) -> bool {
        let mut missing = self.partition.tree.tiles().filter(|&tile| !self.leaf_stays(tile)).peekable();
        if missing.peek().is_none() {
            return true;
        }
        let files = self.directory.point_files();
        let Ok(points) = files.and_then(|files| PointFiles::open(&files)) else { return false };
        let is_whole =
            |tile: TileIndex| self.partition.blocks[tile.get()].par_iter().all(|&block| points.is_whole(block));
        missing.par_bridge().all(is_whole)
    }

    fn step_stays(&self, step: JobStep) -> bool {
        match step {
            JobStep::Leaf(tile) => self.leaf_stays(tile),
            JobStep::Merge(node) => self.merge_stays(node),
            JobStep::BorderNormals(tile) => self.border_stays(tile),
            JobStep::Partition | JobStep::Curve | JobStep::WriteTile(_) | JobStep::Level(_) => {
                self.whole.contains(&step)
            }
            JobStep::Raster | JobStep::Publish => self.all_written && self.whole.contains(&step),
            // A run with all its results whole does not come here. Any other writes a new report, and the journal must name only one.
            JobStep::Report => false,
            // A job of one part has none of these. What a part has read stays anyway, and one that has the others is not looked at.
            JobStep::Plan
            | JobStep::Read(_)
            | JobStep::MeshPart
            | JobStep::Join
            | JobStep::WriteWaiting
            | JobStep::Levels => false,
        }
    }

    pub(super) fn into_kept(self) -> KeptSteps {
        let stays: HashSet<JobStep> = self.entries.keys().copied().filter(|&step| self.step_stays(step)).collect();
        let mut files = HashSet::new();
        if !self.partition.tree.tiles().all(|tile| stays.contains(&JobStep::Leaf(tile))) {
            files.insert(self.directory.name(&self.directory.points()));
        }
        let mut entries: Vec<JournalEntry> =
            self.entries.into_values().filter(|entry| stays.contains(&entry.step)).collect();
        files.extend(entries.iter().flat_map(|entry| &entry.files).map(|file| file.name.clone()));
        files.extend(self.directory.store().iter().map(|path| self.directory.name(path)));
        // The journal must not depend on the order of a hash map.
        entries.sort_by_key(|entry| entry.step);
        KeptSteps { entries, files, partition: Some(self.partition), names: None }
    }
}
