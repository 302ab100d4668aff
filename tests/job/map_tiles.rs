//! `[output.raster] pmtiles`: map tiles have the heights of the raster, whatever the tiles, threads, parts and files of the raster.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Read};

use flate2::read::GzDecoder;

use crate::clouds::{self, Cloud};
use crate::levels::hills;
use crate::parts::{in_files, in_parts};
use crate::program::{Job, gdt_batch, number};
use crate::raster;

const SIDE: usize = 512;

/// Half the width of the map, in metres of web Mercator.
const HALF: f64 = 6_378_137.0 * std::f64::consts::PI;

/// A PMTiles archive without leaves, as its specification describes it.
struct Archive {
    header: Vec<u8>,
    metadata: serde_json::Value,
    /// The pictures by zoom, column and row.
    tiles: BTreeMap<[usize; 3], Vec<[u8; 3]>>,
}

fn unpacked(bytes: &[u8]) -> Vec<u8> {
    let mut unpacked = Vec::new();
    GzDecoder::new(bytes).read_to_end(&mut unpacked).unwrap();
    unpacked
}

impl Archive {
    fn of(job: &Job) -> Archive {
        let bytes = bytes(job);
        let field = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        let section = |at: usize| &bytes[field(at)..field(at) + field(at + 8)];
        assert_eq!((&bytes[..8], field(48)), (&b"PMTiles\x03"[..], 0));
        let root = unpacked(section(8));
        let mut numbers = Vec::new();
        let (mut value, mut shift) = (0, 0);
        for byte in root {
            value |= usize::from(byte & 0x7f) << shift;
            shift += 7;
            if byte < 0x80 {
                numbers.push(value);
                (value, shift) = (0, 0);
            }
        }
        let count = numbers[0];
        let column = |n: usize| &numbers[1 + n * count..1 + (n + 1) * count];
        let (mut id, mut end, mut tiles) = (0, 0, BTreeMap::new());
        for n in 0..count {
            id += column(0)[n];
            let length = column(2)[n];
            let offset = if column(3)[n] == 0 { end } else { column(3)[n] - 1 };
            end = offset + length;
            let picture = colors(&section(56)[offset..end]);
            (0..column(1)[n]).for_each(|k| _ = tiles.insert(place(id + k), picture.clone()));
        }
        let metadata = serde_json::from_slice(&unpacked(section(24))).unwrap();
        Archive { header: bytes[..127].to_vec(), metadata, tiles }
    }

    fn max_zoom(&self) -> usize {
        usize::from(self.header[101])
    }

    /// Returns the height of a pixel of a zoom by the formula of Mapzen.
    fn height(&self, zoom: usize, [x, y]: [usize; 2]) -> Option<f64> {
        let picture = self.tiles.get(&[zoom, x / SIDE, y / SIDE])?;
        let [red, green, blue] = picture[y % SIDE * SIDE + x % SIDE].map(f64::from);
        Some(red * 256.0 + green + blue / 256.0 - 32768.0)
    }
}

/// Returns the zoom, the column and the row of the tile with this number: the inverse of Hilbert's curve.
fn place(id: usize) -> [usize; 3] {
    let (mut zoom, mut along) = (0, id);
    while along >= 1 << (2 * zoom) {
        along -= 1 << (2 * zoom);
        zoom += 1;
    }
    let (mut x, mut y) = (0, 0);
    for bit in 0..zoom {
        let side = 1 << bit;
        let right = (along / 2) & 1;
        let low = (along ^ right) & 1;
        if low == 0 {
            if right == 1 {
                (x, y) = (side - 1 - x, side - 1 - y);
            }
            (x, y) = (y, x);
        }
        (x, y) = (x + side * right, y + side * low);
        along /= 4;
    }
    [zoom, x, y]
}

fn colors(png: &[u8]) -> Vec<[u8; 3]> {
    let mut reader = png::Decoder::new(Cursor::new(png)).read_info().unwrap();
    assert_eq!(reader.info().size(), (SIDE as u32, SIDE as u32));
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    bytes.chunks_exact(3).map(|color| [color[0], color[1], color[2]]).collect()
}

fn bytes(job: &Job) -> Vec<u8> {
    fs::read(job.out().join("terrain.pmtiles")).unwrap()
}

/// Returns a job in web Mercator, whose places need no projection, with map tiles of these options.
fn on_map(job: Job, options: &str) -> Job {
    job.with("input", "crs = \"EPSG:3857\"")
        .with("output", &format!("raster = {{ {options} }}\nmax_edge = \"none\"\ncopyright = \"A & B\""))
}

#[test]
fn pixels_have_the_heights_between_the_cells_of_the_raster() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(4_000, 7), 100_000);
    let run = |job: Job, options: &str| {
        let job = on_map(job, &format!("resolution = 9.0, pmtiles = \"terrarium\"{options}"));
        (job.report(), job)
    };
    let (report, job) = run(Job::on(&files).tiles_of(1_000).threads(1), "");
    let archive = Archive::of(&job);
    assert_eq!(number(&report["pmtiles"]["tiles"]) as usize, archive.tiles.len());
    assert_eq!(number(&report["pmtiles"]["bytes"]) as usize, bytes(&job).len());
    assert_eq!((archive.metadata["encoding"].as_str(), &archive.header[97..100]), (Some("terrarium"), &[2, 1, 2][..]));
    assert_eq!(archive.metadata["attribution"], "A &amp; B");
    has_the_heights_of_the_raster(&job, &archive);
    job.verified();
    // A file does not depend on how it was made.
    for (other, options) in [
        (Job::on(&files).tiles_of(300).threads(3), ", compression = \"none\""),
        (in_parts(&files, 1_500), ", cells_per_file = 512"),
    ] {
        let (_, other) = run(other, options);
        assert!(bytes(&other) == bytes(&job), "{options}");
    }
    // What another job does not write it removes.
    let text = fs::read_to_string(job.config()).unwrap();
    fs::write(job.config(), text.replace(", pmtiles = \"terrarium\"", "")).unwrap();
    gdt_batch(job.folder(), &["job.toml"]).succeeded();
    assert!(job.out().join("terrain.tif").exists() && !job.out().join("terrain.pmtiles").exists());
}

/// Asserts that pixels of the finest zoom have the height of the raster, and coarser ones the mean of those below.
fn has_the_heights_of_the_raster(job: &Job, archive: &Archive) {
    let raster = raster::raster(job);
    let image = &raster.images[0];
    let zoom = archive.max_zoom();
    let pixel = 2.0 * HALF / (SIDE << zoom) as f64;
    assert!((0.7..1.42).contains(&(pixel / 9.0)), "{pixel}");
    let cell = |column: usize, row: usize| f64::from(image.cells[row * image.width + column]);
    let (mut inner, mut parents) = (0, 0);
    let first = [raster.corner[0] + HALF, HALF - raster.corner[1]].map(|from| (from / pixel) as usize);
    let size = [image.width, image.height].map(|cells| (cells as f64 * 9.0 / pixel) as usize);
    let is_inside = |at: [usize; 2]| {
        let [x, y] = at.map(|at| (at as f64 + 0.5) * pixel);
        let (column, row) = ((x - HALF - raster.corner[0]) / 9.0 - 0.5, (raster.corner[1] - (HALF - y)) / 9.0 - 0.5);
        let (left, top) = (column.floor() as usize, row.floor() as usize);
        let is_in = column >= 0.0 && row >= 0.0 && left + 1 < image.width && top + 1 < image.height;
        let heights = is_in.then(|| [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[e, s]| cell(left + e, top + s)))?;
        let (east, south) = (column.fract(), row.fract());
        let weights = [(1.0 - east) * (1.0 - south), east * (1.0 - south), (1.0 - east) * south, east * south];
        heights
            .iter()
            .all(|height| *height != -9999.0)
            .then(|| heights.iter().zip(weights).map(|(height, weight)| height * weight).sum::<f64>())
    };
    for row in (0..size[1]).step_by(3) {
        for column in (0..size[0]).step_by(3) {
            let at = [first[0] + column, first[1] + row];
            let Some(expected) = is_inside(at) else { continue };
            let found = archive.height(zoom, at).unwrap_or_else(|| panic!("no tile at {at:?}"));
            assert!((found - expected).abs() <= 1.0 / 512.0 + 1e-4, "{at:?}: {found} {expected}");
            inner += 1;
            let below = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[e, s]| [at[0] / 2 * 2 + e, at[1] / 2 * 2 + s]);
            if let [Some(a), Some(b), Some(c), Some(d)] = below.map(is_inside) {
                let found = archive.height(zoom - 1, at.map(|at| at / 2)).unwrap();
                assert!((found - (a + b + c + d) / 4.0).abs() <= 1.0 / 512.0 + 1e-4, "above {at:?}");
                parents += 1;
            }
        }
    }
    assert!(inner > 2_000 && parents > 1_000, "{inner} {parents}");
    // Every tile has those above it.
    for [zoom, x, y] in archive.tiles.keys().filter(|[zoom, ..]| *zoom > 0) {
        assert!(archive.tiles.contains_key(&[zoom - 1, x / 2, y / 2]), "{zoom}/{x}/{y}");
    }
}

#[test]
fn map_tiles_that_cannot_be_written_are_refused_before_the_job() {
    let folder = tempfile::tempdir().unwrap();
    let points: Cloud = (0..400).map(|i| [i % 20 * 5, i / 20 * 5, i % 7]).collect();
    let cloud = clouds::write(folder.path(), "cloud.csv", &points);
    let job = |options: &str| Job::on(&[&cloud]).with("output", &format!("raster = {{ resolution = 2, {options} }}"));
    let nowhere = job("pmtiles = \"terrarium\"");
    for arguments in [&[][..], &["check"]] {
        nowhere
            .run_with(arguments)
            .refused(2, &["[output.raster] pmtiles", "no input names its coordinate system", "[input] crs"]);
    }
    let on_map = |options: &str| job(options).with("input", "crs = \"EPSG:32631\"");
    on_map("pmtiles = \"terrain-rgb\", products = [\"slope\"]").run().refused(2, &["add \"height\" to products"]);
    on_map("pmtiles = \"png\"").run().refused(2, &["terrarium", "terrain-rgb"]);
    let at_pole = job("pmtiles = \"terrain-rgb\"").with("input", "crs = \"EPSG:3413\"");
    at_pole.run().refused(2, &["latitude 90.00", "85.05", "[input] bounds"]);
}
