//! Step G3: the twin of `shaders/g3_islands.wgsl`.

use crate::gpu::steps::ISLAND_ROUNDS;
use crate::gpu::texture_size::TextureSize;
use crate::gpu::twins::label::{NONE, key};

/// Gives islands the colours around them, in several rounds.
pub fn remove_islands(size: TextureSize, labels: &mut [u32]) {
    for _ in 0..ISLAND_ROUNDS {
        let islands = find(size, labels);
        if islands.is_empty() || islands.len() > size.max_islands() as usize {
            return;
        }
        for (pixel, colour) in islands {
            labels[pixel] = colour;
        }
    }
}

/// Returns the pixels that have lost touch with their site, each with its new label.
pub(super) fn find(size: TextureSize, labels: &[u32]) -> Vec<(usize, u32)> {
    let mut islands = Vec::new();
    for y in 0..size.height {
        for x in 0..size.width {
            let pixel = (y * size.width + x) as usize;
            let label = labels[pixel];
            if label != NONE && is_island(size, labels, x, y, label) {
                let colour = other_colour(size, labels, x, y, label);
                islands.extend(colour.map(|colour| (pixel, colour)));
            }
        }
    }
    islands
}

fn is_island(size: TextureSize, labels: &[u32], x: u32, y: u32, label: u32) -> bool {
    let towards = |from: u32, to: u32| (i64::from(to) - i64::from(from)).signum();
    let (dx, dy) = (towards(x, label & 0xffff), towards(y, label >> 16));
    // If the site lies straight along an axis, only one of the three is a different pixel than (x, y).
    let neighbours = [(dx, 0), (dx, dy), (0, dy)].into_iter().filter(|&offset| offset != (0, 0));
    let at = |(i, j): (i64, i64)| labels[((i64::from(y) + j) * i64::from(size.width) + i64::from(x) + i) as usize];
    (dx, dy) != (0, 0) && neighbours.map(at).all(|other| other != label)
}

/// Returns the nearest site among the labels of the neighbours, other than `label`.
fn other_colour(size: TextureSize, labels: &[u32], x: u32, y: u32, label: u32) -> Option<u32> {
    let rows = y.saturating_sub(1)..(y + 2).min(size.height);
    let columns = x.saturating_sub(1)..(x + 2).min(size.width);
    let around = rows.flat_map(|q| columns.clone().map(move |p| (q * size.width + p) as usize));
    around.map(|at| labels[at]).filter(|&l| l != label && l != NONE).min_by_key(|&l| key(x, y, l))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::twins::g1_write_sites::write_sites;
    use crate::gpu::twins::g2_voronoi_exact::voronoi_exact;
    use crate::gpu::twins::g2_voronoi_jfa::voronoi_jfa;

    /// Returns the number of islands before every round.
    fn rounds(size: TextureSize, labels: &mut [u32]) -> Vec<usize> {
        let mut counts = Vec::new();
        for _ in 0..ISLAND_ROUNDS {
            let islands = find(size, labels);
            counts.push(islands.len());
            for (pixel, colour) in islands {
                labels[pixel] = colour;
            }
        }
        counts
    }

    #[test]
    fn a_few_rounds_leave_no_island() {
        let size = TextureSize { width: 1024, height: 1024 };
        let mut bits = 1u64;
        let mut random = || {
            bits = bits.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
            (bits >> 40) as u32 % 256
        };
        // All sites lie in one corner. Far from it their regions are thin wedges, and some wedges fall apart into pixels.
        let pixels: Vec<u32> = (0..1000).map(|_| random() << 16 | random()).collect();
        let texture = write_sites(size, &pixels);
        for mut labels in [voronoi_exact(size, &texture), voronoi_jfa(size, &texture)] {
            let counts = rounds(size, &mut labels);
            assert!(counts[0] > 0, "this input has no islands and proves nothing");
            assert_eq!(counts[ISLAND_ROUNDS - 1], 0, "{counts:?}");
        }
    }
}
