//! Labels: the pixel (y << 16 | x) of a site.

/// The label of a pixel that has no nearest site.
pub const NONE: u32 = u32::MAX;

/// Returns what "nearest" compares: the square of the distance between a pixel and the site of `label`, then the site's x and y.
pub(super) fn key(x: u32, y: u32, label: u32) -> (u32, u32, u32) {
    let (site_x, site_y) = (label & 0xffff, label >> 16);
    (site_x.abs_diff(x).pow(2) + site_y.abs_diff(y).pow(2), site_x, site_y)
}

/// Returns the label of the pixel itself.
pub(super) fn own(x: u32, y: u32) -> u32 {
    y << 16 | x
}
