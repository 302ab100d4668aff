//! Where points come from.

use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use std::fmt::Debug;

/// The bytes of memory for each point of a block while it is loaded, about.
pub(crate) const BYTES_PER_LOADED: u64 = 80;
/// The bytes of memory for each point of a block that waits to be triangulated, about.
pub(crate) const BYTES_PER_WAITING: u64 = 24;
/// The bytes of memory for each site of a block while it is triangulated, beside those that the triangulation takes afterwards, about.
pub(crate) const BYTES_PER_TRIANGULATED: u64 = 200;
/// The bytes of memory for each selected point in any case, about.
pub(crate) const BYTES_PER_LISTED: u64 = 24;
/// The bytes of memory for each point of a block of which all are selected, about. The triangulation has up to two sites for each.
pub const BYTES_PER_POINT: u64 = 1000;

/// The points of a block: lattice integers x, y, z. No two have the same x and y.
#[derive(Clone, Debug, Default)]
pub struct BlockPoints {
    /// All points.
    pub points: Vec<[i32; 3]>,
    /// Those of them that are selected in any case.
    pub fixed: Vec<[i32; 3]>,
}

/// A file for what the memory does not hold. Threads may use it at the same time.
pub trait SelectionStore: Sync + Debug {
    /// Returns the position of so many bytes that nothing else gets.
    fn reserve(&self, bytes: u64) -> u64;

    /// Writes bytes from a position on.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    fn write(&self, at: u64, bytes: &[u8]) -> sys::Result<()>;

    /// Reads bytes from a position on.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    fn read(&self, at: u64, bytes: &mut [u8]) -> sys::Result<()>;

    /// Gives the space of so many bytes back that are no longer needed.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    fn free(&self, at: u64, bytes: u64) -> sys::Result<()>;
}

/// A cloud in blocks.
pub trait PointSource: Sync {
    /// What may go wrong.
    type Error: Send + From<sys::Error>;

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

    /// Returns the bytes of memory that selecting may take.
    fn memory(&self) -> u64;

    /// Returns where waits what the memory does not hold. Without such a place all selected points stay in memory.
    fn store(&self) -> Option<&dyn SelectionStore>;

    /// Tells whether the caller wants to know how many points the triangle with these corners holds in the end.
    fn asks_about(&self, corners: [Site; 3]) -> bool;

    /// Is called after each round.
    ///
    /// # Errors
    /// If the work is to be stopped.
    fn after_round(&self) -> Result<(), Self::Error>;
}
