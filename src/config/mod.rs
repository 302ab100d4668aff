//! The configuration of a job: TOML in, checked values out. Unknown keys, wrong types and impossible values are errors
//! that show the line.

mod values;

use crate::input::TextOptions;
use crate::output::Compression;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
pub use values::{
    Backend, Bounds, ColorChoice, CompressionChoice, Duplicates, Format, LevelSites, MaxEdge, Memory, OnBadFile,
    Resolution, Share, SitesPerTile, Texture, Threads, UnitChoice, Voronoi,
};

/// Metres. No datum is as far from the ellipsoid; beyond it f64 would lose what puts tiles together.
const MOST_HEIGHT_OFFSET: f64 = 100_000.0;

/// Everything a user can say about a job.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// What to read.
    pub input: Input,
    /// How to triangulate.
    #[serde(default)]
    pub triangulation: Triangulation,
    /// What to write.
    pub output: Output,
    /// What the job may use.
    #[serde(default)]
    pub limits: Limits,
}

/// `[input]`: which points.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Paths or globs, relative to the configuration file.
    pub files: Vec<String>,
    /// Keep only these classes; default: all but noise (7, 18).
    #[serde(default)]
    pub classes: Option<Vec<u8>>,
    /// Keep only what lies in [xmin, ymin, xmax, ymax], in source units, borders included.
    #[serde(default)]
    pub bounds: Option<Bounds>,
    /// Which of several points with the same x and y stays.
    #[serde(default)]
    pub duplicates: Duplicates,
    /// The unit of x and y.
    #[serde(default)]
    pub unit: UnitChoice,
    /// The step of the lattice in x and y, in source units.
    #[serde(default)]
    pub resolution: Resolution,
    /// The share of malformed records or lines that is put up with, 0 to 1.
    #[serde(default)]
    pub malformed_share: Share,
    /// What becomes of a job with a file that cannot be used.
    #[serde(default)]
    pub on_bad_file: OnBadFile,
    /// How text files are laid out, where detection is not to be trusted.
    #[serde(default)]
    pub csv: TextOptions,
}

/// `[triangulation]`: how, never what: the mesh is the same whatever stands here.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Triangulation {
    /// Who triangulates the tiles.
    pub backend: Backend,
    /// How a GPU computes the discrete Voronoi diagram.
    pub voronoi: Voronoi,
    /// A part of the name of the GPU to take; `None`: what the environment names, or the fastest kind.
    pub adapter: Option<String>,
    /// The side of the pipeline's texture on a GPU.
    pub texture: Texture,
    /// How many sites a tile holds at the most.
    pub sites_per_tile: SitesPerTile,
}

/// `[output]`: where and what.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// The directory to write to, relative to the configuration file.
    pub directory: PathBuf,
    /// Where vertex colours come from.
    #[serde(default)]
    pub color: ColorChoice,
    /// Whether vertices carry normals.
    #[serde(default = "yes")]
    pub normals: bool,
    /// In which form viewers get the terrain.
    #[serde(default)]
    pub format: Format,
    /// Whether 3D Tiles have coarser levels above the exact tiles.
    #[serde(default = "yes")]
    pub levels: bool,
    /// How many sites a coarser tile holds at the most.
    #[serde(default)]
    pub level_sites: LevelSites,
    /// Metres that heights are raised by to be heights above the ellipsoid, where 3D Tiles are placed on the globe.
    #[serde(default)]
    pub height_offset: f64,
    /// How tiles are to be packed.
    #[serde(default)]
    pub compression: CompressionChoice,
    /// Triangles with an edge longer than this are left out.
    #[serde(default)]
    pub max_edge: MaxEdge,
}

impl Output {
    /// How tiles are packed.
    pub fn packing(&self) -> Compression {
        match (self.compression, self.format) {
            (CompressionChoice::Auto, Format::Tiles) | (CompressionChoice::Meshopt, _) => Compression::Meshopt,
            (CompressionChoice::Auto, _) | (CompressionChoice::Quantized, _) => Compression::Quantized,
            (CompressionChoice::None, _) => Compression::None,
        }
    }
}

/// `[limits]`: what the job may use of the machine.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Peak resident memory.
    pub memory: Memory,
    /// Worker threads; 0: one per core.
    pub threads: Threads,
}

fn yes() -> bool {
    true
}

impl Config {
    /// Reads and checks the file at `path`; relative paths in it become relative to its directory.
    ///
    /// # Errors
    /// [`Error::Config`] with the offending line if the text is not a valid configuration, [`Error::Io`] if it cannot be read.
    pub fn load(path: &Path) -> Result<Config> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                return Err(Error::Config(format!("there is no configuration file {}", path.display())));
            }
            Err(e) => return Err(Error::Config(format!("cannot read the configuration {}: {e}", path.display()))),
        };
        let mut config = Config::parse(&text).map_err(|e| Error::Config(format!("{}: {e}", path.display())))?;
        let base = path.parent().unwrap_or(Path::new(""));
        config.output.directory = base.join(&config.output.directory);
        for file in &mut config.input.files {
            // A glob's special characters in the directory of the configuration itself are meant literally.
            if !Path::new(file).is_absolute() {
                *file = format!("{}{file}", glob_prefix(base));
            }
        }
        Ok(config)
    }

    /// Checks a configuration's text; the message of an error shows the line.
    fn parse(text: &str) -> std::result::Result<Config, String> {
        let config: Config = toml::from_str(text).map_err(|e| e.to_string())?;
        if config.input.files.is_empty() {
            return Err("[input] files is empty: name at least one point cloud".into());
        }
        if config.input.classes.as_ref().is_some_and(Vec::is_empty) {
            return Err(
                "[input] classes is empty, which would leave no point; leave the key out to keep all but noise".into(),
            );
        }
        if config.output.directory.as_os_str().is_empty() {
            return Err("[output] directory is empty".into());
        }
        if config.output.height_offset.is_nan() || config.output.height_offset.abs() > MOST_HEIGHT_OFFSET {
            return Err(format!("[output] height_offset is not a number of metres up to {MOST_HEIGHT_OFFSET}"));
        }
        Ok(config)
    }

    /// Which of the 256 classification codes are kept.
    pub fn kept_classes(&self) -> [bool; 256] {
        match &self.input.classes {
            Some(classes) => {
                let mut kept = [false; 256];
                classes.iter().for_each(|&class| kept[class as usize] = true);
                kept
            }
            None => std::array::from_fn(|class| class != 7 && class != 18),
        }
    }

    /// The number of worker threads.
    pub fn threads(&self) -> usize {
        match self.limits.threads.0 {
            0 => std::thread::available_parallelism().map_or(1, |n| n.get()),
            n => n,
        }
    }
}

/// `directory` as the beginning of a glob pattern.
fn glob_prefix(directory: &Path) -> String {
    if directory.as_os_str().is_empty() {
        return String::new();
    }
    format!("{}/", glob::Pattern::escape(&directory.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: &str = "[input]\nfiles = [\"a.laz\"]\n[output]\ndirectory = \"out\"\n";

    fn error(text: &str) -> String {
        Config::parse(text).unwrap_err()
    }

    #[test]
    fn the_least_configuration_has_the_documented_defaults() {
        let config = Config::parse(LEAST).unwrap();
        assert_eq!(config.limits.memory.0, 4 << 30);
        assert_eq!(config.input.duplicates, Duplicates::Lowest);
        assert!(config.output.normals);
        assert!(config.kept_classes()[2] && !config.kept_classes()[7] && !config.kept_classes()[18]);
    }

    #[test]
    fn errors_show_the_line() {
        let unknown = error(&LEAST.replace("files", "fils"));
        assert!(unknown.contains("line 2") && unknown.contains("fils"), "{unknown}");
        let wrong = error(&format!("{LEAST}color = \"blue\"\n"));
        assert!(wrong.contains("line 5") && wrong.contains("elevation"), "{wrong}");
        let memory = error(&format!("{LEAST}[limits]\nmemory = \"4 GB of it\"\n"));
        assert!(memory.contains("line 6") && memory.contains("4 GiB"), "{memory}");
        let bounds = error(&LEAST.replace("[output]", "bounds = [1, 1, 0, 2]\n[output]"));
        assert!(bounds.contains("line 3") && bounds.contains("xmin"), "{bounds}");
        let edge = error(&format!("{LEAST}max_edge = -1\n"));
        assert!(edge.contains("line 5") && edge.contains("auto"), "{edge}");
        let sites = error(&format!("{LEAST}[triangulation]\nsites_per_tile = 2\n"));
        assert!(sites.contains("line 6") && sites.contains("auto"), "{sites}");
    }
}
