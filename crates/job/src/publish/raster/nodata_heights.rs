//! What the user should know if cells have a height that is the number for no height.

use crate::publish::raster::tile_meshes::TileBox;
use lattice::Lattice;
use std::collections::BTreeSet;
use sys::{Result, interrupt};
use tiles::raster::options::{Nodata, nodata_text};
use tiles::raster::window::{HeightScale, LatticeMesh};

/// The most points that the warning names.
const MOST_NAMED: usize = 3;

/// The points that have the height which stands for none, in lattice steps: the westernmost of them, whatever the tiles.
#[derive(Debug, Default)]
pub(super) struct NodataPoints {
    first: BTreeSet<[i32; 2]>,
    are_more: bool,
}

impl NodataPoints {
    /// Looks for the points in those of `tiles` that may have some. `read` returns the mesh of a tile.
    ///
    /// # Errors
    /// Those of `read`, and [`sys::Error::Interrupted`].
    pub(super) fn find(
        tiles: &[TileBox],
        scale: HeightScale,
        nodata: Nodata,
        read: &dyn Fn(&TileBox) -> Result<LatticeMesh>,
    ) -> Result<NodataPoints> {
        let height = |z: i32| scale.source(f64::from(z));
        let may_have = |tile: &&TileBox| {
            let [low, high] = tile.heights.map(height);
            (low..=high).contains(&nodata.number())
        };
        let mut points = NodataPoints::default();
        for tile in tiles.iter().filter(may_have) {
            interrupt::check()?;
            for [x, y, z] in read(tile)?.positions {
                if height(z) == nodata.number() {
                    points.add([x, y]);
                }
            }
        }
        Ok(points)
    }

    fn add(&mut self, point: [i32; 2]) {
        self.first.insert(point);
        if self.first.len() > MOST_NAMED {
            self.first.pop_last();
            self.are_more = true;
        }
    }

    /// Returns the warning about the raster `file`, in which so many cells have this height.
    pub(super) fn warning(&self, file: &str, cells: u64, nodata: Nodata, lattice: &Lattice) -> String {
        let height = nodata_text(nodata.number());
        let cells = match cells {
            1 => "1 cell".into(),
            cells => format!("{cells} cells"),
        };
        let warning = format!("{file} has the height {height} in {cells}, and {height} stands for nodata there");
        if self.first.is_empty() {
            return format!(
                "{warning}: it lies between the heights of points; fix: [output.raster] nodata = \"nan\", or another number"
            );
        }
        let place = |[x, y]: &[i32; 2]| format!("({}, {})", lattice.world_text(0, *x), lattice.world_text(1, *y));
        let places: Vec<String> = self.first.iter().map(place).collect();
        let more = if self.are_more { " and other places" } else { "" };
        format!(
            "{warning}: points at {}{more} have it; fix: [input] nodata = {height} if it stands for nodata in the input too, otherwise \
             [output.raster] nodata = \"nan\" or another number",
            places.join(", ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::TileIndex;
    use delaunay::geometry::Bounds;
    use rust_decimal::Decimal;

    fn warning(meshes: &[&[[i32; 3]]]) -> String {
        let lattice = Lattice::new([Decimal::ONE_HUNDRED; 3], Decimal::new(5, 1), Decimal::ONE).unwrap();
        let (scale, nodata) = (HeightScale { offset: 100.0, step: 1.0 }, Nodata::default());
        let bounds = Bounds { min: [0; 2], max: [9; 2] };
        let tiles: Vec<TileBox> = meshes
            .iter()
            .enumerate()
            .map(|(number, points)| {
                let heights = || points.iter().map(|point| point[2]);
                let heights = [heights().min().unwrap(), heights().max().unwrap()];
                TileBox { tile: TileIndex(number as u32), bounds, heights }
            })
            .collect();
        let read = |tile: &TileBox| {
            let positions = meshes[tile.tile.number()].to_vec();
            assert!(positions.iter().any(|point| point[2] <= -10_099), "tile {:?} has no such height", tile.tile);
            Ok(LatticeMesh { positions, triangles: Vec::new() })
        };
        let points = NodataPoints::find(&tiles, scale, nodata, &read).unwrap();
        points.warning("terrain.tif", 2, nodata, &lattice)
    }

    #[test]
    fn the_westernmost_points_are_named_once() {
        let shared = [3, 8, -10_099];
        let two = warning(&[&[[4, 1, -10_099], shared], &[shared, [0, 0, 5]], &[[1, 1, 7]]]);
        assert!(two.contains("in 2 cells") && two.contains("points at (101.5, 104), (102, 100.5) have it"), "{two}");
        assert!(two.contains("[input] nodata = -9999 if"), "{two}");
        let many: Vec<[i32; 3]> = (0..9).map(|n| [8 - n, n, -10_099]).collect();
        let said = warning(&[&many]);
        assert!(said.contains("points at (100, 104), (100.5, 103.5), (101, 103) and other places have it"), "{said}");
        assert_eq!(said, warning(&[&many[4..], &many[..6]]), "whatever the tiles");
    }

    #[test]
    fn a_height_that_no_point_has_is_no_row_to_leave_out() {
        let said = warning(&[&[[0, 0, -20_000], [5, 5, 0]]]);
        assert!(said.contains("between the heights of points") && !said.contains("[input]"), "{said}");
    }
}
