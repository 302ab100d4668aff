//! `terrain/`: tiles of the format quantized-mesh for globes, from the tiles that are written.
//!
//! Each tile is read twice: first for the density of the terrain, from which the finest zoom follows, then to be cut (`globe_grid.rs`). The pieces
//! wait in a file until all are there (`waiting.rs`). Then the tiles of one zoom after the other are made from those of the finer one
//! (`zooms.rs`) and written (`write_terrain.rs`). What is in memory is a tile with the four below it for each thread, and the list of the tiles of
//! two zooms.

pub(crate) mod check;
pub(crate) mod write_terrain;

mod globe_grid;
mod lakes;
mod limits;
mod room;
mod waiting;
mod zooms;
