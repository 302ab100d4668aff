//! What the user should know about points that are transformed.

use crate::options::InputOptions;
use crate::source::Source;
use crate::source_transform::OwnCoordinates;
use crs::choice::CrsChoice;
use crs::system::{Crs, CrsKind};
use crs::transform::between::{CrsTransform, DatumNote};
use crs::unit::Unit;
use rust_decimal::prelude::ToPrimitive;
use sys::{Warnings, of_inputs};

/// Metres of a degree of latitude, about.
const DEGREE: f64 = 111_200.0;

/// A map is true to scale if its metres are those of the ground to within this fraction.
const TRUE_TO_SCALE: f64 = 0.05;

/// Points whose own step is wider on the ground lie on a grid that shows, in metres.
const COARSE: f64 = 0.05;

/// Warns about sources that say something else than `[input] crs` does.
pub(crate) fn warn_of_overruled(sources: &[Source], said: &[Crs], options: &InputOptions, warnings: &mut Warnings) {
    if options.crs == CrsChoice::Auto {
        return;
    }
    let differences = |(source, crs): (&Source, &Crs)| crs.differences(&source.crs);
    let all = || sources.iter().zip(said);
    let others: Vec<_> = all().filter(|pair| !differences(*pair).is_empty()).collect();
    if let Some((first, crs)) = others.first() {
        warnings.push(format!(
            "{}[input] crs ({}) overrides its CRS: {} differs in {}; fix: leave [input] crs out, if the file is right",
            of_inputs(others.len(), sources.len(), &first.path),
            crs.label(),
            if first.crs.is_named() { first.crs.label() } else { "it".to_string() },
            crs.differences(&first.crs).join(" and ")
        ));
    }
}

/// Warns about texts whose columns say a length, though the user says that they are longitude and latitude.
pub(crate) fn warn_of_lengths(sources: &[Source], said: &[Crs], options: &InputOptions, warnings: &mut Warnings) {
    // What differs from `crs` has been said.
    if options.crs != CrsChoice::Auto {
        return;
    }
    let is_other = |source: &Source, crs: &Crs| {
        crs.kind == CrsKind::Geographic && !source.crs.is_named() && source.crs.metres_per_unit().is_some()
    };
    let others: Vec<_> = sources.iter().zip(said).filter(|(source, crs)| is_other(source, crs)).collect();
    if let Some((first, crs)) = others.first() {
        warnings.push(format!(
            "{}x and y are treated as longitude and latitude ({}), though the columns of {} name the unit {}",
            of_all(others.len(), sources.len()),
            crs.label(),
            first.path.display(),
            first.crs.horizontal.name()
        ));
    }
}

/// Warns about sources in degrees or in feet whose heights have no unit. Beside metres, heights are in metres.
pub(crate) fn warn_of_heights(sources: &[Source], said: &[Crs], warnings: &mut Warnings) {
    let silent = |is_meant: &dyn Fn(&Crs) -> bool| -> Vec<(&Source, &Crs)> {
        let is_silent = |crs: &Crs| crs.vertical.is_none() && is_meant(crs);
        sources.iter().zip(said).filter(|(_, crs)| is_silent(crs)).collect()
    };
    let in_feet = silent(&|crs| {
        crs.metres_per_unit().is_some() && crs.horizontal != Unit::Metre && !crs.has_ellipsoidal_heights()
    });
    if let Some((first, crs)) = in_feet.first() {
        warnings.push(format!(
            "{}its heights have no unit: the unit of its x and y ({}) is assumed; fix: [input] height_unit = \"metre\", \"foot\" or \"us-foot\"",
            of_inputs(in_feet.len(), sources.len(), &first.path),
            crs.horizontal.name()
        ));
    }
    let in_degrees = silent(&|crs| crs.metres_per_unit().is_none());
    if let Some((first, _)) = in_degrees.first() {
        warnings.push(format!(
            "{}its heights have no unit: metres assumed; fix: a CRS with a vertical part, such as [input] crs = \"EPSG:4269+6360\" for \
             US survey feet, if that is wrong",
            of_inputs(in_degrees.len(), sources.len(), &first.path)
        ));
    }
}

/// Warns about sources in degrees whose own step is wide on the ground.
pub(crate) fn warn_of_coarse_degrees(sources: &[Source], said: &[Crs], warnings: &mut Warnings) {
    let step = |source: &Source| source.own_coordinates().axes[0].scale.to_f64().unwrap_or(0.0) * DEGREE;
    let is_coarse =
        |source: &Source, crs: &Crs| source.records > 0 && crs.kind == CrsKind::Geographic && step(source) > COARSE;
    let coarse: Vec<&Source> =
        sources.iter().zip(said).filter(|(source, crs)| is_coarse(source, crs)).map(|pair| pair.0).collect();
    if let Some(first) = coarse.first() {
        warnings.push(format!(
            "{}the degrees of {} are rounded to {}, about {:.1} m on the ground",
            of_all(coarse.len(), sources.len()),
            first.path.display(),
            first.own_coordinates().axes[0].scale,
            step(first)
        ));
    }
}

/// Warns about datums that are taken for one, by what was done about the datums of each source.
pub(crate) fn warn_of_datums(sources: &[Source], notes: &[DatumNote], warnings: &mut Warnings) {
    let all = |is_meant: &dyn Fn(&DatumNote) -> Option<String>| -> Vec<(&Source, String)> {
        sources.iter().zip(notes).filter_map(|(source, note)| Some((source, is_meant(note)?))).collect()
    };
    let alike = all(&|note| if let DatumNote::TakenAlike(names) = note { Some(names.clone()) } else { None });
    if let Some((first, names)) = alike.first() {
        warnings.push(format!(
            "{}no datum shift between {names}, which may be a metre or two apart ([input] datums = \"close\")",
            of_inputs(alike.len(), sources.len(), &first.path)
        ));
    }
    let assumed = all(&|note| if let DatumNote::Assumed(names) = note { Some(names.clone()) } else { None });
    if let Some((first, names)) = assumed.first() {
        warnings.push(format!(
            "{}its datum is unknown, and {names} are assumed to be the same; fix: [input] crs, because two datums may be hundreds of \
             metres \
             apart",
            of_inputs(assumed.len(), sources.len(), &first.path)
        ));
    }
}

/// Warns about sources in degrees that go around half the earth or more, if the map is cut at the date line: then points on both sides of it
/// lie at both ends of the map.
pub(crate) fn warn_of_date_line(sources: &[Source], said: &[Crs], to: &Crs, warnings: &mut Warnings) {
    let meridian = to.form().and_then(|form| Some(form.projection()?.value("lon_0") + form.datum()?.meridian()));
    let is_cut_there = meridian.is_some_and(|meridian| meridian.abs() < 90.0);
    let wide: Vec<&Source> =
        sources.iter().zip(said).filter(|(source, crs)| is_around_the_earth(source, crs)).map(|pair| pair.0).collect();
    if let Some(first) = wide.first().filter(|_| is_cut_there) {
        warnings.push(format!(
            "{}the longitudes of {} span more than half of the earth: points on both sides of the date line lie at both ends of {}; \
             fix: [input] to_crs with a central meridian near them",
            of_all(wide.len(), sources.len()),
            first.path.display(),
            to.label()
        ));
    }
}

/// Returns whether the box of a source in degrees is wider than half of the earth.
pub(crate) fn is_around_the_earth(source: &Source, crs: &Crs) -> bool {
    let own = source.own_coordinates();
    source.records > 1 && crs.kind == CrsKind::Geographic && own.max[0] - own.min[0] > 180.0
}

/// Warns about a map whose metres are nowhere those of the ground, as in the Mercator projection of web maps far from the equator. One stray
/// row makes a box wide, but the others lie in it too.
pub(crate) fn warn_of_scale(sources: &[Source], to: &Crs, warnings: &mut Warnings) {
    let places: Vec<[f64; 2]> = sources.iter().filter(|source| source.records > 0).flat_map(places).collect();
    let scales: Vec<f64> = places.iter().filter_map(|place| ground_of_metre(to, *place)).collect();
    let is_true = |ground: &f64| (ground - 1.0).abs() <= TRUE_TO_SCALE;
    let Some(ground) = scales.get(scales.len() / 2).filter(|_| !scales.iter().any(is_true)) else { return };
    warnings.push(format!(
        "[input] to_crs ({}) distorts lengths here: a metre of it is about {ground:.2} m on the ground; fix: [input] to_crs = \"utm\"",
        to.label()
    ));
}

/// Returns the middle of the box of a source, its corners and the middles of its sides. Those of a box around the earth say nothing.
fn places(source: &Source) -> Vec<[f64; 2]> {
    let is_wide =
        |own: &OwnCoordinates, from: &Crs| from.kind == CrsKind::Geographic && own.max[0] - own.min[0] > 180.0;
    let is_around = source.transform().is_some_and(|transform| is_wide(&transform.own, &transform.from));
    let Some([min, max]) = source.claimed_rectangle().filter(|_| !is_around) else { return Vec::new() };
    let at = |i: usize, axis: usize| min[axis] + (max[axis] - min[axis]) * 0.5 * i as f64;
    (0..9).map(|i| [at(i % 3, 0), at(i / 3, 1)]).collect()
}

/// Returns how long a metre of a map is on the ground, about, from south to north at a place.
fn ground_of_metre(to: &Crs, [x, y]: [f64; 2]) -> Option<f64> {
    const HALF: f64 = 50.0;
    let way = CrsTransform::to_degrees(to).ok()?;
    let half = HALF / to.metres_per_unit()?;
    let (south, north) = (way.apply([x, y - half])?, way.apply([x, y + half])?);
    let cos = libm::cos(south[1].to_radians());
    let turn = (north[0] - south[0] + 540.0) % 360.0 - 180.0;
    Some(libm::hypot((north[1] - south[1]) * DEGREE, turn * DEGREE * cos) / (2.0 * HALF))
}

fn of_all(some: usize, all: usize) -> String {
    if all == 1 { String::new() } else { format!("{some} of {all} inputs: ") }
}
