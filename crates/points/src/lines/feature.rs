//! Features of a file of lines.

use std::path::PathBuf;

use crate::lines::options::LinePurpose;
use breaklines::FeatureKind;
use crs::system::Crs;
use sys::Warnings;

/// What a file of lines holds.
#[derive(Clone, Debug)]
pub struct LineFile {
    /// The file.
    pub path: PathBuf,
    /// The coordinate reference system that the file says.
    pub crs: Crs,
    /// What it is read for.
    pub purpose: LinePurpose,
    /// By what its heights have been multiplied to be in the unit of the points' heights.
    pub height_scale: f64,
    /// Its features, in their order.
    pub features: Vec<LineFeature>,
    /// What the user should know about the file.
    pub warnings: Warnings,
}

/// A line or an area. Its coordinates are finite; a height is NaN where it is to come from the points.
#[derive(Clone, Debug, PartialEq)]
pub struct LineFeature {
    /// Its number in the file: the record of a Shapefile and the feature of GeoJSON, both from 1 on, or the key in a GeoPackage (the
    /// place of the row where keys are no numbers). The parts of a feature with several share it.
    pub number: u64,
    /// The value of its attribute "name", if the options ask for it and it has one.
    pub name: Option<String>,
    /// What it is.
    pub kind: FeatureKind,
    /// Where it is.
    pub shape: LineShape,
}

/// The vertices x, y, z of a feature.
#[derive(Clone, Debug, PartialEq)]
pub enum LineShape {
    /// A line of two vertices or more.
    Line(Vec<[f64; 3]>),
    /// An area: its outline, and the outlines of its islands. The last vertex of each is joined with the first, and does not repeat it.
    Area(Vec<Vec<[f64; 3]>>),
}

impl LineShape {
    /// Returns the lines, or the outlines of an area.
    pub fn outlines(&self) -> &[Vec<[f64; 3]>] {
        match self {
            LineShape::Line(line) => std::slice::from_ref(line),
            LineShape::Area(rings) => rings,
        }
    }

    /// Returns the vertices, to be changed.
    pub fn vertices_mut(&mut self) -> impl Iterator<Item = &mut [f64; 3]> {
        let outlines = match self {
            LineShape::Line(line) => std::slice::from_mut(line),
            LineShape::Area(rings) => rings.as_mut_slice(),
        };
        outlines.iter_mut().flatten()
    }
}

/// The geometry of a feature as a file has it. A vertex without a height has NaN there.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum RawGeometry {
    /// Lines.
    Lines(Vec<Vec<[f64; 3]>>),
    /// Areas: each has an outline first, and then those of its islands.
    Areas(Vec<Vec<Vec<[f64; 3]>>>),
    /// Several of different kinds.
    Several(Vec<RawGeometry>),
    /// Nothing.
    Empty,
    /// What is no line and no area, such as a point.
    Other(&'static str),
}
