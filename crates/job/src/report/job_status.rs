//! How far a job on many machines is.

use crate::phase::Phase;
use crate::report::job_report::SlowestPart;
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;
use sys::terminal::name;

/// How far a job is.
#[derive(Debug, Serialize)]
pub struct JobStatus {
    /// The output directory.
    #[serde(serialize_with = "sys::path_text::shown")]
    pub output: PathBuf,
    /// What is to be done.
    pub state: JobState,
    /// The phases in their order.
    pub phases: Vec<PhaseStatus>,
    /// The part whose phases have taken the longest so far.
    pub slowest_part: Option<SlowestPart>,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum JobState {
    /// There is no plan of this job.
    NotPlanned,
    /// There is no plan of this job, and the results in place are those of another: with other options or inputs, or of another version of
    /// the program.
    OtherResults,
    /// It is under way, or waits to go on.
    UnderWay,
    /// It is not done part by part: the phase publish does all of it.
    LeftToPublish,
    /// All results are in place.
    Done,
}

/// How far a phase is.
#[derive(Clone, Debug, Serialize)]
pub struct PhaseStatus {
    /// The phase.
    pub phase: Phase,
    /// How many of its parts are done; of a phase that is not done by parts, 1 if it is done.
    pub done: u64,
    /// How many there are.
    pub of: u64,
    /// The parts that are missing, from 0 on.
    pub missing_parts: Vec<u32>,
    /// The tasks that are missing, if it was asked for a number of tasks.
    pub missing_tasks: Option<Vec<u32>>,
}

impl fmt::Display for JobStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = match self.state {
            JobState::NotPlanned => "there is no plan of this job yet",
            JobState::OtherResults => {
                "there is no plan of this job yet; the results in place are of other options, inputs, or program"
            }
            JobState::UnderWay => "in progress, or waiting to continue",
            JobState::LeftToPublish => "not done part by part: the phase publish does all of it",
            JobState::Done => "done: all results are in place",
        };
        writeln!(f, "{}: {state}", name(&self.output))?;
        for PhaseStatus { phase, done, of, missing_parts, missing_tasks } in &self.phases {
            write!(f, "{:<8} {done:>6} of {of}", phase.name())?;
            match missing_tasks {
                Some(tasks) if !tasks.is_empty() => write!(f, "   tasks missing: {}", few(tasks))?,
                None if !missing_parts.is_empty() => write!(f, "   parts missing: {}", few(missing_parts))?,
                _ => {}
            }
            writeln!(f)?;
        }
        if let Some(SlowestPart { part, seconds, points }) = self.slowest_part {
            writeln!(f, "slowest part so far: {part}, {seconds:.1} s for {points} points")?;
        }
        Ok(())
    }
}

/// Returns the first few numbers as a text.
fn few(numbers: &[u32]) -> String {
    const MOST: usize = 20;
    let first: Vec<String> = numbers.iter().take(MOST).map(u32::to_string).collect();
    let more = numbers.len().saturating_sub(MOST);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    first.join(", ") + &more
}
