//! The Z-order curve, which goes through all squares of a size before it enters the next (Morton, 1966).

use crate::geometry::Site;

/// Returns the place of a site on the curve. Sites that are near each other on it are near each other in the plane.
pub fn z_order([x, y]: Site) -> u64 {
    spread(x) | spread(y) << 1
}

/// Returns the bits of a coordinate, counted from the least one, with a zero bit after each.
fn spread(coordinate: i32) -> u64 {
    // The order of the result is that of the signed numbers.
    let mut bits = u64::from(coordinate.cast_unsigned() ^ (1 << 31));
    for (shift, mask) in [
        (16, 0x0000_ffff_0000_ffff),
        (8, 0x00ff_00ff_00ff_00ff),
        (4, 0x0f0f_0f0f_0f0f_0f0f),
        (2, 0x3333_3333_3333_3333),
        (1, 0x5555_5555_5555_5555),
    ] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_takes_bits_from_both_axes_in_turn() {
        assert_eq!(z_order([i32::MIN; 2]), 0);
        assert_eq!(z_order([i32::MIN + 5, i32::MIN + 2]), 0b01_10_01);
        assert_eq!(z_order([i32::MAX; 2]), u64::MAX);
        assert!(z_order([-1, 0]) < z_order([0, 0]));
    }
}
