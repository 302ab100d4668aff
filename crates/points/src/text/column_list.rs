//! Columns that comments list, such as `# northing, easting`, where they are others than those that are taken.

use crate::text::name::{axis_of, folded};
use crate::text::units::TextUnit;
use crate::windows_1252::decoded;

/// What comments say against the columns that are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Doubt {
    /// They may list other columns.
    Possible,
    /// They list other columns.
    Certain,
}

/// How an axis is called. A list calls all of its columns in one way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Style {
    /// By the letter x or y.
    Letter,
    /// By the first letter of a direction.
    Initial,
    Direction,
    /// By the letter z.
    Z,
    Height,
}

/// A word of a comment, or what stands between words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Word {
    Axis(usize, Style),
    /// A column of something else, such as a time, the number of a point or a depth.
    Other,
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

/// A column in a list, and the number of its word.
type Column = (usize, Word);

/// Words for x, y and z beside those that headers have.
const AXES: [&str; 3] = [
    "lambda abscissa abscisse abscisa ascissa",
    "phi ordinate ordonnee ordenada ordinata",
    "up msl ht hae elv ele level pegel niveau otmetka",
];

const OTHERS: &str = "beam class classification code date day epoch fid gpstime id idx index intensity lfid name nr num objectid oid \
                      pid ping pn pnr pktnr pointid pointno ptid ptno punktnr punktnummer quality row sec seconds shot shotnumber t \
                      time timestamp utc aika cas czas heure hora nombre nummer numero ora tempo temps tid tiempo tijd zeit время \
                      depth depths down diepte djup dybde glebokosc hloubka profondeur profondita profundidad profundidade syvyys \
                      tiefe tiefen глубина";

const LISTS: &str = "achse achsen attributes axes axis col cols colonne colonnes coluna colunas column columna columnas columns field \
                     fields format frame header kolom kolommen kolonne kolumn kolumna layout order reihenfolge sarake sloupec spalte \
                     spalten variables";

const FILLERS: &str = "and as coded datum double ellipsoid ellipsoidal en epsg crs et first float geoid given gk gps grid int \
                       integer is are ist ja last local nhn nn number och og ortho orthometric point points pos position projected pt \
                       punkt punkte real second sind string system third und utm value values wert werte wgs wgs84 zone";

const STOPS: &str =
    "am at by da das de del der des di die du for from im in it la le mit of on that the this to von was with zu";

/// How words begin that name coordinates and hardly ever a direction in a landscape.
const COORDINATES: [&str; 9] =
    ["easting", "northing", "latitude", "longitude", "latitud", "rechtswert", "hochwert", "ostwert", "nordwert"];

/// How words such as "Nordachse" begin, and how their ends do.
const DIRECTIONS: [(&str, usize); 6] = [("east", 0), ("ost", 0), ("oost", 0), ("north", 1), ("nord", 1), ("noord", 1)];
const AXIS_ENDS: [&str; 9] = ["ach", "ax", "coor", "ing", "komp", "koo", "kord", "richt", "wer"];

/// No list names more columns.
const MOST_COLUMNS: usize = 200;

/// Columns have places up to this one.
const MOST_PLACES: usize = 40;

/// Returns what these comments say against x, y and z as the first three of `columns` columns, and the number of the comment.
pub(crate) fn doubt(texts: &[&[u8]], columns: usize) -> Option<(usize, Doubt)> {
    let comments: Vec<Vec<Word>> = texts.iter().map(|text| words(text)).collect();
    let alone = comments.iter().enumerate().filter_map(|(at, words)| Some((at, doubt_about(words, columns)?)));
    alone.max_by_key(|(at, doubt)| (*doubt, *at)).or_else(|| {
        let parts: Vec<&[Word]> = comments.iter().map(|words| part_of_list(words)).collect();
        let first = parts.iter().position(|part| !part.is_empty())?;
        Some((first, doubt_about(&parts.join(&Word::Separator), columns)?))
    })
}

/// Returns the number of a comment that says that x is the northing, or lists northing and easting in another order than x and y, which
/// are columns of these names. `order` are the places of x and y.
pub(crate) fn doubt_about_letters(texts: &[&[u8]], order: [usize; 2]) -> Option<usize> {
    texts.iter().rposition(|text| {
        let words = words(text);
        let listed = listed(&words).unwrap_or_default();
        let directions = listed.iter().filter_map(|(_, word)| match word {
            Word::Axis(axis, Style::Direction | Style::Initial) => Some(*axis),
            _ => None,
        });
        let other = if order[0] < order[1] { [1, 0] } else { [0, 1] };
        let is_other = directions.eq(other) && is_dense(&words);
        crosses_letters(&words) || meanings_of_letters(&words).is_empty() && is_other
    })
}

/// Returns whether all words belong to a list of columns.
fn is_dense(words: &[Word]) -> bool {
    let has = |word| words.contains(&word);
    !has(Word::Unknown) && !has(Word::Value) && (has(Word::List) || !has(Word::Stop))
}

/// Returns the words of one item of a list over several comments, without the remark in "column 1: northing of the prism".
fn part_of_list(words: &[Word]) -> &[Word] {
    let mut start = words.iter().filter(|word| !matches!(word, Word::List | Word::Separator));
    let is_placed = matches!((start.next(), start.next()), (Some(Word::Place(_)), Some(Word::Axis(..) | Word::Other)));
    let is_remark = |word: &Word| matches!(word, Word::Unknown | Word::Stop);
    let end = words.iter().position(is_remark).filter(|_| is_placed).unwrap_or(words.len());
    if is_dense(&words[..end]) && words.iter().any(is_column) { &words[..end] } else { &[] }
}

fn is_column(word: &Word) -> bool {
    matches!(word, Word::Axis(..) | Word::Other)
}

fn is_place(word: &Word) -> bool {
    matches!(word, Word::Place(_))
}

/// Returns what the letters x and y mean, as pairs of axes: (0, 1) if x is the northing.
fn meanings_of_letters(words: &[Word]) -> Vec<(usize, usize)> {
    let (mut letter, mut meanings) = (None, Vec::new());
    for word in words {
        match word {
            Word::Axis(axis, Style::Letter) => letter = Some(*axis),
            Word::Axis(axis, Style::Direction | Style::Initial) => {
                meanings.extend(letter.take().map(|own| (own, *axis)))
            }
            Word::List | Word::Filler | Word::Separator => {}
            Word::Stop if words.contains(&Word::List) => {}
            _ => letter = None,
        }
    }
    meanings
}

/// Returns whether letters mean the direction of the other letter, each that means one.
fn crosses_letters(words: &[Word]) -> bool {
    let meanings = meanings_of_letters(words);
    let are_crossed = meanings.iter().all(|(letter, axis)| letter != axis);
    are_crossed && (meanings.len() >= 2 || meanings.len() == 1 && is_dense(words))
}

fn doubt_about(words: &[Word], columns: usize) -> Option<Doubt> {
    if crosses_letters(words) {
        return Some(Doubt::Certain);
    }
    let listed = listed(words)?;
    let styles = [Style::Letter, Style::Initial, Style::Direction];
    styles.into_iter().filter_map(|style| doubt_in(style, &listed, words, columns)).max()
}

/// Returns the doubt about the columns that are called in this style.
fn doubt_in(style: Style, listed: &[Column], words: &[Word], columns: usize) -> Option<Doubt> {
    let has_letters = listed.iter().any(|(_, word)| matches!(word, Word::Axis(_, Style::Letter)));
    let axis = |column: &Column| match column.1 {
        Word::Axis(axis, own) if own == style || own == Style::Height => Some(axis),
        // The z of "x y z" is no word of another list.
        Word::Axis(axis, Style::Z) if style == Style::Letter || !has_letters => Some(axis),
        _ => None,
    };
    let runs = runs(listed, axis);
    // "id x y z" before three columns may be about another file, with x, y and z in the same order.
    let has_room = columns > 3 || words.iter().any(is_place);
    // "y = north, x = east" lists letters and not directions.
    let may_be_reversed = style == Style::Letter || meanings_of_letters(words).len() < 2;
    let doubts = runs.iter().filter_map(|run| {
        let others = run.iter().take_while(|column| axis(column).is_none()).count();
        let run = without_remote_start(run, others, words);
        let axes: Vec<usize> = run.iter().filter_map(axis).collect();
        let has_others = axes.len() < run.len();
        let is_other = match axes[..] {
            [0, 1, 2] => has_others && has_room,
            // What follows a list of all three explains it.
            [0, 1] => has_others && runs.len() == 1,
            [1, 0] => may_be_reversed && runs.len() == 1,
            _ => axes.len() == 3,
        };
        is_other.then(|| doubt_about_run(run, axes.len(), words)).flatten()
    });
    doubts.max()
}

/// Returns a list without those of its first columns, `others` than axes, that words of a sentence part from the next.
fn without_remote_start<'a>(run: &'a [Column], others: usize, words: &[Word]) -> &'a [Column] {
    let is_remote = |pair: &&[Column]| {
        let has = |wanted: fn(&Word) -> bool| between(pair, words).iter().any(wanted);
        has(|word| matches!(word, Word::Unknown | Word::Stop)) && !has(is_place)
    };
    &run[run.windows(2).take(others).take_while(is_remote).count()..]
}

/// Returns the lists of x, y and z, each up to the third of them, with the columns of something else among them.
fn runs(listed: &[Column], axis: impl Fn(&Column) -> Option<usize>) -> Vec<Vec<Column>> {
    let (mut runs, mut run) = (Vec::new(), Vec::new());
    for column in listed.iter().filter(|column| axis(column).is_some() || column.1 == Word::Other) {
        let own = axis(column);
        if let Some(last) = run.iter().rposition(|other| own.is_some() && axis(other) == own) {
            run.drain(..=last);
        }
        run.push(*column);
        if run.iter().filter_map(&axis).count() == 3 {
            runs.push(std::mem::take(&mut run));
        }
    }
    runs.push(run);
    runs
}

/// Returns the doubt about other columns with so many axes, if they are no words of a sentence.
fn doubt_about_run(run: &[Column], axes: usize, words: &[Word]) -> Option<Doubt> {
    let between = between(run, words);
    let count = |wanted: Word| between.iter().filter(|word| **word == wanted).count();
    let (is_named, is_all) = (words.contains(&Word::List), axes == 3);
    let (unknown, separators) = (count(Word::Unknown), count(Word::Separator));
    if is_dense(words) || is_all && unknown == 0 && (is_named || count(Word::Stop) == 0) {
        return Some(Doubt::Certain);
    }
    let is_parted = if is_all { is_named || separators + 1 >= run.len() } else { is_named && separators > 0 };
    let most = if is_all { run.len() - 1 } else { 0 };
    (is_parted && unknown <= most).then_some(Doubt::Possible)
}

/// Returns the words from the first to the last of these columns.
fn between<'a>(run: &[Column], words: &'a [Word]) -> &'a [Word] {
    let places = || run.iter().map(|(at, _)| *at);
    match (places().min(), places().max()) {
        (Some(first), Some(last)) => &words[first..=last],
        _ => &[],
    }
}

/// Returns whether numbers that are no places of columns stand beside columns, as in "north: 5933000".
fn gives_values(words: &[Word]) -> bool {
    let beside: Vec<&Word> = words.iter().filter(|word| !matches!(word, Word::List | Word::Separator)).collect();
    words.windows(2).any(|pair| pair[0] == Word::Value && is_column(&pair[1]))
        || beside.windows(2).any(|pair| is_column(pair[0]) && *pair[1] == Word::Value)
}

/// Returns the columns that words list, in the order of their places if they have some; `None` if numbers beside them are values.
fn listed(words: &[Word]) -> Option<Vec<Column>> {
    let own = words.iter().copied().enumerate();
    let own = own.filter(|(_, word)| is_column(word) || is_place(word));
    let (columns, numbers): (Vec<Column>, Vec<Column>) = own.clone().partition(|(_, word)| is_column(word));
    if columns.len() > MOST_COLUMNS || gives_values(words) {
        return None;
    }
    let mut numbered: Vec<Column> = own.collect();
    let is_place_first = numbered.first().is_some_and(|(_, word)| is_place(word));
    if !is_place_first {
        numbered.reverse();
    }
    let placed = numbered.windows(2).filter_map(|pair| match pair {
        [(_, Word::Place(place)), column] if is_column(&column.1) => Some((*place, *column)),
        _ => None,
    });
    let placed: Vec<(usize, Column)> = placed.collect();
    // "3 columns: x y z"
    let are_beside = placed.len() == numbers.len() && (numbers.len() > 1 || columns.len() == 1);
    if numbers.is_empty() || !are_beside { Some(columns) } else { by_place(placed, is_place_first, words) }
}

/// Returns columns in the order of these places, with another one before them if it is missing; `None` if the numbers are values, as in
/// "north 3, east 4".
fn by_place(mut placed: Vec<(usize, Column)>, is_place_first: bool, words: &[Word]) -> Option<Vec<Column>> {
    placed.sort_by_key(|(place, _)| *place);
    let are_in_turn = placed.len() > 1 && placed.windows(2).all(|pair| pair[0].0 + 1 == pair[1].0);
    let (first, (at, _)) = *placed.first()?;
    // Places count from 0 or 1.
    let missing = (first > 1).then_some((at, Word::Other));
    let are_places = missing.is_none() || words.contains(&Word::List) || are_in_turn && is_place_first;
    are_places.then(|| missing.into_iter().chain(placed.into_iter().map(|(_, column)| column)).collect())
}

/// Returns the words of a comment without its mark; none if it describes a CRS in the words of a program, whose axes are no columns.
pub(crate) fn words(text: &[u8]) -> Vec<Word> {
    let text = folded(&with_parted_words(&decoded(text)).to_lowercase());
    if ["axis[", "proj=", "cs[", "crs["].iter().any(|mark| text.contains(mark)) {
        return Vec::new();
    }
    let characters: Vec<char> = text.chars().collect();
    let digit = |at: Option<usize>| at.and_then(|at| characters.get(at)).is_some_and(char::is_ascii_digit);
    let (mut words, mut word) = (Vec::new(), String::new());
    for (at, character) in characters.iter().copied().enumerate() {
        if character.is_alphanumeric() || character == '.' && digit(at.checked_sub(1)) && digit(at.checked_add(1)) {
            word.push(character);
            continue;
        }
        read_word(&std::mem::take(&mut word), &mut words);
        if matches!(character, ',' | ';' | '|' | '/' | '\t' | '=' | ':' | '>') {
            words.push(Word::Separator);
        }
    }
    read_word(&word, &mut words);
    words
}

/// Returns a text with blanks in words such as "GridNorth".
fn with_parted_words(text: &str) -> String {
    let mut parted = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_uppercase() && parted.ends_with(char::is_lowercase) {
            parted.push(' ');
        }
        parted.push(character);
    }
    parted
}

fn read_word(word: &str, words: &mut Vec<Word>) {
    let place = |digits: &str| digits.parse().ok().filter(|place| *place <= MOST_PLACES).map(Word::Place);
    let letters = word.trim_end_matches(|c: char| c.is_ascii_digit());
    let digits = &word[letters.len()..];
    if word.is_empty() {
        return;
    }
    if word.starts_with(|c: char| c.is_ascii_digit()) && word.parse::<f64>().is_ok() {
        words.push(place(word).unwrap_or(Word::Value));
    } else if let Some(columns) = code(word) {
        words.extend(columns);
    } else if let Some(place) = place(digits).filter(|_| has(LISTS, letters)) {
        words.extend([Word::List, place]);
    } else if digits.len() == 1 && ["x", "y", "z"].contains(&letters) {
        words.extend(axis(letters));
    } else {
        words.push(meaning(word));
    }
    if COORDINATES.iter().any(|name| word.starts_with(name)) {
        words.push(Word::List);
    }
}

fn has(words: &str, word: &str) -> bool {
    words.split_ascii_whitespace().any(|known| known == word)
}

fn meaning(word: &str) -> Word {
    let is_short = word.chars().count() == 1 || word.contains(|c: char| c.is_ascii_digit());
    match axis(word) {
        Some(axis) => axis,
        None if has(OTHERS, word) => Word::Other,
        None if has(LISTS, word) || word.starts_with("coord") || word.starts_with("koord") => Word::List,
        None if ["then", "dann", "puis"].contains(&word) => Word::Separator,
        None if has(STOPS, word) => Word::Stop,
        None if is_short || has(FILLERS, word) || TextUnit::read(word).is_some() => Word::Filler,
        None => Word::Unknown,
    }
}

/// Returns the axis that a word names, in the plural too, as in "Eastings" and "Hochwerte", or in a compound, as in "Nordachse".
fn axis(word: &str) -> Option<Word> {
    let singular = ["s", "e", "n", "en"].into_iter().filter_map(|end| word.strip_suffix(end));
    let mut forms = std::iter::once(word).chain(singular.filter(|word| word.chars().count() >= 4));
    let known = |word: &str| axis_of(word).or_else(|| AXES.iter().position(|words| has(words, word)));
    let is_axis = |end: &str| end.len() <= 1 || AXIS_ENDS.iter().any(|start| end.starts_with(start));
    let compound = || DIRECTIONS.iter().find(|(start, _)| word.strip_prefix(start).is_some_and(is_axis));
    let axis = forms.find_map(known).or_else(|| compound().map(|(_, axis)| *axis))?;
    let style = match (word, axis) {
        ("x" | "y", _) => Style::Letter,
        ("e" | "n", _) => Style::Initial,
        ("z", _) => Style::Z,
        (_, 2) => Style::Height,
        _ => Style::Direction,
    };
    Some(Word::Axis(axis, style))
}

/// Returns the columns that the letters of one word name, such as "PNEZD" and "ENH".
fn code(word: &str) -> Option<Vec<Word>> {
    let word = match word {
        "latlon" | "latlong" => return Some(["lat", "lon"].map(meaning).to_vec()),
        "latlonh" | "llh" | "blh" => return Some(["lat", "lon", "h"].map(meaning).to_vec()),
        "ned" => return Some(["n", "e", "depth"].map(meaning).to_vec()),
        word => word,
    };
    let rest = word.strip_prefix(['p', 'i', 't']).unwrap_or(word);
    let axes = rest.strip_suffix(['d', 'c', 'i']).unwrap_or(rest);
    let is_order = ["nez", "neh", "enz", "enh", "xyz", "xyh", "yxz", "yxh", "zxy", "zyx"].contains(&axes);
    let number = (rest.len() < word.len()).then_some(Word::Other);
    is_order.then(|| number.into_iter().chain(axes.chars().map(|c| meaning(c.encode_utf8(&mut [0; 4])))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doubt_of(comments: &str, columns: usize) -> Option<Doubt> {
        let texts: Vec<&[u8]> = comments.lines().map(str::as_bytes).collect();
        doubt(&texts, columns).map(|(_, doubt)| doubt)
    }

    #[test]
    fn lists_in_another_order_are_seen() {
        for comments in [
            "N/E/H",
            "X_north Y_east Z",
            "north, east",
            "Nord Ost Hoehe",
            "col1: north\ncol2: east\ncol3: height",
            "1: id\n2: north\n3: east\n4: h",
            "1:t 2:x 3:y 4:z",
            "[4] height\n[2] north\n[3] east",
            "1=time, 2=x, 3=y, 4=z",
            "[1] time\n[2] x\n[3] y\n[4] z",
            "column 2 = easting, column 1 = northing, column 3 = height",
            "easting: column 2; northing: column 1; height: column 3",
            "column 2 = easting, 3 = northing, 4 = height",
            "X Y Z are in the order north east up",
            "X is north and Y is east",
            "PNEZD",
            "Format: YXH",
            "order N,E,H; zone 32",
            "x y depth (m)",
            "latitudes longitudes heights",
            "lat lon",
            "X = east, Y = north; order in the file: Y X Z",
            "Export of a device, X (north), Y (east), Z",
            "Y[m] X[m] H[m] (PUWG 2000: X = north)",
            "north in column 1, east in column 2, height in column 3",
            "x in column 2 and y in column 1",
            "field 1: northing of the prism\nfield 2: easting of the prism\nfield 3: height above the sea",
            "column 2: x (east)\ncolumn 1: y (north)\ncolumn 3: z",
            "y1,x1,z1",
            "GridNorth GridEast GridHeight",
            "mN mE mRL",
            "Nordachse, Ostachse, Hoehe",
            "NED",
            "A: north\nB: east\nC: height",
            "Coordenada Norte Coordenada Este Cota",
            "Northing and easting in metres, heights DHHN2016",
            "Data in the format northing, then easting and ellipsoidal elevation, exported from a device",
            "time of day, x, y, z",
            "easting; id; in metres; northing; elevation",
            "x, y, time, z",
            "z x y",
        ] {
            assert_eq!(doubt_of(comments, 4), Some(Doubt::Certain), "{comments}");
        }
        for comment in [
            "northing (checked), easting (checked), height",
            "field 1: time of the prism, field 2: x of the prism, field 3: y of the prism, field 4: z of the prism",
        ] {
            assert_eq!(doubt_of(comment, 4), Some(Doubt::Possible), "{comment}");
        }
        assert_eq!(doubt_of("time, x, y, z", 3), None);
        assert_eq!(doubt_of("col2: x\ncol3: y\ncol4: z", 3), Some(Doubt::Certain));
    }

    #[test]
    fn sentences_and_values_are_no_lists() {
        for comments in [
            "made by a scanner, north of the river",
            "exported from X for the Y district",
            "North Carolina lidar, East county",
            "North Carolina lidar\nEast county",
            "east of the river, north bank, height DHHN92",
            "scanned from north to east, height in m",
            "site north east corner",
            "coordinates of the north east corner",
            "X Y Z, north east corner",
            "X Y Z of the north east corner",
            "north: 5933000.5, east: 565000.25, height: 12",
            "north: 5934000\nsouth: 5933000\neast: 566000\nwest: 565000",
            "UTM zone 32 N, 9 E",
            "53.5 N 9.9 E",
            "x y z of the hill",
            "3 columns: x y z",
            "1: x, 2: y, 3: z",
            "x y z x y z",
            "x y z (x = east, y = north, z = height)",
            "x y z (y = north, x = east)",
            "x y z, y and x checked",
            "x y z time intensity",
            "est, nord e quota",
            "este y norte y cota",
            "+proj=tmerc +lat_0=0 +lon_0=9 +x_0=500000 +y_0=0",
            "PROJCS[\"GK\", AXIS[\"Northing\",NORTH],AXIS[\"Easting\",EAST]]",
            "x (east), y (north), z (up)",
            "2024-05-01 12:30:01 operator",
            "position: north 3, east 4, up 5",
            "order of points: from north to south, from west to east",
            "scanned in Nordhausen, Ostpreussen, Hohenstein",
        ] {
            assert_eq!(doubt_of(comments, 4), None, "{comments}");
        }
    }

    #[test]
    fn letters_with_other_directions_are_seen() {
        let doubt = |text: &str, order| doubt_about_letters(&[text.as_bytes()], order);
        assert_eq!(doubt("x = north, y = east", [0, 1]), Some(0));
        assert_eq!(doubt("N E H", [0, 1]), Some(0));
        assert_eq!(doubt("N E H", [1, 0]), None);
        assert_eq!(doubt("y = north, x = east", [0, 1]), None);
        assert_eq!(doubt("the north east of the hill", [0, 1]), None);
        assert_eq!(doubt("UTM 32 N, 9 E", [0, 1]), None);
    }
}
