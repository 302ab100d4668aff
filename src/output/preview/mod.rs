//! The preview: a hill-shaded picture of the whole terrain from above.

pub mod canvas;
pub mod picture;
