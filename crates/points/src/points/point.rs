//! One input point on the lattice, as the job reads and packs it.

use bytemuck::{Pod, Zeroable};

/// A point that passed the filter, in lattice steps. It has 28 bytes without padding, so a slice of points is a slice of bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Point {
    /// Lattice integers in x and y, within `geometry::REACH` of zero.
    pub position: [i32; 2],
    /// Lattice integer in z.
    pub z: i32,
    /// Red, green and blue as the file has them (0 where it has none).
    pub rgb: [u16; 3],
    /// The strength of the return as the file has it (0 where it is not wanted, or the file has none).
    pub intensity: u16,
    /// ASPRS classification code (0 where the file has none).
    pub class: u8,
    order_high: u8,
    /// Always 0.
    unused: u16,
    order_low: u32,
}

impl Point {
    /// Returns a point of intensity 0. `order` is its number in the whole job, counting the records of all files in the order of the
    /// configuration, and must be below 2^40. It is 0 in jobs whose points are not numbered.
    #[inline]
    pub fn new(position: [i32; 2], z: i32, rgb: [u16; 3], class: u8, order: u64) -> Point {
        let (order_high, order_low) = ((order >> 32) as u8, order as u32);
        Point { position, z, rgb, intensity: 0, class, order_high, unused: 0, order_low }
    }

    /// Returns this point with an intensity.
    #[inline]
    #[must_use]
    pub fn with_intensity(self, intensity: u16) -> Point {
        Point { intensity, ..self }
    }

    /// Returns the point as columns that a group of neighbours can be packed by. The intensity is not in them: few jobs have any.
    #[inline]
    pub fn columns(&self) -> [u32; 8] {
        let [x, y] = self.position.map(|value| value as u32);
        let [r, g, b] = self.rgb.map(u32::from);
        // The high byte hardly ever changes, so it takes no bits beside the class.
        let class = self.class as u32 | (self.order_high as u32) << 8;
        [x, y, self.z as u32, r, g, b, class, self.order_low]
    }

    /// Returns the point with these [`Point::columns`], and intensity 0.
    #[inline]
    pub fn of_columns([x, y, z, r, g, b, class, order_low]: [u32; 8]) -> Point {
        Point {
            position: [x as i32, y as i32],
            z: z as i32,
            rgb: [r as u16, g as u16, b as u16],
            intensity: 0,
            class: class as u8,
            order_high: (class >> 8) as u8,
            unused: 0,
            order_low,
        }
    }

    /// Returns the lattice integers x, y, z.
    #[inline]
    pub fn corner(&self) -> [i32; 3] {
        [self.position[0], self.position[1], self.z]
    }

    /// Returns the number of this point's record in the whole job.
    #[inline]
    pub fn order(&self) -> u64 {
        (self.order_high as u64) << 32 | self.order_low as u64
    }
}
