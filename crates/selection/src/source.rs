//! Where points come from.

use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;

/// The bytes of memory for each point of a block that stays in memory, about.
pub const BYTES_PER_POINT: u64 = 24;
/// The bytes of memory for each selected point of such a block, about.
pub const BYTES_PER_SELECTED: u64 = 300;
/// The bytes of memory for each selected point in any case, about.
pub const BYTES_PER_LISTED: u64 = 24;

/// The points of a block: lattice integers x, y, z. No two have the same x and y.
#[derive(Clone, Debug, Default)]
pub struct BlockPoints {
    /// All points.
    pub points: Vec<[i32; 3]>,
    /// Those of them that are selected in any case.
    pub fixed: Vec<[i32; 3]>,
}

/// A cloud in blocks.
pub trait PointSource: Sync {
    /// What may go wrong.
    type Error: Send;

    /// Returns the number of blocks.
    fn blocks(&self) -> usize;

    /// Returns the steps in x and y from zero of the source coordinates to zero of the lattice. What is selected goes by them, and not by where the
    /// lattice begins.
    fn offset(&self) -> [i64; 2];

    /// Returns the points of a block. The boxes of blocks do not touch.
    ///
    /// # Errors
    /// If they cannot be read.
    fn load(&self, block: usize) -> Result<BlockPoints, Self::Error>;

    /// Returns the canonical triangulation of `sites`.
    ///
    /// # Errors
    /// If it fails.
    fn triangulate(&self, sites: &[Site]) -> Result<HalfEdgeMesh, Self::Error>;

    /// Tells whether blocks of `points` points may stay in memory from round to round while `selected` of them are selected. Otherwise one a thread is there at a
    /// time. About [`BYTES_PER_POINT`] are taken for each point then, and [`BYTES_PER_SELECTED`] for each selected one.
    fn keeps_blocks(&self, points: u64, selected: u64) -> bool;

    /// Tells whether the caller wants to know how many points the triangle with these corners holds in the end.
    fn asks_about(&self, corners: [Site; 3]) -> bool;

    /// Is called after each round with what has been selected so far.
    ///
    /// # Errors
    /// If the work is to be stopped.
    fn after_round(&self, round: u32, selected: u64) -> Result<(), Self::Error>;
}
