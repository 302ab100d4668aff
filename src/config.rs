//! The configuration of a job: TOML in, checked values out. Unknown keys, wrong types and impossible values are errors
//! that show the line.

use crate::input::TextOptions;
use crate::output::Compression;
use crate::{Error, Result};
use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

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

/// How tiles are to be packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CompressionChoice {
    /// With meshopt for 3D Tiles alone, whose viewers know it; else quantized.
    #[default]
    Auto,
    /// See [`Compression::Meshopt`].
    Meshopt,
    /// See [`Compression::Quantized`].
    Quantized,
    /// See [`Compression::None`].
    None,
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

/// In which form viewers get the terrain; the exact tiles are written in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Both where the terrain fits one file that viewers open, else 3D Tiles.
    #[default]
    Auto,
    /// One file, `terrain.glb`.
    Glb,
    /// 3D Tiles, `tileset.json`.
    Tiles,
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

/// Which of several points with the same x and y stays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Duplicates {
    /// The one with the least z.
    #[default]
    Lowest,
    /// The one with the greatest z.
    Highest,
    /// The one that is read first, in the order of the files.
    First,
}

/// What becomes of a job with a file that is no point cloud, is damaged, or has too many malformed records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OnBadFile {
    /// It stops with an error.
    #[default]
    Stop,
    /// It leaves the file out, all of it, and says so.
    Skip,
}

/// The unit of x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UnitChoice {
    /// As the CRS says; metres where there is none.
    #[default]
    Auto,
    /// 1 m.
    Metre,
    /// The international foot, 0.3048 m.
    Foot,
    /// The US survey foot, 1200/3937 m.
    UsFoot,
}

/// Who triangulates the tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// The fastest this machine has.
    #[default]
    Auto,
    /// The discrete-Voronoi pipeline on the CPU.
    Cpu,
    /// The discrete-Voronoi pipeline on a GPU.
    Gpu,
    /// `spade` alone: slower, for tests and doubters.
    Reference,
}

/// How a GPU computes the discrete Voronoi diagram. The mesh is the same either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Voronoi {
    /// The exact transform, which is the faster one.
    #[default]
    Auto,
    /// The exact transform: columns, then rows.
    Exact,
    /// Jump flooding, 1+JFA, as in the paper.
    Jfa,
}

/// Where vertex colours come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorChoice {
    /// The points' own colours, elevation where they have none.
    #[default]
    Auto,
    /// The points' own colours.
    Rgb,
    /// A ramp over the heights.
    Elevation,
    /// A colour per class.
    Class,
    /// No colours.
    None,
}

/// How long an edge of a triangle may be in the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "String")]
pub enum MaxEdge {
    /// As long as it is: the terrain is the whole triangulation.
    #[default]
    None,
    /// Ten times the local spacing of the sites.
    Auto,
    /// So many source units.
    Length(f64),
}

impl TryFrom<toml::Value> for MaxEdge {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<MaxEdge, String> {
        let length = match value {
            toml::Value::String(s) if s == "none" => return Ok(MaxEdge::None),
            toml::Value::String(s) if s == "auto" => return Ok(MaxEdge::Auto),
            toml::Value::Integer(i) => i as f64,
            toml::Value::Float(f) => f,
            _ => 0.0,
        };
        match length > 0.0 && length.is_finite() {
            true => Ok(MaxEdge::Length(length)),
            false => Err("max_edge is \"none\", \"auto\" or a positive number of source units, such as 30.0".into()),
        }
    }
}

impl From<MaxEdge> for String {
    fn from(max_edge: MaxEdge) -> String {
        match max_edge {
            MaxEdge::None => "none".into(),
            MaxEdge::Auto => "auto".into(),
            MaxEdge::Length(length) => length.to_string(),
        }
    }
}

/// A rectangle [xmin, ymin, xmax, ymax] in source units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[f64; 4]")]
pub struct Bounds(pub [f64; 4]);

impl TryFrom<[f64; 4]> for Bounds {
    type Error = String;

    fn try_from(b: [f64; 4]) -> std::result::Result<Bounds, String> {
        if b.iter().any(|v| !v.is_finite()) || b[0] >= b[2] || b[1] >= b[3] {
            return Err(format!("bounds are [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax, not {b:?}"));
        }
        Ok(Bounds(b))
    }
}

/// The step of the lattice: `None` means "auto".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "String")]
pub struct Resolution(pub Option<Decimal>);

impl TryFrom<toml::Value> for Resolution {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<Resolution, String> {
        let number = match value {
            toml::Value::String(s) if s == "auto" => return Ok(Resolution(None)),
            toml::Value::Integer(i) => Some(Decimal::from(i)),
            toml::Value::Float(f) => crate::geometry::lattice::shortest_decimal(f),
            _ => None,
        };
        match number {
            Some(step) if step > Decimal::ZERO => Ok(Resolution(Some(step))),
            _ => Err("resolution is \"auto\" or a positive number of source units, such as 0.01".into()),
        }
    }
}

impl From<Resolution> for String {
    fn from(resolution: Resolution) -> String {
        resolution.0.map_or("auto".into(), |step| step.to_string())
    }
}

/// A share between 0 and 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f64")]
pub struct Share(pub f64);

impl TryFrom<f64> for Share {
    type Error = String;

    fn try_from(share: f64) -> std::result::Result<Share, String> {
        if (0.0..=1.0).contains(&share) {
            Ok(Share(share))
        } else {
            Err(format!("a share lies between 0 and 1, not {share}"))
        }
    }
}

/// The side of the texture on a GPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "String")]
pub enum Texture {
    /// What suits the adapter.
    #[default]
    Auto,
    /// The largest that the adapter has.
    Max,
    /// This many pixels.
    Side(u32),
}

impl TryFrom<toml::Value> for Texture {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<Texture, String> {
        match value {
            toml::Value::String(s) if s == "auto" => Ok(Texture::Auto),
            toml::Value::String(s) if s == "max" => Ok(Texture::Max),
            toml::Value::Integer(side @ 64..=65_536) => Ok(Texture::Side(side as u32)),
            _ => Err("texture is \"auto\", \"max\" or a side from 64 to 65536 pixels".into()),
        }
    }
}

impl From<Texture> for String {
    fn from(texture: Texture) -> String {
        match texture {
            Texture::Auto => "auto".into(),
            Texture::Max => "max".into(),
            Texture::Side(side) => side.to_string(),
        }
    }
}

/// How many sites a tile holds at the most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "String")]
pub struct SitesPerTile(pub u64);

impl SitesPerTile {
    /// Keeps a leaf in the cache of one core while it is triangulated, and its vertices within 16-bit indices.
    const AUTO: SitesPerTile = SitesPerTile(50_000);
}

impl Default for SitesPerTile {
    fn default() -> SitesPerTile {
        SitesPerTile::AUTO
    }
}

impl TryFrom<toml::Value> for SitesPerTile {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<SitesPerTile, String> {
        match value {
            toml::Value::String(s) if s == "auto" => Ok(SitesPerTile::AUTO),
            toml::Value::Integer(sites @ 3..=50_000_000) => Ok(SitesPerTile(sites as u64)),
            _ => Err("sites_per_tile is \"auto\" or a whole number from 3 to 50000000".into()),
        }
    }
}

impl From<SitesPerTile> for String {
    fn from(sites: SitesPerTile) -> String {
        sites.0.to_string()
    }
}

/// How many sites a coarser tile holds at the most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "String")]
pub struct LevelSites(pub u64);

impl Default for LevelSites {
    /// As many as the exact tiles have by default.
    fn default() -> LevelSites {
        LevelSites(SitesPerTile::AUTO.0)
    }
}

impl TryFrom<toml::Value> for LevelSites {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<LevelSites, String> {
        match value {
            toml::Value::String(s) if s == "auto" => Ok(LevelSites::default()),
            toml::Value::Integer(sites @ 100..=10_000_000) => Ok(LevelSites(sites as u64)),
            _ => Err("level_sites is \"auto\" or a whole number from 100 to 10000000".into()),
        }
    }
}

impl From<LevelSites> for String {
    fn from(sites: LevelSites) -> String {
        sites.0.to_string()
    }
}

/// How many worker threads; 0: one per core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "i64")]
pub struct Threads(pub usize);

impl TryFrom<i64> for Threads {
    type Error = String;

    fn try_from(threads: i64) -> std::result::Result<Threads, String> {
        match threads {
            0..=1024 => Ok(Threads(threads as usize)),
            _ => Err(format!("threads is a number from 0 (one per core) to 1024, not {threads}")),
        }
    }
}

/// An amount of memory in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Memory(pub u64);

impl Memory {
    /// Below this not even the buffers of one tile are sure to fit.
    const LEAST: u64 = 128 << 20;
}

impl Default for Memory {
    fn default() -> Memory {
        Memory(4 << 30)
    }
}

impl TryFrom<String> for Memory {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Memory, String> {
        let bytes = parse_memory(&text)
            .ok_or_else(|| format!("memory is a text such as \"4 GiB\" or \"800 MB\", not {text:?}"))?;
        if bytes < Memory::LEAST {
            return Err(format!("memory must be at least {}", Memory(Memory::LEAST)));
        }
        Ok(Memory(bytes))
    }
}

impl From<Memory> for String {
    fn from(memory: Memory) -> String {
        memory.to_string()
    }
}

impl std::fmt::Display for Memory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (value, unit) = match self.0 {
            b if b >= 1 << 30 => (b as f64 / (1u64 << 30) as f64, "GiB"),
            b if b >= 1 << 20 => (b as f64 / (1u64 << 20) as f64, "MiB"),
            b => (b as f64 / 1024.0, "KiB"),
        };
        let decimals = if value.fract() == 0.0 { 0 } else { 1 };
        write!(f, "{value:.decimals$} {unit}")
    }
}

fn parse_memory(text: &str) -> Option<u64> {
    let text = text.trim();
    let split = text.find(|c: char| !c.is_ascii_digit() && c != '.')?;
    let value: f64 = text[..split].parse().ok()?;
    let unit: f64 = match text[split..].trim().to_ascii_lowercase().as_str() {
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        "tib" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        _ => return None,
    };
    Some((value * unit) as u64)
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

    #[test]
    fn amounts_of_memory() {
        assert_eq!(parse_memory("4 GiB"), Some(4 << 30));
        assert_eq!(parse_memory("1.5GB"), Some(1_500_000_000));
        assert_eq!(parse_memory("12"), None);
        assert_eq!(parse_memory("GiB"), None);
        assert_eq!(Memory(1 << 30).to_string(), "1 GiB");
        assert_eq!(Memory(1_500_000_000).to_string(), "1.4 GiB");
    }
}
