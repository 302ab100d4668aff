//! The name that people give to a column, and what they write in brackets after it.

use crate::text::role::ColumnRole;
use crate::text::units::{TextUnit, letters};
use crate::windows_1252::decoded;

/// The names of one role in several lists, the clearest first: if several columns have one, that with the clearest name is taken.
pub(crate) type Names = (&'static [&'static [&'static str]], ColumnRole);

/// The names of longitude and latitude.
const LONGITUDE: [&str; 17] = [
    "lon",
    "longitude",
    "long",
    "lng",
    "longitud",
    "laenge",
    "lange",
    "longitudine",
    "laengengrad",
    "langengrad",
    "laengdegrad",
    "lengdegrad",
    "langdgrad",
    "lengtegraad",
    "pituusaste",
    "dlugosc",
    "долгота",
];
const LATITUDE: [&str; 12] = [
    "lat",
    "latitude",
    "latitud",
    "breite",
    "latitudine",
    "breitengrad",
    "breddegrad",
    "breddgrad",
    "breedtegraad",
    "leveysaste",
    "szerokosc",
    "широта",
];

/// Names without case, accents, blanks, points, hyphens and underscores, and without a unit in brackets.
pub(crate) const NAMES: [Names; 10] = [
    (
        &[
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
            ],
            &LONGITUDE,
            &["oost", "oster", "leste", "wschod", "vychod", "vzhod", "istok", "ita", "kelet", "dogu", "восток", "tx"],
        ],
        ColumnRole::Coordinate(0),
    ),
    (
        &[
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
            ],
            &LATITUDE,
            &["noord", "norr", "polnoc", "sever", "sjever", "pohjoinen", "eszak", "kuzey", "север", "ty"],
        ],
        ColumnRole::Coordinate(1),
    ),
    (
        &[&[
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
            "hohe",
            "cota",
            "quota",
            "altitud",
            "h",
            "hgt",
            "elevacion",
            "elevacao",
            "elevazione",
            "altitudine",
            "altezza",
            "altura",
            "hauteur",
            "cote",
            "hoogte",
            "wysokosc",
            "rzedna",
            "vyska",
            "hojd",
            "hojde",
            "hoyde",
            "korkeus",
            "visina",
            "magassag",
            "yukseklik",
            "высота",
            "rl",
            "reducedlevel",
            "tz",
        ]],
        ColumnRole::Coordinate(2),
    ),
    (&[&["r", "red"]], ColumnRole::Color(0)),
    (&[&["g", "green"]], ColumnRole::Color(1)),
    (&[&["b", "blue"]], ColumnRole::Color(2)),
    (&[&["class", "classification"]], ColumnRole::Class),
    (&[&["intensity"]], ColumnRole::Intensity),
    (&[&["returnnumber", "returnnum", "returnno", "return"]], ColumnRole::ReturnNumber),
    (&[&["numberofreturns", "numreturns", "nreturns", "returns"]], ColumnRole::Returns),
];

/// Words beside the name of an axis that do not change what it means, as in `utm_north`.
const BESIDE_AXES: [&str; 19] = [
    "coord",
    "coordinate",
    "coordinates",
    "ellipsoid",
    "ellipsoidal",
    "etrs89",
    "gps",
    "grid",
    "ortho",
    "orthometric",
    "p",
    "point",
    "pos",
    "position",
    "pt",
    "punkt",
    "utm",
    "wgs",
    "wgs84",
];

/// How unclear a name is that is none but for one of its words.
const UNCLEAR: usize = 1000;

/// What heights count from, as people write it in brackets after a name.
const HEIGHT_DATUMS: [&str; 19] = [
    "ahd", "amsl", "cgvd2013", "cgvd28", "dhhn2016", "dhhn92", "egm2008", "egm96", "ign69", "msl", "nap", "navd88",
    "ngvd29", "nhn", "nn", "nn2000", "nzvd2016", "odn", "rh2000",
];

/// A column's name.
pub(crate) struct Name {
    /// As [`NAMES`] has it.
    pub(crate) plain: String,
    /// What is in brackets after it, with the brackets.
    beside: String,
    /// Whether there are blanks in the name.
    has_blanks: bool,
    /// Its words: `X_north` is the northing. None if commas part them.
    words: Vec<String>,
}

impl Name {
    pub(crate) fn read(text: &[u8]) -> Name {
        let text = decoded(text).trim().to_lowercase();
        let (name, beside) = match text.find(['[', '(', '{']) {
            Some(at) if at > 0 && text.ends_with([']', ')', '}']) => text.split_at(at),
            _ => (text.as_str(), ""),
        };
        let has_blanks = name.trim().contains([' ', '\t']);
        let is_one_name = !name.trim_matches(|c: char| !c.is_alphanumeric()).contains([',', ';', ':', '|']);
        let words = if is_one_name { words_in(name) } else { Vec::new() };
        Name { plain: folded(&letters(name)), beside: beside.to_string(), has_blanks, words }
    }

    /// Returns what the column holds, and how unclear the name is. In some countries x is the northing, and brackets say so.
    pub(crate) fn role(&self) -> Option<(usize, ColumnRole)> {
        let of_words = || axis_of_words(&self.words).map(|axis| (UNCLEAR, ColumnRole::Coordinate(axis)));
        let own = role_of(&self.plain).or_else(of_words)?;
        match self.direction_beside() {
            Some(direction) if is_letter(&self.plain) && is_on_map(Some(own)) => role_of(&direction),
            _ => Some(own),
        }
    }

    /// Returns the direction that brackets after the name say.
    fn direction_beside(&self) -> Option<String> {
        self.names_beside().find(|name| !is_letter(name) && is_on_map(role_of(name)))
    }

    /// Returns whether the name is the letter x or y, and nothing says in which direction it points.
    pub(crate) fn is_letter_alone(&self) -> bool {
        is_letter(&self.plain) && role_of(&self.plain).is_some() && self.direction_beside().is_none()
    }

    /// Returns whether the name says that the column is the longitude, or the latitude.
    pub(crate) fn is_degrees(&self, axis: usize) -> bool {
        let degrees: [&[&str]; 2] = [&LONGITUDE, &LATITUDE];
        let is = |name: &str| degrees[axis].contains(&name);
        let have_degrees = || self.words.iter().any(|word| is(word)) && axis_of_words(&self.words) == Some(axis);
        is(&self.plain) || self.names_beside().any(|name| is(&name)) || have_degrees()
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

    /// Returns what is in brackets if that is neither a name nor a unit or datum of heights that is known.
    pub(crate) fn unknown_unit(&self) -> Option<String> {
        let words = self.other_words();
        let is_datum = HEIGHT_DATUMS.contains(&letters(&words.concat()).as_str());
        (!words.is_empty() && !is_datum && TextUnit::among(&words).is_none()).then(|| words.join(" "))
    }
}

/// Returns the words of a name without case, such as "latitude" and "deg" of "Latitude(deg)".
pub(crate) fn words_of(field: &[u8]) -> Vec<String> {
    words_in(&decoded(field).to_lowercase())
}

fn words_in(text: &str) -> Vec<String> {
    let text = folded(text);
    text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_string).collect()
}

/// Returns the axis that a word names.
pub(crate) fn axis_of(word: &str) -> Option<usize> {
    match role_of(word) {
        Some((_, ColumnRole::Coordinate(axis))) => Some(axis),
        _ => None,
    }
}

/// Returns whether a word without case is a letter of an axis, or has one in it, and is no direction.
pub(crate) fn is_letter(name: &str) -> bool {
    name.contains(['x', 'y'])
}

/// Returns the axis that several words name together. A direction counts more than a letter.
fn axis_of_words(words: &[String]) -> Option<usize> {
    let is_beside = |word: &&String| BESIDE_AXES.contains(&word.as_str()) || TextUnit::read(word).is_some();
    let named: Vec<&String> = words.iter().filter(|word| !is_beside(word)).collect();
    let axes: Vec<usize> = named.iter().map_while(|word| axis_of(word)).collect();
    if axes.len() < named.len() {
        return None;
    }
    let is_direction = |word: &&String| !is_letter(word) && is_on_map(role_of(word));
    let directions: Vec<usize> = named.iter().copied().filter(is_direction).filter_map(|word| axis_of(word)).collect();
    let is_map = axes.iter().all(|axis| *axis < 2);
    let axes = if is_map && !directions.is_empty() { directions } else { axes };
    let first = *axes.first()?;
    axes.iter().all(|axis| *axis == first).then_some(first)
}

/// Returns a text without case in letters of the alphabet that English has, as far as they are those with accents.
pub(crate) fn folded(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            'à'..='å' | 'ā' | 'ă' | 'ą' => out.push('a'),
            'æ' => out.push_str("ae"),
            'ç' | 'ć' | 'č' => out.push('c'),
            'ď' | 'đ' => out.push('d'),
            'è'..='ë' | 'ē' | 'ę' | 'ě' => out.push('e'),
            'ğ' => out.push('g'),
            'ì'..='ï' | 'ı' => out.push('i'),
            'ł' => out.push('l'),
            'ñ' | 'ń' | 'ň' => out.push('n'),
            'ò'..='ö' | 'ø' | 'ő' => out.push('o'),
            'ř' => out.push('r'),
            'ś' | 'ş' | 'š' | 'ș' => out.push('s'),
            'ť' | 'ţ' | 'ț' => out.push('t'),
            'ù'..='ü' | 'ů' | 'ű' => out.push('u'),
            'ý' | 'ÿ' => out.push('y'),
            'ź' | 'ż' | 'ž' => out.push('z'),
            // Accents that follow their letter.
            '\u{300}'..='\u{36f}' => {}
            other => out.push(other),
        }
    }
    out
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
    let name = folded(name);
    let rank = |names: &[&[&str]]| names.iter().copied().flatten().position(|known| *known == name);
    NAMES.iter().find_map(|(names, role)| Some((rank(names)?, *role)))
}

/// Returns whether it is x or y.
fn is_on_map(role: Option<(usize, ColumnRole)>) -> bool {
    matches!(role, Some((_, ColumnRole::Coordinate(0 | 1))))
}
