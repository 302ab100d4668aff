//! The names that people give to columns.

use crate::input::text::delimiter::CANDIDATES;
use crate::input::text::role::ColumnRole;
use crate::input::text::units::{TextUnit, TextUnits, UnitsOfAxes};

/// The names of one role, the clearest first: if several columns have one, that with the clearest name is taken.
type Names = (&'static [&'static str], ColumnRole);

/// Names without case, blanks, points, hyphens and underscores, and without a unit in brackets.
const NAMES: [Names; 7] = [
    (
        &[
            "x",
            "pointx",
            "xcoord",
            "xcoordinate",
            "coordx",
            "coordinatex",
            "posx",
            "xm",
            "easting",
            "eastings",
            "east",
            "rechtswert",
            "ostwert",
            "utmx",
            "utme",
            "rechts",
            "rw",
            "e",
            "lon",
            "longitude",
            "long",
            "lng",
        ],
        ColumnRole::Coordinate(0),
    ),
    (
        &[
            "y",
            "pointy",
            "ycoord",
            "ycoordinate",
            "coordy",
            "coordinatey",
            "posy",
            "ym",
            "northing",
            "northings",
            "north",
            "hochwert",
            "nordwert",
            "utmy",
            "utmn",
            "hoch",
            "hw",
            "n",
            "lat",
            "latitude",
        ],
        ColumnRole::Coordinate(1),
    ),
    (
        &[
            "z",
            "pointz",
            "zcoord",
            "zcoordinate",
            "coordz",
            "coordinatez",
            "posz",
            "zm",
            "elevation",
            "elev",
            "height",
            "altitude",
            "alt",
            "ellipsoidalheight",
            "orthometricheight",
            "hoehe",
            "höhe",
            "h",
        ],
        ColumnRole::Coordinate(2),
    ),
    (&["r", "red"], ColumnRole::Color(0)),
    (&["g", "green"], ColumnRole::Color(1)),
    (&["b", "blue"], ColumnRole::Color(2)),
    (&["class", "classification"], ColumnRole::Class),
];

/// The names of longitude and latitude.
const DEGREES: [&[&str]; 2] = [&["lon", "longitude", "long", "lng"], &["lat", "latitude"]];

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
        let unit = |axis: usize| {
            let field = fields.get(self.place(axis)?)?;
            TextUnit::read(std::str::from_utf8(field).ok()?)
        };
        self.units.add_line([unit(0), unit(1), unit(2)])
    }

    /// Takes the units of a line of the header into account where the names, which are the user's, say none: those in brackets after
    /// other names of the same columns, and those of a line of units.
    pub(crate) fn add_units_beside(&mut self, line: &[u8]) {
        for delimiter in CANDIDATES {
            let fields = delimiter.fields(line);
            let field = |axis: usize| fields.get(self.place(axis)?).copied();
            let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(field) else { continue };
            let beside = [x, y, z].map(|field| Name::read(field).unit());
            let alone = [x, y, z].map(|field| TextUnit::read(&String::from_utf8_lossy(field)));
            let found = if alone[0].is_some() && alone[1].is_some() { alone } else { beside };
            self.units.complete(found);
        }
    }
}

/// A column's name.
struct Name {
    /// As [`NAMES`] has it.
    plain: String,
    /// What is in brackets after it.
    unit: String,
}

impl Name {
    fn read(text: &[u8]) -> Name {
        let text = String::from_utf8_lossy(text).trim().to_lowercase();
        let (name, unit) = match text.find(['[', '(', '{']) {
            Some(at) if at > 0 && text.ends_with([']', ')', '}']) => text.split_at(at),
            _ => (text.as_str(), ""),
        };
        Name { plain: plain(name), unit: unit.trim_matches(['[', ']', '(', ')', '{', '}', ' ']).to_string() }
    }

    /// Returns what the column holds, and how unclear the name is. In some countries x is the northing, and brackets say so.
    fn role(&self) -> Option<(usize, ColumnRole)> {
        let own = role_of(&self.plain)?;
        let is_letter = |name: &str| name.contains(['x', 'y']);
        let direction = self.words().find(|word| !is_letter(word) && is_on_map(role_of(word)));
        match direction {
            Some(direction) if is_letter(&self.plain) && is_on_map(Some(own)) => role_of(&direction),
            _ => Some(own),
        }
    }

    /// Returns all that is in brackets, and the words of it.
    fn words(&self) -> impl Iterator<Item = String> + use<'_> {
        let words = self.unit.split([' ', ',', ';', '/']).filter(|word| word.chars().count() > 1);
        std::iter::once(self.unit.as_str()).chain(words).map(plain)
    }

    fn unit(&self) -> Option<TextUnit> {
        self.unit.split([',', ';']).find_map(TextUnit::read)
    }

    fn has_unknown_unit(&self) -> bool {
        !self.unit.is_empty() && self.unit().is_none() && !self.words().any(|word| role_of(&word).is_some())
    }
}

/// Returns a name as [`NAMES`] has it.
fn plain(name: &str) -> String {
    name.chars().filter(|c| !matches!(c, ' ' | '\t' | '_' | '-' | '.')).collect()
}

fn role_of(name: &str) -> Option<(usize, ColumnRole)> {
    let rank = |names: &[&str]| names.iter().position(|known| *known == name);
    NAMES.iter().find_map(|(names, role)| Some((rank(names)?, *role)))
}

/// Returns whether it is x or y.
fn is_on_map(role: Option<(usize, ColumnRole)>) -> bool {
    matches!(role, Some((_, ColumnRole::Coordinate(0 | 1))))
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
            (0, ColumnRole::Coordinate(_)) => return Err(NamesError::Missing(known[0])),
            (0, _) => continue,
            (1, _) => {}
            (count, _) => return Err(NamesError::Repeated { count, name: known[0] }),
        }
        let place = names.iter().position(same);
        if let (ColumnRole::Coordinate(axis), Some(place)) = (role, place) {
            places[axis] = Some(&names[place]);
        }
        place.into_iter().for_each(|place| roles[place] = role);
    }
    drop_partial_color(&mut roles);
    truncate(&mut roles);
    let is = |axis: usize, test: &dyn Fn(&Name) -> bool| places[axis].is_some_and(test);
    let degree = |axis: usize| is(axis, &|name| DEGREES[axis].contains(&name.plain.as_str()));
    let units = TextUnits(places.map(|name| name.and_then(Name::unit)));
    let unknown = places.into_iter().flatten().filter(|name| name.has_unknown_unit());
    let mut unknown_units: Vec<String> = unknown.map(|name| name.unit.clone()).collect();
    unknown_units.dedup();
    Ok(NamedColumns { roles, count: names.len(), degrees: degree(0) && degree(1), unknown_units, units })
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
        assert_eq!(named("x (local);y (local);z [NAVD88]").unknown_units, ["local", "navd88"]);
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
        assert!(named("x [ft];y [ft];z [ft]").units().unwrap().some_foot);
        assert!(!named("x [m];y [m];z [m]").units().unwrap().some_foot);
        let mut below = named("x;y;z");
        below.add_units(&[b"m", b"m", b"cm"]).unwrap();
        assert_eq!(below.units(), named("x [m];y [m];z [cm]").units());
        assert!(named("x [m];y [m];z [m]").add_units(&[b"mm", b"mm", b"mm"]).is_err());
        assert_eq!(named("x;y;z;;").count, 3);
    }
}
