//! The UTM zone in the middle of the data, for `to_crs = "utm"`.

use crate::input::crs::system::Crs;
use crate::input::crs::transform::between::CrsTransform;
use crate::input::crs::transform::utm::{utm_zone, wgs84_zone};
use crate::input::options::InputOptions;
use crate::input::said_crs::no_way;
use crate::input::source::Source;
use crate::input::transform_warnings::is_around_the_earth;
use crate::{Error, Result};
use std::collections::HashSet;

/// Returns the UTM zone of the middle of the boxes of all sources.
///
/// # Errors
/// [`Error::Config`] if no box says where the points lie, or their datum has no such zone.
pub(crate) fn zone_of_middle(sources: &[Source], said: &[Crs], options: &InputOptions) -> Result<Crs> {
    let refuse = |why: &str| Error::Config(format!("[input] to_crs = \"utm\": {why}"));
    let mut places: Vec<[f64; 2]> = Vec::new();
    for (source, crs) in sources.iter().zip(said) {
        let way = CrsTransform::to_degrees(crs).map_err(|why| no_way(source, &why))?;
        if is_around_the_earth(source, crs) {
            return Err(refuse(&format!(
                "the longitudes of {} reach from {} to {}, around more than half of the earth, so the middle of its box says nothing: its \
                 points may lie on both sides of the date line, or one of them is a mistake; name the zone, such as \"EPSG:32601\"",
                source.path.display(),
                source.min[0],
                source.max[0]
            )));
        }
        let Some([min, max]) = source.claimed_rectangle().filter(|_| source.records > 0) else { continue };
        let share = |i: usize, axis: usize| min[axis] + (max[axis] - min[axis]) * 0.5 * i as f64;
        places.extend((0..9).filter_map(|i| way.apply([share(i % 3, 0), share(i / 3, 1)])));
    }
    let middle = middle(&mut places)
        .ok_or_else(|| refuse("no header says where the points lie; name the zone, such as \"EPSG:32615\""))?;
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

/// Returns the middle of the box of places in degrees. One that would be wider than half a turn lies across the date line.
fn middle(places: &mut [[f64; 2]]) -> Option<[f64; 2]> {
    let ends = |places: &[[f64; 2]], axis: usize| {
        let values = || places.iter().map(|place| place[axis]);
        [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
    };
    let [west, east] = ends(places, 0);
    if east - west > 180.0 {
        places.iter_mut().filter(|place| place[0] < 0.0).for_each(|place| place[0] += 360.0);
    }
    let middle = [0, 1].map(|axis| ends(places, axis)).map(|[low, high]| (low + high) / 2.0);
    (!places.is_empty()).then_some(middle)
}
