//! Where the children of a tile lie along one of its axes.

use crate::mesh::LAST;
use crate::scheme::Scheme;
use crate::tile::Tile;

/// The parts that the side of a tile is divided into.
const WHOLE: u64 = 1 << 31;

/// The two halves of a side. Each is linear in its own steps, and they need not be as long as each other: in web mercator the half nearer to the equator
/// is longer. All tiles in a row have the same halves, so that neighbours do the same with a vertex that they share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Halves {
    /// Where they meet: so many of [`WHOLE`] from the west or the south.
    middle: u64,
}

impl Halves {
    /// Returns the halves of the sides along both axes.
    pub(crate) fn of(tile: Tile) -> [Halves; 2] {
        let even = Halves { middle: WHOLE / 2 };
        match tile.scheme {
            Scheme::Geographic => [even; 2],
            Scheme::WebMercator => [even, Halves { middle: (northern_share(tile) * WHOLE as f64 + 0.5) as u64 }],
        }
    }

    /// Tells whether vertices stay in the order of the Z-order curve.
    pub(crate) fn are_even(self) -> bool {
        self.middle == WHOLE / 2
    }

    /// Returns where a vertex of a child lies in its parent, if it lies on the border of that. Only what lies at a corner comes to lie there.
    pub(crate) fn on_border(self, steps: u16, half: u8) -> u16 {
        let place = self.place(steps, half, LAST.into());
        let is_end = (steps, half) == (0, 0) || (steps, half) == (LAST, 1);
        if is_end { place } else { place.clamp(1, LAST - 1) }
    }

    /// Returns where it lies otherwise: not on the border. Vertices stay in order, but for a few that would be on the border.
    pub(crate) fn inside(self, steps: u16, half: u8) -> u16 {
        // So that the first half has as many places as the second, from 0 on.
        self.place(steps, half, u64::from(LAST) + 1).clamp(1, LAST - 1)
    }

    fn place(self, steps: u16, half: u8, whole: u64) -> u16 {
        let steps = u64::from(steps);
        let place = if half == 0 { steps * self.middle } else { whole * self.middle + steps * (WHOLE - self.middle) };
        (place / WHOLE) as u16
    }
}

/// Returns how far north the children of a tile meet, as a share of its height.
fn northern_share(tile: Tile) -> f64 {
    let border = |zoom: u8, row: i32| tile.scheme.latitude(zoom, row);
    let [south, north] = [tile.y, tile.y + 1].map(|row| border(tile.zoom, row));
    (border(tile.zoom + 1, 2 * tile.y + 1) - south) / (north - south)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The halves of equal length, as they are written down without shares.
    #[test]
    fn even_halves_halve() {
        let [even, _] = Halves::of(Tile { scheme: Scheme::Geographic, zoom: 9, x: 3, y: 7 });
        for steps in 0..=LAST {
            for half in 0..2u8 {
                let doubled = u32::from(steps) + u32::from(half) * u32::from(LAST);
                let halved = (doubled / 2) as u16;
                let is_end = doubled == 0 || doubled == 2 * u32::from(LAST);
                assert_eq!(even.on_border(steps, half), if is_end { halved } else { halved.clamp(1, LAST - 1) });
                let inside = (steps / 2 + u16::from(half) * LAST.div_ceil(2)).clamp(1, LAST - 1);
                assert_eq!(even.inside(steps, half), inside);
            }
        }
    }

    proptest! {
        /// A vertex stays at its latitude, but for a step of the parent, and vertices stay in order.
        #[test]
        fn latitudes_stay_in_web_mercator(zoom in 0u8..21, row in 0.0..1.0f64, steps in 0..LAST, half in 0u8..2) {
            let y = (row * f64::from(1u32 << zoom)) as i32;
            let tile = Tile { scheme: Scheme::WebMercator, zoom, x: 0, y };
            let child = Tile { zoom: zoom + 1, y: 2 * y + i32::from(half), ..tile };
            let latitude = |tile: Tile, steps: u16| {
                tile.south_west()[1] + tile.sides()[1] * f64::from(steps) / f64::from(LAST)
            };
            let [_, halves] = Halves::of(tile);
            let step = tile.sides()[1] / f64::from(LAST);
            for place in [halves.on_border(steps, half), halves.inside(steps, half)] {
                let off = (latitude(tile, place) - latitude(child, steps)) / step;
                prop_assert!(off.abs() <= 1.01, "{off}");
            }
            prop_assert!(halves.on_border(steps, half) <= halves.on_border(steps + 1, half));
            prop_assert!(halves.inside(steps, half) <= halves.inside(steps + 1, half));
            // Both children place what lies between them alike.
            prop_assert_eq!(halves.on_border(LAST, 0), halves.on_border(0, 1));
        }
    }
}
