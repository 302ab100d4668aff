//! What breaklines do to the points: those that lie at a line or in a lake are dropped, and the sites of the lines come in their place.

use crate::partition::bucket_sorter::BucketSorter;
use crate::partition::buckets::Buckets;
use crate::partition::grid::Grid;
use crate::plan::job_plan::Plan;
use breaklines::{BreaklineSite, Breaklines, FeatureKind};
use delaunay::geometry::Site;
use points::Point;
use points::surface::SurfaceShares;
use sys::Result;
use tiles::color::class_color;

/// Sites go to the buckets so many at a time.
const SLICE: usize = 1 << 12;

/// Leaves out the points that make room for breaklines. One thread filters a chunk with it.
pub(crate) struct BreaklineFilter<'a> {
    lines: Option<&'a Breaklines>,
    kept: Vec<Point>,
    dropped: SurfaceShares,
}

impl<'a> BreaklineFilter<'a> {
    pub(crate) fn new(lines: Option<&'a Breaklines>) -> BreaklineFilter<'a> {
        BreaklineFilter { lines, kept: Vec::new(), dropped: SurfaceShares::default() }
    }

    /// Returns the points that stay, in their order.
    pub(crate) fn without_dropped<'b>(&'b mut self, points: &'b [Point]) -> &'b [Point] {
        let Some(lines) = self.lines else { return points };
        self.kept.clear();
        for point in points {
            if lines.drops(point.position) {
                self.dropped.add_wanted(point.class);
            } else {
                self.kept.push(*point);
            }
        }
        &self.kept
    }

    /// Returns how many points were left out, of which kinds.
    pub(crate) fn dropped(&self) -> SurfaceShares {
        self.dropped
    }
}

/// Adds the sites of lines at the places that `is_wanted` to the buckets of `grid`. The greatest colour of the points is `max_rgb`.
///
/// # Errors
/// Those of the buckets, and of [`Plan::built_breaklines`].
pub(crate) fn add_line_sites(
    plan: &Plan,
    max_rgb: u16,
    grid: &Grid,
    buckets: &Buckets,
    is_wanted: impl Fn(Site) -> bool,
) -> Result<()> {
    let Some(lines) = plan.built_breaklines()? else { return Ok(()) };
    // Points have the numbers below.
    let sites = (plan.records..).zip(lines.sites()).filter(|(_, site)| is_wanted(site.place));
    let (mut sorter, mut slice) = (BucketSorter::new(grid, buckets), Vec::with_capacity(SLICE));
    for (order, site) in sites {
        slice.push(point_of(site, order, max_rgb));
        if slice.len() == SLICE {
            sorter.add(&slice)?;
            slice.clear();
        }
    }
    sorter.add(&slice)
}

/// Returns a site as a point. A line has no class and no colour of its own: banks and shores are water, other lines are ground, and where
/// points have colours, these have the colour of their class.
fn point_of(site: &BreaklineSite, order: u64, max_rgb: u16) -> Point {
    const GROUND: u8 = 2;
    const WATER: u8 = 9;
    let class = match site.kind {
        FeatureKind::Lake | FeatureKind::River => WATER,
        FeatureKind::Line => GROUND,
    };
    let rgb = match max_rgb {
        0 => [0; 3],
        1..=255 => class_color(class).map(u16::from),
        // 255 becomes 65535.
        _ => class_color(class).map(|value| u16::from(value) * 257),
    };
    Point::new(site.place, site.z.unwrap_or_default(), rgb, class, order)
}
