//! The name that people give to a column, and what they write in brackets after it.

use crate::input::text::role::ColumnRole;
use crate::input::text::units::{TextUnit, letters};
use crate::input::windows_1252::decoded;

/// The names of one role, the clearest first: if several columns have one, that with the clearest name is taken.
pub(crate) type Names = (&'static [&'static str], ColumnRole);

/// Names without case, blanks, points, hyphens and underscores, and without a unit in brackets.
pub(crate) const NAMES: [Names; 10] = [
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
            "ost",
            "osten",
            "est",
            "este",
            "utmx",
            "utme",
            "rechts",
            "rw",
            "e",
            "lon",
            "longitude",
            "long",
            "lng",
            "longitud",
            "laenge",
            "länge",
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
            "nord",
            "norden",
            "norte",
            "utmy",
            "utmn",
            "hoch",
            "hw",
            "n",
            "lat",
            "latitude",
            "latitud",
            "breite",
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
            "cota",
            "quota",
            "altitud",
            "h",
        ],
        ColumnRole::Coordinate(2),
    ),
    (&["r", "red"], ColumnRole::Color(0)),
    (&["g", "green"], ColumnRole::Color(1)),
    (&["b", "blue"], ColumnRole::Color(2)),
    (&["class", "classification"], ColumnRole::Class),
    (&["intensity"], ColumnRole::Intensity),
    (&["returnnumber", "returnnum", "returnno", "return"], ColumnRole::ReturnNumber),
    (&["numberofreturns", "numreturns", "nreturns", "returns"], ColumnRole::Returns),
];

/// The names of longitude and latitude.
const DEGREES: [&[&str]; 2] =
    [&["lon", "longitude", "long", "lng", "longitud", "laenge", "länge"], &["lat", "latitude", "latitud", "breite"]];

/// A column's name.
pub(crate) struct Name {
    /// As [`NAMES`] has it.
    pub(crate) plain: String,
    /// What is in brackets after it, with the brackets.
    beside: String,
    /// Whether there are blanks in the name.
    has_blanks: bool,
}

impl Name {
    pub(crate) fn read(text: &[u8]) -> Name {
        let text = decoded(text).trim().to_lowercase();
        let (name, beside) = match text.find(['[', '(', '{']) {
            Some(at) if at > 0 && text.ends_with([']', ')', '}']) => text.split_at(at),
            _ => (text.as_str(), ""),
        };
        let has_blanks = name.trim().contains([' ', '\t']);
        Name { plain: letters(name), beside: beside.to_string(), has_blanks }
    }

    /// Returns what the column holds, and how unclear the name is. In some countries x is the northing, and brackets say so.
    pub(crate) fn role(&self) -> Option<(usize, ColumnRole)> {
        let own = role_of(&self.plain)?;
        let is_letter = |name: &str| name.contains(['x', 'y']);
        let direction = self.names_beside().find(|name| !is_letter(name) && is_on_map(role_of(name)));
        match direction {
            Some(direction) if is_letter(&self.plain) && is_on_map(Some(own)) => role_of(&direction),
            _ => Some(own),
        }
    }

    /// Returns whether the name says that the column is the longitude, or the latitude.
    pub(crate) fn is_degrees(&self, axis: usize) -> bool {
        let is = |name: &str| DEGREES[axis].contains(&name);
        is(&self.plain) || self.names_beside().any(|name| is(&name))
    }

    /// Returns whether the name, without what is in brackets, has several words.
    pub(crate) fn has_blanks(&self) -> bool {
        self.has_blanks
    }

    /// Returns what is in each pair of brackets, or before or after a comma there.
    fn remarks(&self) -> impl Iterator<Item = &str> {
        let remarks = self.beside.split(['[', ']', '(', ')', '{', '}', ',', ';']);
        remarks.map(str::trim).filter(|remark| !remark.is_empty())
    }

    /// Returns the known names in brackets. A single letter among other words is none.
    fn names_beside(&self) -> impl Iterator<Item = String> {
        let words = |remark| words(remark).filter(|word| word.chars().count() > 1);
        let names = self.remarks().flat_map(move |remark| std::iter::once(remark).chain(words(remark)));
        names.map(letters).filter(|name| role_of(name).is_some())
    }

    /// Returns the words in brackets that are no names.
    fn other_words(&self) -> Vec<&str> {
        self.remarks().filter(|remark| role_of(&letters(remark)).is_none()).flat_map(other_words).collect()
    }

    pub(crate) fn unit(&self) -> Option<TextUnit> {
        TextUnit::among(&self.other_words())
    }

    /// Returns what is in brackets if that is neither a name nor a unit that is known.
    pub(crate) fn unknown_unit(&self) -> Option<String> {
        let words = self.other_words();
        (!words.is_empty() && TextUnit::among(&words).is_none()).then(|| words.join(" "))
    }
}

/// Returns the words of a name without case, such as "latitude" and "deg" of "Latitude(deg)".
pub(crate) fn words_of(field: &[u8]) -> Vec<String> {
    let text = decoded(field).to_lowercase();
    text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_string).collect()
}

/// Returns whether a word names x, y or z.
pub(crate) fn is_coordinate(word: &str) -> bool {
    matches!(role_of(word), Some((_, ColumnRole::Coordinate(_))))
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split([' ', '\t', '/', ':']).filter(|word| !word.is_empty())
}

/// Returns the words that are no names.
fn other_words(text: &str) -> impl Iterator<Item = &str> {
    words(text).filter(|word| role_of(&letters(word)).is_none())
}

/// Returns the unit that a column of a line of units says, as in "m" or "deg E".
pub(crate) fn unit_alone(field: &[u8]) -> Option<TextUnit> {
    let text = decoded(field).to_lowercase();
    TextUnit::read(&other_words(&text).collect::<Vec<_>>().join(" "))
}

fn role_of(name: &str) -> Option<(usize, ColumnRole)> {
    let rank = |names: &[&str]| names.iter().position(|known| *known == name);
    NAMES.iter().find_map(|(names, role)| Some((rank(names)?, *role)))
}

/// Returns whether it is x or y.
fn is_on_map(role: Option<(usize, ColumnRole)>) -> bool {
    matches!(role, Some((_, ColumnRole::Coordinate(0 | 1))))
}
