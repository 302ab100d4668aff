//! `terrain/` as globes ask for it: tiles are packed, and their headers say so.

use std::io::Read;

use flate2::read::GzDecoder;

use crate::rig::{Server, Terrain};

#[test]
fn terrain_tiles_are_served_as_globes_want_them() {
    let terrain = Terrain::new("crs = \"EPSG:26910\"", "terrain = { format = \"quantized-mesh\" }");
    let server = Server::with(&terrain.out(), &["--cors"]);
    for name in ["terrain/0/0/0.terrain", "terrain/0/1/0.terrain"] {
        let (head, body) = server.answer(&format!("/{name}"));
        for line in [
            "HTTP/1.1 200 OK",
            "content-encoding: gzip",
            "content-type: application/vnd.quantized-mesh",
            "access-control-allow-origin: *",
        ] {
            assert!(head.lines().any(|found| found.eq_ignore_ascii_case(line)), "{line}: {head}");
        }
        assert_eq!(body, std::fs::read(terrain.out().join(name)).unwrap());
        let mut unpacked = Vec::new();
        GzDecoder::new(&body[..]).read_to_end(&mut unpacked).unwrap();
        assert!(!quantized_mesh::decode(&unpacked).unwrap().triangles.is_empty());
    }
    let (head, body) = server.answer("/terrain/layer.json");
    let is_packed = head.to_ascii_lowercase().contains("content-encoding");
    assert!(!is_packed && head.to_ascii_lowercase().contains("access-control-allow-origin: *"), "{head}");
    let list: serde_json::Value = serde_json::from_slice(&body).unwrap();
    assert_eq!(list["format"], "quantized-mesh-1.0");
    assert_eq!(server.status("/terrain/0/2/0.terrain"), 404);
}
