//! The areas that systems are made for. A place far outside of that of its system is most often a mistake: exchanged coordinates, or the
//! wrong system.

use crate::area_of_projection::area_of_projection;
use crate::codes::{lines_of_areas, text_of_code};
use crate::datum::{Datum, Sameness};
use crate::form::CrsForm;
use crate::projection::Projection;
use crate::rectangle::Rectangle;
use crate::system::Crs;
use std::ops::RangeInclusive;

/// Degrees of longitude and latitude of a small area.
const SMALL: f64 = 15.0;

/// The area of use of a system: one or several rectangles of longitude and latitude in degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaOfUse {
    rectangles: Vec<Rectangle>,
    /// Whether no dataset states it: it is all that its projection is good for.
    is_estimated: bool,
}

impl AreaOfUse {
    /// Returns the area of a system by its EPSG code. That of a system without one, or whose text contradicts it, is that of all codes with
    /// the same datum and the same projection, or else what its projection is good for; a text that contradicts the unit of its code is wrong
    /// about the unit rather than about the place. Returns `None` if nothing is known of that.
    pub fn of(crs: &Crs) -> Option<AreaOfUse> {
        let code = crs.undisputed_code().or_else(|| crs.epsg.filter(|_| crs.difference_to_unit_of_code().is_some()));
        let by_code = code.map(|code| rectangles(&[code])).filter(|found| !found.is_empty());
        if let Some(rectangles) = by_code {
            return Some(AreaOfUse { rectangles, is_estimated: false });
        }
        let form = crs.form()?;
        let projection = form.projection()?;
        let by_form = rectangles(&codes_of_form(&form, projection));
        if !by_form.is_empty() {
            return Some(AreaOfUse { rectangles: by_form, is_estimated: false });
        }
        let meridian = form.datum().map_or(0.0, Datum::meridian);
        Some(AreaOfUse { rectangles: vec![area_of_projection(projection, meridian)?], is_estimated: true })
    }

    /// Returns how far a place in degrees lies outside: degrees of arc to the east or west, and to the north or south.
    pub fn beyond(&self, place: [f64; 2]) -> [f64; 2] {
        self.nearest(place).beyond(place)
    }

    /// Returns the part of the area that is nearest to a place, for a sentence.
    pub fn label(&self, place: [f64; 2]) -> String {
        let Rectangle { west, south, east, north } = self.nearest(place);
        let [west, south, east, north] = [west, south, east, north].map(|degrees| (degrees * 10.0).round() / 10.0);
        let estimated = if self.is_estimated { "estimated from its projection: " } else { "" };
        format!("{estimated}longitude {west} to {east}, latitude {south} to {north}")
    }

    /// Returns whether the part that is nearest to a place is that of a small country or of a zone of one: most changes of its coordinates lead
    /// out of it.
    pub fn is_small(&self, place: [f64; 2]) -> bool {
        let Rectangle { west, south, east, north } = self.nearest(place);
        (east - west).rem_euclid(360.0) <= SMALL && north - south <= SMALL
    }

    fn nearest(&self, place: [f64; 2]) -> Rectangle {
        let distance = |rectangle: &&Rectangle| arc(rectangle.beyond(place));
        let nearest = self.rectangles.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.copied().unwrap_or(Rectangle::EARTH)
    }
}

/// Returns the length of a way in degrees of arc by its parts to the east and to the north.
pub fn arc([across, along]: [f64; 2]) -> f64 {
    libm::hypot(across, along)
}

/// Returns the rectangles of the areas of `codes`.
fn rectangles(codes: &[u32]) -> Vec<Rectangle> {
    let is_meant = |list: &str| codes.iter().any(|code| runs(list).any(|run| run.contains(code)));
    lines_of_areas().filter(|(_, list)| is_meant(list)).filter_map(|(area, _)| Rectangle::read(area)).collect()
}

/// Returns the runs of codes of a list such as `2001,4601-4604`.
fn runs(list: &str) -> impl Iterator<Item = RangeInclusive<u32>> {
    list.split(',').filter_map(|run| {
        let (first, last) = run.split_once('-').unwrap_or((run, run));
        Some(first.parse().ok()?..=last.parse().ok()?)
    })
}

/// Returns the codes of the systems that have the datum and the projection of `form`, in any unit. On another datum, the same projection
/// may be that of another country.
fn codes_of_form(form: &CrsForm, projection: &Projection) -> Vec<u32> {
    // Reading all texts takes a while; most show at a glance that their origin is elsewhere.
    let meridian = (projection.value("lon_0") * 1e6).round() / 1e6;
    let meridian = format!("\",{}", meridian.trunc());
    let is_same = |other: CrsForm| form.differences(&other).is_empty() && form.sameness(&other) == Sameness::Known;
    let has_it = |text: &str| text.contains(&meridian) && CrsForm::of_text(text).is_some_and(is_same);
    (1..=u32::from(u16::MAX)).filter(|code| text_of_code(*code).is_some_and(has_it)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::from_wkt::{from_epsg, parse};
    use std::collections::HashSet;

    #[test]
    fn the_areas_of_codes_lie_within_what_their_projections_are_good_for() {
        // The sign of the longitude is wrong in three old ones; one cone serves the coast of Antarctica far around its pole.
        const ODD: [u32; 4] = [2155, 2156, 3033, 6141];
        let mut judged = 0;
        let areas = lines_of_areas().flat_map(|(area, list)| runs(list).flatten().map(move |code| (area, code)));
        for (area, code) in areas {
            let Some(form) = CrsForm::of_code(code) else { continue };
            let meridian = form.datum().map_or(0.0, Datum::meridian);
            let estimated = form.projection().and_then(|projection| area_of_projection(projection, meridian));
            let (Some(estimated), Some(known)) = (estimated, Rectangle::read(area)) else { continue };
            let corners = [[known.west, known.south], [known.east, known.north]];
            let beyond = corners.map(|corner| arc(estimated.beyond(corner)));
            let is_near = beyond.iter().all(|degrees| *degrees < 3.0);
            assert!(is_near || ODD.contains(&code), "EPSG:{code} {beyond:?} {known:?} {estimated:?}");
            judged += 1;
        }
        assert!(judged > 4_000, "{judged}");
    }

    fn beyond(code: u32, place: [f64; 2]) -> f64 {
        arc(AreaOfUse::of(&from_epsg(code).unwrap()).unwrap().beyond(place))
    }

    #[test]
    fn every_line_of_the_table_is_read_and_every_known_code_has_an_area() {
        for (area, list) in lines_of_areas() {
            let Rectangle { west, south, east, north } = Rectangle::read(area).unwrap();
            assert!(south < north && west != east, "{area}");
            assert!([west, east].iter().all(|degrees| degrees.abs() <= 180.0), "{area}");
            assert_eq!(runs(list).count(), list.split(',').count(), "{list}");
        }
        let known: HashSet<u32> = lines_of_areas().flat_map(|(_, list)| runs(list).flatten()).collect();
        let is_plane = |text: &str| text.starts_with("PROJCS") || text.starts_with("GEOGCS");
        let codes = (1..=32_767u32).filter(|code| text_of_code(*code).is_some_and(is_plane));
        // The dataset says none of some old ones.
        let without: Vec<u32> = codes.filter(|code| !known.contains(code)).collect();
        assert!(known.len() > 6_000 && without.len() < 20, "{without:?}");
    }

    #[test]
    fn places_are_within_the_area_or_some_degrees_of_arc_beyond() {
        assert_eq!(beyond(25832, [9.0, 50.0]), 0.0);
        assert_eq!(beyond(25832, [9.0, 4.53]), 32.0);
        assert!((beyond(25832, [18.01, 60.0]) - 3.0).abs() < 1e-9);
        assert_eq!(beyond(4326, [-180.0, 90.0]), 0.0);
        // Fiji's area is on both sides of the date line.
        assert_eq!((beyond(3460, [179.9, -17.0]), beyond(3460, [-179.9, -17.0])), (0.0, 0.0));
        assert!(beyond(3460, [0.0, -17.0]) > 100.0);
    }

    #[test]
    fn a_text_without_a_code_has_the_area_of_its_datum_and_projection() {
        let esri = r#"PROJCS["NAD_1983_UTM_Zone_15N",GEOGCS["GCS_North_American_1983",DATUM["D_North_American_1983",
            SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],
            PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],
            PARAMETER["Central_Meridian",-93.0],PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0],
            UNIT["Meter",1.0]]"#;
        let area = AreaOfUse::of(&parse(esri).unwrap()).unwrap();
        assert_eq!((area.beyond([-93.0, 45.0]), area.beyond([-93.0, 25.0])[1] > 0.5), ([0.0; 2], true));
        // That of a site is its own, and the same projection on a datum of another country is of no use.
        let site = esri.replace("-93.0", "-93.4321");
        let elsewhere = esri.replace("North_American_1983", "European_1950").replace("D_European", "D_European_Datum");
        for (text, east) in [(site, -80.0), (elsewhere, -80.0)] {
            let area = AreaOfUse::of(&parse(&text).unwrap()).unwrap();
            assert!(area.is_estimated && area.beyond([-93.0, 25.0]) == [0.0; 2], "{area:?}");
            assert!(area.beyond([east, 25.0])[0] > 0.5, "{area:?}");
        }
        // A text that contradicts its code.
        let text = text_of_code(26915).unwrap().replace("\"central_meridian\",-93", "\"central_meridian\",-99");
        let other = parse(&text).unwrap();
        assert_eq!(other.epsg, Some(26915));
        assert_eq!(AreaOfUse::of(&other).unwrap().beyond([-99.0, 45.0]), [0.0; 2]);
    }
}
