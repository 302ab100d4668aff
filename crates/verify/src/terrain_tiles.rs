//! Looks into the terrain tiles for globes: whether all that `layer.json` lists are there and can be read, whether each covers its place once and has
//! a water mask if that is listed, and whether neighbours have the same vertices between them, at the same heights to the last bit. Where no tile is
//! beside one, viewers show a part of a coarser tile: there the side must be level, and at one height in all of them.
//!
//! The tiles of a zoom are read row by row, and of a row only checksums of its sides stay. So it takes little memory, however many there are, and however
//! many `layer.json` claims.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use rayon::prelude::*;
use xxhash_rust::xxh3::xxh3_128;

use crate::terrain_layer::{Layer, Rectangle, is_listed, is_possible, rows};
use quantized_mesh::{DecodedTile, FIRST_SURROUNDED_ZOOM, SPAN, Scheme, decode};
use sys::{Error, Result, disk, interrupt};
use tiles::checksums::{open_file, read_file};
use tiles::file_names::OutputFiles;
use tiles::gzip::{gunzipped, unpacked_length};

/// More sentences than this would hide what else is wrong.
const MAX_SENTENCES: usize = 20;

/// When so many tiles of the list are gone, the others are not looked for: a list may claim more of them than anybody can wait for.
const MOST_GONE: u64 = 1000;

/// Tiles that are looked for at one time.
const TILES_AT_ONCE: usize = 1024;

/// The list takes so many times as much memory as its file at most: three bytes of it may be an empty list in a list.
const LIST_FACTOR: u64 = 20;

/// What a tile holds takes so many times as much memory as its unpacked bytes, with these.
const UNPACKED_FACTOR: u64 = 3;

/// What the terrain tiles have shown.
#[derive(Debug, Default)]
pub(super) struct TerrainTiles {
    /// The number of tiles that were read.
    pub(super) tiles: u64,
    pub(super) failures: Vec<String>,
    /// The sentences that are left out.
    more: u64,
    /// The tiles that are listed and gone.
    gone: u64,
    /// The heights that all level sides have in common where no tile is beside them.
    surroundings: Option<[f64; 2]>,
}

/// What all tiles have in common.
struct TileFiles<'a> {
    output: &'a OutputFiles,
    scheme: Scheme,
    /// Whether each has a water mask.
    have_water: bool,
    /// The most bytes of memory that one may take.
    memory: u64,
}

/// A side of a tile.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// A checksum of its vertices.
    checksum: u128,
    /// The lowest and the highest height in metres that its vertices may have had before rounding, if all have one.
    level: Option<[f64; 2]>,
}

/// The west, south, east and north side of a tile.
type Sides = [Side; 4];

/// Their names.
const SIDE_NAMES: [&str; 4] = ["western", "southern", "eastern", "northern"];

impl TerrainTiles {
    /// Checks the terrain tiles in the output directory of a job, within about `memory` bytes; `None` if there are none.
    ///
    /// # Errors
    /// [`Error::Io`] if the system cannot read a file, [`Error::Interrupted`].
    pub(super) fn check(directory: &Path, memory: u64) -> Result<Option<TerrainTiles>> {
        let output = OutputFiles::new(directory);
        let path = output.terrain_layer();
        let text = match disk::metadata(&path).map_err(Error::io("read", &path))? {
            None => return Ok(None),
            Some(data) if data.len() > memory / LIST_FACTOR => return Err(too_large(&path, data.len() * LIST_FACTOR)),
            Some(_) => read_file(&path).map_err(Error::io("read", &path))?,
        };
        let mut found = TerrainTiles::default();
        match serde_json::from_slice::<Layer>(&text) {
            Ok(layer) if layer.scheme().is_some_and(|scheme| is_possible(scheme, &layer.available)) => {
                let scheme = layer.scheme().unwrap_or_default();
                let have_water = layer.extensions.iter().any(|name| name == "watermask");
                let files = TileFiles { output: &output, scheme, have_water, memory };
                found.check_all(&files, layer.available)?;
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

    /// Checks all tiles that are listed, by zoom.
    fn check_all(&mut self, files: &TileFiles, available: Vec<Vec<Rectangle>>) -> Result<()> {
        let mut listed = 0;
        for (zoom, rectangles) in (0u8..).zip(&available) {
            listed += self.check_zoom(files, zoom, rectangles.clone())?;
            if self.gone >= MOST_GONE {
                // The last sentence, so that no other one takes its place.
                self.failures.push(format!(
                    "{} or more tiles that layer.json lists are gone; the others are not checked",
                    self.gone
                ));
                return Ok(());
            }
        }
        self.compare_count(&files.output.terrain_tiles(), &available, listed)
    }

    /// Checks the tiles of a zoom, and returns how many are listed. Ends early if too many of them are gone.
    fn check_zoom(&mut self, files: &TileFiles, zoom: u8, rectangles: Vec<Rectangle>) -> Result<u64> {
        let mut listed = 0;
        let mut below: (i32, BTreeMap<i32, Sides>) = (-1, BTreeMap::new());
        for (row, runs) in rows(rectangles) {
            let mut sides: BTreeMap<i32, Sides> = BTreeMap::new();
            let mut columns = runs.into_iter().flatten().peekable();
            while columns.peek().is_some() {
                let some: Vec<i32> = columns.by_ref().take(TILES_AT_ONCE).collect();
                listed += some.len() as u64;
                self.read_all(files, zoom, row, &some, &mut sides)?;
                if self.gone >= MOST_GONE {
                    return Ok(listed);
                }
            }
            self.tiles += sides.len() as u64;
            self.compare_row(files.scheme, zoom, (row, &sides), &below);
            self.check_north(files.scheme, zoom, &below, (row, &sides));
            below = (row, sides);
        }
        self.check_north(files.scheme, zoom, &below, (i32::MAX, &BTreeMap::new()));
        Ok(listed)
    }

    /// Adds the sides of tiles of a row, and what is wrong with the tiles.
    fn read_all(
        &mut self,
        files: &TileFiles,
        zoom: u8,
        row: i32,
        columns: &[i32],
        sides: &mut BTreeMap<i32, Sides>,
    ) -> Result<()> {
        let share = files.memory / 2 / rayon::current_num_threads() as u64;
        let read = |&column: &i32, room: u64| {
            interrupt::check()?;
            read_tile(files, zoom, [column, row], room)
        };
        let found = columns.par_iter().map(|column| read(column, share)).collect::<Result<Vec<_>>>()?;
        for (column, mut tile) in columns.iter().zip(found) {
            if matches!(tile, ReadTile::TooLarge(_)) {
                // No other thread reads one at the same time.
                tile = read(column, files.memory)?;
            }
            match tile {
                ReadTile::Whole(of_tile) => drop(sides.insert(*column, of_tile)),
                ReadTile::Bad(what) => self.fail(format!("{} {what}", name(zoom, [*column, row]))),
                ReadTile::Gone => {
                    self.gone += 1;
                    self.fail(format!("{} is gone, and layer.json lists it", name(zoom, [*column, row])));
                }
                ReadTile::TooLarge(bytes) => {
                    return Err(too_large(&files.output.terrain_tile(zoom, [*column, row]), bytes));
                }
            }
        }
        Ok(())
    }

    /// Compares the sides of the tiles of a row with one another, and with those of the row below it.
    fn compare_row(
        &mut self,
        scheme: Scheme,
        zoom: u8,
        (row, sides): (i32, &BTreeMap<i32, Sides>),
        (row_below, below): &(i32, BTreeMap<i32, Sides>),
    ) {
        for (&column, own) in sides {
            // The last column is beside the first.
            let columns = scheme.columns(zoom);
            let [west, east] = [columns - 1, 1].map(|step| (column + step) % columns);
            match sides.get(&east) {
                Some(other) if own[2].checksum != other[0].checksum => {
                    self.fail(apart(zoom, [column, row], [east, row]));
                }
                Some(_) => {}
                None => self.check_open_side(scheme, zoom, [column, row], (own, 2)),
            }
            if !sides.contains_key(&west) {
                self.check_open_side(scheme, zoom, [column, row], (own, 0));
            }
            match below.get(&column).filter(|_| row_below + 1 == row) {
                Some(other) if own[1].checksum != other[3].checksum => {
                    self.fail(apart(zoom, [column, row - 1], [column, row]));
                }
                None if row > 0 => self.check_open_side(scheme, zoom, [column, row], (own, 1)),
                _ => {}
            }
        }
    }

    /// Checks the northern sides of the tiles of a row that has no tile north of them.
    fn check_north(
        &mut self,
        scheme: Scheme,
        zoom: u8,
        (row, sides): &(i32, BTreeMap<i32, Sides>),
        (row_above, above): (i32, &BTreeMap<i32, Sides>),
    ) {
        let is_last = i64::from(*row) + 1 == 1 << zoom;
        let is_open = |column: &i32| !is_last && (row + 1 != row_above || !above.contains_key(column));
        for (&column, own) in sides.iter().filter(|(column, _)| is_open(column)) {
            self.check_open_side(scheme, zoom, [column, *row], (own, 3));
        }
    }

    /// Checks that a side that has no tile beside it is level, and as high as all others.
    fn check_open_side(&mut self, scheme: Scheme, zoom: u8, place: [i32; 2], (sides, side): (&Sides, usize)) {
        // What should be beside a damaged tile is not known. At the coarsest zooms all surfaces are close enough.
        if zoom < scheme.as_wide_as(FIRST_SURROUNDED_ZOOM) || !self.failures.is_empty() {
            return;
        }
        let name = |what: &str| format!("{}: its {} side {what}", name(zoom, place), SIDE_NAMES[side]);
        let Some([low, high]) = sides[side].level else {
            return self.fail(name("is not level, and no tile is beside it"));
        };
        let [lowest, highest] = self.surroundings.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let common = [low.max(lowest), high.min(highest)];
        if common[0] > common[1] {
            return self.fail(name("is not as high as others that have no tile beside them"));
        }
        self.surroundings = Some(common);
    }

    /// Compares the number of tiles in `folder` with that of the list.
    fn compare_count(&mut self, folder: &Path, available: &[Vec<Rectangle>], listed: u64) -> Result<()> {
        let mut found = 0;
        each_tile(folder, |_| found += 1)?;
        if found > listed {
            let mut stray = None;
            each_tile(folder, |path| {
                if stray.is_none() && !is_listed(available, path) {
                    stray = Some(path.to_owned());
                }
            })?;
            let stray = stray.map_or(String::new(), |path| format!("; it lacks terrain/{}", path.display()));
            self.fail(format!("terrain/ has {found} tiles, where layer.json lists {listed}{stray}"));
        }
        Ok(())
    }
}

/// Calls `visit` with the path of each tile, from the folder of all.
fn each_tile(folder: &Path, mut visit: impl FnMut(&Path)) -> Result<()> {
    let list = |folder: &Path| disk::list(folder).map_err(Error::io("list", folder));
    let is_folder = |path: &Path| disk::is_folder(path).map_err(Error::io("read", path));
    for zoom in list(folder)? {
        if !is_folder(&zoom)? {
            continue;
        }
        for column in list(&zoom)? {
            interrupt::check()?;
            if is_folder(&column)? {
                let tiles = list(&column)?.into_iter().filter(|path| path.extension().is_some_and(|e| e == "terrain"));
                tiles.for_each(|path| visit(path.strip_prefix(folder).unwrap_or(&path)));
            }
        }
    }
    Ok(())
}

fn name(zoom: u8, [column, row]: [i32; 2]) -> String {
    format!("terrain/{zoom}/{column}/{row}.terrain")
}

fn apart(zoom: u8, one: [i32; 2], other: [i32; 2]) -> String {
    format!("{} and {} do not have the same vertices between them", name(zoom, one), name(zoom, other))
}

/// What has become of a tile that is listed.
enum ReadTile {
    Whole(Sides),
    Gone,
    /// What is wrong with it.
    Bad(String),
    /// It takes so many bytes of memory.
    TooLarge(u64),
}

/// Reads a tile, and checks it, if that takes no more than so many bytes of memory.
fn read_tile(files: &TileFiles, zoom: u8, place: [i32; 2], room: u64) -> Result<ReadTile> {
    let path = files.output.terrain_tile(zoom, place);
    let (packed, unpacked) = match lengths(&path) {
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            return Ok(ReadTile::Gone);
        }
        lengths => lengths.map_err(Error::io("read", &path))?,
    };
    let damaged = || Ok(ReadTile::Bad("is damaged".into()));
    let Some(unpacked) = unpacked else { return damaged() };
    let bytes = packed.saturating_add(unpacked.saturating_mul(UNPACKED_FACTOR));
    if bytes > room {
        return Ok(ReadTile::TooLarge(bytes));
    }
    let packed = read_file(&path).map_err(Error::io("read", &path))?;
    let Some(bytes) = gunzipped(&packed, unpacked as usize) else { return damaged() };
    drop(packed);
    Ok(match decode(&bytes) {
        Ok(tile) => match tile.fault() {
            Some(what) => ReadTile::Bad(format!("is no terrain tile: {what}")),
            None if files.have_water && tile.water.is_none() => {
                ReadTile::Bad("has no water mask, and layer.json lists that".into())
            }
            None => ReadTile::Whole(sides_of(&tile)),
        },
        Err(what) => ReadTile::Bad(format!("is no terrain tile: {what}")),
    })
}

/// Returns the length of the file of a tile, and that of what is packed in it; `None` if it is damaged.
fn lengths(path: &Path) -> std::io::Result<(u64, Option<u64>)> {
    let mut file = open_file(path)?;
    let length = file.seek(SeekFrom::End(0))?;
    let mut end = [0; 4];
    if length < end.len() as u64 {
        return Ok((length, None));
    }
    file.seek(SeekFrom::End(-(end.len() as i64)))?;
    file.read_exact(&mut end)?;
    Ok((length, unpacked_length(length, end)))
}

/// Returns the error about a file that takes so many bytes of memory to check.
fn too_large(path: &Path, bytes: u64) -> Error {
    let limit = bytes.div_ceil(1 << 20);
    Error::Memory(format!("{} takes about {limit} MiB to verify: set --memory \"{limit} MiB\" or more", path.display()))
}

fn sides_of(tile: &DecodedTile) -> Sides {
    // Heights are in single precision, and vertices in steps between two.
    let [low, high] = tile.heights.map(f64::from);
    let rounding = (high - low) / SPAN as f64 + low.abs().max(high.abs()) * f64::from(f32::EPSILON);
    [0, 1, 2, 3].map(|side| {
        let bytes = tile.side(side).flat_map(|(along, height)| {
            let mut bytes = [0; 10];
            bytes[..2].copy_from_slice(&along.to_le_bytes());
            bytes[2..].copy_from_slice(&height.to_bits().to_le_bytes());
            bytes
        });
        let checksum = xxh3_128(&bytes.collect::<Vec<u8>>());
        let mut heights = tile.side(side).map(|(_, height)| height);
        let first = heights.next();
        let level = first.filter(|first| heights.all(|height| height == *first));
        Side { checksum, level: level.map(|height| [height - rounding, height + rounding]) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use quantized_mesh::{HeightSteps, LayerAbout, Node, Surface, Tile, TileMesh, Water, ZoomTiles, encode, layer};
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
        assert_fails(
            folder.path(),
            6,
            &["terrain/ has 7 tiles, where layer.json lists 6; it lacks terrain/3/6/4.terrain"],
        );
    }

    /// Viewers show a part of a coarser tile beside them.
    #[test]
    fn sides_without_a_tile_beside_them_must_be_level_and_of_one_height() {
        let folder = tempfile::tempdir().unwrap();
        let output = OutputFiles::new(folder.path());
        let write = |zoom: u8, heights: [i32; 4]| {
            let place = Tile { scheme: SCHEME, zoom, x: 5, y: 2 };
            let path = output.terrain_tile(zoom, [5, 2]);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, tile(place, heights, None)).unwrap();
            place
        };
        let zooms: Vec<ZoomTiles> = (0..6)
            .map(|zoom| {
                ZoomTiles::new(&(3..6).filter(|of| *of == zoom).map(|of| write(of, [100; 4])).collect::<Vec<_>>())
            })
            .collect();
        let about = LayerAbout { scheme: SCHEME, has_water: false, bounds: [0.0; 4], attribution: None };
        fs::write(output.terrain_layer(), layer(&zooms, &about)).unwrap();
        assert_fails(folder.path(), 3, &[]);
        // Zoom 3 is too coarse for that to matter.
        write(3, [100, 100, 100, 900]);
        assert_fails(folder.path(), 3, &[]);
        write(4, [100, 100, 100, 900]);
        assert_fails(folder.path(), 3, &["terrain/4/5/2.terrain: its eastern side is not level"]);
        write(4, [900; 4]);
        assert_fails(folder.path(), 3, &["terrain/5/5/2.terrain: its eastern side is not as high"]);
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

    #[test]
    fn a_list_of_tiles_that_nobody_can_have_ends_the_check() {
        let folder = tempfile::tempdir().unwrap();
        let output = written(folder.path());
        let list = |last: [i32; 2]| {
            let rectangle = format!(r#"{{"startX":0,"endX":{},"startY":0,"endY":{}}}"#, last[0], last[1]);
            let zooms = vec!["[]"; 24].join(",");
            format!(r#"{{"projection":"EPSG:3857","extensions":[],"available":[{zooms},[{rectangle}]]}}"#)
        };
        for last in [[(1 << 24) - 1, 0], [(1 << 24) - 1; 2], [0, (1 << 24) - 1]] {
            fs::write(output.terrain_layer(), list(last)).unwrap();
            let TerrainTiles { tiles, failures, gone, .. } =
                TerrainTiles::check(folder.path(), 1 << 30).unwrap().unwrap();
            assert!(tiles == 0 && gone < MOST_GONE + TILES_AT_ONCE as u64, "{gone}");
            assert!(failures[0].contains("terrain/24/0/0.terrain is gone"), "{failures:?}");
            assert!(failures.iter().any(|failure| failure.contains("the others are not checked")), "{failures:?}");
        }
    }

    /// Returns what the check says with so much memory.
    fn memory_error(folder: &Path, memory: u64) -> String {
        match TerrainTiles::check(folder, memory) {
            Err(Error::Memory(what)) => what,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_takes_too_much_memory_is_no_damage() {
        let folder = tempfile::tempdir().unwrap();
        let output = written(folder.path());
        let mut mesh = TileMesh::surroundings();
        mesh.nodes.extend((0..400_000).map(|i| Node {
            u: 1 + i as u16 % 30_000,
            v: 1 + (i / 30_000) as u16,
            h: i % 9,
        }));
        mesh.triangles.extend((0..400_000).map(|i| [i, i + 1, i + 2]));
        let great = Tile { scheme: SCHEME, zoom: 3, x: 6, y: 3 };
        let water = Water::default();
        let surface = Surface { tile: great, mesh: &mesh, outside: 0, around: &[], water: Some(&water) };
        let bytes = encode(&surface, HeightSteps::over(5_000, 5_000));
        let needed = UNPACKED_FACTOR * bytes.len() as u64;
        fs::write(output.terrain_tile(3, [6, 3]), gzipped_mesh(&bytes)).unwrap();
        let what = memory_error(folder.path(), needed);
        assert!(what.contains("6/3.terrain") || what.contains("6\\3.terrain"), "{what}");
        let (_, limit) = what.split_once("set --memory \"").unwrap();
        let limit: u64 = limit.split_once(" MiB\"").unwrap().0.parse().unwrap();
        // Alone it has room, whatever its neighbours are.
        let found = TerrainTiles::check(folder.path(), limit << 20).unwrap().unwrap();
        assert_eq!(found.tiles, 5, "{:?}", found.failures);
        // The list takes memory too.
        fs::write(output.terrain_layer(), vec![b' '; 1 << 20]).unwrap();
        let needed = format!("layer.json takes about {LIST_FACTOR} MiB");
        assert!(memory_error(folder.path(), 1 << 20).contains(&needed));
    }
}
