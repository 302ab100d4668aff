//! What can go wrong with a triangulation.

/// The result of a triangulation.
pub type Result<T> = std::result::Result<T, Error>;

/// Why there is no triangulation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The host asked to stop: see [`Host`](crate::host::Host).
    #[error("stopped")]
    Stopped,
    /// Two sites have the same place.
    #[error("two sites coincide")]
    Coincident,
    /// A coordinate is farther than [`REACH`](crate::geometry::REACH) from zero, or there are too many sites for 32-bit numbers of edges.
    #[error("a site is out of reach, or there are too many for one mesh")]
    OutOfReach,
    /// A point is no number, or lies too far from the others for the resolution.
    #[error("point {point} is not finite, or too far from the first for the resolution")]
    OffGrid {
        /// Its position in the list, from 0 on.
        point: usize,
    },
    /// The resolution is no positive number.
    #[error("the resolution is not a positive number")]
    Resolution,
    /// A guarantee of this library does not hold.
    #[error("{0}")]
    Broken(String),
}

impl Error {
    /// Returns whether the host asked to stop.
    pub fn is_stopped(&self) -> bool {
        *self == Error::Stopped
    }
}
