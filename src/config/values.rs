//! The values that keys of a configuration take: choices by name, and numbers within bounds.

use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

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

/// How tiles are to be packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CompressionChoice {
    /// With meshopt for 3D Tiles alone, whose viewers know it; else quantized.
    #[default]
    Auto,
    /// See [`crate::output::Compression::Meshopt`].
    Meshopt,
    /// See [`crate::output::Compression::Quantized`].
    Quantized,
    /// See [`crate::output::Compression::None`].
    None,
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

#[cfg(test)]
mod tests {
    use super::*;

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
