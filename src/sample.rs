//! A synthetic terrain for trials and tests: hills with a lake, made from a seed and scanned in rows as from an aircraft, with
//! classes and colours.

use las::point::{Classification, Format};
use las::{Builder, Color, Point, Transform, Vector, Vlr, Writer};
use std::f64::consts::TAU;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::Path;
use sys::{Error, Result, interrupt};

/// Points per square metre.
const DENSITY: f64 = 4.0;
/// UTM coordinates of the south-west corner.
const CORNER: [f64; 2] = [565_000.0, 5_933_000.0];
/// The step of the coordinates in metres.
const SCALE: f64 = 0.01;
/// Between so many points the writer looks whether it should stop.
const CHECKED_EVERY: u64 = 10_000;
/// The level of the lake in metres.
const WATER: f64 = 41.0;

/// ETRS89 / UTM zone 32N in the well-known text of OGC 01-009.
const CRS: &str = "PROJCS[\"ETRS89 / UTM zone 32N\",GEOGCS[\"ETRS89\",DATUM[\"European_Terrestrial_Reference_System_1989\",\
SPHEROID[\"GRS 1980\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],\
PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",9],\
PARAMETER[\"scale_factor\",0.9996],PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",0],\
UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"25832\"]]";

/// Writes `points` points of the terrain of `seed` to `path`, as LAS or LAZ according to its extension. Leaves no file behind if that
/// fails.
///
/// # Errors
/// [`Error::Io`] if the file cannot be written, [`Error::Interrupted`], [`Error::Config`] if it has another extension, if `points`
/// is 0, if there is such a file already and `overwrite` is not set, or if something else than a file is there.
pub fn write(path: &Path, points: u64, seed: u64, overwrite: bool) -> Result<()> {
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    let is_laz = extension.as_ref().is_some_and(|extension| extension == "laz");
    if !is_laz && extension.is_none_or(|extension| extension != "las") {
        return Err(Error::Config(format!("{}: the name of a sample must end in .las or .laz", path.display())));
    }
    if points == 0 {
        return Err(Error::Config("a sample needs at least one point".into()));
    }
    if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
        std::fs::create_dir_all(parent).map_err(Error::io("create the directory", parent))?;
    }
    if path.metadata().is_ok_and(|data| !data.is_file()) {
        // Opening a pipe would wait until another process reads from it.
        return Err(Error::Config(format!("{} exists and is not a regular file: choose another name", path.display())));
    }
    let file = if overwrite { File::create(path) } else { File::create_new(path) };
    let file = file.map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => Error::Config(format!(
            "{} exists already: choose another name, remove it, or add --overwrite",
            path.display()
        )),
        _ => Error::io("create", path)(error),
    })?;
    let written = write_points(file, path, is_laz, points, seed);
    if written.is_err() {
        // The first error is the one to report.
        let _ = std::fs::remove_file(path);
    }
    written
}

fn write_points(file: File, path: &Path, is_laz: bool, points: u64, seed: u64) -> Result<()> {
    let failed = |error| match error {
        las::Error::Io(error) => Error::io("write", path)(error),
        error => Error::io("write", path)(std::io::Error::other(error)),
    };
    let mut writer = header(is_laz).and_then(|header| Writer::new(BufWriter::new(file), header)).map_err(failed)?;
    let side = (points as f64).sqrt().ceil().max(1.0) as u64;
    for number in 0..points {
        if number % CHECKED_EVERY == 0 {
            interrupt::check()?;
        }
        writer.write_point(point(number % side, number / side, seed)).map_err(failed)?;
    }
    writer.into_inner().map_err(failed)?.flush().map_err(Error::io("write", path))
}

fn header(is_laz: bool) -> las::Result<las::Header> {
    let axis = |offset: f64| Transform { scale: SCALE, offset };
    let mut builder = Builder::from((1, 4));
    builder.point_format = Format::new(7)?;
    builder.point_format.is_compressed = is_laz;
    builder.transforms = Vector { x: axis(CORNER[0]), y: axis(CORNER[1]), z: axis(0.0) };
    builder.has_wkt_crs = true;
    builder.vlrs.push(Vlr {
        user_id: "LASF_Projection".into(),
        record_id: 2112,
        description: "WKT".into(),
        data: [CRS.as_bytes(), b"\0"].concat(),
    });
    builder.generating_software = concat!("gdt-batch ", env!("CARGO_PKG_VERSION")).into();
    builder.into_header()
}

fn point(column: u64, row: u64, seed: u64) -> Point {
    let step = DENSITY.sqrt().recip();
    let random = |salt: u64| hash(column ^ row << 32, seed.wrapping_add(salt)) as f64 / u64::MAX as f64;
    let place = [column as f64 + random(1), row as f64 + random(2)].map(|v| v * step);
    let ground = height(place, seed);
    let wooded = noise([place[0] / 60.0, place[1] / 60.0], seed ^ 77) > 0.3 && ground > WATER + 2.0;
    let (z, class, color) = match () {
        _ if ground < WATER => (WATER, 9, [60, 95, 120]),
        _ if wooded && random(3) < 0.6 => (ground + 4.0 + 9.0 * random(4), 5, [52, 84, 40]),
        _ => (ground, 2, [128, 122, 84]),
    };
    let shade = 0.85 + 0.3 * random(5);
    let [red, green, blue] = color.map(|v| (v as f64 * shade) as u16 * 256);
    Point {
        x: CORNER[0] + place[0],
        y: CORNER[1] + place[1],
        z,
        classification: Classification::new(class).unwrap_or_default(),
        color: Some(Color::new(red, green, blue)),
        gps_time: Some(0.0),
        return_number: 1,
        number_of_returns: 1,
        ..Point::default()
    }
}

/// Returns the height of the ground in metres: a few octaves of noise.
fn height([x, y]: [f64; 2], seed: u64) -> f64 {
    let octave = |i: u32| {
        let wave = 400.0 / f64::from(1 << i);
        noise([x / wave, y / wave], seed ^ u64::from(i)) * 0.11 * wave
    };
    50.0 + (0..7).map(octave).sum::<f64>()
}

/// Returns gradient noise between -1 and 1 (Perlin 1985, "An Image Synthesizer").
fn noise([x, y]: [f64; 2], seed: u64) -> f64 {
    let (column, row) = (x.floor(), y.floor());
    let (u, v) = (x - column, y - row);
    let corner = |i: f64, j: f64| {
        let angle = hash((column + i) as u64 ^ ((row + j) as u64) << 32, seed) as f64 / u64::MAX as f64 * TAU;
        libm::cos(angle) * (u - i) + libm::sin(angle) * (v - j)
    };
    let fade = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let south = mix(corner(0.0, 0.0), corner(1.0, 0.0), fade(u));
    let north = mix(corner(0.0, 1.0), corner(1.0, 1.0), fade(u));
    1.4 * mix(south, north, fade(v))
}

fn hash(value: u64, seed: u64) -> u64 {
    xxhash_rust::xxh3::xxh3_64_with_seed(&value.to_le_bytes(), seed)
}
