//! Little-endian numbers in bytes.

/// The little-endian number at `at`; the caller has checked the length.
pub(crate) fn uint16(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(array(bytes, at))
}

/// The little-endian number at `at`; the caller has checked the length.
pub(crate) fn uint32(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(array(bytes, at))
}

/// The little-endian number at `at`; the caller has checked the length.
pub(crate) fn uint64(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(array(bytes, at))
}

/// The little-endian number at `at`; the caller has checked the length.
pub(crate) fn float64(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(array(bytes, at))
}

/// The little-endian number at `at`; the caller has checked the length.
pub(crate) fn int32(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes(array(bytes, at))
}

#[inline]
fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes[at..at + N].try_into().expect("a slice of N bytes")
}
