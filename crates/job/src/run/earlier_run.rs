//! Going on with an interrupted job: which of its phases stay, and which must run again.
//!
//! A phase that is in a journal stays, if all that it left is whole. Its output depends on nothing but the job. So a phase that runs again
//! writes the same as before, and the phases after it stay.

use crate::durable::atomic_file::remove_file;
use crate::durable::directory::JobDirectory;
use crate::durable::journal;
use crate::durable::journal::PublishedFile;
use crate::durable::listing::read_if_there;
use crate::options::{JobOptions, RunOptions};
use crate::plan::fingerprint::{Fingerprint, JobChange, JobHeader, PLAN_AGAIN, first_few};
use crate::plan::first_plan_file::first_plan;
use crate::plan::job_plan::Plan;
use crate::plan::lattice_choice::LatticeCoarsening;
use crate::progress::number_text::counted;
use crate::progress::stage::ProgressOutput;
use crate::records::{JobStep, Journal, JournalEntry};
use crate::report::job_report::Report;
use crate::run::meshed_part::MeshedPart;
use crate::run::part_entries::PartEntries;
use crate::run::single_process;
use crate::run::update::changes::place_changes;
use crate::run::update::mending::Mended;
use std::collections::HashSet;
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::time::SystemTime;
use sys::{Error, Result, interrupt};
use tiles::checksums::parse_list;
use tiles::file_names::OutputFiles;

/// An earlier run of a job in the same directory, as its journals tell.
pub(crate) struct EarlierRun {
    pub(super) header: JobHeader,
    entries: Vec<JournalEntry>,
    parts: Vec<PartEntries>,
    /// Whether all its results are in place.
    is_complete: bool,
    /// If it had `--update` and wrote all its results, what became of them since.
    pub(crate) mended: Option<Mended>,
    /// Whether phases of parts were dropped, so that their journals must be written again.
    has_dropped: bool,
}

/// Whose the plan of a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PlanOrigin {
    /// The earlier run wrote it.
    Kept,
    /// The job is an update of the earlier run, whose parts it keeps.
    Update,
    /// The job is planned anew.
    New,
}

/// The steps of parts that depend on how tiles look.
const STYLED: [JobStep; 4] = [JobStep::Tiles, JobStep::LevelTiles, JobStep::Levels, JobStep::Join];

impl EarlierRun {
    /// Reads what an earlier run left in the job directory, unless the job is to start over. If it left all its results, they take their places
    /// in any case: it may have been cut off among them.
    ///
    /// # Errors
    /// [`Error::Io`] if a journal cannot be read, and as [`JobDirectory::replace_results`].
    pub(crate) fn read(directory: &JobDirectory, run: RunOptions) -> Result<Option<EarlierRun>> {
        let Some((header, entries, _)) = journal::read::<JobHeader, JournalEntry>(directory)? else { return Ok(None) };
        let Some(header) = header else {
            run.progress.note("the journal of the earlier run is damaged or of another version; starting over");
            return Ok(None);
        };
        let parts = PartEntries::of_all(directory, header.id)?;
        let mut earlier = EarlierRun { header, entries, parts, is_complete: false, mended: None, has_dropped: false };
        earlier.place_whole_results(directory, run.progress)?;
        let starts_over = run.restart || earlier.header.submission < run.submission;
        Ok((!starts_over).then_some(earlier))
    }

    /// Puts the results in place if the run had written them all. From then on they are what the output directory holds, whatever
    /// this run does. Those of an update are mended before that.
    fn place_whole_results(&mut self, directory: &JobDirectory, progress: ProgressOutput) -> Result<()> {
        let has_report = self.entries.iter().any(|entry| entry.step == JobStep::Report);
        let updates = self.header.fingerprint.updates();
        if has_report && updates {
            let mended = Mended::of(directory, self.results(directory).cloned().collect())?;
            mended.tell(progress);
            self.mended = Some(mended);
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
        let is_update = self.header.coarsening == header.coarsening && self.is_updated_by(&header.fingerprint);
        let first = is_update.then(|| first_plan(directory)).flatten();
        // A job of a single part, whose nodes above it have a journal too, is computed as a whole in any case.
        if is_update && self.mended.is_some() && first.is_none() && self.parts.len() > 2 {
            let path = directory.first_plan();
            progress.note(&format!("{} is missing or damaged: everything is computed again", path.display()));
        }
        first
    }

    fn results<'a>(&'a self, directory: &'a JobDirectory) -> impl Iterator<Item = &'a PublishedFile> {
        let of_parts = self.parts.iter().flat_map(|part| part.files(None));
        let files = self.entries.iter().flat_map(|entry| &entry.files).chain(of_parts);
        files.filter(|file| directory.is_result(&file.name))
    }

    /// Returns the fingerprint `now` of the job with the inputs as they were when tasks planned it: machines may see other times and names.
    /// Also says which inputs seem to have been modified since: the points are read, and only the user knows whether they are old.
    ///
    /// # Errors
    /// [`Error::Config`] if the job has changed since.
    pub(crate) fn as_planned(&self, now: Fingerprint) -> Result<(Fingerprint, Option<String>)> {
        let planned = &self.header;
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

    /// Returns how much coarser the lattice became, if the job with this fingerprint has the same mesh.
    pub(crate) fn coarsening(&self, fingerprint: &Fingerprint) -> Option<LatticeCoarsening> {
        let is_changed = || matches!(fingerprint.since(&self.header.fingerprint), JobChange::Mesh(_));
        (self.is_updated_by(fingerprint) || !is_changed()).then_some(self.header.coarsening)
    }

    fn is_updated_by(&self, fingerprint: &Fingerprint) -> bool {
        fingerprint.updates() && fingerprint.may_update(&self.header.fingerprint)
    }

    /// Returns what has changed in the job with `header`; `None` if it has another lattice.
    fn change(&self, header: &JobHeader) -> Option<JobChange> {
        (self.header.coarsening == header.coarsening).then(|| header.fingerprint.since(&self.header.fingerprint))
    }

    /// Returns the plan that the run wrote, with the present `options`, if it is whole and that of the job with `header`. Another style may
    /// bend the scene otherwise.
    pub(crate) fn plan(&self, directory: &JobDirectory, header: &JobHeader, options: &JobOptions) -> Option<Plan> {
        let entry = self.entries.iter().find(|entry| entry.step == JobStep::Plan)?;
        let is_same = match self.change(header)? {
            // What is updated takes a plan of its own.
            JobChange::Nothing => self.mended.is_none() || !header.fingerprint.updates() || self.is_complete,
            JobChange::FromTiles { .. } => self.mended.is_none() || !header.fingerprint.updates(),
            JobChange::Style(_) | JobChange::Mesh(_) => false,
        };
        if !is_same || !entry.files.iter().all(|file| file.is_whole(directory)) {
            return None;
        }
        let mut plan = Plan::read(&directory.plan()).ok()?;
        plan.options = options.clone();
        plan.rename_inputs(&header.fingerprint.renamed_inputs(&self.header.fingerprint));
        Some(plan)
    }

    /// Returns the report of the job with `header` if the run was interrupted only while it cleaned up.
    ///
    /// # Errors
    /// [`Error::Io`] if the report cannot be read.
    pub(crate) fn complete_report(&self, directory: &JobDirectory, header: &JobHeader) -> Result<Option<Report>> {
        if self.change(header) != Some(JobChange::Nothing) || !self.is_complete {
            return Ok(None);
        }
        let path = directory.results().report();
        let text = std::fs::read(&path).map_err(Error::io("read", &path))?;
        Ok(serde_json::from_slice(&text).ok())
    }

    /// Drops what does not hold for the job with `header`. Returns `None` if the job starts over.
    fn kept_for(mut self, header: &JobHeader, origin: PlanOrigin, progress: ProgressOutput) -> Option<EarlierRun> {
        let outdated = match origin {
            PlanOrigin::Update => self.outdated_by_update(header, progress),
            PlanOrigin::Kept | PlanOrigin::New => self.outdated_for(header, origin, progress)?,
        };
        // Only the report that this run writes may be named.
        self.entries.retain(|entry| origin == PlanOrigin::Kept && !outdated.contains(&entry.step));
        self.parts.iter_mut().for_each(|part| self.has_dropped |= part.drop_steps(&outdated));
        Some(self)
    }

    /// Returns which steps an update to the job with `header` does again in any case. The key of each phase tells the rest.
    fn outdated_by_update(&self, header: &JobHeader, progress: ProgressOutput) -> Vec<JobStep> {
        let inputs = header.fingerprint.inputs_since(&self.header.fingerprint);
        if !inputs.is_empty() {
            progress.note(&format!("changed since the last run: {}", first_few(inputs)));
        }
        let Some(what) = header.fingerprint.style_since(&self.header.fingerprint) else { return Vec::new() };
        progress.note(&format!("changed since the last run: {what}; all tiles are written again"));
        STYLED.to_vec()
    }

    /// Returns which steps do not hold for the job with `header`, or `None` if it starts over.
    fn outdated_for(&self, header: &JobHeader, origin: PlanOrigin, progress: ProgressOutput) -> Option<Vec<JobStep>> {
        let (old, change, has_plan) = (&self.header, self.change(header)?, origin == PlanOrigin::Kept);
        if header.fingerprint.updates() && !has_plan {
            if let (true, JobChange::Mesh(what)) = (old.fingerprint.updates(), &change) {
                progress.note(&format!("changed since the last run: {what}; everything is computed again"));
            }
            return None;
        }
        if self.is_complete && !matches!(change, JobChange::Style(_)) {
            // Its results have left their waiting places. Another style needs none of them.
            return None;
        }
        let had_plan = self.entries.iter().any(|entry| entry.step == JobStep::Plan);
        if had_plan && !has_plan && matches!(change, JobChange::Nothing | JobChange::FromTiles { .. }) {
            // Another plan may bend the scene otherwise, if another machine makes it.
            progress.note("what the interrupted run left is damaged; starting over");
            return None;
        }
        let changed =
            |what: &str, then: &str| progress.note(&format!("changed since the interrupted run: {what}; {then}"));
        let mut outdated = vec![JobStep::Report];
        match change {
            JobChange::Nothing => {}
            JobChange::FromTiles { what, steps } => {
                changed(&what, "the tiles stay");
                outdated.extend(steps.into_iter().chain([JobStep::Publish]));
            }
            JobChange::Style(what) if self.keeps_meshes() => {
                changed(&what, "the tiles are written again");
                outdated.extend(STYLED);
            }
            JobChange::Style(what) => {
                changed(&what, "the mesh is already deleted ([limits] keep_steps); starting over");
                return None;
            }
            JobChange::Mesh(what) => {
                changed(&what, "starting over");
                return None;
            }
        }
        if header.fingerprint.memory != old.fingerprint.memory {
            // Coarser tiles that do not fit the memory are left out.
            outdated.extend([JobStep::Publish, JobStep::Levels]);
        }
        Some(outdated)
    }

    /// Tells whether all parts that are meshed keep what other tiles need than those that are written.
    fn keeps_meshes(&self) -> bool {
        let meshed = self.parts.iter().filter_map(|part| part.known::<MeshedPart>(JobStep::Mesh).ok().flatten());
        meshed.into_iter().all(|part| part.is_kept)
    }

    /// Drops all phases of the parts whose records or files do not hold what was written. Returns how many parts these are.
    fn drop_damaged_parts(&mut self, progress: ProgressOutput) -> Result<u64> {
        let phases = self.parts.iter().map(|part| part.entries.len() as u64).sum();
        let (stage, mut damaged) = (progress.stage("check", phases, "phases"), 0);
        for part in &mut self.parts {
            let phases = part.entries.len() as u64;
            if !part.is_whole()? {
                part.entries.clear();
                damaged += 1;
            }
            stage.advance(phases);
        }
        stage.finish();
        self.has_dropped |= damaged > 0;
        Ok(damaged)
    }
}

/// Tells whether `names` are those of all results of the job, as its list has them. A journal that is damaged names fewer.
fn are_all_results(directory: &JobDirectory, names: &HashSet<PathBuf>) -> Result<bool> {
    let [waits, place] = [directory.output(), directory.results()].map(OutputFiles::checksums);
    let waiting = read_if_there(&waits)?;
    let Some(text) = waiting.map_or_else(|| read_if_there(&place), |text| Ok(Some(text)))? else { return Ok(false) };
    let own = [directory.results().checksums(), directory.results().report()].map(|path| directory.name(&path));
    let listed = parse_list(&text).into_iter().flatten().map(|(name, _)| PathBuf::from(name));
    Ok(listed.chain(own).collect::<HashSet<_>>() == *names)
}

/// Puts the results of a job in place that has just written its report. If it `updates`, they stay where they wait, too.
///
/// # Errors
/// As [`JobDirectory::replace_results`]; [`Error::Io`] if the journals cannot be read, or do not name all results.
pub(crate) fn place_results_of_finished_job(directory: &JobDirectory, updates: bool) -> Result<()> {
    // There are no folders of parts but those of this job: it has removed all others.
    let mut names = journal::names_of_files(directory)?;
    names.retain(|name| directory.is_result(name));
    if !are_all_results(directory, &names)? {
        let damaged = io::Error::new(ErrorKind::InvalidData, "it has changed since the job wrote it");
        return Err(Error::io("read", directory.journal())(damaged));
    }
    directory.replace_results(&names, updates)?;
    place_changes(directory)
}

/// Begins a run of the job with `header` in its locked directory: takes over what is the same from the earlier run if it is whole, and
/// otherwise removes everything. `origin` tells whose its plan is. What tasks have done is not compared with its hashes
/// (`is_by_tasks`), because it was on the disk before others counted on it. Returns the journal of the job with its header, and the number of
/// phases that are complete.
///
/// # Errors
/// [`Error::Io`] on the job directory.
pub(crate) fn start(
    directory: &JobDirectory,
    header: &JobHeader,
    earlier: Option<EarlierRun>,
    origin: PlanOrigin,
    is_by_tasks: bool,
    progress: ProgressOutput,
) -> Result<(Journal, JobHeader, u64)> {
    let (is_update, has_plan) = (origin == PlanOrigin::Update, origin == PlanOrigin::Kept);
    let progress_of_tasks = if is_by_tasks { ProgressOutput::Quiet } else { progress };
    let mut kept = earlier.and_then(|earlier| earlier.kept_for(header, origin, progress_of_tasks));
    if let (Some(earlier), false) = (&mut kept, is_by_tasks) {
        let mut files = earlier.entries.iter().flat_map(|entry| &entry.files);
        let of_job = files.try_fold(true, |all, file| Ok::<_, Error>(all && file.try_is_whole(directory)?))?;
        let damaged = earlier.drop_damaged_parts(progress)?;
        if is_update && damaged > 0 {
            let parts = counted(damaged, "part");
            progress.note(&format!("what the last run left of {parts} is damaged, and is computed again"));
        } else if damaged > 0 || !of_job {
            progress.note("what the interrupted run left is damaged; starting over");
            kept = None;
        }
    }
    let Some(EarlierRun { header: old, entries, parts, has_dropped, .. }) = kept else {
        remove_file(&directory.journal())?;
        directory.clear(&single_process::notes(directory)?)?;
        let begun = header.begun.or(Some(SystemTime::now()));
        let header = JobHeader { id: new_id(), begun, ..header.clone() };
        let journal = Journal::begin(directory, &header, Vec::new())?;
        return Ok((journal, header, 0));
    };
    let resumed = (entries.len() + parts.iter().map(|part| part.entries.len()).sum::<usize>()) as u64;
    if is_update {
        let of_parts = parts.iter().flat_map(|part| part.files(None));
        directory.keep_results(&of_parts.map(|file| file.name.clone()).collect())?;
    } else if resumed > 0 {
        progress_of_tasks.note(&format!("continuing an interrupted run; phases complete: {resumed}"));
    }
    // Only a plan that stays calls the inputs what they were called.
    let fingerprint = match has_plan {
        true => header.fingerprint.with_names_of(&old.fingerprint),
        false => header.fingerprint.clone(),
    };
    for PartEntries { directory, header, entries } in parts.into_iter().filter(|_| has_dropped) {
        drop(Journal::begin(&directory, &header, entries)?);
    }
    let header = JobHeader { fingerprint, id: old.id, begun: old.begun, ..*header };
    Ok((Journal::begin(directory, &header, entries)?, header, resumed))
}

/// Returns a number that no other run has.
fn new_id() -> u64 {
    let time = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let nanoseconds = time.map_or(0, |time| time.as_nanos() as u64);
    (nanoseconds ^ u64::from(std::process::id()) << 40).max(1)
}
