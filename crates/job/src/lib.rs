//! A job, from the options to the report. [`run()`] shows its walk through the steps; each step has a module of its own.
//!
//! A step that runs once for each tile or node takes the plan, the results of the steps for the whole job (the tree, the style), the
//! index and the store, but never the running job. It finds in the store what earlier steps wrote, and writes its own result there.
//! So steps can run in any order that puts children before parents, and an interrupted job goes on from the steps that its journal
//! has.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

pub mod durable;
mod error;
pub mod index;
pub(crate) mod levels;
pub(crate) mod machine;
pub mod merge_records;
pub mod mesh;
pub mod options;
pub mod partition;
pub mod phase;
pub mod plan;
pub mod preflight;
pub mod progress;
pub(crate) mod publish;
pub mod records;
pub mod report;
pub mod run;
pub(crate) mod tiles;

pub use crate::error::{Error, Result};

use crate::index::{NodeIndex, PartIndex};
use crate::levels::make_level::Child;
use crate::merge_records::Seam;
use crate::mesh::precision_limit::PrecisionLimit;
use crate::options::{JobOptions, RunOptions};
use crate::partition::result::Partition;
use crate::phase::{Phase, PhaseTasks, Task};
use crate::plan::job_plan::Plan;
use crate::plan::no_points::no_point_is_left;
use crate::publish::side_files::StoredTiles;
use crate::publish::tileset_tree::TilesOfTree;
use crate::report::job_report::Report;
use crate::report::job_status::JobStatus;
use crate::report::task_outcome::TaskOutcome;
use crate::run::attempt::{EarlierWork, run_until_it_fits};
use crate::run::curve_step::with_curvature;
use crate::run::levels_step::{hierarchy_of, make_levels};
use crate::run::mesh_and_tiles::mesh_and_tiles;
use crate::run::publish_step::{
    MeshFigures, TilesetContent, WrittenFiles, publish, some_triangles, wants_tileset, write_report,
};
use crate::run::run_context::RunContext;
use crate::run::{parts, read_step, tasks};
use std::time::SystemTime;
use sys::threads::run_concurrently;

/// Runs the whole job, or what an interrupted run left of it.
///
/// # Errors
/// Every error of every step; see [`Error`]. Whatever fails, the results of an earlier job stay as they are. With
/// [`Error::Resumable`] the finished steps are kept. With any other error of a step no temporary files are left; an error before the
/// first step leaves the directory as it was.
pub fn run(options: &JobOptions, run: impl Into<RunOptions>) -> Result<Report> {
    // Step 1, the plan, and what is around every attempt: the directory, its lock, the journal.
    run_until_it_fits(options, run.into(), walk, EarlierWork::Interrupted)
}

/// Does one task of one phase of the job.
///
/// # Errors
/// [`Error::TooEarly`] if an earlier phase is not complete, [`Error::InUse`] if another process has one of the task's parts, and the
/// errors of the steps. What is done is kept in any case.
pub fn work(options: &JobOptions, run: impl Into<RunOptions>, phase: Phase, task: Task) -> Result<TaskOutcome> {
    tasks::work(options, run.into(), phase, task, walk)
}

/// Returns all phases of the job with the tasks that are missing, where phases are dealt out to `tasks` tasks: all of them if there is no
/// plan of this job, and none if its results are in place.
///
/// # Errors
/// [`sys::Error::Config`] if there are no inputs, [`sys::Error::Io`] if one of them, or a journal, cannot be read.
pub fn missing_tasks(options: &JobOptions, tasks: u32) -> sys::Result<Vec<PhaseTasks>> {
    tasks::missing::missing_tasks(options, tasks)
}

/// As [`missing_tasks`], of a job that has just been planned: its phase `plan` is not missing.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the job directory.
pub fn missing_tasks_of_planned(options: &JobOptions, tasks: u32) -> sys::Result<Vec<PhaseTasks>> {
    tasks::missing::missing_tasks_of_planned(options, tasks)
}

/// Returns a number for a submission that starts the job over. It is greater than those of earlier submissions, as far as clocks agree.
pub fn new_submission() -> u64 {
    let time = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    time.map_or(1, |time| time.as_millis() as u64)
}

/// Returns how far the job is. If `tasks` is given, also which tasks are missing, where phases are dealt out to so many.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the job directory.
pub fn status(options: &JobOptions, tasks: Option<u32>) -> sys::Result<JobStatus> {
    tasks::status::status(options, tasks)
}

/// The walk through the steps after the plan.
fn walk(run: &RunContext, plan: Plan, earlier: Option<Partition>) -> Result<Report> {
    if !plan.is_one_part() {
        return parts::walk(run, plan);
    }
    // Step 2, partition/: the points by tile, and the tree.
    let (plan, partition) = read_step::read(run, plan, earlier)?;
    let summary = &partition.summary;
    let bounds = summary.bounds.ok_or_else(|| no_point_is_left(&plan, &summary.counts))?;
    PrecisionLimit::of(&plan.frame).check_heights(bounds)?;
    let plan = with_curvature(run, plan, bounds)?;
    // Steps 3 and 4, mesh/: leaves and merges. Steps 5 and 6, tiles/: border normals and tiles, each as soon as it is finished.
    let mesh = mesh_and_tiles(run, &plan, &partition, bounds)?;
    let tiles = &mesh.tiles;
    let appearance =
        tiles.appearance.as_ref().ok_or_else(|| sys::Error::Broken("the tiles have no appearance".into()))?;
    some_triangles(&tiles.stats, &plan)?;
    // From here on the store is enough.
    run_concurrently(
        || run.remove_points(mesh.all_leaves),
        || {
            // Step 7, levels/: coarser tiles.
            let levels = wants_tileset(&plan, &tiles.stats).then(|| {
                let hierarchy = hierarchy_of(&plan, &partition);
                make_levels(run, &plan, PartIndex::FIRST, hierarchy, &appearance.style, &no_other_part)
            });
            let levels = levels.transpose()?;
            // Step 8, publish/: what is beside the tiles, and the report.
            let tree = &partition.tree;
            let tileset = levels.map(|levels| {
                let part_root = &|_| Ok(None);
                let root = TilesOfTree { store: run.store, tree, hierarchy: &levels.hierarchy, part_root }.root()?;
                TilesetContent::new(root, levels.stats)
            });
            let (tileset, all) = (tileset.transpose()?, StoredTiles { store: run.store, tree });
            let files =
                WrittenFiles { stats: tiles.stats, hull: Seam::hull_count(run.store, NodeIndex::ROOT)?, tiles: &all };
            let published = publish(run, &plan, bounds, &files, appearance, tileset)?;
            let figures = MeshFigures {
                points: summary.counts.clone(),
                leaves: mesh.leaves,
                tiles: tiles.stats,
                temporary: run.temporary.measure(&partition, run.store),
                files: Vec::new(),
                parts: 1,
                slowest_part: None,
                peak_memory: None,
                cpu_s_of_tasks: 0.0,
            };
            Ok(write_report(run, &plan, figures, published)?)
        },
    )
}

/// In a job of one part no tile needs another.
fn no_other_part(part: PartIndex) -> sys::Result<Child> {
    Err(sys::Error::Broken(format!("there is no part {part}")))
}
