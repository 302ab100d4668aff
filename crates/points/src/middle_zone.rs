//! The UTM zone in the middle of the data, for `to_crs = "utm"`.

use crate::options::InputOptions;
use crate::source::Source;
use crate::stated_crs::no_way;
use crate::transform_warnings::is_around_the_earth;
use crs::system::Crs;
use crs::transform::between::CrsTransform;
use crs::transform::utm::{utm_zone, wgs84_zone};
use std::collections::HashSet;
use sys::{Error, Result};

/// A box that is wider or higher in degrees than a zone is wide may be so because of a few stray points.
const WIDE: f64 = 6.0;

/// Returns the UTM zone of the middle of the boxes of all sources. A few points far from all others of their file have no say.
///
/// # Errors
/// [`Error::Config`] if no box says where the points lie, or their datum has no such zone.
pub(crate) fn zone_of_middle(sources: &[Source], said: &[Crs], options: &InputOptions) -> Result<Crs> {
    let refuse = |why: &str| Error::Config(format!("[input] to_crs = \"utm\": {why}"));
    let mut places: Vec<[f64; 2]> = Vec::new();
    for (source, crs) in sources.iter().zip(said).filter(|(source, _)| source.records > 0) {
        let way = CrsTransform::to_degrees(crs).map_err(|why| no_way(source, &why))?;
        let Some(claimed) = source.claimed_rectangle() else { continue };
        let claimed = places_within(claimed, &way);
        let most = if is_wide(&claimed) { source.rectangle_of_most()? } else { None };
        if most.is_none() && is_around_the_earth(source, crs) {
            return Err(refuse(&format!(
                "the longitudes of {} reach from {} to {}, around more than half of the earth, so the middle of its box is meaningless: \
                 its \
                 points may lie on both sides of the date line, or one of them is a mistake; name the zone, such as \"EPSG:32601\"",
                source.path.display(),
                source.min[0],
                source.max[0]
            )));
        }
        places.extend(most.map_or(claimed, |most| places_within(most, &way)));
    }
    let middle = middle(&mut places)
        .ok_or_else(|| refuse("no header gives the position of the points; name the zone, such as \"EPSG:32615\""))?;
    let mut known = HashSet::new();
    let distinct = said.iter().filter(|crs| known.insert(format!("{crs:?}")));
    let (mut codes, mut zone) = (HashSet::new(), None);
    for crs in distinct {
        let found = utm_zone(crs, middle, options.datums).map_err(|why| refuse(&why))?;
        codes.insert(found.epsg);
        zone = Some(found);
    }
    // Of several datums none comes first.
    let zone = if codes.len() > 1 { wgs84_zone(middle) } else { zone };
    zone.ok_or_else(|| refuse("there are no inputs"))
}

/// Returns nine places of a rectangle in degrees, without those that are no place on earth.
fn places_within([min, max]: [[f64; 2]; 2], way: &CrsTransform) -> Vec<[f64; 2]> {
    let share = |i: usize, axis: usize| min[axis] + (max[axis] - min[axis]) * 0.5 * i as f64;
    (0..9).filter_map(|i| way.apply([share(i % 3, 0), share(i / 3, 1)])).collect()
}

/// Returns whether places of a rectangle reach over more than a zone, or some of them are no place on earth.
fn is_wide(places: &[[f64; 2]]) -> bool {
    let size = |axis: usize| ends(places, axis)[1] - ends(places, axis)[0];
    places.len() < 9 || size(0) > WIDE || size(1) > WIDE
}

/// Returns the least and the greatest degree of places on an axis.
fn ends(places: &[[f64; 2]], axis: usize) -> [f64; 2] {
    let values = || places.iter().map(|place| place[axis]);
    [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
}

/// Returns the middle of the box of places in degrees. One that would be wider than half a turn lies across the date line.
fn middle(places: &mut [[f64; 2]]) -> Option<[f64; 2]> {
    let [west, east] = ends(places, 0);
    if east - west > 180.0 {
        places.iter_mut().filter(|place| place[0] < 0.0).for_each(|place| place[0] += 360.0);
    }
    let middle = [0, 1].map(|axis| ends(places, axis)).map(|[low, high]| (low + high) / 2.0);
    (!places.is_empty()).then_some(middle)
}
