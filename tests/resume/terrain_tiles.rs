//! A job that is stopped while it makes terrain tiles for globes.

use crate::rig::{Rig, Setup};
use crate::scattered;

fn with_terrain() -> Setup {
    Setup::tiles_of(1_500)
        .input("crs = \"EPSG:32633\"")
        .output("terrain = { format = \"quantized-mesh\", scheme = \"web-mercator\" }")
}

#[test]
fn terrain_tiles_that_were_stopped_anywhere_end_with_the_same_bytes() {
    let mut rig = Rig::new(&scattered::uniform(5_000, 20_000, 5), &with_terrain());
    rig.ends_alike_wherever_it_is_stopped(&[("write_terrain", 2), ("write_terrain", 4), ("zooms", 1), ("zooms", 6)]);
    // Without terrain tiles, those of the last run go.
    rig.forget();
    rig.expect(&Setup::tiles_of(1_500).input("crs = \"EPSG:32633\""));
    rig.completes("without terrain tiles");
}

/// Returns a job with a lake in its water masks, in a scheme.
fn with_lake(scheme: &str) -> Setup {
    let mut setup = Setup::tiles_of(1_000).input("crs = \"EPSG:32633\"");
    setup = setup.output(&format!("terrain = {{ format = \"quantized-mesh\", scheme = \"{scheme}\" }}"));
    setup.limits += "\n[[breaklines]]\nfiles = [\"lake.geojson\"]\nkind = \"lake\"";
    setup
}

#[test]
fn water_masks_of_killed_jobs_are_the_same_in_both_schemes() {
    const LAKE: &str = r#"{"type":"FeatureCollection","crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::32633"}},
        "features":[{"type":"Feature","properties":{},"geometry":{"type":"Polygon","coordinates":
        [[[4000,4000,9],[15000,5000,9],[14000,15000,9],[5000,13000,9],[4000,4000,9]]]}}]}"#;
    let cloud = scattered::uniform(3_000, 20_000, 5);
    for scheme in ["geographic", "web-mercator"] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("lake.geojson"), LAKE).unwrap();
        let mut rig = Rig::of_files(folder, &cloud, 20_000, &with_lake(scheme));
        let layer = String::from_utf8(rig.expected["terrain/layer.json"].clone()).unwrap();
        assert!(layer.contains("watermask"), "{layer}");
        rig.ends_alike_wherever_it_is_stopped(&[("write_terrain", 1), ("zooms", 1), ("zooms", 9)]);
        for fault in ["commit", "published"] {
            let kills = (1..).take_while(|&count| {
                rig.forget();
                let was_killed = rig.run_to(fault, count).was_killed();
                rig.completes(&format!("{scheme}: {fault} {count}"));
                was_killed
            });
            assert!(kills.count() >= 5, "{scheme}: {fault}");
        }
    }
}
