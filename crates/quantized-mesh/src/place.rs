//! Where places lie on the tiles of a zoom: whole numbers.

/// The steps across a tile, in both directions.
pub const SPAN: i64 = 32_767;

/// The steps of height in a metre.
pub const HEIGHT_STEPS: f64 = 4096.0;

/// The greatest zoom: a tile is 19 metres high there, and a step is half a millimetre.
pub const MOST_ZOOM: u8 = 20;

/// A place on the grid of a zoom. Tile number `n` of a direction, counted from the south-west, reaches from `n * SPAN` to `(n + 1) * SPAN`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct GridPoint {
    /// Steps east of the meridian 180 degrees west. A terrain across that meridian goes on below zero, or beyond the last tile.
    pub x: i64,
    /// Steps north of the south pole.
    pub y: i64,
    /// Height above the ellipsoid, in [`HEIGHT_STEPS`] a metre.
    pub z: i32,
}

impl GridPoint {
    /// Returns the nearest place on the grid of a zoom: longitude and latitude in radians, the height above the ellipsoid in metres. The longitude
    /// may be beyond half a turn. `None` if the height is more than half a million metres.
    pub fn nearest(zoom: u8, [longitude, latitude]: [f64; 2], height: f64) -> Option<GridPoint> {
        let per_radian = (SPAN << zoom) as f64 / std::f64::consts::PI;
        let step = |radians: f64, zero: f64| floor((radians + zero) * per_radian + 0.5);
        let (half, quarter) = (std::f64::consts::PI, std::f64::consts::FRAC_PI_2);
        Some(GridPoint { x: step(longitude, half), y: step(latitude, quarter), z: height_steps(height)? })
    }

    pub(crate) fn along(&self, axis: usize) -> i64 {
        if axis == 0 { self.x } else { self.y }
    }
}

/// Returns a height in metres in steps; `None` if it is more than half a million metres.
pub fn height_steps(metres: f64) -> Option<i32> {
    let steps = metres * HEIGHT_STEPS + 0.5;
    (steps.abs() < f64::from(i32::MAX)).then(|| floor(steps) as i32)
}

/// Returns the greatest whole number that is not above a number of usual size. Without a vector extension, `f64::floor` is a call.
fn floor(number: f64) -> i64 {
    let towards_zero = number as i64;
    towards_zero - i64::from(towards_zero as f64 > number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floors_are_those_of_the_standard_library() {
        for number in [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 1e15 + 0.5, -1e15 - 0.5, 2.9999, -2.0001] {
            assert_eq!(floor(number), number.floor() as i64, "{number}");
        }
        assert_eq!(
            [524_287.0, 524_288.0, -524_288.0, f64::MAX].map(height_steps),
            [Some(2_147_479_552), None, None, None]
        );
    }
}
