//! What the columns of a text mean, as the options say or as the first lines show.

use std::borrow::Cow;
use std::cmp::Reverse;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::points::returns::KeptReturns;
use crate::text::comment_names::{names_in_comments, texts_of};
use crate::text::commented_header::{Comments, UnreadHeader};
use crate::text::decimal_comma;
use crate::text::decimal_comma::{CommaUse, Names};
use crate::text::decimal_sign;
use crate::text::decimal_sign::DecimalSign;
use crate::text::delimiter::{CANDIDATES, Delimiter};
use crate::text::header;
use crate::text::header::{names_among_rows, separator_line};
use crate::text::lines::is_skipped;
use crate::text::lines_between::TextStart;
use crate::text::names::{NamedColumns, named_columns, truncate};
use crate::text::nodata_rows::NodataRows;
use crate::text::number::Number;
use crate::text::numbered::are_numbered;
use crate::text::optional_columns::{drop_unreadable_colors, unreadable_class, unreadable_intensity};
use crate::text::options::TextOptions;
use crate::text::role::ColumnRole;
use crate::text::row_choice::RowChoice;
use crate::text::thousands::are_separated;
use crate::text::units::UnitsOfAxes;
use sys::{Error, Result, Warnings};

/// The columns of a text that nothing names.
const COORDINATES: [ColumnRole; 3] = [ColumnRole::Coordinate(0), ColumnRole::Coordinate(1), ColumnRole::Coordinate(2)];

const DECIMAL_COMMA: &str = "has commas both between columns and before decimals, as in 565000,25,5933000,50: all its columns are whole \
                             numbers; write it again with points before decimals or with semicolons between columns, or name all \
                             of its columns with `columns` under [input.csv]";

const UNCLEAR_COMMA: &str = "has only whole numbers with commas between them, more than three in a row, and no line names all of them: the commas may also \
                             stand before decimals, as in 565000,25,5933000,50; if they do not, name all of its columns with `columns` under \
                             [input.csv], for example [\"x\", \"y\", \"z\", \"class\"], and if they do, write it again with points before \
                             decimals or with semicolons between columns";

const DOUBTFUL_COMMA: &str = "has whole numbers with commas between them and no full header: the commas are read as delimiters; fix: \
                              [input.csv] columns with all columns; if commas are decimal commas too, as in 565000,5933000,12,5, write \
                              points there";

const UNCLEAR_THOUSANDS: &str = "has commas that may stand before decimals or between thousands, as in 565,000: write it again with points \
                                 before decimals, and nothing between thousands";

const THOUSANDS: &str = "has blanks, commas or points between thousands, as in 565 000, so that parts of numbers look like columns or decimals: \
                         write it again with nothing between thousands, or name the columns with `columns` under [input.csv] if they are \
                         no thousands";

const NUMBERED: &str = "has columns that no line names, and the first of them counts the rows: it looks like the number of the point, and \
                        not like x; name the columns with `columns` under [input.csv], for example [\"id\", \"x\", \"y\", \"z\"], or \
                        [\"x\", \"y\", \"z\"] if the first is x";

/// How the lines of a text are to be read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Columns {
    /// What separates the columns of a row.
    pub(crate) delimiter: Delimiter,
    /// What each column holds, up to the last column that is used.
    pub(crate) roles: Vec<ColumnRole>,
    /// How many columns the text itself names. A row with more is malformed.
    pub(crate) named: Option<usize>,
    /// Whether decimals have a comma before them, not a point. If commas are also the delimiter, only those in quotes are that.
    pub(crate) decimal_comma: bool,
    /// Whether a row is malformed if its class cannot be read.
    pub(crate) strict_classes: bool,
    /// Whether colours are numbers from 0 to 1. Only all rows together show it.
    pub(crate) unit_colors: bool,
    /// Whether intensities are, likewise.
    pub(crate) unit_intensity: bool,
    /// The heights that stand for nodata. One that is too large for any height is no reason to take a row for malformed then.
    pub(crate) nodata: NodataRows,
    /// Lines that begin with one of these are skipped.
    comments: Vec<String>,
}

/// What the lines at the start of a text show.
pub(crate) struct DetectedColumns {
    pub(crate) columns: Columns,
    /// How many lines come before the rows.
    pub(crate) header_lines: usize,
    /// The number of rows, if the first line holds it.
    pub(crate) promised: Option<u64>,
    /// Whether x and y are named as longitude and latitude.
    pub(crate) degrees: bool,
    /// What the names say about units.
    pub(crate) units: UnitsOfAxes,
    /// What lines among the rows are compared with.
    pub(crate) start: TextStart,
}

impl Columns {
    /// Finds out how the text in `path` is laid out; `lines` are its first lines. `choice` tells which rows are wanted, and
    /// what of them.
    pub(crate) fn detect(
        path: &Path,
        lines: &[&[u8]],
        options: &TextOptions,
        choice: &RowChoice,
        warnings: &mut Warnings,
    ) -> Result<DetectedColumns> {
        let comments = comments(options)?;
        let mut rows: Vec<(usize, &[u8])> = lines.iter().copied().enumerate().collect();
        rows.retain(|(_, line)| !is_skipped(line, &comments));
        let Some(&(first_at, first)) = rows.first() else {
            let is_empty = lines.iter().all(|line| line.trim_ascii().is_empty());
            return Err(Error::input(
                path,
                match is_empty {
                    true => "has no line with numbers in it",
                    false => "has no line with numbers in it, and names no files: all its lines are comments",
                },
            ));
        };
        let mut header_lines = 0;
        let mut given = options.delimiter;
        if let Some(separator) = separator_line(first).filter(|_| rows.len() > 1) {
            given = given.or(Some(separator));
            header_lines = first_at + 1;
            rows.remove(0);
        }
        let mut candidates = match given {
            Some(delimiter) => vec![Delimiter::from_option(delimiter)?],
            None => CANDIDATES.to_vec(),
        };
        let written: Vec<&[u8]> = rows.iter().map(|(_, line)| *line).collect();
        let sign = decimal_sign::find(&written, &candidates);
        let is_comma = |delimiter: &Delimiter| *delimiter == Delimiter::Byte(b',');
        let pointed: Vec<Cow<[u8]>> = match sign {
            DecimalSign::Unclear => return Err(Error::input(path, UNCLEAR_THOUSANDS)),
            DecimalSign::Point => written.iter().map(|line| Cow::Borrowed(*line)).collect(),
            DecimalSign::Comma => {
                candidates.retain(|delimiter| !is_comma(delimiter));
                written.iter().map(|line| decimal_sign::pointed(line, &candidates)).collect()
            }
            DecimalSign::QuotedComma => {
                candidates.retain(is_comma);
                written.iter().map(|line| decimal_sign::pointed_in_quotes(line)).collect()
            }
        };
        let texts: Vec<&[u8]> = pointed.iter().map(|line| &**line).collect();
        let decimal_comma = sign != DecimalSign::Point;
        let header = header::find(&texts, &candidates, options.header, options.columns.is_some());
        if let Some((at, _)) = header.lines.checked_sub(1).and_then(|last| rows.get(last)) {
            header_lines = at + 1;
        }
        let data = &texts[header.lines..];
        let bad = |what: String| Error::input(path, what);
        let mut words = None;
        let mut doubts = None;
        header_lines = rows.get(header.lines).map_or(header_lines, |row| row.0);
        let before = &lines[..header_lines];
        let remarks = Comments { lines: before, marks: &comments, candidates: &candidates, rows: data };
        let found = match (&options.columns, header.names) {
            (Some(names), _) => {
                let mut named = named_by_user(names)?;
                let comments = before.iter().flat_map(|line| texts_of(line, &comments));
                let row = data.first().copied().unwrap_or_default();
                texts[..header.lines]
                    .iter()
                    .copied()
                    .chain(comments)
                    .for_each(|line| named.add_units_beside(line, row));
                Some(named)
            }
            (None, Some(names)) => Some(names.map_err(bad)?),
            (None, None) if options.header == Some(false) => None,
            (None, None) => {
                let in_comments = names_in_comments(before, &comments, &candidates, data).map_err(bad)?;
                words = in_comments.words;
                let unread = in_comments.named.is_none().then(|| remarks.unread_header(words.is_some()));
                match unread.flatten() {
                    Some(UnreadHeader::Certain(what)) => return Err(bad(what)),
                    Some(UnreadHeader::Possible(what)) => doubts = Some(what),
                    None => {}
                }
                let among_rows = || names_among_rows(data, &candidates);
                match in_comments.named {
                    Some(named) => Some(named),
                    None => among_rows().map_or(Ok(None), |what| Err(bad(what)))?,
                }
            }
        };
        if let Some(what) =
            found.as_ref().filter(|_| options.columns.is_none()).and_then(|named| remarks.other_directions(named))
        {
            return Err(bad(what));
        }
        let decides = options.columns.is_none() && options.header != Some(false);
        let start = TextStart::new(&remarks, found.as_ref(), decides);
        let mut roles = used_roles(found.as_ref(), choice);
        let delimiter = row_delimiter(&candidates, &roles, data);
        let places: Vec<usize> =
            (0..roles.len()).filter(|at| matches!(roles[*at], ColumnRole::Coordinate(_))).collect();
        if options.columns.is_none() && are_separated(delimiter, &places, data) {
            return Err(bad(THOUSANDS.to_string()));
        }
        if options.columns.as_ref().is_none_or(|names| data.iter().any(|row| delimiter.has_more_than(names.len(), row)))
        {
            let found = found.as_ref().filter(|_| options.columns.is_none());
            warnings.extend(refuse_decimal_comma(path, delimiter, found, words, data)?);
        }
        if found.is_none() && are_numbered(delimiter, data) {
            return Err(bad(NUMBERED.to_string()));
        }
        let is_filled = |field: &&[u8]| !field.is_empty();
        let filled = |row: &&[u8]| delimiter.fields(row).iter().rposition(is_filled).map_or(0, |last| last + 1);
        let columns_of_last = texts.last().map_or(0, filled);
        let units = found.as_ref().map_or(Ok(UnitsOfAxes::default()), NamedColumns::units);
        let units = units.map_err(|what| bad(format!("its header {what}")))?;
        let is_foot_unclear = units.some_foot && !choice.is_foot_stated;
        warnings.extend(doubts.or_else(|| names_warning(found.as_ref(), is_foot_unclear, columns_of_last)));
        warnings.extend(unknown_units(found.as_ref()));
        let named = found.as_ref().filter(|_| options.columns.is_none()).map(|found| found.count);
        warnings.extend(drop_unreadable_colors(delimiter, &mut roles, data));
        warnings.extend(unreadable_intensity(delimiter, &roles, data));
        truncate(&mut roles);
        let strict_classes = choice.strict_classes;
        warnings.extend(unreadable_class(delimiter, &roles, data).filter(|_| !strict_classes));
        let (unit_colors, unit_intensity) = (false, false);
        let nodata = NodataRows::named(&choice.nodata);
        let columns = Columns {
            delimiter,
            roles,
            named,
            decimal_comma,
            strict_classes,
            unit_colors,
            unit_intensity,
            nodata,
            comments,
        };
        let (promised, degrees) = (header.count, found.is_some_and(|found| found.degrees));
        Ok(DetectedColumns { columns, header_lines, promised, degrees, units, start })
    }

    /// Returns the sign before decimals.
    pub(crate) fn decimal_sign(&self) -> u8 {
        if self.decimal_comma { b',' } else { b'.' }
    }

    /// Returns whether `line` is blank or a comment.
    #[inline]
    pub(crate) fn skips(&self, line: &[u8]) -> bool {
        is_skipped(line, &self.comments)
    }

    /// Returns whether a column has the role `wanted`.
    pub(crate) fn have(&self, wanted: ColumnRole) -> bool {
        self.roles.contains(&wanted)
    }
}

fn named_by_user(names: &[String]) -> Result<NamedColumns> {
    named_columns(names.iter().map(|name| name.as_bytes()))
        .map_err(|error| Error::Config(format!("[input.csv] columns {error}")))
}

/// Returns what the columns hold that are used. Without names, the first three are x, y and z.
fn used_roles(found: Option<&NamedColumns>, choice: &RowChoice) -> Vec<ColumnRole> {
    let mut roles = found.map_or(COORDINATES.to_vec(), |found| found.roles.clone());
    let is_unwanted = |role: &&mut ColumnRole| match role {
        ColumnRole::Color(_) => !choice.fields.rgb,
        ColumnRole::Intensity => !choice.fields.intensity,
        ColumnRole::ReturnNumber => choice.returns == KeptReturns::All,
        // Only the last return takes both numbers to know.
        ColumnRole::Returns => choice.returns != KeptReturns::Last,
        _ => false,
    };
    roles.iter_mut().filter(is_unwanted).for_each(|role| *role = ColumnRole::Skipped);
    truncate(&mut roles);
    roles
}

fn unknown_units(found: Option<&NamedColumns>) -> Option<String> {
    let unknown = &found.filter(|found| !found.unknown_units.is_empty())?.unknown_units;
    Some(format!(
        "the unit \"{}\" in the names of its columns is unknown, and ignored; fix: [input] unit, if it is a unit of length",
        unknown.join("\" and \"")
    ))
}

fn names_warning(found: Option<&NamedColumns>, is_foot_unclear: bool, columns: usize) -> Option<String> {
    let warning = match found {
        None if columns > 3 => {
            "it has no header, so its first three columns are taken as x, y and z; fix: [input.csv] columns, if that is wrong"
        }
        Some(_) if is_foot_unclear => {
            "its columns are in feet of an unknown kind: international feet (0.3048 m) assumed; fix: us-ft in the names of its columns, as \
             in \"z [us-ft]\", for US survey feet"
        }
        _ => return None,
    };
    Some(warning.to_string())
}

/// Fails if commas stand before decimals too, or probably do, and returns a warning if they may. `words` are those of a comment that begins with x, y and z.
fn refuse_decimal_comma(
    path: &Path,
    delimiter: Delimiter,
    found: Option<&NamedColumns>,
    words: Option<usize>,
    rows: &[&[u8]],
) -> Result<Option<String>> {
    let names = match found {
        None => words.map_or(Names::None, Names::InComment),
        Some(found) if found.roles.starts_with(&COORDINATES) => Names::CoordinatesFirst,
        Some(_) => Names::Others,
    };
    match decimal_comma::second_use(delimiter, names, found.map(|found| found.count), rows) {
        Some(CommaUse::Decimals) => Err(Error::input(path, DECIMAL_COMMA)),
        Some(CommaUse::Unclear) => Err(Error::input(path, UNCLEAR_COMMA)),
        Some(CommaUse::Columns) => Ok(Some(DOUBTFUL_COMMA.to_string())),
        None => Ok(None),
    }
}

/// Returns what begins the lines that are skipped.
pub(crate) fn comments(options: &TextOptions) -> Result<Vec<String>> {
    match &options.comment {
        Some(comment) if comment.is_empty() => Ok(Vec::new()),
        Some(comment) if comment.starts_with(|c: char| c.is_ascii_digit()) => Err(Error::Config(format!(
            "[input.csv] comment = {comment:?} would skip rows; it cannot begin with a digit"
        ))),
        Some(comment) => Ok(vec![comment.clone()]),
        None => Ok(vec!["#".to_string(), "//".to_string()]),
    }
}

/// Returns the delimiter under which most rows have numbers as x, y and z. Of several, the first candidate wins.
fn row_delimiter(candidates: &[Delimiter], roles: &[ColumnRole], rows: &[&[u8]]) -> Delimiter {
    let fits = |delimiter: Delimiter, row: &&[u8]| {
        let fields = delimiter.fields(row);
        let number = |(column, role): (usize, &ColumnRole)| {
            !matches!(role, ColumnRole::Coordinate(_))
                || fields.get(column).is_some_and(|field| Number::parse(field).is_some())
        };
        roles.iter().enumerate().all(number)
    };
    let fitting = |delimiter: &Delimiter| rows.iter().filter(|row| fits(*delimiter, row)).count();
    let numbers = |delimiter: &Delimiter| rows.iter().map(|row| delimiter.numbers(row)).sum::<usize>();
    let best = candidates.iter().map(|delimiter| (Reverse(fitting(delimiter)), delimiter)).min_by_key(|best| best.0);
    match best {
        // No row can be read: at least the messages about them name the right columns.
        Some((Reverse(0), _)) => candidates.iter().min_by_key(|delimiter| Reverse(numbers(delimiter))),
        best => best.map(|(_, delimiter)| delimiter),
    }
    .copied()
    .unwrap_or(Delimiter::Blank)
}
