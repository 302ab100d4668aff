//! `layer.json`: which tiles there are.

use crate::scheme::Scheme;
use crate::tile::Tile;
use serde_json::{Value, json};

/// The tiles of a zoom, with columns as file names have them.
pub struct ZoomTiles(Vec<[i32; 2]>);

impl ZoomTiles {
    /// Returns the tiles of one zoom.
    pub fn new(tiles: &[Tile]) -> ZoomTiles {
        let mut places: Vec<[i32; 2]> = tiles.iter().map(|tile| [tile.y, tile.column()]).collect();
        places.sort_unstable();
        places.dedup();
        ZoomTiles(places)
    }

    /// Returns rectangles that cover them all, and nothing else: columns and rows, first and last.
    fn rectangles(&self) -> Vec<[[i32; 2]; 2]> {
        let mut open: Vec<[[i32; 2]; 2]> = Vec::new();
        let mut done = Vec::new();
        for row in self.0.chunk_by(|a, b| a[0] == b[0]) {
            let y = row[0][0];
            let runs = row.chunk_by(|a, b| a[1] + 1 == b[1]).map(|run| [run[0][1], run[run.len() - 1][1]]);
            let mut next = Vec::new();
            for columns in runs {
                // A run goes on with the rectangle below it, if that is as wide.
                match open.iter().position(|[open, rows]| *open == columns && rows[1] + 1 == y) {
                    Some(below) => {
                        let [columns, rows] = open.swap_remove(below);
                        next.push([columns, [rows[0], y]]);
                    }
                    None => next.push([columns, [y, y]]),
                }
            }
            done.append(&mut open);
            open = next;
        }
        done.append(&mut open);
        done.sort_unstable_by_key(|[columns, rows]| [rows[0], columns[0]]);
        done
    }
}

/// What the list tells of the terrain.
pub struct LayerAbout<'a> {
    /// The tiling scheme.
    pub scheme: Scheme,
    /// Whether tiles have a water mask.
    pub has_water: bool,
    /// West, south, east and north of the terrain in degrees.
    pub bounds: [f64; 4],
    /// Whose the data are.
    pub attribution: Option<&'a str>,
}

/// Returns the list of the tiles of all zooms, from 0 on.
pub fn layer(zooms: &[ZoomTiles], about: &LayerAbout) -> String {
    let rectangle = |[[west, east], [south, north]]: [[i32; 2]; 2]| json!({ "startX": west, "startY": south, "endX": east, "endY": north });
    let available: Vec<Vec<Value>> =
        zooms.iter().map(|zoom| zoom.rectangles().into_iter().map(rectangle).collect()).collect();
    let extensions = if about.has_water { &["octvertexnormals", "watermask"][..] } else { &["octvertexnormals"] };
    let mut list = json!({
        "tilejson": "2.1.0",
        "format": "quantized-mesh-1.0",
        "version": "1.0.0",
        "scheme": "tms",
        "projection": about.scheme.projection(),
        "tiles": ["{z}/{x}/{y}.terrain"],
        "extensions": extensions,
        "bounds": about.bounds,
        "minzoom": 0,
        "maxzoom": zooms.len().saturating_sub(1),
        "available": available,
    });
    if let (Some(list), Some(attribution)) = (list.as_object_mut(), about.attribution) {
        list.insert("attribution".into(), attribution.into());
    }
    format!("{list}\n")
}
