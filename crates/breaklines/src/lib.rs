//! Breaklines and flat lakes, in lattice integers: from lines and polygons to sites and subsegments that are edges of the Delaunay
//! triangulation, and to the rule which points of the cloud make room for them.
//!
//! # Why every subsegment is an edge
//! An edge ab is in every Delaunay triangulation of a set of sites if the closed disc that has ab as its diameter holds no other site. So
//! lines are cut until no site of a line lies in the closed disc of a subsegment, its two ends excepted, and points of the cloud that lie
//! in one are dropped. No constrained triangulation is needed, and the mesh stays the Delaunay triangulation of its sites. A point p lies
//! in the closed disc of ab if (a - p) . (b - p) <= 0, which whole numbers decide.
//!
//! # Where they end
//! Everything is cut to the box of the points before anything else, and all sites lie in it; `clip.rs` says why. A lake that goes on beyond the
//! box gets a shore along its border. So the lake is closed, and all of it that is in the box is inside or on its shore: its points are dropped,
//! since those on the shore lie in closed discs.
//!
//! What is dropped depends on the lines alone, not on the other points, so tiles, parts, threads and machines agree.
//!
//! # How it is used
//! [`Breaklines::build`] takes features in lattice coordinates. [`Breaklines::drops`] is asked for every point of the cloud.
//! [`Breaklines::sites`] are added to the points that stay. Sites of lines without heights first get one from the points around:
//! [`NearestHeights`].

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod box_tree;
mod clean;
mod clip;
mod cut;
mod drop_index;
mod edge_table;
mod error;
mod exact;
mod fast_hash;
mod feature;
mod findings;
mod heights;
mod lakes;
mod levels;
mod lines_in_lakes;
mod nearest_heights;
mod net;
mod node;
mod options;
mod owners;
mod refine;
mod result;
mod site;
mod site_table;
#[cfg(test)]
mod tests;

pub use error::BreaklineError;
pub use feature::{Feature, FeatureId, FeatureKind, Vertex};
pub use findings::{Disagreement, Findings, InLake, Rise, Uneven};
pub use nearest_heights::{NearestHeights, NearestPoint};
pub use options::BreaklineOptions;
pub use result::Breaklines;
pub use site::BreaklineSite;
