//! The triangulation of what is selected, as far as it concerns the points of one block.

use crate::area::is_in;
use crate::column::Column;
use crate::concern::Concern;
use crate::disc::Disc;
use crate::error_bound::{Candidate, ErrorBound, RoundBound, VerticalError};
use crate::held_points::HeldPoints;
use crate::mesh_of_points::{Held, MeshOfPoints, NONE, TriangleKey};
use crate::near_points::{NearestTriangles, PointsByPlace};
use crate::sample::Sample;
use crate::selected_sites::SelectedSites;
use delaunay::geometry::predicates::orient2d;
use delaunay::geometry::{Bounds, Site};
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::{HalfEdgeIndex, SiteIndex};
use delaunay::mesh::insert::{insert, locate};
use delaunay::triangulation::canonical::recycle;
use std::cmp::Reverse;

/// Stands in the place of a next point where the point is selected.
const SELECTED: u32 = u32::MAX - 1;

/// If more than one selected point for so many is new, all are triangulated anew.
const SITES_PER_INSERTED: usize = 3;

/// Points that are to be placed are loaded so many at a time: the processor waits for all of them at once.
const LOADED_AT_ONCE: usize = 64;

/// So many sites cost next to nothing.
const FEW_SITES: usize = 1000;

/// The points of a block, and a triangulation in which every triangle that holds one of them is a triangle of all that is selected, in this
/// block or elsewhere.
pub(crate) struct Block {
    /// The points that are looked at, those of each sample row by row of small cells.
    points: Vec<[i32; 3]>,
    /// Those that are not, likewise.
    later: Vec<[i32; 3]>,
    /// For each point the next that lies in the same triangle, or [`SELECTED`].
    next: Vec<u32>,
    /// Which of them are looked at.
    sample: Sample,
    /// The box of the points. No point of another block lies in it.
    bounds: Bounds<2>,
    /// A box around that. The mesh has all that is selected in it.
    around: Bounds<2>,
    mesh: MeshOfPoints,
    /// Points whose triangles have changed, each with a triangle near it.
    displaced: Vec<(u32, u32)>,
    /// Triangles that hold points, or are beside one that does, and whose discs reach out of `around`.
    at_border: Vec<u32>,
    /// The box of their discs.
    reach: Bounds<2>,
    /// Triangles whose worst point exceeds the bound, and that reach out of the block or are beside one that does.
    shared: Vec<u32>,
    /// For squares of the block a triangle near it.
    near: NearestTriangles,
}

/// Returns the box that a block takes selected points from in any case: at most a cell of `selected` around that of the block, and hardly more
/// of them around the block than in it. Beside a crowd, the box of a block would hold all of it.
/// [`Block::complete`] finds what concerns the block and is not in the box.
fn surroundings(bounds: Bounds<2>, selected: &SelectedSites) -> Bounds<2> {
    let by = |value: i32, side: i64| (i64::from(value) + side).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
    let widened = |side: i64| Bounds { min: bounds.min.map(|v| by(v, -side)), max: bounds.max.map(|v| by(v, side)) };
    let side = selected.side().min(bounds.extent(0).max(bounds.extent(1)) / 8).max(1);
    let most = 2 * selected.near(bounds) + FEW_SITES;
    let mut sides = std::iter::successors(Some(side), |side| Some(side / 4)).take_while(|side| *side > 0);
    widened(sides.find(|&side| selected.near(widened(side)) <= most).unwrap_or(0))
}

/// What a block proposes to select: the worst points of triangles where they exceed the bound and are further from their triangle than the worst
/// points of the three triangles beside it are from theirs, or, in clouds with samples, exceed it by far.
///
/// If the worst points of all triangles joined, up to a third of them would be superfluous in the end: another nearby serves as well. Where the
/// triangles are not nearly the last ones, that saves rounds, and does little harm except where walls are.
#[derive(Debug, Default)]
pub(crate) struct Proposal {
    /// The points about which the block alone decides.
    pub(crate) accepted: Vec<[i32; 3]>,
    /// The worst points that the block has of triangles that reach out of it, or are beside one that does.
    pub(crate) shared: Vec<SharedCandidate>,
}

impl Proposal {
    /// Returns the bytes of memory that it takes while a round is decided, in which all shared points are sorted.
    pub(crate) fn bytes(&self) -> u64 {
        let of_shared = self.shared.capacity() * size_of::<SharedCandidate>() + self.shared.len() * size_of::<usize>();
        (of_shared + self.accepted.capacity() * size_of::<[i32; 3]>()) as u64
    }
}

/// The worst point that a block has of a triangle about which other blocks may know more.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SharedCandidate {
    pub(crate) triangle: TriangleKey,
    pub(crate) candidate: Candidate,
    /// Whether it is selected if no other block has a worse one: nothing that the block knows outdoes it.
    pub(crate) is_proposed: bool,
    /// Whether the block holds all points of the triangle.
    pub(crate) is_inside: bool,
    /// For each corner of the triangle, where the one beside it at the opposite side reaches out of the block, the corner of that one which is not in
    /// this. The whole corners of all three would take twice the memory.
    pub(crate) across: [Option<Site>; 3],
}

impl SharedCandidate {
    /// Returns the triangles beside its own that reach out of the block.
    pub(crate) fn beside(&self) -> impl Iterator<Item = TriangleKey> {
        let key = |corner: usize| {
            let mut beside = self.triangle;
            beside[corner] = self.across[corner]?;
            beside.sort_unstable();
            Some(beside)
        };
        (0..3).filter_map(key)
    }
}

/// The distances of a block's points from the triangulation.
#[derive(Clone, Debug, Default)]
pub(crate) struct BlockErrors {
    /// The greatest, in units of [`VerticalError::fixed`], and the point that it belongs to.
    pub(crate) greatest: Option<(u64, [i32; 3])>,
    /// The sum, in the same units.
    pub(crate) sum: u128,
    /// The triangles with points inside, of those that were asked about.
    pub(crate) holding: Vec<HeldPoints>,
}

impl BlockErrors {
    /// Of equal distances, the point that comes first in order stays.
    fn add_greatest(&mut self, other: Option<(u64, [i32; 3])>) {
        let rank = |&(error, point): &(u64, [i32; 3])| (error, Reverse(point));
        self.greatest = self.greatest.into_iter().chain(other).max_by_key(rank);
    }

    /// Adds those of another block.
    pub(crate) fn join(mut self, other: BlockErrors) -> BlockErrors {
        self.add_greatest(other.greatest);
        self.holding.extend(other.holding);
        BlockErrors { sum: self.sum + other.sum, ..self }
    }
}

impl Block {
    /// Returns the block of `points`, which lie in `bounds`, and what `selected` has near them. `afar` are others that are selected, among them the
    /// corners of the hull of the whole cloud that are not near. `triangulate` returns the canonical triangulation of sites.
    ///
    /// # Errors
    /// Those of `triangulate` and of `selected`.
    pub(crate) fn new<E: From<sys::Error>>(
        PointsByPlace { looked_at: points, later }: PointsByPlace,
        bounds: Bounds<2>,
        sample: Sample,
        selected: &SelectedSites,
        afar: &[[i32; 3]],
        triangulate: impl FnOnce(&[Site]) -> Result<HalfEdgeMesh, E>,
    ) -> Result<Block, E> {
        let all = points.len() + later.len();
        let around = surroundings(bounds, selected);
        let mut known = selected.within(around)?;
        known.extend(afar);
        let key = |value: i32| u64::from(value.cast_unsigned() ^ 1 << 31);
        radsort::sort_by_key(&mut known, |&[x, y, _]| key(y) << 32 | key(x));
        known.dedup();
        let sites: Vec<Site> = known.iter().map(|&[x, y, _]| [x, y]).collect();
        let mesh = triangulate(&sites)?;
        let mesh = MeshOfPoints::new(&known, sites, mesh);
        let displaced = (0..points.len() as u32).map(|point| (point, NONE)).collect();
        let near = NearestTriangles::new(bounds, all);
        let next = vec![NONE; points.len()];
        let mut block = Block {
            points,
            later,
            next,
            sample,
            bounds,
            around,
            mesh,
            displaced,
            at_border: Vec::new(),
            reach: around,
            shared: Vec::new(),
            near,
        };
        block.place_displaced();
        // The list of all points is never as long again.
        block.rest();
        block.complete(selected, true)?;
        Ok(block)
    }

    /// Returns where points must be selected before the block has anything to propose again; `None` if it has now. The block has proposed what it
    /// has.
    pub(crate) fn settled_within(&self) -> Option<Concern> {
        let disc = |triangle: &u32| Disc::of(self.mesh.corners(*triangle as usize));
        (self.mesh.exceeding == 0).then(|| Concern::new(self.around, self.at_border.iter().map(disc).collect()))
    }

    /// Returns all that it has of points, sites and triangles. No points are displaced between rounds.
    pub(crate) fn columns(&mut self) -> Vec<&mut dyn Column> {
        let Block { points, later, next, at_border, shared, near, mesh, .. } = self;
        let mut columns: Vec<&mut dyn Column> = vec![points, later, next, at_border, shared, &mut near.triangles];
        columns.extend(mesh.columns());
        columns
    }

    /// Returns the bytes of memory that it takes while it rests.
    pub(crate) fn bytes(&self) -> u64 {
        let Block { points, later, next, at_border, shared, near, mesh, .. } = self;
        let of_points = (points.capacity() + later.capacity()) * size_of::<[i32; 3]>()
            + (next.capacity() + at_border.capacity() + shared.capacity()) * size_of::<u32>();
        (of_points + near.bytes() + mesh.bytes()) as u64
    }

    /// Gives back what is needed during a round alone.
    pub(crate) fn rest(&mut self) {
        self.displaced = Vec::new();
    }

    /// Returns the number of sites of its triangulation.
    pub(crate) fn sites(&self) -> u64 {
        self.mesh.sites.len() as u64
    }

    /// Tells whether so much has been added last to what is `selected` that it is faster to triangulate the block anew.
    pub(crate) fn grows_by_far(&self, selected: &SelectedSites) -> bool {
        selected.newly_near(self.around) > self.mesh.sites.len() / SITES_PER_INSERTED
    }

    /// Returns the points that are not known to be selected, and the sites of the mesh that are not near them.
    pub(crate) fn into_points(self) -> (PointsByPlace, Vec<[i32; 3]>) {
        let sites = self.mesh.sites.iter().zip(&self.mesh.heights).map(|(&[x, y], &z)| [x, y, z]);
        let afar = sites.filter(|site| !is_in(&self.around, site)).collect();
        recycle(self.mesh.mesh);
        let points = self.points.into_iter().zip(self.next);
        let looked_at = points.filter(|(_, next)| *next != SELECTED).map(|(point, _)| point).collect();
        (PointsByPlace { looked_at, later: self.later }, afar)
    }

    /// Inserts what has been added last to what is `selected`, as far as it concerns the block.
    ///
    /// # Errors
    /// Those of `selected`.
    pub(crate) fn update(&mut self, selected: &SelectedSites) -> sys::Result<()> {
        for point in selected.newly_within(self.around) {
            let start = self.near.of(point);
            self.insert(point, start);
        }
        self.place_displaced();
        self.complete(selected, selected.has_newly_between(self.around, self.reach))
    }

    /// Looks at the points of a sample that holds the present one.
    ///
    /// # Errors
    /// Those of `selected`.
    pub(crate) fn look_at(&mut self, sample: Sample, selected: &SelectedSites) -> sys::Result<()> {
        if sample == self.sample {
            return Ok(());
        }
        let known = self.points.len() as u32;
        let later = std::mem::take(&mut self.later);
        let (looked_at, later): (Vec<_>, Vec<_>) = later.into_iter().partition(|point| sample.has(*point));
        self.points.reserve_exact(looked_at.len());
        self.points.extend(looked_at);
        self.later = later;
        self.next.resize(self.points.len(), NONE);
        self.displaced = (known..self.points.len() as u32).map(|point| (point, NONE)).collect();
        self.sample = sample;
        self.mesh.changed = (0..self.mesh.held.len() as u32).collect();
        self.place_displaced();
        self.rest();
        self.complete(selected, true)
    }

    /// Returns the points of triangles whose distance is more than `bound`.
    pub(crate) fn beyond(&self, bound: ErrorBound) -> Vec<[i32; 3]> {
        let (mut beyond, everywhere) = (Vec::new(), RoundBound::everywhere(bound));
        for triangle in 0..self.mesh.held.len() {
            if self.mesh.excess_over(triangle, &everywhere) == 0 {
                continue;
            }
            let corners = self.mesh.points(triangle);
            let mut point = self.mesh.held[triangle].first;
            while point != NONE {
                let place = self.points[point as usize];
                if bound.is_exceeded_by(VerticalError::of(corners, place)) {
                    beyond.push(place);
                }
                point = self.next[point as usize];
            }
        }
        beyond
    }

    /// Proposes points to select.
    pub(crate) fn propose(&mut self, bound: &RoundBound) -> Proposal {
        for index in 0..self.mesh.changed.len() {
            let t = self.mesh.changed[index] as usize;
            let excess = self.mesh.excess_over(t, bound);
            let is_inside = self.is_inside(t);
            let held = &mut self.mesh.held[t];
            held.set_inside(is_inside);
            let before = std::mem::replace(&mut held.excess, excess);
            self.mesh.exceeding = self.mesh.exceeding + usize::from(excess > 0) - usize::from(before > 0);
        }
        // Whatever was outdone by a triangle that has not changed still is.
        let shared = std::mem::take(&mut self.shared);
        let triangles = self.mesh.changed_and_beside(0, shared);
        self.mesh.changed.clear();
        let mut proposal = Proposal::default();
        for t in triangles {
            if self.mesh.held[t as usize].excess > 0 && self.propose_of(t as usize, bound.far, &mut proposal) {
                self.shared.push(t);
            }
        }
        proposal
    }

    /// Adds the worst point of a triangle to the proposal, if nothing that the block knows outdoes it. Tells whether other blocks may know more.
    fn propose_of(&self, t: usize, far: u64, proposal: &mut Proposal) -> bool {
        let candidate = self.candidate(t);
        let is_inside = self.mesh.held[t].is_inside();
        let triangle = self.mesh.key(t);
        let mut across = [None; 3];
        let mut is_outdone = false;
        for (side, twin) in HalfEdgeIndex::of_triangle(t).map(|side| (side, self.mesh.mesh.twin(side))) {
            if twin == HalfEdgeIndex::HULL {
                continue;
            }
            let other = twin.triangle();
            if self.mesh.held[other].is_inside() {
                is_outdone |= self.mesh.held[other].excess > 0 && !candidate.stands_beside(&self.candidate(other), far);
            } else {
                let [opposite, beyond] = [side, twin].map(|side| self.mesh.sites[self.mesh.mesh.apex(side).get()]);
                let corner = triangle.iter().position(|corner| *corner == opposite);
                across[corner.unwrap_or_default()] = Some(beyond);
            }
        }
        let is_shared = !is_inside || across != [None; 3];
        match (is_outdone, is_shared) {
            (_, true) => {
                let is_proposed = !is_outdone;
                proposal.shared.push(SharedCandidate { triangle, candidate, is_proposed, is_inside, across });
            }
            (true, false) => {}
            (false, false) => proposal.accepted.push(candidate.point),
        }
        is_shared
    }

    /// Returns the worst point of a triangle that holds some.
    fn candidate(&self, triangle: usize) -> Candidate {
        let held = &self.mesh.held[triangle];
        let point = self.points.get(held.worst as usize).copied().unwrap_or_default();
        Candidate { numerator: held.numerator, excess: held.excess, point }
    }

    /// Tells whether a triangle lies in the block, so that it holds no points of others.
    fn is_inside(&self, triangle: usize) -> bool {
        self.mesh.corners(triangle).into_iter().all(|corner| self.holds(corner))
    }

    /// Returns the distances of all points that are not selected.
    /// Also lists the triangles that hold points, of those for which `asks_about` is true.
    pub(crate) fn errors(&self, asks_about: impl Fn([Site; 3]) -> bool) -> BlockErrors {
        let mut errors = BlockErrors::default();
        for triangle in 0..self.mesh.held.len() {
            let mut point = self.mesh.held[triangle].first;
            if point == NONE {
                continue;
            }
            let corners = self.mesh.points(triangle);
            let mut held = asks_about(self.mesh.corners(triangle)).then(|| HeldPoints::none(self.mesh.key(triangle)));
            while point != NONE {
                let place = self.points[point as usize];
                let error = VerticalError::of(corners, place).fixed();
                errors.sum += u128::from(error);
                errors.add_greatest(Some((error, place)));
                held.iter_mut().for_each(|held| held.add([place[0], place[1]]));
                point = self.next[point as usize];
            }
            errors.holding.extend(held.filter(|held| held.count > 0));
        }
        errors
    }

    fn holds(&self, [x, y]: Site) -> bool {
        let Bounds { min, max } = self.bounds;
        min[0] <= x && x <= max[0] && min[1] <= y && y <= max[1]
    }

    /// Inserts a selected point, looking for its place from triangle `start` on, and notes whose points are displaced.
    fn insert(&mut self, point: [i32; 3], start: u32) {
        let Block {
            mesh: MeshOfPoints { sites, heights, mesh, held, changed, exceeding, .. },
            next,
            displaced,
            near,
            ..
        } = self;
        let site = [point[0], point[1]];
        // The hull of the cloud is that of the mesh, so that all points lie in it.
        let Some(triangle) = locate(mesh, sites, start as usize, site, &mut u64::MAX.clone()) else { return };
        if mesh.triangles[triangle].iter().any(|v| sites[v.get()] == site) {
            return;
        }
        let v = SiteIndex::new(sites.len());
        sites.push(site);
        heights.push(point[2]);
        insert(mesh, sites, v, triangle, |t| {
            if t >= held.len() {
                held.push(Held::on_list(0));
            }
            let mut point = held[t].first;
            *exceeding -= usize::from(held[t].excess > 0);
            held[t] = Held::on_list(held[t].listed);
            changed.push(t as u32);
            while point != NONE {
                displaced.push((point, t as u32));
                point = next[point as usize];
            }
        });
        near.set(point, triangle as u32);
    }

    /// Finds the triangles of displaced points, and the worst point of each of these triangles.
    fn place_displaced(&mut self) {
        let mut displaced = std::mem::take(&mut self.displaced);
        let (mut last, mut places) = (0, Vec::with_capacity(LOADED_AT_ONCE));
        for displaced in displaced.chunks(LOADED_AT_ONCE) {
            places.extend(displaced.iter().map(|&(point, _)| self.points[point as usize]));
            for (&(point, start), place) in displaced.iter().zip(places.drain(..)) {
                let is_first = start == NONE;
                last = self.place(point, place, if is_first { last } else { start });
                if is_first {
                    self.near.set(place, last);
                }
            }
        }
        displaced.clear();
        self.displaced = displaced;
    }

    /// Puts a point at this place into its triangle, looking from triangle `start` on, and returns that. A selected point is in none.
    ///
    /// A point on an edge belongs to the triangle on the left of the edge as seen from its lesser end: the point is thought of as moved
    /// a little towards greater y, and by far less towards lesser x.
    #[inline]
    fn place(&mut self, point: u32, [x, y, z]: [i32; 3], start: u32) -> u32 {
        let p = [x, y];
        let mesh = &mut self.mesh;
        let mut triangle = start as usize;
        // The side that the walk came through; it need not be looked at again.
        let mut entry = 3;
        loop {
            let corners = mesh.corners(triangle);
            let mut parts = [0; 3];
            let mut exit = None;
            for k in 0..3 {
                let (from, to) = (corners[k], corners[(k + 1) % 3]);
                // Opposite the third corner.
                let part = orient2d(from, to, p);
                parts[(k + 2) % 3] = part;
                if k != entry
                    && (part < 0 || part == 0 && from > to && mesh.mesh.twins[3 * triangle + k] != HalfEdgeIndex::HULL)
                {
                    exit = Some(k);
                    break;
                }
            }
            if let Some(side) = exit {
                let twin = mesh.mesh.twins[3 * triangle + side];
                (triangle, entry) = (twin.triangle(), twin.corner());
                continue;
            }
            if corners.contains(&p) {
                self.next[point as usize] = SELECTED;
                return triangle as u32;
            }
            let numerator = VerticalError::of_parts(parts, mesh.heights(triangle), z).numerator;
            let held = &mut mesh.held[triangle];
            self.next[point as usize] = std::mem::replace(&mut held.first, point);
            let site_of = |point: u32| {
                let [x, y, _] = self.points[point as usize];
                [x, y]
            };
            let known = held.numerator();
            if held.worst == NONE || numerator > known || numerator == known && p < site_of(held.worst) {
                held.set_worst(point, numerator);
            }
            return triangle as u32;
        }
    }

    /// Inserts selected points of other blocks until no triangle that holds points, or is beside one that does, has one in its circle. Those
    /// that did not change had none before the last points were selected, and unless these `concern_border` still have none.
    fn complete(&mut self, selected: &SelectedSites, concern_border: bool) -> sys::Result<()> {
        let mut unsure = self.mesh.changed_and_beside(0, Vec::new());
        for triangle in std::mem::take(&mut self.at_border) {
            if self.mesh.is_listed(triangle) {
                continue;
            }
            let corners = self.mesh.corners(triangle as usize);
            match concern_border && selected.has_newly_inside(corners, Disc::of(corners)) {
                true => unsure.push(triangle),
                false => self.at_border.push(triangle),
            }
        }
        while let Some(triangle) = unsure.pop() {
            let corners = self.mesh.corners(triangle as usize);
            if Disc::is_surely_in(corners, &self.around) || !self.concerns(triangle as usize) {
                continue;
            }
            let disc = Disc::of(corners);
            if disc.is_in(&self.around) {
                continue;
            }
            match selected.deepest_inside(corners, disc)? {
                None => {
                    self.at_border.push(triangle);
                    self.reach = self.reach.union(disc.bounds());
                }
                Some(point) => {
                    let known = self.mesh.changed.len();
                    self.insert(point, triangle);
                    self.place_displaced();
                    unsure.extend(self.mesh.changed_and_beside(known, Vec::new()));
                }
            }
        }
        Ok(())
    }

    /// Tells whether a triangle or one beside it holds points.
    fn concerns(&self, triangle: usize) -> bool {
        let holds_points = |t: usize| self.mesh.held[t].first != NONE;
        let holds_points_beyond = |twin: HalfEdgeIndex| twin != HalfEdgeIndex::HULL && holds_points(twin.triangle());
        holds_points(triangle) || self.mesh.twins_of(triangle).iter().any(|&twin| holds_points_beyond(twin))
    }
}

/// Sequential greedy insertion, to compare with: of all points of one block the worst is selected, again and again.
#[cfg(test)]
pub(crate) fn greedy_insertion(mut block: Block, selected: &mut SelectedSites, bound: ErrorBound) -> u64 {
    use std::collections::BinaryHeap;
    let mut heap = BinaryHeap::new();
    let mut count = selected.count();
    loop {
        for t in std::mem::take(&mut block.mesh.changed) {
            let excess = block.mesh.excess_over(t as usize, &RoundBound::everywhere(bound));
            if excess > 0 {
                let worst = block.mesh.held[t as usize].worst;
                heap.push((excess, Reverse(block.points[worst as usize]), t, worst));
            }
        }
        let Some((excess, Reverse(point), t, worst)) = heap.pop() else { return count };
        let is_stale = block.mesh.excess_over(t as usize, &RoundBound::everywhere(bound)) != excess;
        if is_stale || block.mesh.held[t as usize].worst != worst {
            continue;
        }
        block.insert(point, t);
        block.place_displaced();
        count += 1;
    }
}
