//! Rounds normals, colours and whole numbers to the bytes of packed tiles, and reads them back.

/// Returns a normal (x, y up, z) in signed bytes, 127 for 1, for a mesh that its node stretches by 1, `anisotropy`, 1: readers
/// divide normals by that. The fourth byte is padding.
#[inline(always)]
pub(crate) fn normal_bytes(normal: [f32; 3], anisotropy: f32) -> [i8; 4] {
    let [x, y, z] = stretched(normal, anisotropy, 127.0).map(|v| v as i8);
    [x, y, z, 0]
}

/// If the vertical and the horizontal step differ by more than this factor, 8 bits are too few for a normal.
const MOST_ANISOTROPY: f32 = 4.0;

/// Tells whether the normals of a mesh that its node stretches by `anisotropy` need 16 bits.
pub(crate) fn needs_long_normals(anisotropy: f32) -> bool {
    !(1.0 / MOST_ANISOTROPY..=MOST_ANISOTROPY).contains(&anisotropy)
}

/// Does what [`normal_bytes`] does, in signed 16 bits, 32767 for 1.
pub(crate) fn normal_shorts(normal: [f32; 3], anisotropy: f32) -> [i16; 4] {
    let [x, y, z] = stretched(normal, anisotropy, 32767.0).map(|v| v as i16);
    [x, y, z, 0]
}

/// Numbers below this, and above its negative, are rounded.
const ROUNDED_REACH: f32 = (1 << 22) as f32;

/// The sum of this and a number below [`ROUNDED_REACH`] has no place for a fraction.
const SHIFT: f32 = 3.0 * ROUNDED_REACH;

/// Returns the nearest whole number, of two the one further from 0; 0 if the number is out of reach. Unlike `f32::round`, and unlike a
/// conversion to whole numbers, it is a few steps that every processor does for several numbers at a time.
#[inline(always)]
fn rounded(v: f32) -> i32 {
    let v = if v.abs() < ROUNDED_REACH { v } else { 0.0 };
    let shifted = v + SHIFT;
    // The sum was rounded to the even one of two.
    let off = v - (shifted - SHIFT);
    let whole = shifted.to_bits() as i32 - SHIFT.to_bits() as i32;
    let (is_up, is_down) = (v > 0.0 && off == 0.5, v < 0.0 && off == -0.5);
    whole + i32::from(is_up) - i32::from(is_down)
}

/// Returns the normal with its y stretched, as whole numbers of about this `length`.
#[inline(always)]
fn stretched([x, y, z]: [f32; 3], anisotropy: f32, length: f32) -> [i32; 3] {
    let y = y * anisotropy;
    let scale = length / (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|v| rounded(v * scale))
}

/// Returns the normal as two signed bytes on the octahedron, 127 for 1, in the form of the octahedral filter of
/// `EXT_meshopt_compression`, which packs better than three bytes.
#[inline(always)]
pub(crate) fn normal_octahedral(normal: [f32; 3], anisotropy: f32) -> [i8; 4] {
    let [u, v] = on_octahedron(normal, anisotropy, 127.0);
    [u as i8, v as i8, 127, 0]
}

/// Returns how far the corners of the octahedron are from its middle, so that normals that are stretched by `anisotropy` are as accurate
/// as 8 bits make others: one less than a power of two, as the filter wants it. Returns `None` if 16 bits are too few.
pub(crate) fn long_octahedron(anisotropy: f32) -> Option<i16> {
    let stretch = anisotropy.max(1.0 / anisotropy);
    let is_enough = stretch <= 512.0;
    is_enough.then(|| (((64.0 * stretch) as u32).next_power_of_two() - 1) as i16)
}

/// Does what [`normal_octahedral`] does, in signed 16 bits, on an octahedron of [`long_octahedron`].
#[inline(always)]
pub(crate) fn normal_long_octahedral(normal: [f32; 3], anisotropy: f32, one: i16) -> [i16; 4] {
    let [u, v] = on_octahedron(normal, anisotropy, f32::from(one));
    [u as i16, v as i16, one, 0]
}

/// Returns the place of a normal, with its y stretched, on the octahedron whose corners are this far, `one`, from its middle.
#[inline(always)]
fn on_octahedron([x, y, z]: [f32; 3], anisotropy: f32, one: f32) -> [i32; 2] {
    let y = y * anisotropy;
    let scale = 1.0 / (x.abs() + y.abs() + z.abs());
    let (u, v) = (x * scale, y * scale);
    let (u, v) =
        if z >= 0.0 { (u, v) } else { (1.0f32.copysign(u) * (1.0 - v.abs()), 1.0f32.copysign(v) * (1.0 - u.abs())) };
    [u, v].map(|v| rounded(v * one))
}

/// Returns the normal in signed bytes from the form of [`normal_octahedral`], as the filter does.
#[inline(always)]
pub(crate) fn from_octahedral([u, v, one, padding]: [i8; 4]) -> [i8; 4] {
    let [x, y, z] = off_octahedron([u, v, one].map(f32::from), 127.0).map(|v| v as i8);
    [x, y, z, padding]
}

/// Returns the normal in signed 16 bits from the form of [`normal_long_octahedral`], as the filter does.
#[inline(always)]
pub(crate) fn from_long_octahedral([u, v, one, padding]: [i16; 4]) -> [i16; 4] {
    let [x, y, z] = off_octahedron([u, v, one].map(f32::from), 32767.0).map(|v| v as i16);
    [x, y, z, padding]
}

/// Returns the normal of a place on the octahedron, as whole numbers of this `length`. Single precision and this order of operations
/// make the result the same on every machine.
#[inline(always)]
fn off_octahedron([u, v, one]: [f32; 3], length: f32) -> [i32; 3] {
    let one = one.max(1.0);
    let (u, v) = (u / one, v / one);
    let z = 1.0 - u.abs() - v.abs();
    let fold = (-z).max(0.0);
    let (x, y) = (u - fold.copysign(u), v - fold.copysign(v));
    let scale = length / (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|v| rounded(v * scale))
}

/// Whole numbers below this, and above its negative, have a form by [`exponential`].
pub(crate) const EXPONENTIAL_REACH: f64 = (1 << 23) as f64;

/// Returns a whole number in the form of the exponential filter of `EXT_meshopt_compression`: a mantissa of 24 bits, signed, and an
/// exponent of 8 bits, here 0. Neighbouring numbers differ in low bits only, unlike those of f32, so they pack better.
pub(crate) fn exponential(steps: f64) -> u32 {
    steps as i32 as u32 & 0x00ff_ffff
}

/// Returns the number in the form of [`exponential`], with any exponent.
pub(crate) fn from_exponential(bits: u32) -> f32 {
    let mantissa = (bits as i32) << 8 >> 8;
    let exponent = bits as i32 >> 24;
    // The bits of 2 to the power of `exponent`, which no mathematics library rounds.
    let power = f64::from_bits(((f64::MAX_EXP - 1 + exponent) as u64) << (f64::MANTISSA_DIGITS - 1));
    (f64::from(mantissa) * power) as f32
}

/// Returns a linear colour in bytes, opaque.
pub(crate) fn color_bytes([r, g, b]: [u16; 3]) -> [u8; 4] {
    let byte = |v: u16| ((v as u32 * 255 + 32767) / 65535) as u8;
    [byte(r), byte(g), byte(b), u8::MAX]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns unit normals that point up, on a spiral.
    fn normals() -> impl Iterator<Item = [f32; 3]> {
        (0..5_000).map(|i| {
            let (up, turn) = ((i as f32 + 0.5) / 5_000.0, i as f32 * 2.4);
            let across = (1.0 - up * up).sqrt();
            [across * turn.cos(), up, across * turn.sin()]
        })
    }

    /// Returns the degrees between a normal and the normal that a viewer reads from its bytes.
    fn error([x, y, z]: [f32; 3], packed: [impl Into<f32>; 4], anisotropy: f32) -> f32 {
        let [a, b, c, _] = packed.map(Into::into);
        let b = b / anisotropy;
        let cosine = (x * a + y * b + z * c) / (a * a + b * b + c * c).sqrt();
        cosine.min(1.0).acos().to_degrees()
    }

    #[test]
    fn rounding_is_that_of_the_standard_library() {
        let near = |v: f32| [v.next_down(), v, v.next_up()];
        let halves = (-80_000..80_000).map(|half| half as f32 / 2.0);
        for v in halves.flat_map(near).chain(near(ROUNDED_REACH - 1.5)).chain([-0.0, 0.1, f32::MIN_POSITIVE]) {
            assert_eq!(rounded(v), v.round() as i32, "{v}");
        }
        assert_eq!([f32::NAN, f32::INFINITY, -ROUNDED_REACH].map(rounded), [0; 3]);
    }

    #[test]
    fn packed_normals_are_within_a_few_degrees() {
        let worst = |of: &dyn Fn([f32; 3]) -> f32| normals().map(of).fold(0.0, f32::max);
        assert!(worst(&|n| error(n, normal_bytes(n, 1.0), 1.0)) < 0.5);
        assert!(worst(&|n| error(n, from_octahedral(normal_octahedral(n, 1.0)), 1.0)) < 1.25);
        for anisotropy in [0.25, 4.0] {
            assert!(worst(&|n| error(n, normal_bytes(n, anisotropy), anisotropy)) < 2.0);
            assert!(worst(&|n| error(n, from_octahedral(normal_octahedral(n, anisotropy)), anisotropy)) < 5.0);
            assert!(!needs_long_normals(anisotropy));
        }
        for (anisotropy, most) in [(1.0 / 256.0, 0.5), (0.125, 0.1), (8.0, 0.1), (256.0, 0.5)] {
            assert!(needs_long_normals(anisotropy));
            assert!(worst(&|n| error(n, normal_shorts(n, anisotropy), anisotropy)) < most);
        }
    }

    #[test]
    fn stretched_normals_are_as_accurate_as_others_or_have_no_octahedron() {
        for anisotropy in [1.0 / 512.0, 0.01, 0.125, 5.0, 8.0, 64.0, 256.0, 512.0] {
            let one = long_octahedron(anisotropy).unwrap();
            let packed = |n| from_long_octahedral(normal_long_octahedral(n, anisotropy, one));
            let worst = normals().map(|n| error(n, packed(n), anisotropy)).fold(0.0, f32::max);
            assert!(worst < 1.25, "{anisotropy}: {worst}");
        }
        assert_eq!([0.0009, 513.0, f32::NAN].map(long_octahedron), [None; 3]);
    }

    #[test]
    fn the_exponential_filter_returns_whole_numbers() {
        let numbers = [0.0, 1.0, -1.0, 65536.0, -77_777.0, EXPONENTIAL_REACH - 1.0, 1.0 - EXPONENTIAL_REACH];
        for number in numbers {
            let packed = exponential(number);
            let mut theirs = [[packed]];
            meshopt::decode_filter_exp(&mut theirs);
            assert_eq!(f64::from(f32::from_bits(theirs[0][0])), number);
            assert_eq!(f64::from(from_exponential(packed)), number);
        }
        assert_eq!(from_exponential(0xff00_0003), 1.5);
        assert_eq!(from_exponential(0x0200_0003), 12.0);
        assert_eq!(from_exponential(0x8000_0001), 0.5f32.powi(128));
        assert_eq!(from_exponential(0x7f00_0001), 2f32.powi(127));
    }

    #[test]
    fn the_octahedral_filter_agrees_with_meshoptimizer() {
        for normal in normals() {
            let packed = normal_octahedral(normal, 1.0);
            let mut theirs = [packed];
            meshopt::decode_filter_oct(&mut theirs);
            let ours = from_octahedral(packed);
            assert!((0..4).all(|k| ours[k].abs_diff(theirs[0][k]) <= 1), "{packed:?}: {ours:?}, theirs {theirs:?}");
        }
        assert_eq!(from_octahedral([0, 0, 0, 0]), [0, 0, 127, 0]);
        for (normal, anisotropy) in normals().flat_map(|normal| [(normal, 0.1), (normal, 8.0), (normal, 300.0)]) {
            let one = long_octahedron(anisotropy).unwrap();
            assert!((one as u16 + 1).is_power_of_two());
            let packed = normal_long_octahedral(normal, anisotropy, one);
            let mut theirs = [packed];
            meshopt::decode_filter_oct(&mut theirs);
            let ours = from_long_octahedral(packed);
            assert!((0..4).all(|k| ours[k].abs_diff(theirs[0][k]) <= 2), "{packed:?}: {ours:?}, theirs {theirs:?}");
        }
    }
}
