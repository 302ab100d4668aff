//! What the codes of the classification mean (LAS 1.4 R15, table 17).

/// The names of the standard classes 0 to 22.
const NAMES: [&str; 23] = [
    "never classified",
    "unclassified",
    "ground",
    "low vegetation",
    "medium vegetation",
    "high vegetation",
    "building",
    "low noise",
    "model key point",
    "water",
    "rail",
    "road surface",
    "overlap",
    "wire guard",
    "wire conductor",
    "transmission tower",
    "wire connector",
    "bridge deck",
    "high noise",
    "overhead structure",
    "ignored ground",
    "snow",
    "temporal exclusion",
];

/// The classes of bare earth: ground and water; model key points, which older files take out of the ground; and ground that was set
/// aside because it is close to a breakline.
pub(crate) const GROUND: [u8; 4] = [2, 8, 9, IGNORED_GROUND];

/// The class of ground that was set aside because it is close to a breakline.
pub(crate) const IGNORED_GROUND: u8 = 20;

/// Returns the name of a class, or nothing.
pub(crate) fn name(class: u8) -> &'static str {
    NAMES.get(class as usize).copied().unwrap_or("")
}

/// Returns whether a class is one of [`GROUND`].
#[inline]
pub(crate) fn is_ground(class: u8) -> bool {
    GROUND.contains(&class)
}

/// Returns whether a class says nothing: those of points that were never classified, or were left over.
#[inline]
pub(crate) fn is_unclassified(class: u8) -> bool {
    class < 2
}

/// Returns whether a class is noise.
pub(crate) fn is_noise(class: u8) -> bool {
    class == 7 || class == 18
}
