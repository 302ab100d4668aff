//! How the colour of a pixel tells a height.

use serde::{Deserialize, Serialize};

/// What colours mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeightEncoding {
    /// Steps of 1/256 m above -32,768 m, as in the tiles of Mapzen and AWS.
    Terrarium,
    /// Steps of 0.1 m above -10,000 m, as in the tiles of Mapbox.
    TerrainRgb,
}

/// The greatest number of three bytes.
const GREATEST: f64 = 16_777_215.0;

impl HeightEncoding {
    /// Returns the height of code 0 in metres, and the number of steps in a metre.
    fn scale(self) -> [f64; 2] {
        match self {
            HeightEncoding::Terrarium => [-32_768.0, 256.0],
            HeightEncoding::TerrainRgb => [-10_000.0, 10.0],
        }
    }

    /// Returns red, green and blue of a height in metres: the nearest that there is.
    pub(crate) fn color(self, height: f64) -> [u8; 3] {
        let [lowest, steps] = self.scale();
        let code = ((height - lowest) * steps + 0.5).floor().clamp(0.0, GREATEST);
        // The conversion keeps within the type.
        let [_, red, green, blue] = (code as u32).to_be_bytes();
        [red, green, blue]
    }

    /// Returns the name that the configuration has for the encoding.
    pub fn name(self) -> &'static str {
        match self {
            HeightEncoding::Terrarium => "terrarium",
            HeightEncoding::TerrainRgb => "terrain-rgb",
        }
    }

    /// Returns the name that MapLibre has for the encoding.
    pub fn maplibre_name(self) -> &'static str {
        match self {
            HeightEncoding::Terrarium => "terrarium",
            HeightEncoding::TerrainRgb => "mapbox",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the height of a colour by the formulas that the documents of Mapzen and of Mapbox have.
    fn decoded(encoding: HeightEncoding, color: [u8; 3]) -> f64 {
        let [red, green, blue] = color.map(f64::from);
        match encoding {
            HeightEncoding::Terrarium => (red * 256.0 + green + blue / 256.0) - 32768.0,
            HeightEncoding::TerrainRgb => -10000.0 + (red * 256.0 * 256.0 + green * 256.0 + blue) * 0.1,
        }
    }

    #[test]
    fn a_colour_is_within_half_a_step_of_its_height() {
        for (encoding, step) in [(HeightEncoding::Terrarium, 1.0 / 256.0), (HeightEncoding::TerrainRgb, 0.1)] {
            for n in -20_000..90_000 {
                let height = f64::from(n) * 0.097_3;
                let off = (decoded(encoding, encoding.color(height)) - height).abs();
                assert!(off <= step / 2.0 + 1e-9, "{encoding:?} {height}: {off}");
            }
            assert_eq!(encoding.color(-1e9), [0; 3]);
            assert_eq!(encoding.color(1e9), [255; 3]);
        }
    }

    #[test]
    fn colours_are_those_of_the_documents() {
        assert_eq!(HeightEncoding::Terrarium.color(0.0), [128, 0, 0]);
        assert_eq!(HeightEncoding::TerrainRgb.color(0.0), [1, 134, 160]);
    }
}
