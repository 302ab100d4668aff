//! `[output] attributes`: every vertex carries the class and the intensity of the point that it stands for.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tiles::gltf::read::{TileFile, TilePart, read_tile};
use verify::SourceGrid;

use crate::clouds;
use crate::common::shared;
use crate::las_file::LasFile;
use crate::program::{Job, number};
use crate::tileset::files_below;
use crate::validator::validate;

const BOTH: &str = "attributes = [\"classification\", \"intensity\"]";

/// The class and the intensity of a point.
type Look = (u8, u16);

/// What the points of a file look like, by x and y in hundredths.
type Looks = BTreeMap<[i64; 2], Look>;

/// Returns where in a record of this format the colours are.
fn rgb_at(format: u8) -> Option<usize> {
    match format {
        2 => Some(20),
        3 | 5 => Some(28),
        7 | 8 | 10 => Some(30),
        _ => None,
    }
}

/// Returns a file with points at most of the places of a rough grid, and several at some of them, which differ in height, in class, in
/// colour or in intensity alone.
fn survey(format: u8, side: usize) -> LasFile {
    let mut file = LasFile::new(4, format, 0, side * side);
    let (length, mut more) = (file.length() as usize, Vec::new());
    for (i, record) in file.records.chunks_exact_mut(length).enumerate() {
        let shift = |k: usize| (k * 7919 % 131) as i32;
        let at = [(i % side * 300) as i32 + shift(i), (i / side * 300) as i32 + shift(i * 17)];
        for (k, value) in at.into_iter().enumerate() {
            record[4 * k..4 * k + 4].copy_from_slice(&value.to_le_bytes());
        }
        let intensity = (i * 40_503 % 65_536) as u16;
        record[12..14].copy_from_slice(&intensity.to_le_bytes());
        let mut twin = record.to_vec();
        match i % 50 {
            0 => twin[8] ^= 1,
            1 => twin[if format >= 6 { 16 } else { 15 }] ^= 1,
            2 => twin[rgb_at(format).unwrap_or(12)] ^= 4,
            3 => twin[12] ^= 2,
            _ => continue,
        }
        more.extend(twin);
    }
    file.records.extend(more);
    file
}

/// Returns what must be seen of the points of `file` if the lowest of several stays.
fn looks(file: &LasFile) -> Looks {
    let mut best: BTreeMap<[i64; 2], (i32, u8, [u16; 3], u16)> = BTreeMap::new();
    let rgb = rgb_at(file.format);
    for record in file.records.chunks_exact(file.length() as usize) {
        let long = |at: usize| i32::from_le_bytes(record[at..at + 4].try_into().unwrap());
        let short = |at: usize| u16::from_le_bytes(record[at..at + 2].try_into().unwrap());
        let (class, withheld) =
            if file.format >= 6 { (record[16], record[15] & 4) } else { (record[15] & 31, record[15] & 128) };
        if withheld != 0 || class == 7 || class == 18 {
            continue;
        }
        let color = rgb.map_or([0; 3], |at| [at, at + 2, at + 4].map(short));
        let point = (long(8), class, color, short(12));
        let kept = best.entry([i64::from(long(0)), i64::from(long(4))]).or_insert(point);
        *kept = point.min(*kept);
    }
    best.into_iter().map(|(at, (_, class, _, intensity))| (at, (class, intensity))).collect()
}

/// Returns the places of the vertices of a part, in hundredths of source units.
fn places(tile: &TileFile, part: &TilePart) -> Vec<[i64; 2]> {
    let source = SourceGrid::new(&tile.extras).unwrap();
    let integers = |world| match part.scale == [1.0; 3] {
        true => source.integers(world),
        false => source.integers_on(world, part.scale),
    };
    let place = |v: usize| {
        let [x, y, _] = source.coordinates(integers(part.world(v)).unwrap());
        [((x - 500_000.0) * 100.0).round() as i64, ((y - 4_000_000.0) * 100.0).round() as i64]
    };
    (0..part.positions.len()).map(place).collect()
}

/// Asserts that the vertices of the GLB at `path` look as their points, and adds their places to `seen`.
#[track_caller]
fn looks_like_its_points(path: &Path, looks: &Looks, seen: &mut Vec<[i64; 2]>) {
    let tile = read_tile(path).unwrap();
    for part in &tile.parts {
        let (classes, intensities) =
            (part.attributes.classification.as_ref().unwrap(), part.attributes.intensity.as_ref().unwrap());
        for (v, place) in places(&tile, part).into_iter().enumerate() {
            assert_eq!((classes[v], intensities[v]), looks[&place], "{place:?} in {path:?}");
            seen.push(place);
        }
    }
}

fn glbs(folder: &Path) -> Vec<PathBuf> {
    files_below(folder).into_iter().filter(|path| path.extension().is_some_and(|ending| ending == "glb")).collect()
}

/// Asserts that all vertices of what the job wrote look as their points.
#[track_caller]
fn is_true(job: &Job, looks: &Looks) {
    job.report();
    job.verified();
    let mut seen = Vec::new();
    let tiles = glbs(&job.out().join("tiles"));
    tiles.iter().for_each(|path| looks_like_its_points(path, looks, &mut seen));
    assert!(tiles.len() > 20 && seen.len() > looks.len(), "some vertices are in several tiles");
    assert_eq!(seen.into_iter().collect::<BTreeSet<_>>(), looks.keys().copied().collect());
    let levels = glbs(&job.out().join("levels"));
    assert!(levels.len() > 3);
    levels.iter().for_each(|path| looks_like_its_points(path, looks, &mut Vec::new()));
    looks_like_its_points(&job.out().join("terrain.glb"), looks, &mut Vec::new());
}

/// Writes the file and returns its path.
fn written(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

fn job_on(cloud: &Path, compression: &str) -> Job {
    let output = format!("{BOTH}\ncompression = \"{compression}\"\nmax_points_per_level_tile = 600");
    Job::on(&[cloud]).tiles_of(300).with("output", &output)
}

#[test]
fn every_vertex_has_the_class_and_the_intensity_of_its_point() {
    let folder = tempfile::tempdir().unwrap();
    for (format, compression) in [(1, "none"), (3, "quantized"), (6, "meshopt"), (7, "none"), (8, "meshopt")] {
        let file = survey(format, 90);
        let name = format!("{format}.las");
        let cloud = written(folder.path(), &name, &file.las());
        is_true(&job_on(&cloud, compression), &looks(&file));
        let packed = written(folder.path(), &format!("{format}.laz"), &file.laz(&[700], false));
        is_true(&job_on(&packed, compression).threads(2), &looks(&file));
    }
}

/// Tiles of several parts meet, whose borders are finished by merges above the parts.
#[test]
fn parts_and_threads_change_no_byte() {
    let folder = tempfile::tempdir().unwrap();
    let file = survey(7, 100);
    let path = written(folder.path(), "cloud.laz", &file.laz(&[500], false));
    let sums = |job: &Job| fs::read_to_string(job.out().join("XXH128SUMS")).unwrap();
    let alone = job_on(&path, "meshopt").threads(1);
    is_true(&alone, &looks(&file));
    let together = job_on(&path, "meshopt").threads(4);
    together.report();
    assert_eq!(sums(&alone), sums(&together));
    let in_parts = |threads| {
        let job = job_on(&path, "meshopt").with("triangulation", "max_points_per_part = 1500").threads(threads);
        is_true(&job, &looks(&file));
        sums(&job)
    };
    assert_eq!(in_parts(1), in_parts(3));
    let freed = job_on(&path, "meshopt").with("limits", "keep_steps = false");
    freed.report();
    assert_eq!(sums(&freed), sums(&alone));
}

/// A job that does not ask for them writes what it wrote before there were any, whatever the intensities of its points are.
#[test]
fn without_the_option_nothing_is_carried() {
    let folder = tempfile::tempdir().unwrap();
    let sums = |file: &LasFile| {
        let cloud = written(folder.path(), "cloud.las", &file.las());
        let job = Job::on(&[&cloud]).tiles_of(300);
        let report = job.report();
        for path in glbs(&job.out()) {
            let bytes = fs::read(&path).unwrap();
            assert!(!bytes.windows(10).any(|bytes| bytes == b"structural" || bytes == b"_INTENSITY"), "{path:?}");
        }
        let listed = fs::read_to_string(job.out().join("XXH128SUMS")).unwrap();
        (listed, number(&report["bytes_temporary"]))
    };
    let mut file = survey(1, 40);
    let first = sums(&file);
    let length = file.length() as usize;
    file.records.chunks_exact_mut(length).for_each(|record| record[12..14].fill(0));
    assert_eq!(sums(&file), first);
}

#[test]
fn one_of_them_comes_alone_and_triangles_left_out_carry_none() {
    let folder = tempfile::tempdir().unwrap();
    let file = survey(6, 40);
    let cloud = written(folder.path(), "cloud.laz", &file.laz(&[700], false));
    for (name, is_class) in [("classification", true), ("intensity", false)] {
        let job = Job::on(&[&cloud]).tiles_of(300).with("output", &format!("attributes = [{name:?}]\nmax_edge = 6.0"));
        job.report();
        job.verified();
        for path in glbs(&job.out()) {
            let is_left_out = path.strip_prefix(job.out()).unwrap().starts_with("cut");
            for part in read_tile(&path).unwrap().parts {
                assert_eq!(part.attributes.classification.is_some(), is_class && !is_left_out, "{path:?}");
                assert_eq!(part.attributes.intensity.is_some(), !is_class && !is_left_out, "{path:?}");
            }
        }
        assert!(!glbs(&job.out().join("cut")).is_empty());
    }
    let job = Job::on(&[&cloud]).with("output", "attributes = [\"class\"]");
    job.run().refused(2, &["attributes", "\"classification\"", "\"intensity\"", "\"class\" is not known"]);
}

/// Returns the classes and intensities of the only tile of a job on a text with these lines, by x and y, and what the job said.
#[track_caller]
fn of_text(lines: &str, settings: &str) -> (BTreeMap<[i64; 2], Look>, String) {
    let folder = tempfile::tempdir().unwrap();
    let cloud = written(folder.path(), "cloud.csv", lines.as_bytes());
    let job = Job::on(&[cloud]).with("output", &format!("{BOTH}\ncompression = \"none\"")).with("input.csv", settings);
    let said = job.run().succeeded().out;
    job.verified();
    let tile = read_tile(&job.out().join("tiles/000000.glb")).unwrap();
    let source = SourceGrid::new(&tile.extras).unwrap();
    let part = &tile.parts[0];
    let look = |v: usize| {
        let [x, y, _] = source.coordinates(source.integers(part.world(v)).unwrap());
        let attributes = &part.attributes;
        let look = (attributes.classification.as_ref().unwrap()[v], attributes.intensity.as_ref().unwrap()[v]);
        ([x as i64, y as i64], look)
    };
    ((0..part.positions.len()).map(look).collect(), said)
}

#[test]
fn texts_have_them_in_columns() {
    let (found, said) = of_text("x,y,z,Intensity,class\n0,0,1,65535,2\n9,0,1,7.6,5\n0,9,1,,9\n", "");
    assert_eq!(found, BTreeMap::from([([0, 0], (2, 65535)), ([9, 0], (5, 8)), ([0, 9], (9, 0))]));
    assert!(!said.contains("intensit"), "{said}");
    // From 0 to 1, as all rows together show, and one that is none.
    let (found, said) = of_text("x y z intensity\n0 0 1 0.5\n9 0 1 1\n0 9 1 0.25\n9 9 1 none\n", "");
    let intensities: Vec<u16> = found.values().map(|look| look.1).collect();
    assert_eq!(intensities, [32768, 16384, 65535, 0]);
    assert!(said.contains("\"none\"") && said.contains("read as 0") && said.contains("no column of classes"), "{said}");
    let (found, _) = of_text("0 0 1 300\n9 0 1 400\n0 9 1 500\n", "columns = [\"x\", \"y\", \"z\", \"intensity\"]");
    assert_eq!(found[&[0, 9]], (0, 500));
    let (found, said) = of_text("x,y,z\n0,0,1\n9,0,1\n0,9,1\n", "");
    assert!(found.values().all(|look| *look == (0, 0)));
    for words in ["no column of classes", "no column of intensities", "[input.csv] columns"] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

/// Returns the JSON of a GLB, and whether both of its chunks end at multiples of eight bytes.
fn document(glb: &[u8]) -> (Value, bool) {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    (
        serde_json::from_slice(&glb[20..20 + length]).unwrap(),
        (20 + length).is_multiple_of(8) && glb.len().is_multiple_of(8),
    )
}

/// The validator does not know the extension, so what it asks for is compared here.
#[test]
fn the_files_are_valid_and_describe_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = survey(8, 60);
    let cloud = written(folder.path(), "cloud.las", &file.las());
    for compression in ["none", "quantized", "meshopt"] {
        let job = job_on(&cloud, compression);
        job.report();
        validate(&job.out(), 20);
        // What is left out of the tiles is for `verify` alone.
        for path in glbs(&job.out()).into_iter().filter(|path| !path.starts_with(job.out().join("cut"))) {
            let (found, is_aligned) = document(&fs::read(&path).unwrap());
            let metadata = &found["extensions"]["EXT_structural_metadata"];
            let properties = &metadata["schema"]["classes"]["point"]["properties"];
            assert_eq!(properties["classification"]["componentType"], "UINT8");
            assert_eq!(properties["intensity"]["componentType"], "UINT16");
            let attribute = &metadata["propertyAttributes"][0];
            assert_eq!(attribute["class"], "point");
            assert!(is_aligned, "{path:?}");
            let primitive = &found["meshes"][0]["primitives"][0];
            assert_eq!(primitive["extensions"]["EXT_structural_metadata"], json!({"propertyAttributes": [0]}));
            for (name, kind) in [("classification", 5121), ("intensity", 5123)] {
                let semantic = attribute["properties"][name]["attribute"].as_str().unwrap();
                let accessor = &found["accessors"][primitive["attributes"][semantic].as_u64().unwrap() as usize];
                assert_eq!((&accessor["componentType"], &accessor["type"]), (&json!(kind), &json!("SCALAR")));
                let view = &found["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
                assert_eq!(view["byteStride"], 4, "{path:?}");
            }
            let used = found["extensionsUsed"].as_array().unwrap();
            assert!(used.contains(&json!("EXT_structural_metadata")));
            assert!(!found["extensionsRequired"].to_string().contains("structural"));
        }
    }
}

#[test]
fn a_real_file_is_true_too() {
    let Some(data) = shared().map(|shared| shared.join("data")) else { return };
    let job = Job::on(&[data.join("autzen_trim.las")]).tiles_of(4_000).with("output", BOTH);
    job.report();
    job.verified();
    validate(&job.out(), 28);
    let (mut classes, mut brightest) = (BTreeSet::new(), 0);
    for path in glbs(&job.out().join("tiles")) {
        for part in read_tile(&path).unwrap().parts {
            classes.extend(part.attributes.classification.unwrap());
            brightest = brightest.max(part.attributes.intensity.unwrap().into_iter().max().unwrap());
        }
    }
    assert!(classes.contains(&2) && brightest > 0, "{classes:?}, {brightest}");
}

#[test]
fn a_line_of_points_is_true_too() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "line.csv", &clouds::line(3_000, 1));
    let job = Job::on(&[cloud]).tiles_of(500).with("output", BOTH);
    job.report();
    job.verified();
}
