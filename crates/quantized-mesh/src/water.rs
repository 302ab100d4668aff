//! Water masks: which of 256 x 256 cells of a tile have their middle in a lake.
//!
//! Shores lie on the grid of the finest zoom, as the vertices of tiles do, and all comparisons are made in whole numbers. So the mask of a tile
//! depends on the lakes and its place alone.

use crate::place::{SPAN, TileGrid};
use crate::scheme::Scheme;
use crate::tile::Tile;

/// The columns and the rows of cells in a tile.
const CELLS: i32 = 256;

/// The parts of a step that the middles of cells are whole numbers of.
const PARTS: i64 = 2 * CELLS as i64;

/// What stands for water, and for land.
const WATER: u8 = 255;
const LAND: u8 = 0;

/// An edge of the shore of a lake. A place is in a lake if a line from there crosses its shore an odd number of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shore {
    /// The number of the lake.
    pub lake: u32,
    /// Its ends: x and y on the grid of the finest zoom, as a [`GridPoint`](crate::GridPoint) has them.
    pub ends: [[i64; 2]; 2],
}

/// Cells of one row whose middles are in a lake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Span {
    /// The row of cells, from the south.
    row: i32,
    /// The first column of cells, and the first behind the last.
    columns: [i32; 2],
}

/// Where the water of a zoom is.
#[derive(Clone, Debug, Default)]
pub struct Water {
    /// In order, and apart from each other.
    spans: Vec<Span>,
}

impl Water {
    /// Returns where the water of a zoom is. The grid of `shores` is that of the zoom `finest`.
    pub fn new(scheme: Scheme, [zoom, finest]: [u8; 2], shores: &[Shore]) -> Water {
        let rows = CellRows::new(scheme, [zoom, finest], shores);
        let width = SPAN << (finest - zoom);
        let mut crossings: Vec<(i32, u32, i32)> = Vec::new();
        for shore in shores {
            rows.crossed_by(shore, |row, y| crossings.push((row, shore.lake, column_behind(shore, y, width))));
        }
        crossings.sort_unstable();
        let of_lakes = crossings.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
        let in_lakes = of_lakes.flat_map(|crossings| crossings.as_chunks::<2>().0);
        let spans = in_lakes.map(|[from, to]| Span { row: from.0, columns: [from.2, to.2] });
        Water { spans: united(spans.filter(|span| span.columns[0] < span.columns[1]).collect()) }
    }

    /// Returns the mask of a tile of the zoom: one number if it is the same everywhere, else the numbers of all cells, from the north-west on, row by
    /// row.
    pub(crate) fn mask(&self, tile: Tile) -> Vec<u8> {
        // A tile around the globe has what lies beyond the 180th meridian too.
        let turns = if tile.scheme.columns(tile.zoom) == 1 { -1..=1 } else { 0..=0 };
        let mut cells = vec![LAND; (CELLS * CELLS) as usize];
        let (mut count, south) = (0, tile.y * CELLS);
        let first = self.spans.partition_point(|span| span.row < south);
        for span in self.spans[first..].iter().take_while(|span| span.row < south + CELLS) {
            let from_north = (south + CELLS - 1 - span.row) * CELLS;
            for turn in turns.clone() {
                let west = (tile.x + turn) * CELLS;
                let [from, to] =
                    span.columns.map(|column| (column.clamp(west, west + CELLS) - west + from_north) as usize);
                cells[from..to].fill(WATER);
                count += to - from;
            }
        }
        match count {
            0 => vec![LAND],
            all if all == cells.len() => vec![WATER],
            _ => cells,
        }
    }
}

/// Tells whether bytes are the mask of a tile.
pub(crate) fn is_mask(bytes: &[u8]) -> bool {
    (bytes.len() == 1 || bytes.len() == (CELLS * CELLS) as usize)
        && bytes.iter().all(|cell| [LAND, WATER].contains(cell))
}

/// The rows of cells that shores may cross.
struct CellRows {
    /// The number of the first.
    first: i32,
    /// The y of their middles, in parts of a step of the finest zoom.
    middles: Vec<i64>,
}

impl CellRows {
    fn new(scheme: Scheme, [zoom, finest]: [u8; 2], shores: &[Shore]) -> CellRows {
        let ends = || shores.iter().flat_map(|shore| shore.ends.map(|[_, y]| y));
        let (Some(south), Some(north)) = (ends().min(), ends().max()) else {
            return CellRows { first: 0, middles: Vec::new() };
        };
        let [south, north] = [south, north].map(|y| (y.div_euclid(SPAN) >> (finest - zoom)) as i32);
        let mut grid = TileGrid::new(scheme, finest);
        let middles = (south..=north).flat_map(|row| {
            let [low, high] = [row, row + 1].map(|row| scheme.latitude(zoom, row));
            let middle = move |cell: i32| low + (high - low) * (f64::from(2 * cell + 1) / PARTS as f64);
            (0..CELLS).map(middle)
        });
        CellRows { first: south * CELLS, middles: middles.map(|latitude| grid.y(latitude, PARTS)).collect() }
    }

    /// Calls `found` with each row whose middle line a shore crosses, and the y of that. The lower end of a shore belongs to it, the upper one does
    /// not.
    fn crossed_by(&self, shore: &Shore, mut found: impl FnMut(i32, i64)) {
        let [a, b] = shore.ends.map(|[_, y]| y * PARTS);
        let from = self.middles.partition_point(|middle| *middle < a.min(b));
        let crossed = self.middles[from..].iter().take_while(|middle| **middle < a.max(b));
        (self.first + from as i32..).zip(crossed).for_each(|(row, y)| found(row, *y));
    }
}

/// Returns the first column of cells whose middle is not west of where a shore crosses a row, in tiles so many steps wide.
fn column_behind(shore: &Shore, y: i64, width: i64) -> i32 {
    let [low, high] = if shore.ends[0][1] < shore.ends[1][1] { shore.ends } else { [shore.ends[1], shore.ends[0]] };
    let [dx, dy] = [0, 1].map(|axis: usize| i128::from(high[axis] - low[axis]));
    let parts = i128::from(PARTS);
    // So many parts of a step east of zero it crosses, times `dy`.
    let crossing = i128::from(low[0]) * parts * dy + dx * (i128::from(y) - i128::from(low[1]) * parts);
    // The middle of a column lies `(2 * column + 1) * width` parts of a step east.
    let width = i128::from(width) * dy;
    -(width - crossing).div_euclid(2 * width) as i32
}

/// Joins spans that overlap or touch.
fn united(mut spans: Vec<Span>) -> Vec<Span> {
    spans.sort_unstable();
    spans.dedup_by(|next, known| {
        let is_joined = next.row == known.row && next.columns[0] <= known.columns[1];
        if is_joined {
            known.columns[1] = known.columns[1].max(next.columns[1]);
        }
        is_joined
    });
    spans
}
