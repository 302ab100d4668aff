//! What comes back from an atlas, and how the CPU finds the part of each leaf in it.

use crate::on_device::atlas::{Atlas, AtlasLeaf};
use crate::on_device::leaf_flags::TOO_MANY_TRIANGLES;
use delaunay::voronoi::mesh_reply::{MadeMesh, MeshReply, SharedNumbers};
use std::ops::Range;

/// Where everything lies among the numbers that come back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReturnedLayout {
    /// Eight numbers for each record.
    pub records: Range<usize>,
    /// A bit for each record.
    pub unfinished: Range<usize>,
    /// A bit for each site. Those of a leaf begin a word.
    pub missing: Range<usize>,
    /// The number of triangles and the flags of each leaf.
    pub leaves: Range<usize>,
    /// A number for each block.
    pub block_starts: Range<usize>,
}

impl ReturnedLayout {
    /// Returns the layout of what comes back from `atlas`.
    pub fn of(atlas: &Atlas) -> ReturnedLayout {
        let after = |before: &Range<usize>, length: usize| before.end..before.end + length;
        let records = 0..8 * atlas.records as usize;
        let unfinished = after(&records, atlas.records as usize / 32);
        let missing = after(&unfinished, first_word(atlas.vertices, atlas.leaves.len()) + 1);
        let leaves = after(&missing, 2 * atlas.leaves.len());
        let block_starts = after(&leaves, atlas.blocks as usize);
        ReturnedLayout { records, unfinished, missing, leaves, block_starts }
    }

    /// Returns how many numbers come back.
    pub fn numbers(&self) -> usize {
        self.block_starts.end
    }
}

/// Returns the word, among those of the missing sites, in which a leaf begins.
fn first_word(first_site: u32, leaf: usize) -> usize {
    first_site as usize / 32 + leaf
}

/// What the device made of a leaf. Numbers of sites, records and blocks are those of the leaf alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReturnedLeaf<'a> {
    /// Why the leaf must not be used, as bits of [`crate::on_device::leaf_flags`]; 0 if it may be.
    pub flags: u32,
    /// Eight numbers for each triangle: three corners counterclockwise, 0, three twins, 0. Half-edge `8 t + i` starts at corner i of
    /// triangle t. The vertex at infinity has the number after those of all sites.
    pub records: &'a [u32],
    /// A bit for each triangle: it is inverted, or the rounds of flips were not enough for it.
    pub unfinished: &'a [u32],
    /// A bit for each site: it found no pixel, so it is in no triangle.
    pub missing: &'a [u32],
    /// The number of triangles before each block. Those of a block were near it before the flips.
    pub block_starts: &'a [u32],
    /// The number of blocks in a row.
    pub blocks_x: u32,
}

/// The numbers that came back from an atlas.
#[derive(Clone, Copy, Debug)]
pub struct ReturnedAtlas<'a> {
    atlas: &'a Atlas,
    numbers: &'a [u32],
}

impl<'a> ReturnedAtlas<'a> {
    /// Returns `numbers`, which came back from `atlas`, or `None` if there are more or fewer than there should be.
    pub fn new(atlas: &'a Atlas, numbers: &'a [u32]) -> Option<ReturnedAtlas<'a>> {
        (numbers.len() == ReturnedLayout::of(atlas).numbers()).then_some(ReturnedAtlas { atlas, numbers })
    }

    /// Returns leaf number `leaf`, or `None` if the device tells nonsense about it.
    pub fn leaf(&self, leaf: usize) -> Option<ReturnedLeaf<'a>> {
        let place = self.place(leaf)?;
        let part = |range: &Range<usize>| self.numbers.get(range.clone());
        Some(ReturnedLeaf {
            flags: place.flags,
            records: part(&place.records)?,
            unfinished: part(&place.unfinished)?,
            missing: part(&place.missing)?,
            block_starts: part(&place.block_starts)?,
            blocks_x: place.blocks_x,
        })
    }

    /// Returns where leaf number `leaf` lies, or `None` if the device tells nonsense about it.
    fn place(&self, leaf: usize) -> Option<PlaceOfLeaf> {
        let layout = ReturnedLayout::of(self.atlas);
        let place = self.atlas.leaves.get(leaf)?;
        let part = |section: &Range<usize>, first: usize, length: usize| {
            let range = section.start + first..section.start + first + length;
            (range.end <= section.end).then_some(range)
        };
        let &[triangles, flags] = self.numbers.get(part(&layout.leaves, 2 * leaf, 2)?)? else { return None };
        let count = if flags & TOO_MANY_TRIANGLES == 0 { triangles as usize } else { 0 };
        if count > place.records() as usize {
            return None;
        }
        let first_record = place.first_record as usize;
        let blocks = (place.blocks_x() * place.blocks_y()) as usize;
        let missing = part(&layout.missing, first_word(place.first_site, leaf), (place.sites as usize).div_ceil(32))?;
        Some(PlaceOfLeaf {
            flags,
            records: part(&layout.records, 8 * first_record, 8 * count)?,
            unfinished: part(&layout.unfinished, first_record / 32, count.div_ceil(32))?,
            missing,
            block_starts: part(&layout.block_starts, place.first_block as usize, blocks)?,
            blocks_x: place.blocks_x(),
        })
    }
}

/// What the device says of a leaf, and where its parts lie among the numbers that came back.
struct PlaceOfLeaf {
    flags: u32,
    records: Range<usize>,
    unfinished: Range<usize>,
    missing: Range<usize>,
    block_starts: Range<usize>,
    blocks_x: u32,
}

/// Returns the answer for every leaf of `atlas`, of which `numbers` came back. They share the numbers if those `may_stay`; else each has a
/// copy of its own.
pub fn replies(atlas: &Atlas, numbers: &SharedNumbers, may_stay: bool) -> Vec<MeshReply> {
    let returned = ReturnedAtlas::new(atlas, (**numbers).as_ref());
    let reply = |(i, leaf): (usize, &AtlasLeaf)| match returned.and_then(|returned| returned.place(i)) {
        Some(place) if place.flags == 0 => {
            let made = made(place, *leaf, numbers);
            MeshReply::Made(if may_stay { made } else { made.alone() })
        }
        _ => MeshReply::Flagged,
    };
    atlas.leaves.iter().enumerate().map(reply).collect()
}

fn made(place: PlaceOfLeaf, leaf: AtlasLeaf, numbers: &SharedNumbers) -> MadeMesh {
    let PlaceOfLeaf { records, unfinished, missing, block_starts, .. } = place;
    let block_of = Box::new(move |site| leaf.block_of(site));
    MadeMesh { numbers: numbers.clone(), records, missing, unfinished, block_starts, block_of }
}

#[cfg(test)]
mod tests {
    use super::*;
    use delaunay::voronoi::texture_request::TextureRequest;
    use std::sync::Arc;

    #[test]
    fn parts_of_leaves_do_not_overlap() {
        let mut atlas = Atlas::default();
        for count in [3, 31, 32, 33, 62, 64, 100] {
            let sites: Vec<_> = (0..count).map(|i| [i % 10 * 7, i / 10 * 7 + i % 3]).collect();
            assert!(atlas.add(&sites, &TextureRequest::default(), 1 << 20));
        }
        // Every number tells where it is.
        let mut numbers: Vec<u32> = (0..ReturnedLayout::of(&atlas).numbers() as u32).collect();
        let leaves = ReturnedLayout::of(&atlas).leaves;
        leaves.step_by(2).for_each(|at| (numbers[at], numbers[at + 1]) = (4, 0));
        let returned = ReturnedAtlas::new(&atlas, &numbers).unwrap();
        let mut last = [0; 4];
        for (i, leaf) in atlas.leaves.iter().enumerate() {
            let back = returned.leaf(i).unwrap();
            assert_eq!((back.records.len(), back.unfinished.len()), (32, 1));
            assert_eq!(back.missing.len(), (leaf.sites as usize).div_ceil(32));
            assert_eq!(back.records[0], 8 * leaf.first_record);
            for (part, last) in [back.records, back.unfinished, back.missing, back.block_starts].iter().zip(&mut last) {
                assert!(i == 0 || part[0] > *last);
                *last = part[part.len() - 1];
            }
        }
        assert_eq!(returned.leaf(atlas.leaves.len()), None);
    }

    #[test]
    fn nonsense_is_no_leaf() {
        let mut atlas = Atlas::default();
        assert!(atlas.add(&[[0, 0], [5, 5], [9, 0]], &TextureRequest::default(), 1 << 20));
        let layout = ReturnedLayout::of(&atlas);
        let mut numbers = vec![0; layout.numbers()];
        assert!(ReturnedAtlas::new(&atlas, &numbers[1..]).is_none());
        let leaf =
            |numbers: &[u32]| ReturnedAtlas::new(&atlas, numbers).unwrap().leaf(0).map(|leaf| leaf.records.len());
        numbers[layout.leaves.start] = 64;
        assert_eq!(leaf(&numbers), Some(512));
        numbers[layout.leaves.start] = 65;
        assert_eq!(leaf(&numbers), None);
        numbers[layout.leaves.start + 1] = TOO_MANY_TRIANGLES;
        assert_eq!(leaf(&numbers), Some(0));
        let is_made = |numbers: &[u32]| {
            let shared: SharedNumbers = Arc::new(numbers.to_vec());
            [true, false].into_iter().all(|may_stay| {
                let replies = replies(&atlas, &shared, may_stay);
                matches!(&replies[..], [MeshReply::Made(made)] if made.records.len() == 8)
            })
        };
        assert!(!is_made(&numbers));
        (numbers[layout.leaves.start], numbers[layout.leaves.start + 1]) = (1, 0);
        assert!(is_made(&numbers));
    }
}
