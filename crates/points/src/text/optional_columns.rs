//! Columns of colours, classes and intensities: what they hold, and what of them cannot be read. A point is a point without them.

use crate::text::delimiter::Delimiter;
use crate::text::lines::shown;
use crate::text::number::Number;
use crate::text::role::ColumnRole;

/// Returns the colour or the intensity that `number` stands for; `None` if there is none that is so dark or bright.
#[inline]
pub(crate) fn brightness_of(number: Number, is_unit: bool) -> Option<u16> {
    if is_unit {
        return Some((number.value().clamp(0.0, 1.0) * u16::MAX as f64).round() as u16);
    }
    let (nearest, _) = number.steps(0)?;
    u16::try_from(nearest).ok()
}

/// Returns the class that `number` stands for; `None` if it is no whole number from 0 to 255.
#[inline]
pub(crate) fn class_of(number: Number) -> Option<u8> {
    let number = number.shortest();
    if number.decimals == 0 && !number.rounded { u8::try_from(number.mantissa).ok() } else { None }
}

/// Skips the columns of colours if most of these rows have none that can be read. Returns a warning if one has not.
pub(crate) fn drop_unreadable_colors(delimiter: Delimiter, roles: &mut [ColumnRole], rows: &[&[u8]]) -> Option<String> {
    let is_color = |role: &ColumnRole| matches!(role, ColumnRole::Color(_));
    let bad = |row: &&&[u8]| {
        let color = |field: &[u8]| Number::parse(field).and_then(|number| brightness_of(number, false));
        unreadable(delimiter, roles, row, is_color, |field| color(field).is_some())
    };
    let found: Vec<String> = rows.iter().filter_map(|row| bad(&row)).collect();
    let example = found.first()?;
    if found.len() * 2 <= rows.len() {
        return Some(format!("some colours are not numbers from 0 to 65535, such as {example}: they are read as 0"));
    }
    for role in roles.iter_mut().filter(|role| is_color(role)) {
        *role = ColumnRole::Skipped;
    }
    Some(format!(
        "its colours are not numbers from 0 to 65535, such as {example}, and are ignored; fix: [input.csv] columns, if these \
     are not the colours"
    ))
}

/// Returns a warning if one of these rows has a class that cannot be read.
pub(crate) fn unreadable_class(delimiter: Delimiter, roles: &[ColumnRole], rows: &[&[u8]]) -> Option<String> {
    let is_class = |role: &ColumnRole| *role == ColumnRole::Class;
    let class = |field: &[u8]| Number::parse(field).and_then(class_of);
    let example = rows.iter().find_map(|row| unreadable(delimiter, roles, row, is_class, |f| class(f).is_some()))?;
    Some(format!(
        "some classes are not whole numbers from 0 to 255, such as {example}: they are read as 0, \"never classified\""
    ))
}

/// Returns a warning if one of these rows has an intensity that cannot be read.
pub(crate) fn unreadable_intensity(delimiter: Delimiter, roles: &[ColumnRole], rows: &[&[u8]]) -> Option<String> {
    let is_intensity = |role: &ColumnRole| *role == ColumnRole::Intensity;
    let intensity = |field: &[u8]| Number::parse(field).and_then(|number| brightness_of(number, false));
    let is_readable = |field: &[u8]| intensity(field).is_some();
    let example = rows.iter().find_map(|row| unreadable(delimiter, roles, row, is_intensity, is_readable))?;
    Some(format!("some intensities are not numbers from 0 to 65535, such as {example}: they are read as 0"))
}

/// Returns the first column of `row` with a wanted role that holds something which cannot be read, for a message.
fn unreadable(
    delimiter: Delimiter,
    roles: &[ColumnRole],
    row: &[u8],
    is_wanted: impl Fn(&ColumnRole) -> bool,
    is_readable: impl Fn(&[u8]) -> bool,
) -> Option<String> {
    if !roles.iter().any(&is_wanted) {
        return None;
    }
    let fields = delimiter.fields(row);
    let mut columns = fields.iter().zip(roles).filter(|(_, role)| is_wanted(role));
    columns.find(|(field, _)| !field.is_empty() && !is_readable(field)).map(|(field, _)| shown(field))
}

/// The colours or the intensities of rows: from 0 to 1, or whole numbers. A whole text has one scale, and its first rows may be black.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BrightnessScale {
    /// The number of rows whose values are from 0 to 1, one of them with decimals.
    from_0_to_1: u64,
    /// The number of rows with a value that is not.
    others: u64,
}

/// The colours or the intensity of one row.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RowBrightness {
    is_beyond: bool,
    has_decimals: bool,
}

impl RowBrightness {
    #[inline]
    pub(crate) fn see(&mut self, value: &Number) {
        if value.decimals == 0 {
            self.is_beyond |= !(0..=1).contains(&value.mantissa);
        } else {
            let value = value.value();
            self.is_beyond |= !(0.0..=1.0).contains(&value);
            self.has_decimals |= value.fract() != 0.0;
        }
    }
}

impl BrightnessScale {
    #[inline]
    pub(crate) fn see(&mut self, row: RowBrightness) {
        self.from_0_to_1 += (row.has_decimals && !row.is_beyond) as u64;
        self.others += row.is_beyond as u64;
    }

    pub(crate) fn add(&mut self, other: &BrightnessScale) {
        self.from_0_to_1 += other.from_0_to_1;
        self.others += other.others;
    }

    /// Returns whether most rows say that the values are from 0 to 1.
    pub(crate) fn are_from_0_to_1(&self) -> bool {
        self.from_0_to_1 > self.others
    }

    /// Returns a warning about the values of this name, in the plural, if more rows than a few mistakes say otherwise.
    pub(crate) fn warning(&self, name: &str) -> Option<String> {
        const FEW: u64 = 1000;
        let (low, high) = (self.from_0_to_1, self.others);
        let taken = if self.are_from_0_to_1() { "as numbers from 0 to 1" } else { "as whole numbers" };
        (low.min(high) * FEW > low.max(high)).then(|| {
            format!(
                "its {name} have decimals from 0 to 1 in {low} rows, and other values in {high}: all are read {taken}"
            )
        })
    }
}
