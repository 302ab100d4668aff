//! `contours.dxf`: each line as a polyline with its elevation, on a layer for index contours or on that for others.

use crate::durable::atomic_file::{PendingFile, PendingWriter};
use crate::plan::job_plan::Plan;
use crate::publish::exports::write_exports::length_unit;
use crate::publish::raster::tile_meshes::TileBox;
use delaunay::geometry::Bounds;
use exports::Place;
use exports::dxf::{DxfHead, DxfWriter, Layer, push_polyline_2d};
use std::path::Path;
use sys::{Error, Result};
use tiles::contour_options::ContourHeight;
use tiles::frame::Frame;

const CONTOURS: Layer = Layer { name: "CONTOURS", color: 8 };
const INDEX_CONTOURS: Layer = Layer { name: "CONTOURS_INDEX", color: 1 };

/// A point of a line.
struct Point([f64; 2]);

impl Place for Point {
    fn push(&self, axis: usize, out: &mut Vec<u8>) {
        // Lines are flat, so z is never asked for.
        out.extend_from_slice(self.0.get(axis).copied().unwrap_or_default().to_string().as_bytes());
    }
}

/// Returns a line as the drawing has it. In that of a ring the first point does not come again.
pub(super) fn drawn(points: &[[f64; 2]], is_closed: bool, height: ContourHeight) -> Vec<u8> {
    let layer = if height.is_index { &INDEX_CONTOURS } else { &CONTOURS };
    let points = if is_closed { points.split_last().map_or(points, |(_, others)| others) } else { points };
    let places: Vec<Point> = points.iter().copied().map(Point).collect();
    let mut bytes = Vec::new();
    push_polyline_2d(layer, &height.number.to_string(), &places, is_closed, &mut bytes);
    bytes
}

/// The drawing while it is being written.
pub(super) struct ContourDrawing(PendingWriter);

impl ContourDrawing {
    /// Begins the drawing at `path`.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn create(plan: &Plan, frame: &Frame, tiles: &[TileBox], path: &Path) -> Result<ContourDrawing> {
        let mut file = PendingWriter::create(path)?;
        let nowhere = || Error::Broken("there is no tile to draw contour lines of".into());
        let bounds = tiles.iter().map(|tile| tile.bounds).reduce(Bounds::union).ok_or_else(nowhere)?;
        let heights = tiles.iter().map(|tile| tile.heights);
        let [low, high] = heights.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]).ok_or_else(nowhere)?;
        let corner = |[x, y]: [i32; 2], z: i32| {
            let axis = |axis: usize, at: i32| plan.lattice.world_text(axis, at);
            [axis(0, x), axis(1, y), axis(2, z)]
        };
        let corners = [corner(bounds.min, low), corner(bounds.max, high)];
        let extents = corners.each_ref().map(|corner| corner.each_ref().map(String::as_str));
        let copyright = plan.options.output.copyright().map(String::from);
        let head = DxfHead {
            comments: &copyright.into_iter().collect::<Vec<String>>(),
            unit: length_unit(frame),
            extents,
            layers: &[CONTOURS, INDEX_CONTOURS],
        };
        DxfWriter::begin(&head, &mut |bytes: &[u8]| file.write(bytes))?;
        Ok(ContourDrawing(file))
    }

    /// Adds a line.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn add(&mut self, line: &[u8]) -> Result<()> {
        self.0.write(line)
    }

    /// Ends the drawing.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn finish(mut self) -> Result<PendingFile> {
        DxfWriter::continued(&mut |bytes: &[u8]| self.0.write(bytes)).end()?;
        self.0.finish()
    }
}
