//! The files of lines: which ones the options name, and what they hold.

use crate::options::JobOptions;
use crate::plan::extent::Extent;
use crate::plan::named_files::files_of;
use breaklines::FeatureKind;
use points::lines::line_crs::{SystemOfPoints, bring_to_points};
use points::lines::options::LineOptions;
use points::lines::{LineFeature, LineFile, is_side_file, read_lines};
use points::{is_number_in_steps, shown_height};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use sys::{Error, Result, Warnings};

/// What messages call the option.
const FILES: &str = "[[breaklines]] files";

/// Heights of lines and points differ by less than this many units, on the earth and in the sea.
const FAR_AWAY: f64 = 100_000.0;

/// Numbers that stand for no height lie farther from all heights of the points, in units of the file.
const FAR_FROM_HEIGHTS: f64 = 100.0;

/// Heights have so many digits after the point, at most: the others come from converting them.
const DIGITS: f64 = 1e-6;

/// Lines are held in memory whole, with all that is made of them. Their files may take this share of the limit.
const SHARE_OF_MEMORY: u64 = 8;

/// Returns the files of lines that the options name, in their order, each with the options that name it. An entry names a file once, but
/// two entries may name the same one, for two of its layers.
///
/// # Errors
/// [`Error::Config`] if a pattern names none, [`Error::Input`] if it names a folder of a geodatabase, [`Error::Io`] if a folder cannot be
/// read.
pub(crate) fn line_paths(all: &[LineOptions]) -> Result<Vec<(&LineOptions, PathBuf)>> {
    let mut paths = Vec::new();
    for options in all {
        let first = paths.len();
        for pattern in &options.files {
            refuse_geodatabase(pattern)?;
            let found = files_of(pattern, FILES)?;
            let is_only_beside = !found.is_empty() && found.iter().all(|path| is_side_file(path));
            if found.is_empty() || is_only_beside {
                return Err(Error::Config(format!("{FILES}: there is no file of lines {pattern}")));
            }
            for path in found.into_iter().filter(|path| !is_side_file(path)) {
                if paths[first..].iter().all(|(_, known)| *known != path) {
                    paths.push((options, path));
                }
            }
        }
    }
    Ok(paths)
}

/// Nothing but a program of Esri reads all of a file geodatabase. It is a folder, so no file in it could be named instead.
fn refuse_geodatabase(pattern: &str) -> Result<()> {
    let path = Path::new(pattern.trim_end_matches(['/', '\\']));
    let is_one = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gdb")) && path.is_dir();
    match is_one {
        true => Err(Error::input(
            path,
            format!(
                "is an Esri file geodatabase: convert it first, for example with `ogr2ogr lines.gpkg {}`",
                path.display()
            ),
        )),
        false => Ok(()),
    }
}

/// The files of lines of a job, in source units.
#[derive(Debug, Default)]
pub(crate) struct LineFiles {
    pub(super) files: Vec<LineFile>,
}

impl LineFiles {
    /// Reads all files that the options name, and transforms their lines into the system of the `points`.
    ///
    /// # Errors
    /// [`Error::Config`] if there is no way from its system to that of the points, or they are too large; [`Error::Input`] if one is bad;
    /// [`Error::Io`] if one cannot be read.
    pub(crate) fn read(options: &JobOptions, points: &SystemOfPoints, warnings: &mut Warnings) -> Result<LineFiles> {
        let paths = line_paths(&options.breaklines)?;
        let memory = options.limits.memory.0;
        check_size(&paths, memory)?;
        let read = |(options, path): &(&LineOptions, PathBuf)| {
            let mut file = read_lines(path, options, memory)?;
            bring_to_points(&mut file, options, points)?;
            Ok(file)
        };
        let read: Vec<Result<LineFile>> = paths.par_iter().map(read).collect();
        // The first error in the order of the files.
        let files = read.into_iter().collect::<Result<Vec<_>>>()?;
        files.iter().for_each(|file| warnings.extend_from_file(&file.path, &file.warnings));
        Ok(LineFiles { files })
    }

    /// Tells whether there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// Extends the heights of `extent` to those of the lines above and below it.
    ///
    /// # Errors
    /// [`Error::Input`] if a height stands for none, or is far from all points: the lattice would be made for it, and too coarse for all
    /// others.
    pub(crate) fn extend_heights(&self, extent: &mut Extent) -> Result<()> {
        let own = [extent.min[2], extent.max[2]];
        let points = [own[0] - FAR_AWAY, own[1] + FAR_AWAY];
        for file in &self.files {
            for feature in &file.features {
                for vertex in vertices_that_count(feature, extent) {
                    let z = vertex[2];
                    let far = FAR_FROM_HEIGHTS * file.height_scale;
                    let is_nodata = is_number_in_steps(z / file.height_scale, DIGITS);
                    if is_nodata && (z < own[0] - far || z > own[1] + far) {
                        return Err(no_height(file, feature, vertex));
                    }
                    if z < points[0] || z > points[1] {
                        return Err(too_far_away(file, feature, vertex));
                    }
                    extent.min[2] = extent.min[2].min(z);
                    extent.max[2] = extent.max[2].max(z);
                }
            }
        }
        Ok(())
    }
}

/// Returns the vertices whose heights come into the mesh: the ends of segments that may meet the box, and the lowest one of a lake.
fn vertices_that_count(feature: &LineFeature, extent: &Extent) -> Vec<[f64; 3]> {
    let outlines = feature.shape.outlines();
    let is_apart = |vertices: &[[f64; 3]]| {
        (0..2).any(|axis| {
            vertices.iter().all(|vertex| vertex[axis] < extent.min[axis])
                || vertices.iter().all(|vertex| vertex[axis] > extent.max[axis])
        })
    };
    let mut found = Vec::new();
    for outline in outlines.iter().filter(|outline| !is_apart(outline)) {
        if feature.kind == FeatureKind::Lake {
            found.extend(outlines.iter().flatten().copied().min_by(|a, b| a[2].total_cmp(&b[2])));
            break;
        }
        // An outline goes on from its last vertex to its first. That of a line does not, but then both count anyway.
        let next = outline.iter().cycle().skip(1);
        found.extend(outline.iter().zip(next).filter(|(a, b)| !is_apart(&[**a, **b])).flat_map(|(a, b)| [*a, *b]));
    }
    found.retain(|vertex| vertex[2].is_finite());
    found
}

fn no_height(file: &LineFile, feature: &LineFeature, [x, y, z]: [f64; 3]) -> Error {
    let z = shown_height((z / file.height_scale).round());
    let what = format!(
        "feature {} has the height {z} at ({x}, {y}), which stands for no height (nodata): correct it, leave the feature out, or take its \
         heights from the points around with heights = \"points\" in [[breaklines]]",
        feature.number
    );
    Error::input(&file.path, what)
}

fn too_far_away(file: &LineFile, feature: &LineFeature, [x, y, z]: [f64; 3]) -> Error {
    let what = format!(
        "feature {} has the height {z:?} at ({x}, {y}), more than {FAR_AWAY} above or below all points: correct it, leave the feature out, or \
         take its heights from the points around with heights = \"points\" in [[breaklines]]",
        feature.number
    );
    Error::input(&file.path, what)
}

fn check_size(paths: &[(&LineOptions, PathBuf)], memory: u64) -> Result<()> {
    let mut bytes = 0u64;
    for (_, path) in paths {
        // The attributes of a Shapefile are read record by record.
        bytes += path.metadata().map_err(Error::io("read", path))?.len();
    }
    if bytes <= memory / SHARE_OF_MEMORY {
        return Ok(());
    }
    Err(Error::Config(format!(
        "the files of [[breaklines]] have {} MiB together, and lines are held in memory: cut out those of the area (for example with \
         `ogr2ogr -clipsrc`), or raise [limits] memory",
        bytes >> 20
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::Crs;
    use points::lines::LineShape;
    use points::lines::options::LinePurpose;
    use sys::ErrorKind;

    fn extended(kind: FeatureKind, heights: [f64; 4]) -> Result<[f64; 2]> {
        let corners = [[-50.0, -50.0], [60.0, -50.0], [60.0, 70.0], [-50.0, 70.0]];
        let ring = corners.iter().zip(heights).map(|([x, y], z)| [*x, *y, z]).collect();
        let shape = if kind == FeatureKind::Lake { LineShape::Area(vec![ring]) } else { LineShape::Line(ring) };
        let features = vec![LineFeature { number: 4, name: None, kind, shape }];
        let file = LineFile {
            path: "a.shp".into(),
            crs: Crs::default(),
            purpose: LinePurpose::default(),
            height_scale: 1.0,
            features,
            warnings: Warnings::default(),
        };
        let mut extent = Extent { min: [0.0; 3], max: [10.0, 10.0, 20.0], boxes: Vec::new() };
        LineFiles { files: vec![file] }.extend_heights(&mut extent)?;
        Ok([extent.min[2], extent.max[2]])
    }

    #[test]
    fn numbers_that_stand_for_no_height_are_refused() {
        for heights in [[8.0, -9999.0, 8.0, 8.0], [-32_768.0; 4], [99_999.0; 4]] {
            let error = extended(FeatureKind::Lake, heights).unwrap_err();
            let text = error.to_string();
            assert!(
                error.kind() == ErrorKind::Input && text.contains("stands for no height") && text.contains("heights ="),
                "{text}"
            );
        }
        // Far from the box, and so never used.
        assert_eq!(extended(FeatureKind::Line, [8.0, 8.0, -9999.0, 8.0]).unwrap(), [0.0, 20.0]);
    }

    #[test]
    fn heights_of_lines_count_where_they_come_into_the_mesh() {
        // No segment comes near the box, but it lies in the lake.
        assert_eq!(extended(FeatureKind::Lake, [-7.0, 90.0, 1e12, 8.0]).unwrap(), [-7.0, 20.0]);
        assert_eq!(extended(FeatureKind::Line, [-7.0, 90.0, 1e12, 8.0]).unwrap(), [0.0, 20.0]);
        for wrong in [-1e12, 1e7] {
            let error = extended(FeatureKind::Lake, [wrong; 4]).unwrap_err();
            let text = error.to_string();
            assert!(error.kind() == ErrorKind::Input && text.contains("a.shp: feature 4 has the height"), "{text}");
        }
    }
}
