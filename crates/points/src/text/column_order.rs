//! The order in which comments list columns, where it is another than that in which columns are taken.

use crate::text::column_words::{ColumnWord, Token, tokens};

/// So many words that are not known may stand among the names of columns.
const MOST_UNKNOWN: usize = 2;

/// No list names more columns.
const MOST_COLUMNS: usize = 200;

/// So many words for other columns are remembered before those for x, y and z.
const MOST_OTHERS: usize = 40;

/// What comments say against the order in which columns are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Doubt {
    /// They may list columns in another order.
    Possible,
    /// They list columns in another order.
    Certain,
}

/// A word in the list of a comment that names a column.
#[derive(Clone, Copy, Debug)]
struct Listed {
    word: ColumnWord,
    /// The place of the column, if a number says it.
    place: Option<usize>,
    /// Which token it is.
    at: usize,
}

/// How columns are called. A list calls all of its columns in one way.
const STYLES: [fn(ColumnWord) -> Option<usize>; 3] = [
    |word| match word {
        ColumnWord::Letter(axis) => Some(axis),
        _ => None,
    },
    |word| match word {
        ColumnWord::Initial(axis) => Some(axis),
        _ => None,
    },
    |word| match word {
        ColumnWord::Direction(axis) => Some(axis),
        _ => None,
    },
];

/// Returns what these comments say against x, y and z as the first three of `columns` columns, and the number of the comment.
pub(crate) fn doubt(texts: &[&[u8]], columns: usize) -> Option<(usize, Doubt)> {
    let lists: Vec<List> = texts.iter().map(|text| List::read(text)).collect();
    let alone = lists.iter().enumerate().filter_map(|(at, list)| Some((at, list.doubt(columns)?)));
    alone.max_by_key(|(at, doubt)| (*doubt, *at)).or_else(|| {
        let (first, joined) = List::join(&lists)?;
        Some((first, joined.doubt(columns)?))
    })
}

/// Returns the number of a comment that says that x is the northing, or lists northing and easting in another order than x and y, which
/// are columns of these names. `order` are the places of x and y.
pub(crate) fn doubt_about_letters(texts: &[&[u8]], order: [usize; 2]) -> Option<usize> {
    texts.iter().rposition(|text| {
        let list = List::read(text);
        let is_direction = |word: &ColumnWord| matches!(word, ColumnWord::Direction(_) | ColumnWord::Initial(_));
        let words = list.listed.iter().map(|listed| listed.word);
        let directions: Vec<Option<usize>> = words.filter(is_direction).map(ColumnWord::axis).collect();
        let is_other_order = directions == if order[0] < order[1] { [Some(1), Some(0)] } else { [Some(0), Some(1)] };
        let meanings = list.meanings_of_letters();
        list.crosses_letters() || meanings.is_empty() && is_other_order && list.is_dense()
    })
}

/// The columns that a comment lists.
struct List {
    tokens: Vec<Token>,
    /// In the order of their places, if these are given.
    listed: Vec<Listed>,
}

impl List {
    fn read(text: &[u8]) -> List {
        let tokens = if is_system(text) { Vec::new() } else { tokens(text) };
        let listed = listed(&tokens).unwrap_or_default();
        List { tokens, listed }
    }

    /// Returns the list of all comments with nothing but names of columns in them, and the number of the first of them.
    fn join(lists: &[List]) -> Option<(usize, List)> {
        let part = |list: &List| {
            let part = list.before_remark();
            (!part.listed.is_empty() && part.is_dense()).then_some(part)
        };
        let first = lists.iter().position(|list| part(list).is_some())?;
        let mut joined = List { tokens: Vec::new(), listed: Vec::new() };
        for list in lists.iter().filter_map(part) {
            let before = joined.tokens.len();
            joined.listed.extend(list.listed.iter().map(|listed| Listed { at: before + listed.at, ..*listed }));
            joined.tokens.extend(&list.tokens);
            joined.tokens.push(Token::Separator);
        }
        by_place(&mut joined.listed);
        Some((first, joined))
    }

    /// Returns the list without the remark that follows the name of a column after its place, as in "column 1: northing of the prism".
    fn before_remark(&self) -> List {
        let is_sign = |token: &&Token| !matches!(token, Token::List | Token::Separator);
        let mut start = self.tokens.iter().filter(is_sign);
        let is_placed = matches!((start.next(), start.next()), (Some(Token::Place(_)), Some(Token::Column(_))));
        let is_remark = |token: &Token| matches!(token, Token::Unknown | Token::Stop);
        let end = self.tokens.iter().position(is_remark).filter(|_| is_placed).unwrap_or(self.tokens.len());
        let listed = self.listed.iter().copied().filter(|listed| listed.at < end).collect();
        List { tokens: self.tokens[..end].to_vec(), listed }
    }

    /// Returns whether all words belong to a list of columns.
    fn is_dense(&self) -> bool {
        !self.tokens.iter().any(|token| matches!(token, Token::Unknown | Token::Value))
            && (self.is_named_list() || !self.tokens.contains(&Token::Stop))
    }

    /// Returns whether a word says that columns are listed.
    fn is_named_list(&self) -> bool {
        self.tokens.contains(&Token::List)
    }

    /// Returns what the letters x and y mean, as pairs of axes: (0, 1) if x is the northing.
    fn meanings_of_letters(&self) -> Vec<(usize, usize)> {
        let (mut letter, mut meanings) = (None, Vec::new());
        for token in &self.tokens {
            match token {
                Token::Column(ColumnWord::Letter(axis)) => letter = Some(*axis),
                Token::Column(ColumnWord::Direction(axis) | ColumnWord::Initial(axis)) => {
                    meanings.extend(letter.take().map(|letter| (letter, *axis)));
                }
                Token::List | Token::Filler | Token::Separator => {}
                Token::Stop if self.is_named_list() => {}
                _ => letter = None,
            }
        }
        meanings
    }

    /// Returns whether letters mean the direction of the other letter, each that means one.
    fn crosses_letters(&self) -> bool {
        let meanings = self.meanings_of_letters();
        let are_crossed = meanings.iter().all(|(letter, axis)| letter != axis);
        are_crossed && (meanings.len() >= 2 || meanings.len() == 1 && self.is_dense())
    }

    fn doubt(&self, columns: usize) -> Option<Doubt> {
        let crossed = self.crosses_letters().then_some(Doubt::Certain);
        crossed.or_else(|| STYLES.iter().filter_map(|style| self.doubt_in(*style, columns)).max())
    }

    /// Returns the doubt about columns that are called in one way.
    fn doubt_in(&self, style: fn(ColumnWord) -> Option<usize>, columns: usize) -> Option<Doubt> {
        let is_letter = |listed: &Listed| matches!(listed.word, ColumnWord::Letter(_));
        let has_letters = self.listed.iter().any(is_letter);
        let is_letters = style(ColumnWord::Letter(0)).is_some();
        // The z of "x y z" is no word for a column of another list.
        let axis = |listed: &Listed| match listed.word {
            ColumnWord::Z if is_letters || !has_letters => Some(2),
            ColumnWord::Height => Some(2),
            word => style(word),
        };
        let (mut run, mut doubts): (Vec<Listed>, Vec<Option<Doubt>>) = (Vec::new(), Vec::new());
        for listed in &self.listed {
            let own = axis(listed);
            if own.is_none() && !matches!(listed.word, ColumnWord::Other | ColumnWord::Depth) {
                continue;
            }
            if let Some(last) = run.iter().rposition(|other| own.is_some() && axis(other) == own) {
                run.drain(..=last);
            }
            if run.len() >= MOST_OTHERS {
                run.remove(0);
            }
            run.push(*listed);
            if run.iter().filter(|listed| axis(listed).is_some()).count() == 3 {
                doubts.push(self.doubt_about_three(&std::mem::take(&mut run), axis, columns));
            }
        }
        doubts.push(self.doubt_about_two(&run, axis));
        doubts.into_iter().flatten().max()
    }

    /// Returns the doubt about a list that ends with the third of x, y and z.
    fn doubt_about_three(
        &self,
        run: &[Listed],
        axis: impl Fn(&Listed) -> Option<usize>,
        columns: usize,
    ) -> Option<Doubt> {
        let run = self.without_remote_start(run);
        let axes: Vec<usize> = run.iter().filter_map(&axis).collect();
        let is_in_order = axes == [0, 1, 2];
        let has_others = axes.len() < run.len();
        // The places count from 0 or 1.
        let are_first = match run.iter().map(|listed| listed.place).collect::<Option<Vec<usize>>>() {
            Some(places) => !has_others && places[0] <= 1 && places.windows(2).all(|pair| pair[0] + 1 == pair[1]),
            None => !has_others || columns == 3,
        };
        if is_in_order && are_first {
            return None;
        }
        let between = self.between(run);
        let count = |wanted: Token| between.iter().filter(|token| **token == wanted).count();
        let unknown = count(Token::Unknown);
        if unknown == 0 && (count(Token::Stop) == 0 || self.is_named_list()) {
            return Some(Doubt::Certain);
        }
        let is_list = self.is_named_list() || count(Token::Separator) + 1 >= run.len();
        (unknown <= MOST_UNKNOWN && is_list).then_some(Doubt::Possible)
    }

    /// Returns the doubt about a list with x and y alone, or with the depth.
    fn doubt_about_two(&self, run: &[Listed], axis: impl Fn(&Listed) -> Option<usize>) -> Option<Doubt> {
        let axes: Vec<usize> = run.iter().filter_map(&axis).collect();
        let has_depth = run.iter().any(|listed| listed.word == ColumnWord::Depth);
        let is_before = |listed: &&Listed| axis(listed).is_none();
        let begins_otherwise = run.iter().take_while(is_before).count() > 0;
        let is_other = axes == [1, 0] || axes == [0, 1] && (has_depth || begins_otherwise);
        if !is_other {
            return None;
        }
        let between = self.between(run);
        let is_list = between.contains(&Token::Separator) && !between.contains(&Token::Unknown) && self.is_named_list();
        if self.is_dense() { Some(Doubt::Certain) } else { is_list.then_some(Doubt::Possible) }
    }

    /// Returns a list without other columns at its start that words part from the next.
    fn without_remote_start<'a>(&self, mut run: &'a [Listed]) -> &'a [Listed] {
        while let [first, rest @ ..] = run
            && first.word == ColumnWord::Other
            && let Some(next) = rest.first()
            && self.between(&[*first, *next]).iter().any(|token| matches!(token, Token::Unknown | Token::Stop))
        {
            run = rest;
        }
        run
    }

    /// Returns the tokens from the first to the last word of a list.
    fn between(&self, run: &[Listed]) -> &[Token] {
        let places = || run.iter().map(|listed| listed.at);
        match (places().min(), places().max()) {
            (Some(first), Some(last)) => &self.tokens[first..=last],
            _ => &[],
        }
    }
}

/// Returns whether a comment describes a CRS in the words of a program, in which axes have another order than columns.
fn is_system(text: &[u8]) -> bool {
    let text = String::from_utf8_lossy(text).to_lowercase();
    ["axis[", "proj=", "cs[", "crs["].iter().any(|mark| text.contains(mark))
}

/// Returns the columns that these tokens list, in the order of their places; `None` if they give values, such as "north: 5933000".
fn listed(tokens: &[Token]) -> Option<Vec<Listed>> {
    if gives_values(tokens) || tokens.iter().filter(|token| matches!(token, Token::Column(_))).count() > MOST_COLUMNS {
        return None;
    }
    let beside = columns_and_places(tokens);
    let columns = beside.iter().filter_map(|(at, token)| match token {
        Token::Column(word) => Some(Listed { word: *word, place: None, at: *at }),
        _ => None,
    });
    let mut listed: Vec<Listed> = columns.collect();
    if beside.len() == listed.len() {
        return Some(listed);
    }
    let is_place_first = matches!(beside.first(), Some((_, Token::Place(_))));
    give_places(&mut listed, &beside, is_place_first);
    let mut places: Vec<usize> = listed.iter().filter_map(|listed| listed.place).collect();
    let have_all = places.len() == listed.len();
    places.dedup();
    // "north 3, east 4" are values.
    let are_places =
        is_place_first || tokens.contains(&Token::List) || places.iter().min().is_none_or(|least| *least <= 1);
    if have_all && !are_places {
        return None;
    }
    if have_all && (places.len() > 1 || listed.len() == 1 || has_one_letter_and_direction(&listed)) {
        by_place(&mut listed);
    } else if is_place_first {
        // "3 columns: x y z"
        listed.iter_mut().for_each(|listed| listed.place = None);
    } else {
        return None;
    }
    Some(listed)
}

/// Returns whether numbers that are no places of columns stand beside columns.
fn gives_values(tokens: &[Token]) -> bool {
    let is_before = tokens.windows(2).any(|pair| matches!(pair, [Token::Value, Token::Column(_)]));
    let relevant: Vec<&Token> =
        tokens.iter().filter(|token| !matches!(token, Token::List | Token::Separator)).collect();
    is_before || relevant.windows(2).any(|pair| matches!(pair, [Token::Column(_), Token::Value]))
}

/// Returns the columns, and the numbers beside them that may be their places, with the numbers of their tokens.
fn columns_and_places(tokens: &[Token]) -> Vec<(usize, Token)> {
    let numbered = tokens.iter().copied().enumerate();
    let is_relevant = |token: &Token| !matches!(token, Token::List | Token::Separator | Token::Stop);
    let relevant: Vec<(usize, Token)> = numbered.filter(|(_, token)| is_relevant(token)).collect();
    let is_column = |at: usize| relevant.get(at).is_some_and(|(_, token)| matches!(token, Token::Column(_)));
    let is_beside = |at: usize| is_column(at + 1) || at.checked_sub(1).is_some_and(is_column);
    let is_wanted = |(at, (_, token)): &(usize, &(usize, Token))| match token {
        Token::Column(_) => true,
        Token::Place(_) => is_beside(*at),
        _ => false,
    };
    relevant.iter().enumerate().filter(is_wanted).map(|(_, found)| *found).collect()
}

/// Returns whether two words name one column, as in "column 1: x (north)".
fn has_one_letter_and_direction(listed: &[Listed]) -> bool {
    matches!(
        listed,
        [
            Listed { word: ColumnWord::Letter(_), .. },
            Listed { word: ColumnWord::Direction(_) | ColumnWord::Initial(_), .. }
        ]
    )
}

/// Gives columns the numbers before them, or those after them.
fn give_places(listed: &mut [Listed], beside: &[(usize, Token)], is_place_first: bool) {
    let places = beside.iter().filter_map(|(at, token)| match token {
        Token::Place(place) => Some((*at, *place)),
        _ => None,
    });
    let places: Vec<(usize, usize)> = places.collect();
    for listed in listed {
        let found = if is_place_first {
            places.iter().rev().find(|(at, _)| *at < listed.at)
        } else {
            places.iter().find(|(at, _)| *at > listed.at)
        };
        listed.place = found.map(|(_, place)| *place);
    }
}

/// Puts columns in the order of their places, if all have one.
fn by_place(listed: &mut [Listed]) {
    if listed.iter().all(|listed| listed.place.is_some()) {
        listed.sort_by_key(|listed| listed.place);
    }
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
            "1=time, 2=x, 3=y, 4=z",
            "[1] time\n[2] x\n[3] y\n[4] z",
            "column 2 = easting, column 1 = northing, column 3 = height",
            "easting: column 2; northing: column 1; height: column 3",
            "column 2 = easting, 3 = northing, 4 = height",
            "X Y Z are in the order north east up",
            "X is north and Y is east",
            "PNEZD",
            "Format: YXH",
            "Data in the format northing, then easting and ellipsoidal elevation, exported from a device",
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
            "y1,x1,z1",
            "Βορράς Ανατολή Υψόμετρο",
            "GridNorth GridEast GridHeight",
            "mN mE mRL",
            "Nordachse, Ostachse, Hoehe",
            "NED",
            "A: north\nB: east\nC: height",
            "Coordenada Norte Coordenada Este Cota",
            "Northing and easting in metres, heights DHHN2016",
        ] {
            assert_eq!(doubt_of(comments, 3), Some(Doubt::Certain), "{comments}");
        }
        assert_eq!(doubt_of("time of day, x, y, z", 4), Some(Doubt::Certain));
        assert_eq!(doubt_of("northing (checked), easting (checked), height", 3), Some(Doubt::Possible));
    }

    #[test]
    fn sentences_and_values_are_no_lists() {
        for comments in [
            "made by a scanner, north of the river",
            "North Carolina lidar, East county",
            "east of the river, north bank, height DHHN92",
            "scanned from north to east, height in m",
            "site north east corner",
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
            assert_eq!(doubt_of(comments, 3), None, "{comments}");
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
    }
}
