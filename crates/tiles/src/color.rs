//! Vertex colours. glTF has linear colours; sources have sRGB colours, or none.

use delaunay::geometry::Bounds;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// Linear red, green and blue, 65535 for full intensity.
pub type LinearRgb = [u16; 3];

/// The heights that the ramp of colours spans, in lattice integers. What is lower or higher has the colour of that end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct HeightRange {
    /// The height with the first colour.
    pub low: i32,
    /// The height with the last colour.
    pub high: i32,
}

impl HeightRange {
    /// Returns the heights of a box.
    #[inline]
    pub fn of(bounds: Bounds<3>) -> HeightRange {
        HeightRange { low: bounds.min[2], high: bounds.max[2] }
    }
}

/// How the sites of a job get their colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coloring {
    /// By the colour of the source.
    Rgb {
        /// Whether all values of the job are 0 to 255, in 16-bit fields.
        eight_bit: bool,
    },
    /// By height.
    Elevation(HeightRange),
    /// By ASPRS classification.
    Class,
}

impl Coloring {
    /// Returns the colours of sites with these lattice integers x, y, z, source colours and classifications.
    pub fn colors(&self, positions: &[[i32; 3]], rgb: &[[u16; 3]], class: &[u8]) -> Vec<LinearRgb> {
        match *self {
            // Most jobs: here the table is fetched once, not for every site.
            Coloring::Rgb { eight_bit: true } => {
                let table: [u16; 256] = std::array::from_fn(|v| decode_byte(v as u8));
                rgb.iter().map(|rgb| rgb.map(|v| table[v.min(255) as usize])).collect()
            }
            Coloring::Rgb { eight_bit: false } => {
                let table = &**TO_LINEAR;
                rgb.iter().map(|rgb| rgb.map(|v| table[v as usize])).collect()
            }
            _ => positions.iter().zip(rgb).zip(class).map(|((p, &rgb), &class)| self.color(p[2], rgb, class)).collect(),
        }
    }

    /// Returns the colour of a site with lattice integer `z`, source colour `rgb` and classification `class`.
    #[inline]
    pub fn color(&self, z: i32, rgb: [u16; 3], class: u8) -> LinearRgb {
        match *self {
            Coloring::Rgb { eight_bit: true } => rgb.map(|v| TO_LINEAR[v.min(255) as usize * 257]),
            Coloring::Rgb { eight_bit: false } => rgb.map(|v| TO_LINEAR[v as usize]),
            Coloring::Elevation(range) => height_color(z, range),
            Coloring::Class => class_color(class).map(decode_byte),
        }
    }
}

/// Returns the sRGB colour of an ASPRS classification.
#[inline]
pub fn class_color(class: u8) -> [u8; 3] {
    *CLASS_COLORS.get(class as usize).unwrap_or(&OTHER_CLASS)
}

/// Returns the colour of height `z` on the ramp over `range`.
pub fn height_color(z: i32, HeightRange { low, high }: HeightRange) -> LinearRgb {
    let (above, span) = (z as i64 - low as i64, (high as i64 - low as i64).max(1));
    let last = RAMP.len() as i64 - 1;
    RAMP[(above * last / span).clamp(0, last) as usize]
}

/// Returns a linear intensity as an sRGB byte.
#[inline]
pub fn to_srgb(linear: u16) -> u8 {
    FROM_LINEAR[linear as usize >> 4]
}

/// Returns the linear colour of an sRGB colour.
pub fn from_srgb(bytes: [u8; 3]) -> LinearRgb {
    bytes.map(decode_byte)
}

fn decode_byte(v: u8) -> u16 {
    TO_LINEAR[v as usize * 257]
}

/// Returns the linear value of an sRGB value (IEC 61966-2-1).
fn decode(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}

/// Returns the sRGB value of a linear value.
fn encode(v: f64) -> f64 {
    if v <= 0.0031308 { v * 12.92 } else { 1.055 * libm::pow(v, 1.0 / 2.4) - 0.055 }
}

// The tables decide bytes that must be the same everywhere, so `libm` computes them, not the machine's mathematics library.

static TO_LINEAR: LazyLock<Vec<u16>> =
    LazyLock::new(|| (0..=65535).map(|v| (decode(v as f64 / 65535.0) * 65535.0).round() as u16).collect());

/// sRGB bytes by the upper 12 bits of the linear value, each for the middle of its range.
static FROM_LINEAR: LazyLock<Vec<u8>> =
    LazyLock::new(|| (0..4096).map(|v| (encode((v as f64 + 0.5) / 4096.0) * 255.0).round() as u8).collect());

/// The hypsometric ramp in sRGB: river meadows, woods, dry slopes, rock, snow.
const RAMP_STOPS: [[u8; 3]; 7] = [
    [70, 120, 96],
    [112, 158, 104],
    [178, 190, 122],
    [222, 206, 148],
    [196, 156, 110],
    [160, 124, 104],
    [244, 242, 238],
];

static RAMP: LazyLock<Vec<LinearRgb>> = LazyLock::new(|| (0..2048).map(|i| ramp_at(i as f64 / 2047.0)).collect());

fn ramp_at(t: f64) -> LinearRgb {
    let position = t * (RAMP_STOPS.len() - 1) as f64;
    let (i, rest) = (position.floor().min((RAMP_STOPS.len() - 2) as f64), position.fract());
    let rest = if i < position.floor() { 1.0 } else { rest };
    let (a, b) = (RAMP_STOPS[i as usize], RAMP_STOPS[i as usize + 1]);
    [0, 1, 2].map(|k| {
        let encoded = a[k] as f64 * (1.0 - rest) + b[k] as f64 * rest;
        (decode(encoded / 255.0) * 65535.0).round() as u16
    })
}

/// sRGB colours of the standard classes 0 to 22 of LAS 1.4.
const CLASS_COLORS: [[u8; 3]; 23] = [
    [170, 170, 170], // never classified
    [190, 190, 190], // unclassified
    [166, 124, 82],  // ground
    [160, 200, 110], // low vegetation
    [96, 168, 80],   // medium vegetation
    [44, 122, 60],   // high vegetation
    [214, 96, 72],   // building
    [240, 60, 200],  // low noise
    [222, 196, 120], // model key point
    [72, 132, 204],  // water
    [120, 110, 130], // rail
    [110, 110, 116], // road surface
    [200, 180, 160], // overlap
    [236, 206, 70],  // wire guard
    [246, 174, 54],  // wire conductor
    [150, 80, 150],  // transmission tower
    [250, 130, 40],  // wire connector
    [150, 140, 150], // bridge deck
    [255, 40, 160],  // high noise
    [130, 150, 170], // overhead structure
    [120, 90, 60],   // ignored ground
    [226, 236, 246], // snow
    [200, 150, 200], // temporal exclusion
];

const OTHER_CLASS: [u8; 3] = [150, 160, 180];

#[cfg(test)]
mod tests {
    use super::*;

    fn by_height(low: i32, high: i32) -> Coloring {
        Coloring::Elevation(HeightRange { low, high })
    }

    #[test]
    fn eight_bit_colours_are_those_of_the_same_sixteen_bit_values() {
        let (eight, sixteen) = (Coloring::Rgb { eight_bit: true }, Coloring::Rgb { eight_bit: false });
        for v in 0..=255 {
            assert_eq!(eight.color(0, [v, 0, 255], 0), sixteen.color(0, [v * 257, 0, 65535], 0));
        }
        for coloring in [eight, sixteen, by_height(0, 9), Coloring::Class] {
            let (positions, rgb, class) = ([[0, 0, 3], [5, 5, 9]], [[1, 2, 300], [255, 65535, 256]], [2, 9]);
            let one_by_one = [0, 1].map(|i| coloring.color(positions[i][2], rgb[i], class[i]));
            assert_eq!(coloring.colors(&positions, &rgb, &class), one_by_one);
        }
        assert_eq!(eight.color(0, [0, 255, 188], 0), [0, 65535, 32957]);
    }

    #[test]
    fn bytes_come_back_from_linear_values() {
        for v in 0..=255 {
            // Twelve bits of linear light cannot tell the darkest bytes apart.
            let tolerance = if v < 24 { 2 } else { 0 };
            assert!(to_srgb(decode_byte(v)).abs_diff(v) <= tolerance, "{v}");
        }
    }

    #[test]
    fn heights_beyond_the_ramp_have_the_colours_of_its_ends() {
        let ramp = by_height(-100, 2_000_000_000);
        let color = |z| ramp.color(z, [0; 3], 0);
        assert_eq!(color(-100), RAMP_STOPS[0].map(decode_byte));
        assert_eq!(color(2_000_000_000), RAMP_STOPS[6].map(decode_byte));
        assert_eq!(color(i32::MIN), color(-100));
        assert_eq!(color(i32::MAX), color(2_000_000_000));
        assert_ne!(color(0), color(1_000_000_000));
        let flat = [4, 5, 6, i32::MAX].map(|z| by_height(5, 5).color(z, [0; 3], 0));
        let [first, last] = [0, 6].map(|stop| RAMP_STOPS[stop].map(decode_byte));
        assert_eq!(flat, [first, first, last, last]);
    }

    #[test]
    fn every_class_has_a_colour() {
        let color = |class| Coloring::Class.color(0, [0; 3], class);
        assert_ne!(color(2), color(9));
        assert_eq!(color(65), color(255));
    }
}
