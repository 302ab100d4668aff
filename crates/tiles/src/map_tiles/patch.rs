//! Where the pixels of a tile lie on the raster.
//!
//! A projection of every pixel would take longer than all the rest. A patch of pixels is projected at nine places, and a polynomial of
//! the second degree along each axis goes through them. Four more places prove that it is good enough; else the patch is cut.

use crate::map_tiles::PixelWay;

/// A place may be so many cells off.
const TOLERANCE: f64 = 1.0 / 65_536.0;

/// A square of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Patch {
    /// The pixel in the north-west.
    pub(crate) first: [f64; 2],
    /// Pixels along the side.
    pub(crate) side: usize,
}

impl Patch {
    /// Returns the columns and rows on the raster of all pixels, row by row; `None` if the patch must be cut, or its only pixel lies
    /// nowhere.
    pub(crate) fn places(self, way: &PixelWay) -> Option<Vec<[f64; 2]>> {
        if self.side == 1 {
            return Some(vec![way(self.first)?]);
        }
        let length = (self.side - 1) as f64;
        let exact = |t: [f64; 2]| way([0, 1].map(|axis| self.first[axis] + length * t[axis]));
        let mut nodes = [[[0.0; 2]; 3]; 3];
        for (row, nodes) in nodes.iter_mut().enumerate() {
            for (column, node) in nodes.iter_mut().enumerate() {
                *node = exact([column, row].map(|n| n as f64 / 2.0))?;
            }
        }
        for t in [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]] {
            let (place, found) = (exact(t)?, Row::of(&nodes, t[1]).at(t[0]));
            if (0..2).any(|axis| (place[axis] - found[axis]).abs() > TOLERANCE) {
                return None;
            }
        }
        let mut places = Vec::with_capacity(self.side * self.side);
        for row in 0..self.side {
            let line = Row::of(&nodes, row as f64 / length);
            places.extend((0..self.side).map(|column| line.at(column as f64 / length)));
        }
        Some(places)
    }

    /// Returns the four quarters.
    pub(crate) fn quarters(self) -> [Patch; 4] {
        let side = self.side / 2;
        [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
            .map(|quarter| Patch { first: [0, 1].map(|axis| self.first[axis] + quarter[axis] * side as f64), side })
    }
}

/// The polynomials of a row of pixels, for both axes of the raster: the coefficients of the powers 0, 1 and 2.
struct Row([[f64; 3]; 2]);

impl Row {
    /// Returns the row at `t`, from 0 in the first row of `nodes` to 1 in the last.
    fn of(nodes: &[[[f64; 2]; 3]; 3], t: f64) -> Row {
        let weights = [2.0 * (t - 0.5) * (t - 1.0), 4.0 * t * (1.0 - t), 2.0 * t * (t - 0.5)];
        Row([0, 1].map(|axis| {
            let [first, middle, last] =
                [0, 1, 2].map(|k| (0..3).fold(0.0, |sum, row| sum + weights[row] * nodes[row][k][axis]));
            [first, 4.0 * middle - 3.0 * first - last, 2.0 * (first - 2.0 * middle + last)]
        }))
    }

    fn at(&self, t: f64) -> [f64; 2] {
        self.0.map(|[constant, slope, curve]| constant + t * (slope + t * curve))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_those_of_the_way_within_the_tolerance() {
        // A turned map that bends like one of the earth with cells of a hundred metres.
        let way = |[x, y]: [f64; 2]| {
            let [x, y] = [x - 1e6, y - 2e6];
            let bend = 1e-5 * x * y + 3e-6 * y * y + 1e-10 * x * x * y;
            Some([0.8 * x + 0.3 * y + bend, 0.8 * y - 0.3 * x - 0.7 * bend])
        };
        let patch = Patch { first: [1e6, 2e6], side: 128 };
        let places = patch.places(&way).unwrap();
        for (n, place) in places.iter().enumerate() {
            let exact = way([1e6 + (n % 128) as f64, 2e6 + (n / 128) as f64]).unwrap();
            assert!((0..2).all(|axis| (place[axis] - exact[axis]).abs() < 1.2 * TOLERANCE), "{n}");
        }
        let steep = |[x, y]: [f64; 2]| Some([x * x * x * 1e-4, y]);
        assert!(Patch { first: [0.0; 2], side: 128 }.places(&steep).is_none());
        assert_eq!(Patch { first: [3.0, 4.0], side: 1 }.places(&steep), Some(vec![steep([3.0, 4.0]).unwrap()]));
    }

    #[test]
    fn a_patch_with_a_place_that_is_nowhere_is_cut() {
        let way = |[x, y]: [f64; 2]| (x < 100.0).then_some([x, y]);
        let patch = Patch { first: [64.0, 0.0], side: 64 };
        assert!(patch.places(&way).is_none());
        let quarters = patch.quarters();
        assert_eq!(quarters[3], Patch { first: [96.0, 32.0], side: 32 });
        assert!(quarters[0].places(&way).is_some() && quarters[1].places(&way).is_none());
    }
}
