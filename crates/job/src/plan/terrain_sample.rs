//! A sample of the points on the tiles of a globe: how many vertices tiles have, and how far the terrain reaches.

use crate::plan::globe_system::globe_system;
use crs::Crs;
use delaunay::geometry::{Bounds, Site, bounds_of};
use quantized_mesh::{GridPoint, SPAN, Scheme, TileGrid};
use std::collections::HashMap;
use std::f64::consts::TAU;
use tiles::frame::Frame;

/// A tile where fewer places of the sample have points tells little: all points of the places may be in it, or only those of the sample.
const SURE_PLACES: usize = 4;

/// A tile where fewer have points tells nothing: files of flight lines have such tiles by chance.
const LEAST_PLACES: usize = 3;

/// A sample that reaches along so much of both sides of the box around all points shows the hull of the terrain, and the area of that may be so many times
/// what it shows.
const REACHED: f64 = 0.8;
const WIDER: f64 = 1.1;

/// What is known of a cloud before its points are read.
pub(crate) struct SampledCloud<'a> {
    pub(crate) crs: &'a Crs,
    pub(crate) frame: &'a Frame,
    /// The box around all points, as headers tell.
    pub(crate) extent: Bounds<2>,
    /// The points that the job keeps of the sample.
    pub(crate) sample: &'a [(Site, i32)],
    /// About so many points of it follow one another.
    pub(crate) of_place: usize,
    /// The records that are decoded, and those that the sample has seen.
    pub(crate) records: u64,
    pub(crate) seen: u64,
}

/// A point of the sample.
struct PlacedSite {
    /// The number of the place of the sample.
    number: usize,
    site: Site,
    /// Longitude and latitude in radians.
    place: [f64; 2],
}

/// A sample on the globe.
pub(super) struct Placed {
    sites: Vec<PlacedSite>,
    /// For how many points one of the sample stands.
    times: f64,
    /// Longitude and latitude in the middle of the sample.
    pub(super) middle: [f64; 2],
    /// The least and the greatest area of the terrain in square metres.
    pub(super) areas: [f64; 2],
    /// Whether the sample shows how far the terrain reaches.
    pub(super) shows_all: bool,
    /// Twice as many degrees as points are from the middle of all, at most.
    pub(super) longitudes: f64,
    /// How many degrees north or south of the equator points are, at most.
    pub(super) latitude: f64,
}

impl Placed {
    /// Places a sample; `None` if it has no place.
    pub(super) fn of(cloud: &SampledCloud) -> Option<Placed> {
        let extras = cloud.frame.extras();
        let system = globe_system(cloud.crs, extras.metres_per_unit).ok()?;
        let place = |site: [f64; 2]| {
            let along = |axis: usize| extras.offset[axis] + extras.resolution * site[axis];
            (system.way)([along(0), along(1)])
        };
        let placed = |(i, (site, _)): (usize, &(Site, i32))| {
            Some(PlacedSite { number: i / cloud.of_place.max(1), site: *site, place: place(site.map(f64::from))? })
        };
        let sites: Vec<PlacedSite> = cloud.sample.iter().enumerate().filter_map(placed).collect();
        let PlacedSite { site, place: middle, .. } = *sites.get(sites.len() / 2)?;
        let shown: Vec<Site> = sites.iter().map(|site| site.site).collect();
        let along = |bounds: Bounds<2>| [0, 1].map(|axis| bounds.extent(axis) as f64);
        let of_sample = bounds_of(&shown)?;
        let (own, whole) = (along(of_sample), along(cloud.extent));
        let shows_all = (0..2).all(|axis| own[axis] >= whole[axis] * REACHED);
        let hull = hull_area(&shown);
        // A terrain of a usual shape covers at least half of its box.
        let most = if shows_all { hull * WIDER } else { (hull * WIDER).max(whole[0] * whole[1] / 2.0) };
        let step = area_of_step(site, extras.resolution, &place).unwrap_or(cloud.frame.resolution_metres()[0].powi(2));
        // That of the extent may be far from all points where boxes are transformed.
        let from = place(of_sample.middle().map(f64::from));
        Some(Placed {
            longitudes: from.map_or(0.0, |[from, _]| 2.0 * farthest(&sites, from)),
            latitude: sites.iter().map(|site| site.place[1].abs().to_degrees()).fold(0.0, f64::max),
            sites,
            times: (cloud.records as f64 / cloud.seen.max(1) as f64).max(1.0),
            middle,
            areas: [hull, most].map(|area| area * step),
            shows_all,
        })
    }

    /// Returns about how many points there are.
    pub(super) fn points(&self) -> u64 {
        (self.sites.len() as f64 * self.times) as u64
    }

    /// Returns about how many vertices all tiles of a zoom have together, before they are rounded to its grid.
    pub(super) fn vertices(&self, zoom: (Scheme, u8)) -> u64 {
        let of_tiles = self.by_tile(zoom, |site, _| site.site.map(i64::from));
        of_tiles.into_values().map(|drawn| drawn_of(drawn, self.times).0).sum::<f64>() as u64
    }

    /// Returns how many vertices a tile of a zoom has at most, as far as the sample shows that well, and as far as it shows it at all.
    pub(super) fn most_in_a_tile(&self, zoom: (Scheme, u8)) -> [f64; 2] {
        let of_tiles = self.by_tile(zoom, |_, point| [point.x, point.y]);
        let found = of_tiles.into_values().map(|drawn| {
            let (vertices, places) = drawn_of(drawn, self.times);
            if self.times == 1.0 {
                return [vertices; 2];
            }
            // As many places of the sample may have missed the tile as chance has it.
            let most = vertices * (1.0 + 1.0 / (places as f64).sqrt());
            [SURE_PLACES, LEAST_PLACES].map(|least| if places >= least { most } else { 0.0 })
        });
        found.fold([0.0; 2], |most, more| [0, 1].map(|k| most[k].max(more[k])))
    }

    /// Returns what the tiles of a zoom have of the sample: what `key` says of each point, and the number of its place of the sample.
    fn by_tile(
        &self,
        (scheme, zoom): (Scheme, u8),
        key: impl Fn(&PlacedSite, &GridPoint) -> [i64; 2],
    ) -> HashMap<[i64; 2], Vec<([i64; 2], usize)>> {
        let mut grid = TileGrid::new(scheme, zoom);
        let mut tiles: HashMap<[i64; 2], Vec<([i64; 2], usize)>> = HashMap::new();
        for site in &self.sites {
            let Some(point) = grid.nearest(site.place, 0.0) else { continue };
            let tile = [point.x, point.y].map(|along| along.div_euclid(SPAN));
            tiles.entry(tile).or_default().push((key(site, &point), site.number));
        }
        tiles
    }
}

/// Returns how many degrees of longitude points are from one in radians, at most.
fn farthest(sites: &[PlacedSite], from: f64) -> f64 {
    let apart = sites.iter().map(|site| site.place[0] - from);
    apart.map(|apart| (apart - (apart / TAU).round() * TAU).abs().to_degrees()).fold(0.0, f64::max)
}

/// Returns the area of a square step at a point in square metres.
fn area_of_step(site: Site, resolution: f64, place: &impl Fn([f64; 2]) -> Option<[f64; 2]>) -> Option<f64> {
    /// The radius of the earth in metres, about.
    const RADIUS: f64 = 6_371_000.0;
    let side = 1.0 / resolution;
    let [x, y] = site.map(f64::from);
    let origin = place([x, y])?;
    let [east, north] = [place([x + side, y])?, place([x, y + side])?]
        .map(|beside| [(beside[0] - origin[0]) * libm::cos(origin[1]), beside[1] - origin[1]]);
    Some((east[0] * north[1] - east[1] * north[0]).abs() * RADIUS * RADIUS / (side * side))
}

/// Returns the area of the convex hull of sites in square steps.
fn hull_area(sites: &[Site]) -> f64 {
    let mut sorted: Vec<[i64; 2]> = sites.iter().map(|site| site.map(i64::from)).collect();
    sorted.sort_unstable();
    let turn = |a: [i64; 2], b: [i64; 2], c: [i64; 2]| {
        let [[bx, by], [cx, cy]] = [b, c].map(|p| [i128::from(p[0] - a[0]), i128::from(p[1] - a[1])]);
        bx * cy - by * cx
    };
    // Below and above the line from the first to the last.
    let chain = |points: &mut dyn Iterator<Item = [i64; 2]>| {
        let mut chain: Vec<[i64; 2]> = Vec::new();
        for point in points {
            while chain.len() > 1 && turn(chain[chain.len() - 2], chain[chain.len() - 1], point) <= 0 {
                chain.pop();
            }
            chain.push(point);
        }
        chain
    };
    let around = [chain(&mut sorted.iter().copied()), chain(&mut sorted.iter().rev().copied())].concat();
    let Some(&first) = around.first() else { return 0.0 };
    let double: i128 = around.windows(2).map(|edge| turn(first, edge[0], edge[1])).sum();
    double as f64 / 2.0
}

/// Returns about how many different keys there are where a sample has drawn these, of which each stands for `times` as many, and from how many of its places
/// they come. The more keys come from several places, the fewer there are.
fn drawn_of(mut drawn: Vec<([i64; 2], usize)>, times: f64) -> (f64, usize) {
    // Points that follow one another may be neighbours, so that a key that one place has twice tells only of that place.
    drawn.sort_unstable();
    drawn.dedup();
    let distinct = drawn.chunk_by(|a, b| a.0 == b.0).count() as f64;
    let mut places: Vec<usize> = drawn.iter().map(|(_, place)| *place).collect();
    places.sort_unstable();
    places.dedup();
    if times == 1.0 {
        return (distinct, places.len());
    }
    let (all, own) = (drawn.len() as f64, 1.0 / places.len().max(1) as f64);
    // Some meet by chance.
    let met = all - distinct - 2.0 * (all - distinct).sqrt();
    let crowding = if met > 0.0 && own < 1.0 { crowding_of(met / all) / (1.0 - own) } else { 0.0 };
    (all * times * share_of_distinct(crowding * times), places.len())
}

/// Returns which share of things drawn from a number of keys are different, where so many times as many are drawn as there are keys.
fn share_of_distinct(crowding: f64) -> f64 {
    if crowding > 0.0 { -libm::expm1(-crowding) / crowding } else { 1.0 }
}

/// Returns how many times as many things are drawn as there are keys, where this share of them has met others.
fn crowding_of(met: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1e6);
    for _ in 0..64 {
        let middle = (low + high) / 2.0;
        if 1.0 - share_of_distinct(middle) < met { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns numbers below a limit that look random.
    fn random(seed: u64) -> impl FnMut(u64) -> u64 {
        let mut state = seed;
        move |below| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        }
    }

    fn vertices(drawn: Vec<([i64; 2], usize)>, times: f64) -> f64 {
        drawn_of(drawn, times).0
    }

    #[test]
    fn points_of_one_place_are_one_vertex() {
        let apart = (0..5_000).map(|i| ([i % 71 * 1_000, i / 71 * 1_000], i as usize / 50)).collect();
        assert_eq!(vertices(apart, 100.0), 500_000.0);
        assert!(vertices((0..5_000).map(|i| ([3, 4], i / 50)).collect(), 100.0) < 5_000.0);
        // So many places, each with several points of all.
        let mut next = random(1);
        for places in [2_000, 40_000, 100_000, 250_000] {
            let drawn = (0..60_000).map(|i| ([next(places) as i64, 0], i / 500)).collect();
            let (found, expected) = (vertices(drawn, 25.0), places as f64);
            // At most what chance may have hidden.
            assert!((0.95 * expected..1.25 * expected).contains(&found), "{places}: {found}");
        }
    }

    /// Files may be in order of place: then those that follow one another meet, and tell nothing of others.
    #[test]
    fn neighbours_that_share_a_place_tell_nothing_of_other_places() {
        let drawn = (0..50_000).map(|i| ([i / 1_000 * 1_000_000 + i % 1_000 / 2, 0], i as usize / 1_000)).collect();
        assert_eq!(vertices(drawn, 100.0), 2_500_000.0);
    }

    #[test]
    fn the_area_of_a_hull_is_that_of_its_corners() {
        assert_eq!(hull_area(&[]), 0.0);
        assert_eq!(hull_area(&[[3, 4], [3, 4], [9, 12]]), 0.0);
        let mut next = random(3);
        let inside = (0..300).map(|_| [next(1_000), next(1_000)].map(|along| along as i32 - 200));
        let corners = [[-200, -200], [800, -200], [-200, 800], [800, 800], [300, 1_300]];
        assert_eq!(hull_area(&inside.chain(corners).collect::<Vec<Site>>()), 1_250_000.0);
        let far = (1 << 29) - 1;
        let side = 2.0 * f64::from(far);
        assert_eq!(hull_area(&[[-far, -far], [far, far], [far, -far], [-far, far]]), side * side);
    }

    #[test]
    fn the_most_crowded_tile_is_found() {
        // A tile of zoom 12 is 0.044 degrees wide.
        let wide = (0..500).map(|i| [0.1 + f64::from(i) * 1e-3, 0.7]);
        let crowd = (0..4_000).map(|i| [0.2 + f64::from(i % 64) * 1e-7, 0.8 + f64::from(i / 64) * 1e-7]);
        let of_place = |of_place: usize| {
            let sites = wide.clone().chain(crowd.clone()).enumerate();
            let sites = sites.map(|(i, place)| PlacedSite { number: i / of_place, site: [i as i32, 7], place });
            let (middle, areas) = ([0.2, 0.8], [1.0; 2]);
            Placed {
                sites: sites.collect(),
                times: 50.0,
                middle,
                areas,
                shows_all: true,
                longitudes: 0.0,
                latitude: 0.0,
            }
        };
        let most = |number: usize| of_place(number).most_in_a_tile((Scheme::Geographic, 12));
        let [shown, possible] = most(50);
        assert!((190_000.0..240_000.0).contains(&shown) && shown == possible, "{shown} {possible}");
        let [shown, possible] = most(2_000);
        assert!(shown < 100_000.0 && possible > 190_000.0, "few places show little: {shown} {possible}");
    }
}
