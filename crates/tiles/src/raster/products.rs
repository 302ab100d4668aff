//! What a raster shows: heights, or what follows from them: hill shades, slopes, aspects.
//!
//! All but heights follow from the heights at the centres of a cell and its eight neighbours, by the weights of Horn, "Hill shading and the
//! reflectance map" (Proc. IEEE 69, 1981), as in `gdaldem`. Only plain IEEE operations and `libm` are used, in a fixed order, so the
//! bits are the same everywhere.

use serde::{Deserialize, Serialize};

/// One kind of raster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RasterProduct {
    /// The height of the terrain, in source units.
    Height,
    /// How bright the terrain is in the light of a sun in the north-west, halfway up: 1 (dark) to 255.
    Hillshade,
    /// The angle between the terrain and the horizontal, in degrees.
    Slope,
    /// The direction that the terrain faces, downhill, in degrees clockwise from north. Flat terrain has none.
    Aspect,
}

/// Every kind.
pub const PRODUCTS: [RasterProduct; 4] =
    [RasterProduct::Height, RasterProduct::Hillshade, RasterProduct::Slope, RasterProduct::Aspect];

impl RasterProduct {
    /// Returns the name of its file without the ending, and that of its folder in a grid of files.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            RasterProduct::Height => ["terrain", "raster"],
            RasterProduct::Hillshade => ["hillshade", "hillshade"],
            RasterProduct::Slope => ["slope", "slope"],
            RasterProduct::Aspect => ["aspect", "aspect"],
        }
    }

    /// Returns the bits of a cell in a file.
    pub fn bits(self) -> u16 {
        if self.is_bytes() { 8 } else { 32 }
    }

    /// Tells whether cells are whole numbers from 0 to 255.
    pub fn is_bytes(self) -> bool {
        self == RasterProduct::Hillshade
    }

    /// Returns what cells without a value hold. `of_heights` is what the user wants for heights.
    pub fn nodata(self, of_heights: f32) -> f32 {
        match self {
            RasterProduct::Height => of_heights,
            RasterProduct::Hillshade => 0.0,
            RasterProduct::Slope | RasterProduct::Aspect => -9999.0,
        }
    }

    /// Returns the value of a cell with these heights around it, or NaN.
    pub(crate) fn value(self, heights: Neighbours, scale: GradientScale) -> f32 {
        match self {
            RasterProduct::Height => heights.0[4],
            RasterProduct::Hillshade => heights.gradient(scale).map_or(f32::NAN, hillshade),
            RasterProduct::Slope => heights.gradient(scale).map_or(f32::NAN, slope),
            RasterProduct::Aspect => heights.gradient(scale).map_or(f32::NAN, aspect),
        }
    }

    /// Returns the cell of an overview over four cells, NaN among them where there is no value. It is their mean; of directions it is the
    /// first, since 359 and 1 degrees have no mean of use.
    pub(crate) fn overview(self, cells: [f32; 4]) -> f32 {
        match self {
            RasterProduct::Aspect => cells.into_iter().find(|cell| !cell.is_nan()).unwrap_or(f32::NAN),
            _ => mean(cells),
        }
    }
}

/// Returns the mean of the numbers among `values`, from the first to the last in this order, so that every machine has the same bits.
#[inline(always)]
fn mean(values: [f32; 4]) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        if !value.is_nan() {
            sum += f64::from(value);
            count += 1.0;
        }
    }
    // Without a number, 0 / 0 is NaN.
    (sum / count) as f32
}

/// Which kinds a job writes, at least one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<RasterProduct>", into = "Vec<RasterProduct>")]
pub struct RasterProducts([bool; PRODUCTS.len()]);

impl Default for RasterProducts {
    /// Heights alone.
    fn default() -> RasterProducts {
        RasterProducts([true, false, false, false])
    }
}

impl RasterProducts {
    /// Returns the kinds, in a fixed order.
    pub fn iter(self) -> impl Iterator<Item = RasterProduct> {
        PRODUCTS.into_iter().zip(self.0).filter_map(|(product, is_wanted)| is_wanted.then_some(product))
    }

    /// Tells whether this is the default.
    pub fn is_default(&self) -> bool {
        *self == RasterProducts::default()
    }
}

impl TryFrom<Vec<RasterProduct>> for RasterProducts {
    type Error = String;

    fn try_from(wanted: Vec<RasterProduct>) -> Result<RasterProducts, String> {
        match wanted.is_empty() {
            true => Err("products needs at least one of \"height\", \"hillshade\", \"slope\" and \"aspect\"".into()),
            false => Ok(RasterProducts(PRODUCTS.map(|product| wanted.contains(&product)))),
        }
    }
}

impl From<RasterProducts> for Vec<RasterProduct> {
    fn from(products: RasterProducts) -> Vec<RasterProduct> {
        products.iter().collect()
    }
}

/// How differences of heights become gradients: the units of height in a unit of length, divided by eight sides of a cell.
#[derive(Clone, Copy, Debug)]
pub struct GradientScale(f64);

impl GradientScale {
    /// Returns the scale for cells of `side` source units, which are `metres` long, with heights in units of `metres_of_height`.
    pub const fn new(side: f64, metres: f64, metres_of_height: f64) -> GradientScale {
        GradientScale(metres_of_height / metres / (8.0 * side))
    }
}

/// The heights of a cell and of those around it, row by row from the north-west; NaN where there is none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Neighbours(pub(crate) [f32; 9]);

impl Neighbours {
    /// Returns the rise towards the east and towards the north, or `None` if the cell has no height. A neighbour without a height has
    /// the one on the line from the opposite neighbour through the cell, or else that of the cell.
    fn gradient(self, scale: GradientScale) -> Option<[f64; 2]> {
        let center = f64::from(self.0[4]);
        if center.is_nan() {
            return None;
        }
        let at = |n: usize| match [self.0[n], self.0[8 - n]].map(f64::from) {
            [height, _] if !height.is_nan() => height,
            [_, opposite] if !opposite.is_nan() => 2.0 * center - opposite,
            _ => center,
        };
        let east = (at(2) + at(5) + at(5) + at(8)) - (at(0) + at(3) + at(3) + at(6));
        let north = (at(0) + at(1) + at(1) + at(2)) - (at(6) + at(7) + at(7) + at(8));
        Some([east * scale.0, north * scale.0])
    }
}

const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// Returns the brightness of a slope under a sun in the north-west, 45 degrees above the horizon: 1 to 255.
fn hillshade([east, north]: [f64; 2]) -> f32 {
    // The cosine of 45 degrees times the sine and the cosine of the sun's direction are both 1/2 in absolute value.
    let light = (std::f64::consts::FRAC_1_SQRT_2 + 0.5 * (east - north)) / (1.0 + east * east + north * north).sqrt();
    let bright = if light <= 0.0 { 1.0 } else { 1.0 + 254.0 * light };
    (bright + 0.5).floor().min(255.0) as f32
}

fn slope([east, north]: [f64; 2]) -> f32 {
    (libm::atan((east * east + north * north).sqrt()) * DEGREES) as f32
}

/// Returns the direction downhill in degrees clockwise from north, 0 to below 360, or NaN for flat terrain.
fn aspect([east, north]: [f64; 2]) -> f32 {
    if east == 0.0 && north == 0.0 {
        return f32::NAN;
    }
    let degrees = (libm::atan2(-east, -north) * DEGREES) as f32;
    let turned = if degrees < 0.0 { degrees + 360.0 } else { degrees };
    // Rounded to single precision, an angle just below a full turn is a full turn; and -0 is 0.
    if turned >= 360.0 || turned == 0.0 { 0.0 } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCALE: GradientScale = GradientScale(1.0 / 8.0);

    /// Cells of side 1 on a plane that rises by `east` and `north` a cell.
    fn plane(east: f32, north: f32) -> Neighbours {
        Neighbours(std::array::from_fn(|n| 100.0 + (n % 3) as f32 * east + (2 - n / 3) as f32 * north))
    }

    #[test]
    fn planes_have_their_slope_and_direction() {
        let of = |product: RasterProduct, east, north| product.value(plane(east, north), SCALE);
        assert_eq!(of(RasterProduct::Slope, 1.0, 0.0), 45.0);
        assert_eq!(of(RasterProduct::Slope, 0.0, 0.0), 0.0);
        for (east, north, degrees) in [
            (-1.0, 0.0, 90.0),
            (1.0, 0.0, 270.0),
            (0.0, -2.0, 0.0),
            (0.0, 0.5, 180.0),
            (-1.0, -1.0, 45.0),
            (1.0, -1.0, 315.0),
        ] {
            assert_eq!(of(RasterProduct::Aspect, east, north), degrees, "{east} {north}");
        }
        assert!(of(RasterProduct::Aspect, 0.0, 0.0).is_nan());
        // Flat terrain, terrain that faces the sun, and terrain that turns its back.
        assert_eq!(of(RasterProduct::Hillshade, 0.0, 0.0), 181.0);
        assert_eq!(
            of(RasterProduct::Hillshade, std::f32::consts::FRAC_1_SQRT_2, -std::f32::consts::FRAC_1_SQRT_2),
            255.0
        );
        assert_eq!(of(RasterProduct::Hillshade, -50.0, 50.0), 1.0);
    }

    #[test]
    fn the_edge_of_the_terrain_goes_on_as_it_is() {
        let mut heights = plane(0.5, -0.25);
        let whole = heights.gradient(SCALE).unwrap();
        [0, 1, 2, 5].iter().for_each(|n| heights.0[*n] = f32::NAN);
        let Some([east, north]) = heights.gradient(SCALE) else { panic!() };
        // The corner in the north-east lies opposite to one with a height; the whole plane goes on.
        assert_eq!([east, north], whole);
        let alone = Neighbours(std::array::from_fn(|n| if n == 4 { 3.0 } else { f32::NAN }));
        assert_eq!(alone.gradient(SCALE), Some([0.0, 0.0]));
        heights.0[4] = f32::NAN;
        assert!(heights.gradient(SCALE).is_none());
    }

    #[test]
    fn feet_and_metres_give_the_same_slopes() {
        // One foot up on a metre along.
        let slope = RasterProduct::Slope.value(plane(1.0, 0.0), GradientScale::new(1.0, 1.0, 0.3048));
        assert!((f64::from(slope) - libm::atan(0.3048) * DEGREES).abs() < 1e-5);
    }

    #[test]
    fn overviews_have_means_but_of_directions() {
        assert_eq!(RasterProduct::Slope.overview([1.0, f32::NAN, 3.0, f32::NAN]), 2.0);
        assert_eq!(RasterProduct::Aspect.overview([f32::NAN, 359.0, 1.0, 1.0]), 359.0);
        assert!(PRODUCTS.iter().all(|product| product.overview([f32::NAN; 4]).is_nan()));
    }
}
