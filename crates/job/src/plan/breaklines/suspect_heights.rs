//! Heights of lines that the terrain around makes doubtful: in another unit, counted from another zero, or missing and written as 0.

use crate::plan::breaklines::other_unit::UnitJudge;
use crate::plan::breaklines::terrain::{Around, Pair, SampledTerrain, median, middles, rounded};
use crate::plan::extent::to_float;
use breaklines::{Feature, FeatureKind, Vertex};
use points::is_number_in_steps;
use points::lines::LineFile;
use sys::{Result, interrupt};

/// So many vertices of a file are compared with the terrain, to judge the file.
const OF_FILE: usize = 512;

/// So many missing heights of a feature are compared, and so many spikes.
const OF_FEATURE: usize = 64;

/// So many metres are more than between lines and the points beside them, and less than between most ellipsoids and the sea.
const OTHER_ZERO: f64 = 20.0;

/// A vertex with a missing height may lie beside the box of the points. From there, terrain falls to the sea by less than this, of many metres.
const FALL: f64 = 0.2;

/// Of the heights of a file that counts from another zero, so many in a hundred lie as far from the terrain. Otherwise its features are judged
/// one by one.
const MOST: usize = 80;

/// Where all heights of a file are 0, a terrain within so many metres may be the shore of the sea.
const SHORE: f64 = 1.0;

/// A height of 0 is doubtful where the terrain is so many metres above or below it: in a feature with other heights, and in one without.
const FROM_ZERO: [f64; 2] = [3.0, 10.0];

/// A feature without any other height than 0 is doubtful nearer to an even terrain, if most other features lie on the points: where it is so many
/// metres above or below, and so many times as far as the points around differ. Quays are lower.
const FROM_EVEN: f64 = 4.0;
const TIMES_EVEN: f64 = 10.0;

/// Other features lie on the points if they are no more than so many metres beyond.
const ON_POINTS: f64 = 1.0;

/// A vertex is doubtful if it lies so many metres beyond its neighbours on the line and beyond the terrain.
const SPIKE: f64 = 10.0;

/// Any vertex is doubtful if it lies so many metres beyond the terrain.
const BEYOND: f64 = 50.0;

/// A lake is doubtful if it lies so many metres above the points on most of its shore, and so many times their relief.
const ABOVE_SHORE: f64 = 1.0;
const TIMES_RELIEF: f64 = 10.0;

/// So many vertices of a feature are looked at, evenly.
const EVENLY: usize = 16;

/// Returns the warnings about heights of the `features`, which come from `files`.
///
/// # Errors
/// [`sys::Error::Interrupted`].
pub(super) fn suspect_heights(
    files: &[LineFile],
    features: &[Feature],
    terrain: &SampledTerrain,
) -> Result<Vec<String>> {
    let mut found = Vec::new();
    // Features come in the order of their files.
    for features in features.chunk_by(|one, other| one.id.file == other.id.file) {
        interrupt::check()?;
        let Some(file) = features.first().and_then(|feature| files.get(feature.id.file as usize)) else { continue };
        let doubts = Judge { terrain, scale: file.height_scale }.doubts(features);
        found.extend(doubts.into_iter().map(|doubt| format!("{}: {doubt}", file.path.display())));
    }
    Ok(found)
}

struct Judge<'a> {
    terrain: &'a SampledTerrain<'a>,
    /// By what the heights of the file have been multiplied.
    scale: f64,
}

/// Why a vertex is doubtful.
enum Doubt {
    /// Its height is 0 in the file.
    Zero,
    /// Its height is a number that programs write for none.
    Nodata,
    Far,
}

impl Judge<'_> {
    /// Returns sentences about the features of a file.
    fn doubts(&self, features: &[Feature]) -> Vec<String> {
        let units = UnitJudge { terrain: self.terrain, scale: self.scale };
        let pairs = self.pairs(features);
        if let Some(doubt) = units.of_file(&pairs).or_else(|| self.all_zero(features, &pairs)) {
            return vec![doubt];
        }
        let by_feature: Vec<Vec<Pair>> = features.iter().map(|feature| self.pairs_of_feature(feature)).collect();
        let in_other_unit = units.of_features(features, &by_feature);
        if in_other_unit.is_none()
            && let Some(doubt) = self.other_zero(features, &pairs)
        {
            return vec![doubt];
        }
        let known = in_other_unit.as_ref().map(|(known, _)| known.as_slice()).unwrap_or_default();
        let others = features.iter().filter(|feature| !known.contains(&feature.id.feature));
        let vertices = self.of_vertices(others, self.are_on_points(&by_feature));
        in_other_unit.map(|(_, sentence)| sentence).into_iter().chain(vertices).collect()
    }

    /// Tells whether most features with heights lie on the points. `pairs` are those of each feature.
    fn are_on_points(&self, pairs: &[Vec<Pair>]) -> bool {
        let apart = pairs.iter().filter_map(|pairs| median(pairs.iter().map(|(z, around)| around.beyond(*z).abs())));
        median(apart).is_some_and(|apart| apart <= self.terrain.in_height_unit(ON_POINTS))
            && pairs.iter().filter(|pairs| !pairs.is_empty()).count().saturating_mul(2) > pairs.len()
    }

    /// Returns the heights of some vertices of a file, and what is around them.
    fn pairs(&self, features: &[Feature]) -> Vec<Pair> {
        self.sampled(features).filter_map(|vertex| self.terrain.pair(vertex)).collect()
    }

    fn sampled<'f>(&self, features: &'f [Feature]) -> impl Iterator<Item = &'f Vertex> {
        let all = || features.iter().flat_map(|feature| feature.paths.iter().flatten());
        all().step_by(all().count().div_ceil(OF_FILE).max(1))
    }

    /// Returns the heights of some vertices of a feature, without those of 0, and what is around them.
    fn pairs_of_feature(&self, feature: &Feature) -> Vec<Pair> {
        let some = evenly(feature).filter(|vertex| !self.terrain.is_zero(vertex));
        some.filter_map(|vertex| self.terrain.pair(vertex)).collect()
    }

    /// Returns a sentence if all heights of a file are 0.
    fn all_zero(&self, features: &[Feature], pairs: &[Pair]) -> Option<String> {
        let beyond = median(pairs.iter().map(|(z, around)| around.beyond(*z)))?;
        let is_all_zero = self.sampled(features).all(|vertex| vertex.z.is_none() || self.terrain.is_zero(vertex));
        (is_all_zero && beyond.abs() > self.terrain.in_height_unit(SHORE)).then(|| {
            format!(
                "all its heights are 0, but the median of the points around is {}; fix: [[breaklines]] heights = \"points\" takes them \
                 from the points",
                rounded(median(pairs.iter().map(|(_, around)| around.middle)).unwrap_or_default())
            )
        })
    }

    /// Returns a sentence if all heights of a file seem to have another zero.
    fn other_zero(&self, features: &[Feature], pairs: &[Pair]) -> Option<String> {
        let beyond = median(pairs.iter().map(|(z, around)| around.beyond(*z)))?;
        let zeros = self.sampled(features).filter(|vertex| self.terrain.is_zero(vertex)).count();
        let count = self.sampled(features).filter(|vertex| vertex.z.is_some()).count();
        let least = self.terrain.in_height_unit(OTHER_ZERO);
        let slack = median(pairs.iter().map(|(_, around)| around.relief() + around.reach))?;
        let are_beyond = |(z, around): &&Pair| around.beyond(*z) * beyond.signum() > least;
        let is_most = pairs.iter().filter(are_beyond).count().saturating_mul(100) >= pairs.len().saturating_mul(MOST);
        let is_far = beyond.abs() > least + slack && is_most && zeros < count.div_ceil(2);
        let [line, points] = middles(pairs)?;
        let units = UnitJudge { terrain: self.terrain, scale: self.scale };
        is_far.then(|| {
            let side = if beyond > 0.0 { "above" } else { "below" };
            let unit = units.hint(pairs).map(|unit| format!("be in another unit ({unit}), ")).unwrap_or_default();
            format!(
                "its heights lie {side} the terrain (median {line}, points around {points}): they may {unit}have another datum, such as \
                 the ellipsoid; fix: convert them, or [[breaklines]] heights = \"points\" takes them from the points"
            )
        })
    }

    /// Returns a sentence about the vertices that are far from the terrain, by features. `on_points` tells whether most features of the file lie
    /// on the points.
    fn of_vertices<'f>(&self, features: impl Iterator<Item = &'f Feature>, on_points: bool) -> Option<String> {
        let zero = |feature| self.zero_on_even(feature).filter(|_| on_points);
        let doubtful = |feature| self.doubtful_vertex(feature).or_else(|| zero(feature));
        let mut found = features.filter_map(|feature| Some((feature, doubtful(feature)?)));
        let (feature, (vertex, around, doubt)) = found.next()?;
        let others = match found.count() {
            0 => String::new(),
            1 => " (and another feature has such a vertex)".into(),
            count => format!(" (and {count} other features have such vertices)"),
        };
        let z = self.terrain.height(vertex)?;
        let (z, what) = match doubt {
            Doubt::Zero => (0.0, "; fix: correct it, if 0 stands for no height,"),
            Doubt::Nodata => (z, "; fix: correct it, if it stands for nodata,"),
            Doubt::Far => (z, "; fix: correct it, set [[breaklines]] height_unit if the file is in another unit,"),
        };
        Some(format!(
            "feature {} has the height {z} at {}, where the points around lie from {} to {}{others}{what} or [[breaklines]] heights = \
             \"points\" takes all heights from the points",
            feature.id.feature,
            self.terrain.place_text(vertex.place),
            rounded(around.lowest),
            rounded(around.highest)
        ))
    }

    /// Returns the first vertex of a feature whose height is no height of the terrain around.
    fn doubtful_vertex<'f>(&self, feature: &'f Feature) -> Option<(&'f Vertex, Around, Doubt)> {
        self.missing_height(feature).or_else(|| self.far_vertex(feature)).or_else(|| self.high_lake(feature))
    }

    /// Returns the first vertex of a feature whose height seems to be missing: it is 0, or a number for none, and the terrain lies elsewhere.
    fn missing_height<'f>(&self, feature: &'f Feature) -> Option<(&'f Vertex, Around, Doubt)> {
        let mut vertices = feature.paths.iter().flatten();
        let is_all_zero = vertices.all(|vertex| vertex.z.is_none() || self.terrain.is_zero(vertex));
        let from_zero = self.terrain.in_height_unit(FROM_ZERO[usize::from(is_all_zero)]);
        // All of a lake gets its lowest height, wherever that is.
        let fall = if feature.kind == FeatureKind::Lake { 0.0 } else { FALL };
        let places = feature.paths.iter().flat_map(|path| (0..path.len()).map(move |at| (path, at)));
        let missing = places.filter_map(|(path, at)| Some((path, at, self.missing_in(path.get(at)?)?)));
        missing.take(OF_FEATURE).find_map(|(path, at, doubt)| {
            let vertex = path.get(at)?;
            let (around, outside) = self.terrain.beside(vertex.place)?;
            let beyond = around.beyond(self.terrain.height(vertex)?);
            // Trees have a relief of their own. Between two vertices on the ground, it makes no difference.
            let is_between = self.known_beside(path, at).is_some_and(|known| {
                known.iter().all(|z| around.beyond(*z).abs() < from_zero && (z - around.lowest).abs() < beyond.abs())
            });
            let gentle = if is_between { FALL * around.reach } else { f64::INFINITY };
            let slack = around.relief().min(gentle);
            (beyond.abs() > from_zero + slack + fall * outside).then_some((vertex, around, doubt))
        })
    }

    /// Returns the first vertex of a line without any other height than 0 of which most lies off an even terrain. The water of a lake may lie
    /// deep below its shore.
    fn zero_on_even<'f>(&self, feature: &'f Feature) -> Option<(&'f Vertex, Around, Doubt)> {
        let mut vertices = feature.paths.iter().flatten();
        let is_all_zero = vertices.all(|vertex| vertex.z.is_none() || self.terrain.is_zero(vertex));
        let off = |vertex: &'f Vertex| {
            let (z, around) = self.terrain.pair(vertex)?;
            let least = self.terrain.in_height_unit(FROM_EVEN).max(TIMES_EVEN * around.relief());
            Some((vertex, around, around.beyond(z).abs() - least))
        };
        let off: Vec<_> = evenly(feature).filter_map(off).collect();
        let is_off = is_all_zero
            && feature.kind != FeatureKind::Lake
            && median(off.iter().map(|(_, _, more)| *more)).is_some_and(|more| more > 0.0);
        let (vertex, around, _) = off.into_iter().find(|(_, _, more)| is_off && *more > 0.0)?;
        Some((vertex, around, Doubt::Zero))
    }

    /// Returns why the height of a vertex may be missing.
    fn missing_in(&self, vertex: &Vertex) -> Option<Doubt> {
        let nodata = || self.is_nodata(vertex).then_some(Doubt::Nodata);
        self.terrain.is_zero(vertex).then_some(Doubt::Zero).or_else(nodata)
    }

    /// Returns the nearest heights before and after a vertex that are not missing.
    fn known_beside(&self, path: &[Vertex], at: usize) -> Option<[f64; 2]> {
        let (before, after) = path.split_at_checked(at)?;
        let is_known = |vertex: &&Vertex| self.missing_in(vertex).is_none();
        let [before, after] = [before.iter().rev().find(is_known)?, after.iter().find(is_known)?];
        Some([self.terrain.height(before)?, self.terrain.height(after)?])
    }

    /// Tells whether the height of a vertex is a number that programs write for none.
    fn is_nodata(&self, vertex: &Vertex) -> bool {
        let step = to_float(self.terrain.lattice.step(2)) / self.scale;
        self.terrain.height(vertex).is_some_and(|z| is_number_in_steps(z / self.scale, step))
    }

    /// Returns the first vertex of a feature that lies far beyond the terrain, and more so beyond its neighbours.
    fn far_vertex<'f>(&self, feature: &'f Feature) -> Option<(&'f Vertex, Around, Doubt)> {
        let [spike, beyond] = [SPIKE, BEYOND].map(|metres| self.terrain.in_height_unit(metres));
        let spikes = feature.paths.iter().flat_map(|path| spikes(path, self.terrain.steps(spike)));
        let spikes = spikes.map(|vertex| (vertex, spike)).take(OF_FEATURE);
        let mut candidates = spikes.chain(evenly(feature).map(|vertex| (vertex, beyond)));
        candidates.find_map(|(vertex, least)| {
            let (z, around) = self.terrain.pair(vertex)?;
            // A line may lead to a peak that the sample does not show.
            let is_far = around.beyond(z).abs() > least + around.relief() + around.reach;
            (is_far && !self.terrain.is_zero(vertex)).then_some((vertex, around, Doubt::Far))
        })
    }

    /// Returns a vertex of a lake that lies above the points on most of its shore. Those on a dam would be as high as the water.
    fn high_lake<'f>(&self, feature: &'f Feature) -> Option<(&'f Vertex, Around, Doubt)> {
        let above = |vertex: &'f Vertex| {
            let (z, around) = self.terrain.pair(vertex)?;
            let least = self.terrain.in_height_unit(ABOVE_SHORE).max(TIMES_RELIEF * around.relief());
            Some((vertex, around, around.beyond(z) - least.max(FALL * around.reach)))
        };
        let on_shore: Vec<_> = evenly(feature).filter_map(above).collect();
        let is_high = feature.kind == FeatureKind::Lake && median(on_shore.iter().map(|(_, _, more)| *more))? > 0.0;
        let (vertex, around, _) = on_shore.into_iter().find(|(_, _, more)| is_high && *more > 0.0)?;
        Some((vertex, around, Doubt::Far))
    }
}

/// Returns some vertices of a feature, evenly.
fn evenly(feature: &Feature) -> impl Iterator<Item = &Vertex> {
    let vertices = || feature.paths.iter().flatten();
    vertices().step_by(vertices().count().div_ceil(EVENLY).max(1))
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
