//! The breaklines of a plan.

use crate::options::JobOptions;
use crate::plan::breaklines::line_files::LineFiles;
use crate::plan::breaklines::on_lattice::on_lattice;
use crate::plan::breaklines::sentences::sentences;
use crate::plan::breaklines::spacing::spacing;
use crate::plan::breaklines::suspect_heights::suspect_heights;
use crate::plan::breaklines::terrain::SampledTerrain;
use crate::plan::extent::Extent;
use breaklines::{
    BreaklineError, BreaklineOptions, BreaklineSite, Breaklines, Feature, FeatureId, Findings, NearestHeights,
    NearestPoint,
};
use delaunay::geometry::{Bounds, Site};
use lattice::Lattice;
use points::lines::LineFile;
use points::{PointRules, Source};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use sys::{Error, Result, Warnings, interrupt};

/// About how many bytes a site of a line takes, with its subsegments, its piece of the index, and what cutting holds meanwhile.
const BYTES_PER_SITE: u64 = 400;

/// Lines may take this share of the memory limit.
const SHARE_OF_MEMORY: u64 = 4;

/// The breaklines of a plan: the features that they are cut from, and what cutting them has shown. They are cut again, to the same
/// sites, where a process needs them.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PlannedBreaklines {
    /// The files of lines; a feature's id has the number of its file here.
    #[serde(serialize_with = "sys::path_text::all_shown")]
    pub files: Vec<PathBuf>,
    /// What the report says.
    pub findings: Findings,
    /// Features that lie outside the box of the points. No other figure counts them.
    pub features_outside: u64,
    /// The box of all sites; `None` without a site.
    pub bounds: Option<Bounds<3>>,
    cut_from: CutFrom,
    #[serde(skip)]
    built: OnceLock<Arc<Breaklines>>,
}

/// What breaklines are cut from. The same gives the same sites.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct CutFrom {
    features: Vec<Feature>,
    options: BreaklineOptions,
    /// The points that gave heights to the sites of lines that have none.
    nearest: Vec<Option<NearestPoint>>,
}

/// The inputs of a job, as far as breaklines depend on them.
pub(crate) struct CloudOfPlan<'a> {
    pub(crate) sources: &'a [Source],
    pub(crate) rules: &'a [PointRules],
    pub(crate) lattice: &'a Lattice,
    pub(crate) extent: &'a Extent,
    /// The box of the points on the lattice, within `[input] bounds`.
    pub(crate) clipped: Bounds<2>,
    /// The area of the box around all records in square lattice steps.
    pub(crate) area: u64,
    /// A sample of the points that the job keeps: where each is, and its height.
    pub(crate) sample: &'a [(Site, i32)],
    /// The lengths of a unit of x and y and of one of heights in metres.
    pub(crate) metres: [f64; 2],
}

impl PlannedBreaklines {
    /// Cuts the lines of `files`; `None` if the job has none.
    ///
    /// # Errors
    /// [`Error::Input`] if a feature cannot be a breakline, [`Error::Config`] if there are too many, and those of reading points where
    /// lines take their heights from them.
    pub(crate) fn of(
        files: &LineFiles,
        options: &JobOptions,
        cloud: &CloudOfPlan,
        warnings: &mut Warnings,
    ) -> Result<Option<PlannedBreaklines>> {
        if files.is_empty() {
            return Ok(None);
        }
        let records = cloud.sources.iter().map(|source| source.records).sum();
        let spacing = spacing(&options.breaklines, cloud.lattice, cloud.extent, cloud.area, records)?;
        let (features, features_outside) = on_lattice(&files.files, cloud.lattice, cloud.clipped)?;
        let most = options.limits.memory.0 / SHARE_OF_MEMORY / BYTES_PER_SITE;
        let options = BreaklineOptions {
            most_sites: usize::try_from(most).unwrap_or(usize::MAX),
            ..BreaklineOptions::new(spacing, Some(cloud.clipped))
        };
        let built = Breaklines::build(&features, &options);
        let (mut built, findings) = built.map_err(|error| refuse(error, &files.files, cloud.lattice))?;
        let nearest = nearest_heights(&built, cloud)?;
        nearest.settle(&mut built);
        refuse_sites_without_height(&built, &files.files, cloud.lattice)?;
        let terrain = SampledTerrain::new(cloud.sample, cloud.metres, cloud.lattice, cloud.clipped);
        warnings.extend(suspect_heights(&files.files, &features, &terrain)?);
        warnings.extend(sentences(&files.files, cloud.lattice, &options, &findings, features_outside));
        Ok(Some(PlannedBreaklines {
            files: files.files.iter().map(|file| file.path.clone()).collect(),
            findings,
            features_outside,
            bounds: Bounds::of_points(built.sites().iter().map(corner)),
            cut_from: CutFrom { features, options, nearest: nearest.found().to_vec() },
            built: OnceLock::from(Arc::new(built)),
        }))
    }

    /// Returns the breaklines.
    ///
    /// # Errors
    /// [`Error::Broken`] if they cannot be cut, though they could when the plan was made.
    pub fn built(&self) -> Result<Arc<Breaklines>> {
        if let Some(built) = self.built.get() {
            return Ok(built.clone());
        }
        let CutFrom { features, options, nearest: found } = &self.cut_from;
        let built = Breaklines::build(features, options);
        let (mut built, _) = built.map_err(|error| match error {
            BreaklineError::Interrupted => Error::Interrupted,
            error => Error::Broken(format!("the breaklines of the plan: {error}")),
        })?;
        let mut nearest = NearestHeights::new(&built);
        nearest.join(found);
        nearest.settle(&mut built);
        Ok(self.built.get_or_init(|| Arc::new(built)).clone())
    }
}

/// Returns the lattice integers of a site.
pub(super) fn corner(site: &BreaklineSite) -> [i32; 3] {
    [site.place[0], site.place[1], site.z.unwrap_or_default()]
}

/// Looks at all points for the heights of lines without heights. Only such lines make the plan read the inputs once more.
fn nearest_heights(built: &Breaklines, cloud: &CloudOfPlan) -> Result<NearestHeights> {
    let none = NearestHeights::new(built);
    if none.is_empty() {
        return Ok(none);
    }
    let inputs = cloud.sources.iter().zip(cloud.rules);
    let read_ahead = |(source, rules): (&Source, &PointRules)| source.read_ahead(rules.bounds.as_ref(), false);
    let _ahead = inputs.clone().map(read_ahead).collect::<Result<Vec<_>>>()?;
    let chunks: Vec<_> =
        inputs.flat_map(|(source, rules)| (0..source.chunks()).map(move |chunk| (source, rules, chunk))).collect();
    let look = |mut nearest: NearestHeights, &(source, rules, chunk): &(&Source, &PointRules, usize)| {
        interrupt::check()?;
        source.decode(chunk, rules, &mut |points| {
            points.iter().for_each(|point| nearest.offer(point.position, point.z));
            Ok(())
        })?;
        Ok(nearest)
    };
    let join = |mut a: NearestHeights, b: NearestHeights| {
        a.join(b.found());
        Ok(a)
    };
    // A collection for each thread and no more: they may be large.
    let share = chunks.len().div_ceil(rayon::current_num_threads()).max(1);
    let of_share = |chunks: &[_]| chunks.iter().try_fold(none.clone(), look);
    chunks.par_chunks(share).map(of_share).try_reduce(|| none.clone(), join)
}

/// Returns the error about features that cannot be breaklines.
fn refuse(error: BreaklineError, files: &[LineFile], lattice: &Lattice) -> Error {
    let at = |place| place_text(lattice, place);
    match error {
        BreaklineError::Interrupted => Error::Interrupted,
        BreaklineError::Wall { id, place, heights: [low, high] } => about(
            files,
            id,
            format!(
                "is a wall: it has the heights {} and {} at {}, and a terrain has one height at a place; move one of its vertices, or \
                 leave the feature out",
                lattice.world(2, low),
                lattice.world(2, high),
                at(place)
            ),
        ),
        BreaklineError::OutOfReach { id, place } => {
            about(files, id, format!("has a vertex at {}, which no lattice reaches", at(place)))
        }
        BreaklineError::TooMany { most } => Error::Config(format!(
            "the breaklines need more than {most} vertices, which do not fit the memory: set a greater spacing in [[breaklines]], raise \
             [limits] memory, or cut out the lines of the area"
        )),
    }
}

/// Checks that every site has a height.
fn refuse_sites_without_height(built: &Breaklines, files: &[LineFile], lattice: &Lattice) -> Result<()> {
    match built.sites().iter().find(|site| site.z.is_none()) {
        None => Ok(()),
        Some(BreaklineSite { place, id, .. }) => Err(about(
            files,
            *id,
            format!(
                "has no heights, and no point of the cloud is near it, for example at {}: give it heights, or leave it out",
                place_text(lattice, *place)
            ),
        )),
    }
}

/// Returns an error about a feature.
fn about(files: &[LineFile], id: FeatureId, what: String) -> Error {
    match files.get(id.file as usize) {
        Some(file) => Error::input(&file.path, format!("feature {} {what}", id.feature)),
        None => Error::Broken(format!("there is no file of lines {}", id.file)),
    }
}

fn place_text(lattice: &Lattice, place: Site) -> String {
    format!("({}, {})", lattice.world(0, place[0]), lattice.world(1, place[1]))
}
