//! What tells edges of the triangulation from each other, in any tile.

use bytemuck::{Pod, Zeroable};

/// The two ends of an edge, the low one first. Each is the place of its vertex on a Z-order curve. So edges with neighbouring keys are near
/// each other, and sorted lines stay near each other in a file.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct EdgeKey(pub [u64; 2]);

/// Returns the place of a lattice point on the Z-order curve.
pub(crate) fn curve_place([x, y, _]: [i32; 3]) -> u64 {
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
    fn places_are_bits_in_turn_and_tell_all_points_apart() {
        let least = [i32::MIN; 3];
        assert_eq!(curve_place(least), 0);
        assert_eq!(curve_place([i32::MIN + 5, i32::MIN + 2, 0]), 0b01_10_01);
        assert_eq!(curve_place([i32::MAX, i32::MAX, 9]), u64::MAX);
        assert!(curve_place([-1, 0, 0]) < curve_place([0, 0, 0]));
    }
}
