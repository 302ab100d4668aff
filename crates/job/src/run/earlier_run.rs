//! Going on with an interrupted job: which of its phases stay, and which must run again.
//!
//! A phase that is in a journal stays, if all that it left is whole. Its output depends on nothing but the job. So a phase that runs again
//! writes the same as before, and the phases after it stay.

use crate::durable::atomic_file::remove_file;
use crate::durable::directory::JobDirectory;
use crate::durable::journal;
use crate::durable::journal::{PublishedFile, records_of};
use crate::options::JobOptions;
use crate::plan::fingerprint::{Fingerprint, JobChange, JobHeader, PLAN_AGAIN, first_few};
use crate::plan::job_plan::Plan;
use crate::plan::lattice_choice::LatticeCoarsening;
use crate::progress::number_text::counted;
use crate::progress::stage::{ProgressOutput, Stage};
use crate::records::{JobStep, Journal, JournalEntry};
use crate::report::job_report::Report;
use crate::run::done::Done;
use crate::run::part_entries::{PartHeader, PartJournals, open_store};
use crate::run::phases::meshed_part::MeshedPart;
use crate::run::single_process;
use crate::run::update::changes::place_changes;
use crate::run::update::first_plan_file::first_plan;
use crate::run::update::mending::Mended;
use rayon::prelude::*;
use std::collections::HashSet;
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::time::SystemTime;
use sys::disk::exists;
use sys::{Error, Result, interrupt};
use tiles::checksums::{parse_list, read_file};
use tiles::file_names::OutputFiles;

/// An earlier run of a job in the same directory, as its journals tell.
pub(crate) struct EarlierRun {
    /// `None` if another version of the program wrote the journal, or it is damaged.
    pub(super) header: Option<JobHeader>,
    entries: Vec<JournalEntry>,
    parts: PartJournals,
    /// The submission that started the job over; 0 if none did.
    pub(crate) submission: u64,
    /// Whether all its results are in place.
    is_complete: bool,
    /// Whether it had `--update`, and wrote all its results.
    is_finished: bool,
    /// What became of its results since, if it is finished.
    mended: Mended,
    /// Whether phases of parts were dropped, so that their journals must be written again.
    has_dropped: bool,
}

impl EarlierRun {
    /// Reads the journals in the job directory, if there are some.
    ///
    /// # Errors
    /// [`Error::Io`] if one cannot be read.
    pub(crate) fn read(directory: &JobDirectory) -> Result<Option<EarlierRun>> {
        let run = journal::read::<JobHeader, JobStep, _>(directory)?;
        let Some((header, entries)) = run else { return Ok(None) };
        let submission = header.as_ref().map_or(0, |header| header.submission);
        let parts = match &header {
            Some(header) => PartJournals::of(directory, header.id)?,
            None => PartJournals::default(),
        };
        let (is_finished, mended) = (false, Mended::default());
        let run = EarlierRun {
            submission,
            header,
            entries,
            parts,
            is_complete: false,
            is_finished,
            mended,
            has_dropped: false,
        };
        Ok(Some(run))
    }

    /// Puts the results in place if the run had written them all. From then on they are what the output directory holds, whatever
    /// this run does. Those of an update are mended before that.
    ///
    /// # Errors
    /// As [`JobDirectory::replace_results`].
    pub(crate) fn place_whole_results(&mut self, directory: &JobDirectory, progress: ProgressOutput) -> Result<()> {
        let has_report = self.entries.iter().any(|entry| entry.step == JobStep::Report);
        let updates = self.header.as_ref().is_some_and(|header| header.fingerprint.updates());
        if has_report && updates {
            self.is_finished = true;
            self.mended = Mended::of(directory, self.results(directory).cloned().collect())?;
            self.mended.tell(progress);
        }
        let is_whole = |file: &PublishedFile| {
            interrupt::check()?;
            Ok(file.is_whole(directory) || file.is_in_place(directory))
        };
        let names = self.results(directory).map(|file| file.name.clone()).collect();
        // The report takes its place last. After that the journals go, but not those of an update: if they name fewer results than the list,
        // they are damaged, and what they do not name must stay.
        let report = directory.name(&directory.results().report());
        let is_last = |file: &PublishedFile| !updates && file.name == report && file.is_in_place(directory);
        let are_all = has_report && (self.results(directory).any(is_last) || are_all_results(directory, &names)?);
        if !are_all || !self.results(directory).try_fold(true, |all, file| Ok(all && is_whole(file)?))? {
            return Ok(());
        }
        self.is_complete = true;
        directory.replace_results(&names, updates)?;
        place_changes(directory)
    }

    /// Returns the plan of the first run, if the job with `header` is an update of this one: both have `--update`, and their meshes depend on the
    /// same options.
    pub(crate) fn first_plan(
        &self,
        directory: &JobDirectory,
        header: &JobHeader,
        progress: ProgressOutput,
    ) -> Option<Plan> {
        let old = self.header.as_ref().filter(|old| old.coarsening == header.coarsening)?;
        let is_update = header.fingerprint.updates() && header.fingerprint.may_update(&old.fingerprint);
        let first = is_update.then(|| first_plan(directory)).flatten();
        // A job of a single part, whose nodes above it have a journal too, is computed as a whole in any case.
        if is_update && self.is_finished && first.is_none() && self.parts.0.len() > 2 {
            let path = directory.first_plan();
            progress.note(&format!("{} is missing or damaged: everything is computed again", path.display()));
        }
        first
    }

    /// Returns what became of its results since, if it had `--update` and wrote them all.
    pub(crate) fn mended(&self) -> &Mended {
        &self.mended
    }

    fn results<'a>(&'a self, directory: &'a JobDirectory) -> impl Iterator<Item = &'a PublishedFile> {
        let files = self.entries.iter().flat_map(|entry| &entry.files).chain(self.parts.files());
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
                "{files}: modified after the job was planned, so the terrain may show old content; fix: submit the job with --restart"
            )
        });
        let other_time = || {
            let files = now.with_other_times(&planned.fingerprint)?;
            Some(format!(
                "{files}: its modification time differs from that when the job was planned; fix: `gdt-batch verify OUT --input FILE` \
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

    /// Returns when the job was begun.
    pub(crate) fn begun(&self) -> Option<SystemTime> {
        self.header.as_ref().and_then(|header| header.begun)
    }

    /// Forgets all phases, so that the job starts over.
    pub(crate) fn forget(&mut self) {
        self.header = None;
        self.entries.clear();
        self.parts.0.clear();
        self.is_complete = false;
        self.is_finished = false;
    }

    /// Returns how much coarser the lattice became, if the job with this fingerprint has the same mesh.
    pub(crate) fn coarsening(&self, fingerprint: &Fingerprint) -> Option<LatticeCoarsening> {
        let header = self.header.as_ref()?;
        let is_update = fingerprint.updates() && fingerprint.may_update(&header.fingerprint);
        let is_same = is_update || !matches!(fingerprint.since(&header.fingerprint), JobChange::Mesh(_));
        is_same.then_some(header.coarsening)
    }

    /// Returns the plan that the run wrote, with the present `options`, if it is whole and that of the job with `header`. Another style may
    /// bend the scene otherwise.
    pub(crate) fn plan(&self, directory: &JobDirectory, header: &JobHeader, options: &JobOptions) -> Option<Plan> {
        let (old, entry) = (self.header.as_ref()?, self.entries.iter().find(|entry| entry.step == JobStep::Plan)?);
        let change = header.fingerprint.since(&old.fingerprint);
        let is_as_it_was = change == JobChange::Nothing && self.is_complete;
        if self.is_finished && header.fingerprint.updates() && !is_as_it_was {
            // It is updated, which takes a plan of its own.
            return None;
        }
        let is_same =
            old.coarsening == header.coarsening && matches!(change, JobChange::Nothing | JobChange::FromTiles { .. });
        let plan = is_same && entry.files.iter().all(|file| file.is_whole(directory));
        let mut plan = plan.then(|| Plan::read(&directory.plan()).ok())??;
        plan.options = options.clone();
        plan.rename_inputs(&header.fingerprint.renamed_inputs(&old.fingerprint));
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

    /// Drops what an update to the job with `header` does again in any case. The key of each phase tells the rest.
    fn kept_for_update(mut self, header: &JobHeader, progress: ProgressOutput) -> EarlierRun {
        let old = self.header.as_ref().map(|old| &old.fingerprint);
        let inputs = old.map(|old| header.fingerprint.inputs_since(old)).unwrap_or_default();
        if !inputs.is_empty() {
            progress.note(&format!("changed since the last run: {}", first_few(inputs)));
        }
        if let Some(what) = old.and_then(|old| header.fingerprint.style_since(old)) {
            progress.note(&format!("changed since the last run: {what}; all tiles are written again"));
            self.parts.drop_steps(&[JobStep::Tiles, JobStep::LevelTiles, JobStep::Levels, JobStep::Join]);
            self.has_dropped = true;
        }
        self.entries.clear();
        self
    }

    /// Drops what does not hold for the job with `header`, whose plan stays if `has_plan`. Returns `None` if the job starts over.
    fn kept_for(self, header: &JobHeader, has_plan: bool, progress: ProgressOutput) -> Option<EarlierRun> {
        let mut kept = self;
        let old = kept.header.as_ref().filter(|old| old.coarsening == header.coarsening)?;
        let change = header.fingerprint.since(&old.fingerprint);
        if header.fingerprint.updates() && !has_plan {
            if let (true, JobChange::Mesh(what)) = (old.fingerprint.updates(), &change) {
                progress.note(&format!("changed since the last run: {what}; everything is computed again"));
            }
            return None;
        }
        if kept.is_complete && !matches!(change, JobChange::Style(_)) {
            // Its results have left their waiting places. Another style needs none of them.
            return None;
        }
        let had_plan = kept.entries.iter().any(|entry| entry.step == JobStep::Plan);
        if had_plan && !has_plan && matches!(change, JobChange::Nothing | JobChange::FromTiles { .. }) {
            // Another plan may bend the scene otherwise, if another machine makes it.
            progress.note("what the interrupted run left is damaged; starting over");
            return None;
        }
        let mut of_job = vec![
            JobStep::Plan,
            JobStep::Raster,
            JobStep::MapTiles,
            JobStep::Contours,
            JobStep::Terrain,
            JobStep::Exports,
            JobStep::Classified,
            JobStep::Publish,
        ];
        let mut of_parts = Vec::new();
        match &change {
            JobChange::Nothing => {}
            JobChange::FromTiles { what, steps } => {
                progress.note(&format!("changed since the interrupted run: {what}; the tiles stay"));
                of_job.retain(|step| *step != JobStep::Publish && !steps.contains(step));
            }
            JobChange::Style(what) => {
                let meshed = kept.parts.meshed();
                if !meshed.iter().all(|part| part.is_kept) {
                    progress.note(&format!(
                        "changed since the interrupted run: {what}; the mesh is already deleted ([limits] keep_steps); starting over"
                    ));
                    return None;
                }
                progress.note(&format!("changed since the interrupted run: {what}; the tiles are written again"));
                of_job = Vec::new();
                of_parts = vec![JobStep::Tiles, JobStep::Levels, JobStep::Join];
            }
            JobChange::Mesh(what) => {
                progress.note(&format!("changed since the interrupted run: {what}; starting over"));
                return None;
            }
        }
        if header.fingerprint.memory != old.fingerprint.memory {
            // Coarser tiles that do not fit the memory are left out.
            of_job.retain(|step| *step != JobStep::Publish);
            of_parts.push(JobStep::Levels);
        }
        // Only the report that this run writes may be named.
        kept.entries.retain(|entry| has_plan && of_job.contains(&entry.step));
        kept.has_dropped = !of_parts.is_empty();
        kept.parts.drop_steps(&of_parts);
        Some(kept)
    }
}

impl PartJournals {
    /// Returns what is known of the parts that are meshed.
    fn meshed(&self) -> Vec<MeshedPart> {
        let entries = self.0.iter().flat_map(|(_, _, entries)| entries).filter(|entry| entry.step == JobStep::Mesh);
        entries.filter_map(|entry| entry.figures::<Done<MeshedPart>>().ok()).map(|done| done.figures).collect()
    }

    fn drop_steps(&mut self, steps: &[JobStep]) {
        self.0.iter_mut().for_each(|(_, _, entries)| entries.retain(|entry| !steps.contains(&entry.step)));
    }

    /// Tells whether all records and files hold what was written.
    fn are_whole(&self, stage: &Stage) -> Result<bool> {
        self.0.iter().try_fold(true, |all, (directory, _, entries)| Ok(all && is_whole(directory, entries, stage)?))
    }

    /// Drops all phases of the parts whose records or files do not hold what was written. Returns how many parts that are.
    fn drop_damaged(&mut self, stage: &Stage) -> Result<u64> {
        let mut damaged = 0;
        for (directory, _, entries) in &mut self.0 {
            if !is_whole(directory, entries, stage)? {
                entries.clear();
                damaged += 1;
            }
        }
        Ok(damaged)
    }
}

/// Tells whether all records and files of the part with this `directory` hold what was written.
fn is_whole(directory: &JobDirectory, entries: &[JournalEntry], stage: &Stage) -> Result<bool> {
    let records: Vec<_> = records_of(entries).into_values().collect();
    let store = open_store(directory, records.iter().copied())?;
    let is_whole = |record| {
        interrupt::check()?;
        store.is_whole(record)
    };
    let records = records.par_iter().map(is_whole).try_reduce(|| true, |a, b| Ok(a && b))?;
    let files = entries.par_iter().flat_map(|entry| &entry.files).map(|file| file.try_is_whole(directory));
    let files = files.try_reduce(|| true, |a, b| Ok(a && b))?;
    stage.advance(entries.len() as u64);
    Ok(records && files)
}

/// Tells whether `names` are those of all results of the job, as its list has them. A journal that is damaged names fewer.
fn are_all_results(directory: &JobDirectory, names: &HashSet<PathBuf>) -> Result<bool> {
    let [waits, place] = [directory.output(), directory.results()].map(OutputFiles::checksums);
    let list = if exists(&waits).map_err(Error::io("read", &waits))? { waits } else { place };
    let text = match read_file(&list) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(false),
        text => text.map_err(Error::io("read", &list))?,
    };
    let own = [directory.results().checksums(), directory.results().report()].map(|path| directory.name(&path));
    let listed = parse_list(&text).into_iter().flatten().map(|(name, _)| PathBuf::from(name));
    Ok(listed.chain(own).collect::<HashSet<_>>() == *names)
}

/// Puts the results of a job in place that has just written its report. If it `updates`, they stay where they wait, too.
///
/// # Errors
/// As [`JobDirectory::replace_results`]; [`Error::Io`] if the journal cannot be read, or does not name the report: then it does not
/// name all results either.
pub(crate) fn place_results_of_finished_job(directory: &JobDirectory, updates: bool) -> Result<()> {
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
    if !has_report || !are_all_results(directory, &names)? {
        let damaged = io::Error::new(ErrorKind::InvalidData, "it has changed since the job wrote it");
        return Err(Error::io("read", directory.journal())(damaged));
    }
    directory.replace_results(&names, updates)?;
    place_changes(directory)
}

/// Where a run begins.
pub(crate) struct RunStart<'a> {
    /// Which phases of the whole job are complete.
    pub(crate) journal: Journal<'a>,
    /// Tells the folders of this job's parts from those of others.
    pub(crate) job_id: u64,
    /// The number of phases that are complete.
    pub(crate) resumed: u64,
}

/// Begins a run of the job with `header` in its locked directory: takes over what is the same from the earlier run if it is whole, and
/// otherwise removes everything. `has_plan` tells whether its plan is that of this run, and `is_update` whether what has not changed since
/// stays as it is. What tasks have done is not compared with its hashes
/// (`is_by_tasks`), because it was on the disk before others counted on it.
///
/// # Errors
/// [`Error::Io`] on the job directory.
pub(crate) fn start<'a>(
    directory: &'a JobDirectory,
    header: &JobHeader,
    earlier: Option<EarlierRun>,
    has_plan: bool,
    is_update: bool,
    is_by_tasks: bool,
    progress: ProgressOutput,
) -> Result<RunStart<'a>> {
    let progress_of_tasks = if is_by_tasks { ProgressOutput::Quiet } else { progress };
    let mut kept = earlier.and_then(|earlier| match is_update {
        true => Some(earlier.kept_for_update(header, progress)),
        false => earlier.kept_for(header, has_plan, progress_of_tasks),
    });
    if let (Some(earlier), true) = (&mut kept, is_update) {
        let stage = progress.stage("check", earlier.parts.len(), "phases");
        let damaged = earlier.parts.drop_damaged(&stage)?;
        stage.finish();
        if damaged > 0 {
            progress.note(&format!(
                "what the last run left of {} is damaged, and is computed again",
                counted(damaged, "part")
            ));
            earlier.has_dropped = true;
        }
    } else if let (Some(earlier), false) = (&kept, is_by_tasks) {
        let stage = progress.stage("check", earlier.parts.len(), "phases");
        let mut files = earlier.entries.iter().flat_map(|entry| &entry.files);
        let of_job = files.try_fold(true, |all, file| Ok::<_, Error>(all && file.try_is_whole(directory)?))?;
        let is_whole = of_job && earlier.parts.are_whole(&stage)?;
        stage.finish();
        if !is_whole {
            progress.note("what the interrupted run left is damaged; starting over");
            kept = None;
        }
    }
    let Some(EarlierRun { header: Some(old), entries, parts, has_dropped, .. }) = kept else {
        remove_file(&directory.journal())?;
        directory.clear(&single_process::notes(directory)?)?;
        let begun = header.begun.or(Some(SystemTime::now()));
        let header = JobHeader { id: new_id(), begun, ..header.clone() };
        let journal = Journal::begin(directory, &header, Vec::new())?;
        return Ok(RunStart { journal, job_id: header.id, resumed: 0 });
    };
    let resumed = entries.len() as u64 + parts.len();
    if is_update {
        directory.keep_results(&parts.files().map(|file| file.name.clone()).collect())?;
    } else if resumed > 0 {
        progress_of_tasks.note(&format!("continuing an interrupted run; phases complete: {resumed}"));
    }
    // Only a plan that stays calls the inputs what they were called.
    let fingerprint = match has_plan {
        true => header.fingerprint.with_names_of(&old.fingerprint),
        false => header.fingerprint.clone(),
    };
    for (folder, header, entries) in parts.0.into_iter().filter(|_| has_dropped) {
        drop(Journal::begin(&folder, &header, entries)?);
    }
    let header = JobHeader { fingerprint, id: old.id, begun: old.begun, ..*header };
    Ok(RunStart { journal: Journal::begin(directory, &header, entries)?, job_id: header.id, resumed })
}

/// Returns a number that no other run has.
fn new_id() -> u64 {
    let time = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let nanoseconds = time.map_or(0, |time| time.as_nanos() as u64);
    (nanoseconds ^ u64::from(std::process::id()) << 40).max(1)
}
