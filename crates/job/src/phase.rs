//! The phases of a job of several parts, and the tasks that a phase is dealt out to. A scheduler runs a task as
//! `gdt-batch work job.toml --phase P --task i/N`.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use sys::{Error, Result};

/// A phase of a job. Each needs those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
#[value(rename_all = "lowercase")]
pub enum Phase {
    /// Looks at all headers and cuts the plane into parts.
    Plan,
    /// Reads the inputs that a part is the first to need.
    Read,
    /// Finds the vertices of all parts among their points, in a job with `surface = "bare-earth"` or `[output] max_error`.
    Select,
    /// Triangulates a part, and writes the tiles that need no other.
    Mesh,
    /// Merges what the parts send up.
    Join,
    /// Writes the tiles of a part that have waited for others.
    Tiles,
    /// Makes the coarser tiles of a part.
    Levels,
    /// Makes the coarser tiles above the parts, writes what is beside the tiles, and puts all results in place.
    Publish,
}

impl Phase {
    /// All phases in their order.
    pub const ALL: [Phase; 8] = [
        Phase::Plan,
        Phase::Read,
        Phase::Select,
        Phase::Mesh,
        Phase::Join,
        Phase::Tiles,
        Phase::Levels,
        Phase::Publish,
    ];

    /// Returns the phases of a job in their order. Only a job that leaves points out of the mesh has [`Phase::Select`].
    pub fn of_job(selects: bool) -> impl Iterator<Item = Phase> {
        Phase::ALL.into_iter().filter(move |phase| selects || *phase != Phase::Select)
    }

    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Phase::Plan => "plan",
            Phase::Read => "read",
            Phase::Select => "select",
            Phase::Mesh => "mesh",
            Phase::Join => "join",
            Phase::Tiles => "tiles",
            Phase::Levels => "levels",
            Phase::Publish => "publish",
        }
    }

    /// Tells whether it is done part by part, and so can be dealt out to several tasks.
    pub fn is_by_part(self) -> bool {
        !matches!(self, Phase::Plan | Phase::Select | Phase::Join | Phase::Publish)
    }

    /// Returns how many tasks it has where phases are dealt out to `tasks` tasks.
    pub fn tasks(self, tasks: u32) -> u32 {
        if self.is_by_part() { tasks } else { 1 }
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A phase, and its tasks that have not done all of their parts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PhaseTasks {
    /// The phase.
    pub phase: Phase,
    /// How many tasks it is dealt out to.
    pub count: u32,
    /// The numbers of the tasks that are missing, from 1 to `count`, ascending.
    pub missing: Vec<u32>,
}

impl PhaseTasks {
    /// Returns all phases of a job with all of their tasks, where phases are dealt out to `tasks` tasks.
    pub fn all(tasks: u32, selects: bool) -> Vec<PhaseTasks> {
        let all =
            |phase: Phase| PhaseTasks { phase, count: phase.tasks(tasks), missing: (1..=phase.tasks(tasks)).collect() };
        Phase::of_job(selects).map(all).collect()
    }
}

/// One of the tasks that a phase is dealt out to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Task {
    /// Its number, from 1 on.
    pub number: u32,
    /// How many there are.
    pub count: u32,
}

/// The most tasks of a phase: as many as the arrays of schedulers may have.
pub const MOST_TASKS: u32 = 1_000_000;

impl Task {
    /// Returns the task that the environment of an array job names, as `variable` tells it. `count` is the number of tasks, if the
    /// user says it. A phase with one task needs no array; `count` is that of the other phases then.
    ///
    /// # Errors
    /// [`Error::Config`] if the environment names no task or one that does not exist.
    pub fn of_environment(phase: Phase, count: Option<u32>, variable: impl Fn(&str) -> Option<String>) -> Result<Task> {
        if !phase.is_by_part() {
            return Ok(Task { number: 1, count: count.unwrap_or(1) });
        }
        for (name, first) in INDICES {
            if let Some(text) = variable(name) {
                let number = number_of(name, &text)?;
                let count = match (count, first) {
                    (Some(count), _) => count,
                    (None, 1) => slurm_count(&variable)?,
                    _ => {
                        return Err(Error::Config(format!(
                            "{name} is {text}, but the number of tasks is missing: add --tasks N"
                        )));
                    }
                };
                let text = format!("{name} is {text}, and there are {count} tasks: their numbers begin at {first}");
                return number
                    .checked_sub(first)
                    .map_or(Err(()), |before| Task::new(before + 1, count))
                    .map_err(|()| Error::Config(text));
            }
        }
        let names = INDICES.map(|(name, _)| name).join(", ");
        Err(Error::Config(format!(
            "name a task with --task i/N, or run this in an array job, which sets one of {names}"
        )))
    }

    fn new(number: u32, count: u32) -> std::result::Result<Task, ()> {
        let exists = (1..=count).contains(&number) && count <= MOST_TASKS;
        if exists { Ok(Task { number, count }) } else { Err(()) }
    }
}

/// The variables with the index of a task of an array, and what they count from: Slurm, Kubernetes, AWS Batch.
const INDICES: [(&str, u32); 3] =
    [("SLURM_ARRAY_TASK_ID", 1), ("JOB_COMPLETION_INDEX", 0), ("AWS_BATCH_JOB_ARRAY_INDEX", 0)];

/// Returns how many tasks the array of Slurm has, if it is one from 1 to that number.
fn slurm_count(variable: impl Fn(&str) -> Option<String>) -> Result<u32> {
    let number = |name: &str| variable(name).map(|text| number_of(name, &text)).transpose();
    let (most, count) = (number("SLURM_ARRAY_TASK_MAX")?, number("SLURM_ARRAY_TASK_COUNT")?);
    match (most, count) {
        (Some(most), Some(count)) if most == count => Ok(most),
        _ => Err(Error::Config(
            "the array of Slurm is not one from 1 to the number of tasks: set their number with --tasks N".into(),
        )),
    }
}

fn number_of(name: &str, text: &str) -> Result<u32> {
    text.parse().map_err(|_| Error::Config(format!("{name} is {text:?}, which is not a number")))
}

impl FromStr for Task {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Task, String> {
        let numbers =
            text.split_once('/').and_then(|(number, count)| Some((number.parse().ok()?, count.parse().ok()?)));
        let task = numbers.and_then(|(number, count)| Task::new(number, count).ok());
        task.ok_or_else(|| format!("a task is i/N, with i from 1 to N and N at most {MOST_TASKS}: for example 3/8"))
    }
}

impl fmt::Display for Task {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sys::ErrorKind;

    #[test]
    fn names_are_those_of_the_command_line() {
        for phase in Phase::ALL {
            assert_eq!(Phase::from_str(phase.name(), false), Ok(phase));
            assert_eq!(serde_json::to_value(phase).unwrap(), phase.name());
        }
    }

    #[test]
    fn a_task_is_one_of_several() {
        assert_eq!("3/8".parse(), Ok(Task { number: 3, count: 8 }));
        assert_eq!("8/8".parse::<Task>().unwrap().to_string(), "8/8");
        for wrong in ["0/8", "9/8", "3", "/8", "3/", "-1/8", "3/8/9", "a/b", "1/0", "1/4294967296"] {
            assert!(wrong.parse::<Task>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn array_jobs_name_their_tasks() {
        let task = |count: Option<u32>, set: &[(&str, &str)]| {
            let variable = |name: &str| set.iter().find(|(key, _)| *key == name).map(|(_, value)| value.to_string());
            Task::of_environment(Phase::Mesh, count, variable).map(|task| task.to_string()).map_err(|e| e.kind())
        };
        let slurm = [("SLURM_ARRAY_TASK_ID", "3"), ("SLURM_ARRAY_TASK_MAX", "8"), ("SLURM_ARRAY_TASK_COUNT", "8")];
        assert_eq!(task(None, &slurm), Ok("3/8".into()));
        assert_eq!(task(Some(20), &slurm), Ok("3/20".into()));
        // An array of only some tasks does not tell how many there are.
        let some = [slurm[0], slurm[1], ("SLURM_ARRAY_TASK_COUNT", "2")];
        assert_eq!(task(None, &some), Err(ErrorKind::Usage));
        assert_eq!(task(Some(8), &some), Ok("3/8".into()));
        assert_eq!(task(Some(2), &some), Err(ErrorKind::Usage));
        assert_eq!(task(Some(8), &[("SLURM_ARRAY_TASK_ID", "0")]), Err(ErrorKind::Usage));
        for name in ["JOB_COMPLETION_INDEX", "AWS_BATCH_JOB_ARRAY_INDEX"] {
            assert_eq!(task(Some(8), &[(name, "0")]), Ok("1/8".into()));
            assert_eq!(task(Some(8), &[(name, "7")]), Ok("8/8".into()));
            assert_eq!(task(Some(8), &[(name, "8")]), Err(ErrorKind::Usage));
            assert_eq!(task(Some(8), &[(name, "x")]), Err(ErrorKind::Usage));
            assert_eq!(task(None, &[(name, "0")]), Err(ErrorKind::Usage));
        }
        assert_eq!(task(Some(8), &[]), Err(ErrorKind::Usage));
        let only = |count: Option<u32>| Task::of_environment(Phase::Join, count, |_| None).unwrap().to_string();
        assert_eq!((only(None), only(Some(8))), ("1/1".into(), "1/8".into()));
    }
}
