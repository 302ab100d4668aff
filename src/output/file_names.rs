//! The names of the files and folders in an output directory.

use std::path::{Path, PathBuf};

const TILES: &str = "tiles";
const LEVELS: &str = "levels";
const CUT: &str = "cut";
const CHECKSUMS: &str = "XXH128SUMS";

/// The paths in one output directory. Nothing else in the crate spells these names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputFiles {
    directory: PathBuf,
}

impl OutputFiles {
    /// Returns the layout of `directory`, which need not exist.
    pub fn new(directory: &Path) -> OutputFiles {
        OutputFiles { directory: directory.to_path_buf() }
    }

    /// Returns the output directory itself.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Returns the folder of the exact tiles.
    pub fn tiles(&self) -> PathBuf {
        self.directory.join(TILES)
    }

    /// Returns the GLB of exact tile number `tile`.
    pub fn tile(&self, tile: usize) -> PathBuf {
        self.directory.join(tile_uri(tile))
    }

    /// Returns the folder of the coarser tiles.
    pub fn levels(&self) -> PathBuf {
        self.directory.join(LEVELS)
    }

    /// Returns the GLB of the coarser tile at tree node `node`.
    pub fn level(&self, node: usize) -> PathBuf {
        self.directory.join(level_uri(node))
    }

    /// Returns the folder of the triangles that `[output] max_edge` left out of the tiles.
    pub fn cut(&self) -> PathBuf {
        self.directory.join(CUT)
    }

    /// Returns the GLB of the triangles that were left out of tile number `tile`.
    pub fn cut_tile(&self, tile: usize) -> PathBuf {
        self.directory.join(numbered(CUT, tile))
    }

    /// Returns the three folders that hold GLB files.
    pub fn glb_folders(&self) -> [PathBuf; 3] {
        [self.tiles(), self.levels(), self.cut()]
    }

    /// Returns the list of all tiles as 3D Tiles.
    pub fn tileset(&self) -> PathBuf {
        self.directory.join("tileset.json")
    }

    /// Returns the GLB of all tiles in one scene.
    pub fn terrain(&self) -> PathBuf {
        self.directory.join("terrain.glb")
    }

    /// Returns the file with offset, resolution, unit and CRS.
    pub fn georeference(&self) -> PathBuf {
        self.directory.join("georeference.json")
    }

    /// Returns the report for machines.
    pub fn report(&self) -> PathBuf {
        self.directory.join("report.json")
    }

    /// Returns the list of all other results with their checksums, as `xxhsum -c` reads it.
    pub fn checksums(&self) -> PathBuf {
        self.directory.join(CHECKSUMS)
    }

    /// Returns the picture of the whole terrain.
    pub fn preview(&self) -> PathBuf {
        self.directory.join("preview.png")
    }

    /// Returns the folder of what a job keeps for itself until it is finished.
    pub fn job(&self) -> PathBuf {
        self.directory.join("job")
    }

    /// Returns the list of the steps that a job has finished. It is there from the first step until all results are in place.
    pub fn journal(&self) -> PathBuf {
        self.job().join("journal")
    }
}

/// Returns the path of exact tile number `tile` from the output directory, as `tileset.json` names it.
pub fn tile_uri(tile: usize) -> String {
    numbered(TILES, tile)
}

/// Returns the path of the coarser tile at tree node `node` from the output directory, as `tileset.json` names it.
pub fn level_uri(node: usize) -> String {
    numbered(LEVELS, node)
}

fn numbered(folder: &str, number: usize) -> String {
    format!("{folder}/{number:06}.glb")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_and_paths_name_the_same_files() {
        let layout = OutputFiles::new(Path::new("out"));
        assert_eq!(tile_uri(7), "tiles/000007.glb");
        assert_eq!(layout.tile(7), layout.tiles().join("000007.glb"));
        assert_eq!(layout.level(1_234_567), layout.directory().join("levels").join("1234567.glb"));
        assert_eq!(layout.cut_tile(0), layout.cut().join("000000.glb"));
    }
}
