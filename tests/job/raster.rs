//! `[output.raster]`: every cell has the height of the triangle at its centre, whatever the tiles, threads and parts.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufReader, Cursor};
use std::path::{Path, PathBuf};

use serde_json::Value;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;
use tiles::gltf::read::read_tile;

use crate::clouds::{self, Cloud};
use crate::coordinate_systems::{keys, warnings, write};
use crate::levels::hills;
use crate::parts::{in_files, in_parts};
use crate::program::{Job, gdt_batch, number};
use crate::tileset::files_below;

/// An image of a raster.
#[derive(Debug)]
pub(crate) struct Image {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) cells: Vec<f32>,
}

/// A raster as another reader sees it: the raster itself, then its overviews.
pub(crate) struct Raster {
    pub(crate) images: Vec<Image>,
    /// The x of the western and the y of the northern edge.
    pub(crate) corner: [f64; 2],
    nodata: String,
    keys: Vec<u32>,
}

/// Returns the cells of a raster of one file, without its overviews.
fn cells(job: &Job, file: &str) -> DecodingResult {
    Decoder::new(BufReader::new(File::open(job.out().join(file)).unwrap())).unwrap().read_image().unwrap()
}

fn bytes(job: &Job) -> Vec<u8> {
    fs::read(job.out().join("terrain.tif")).unwrap()
}

pub(crate) fn raster(job: &Job) -> Raster {
    let mut decoder = Decoder::new(BufReader::new(File::open(job.out().join("terrain.tif")).unwrap())).unwrap();
    let place = decoder.get_tag_f64_vec(Tag::Unknown(33922)).unwrap();
    let mut raster = Raster {
        images: Vec::new(),
        corner: [place[3], place[4]],
        nodata: decoder.get_tag_ascii_string(Tag::Unknown(42113)).unwrap(),
        keys: decoder.get_tag_u32_vec(Tag::Unknown(34735)).unwrap_or_default(),
    };
    loop {
        let (width, height) = decoder.dimensions().unwrap();
        let DecodingResult::F32(cells) = decoder.read_image().unwrap() else { panic!("not of single precision") };
        let [width, height] = [width, height].map(|side| side as usize);
        raster.images.push(Image { width, height, cells });
        if !decoder.more_images() {
            return raster;
        }
        decoder.next_image().unwrap();
    }
}

/// Returns the triangles of all tiles, in the source's coordinates.
fn triangles(job: &Job) -> Vec<[[f64; 3]; 3]> {
    let text = fs::read(job.out().join("georeference.json")).unwrap();
    let georeference: Value = serde_json::from_slice(&text).unwrap();
    let offset = [0, 1, 2].map(|axis| georeference["offset"][axis].as_f64().unwrap());
    let mut found = Vec::new();
    for path in files_below(&job.out().join("tiles")) {
        for part in read_tile(&path).unwrap().parts {
            // The clouds have whole coordinates.
            let corner = |v: u32| {
                let [x, up, z] = part.world(v as usize);
                [x + offset[0], offset[1] - z, offset[2] + up].map(f64::round)
            };
            found.extend(part.triangles.iter().map(|t| t.map(corner)));
        }
    }
    found
}

/// Asserts that the raster of a job with cells of `side` has in every cell what the triangle at its centre says, and nothing where there is
/// none. Returns how many cells have a height.
#[track_caller]
fn has_the_heights_of_the_triangles(job: &Job, side: f64) -> usize {
    let raster = raster(job);
    let Image { width, height, cells } = &raster.images[0];
    assert_eq!(raster.corner.map(|edge| (edge / side).fract()), [0.0; 2], "aligned to multiples of the resolution");
    let mut expected: Vec<Option<f64>> = vec![None; width * height];
    for [a, b, c] in triangles(job) {
        let span = |axis: usize| {
            let values = [a[axis], b[axis], c[axis]];
            values.into_iter().fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v), high.max(v)])
        };
        let [[west, east], [south, north]] = [span(0), span(1)];
        let first = |from: f64, to: f64| ((from - to) / side - 1.0).max(0.0) as usize;
        let (columns, rows) = (first(west, raster.corner[0]), first(raster.corner[1], north));
        let past = |from: f64, to: f64, most: usize| (((to - from) / side) as usize + 2).min(most);
        for row in rows..past(south, raster.corner[1], *height) {
            for column in columns..past(raster.corner[0], east, *width) {
                let x = raster.corner[0] + (column as f64 + 0.5) * side;
                let y = raster.corner[1] - (row as f64 + 0.5) * side;
                // Twice the areas; exact, because all numbers are short.
                let area = |p: [f64; 3], q: [f64; 3]| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
                let weights = [area(b, c), area(c, a), area(a, b)];
                if weights.iter().all(|weight| *weight >= 0.0) {
                    let sum: f64 = weights.iter().sum();
                    let z = (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) / sum;
                    expected[row * width + column] = Some(z);
                }
            }
        }
    }
    let nodata: f32 = raster.nodata.parse().unwrap();
    for (number, (found, expected)) in cells.iter().zip(&expected).enumerate() {
        match expected {
            // The last bits of the double may differ, and so the rounding to single precision.
            Some(z) => assert!((f64::from(*found) - z).abs() <= z.abs() * 1.2e-7, "cell {number}: {found}, {z}"),
            None => assert_eq!(found.to_bits(), nodata.to_bits(), "cell {number} has no triangle"),
        }
    }
    expected.iter().flatten().count()
}

/// Returns a job on small tiles with a raster of these options.
fn with_raster(job: Job, options: &str) -> Job {
    job.with("output", &format!("raster = {{ {options} }}"))
}

#[test]
fn cells_have_the_heights_of_the_triangles_in_any_tiling() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &clouds::clusters(6_000), 100_000);
    for (options, side, more) in [
        ("resolution = 1500.0", 1500.0, "format = \"glb\""),
        (
            "resolution = 750, compression = \"none\", nodata = \"nan\"",
            750.0,
            "max_edge = 9000.0\ncompression = \"meshopt\"",
        ),
        ("resolution = 256, nodata = 0", 256.0, "hull = \"whole\"\ncompression = \"none\""),
    ] {
        let run = |job: Job| {
            let job = with_raster(job, options).with("output", more);
            let report = job.report();
            assert!(number(&report["raster"]["bytes"]) > 0);
            job
        };
        let first = run(Job::on(&files).tiles_of(400).threads(1));
        let covered = has_the_heights_of_the_triangles(&first, side);
        let all = raster(&first).images[0].cells.len();
        assert!(covered > 1_000 && covered < all, "{covered} of {all}");
        for other in [run(Job::on(&files).tiles_of(2_000).threads(2)), run(in_parts(&files, 1_500))] {
            assert!(bytes(&other) == bytes(&first), "{options}");
            other.verified();
        }
        if side == 1500.0 {
            let by_tasks = with_raster(in_parts(&files, 1_500), options).with("output", more);
            by_tasks.run_with(&["submit", "--engine", "local", "--tasks", "2"]).succeeded();
            assert!(bytes(&by_tasks) == bytes(&first), "by tasks");
        }
    }
}

#[test]
fn points_at_the_centres_are_the_cells() {
    let folder = tempfile::tempdir().unwrap();
    let points: Cloud = (0..30 * 20).map(|i| [i % 30 * 2 - 7, i / 30 * 2 + 41, (i * 7919) % 997 - 300]).collect();
    let cloud = clouds::write(folder.path(), "cloud.csv", &points);
    let job = with_raster(Job::on(&[&cloud]).with("output", "hull = \"whole\""), "resolution = 2, nodata = -300");
    let report = job.report();
    let raster = raster(&job);
    // Of the first row: that of the northernmost points.
    assert_eq!((raster.corner, raster.nodata.as_str()), ([-8.0, 80.0], "-300"));
    let Image { width, height, cells } = &raster.images[0];
    assert_eq!((*width, *height, raster.images.len()), (30, 20, 1));
    for (i, [_, _, z]) in points.iter().enumerate() {
        assert_eq!(cells[(19 - i / 30) * 30 + i % 30], *z as f32);
    }
    let said = warnings(&report);
    let lowest = points.iter().find(|point| point[2] == -300).unwrap();
    let place = format!("points at ({}, {}) have it", lowest[0], lowest[1]);
    for words in
        ["terrain.tif has the height -300 in 1 cell,", &place, "[input] nodata = -300 if", "[output.raster] nodata = "]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
    // Centres on edges and on vertices belong to no tile more than to another.
    let other = with_raster(
        Job::on(&[&cloud]).tiles_of(24).with("output", "hull = \"whole\""),
        "resolution = 2, nodata = -300",
    );
    other.report();
    assert!(bytes(&other) == bytes(&job));
}

/// Returns the height of point number `column`, `row` of a grid in hundredths.
fn dem_height(column: i64, row: i64) -> i64 {
    31_250 + 117 * column - 53 * row + (column * 7919 + row * 104_729) % 997
}

/// A grid of heights whose cell centres are at whole multiples of the cells' side comes back cell by cell, on the border too.
#[test]
fn a_grid_of_heights_comes_back_if_the_origin_is_its_own() {
    let (columns, rows, west, south) = (60, 50, 461_200.0, 5_732_800.0);
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("x,y,z\n");
    for (column, row) in (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))) {
        let [x, y, z] = [west + 0.5 * column as f64, south + 0.5 * row as f64, dem_height(column, row) as f64 / 100.0];
        text += &format!("{x},{y},{z}\n");
    }
    let dem = folder.path().join("dem.csv");
    fs::write(&dem, text).unwrap();
    // Any corner of a cell will do, in any tiling.
    for (origin, per_tile) in [("[0.25, 0.25]", 5_000), ("[461199.75, -7.25]", 300)] {
        let job = with_raster(Job::on(&[&dem]).tiles_of(per_tile), &format!("resolution = 0.5, origin = {origin}"));
        let check = job.run_with(&["check"]).succeeded().out;
        assert!(check.contains("about 60 x 50 cells"), "{check}");
        job.report();
        let raster = raster(&job);
        assert_eq!(raster.corner, [west - 0.25, south + 0.5 * rows as f64 - 0.25]);
        let Image { width, height, cells } = &raster.images[0];
        assert_eq!((*width as i64, *height as i64), (columns, rows));
        for (number, found) in (0..).zip(cells) {
            let (column, row) = (number % columns, rows - 1 - number / columns);
            assert_eq!(*found, (dem_height(column, row) as f64 / 100.0) as f32, "column {column}, row {row}");
        }
    }
    // By default centres are between four of its points.
    let job = with_raster(Job::on(&[&dem]), "resolution = 0.5");
    job.report();
    let image = &raster(&job).images[0];
    assert_eq!((image.width, image.height), (59, 49));
}

#[test]
fn overviews_are_means_of_the_heights_below() {
    let strip: Cloud = hills(20_000, 3).into_iter().filter(|point| point[1] < 1_000).collect();
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &strip);
    let job = |threads: usize, memory: &str| {
        let job = with_raster(Job::on(&[&cloud]).tiles_of(1_000), "resolution = 9.0").threads(threads);
        let job = job.with("limits", &format!("memory = \"{memory}\""));
        job.report();
        job
    };
    // With little memory a window is smaller.
    let (job, small) = (job(2, "1 GiB"), job(1, "128 MiB"));
    assert!(bytes(&job) == bytes(&small));
    let images = raster(&job).images;
    assert!(images.len() > 3 && images[0].width > 2048, "{} x {}", images[0].width, images[0].height);
    for pair in images.windows(2) {
        let (fine, coarse) = (&pair[0], &pair[1]);
        assert_eq!([coarse.width, coarse.height], [fine.width, fine.height].map(|side| side.div_ceil(2)));
        for (number, mean) in coarse.cells.iter().enumerate() {
            let (column, row) = (number % coarse.width * 2, number / coarse.width * 2);
            let below = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(east, south)| (column + east, row + south));
            let inside = below.iter().filter(|(column, row)| *column < fine.width && *row < fine.height);
            let heights = inside.map(|(column, row)| fine.cells[row * fine.width + column]).filter(|z| *z != -9999.0);
            let (sum, count) = heights.fold((0.0, 0.0), |(sum, count), z| (sum + f64::from(z), count + 1.0));
            assert_eq!(*mean, if count > 0.0 { (sum / count) as f32 } else { -9999.0 });
        }
    }
    let last = images.last().unwrap();
    assert!(last.width <= 512 && last.height <= 512);
}

/// Returns what the attributes of a line of a list say, as numbers.
fn attributes<const N: usize>(line: &str, names: [&str; N]) -> [usize; N] {
    names.map(|name| {
        let (_, after) = line.split_once(&format!("{name}=\"")).unwrap();
        after.split('"').next().unwrap().parse().unwrap()
    })
}

/// Returns the cells of a grid of floating-point files, and the lines that name the files. It must have the place and the size of `whole`.
#[track_caller]
fn cells_of_files(job: &Job, list: &str, whole: &Raster) -> (Vec<f32>, Vec<String>) {
    let list = fs::read_to_string(job.out().join(list)).unwrap();
    let lines =
        |name: &str| list.lines().filter(move |line| line.contains(name)).map(str::to_owned).collect::<Vec<_>>();
    let [width, height] = attributes(&lines("<VRTDataset")[0], ["rasterXSize", "rasterYSize"]);
    assert_eq!((width, height), (whole.images[0].width, whole.images[0].height));
    let mut cells = vec![-9999.0; width * height];
    let (names, places) = (lines("<SourceFilename"), lines("<DstRect"));
    for (name, place) in names.iter().zip(&places) {
        let uri = name.split(['>', '<']).nth(2).unwrap();
        let [left, top, columns, rows] = attributes(place, ["xOff", "yOff", "xSize", "ySize"]);
        let mut decoder = Decoder::new(BufReader::new(File::open(job.out().join(uri)).unwrap())).unwrap();
        assert_eq!(decoder.dimensions().unwrap(), (columns as u32, rows as u32));
        let corner = decoder.get_tag_f64_vec(Tag::Unknown(33922)).unwrap();
        assert_eq!(corner[3..5], [whole.corner[0] + 9.0 * left as f64, whole.corner[1] - 9.0 * top as f64]);
        let DecodingResult::F32(own) = decoder.read_image().unwrap() else { panic!("not of single precision") };
        for (row, own) in own.chunks(columns).enumerate() {
            cells[(top + row) * width + left..][..columns].copy_from_slice(own);
        }
    }
    (cells, names)
}

#[test]
fn a_grid_of_files_has_the_cells_of_the_one_file() {
    // A ring, so that there are files without any tile.
    let ring: Cloud = hills(20_000, 3);
    let far = |point: &[i64; 3]| [point[0] - 10_000, point[1] - 10_000].iter().any(|way| way.abs() > 6_000);
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &ring.into_iter().filter(far).collect::<Cloud>());
    let job = |options: &str| {
        let job = with_raster(Job::on(&[&cloud]).tiles_of(500), &format!("resolution = 9.0{options}"));
        job.with("output", "max_edge = 900.0")
    };
    let whole = job("");
    whole.report();
    let image = &raster(&whole).images[0];
    let parts = job(", cells_per_file = 512");
    let report = parts.report();
    let (cells, names) = cells_of_files(&parts, "terrain.vrt", &raster(&whole));
    assert!(cells == image.cells);
    let [files, heights] = ["files", "heights"].map(|key| number(&report["raster"][key]));
    let with_height = image.cells.iter().filter(|z| **z != -9999.0).count();
    assert_eq!((files as usize, heights as usize), (names.len(), with_height));
    assert!((4..25).contains(&names.len()), "{names:?}");
    parts.verified();
    // Parts have the same files, and what another job does not write it removes.
    let by_parts = in_parts(&in_files(folder.path(), &hills(2_000, 3), 1_000), 1_000);
    let by_parts = with_raster(by_parts, "resolution = 30.0, cells_per_file = 512");
    by_parts.report();
    let text = fs::read_to_string(by_parts.config()).unwrap();
    fs::write(by_parts.config(), text.replace(", cells_per_file = 512", "")).unwrap();
    gdt_batch(by_parts.folder(), &["job.toml"]).succeeded();
    assert!(by_parts.out().join("terrain.tif").exists());
    assert!(!by_parts.out().join("terrain.vrt").exists() && !by_parts.out().join("raster").exists());
}

/// The rasters that follow from the heights have, in every cell of the terrain, what Horn's formulas have there; in any tiling, and in
/// files whose cells have their neighbours in other files.
#[test]
fn slopes_and_shades_follow_from_the_heights() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &hills(8_000, 3));
    let job = |per_tile, options: &str| {
        let options =
            format!("resolution = 9.0, products = [\"slope\", \"hillshade\", \"aspect\", \"height\"]{options}");
        let job = with_raster(Job::on(&[&cloud]).tiles_of(per_tile), &options);
        (job.report(), job)
    };
    let (report, whole) = job(1_000, "");
    assert_eq!(report["raster"]["products"], serde_json::json!(["height", "hillshade", "slope", "aspect"]));
    let raster = raster(&whole);
    let Image { width, height, cells: heights } = &raster.images[0];
    let (DecodingResult::F32(slopes), DecodingResult::F32(aspects), DecodingResult::U8(shades)) =
        (cells(&whole, "slope.tif"), cells(&whole, "aspect.tif"), cells(&whole, "hillshade.tif"))
    else {
        panic!("rasters of other numbers")
    };
    let mut inner = 0;
    for number in 0..heights.len() {
        let has_height = heights[number] != -9999.0;
        assert_eq!((slopes[number] != -9999.0, shades[number] != 0), (has_height, has_height), "cell {number}");
        let (column, row) = (number % width, number / width);
        if column == 0 || row == 0 || column + 1 == *width || row + 1 == *height {
            continue;
        }
        let around: Vec<f64> = [-1i64, 0, 1]
            .iter()
            .flat_map(|south| [-1i64, 0, 1].map(|east| number as i64 + south * *width as i64 + east))
            .map(|at| f64::from(heights[at as usize]))
            .collect();
        if around.contains(&-9999.0) {
            continue;
        }
        let weighted = |cells: [(usize, f64); 6]| cells.iter().map(|(n, w)| around[*n] * w).sum::<f64>() / 72.0;
        let east = weighted([(2, 1.0), (5, 2.0), (8, 1.0), (0, -1.0), (3, -2.0), (6, -1.0)]);
        let north = weighted([(0, 1.0), (1, 2.0), (2, 1.0), (6, -1.0), (7, -2.0), (8, -1.0)]);
        let slope = east.hypot(north).atan().to_degrees();
        assert!((f64::from(slopes[number]) - slope).abs() < 1e-4, "cell {number}: {} {slope}", slopes[number]);
        // The sun is at (-1, 1, sqrt 2) / 2, the normal of the terrain at (-east, -north, 1).
        let light = (east - north + 2f64.sqrt()) / 2.0 / (1.0 + east * east + north * north).sqrt();
        let shade = (1.0 + 254.0 * light.max(0.0)).round();
        assert!((f64::from(shades[number]) - shade).abs() <= 1.0, "cell {number}: {} {shade}", shades[number]);
        let downhill = (-east).atan2(-north).to_degrees().rem_euclid(360.0);
        let off = (f64::from(aspects[number]) - downhill).abs();
        assert!(slope < 1e-3 || off.min(360.0 - off) < 0.1, "cell {number}: {} {downhill}", aspects[number]);
        inner += 1;
    }
    assert!(inner > 10_000, "{inner}");
    let (_, other) = job(300, "");
    for file in ["slope.tif", "aspect.tif", "hillshade.tif", "terrain.tif"] {
        let [a, b] = [&whole, &other].map(|job| fs::read(job.out().join(file)).unwrap());
        assert!(a == b, "{file}");
    }
    let (_, files) = job(1_000, ", cells_per_file = 512");
    let (of_files, names) = cells_of_files(&files, "slope.vrt", &raster);
    assert!(of_files == slopes && names.len() > 4 && names[0].contains("slope/000000.tif"), "{names:?}");
    files.verified();
}

/// Returns the names and the bytes of all files of a raster, and the list of them.
fn grid_of_files(job: &Job) -> BTreeMap<PathBuf, Vec<u8>> {
    let paths = files_below(&job.out().join("raster")).into_iter().chain([job.out().join("terrain.vrt")]);
    paths.map(|path| (path.strip_prefix(job.out()).unwrap().into(), fs::read(&path).unwrap())).collect()
}

/// The box around a large tile of a band along a curve reaches over many files without a cell of the terrain.
#[test]
fn which_files_a_grid_has_depends_on_its_cells_alone() {
    let along_curve = |n: i64| {
        let angle = n as f64 / 4_000.0 * std::f64::consts::FRAC_PI_2;
        let radius = 19_000.0 + (n * 7919 % 1_000) as f64;
        [(radius * angle.cos()) as i64, (radius * angle.sin()) as i64, n % 97]
    };
    let band: Cloud = (0..4_000).map(along_curve).collect();
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &band, 100_000);
    let run = |job: Job| {
        let job = with_raster(job, "resolution = 9.0, cells_per_file = 512").with("output", "max_edge = 900.0");
        let report = job.report();
        let found = grid_of_files(&job);
        assert_eq!(number(&report["raster"]["files"]), found.len() as u64 - 1);
        (job, found)
    };
    let (job, found) = run(Job::on(&files).tiles_of(100_000));
    job.verified();
    let list = String::from_utf8(found[Path::new("terrain.vrt")].clone()).unwrap();
    for name in found.keys().filter(|name| name.starts_with("raster")) {
        assert!(list.contains(&format!(">{}<", name.display())), "{}", name.display());
        let mut decoder = Decoder::new(Cursor::new(&found[name])).unwrap();
        let DecodingResult::F32(cells) = decoder.read_image().unwrap() else { panic!("not of single precision") };
        assert!(cells.iter().any(|z| *z != -9999.0), "{} has no height", name.display());
    }
    // The box of the band has 25 files.
    assert!((7..20).contains(&found.len()) && list.matches("<SimpleSource>").count() == found.len() - 1, "{list}");
    for job in [Job::on(&files).tiles_of(300), in_parts(&files, 1_000)] {
        let (_, other) = run(job);
        assert_eq!(other.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>());
        assert!(other == found, "other bytes");
    }
}

#[test]
fn a_raster_has_any_size_that_a_file_can_have() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(500, 2_000, 5));
    // One cell with its centre in the terrain, and one with its centre far away.
    for (side, is_inside) in [(2_000.0, true), (1e9, false)] {
        let job = with_raster(Job::on(&[&cloud]), &format!("resolution = {side:?}"));
        let report = job.report();
        assert_eq!(has_the_heights_of_the_triangles(&job, side), usize::from(is_inside));
        assert_eq!(warnings(&report).contains("no cell has its centre within the terrain"), !is_inside);
        let image = &raster(&job).images[0];
        assert_eq!((image.width, image.height), (1, 1));
    }
    let job = with_raster(Job::on(&[&cloud]), "resolution = 0.0001");
    for arguments in [&["check"][..], &[]] {
        let said = job.run_with(arguments);
        said.refused(2, &["resolution = 0.0001 makes 19", "GB", "at most 2^38 cells", "set 0.0039 or more"]);
    }
    assert!(!job.out().exists());
    let job = with_raster(Job::on(&[&cloud]), "resolution = 1e-25");
    job.run().refused(2, &["resolution = 0.0000000000000000000000001 makes"]);
}

#[test]
fn a_system_and_its_heights_are_named() {
    let folder = tempfile::tempdir().unwrap();
    // NAD83(2011) / Minnesota and heights in US survey feet, which have the code of their datum alone.
    let named = keys(&[[1024, 0, 1, 1], [3072, 0, 1, 26915], [4096, 0, 1, 5103], [4099, 0, 1, 9003]]);
    let cloud = write(folder.path(), "cloud.las", &[named]);
    let job = with_raster(Job::on(&[&cloud]), "resolution = 10");
    job.report();
    let keys = raster(&job).keys;
    let value = |key: u32| keys[4..].chunks(4).find(|entry| entry[0] == key).map(|entry| entry[3]);
    assert_eq!(keys[..3], [1, 1, 1]);
    let expected = [(1024, 1), (1025, 1), (3072, 26915), (3076, 9001), (4096, 6360), (4099, 9003)];
    for (key, number) in expected {
        assert_eq!(value(key), Some(number), "{key}: {keys:?}");
    }
    // A code that says heights too is the code of its plane and that of its heights: a reader would take it for no plane.
    let cloud = write(folder.path(), "plain.las", &[]);
    let job = with_raster(
        Job::on(&[&cloud]).with("input", "crs = \"EPSG:7405\"\noutside_crs_area = \"warn\""),
        "resolution = 10",
    );
    job.report();
    let keys = raster(&job).keys;
    let value = |key: u32| keys[4..].chunks(4).find(|entry| entry[0] == key).map(|entry| entry[3]);
    assert_eq!([3072, 4096].map(value), [Some(27700), Some(5701)], "{keys:?}");
}

#[test]
fn the_raster_is_a_result_like_others() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(2_000, 2_000, 9));
    let job = with_raster(Job::on(&[&cloud]), "resolution = 5.0");
    job.report();
    job.verified();
    let path = job.out().join("terrain.tif");
    let mut changed = bytes(&job);
    *changed.last_mut().unwrap() ^= 1;
    fs::write(&path, changed).unwrap();
    let verdict = gdt_batch(job.folder(), &["verify", "out"]);
    assert!(verdict.code == 4 && verdict.out.contains("terrain.tif"), "{verdict:?}");
    // A job that wants none removes that of the job before.
    let text = fs::read_to_string(job.config()).unwrap();
    let without: String =
        text.lines().filter(|line| !line.starts_with("raster")).map(|line| format!("{line}\n")).collect();
    fs::write(job.folder().join("job.toml"), without).unwrap();
    gdt_batch(job.folder(), &["job.toml"]).succeeded();
    assert!(!path.exists());
}

#[test]
fn wrong_options_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(500, 2_000, 5));
    for (options, words) in [
        ("compression = \"none\"", ["line 5", "resolution"]),
        ("resolution = 0", ["line 5", "positive"]),
        ("resolution = -1.5", ["line 5", "positive"]),
        ("resolution = \"1\"", ["line 5", "positive"]),
        ("resolution = nan", ["line 5", "positive"]),
        ("resolution = 1, nodata = inf", ["line 5", "nodata"]),
        ("resolution = 1, nodata = 1e40", ["line 5", "nodata"]),
        ("resolution = 1, nodata = 1e-50", ["line 5", "nodata"]),
        ("resolution = 1, cells_per_file = 100", ["line 5", "from 512 to 524288"]),
        ("resolution = 1, origin = 0.5", ["line 5", "two numbers such as [0.5, 0.5]"]),
        ("resolution = 1, origin = [0.5]", ["line 5", "origin"]),
        ("resolution = 1, origin = [0.5, 0.5, 0]", ["line 5", "origin"]),
        ("resolution = 1, origin = [0.5, \"0.5\"]", ["line 5", "origin"]),
        ("resolution = 1, origin = [0.5, nan]", ["line 5", "origin"]),
        ("resolution = 1, origin = [1e25, 0]", ["origin = [1e25, 0.0]", "too many digits"]),
        ("resolution = 1, compression = \"lzw\"", ["line 5", "lzw"]),
        ("resolution = 1, size = 3", ["line 5", "size"]),
    ] {
        with_raster(Job::on(&[&cloud]), options).run().refused(2, &words);
    }
}
