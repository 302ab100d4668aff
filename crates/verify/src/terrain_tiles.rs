//! Looks into the terrain tiles for globes: whether all that `layer.json` lists are there and can be read, whether each covers its place once and has
//! a water mask if that is listed, and whether neighbours have the same vertices between them, at the same heights to the last bit.
//!
//! The tiles of a zoom are read row by row, and of a row only checksums of its sides stay. So it takes little memory, however many there are.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use rayon::prelude::*;
use serde::Deserialize;
use xxhash_rust::xxh3::xxh3_128;

use quantized_mesh::{DecodedTile, Scheme, decode};
use sys::{Error, Result, disk, interrupt};
use tiles::checksums::read_file;
use tiles::file_names::OutputFiles;
use tiles::gzip::gunzipped;

/// More sentences than this would hide what else is wrong.
const MAX_SENTENCES: usize = 20;

/// Finer zooms than this are not written.
const MOST_ZOOM: usize = 30;

/// The least memory that a tile may take when it is unpacked.
const LEAST_UNPACKED: u64 = 16 << 20;

/// What the terrain tiles have shown.
#[derive(Debug, Default)]
pub(super) struct TerrainTiles {
    /// The number of tiles that were read.
    pub(super) tiles: u64,
    pub(super) failures: Vec<String>,
    /// The sentences that are left out.
    more: u64,
}

#[derive(Deserialize)]
struct Layer {
    projection: String,
    extensions: Vec<String>,
    available: Vec<Vec<Rectangle>>,
}

impl Layer {
    fn scheme(&self) -> Option<Scheme> {
        [Scheme::Geographic, Scheme::WebMercator].into_iter().find(|scheme| scheme.projection() == self.projection)
    }
}

/// Columns and rows of tiles, first and last.
#[derive(Clone, Copy, Deserialize)]
struct Rectangle {
    #[serde(rename = "startX")]
    west: i32,
    #[serde(rename = "endX")]
    east: i32,
    #[serde(rename = "startY")]
    south: i32,
    #[serde(rename = "endY")]
    north: i32,
}

/// What all tiles have in common.
struct TileFiles<'a> {
    output: &'a OutputFiles,
    scheme: Scheme,
    /// Whether each has a water mask.
    have_water: bool,
    /// The most bytes that one may take unpacked.
    most: usize,
}

/// A checksum of the vertices of each side of a tile: west, south, east, north.
type Sides = [u128; 4];

impl TerrainTiles {
    /// Checks the terrain tiles in the output directory of a job, within about `memory` bytes; `None` if there are none.
    ///
    /// # Errors
    /// [`Error::Io`] if the system cannot read a file, [`Error::Interrupted`].
    pub(super) fn check(directory: &Path, memory: u64) -> Result<Option<TerrainTiles>> {
        let output = OutputFiles::new(directory);
        let path = output.terrain_layer();
        let text = match read_file(&path) {
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => return Ok(None),
            text => text.map_err(Error::io("read", &path))?,
        };
        let threads = rayon::current_num_threads() as u64;
        let most = usize::try_from((memory / 4 / threads).max(LEAST_UNPACKED)).unwrap_or(usize::MAX);
        let mut found = TerrainTiles::default();
        match serde_json::from_slice::<Layer>(&text) {
            Ok(layer) if layer.scheme().is_some_and(|scheme| is_possible(scheme, &layer.available)) => {
                let scheme = layer.scheme().unwrap_or_default();
                let have_water = layer.extensions.iter().any(|name| name == "watermask");
                let files = TileFiles { output: &output, scheme, have_water, most };
                let mut listed = 0;
                for (zoom, rectangles) in (0u8..).zip(layer.available) {
                    listed += found.check_zoom(&files, zoom, rectangles)?;
                }
                found.compare_count(&output, listed)?;
            }
            _ => found.fail("terrain/layer.json is no list of terrain tiles".into()),
        }
        if found.more > 0 {
            found.failures.push(format!("{} more faults of terrain tiles", found.more));
        }
        Ok(Some(found))
    }

    fn fail(&mut self, sentence: String) {
        if self.failures.len() < MAX_SENTENCES { self.failures.push(sentence) } else { self.more += 1 }
    }

    /// Checks the tiles of a zoom, and returns how many are listed.
    fn check_zoom(&mut self, files: &TileFiles, zoom: u8, rectangles: Vec<Rectangle>) -> Result<u64> {
        let mut listed = 0;
        let mut below: (i32, BTreeMap<i32, Sides>) = (-1, BTreeMap::new());
        for (row, columns) in rows(rectangles) {
            listed += columns.len() as u64;
            let read = columns.par_iter().map(|&column| {
                interrupt::check()?;
                Ok((column, sides_of(files, zoom, [column, row])?))
            });
            let mut sides: BTreeMap<i32, Sides> = BTreeMap::new();
            for (column, of_tile) in read.collect::<Result<Vec<_>>>()? {
                match of_tile {
                    Ok(of_tile) => drop(sides.insert(column, of_tile)),
                    Err(what) => self.fail(format!("{} {what}", name(zoom, [column, row]))),
                }
            }
            self.tiles += sides.len() as u64;
            for (&column, own) in &sides {
                // The last column is beside the first.
                let east = (column + 1) % files.scheme.columns(zoom);
                if sides.get(&east).is_some_and(|other| own[2] != other[0]) {
                    self.fail(apart(zoom, [column, row], [east, row]));
                }
                let south = below.1.get(&column).filter(|_| below.0 + 1 == row);
                if south.is_some_and(|other| own[1] != other[3]) {
                    self.fail(apart(zoom, [column, row - 1], [column, row]));
                }
            }
            below = (row, sides);
        }
        Ok(listed)
    }

    /// Compares the number of tiles on the disk with that of the list.
    fn compare_count(&mut self, output: &OutputFiles, listed: u64) -> Result<()> {
        let list = |folder: &Path| disk::list(folder).map_err(Error::io("list", folder));
        let is_folder = |path: &Path| disk::is_folder(path).map_err(Error::io("read", path));
        let mut found = 0;
        for zoom in list(&output.terrain_tiles())? {
            if !is_folder(&zoom)? {
                continue;
            }
            for column in list(&zoom)? {
                interrupt::check()?;
                if is_folder(&column)? {
                    let is_tile = |path: &&std::path::PathBuf| path.extension().is_some_and(|e| e == "terrain");
                    found += list(&column)?.iter().filter(is_tile).count() as u64;
                }
            }
        }
        if found > listed {
            self.fail(format!("terrain/ has {found} tiles, where layer.json lists {listed}"));
        }
        Ok(())
    }
}

/// Tells whether all rectangles lie within their zooms.
fn is_possible(scheme: Scheme, available: &[Vec<Rectangle>]) -> bool {
    let is_in = |low: i32, high: i32, count: i64| 0 <= low && low <= high && i64::from(high) < count;
    let fits = |(zoom, rectangles): (u8, &Vec<Rectangle>)| {
        let [columns, rows] = [scheme.columns(zoom).into(), 1i64 << zoom];
        rectangles.iter().all(|all| is_in(all.west, all.east, columns) && is_in(all.south, all.north, rows))
    };
    available.len() < MOST_ZOOM && (0..).zip(available).all(fits)
}

/// Returns the rows of rectangles from the south, each with its columns from the west.
fn rows(mut rectangles: Vec<Rectangle>) -> impl Iterator<Item = (i32, Vec<i32>)> {
    rectangles.sort_unstable_by_key(|rectangle| std::cmp::Reverse(rectangle.south));
    let (mut open, mut row): (Vec<Rectangle>, i32) = (Vec::new(), -1);
    std::iter::from_fn(move || {
        open.retain(|rectangle| rectangle.north > row);
        row = match (open.is_empty(), rectangles.last()) {
            (false, _) => row + 1,
            (true, next) => next?.south,
        };
        while let Some(next) = rectangles.pop_if(|next| next.south == row) {
            open.push(next);
        }
        let mut columns: Vec<i32> = open.iter().flat_map(|rectangle| rectangle.west..=rectangle.east).collect();
        columns.sort_unstable();
        columns.dedup();
        Some((row, columns))
    })
}

fn name(zoom: u8, [column, row]: [i32; 2]) -> String {
    format!("terrain/{zoom}/{column}/{row}.terrain")
}

fn apart(zoom: u8, one: [i32; 2], other: [i32; 2]) -> String {
    format!("{} and {} do not have the same vertices between them", name(zoom, one), name(zoom, other))
}

/// Reads a tile, and returns the checksums of its sides, or what is wrong with it.
fn sides_of(files: &TileFiles, zoom: u8, place: [i32; 2]) -> Result<std::result::Result<Sides, String>> {
    let TileFiles { output, have_water, most, .. } = *files;
    let path = output.terrain_tile(zoom, place);
    let packed = match read_file(&path) {
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            return Ok(Err("is gone, and layer.json lists it".into()));
        }
        packed => packed.map_err(Error::io("read", &path))?,
    };
    let Some(bytes) = gunzipped(&packed, most) else {
        return Ok(Err(format!("is damaged, or takes more than {} MiB unpacked", most >> 20)));
    };
    Ok(match decode(&bytes) {
        Ok(tile) => match tile.fault() {
            Some(what) => Err(format!("is no terrain tile: {what}")),
            None if have_water && tile.water.is_none() => Err("has no water mask, and layer.json lists that".into()),
            None => Ok(checksums(&tile)),
        },
        Err(what) => Err(format!("is no terrain tile: {what}")),
    })
}

fn checksums(tile: &DecodedTile) -> Sides {
    [0, 1, 2, 3].map(|side| {
        let bytes = tile.side(side).flat_map(|(along, height)| {
            let mut bytes = [0; 10];
            bytes[..2].copy_from_slice(&along.to_le_bytes());
            bytes[2..].copy_from_slice(&height.to_bits().to_le_bytes());
            bytes
        });
        xxh3_128(&bytes.collect::<Vec<u8>>())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use quantized_mesh::{HeightSteps, LayerAbout, Node, Surface, Tile, TileMesh, Water, ZoomTiles, encode, layer};
    use std::collections::BTreeSet;
    use std::fs;
    use tiles::gzip::gzipped_mesh;

    const SCHEME: Scheme = Scheme::WebMercator;

    /// A tile with two triangles whose corners have these heights.
    fn tile(tile: Tile, heights: [i32; 4], water: Option<&Water>) -> Vec<u8> {
        let mut mesh = TileMesh::surroundings();
        mesh.nodes.iter_mut().zip(heights).for_each(|(node, h)| *node = Node { h, ..*node });
        let surface = Surface { tile, mesh: &mesh, outside: 0, around: &[], water };
        gzipped_mesh(&encode(&surface, HeightSteps::over(5_000, 5_000)))
    }

    /// Writes 3 x 2 tiles of zoom 3 on one slope, with water masks, and the list of them.
    fn written(folder: &Path) -> OutputFiles {
        let output = OutputFiles::new(folder);
        let height = |x: i32, y: i32| x * 300 + y * 70;
        let places: Vec<Tile> = (0..6).map(|i| Tile { scheme: SCHEME, zoom: 3, x: 5 + i % 3, y: 2 + i / 3 }).collect();
        for place in &places {
            let path = output.terrain_tile(3, [place.x, place.y]);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            let [x, y] = [place.x, place.y];
            let heights = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|[x, y]| height(x, y));
            fs::write(path, tile(*place, heights, Some(&Water::default()))).unwrap();
        }
        let none = || ZoomTiles::new(&[]);
        let zooms = [none(), none(), none(), ZoomTiles::new(&places)];
        let about = LayerAbout { scheme: SCHEME, has_water: true, bounds: [0.0; 4], attribution: None };
        fs::write(output.terrain_layer(), layer(&zooms, &about)).unwrap();
        output
    }

    #[track_caller]
    fn assert_fails(folder: &Path, tiles: u64, expected: &[&str]) {
        let found = TerrainTiles::check(folder, 1 << 30).unwrap().unwrap();
        assert_eq!(found.tiles, tiles);
        assert_eq!(found.failures.len(), expected.len(), "{:?}", found.failures);
        for (failure, expected) in found.failures.iter().zip(expected) {
            assert!(failure.contains(expected), "{failure}");
        }
    }

    #[test]
    fn whole_tiles_pass_and_others_are_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(TerrainTiles::check(folder.path(), 1 << 30).unwrap().is_none());
        let output = written(folder.path());
        assert_fails(folder.path(), 6, &[]);

        let one = output.terrain_tile(3, [6, 3]);
        let bytes = fs::read(&one).unwrap();
        // One corner is higher than those of three neighbours there, one of which lies across.
        let place = Tile { scheme: SCHEME, zoom: 3, x: 6, y: 3 };
        let higher = [6 * 300 + 3 * 70 + 40, 2310, 2080, 2380];
        fs::write(&one, tile(place, higher, Some(&Water::default()))).unwrap();
        assert_fails(
            folder.path(),
            6,
            &["terrain/3/5/3.terrain and terrain/3/6/3.terrain", "terrain/3/6/2.terrain and terrain/3/6/3.terrain"],
        );
        fs::write(&one, tile(place, higher, None)).unwrap();
        assert_fails(folder.path(), 5, &["terrain/3/6/3.terrain has no water mask"]);
        fs::write(&one, &bytes[..bytes.len() - 3]).unwrap();
        assert_fails(folder.path(), 5, &["terrain/3/6/3.terrain is damaged"]);
        fs::write(&one, gzipped_mesh(b"no tile")).unwrap();
        assert_fails(folder.path(), 5, &["terrain/3/6/3.terrain is no terrain tile"]);
        fs::remove_file(&one).unwrap();
        assert_fails(folder.path(), 5, &["terrain/3/6/3.terrain is gone"]);
        fs::write(&one, &bytes).unwrap();
        fs::write(output.terrain_tile(3, [6, 4]), &bytes).unwrap();
        assert_fails(folder.path(), 6, &["terrain/ has 7 tiles, where layer.json lists 6"]);
    }

    #[test]
    fn a_list_of_impossible_tiles_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let output = written(folder.path());
        let list = |projection: &str, last: i32| {
            let rectangle = format!(r#"{{"startX":0,"endX":{last},"startY":0,"endY":0}}"#);
            format!(r#"{{"projection":"{projection}","extensions":[],"available":[[{rectangle}]]}}"#)
        };
        for (projection, columns) in [("EPSG:4326", 2), ("EPSG:3857", 1)] {
            let gone = (0..columns).map(|_| "is gone").collect::<Vec<_>>();
            fs::write(output.terrain_layer(), list(projection, columns - 1)).unwrap();
            assert_fails(folder.path(), 0, &[&gone[..], &["terrain/ has 6 tiles"]].concat());
            fs::write(output.terrain_layer(), list(projection, columns)).unwrap();
            assert_fails(folder.path(), 0, &["layer.json is no list"]);
        }
        fs::write(output.terrain_layer(), list("EPSG:32633", 0)).unwrap();
        assert_fails(folder.path(), 0, &["layer.json is no list"]);
    }

    proptest! {
        #[test]
        fn rows_have_all_tiles_of_the_rectangles_once(
            rectangles in prop::collection::vec((0..20i32, 0..20i32, 0..4i32, 0..4i32), 0..12),
        ) {
            let rectangle = |&(west, south, wide, high): &(i32, i32, i32, i32)| {
                Rectangle { west, east: west + wide, south, north: south + high }
            };
            let rectangles: Vec<Rectangle> = rectangles.iter().map(rectangle).collect();
            let expected: BTreeSet<[i32; 2]> = rectangles
                .iter()
                .flat_map(|all| (all.south..=all.north).flat_map(|y| (all.west..=all.east).map(move |x| [y, x])))
                .collect();
            let found: Vec<[i32; 2]> =
                rows(rectangles).flat_map(|(y, columns)| columns.into_iter().map(move |x| [y, x])).collect();
            prop_assert_eq!(found, expected.into_iter().collect::<Vec<_>>());
        }
    }
}
