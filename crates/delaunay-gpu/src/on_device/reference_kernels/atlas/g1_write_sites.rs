//! Step G1 on an atlas: the twin of `shaders/atlas/g1_write_sites.wgsl`, which describes the rule.

use crate::on_device::atlas::{Atlas, AtlasLeaf};
use crate::on_device::reference_kernels::c4_flip::AT_INFINITY;
use delaunay::geometry::Site;
use std::collections::HashSet;

const NUMBER: u32 = 0x3fff_ffff;
const FROM_WEST: u32 = 0x4000_0000;

/// An atlas with its sites.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenSites {
    /// The complement of the number of the site in a pixel, or 0.
    pub texture: Vec<u32>,
    /// A bit for each vertex: it is a site that has no pixel.
    pub missing: Vec<u32>,
}

/// Where a site belongs.
struct Home {
    at: usize,
    has_east: bool,
    has_west: bool,
}

struct Writing<'a> {
    atlas: &'a Atlas,
    sites: &'a [Site],
    texture: Vec<u32>,
}

/// Writes the sites of all leaves; `sites` has one at infinity after those of each leaf.
pub fn write_sites(atlas: &Atlas, sites: &[Site]) -> WrittenSites {
    let mut writing = Writing { atlas, sites, texture: vec![0; atlas.pixels as usize] };
    let finite: Vec<u32> = (0..).zip(sites).filter(|(_, site)| site[0] != AT_INFINITY).map(|(i, _)| i).collect();
    for &i in &finite {
        writing.claim(writing.home(i).at, !i);
    }
    let losers: Vec<u32> = finite.into_iter().filter(|&i| writing.texture[writing.home(i).at] != !i).collect();
    for &i in &losers {
        let home = writing.home(i);
        if home.has_east {
            writing.claim(home.at + 1, FROM_WEST | (!i & NUMBER));
        }
    }
    let (eastern, others): (Vec<u32>, Vec<u32>) = losers.iter().partition(|&&i| writing.holds_east(i));
    for &i in &others {
        let home = writing.home(i);
        if home.has_west {
            writing.claim(home.at - 1, !i & NUMBER);
        }
    }
    let (western, left): (Vec<u32>, Vec<u32>) = others.iter().partition(|&&i| writing.holds_west(i));
    let with_western: HashSet<usize> = western.iter().map(|&i| writing.home(i).at).collect();
    for i in western {
        writing.put_west(i);
    }
    for i in eastern {
        let at = writing.home(i).at;
        if !with_western.contains(&at) {
            writing.put(at, vec![i, !writing.texture[at]]);
        }
    }
    let mut missing = vec![0; sites.len().div_ceil(32)];
    for i in left {
        missing[i as usize / 32] |= 1 << (i % 32);
    }
    WrittenSites { texture: writing.texture, missing }
}

impl Writing<'_> {
    fn leaf_of(&self, site: u32) -> &AtlasLeaf {
        let after = self.atlas.leaves.partition_point(|leaf| leaf.first_site <= site);
        &self.atlas.leaves[after - 1]
    }

    fn home(&self, site: u32) -> Home {
        let leaf = self.leaf_of(site);
        let [x, y] = leaf.pixel(self.sites[site as usize]);
        Home { at: leaf.at(x, y) as usize, has_east: x + 1 < leaf.width, has_west: x > 0 }
    }

    fn claim(&mut self, at: usize, key: u32) {
        self.texture[at] = key.max(self.texture[at]);
    }

    fn holds_east(&self, i: u32) -> bool {
        let home = self.home(i);
        home.has_east && self.texture[home.at + 1] == FROM_WEST | (!i & NUMBER)
    }

    fn holds_west(&self, i: u32) -> bool {
        let home = self.home(i);
        home.has_west && self.texture[home.at - 1] == !i & NUMBER
    }

    /// Writes sites into the pixels from `first` on, in their order.
    fn put(&mut self, first: usize, mut sites: Vec<u32>) {
        sites.sort_unstable_by_key(|&i| (self.sites[i as usize], i));
        for (i, site) in sites.into_iter().enumerate() {
            self.texture[first + i] = !site;
        }
    }

    /// Puts the loser `i`, which has the pixel in the west, the winner, and the loser that has the pixel in the east, if any, in order.
    fn put_west(&mut self, i: u32) {
        let at = self.home(i).at;
        let east = self.texture[at + 1];
        let mut sites = vec![i, !self.texture[at]];
        if east >> 30 == 1 {
            sites.push(!east & NUMBER);
        }
        self.put(at - 1, sites);
    }
}
