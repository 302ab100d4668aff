//! Options that choose which points stay and how the tiles look.

use std::collections::BTreeMap;

use serde_json::Value;
use tempfile::TempDir;
use tiles::gltf::read::{TileFile, read_tile};
use verify::SourceGrid;

use crate::program::{Job, number};

/// A square with points inside, three of them at one place. Every point has a colour and a class.
const POINTS: &str = "x,y,z,red,green,blue,classification
0,0,1,255,0,0,2
10,0,2,0,255,0,2
0,10,3,0,0,255,9
10,10,4,255,255,255,6
5,5,20,0,0,0,2
5,5,10,51,51,51,6
5,5,30,102,102,102,9
3,6,7,10,20,30,7
6,3,7,10,20,30,18
";

struct Square {
    _folder: TempDir,
    job: Job,
}

impl Square {
    fn new() -> Square {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("square.csv");
        std::fs::write(&path, POINTS).unwrap();
        // Without packing, so that the values come back exactly.
        Square { job: Job::on(&[&path]).with("output", "compression = \"none\""), _folder: folder }
    }

    fn with(self, section: &'static str, line: &str) -> Square {
        Square { job: self.job.with(section, line), ..self }
    }

    /// Runs the job and proves the mesh. Returns the report and the only tile.
    #[track_caller]
    fn run(&self) -> (Value, TileFile) {
        let report = self.job.report();
        self.job.verified();
        (report, read_tile(&self.job.out().join("tiles/000000.glb")).unwrap())
    }

    /// Returns the heights of the vertices by place.
    #[track_caller]
    fn heights(&self) -> BTreeMap<[i64; 2], f64> {
        let (_, tile) = self.run();
        places(&tile).into_iter().map(|[x, y, z]| ([x as i64, y as i64], z)).collect()
    }

    /// Returns the colours of the vertices by place, as 16-bit linear intensities.
    #[track_caller]
    fn colors(&self) -> Option<BTreeMap<[i64; 2], [u16; 3]>> {
        let (_, tile) = self.run();
        let colors = tile.parts[0].colors.as_ref()?;
        let keyed = places(&tile).into_iter().zip(colors);
        Some(keyed.map(|([x, y, _], &[r, g, b, _])| ([x as i64, y as i64], [r, g, b])).collect())
    }
}

/// Returns the source coordinates of the vertices of a tile that has one part.
fn places(tile: &TileFile) -> Vec<[f64; 3]> {
    let source = SourceGrid::new(&tile.extras).unwrap();
    let part = &tile.parts[0];
    (0..part.positions.len()).map(|v| source.coordinates(source.integers(part.world(v)).unwrap())).collect()
}

#[test]
fn duplicates_decides_which_point_at_a_place_stays() {
    for (rule, z) in [("lowest", 10.0), ("highest", 30.0), ("first", 20.0)] {
        let square = Square::new().with("input", &format!("duplicates = \"{rule}\""));
        let heights = square.heights();
        assert_eq!((heights.len(), heights[&[5, 5]]), (5, z), "{rule}");
        assert_eq!((heights[&[0, 10]], heights[&[10, 10]]), (3.0, 4.0), "{rule}");
    }
    assert_eq!(Square::new().heights()[&[5, 5]], 10.0, "the lowest is the default");
}

#[test]
fn noise_is_left_out_unless_classes_names_it() {
    let (report, _) = Square::new().run();
    assert_eq!((number(&report["points"]["other_class"]), number(&report["duplicates"])), (2, 2));
    let heights = Square::new().with("input", "classes = [2, 6, 7]").heights();
    assert_eq!(heights.into_keys().collect::<Vec<_>>(), [[0, 0], [3, 6], [5, 5], [10, 0], [10, 10]]);
}

#[test]
fn bounds_keep_the_points_on_their_borders() {
    let square = Square::new().with("input", "bounds = [0, 0, 10, 9.5]").with("input", "classes = [2, 6, 7, 9, 18]");
    let (report, tile) = square.run();
    assert_eq!(number(&report["points"]["out_of_bounds"]), 2);
    assert_eq!(places(&tile).len(), 5);
    let nothing = Square::new().with("input", "bounds = [100, 100, 200, 200]");
    nothing.job.run().refused(3, &["no point", "9 outside the bounds", "bounds"]);
}

#[test]
fn colors_are_those_of_the_points_and_linear() {
    let square = || Square::new().with("input", "duplicates = \"first\"");
    let own = square().with("output", "color = \"rgb\"").colors().unwrap();
    assert_eq!((own[&[0, 0]], own[&[10, 10]], own[&[5, 5]]), ([65535, 0, 0], [65535; 3], [0; 3]));
    assert_eq!(square().colors().unwrap(), own, "auto takes the colours of the points if they have any");
    let lowest = Square::new().with("output", "color = \"rgb\"").colors().unwrap();
    // sRGB 51/255 is 0.033105 of full intensity.
    assert_eq!(lowest[&[5, 5]], [2170; 3]);
}

#[test]
fn colors_can_show_class_or_height_or_be_left_out() {
    let by_class = Square::new().with("output", "color = \"class\"").colors().unwrap();
    assert_eq!(by_class[&[0, 0]], by_class[&[10, 0]]);
    assert_eq!(by_class[&[10, 10]], by_class[&[5, 5]]);
    assert_ne!(by_class[&[0, 0]], by_class[&[0, 10]]);
    let by_height = Square::new().with("output", "color = \"elevation\"").colors().unwrap();
    let distinct: std::collections::BTreeSet<_> = by_height.values().collect();
    assert_eq!(distinct.len(), 5, "five heights, five colours: {by_height:?}");
    assert!(Square::new().with("output", "color = \"none\"").colors().is_none());
}

#[test]
fn normals_are_unit_vectors_or_left_out() {
    let (_, tile) = Square::new().run();
    for [x, y, z] in tile.parts[0].normals.as_ref().unwrap().iter() {
        assert!(y > 0.0 && (x * x + y * y + z * z - 1.0).abs() < 1e-5, "points up and has length one");
    }
    let (_, bare) = Square::new().with("output", "normals = false").run();
    assert!(bare.parts[0].normals.is_none() && bare.parts[0].colors.is_some());
}

#[test]
fn the_unit_scales_the_scene_but_not_the_source_coordinates() {
    for (unit, metres) in [("metre", 1.0), ("foot", 0.3048), ("us-foot", 1200.0 / 3937.0)] {
        let (_, tile) = Square::new().with("input", &format!("unit = \"{unit}\"")).run();
        let x = (0..5).map(|v| tile.parts[0].world(v)[0]);
        let width = x.clone().fold(f64::MIN, f64::max) - x.fold(f64::MAX, f64::min);
        // Positions are rounded to a step of at most half the lattice's, here 1 unit.
        assert!((width - 10.0 * metres).abs() <= 0.5 * metres, "{unit}: {width} m");
        let reach = places(&tile).iter().map(|p| p[0]).fold(f64::MIN, f64::max);
        assert_eq!((reach, tile.extras.metres_per_unit), (10.0, metres), "{unit}");
    }
}
