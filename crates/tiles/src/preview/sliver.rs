//! High, narrow triangles of the preview.

/// The borders of a high triangle in floating point. Most rows of a sliver lie between two centres, and this finds most of those rows
/// without a division. The exact edge functions decide the others.
pub(super) struct Sliver {
    /// The rows of the three corners, from above.
    rows: [f64; 3],
    /// From the first corner to the last.
    long: Border,
    /// From the first corner to the second, and from there to the last.
    short: [Border; 2],
}

/// Triangles over fewer rows are drawn without a look at their borders.
pub(super) const SLIVER_ROWS: i64 = 16;

/// A line by its column in row 0 and the columns that it moves in a row.
#[derive(Clone, Copy)]
struct Border {
    column: f64,
    slope: f64,
}

impl Border {
    fn between(a: [f64; 2], b: [f64; 2]) -> Border {
        let slope = if b[0] > a[0] { (b[1] - a[1]) / (b[0] - a[0]) } else { 0.0 };
        Border { column: a[1] - slope * a[0], slope }
    }

    fn at(self, row: f64) -> f64 {
        self.column + self.slope * row
    }
}

impl Sliver {
    /// Returns the borders of the triangle with its corners at these `places`, where the middle of the first pixel is at `center` and pixels
    /// have the side `pitch`.
    pub(super) fn new(places: [[i64; 2]; 3], center: i64, pitch: i64) -> Sliver {
        let mut corners = places.map(|p| [1, 0].map(|k| (p[k] - center) as f64 / pitch as f64));
        corners.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        let [a, b, c] = corners;
        Sliver {
            rows: corners.map(|corner| corner[0]),
            long: Border::between(a, c),
            short: [Border::between(a, b), Border::between(b, c)],
        }
    }

    /// Tells whether the triangle surely covers no centre in `row`.
    pub(super) fn misses(&self, row: i64) -> bool {
        let row = row as f64;
        let [first, second, last] = self.rows;
        // Within a row of a corner a border may be so flat that rounding moves it far.
        if row < first + 1.0 || (row - second).abs() < 1.0 || row > last - 1.0 {
            return false;
        }
        let (a, b) = (self.long.at(row), self.short[usize::from(row > second)].at(row));
        // Far more than rounding can move a border that is at least a row high. Borders lie within the corners' columns, so two more are
        // positive, and are rounded down without a call.
        let spare = 1e-4;
        let column_below = |at: f64| (at + 2.0) as i64;
        column_below(a.min(b) - spare) == column_below(a.max(b) + spare)
    }
}
