//! Running the steps of a job in this process: the only module that knows all of them.

pub(crate) mod attempt;
pub(crate) mod curve_step;
pub(crate) mod damage;
pub(crate) mod finished;
pub(crate) mod freeing;
pub(crate) mod levels_step;
pub(crate) mod mesh_and_tiles;
pub(crate) mod part_entries;
pub(crate) mod parts;
pub(crate) mod postponed_merges;
pub(crate) mod publish_step;
mod raster_step;
pub(crate) mod read_step;
pub(crate) mod resume;
pub(crate) mod resume_parts;
pub(crate) mod run_context;
pub(crate) mod single_process;
pub(crate) mod stage_costs;
pub(crate) mod tasks;
pub(crate) mod temporary_bytes;
pub(crate) mod tile_queue;
pub(crate) mod tree_walk;
