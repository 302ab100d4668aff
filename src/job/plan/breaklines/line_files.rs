//! The files of lines: which ones the options name, and what they hold.

use crate::input::Crs;
use crate::input::lines::options::{LineHeights, LineOptions};
use crate::input::lines::{LineFile, is_side_file, read_lines};
use crate::job::options::JobOptions;
use crate::job::plan::breaklines::line_crs::bring_to_points;
use crate::job::plan::extent::Extent;
use crate::job::plan::named_files::files_of;
use crate::{Error, Result, Warnings};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// What messages call the option.
const FILES: &str = "[[breaklines]] files";

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
    /// Reads all files that the options name, and transforms their lines into the system `crs` of the points.
    ///
    /// # Errors
    /// [`Error::Config`] if there is no way from its system to that of the points, or they are too large; [`Error::Input`] if one is bad; [`Error::Io`] if one cannot be
    /// read.
    pub(crate) fn read(options: &JobOptions, crs: &Crs, warnings: &mut Warnings) -> Result<LineFiles> {
        let paths = line_paths(&options.breaklines)?;
        check_size(&paths, options.limits.memory.0)?;
        let datums = options.input.datums;
        let read = |(options, path): &(&LineOptions, PathBuf)| {
            let mut file = read_lines(path, options)?;
            bring_to_points(&mut file, &options.crs, crs, datums)?;
            Ok(file)
        };
        let read: Vec<Result<LineFile>> = paths.par_iter().map(read).collect();
        // The first error in the order of the files.
        let files = read.into_iter().collect::<Result<Vec<_>>>()?;
        for ((options, _), file) in paths.iter().zip(&files) {
            warnings.extend_from_file(&file.path, &file.warnings);
            if options.heights == LineHeights::File && options.height_field.is_none() {
                warnings.extend(all_at_zero(file));
            }
        }
        Ok(LineFiles { files })
    }

    /// Tells whether there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// Extends the heights of `extent` to those of the lines above and below it.
    pub(crate) fn extend_heights(&self, extent: &mut Extent) {
        let (min, max) = (extent.min, extent.max);
        let apart = |a: &[f64; 3], b: &[f64; 3]| {
            (0..2).any(|axis| a[axis].max(b[axis]) < min[axis] || a[axis].min(b[axis]) > max[axis])
        };
        for outline in self.files.iter().flat_map(|file| &file.features).flat_map(|feature| feature.shape.outlines()) {
            // An outline goes on from its last vertex to its first. That of a line does not, but then both count anyway.
            let next = outline.iter().cycle().skip(1);
            for (a, b) in outline.iter().zip(next).filter(|(a, b)| !apart(a, b)) {
                for z in [a[2], b[2]].into_iter().filter(|z| z.is_finite()) {
                    extent.min[2] = extent.min[2].min(z);
                    extent.max[2] = extent.max[2].max(z);
                }
            }
        }
    }
}

fn check_size(paths: &[(&LineOptions, PathBuf)], memory: u64) -> Result<()> {
    let mut bytes = 0u64;
    for (_, path) in paths {
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

/// Says that the lines of a file have heights, but all are zero, as programs write them that know none.
fn all_at_zero(file: &LineFile) -> Option<String> {
    let mut heights = file.features.iter().flat_map(|f| f.shape.outlines()).flatten().map(|vertex| vertex[2]);
    let is_zero = !file.features.is_empty() && heights.all(|z| z == 0.0);
    is_zero.then(|| {
        format!(
            "{}: all its heights are 0; if it has none, say heights = \"points\" in [[breaklines]] to take them from the points around",
            file.path.display()
        )
    })
}
