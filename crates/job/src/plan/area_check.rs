//! Whether the points lie where their coordinate reference system is made for. If not, the terrain would be placed in another country or in
//! a sea: x and y are exchanged, or the system is another one.

use crate::plan::area_cure::{Change, changes, name_missing_crs, scales};
use crate::plan::common_crs::TRANSFORM;
use crate::plan::extent::{Extent, SourceBox};
use crate::plan::height_range::{HeightSample, may_reach};
use crate::plan::point_survey::box_around;
use crs::{AreaOfUse, Crs, CrsChoice, CrsKind, CrsTransform, DatumRule, Unit, arc, turned};
use lattice::Lattice;
use points::Source;
use points::options::{InputOptions, OutsideCrsArea};
use std::collections::{HashMap, HashSet};
use std::path::Path;
use sys::{Warnings, of_inputs};

/// Surveys and zones reach some hundred kilometres beyond the area of use. Farther out, in degrees of arc, there is a warning.
const DOUBTFUL: f64 = 3.0;

/// Farther outside than this, in degrees of arc, no survey uses a system.
const HOPELESS: f64 = 6.0;

/// Neighbouring zones are used to the east and to the west. Where x and y exchanged would fit, so many degrees to the north or south are
/// enough to be sure.
const EXCHANGED: f64 = 1.0;

/// The files of one job lie no farther apart than this, in metres: what would bring one of them farther off is no cure.
const NEAR: f64 = 1e6;

/// A wrong scale is told from others by where it brings a file: so many times the length of all others beside them, or nearer.
const BESIDE: f64 = 2.0;
/// Surveys across the border of a zone are common. Where another unit would fit a small area, so many degrees beyond it are enough for a
/// warning.
const OTHER_UNIT: f64 = 0.05;

/// A system with a false origin has it so many metres away from where its coordinates are zero, and a site's own grid does not reach as far.
const FALSE_ORIGIN: f64 = 100_000.0;

/// Where a system without a false origin has its origin at longitude and latitude zero, there is nothing but sea within so many metres.
const OPEN_SEA: f64 = 1_000.0;

/// What to do about points that may be right.
const NOTHING_TO_DO: &str = ". Nothing, if the CRS and the coordinates are right";

/// Kilometres of a degree of arc.
const DEGREE: f64 = 111.2;

/// What the points of the job have in common.
pub(crate) struct CommonPlace<'a> {
    /// The system of the job.
    pub(crate) crs: &'a Crs,
    /// Metres of its unit of x and y.
    pub(crate) metres: f64,
    pub(crate) lattice: &'a Lattice,
    pub(crate) extent: &'a Extent,
    pub(crate) sample: &'a HeightSample,
}

/// Checks that the points of each source lie in the area of use of the system that they are in, and of that which they are transformed into.
///
/// # Errors
/// [`crate::Error::NoTerrain`] names the first source that lies hopelessly far outside.
pub(crate) fn check_places(
    sources: &[Source],
    common: &CommonPlace,
    options: &InputOptions,
    warnings: &mut Warnings,
) -> crate::Result<()> {
    let places: Vec<(&Source, Vec<[f64; 2]>)> = sources
        .iter()
        .zip(&common.extent.boxes)
        .filter(|(source, _)| may_reach(source, options.rectangle()))
        .map(|(source, claim)| (source, places(source, claim, common)))
        .filter(|(_, places)| !places.is_empty())
        .collect();
    warn_of_long_turns(&places, warnings);
    let mut ways = ToDegrees::default();
    let mut find = |others: Option<&Others>| -> Vec<(&Source, Outside)> {
        let found = places.iter().map(|(source, places)| (*source, outside(source, places, common, &mut ways, others)));
        found.filter_map(|(source, found)| Some((source, found?))).collect()
    };
    let outside = find(None);
    let others = Others::than(&outside, sources, common);
    let outside = if others.is_some() { find(others.as_ref()) } else { outside };
    let is_assumed = |source: &Source| is_crs_assumed(source, sources, options);
    if options.outside_crs_area == OutsideCrsArea::Stop {
        refuse_hopeless(&outside, is_assumed)?;
    }
    if let Some((source, first)) = outside.first() {
        let of = of_inputs(outside.len(), sources.len(), &source.path);
        let nothing = if first.is_hopeless() || first.is_local { "" } else { NOTHING_TO_DO };
        let sentence = first.sentence(source, is_assumed(source));
        warnings.push(format!("{of}{sentence}{nothing}"));
    }
    Ok(())
}

/// Returns whether a source names no CRS, so that it is taken to be in that of the others.
fn is_crs_assumed(source: &Source, sources: &[Source], options: &InputOptions) -> bool {
    let is_open = options.crs == CrsChoice::Auto && options.missing_crs.is_none();
    is_open && !source.own_crs().is_named() && sources.iter().any(|other| other.own_crs().is_named())
}

/// Warns about longitudes that count on beyond 180 degrees: whole turns are taken away.
fn warn_of_long_turns(places: &[(&Source, Vec<[f64; 2]>)], warnings: &mut Warnings) {
    let beyond = |source: &Source| {
        let own = source.transform().filter(|transform| transform.from.kind == CrsKind::Geographic)?;
        let (west, east) = (own.own.min[0], own.own.max[0]);
        (west > 180.0 || east < -180.0).then_some([west, east])
    };
    if let Some((source, [west, east])) = places.iter().find_map(|(source, _)| Some((source, beyond(source)?))) {
        warnings.push(format!(
            "{}: its longitudes ({west} to {east}) lie beyond 180 degrees, and are taken as {:.4} to {:.4}",
            source.path.display(),
            turned(west),
            turned(east)
        ));
    }
}

/// Returns how the points of a source lie outside the area of a system that they are in, if they do.
fn outside(
    source: &Source,
    places: &[[f64; 2]],
    common: &CommonPlace,
    ways: &mut ToDegrees,
    others: Option<&Others>,
) -> Option<Outside> {
    let of = |said: StatedSystem| Outside::of(&said, ways.of(&said.crs)?, &said.own(places)?, others);
    systems(source, common).into_iter().find_map(of)
}

/// Where the files lie that are not outside, in the system of the job.
struct Others {
    bounds: SourceBox,
    metres: f64,
}

impl Others {
    /// Returns where the files lie that are not among those outside; `None` without any.
    fn than(outside: &[(&Source, Outside)], sources: &[Source], common: &CommonPlace) -> Option<Others> {
        if outside.is_empty() {
            return None;
        }
        let outside: HashSet<&Path> = outside.iter().map(|(source, _)| source.path.as_path()).collect();
        let is_within = |source: &Source| !outside.contains(source.path.as_path());
        let claims = sources.iter().zip(&common.extent.boxes).filter(|(source, _)| is_within(source));
        let bounds = box_around(claims.filter_map(|(_, claim)| *claim).flatten())?;
        Some(Others { bounds, metres: common.metres })
    }

    /// Returns whether a place lies no farther than this from their box in x and y.
    fn are_within(&self, distance: f64, place: [f64; 2]) -> bool {
        let [min, max] = self.bounds;
        (0..2).all(|axis| place[axis] >= min[axis] - distance && place[axis] <= max[axis] + distance)
    }

    /// Returns whether a change that brings a point to this place is a cure.
    fn allow(&self, change: &Change, place: [f64; 2]) -> bool {
        let [min, max] = self.bounds;
        let longest = (max[0] - min[0]).max(max[1] - min[1]);
        let distance = if matches!(change, Change::Scaled(_)) { BESIDE * longest } else { NEAR / self.metres };
        self.are_within(distance, place)
    }
}

/// Fails if a source lies hopelessly far outside. It is no bad file that a job may leave out: what the sample of all files has of one depends
/// on the others, and so would the mesh.
fn refuse_hopeless(outside: &[(&Source, Outside)], is_assumed: impl Fn(&Source) -> bool) -> crate::Result<()> {
    let Some((source, first)) = outside.iter().find(|(_, found)| found.is_hopeless()) else { return Ok(()) };
    let what = format!(
        "{}; if the CRS and the coordinates are right, set [input] outside_crs_area = \"warn\"",
        first.sentence(source, is_assumed(source))
    );
    Err(crate::Error::NoTerrain(format!("{}: {what}", source.path.display())))
}

/// A system that the points of a source are in.
struct StatedSystem {
    crs: Crs,
    /// What the file is in.
    of_file: Crs,
    /// The way from the system of the job to that of the file, and the way back; `None` if they are one.
    to_file: Option<[CrsTransform; 2]>,
    /// Whether the points have been transformed into it.
    is_target: bool,
}

impl StatedSystem {
    /// Returns the places in this system; `None` if it has none of them.
    fn own(&self, places: &[[f64; 2]]) -> Option<Vec<[f64; 2]>> {
        let own: Vec<[f64; 2]> = match &self.to_file {
            Some([to_file, _]) if !self.is_target => places.iter().filter_map(|place| to_file.apply(*place)).collect(),
            _ => places.to_vec(),
        };
        (!own.is_empty()).then_some(own)
    }

    /// Returns a place of this system in the system of the file.
    fn in_file(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        match &self.to_file {
            Some([to_file, _]) if self.is_target => to_file.apply(place),
            _ => Some(place),
        }
    }

    /// Returns where a place of the file lies in the system of the job.
    fn in_job(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        match &self.to_file {
            Some([_, from_file]) => from_file.apply(place),
            None => Some(place),
        }
    }

    /// Returns where a place of the file lies in this system.
    fn of_place_in_file(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        match &self.to_file {
            Some([_, from_file]) if self.is_target => from_file.apply(place),
            _ => Some(place),
        }
    }
}

/// Returns what the file is in, if its points are transformed, and the system of the job.
fn systems(source: &Source, common: &CommonPlace) -> Vec<StatedSystem> {
    let crs = Crs { horizontal: Unit::from_metres(Some(common.metres)), ..common.crs.clone() };
    let ways = |from: &Crs| {
        let way = |from: &Crs, to: &Crs| CrsTransform::between(from, to, DatumRule::Close).ok();
        Some([way(&crs, from)?, way(from, &crs)?])
    };
    let Some(from) = source.transformed_from() else {
        return vec![StatedSystem { of_file: crs.clone(), crs, to_file: None, is_target: false }];
    };
    let Some(to_file) = ways(from) else { return Vec::new() };
    let of_file = from.clone();
    [(from.clone(), false), (crs.clone(), true)]
        .map(|(crs, is_target)| StatedSystem {
            crs,
            of_file: of_file.clone(),
            to_file: Some(to_file.clone()),
            is_target,
        })
        .into()
}

/// Returns where the points of a source lie, in the system of the job: in the middle of those of the sample, or at nine places of the box
/// that the source claims. A box may be wide because of one stray point or a wrong header, so that only all of its places together tell.
fn places(source: &Source, claim: &Option<SourceBox>, common: &CommonPlace) -> Vec<[f64; 2]> {
    let middle = common.sample.by_file.get(&source.path).and_then(|found| found.middle());
    if let Some([x, y]) = middle {
        return vec![[common.lattice.world(0, x), common.lattice.world(1, y)]];
    }
    let Some([min, max]) = claim.as_ref().filter(|_| source.claimed_rectangle().is_some()) else { return Vec::new() };
    let at = |i: usize, axis: usize| min[axis] + (max[axis] - min[axis]) * 0.5 * i as f64;
    (0..9).map(|i| [at(i % 3, 0), at(i / 3, 1)]).collect()
}

/// The ways to longitude and latitude of systems that sources have in common. One that is not computed has none.
#[derive(Default)]
struct ToDegrees(HashMap<String, Option<(AreaOfUse, CrsTransform)>>);

impl ToDegrees {
    fn of(&mut self, crs: &Crs) -> Option<&(AreaOfUse, CrsTransform)> {
        let way = || Some((AreaOfUse::of(crs)?, CrsTransform::to_rough_degrees(crs).ok()?));
        self.0.entry(format!("{crs:?}")).or_insert_with(way).as_ref()
    }
}

/// Points that lie outside the area of use of a system.
struct Outside {
    /// Where the points lie in the system.
    place: [f64; 2],
    /// The same in degrees; `None` if it is no place on earth.
    degrees: Option<[f64; 2]>,
    /// How far outside that is, to the east or west, and to the north or south.
    beyond: [f64; 2],
    /// What would bring them into the area.
    change: Option<Change>,
    /// Whether they lie near the origin of the coordinates, where a site's own grid lies, and no survey is likely.
    is_local: bool,
    is_target: bool,
    /// The system.
    crs: Crs,
    area: String,
}

impl Outside {
    /// Returns how the nearest of some places lies outside the area of a system; `None` if it does not lie far outside.
    fn of(
        said: &StatedSystem,
        (area, way): &(AreaOfUse, CrsTransform),
        places: &[[f64; 2]],
        others: Option<&Others>,
    ) -> Option<Outside> {
        let beyond_area =
            |place: &[f64; 2]| way.apply(*place).map_or([f64::INFINITY; 2], |degrees| area.beyond(degrees));
        let place = *places.iter().min_by(|a, b| arc(beyond_area(a)).total_cmp(&arc(beyond_area(b))))?;
        let (degrees, beyond) = (way.apply(place), beyond_area(&place));
        let is_within = |degrees: [f64; 2]| area.beyond(degrees) == [0.0; 2];
        let fits = |place: [f64; 2]| way.apply(place).is_some_and(is_within);
        let (is_far, is_near) = (arc(beyond) > HOPELESS, arc(beyond) <= DOUBTFUL);
        let is_local = !is_far && !said.is_target && is_at_origin(&said.crs, place, degrees, beyond);
        if is_near && !is_local && (said.is_target || arc(beyond) <= OTHER_UNIT) {
            return None;
        }
        let in_file = said.in_file(place);
        let is_beside = |[across, along]: [f64; 2]| across.abs() <= HOPELESS && along == 0.0;
        let helps = |change: &Change| {
            let changed = change.apply(in_file?, &said.of_file)?;
            let there = said.of_place_in_file(changed);
            let is_there = match change {
                Change::ExchangedNearBy => there.is_some_and(|place| is_beside(beyond_area(&place))),
                // It leads to the area of another system.
                Change::Southern(..) => !said.is_target,
                Change::Exchanged if is_near && arc(beyond) <= EXCHANGED => false,
                _ => change.is_in_degrees() && is_within(changed) || there.is_some_and(fits),
            };
            let is_allowed = |others: &Others| said.in_job(changed).is_some_and(|place| others.allow(change, place));
            Some(is_there && (change.is_in_degrees() || others.is_none_or(is_allowed)))
        };
        let of_one = others.into_iter().flat_map(|_| scales());
        let all = of_one.chain(in_file.into_iter().flat_map(|place| changes(place, &said.of_file)));
        // Around an origin without a false one, every shorter unit leads from beside the area into it.
        let is_rare = has_false_origin(&said.crs) && area.is_small(degrees.unwrap_or_default());
        let is_likely = |change: &Change| match change {
            _ if is_far => true,
            Change::Unit(_) => is_rare,
            Change::Scaled(_) => true,
            change => *change == Change::Exchanged && !is_local,
        };
        let mut likely = all.filter(is_likely);
        let change = likely.find(|change| helps(change) == Some(true));
        if is_near && !is_local && change.is_none() {
            return None;
        }
        let is_local = is_local && change.is_none();
        let area = area.label(degrees.unwrap_or_default());
        Some(Outside {
            place,
            degrees,
            beyond,
            change,
            is_local,
            is_target: said.is_target,
            crs: said.crs.clone(),
            area,
        })
    }

    /// Returns whether a terrain there is wrong for certain.
    fn is_hopeless(&self) -> bool {
        let is_far = arc(self.beyond) > HOPELESS;
        let is_exchanged = self.change == Some(Change::Exchanged);
        let is_scaled = matches!(self.change, Some(Change::Scaled(_)));
        is_far || is_scaled || is_exchanged && (arc(self.beyond) > DOUBTFUL || self.beyond[1] > EXCHANGED)
    }

    /// Says where the points lie and what to do. `is_assumed` tells that the source names no CRS, and others do.
    fn sentence(&self, source: &Source, is_assumed: bool) -> String {
        let [x, y] = self.place;
        let lie = match self.degrees {
            Some(_) if self.beyond == [0.0; 2] => "lie in the sea at longitude 0, latitude 0".into(),
            Some([longitude, latitude]) => format!(
                "lie at longitude {:.2}, latitude {latitude:.2}, about {:.0} km outside its area of use ({})",
                turned(longitude),
                arc(self.beyond) * DEGREE,
                self.area
            ),
            None => format!("are not on earth; its area of use is {}", self.area),
        };
        let contradiction = self.crs.difference_to_code();
        let contradiction =
            contradiction.map_or_else(String::new, |what| format!(", whose text and code differ in {what}"));
        let assumed = if is_assumed { "it has no CRS, and that of the other files is assumed: " } else { "" };
        let what_to_do = if is_assumed { self.what_to_do_without_crs(source) } else { self.what_to_do(source) };
        format!(
            "{assumed}in {}{contradiction}, its points (around x {x:.2}, y {y:.2}) {lie}; fix: {what_to_do}",
            self.crs.label()
        )
    }

    fn what_to_do_without_crs(&self, source: &Source) -> String {
        match &self.change {
            _ if source.looks_geocentric() => self.what_to_do(source),
            Some(change) => change.cure_without_crs(source.format, &self.crs),
            None => name_missing_crs(None, &self.crs),
        }
    }

    fn what_to_do(&self, source: &Source) -> String {
        let is_angle = self.place[0].abs() <= 360.0 && self.place[1].abs() <= 90.0;
        if source.looks_geocentric() {
            return format!("they look geocentric: {TRANSFORM}");
        }
        match &self.change {
            Some(change) => change.cure(source.format),
            None if self.is_local => {
                "[input] crs = \"none\" for a local grid. Nothing, if the CRS and the coordinates are right"
                    .into()
            }
            None if self.is_target => {
                "[input] to_crs = \"utm\", or another CRS for their place".into()
            }
            None if is_angle => {
                "[input] crs = \"EPSG:4326\" and [input] to_crs = \"utm\" for longitude and latitude, [input] crs = \"none\" for a \
                 local grid"
                    .into()
            }
            None => {
                "[input] crs = \"EPSG:...\" if the record is wrong, [input] crs = \"none\" for a local grid"
                    .into()
            }
        }
    }
}

/// Returns whether a place on a map lies where its coordinates are zero, and neither the area of the map nor land is there.
fn is_at_origin(crs: &Crs, place: [f64; 2], degrees: Option<[f64; 2]>, beyond: [f64; 2]) -> bool {
    let (Some(metres), CrsKind::Projected) = (crs.metres_per_unit(), crs.kind) else { return false };
    let from_zero = arc(place) * metres;
    let is_in_sea = degrees.is_some_and(|degrees| arc(degrees) * DEGREE * 1000.0 < 2.0 * OPEN_SEA);
    from_zero < OPEN_SEA && is_in_sea || from_zero < FALSE_ORIGIN && has_false_origin(crs) && beyond != [0.0; 2]
}

fn has_false_origin(crs: &Crs) -> bool {
    crs.form().and_then(|form| form.false_origin()).map_or(0.0, arc) > FALSE_ORIGIN
}
