//! The way of places on a map to the longitude and latitude of WGS 84, where the globes of viewers lie, and back.
//!
//! A datum that is some metres off comes with a shift, from the definition of the system in the form of PROJ.4. All shifts of this program
//! are seven numbers (EPSG method 9606, position vector): earth-centred coordinates are moved, turned and scaled.

use crate::system::Crs;
use crate::transform::between::CrsTransform;
use crate::transform::ellipsoid::{Ellipsoid, WGS84, sin_cos};
use crate::transform::map_projection::DEGREE;
use std::f64::consts::PI;

/// The squares of eccentricities that differ by less are those of one ellipsoid, as for PROJ: that of WGS 84 and GRS 80.
const SAME_SHAPE: f64 = 5e-11;

/// Radians of a second of arc.
const SECOND: f64 = DEGREE / 3600.0;

/// Each round finds two digits more of the latitude.
const ROUNDS: usize = 9;

/// Each round of the way back through a shift finds four digits more: a shift moves places by a ten-thousandth of a radian at most.
const ROUNDS_BACK: usize = 5;

/// The shifts to WGS 84 of datums that PROJ has names for: metres, seconds of arc, millionths.
const NAMED: [(&str, [f64; 7]); 9] = [
    ("WGS84", [0.0; 7]),
    ("NAD83", [0.0; 7]),
    ("GGRS87", [-199.87, 74.79, 246.62, 0.0, 0.0, 0.0, 0.0]),
    ("potsdam", [598.1, 73.7, 418.2, 0.202, 0.045, -2.455, 6.7]),
    ("carthage", [-263.0, 6.0, 431.0, 0.0, 0.0, 0.0, 0.0]),
    ("hermannskogel", [577.326, 90.129, 463.919, 5.137, 1.474, 5.297, 2.4232]),
    ("ire65", [482.53, -130.596, 564.557, -1.042, -0.214, -0.631, 8.15]),
    ("nzgd49", [59.47, -5.04, 187.44, 0.47, -0.1, 1.024, -4.5993]),
    ("OSGB36", [446.448, -125.157, 542.06, 0.1502, 0.247, 0.8421, -20.4894]),
];

/// The prime meridians that PROJ has names for, in degrees.
const MERIDIANS: [(&str, f64); 13] = [
    ("greenwich", 0.0),
    ("lisbon", -9.131_906_111),
    ("paris", 2.337_229_167),
    ("bogota", -74.080_916_667),
    ("madrid", -3.687_938_889),
    ("rome", 12.452_333_333),
    ("bern", 7.439_583_333),
    ("jakarta", 106.807_719_444),
    ("ferro", -17.666_666_667),
    ("brussels", 4.367_975),
    ("stockholm", 18.058_277_778),
    ("athens", 23.716_337_5),
    ("oslo", 10.722_916_667),
];

/// A tenth of a metre, in degrees. A meridian in another unit is kilometres off.
const SAME_MERIDIAN: f64 = 1e-6;

/// What to do with points in a system that is not computed.
const ELSEWHERE: &str =
    "transform the points to another CRS first, such as a UTM zone, with the filter `reprojection` of `pdal translate`";

/// The way to the longitude and latitude of WGS 84. The same bits come out on every machine.
#[derive(Clone, Debug)]
pub struct GlobeWay {
    to_degrees: CrsTransform,
    from_degrees: CrsTransform,
    /// Units of the system in a unit of x and y.
    scale: f64,
    /// Nothing where longitude and latitude are those of WGS 84 already.
    shift: Option<Shift>,
}

impl GlobeWay {
    /// Returns the way from `crs`, whose `definition` in the form of PROJ.4 says what its datum is to WGS 84. Coordinates are in units of
    /// `metres`.
    ///
    /// # Errors
    /// A sentence if gdt-batch does not support it.
    pub fn of(crs: &Crs, definition: &str, metres: f64) -> Result<GlobeWay, String> {
        let to_degrees = CrsTransform::to_degrees(crs).map_err(|why| format!("{why} ({ELSEWHERE})"))?;
        let form = crs.form().filter(|form| form.projection().is_some());
        let (form, own) = form.zip(crs.metres_per_unit()).ok_or("it is not a projected system")?;
        let datum = form.datum().ok_or_else(|| format!("{} does not state its datum", crs.label()))?;
        if meridian(definition).is_none_or(|east| (east - datum.meridian()).abs() > SAME_MERIDIAN) {
            return Err(format!("{} and {definition} differ in the prime meridian ({ELSEWHERE})", crs.label()));
        }
        let ellipsoid = datum.ellipsoid().and_then(Ellipsoid::of);
        let ellipsoid = ellipsoid.ok_or_else(|| format!("{} has no ellipsoid", crs.label()))?;
        let from_degrees = to_degrees.clone().reversed();
        Ok(GlobeWay { to_degrees, from_degrees, scale: metres / own, shift: Shift::of(definition, ellipsoid)? })
    }

    /// Returns longitude and latitude in radians; `None` if the map has no such place.
    pub fn geographic(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let place = self.to_degrees.apply(place.map(|value| value * self.scale))?.map(|degrees| degrees * DEGREE);
        let [longitude, latitude] = self.shift.as_ref().map_or(place, |shift| shift.apply(place));
        Some([within_half_a_turn(longitude), latitude])
    }

    /// Returns x and y of a place by longitude and latitude in radians; `None` if the map has no such place.
    pub fn place(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let own = self.shift.as_ref().map_or(place, |shift| shift.undone(place));
        let place = self.from_degrees.apply(own.map(|radians| radians / DEGREE))?;
        Some(place.map(|value| value / self.scale))
    }
}

/// Returns an angle of less than a turn and a half as one of half a turn at most, in radians.
fn within_half_a_turn(angle: f64) -> f64 {
    if angle > PI {
        angle - 2.0 * PI
    } else if angle < -PI {
        angle + 2.0 * PI
    } else {
        angle
    }
}

/// A shift of earth-centred coordinates to those of WGS 84.
#[derive(Clone, Debug)]
struct Shift {
    from: Ellipsoid,
    to: Ellipsoid,
    metres: [f64; 3],
    /// Radians.
    turns: [f64; 3],
    scale: f64,
}

impl Shift {
    /// Returns the shift that a definition names, if it names one.
    ///
    /// # Errors
    /// A sentence if it is not known here. A datum such as NAD27 leads to WGS 84 by a grid alone.
    fn of(definition: &str, from: Ellipsoid) -> Result<Option<Shift>, String> {
        let value = |key: &str| value(definition, key);
        let numbers = match (value("+nadgrids"), value("+towgs84"), value("+datum")) {
            (Some("@null"), ..) | (None, None, None) => return Ok(None),
            (None, Some(list), _) => seven(list).ok_or_else(|| format!("the shift in {definition} cannot be read"))?,
            (grids, _, name) => {
                let known = NAMED.iter().find(|(known, _)| grids.is_none() && Some(*known) == name);
                known.map(|(_, numbers)| *numbers).ok_or_else(|| needs_grid(definition))?
            }
        };
        let to = Ellipsoid::of(WGS84).ok_or("WGS 84 has no ellipsoid")?;
        if numbers == [0.0; 7] && from.a == to.a && (from.e2 - to.e2).abs() < SAME_SHAPE {
            return Ok(None);
        }
        let [x, y, z, turn_x, turn_y, turn_z, millionths] = numbers;
        let turns = [turn_x, turn_y, turn_z].map(|seconds| seconds * SECOND);
        Ok(Some(Shift { from, to, metres: [x, y, z], turns, scale: 1.0 + millionths / 1e6 }))
    }

    fn apply(&self, [longitude, latitude]: [f64; 2]) -> [f64; 2] {
        let ([sin, cos], [east, north]) = (sin_cos(latitude), sin_cos(longitude));
        let normal = self.from.a / (1.0 - self.from.e2 * sin * sin).sqrt();
        let [x, y, z] = [normal * cos * north, normal * cos * east, normal * (1.0 - self.from.e2) * sin];
        let [turn_x, turn_y, turn_z] = self.turns;
        let turned = [x - turn_z * y + turn_y * z, turn_z * x + y - turn_x * z, z - turn_y * x + turn_x * y];
        let [x, y, z] = [0, 1, 2].map(|k| self.metres[k] + self.scale * turned[k]);
        [libm::atan2(y, x), self.latitude((x * x + y * y).sqrt(), z)]
    }

    /// Returns the place that [`Shift::apply`] leads to `place`.
    fn undone(&self, place: [f64; 2]) -> [f64; 2] {
        (0..ROUNDS_BACK).fold(place, |guess, _| {
            let [longitude, latitude] = self.apply(guess);
            [guess[0] + within_half_a_turn(place[0] - longitude), guess[1] + (place[1] - latitude)]
        })
    }

    /// Returns the latitude of a place by its distances from the axis and from the plane of the equator.
    fn latitude(&self, across: f64, up: f64) -> f64 {
        let Ellipsoid { a, e2, .. } = self.to;
        let first = libm::atan2(up, across * (1.0 - e2));
        (0..ROUNDS).fold(first, |latitude, _| {
            let sin = libm::sin(latitude);
            libm::atan2(up + e2 * sin * a / (1.0 - e2 * sin * sin).sqrt(), across)
        })
    }
}

/// Returns the value of a key of a definition.
fn value<'a>(definition: &'a str, key: &str) -> Option<&'a str> {
    definition.split_whitespace().find_map(|word| word.strip_prefix(key)?.strip_prefix('='))
}

/// Returns the prime meridian of a definition in degrees; `None` if it is not known here.
fn meridian(definition: &str) -> Option<f64> {
    let Some(name) = value(definition, "+pm") else { return Some(0.0) };
    let named = MERIDIANS.iter().find(|(known, _)| *known == name).map(|(_, east)| *east);
    named.or_else(|| name.parse().ok())
}

fn needs_grid(definition: &str) -> String {
    format!(
        "the datum shift from {definition} to WGS 84 needs a grid, which gdt-batch does not have (transform the points to a datum \
         such as NAD83 first)"
    )
}

/// Returns three or seven numbers as seven.
fn seven(list: &str) -> Option<[f64; 7]> {
    let given = list.split(',').map(|number| number.trim().parse().ok()).collect::<Option<Vec<f64>>>()?;
    let mut numbers = [0.0; 7];
    match given.len() {
        3 | 7 => numbers[..given.len()].copy_from_slice(&given),
        _ => return None,
    }
    Some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::from_wkt::from_epsg;
    use crate::system::CrsKind;
    use proj4rs::{Proj, transform::transform};
    use std::collections::BTreeMap;

    fn way(code: u32) -> (GlobeWay, String) {
        let crs = from_epsg(code).unwrap();
        let (definition, metres) = (crs.proj4_definition().unwrap(), crs.metres_per_unit().unwrap());
        (GlobeWay::of(&crs, &definition, metres).unwrap_or_else(|why| panic!("EPSG:{code}: {why}")), definition)
    }

    /// Returns how far the way is off another library on places around `at`, in radians.
    fn off(code: u32, at: [f64; 2]) -> f64 {
        let (way, definition) = way(code);
        let [from, to] =
            [definition.as_str(), "+proj=longlat +datum=WGS84"].map(|d| Proj::from_proj_string(d).unwrap());
        let off = (0..100).map(|i| {
            let place = [at[0] + f64::from(i % 10) * 997.0, at[1] - f64::from(i / 10) * 1013.0];
            let mut theirs = (place[0], place[1], 0.0);
            transform(&from, &to, &mut theirs).unwrap();
            let [longitude, latitude] = way.geographic(place).unwrap();
            (longitude - theirs.0).abs().max((latitude - theirs.1).abs())
        });
        off.fold(0.0, f64::max)
    }

    #[test]
    fn places_are_those_of_another_library() {
        // With a shift of seven numbers, of three, of none, with one by name, on a sphere, and in feet.
        for (code, at) in [
            (27700, [530_000.0, 180_000.0]),
            (31467, [3_500_000.0, 5_500_000.0]),
            (31256, [0.0, 340_000.0]),
            (28992, [155_000.0, 463_000.0]),
            (2039, [219_529.0, 626_907.0]),
            (2277, [2_300_000.0, 10_000_000.0]),
            (2154, [700_000.0, 6_600_000.0]),
            (3035, [4_321_000.0, 3_210_000.0]),
            (3857, [1_500_000.0, 6_000_000.0]),
            (32733, [500_000.0, 6_200_000.0]),
            (3413, [100_000.0, -1_500_000.0]),
            (2100, [500_000.0, 4_200_000.0]),
        ] {
            let off = off(code, at);
            // A hundredth of a millimetre.
            assert!(off < 1.5e-12, "EPSG:{code}: {off} radians");
        }
    }

    #[test]
    fn oblique_and_other_maps_are_those_of_another_library() {
        for (code, at) in [
            (2056, [2_683_000.0, 1_247_000.0]),
            (21781, [683_000.0, 247_000.0]),
            (21780, [85_000.0, 47_000.0]),
            (23700, [650_000.0, 239_000.0]),
            (5514, [-743_000.0, -1_043_000.0]),
            (5221, [-743_000.0, -1_043_000.0]),
            (8353, [-600_000.0, -1_280_000.0]),
            (3375, [743_000.0, 348_000.0]),
            (3376, [590_000.0, 553_000.0]),
            (29873, [590_000.0, 553_000.0]),
            (26931, [775_000.0, 720_000.0]),
            (3078, [620_000.0, 280_000.0]),
            (3068, [24_000.0, 20_000.0]),
            (30200, [66_000.0, 82_000.0]),
            (3378, [-4_000.0, -2_000.0]),
            (5880, [5_754_000.0, 7_395_000.0]),
            (6933, [1_157_000.0, 5_172_000.0]),
            (2053, [80_000.0, 2_843_000.0]),
            (31253, [0.0, 340_000.0]),
            (20790, [110_000.0, 190_000.0]),
            (27393, [-1_000.0, 211_000.0]),
            (21100, [3_500_000.0, 210_000.0]),
        ] {
            let off = off(code, at);
            assert!(off < 1e-11, "EPSG:{code}: {off} radians");
        }
        // The text has the meridian of Paris to a third of a millimetre.
        for (code, at) in [(27572, [600_000.0, 2_427_000.0]), (29702, [513_000.0, 799_000.0])] {
            let off = off(code, at);
            assert!(off < 7e-11, "EPSG:{code}: {off} radians");
        }
    }

    #[test]
    fn the_way_back_leads_to_the_same_place() {
        for (code, at) in [
            (27700, [530_000.0, 180_000.0]),
            (31467, [3_500_000.0, 5_500_000.0]),
            (28992, [155_000.0, 463_000.0]),
            (2277, [2_300_000.0, 10_000_000.0]),
            (3857, [1_500_000.0, 6_000_000.0]),
            (3413, [100_000.0, -1_500_000.0]),
            (2056, [2_683_000.0, 1_247_000.0]),
            (5514, [-743_000.0, -1_043_000.0]),
            (27572, [600_000.0, 2_427_000.0]),
            // Across the 180th meridian.
            (32660, [830_000.0, 100_000.0]),
        ] {
            let (way, _) = way(code);
            for i in 0..100 {
                let place = [at[0] + f64::from(i % 10) * 997.0, at[1] - f64::from(i / 10) * 1013.0];
                let back = way.place(way.geographic(place).unwrap()).unwrap();
                let off = (back[0] - place[0]).abs().max((back[1] - place[1]).abs());
                assert!(off < 2e-6, "EPSG:{code}: {off}");
            }
        }
    }

    #[test]
    fn the_bits_are_those_of_every_machine() {
        let bits = [
            (27700, [530_000.0, 180_000.0]),
            (2277, [2_300_000.0, 10_000_000.0]),
            (2056, [2_683_000.0, 1_247_000.0]),
            (5514, [-743_000.0, -1_043_000.0]),
            (27572, [600_000.0, 2_427_000.0]),
        ]
        .map(|(code, place)| way(code).0.geographic(place).unwrap().map(f64::to_bits));
        let expected = [
            [13_790_684_007_957_377_804, 4_606_271_919_018_445_997],
            [13_833_936_471_851_274_948, 4_602_907_052_258_766_745],
            [4_594_536_583_784_806_335, 4_605_621_815_907_048_335],
            [4_598_205_000_748_869_246, 4_606_049_227_011_466_186],
            [4_586_037_797_926_763_645, 4_605_853_339_240_275_558],
        ];
        assert_eq!(bits, expected);
    }

    /// Returns why there is no way.
    fn refused(code: u32, definition: &str) -> String {
        GlobeWay::of(&from_epsg(code).unwrap(), definition, 1.0).err().unwrap()
    }

    #[test]
    fn what_is_not_computed_is_refused_by_name() {
        let southings = refused(5513, "+proj=krovak +towgs84=0,0,0");
        assert!(southings.contains("S-JTSK / Krovak") && southings.contains("pdal translate"), "{southings}");
        assert!(refused(27200, "+proj=nzmg").contains("New_Zealand_Map_Grid"));
        let british = "+proj=tmerc +nadgrids=OSTN15.gsb";
        assert!(refused(27700, british).contains(&format!("the datum shift from {british} to WGS 84 needs a grid")));
        let old = refused(26715, "+proj=utm +zone=15 +datum=NAD27 +units=m +no_defs");
        assert!(old.contains("needs a grid") && old.contains("NAD27") && old.contains("NAD83"), "{old}");
        assert!(refused(27700, "+proj=tmerc +towgs84=1,2").contains("cannot be read"));
        assert!(refused(4326, "+proj=longlat").contains("not a projected system"));
        // Another meridian than that of the text.
        for meridian in ["paris", "2.5969213", "unknown"] {
            let definition = format!("+proj=tmerc +pm={meridian}");
            assert!(refused(27700, &definition).contains("differ in the prime meridian"), "{meridian}");
        }
        assert!(refused(27572, "+proj=lcc").contains("differ in the prime meridian"));
    }

    #[test]
    fn of_all_codes_these_are_not_computed() {
        let codes = (1..=u32::from(u16::MAX)).filter_map(from_epsg).filter(|crs| crs.kind == CrsKind::Projected);
        let mut reasons: BTreeMap<String, Vec<u32>> = BTreeMap::new();
        for crs in codes {
            let Some((definition, metres)) = crs.proj4_definition().zip(crs.metres_per_unit()) else { continue };
            let why = GlobeWay::of(&crs, &definition, metres).err().filter(|why| !why.contains("needs a grid"));
            if let Some(why) = why {
                let (_, reason) = why.split_once(": ").unwrap();
                let reason = reason.split_once(" (").map_or(reason, |(reason, _)| reason).to_string();
                reasons.entry(reason).or_default().push(crs.epsg.unwrap());
            }
        }
        let expected = [
            ("its projection is Equirectangular", &[3786, 4087, 4088, 32662, 32663][..]),
            ("its projection is New_Zealand_Map_Grid", &[27200]),
            ("its x grows to the west, or its y to the south", &[2065, 5513, 8352]),
            // Laborde's projection, and that of Belgium with a cone that is turned.
            ("the parameter alpha of its projection", &[8441]),
            ("the parameter lat_1 of its projection", &[31300]),
        ];
        assert_eq!(reasons, expected.map(|(reason, codes)| (reason.to_string(), codes.to_vec())).into());
    }
}
