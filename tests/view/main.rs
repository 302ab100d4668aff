//! `gdt-batch view` and its page, as a user meets them: a job writes the terrain and the page, the program serves it, and a headless
//! Chromium opens it, clicks, and reads what the page says.

mod clicks;
mod looks;
mod map_tiles;
mod rig;
mod terrain_tiles;

use std::process::Command;

use crate::rig::{PROGRAM, Server, Terrain};

#[test]
fn inputs_and_configurations_beside_the_results_are_not_served() {
    let terrain = Terrain::among_inputs();
    let folder = terrain.folder.path();
    for name in [".git/config", ".env", "tiles/notes.txt", "tiles/000999.glb"] {
        std::fs::create_dir_all(folder.join(name).parent().unwrap()).unwrap();
        std::fs::write(folder.join(name), "secret").unwrap();
    }
    let server = Server::start(folder);
    let results = [
        "/",
        "/index.html",
        "/tileset.json",
        "/tiles/000000.glb",
        "/terrain.tif",
        "/preview.png",
        "/preview.pgw",
        "/georeference.json",
        "/report.json",
    ];
    for target in results {
        assert_eq!(server.status(target), 200, "{target}");
    }
    let others = [
        "/job.toml",
        "/cloud.csv",
        "/.git/config",
        "/.env",
        "/%2eenv",
        "/tiles/notes.txt",
        "/tiles/000999.glb",
        "/out/tileset.json",
        "/tiles",
        "/tiles/",
        "/JOB.toml",
        "/tiles/../job.toml",
        "/tiles%2f..%2fjob.toml",
        "/.\\job.toml",
        "/XXH128SUMS",
    ];
    for target in others {
        assert_eq!(server.status(target), 404, "{target}");
    }
}

#[test]
fn the_page_beside_the_tiles_opens_what_the_job_wrote() {
    let terrain = Terrain::new("", "format = \"glb\"");
    let page = std::fs::read_to_string(terrain.out().join("index.html")).unwrap();
    assert!(page.contains("data-terrain=\"terrain.glb\""));
    let sums = std::fs::read_to_string(terrain.out().join("XXH128SUMS")).unwrap();
    assert!(sums.contains("  index.html\n"));
    // A job without a page takes away the page of the job before.
    let config = terrain.folder.path().join("job.toml");
    let without = std::fs::read_to_string(&config).unwrap().replace("page = true\n", "");
    std::fs::write(&config, &without).unwrap();
    terrain.succeeds(&["job.toml", "--quiet"]);
    assert!(!terrain.out().join("index.html").exists());
    // But not that of somebody else, and it does not write over it.
    std::fs::write(terrain.out().join("index.html"), "<title>My survey</title>").unwrap();
    terrain.succeeds(&["job.toml", "--quiet"]);
    std::fs::write(&config, without.replace("[output]", "[output]\npage = true")).unwrap();
    let refused = Command::new(PROGRAM).arg(&config).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", String::from_utf8_lossy(&refused.stderr));
    assert_eq!(std::fs::read_to_string(terrain.out().join("index.html")).unwrap(), "<title>My survey</title>");
}
