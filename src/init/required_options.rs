//! What the clouds need so that a job of them runs. Each way is one that the program's own messages name, and each is tried as `check`
//! would try it.

use crate::init::bad_files::{Damage, line_for_damage, line_for_malformed, lines_for_bad_files};
use crate::init::draft::{Draft, NeededLine};
use crate::init::offered_options::OfferedOptions;
use crate::init::refusals::Refusals;
use crate::init::suspect_heights::line_for_nodata;
use crate::init::systems::CrsAttempts;
use crate::init::triangle::may_have_triangle;
use job::plan::clip::CLIP;
use job::plan::job_plan::{Plan, PlannedInput};
use job::plan::no_points::{no_point_is_left, no_triangle};
use job::plan::text_inputs::{allowed_malformed, count, stop_at};
use job::preflight::check::{Preflight, inspect};
use job::{Error, Result};
use points::Source;
use rayon::prelude::*;
use std::io::ErrorKind;

/// A configuration that runs, and what `check` says of it.
pub(crate) struct Runnable {
    pub(crate) draft: Draft,
    pub(crate) preflight: Preflight,
    pub(crate) plan: Plan,
    /// Why this machine has no room for the job, if it has none.
    pub(crate) obstacle: Option<Error>,
    /// Why the job stops until the user has decided, if there is something to decide.
    pub(crate) stop: Option<Error>,
    /// The options that the job would take.
    pub(crate) offers: OfferedOptions,
}

/// What a try of a draft shows.
enum Trial {
    Runs(Box<(Preflight, Plan)>),
    /// More records cannot be read than the draft allows.
    Damaged(Damage),
}

/// Returns `draft` with the lines that it needs to run.
///
/// # Errors
/// That of `check`, if nothing lets it run.
pub(crate) fn runnable(draft: Draft) -> Result<Runnable> {
    let (mut now, mut ways, mut refusals): (Draft, Option<CrsAttempts>, Refusals) = (draft, None, Refusals::default());
    loop {
        let (error, next) = match trial(&now) {
            Ok(Trial::Runs(found)) => return fitted(now, *found),
            Ok(Trial::Damaged(damage)) => {
                let allowed = || line_for_damage(&now, &damage).map(|line| now.with([line]));
                let next = match &mut ways {
                    Some(ways) => ways.after_stray_points().or_else(allowed),
                    None => allowed(),
                };
                (damage.error.into(), next)
            }
            Err(Error::System(error @ sys::Error::Input { .. })) => {
                let next = match lines_for_bad_files(&now)? {
                    Some(lines) => Some(now.with(lines)),
                    None => line_for_far_points(&now, &error).map(|line| now.with([line])),
                };
                (error.into(), next)
            }
            Err(Error::System(sys::Error::Config(what))) if what.starts_with(CLIP) => {
                return Err(sys::Error::Config(what).into());
            }
            Err(error @ Error::System(sys::Error::Config(_))) => {
                let ways = match &mut ways {
                    Some(ways) => ways,
                    None => ways.insert(CrsAttempts::of(&now)?),
                };
                let next = ways.next();
                (error, next)
            }
            Err(error @ Error::NoTerrain(_)) => {
                let next = line_for_nodata(&now, &error).map(|line| now.with([line]));
                (error, next)
            }
            Err(error) => return Err(error),
        };
        refusals.add(&now, error);
        match next {
            Some(draft) => now = draft,
            None => return Err(refusals.into_error()),
        }
    }
}

/// Tries a draft as `check` does. Where a sample shows records that cannot be read, counts all of them.
fn trial(draft: &Draft) -> Result<Trial> {
    let (preflight, plan) = inspect(&draft.options()?)?;
    let (sample, inputs) = (&plan.sample, &plan.inputs);
    if sample.read >= plan.records && sample.kept == 0 {
        return Err(no_point_is_left(&plan, sample));
    }
    let is_doubtful = sample.malformed > 0 || inputs.iter().any(|input| input.source.has_lost_chunk_table());
    let damage = if is_doubtful { damage(&plan)? } else { None };
    if let Some(damage) = damage {
        return Ok(Trial::Damaged(damage));
    }
    if !may_have_triangle(&plan)? {
        return Err(no_triangle(&plan));
    }
    Ok(Trial::Runs(Box::new((preflight, plan))))
}

/// Returns the line that lets the job leave out points far from all others; `None` if `error` is none that such points cause.
fn line_for_far_points(draft: &Draft, error: &sys::Error) -> Option<NeededLine> {
    let any = NeededLine::of_input("max_malformed_fraction", 1.0, "");
    let allowing = Some(draft.with([any])).filter(|_| !draft.sets("max_malformed_fraction"))?;
    let (_, plan) = inspect(&allowing.options().ok()?).ok()?;
    let counts = |input: &PlannedInput| count(&input.source, &input.rules).map(|counts| counts.malformed);
    let malformed = plan.inputs.par_iter().map(counts).collect::<sys::Result<Vec<_>>>().ok()?.into_iter().sum();
    line_for_malformed(draft, [malformed, plan.records], error)
}

/// Reads all points, and returns how many records are damaged if they are more than the options allow.
fn damage(plan: &Plan) -> sys::Result<Option<Damage>> {
    let count = |input: &PlannedInput| count(&input.source, &input.rules);
    let counts = plan.inputs.par_iter().map(count).collect::<sys::Result<Vec<_>>>()?;
    let malformed = counts.iter().map(|counts| counts.malformed).sum();
    if malformed <= allowed_malformed(plan.options.input.max_malformed_fraction.0, plan.records) {
        return Ok(None);
    }
    let worst = plan.inputs.iter().zip(&counts).max_by_key(|(_, counts)| counts.malformed);
    Ok(worst.map(|(input, of_worst)| {
        let source: &Source = &input.source;
        let others = plan.inputs.iter().zip(&counts).map(|(input, counts)| (&input.source, counts.malformed));
        Damage { malformed, records: plan.records, error: stop_at(source, of_worst, others, [malformed, plan.records]) }
    }))
}

/// Returns the draft with what lets the job fit this machine, if something does.
fn fitted(draft: Draft, (preflight, plan): (Preflight, Plan)) -> Result<Runnable> {
    let offers = OfferedOptions::of(&draft, &preflight, &plan)?;
    let stop = why_it_stops(&draft);
    let Err(obstacle) = preflight.passes() else {
        return Ok(Runnable { draft, preflight, plan, obstacle: None, stop, offers });
    };
    for line in lines_for_memory(&obstacle, preflight.threads) {
        let smaller = draft.with([line]);
        let (preflight, plan) = inspect(&smaller.options()?)?;
        if preflight.passes().is_ok() {
            return Ok(Runnable { draft: smaller, preflight, plan, obstacle: None, stop, offers });
        }
    }
    Ok(Runnable { draft, preflight, plan, obstacle: Some(obstacle), stop, offers })
}

/// Returns why the job of a draft stops until the user has decided; `None` if there is nothing to decide.
fn why_it_stops(draft: &Draft) -> Option<Error> {
    if draft.choices.is_empty() {
        return None;
    }
    match trial(&draft.undecided()) {
        Ok(Trial::Runs(_)) => None,
        Ok(Trial::Damaged(damage)) => Some(damage.error.into()),
        Err(error) => Some(error),
    }
}

/// Returns lines of which one may let a job fit, the mildest first.
fn lines_for_memory(obstacle: &Error, threads: usize) -> Vec<NeededLine> {
    match obstacle {
        Error::System(sys::Error::Memory(_)) => {
            let why = "With more threads the job takes more memory than this machine has free.";
            let fewer = std::iter::successors(Some(threads / 2), |threads| Some(threads / 2));
            let fewer = fewer.take_while(|threads| *threads > 0);
            fewer.map(|threads| NeededLine::of_limits("threads", threads as i64, why)).collect()
        }
        Error::System(sys::Error::Io { source, .. }) if source.kind() == ErrorKind::StorageFull => {
            let why = "If the job keeps its mesh, it takes more disk than is free. Without it, an interrupted job cannot continue with \
                       another style.";
            vec![NeededLine::of_limits("keep_steps", false, why)]
        }
        _ => Vec::new(),
    }
}
