//! Selected points in a file, and where in it those of a part of the plane are: a packed R-tree (Roussopoulos and Leifker 1985, "Direct spatial
//! search on pictorial databases using packed R-trees") whose boxes are in memory.

use crate::area::Area;
use crate::source::SelectionStore;
use bytemuck::{cast_slice, cast_slice_mut};
use delaunay::geometry::Bounds;
use sys::Result;

/// A page has at most so many points, which are read together.
const POINTS_PER_PAGE: usize = 256;
/// A box is kept for so many pages.
const PAGES_PER_GROUP: usize = 64;

/// Points in a file that were put there together.
#[derive(Debug, Default)]
pub(crate) struct StoredSites {
    pages: Vec<Page>,
    /// The box of each group of pages.
    groups: Vec<Bounds<2>>,
    /// The box of all.
    bounds: Option<Bounds<2>>,
    count: u64,
}

/// Points that follow each other in the file.
#[derive(Clone, Copy, Debug)]
struct Page {
    bounds: Bounds<2>,
    at: u64,
    count: u32,
}

impl Page {
    fn bytes(&self) -> u64 {
        u64::from(self.count) * size_of::<[i32; 3]>() as u64
    }
}

impl StoredSites {
    /// Puts points at the end of a file, where neighbours in it should be neighbours in the plane.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn add(&mut self, points: &[[i32; 3]], store: &dyn SelectionStore) -> Result<()> {
        for points in points.chunks(POINTS_PER_PAGE) {
            let Some(bounds) = Bounds::of_points(points.iter().map(|p| [p[0], p[1]])) else { continue };
            let bytes: &[u8] = cast_slice(points);
            let at = store.reserve(bytes.len() as u64);
            store.write(at, bytes)?;
            match self.groups.last_mut().filter(|_| !self.pages.len().is_multiple_of(PAGES_PER_GROUP)) {
                Some(group) => *group = group.union(bounds),
                None => self.groups.push(bounds),
            }
            self.bounds = Some(self.bounds.map_or(bounds, |all| all.union(bounds)));
            self.pages.push(Page { bounds, at, count: points.len() as u32 });
            self.count += points.len() as u64;
        }
        Ok(())
    }

    /// Returns the number of points.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// Returns the bytes of memory that the boxes take.
    pub(crate) fn bytes(&self) -> u64 {
        (self.pages.capacity() * size_of::<Page>()) as u64
    }

    /// Gives the space of the points in the file back.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn free(self, store: &dyn SelectionStore) -> Result<()> {
        let pages = self.pages.chunk_by(|page, next| page.at + page.bytes() == next.at);
        pages.into_iter().try_for_each(|pages| store.free(pages[0].at, pages.iter().map(Page::bytes).sum()))
    }

    /// Returns the number of points in the pages that meet an area, or are near it.
    pub(crate) fn near(&self, area: &impl Area) -> usize {
        self.pages_near(area).map(|page| page.count as usize).sum()
    }

    /// Shows `look` the points of pages that meet an area, or are near it.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn visit(
        &self,
        area: &impl Area,
        store: &dyn SelectionStore,
        look: &mut impl FnMut(&[[i32; 3]]),
    ) -> Result<()> {
        let mut points = [[0; 3]; POINTS_PER_PAGE];
        for page in self.pages_near(area) {
            let points = &mut points[..page.count as usize];
            store.read(page.at, cast_slice_mut(points))?;
            look(points);
        }
        Ok(())
    }

    fn pages_near(&self, area: &impl Area) -> impl Iterator<Item = &Page> {
        let meets_all = self.bounds.is_some_and(|bounds| area.meets(&bounds));
        let groups =
            self.groups.iter().zip(self.pages.chunks(PAGES_PER_GROUP)).take(if meets_all { usize::MAX } else { 0 });
        groups
            .filter(|(bounds, _)| area.meets(bounds))
            .flat_map(|(_, pages)| pages)
            .filter(|page| area.meets(&page.bounds))
    }
}
