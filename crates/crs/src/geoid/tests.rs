//! Tests of grids and models of the geoid.

use super::*;
use flate2::write::ZlibEncoder;
use proptest::prelude::*;
use std::io::{Cursor, Write};
use std::path::PathBuf;
use sys::ErrorKind;
use tempfile::TempDir;
use tiff::encoder::colortype::{Gray16, Gray32Float};
use tiff::encoder::{Compression, TiffEncoder};
use tiff::tags::Tag;

/// A grid of 5 columns and 4 rows with its south-western node at 10.5, 45. Its heights are linear, so that they are known between nodes.
const CORNER: [f64; 2] = [10.5, 45.0];
const STEPS: [f64; 2] = [0.25, 0.5];

fn linear(longitude: f64, latitude: f64) -> f64 {
    40.0 + 2.0 * (longitude - 10.0) - 3.0 * (latitude - 45.0)
}

/// Returns the heights of [`linear`] row by row from the south.
fn heights() -> Vec<f32> {
    let height = |i: usize| linear(CORNER[0] + STEPS[0] * (i % 5) as f64, CORNER[1] + STEPS[1] * (i / 5) as f64);
    (0..20).map(|i| height(i) as f32).collect()
}

fn gtx(corner: [f64; 2], steps: [f64; 2], [columns, rows]: [i32; 2], heights: &[f32]) -> Vec<u8> {
    let numbers = [corner[1], corner[0], steps[1], steps[0]].into_iter().flat_map(f64::to_be_bytes);
    let sizes = [rows, columns].into_iter().flat_map(i32::to_be_bytes);
    numbers.chain(sizes).chain(heights.iter().flat_map(|height| height.to_be_bytes())).collect()
}

fn small_gtx() -> Vec<u8> {
    gtx(CORNER, STEPS, [5, 4], &heights())
}

/// What a test changes in a GeoTIFF.
struct Tiff {
    model: u16,
    raster: u16,
    nodata: &'static str,
    metadata: &'static str,
    compression: Compression,
}

impl Default for Tiff {
    fn default() -> Tiff {
        let compression = Compression::Deflate(tiff::encoder::DeflateLevel::Balanced);
        Tiff { model: 2, raster: 2, nodata: "-32768", metadata: "", compression }
    }
}

impl Tiff {
    fn bytes(&self, heights: &[f32]) -> Vec<u8> {
        let from_north: Vec<f32> = heights.chunks(5).rev().flatten().copied().collect();
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap().with_compression(self.compression);
        let mut image = encoder.new_image::<Gray32Float>(5, 4).unwrap();
        image.rows_per_strip(3).unwrap();
        let tags = image.encoder();
        let half = if self.raster == 2 { 0.0 } else { 0.5 };
        let tie = [0.0, 0.0, 0.0, CORNER[0] - half * STEPS[0], CORNER[1] + (3.0 + half) * STEPS[1], 0.0];
        tags.write_tag(Tag::ModelPixelScaleTag, &[STEPS[0], STEPS[1], 0.0][..]).unwrap();
        tags.write_tag(Tag::ModelTiepointTag, &tie[..]).unwrap();
        let keys = [1, 1, 0, 2, 1024, 0, 1, self.model, 1025, 0, 1, self.raster];
        tags.write_tag(Tag::GeoKeyDirectoryTag, &keys[..]).unwrap();
        tags.write_tag(Tag::GdalNodata, self.nodata).unwrap();
        if !self.metadata.is_empty() {
            tags.write_tag(Tag::Unknown(42112), self.metadata).unwrap();
        }
        image.write_data(&from_north).unwrap();
        bytes.into_inner()
    }
}

/// Returns a GeoTIFF as PROJ's package has them: tiles, here one of 16 x 16, packed by deflate after the floating-point predictor, which
/// takes the bytes of a row apart by their weight and keeps differences.
fn as_proj_packs_it(heights: &[f32]) -> Vec<u8> {
    const SIDE: usize = 16;
    let mut packed = ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    for row in 0..SIDE {
        let value = |column: usize| if row < 4 && column < 5 { heights[(3 - row) * 5 + column] } else { 0.0 };
        let planes: Vec<u8> = (0..4).flat_map(|byte| (0..SIDE).map(move |c| value(c).to_be_bytes()[byte])).collect();
        let before = |i: usize| if i == 0 { 0 } else { planes[i - 1] };
        let differences: Vec<u8> = (0..planes.len()).map(|i| planes[i].wrapping_sub(before(i))).collect();
        packed.write_all(&differences).unwrap();
    }
    let packed = packed.finish().unwrap();
    let doubles = |values: &[f64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let shorts = |values: &[u16]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let long = |value: usize| (value as u32).to_le_bytes().to_vec();
    // The number, the type (2 text, 3 short, 4 long, 12 double), the count and the value of each tag.
    let tags: Vec<(u16, u16, usize, Vec<u8>)> = vec![
        (256, 3, 1, shorts(&[5])),
        (257, 3, 1, shorts(&[4])),
        (258, 3, 1, shorts(&[32])),
        (259, 3, 1, shorts(&[8])),
        (262, 3, 1, shorts(&[1])),
        (277, 3, 1, shorts(&[1])),
        (317, 3, 1, shorts(&[3])),
        (322, 3, 1, shorts(&[SIDE as u16])),
        (323, 3, 1, shorts(&[SIDE as u16])),
        (324, 4, 1, long(8)),
        (325, 4, 1, long(packed.len())),
        (339, 3, 1, shorts(&[3])),
        (33550, 12, 3, doubles(&[STEPS[0], STEPS[1], 0.0])),
        (33922, 12, 6, doubles(&[0.0, 0.0, 0.0, CORNER[0], CORNER[1] + 3.0 * STEPS[1], 0.0])),
        (34735, 3, 12, shorts(&[1, 1, 1, 2, 1024, 0, 1, 2, 1025, 0, 1, 2])),
        (42113, 2, 7, b"-32768\0".to_vec()),
    ];
    let directory = (8 + packed.len()).next_multiple_of(2);
    let mut bytes = [b"II*\0".as_slice(), &long(directory), &packed].concat();
    bytes.resize(directory, 0);
    let (mut entries, mut values, behind) = (shorts(&[tags.len() as u16]), Vec::new(), directory + 6 + 12 * tags.len());
    for (tag, kind, count, value) in tags {
        entries.extend([shorts(&[tag, kind]), long(count)].concat());
        if value.len() > 4 {
            entries.extend(long(behind + values.len()));
            values.extend(value);
        } else {
            entries.extend(value.iter().chain(&[0; 4]).take(4));
        }
    }
    [bytes, entries, long(0), values].concat()
}

/// A file in a folder of its own.
fn written(name: &str, bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    sys::disk::create(&path).unwrap().write_all(bytes).unwrap();
    (folder, path)
}

fn opened(name: &str, bytes: &[u8]) -> Result<Geoid, Error> {
    let (_folder, path) = written(name, bytes);
    Geoid::open(Some(&HeightOffset::Grid(path)))
}

#[track_caller]
fn refused_with(geoid: Result<Geoid, Error>, words: &[&str]) {
    let error = geoid.err().map(|e| (e.kind(), e.to_string())).expect("an error");
    assert_eq!(error.0, ErrorKind::Usage);
    let told = words.iter().chain(&["[output] height_offset"]).all(|word| error.1.contains(word));
    assert!(told, "no {words:?} in {}", error.1);
}

#[test]
fn a_number_is_the_same_everywhere_and_nothing_is_zero() {
    let number = Geoid::open(Some(&HeightOffset::Metres(-22.5))).unwrap();
    assert_eq!((number.at(10.0, 50.0).unwrap(), number.model()), (-22.5, None));
    assert_eq!(Geoid::open(None).unwrap().at(f64::NAN, 0.0).unwrap(), 0.0);
}

#[test]
fn either_format_gives_the_same_heights_between_nodes() {
    let area = Tiff { raster: 1, compression: Compression::Uncompressed, ..Tiff::default() };
    for (name, bytes) in [
        ("grid.gtx", small_gtx()),
        ("grid.tif", Tiff::default().bytes(&heights())),
        ("area.tif", area.bytes(&heights())),
        ("proj.tif", as_proj_packs_it(&heights())),
        // What a file is, its content says.
        ("named.gtx", Tiff::default().bytes(&heights())),
    ] {
        let (_folder, path) = written(name, &bytes);
        let geoid = Geoid::open(Some(&HeightOffset::Grid(path))).unwrap();
        assert_eq!(geoid.model(), Some(name));
        for [x, y] in [[10.5, 45.0], [11.5, 46.5], [10.6, 45.1], [11.49, 46.4], [10.75, 45.5], [11.0, 46.2]] {
            for turn in [0.0, 360.0, -360.0] {
                let off = (geoid.at(x + turn, y).unwrap() - linear(x, y)).abs();
                assert!(off < 1e-5, "{name} {x} {y}: {off}");
            }
        }
        for [x, y] in [[10.49, 45.2], [11.51, 45.2], [11.0, 44.99], [11.0, 46.51], [-169.0, 46.0]] {
            let error = geoid.at(x, y).unwrap_err();
            let said = error.to_string();
            assert_eq!(error.kind(), ErrorKind::Usage);
            assert!(said.contains(name) && said.contains("10.500 to 11.500") && said.contains("egm96"), "{said}");
        }
    }
}

#[test]
fn a_grid_around_the_earth_has_no_gap() {
    // 36 columns from -180 to 170.
    let heights: Vec<f32> = (0..36 * 19).map(|i| (i % 36) as f32).collect();
    let geoid = {
        let (folder, path) = written("world.gtx", &gtx([-180.0, -90.0], [10.0, 10.0], [36, 19], &heights));
        let geoid = Geoid::open(Some(&HeightOffset::Grid(path))).unwrap();
        (folder, geoid)
    };
    let at = |longitude: f64| geoid.1.at(longitude, 12.0).unwrap();
    assert_eq!((at(-180.0), at(180.0), at(170.0), at(-170.0)), (0.0, 0.0, 35.0, 1.0));
    assert_eq!((at(175.0), at(535.0)), (17.5, 17.5));
    assert_eq!((geoid.1.at(0.0, 90.0).unwrap(), geoid.1.at(0.0, -90.0).unwrap()), (18.0, 18.0));
}

#[test]
fn a_place_beside_a_node_without_a_height_is_an_error_and_one_on_another_node_is_none() {
    let with = |nothing: f32| {
        let mut heights = heights();
        heights[6] = nothing;
        heights
    };
    for (name, bytes) in [
        ("grid.gtx", gtx(CORNER, STEPS, [5, 4], &with(-88.8888))),
        ("far.gtx", gtx(CORNER, STEPS, [5, 4], &with(1e30))),
        ("nan.gtx", gtx(CORNER, STEPS, [5, 4], &with(f32::NAN))),
        ("grid.tif", Tiff::default().bytes(&with(-32768.0))),
        ("nan.tif", Tiff { nodata: "nan", ..Tiff::default() }.bytes(&with(f32::NAN))),
    ] {
        let (_folder, path) = written(name, &bytes);
        let geoid = Geoid::open(Some(&HeightOffset::Grid(path))).unwrap();
        let said = geoid.at(10.8, 45.4).unwrap_err().to_string();
        for words in ["has no height at longitude 10.80000", "but a neighbouring node", "NaN", "repair the grid"] {
            assert!(said.contains(words), "{name}: {said}");
        }
        let outside = geoid.at(40.0, 45.4).unwrap_err().to_string();
        assert!(outside.contains("covers the terrain") && !outside.contains("NaN"), "{outside}");
        assert!(geoid.at(11.1, 45.4).is_ok() && geoid.at(10.5, 45.5).is_ok(), "{name}");
    }
}

#[test]
fn files_that_are_no_grids_are_refused_by_name() {
    refused_with(Geoid::open(Some(&HeightOffset::Grid("no/such.gtx".into()))), &["no/such.gtx", "correct its name"]);
    let folder = tempfile::tempdir().unwrap();
    refused_with(Geoid::open(Some(&HeightOffset::Grid(folder.path().into()))), &["it is not a file"]);
    let small = small_gtx();
    refused_with(opened("a.gtx", &[]), &["a.gtx", "0 bytes"]);
    refused_with(opened("a.gtx", &small[..39]), &["39 bytes"]);
    refused_with(opened("a.gtx", &small[..119]), &["cut off", "take 120 bytes, and it has 119"]);
    refused_with(opened("a.gtx", &gtx(CORNER, [0.0, 0.5], [5, 4], &heights())), &["GTX", "no grid"]);
    refused_with(opened("a.gtx", &gtx(CORNER, STEPS, [-5, 4], &heights())), &["no grid"]);
    refused_with(opened("a.gtx", &gtx(CORNER, [f64::NAN, 0.5], [5, 4], &heights())), &["no grid"]);
    refused_with(opened("a.gtx", &gtx([500_000.0, 4e6], [10.0, 10.0], [5, 4], &heights())), &["in degrees"]);
    refused_with(opened("a.gtx", &gtx(CORNER, [1e-9, 1e-9], [i32::MAX, i32::MAX], &heights())), &["cut off"]);
    refused_with(opened("a.gtx", b"this is a text about geoids, in so many words"), &["a.gtx"]);
}

#[test]
fn geotiffs_of_another_kind_are_refused_by_name() {
    let tiff = |tiff: Tiff| opened("a.tif", &tiff.bytes(&heights()));
    refused_with(tiff(Tiff { model: 1, ..Tiff::default() }), &["a.tif", "not longitude and latitude"]);
    let kind = "<GDALMetadata><Item name=\"TYPE\">HORIZONTAL_OFFSET</Item></GDALMetadata>";
    refused_with(tiff(Tiff { metadata: kind, ..Tiff::default() }), &["of the type HORIZONTAL_OFFSET"]);
    let unit = "<GDALMetadata><Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">foot</Item></GDALMetadata>";
    refused_with(tiff(Tiff { metadata: unit, ..Tiff::default() }), &["in foot, not in metres"]);
    let scale = "<GDALMetadata><Item name=\"SCALE\" sample=\"0\" role=\"scale\">0.01</Item></GDALMetadata>";
    refused_with(tiff(Tiff { metadata: scale, ..Tiff::default() }), &["scaled"]);
    let right = "<GDALMetadata><Item name=\"TYPE\">VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL</Item>\
                 <Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">metre</Item></GDALMetadata>";
    assert!(tiff(Tiff { metadata: right, ..Tiff::default() }).is_ok());
    let mut bytes = Cursor::new(Vec::new());
    TiffEncoder::new(&mut bytes).unwrap().write_image::<Gray16>(5, 4, &[0; 20]).unwrap();
    refused_with(opened("a.tif", &bytes.into_inner()), &["32-bit floating point"]);
    let mut bytes = Cursor::new(Vec::new());
    TiffEncoder::new(&mut bytes).unwrap().write_image::<Gray32Float>(5, 4, &[0.0; 20]).unwrap();
    refused_with(opened("a.tif", &bytes.into_inner()), &["is not georeferenced"]);
}

#[test]
fn a_damaged_part_of_a_geotiff_is_an_error_where_it_is_needed() {
    let mut bytes = as_proj_packs_it(&heights());
    // The tile begins behind the header of 8 bytes.
    bytes[8..24].fill(0x55);
    let (_folder, path) = written("grid.tif", &bytes);
    let geoid = Geoid::open(Some(&HeightOffset::Grid(path))).unwrap();
    let error = geoid.at(11.0, 46.2).unwrap_err();
    assert!(error.kind() == ErrorKind::Usage && error.to_string().contains("part 0 of the grid"), "{error}");
}

/// Heights that NASA and NIMA give with the model (OUTPUT.DAT of its program F477), in metres.
const KNOWN: [([f64; 2], f64); 6] = [
    ([269.779155, 38.628155], -31.628),
    ([305.021114, -14.621217], -2.969),
    ([102.448729, 46.874319], -43.575),
    ([133.874712, -23.617446], 15.871),
    ([359.9995, 38.625473], 50.066),
    ([0.0023, -0.466744], 17.329),
];

#[test]
fn egm96_is_where_its_authors_have_it() {
    let geoid = Geoid::open(Some(&HeightOffset::Egm96)).unwrap();
    assert_eq!(geoid.model(), Some("egm96"));
    for ([longitude, latitude], known) in KNOWN {
        for turn in [0.0, -360.0] {
            let found = geoid.at(longitude + turn, latitude).unwrap();
            assert!((found - known).abs() < 0.045, "{longitude} {latitude}: {found}, {known}");
        }
    }
    let at_node = geoid.at(10.05, 47.35).unwrap();
    let exact = ::egm96::egm96_compute_altitude_offset(47.35, 10.05);
    assert!((at_node - exact).abs() <= 0.000_501, "{at_node} {exact}");
    assert!(geoid.at(0.0, 90.0).unwrap() > 12.0 && geoid.at(77.0, -90.0).unwrap() < -28.0);
}

#[test]
fn egm96_has_no_steps() {
    let geoid = Geoid::open(Some(&HeightOffset::Egm96)).unwrap();
    let mut last = geoid.at(179.9, 20.0).unwrap();
    for i in 1..400 {
        let next = geoid.at(179.9 + f64::from(i) * 0.0005, 20.0 + f64::from(i) * 0.0003).unwrap();
        assert!((next - last).abs() < 0.02, "{i}: {last}, {next}");
        last = next;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn no_bytes_make_it_panic(at in 0usize..500, with: [u8; 4], cut in 0usize..600, tiff: bool) {
        let mut bytes = if tiff { as_proj_packs_it(&heights()) } else { small_gtx() };
        let at = at % (bytes.len() - 4);
        bytes[at..at + 4].copy_from_slice(&with);
        bytes.truncate(bytes.len() - cut.saturating_sub(300).min(bytes.len()));
        if let Ok(geoid) = opened("grid.tif", &bytes) {
            for [x, y] in [[10.5, 45.0], [11.0, 45.7], [11.5, 46.5]] {
                let _ = geoid.at(x, y);
            }
        }
    }
}
