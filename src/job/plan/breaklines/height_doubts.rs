//! Heights of lines that the terrain around makes doubtful: in another unit, counted from another zero, or missing and written as 0.

use crate::breaklines::{Feature, Vertex};
use crate::input::Unit;
use crate::input::lines::LineFile;
use crate::job::plan::breaklines::terrain::{Around, SampledTerrain};
use crate::{Result, interrupt};

/// So many vertices of a file are compared with the terrain, to judge the file.
const OF_FILE: usize = 512;

/// So many of the same feature are, to judge them one by one.
const OF_FEATURE: usize = 64;

/// Heights in another unit are so many times nearer to the terrain when they are converted, and were farther from it than so many metres,
/// or fewer where they rise and fall with it.
const TIMES_NEARER: f64 = 4.0;
const LEAST_APART: f64 = 10.0;
const LEAST_RISE: f64 = 1.0;

/// So many metres are more than between lines and the points beside them, and less than between most ellipsoids and the sea.
const OTHER_ZERO: f64 = 20.0;

/// Where all heights of a file are 0, a terrain within so many metres may be the shore of the sea.
const SHORE: f64 = 1.0;

/// A height of 0 is doubtful where the terrain is so many metres above or below it: in a feature with other heights, and in one without.
const FROM_ZERO: [f64; 2] = [3.0, 10.0];

/// A vertex is doubtful if it lies so many metres beyond its neighbours on the line and beyond the terrain.
const SPIKE: f64 = 10.0;

/// Any vertex is doubtful if it lies so many metres beyond the terrain.
const BEYOND: f64 = 50.0;

/// So many vertices of a feature are looked at for that, evenly.
const EVENLY: usize = 16;

/// Returns the warnings about heights of the `features`, which come from `files`.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub(super) fn height_doubts(files: &[LineFile], features: &[Feature], terrain: &SampledTerrain) -> Result<Vec<String>> {
    let judge = Judge { terrain };
    let mut found = Vec::new();
    // Features come in the order of their files.
    for features in features.chunk_by(|one, other| one.id.file == other.id.file) {
        interrupt::check()?;
        let doubt = judge.of_file(features).or_else(|| judge.of_vertices(features));
        let file = features.first().and_then(|feature| files.get(feature.id.file as usize));
        found.extend(file.zip(doubt).map(|(file, doubt)| format!("{}: {doubt}", file.path.display())));
    }
    Ok(found)
}

struct Judge<'a> {
    terrain: &'a SampledTerrain<'a>,
}

/// Heights of lines that seem to be in feet while those of the points are in metres, or the reverse.
struct OtherUnit {
    lines_in_feet: bool,
    /// What the heights of the points are taken to be in.
    points_in: Unit,
}

impl OtherUnit {
    /// Returns the sentence about it. `numbers` are those of the lines and of the points.
    fn sentence(&self, numbers: &str) -> String {
        let (seem, others) = if self.lines_in_feet { ("feet", "metres") } else { ("metres", "feet") };
        let start = format!("its heights seem to be in {seem}, and those of the points in {others}: {numbers}");
        match (self.lines_in_feet, self.points_in) {
            (true, Unit::Metre) => format!("{start}; set height_unit = \"foot\" in [[breaklines]] to convert them"),
            (false, Unit::Foot | Unit::UsFoot) => {
                format!("{start}; set height_unit = \"metre\" in [[breaklines]] to convert them")
            }
            _ => format!(
                "{start}, but the points are taken to be in {}: say with [input] unit or crs what the points are in, and with height_unit in \
                 [[breaklines]] what the lines are in",
                self.points_in.name()
            ),
        }
    }
}

/// A height, and what is around it.
type Pair = (f64, Around);

impl Judge<'_> {
    /// Returns a sentence if all heights of a file seem to be in another unit or to have another zero.
    fn of_file(&self, features: &[Feature]) -> Option<String> {
        let all = || features.iter().flat_map(|feature| feature.paths.iter().flatten());
        let every = all().count().div_ceil(OF_FILE).max(1);
        let sampled = || all().step_by(every);
        let pairs: Vec<Pair> = sampled().filter_map(|vertex| self.pair(vertex)).collect();
        let [line, points] = [median(pairs.iter().map(|(z, _)| *z))?, median(pairs.iter().map(|(_, a)| a.middle))?];
        let numbers =
            format!("in the middle {}, where that of the points around is {}", rounded(line), rounded(points));
        if let Some(unit) = self.other_unit(&pairs) {
            return Some(unit.sentence(&numbers));
        }
        let beyond = median(pairs.iter().map(|(z, around)| around.beyond(*z)))?;
        let zeros = sampled().filter(|vertex| self.terrain.is_zero(vertex)).count();
        let count = sampled().filter(|vertex| vertex.z.is_some()).count();
        if zeros == count {
            return (beyond.abs() > self.terrain.in_height_unit(SHORE)).then(|| {
                format!(
                    "all its heights are 0, where the middle one of the points around is {}; if it has none, set heights = \"points\" in \
                     [[breaklines]] to take them from the points around",
                    rounded(points)
                )
            });
        }
        let slack = median(pairs.iter().map(|(_, around)| around.relief() + around.reach))?;
        let is_far = beyond.abs() > self.terrain.in_height_unit(OTHER_ZERO) + slack && zeros < count.div_ceil(2);
        is_far.then(|| {
            let side = if beyond > 0.0 { "above" } else { "below" };
            format!(
                "its heights lie {side} the terrain, {numbers}: they may count from another zero, such as the ellipsoid, or be no heights of \
                 the ground; convert them, or set heights = \"points\" in [[breaklines]] to take them from the points around"
            )
        })
    }

    /// Returns the units in which the heights of a file and those of the points seem to be, if these differ.
    fn other_unit(&self, pairs: &[Pair]) -> Option<OtherUnit> {
        let metres_z = self.terrain.in_height_unit(1.0).recip();
        let foot = if Unit::from_metres(Some(metres_z)) == Unit::UsFoot { Unit::US_FOOT } else { Unit::FOOT };
        let apart = |factor: f64| median(pairs.iter().map(move |(z, around)| (z * factor - around.middle).abs()));
        let shift = median(pairs.iter().map(|(z, around)| z - around.middle))?;
        let shifted = median(pairs.iter().map(|(z, around)| (z - around.middle - shift).abs()))?;
        let as_written = apart(1.0)?;
        let is_more_than = |value: f64, metres: f64| value > self.terrain.in_height_unit(metres);
        let fits = |factor: f64| {
            let converted = apart(factor)?;
            // Heights from another zero fit better when they are shifted.
            let is_shifted = converted > 2.0 * shifted.max(self.terrain.in_height_unit(LEAST_RISE));
            let rises = is_more_than(shifted, LEAST_RISE) && shifted > TIMES_NEARER * converted;
            let is_apart = is_more_than(as_written, LEAST_APART) || rises;
            (as_written > TIMES_NEARER * converted && !is_shifted && is_apart).then_some(())
        };
        let lines_in_feet = fits(foot).map(|()| true).or_else(|| fits(foot.recip()).map(|()| false))?;
        let points_in = Unit::from_metres(Some(metres_z));
        Some(OtherUnit { lines_in_feet, points_in })
    }

    /// Returns a sentence about the vertices that are far from the terrain, by features.
    fn of_vertices(&self, features: &[Feature]) -> Option<String> {
        let mut found = features.iter().filter_map(|feature| Some((feature, self.doubtful_vertex(feature)?)));
        let (feature, (vertex, around)) = found.next()?;
        let others = match found.count() {
            0 => String::new(),
            count => format!(" (and {count} features more have such vertices)"),
        };
        let z = self.terrain.height(vertex)?;
        let (z, what) = match self.terrain.is_zero(vertex) {
            true => (0.0, ": if 0 stands for no height,"),
            false => (z, ":"),
        };
        Some(format!(
            "feature {} has the height {z} at {}, where the points around lie from {} to {}{others}{what} correct it, set height_unit in \
             [[breaklines]] if the heights of the file are in another unit, or heights = \"points\" to take all heights from the points around",
            feature.id.feature,
            self.terrain.place_text(vertex.place),
            rounded(around.lowest),
            rounded(around.highest)
        ))
    }

    /// Returns the first vertex of a feature whose height is no height of the terrain around.
    fn doubtful_vertex<'f>(&self, feature: &'f Feature) -> Option<(&'f Vertex, Around)> {
        let vertices = || feature.paths.iter().flatten();
        let is_all_zero = vertices().all(|vertex| vertex.z.is_none() || self.terrain.is_zero(vertex));
        let from_zero = self.terrain.in_height_unit(FROM_ZERO[usize::from(is_all_zero)]);
        let spike = self.terrain.in_height_unit(SPIKE);
        let zeros = vertices().filter(|vertex| self.terrain.is_zero(vertex));
        let beyond = self.terrain.in_height_unit(BEYOND);
        let evenly = vertices().step_by(vertices().count().div_ceil(EVENLY).max(1));
        let spikes = feature.paths.iter().flat_map(|path| spikes(path, self.terrain.steps(spike)));
        let mut candidates = zeros
            .map(|vertex| (vertex, from_zero))
            .take(OF_FEATURE)
            .chain(spikes.map(|vertex| (vertex, spike)).take(OF_FEATURE))
            .chain(evenly.map(|vertex| (vertex, beyond)));
        candidates.find_map(|(vertex, least)| {
            let (z, around) = self.pair(vertex)?;
            // A line may lead to a peak that the sample does not show.
            let reach = if self.terrain.is_zero(vertex) { 0.0 } else { around.reach };
            let is_far = around.beyond(z).abs() > least + around.relief() + reach;
            is_far.then_some((vertex, around))
        })
    }

    /// Returns the height of a vertex in the box of the points, and what is around it.
    fn pair(&self, vertex: &Vertex) -> Option<Pair> {
        Some((self.terrain.height(vertex)?, self.terrain.around(vertex.place)?))
    }
}

/// Returns the vertices of a path that lie more than `least` steps above both neighbours or below both. One at an end has one neighbour.
fn spikes(path: &[Vertex], least: i64) -> impl Iterator<Item = &Vertex> {
    let height = |at: Option<usize>| Some(i64::from(path.get(at?)?.z?));
    let differences = move |at: usize| {
        let z = height(Some(at))?;
        let neighbours = [at.checked_sub(1), at.checked_add(1)];
        let [before, after] = neighbours.map(|next| height(next).map(|other| z.saturating_sub(other)));
        before.or(after).zip(after.or(before))
    };
    let is_spike = move |(before, after): (i64, i64)| before.min(after) > least || before.max(after) < -least;
    (0..path.len()).filter(move |at| differences(*at).is_some_and(is_spike)).filter_map(|at| path.get(at))
}

/// Returns the middle one of `values`; of two, the greater.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Rounds to hundredths: a sample tells no more.
fn rounded(z: f64) -> f64 {
    (z * 100.0).round() / 100.0
}
