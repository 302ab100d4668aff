//! The tiles of the later terrain, of all levels, with the colours of the difference. Everything else in them stays: each vertex has its
//! position, bit for bit.

use crate::written::compared::Compared;
use crate::written::folder::{DifferenceFolder, LEVELS, TILES, TILESET, TILESETS};
use crate::written::ramp::Legend;
use overlay::Places;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::sync::atomic::{AtomicUsize, Ordering};
use sys::{Error, Result, interrupt};
use tiles::rewritten::WrittenTile;

/// What is to be written.
pub(crate) struct ColoredTiles<'a> {
    compared: &'a Compared<'a>,
    legend: Legend,
}

impl<'a> ColoredTiles<'a> {
    pub(crate) fn new(compared: &'a Compared<'a>, legend: Legend) -> ColoredTiles<'a> {
        ColoredTiles { compared, legend }
    }

    /// Writes the tileset and all its tiles into the folder. Returns the number of tiles; `None` if the later terrain has no tileset.
    ///
    /// # Errors
    /// [`Error::Input`] if a file is not as its job wrote it, [`Error::Io`], [`Error::Interrupted`].
    pub(crate) fn write(self, folder: &DifferenceFolder) -> Result<Option<(u64, Legend)>> {
        let after = self.compared.terrains[1];
        let names: Vec<&str> = after.files().collect();
        if !names.contains(&TILESET) {
            return Ok(None);
        }
        let in_folder = |name: &str, folder: &str| name.strip_prefix(folder).is_some_and(|rest| rest.starts_with('/'));
        for name in names.iter().filter(|name| in_folder(name, TILESETS)) {
            folder.write(name, &after.read_file(name)?)?;
        }
        let copyright = self.write_tileset(folder)?;
        let is_tile = |name: &&&str| in_folder(name, TILES) || in_folder(name, LEVELS);
        let tiles: Vec<&str> = names.iter().filter(is_tile).copied().collect();
        let next = AtomicUsize::new(0);
        let write_some = |_| {
            while let Some(name) = tiles.get(next.fetch_add(1, Ordering::Relaxed)) {
                folder.write(name, &self.colored(name, copyright.as_deref())?)?;
            }
            Ok::<(), Error>(())
        };
        (0..self.compared.lanes).into_par_iter().with_max_len(1).try_for_each(write_some)?;
        Ok(Some((tiles.len() as u64, self.legend)))
    }

    /// Writes the main file of the tileset, with the legend in the extras of its asset. Returns whose the data are, if it says that.
    fn write_tileset(&self, folder: &DifferenceFolder) -> Result<Option<String>> {
        let after = self.compared.terrains[1];
        let broken = || Error::input(after.directory().join(TILESET), "is not a tileset: run the job again");
        let mut tileset: Value = serde_json::from_slice(&after.read_file(TILESET)?).map_err(|_| broken())?;
        let asset = tileset.get_mut("asset").and_then(Value::as_object_mut).ok_or_else(broken)?;
        let copyright = asset.get("copyright").and_then(Value::as_str).map(str::to_owned);
        let extras = asset.entry("extras").or_insert_with(|| json!({})).as_object_mut().ok_or_else(broken)?;
        extras.insert("difference".into(), json!(self.legend));
        folder.write(TILESET, format!("{tileset}\n").as_bytes())?;
        Ok(copyright)
    }

    /// Returns the bytes of a tile with its colours.
    fn colored(&self, name: &str, copyright: Option<&str>) -> Result<Vec<u8>> {
        interrupt::check()?;
        let Compared { terrains: [_, after], lattice, .. } = self.compared;
        let path = after.directory().join(name);
        let mut written = WrittenTile::of(&path, after.read_file(name)?, after.extras(), after.lattice())?;
        let points: Vec<[i64; 3]> = written.tile.positions.iter().map(|point| lattice.ways[1].point(*point)).collect();
        let earlier = self.heights_before(&points)?;
        let step = lattice.step_lengths()[1];
        let change =
            |(point, earlier): (&[i64; 3], &Option<f64>)| earlier.map(|earlier| (point[2] as f64 - earlier) * step);
        let colors = points.iter().zip(&earlier).map(change).map(|change| self.legend.color(change));
        written.tile.colors = Some(colors.collect());
        written.encode(copyright)
    }

    /// Returns the height of the earlier terrain in steps at each point; `None` outside of it.
    fn heights_before(&self, points: &[[i64; 3]]) -> Result<Vec<Option<f64>>> {
        let places = Places::new(points.iter().map(|[x, y, _]| [*x, *y]).collect());
        let mut heights = vec![None; places.len()];
        let is_met = |number: &usize| self.compared.facts[0][*number].bounds.meets(&places.bounds());
        for number in (0..self.compared.facts[0].len()).filter(is_met) {
            interrupt::check()?;
            places.find_heights(&*self.compared.cache.get(number)?, &mut heights);
        }
        Ok(heights)
    }
}
