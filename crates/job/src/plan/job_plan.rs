//! The plan of a job.

use crate::durable::atomic_file::{PendingFile, write_pending};
use crate::index::PartIndex;
use crate::options::JobOptions;
use crate::plan::breaklines::PlannedBreaklines;
use crate::plan::clip::PlannedClip;
use crate::plan::ground_cells::GroundCells;
use crate::plan::ground_triangles::GroundTriangles;
use crate::plan::input_identity::RenamedInputs;
use crate::plan::lattice_choice::LatticeCoarsening;
use crate::plan::missing_attributes::missing_attributes;
use crate::plan::plan_cut::{CutInput, PlanCut};
use crate::plan::terrain_crowd::TerrainCrowd;
use crate::progress::number_text::grouped;
use breaklines::Breaklines;
use crs::Crs;
use delaunay::geometry::Bounds;
use lattice::Lattice;
use points::options::InputOptions;
use points::{PointCounts, PointRules, Source};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use sys::{Error, Result, Warnings};
use tiles::color::HeightRange;
use tiles::curvature::Curvature;
use tiles::frame::Frame;

/// What a job reads and where it puts it. The plan holds everything that later steps need besides what earlier steps stored: no step
/// reads a header again. What steps compute from it is the same on every machine, except the transforms onto the globe and the curvature
/// where the program does not compute the projection itself. Each is computed once.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Plan {
    /// What the user wants.
    pub options: JobOptions,
    /// The inputs in their order.
    pub inputs: Vec<PlannedInput>,
    /// The inputs that are left out because they are bad.
    pub skipped: Vec<SkippedInput>,
    /// The number of records in all inputs.
    pub records: u64,
    /// How much coarser the lattice is than the inputs ask for.
    pub coarsening: LatticeCoarsening,
    /// The lattice that all sites lie on.
    pub lattice: Lattice,
    /// The box of the inputs on the lattice as their headers claim it, within `[input] bounds`.
    pub extent: Bounds<2>,
    /// What is known of all points before the first is triangulated: what headers claim, or what was read where one part has read all. `None`
    /// before that.
    pub claims: Option<Claims>,
    /// The heights that a ramp of colours spans, by a sample of the points. `None` if they are too few to tell: then the box of the points,
    /// or what is claimed of it, decides.
    pub heights: Option<HeightRange>,
    /// What became of the records of a sample, the one that `heights` is from.
    pub sample: PointCounts,
    /// The CRS of the job.
    pub crs: Crs,
    /// The name of the unit of x and y.
    pub unit: String,
    /// The area of the box around all records in square lattice steps, as headers claim it, whatever part of it the user wants.
    pub claimed_area: u64,
    /// How the plane is cut, where an update keeps the cuts of the first run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) cut: Option<PlanCut>,
    /// The way from the lattice to glTF, of a scene that is not bent.
    pub frame: Frame,
    /// How the scene follows the curve of the earth. It is found once, by the claims, and kept, because not all projections have the same bits
    /// on every machine.
    #[serde(default)]
    pub curvature: Option<Curvature>,
    /// The breaklines; `None` without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub breaklines: Option<PlannedBreaklines>,
    /// The area that points are kept in; `None` for everywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clip: Option<PlannedClip>,
    /// A sentence about a few points that stretch the area, if there are some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stretch: Option<String>,
    /// With `surface = "bare-earth"`: how many cells the ground has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) ground_cells: Option<GroundCells>,
    /// With `[output.terrain]`: how many vertices the most crowded tile has. Unknown in a plan that was read.
    #[serde(skip)]
    pub(crate) terrain_crowd: Option<TerrainCrowd>,
    /// With `max_error`: which long triangles lie on ground.
    #[serde(skip)]
    pub on_ground: GroundTriangles,
    /// What the user should know about the inputs. [`Plan::all_warnings`] adds what there is to know about the options.
    pub warnings: Warnings,
}

/// An input and the rules for its points.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PlannedInput {
    /// What its header says.
    pub source: Source,
    /// How its points come to the lattice, and which of them are kept.
    pub rules: PointRules,
    /// The lattice box of its points, as far as its header tells.
    pub claimed: Bounds<2>,
    /// With `--update`, its key: a hash of its content, and of how its points come to the lattice. Else 0.
    #[serde(default)]
    pub(crate) key: u64,
}

impl PlannedInput {
    /// Returns the number of records that are decoded. An index may tell that others are out of bounds.
    pub fn decoded_records(&self) -> u64 {
        decoded_records(&self.source, &self.rules)
    }
}

/// Returns the number of records that are decoded of a source.
pub(crate) fn decoded_records(source: &Source, rules: &PointRules) -> u64 {
    source.decoded_chunks(rules.bounds.as_ref()).records
}

/// What is known of all points before the first is triangulated. All tiles have one style, so in a job of several parts it cannot wait for
/// the last point: headers and first chunks tell. If a point shows that one is wrong, all inputs are measured, and the job starts again.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Claims {
    /// The lattice box of the points.
    pub bounds: Bounds<3>,
    /// The greatest red, green or blue. Only whether it exceeds 0, and 255, counts.
    pub max_rgb: u16,
}

impl Claims {
    /// Returns the claims with the sites of lines within `bounds`.
    pub(crate) fn with_lines(self, bounds: Option<Bounds<3>>) -> Claims {
        Claims { bounds: bounds.map_or(self.bounds, |bounds| bounds.union(self.bounds)), ..self }
    }

    /// Tells whether points within `bounds`, of which `max_rgb` is the greatest colour, contradict the claims.
    pub fn are_broken_by(&self, bounds: Bounds<3>, max_rgb: u16) -> bool {
        self.bounds.union(bounds) != self.bounds || range_of_colors(max_rgb) > range_of_colors(self.max_rgb)
    }
}

/// Returns 0 for no colours, 1 for colours of eight bits, 2 for longer ones.
fn range_of_colors(max_rgb: u16) -> u8 {
    match max_rgb {
        0 => 0,
        1..=255 => 1,
        _ => 2,
    }
}

/// An input that is left out because it is bad.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkippedInput {
    /// The file.
    #[serde(with = "sys::path_text")]
    pub file: PathBuf,
    /// What is wrong with it.
    pub why: String,
}

impl SkippedInput {
    /// Calls the input what it is called by now.
    pub(crate) fn rename(&mut self, renamed: &RenamedInputs) {
        renamed.rename(&mut self.file);
        renamed.rename_in(&mut self.why);
    }
}

impl Plan {
    /// Returns about how many points a part is to have: all, if they are not many more. Numbers of tiles leave room for a limited number of
    /// parts.
    pub(crate) fn points_per_part(&self) -> u64 {
        let (wanted, cut) = (self.options.triangulation.max_points_per_part, self.cut());
        match cut.decoded_records() <= wanted.most_in_one_part() {
            true => u64::MAX,
            false => wanted.0.max(cut.records.div_ceil(PartIndex::MOST as u64 / 2)),
        }
    }

    /// Returns how the plane is cut.
    pub(crate) fn cut(&self) -> Cow<'_, PlanCut> {
        if let Some(cut) = &self.cut {
            return Cow::Borrowed(cut);
        }
        let input = |input: &PlannedInput| CutInput { claimed: input.claimed, records: input.decoded_records() };
        let inputs = self.inputs.iter().map(input).collect();
        Cow::Owned(PlanCut { extent: self.extent, records: self.records, inputs })
    }

    /// Returns the number of records, and the area that they share, which decide what is far apart.
    pub(crate) fn density(&self) -> (u64, u64) {
        (self.records, self.claimed_area)
    }

    /// Returns the number of records that are decoded.
    pub(crate) fn decoded_records(&self) -> u64 {
        self.inputs.iter().map(PlannedInput::decoded_records).sum()
    }

    /// Tells whether the mesh stays on the disk until the job is done, so that it can go on with another style.
    pub(crate) fn keeps_mesh(&self) -> bool {
        self.options.limits.keep_steps.keeps(self.decoded_records())
    }

    /// Returns what the user should know if parts, which have so many points, have grown since the first run of a job that is updated.
    pub(crate) fn grown_parts_warning(&self, points: &[u64]) -> Option<String> {
        let most = self.points_per_part().saturating_mul(2);
        let grown = points.iter().filter(|points| **points > most).count();
        (self.cut.is_some() && grown > 0).then(|| {
            format!(
                "{} more than twice the {} points that a part is to have, so updates of them take longer; fix: run once with --restart, \
                 which cuts all parts anew",
                if grown == 1 { "1 part has".into() } else { format!("{grown} parts have") },
                grouped(self.points_per_part())
            )
        })
    }

    /// Returns the breaklines; `None` without any.
    ///
    /// # Errors
    /// Those of [`PlannedBreaklines::built`].
    pub fn built_breaklines(&self) -> Result<Option<Arc<Breaklines>>> {
        self.breaklines.as_ref().map(PlannedBreaklines::built).transpose()
    }

    /// Returns the box of all that the mesh has, of which the kept points have `points`.
    pub fn with_lines(&self, points: Bounds<3>) -> Bounds<3> {
        let lines = self.breaklines.as_ref().and_then(|lines| lines.bounds);
        lines.map_or(points, |lines| lines.union(points))
    }

    /// Returns the rectangle in source units that `bounds` and the box of `clip` share: [xmin, ymin, xmax, ymax]. Outside of it no point is
    /// wanted.
    pub(crate) fn rectangle(&self) -> Option<[f64; 4]> {
        let clip_box = self.clip.as_ref().map(|clip| clip.reach);
        InputOptions { clip_box, ..self.options.input.clone() }.rectangle()
    }

    /// Returns what the user should know about the options and the inputs.
    pub fn all_warnings(&self) -> Warnings {
        let mut warnings = self.options.warnings.clone();
        warnings.extend(self.warnings.clone());
        let sources = self.inputs.iter().map(|input| &input.source);
        warnings.extend(missing_attributes(sources, self.options.output.attributes));
        warnings
    }

    /// Calls the inputs what they are called by now.
    pub(crate) fn rename_inputs(&mut self, renamed: &RenamedInputs) {
        self.inputs.iter_mut().for_each(|input| renamed.rename(&mut input.source.path));
        self.skipped.iter_mut().for_each(|skipped| skipped.rename(renamed));
        self.breaklines.iter_mut().flat_map(|lines| &mut lines.files).for_each(|file| renamed.rename(file));
        self.clip.iter_mut().for_each(|clip| renamed.rename(&mut clip.file));
        self.warnings.iter_mut().for_each(|warning| renamed.rename_in(warning));
    }

    /// Writes the plan as the pending file at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] if writing fails.
    pub fn write(&self, path: &Path) -> Result<PendingFile> {
        let text = serde_json::to_vec(self).map_err(|e| Error::Broken(format!("{}: {e}", path.display())))?;
        write_pending(path, &text)
    }

    /// Reads the plan in the file at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Broken`] if it holds no plan.
    pub fn read(path: &Path) -> Result<Plan> {
        let text = std::fs::read(path).map_err(Error::io("read", path))?;
        let parsed = std::str::from_utf8(&text).map_err(|e| e.to_string());
        let parsed = parsed.and_then(|text| Plan::parse(text).map_err(|e| e.to_string()));
        parsed.map_err(|e| Error::Broken(format!("{}: {e}", path.display())))
    }

    /// Reads the text of a plan.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub(crate) fn parse(text: &str) -> serde_json::Result<Plan> {
        serde_json::from_str(text).map(Plan::with_area_in_rules)
    }

    /// Gives the rules of all inputs the area that points are kept in, which is written once for all of them.
    fn with_area_in_rules(mut self) -> Plan {
        let area = self.clip.as_ref().map(PlannedClip::area);
        self.inputs.iter_mut().for_each(|input| input.rules.clip = area.clone());
        self
    }
}
