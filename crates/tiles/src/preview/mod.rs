//! The preview: a hill-shaded picture of the whole terrain from above, with a legend, and where it is on the map.

pub mod canvas;
mod coverage;
pub mod layout;
pub mod panel;
pub mod picture;
pub mod pixel;
mod shading;
mod sliver;
mod strokes;
