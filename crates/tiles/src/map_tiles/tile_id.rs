//! The numbers of tiles in a PMTiles archive: by zoom, and within a zoom along Hilbert's curve.

/// A tile of a web map: column `x` from the west and row `y` from the north, of 2^`zoom` each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapTile {
    /// 0 has one tile for the world. At most 31.
    pub zoom: u8,
    /// The column.
    pub x: u32,
    /// The row.
    pub y: u32,
}

impl MapTile {
    /// The tile of the whole world.
    pub const WORLD: MapTile = MapTile { zoom: 0, x: 0, y: 0 };

    /// Returns the number of the tile.
    pub fn id(self) -> u64 {
        let side = 1u64 << self.zoom;
        let before = (side * side - 1) / 3;
        let (mut x, mut y, mut along) = (u64::from(self.x), u64::from(self.y), 0);
        for bit in (0..self.zoom).rev() {
            let [right, low] = [x, y].map(|place| place >> bit & 1);
            along += ((3 * right) ^ low) << (2 * bit);
            if low == 0 {
                if right == 1 {
                    (x, y) = (side - 1 - x, side - 1 - y);
                }
                (x, y) = (y, x);
            }
        }
        before + along
    }

    /// Returns the four tiles of the next zoom: north-west, north-east, south-west, south-east.
    pub fn children(self) -> [MapTile; 4] {
        [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[east, south]| MapTile {
            zoom: self.zoom + 1,
            x: 2 * self.x + east,
            y: 2 * self.y + south,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_other_programs() {
        for (zoom, x, y, id) in [
            (0, 0, 0, 0),
            (1, 0, 0, 1),
            (1, 0, 1, 2),
            (1, 1, 1, 3),
            (1, 1, 0, 4),
            (2, 0, 0, 5),
            (2, 1, 1, 7),
            (12, 3423, 1763, 19_078_479),
        ] {
            assert_eq!(MapTile { zoom, x, y }.id(), id, "{zoom}/{x}/{y}");
        }
    }

    #[test]
    fn neighbours_in_number_are_neighbours_on_the_map() {
        const ZOOM: u8 = 6;
        let mut tiles: Vec<MapTile> =
            (0..1 << (2 * ZOOM)).map(|n| MapTile { zoom: ZOOM, x: n % 64, y: n / 64 }).collect();
        tiles.sort_by_key(|tile| tile.id());
        assert_eq!(tiles[0].id(), 1365);
        for pair in tiles.windows(2) {
            assert_eq!(pair[1].id(), pair[0].id() + 1);
            assert_eq!(pair[0].x.abs_diff(pair[1].x) + pair[0].y.abs_diff(pair[1].y), 1);
        }
        let below = tiles[9].children().map(MapTile::id);
        let first = below.iter().min().unwrap();
        assert!(below.iter().all(|id| id - first < 4), "children follow each other");
    }
}
