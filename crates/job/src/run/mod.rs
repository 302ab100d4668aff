//! Running the phases of a job in this process: the only module that knows all of them.

pub(crate) mod attempt;
pub(crate) mod damage;
pub(crate) mod earlier_run;
pub(crate) mod finished;
pub(crate) mod folder;
pub(crate) mod job;
pub(crate) mod meshed_part;
pub(crate) mod part_entries;
pub(crate) mod phases;
pub(crate) mod planned_job;
pub(crate) mod single_process;
pub(crate) mod tasks;
pub(crate) mod update;
pub(crate) mod whole_run;
