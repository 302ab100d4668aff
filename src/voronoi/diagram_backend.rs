//! The interface to a backend that computes discrete Voronoi diagrams.

use crate::voronoi::texture_request::TextureRequest;

/// A backend that computes discrete Voronoi diagrams (step G2) faster than this thread.
pub trait DiagramBackend {
    /// Returns the size of texture that suits the backend.
    fn texture_request(&self) -> TextureRequest;

    /// Computes the diagram of a texture of `width` x `height` pixels whose sites are at `pixels` (each y << 16 | x).
    fn diagram(&self, width: u32, height: u32, pixels: Vec<u32>) -> DiagramReply;
}

/// A backend's answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DiagramReply {
    /// The label of every pixel, row by row: the pixel (y << 16 | x) of its nearest site.
    Labels(Vec<u32>),
    /// The texture was too large. [`DiagramBackend::texture_request`] now asks for a smaller one.
    TooLarge,
    /// The backend cannot help: the caller must compute the diagram itself.
    Unavailable,
}
