//! Overviews: coarser images of a raster, each half as fine as the one before.

use crate::raster::products::RasterProduct;
use rayon::prelude::*;

/// Returns an image of half the side of the square image of `product` whose pixel number n is `cell(n)`. A pixel follows from those of the
/// four pixels below it that have a value ([`RasterProduct`] has the rule); without one it has none (NaN).
pub fn halved(product: RasterProduct, side: usize, cell: impl Fn(usize) -> f32 + Sync) -> Vec<f32> {
    let half = side / 2;
    let mut image = vec![f32::NAN; half * half];
    image.par_chunks_mut(half.max(1)).enumerate().for_each(|(row, pixels)| {
        for (column, pixel) in pixels.iter_mut().enumerate() {
            let first = 2 * row * side + 2 * column;
            *pixel = product.overview([first, first + 1, first + side, first + side + 1].map(&cell));
        }
    });
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_the_mean_of_the_heights_below_it() {
        const NONE: f32 = f32::NAN;
        let image = [1.0, 2.0, NONE, NONE, 4.0, 5.0, NONE, NONE, 7.5, NONE, 1e30, 1e30, NONE, NONE, -1e30, 2.0];
        let half = halved(RasterProduct::Height, 4, |n| image[n]);
        assert_eq!(half[0], 3.0);
        assert!(half[1].is_nan());
        assert_eq!(half[2..], [7.5, 2.5e29]);
    }
}
