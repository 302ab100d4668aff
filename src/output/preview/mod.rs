//! The preview: a hill-shaded picture of the whole terrain from above, with a legend, and where it is on the map.

pub mod canvas;
pub mod layout;
pub mod panel;
pub mod picture;
mod sliver;
mod strokes;
