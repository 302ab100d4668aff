//! A job that is stopped while it makes terrain tiles for globes.

use crate::rig::{Rig, Setup};
use crate::scattered;

fn with_terrain() -> Setup {
    Setup::tiles_of(1_500).input("crs = \"EPSG:32633\"").output("terrain = { format = \"quantized-mesh\" }")
}

#[test]
fn terrain_tiles_that_were_stopped_anywhere_end_with_the_same_bytes() {
    let mut rig = Rig::new(&scattered::uniform(5_000, 20_000, 5), &with_terrain());
    for (place, count) in [("write_terrain", 2), ("write_terrain", 7), ("zooms", 1), ("zooms", 6)] {
        rig.forget();
        let what = format!("signal-{place}");
        rig.run_to(&what, count).stopped(&["error: interrupted"]);
        rig.has_nothing_half_written(&what);
        assert!(rig.completes(&what)["resumed"].as_u64() >= Some(5));
    }
    rig.forget();
    while rig.run_to("committed", 1).was_killed() {
        rig.has_nothing_half_written("a kill after a phase");
    }
    rig.is_complete("kills after phases");
    // Without terrain tiles, those of the last run go.
    rig.forget();
    rig.expect(&Setup::tiles_of(1_500).input("crs = \"EPSG:32633\""));
    rig.completes("without terrain tiles");
}
