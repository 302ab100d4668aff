//! Colours of places from an orthophoto: a GeoTIFF with bands of eight bits, in tiles or strips.
//!
//! The crate `tiff` reads the container, and DEFLATE and LZW; `zune-jpeg` reads JPEG. Both are used without code for single processors, so that
//! a picture has the same bytes everywhere. They may panic on hostile data, so every call is wrapped in [`sys::catch_panic::catch_panic`].

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod bands;
mod chunks;
mod errors;
mod georeference;
mod image;
mod jpeg;
mod photo;
#[cfg(test)]
mod tests;

pub use errors::require_file;
pub use image::PictureBytes;
pub use photo::Orthophoto;
