//! What a point cloud holds, as its header or a first pass over it says: for people, and as JSON.

use std::fmt;

use serde::Serialize;

use crate::histogram::Histogram;
use crate::points::axis::AXIS_NAMES;
use crate::source::{FileFormat, Source};
use crate::surface::{MeshOf, Surface, SurfaceShares};
use crs::system::Crs;
use crs::unit::Unit;
use sys::terminal::one_line;
use sys::{Result, ShownWarning, Warnings};

/// The output of `gdt-batch info`: `Display` is for people, `Serialize` for programs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SourceDescription {
    /// The file.
    pub file: String,
    /// Its size in bytes.
    pub size: u64,
    /// How it holds its points.
    pub format: FileFormat,
    /// LAS version, as in "1.4".
    pub version: Option<String>,
    /// LAS point format.
    pub point_format: Option<u8>,
    /// The number of points that it says it has.
    pub points: u64,
    /// The number of points by return, from the first return on, as the header claims.
    pub points_by_return: Vec<u64>,
    /// Least x, y, z; as the header claims for LAS.
    pub min: [f64; 3],
    /// Greatest x, y, z; likewise.
    pub max: [f64; 3],
    /// Steps of x, y, z, exact.
    pub scale: [String; 3],
    /// Offsets of x, y, z, exact.
    pub offset: [String; 3],
    /// Whether points have a colour.
    pub color: bool,
    /// Whether points have a classification.
    pub classification: bool,
    /// The number of parts that can be decoded independently.
    #[serde(rename = "pieces")]
    pub chunks: usize,
    /// The coordinate reference system.
    pub crs: Crs,
    /// The length of one unit of x and y in metres.
    pub metres_per_unit: Option<f64>,
    /// How many points of each kind there are, if that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub histogram: Option<Histogram>,
    /// What a mesh of all points but noise will be, by their classes.
    pub surface: Option<String>,
    /// The points that tell it: all of them if there is a histogram, else a sample.
    pub surface_sample: Option<SurfaceShares>,
    /// What is unusual about the file.
    pub warnings: Warnings,
}

/// Describes `source`.
pub fn describe(source: &Source) -> SourceDescription {
    let mut warnings = source.warnings.clone();
    warnings.extend(source.crs.depths());
    let last = source.by_return.iter().rposition(|&count| count > 0).map_or(0, |last| last + 1);
    SourceDescription {
        file: source.path.display().to_string(),
        size: source.size,
        format: source.format,
        version: source.version.map(|[major, minor]| format!("{major}.{minor}")),
        point_format: source.point_format,
        points: source.records,
        points_by_return: source.by_return[..last].to_vec(),
        min: source.min,
        max: source.max,
        scale: source.axes.map(|axis| axis.scale.to_string()),
        offset: source.axes.map(|axis| axis.offset.to_string()),
        color: source.has_rgb,
        classification: source.has_class,
        chunks: source.chunks(),
        crs: source.crs.clone(),
        metres_per_unit: source.crs.metres_per_unit(),
        histogram: None,
        surface: None,
        surface_sample: None,
        warnings,
    }
}

impl SourceDescription {
    /// Adds what a mesh of the points will be: by the histogram if there is one, or by a sample of `source`.
    ///
    /// # Errors
    /// Those of [`SurfaceShares::sampled`].
    pub fn with_surface(mut self, source: &Source) -> Result<SourceDescription> {
        if let Some(histogram) = &self.histogram {
            self.surface_sample = Some(histogram.shares());
            self.surface = histogram.shares().sentence(MeshOf::Surface(Surface::All));
        } else {
            self.surface_sample = SurfaceShares::sampled(source)?;
            self.surface = self.surface_sample.and_then(|shares| shares.estimate(MeshOf::Surface(Surface::All)));
        }
        Ok(self)
    }

    fn kind(&self) -> String {
        let name = self.format.name();
        match (&self.version, self.point_format) {
            (Some(version), Some(format)) => format!("{name} {version}, point format {format}"),
            _ => name.to_string(),
        }
    }

    fn content(&self) -> &'static str {
        match (self.color, self.classification) {
            (true, true) => "colour, classification",
            (true, false) => "colour",
            (false, true) => "classification",
            (false, false) => "coordinates only",
        }
    }

    fn vertical(&self) -> String {
        self.crs.vertical.map_or("unknown".to_string(), |metres| format!("{metres} m"))
    }
}

impl fmt::Display for SourceDescription {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(f, "{}", one_line(&self.file))?;
        writeln!(f, "  format   {}, {} bytes", self.kind(), self.size)?;
        writeln!(f, "  points   {} ({})", self.points, self.content())?;
        if !self.points_by_return.is_empty() {
            writeln!(f, "  returns  {:?}", self.points_by_return)?;
        }
        for (axis, name) in AXIS_NAMES.into_iter().enumerate() {
            let (min, max, step, offset) = (self.min[axis], self.max[axis], &self.scale[axis], &self.offset[axis]);
            let decimals = step.split_once('.').map_or(0, |(_, decimals)| decimals.len());
            writeln!(f, "  {name}        {min:.decimals$} to {max:.decimals$}, step {step}, offset {offset}")?;
        }
        writeln!(f, "  crs      {}", self.crs.label())?;
        writeln!(f, "  unit     {} in x and y, {} in z", self.crs.horizontal.name(), self.vertical())?;
        if self.crs.horizontal == Unit::Degree {
            writeln!(f, "  a job    needs [input] to_crs = \"utm\" or \"EPSG:...\", which transforms degrees")?;
        }
        if let Some(surface) = &self.surface {
            writeln!(f, "  surface  {surface}")?;
        }
        if let Some(histogram) = &self.histogram {
            write!(f, "{histogram}")?;
        }
        for warning in self.warnings.iter() {
            let shown = ShownWarning(warning).to_string();
            writeln!(f, "  {}", shown.replacen("warning: ", "warning  ", 1).replace("\n  fix: ", "\n  fix      "))?;
        }
        Ok(())
    }
}
