//! The phases between the plan and publishing.

use crate::durable::directory::JobDirectory;
use crate::durable::listing::entries;
use crate::durable::lock::Lock;
use crate::index::PartIndex;
use crate::options::{JobOptions, RunOptions};
use crate::phase::{Phase, Task};
use crate::plan::budget::workers;
use crate::progress::clock::JobClock;
use crate::progress::stage::JobProgress;
use crate::publish::written_tiles::wants_tileset;
use crate::run::attempt::{NO_LOCKS, may_coarsen};
use crate::run::damage::{damaged_by_tasks, is_cut_off};
use crate::run::job::{Job, Process};
use crate::run::phases::appearance::early_appearance;
use crate::run::phases::join::{JoinedParts, join_parts};
use crate::run::phases::level_phase::levels_of_part;
use crate::run::phases::mesh_phase::mesh_one;
use crate::run::phases::read_phase::{read_for, sum_up};
use crate::run::phases::select_phase::{know_selection, select_vertices, selects};
use crate::run::phases::tile_phase::finish_part;
use crate::run::planned_job::PlannedJob;
use crate::run::single_process;
use crate::run::tasks::dealing::deal;
use crate::run::tasks::missing::{JobProgressByPart, not_planned};
use crate::tiles::write_tile::TileStats;
use crate::{Error, Result};
use delaunay_gpu::triangulator::Triangulator;
use std::collections::HashSet;
use sys::threads::on_threads;
use tiles::options::OutputFormat;

/// Does `phase` of the parts that fall to `task`. Returns how many these are, and what there is to say.
///
/// # Errors
/// [`Error::TooEarly`] if an earlier phase is not complete, [`Error::InUse`] if another process has one of the parts, and those of the
/// steps.
pub(crate) fn work_on_parts(
    options: &JobOptions,
    run: RunOptions,
    phase: Phase,
    task: Task,
) -> Result<(u64, Option<String>)> {
    let directory = &JobDirectory::new(&options.output.directory);
    let has_journal = entries(directory.job())?.contains(&directory.journal());
    if !has_journal && !single_process::is_noted(directory, run.submission)? {
        return Err(not_planned());
    }
    let lock = Lock::share(directory.job())?;
    if !lock.is_real() {
        run.progress.note(NO_LOCKS);
    }
    if single_process::is_noted(directory, run.submission)? {
        return Ok((0, Some(format!("nothing to do: {}", single_process::SENTENCE))));
    }
    let mut job = PlannedJob::open(directory, options, run.submission)?.ok_or_else(not_planned)?;
    if job.is_complete {
        return Ok((0, Some("nothing to do: all results are written".into())));
    }
    let mine = parts_of(&job, phase, task);
    if mine.is_empty() {
        return Ok((0, None));
    }
    if phase == Phase::Read {
        let inputs: Vec<usize> = mine.iter().flat_map(|&part| job.parts.new_inputs(part)).copied().collect();
        job.find_inputs(inputs.into_iter())?;
    }
    let worked =
        on_threads(workers(options, job.plan.records)?, || PartTask { job: &job, run, phase, task }.work(&mine));
    let why = match worked {
        Err(Error::OtherThanClaimed { is_bad_file: true }) => "a file is bad and will be left out".into(),
        Err(Error::OtherThanClaimed { is_bad_file: false }) => "what was read contradicts the header of a file".into(),
        Err(Error::TooFine { vertical, what }) if may_coarsen(options, vertical) => what,
        Err(Error::DamagedSteps) => return Err(damaged_by_tasks(directory)),
        Err(error) if is_cut_off(&error, directory) => return Err(damaged_by_tasks(directory)),
        worked => return worked.map(|()| (mine.len() as u64, None)),
    };
    single_process::leave_note(directory, job.header.submission)?;
    Ok((mine.len() as u64, Some(format!("{why}; {}", single_process::SENTENCE))))
}

/// Returns the parts of `phase` that fall to `task`. A phase with one task does all.
fn parts_of(job: &PlannedJob, phase: Phase, task: Task) -> Vec<PartIndex> {
    let dealt = deal(&job.plan, &job.parts, phase, phase.tasks(task.count));
    dealt.into_iter().filter(|(_, number)| *number == task.number).map(|(part, _)| part).collect()
}

/// A task of a phase that is done by parts, or of join.
struct PartTask<'a> {
    job: &'a PlannedJob,
    run: RunOptions,
    phase: Phase,
    task: Task,
}

impl PartTask<'_> {
    /// Does the phase for the parts that are `mine`. Goes on with the others where another process has one.
    fn work(&self, mine: &[PartIndex]) -> Result<()> {
        let clock = JobClock::start();
        let options = &self.job.plan.options;
        let threads = rayon::current_num_threads();
        let triangulator = match self.phase {
            Phase::Mesh | Phase::Select => {
                Triangulator::new(&options.triangulation, &options.gpu, options.limits.memory.0)?
            }
            _ => Triangulator::without_gpu(&options.triangulation),
        };
        triangulator.prepare(mine.iter().map(|&part| self.job.parts.expected_points(part)).sum(), threads);
        let process = Process {
            directory: &self.job.directory,
            triangulator: &triangulator,
            progress: &JobProgress::new(self.run.progress, clock, Vec::new()),
            threads,
            clock,
            id: self.job.header.id,
            checks_points: true,
            is_task: true,
        };
        let job = &Job::new(process, &self.job.plan, &self.job.parts);
        self.require_others(mine)?;
        if self.phase > Phase::Select {
            know_selection(job)?;
        }
        match self.phase {
            Phase::Read => self.each(mine, |part| read_for(job, part, 0).map(|_| ())),
            Phase::Select => sum_up(job).and_then(|_| select_vertices(job)),
            Phase::Mesh => {
                let appearance = early_appearance(job)?;
                self.each(mine, |part| mesh_one(job, part, appearance.as_ref(), None).map(|_| ()))
            }
            Phase::Join => join_parts(job),
            Phase::Tiles => {
                let joined = JoinedParts::open(job)?;
                self.each(mine, |part| finish_part(job, &joined, part).map(|_| ()))
            }
            Phase::Levels => {
                let joined = JoinedParts::open(job)?;
                let written = self.parts_needed(mine).into_iter().map(|part| Ok(job.entries(part)?.tiles()?.stats));
                let has_tileset = wants_tileset(job.plan, &written.sum::<Result<TileStats>>()?);
                self.each(mine, |part| levels_of_part(job, &joined, part, has_tileset).map(|_| ()))
            }
            Phase::Plan | Phase::Publish => Ok(()),
        }
    }

    /// Checks that the phases are complete that this one needs, as far as it needs them.
    fn require_others(&self, mine: &[PartIndex]) -> Result<()> {
        let needed: &[Phase] = match self.phase {
            Phase::Select => &[Phase::Read],
            Phase::Mesh if selects(&self.job.plan) => &[Phase::Select],
            Phase::Mesh => &[Phase::Read],
            Phase::Join => &[Phase::Read, Phase::Mesh],
            Phase::Tiles => &[Phase::Join],
            Phase::Levels => &[Phase::Join, Phase::Tiles],
            Phase::Plan | Phase::Read | Phase::Publish => &[],
        };
        let progress = JobProgressByPart::of_parts(self.job, self.parts_needed(mine))?;
        needed.iter().try_for_each(|phase| progress.require(*phase, self.task.count))
    }

    /// Returns the parts whose earlier phases this one needs.
    fn parts_needed(&self, mine: &[PartIndex]) -> Vec<PartIndex> {
        let PlannedJob { plan, parts, .. } = self.job;
        let readers: HashSet<PartIndex> = mine.iter().flat_map(|&part| parts.readers_of(part)).collect();
        let is_needed = |part: &PartIndex| match self.phase {
            Phase::Mesh => selects(plan) || readers.contains(part),
            // With one file, the size of all tiles together tells whether it holds them.
            Phase::Levels => plan.options.output.format == OutputFormat::Glb || mine.contains(part),
            phase => matches!(phase, Phase::Select | Phase::Join),
        };
        parts.all().filter(is_needed).collect()
    }

    /// Does `work` for each of `mine`. A part that another process has is left to it.
    fn each(&self, mine: &[PartIndex], work: impl Fn(PartIndex) -> Result<()>) -> Result<()> {
        let mut in_use = None;
        for &part in mine {
            match work(part) {
                Err(error @ Error::InUse { .. }) => {
                    self.run.progress.note(&format!("part {part} is left out: {error}"));
                    in_use.get_or_insert(error);
                }
                outcome => outcome?,
            }
        }
        in_use.map_or(Ok(()), Err)
    }
}
