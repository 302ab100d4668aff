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
