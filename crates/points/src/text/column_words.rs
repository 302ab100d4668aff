//! The words of a comment that may name columns: axes, times and numbers of points, the places of columns, and words that belong to
//! such a list.

use crate::text::name::{axis_of, folded};
use crate::text::units::TextUnit;
use crate::windows_1252::decoded;

/// What a column of a list is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ColumnWord {
    /// x or y by this letter.
    Letter(usize),
    /// East or north by its first letter.
    Initial(usize),
    /// East or north, the longitude or the latitude by a word.
    Direction(usize),
    /// The letter z.
    Z,
    /// The height by another word.
    Height,
    /// The depth, which is no height.
    Depth,
    /// A time, the number of a point, or what else stands beside coordinates.
    Other,
}

impl ColumnWord {
    /// Returns the axis; the depth is along z.
    pub(crate) fn axis(self) -> Option<usize> {
        match self {
            ColumnWord::Letter(axis) | ColumnWord::Initial(axis) | ColumnWord::Direction(axis) => Some(axis),
            ColumnWord::Z | ColumnWord::Height | ColumnWord::Depth => Some(2),
            ColumnWord::Other => None,
        }
    }
}

/// A word of a comment, or what stands between words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Token {
    Column(ColumnWord),
    /// A small whole number, which may be the place of a column.
    Place(usize),
    /// Another number.
    Value,
    /// A word such as "column" or "order".
    List,
    /// A unit, a datum, "and": it changes nothing.
    Filler,
    /// A word of sentences, such as "of".
    Stop,
    /// A sign that parts the items of a list.
    Separator,
    Unknown,
}

/// The words for axes that are no names of columns.
const AXES: [(&[&str], ColumnWord); 8] = [
    (&["xs", "px"], ColumnWord::Letter(0)),
    (&["ys", "py"], ColumnWord::Letter(1)),
    (&["zs", "pz"], ColumnWord::Z),
    (&["lambda", "abscissa", "abscisse", "abscisa", "ascissa"], ColumnWord::Direction(0)),
    (&["phi", "ordinate", "ordonnee", "ordenada", "ordinata"], ColumnWord::Direction(1)),
    (&["up", "rl", "msl", "ht", "hae", "elv", "ele", "level", "pegel", "niveau", "otmetka"], ColumnWord::Height),
    (
        &[
            "depth",
            "down",
            "depths",
            "tiefe",
            "tiefen",
            "profondeur",
            "profundidad",
            "profundidade",
            "profondita",
            "diepte",
            "dybde",
            "djup",
            "syvyys",
            "hloubka",
            "glebokosc",
            "глубина",
        ],
        ColumnWord::Depth,
    ),
    (
        &[
            "aika",
            "beam",
            "cas",
            "class",
            "classification",
            "code",
            "czas",
            "date",
            "day",
            "epoch",
            "fid",
            "gpstime",
            "heure",
            "hora",
            "id",
            "idx",
            "index",
            "intensity",
            "lfid",
            "name",
            "nombre",
            "nr",
            "num",
            "numero",
            "nummer",
            "objectid",
            "oid",
            "ora",
            "pid",
            "ping",
            "pktnr",
            "pn",
            "pnr",
            "pointid",
            "pointno",
            "ptid",
            "ptno",
            "punktnr",
            "punktnummer",
            "quality",
            "row",
            "sec",
            "seconds",
            "shot",
            "shotnumber",
            "t",
            "temps",
            "tempo",
            "tid",
            "tiempo",
            "tijd",
            "time",
            "timestamp",
            "utc",
            "zeit",
            "время",
        ],
        ColumnWord::Other,
    ),
];

/// Words that say that columns are listed.
const LISTS: [&str; 33] = [
    "attributes",
    "axes",
    "axis",
    "achse",
    "achsen",
    "col",
    "cols",
    "colonne",
    "colonnes",
    "columna",
    "columnas",
    "coluna",
    "colunas",
    "column",
    "columns",
    "field",
    "fields",
    "format",
    "header",
    "kolom",
    "kolommen",
    "kolonne",
    "kolumn",
    "kolumna",
    "layout",
    "order",
    "reihenfolge",
    "sarake",
    "sloupec",
    "spalte",
    "spalten",
    "variables",
    "frame",
];

const FILLERS: [&str; 59] = [
    "and",
    "und",
    "et",
    "og",
    "och",
    "ja",
    "en",
    "i",
    "first",
    "second",
    "third",
    "last",
    "is",
    "are",
    "ist",
    "sind",
    "as",
    "given",
    "coded",
    "value",
    "values",
    "wert",
    "werte",
    "grid",
    "utm",
    "gk",
    "wgs",
    "wgs84",
    "gps",
    "zone",
    "datum",
    "system",
    "ellipsoid",
    "ellipsoidal",
    "orthometric",
    "ortho",
    "geoid",
    "nn",
    "nhn",
    "local",
    "projected",
    "p",
    "point",
    "points",
    "pos",
    "position",
    "pt",
    "punkt",
    "punkte",
    "epsg",
    "crs",
    "a",
    "float",
    "double",
    "int",
    "integer",
    "real",
    "number",
    "string",
];

const STOPS: [&str; 30] = [
    "the", "of", "to", "from", "at", "by", "in", "on", "with", "for", "this", "that", "it", "was", "der", "die", "das",
    "von", "zu", "im", "am", "mit", "de", "la", "le", "du", "del", "di", "da", "des",
];

/// How words begin that name coordinates and hardly ever a direction in a landscape.
const COORDINATES: [&str; 9] =
    ["easting", "northing", "latitude", "longitude", "latitud", "rechtswert", "hochwert", "ostwert", "nordwert"];

/// How words begin that name directions and heights, in compounds such as "Nordachse".
const BEGINNINGS: [(&str, ColumnWord); 22] = [
    ("east", ColumnWord::Direction(0)),
    ("oost", ColumnWord::Direction(0)),
    ("ost", ColumnWord::Direction(0)),
    ("vychod", ColumnWord::Direction(0)),
    ("wschod", ColumnWord::Direction(0)),
    ("north", ColumnWord::Direction(1)),
    ("noord", ColumnWord::Direction(1)),
    ("nord", ColumnWord::Direction(1)),
    ("sever", ColumnWord::Direction(1)),
    ("polnoc", ColumnWord::Direction(1)),
    ("pohj", ColumnWord::Direction(1)),
    ("hohen", ColumnWord::Height),
    ("kork", ColumnWord::Height),
    ("ανατολ", ColumnWord::Direction(0)),
    ("βορ", ColumnWord::Direction(1)),
    ("υψ", ColumnWord::Height),
    ("东", ColumnWord::Direction(0)),
    ("東", ColumnWord::Direction(0)),
    ("北", ColumnWord::Direction(1)),
    ("高", ColumnWord::Height),
    ("标高", ColumnWord::Height),
    ("標高", ColumnWord::Height),
];

/// How the ends of such compounds begin.
const AXIS_ENDS: [&str; 13] =
    ["ach", "angab", "ax", "coor", "dir", "ing", "ois", "komp", "koo", "kord", "rich", "val", "wer"];

/// Columns have places up to this one.
const MOST_PLACES: usize = 40;

/// Returns the tokens of a comment without its mark.
pub(crate) fn tokens(text: &[u8]) -> Vec<Token> {
    let text = folded(&with_parted_words(&decoded(text)).to_lowercase());
    let characters: Vec<char> = text.chars().collect();
    let digit = |at: Option<usize>| at.and_then(|at| characters.get(at)).is_some_and(char::is_ascii_digit);
    let mut tokens = Vec::new();
    let mut word = String::new();
    for (at, character) in characters.iter().copied().enumerate() {
        let is_point = character == '.' && digit(at.checked_sub(1)) && digit(at.checked_add(1));
        if character.is_alphanumeric() || is_point {
            word.push(character);
            continue;
        }
        read_word(&std::mem::take(&mut word), &mut tokens);
        if matches!(character, ',' | ';' | '|' | '/' | '\t' | '=' | ':' | '>') {
            tokens.push(Token::Separator);
        }
    }
    read_word(&word, &mut tokens);
    tokens
}

/// Returns a text with blanks in words such as "GridNorth".
fn with_parted_words(text: &str) -> String {
    let mut parted = String::with_capacity(text.len());
    let mut is_after_small = false;
    for character in text.chars() {
        if is_after_small && character.is_uppercase() {
            parted.push(' ');
        }
        is_after_small = character.is_lowercase();
        parted.push(character);
    }
    parted
}

fn read_word(word: &str, tokens: &mut Vec<Token>) {
    if word.is_empty() {
        return;
    }
    if word.starts_with(|c: char| c.is_ascii_digit()) && word.parse::<f64>().is_ok() {
        return tokens.push(place(word).map_or(Token::Value, Token::Place));
    }
    if let Some(columns) = code(word) {
        return tokens.extend(columns.into_iter().map(Token::Column));
    }
    let letters = word.trim_end_matches(|c: char| c.is_ascii_digit());
    match place(&word[letters.len()..]) {
        Some(place) if LISTS.contains(&letters) => tokens.extend([Token::List, Token::Place(place)]),
        // "x1", "y0"
        Some(0..=9) if ["x", "y", "z"].contains(&letters) => tokens.push(token(letters)),
        _ => tokens.push(token(word)),
    }
    if COORDINATES.iter().any(|name| word.starts_with(name)) {
        tokens.push(Token::List);
    }
}

fn place(digits: &str) -> Option<usize> {
    digits.parse().ok().filter(|place| *place <= MOST_PLACES)
}

fn token(word: &str) -> Token {
    if let Some(column) = column(word) {
        Token::Column(column)
    } else if LISTS.contains(&word) || word.starts_with("coord") || word.starts_with("koord") {
        Token::List
    } else if ["then", "dann", "puis"].contains(&word) {
        Token::Separator
    } else if STOPS.contains(&word) {
        Token::Stop
    } else if FILLERS.contains(&word)
        || word.chars().count() == 1
        || word.contains(|c: char| c.is_ascii_digit())
        || TextUnit::read(word).is_some()
    {
        Token::Filler
    } else {
        Token::Unknown
    }
}

/// Returns the column that a word names.
fn column(word: &str) -> Option<ColumnWord> {
    let known = |word: &str| AXES.iter().find(|(words, _)| words.contains(&word)).map(|(_, column)| *column);
    // "Eastings", "Hochwerte", "Höhen".
    let singular = ["s", "e", "n", "en"].into_iter().filter_map(|end| word.strip_suffix(end));
    let mut forms = std::iter::once(word).chain(singular.filter(|word| word.chars().count() >= 4));
    let begins = || {
        let is_compound =
            |start: &str| word.strip_prefix(start).is_some_and(|rest| !start.is_ascii() || is_of_axis(rest));
        BEGINNINGS.iter().find(|(start, _)| is_compound(start)).map(|(_, column)| *column)
    };
    forms.find_map(|word| named(word).or_else(|| known(word))).or_else(begins)
}

/// Returns whether a direction before this end of a word names an axis, as in "Nordachse", and no place, as in "Nordhausen".
fn is_of_axis(end: &str) -> bool {
    end.chars().count() <= 1 || AXIS_ENDS.iter().any(|start| end.starts_with(start))
}

fn named(word: &str) -> Option<ColumnWord> {
    Some(match (word, axis_of(word)?) {
        ("x" | "y", axis) => ColumnWord::Letter(axis),
        ("e" | "n", axis) => ColumnWord::Initial(axis),
        ("z", _) => ColumnWord::Z,
        (_, 2) => ColumnWord::Height,
        (_, axis) => ColumnWord::Direction(axis),
    })
}

/// Returns the columns that the letters of one word name, such as "PNEZD" and "ENH".
fn code(word: &str) -> Option<Vec<ColumnWord>> {
    let latitude_first = [ColumnWord::Direction(1), ColumnWord::Direction(0), ColumnWord::Height];
    match word {
        "ned" => return Some(vec![ColumnWord::Initial(1), ColumnWord::Initial(0), ColumnWord::Depth]),
        "latlon" | "latlong" => return Some(latitude_first[..2].to_vec()),
        "latlonh" | "llh" | "blh" => return Some(latitude_first.to_vec()),
        "zxy" | "zyx" => return Some(word.chars().filter_map(letter).collect()),
        _ => {}
    }
    let (numbered, rest) = match word.strip_prefix(['p', 'i', 't']) {
        Some(rest) => (true, rest),
        None => (false, word),
    };
    let axes = rest.strip_suffix(['d', 'c', 'i']).unwrap_or(rest);
    let is_order = axes.len() == 3 && ["ne", "en", "xy", "yx"].iter().any(|start| axes.starts_with(start));
    (is_order && axes.ends_with(['z', 'h']))
        .then(|| numbered.then_some(ColumnWord::Other).into_iter().chain(axes.chars().filter_map(letter)).collect())
}

fn letter(letter: char) -> Option<ColumnWord> {
    named(letter.encode_utf8(&mut [0; 4]))
}
