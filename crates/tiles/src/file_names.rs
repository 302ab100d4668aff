//! The names of the files and folders in an output directory.
//!
//! Numbered files are dealt out to folders, because folders with many thousands of files are slow on many file systems, and on shared
//! ones most of all. File n below 256 is in the folder of its kind. From 256 on it is in the folder `n / 256` there, from 65,536 on
//! in a folder above that, and so on. A folder has the number of its first file divided by 256, so no two have the same name.

use crate::options::ExportFormat;
use crate::raster::products::{PRODUCTS, RasterProduct};
use std::path::{Path, PathBuf};

const TILES: &str = "tiles";
const LEVELS: &str = "levels";
const CUT: &str = "cut";
const TILESETS: &str = "tilesets";
const GLB: &str = "glb";
const JSON: &str = "json";
const TIF: &str = "tif";
const CLASSIFIED: &str = "classified";
const LAZ: &str = "laz";
/// The folder, and the ending of its files.
const TERRAIN: &str = "terrain";
const CHECKSUMS: &str = "XXH128SUMS";

/// A folder holds at most this many numbered files, and as many folders for each power of this that numbers reach.
const PER_FOLDER: usize = 256;

/// How many folders deep below the folder of its kind a numbered file may be. Tiles and nodes have 32 bits.
pub const MOST_FOLDERS_DEEP: usize = 3;

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

    /// Returns the folder of the triangles that `[output] hull` or `max_edge` left out of the tiles.
    pub fn cut(&self) -> PathBuf {
        self.directory.join(CUT)
    }

    /// Returns the GLB of the triangles that were left out of tile number `tile`.
    pub fn cut_tile(&self, tile: usize) -> PathBuf {
        self.directory.join(numbered(CUT, tile, GLB))
    }

    /// Returns the folder of the external tilesets.
    pub fn tilesets(&self) -> PathBuf {
        self.directory.join(TILESETS)
    }

    /// Returns external tileset number `number`.
    pub fn external_tileset(&self, number: usize) -> PathBuf {
        self.directory.join(tileset_uri(Some(number)))
    }

    /// Returns the folders that hold numbered files, each with the ending of their names.
    pub fn numbered_folders(&self) -> Vec<(PathBuf, &'static str)> {
        let own = [(self.tiles(), GLB), (self.levels(), GLB), (self.cut(), GLB), (self.tilesets(), JSON)];
        let rasters = PRODUCTS.map(|product| (self.directory.join(product.names()[1]), TIF));
        own.into_iter().chain(rasters).collect()
    }

    /// Returns the files of which there is one at most, besides the page.
    pub fn single_files(&self) -> Vec<PathBuf> {
        let mut files = vec![
            self.report(),
            self.checksums(),
            self.changes(),
            self.terrain(),
            self.tileset(),
            self.georeference(),
            self.breaklines(),
            self.preview(),
            self.preview_world(),
            self.map_tiles(),
            self.contours(),
            self.contour_drawing(),
            self.terrain_layer(),
        ];
        files.extend(PRODUCTS.into_iter().flat_map(|product| [self.raster(product), self.raster_list(product)]));
        files.extend(ExportFormat::ALL.map(|format| self.export(format)));
        files
    }

    /// Returns the folder of the inputs with the classes that the job has found, and the ending of their names.
    pub fn classified(&self) -> (PathBuf, &'static str) {
        (self.directory.join(CLASSIFIED), LAZ)
    }

    /// Returns the list of all tiles as 3D Tiles, or of the coarsest ones if there are external tilesets.
    pub fn tileset(&self) -> PathBuf {
        self.directory.join(tileset_uri(None))
    }

    /// Returns the GLB of all tiles in one scene.
    pub fn terrain(&self) -> PathBuf {
        self.directory.join("terrain.glb")
    }

    /// Returns the file with offset, resolution, unit and CRS.
    pub fn georeference(&self) -> PathBuf {
        self.directory.join("georeference.json")
    }

    /// Returns the edges along breaklines.
    pub fn breaklines(&self) -> PathBuf {
        self.directory.join("breaklines.csv")
    }

    /// Returns the report for machines.
    pub fn report(&self) -> PathBuf {
        self.directory.join("report.json")
    }

    /// Returns the list of all other results with their checksums, as `xxhsum -c` reads it.
    pub fn checksums(&self) -> PathBuf {
        self.directory.join(CHECKSUMS)
    }

    /// Returns the path of the list of what an update has changed.
    pub fn changes(&self) -> PathBuf {
        self.directory.join("update.json")
    }

    /// Returns the picture of the whole terrain.
    pub fn preview(&self) -> PathBuf {
        self.directory.join("preview.png")
    }

    /// Returns the file that says where the picture is on the map.
    pub fn preview_world(&self) -> PathBuf {
        self.directory.join("preview.pgw")
    }

    /// Returns the raster of heights, or of what follows from them.
    pub fn raster(&self, product: RasterProduct) -> PathBuf {
        self.directory.join(format!("{}.{TIF}", product.names()[0]))
    }

    /// Returns the list of the files of a raster in several files, which programs open as one.
    pub fn raster_list(&self, product: RasterProduct) -> PathBuf {
        self.directory.join(format!("{}.vrt", product.names()[0]))
    }

    /// Returns the heights as map tiles.
    pub fn map_tiles(&self) -> PathBuf {
        self.directory.join("terrain.pmtiles")
    }

    /// Returns the contour lines for CAD programs.
    pub fn contour_drawing(&self) -> PathBuf {
        self.directory.join("contours.dxf")
    }

    /// Returns the mesh in a format of other programs.
    pub fn export(&self, format: ExportFormat) -> PathBuf {
        self.directory.join(format.file_name())
    }

    /// Returns the contour lines.
    pub fn contours(&self) -> PathBuf {
        self.directory.join("contours.gpkg")
    }

    /// Returns the folder of the terrain tiles for globes.
    pub fn terrain_tiles(&self) -> PathBuf {
        self.directory.join(TERRAIN)
    }

    /// Returns the list of the terrain tiles for globes.
    pub fn terrain_layer(&self) -> PathBuf {
        self.terrain_tiles().join("layer.json")
    }

    /// Returns the terrain tile in this column and row of a zoom.
    pub fn terrain_tile(&self, zoom: u8, [column, row]: [i32; 2]) -> PathBuf {
        self.terrain_tiles().join(format!("{zoom}/{column}/{row}.{TERRAIN}"))
    }

    /// Returns the page that shows the terrain in a browser.
    pub fn page(&self) -> PathBuf {
        self.directory.join("index.html")
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

/// Returns the path of exact tile number `tile` from the output directory.
pub fn tile_uri(tile: usize) -> String {
    numbered(TILES, tile, GLB)
}

/// Returns the path of the coarser tile at tree node `node` from the output directory.
pub fn level_uri(node: usize) -> String {
    numbered(LEVELS, node, GLB)
}

/// Returns the path of file number `number` of a raster in several files from the output directory.
pub fn raster_uri(product: RasterProduct, number: usize) -> String {
    numbered(product.names()[1], number, TIF)
}

/// Returns the path of an external tileset from the output directory, or that of the main tileset.
pub fn tileset_uri(external: Option<usize>) -> String {
    external.map_or_else(|| "tileset.json".into(), |number| numbered(TILESETS, number, JSON))
}

/// Returns the URI of the file `to` as the file `from` names it. Both are given by their paths from the output directory.
pub fn relative_uri(from: &str, to: &str) -> String {
    "../".repeat(from.matches('/').count()) + to
}

/// Tells whether a name, without its ending, is that of a numbered file or of a folder of such files.
pub fn is_number(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_digit())
}

/// Tells whether the numbered file `number`, whatever its ending, belongs into the `folders` below the folder of its kind.
pub fn belongs_into(folders: &[String], number: usize) -> bool {
    folders.iter().eq(folders_of(number).iter())
}

fn numbered(kind: &str, number: usize, ending: &str) -> String {
    let folders: String = folders_of(number).iter().map(|folder| format!("{folder}/")).collect();
    format!("{kind}/{folders}{number:06}.{ending}")
}

/// Returns the folders below the folder of its kind that lead to file number `number`.
fn folders_of(number: usize) -> Vec<String> {
    let mut folders = Vec::new();
    // The number of files in all folders at and below one.
    let mut span = PER_FOLDER;
    while number >= span {
        folders.push(format!("{:03}", number / span * (span / PER_FOLDER)));
        span = span.saturating_mul(PER_FOLDER);
    }
    folders.reverse();
    folders
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{BTreeMap, BTreeSet};

    #[test]
    fn uris_and_paths_name_the_same_files() {
        let layout = OutputFiles::new(Path::new("out"));
        assert_eq!(tile_uri(7), "tiles/000007.glb");
        assert_eq!(layout.tile(7), layout.tiles().join("000007.glb"));
        assert_eq!(layout.level(1_234_567), layout.directory().join("levels/4608/4822/1234567.glb"));
        assert_eq!(layout.cut_tile(0), layout.cut().join("000000.glb"));
        assert_eq!(layout.external_tileset(300), layout.tilesets().join("001/000300.json"));
        assert_eq!(layout.tileset(), layout.directory().join(tileset_uri(None)));
    }

    #[test]
    fn numbers_from_256_on_are_in_folders() {
        let names = [255, 256, 65_535, 65_536, 65_792, 131_072, 1 << 24, u32::MAX as usize].map(tile_uri);
        assert_eq!(
            names,
            [
                "tiles/000255.glb",
                "tiles/001/000256.glb",
                "tiles/255/065535.glb",
                "tiles/256/256/065536.glb",
                "tiles/256/257/065792.glb",
                "tiles/512/512/131072.glb",
                "tiles/65536/65536/65536/16777216.glb",
                "tiles/16711680/16776960/16777215/4294967295.glb",
            ]
        );
        assert_eq!(names[7].matches('/').count(), 1 + MOST_FOLDERS_DEEP);
    }

    #[test]
    fn no_folder_has_more_than_some_hundred_entries_and_no_two_files_one_name() {
        // All of the first 200,000, and beyond that the first and the last of every folder.
        let numbers = (0..200_000).chain((200_000..1 << 25).filter(|n| n % 256 == 0 || n % 256 == 255));
        let (mut entries, mut files) = (BTreeMap::<String, BTreeSet<String>>::new(), 0);
        for number in numbers {
            let name = tile_uri(number);
            let mut path = name.as_str();
            let mut is_new = false;
            while let Some((folder, entry)) = path.rsplit_once('/') {
                is_new |= entries.entry(folder.into()).or_default().insert(entry.into());
                path = folder;
            }
            assert!(is_new, "{name}");
            files += 1;
        }
        assert!(files > 400_000);
        let most = entries.values().map(BTreeSet::len).max();
        assert_eq!(most, Some(256 + 255 + 255 + 1));
        assert!(entries.keys().all(|folder| !folder.ends_with(".glb")));
    }

    #[test]
    fn uris_resolve_from_the_folder_of_the_file_that_names_them() {
        assert_eq!(relative_uri("tileset.json", "tiles/000007.glb"), "tiles/000007.glb");
        assert_eq!(relative_uri("tilesets/000000.json", "tiles/001/000256.glb"), "../tiles/001/000256.glb");
        assert_eq!(relative_uri(&tileset_uri(Some(256)), &tileset_uri(Some(7))), "../../tilesets/000007.json");
    }

    #[test]
    fn a_file_belongs_into_one_folder_only() {
        let folders = |names: &[&str]| names.iter().map(|name| name.to_string()).collect::<Vec<_>>();
        assert!(belongs_into(&[], 255) && !belongs_into(&[], 256));
        assert!(belongs_into(&folders(&["001"]), 511) && !belongs_into(&folders(&["1"]), 511));
        assert!(belongs_into(&folders(&["256", "257"]), 65_792) && !belongs_into(&folders(&["257"]), 65_792));
    }
}
