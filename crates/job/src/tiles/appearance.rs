//! How the tiles of a job look, and what they are drawn on.

use crate::plan::job_plan::Plan;
use crate::tiles::max_edge::MaxEdgeRule;
use crate::tiles::style::TileStyle;
use delaunay::geometry::Bounds;
use sys::Result;
use tiles::color::HeightRange;
use tiles::preview::canvas::{Canvas, longer_side};

/// How tiles look, and what they are drawn on.
pub(crate) struct TileAppearance {
    pub(crate) style: TileStyle,
    pub(crate) canvas: Canvas,
}

impl TileAppearance {
    /// Returns the appearance of a job whose points are within `bounds`, and whose greatest colour is `max_rgb`.
    ///
    /// # Errors
    /// Those of [`TileStyle::new`].
    pub(crate) fn new(plan: &Plan, max_rgb: u16, bounds: Bounds<3>, max_edge: MaxEdgeRule) -> Result<TileAppearance> {
        let heights = plan.heights.unwrap_or(HeightRange::of(bounds));
        let style = TileStyle::new(plan, max_rgb, bounds, heights, max_edge)?;
        let canvas = Canvas::new(&style.frame, bounds, heights, longer_side());
        Ok(TileAppearance { style, canvas })
    }
}
