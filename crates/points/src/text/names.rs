//! What the names of columns say together.

use crate::text::delimiter::CANDIDATES;
use crate::text::name::{NAMES, Name, unit_alone};
use crate::text::role::ColumnRole;
use crate::text::units::{TextUnit, TextUnits, UnitsOfAxes};

/// What is wrong with the names of columns.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NamesError {
    #[error("names {count} columns {name}")]
    Repeated { count: usize, name: &'static str },
    #[error("names no column {0}")]
    Missing(&'static str),
}

/// What the names of columns say.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NamedColumns {
    /// What each column holds, up to the last column that is used.
    pub(crate) roles: Vec<ColumnRole>,
    /// The number of names.
    pub(crate) count: usize,
    /// Whether x and y are named as longitude and latitude.
    pub(crate) degrees: bool,
    /// Whether x and y are named by these letters alone, which are northing and easting in some countries.
    pub(crate) letters: bool,
    /// What is in brackets after the names of x, y and z, and neither a unit that is known nor a name.
    pub(crate) unknown_units: Vec<String>,
    /// What is known of their units.
    units: TextUnits,
}

impl NamedColumns {
    /// Returns the column of the axis.
    pub(crate) fn place(&self, axis: usize) -> Option<usize> {
        self.roles.iter().position(|role| *role == ColumnRole::Coordinate(axis))
    }

    /// Returns what the names say about units.
    ///
    /// # Errors
    /// A sentence, if they contradict each other.
    pub(crate) fn units(&self) -> Result<UnitsOfAxes, String> {
        self.units.of_axes()
    }

    /// Takes the units of a line below the names into account, if it is one.
    ///
    /// # Errors
    /// A sentence, if the names say other units.
    pub(crate) fn add_units(&mut self, fields: &[&[u8]]) -> Result<(), String> {
        self.units.add_line(self.units_in(fields))
    }

    /// Takes the units of a comment below the names into account, if it says those of x, y and z and is no sentence.
    ///
    /// # Errors
    /// A sentence, if the names say other units.
    pub(crate) fn add_units_of_comment(&mut self, text: &[u8]) -> Result<(), String> {
        let lines = CANDIDATES.map(|delimiter| self.units_in(&delimiter.fields(text)));
        lines.into_iter().filter(|line| line.iter().all(Option::is_some)).try_for_each(|line| self.units.add_line(line))
    }

    fn units_in(&self, fields: &[&[u8]]) -> [Option<TextUnit>; 3] {
        [0, 1, 2].map(|axis| unit_alone(fields.get(self.place(axis)?)?))
    }

    /// Takes the units of a line of the header into account where the names, which are the user's, state none: those in brackets after
    /// other names of the same columns, and those of a line of units. A line with another number of columns than `row` names others.
    pub(crate) fn add_units_beside(&mut self, line: &[u8], row: &[u8]) {
        for delimiter in CANDIDATES {
            let fields = delimiter.fields(line);
            if fields.len() != delimiter.fields(row).len() {
                continue;
            }
            let field = |axis: usize| fields.get(self.place(axis)?).copied();
            let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(field) else { continue };
            let beside = [x, y, z].map(|field| Name::read(field).unit());
            let alone = [x, y, z].map(unit_alone);
            let found = if alone[0].is_some() && alone[1].is_some() { alone } else { beside };
            self.units.complete(found);
        }
    }
}

/// Returns what columns with these names hold.
pub(crate) fn named_columns<'a>(
    names: impl Iterator<Item = &'a [u8]>,
) -> std::result::Result<NamedColumns, NamesError> {
    let mut names: Vec<Name> = names.map(Name::read).collect();
    while names.last().is_some_and(|name| name.plain.is_empty()) {
        names.pop();
    }
    let mut roles = vec![ColumnRole::Skipped; names.len()];
    let mut places = [None; 3];
    for (known, role) in NAMES {
        let best = names.iter().filter_map(Name::role).filter(|found| found.1 == role).map(|found| found.0).min();
        let same = |name: &Name| best.is_some() && name.role() == best.map(|rank| (rank, role));
        match (names.iter().filter(|name| same(name)).count(), role) {
            (0, ColumnRole::Coordinate(_)) => return Err(NamesError::Missing(known[0][0])),
            (0, _) => continue,
            // Most jobs read none of these. Two of them are no reason to refuse the file, and the first is taken.
            (1, _) | (_, ColumnRole::Intensity | ColumnRole::ReturnNumber | ColumnRole::Returns) => {}
            (count, _) => return Err(NamesError::Repeated { count, name: known[0][0] }),
        }
        let place = names.iter().position(same);
        if let (ColumnRole::Coordinate(axis), Some(place)) = (role, place) {
            places[axis] = Some(&names[place]);
        }
        place.into_iter().for_each(|place| roles[place] = role);
    }
    drop_partial_color(&mut roles);
    truncate(&mut roles);
    let degree = |axis: usize| places[axis].is_some_and(|name| name.is_degrees(axis));
    let units = TextUnits(places.map(|name| name.and_then(Name::unit)));
    let mut unknown_units: Vec<String> = places.into_iter().flatten().filter_map(Name::unknown_unit).collect();
    unknown_units.dedup();
    let letters = places[..2].iter().flatten().all(|name| name.is_letter_alone());
    Ok(NamedColumns { roles, count: names.len(), degrees: degree(0) && degree(1), letters, unknown_units, units })
}

/// Returns how many of x, y and z the names name.
pub(crate) fn coordinates<'a>(names: impl Iterator<Item = &'a [u8]>) -> usize {
    let roles: Vec<ColumnRole> = names.filter_map(|name| Some(Name::read(name).role()?.1)).collect();
    (0..3).filter(|axis| roles.contains(&ColumnRole::Coordinate(*axis))).count()
}

/// Removes the columns after the last one that is used.
pub(crate) fn truncate(roles: &mut Vec<ColumnRole>) {
    let used = roles.iter().rposition(|role| *role != ColumnRole::Skipped).map_or(0, |last| last + 1);
    roles.truncate(used);
}

/// Skips the columns of colours unless red, green and blue are all there.
fn drop_partial_color(roles: &mut [ColumnRole]) {
    if !(0..3).all(|channel| roles.contains(&ColumnRole::Color(channel))) {
        for role in roles.iter_mut().filter(|role| matches!(role, ColumnRole::Color(_))) {
            *role = ColumnRole::Skipped;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::unit::Unit;

    fn coordinates(line: &str) -> Option<[usize; 3]> {
        let named = named_columns(line.split(';').map(str::as_bytes)).ok()?;
        let place = |axis| named.roles.iter().position(|role| *role == ColumnRole::Coordinate(axis));
        Some([place(0)?, place(1)?, place(2)?])
    }

    #[test]
    fn names_of_many_kinds_are_known() {
        for line in [
            "POINT_X;POINT_Y;POINT_Z",
            "X [m];Y [m];Z [m]",
            "x(m);y(m);z(m)",
            "Rechtswert;Hochwert;Höhe",
            "East;North;Height",
            "X_Coord;Y_Coord;Elev.",
            "E;N;H",
            "Ost;Nord;Hoehe",
            "este;norte;cota",
            "Easting;Northing;RL",
            "Easting;Northing;Reduced Level (m)",
            "Easting (m);Northing (m);Elevation (m)",
        ] {
            assert_eq!(coordinates(line), Some([0, 1, 2]), "{line}");
        }
    }

    #[test]
    fn a_direction_in_brackets_after_a_letter_is_followed() {
        for line in [
            "X (Northing);Y (Easting);Z",
            "X [north];Y [east];Z [m]",
            "X (Hochwert, m);Y (Rechtswert, m);Z",
            "POINT_X (N);POINT_Y (E);Z",
            "Northing (X);Easting (Y);Height",
        ] {
            assert_eq!(coordinates(line), Some([1, 0, 2]), "{line}");
        }
        for line in [
            "X (Easting);Y (Northing);Z",
            "Easting (m);Northing (m);Z",
            "X (m);Y (m);Z (Height)",
            "Easting (X);Northing (Y);Z",
        ] {
            assert_eq!(coordinates(line), Some([0, 1, 2]), "{line}");
        }
        assert_eq!(coordinates("X (Northing);Y;Z"), None);
        let named = |line: &str| named_columns(line.split(';').map(str::as_bytes)).unwrap();
        assert!(named("X (Northing, ft);Y (Easting, ft);Z").units().unwrap().some_foot);
        assert_eq!(named("X (Easting);Y [m];Z (H)").unknown_units, [""; 0]);
        assert_eq!(named("X (Easting);Y [m];Z (ellipsoidal height)").unknown_units, [""; 0]);
        assert_eq!(named("x (local);y (local);z [NAVD88]").unknown_units, ["local"]);
        assert_eq!(named("X (Easting / rod);Y [Northing (rod)];Z (m.s.l.)").unknown_units, ["rod"]);
    }

    #[test]
    fn all_brackets_of_a_name_are_read() {
        let named = |line: &str| named_columns(line.split(';').map(str::as_bytes)).unwrap();
        for line in [
            "X (Northing) [m];Y (Easting) [m];Z [m]",
            "X [m] (Hochwert);Y [m] (Rechtswert);Z {m}",
            "X [Northing (m)];Y [Easting (m)];Z [Height (m)]",
            "X (N, m);Y (E, m);Z (H, m)",
        ] {
            assert_eq!(coordinates(line), Some([1, 0, 2]), "{line}");
            assert_eq!(named(line).units().unwrap().horizontal, Unit::Metre, "{line}");
            assert_eq!(named(line).units().unwrap().vertical, Some(1.0), "{line}");
        }
        for line in [
            "Easting (X) [ft];Northing (Y) [ft];Z [ft]",
            "X [Easting (ft)];Y [Northing (ft)];Z [Height (ft)]",
            "X (Easting in feet);Y (Northing in feet);Z (in ft)",
            "X (Easting ft);Y (Northing ft);Z (ft NAVD88)",
            "X (Easting / ft);Y (Northing / ft);Z (Height / ft)",
        ] {
            assert_eq!(coordinates(line), Some([0, 1, 2]), "{line}");
            let found = named(line).units().unwrap();
            assert_eq!((found.horizontal, found.vertical), (Unit::Foot, Some(Unit::FOOT)), "{line}");
            assert_eq!(named(line).unknown_units, [""; 0], "{line}");
        }
        for line in ["X [ft (US)];Y [ft (US)];Z [ft (US)]", "X [ft US survey];Y [ft-US];Z (foot us)"] {
            assert_eq!(named(line).units().unwrap().horizontal, Unit::UsFoot, "{line}");
        }
    }

    #[test]
    fn of_several_names_the_clearest_is_taken() {
        assert_eq!(coordinates("lon;lat;easting;northing;height;z"), Some([2, 3, 5]));
        assert_eq!(coordinates("n;h;x;y;z"), Some([2, 3, 4]));
        assert_eq!(coordinates("x;x;y;z"), None);
    }

    #[test]
    fn degrees_and_units_are_seen() {
        let named = |line: &str| named_columns(line.split(';').map(str::as_bytes)).unwrap();
        assert!(named("longitude;latitude;height").degrees);
        assert!(!named("lon;lat;x;y;z").degrees && !named("x;lat;z").degrees);
        for line in [
            "X (lon);Y (lat);Z",
            "X (longitude);Y (latitude);Elevation",
            "x [Longitude];y [Latitude];z [m]",
            "x (lng);y (lat);z",
            "Easting (lon);Northing (lat);z",
            "X (lat);Y (lon);z",
            "x [Longitude WGS84];y [Latitude WGS84];z",
        ] {
            assert!(named(line).degrees, "{line}");
        }
        for line in ["x (degrees east);y (degrees north);z", "x (deg E);y (deg N);z"] {
            assert_eq!(named(line).units().unwrap().horizontal, Unit::Degree, "{line}");
        }
        let mut below = named("x;y;z");
        below.add_units(&[b"deg E", b"deg N", b"m"]).unwrap();
        assert_eq!(below.units().unwrap().horizontal, Unit::Degree);
        assert_eq!(named("X (GK, 3 degree zones);Y (GK);z").units().unwrap().horizontal, Unit::Unknown);
        assert!(named("x [ft];y [ft];z [ft]").units().unwrap().some_foot);
        assert!(!named("x [m];y [m];z [m]").units().unwrap().some_foot);
        let mut below = named("x;y;z");
        below.add_units(&[b"m", b"m", b"cm"]).unwrap();
        assert_eq!(below.units(), named("x [m];y [m];z [cm]").units());
        assert!(named("x [m];y [m];z [m]").add_units(&[b"mm", b"mm", b"mm"]).is_err());
        assert_eq!(named("x;y;z;;").count, 3);
    }
}
