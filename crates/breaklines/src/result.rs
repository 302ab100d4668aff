//! Breaklines that are cut into edges.

use crate::clean::segments_of;
use crate::drop_index::DropIndex;
use crate::error::BreaklineError;
use crate::feature::{Feature, FeatureKind};
use crate::findings::Findings;
use crate::heights::sites_with_heights;
use crate::lakes::Fraction;
use crate::levels::LineLevels;
use crate::net::{Net, net_of};
use crate::options::BreaklineOptions;
use crate::site::BreaklineSite;
use delaunay::geometry::Site;
use std::sync::OnceLock;

/// Breaklines that are cut into edges of the triangulation.
#[derive(Clone, Debug)]
pub struct Breaklines {
    sites: Vec<BreaklineSite>,
    subsegments: Vec<[u32; 2]>,
    index: DropIndex,
    options: BreaklineOptions,
    /// Made when a coarser tile first asks for it.
    levels: OnceLock<LineLevels>,
}

impl Breaklines {
    /// Cuts `features`. The result does not depend on the order of the features, nor on the order of their paths.
    ///
    /// # Errors
    /// See [`BreaklineError`].
    pub fn build(features: &[Feature], options: &BreaklineOptions) -> Result<(Breaklines, Findings), BreaklineError> {
        let mut findings = Findings::default();
        let (segments, lakes) = segments_of(features, options, &mut findings)?;
        let net = net_of(&segments, lakes, options, &mut findings)?;
        let sites = sites_with_heights(&net, &segments, options, &mut findings)?;
        let subsegments = subsegments_of(&net, &sites);
        findings.sites = sites.len() as u64;
        findings.subsegments = subsegments.len() as u64;
        findings.sites_without_height = sites.iter().filter(|site| site.z.is_none()).count() as u64;
        let places = subsegments.iter().map(|ends| ends.map(|end| sites[end as usize].place));
        let index = DropIndex::new(places, net.lakes, options.spacing);
        Ok((Breaklines { sites, subsegments, index, options: *options, levels: OnceLock::new() }, findings))
    }

    /// Returns the options that the lines were cut with.
    pub fn options(&self) -> &BreaklineOptions {
        &self.options
    }

    /// Returns the sites, unique in x and y, sorted by y, then x.
    pub fn sites(&self) -> &[BreaklineSite] {
        &self.sites
    }

    /// Returns the subsegments, sorted: positions in [`Breaklines::sites`], the lesser first.
    pub fn subsegments(&self) -> &[[u32; 2]] {
        &self.subsegments
    }

    /// Returns the position in [`Breaklines::sites`] of the site at `place`.
    pub fn position(&self, place: Site) -> Option<usize> {
        self.sites.binary_search_by_key(&(place[1], place[0]), |site| (site.place[1], site.place[0])).ok()
    }

    /// Returns whether there is a subsegment between the places `a` and `b`.
    pub fn is_subsegment(&self, a: Site, b: Site) -> bool {
        let pair = self.position(a).zip(self.position(b));
        pair.is_some_and(|(a, b)| self.subsegments.binary_search(&[a.min(b) as u32, a.max(b) as u32]).is_ok())
    }

    /// Returns whether a point of the cloud at `place` is dropped: it lies in the closed disc of a subsegment or inside a lake. That holds
    /// for the sites of the breaklines too. The place must lie within `geometry::REACH` of zero.
    #[inline]
    pub fn drops(&self, place: Site) -> bool {
        self.index.drops(place)
    }

    /// Returns the edges of the shores of all lakes, each with the number of its lake. A place is in a lake if a line from there crosses its shore an odd
    /// number of times.
    pub fn shores(&self) -> impl Iterator<Item = (u32, [Site; 2])> + '_ {
        self.index.lakes().shores()
    }

    /// Returns whether the triangle lies inside a lake, on its flat water. The triangle must be one of the mesh.
    pub fn is_water(&self, triangle: [Site; 3]) -> bool {
        self.index.is_water(Fraction::middle_of(&triangle))
    }

    /// Returns whether all corners of the triangle are sites of rivers or lakes: where no point lies between the banks of a river, its
    /// water is made of such triangles.
    pub fn is_between_shores(&self, triangle: [Site; 3]) -> bool {
        let is_shore = |site: usize| self.sites[site].kind != FeatureKind::Line;
        triangle.into_iter().all(|place| self.position(place).is_some_and(is_shore))
    }

    /// Returns the highest level of coarser lines that still has the site at `place`; `None` if no line has a site there. At level n a line
    /// keeps every 2^n-th of its sites, and those where lines meet or end.
    pub fn rank(&self, place: Site) -> Option<u8> {
        self.index.is_near_line(place).then(|| self.position(place)).flatten().map(|site| self.levels().rank(site))
    }

    /// Returns whether a vertex at `place` could keep lines of this level from being edges: it lies in a closed disc of theirs, and is
    /// none of their sites.
    pub fn bars(&self, place: Site, level: u8) -> bool {
        self.levels().bar(place, level)
    }

    fn levels(&self) -> &LineLevels {
        self.levels.get_or_init(|| {
            let places: Vec<Site> = self.sites.iter().map(|site| site.place).collect();
            LineLevels::new(&places, &self.subsegments)
        })
    }

    /// Gives the sites that have no height those of `heights`, which has one for each of them, in their order.
    pub(crate) fn set_missing_heights(&mut self, heights: impl IntoIterator<Item = Option<i32>>) {
        let missing = self.sites.iter_mut().filter(|site| site.z.is_none());
        missing.zip(heights).for_each(|(site, z)| site.z = z);
    }
}

/// Returns the subsegments as positions in `sites`, sorted.
fn subsegments_of(net: &Net, sites: &[BreaklineSite]) -> Vec<[u32; 2]> {
    let position =
        |place: Site| sites.partition_point(|site| (site.place[1], site.place[0]) < (place[1], place[0])) as u32;
    let pair = |edge| {
        let [a, b] = net.edges.places(&net.sites, edge).map(position);
        [a.min(b), a.max(b)]
    };
    let mut subsegments: Vec<[u32; 2]> = net.edges.alive().map(pair).collect();
    subsegments.sort_unstable();
    subsegments
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feature::{FeatureId, Vertex};
    use crate::findings::{Disagreement, Rise, Uneven};
    use crate::nearest_heights::NearestHeights;
    use delaunay::geometry::Bounds;

    fn id(feature: u64) -> FeatureId {
        FeatureId { file: 7, feature }
    }

    fn feature(kind: FeatureKind, number: u64, path: &[[i32; 3]]) -> Feature {
        let vertex = |&[x, y, z]: &[i32; 3]| Vertex { place: [x, y], z: Some(z) };
        Feature { kind, id: id(number), paths: vec![path.iter().map(vertex).collect()] }
    }

    fn build(features: &[Feature], spacing: u32) -> (Breaklines, Findings) {
        Breaklines::build(features, &BreaklineOptions::new(spacing, None)).unwrap()
    }

    fn at(lines: &Breaklines, place: Site) -> Option<(i32, FeatureKind)> {
        let site = lines.sites()[lines.position(place)?];
        Some((site.z?, site.kind))
    }

    const POND: [[i32; 3]; 4] = [[0, 0, 50], [1000, 0, 50], [1000, 1000, 50], [0, 1000, 50]];

    #[test]
    fn heights_are_linear_between_vertices() {
        let (lines, _) = build(&[feature(FeatureKind::Line, 0, &[[0, 0, 0], [1000, 0, 101], [1000, 300, 101]])], 100);
        let heights: Vec<_> = (0..=10).map(|i| at(&lines, [100 * i, 0]).unwrap().0).collect();
        assert_eq!(heights, [0, 10, 20, 30, 40, 51, 61, 71, 81, 91, 101]);
        assert!(lines.is_subsegment([100, 0], [200, 0]) && !lines.is_subsegment([100, 0], [300, 0]));
        assert!(lines.drops([150, 50]) && !lines.drops([150, 51]) && !lines.drops([-1, 0]));
    }

    #[test]
    fn where_lines_meet_the_lake_comes_before_the_river_and_the_river_before_the_line() {
        let river = feature(FeatureKind::River, 1, &[[-3000, 500, 200], [-500, 500, 60], [500, 500, 40]]);
        let line = feature(FeatureKind::Line, 2, &[[-2000, 0, 10], [-2000, 1000, 10]]);
        let (lines, found) = build(&[line, river, feature(FeatureKind::Lake, 3, &POND)], 250);
        assert_eq!(at(&lines, [0, 500]), Some((50, FeatureKind::Lake)));
        assert_eq!(at(&lines, [-2000, 500]), Some((144, FeatureKind::River)));
        assert_eq!((found.crossings, found.pieces_in_lakes, found.disagreements), (2, 1, 1));
        let worst = Disagreement { place: [-2000, 500], kept: (id(1), 144), other: (id(2), 10) };
        assert_eq!(found.worst_disagreements, [worst]);
        assert!(lines.sites().iter().all(|site| site.place[0] <= 0 || site.z == Some(50)), "nothing inside the lake");
    }

    #[test]
    fn water_is_dropped_and_islands_stay() {
        let mut pond = feature(FeatureKind::Lake, 0, &POND);
        pond.paths
            .push([[300, 300], [700, 300], [700, 700], [300, 700]].map(|place| Vertex { place, z: None }).to_vec());
        let path = feature(FeatureKind::Line, 1, &[[400, 500, 70], [600, 500, 70]]);
        let (lines, found) = build(&[pond, path], 100);
        assert!(
            lines.drops([150, 150]) && lines.drops([850, 500]) && !lines.drops([500, 400]) && !lines.drops([-90, -90])
        );
        assert!(
            lines.is_water([[0, 0], [300, 0], [100, 100]]) && !lines.is_water([[310, 310], [350, 310], [310, 350]])
        );
        assert_eq!((found.pieces_in_lakes, found.uneven_lakes), (0, 0));
        assert_eq!(at(&lines, [400, 500]), Some((70, FeatureKind::Line)));
        assert_eq!(at(&lines, [300, 300]), Some((50, FeatureKind::Lake)));
    }

    #[test]
    fn triangles_between_banks_have_no_other_corners() {
        let bank = |kind, number, y| feature(kind, number, &[[0, y, 10], [300, y, 10]]);
        let banks =
            [bank(FeatureKind::River, 0, 0), bank(FeatureKind::River, 1, 900), bank(FeatureKind::Line, 2, 1800)];
        let (lines, _) = build(&banks, 100);
        assert!(lines.is_between_shores([[0, 0], [100, 0], [100, 900]]));
        assert!(!lines.is_between_shores([[0, 900], [100, 900], [100, 1800]]), "one corner is on a line");
        assert!(!lines.is_between_shores([[0, 0], [100, 0], [50, 450]]), "one corner is a point");
    }

    #[test]
    fn lakes_that_are_not_flat_and_rivers_that_rise_are_found() {
        let mut pond = POND;
        pond[2][2] = 58;
        let river = [[0, 5000, 90], [100, 5000, 80], [200, 5000, 85], [300, 5000, 87], [400, 5000, 20]];
        let falls = [[0, 6000, 1], [100, 6000, 2], [200, 6000, 2], [300, 6000, 9]];
        let features = [
            feature(FeatureKind::Lake, 0, &pond),
            feature(FeatureKind::River, 1, &river),
            feature(FeatureKind::River, 2, &falls),
        ];
        let (lines, found) = build(&features, 100);
        assert_eq!(found.worst_uneven, [Uneven { id: id(0), lowest: 50, highest: 58, place: [1000, 1000] }]);
        assert_eq!(found.worst_rises, [Rise { id: id(1), place: [300, 5000], steps: 7 }]);
        assert_eq!((found.uneven_lakes, found.rising_rivers), (1, 1));
        assert_eq!(at(&lines, [1000, 1000]), Some((50, FeatureKind::Lake)), "the lowest height is that of the lake");
    }

    #[test]
    fn walls_are_refused_and_repeated_vertices_are_not() {
        let wall = feature(FeatureKind::Line, 5, &[[0, 0, 3], [10, 0, 3], [10, 0, 9], [0, 0, 9]]);
        let error = Breaklines::build(&[wall], &BreaklineOptions::new(10, None)).unwrap_err();
        assert_eq!(error, BreaklineError::Wall { id: id(5), place: [10, 0], heights: [3, 9] });
        let cured =
            feature(FeatureKind::Line, 5, &[[0, 0, 3], [0, 0, 3], [100, 0, 4], [100, 0, 3], [0, 100, 8], [0, 0, 6]]);
        let (_, found) = build(&[cured, feature(FeatureKind::Line, 6, &[[9, 9, 9], [9, 9, 9]])], 100);
        assert_eq!((found.repeated_vertices, found.empty_paths, found.segments), (3, 1, 3));
        assert_eq!(found.worst_disagreements[0].kept, (id(5), 3), "a closed line that ends higher than it starts");
        let far = feature(FeatureKind::Line, 1, &[[0, 0, 0], [i32::MIN, 0, 0]]);
        let error = Breaklines::build(&[far], &BreaklineOptions::new(10, None)).unwrap_err();
        assert_eq!(error, BreaklineError::OutOfReach { id: id(1), place: [i32::MIN, 0] });
    }

    #[test]
    fn too_many_sites_are_refused() {
        let line = feature(FeatureKind::Line, 0, &[[0, 0, 3], [100_000, 777, 3]]);
        let options = BreaklineOptions { most_sites: 500, ..BreaklineOptions::new(100, None) };
        assert_eq!(
            Breaklines::build(std::slice::from_ref(&line), &options).unwrap_err(),
            BreaklineError::TooMany { most: 500 }
        );
        assert!(Breaklines::build(&[line], &BreaklineOptions { most_sites: 2000, ..options }).is_ok());
    }

    #[test]
    fn hundreds_of_lines_meet_at_one_place() {
        // From the middle to all lattice points of a square's border, and beyond.
        let border = (-30..30).flat_map(|i| [[i, -30], [30, i], [-i, 30], [-30, -i]]);
        let line = |(i, [x, y]): (u64, [i32; 2])| {
            feature(FeatureKind::Line, i, &[[0, 0, 0], [x * 60, y * 60, 9], [x * 99 + y, y * 99, 9]])
        };
        let features: Vec<Feature> = (0..).zip(border).map(line).collect();
        let (lines, _) = build(&features, 1000);
        let place = |i: u32| lines.sites()[i as usize].place;
        let touches = |&[a, b]: &[u32; 2]| {
            let ends = [place(a), place(b)];
            let others = (0..lines.sites().len() as u32).filter(|&p| p != a && p != b);
            others.map(place).any(|p| crate::exact::in_disc(ends[0], ends[1], p))
        };
        assert!(!lines.subsegments().iter().any(touches));
        assert!((480..40_000).contains(&lines.subsegments().len()), "{}", lines.subsegments().len());
    }

    #[test]
    fn only_what_is_in_the_box_is_cut() {
        let line = feature(FeatureKind::Line, 0, &[[-1_000_000, 0, 0], [1_000_000, 10, 0]]);
        let far = feature(FeatureKind::Line, 1, &[[-1_000_000, 5000, 0], [1_000_000, 5000, 0]]);
        let within = Bounds { min: [-500, -300], max: [500, 300] };
        let pond = feature(FeatureKind::Lake, 2, &[[100, -9000, 5], [9000, -9000, 5], [9000, 9000, 5], [100, 9000, 5]]);
        let (lines, found) = Breaklines::build(&[line, far, pond], &BreaklineOptions::new(100, Some(within))).unwrap();
        let [min, max] = [0, 1].map(|end| {
            lines
                .sites()
                .iter()
                .map(|s| s.place[0])
                .fold(if end == 0 { 9 } else { -9 }, |a, b| if end == 0 { a.min(b) } else { a.max(b) })
        });
        assert_eq!((min, max, found.pieces_outside, found.lakes_at_border), (-500, 500, 3, 1));
        assert!(lines.drops([300, 200]) && !lines.drops([-300, 200]));
        let [line, far, pond] = [at(&lines, [-500, 5]), at(&lines, [-500, 300]), at(&lines, [500, -300])];
        assert_eq!((line, far, pond), (Some((0, FeatureKind::Line)), None, Some((5, FeatureKind::Lake))));
    }

    /// Neighbouring tiles cut lakes at their common border, and each has its part.
    #[test]
    fn lakes_reach_the_border_of_the_box_and_are_flat() {
        let within = Bounds { min: [0, 0], max: [1000, 1000] };
        let options = BreaklineOptions::new(100, Some(within));
        for (ring, inside) in [
            ([[500, -200], [1500, -200], [1500, 1200], [500, 1200]], [[1000, 0], [1000, 1000], [501, 999]]),
            ([[700, 700], [1500, 700], [1500, 1200], [700, 1200]], [[1000, 1000], [999, 701], [800, 1000]]),
            ([[0, 0], [1000, 0], [1000, 1000], [0, 1000]], [[1000, 1000], [0, 0], [500, 500]]),
            ([[-1, -1], [5000, -1], [5000, 1001], [-1, 1001]], [[1000, 1000], [0, 0], [500, 500]]),
            ([[0, 0], [1000, 0], [500, 500], [0, 0]], [[10, 1], [990, 1], [500, 490]]),
        ] {
            let lake = feature(FeatureKind::Lake, 0, &ring.map(|[x, y]| [x, y, 50]));
            let (lines, _) = Breaklines::build(&[lake], &options).unwrap();
            assert!(inside.iter().all(|place| lines.drops(*place)), "{ring:?}");
            assert!(lines.sites().iter().all(|site| site.z == Some(50)) && lines.sites().len() > 8, "{ring:?}");
            let ends = lines.subsegments().iter().flatten().copied();
            let mut ends: Vec<u32> = ends.collect();
            ends.sort_unstable();
            assert!(ends.chunk_by(|a, b| a == b).all(|same| same.len() == 2), "{ring:?} is not closed");
        }
        let beside = feature(FeatureKind::Lake, 0, &[[1000, 0, 5], [2000, 0, 5], [2000, 1000, 5], [1000, 1000, 5]]);
        let (lines, found) = Breaklines::build(&[beside], &options).unwrap();
        assert_eq!((lines.sites().len(), found.lakes_at_border), (0, 0));
    }

    #[test]
    fn lines_through_corners_of_the_box_and_along_its_border_stay() {
        let within = Bounds { min: [0, 0], max: [1000, 1000] };
        for path in [
            [[0, 0, 1], [1000, 1000, 1]],
            [[-500, -500, 1], [1500, 1500, 1]],
            [[0, 0, 1], [500, 500, 1]],
            [[-9, 1009, 1], [1009, -9, 1]],
            [[0, 1000, 1], [1000, 1000, 1]],
            [[0, 3, 1], [1000, 3, 1]],
        ] {
            let line = feature(FeatureKind::Line, 0, &path);
            let (lines, found) = Breaklines::build(&[line], &BreaklineOptions::new(100, Some(within))).unwrap();
            assert!((7..=14).contains(&found.subsegments), "{path:?}: {found:?}");
            assert!(lines.sites().len() as u64 == found.subsegments + 1);
        }
    }

    #[test]
    fn lines_that_are_the_same_are_cut_once() {
        let line = |number: u64| feature(FeatureKind::Line, number, &[[0, 0, 0], [1000, 10, 101], [1000, 300, 101]]);
        let many: Vec<Feature> = (0..500).map(line).collect();
        let ((one, _), (all, found)) = (build(&many[..1], 10), build(&many, 10));
        assert_eq!((one.sites(), one.subsegments()), (all.sites(), all.subsegments()));
        assert_eq!((found.segments, found.disagreements), (2, 0));
        // Where heights differ, the lowest is taken at every site.
        let higher = |number: u64| {
            let z = (number * 7 % 300) as i32;
            feature(FeatureKind::Line, number, &[[0, 0, 300 - z], [1000, 0, z]])
        };
        let (lines, found) = build(&(0..300).map(higher).collect::<Vec<_>>(), 10);
        assert_eq!((at(&lines, [0, 0]).unwrap().0, at(&lines, [1000, 0]).unwrap().0), (1, 0));
        assert!(found.disagreements > 90 && found.worst_disagreements[0].place == [0, 0], "{found:?}");
    }

    /// All pairs cross, but at one place.
    #[test]
    fn lines_that_cross_at_one_place_need_few_sites() {
        // From one side of a square to the other.
        let border = (-75..75).flat_map(|i| [[i, 75], [75, i]]);
        let line =
            |(i, [x, y]): (u64, [i32; 2])| feature(FeatureKind::Line, i, &[[-6 * x, -6 * y, 0], [6 * x, 6 * y, 0]]);
        let features: Vec<Feature> = (0..).zip(border).map(line).collect();
        let options = BreaklineOptions { most_sites: 40_000, ..BreaklineOptions::new(1000, None) };
        let (_, found) = Breaklines::build(&features, &options).unwrap();
        assert!(found.crossings == 1 && found.sites < 40_000, "{found:?}");
    }

    #[test]
    fn walls_count_in_the_box_and_where_a_line_goes_straight_up() {
        let within = Bounds { min: [0, -50], max: [100, 50] };
        let options = BreaklineOptions::new(10, Some(within));
        let wall = feature(FeatureKind::Line, 5, &[[0, 0, 3], [900, 0, 3], [900, 0, 9]]);
        assert!(Breaklines::build(&[wall], &options).is_ok());
        let spiral = feature(FeatureKind::Line, 5, &[[0, 0, 1], [50, 0, 2], [80, 40, 30], [20, 40, 60], [50, 0, 90]]);
        let (lines, found) = Breaklines::build(&[spiral], &options).unwrap();
        assert_eq!((at(&lines, [50, 0]), found.disagreements), (Some((2, FeatureKind::Line)), 1));
    }

    #[test]
    fn what_lies_in_a_lake_is_found() {
        let dam = feature(FeatureKind::Line, 1, &[[-500, 500, 80], [1500, 500, 80]]);
        let pond = feature(FeatureKind::Lake, 2, &[[100, 100, 70], [200, 100, 70], [200, 200, 70], [100, 200, 70]]);
        let (_, found) = build(&[dam, pond, feature(FeatureKind::Lake, 3, &POND)], 100);
        let cases: Vec<_> = found.worst_in_lakes.iter().map(|case| (case.id, case.lake, case.length)).collect();
        assert_eq!(cases, [(id(1), id(3), 1000), (id(2), id(3), 400)]);
    }

    #[test]
    fn every_pond_of_a_feature_has_its_own_height() {
        let pond = |x: i32| {
            let mut pond = feature(FeatureKind::Lake, 0, &POND.map(|[a, b, z]| [a + x, b, z]));
            pond.paths[0].iter_mut().for_each(|v| v.z = None);
            pond
        };
        let (mut lines, _) = build(&[pond(0), pond(5000)], 250);
        let mut nearest = NearestHeights::new(&lines);
        (-10..80).for_each(|i| nearest.offer([100 * i, -10], if i < 30 { 7 } else { 90 }));
        assert!(nearest.settle(&mut lines));
        assert_eq!((at(&lines, [0, 0]).unwrap().0, at(&lines, [6000, 1000]).unwrap().0), (7, 90));
    }

    #[test]
    fn what_is_not_compared_is_counted() {
        let mut pond = feature(FeatureKind::Lake, 0, &POND);
        pond.paths[0].iter_mut().for_each(|v| v.z = None);
        let mut river = feature(FeatureKind::River, 1, &[[3000, 0, 0], [4000, 0, 0]]);
        river.paths[0].iter_mut().for_each(|v| v.z = None);
        let (_, found) = build(&[pond, river, feature(FeatureKind::Line, 2, &[[-500, 500, 9], [500, 500, 9]])], 100);
        assert_eq!((found.places_not_compared, found.rivers_without_heights), (1, 1));
    }

    #[test]
    fn lines_without_heights_take_them_from_the_points_around() {
        let without = |mut feature: Feature| {
            feature.paths.iter_mut().flatten().for_each(|v| v.z = None);
            feature
        };
        let pond = without(feature(FeatureKind::Lake, 0, &POND));
        let path = without(feature(FeatureKind::Line, 1, &[[-5000, 500, 0], [-2000, 500, 0]]));
        let partly = Vertex { place: [-2000, 2000], z: None };
        let mut road = feature(FeatureKind::Line, 2, &[[-5000, 2000, 10], [0, 2000, 60]]);
        road.paths[0].insert(1, partly);
        let (mut lines, found) = build(&[pond, path, road], 250);
        assert_eq!(at(&lines, [-2000, 2000]), Some((40, FeatureKind::Line)), "between vertices that have one");
        let mut nearest = NearestHeights::new(&lines);
        let mut others = nearest.clone();
        assert!(!nearest.settle(&mut lines.clone()), "no point yet");
        for i in -60..20 {
            nearest.offer([100 * i, 480], 100 + i);
            others.offer([100 * i, 490], 200 + i);
        }
        nearest.join(others.found());
        assert!(nearest.settle(&mut lines) && found.sites_without_height > 20);
        assert_eq!(at(&lines, [-5000, 500]), Some((150, FeatureKind::Line)));
        let water: std::collections::BTreeSet<_> =
            lines.sites().iter().filter(|s| s.kind == FeatureKind::Lake).map(|s| s.z).collect();
        assert_eq!(water.len(), 1, "one height for the lake: {water:?}");
        let far = without(feature(FeatureKind::Line, 3, &[[0, 90_000, 0], [9, 99_000, 0]]));
        let (mut lines, _) = build(&[far], 250);
        assert!(!NearestHeights::new(&lines).settle(&mut lines) && lines.sites()[0].z.is_none());
    }
}
