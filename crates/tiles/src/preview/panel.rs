//! The strip below the terrain in the preview: a scale bar, the heights, and an arrow to the north.

use crate::color::{HeightRange, height_color, to_srgb};
use crate::preview::canvas::Canvas;
use crate::preview::strokes::{glyph, width};

/// The height of the strip in pixels.
pub(super) const HEIGHT: usize = 64;

/// The least width of the strip in pixels. A narrower terrain is in its middle.
pub(super) const LEAST_WIDTH: usize = 480;

/// The colours of the strip and of what is drawn on it, in sRGB.
const PAPER: [u8; 3] = [250, 250, 247];
const INK: [u8; 3] = [48, 50, 54];
const FRAME: [u8; 3] = [168, 168, 166];

/// From the sides of the strip to what is drawn on it.
const MARGIN: f32 = 20.0;

/// The least distance between two labels, and between a label and the scale bar.
const GAP: f32 = 12.0;

/// The height of a digit in pixels unless long numbers make them smaller, and half the breadth of its strokes.
const DIGIT: f32 = 10.0;
const HALF_STROKE: f32 = 0.75;

/// The longest scale bar and the ramp of heights in pixels.
const LONGEST_BAR: f64 = 160.0;
const RAMP: usize = 180;

/// Where the bars are, and where the bottoms of the letters are, in pixels from the top of the strip.
const BAR_TOP: usize = 38;
const BAR_HEIGHT: usize = 10;
const BASELINE: f32 = 28.0;

/// A foot in metres; a US foot is so near that a bar is as long.
const FOOT: f64 = 0.3048;

/// What the strip says.
#[derive(Clone, Debug, PartialEq)]
pub struct Legend {
    /// The length of the scale bar in pixels, and what it stands for.
    bar: (f64, String),
    /// The least and the greatest height.
    heights: [String; 2],
    /// Whether colours stand for heights.
    has_ramp: bool,
}

impl Legend {
    /// Returns the legend of what is drawn on `canvas`. `has_ramp` says whether colours stand for heights.
    pub fn new(canvas: &Canvas, has_ramp: bool) -> Legend {
        let HeightRange { low, high } = canvas.heights();
        let extras = canvas.frame().extras();
        let source = |z| canvas.frame().world([0, 0, z])[1] / extras.metres_per_unit_z + extras.offset[2];
        let (heights, unit) = in_unit([source(low), source(high)], extras.metres_per_unit_z);
        let decimals = decimals_for(heights[1] - heights[0]);
        let [low, high] = heights.map(|height| format!("{height:.decimals$}"));
        let pixel = canvas.pixel_size() * extras.metres_per_unit;
        Legend { bar: scale_bar(pixel, extras.metres_per_unit), heights: [low, format!("{high} {unit}")], has_ramp }
    }

    /// Returns the strip, row by row, in opaque pixels.
    pub(super) fn draw(&self, columns: usize) -> Vec<[u8; 4]> {
        let mut strip = Strip { columns, pixels: vec![PAPER; columns * HEIGHT] };
        self.draw_bar(&mut strip);
        let right = columns as f32 - MARGIN;
        strip.arrow(right - 8.0);
        self.draw_heights(&mut strip, right - 8.0 - 8.0 - 36.0);
        strip.pixels.into_iter().map(|[r, g, b]| [r, g, b, 255]).collect()
    }

    /// Draws two halves, one dark and one light, so that lengths can be read off.
    fn draw_bar(&self, strip: &mut Strip) {
        let (from, length) = (MARGIN as usize, self.bar.0.round() as usize);
        strip.fill([from, BAR_TOP], [length, BAR_HEIGHT], |_| INK);
        strip.fill([from + length / 2, BAR_TOP + 1], [length - length / 2 - 1, BAR_HEIGHT - 2], |_| PAPER);
        strip.text(MARGIN, "0");
        let label = &self.bar.1;
        strip.text((MARGIN + length as f32 - text_width(label)).max(MARGIN + 14.0), label);
    }

    /// Draws the ramp, which ends at column `right`, with the heights of its ends above; without colours by height only the heights.
    fn draw_heights(&self, strip: &mut Strip, right: f32) {
        let [low, high] = &self.heights;
        let left = right - RAMP as f32;
        let (digit, width) = side_by_side([low.as_str(), high.as_str()], right - (MARGIN + LONGEST_BAR as f32 + GAP));
        strip.text_at([right - text_width(high) * digit / DIGIT, BASELINE - digit], digit, high);
        strip.text_at([right - width, BASELINE - digit], digit, low);
        let range = HeightRange { low: 0, high: RAMP as i32 - 1 };
        let color = |column: usize| match self.has_ramp {
            true => height_color(column as i32, range).map(to_srgb),
            // From one height to the other, a thin line.
            false => INK,
        };
        if self.has_ramp {
            // The last colours are nearly those of the paper.
            strip.fill([left as usize - 1, BAR_TOP - 1], [RAMP + 2, BAR_HEIGHT + 2], |_| FRAME);
        }
        let (top, height) = if self.has_ramp { (BAR_TOP, BAR_HEIGHT) } else { (BAR_TOP + BAR_HEIGHT / 2, 2) };
        strip.fill([left as usize, top], [RAMP, height], color);
        if !self.has_ramp {
            for end in [left as usize, right as usize - 2] {
                strip.fill([end, BAR_TOP], [2, BAR_HEIGHT], |_| INK);
            }
        }
    }
}

/// Returns values of a unit of `metres` in metres, or in feet if the unit is a foot, and the name of that unit.
fn in_unit<const N: usize>(values: [f64; N], metres: f64) -> ([f64; N], &'static str) {
    match (metres - FOOT).abs() < 1e-5 {
        true => (values, "ft"),
        false => (values.map(|value| value * metres), "m"),
    }
}

/// Returns how many decimals tell a hundredth of `span` apart.
fn decimals_for(span: f64) -> usize {
    [100.0, 10.0, 1.0].iter().position(|limit| span >= *limit).unwrap_or(3)
}

/// Returns the length in pixels of a scale bar of a round length, and that length. A pixel has `pixel` metres.
fn scale_bar(pixel: f64, metres_per_unit: f64) -> (f64, String) {
    let ([_], unit) = in_unit([0.0], metres_per_unit);
    let unit_metres = if unit == "ft" { FOOT } else { 1.0 };
    let longest = LONGEST_BAR * pixel / unit_metres;
    let mut power = 1e-6;
    while power * 10.0 <= longest {
        power *= 10.0;
    }
    let length = [5.0, 2.0].iter().map(|digit| digit * power).find(|length| *length <= longest).unwrap_or(power);
    let text = match unit {
        "m" if length >= 999.0 => format!("{} km", number(length / 1000.0)),
        "m" if length < 0.0099 => format!("{} mm", number(length * 1000.0)),
        "m" if length < 0.99 => format!("{} cm", number(length * 100.0)),
        _ => format!("{} {unit}", number(length)),
    };
    (length * unit_metres / pixel, text)
}

/// Returns a number of one digit and zeros; sums of powers of ten are not quite round.
fn number(value: f64) -> String {
    let decimals = [1.0, 0.1, 0.01].iter().position(|limit| value > limit * 0.99).unwrap_or(3);
    format!("{value:.decimals$}")
}

fn text_width(text: &str) -> f32 {
    width(text) * DIGIT / 6.0
}

/// Returns the height of digits at which two labels fit `room` side by side, and how wide they are together then: no less than the ramp, over
/// whose ends they stand.
fn side_by_side(labels: [&str; 2], room: f32) -> (f32, f32) {
    let wanted = text_width(labels[0]) + text_width(labels[1]);
    let share = ((room - GAP) / wanted).min(1.0);
    (DIGIT * share, (wanted * share + GAP).max(RAMP as f32))
}

/// The strip while it is drawn.
struct Strip {
    columns: usize,
    pixels: Vec<[u8; 3]>,
}

impl Strip {
    /// Fills a rectangle; `color` returns the colour of a column of it.
    fn fill(&mut self, [left, top]: [usize; 2], [width, height]: [usize; 2], color: impl Fn(usize) -> [u8; 3]) {
        for row in top..(top + height).min(HEIGHT) {
            for column in left..(left + width).min(self.columns) {
                self.pixels[row * self.columns + column] = color(column - left);
            }
        }
    }

    /// Writes a text from column `left` on, above the bars.
    fn text(&mut self, left: f32, text: &str) {
        self.text_at([left, BASELINE - DIGIT], DIGIT, text);
    }

    /// Writes a text whose digits have the height `digit`.
    fn text_at(&mut self, [left, top]: [f32; 2], digit: f32, text: &str) {
        let scale = digit / 6.0;
        let mut at = left;
        for character in text.chars() {
            let glyph = glyph(character);
            for stroke in glyph.strokes {
                for pair in stroke.windows(2) {
                    let end = |[x, y]: [f32; 2]| [at + x * scale, top + y * scale];
                    self.line(end(pair[0]), end(pair[1]), HALF_STROKE);
                }
            }
            at += glyph.advance * scale;
        }
    }

    /// Draws an arrow upwards around column `middle`, with an N below.
    fn arrow(&mut self, middle: f32) {
        let (tip, wing) = ([middle, 9.0], 31.0);
        for step in 0..=14 {
            // The left half is filled.
            let x = middle - step as f32 * 0.5;
            let share = step as f32 / 14.0;
            self.line([x, 9.0 + share * (wing - 9.0)], [x, wing - 5.0 + share * 5.0], 0.5);
        }
        for side in [-7.0, 7.0] {
            self.line(tip, [middle + side, wing], 0.6);
            self.line([middle + side, wing], [middle, wing - 5.0], 0.6);
        }
        self.line(tip, [middle, wing - 5.0], 0.6);
        self.text_at([middle - text_width("N") / 2.0, 40.0], DIGIT, "N");
    }

    /// Draws a line with round ends, with smooth borders: a pixel gets as much ink as its middle is near.
    fn line(&mut self, from: [f32; 2], to: [f32; 2], half: f32) {
        let reach = half + 1.0;
        let span = |axis: usize, most: usize| {
            let (low, high) = (from[axis].min(to[axis]) - reach, from[axis].max(to[axis]) + reach);
            low.max(0.0) as usize..(high.max(0.0) as usize + 1).min(most)
        };
        for row in span(1, HEIGHT) {
            for column in span(0, self.columns) {
                let distance = distance([column as f32 + 0.5, row as f32 + 0.5], from, to);
                let ink = (half + 0.5 - distance).clamp(0.0, 1.0);
                let pixel = &mut self.pixels[row * self.columns + column];
                *pixel = [0, 1, 2].map(|k| (f32::from(pixel[k]) * (1.0 - ink) + f32::from(INK[k]) * ink + 0.5) as u8);
            }
        }
    }
}

/// Returns the distance between a point and a line from `a` to `b`.
fn distance(point: [f32; 2], a: [f32; 2], b: [f32; 2]) -> f32 {
    let ([dx, dy], [px, py]) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
    let length = dx * dx + dy * dy;
    let share = if length > 0.0 { ((px * dx + py * dy) / length).clamp(0.0, 1.0) } else { 0.0 };
    let (x, y) = (px - share * dx, py - share * dy);
    (x * x + y * y).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_have_round_lengths_that_fit() {
        for (pixel, unit, text) in [
            (1.0, 1.0, "100 m"),
            (0.95, 1.0, "100 m"),
            (10.0, 1.0, "1 km"),
            (100.0, 1.0, "10 km"),
            (2.0, 1.0, "200 m"),
            (0.004, 1.0, "50 cm"),
            (0.00001, 1.0, "1 mm"),
            (0.000_001, 1.0, "0.1 mm"),
            (0.3048, 0.3048, "100 ft"),
            (0.3048, 1200.0 / 3937.0, "100 ft"),
            (5_000.0, 1.0, "500 km"),
        ] {
            let (length, found) = scale_bar(pixel, unit);
            assert_eq!(found, text, "{pixel}");
            assert!(length > LONGEST_BAR / 2.6 && length <= LONGEST_BAR + 1e-6, "{pixel}: {length}");
        }
    }

    #[test]
    fn every_character_of_a_legend_has_strokes() {
        for character in "0123456789.-Nmkcft".chars() {
            assert!(!glyph(character).strokes.is_empty(), "{character}");
        }
        assert!(text_width("100 km") > text_width("100 m") && text_width("1") > 0.0);
    }

    /// Returns the widest run of columns without ink between the first label of the heights and the last, in pixels.
    fn widest_gap(heights: [&str; 2]) -> usize {
        let heights = heights.map(str::to_owned);
        let legend = Legend { bar: (100.0, "1 m".into()), heights, has_ramp: false };
        let pixels = legend.draw(LEAST_WIDTH);
        let inked = |column: &usize| (0..BAR_TOP - 4).any(|row| pixels[row * LEAST_WIDTH + column][..3] != PAPER);
        // The arrow is right of the labels.
        let columns: Vec<usize> = (130..LEAST_WIDTH - 70).filter(inked).collect();
        assert!(columns[0] >= MARGIN as usize + LONGEST_BAR as usize, "{columns:?}");
        columns.windows(2).map(|two| two[1] - two[0] - 1).max().unwrap()
    }

    #[test]
    fn labels_of_heights_do_not_touch_each_other() {
        for heights in [
            ["12", "345 m"],
            ["1234567.125", "1234567.250 m"],
            ["-1234567.125", "-1234567.000 ft"],
            ["123456789012.125", "123456789012.250 m"],
            ["-12345678901234567890", "12345678901234567890 ft"],
        ] {
            assert!(widest_gap(heights) >= 7, "{heights:?}: {} pixels", widest_gap(heights));
        }
    }

    #[test]
    fn decimals_tell_a_hundredth_of_the_heights_apart() {
        assert_eq!([1000.0, 100.0, 99.0, 5.0, 0.2, 0.0].map(decimals_for), [0, 0, 1, 2, 3, 3]);
    }
}
