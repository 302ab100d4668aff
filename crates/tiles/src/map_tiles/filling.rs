//! Heights for pixels without terrain.
//!
//! The colours have none that stands for no height. With height 0 the terrain would end in a cliff, which hill shades and contour
//! lines show. So the terrain goes on smoothly: the picture is made coarser, means over the heights that there are, until no
//! pixel lacks one; then each pixel without a height gets it from the next coarser picture, interpolated.

/// Gives every pixel without a height (NaN) of a square picture one. The side is a power of two, and one pixel has a height.
pub(crate) fn fill(heights: &mut [f64], side: usize) {
    if side < 2 || !heights.iter().any(|height| height.is_nan()) {
        return;
    }
    let mut coarser = halved(heights, side);
    fill(&mut coarser, side / 2);
    for row in 0..side {
        for column in 0..side {
            let at = row * side + column;
            if heights[at].is_nan() {
                heights[at] = interpolated(&coarser, side / 2, [column, row]);
            }
        }
    }
}

/// Returns the picture with half as many columns and rows: means over the heights that there are, else NaN.
pub fn halved(heights: &[f64], side: usize) -> Vec<f64> {
    let half = side / 2;
    let mut coarser = Vec::with_capacity(half * half);
    for row in 0..half {
        for column in 0..half {
            let first = 2 * row * side + 2 * column;
            coarser.push(mean([0, 1, side, side + 1].map(|n| heights[first + n])));
        }
    }
    coarser
}

/// Returns the mean of the numbers among `values`, in this order; NaN without one.
fn mean(values: [f64; 4]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        if !value.is_nan() {
            sum += value;
            count += 1.0;
        }
    }
    sum / count
}

/// Returns what a picture of `side` has at the centre of a pixel of the picture that is twice as fine.
fn interpolated(coarser: &[f64], side: usize, pixel: [usize; 2]) -> f64 {
    // The centre is a quarter of a coarse pixel beside that of the coarse pixel around it.
    let own = pixel.map(|at| at / 2);
    let beside = [0, 1].map(|axis| match pixel[axis] % 2 {
        0 => own[axis].saturating_sub(1),
        _ => (own[axis] + 1).min(side - 1),
    });
    let height = |column: usize, row: usize| coarser[row * side + column];
    let along = |row: usize| 0.75 * height(own[0], row) + 0.25 * height(beside[0], row);
    0.75 * along(own[1]) + 0.25 * along(beside[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_stay_and_the_rest_lies_between_them() {
        const SIDE: usize = 64;
        let given = |n: usize| match (n % SIDE, n / SIDE) {
            (column, row) if column > 20 && row < 40 && column + row != 50 => 100.0 + column as f64,
            _ => f64::NAN,
        };
        let mut heights: Vec<f64> = (0..SIDE * SIDE).map(given).collect();
        fill(&mut heights, SIDE);
        for (n, height) in heights.iter().enumerate() {
            assert!((120.0..=164.0).contains(height), "{n}: {height}");
            assert!(given(n).is_nan() || given(n) == *height);
        }
        // The terrain goes on beyond its edge as it is there.
        for row in 0..30 {
            assert!((heights[row * SIDE + 20] - 121.0).abs() < 3.0);
        }
        // A hole of one pixel has about the height of those around it.
        assert!((heights[10 * SIDE + 40] - 140.0).abs() < 1.0);
    }

    #[test]
    fn one_height_fills_all() {
        let mut heights = vec![f64::NAN; 16];
        heights[5] = 7.0;
        fill(&mut heights, 4);
        assert_eq!(heights, vec![7.0; 16]);
    }
}
