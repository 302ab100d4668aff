//! The area of `[input] clip`: the polygons of a file, brought to the system of the job as breaklines are, and then to its lattice.
//!
//! Points come to the lattice, and the polygons to one that is up to a thousand times as fine, each vertex rounded once. Whether a point lies
//! inside is decided there, in whole numbers ([`LatticeArea`]). The box of the polygons does for the plan what `bounds` do: it limits the extent, and the nodes of a COPC
//! file that are read. Unlike `bounds`, it also leaves files aside whose headers lie outside.

use crate::options::JobOptions;
use crate::plan::extent::{MEASURE, measure, to_float};
use lattice::{Lattice, LatticeArea, Polygons};
use points::Source;
use points::lines::line_crs::{SystemOfPoints, bring_to_points};
use points::lines::options::LineOptions;
use points::lines::{LineFile, LineShape, read_lines};
use points::options::InputOptions;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use sys::{Error, Result, Warnings, interrupt};

/// Polygons are held in memory whole, with all that is made of them. Their file may take this share of the limit.
const SHARE_OF_MEMORY: u64 = 8;

/// A header is believed to leave a file aside if so many of the first records lie within its box.
const RECORDS_LOOKED_AT: u64 = 4096;

/// The box of a header may be off by this share of its size: some programs round it.
const SLACK: f64 = 1e-3;

/// How messages begin that blame the file of a clip for what a configuration cannot be.
pub const CLIP: &str = "[input] clip";

/// The polygons of a clip in source units.
#[derive(Debug)]
pub(crate) struct ClipFile(LineFile);

/// The polygons of a clip on the lattice of a job.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PlannedClip {
    /// The file that they are from.
    #[serde(with = "sys::path_text")]
    pub file: PathBuf,
    /// Their rings, in parts of a lattice step.
    pub polygons: Polygons,
    /// The number of parts in a lattice step.
    pub parts: i64,
    /// Their box in source units, as their file has them: [xmin, ymin, xmax, ymax].
    pub area_box: [f64; 4],
    /// A box in source units outside of which no point can come to a place within the area.
    pub reach: [f64; 4],
    #[serde(skip)]
    area: OnceLock<Arc<LatticeArea>>,
}

impl ClipFile {
    /// Reads the file that the options name, and transforms its polygons into the system of the `points`; `None` if they name none.
    ///
    /// # Errors
    /// [`Error::Input`] if it has no polygon, or is bad; [`Error::Config`] if there is no way from its system to that of the points, or it
    /// is too large; [`Error::Io`] if it cannot be read.
    pub(crate) fn read(
        options: &JobOptions,
        points: &SystemOfPoints,
        warnings: &mut Warnings,
    ) -> Result<Option<ClipFile>> {
        let Some(path) = clip_path(&options.input)? else { return Ok(None) };
        let memory = options.limits.memory.0;
        check_size(path, memory)?;
        let lines = LineOptions::of_clip(path);
        let mut file = read_lines(path, &lines, memory)?;
        if file.features.is_empty() {
            return Err(Error::input(
                path,
                "has no polygon, and [input] clip keeps the points within polygons: make polygons of its lines (in QGIS: \"Lines to \
                 polygons\"), or name another file",
            ));
        }
        bring_to_points(&mut file, &lines, points).map_err(|error| match error {
            Error::Config(what) => Error::Config(format!("{CLIP}: {what}")),
            error => error,
        })?;
        warnings.extend_from_file(&file.path, &file.warnings);
        Ok(Some(ClipFile(file)))
    }

    /// Returns the box of the polygons in source units.
    pub(crate) fn area_box(&self) -> [f64; 4] {
        let vertices = || self.0.features.iter().flat_map(|feature| feature.shape.outlines()).flatten();
        let least = |axis: usize| vertices().map(|vertex| vertex[axis]).fold(f64::INFINITY, f64::min);
        let greatest = |axis: usize| vertices().map(|vertex| vertex[axis]).fold(f64::NEG_INFINITY, f64::max);
        [least(0), least(1), greatest(0), greatest(1)]
    }

    /// Returns the polygons on the lattice.
    ///
    /// # Errors
    /// [`Error::Input`] names a feature with a vertex that is no place on it.
    pub(crate) fn on_lattice(&self, lattice: &Lattice) -> Result<PlannedClip> {
        let (places, parts) = lattice.for_places();
        let mut polygons = Vec::with_capacity(self.0.features.len());
        for feature in &self.0.features {
            interrupt::check()?;
            let LineShape::Area(rings) = &feature.shape else { continue };
            let vertex = |&[x, y, _]: &[f64; 3]| match (places.nearest(0, x), places.nearest(1, y)) {
                (Some(x), Some(y)) => Ok([x, y]),
                _ => {
                    let what = format!("feature {} has the vertex ({x:?}, {y:?}), which is no place", feature.number);
                    Err(Error::input(&self.0.path, what))
                }
            };
            let ring = |ring: &Vec<[f64; 3]>| ring.iter().map(vertex).collect::<Result<Vec<_>>>();
            polygons.push(rings.iter().map(ring).collect::<Result<Vec<_>>>()?);
        }
        let area = LatticeArea::new(&polygons, parts);
        let (file, area_box) = (self.0.path.clone(), self.area_box());
        let reach = reach(&area, lattice).unwrap_or(area_box);
        Ok(PlannedClip { file, polygons, parts, area_box, reach, area: OnceLock::from(Arc::new(area)) })
    }

    /// Leaves the files aside whose headers say that no point of theirs lies in the box of the polygons, and whose first records do not
    /// say otherwise: a folder of thousands of files is not read for a few of them. Texts are read whole in any case.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(crate) fn leave_files_aside(&self, sources: &mut [Source], input: &InputOptions) -> Result<()> {
        let area_box = self.area_box();
        sources.par_iter_mut().try_for_each(|source| {
            interrupt::check()?;
            if is_outside(source, area_box) && is_header_right(source, input)? {
                source.leave_aside();
            }
            Ok(())
        })
    }
}

impl PlannedClip {
    /// Returns the area.
    pub(crate) fn area(&self) -> Arc<LatticeArea> {
        self.area.get_or_init(|| Arc::new(LatticeArea::new(&self.polygons, self.parts))).clone()
    }
}

/// Returns the box of an area in source units, a step farther out, so that no number that is rounded into the area lies outside of it.
fn reach(area: &LatticeArea, lattice: &Lattice) -> Option<[f64; 4]> {
    let [min, max] = area.bounds()?;
    let low = |axis: usize| lattice.world(axis, min[axis].saturating_sub(1));
    let high = |axis: usize| lattice.world(axis, max[axis].saturating_add(1));
    Some([low(0), low(1), high(0), high(1)])
}

/// Returns the file that the options name; `None` if they name none.
///
/// # Errors
/// [`Error::Config`] if it is not there or a folder, [`Error::Io`] if the system does not tell.
pub(crate) fn clip_path(input: &InputOptions) -> Result<Option<&Path>> {
    let Some(path) = input.clip.as_deref().map(Path::new) else { return Ok(None) };
    match path.metadata() {
        Ok(found) if found.is_dir() => Err(Error::Config(format!(
            "{CLIP}: {} is a folder: name one Shapefile, GeoPackage or GeoJSON file",
            path.display()
        ))),
        Ok(_) => Ok(Some(path)),
        Err(error) if error.kind() == ErrorKind::NotFound => {
            Err(Error::Config(format!("{CLIP}: there is no file {}", path.display())))
        }
        Err(error) => Err(Error::io("read", path)(error)),
    }
}

/// Checks that the file fits the memory.
fn check_size(path: &Path, memory: u64) -> Result<()> {
    let size = path.metadata().map_err(Error::io("read", path))?.len();
    if size <= memory / SHARE_OF_MEMORY {
        return Ok(());
    }
    Err(Error::Config(format!(
        "{} has {} MiB, and the polygons of [input] clip are held in memory: cut out those of the area (for example with `ogr2ogr \
         -clipsrc`), or raise [limits] memory",
        path.display(),
        size >> 20
    )))
}

/// Tells whether a source claims to have no point in a box.
fn is_outside(source: &Source, [xmin, ymin, xmax, ymax]: [f64; 4]) -> bool {
    let Some([min, max]) = claimed(source) else { return false };
    max[0] < xmin || min[0] > xmax || max[1] < ymin || min[1] > ymax
}

/// Returns the rectangle that a header claims, and a little around it; `None` for a text.
fn claimed(source: &Source) -> Option<[[f64; 2]; 2]> {
    let [min, max] = source.claimed_rectangle().filter(|_| !source.format.is_text())?;
    let slack =
        |axis: usize| SLACK * (max[axis] - min[axis]) + 2.0 * MEASURE as f64 * to_float(source.axes[axis].scale);
    Some([[min[0] - slack(0), min[1] - slack(1)], [max[0] + slack(0), max[1] + slack(1)]])
}

/// Tells whether the first records of a source lie within the rectangle of its header. One whose records cannot be read is not believed:
/// reading it says what is wrong.
fn is_header_right(source: &Source, input: &InputOptions) -> Result<bool> {
    let Some([least, greatest]) = claimed(source).filter(|_| source.measured().is_none()) else { return Ok(false) };
    if source.chunks() == 0 {
        return Ok(false);
    }
    match measure(source, input, 0..1, RECORDS_LOOKED_AT) {
        Ok(found) => {
            Ok(found
                .is_none_or(|[min, max]| (0..2).all(|axis| min[axis] >= least[axis] && max[axis] <= greatest[axis])))
        }
        Err(Error::Interrupted) => Err(Error::Interrupted),
        Err(_) => Ok(false),
    }
}
