//! A job that is stopped while it writes its raster or its mesh for other programs, or goes on with another one.

use crate::rig::{Rig, Setup};
use crate::scattered;

fn with_raster(options: &str) -> Setup {
    Setup::tiles_of(1_500).output(&format!("raster = {{ {options} }}"))
}

fn rig() -> Rig {
    Rig::new(&scattered::uniform(5_000, 20_000, 5), &with_raster("resolution = 15.0"))
}

#[test]
fn files_from_the_tiles_that_were_stopped_anywhere_end_with_the_same_bytes() {
    let exports = with_raster("resolution = 15.0").output("export = [\"landxml\", \"ply\"]");
    let rig = Rig::new(&scattered::uniform(5_000, 20_000, 5), &exports);
    // While a window is drawn, while the blocks are put together, while vertices are numbered, and while a mesh is written.
    for (place, count) in [
        ("window", 1),
        ("window", 4),
        ("waiting_blocks", 1),
        ("waiting_blocks", 5),
        ("write_exports", 2),
        ("chunks", 1),
        ("chunks", 4),
    ] {
        rig.forget();
        let what = format!("signal-{place}");
        rig.run_to(&what, count).stopped(&["error: interrupted"]);
        rig.has_nothing_half_written(&what);
        assert!(rig.completes(&what)["resumed"].as_u64() >= Some(5));
    }
    // The last phases are those of the raster, of the exports, of what is beside the tiles, and of the report.
    rig.forget();
    let mut kills = 0;
    while rig.run_to("committed", 1).was_killed() {
        rig.has_nothing_half_written("a kill after a phase");
        kills += 1;
    }
    assert!(kills > 5, "{kills} kills");
    rig.is_complete("kills after phases");
}

/// Map tiles are made from the raster: they are made again with it, and alone if nothing else has changed.
#[test]
fn map_tiles_that_were_stopped_anywhere_end_with_the_same_bytes() {
    let on_map = |options: &str| with_raster(options).input("crs = \"EPSG:3857\"");
    let tiles = on_map("resolution = 15.0, pmtiles = \"terrarium\"");
    let mut rig = Rig::new(&scattered::uniform(5_000, 20_000, 5), &tiles);
    for (place, count) in [("drawing", 1), ("drawing", 9), ("waiting_tiles", 1), ("waiting_tiles", 5)] {
        rig.forget();
        let what = format!("signal-{place}");
        rig.run_to(&what, count).stopped(&["error: interrupted"]);
        rig.has_nothing_half_written(&what);
        // The raster was complete.
        assert!(rig.completes(&what)["resumed"].as_u64() >= Some(6));
    }
    for options in ["resolution = 15.0, pmtiles = \"terrain-rgb\"", "resolution = 30.0, pmtiles = \"terrarium\""] {
        rig.forget();
        rig.configure(&tiles);
        rig.run_to("signal-waiting_tiles", 2).stopped(&["error: interrupted"]);
        rig.expect(&on_map(options));
        let said = rig.run().succeeded().err;
        assert!(said.contains("; the tiles stay"), "{said}");
        assert_eq!(said.contains("[output.raster] pmtiles"), options.contains("terrain-rgb"), "{said}");
        rig.is_complete(options);
    }
}

#[test]
fn another_raster_keeps_the_tiles() {
    let mut rig = rig();
    for options in [
        "resolution = 30.0",
        "resolution = 15.0, nodata = 0",
        "resolution = 15.0, origin = [7.5, 7.5]",
        "resolution = 15.0, cells_per_file = 512",
    ] {
        rig.forget();
        rig.configure(&with_raster("resolution = 15.0"));
        rig.run_to("signal-waiting_blocks", 2).stopped(&["error: interrupted"]);
        rig.expect(&with_raster(options));
        let said = rig.run().succeeded().err;
        assert!(said.contains("[output] raster; the tiles stay"), "{said}");
        assert!(rig.is_complete(options)["resumed"].as_u64() >= Some(5));
    }
    // No raster at all: that of the interrupted run goes.
    rig.forget();
    rig.expect(&with_raster("resolution = 15.0"));
    assert!(rig.run_to("replacing", 1).was_killed());
    rig.completes("all results were whole");
    rig.expect(&Setup::tiles_of(1_500));
    rig.completes("without a raster");
}
