//! `[output] color = "photo.tif"`: vertices have the colours of the pixels that they lie in.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use tempfile::TempDir;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::RGB8;
use tiff::tags::Tag;
use tiles::color::from_srgb;
use tiles::gltf::read::read_tile;
use verify::SourceGrid;

use crate::program::Job;
use crate::web_server::{Answer, WebServer};

/// Points side by side, a unit apart; the picture has as many pixels, but lacks the columns in the east.
const SIDE: u32 = 40;
const COLUMNS: u32 = 30;
const GREY: [u8; 3] = [170; 3];

/// Returns the colour of the pixel around a point.
fn pixel(x: u32, y: u32, blue: u8) -> [u8; 3] {
    [(x * 6) as u8, (y * 6) as u8, blue]
}

/// Writes a picture whose pixels have the points in their middles. It says no CRS.
fn write_photo(path: &Path, blue: u8) {
    let mut encoder = TiffEncoder::new(File::create(path).unwrap()).unwrap();
    let mut image = encoder.new_image::<RGB8>(COLUMNS, SIDE).unwrap();
    image.rows_per_strip(7).unwrap();
    image.encoder().write_tag(Tag::ModelPixelScaleTag, &[1.0, 1.0, 0.0][..]).unwrap();
    image.encoder().write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, -0.5, f64::from(SIDE) - 0.5, 0.0][..]).unwrap();
    let rows = (0..SIDE).rev();
    let data: Vec<u8> = rows.flat_map(|y| (0..COLUMNS).flat_map(move |x| pixel(x, y, blue))).collect();
    image.write_data(&data).unwrap();
}

/// Returns the colours of all vertices in the exact tiles of a job by place. A vertex of several tiles has one colour.
fn colors(job: &Job) -> BTreeMap<[u32; 2], [u16; 3]> {
    let mut colors = BTreeMap::new();
    for tile in std::fs::read_dir(job.out().join("tiles")).unwrap() {
        let tile = read_tile(&tile.unwrap().path()).unwrap();
        let (source, part) = (SourceGrid::new(&tile.extras).unwrap(), &tile.parts[0]);
        for (v, &[red, green, blue, _]) in part.colors.as_ref().unwrap().iter().enumerate() {
            let [x, y, _] = source.coordinates(source.integers(part.world(v)).unwrap());
            let known = colors.insert([x as u32, y as u32], [red, green, blue]);
            assert!(known.is_none_or(|known| known == [red, green, blue]), "two colours at {x}, {y}");
        }
    }
    colors
}

#[test]
fn vertices_have_the_colours_of_an_orthophoto_in_any_tiles() {
    let folder = TempDir::new().unwrap();
    let [cloud, photo] = ["cloud.csv", "photo.tif"].map(|name| folder.path().join(name));
    let places = || (0..SIDE).flat_map(|x| (0..SIDE).map(move |y| [x, y]));
    // Heights that differ a little, so that the job has something to triangulate.
    let rows: String = places().map(|[x, y]| format!("{x},{y},{}\n", (x * y) % 7)).collect();
    std::fs::write(&cloud, format!("x,y,z\n{rows}")).unwrap();
    let job = |sites: u64| {
        let job = Job::on(&[&cloud]).tiles_of(sites).with("output", "compression = \"none\"");
        job.with("output", &format!("color = {:?}", photo.display().to_string()))
    };
    let expected = |blue: u8| -> BTreeMap<[u32; 2], [u16; 3]> {
        let color = |x, y| if x < COLUMNS { pixel(x, y, blue) } else { GREY };
        places().map(|[x, y]| ([x, y], from_srgb(color(x, y)))).collect()
    };
    write_photo(&photo, 200);
    let jobs = [150, 5000].map(job);
    for job in &jobs {
        let report = job.report();
        assert_eq!(report["vertex_colors"], "orthophoto");
        let warnings: Vec<&str> =
            report["warnings"].as_array().unwrap().iter().filter_map(|warning| warning.as_str()).collect();
        assert!(warnings.iter().any(|warning| warning.contains("400 vertices are grey, outside ")), "{warnings:?}");
        assert_eq!(colors(job), expected(200));
    }
    // Another picture by the same name.
    write_photo(&photo, 100);
    let [job, _] = jobs;
    job.report();
    assert_eq!(colors(&job), expected(100));
    job.verified();
    std::fs::write(&photo, "no picture").unwrap();
    job.run().refused(3, &["photo.tif", "[output] color", "not a readable GeoTIFF"]);
    std::fs::remove_file(&photo).unwrap();
    job.run().refused(2, &["[output] color: there is no file", "photo.tif"]);
}

/// A picture by URL gives the results of one on this machine. Its query is in no report, and what a server does not hand out may come later.
#[test]
fn an_orthophoto_may_be_on_a_server() {
    let folder = TempDir::new().unwrap();
    let [cloud, photo] = ["cloud.csv", "photo.tif"].map(|name| folder.path().join(name));
    let rows: String = (0..SIDE).flat_map(|x| (0..SIDE).map(move |y| format!("{x},{y},{}\n", (x * y) % 7))).collect();
    std::fs::write(&cloud, format!("x,y,z\n{rows}")).unwrap();
    write_photo(&photo, 200);
    let server = WebServer::of(&[("/a/photo.tif", std::fs::read(&photo).unwrap())]);
    let job = |color: &str| {
        let job = Job::on(&[&cloud]).with("output", &format!("color = {color:?}"));
        job.variable("GDT_TIMEOUT_MS", "2000")
    };
    let expected = job(&photo.display().to_string()).report();
    let by_url = job(&server.url("/a/photo.tif?key=SECRET"));
    let report = by_url.report();
    assert_eq!(report["file_list"], expected["file_list"]);
    assert!(report["file_list"].is_string());
    let text = report.to_string();
    assert!(
        text.contains("outside http://") && text.contains("/a/photo.tif?...") && !text.contains("SECRET"),
        "{text}"
    );
    job(&server.url("/a/none.tif")).run().refused(2, &["/a/none.tif", "there is no file"]);
    server.answer(|_, _| Answer::Status(401, "X: y"));
    by_url.run().refused(1, &["cannot read", "/a/photo.tif?...", "401"]);
}
