//! `terrain.xml`, `terrain.dxf`, `terrain.obj` and `terrain.ply`: the exact mesh for CAD and other programs, from the tiles that are written.
//!
//! The tiles are read once, in their order. Their vertices are numbered, and the numbered mesh waits in two files of its own: several formats
//! want all vertices before the first triangle, and their counts before both. Each format is then written from these files.

pub(crate) mod export_limits;
pub(crate) mod waiting_mesh;
pub(crate) mod write_exports;
