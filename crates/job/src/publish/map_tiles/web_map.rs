//! How the raster of a job lies on a web map: the way between its cells and pixels, the finest zoom, and the tiles that it may meet.

use crate::plan::globe_system::globe_way;
use crs::{Crs, GlobeWay};
use std::f64::consts::PI;
use std::ops::Range;
use tiles::map_tiles::TILE;
use tiles::map_tiles::tile_id::MapTile;
use tiles::map_tiles::web_mercator::{NORTHMOST, geographic, on_map};
use tiles::raster::grid::RasterGrid;

/// No map that is shown in a browser is finer: a pixel is 5 mm wide at the equator.
const FINEST: u8 = 24;

/// The raster is looked at in so many places along each side, and between.
const PLACES: u32 = 33;

/// An edge between two of these places bends by less than this share of the extent.
const BEND: f64 = 1.0 / 256.0;

/// Cells that a place may be off after it has been to the globe and back.
const OFF: f64 = 0.01;

const DEGREES: f64 = 180.0 / PI;

/// A raster on a web map.
pub(crate) struct WebMap {
    way: GlobeWay,
    /// The x of the western and the y of the northern edge of the raster.
    corner: [f64; 2],
    cell: f64,
    /// The longitude of the middle in radians. Others are taken within half a turn of it.
    middle: f64,
    /// What is added to longitudes before they go to the projection: whole turns.
    turn: f64,
    /// The finest zoom.
    pub(crate) max_zoom: u8,
    /// The columns of tiles of this zoom that the raster may meet. Beyond the 180th meridian they count on.
    columns: Range<i64>,
    rows: Range<i64>,
    /// West, south, east and north in degrees.
    pub(crate) bounds: [f64; 4],
}

impl WebMap {
    /// Returns how `grid`, with coordinates of `crs` in units of `metres`, lies on the map.
    ///
    /// # Errors
    /// A sentence if it does not lie there.
    pub(crate) fn of(crs: &Crs, metres: f64, grid: &RasterGrid) -> Result<WebMap, String> {
        let way = globe_way(crs, metres)
            .map_err(|why| format!("{why}; name the CRS of the points with [input] crs, or leave pmtiles out"))?;
        let mut map = WebMap {
            way,
            corner: grid.corner(),
            cell: grid.cell_size(),
            middle: 0.0,
            turn: 0.0,
            max_zoom: 0,
            columns: 0..0,
            rows: 0..0,
            bounds: [0.0; 4],
        };
        let size = grid.size();
        let middle = size.map(|cells| f64::from(cells) / 2.0);
        map.middle = map.globe(middle)?[0];
        map.turn = map.turn_of_projection(middle, crs)?;
        map.max_zoom = map.zoom_of_cells(middle)?;
        map.find_extent(size)?;
        Ok(map)
    }

    /// Returns longitude and latitude in radians of a place in cells from the corner of the raster. They are within half a turn of the
    /// middle.
    fn globe(&self, cells: [f64; 2]) -> Result<[f64; 2], String> {
        let [west, north] = self.corner;
        let place = [west + cells[0] * self.cell, north - cells[1] * self.cell];
        let found = self.way.geographic(place);
        let [longitude, latitude] = found.ok_or_else(|| {
            format!(
                "the projection of the CRS has no longitude and latitude at ({}, {}); fix: narrower [input] bounds",
                place[0], place[1]
            )
        })?;
        Ok([near(longitude, self.middle), latitude])
    }

    /// Returns the whole turns that lead longitudes near the middle to where the projection has the raster: a map that reaches across the
    /// 180th meridian counts on there.
    fn turn_of_projection(&self, middle: [f64; 2], crs: &Crs) -> Result<f64, String> {
        let [longitude, latitude] = self.globe(middle)?;
        let is_there = |turn: &f64| {
            let back = self.way.place([longitude + turn, latitude]).map(|place| self.edges_to(place));
            back.is_some_and(|back| (0..2).all(|axis| (back[axis] - middle[axis]).abs() < OFF))
        };
        let turn = [0.0, -2.0 * PI, 2.0 * PI].into_iter().find(is_there);
        turn.ok_or_else(|| {
            format!(
                "gdt-batch cannot transform longitude and latitude back to {}; transform the points to a UTM zone with [input] to_crs \
                 = \"utm\"",
                crs.label()
            )
        })
    }

    /// Returns a place of the CRS in cells from the corner.
    fn edges_to(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.corner[0]) / self.cell, (self.corner[1] - y) / self.cell]
    }

    /// Returns the zoom whose pixels have about the size of cells around a place: between 0.71 and 1.41 of it.
    fn zoom_of_cells(&self, [column, row]: [f64; 2]) -> Result<u8, String> {
        let place = |column: f64, row: f64| self.globe([column, row]).map(on_map);
        let difference = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|axis| (b[axis] - a[axis]) / 2.0);
        let east = difference(place(column - 1.0, row)?, place(column + 1.0, row)?);
        let south = difference(place(column, row - 1.0)?, place(column, row + 1.0)?);
        let area = (east[0] * south[1] - east[1] * south[0]).abs();
        let is_fine = |zoom: &u8| {
            let pixel = 1.0 / (TILE as f64 * tiles_along(*zoom));
            pixel * pixel <= 2.0 * area
        };
        Ok((0..FINEST).find(is_fine).unwrap_or(FINEST))
    }

    /// Finds the extent of the raster on the globe and on the map.
    fn find_extent(&mut self, size: [u32; 2]) -> Result<(), String> {
        let mut globe = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for n in 0..PLACES * PLACES {
            let share = [n % PLACES, n / PLACES].map(|k| f64::from(k) / f64::from(PLACES - 1));
            let place = self.globe([0, 1].map(|axis| share[axis] * f64::from(size[axis])))?;
            for axis in 0..2 {
                globe[0][axis] = globe[0][axis].min(place[axis]);
                globe[1][axis] = globe[1][axis].max(place[axis]);
            }
        }
        let [[west, south], [east, north]] = globe;
        let poleward = if north > -south { north } else { south };
        if poleward.abs() > NORTHMOST {
            return Err(format!(
                "the raster reaches to latitude {:.2}, and web maps end at 85.05 degrees; fix: narrower [input] bounds",
                poleward * DEGREES
            ));
        }
        let [north_west, south_east] = [on_map([west, north]), on_map([east, south])];
        let along = tiles_along(self.max_zoom);
        let range = |axis: usize| {
            let bend = (south_east[axis] - north_west[axis]) * BEND;
            // The conversions keep within the type.
            let [first, last] =
                [north_west[axis] - bend, south_east[axis] + bend].map(|at| (at * along).floor() as i64);
            first..last + 1
        };
        (self.columns, self.rows) = (range(0), range(1));
        let [west, east] = match west < -PI || east > PI {
            true => [-PI, PI],
            false => [west, east],
        };
        self.bounds = [west, south, east, north].map(|angle| angle * DEGREES);
        Ok(())
    }

    /// Returns the column and the row of a pixel of the finest zoom, where whole numbers are centres of pixels and of cells; `None` where
    /// the CRS has no such place.
    pub(crate) fn cell_of_pixel(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let pixels = TILE as f64 * tiles_along(self.max_zoom);
        let [longitude, latitude] = geographic(pixel.map(|at| (at + 0.5) / pixels));
        let place = self.way.place([near(longitude, self.middle) + self.turn, latitude])?;
        Some(self.edges_to(place).map(|cells| cells - 0.5))
    }

    /// Tells whether the raster may meet a tile.
    pub(crate) fn may_meet(&self, tile: MapTile) -> bool {
        let below = self.max_zoom - tile.zoom;
        let span = |at: u32| (i64::from(at) << below)..((i64::from(at) + 1) << below);
        let meet = |a: &Range<i64>, b: &Range<i64>, turn: i64| a.start < b.end + turn && b.start + turn < a.end;
        let turn = 1 << self.max_zoom;
        let columns = span(tile.x);
        meet(&self.rows, &span(tile.y), 0) && [-turn, 0, turn].iter().any(|turn| meet(&self.columns, &columns, *turn))
    }

    /// Returns the number of tiles of the finest zoom that the raster may meet.
    pub(crate) fn finest_tiles(&self) -> u64 {
        let whole = 1 << self.max_zoom;
        let columns = (self.columns.end - self.columns.start).min(whole);
        let rows = self.rows.end.min(whole) - self.rows.start.max(0);
        (columns * rows).max(0) as u64
    }

    /// Returns the number of their pixels.
    pub(crate) fn pixels(&self) -> u64 {
        self.finest_tiles() * (TILE * TILE) as u64
    }

    /// Returns the finest zoom in which the raster fits a window of two tiles along each side.
    pub(crate) fn center_zoom(&self) -> u8 {
        let [west, south, east, north] = self.bounds.map(|degrees| degrees / DEGREES);
        let ([left, top], [right, bottom]) = (on_map([west, north]), on_map([east, south]));
        let extent = (right - left).max(bottom - top);
        (0..self.max_zoom).rev().find(|zoom| extent * tiles_along(*zoom) <= 2.0).unwrap_or(0)
    }
}

/// Returns the number of tiles along a side of the map.
fn tiles_along(zoom: u8) -> f64 {
    // The conversion is exact.
    (1u64 << zoom) as f64
}

/// Returns a longitude within half a turn of `middle`, in radians. Both are within a turn and a half of it.
fn near(longitude: f64, middle: f64) -> f64 {
    let off = longitude - middle;
    if off > PI {
        longitude - 2.0 * PI
    } else if off < -PI {
        longitude + 2.0 * PI
    } else {
        longitude
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::from_wkt::from_epsg;
    use delaunay::geometry::Bounds;
    use lattice::Lattice;
    use rust_decimal::Decimal;
    use tiles::raster::grid::{CellAlignment, CellLimit};

    /// Returns how a raster of `size` meters around a place lies on the map, with cells of so many thousandths.
    fn map(code: u32, [x, y]: [i64; 2], size: i32, thousandths: i64) -> Result<WebMap, String> {
        let lattice = Lattice::new([x, y, 0].map(Decimal::from), Decimal::ONE, Decimal::ONE).unwrap();
        let alignment = CellAlignment { origin: [Decimal::ZERO; 2], resolution: Decimal::new(thousandths, 3) };
        let bounds = Bounds { min: [-size / 2; 2], max: [size / 2; 2] };
        let grid = RasterGrid::new(&lattice, alignment, bounds, CellLimit::OneFile).unwrap();
        let crs = from_epsg(code).unwrap();
        WebMap::of(&crs, crs.metres_per_unit().unwrap(), &grid)
    }

    /// Asserts that pixels lie where the raster is, and that tiles around them are looked at.
    #[track_caller]
    fn leads_to_cells(map: &WebMap, size: f64) {
        let place = map.globe([size / 3.0, size / 4.0]).unwrap();
        let pixels = on_map(place).map(|at| at * tiles_along(map.max_zoom) * TILE as f64);
        let cell = map.cell_of_pixel(pixels.map(|at| at - 0.5)).unwrap();
        for (cell, expected) in cell.iter().zip([size / 3.0, size / 4.0]) {
            assert!((cell + 0.5 - expected).abs() < 1e-3, "{cell} {expected}");
        }
        let whole = 1i64 << map.max_zoom;
        for zoom in 0..=map.max_zoom {
            let [x, y] = pixels.map(|at| (at / TILE as f64).floor() as i64);
            let [x, y] = [x.rem_euclid(whole), y].map(|at| (at >> (map.max_zoom - zoom)) as u32);
            assert!(map.may_meet(MapTile { zoom, x, y }), "{zoom}");
        }
    }

    #[test]
    fn the_finest_zoom_has_pixels_like_cells() {
        // A pixel of zoom 16 is 1.19 m at the equator, and half of it at 60 degrees.
        for (code, place, thousandths, zoom) in [
            (32631, [500_000, 0], 1000, 16),
            (32631, [500_000, 6_650_000], 1000, 15),
            (32631, [500_000, 0], 1600, 16),
            (32631, [500_000, 0], 1800, 15),
            (32631, [500_000, 0], 1, 24),
            // Feet.
            (2994, [640_000, 850_000], 3281, 16),
            // Pixels of web Mercator are metres at the equator alone.
            (3857, [0, 8_400_000], 1194, 16),
        ] {
            let map = map(code, place, 100, thousandths).unwrap();
            assert_eq!(map.max_zoom, zoom, "{code} {place:?} {thousandths}");
        }
    }

    #[test]
    fn pixels_lead_to_cells() {
        for (code, place) in [
            (32631, [500_000, 5_500_000]),
            (2056, [2_683_000, 1_247_000]),
            (27700, [530_000, 180_000]),
            (3857, [1_500_000, -6_000_000]),
            (2994, [640_000, 850_000]),
            (3338, [50_000, 1_200_000]),
        ] {
            let map = map(code, place, 4000, 1000).unwrap();
            leads_to_cells(&map, 4001.0);
            assert!(!map.may_meet(MapTile { zoom: map.max_zoom, x: 0, y: 0 }));
            let tiles = map.finest_tiles();
            assert!((30..300).contains(&tiles), "{code}: {tiles}");
            assert!(map.center_zoom() < map.max_zoom && map.center_zoom() > 8);
        }
    }

    #[test]
    fn the_180th_meridian_is_no_edge() {
        // West of it, across it, and where Alaska's map counts on beyond it.
        for (code, place) in
            [(32660, [833_000, 100_000]), (3338, [-2_200_000, 500_000]), (2193, [2_560_000, 5_000_000])]
        {
            let map = map(code, place, 30_000, 100_000).unwrap();
            leads_to_cells(&map, 301.0);
        }
        let map = map(32660, [833_950, 100_000], 30_000, 100_000).unwrap();
        let whole = (1 << map.max_zoom) - 1;
        let row = map.rows.start as u32;
        for x in [0, whole] {
            assert!(map.may_meet(MapTile { zoom: map.max_zoom, x, y: row }), "{x}");
        }
        assert_eq!([map.bounds[0], map.bounds[2]], [-180.0, 180.0]);
    }

    #[test]
    fn what_has_no_place_on_the_map_is_refused() {
        let pole = map(3413, [0, 0], 20_000, 10_000).err().unwrap();
        assert!(pole.contains("latitude 90.00") && pole.contains("85.05"), "{pole}");
        assert!(map(3413, [0, -1_500_000], 20_000, 10_000).is_ok());
        let lattice = Lattice::new([Decimal::ZERO; 3], Decimal::ONE, Decimal::ONE).unwrap();
        let alignment = CellAlignment { origin: [Decimal::ZERO; 2], resolution: Decimal::ONE };
        let bounds = Bounds { min: [0; 2], max: [10; 2] };
        let grid = RasterGrid::new(&lattice, alignment, bounds, CellLimit::OneFile).unwrap();
        let unknown = WebMap::of(&Crs::default(), 1.0, &grid).err().unwrap();
        assert!(
            unknown.contains("no input names its coordinate system") && unknown.contains("[input] crs"),
            "{unknown}"
        );
    }
}
