//! Entwine Point Tiles (EPT 1.0): an octree of points in many small files, its nodes, with an index `ept.json` and the number of points of each
//! node in the pages of its hierarchy.
//!
//! All nodes together are one input. Bounds need only some of them, and only the pages that lead there. Nodes have no size of their own in the
//! index, so that each is read whole: of another machine in one request.

pub(crate) mod binary;
pub(crate) mod dimension;
pub(crate) mod files;
pub(crate) mod hierarchy;
pub(crate) mod index;
pub(crate) mod key;
pub(crate) mod name;
mod node_sink;
pub(crate) mod points;
