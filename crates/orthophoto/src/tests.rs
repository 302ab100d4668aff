//! Pictures of a few pixels, whose colours tell their column and row.

use crate::{Orthophoto, require_file};
use crs::from_wkt::from_epsg;
use crs::{Crs, CrsTransform, DatumRule};
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use sys::Error;
use tempfile::TempDir;
use tiff::encoder::colortype::{ColorType, Gray16, RGB8, RGBA8};
use tiff::encoder::{Compression, TiffEncoder, TiffValue};
use tiff::tags::Tag;

const COLUMNS: u32 = 7;
const ROWS: u32 = 5;
const LARGE: u64 = 1 << 20;

/// Half a unit wide pixels below and right of (1000, 2000).
const SCALE: &[f64] = &[0.5, 0.5, 0.0];
const TIE: &[f64] = &[0.0, 0.0, 0.0, 1000.0, 2000.0, 0.0];

fn open(path: &Path, points: &Crs, most_bytes: u64) -> sys::Result<Orthophoto> {
    Orthophoto::open(path, Box::new(BufReader::new(File::open(path).unwrap())), points, most_bytes)
}

fn color(column: u32, row: u32) -> [u8; 3] {
    [column as u8 * 30, row as u8 * 50, 7]
}

/// Returns the middle of a pixel.
fn middle(column: u32, row: u32) -> [f64; 2] {
    [1000.0 + 0.5 * (f64::from(column) + 0.5), 2000.0 - 0.5 * (f64::from(row) + 0.5)]
}

fn all_pixels() -> impl Iterator<Item = (u32, u32)> {
    (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (column, row)))
}

/// Writes a picture with strips of two rows, and these tags besides.
fn write<C: ColorType>(path: &Path, compression: Compression, tags: &[(Tag, &dyn Fn() -> Values)], data: &[C::Inner])
where
    [C::Inner]: TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap().with_compression(compression);
    let mut image = encoder.new_image::<C>(COLUMNS, ROWS).unwrap();
    image.rows_per_strip(2).unwrap();
    for (tag, values) in tags {
        match values() {
            Values::Doubles(values) => image.encoder().write_tag(*tag, &values[..]).unwrap(),
            Values::Shorts(values) => image.encoder().write_tag(*tag, &values[..]).unwrap(),
            Values::Text(text) => image.encoder().write_tag(*tag, &text[..]).unwrap(),
        }
    }
    image.write_data(data).unwrap();
    std::fs::write(path, bytes.into_inner()).unwrap();
}

enum Values {
    Doubles(Vec<f64>),
    Shorts(Vec<u16>),
    Text(String),
}

const PLACE: [(Tag, &dyn Fn() -> Values); 2] = [
    (Tag::ModelPixelScaleTag, &|| Values::Doubles(SCALE.to_vec())),
    (Tag::ModelTiepointTag, &|| Values::Doubles(TIE.to_vec())),
];

fn rgb() -> Vec<u8> {
    all_pixels().flat_map(|(column, row)| color(column, row)).collect()
}

/// Writes a picture of [`rgb`] and returns what it is when opened.
fn photo(folder: &TempDir, compression: Compression) -> Orthophoto {
    let path = folder.path().join("photo.tif");
    write::<RGB8>(&path, compression, &PLACE, &rgb());
    open(&path, &Crs::default(), LARGE).unwrap()
}

fn refusal(path: &Path, points: &Crs, most_bytes: u64) -> String {
    let error = open(path, points, most_bytes).unwrap_err();
    assert!(matches!(error, Error::Input { .. }), "{error}");
    let said = error.to_string();
    assert!(said.contains("photo.tif: [output] color: "), "{said}");
    said
}

#[test]
fn every_place_has_the_colour_of_the_pixel_that_it_lies_in() {
    let folder = TempDir::new().unwrap();
    for compression in [Compression::Uncompressed, Compression::Lzw, Compression::Deflate(Default::default())] {
        let photo = photo(&folder, compression);
        let wanted: Vec<_> = all_pixels().map(|(column, row)| Some(color(column, row))).collect();
        let found = photo.colors(all_pixels().map(|(column, row)| middle(column, row))).unwrap();
        assert_eq!(found, wanted);
        let backwards =
            photo.colors(all_pixels().map(|(column, row)| middle(column, row)).collect::<Vec<_>>().into_iter().rev());
        assert_eq!(backwards.unwrap(), wanted.into_iter().rev().collect::<Vec<_>>(), "the order does not matter");
    }
}

#[test]
fn the_upper_and_the_left_edge_belong_to_a_picture_and_nothing_beyond() {
    let folder = TempDir::new().unwrap();
    let photo = photo(&folder, Compression::Uncompressed);
    let [right, bottom] = [1000.0 + 0.5 * f64::from(COLUMNS), 2000.0 - 0.5 * f64::from(ROWS)];
    let inside = [[1000.0, 2000.0], [1000.5, 1999.5], [right.next_down(), bottom.next_up()]];
    let wanted = [color(0, 0), color(1, 1), color(COLUMNS - 1, ROWS - 1)].map(Some);
    assert_eq!(photo.colors(inside.into_iter()).unwrap(), wanted);
    let outside =
        [[999.9, 1999.0], [1001.0, 2000.1], [right, 1999.0], [1001.0, bottom], [f64::NAN, 1999.0], [1e300, -1e300]];
    assert_eq!(photo.colors(outside.into_iter()).unwrap(), [None; 6]);
}

#[test]
fn where_a_picture_is_clear_or_has_no_data_there_is_no_colour() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("photo.tif");
    let is_clear = |column: u32, row: u32| (column + row).is_multiple_of(2);
    let rgba = |(column, row)| {
        let [red, green, blue] = color(column, row);
        [red, green, blue, if is_clear(column, row) { 0 } else { 255 }]
    };
    let tags: [(Tag, &dyn Fn() -> Values); 3] = [PLACE[0], PLACE[1], (Tag::ExtraSamples, &|| Values::Shorts(vec![2]))];
    write::<RGBA8>(&path, Compression::Lzw, &tags, &all_pixels().flat_map(rgba).collect::<Vec<u8>>());
    let middles = || all_pixels().map(|(column, row)| middle(column, row));
    let found = open(&path, &Crs::default(), LARGE).unwrap().colors(middles()).unwrap();
    for ((column, row), found) in all_pixels().zip(found) {
        assert_eq!(found, (!is_clear(column, row)).then(|| color(column, row)));
    }
    let mut data = rgb();
    data[..3].fill(9);
    let tags: [(Tag, &dyn Fn() -> Values); 3] = [PLACE[0], PLACE[1], (Tag::GdalNodata, &|| Values::Text("9".into()))];
    write::<RGB8>(&path, Compression::Uncompressed, &tags, &data);
    let found = open(&path, &Crs::default(), LARGE).unwrap().colors(middles()).unwrap();
    assert_eq!(found.iter().filter(|color| color.is_none()).count(), 1);
    assert_eq!((found[0], found[1]), (None, Some(color(1, 0))));
}

#[test]
fn a_turned_picture_is_read_by_its_matrix() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("photo.tif");
    // Columns go north, and rows go east.
    let matrix = [0.0, 2.0, 0.0, 100.0, 3.0, 0.0, 0.0, 200.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    write::<RGB8>(
        &path,
        Compression::Uncompressed,
        &[(Tag::ModelTransformationTag, &|| Values::Doubles(matrix.to_vec()))],
        &rgb(),
    );
    let photo = open(&path, &Crs::default(), LARGE).unwrap();
    let place = |(column, row)| [100.0 + 2.0 * (f64::from(row) + 0.5), 200.0 + 3.0 * (f64::from(column) + 0.5)];
    let wanted: Vec<_> = all_pixels().map(|(column, row)| Some(color(column, row))).collect();
    assert_eq!(photo.colors(all_pixels().map(place)).unwrap(), wanted);
}

/// The tags that place a picture in longitude and latitude, around 9 degrees east and 48 north.
const DEGREES: [(Tag, &dyn Fn() -> Values); 3] = [
    (Tag::ModelPixelScaleTag, &|| Values::Doubles(vec![0.001, 0.001, 0.0])),
    (Tag::ModelTiepointTag, &|| Values::Doubles(vec![0.0, 0.0, 0.0, 9.0, 48.0, 0.0])),
    (Tag::GeoKeyDirectoryTag, &|| Values::Shorts(vec![1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326])),
];

#[test]
fn places_are_brought_into_the_system_of_the_picture() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("photo.tif");
    write::<RGB8>(&path, Compression::Uncompressed, &DEGREES, &rgb());
    let [utm, degrees] = [32632, 4326].map(|code| from_epsg(code).unwrap());
    let photo = open(&path, &utm, LARGE).unwrap();
    assert!(photo.warnings.is_empty(), "{:?}", photo.warnings);
    let to_utm = CrsTransform::between(&degrees, &utm, DatumRule::Strict).unwrap();
    let place = |(column, row)| {
        to_utm.apply([9.0 + 0.001 * (f64::from(column) + 0.5), 48.0 - 0.001 * (f64::from(row) + 0.5)]).unwrap()
    };
    let wanted: Vec<_> = all_pixels().map(|(column, row)| Some(color(column, row))).collect();
    assert_eq!(photo.colors(all_pixels().map(place)).unwrap(), wanted);
    // ETRS89 and WGS 84 are a metre apart at most.
    let close = open(&path, &from_epsg(25832).unwrap(), LARGE).unwrap();
    assert!(close.warnings.iter().any(|warning| warning.contains("one datum")), "{:?}", close.warnings);
    let nameless = open(&path, &Crs::default(), LARGE).unwrap();
    assert!(nameless.warnings.iter().any(|warning| warning.contains("no CRS")), "{:?}", nameless.warnings);
}

/// A picture that GDAL has written, whose luminance and chrominance are JPEG in tiles of 16 pixels, those at the border with 8 of them.
#[test]
fn jpeg_tiles_are_those_that_gdal_writes() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("photo.tif");
    std::fs::write(&path, include_bytes!("jpeg-tiles.tif")).unwrap();
    let photo = open(&path, &from_epsg(32632).unwrap(), LARGE).unwrap();
    let pixels = || (0..24_u32).flat_map(|row| (0..40_u32).map(move |column| [column, row]));
    let place = |[column, row]: [u32; 2]| [500_000.25 + 0.5 * f64::from(column), 4_999_999.75 - 0.5 * f64::from(row)];
    let found = photo.colors(pixels().map(place)).unwrap();
    for ([column, row], found) in pixels().zip(&found) {
        let wanted = [6 * column, 10 * row, 255 - (3 * column + 4 * row).min(255)];
        let found = found.unwrap();
        assert!(
            (0..3).all(|k| u32::from(found[k]).abs_diff(wanted[k]) <= 10),
            "{column} {row}: {found:?}, not {wanted:?}"
        );
    }
    // The same on every machine.
    let sum =
        found.iter().flatten().flatten().fold(0_u64, |sum, value| sum.wrapping_mul(31).wrapping_add(u64::from(*value)));
    assert_eq!(sum, 9_109_164_732_050_812_389);
}

#[test]
fn what_cannot_be_read_is_refused_with_a_way_out() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("photo.tif");
    let none = Crs::default();
    std::fs::write(&path, "no picture").unwrap();
    assert!(refusal(&path, &none, LARGE).contains("not a readable GeoTIFF"));
    write::<RGB8>(&path, Compression::Uncompressed, &[], &rgb());
    assert!(refusal(&path, &none, LARGE).contains("is not georeferenced"));
    write::<Gray16>(&path, Compression::Uncompressed, &PLACE, &vec![1; (COLUMNS * ROWS) as usize]);
    assert!(refusal(&path, &none, LARGE).contains("-ot Byte"));
    write::<RGB8>(&path, Compression::Uncompressed, &PLACE, &rgb());
    assert!(refusal(&path, &none, 10).contains("-of COG"));
    let whole = std::fs::read(&path).unwrap();
    // Tag 259 is the compression, and 34925 is LZMA.
    let entry = [&259_u16.to_le_bytes()[..], &3_u16.to_le_bytes(), &1_u32.to_le_bytes(), &1_u16.to_le_bytes()].concat();
    let at = whole.windows(entry.len()).position(|bytes| bytes == entry).unwrap();
    let mut other = whole.clone();
    other[at + 8..at + 10].copy_from_slice(&34925_u16.to_le_bytes());
    std::fs::write(&path, other).unwrap();
    assert!(refusal(&path, &none, LARGE).contains("COMPRESS=DEFLATE"));
    let missing = require_file(&folder.path().join("none.tif")).unwrap_err();
    assert!(matches!(&missing, Error::Config(what) if what.contains("none.tif")), "{missing}");
    // A file that is cut off anywhere is refused, or its colours are, and nothing panics.
    for end in 0..whole.len() {
        std::fs::write(&path, &whole[..end]).unwrap();
        if let Ok(photo) = open(&path, &none, LARGE) {
            let error = photo.colors(all_pixels().map(|(column, row)| middle(column, row)));
            assert!(error.is_err() || end + 8 > whole.len(), "{end} of {} bytes are enough", whole.len());
        }
    }
}

/// Bytes of a server that breaks down after some of them.
struct Breaking {
    bytes: Cursor<Vec<u8>>,
    left: usize,
}

impl Read for Breaking {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.left = self.left.checked_sub(out.len()).ok_or_else(|| io::Error::other("no answer"))?;
        self.bytes.read(out)
    }
}

impl Seek for Breaking {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.bytes.seek(to)
    }
}

/// What is not handed out may be there another time. That is no fault of the picture.
#[test]
fn bytes_that_do_not_come_are_no_bad_picture() {
    let folder = TempDir::new().unwrap();
    for compression in [Compression::Uncompressed, Compression::Deflate(Default::default())] {
        let path = folder.path().join("photo.tif");
        write::<RGB8>(&path, compression, &PLACE, &rgb());
        let bytes = std::fs::read(&path).unwrap();
        let mut refused = 0;
        for left in 0..bytes.len() {
            let bytes = Box::new(Breaking { bytes: Cursor::new(bytes.clone()), left });
            let middles = all_pixels().map(|(column, row)| middle(column, row));
            let found = Orthophoto::open(&path, bytes, &Crs::default(), LARGE);
            if let Err(error) = found.and_then(|photo| photo.colors(middles)) {
                assert!(
                    matches!(&error, Error::Io { source, .. } if source.to_string() == "no answer"),
                    "{left}: {error}"
                );
                refused += 1;
            }
        }
        assert!(refused > bytes.len() / 4, "{refused} of {}", bytes.len());
    }
}
