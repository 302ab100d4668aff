//! Proves that the vertices are the points of the inputs, heights included: the inputs are read again, and every place with a
//! vertex or with a point that the job wanted must have both, at the height that the rule for duplicates gives.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use bytemuck::{Pod, Zeroable, bytes_of};
use rayon::prelude::*;
use xxhash_rust::xxh3::xxh3_64;

use crate::breaklines::BreaklineEdges;
use crate::clip::ClipArea;
use crate::keyed_records::{KeyedRecord, KeyedRecords};
use crate::report::ReportedFacts;
use crate::surface::{Bound, Surface, SurfaceProof};
use crate::watcher::Watcher;
use delaunay::geometry::Site;
use ground::{BYTES_PER_CELL, CoveredArea, Ground, LowestHeights, MetricLattice, PointCollector};
use lattice::{AxisMap, Lattice, shortest_decimal};
use points::options::{Duplicates, InputOptions};
use points::samples::{FileSamples, fingerprint_of};
use points::transform_sources::transform_sources;
use points::{
    KeptReturns, NodataChoice, OptionalFields, Point, PointRules, RowChoice, Source, TextOptions, TextReading,
    open_chosen,
};
use rust_decimal::prelude::ToPrimitive;
use sys::{Error, Result, Warnings, interrupt};
use terrain::SourceGrid;
use tiles::frame::Extras;

/// The number of the source of a vertex. Inputs have the numbers above it.
const VERTEX: u32 = 0;

/// The number of the source of an end of an edge along a breakline: above those of all inputs.
const LINE: u32 = u32::MAX;

/// Decodes the points of a chunk into a sink.
type DecodeChunk<'a> = dyn Fn(&mut dyn FnMut(&[Point]) -> Result<()>) -> Result<()> + 'a;

/// A vertex of the mesh, or a point of an input.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
struct Place {
    site: Site,
    source: u32,
    height: i32,
    /// The number of the point's record among those of all inputs.
    order: u64,
}

impl KeyedRecord for Place {
    fn key_hash(&self) -> u64 {
        xxh3_64(bytes_of(&self.site))
    }
}

/// The vertices of the mesh and the points of the inputs, to be compared.
pub(super) struct Places(Mutex<KeyedRecords<Place>>);

impl Places {
    /// Returns an empty collection that takes up to `memory` bytes and then writes to temporary files in `directory`.
    pub(super) fn new(directory: &Path, memory: u64) -> Places {
        Places(Mutex::new(KeyedRecords::new(directory.to_path_buf(), memory)))
    }

    /// Adds vertices by their lattice integers.
    pub(super) fn add_vertices(&self, vertices: &[[i32; 3]]) -> Result<()> {
        let place = |&[x, y, height]: &[i32; 3]| Place { site: [x, y], source: VERTEX, height, order: 0 };
        self.add(vertices.iter().map(place).collect())
    }

    fn add_lines(&self, lines: &BreaklineEdges) -> Result<()> {
        let place = |[x, y, height]: [i32; 3]| Place { site: [x, y], source: LINE, height, order: 0 };
        self.add(lines.sites().map(place).collect())
    }

    fn add_points(&self, source: u32, points: &[Point]) -> Result<()> {
        let place = |point: &Point| Place { site: point.position, source, height: point.z, order: point.order() };
        self.add(points.iter().map(place).collect())
    }

    fn add(&self, places: Vec<Place>) -> Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend(&places)
    }
}

/// What comparing the vertices with the inputs has shown.
#[derive(Debug, Default)]
pub(super) struct InputProof {
    /// The points of the inputs that the job wanted, duplicates included.
    pub(super) points: u64,
    /// The greatest vertical distance of a point from the mesh, in source units, if not all are vertices.
    pub(super) greatest_error: Option<f64>,
    pub(super) failures: Vec<String>,
    pub(super) unproved: Option<String>,
}

/// The inputs of a job, and what it wanted of them.
pub(super) struct Inputs<'a> {
    facts: &'a ReportedFacts,
    lattice: Lattice,
    metric: MetricLattice,
    sources: Vec<Source>,
    files: &'a [PathBuf],
    /// The area that the job kept points in; `None` for everywhere.
    clip: Option<ClipArea>,
    /// The bytes of memory that the proof may take.
    memory: u64,
    watcher: &'a dyn Watcher,
}

impl<'a> Inputs<'a> {
    /// Opens the files of a job whose tiles have these `extras`.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] if one cannot be read.
    pub(super) fn open(
        files: &'a [PathBuf],
        facts: &'a ReportedFacts,
        extras: &Extras,
        memory: u64,
        watcher: &'a dyn Watcher,
    ) -> Result<Inputs<'a>> {
        let reading = facts.texts.unwrap_or(TextReading { colors: true, ..TextReading::default() });
        let (text, choice) = match &facts.input {
            Some(input) => (input.csv.clone(), input.row_choice(reading.fields())),
            None => (TextOptions::default(), RowChoice { fields: reading.fields(), ..RowChoice::all() }),
        };
        // Earlier versions left no heights out that stand for nodata.
        let counts_nodata = facts.points.is_some_and(|points| points.nodata.is_some());
        let nodata = if counts_nodata { choice.nodata.clone() } else { NodataChoice::None };
        // The proof trusts no index of a file.
        let choice = RowChoice { use_index: false, nodata, ..choice };
        // As the job opened it: what it did not want has no say about the digits of a text.
        let open_again = |file: &PathBuf| open_chosen(file, &text, &choice);
        let is_skipped = |file: &Path| {
            let place = |path: &Path| path.canonicalize().ok();
            // Files of other machines have no place here.
            let same =
                |skipped: &Path| skipped == file || place(skipped).is_some_and(|known| place(file) == Some(known));
            facts.skipped.iter().any(|skipped| same(&skipped.file))
        };
        let used = files.iter().filter(|file| !is_skipped(file));
        let mut sources = used.map(open_again).collect::<Result<Vec<Source>>>()?;
        if let Some(input) = &facts.input {
            transform_sources(&mut sources, input, &mut Warnings::default())?;
        }
        sources.iter_mut().try_for_each(|source| source.leave_out_known(&facts.plausible_points))?;
        // As the job did it: after the transform, which says how far degrees reach.
        for source in sources.iter_mut().filter(|_| reading.outliers_left_out) {
            source.leave_out_outliers(&choice)?;
            if source.has_frequent_outliers() && !reading.even_among_few {
                source.keep_outliers();
            }
        }
        let lattice = lattice_of(facts, extras)?;
        let metric = MetricLattice {
            horizontal: extras.resolution * extras.metres_per_unit,
            vertical: extras.resolution_z * extras.metres_per_unit_z,
            offset: lattice.steps_from_zero(),
        };
        let clip = clip_area(facts, &lattice)?;
        Ok(Inputs { facts, lattice, metric, sources, files, clip, memory, watcher })
    }

    /// Compares the vertices in `places` with the points of the inputs, and with the ends of the edges along breaklines. Points that are no
    /// vertices are compared with the `surface`, if there is one.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] if an input cannot be read, [`Error::Io`] on temporary files.
    pub(super) fn compare(
        &self,
        places: Places,
        surface: Option<Surface>,
        lines: Option<&BreaklineEdges>,
        grid: &SourceGrid,
    ) -> Result<InputProof> {
        lines.map_or(Ok(()), |lines| places.add_lines(lines))?;
        // Points that lines have dropped had no say in what the ground is.
        let is_ground_unknown = self.wants_ground() && lines.is_some();
        let surface = surface.filter(|_| !is_ground_unknown);
        let ground = (self.wants_ground() && !is_ground_unknown).then(|| self.find_ground()).transpose()?;
        self.begin("read inputs");
        self.each_chunk(&|number, decode| {
            decode(&mut |points| match &ground {
                None => places.add_points(number, points),
                Some(ground) => {
                    let on_ground: Vec<Point> =
                        points.iter().filter(|point| ground.has(point.corner())).copied().collect();
                    places.add_points(number, &on_ground)
                }
            })
        })?;
        let duplicates = self.facts.input.as_ref().map(|input| input.duplicates);
        let has_lines = lines.is_some();
        let selects = surface.is_some();
        let mut differences = Differences {
            inputs: self,
            duplicates,
            grid,
            points: 0,
            dropped: 0,
            has_lines,
            places: 0,
            not_selected: selects.then(Vec::new),
            kinds: Default::default(),
        };
        let records = places.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        let mut failure = None;
        records.for_each_bucket(|bucket| {
            bucket.par_sort_unstable();
            bucket.chunk_by(|a, b| a.site == b.site).for_each(|group| differences.add(group));
            if let (Some(surface), Some(points)) = (&surface, &mut differences.not_selected) {
                failure = failure.take().or(surface.add_points(points).err());
                points.clear();
            }
        })?;
        failure.map_or(Ok(()), Err)?;
        let on_surface = surface.map(|surface| self.check_surface(surface, lines)).transpose()?;
        let mut proof = self.proof(differences, on_surface, is_ground_unknown)?;
        if is_ground_unknown {
            let unknown = "which points lie on the ground is not proved for a job with breaklines";
            proof.unproved.get_or_insert_with(|| unknown.to_owned());
        }
        Ok(proof)
    }

    /// Tells whether the job wanted only the ground, and found it itself.
    fn wants_ground(&self) -> bool {
        self.facts.input.as_ref().is_some_and(InputOptions::finds_ground)
    }

    /// Finds the ground anew, as the job did.
    ///
    /// # Errors
    /// [`Error::Memory`] if the memory does not hold it, and those of reading the inputs.
    fn find_ground(&self) -> Result<Ground> {
        self.begin("find area");
        let area = self.collect(CoveredArea::new(self.metric))?;
        require_memory_for_ground(area.cell_count().cells(), self.memory)?;
        self.begin("find ground");
        let lowest = LowestHeights::new(&area);
        drop(area);
        let lowest = self.collect(lowest)?;
        let sizes = self.facts.input.as_ref().map(|input| input.bare_earth).unwrap_or_default();
        Ground::find(lowest, sizes, interrupt::check)
    }

    /// Adds all points that the job wanted to `collector`.
    fn collect<C: PointCollector + Sync>(&self, collector: C) -> Result<C> {
        let all = Mutex::new(collector.emptied());
        self.each_chunk(&|_, decode| {
            let mut found = collector.emptied();
            decode(&mut |points| {
                found.add(points.iter().map(Point::corner));
                Ok(())
            })?;
            all.lock().unwrap_or_else(PoisonError::into_inner).join(&found);
            Ok(())
        })?;
        Ok(all.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// Tells that all points of the inputs are read for a step.
    fn begin(&self, step: &'static str) {
        self.watcher.begin(step, self.sources.iter().map(|source| source.records).sum(), "points");
    }

    /// Calls `take` for each chunk of the inputs, with the number of the input and with what decodes the points that the job wanted, on all threads.
    fn each_chunk(&self, take: &(dyn Fn(u32, &DecodeChunk) -> Result<()> + Sync)) -> Result<()> {
        let mut first_order = 0;
        for (number, source) in (VERTEX + 1..).zip(&self.sources) {
            let rules = self.rules(source, first_order)?;
            let _ahead = source.read_ahead(rules.bounds.as_ref(), false)?;
            (0..source.chunks()).into_par_iter().try_for_each(|chunk| {
                interrupt::check()?;
                take(number, &|sink| {
                    let within = &mut |points: &[Point]| match &self.clip {
                        None => sink(points),
                        Some(clip) => {
                            let is_inside = |point: &&Point| clip.holds(point.position);
                            sink(&points.iter().filter(is_inside).copied().collect::<Vec<_>>())
                        }
                    };
                    self.watcher.advance(source.decode(chunk, &rules, within)?.read);
                    Ok(())
                })
            })?;
            first_order += source.records;
        }
        Ok(())
    }

    /// Compares the points that are no vertices with the mesh. Without a bound, nothing is known.
    fn check_surface(&self, surface: Surface, lines: Option<&BreaklineEdges>) -> Result<Option<SurfaceProof>> {
        let bound = self.facts.selection.and_then(|selection| shortest_decimal(selection.max_error));
        let bound = bound.and_then(|bound| Bound::new(bound, self.lattice.resolution_z));
        let zones = lines.map(BreaklineEdges::zones);
        bound.map(|bound| surface.check(bound, zones.as_ref())).transpose()
    }

    fn rules(&self, source: &Source, first_order: u64) -> Result<PointRules> {
        let lattice = &self.lattice;
        let map = |axis: usize| {
            let own = source.axes[axis];
            AxisMap::new(own.offset, own.scale, lattice.offset[axis], lattice.step(axis)).ok_or_else(|| {
                Error::input(&source.path, "its scale and offset have too many digits to meet the lattice of the tiles")
            })
        };
        let input = self.facts.input.as_ref();
        Ok(PointRules {
            maps: [map(0)?, map(1)?, map(2)?],
            classes: input.map_or([true; 256], |input| input.kept_classes()),
            returns: input.map_or(KeptReturns::All, |input| input.kept_returns()),
            bounds: input.and_then(|input| input.bounds).and_then(|bounds| source.raw_bounds(bounds.0)),
            // The proof decides in its own way which points lie within polygons.
            clip: None,
            first_order,
            numbered: true,
            fields: OptionalFields::default(),
        })
    }

    fn proof(
        &self,
        differences: Differences,
        on_surface: Option<Option<SurfaceProof>>,
        is_ground_unknown: bool,
    ) -> Result<InputProof> {
        let (points, mut failures) = (differences.points, differences.sentences());
        let dropped = self.facts.points.map_or(0, |points| points.at_breaklines);
        let step = self.lattice.resolution_z.to_f64().unwrap_or(f64::NAN);
        let greatest_error = on_surface.flatten().map(|proof| proof.greatest * step);
        let has_no_bound = on_surface.is_some_and(|proof| proof.is_none());
        let selected_from = self.facts.selection.map(|selection| selection.points).filter(|_| on_surface.is_some());
        if let Some(reported) =
            selected_from.filter(|&reported| !differences.has_lines && reported != differences.places)
        {
            failures.push(format!(
                "the inputs have points at {} places, but report.json has {reported} points that vertices were selected from",
                differences.places
            ));
        }
        if let Some(proof) = on_surface.flatten() {
            failures.extend(differences.beyond(&proof, dropped));
        } else if on_surface.is_none()
            && !is_ground_unknown
            && differences.dropped != dropped
            && self.facts.input.is_some()
        {
            failures.push(format!(
                "{} points of the inputs are not vertices, but by report.json {dropped} were dropped at breaklines",
                differences.dropped
            ));
        }
        if !failures.is_empty() {
            let samples = self.files.iter().map(|file| FileSamples::of(file)).collect::<Result<_>>()?;
            let fingerprint = fingerprint_of(samples);
            if let Some(reported) = self.facts.inputs_fingerprint.as_ref().filter(|reported| **reported != fingerprint)
            {
                failures.push(format!(
                    "the files of --input are not those that the job has read: their fingerprint is {fingerprint}, report.json says \
                     {reported}"
                ));
            }
        }
        let unproved = self.facts.input.is_none().then(|| {
            "points may be missing: there is no report.json to show which points of the inputs the job selected"
                .to_owned()
        });
        let no_bound = || "the max_error in report.json is no bound on this lattice".to_owned();
        let unproved = unproved.or_else(|| has_no_bound.then(no_bound));
        Ok(InputProof { points, greatest_error, failures, unproved })
    }
}

/// Returns the lattice of the tiles, with all its digits if the report says them.
///
/// # Errors
/// [`Error::Config`] if no lattice has the numbers of the tiles.
pub(super) fn lattice_of(facts: &ReportedFacts, extras: &Extras) -> Result<Lattice> {
    if let Some(lattice) = facts.lattice.as_ref().filter(|_| facts.lattice_failure(extras).is_none()) {
        return Ok(lattice.clone());
    }
    let decimal = |value: f64| {
        shortest_decimal(value)
            .ok_or_else(|| Error::Config(format!("no lattice can have the number {value} of the tiles")))
    };
    let [x, y, z] = extras.offset.map(decimal);
    Ok(Lattice {
        offset: [x?, y?, z?],
        resolution: decimal(extras.resolution)?,
        resolution_z: decimal(extras.resolution_z)?,
    })
}

/// Returns the area that the job kept points in; `None` for everywhere.
fn clip_area(facts: &ReportedFacts, lattice: &Lattice) -> Result<Option<ClipArea>> {
    let Some(clip) = &facts.clip else { return Ok(None) };
    let (places, parts) = lattice.for_places();
    match places.polygons_of_text(&clip.area) {
        Some(polygons) => Ok(Some(ClipArea::new(&polygons, parts))),
        None => {
            Err(Error::Config("report.json: the area of clip is no MULTIPOLYGON on the lattice of the tiles".into()))
        }
    }
}

/// In what the vertices and the points of the inputs differ.
struct Differences<'a> {
    inputs: &'a Inputs<'a>,
    /// Which of several points at one place stays; `None` if nobody knows.
    duplicates: Option<Duplicates>,
    grid: &'a SourceGrid,
    points: u64,
    /// The points that are no vertices, of a job with breaklines: these may have dropped them.
    dropped: u64,
    has_lines: bool,
    /// The places with a vertex or a point.
    places: u64,
    /// The points of the present bucket that are no vertices, of a job that selects vertices.
    not_selected: Option<Vec<[i32; 3]>>,
    kinds: [Difference; 3],
}

/// One kind of difference: how often it is found, and the first place of all.
#[derive(Default)]
struct Difference {
    count: u64,
    first: Option<[Place; 2]>,
}

/// The kinds, by their numbers in [`Differences`].
const NO_POINT: usize = 0;
const NO_VERTEX: usize = 1;
const OTHER_HEIGHT: usize = 2;

impl Differences<'_> {
    /// Adds all vertices and points of one place. Vertices come first.
    fn add(&mut self, group: &[Place]) {
        let (vertices, points) = group.split_at(group.partition_point(|place| place.source == VERTEX));
        let (points, lines) = points.split_at(points.partition_point(|place| place.source != LINE));
        self.points += points.len() as u64;
        self.places += 1;
        if !lines.is_empty() {
            // A vertex of a line takes the place of points. Its height has been compared with the list.
            self.dropped += points.len() as u64;
            return;
        }
        match (vertices.first(), self.point_that_stays(points)) {
            (Some(&vertex), None) => self.note(NO_POINT, [vertex, vertex]),
            (None, Some(point)) if self.not_selected.is_some() => {
                let [x, y] = point.site;
                self.not_selected.iter_mut().for_each(|points| points.push([x, y, point.height]));
            }
            (None, Some(_)) if self.has_lines => self.dropped += points.len() as u64,
            // Without a rule the job may not have wanted this point.
            (None, Some(point)) if self.duplicates.is_some() => self.note(NO_VERTEX, [point, point]),
            (Some(_), Some(point)) => {
                let fits = |vertex: &Place| match self.duplicates {
                    Some(_) => vertex.height == point.height,
                    None => points.iter().any(|point| point.height == vertex.height),
                };
                if let Some(&vertex) = vertices.iter().find(|vertex| !fits(vertex)) {
                    self.note(OTHER_HEIGHT, [vertex, point]);
                }
            }
            (None, _) => {}
        }
    }

    fn point_that_stays(&self, points: &[Place]) -> Option<Place> {
        let points = points.iter().copied();
        match self.duplicates {
            Some(Duplicates::Lowest) => points.min_by_key(|point| (point.height, point.order)),
            Some(Duplicates::Highest) => points.max_by_key(|point| (point.height, point.order)),
            Some(Duplicates::First) | None => points.min_by_key(|point| point.order),
        }
    }

    fn note(&mut self, kind: usize, places: [Place; 2]) {
        let Difference { count, first } = &mut self.kinds[kind];
        *count += 1;
        if first.is_none_or(|first| places < first) {
            *first = Some(places);
        }
    }

    /// Returns a sentence for each kind that was found.
    fn sentences(&self) -> Vec<String> {
        let sentence = |(kind, difference): (usize, &Difference)| {
            let (count, [a, b]) = (difference.count, difference.first?);
            Some(match kind {
                NO_POINT => format!("{count} vertices are not points of the inputs, the first at {}", self.text(a)),
                NO_VERTEX => {
                    format!("{count} points of the inputs are not vertices, the first is {}", self.record_text(b))
                }
                _ => format!(
                    "{count} vertices have another height than the points of the inputs, the first at {}: it should be that of {}{}",
                    self.text(a),
                    self.record_text(b),
                    self.hint()
                ),
            })
        };
        self.kinds.iter().enumerate().filter_map(sentence).collect()
    }

    /// Returns a sentence for points that are too far from the mesh, and were not among those `dropped` at breaklines.
    fn beyond(&self, proof: &SurfaceProof, dropped: u64) -> Option<String> {
        let SurfaceProof { beyond, first_beyond, uncovered, first_uncovered, excused, .. } = *proof;
        let text = |[x, y, z]: [i32; 3]| {
            let [x, y, z] = self.grid.coordinates([x, y, z]);
            format!("({x}, {y}, {z})")
        };
        let max_error = self.inputs.facts.selection.map_or(f64::NAN, |selection| selection.max_error);
        let outside = || {
            let first = first_uncovered.map(text)?;
            Some(format!("points of the inputs outside the mesh: {uncovered}, the first at {first}"))
        };
        let too_far = first_beyond.map(|first| {
            format!(
                "points of the inputs that are more than max_error = {max_error} from the mesh: {beyond}, the first at {}",
                text(first)
            )
        });
        let too_many = (excused > dropped).then(|| {
            format!("{excused} points beyond max_error lie at breaklines, where {dropped} points were dropped by report.json")
        });
        let sentences: Vec<String> = too_far.into_iter().chain(outside()).chain(too_many).collect();
        (!sentences.is_empty()).then(|| sentences.join("; "))
    }

    fn hint(&self) -> &'static str {
        match self.duplicates {
            Some(Duplicates::First) => " (with duplicates = \"first\", name the files in the order of the job)",
            _ => "",
        }
    }

    fn text(&self, place: Place) -> String {
        let [x, y, z] = self.grid.coordinates([place.site[0], place.site[1], place.height]);
        format!("({x}, {y}, {z})")
    }

    /// Returns a point and where it comes from.
    fn record_text(&self, point: Place) -> String {
        let sources = &self.inputs.sources;
        let index = point.source as usize - 1;
        let before: u64 = sources[..index].iter().map(|source| source.records).sum();
        format!("{}, record {} of {}", self.text(point), point.order - before + 1, sources[index].path.display())
    }
}

/// Checks that three quarters of `memory` bytes hold the ground in so many cells: the rest is for what else the proof has in memory.
fn require_memory_for_ground(cells: u64, memory: u64) -> Result<()> {
    let needed = cells.saturating_mul(BYTES_PER_CELL);
    if needed <= memory / 4 * 3 {
        return Ok(());
    }
    let wanted = (needed.div_ceil(3).saturating_mul(4) >> 20) + 1;
    Err(Error::Memory(format!(
        "finding the ground of the inputs takes more memory than there is: set --memory \"{wanted} MiB\""
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_that_a_message_names_has_room_for_the_ground() {
        for cells in [1, 4096, 4_000_000, 123_456_789] {
            let why = require_memory_for_ground(cells, 10).unwrap_err().to_string();
            let (_, after) = why.split_once("--memory \"").unwrap();
            let wanted: u64 = after.split_once(" MiB").unwrap().0.parse().unwrap();
            require_memory_for_ground(cells, wanted << 20).unwrap();
        }
    }
}
