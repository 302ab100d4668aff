//! Little-endian numbers in byte slices. Every function takes the slice and the position of the number's first byte; the caller
//! has checked that the number lies within the slice.

/// Returns the unsigned 16-bit integer at `at`.
#[inline]
pub fn uint16(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(array(bytes, at))
}

/// Returns the unsigned 32-bit integer at `at`.
#[inline]
pub fn uint32(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(array(bytes, at))
}

/// Returns the unsigned 64-bit integer at `at`.
#[inline]
pub fn uint64(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(array(bytes, at))
}

/// Returns the signed 32-bit integer at `at`.
#[inline]
pub fn int32(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes(array(bytes, at))
}

/// Returns the 64-bit floating-point number at `at`.
#[inline]
pub fn float64(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(array(bytes, at))
}

#[inline]
fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let mut array = [0; N];
    array.copy_from_slice(&bytes[at..at + N]);
    array
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_little_endian() {
        let bytes = [0xee, 0xfe, 0xff, 0xff, 0xff, 0, 0, 0, 0x80];
        assert_eq!((uint16(&bytes, 1), uint32(&bytes, 1), int32(&bytes, 1)), (0xfffe, 0xffff_fffe, -2));
        assert_eq!((uint64(&bytes, 1), float64(&[0, 0, 0, 0, 0, 0, 0xe0, 0x3f], 0)), (0x8000_0000_ffff_fffe, 0.5));
    }
}
