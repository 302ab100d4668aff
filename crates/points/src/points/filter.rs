//! The filter: applies the rules to one record at a time, maps its coordinates to the lattice, counts it, and hands points on.

use std::collections::BTreeMap;
use std::path::Path;

use crate::points::axis::{AXIS_NAMES, Axis};
use crate::points::classes::{is_ground, is_unclassified};
use crate::points::counts::PointCounts;
use crate::points::point::Point;
use crate::points::raw_box::RawBox;
use crate::points::record::{NODATA, PointRecord};
use crate::points::record_sink::RecordSink;
use crate::points::returns::{KeptReturns, PulseReturn};
use crate::points::rules::PointRules;
use delaunay::geometry::REACH;
use lattice::BEYOND;
use sys::Result;

/// The most points handed to the sink at once: 448 KiB of them, which stays in the second-level cache.
const SLICE: usize = 1 << 14;

/// Takes the points of a source, in record order.
pub(crate) type Sink<'a> = &'a mut dyn FnMut(&[Point]) -> Result<()>;

/// Lattice integers in x, y and z, each with whether it was rounded; `None` where the integer does not fit an `i32`.
type Mapped = [Option<(i32, bool)>; 3];

/// Filters the records of one chunk of a source.
pub(crate) struct PointFilter<'a> {
    path: &'a Path,
    axes: &'a [Axis; 3],
    rules: &'a PointRules,
    /// The maps of x, y and z, if all are exact and the rules look at nothing but the class of a record.
    quick_maps: Option<[[i64; 2]; 3]>,
    /// Points outside this box are mistakes, and what to say about the first of them.
    plausible: Option<(RawBox, &'a str)>,
    sink: Sink<'a>,
    points: Vec<Point>,
    counts: PointCounts,
    /// Records within the bounds and not withheld, by class.
    classes: [u64; 256],
    /// Points handed on, by class.
    kept: [u64; 256],
}

impl<'a> PointFilter<'a> {
    /// Returns a filter for records of the file at `path` with these `axes`; points that pass `rules` go to `sink`.
    pub(crate) fn new(path: &'a Path, axes: &'a [Axis; 3], rules: &'a PointRules, sink: Sink<'a>) -> PointFilter<'a> {
        let (points, counts) = (Vec::with_capacity(SLICE), PointCounts::default());
        let quick_maps = quick_maps(rules);
        let (plausible, classes, kept) = (None, [0; 256], [0; 256]);
        PointFilter { path, axes, rules, quick_maps, plausible, sink, points, counts, classes, kept }
    }

    /// Makes points outside of this box malformed. The message about the first of them gives the `remedy`.
    pub(crate) fn within(self, plausible: RawBox, remedy: &'a str) -> PointFilter<'a> {
        PointFilter { quick_maps: None, plausible: Some((plausible, remedy)), ..self }
    }

    /// Returns the lattice integers of a record whose class alone decides its fate; `None` if a closer look is needed.
    #[inline(always)]
    fn quick_place(&self, record: &PointRecord) -> Option<[i32; 3]> {
        let maps = self.quick_maps.as_ref()?;
        let mut fits = !(record.withheld | record.rounded[0] | record.rounded[1]);
        let mut place = [0; 3];
        for ((place, &raw), [mul, add]) in place.iter_mut().zip(&record.raw).zip(maps) {
            let narrow = raw as i32;
            let mapped = i64::from(narrow) * mul + add;
            *place = mapped as i32;
            fits &= (i64::from(narrow) == raw) & (i64::from(*place) == mapped);
        }
        (fits & in_reach(place[0]) & in_reach(place[1])).then_some(place)
    }

    /// Counts a class, and returns whether the job keeps it.
    #[inline(always)]
    fn keeps_class(&mut self, class: u8) -> bool {
        self.classes[class as usize] += 1;
        let is_kept = self.rules.classes[class as usize];
        self.counts.other_class += u64::from(!is_kept);
        is_kept
    }

    /// Keeps record `number`, whose lattice integers are `place`.
    #[inline(always)]
    fn keep(&mut self, number: u64, record: &PointRecord, [x, y, z]: [i32; 3]) -> Result<()> {
        let order = if self.rules.numbered { self.rules.first_order + number } else { 0 };
        let point = Point::new([x, y], z, record.rgb, record.class, order);
        let point = point.with_intensity(record.intensity);
        self.kept[point.class as usize] += 1;
        self.counts.max_rgb = self.counts.max_rgb.max(point.rgb[0].max(point.rgb[1]).max(point.rgb[2]));
        self.points.push(point);
        if self.points.len() == SLICE { self.flush() } else { Ok(()) }
    }

    /// Hands on the last points and returns the counts.
    pub(crate) fn finish(mut self) -> Result<PointCounts> {
        self.flush()?;
        for (class, kept) in (0..=u8::MAX).zip(self.kept) {
            self.counts.kept += kept;
            self.counts.ground += if is_ground(class) { kept } else { 0 };
            self.counts.unclassified += if is_unclassified(class) { kept } else { 0 };
        }
        let PointCounts {
            withheld,
            other_class,
            other_return,
            out_of_bounds,
            outside_clip,
            nodata,
            malformed,
            kept,
            ..
        } = self.counts;
        let not_wanted = out_of_bounds + outside_clip + withheld + other_class + other_return;
        self.counts.read = not_wanted + nodata + malformed + kept;
        let classes: BTreeMap<u8, u64> = (0..=u8::MAX).zip(self.classes).filter(|(_, count)| *count > 0).collect();
        self.counts.classes = classes;
        Ok(self.counts)
    }

    /// Returns whether the job keeps a return, and counts it if it does not, or if the record does not say clearly which it is.
    #[inline]
    fn keeps_return(&mut self, pulse_return: PulseReturn) -> bool {
        if self.rules.returns == KeptReturns::All {
            return true;
        }
        self.counts.unclear_returns += u64::from(!pulse_return.is_clear());
        let is_kept = self.rules.returns.has(pulse_return);
        self.counts.other_return += u64::from(!is_kept);
        is_kept
    }

    /// Takes any record, and asks everything that the rules may want to know.
    #[inline(never)]
    fn push_any(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        if self.rules.bounds.as_ref().is_some_and(|bounds| !bounds.hold(&record.raw)) {
            self.counts.out_of_bounds += 1;
            return Ok(());
        }
        if self.is_outside_clip(record) {
            self.counts.outside_clip += 1;
            return Ok(());
        }
        if record.withheld {
            self.counts.withheld += 1;
            return Ok(());
        }
        if !self.keeps_class(record.class) || !self.keeps_return(record.pulse_return) {
            return Ok(());
        }
        if record.raw[2] == NODATA {
            self.counts.nodata += 1;
            return Ok(());
        }
        if self.plausible.is_some_and(|(plausible, _)| !plausible.holds(&record.raw)) {
            self.push_far(record, &place());
            return Ok(());
        }
        // One by one: `array::map` compiles to a call for every record here.
        let [x, y, z] = &self.rules.maps;
        let mapped = [x.apply(record.raw[0]), y.apply(record.raw[1]), z.apply(record.raw[2])];
        match mapped {
            [Some((x, round_x)), Some((y, round_y)), Some((z, round_z))] if in_reach(x) && in_reach(y) => {
                self.counts.rounded_xy += (round_x | round_y | record.rounded[0]) as u64;
                self.counts.rounded_z += (round_z | record.rounded[1]) as u64;
                self.keep(number, record, [x, y, z])
            }
            _ => {
                let (value, name) = self.out_of_reach(record, &mapped);
                self.malformed(1, || {
                    format!(
                        "{}: {name} = {value} lies outside the range that the job's lattice reaches; leave such points out \
                         with bounds, or choose a coarser resolution",
                        place()
                    )
                });
                Ok(())
            }
        }
    }

    /// Returns whether a record lies outside the polygons of the job. Unlike bounds, which hold for the numbers of a file, this is decided
    /// on the lattice: the polygons come from another file, often from another system, so they are exact nowhere else. So points that
    /// rounding brings to one place fare alike, whatever their files. A record without a place on the lattice is malformed.
    #[inline]
    fn is_outside_clip(&self, record: &PointRecord) -> bool {
        let Some(clip) = &self.rules.clip else { return false };
        let [x, y, _] = &self.rules.maps;
        match (x.apply(record.raw[0]), y.apply(record.raw[1])) {
            (Some((x, _)), Some((y, _))) => !clip.holds([x, y]),
            _ => false,
        }
    }

    fn flush(&mut self) -> Result<()> {
        if !self.points.is_empty() {
            (self.sink)(&self.points)?;
            self.points.clear();
        }
        Ok(())
    }

    /// Counts a record that lies far from all others.
    #[cold]
    fn push_far(&mut self, record: &PointRecord, place: &str) {
        let remedy = self.plausible.as_mut().map_or("", |(_, remedy)| std::mem::take(remedy));
        let [x, y, z] = [0, 1, 2].map(|axis| self.value_text(record, axis));
        self.malformed(1, || format!("{place}: ({x}, {y}, {z}) lies far from all other points{remedy}"));
    }

    fn value_text(&self, record: &PointRecord, axis: usize) -> String {
        match record.raw[axis] {
            BEYOND => format!("more than 10^18 steps of {}", self.axes[axis].scale),
            raw => self.axes[axis].value(raw).to_string(),
        }
    }

    /// Returns the first coordinate that is outside the lattice's reach, and the name of its axis.
    #[cold]
    fn out_of_reach(&self, record: &PointRecord, mapped: &Mapped) -> (String, &'static str) {
        let is_out = |axis: usize| mapped[axis].is_none_or(|(v, _)| axis < 2 && !in_reach(v));
        let axis = (0..3).find(|&axis| is_out(axis)).unwrap_or(2);
        (self.value_text(record, axis), AXIS_NAMES[axis])
    }
}

impl RecordSink for PointFilter<'_> {
    #[inline]
    fn push(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        // Nearly all records of jobs without bounds and returns. To ask for everything in turn takes 1.6 times the instructions.
        match self.quick_place(record) {
            None => self.push_any(number, record, place),
            Some(place) if self.keeps_class(record.class) => self.keep(number, record, place),
            Some(_) => Ok(()),
        }
    }

    #[inline]
    fn push_out_of_bounds(&mut self, _: u8) {
        self.counts.out_of_bounds += 1;
    }

    #[cold]
    fn push_outlier(&mut self, class: u8, pulse_return: PulseReturn, what: impl FnOnce() -> String) {
        // A text leaves rows beyond the bounds out by itself. What has no place in another system is not within bounds there.
        let is_out_of_bounds = self.rules.bounds.is_some();
        if is_out_of_bounds {
            self.push_out_of_bounds(class);
        } else if !self.rules.classes[class as usize] {
            self.counts.other_class += 1;
        } else if self.keeps_return(pulse_return) {
            self.malformed(1, what);
        }
    }

    fn malformed(&mut self, count: u64, what: impl FnOnce() -> String) {
        let path = self.path;
        self.counts.add_malformed(count, || format!("{}: {}", path.display(), what()));
    }

    fn not_decoded(&mut self, count: u64) {
        self.counts.out_of_bounds += count;
        self.counts.not_decoded += count;
    }

    fn misplaced(&mut self, count: u64) {
        self.counts.misplaced += count;
    }
}

/// Returns the maps of x, y and z if all are exact, and neither bounds nor polygons nor returns leave records out.
fn quick_maps(rules: &PointRules) -> Option<[[i64; 2]; 3]> {
    let asks_for_more = rules.bounds.is_some() || rules.clip.is_some() || rules.returns != KeptReturns::All;
    let [x, y, z] = &rules.maps;
    if asks_for_more { None } else { Some([x.exact()?, y.exact()?, z.exact()?]) }
}

/// Returns whether a lattice integer in x or y is within reach. Unlike `value.abs() <= REACH`, this is right for `i32::MIN`.
fn in_reach(value: i32) -> bool {
    (-REACH..=REACH).contains(&value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::classes::is_noise;
    use crate::points::optional_fields::OptionalFields;
    use crate::points::raw_bounds::RawBounds;
    use lattice::{AxisMap, LatticeArea};
    use proptest::prelude::*;
    use rust_decimal::Decimal;
    use std::sync::Arc;

    fn map(offset: i64, scale: i64) -> AxisMap {
        AxisMap::new(Decimal::from(offset), Decimal::from(scale), Decimal::ZERO, Decimal::ONE).unwrap()
    }

    /// Returns the points that pass, and the counts; with `only_any`, no record takes the quick way.
    fn filtered(rules: &PointRules, records: &[PointRecord], only_any: bool) -> (Vec<Point>, PointCounts) {
        let axes = [Axis { offset: Decimal::ZERO, scale: Decimal::ONE }; 3];
        let mut points = Vec::new();
        let mut sink = |some: &[Point]| {
            points.extend_from_slice(some);
            Ok(())
        };
        let mut filter = PointFilter::new(Path::new("cloud.las"), &axes, rules, &mut sink);
        assert!(filter.quick_maps.is_some(), "these rules allow the quick way");
        if only_any {
            filter.quick_maps = None;
        }
        for (number, record) in (0..).zip(records) {
            filter.push(number, record, || format!("point {number}")).unwrap();
        }
        let counts = filter.finish().unwrap();
        (points, counts)
    }

    /// Raw integers within reach, at its ends, and beyond 32 bits.
    fn raw() -> impl Strategy<Value = i64> {
        let reach = i64::from(REACH);
        let ends = [reach, -reach, i64::from(i32::MAX), i64::from(i32::MIN)];
        let beyond = ends.map(|end| end + end.signum());
        let edges = [&ends[..], &beyond, &[0, BEYOND, NODATA]].concat();
        prop_oneof![6 => -1000i64..1000, 1 => prop::sample::select(edges), 1 => any::<i32>().prop_map(i64::from)]
    }

    fn record() -> impl Strategy<Value = PointRecord> {
        let flags = prop::array::uniform3(prop::sample::select(vec![false, false, false, true]));
        let values = (prop::array::uniform3(any::<u16>()), any::<u16>(), 0u8..20);
        (prop::array::uniform3(raw()), values, flags).prop_map(|(raw, (rgb, intensity, class), flags)| {
            let [withheld, xy, z] = flags;
            PointRecord { raw, rgb, intensity, class, withheld, rounded: [xy, z], ..PointRecord::default() }
        })
    }

    proptest! {
        #[test]
        fn on_the_quick_way_records_fare_as_any_others(
            records in prop::collection::vec(record(), 0..60),
            offsets in prop::array::uniform3(prop_oneof![3 => Just(0), 3 => -1000i64..1000, 1 => -(1i64 << 31)..1 << 31]),
            scales in prop::array::uniform3(prop_oneof![Just(1), 1i64..50]),
            first_order in 0u64..1 << 39,
            numbered in any::<bool>(),
        ) {
            let rules = PointRules {
                maps: [0, 1, 2].map(|axis| map(offsets[axis], scales[axis])),
                classes: std::array::from_fn(|class| !is_noise(class as u8)),
                returns: KeptReturns::All,
                bounds: None,
                clip: None,
                first_order,
                numbered,
                fields: OptionalFields::default(),
            };
            prop_assert_eq!(filtered(&rules, &records, false), filtered(&rules, &records, true));
        }
    }

    /// Of a finer source, several records come to one place of the lattice.
    #[test]
    fn polygons_hold_for_places_on_the_lattice() {
        let rounding = AxisMap::new(Decimal::ZERO, Decimal::ONE, Decimal::ZERO, Decimal::from(10)).unwrap();
        let area = LatticeArea::new(&[vec![vec![[0, 0], [10, 0], [10, 10], [0, 10]]]], 1);
        let rules = PointRules {
            maps: [rounding; 3],
            classes: std::array::from_fn(|class| class != 9),
            returns: KeptReturns::All,
            bounds: None,
            clip: Some(Arc::new(area)),
            first_order: 0,
            numbered: true,
            fields: OptionalFields::default(),
        };
        let axes = [Axis { offset: Decimal::ZERO, scale: Decimal::ONE }; 3];
        let mut ignore = |_: &[Point]| Ok(());
        let mut filter = PointFilter::new(Path::new("cloud.las"), &axes, &rules, &mut ignore);
        let records = [([-4, 0], 2), ([-6, 50], 2), ([104, 104], 2), ([105, 50], 9), ([50, 50], 9), ([50, 1 << 40], 2)];
        for (number, ([x, y], class)) in (0..).zip(records) {
            let record = PointRecord { raw: [x, y, 0], class, ..PointRecord::default() };
            filter.push(number, &record, String::new).unwrap();
        }
        let counts = filter.finish().unwrap();
        assert_eq!((counts.kept, counts.outside_clip, counts.other_class, counts.malformed), (2, 2, 1, 1));
        assert_eq!((counts.read, counts.classes.get(&9)), (6, Some(&1)));
    }

    #[test]
    fn rules_that_leave_records_out_or_round_them_allow_no_quick_way() {
        let rules = PointRules {
            maps: [map(7, 1); 3],
            classes: [true; 256],
            returns: KeptReturns::All,
            bounds: None,
            clip: None,
            first_order: 0,
            numbered: true,
            fields: OptionalFields::default(),
        };
        assert_eq!(quick_maps(&rules), Some([[1, 7]; 3]));
        assert_eq!(quick_maps(&PointRules { returns: KeptReturns::First, ..rules.clone() }), None);
        let everywhere = RawBounds { min: [i64::MIN; 2], max: [i64::MAX; 2] };
        assert_eq!(quick_maps(&PointRules { bounds: Some(everywhere), ..rules.clone() }), None);
        let area = Arc::new(LatticeArea::new(&[vec![vec![[0, 0], [9, 0], [0, 9]]]], 1));
        assert_eq!(quick_maps(&PointRules { clip: Some(area), ..rules.clone() }), None);
        let rounding = AxisMap::new(Decimal::ZERO, Decimal::ONE, Decimal::ZERO, Decimal::from(2)).unwrap();
        for axis in 0..3 {
            let mut changed = rules.clone();
            changed.maps[axis] = rounding;
            assert_eq!(quick_maps(&changed), None, "axis {axis}");
        }
    }
}
