//! Why the pipeline rejects a leaf.

/// Why the pipeline rejects a leaf. The caller may cut the leaf, or triangulate it in another way.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Rejection {
    /// Fewer than three sites have no triangle.
    #[error("too few sites for a triangle")]
    TooFew,
    /// The leaf has more than 2^26 sites.
    #[error("too many sites for one leaf")]
    TooMany,
    /// A coordinate exceeds `geometry::REACH`.
    #[error("a coordinate is out of reach")]
    OutOfReach,
    /// So many sites share a pixel that the discrete diagram says too little.
    #[error("too many sites share a pixel")]
    Crowded,
    /// The result was wrong, or was going to be wrong. The text says which check failed.
    #[error("the mesh was not accepted: {0}")]
    NotAccepted(&'static str),
}
