//! A grid over longitude and latitude, and what lies between its nodes.

use sys::Error;

/// How far beyond the outermost nodes a place may be, in steps: rounding moves it less.
const TOLERANCE: f64 = 1e-6;

/// The values at the nodes of a grid.
pub(super) trait NodeValues: Send + Sync {
    /// Returns the metres at a node; `None` if the grid has none there. Columns count from the west, rows from the south.
    ///
    /// # Errors
    /// [`Error::Config`] if the file is damaged; [`Error::Io`] if reading it fails.
    fn value(&self, column: u64, row: u64) -> Result<Option<f64>, Error>;
}

/// A grid, and the way to its values.
pub(super) type Nodes = (NodeGrid, Box<dyn NodeValues>);

/// Where the nodes of a grid are, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NodeGrid {
    west: f64,
    south: f64,
    /// The steps in longitude and latitude.
    steps: [f64; 2],
    columns: u64,
    rows: u64,
    /// The number of columns around the earth, if the grid goes around.
    around: Option<u64>,
}

impl NodeGrid {
    /// Returns the grid whose south-western node is at `corner` (longitude and latitude), or a sentence that says what is wrong with it.
    pub(super) fn new(corner: [f64; 2], steps: [f64; 2], [columns, rows]: [u64; 2]) -> Result<NodeGrid, String> {
        let [west, south] = corner;
        let [width, height] = [0, 1].map(|axis| [columns, rows][axis].saturating_sub(1) as f64 * steps[axis]);
        let are_numbers = corner.iter().chain(&steps).all(|value| value.is_finite());
        if !are_numbers || steps.iter().any(|step| *step <= 0.0) || columns < 2 || rows < 2 {
            return Err(format!(
                "{columns} columns and {rows} rows in steps of {} and {} degrees from {west}, {south} are no grid",
                steps[0], steps[1]
            ));
        }
        if west.abs() > 720.0 || width > 361.0 || south < -91.0 || south + height > 91.0 {
            return Err(format!(
                "the grid reaches from longitude {west} to {} and from latitude {south} to {}: it must be in degrees",
                west + width,
                south + height
            ));
        }
        let count = (360.0 / steps[0]).round();
        let goes_around = (count * steps[0] - 360.0).abs() < 1e-3 * steps[0] && columns as f64 >= count;
        Ok(NodeGrid { west, south, steps, columns, rows, around: goes_around.then_some(count as u64) })
    }

    /// Returns the bilinear value at a place in degrees; `None` if it is outside, or a node has no value that counts there.
    pub(super) fn interpolate(
        &self,
        longitude: f64,
        latitude: f64,
        values: &dyn NodeValues,
    ) -> Result<Option<f64>, Error> {
        let Some(([column, row], [east, north])) = self.cell(longitude, latitude) else { return Ok(None) };
        let next = self.around.map_or(column + 1, |around| (column + 1) % around);
        let weights = [(1.0 - east) * (1.0 - north), east * (1.0 - north), (1.0 - east) * north, east * north];
        let nodes = [(column, row), (next, row), (column, row + 1), (next, row + 1)];
        // Counted from one node, so that rounding leaves what is the same at all nodes.
        let (mut first, mut above) = (None, 0.0);
        for (weight, (column, row)) in weights.into_iter().zip(nodes) {
            if weight > 0.0 {
                let Some(value) = values.value(column, row)? else { return Ok(None) };
                above += weight * (value - *first.get_or_insert(value));
            }
        }
        Ok(first.map(|first| first + above))
    }

    /// Tells whether a place is between nodes.
    pub(super) fn covers(&self, longitude: f64, latitude: f64) -> bool {
        self.cell(longitude, latitude).is_some()
    }

    /// Returns the south-western node of the cell around a place, and how far from there the place is in steps.
    fn cell(&self, longitude: f64, latitude: f64) -> Option<([u64; 2], [f64; 2])> {
        if !longitude.is_finite() || !latitude.is_finite() {
            return None;
        }
        let turned = (longitude - self.west).rem_euclid(360.0) / self.steps[0];
        // A place at the western border may be a hair west of it.
        let east = if 360.0 / self.steps[0] - turned < TOLERANCE { 0.0 } else { turned };
        let north = (latitude - self.south) / self.steps[1];
        let columns = self.around.map_or(self.columns, |around| around + 1);
        let [(column, east), (row, north)] = [within(east, columns)?, within(north, self.rows)?];
        Some(([column, row], [east, north]))
    }

    /// Returns in words where the grid is.
    pub(super) fn extent(&self) -> String {
        if self.around.is_some() {
            return String::new();
        }
        let end = |from: f64, count: u64, step: f64| from + (count - 1) as f64 * step;
        format!(
            " (it reaches from longitude {:.3} to {:.3} and from latitude {:.3} to {:.3})",
            self.west,
            end(self.west, self.columns, self.steps[0]),
            self.south,
            end(self.south, self.rows, self.steps[1])
        )
    }
}

/// Returns the cell among `nodes` nodes in which a place is, and its share of the cell.
fn within(place: f64, nodes: u64) -> Option<(u64, f64)> {
    let last = (nodes - 1) as f64;
    if place < -TOLERANCE || place > last + TOLERANCE {
        return None;
    }
    let place = place.clamp(0.0, last);
    let cell = place.floor().min(last - 1.0);
    Some((cell as u64, place - cell))
}
