//! Random arrangements of lines and lakes of every kind that is known to be hard, against the definition and the reference.

use super::exact::{distance2, dot, in_disc};
use super::*;
use delaunay::geometry::REACH;
use delaunay::geometry::predicates::orient2d;
use delaunay::geometry::{Bounds, Site};
use delaunay::triangulation::reference;
use delaunay::voronoi::test_cases::Random;
use std::collections::BTreeSet;

const KINDS: [&str; 11] = [
    "random",
    "fan",
    "parallel",
    "walk",
    "touching",
    "triangles",
    "lakes",
    "huge",
    "coarse",
    "zigzag",
    "lakes and lines",
];

/// Returns the features of a kind and the options to cut them with.
fn arrangement(kind: &str, random: &mut Random) -> (Vec<Feature>, BreaklineOptions) {
    let side = [12, 60, 400, 3000, 40_000][random.below(5) as usize];
    let most = if kind == "huge" { REACH } else { side };
    let spacing = (1 + random.below(most) / 2 + most / 60) as u32;
    let floor = 2 + random.below(4) as u32;
    let mut options = BreaklineOptions { floor, most_sites: 4000, ..BreaklineOptions::new(spacing, None) };
    if random.below(4) == 0 {
        options.within = Some(Bounds { min: [side / 4; 2], max: [side - side / 5; 2] });
    }
    let turn = random.below(8);
    let count = 1 + random.below(7);
    let mut paths: Vec<(FeatureKind, Vec<Site>)> = Vec::new();
    let mut lakes: Vec<Vec<Site>> = Vec::new();
    for i in 0..count {
        let kinds = [FeatureKind::Line, FeatureKind::River, FeatureKind::Line];
        let mut line = |path: Vec<Site>, random: &mut Random| paths.push((kinds[random.below(3) as usize], path));
        match kind {
            "random" => line(vec![place(side, random), place(side, random)], random),
            "fan" => {
                let length = side / 2 + random.below(side);
                line(vec![[3, 3], [3 + length, 3 + i + random.below(1 + side / 20)]], random);
            }
            "parallel" => {
                let off = i * (1 + random.below(12));
                let stops = 2 + random.below(5);
                line((0..stops).map(|k| [k * side / 5 + random.below(3), k * side / 11 + off]).collect(), random);
            }
            "walk" | "zigzag" => line(walk(kind == "zigzag", side, random), random),
            "touching" => {
                let [k, j] = [random.below(8), 1 + random.below(8)];
                let off = if random.below(2) == 0 { [0, 0] } else { place(4, random) };
                let on = |k: i32| [k * side / 8 + off[0], k * side / 16 + off[1]];
                line(
                    if random.below(2) == 0 { vec![on(k), on(k + j)] } else { vec![on(k), place(side, random)] },
                    random,
                );
            }
            "triangles" => lakes.push((0..3).map(|_| place(4 + side / 50, random)).collect()),
            "lakes" => lakes.push((0..3 + random.below(5)).map(|_| place(side, random)).collect()),
            "huge" => line((0..2 + random.below(2)).map(|_| far(random)).collect(), random),
            "coarse" => {
                let at = |random: &mut Random| place(6, random).map(|v| v * (1 + side / 6));
                line((0..2 + random.below(3)).map(|_| at(random)).collect(), random);
            }
            _ => {
                let [x, y] = place(side, random);
                let [w, h] = place(side / 2, random).map(|v| v + 3);
                let slant = random.below(1 + w / 3);
                lakes.push(vec![[x, y], [x + w, y + slant], [x + w - slant, y + h], [x + slant, y + h]]);
                line(walk(false, side, random), random);
            }
        }
    }
    paths.extend(lakes.into_iter().map(|ring| (FeatureKind::Lake, ring)));
    let turned = |[x, y]: Site| {
        let [x, y] = if turn & 1 == 0 { [x, y] } else { [y, x] };
        if kind == "huge" {
            [x, y]
        } else {
            [if turn & 2 == 0 { x } else { side - x }, if turn & 4 == 0 { y } else { side - y }]
        }
    };
    let vertex = |place: Site, level: Option<i32>| Vertex { place, z: level.or(Some(height(place))) };
    let feature = |(i, (kind, path)): (usize, (FeatureKind, Vec<Site>))| Feature {
        kind,
        id: FeatureId { file: 0, feature: i as u64 },
        paths: vec![
            path.into_iter().map(|p| vertex(turned(p), (kind == FeatureKind::Lake).then_some(i as i32))).collect(),
        ],
    };
    let mut features: Vec<Feature> = paths.into_iter().enumerate().map(feature).collect();
    if let Some(Bounds { min, max }) = options.within.filter(|_| random.below(2) == 0) {
        // Through two corners of the box, or as far as these.
        let off = random.below(2) * (1 + random.below(side));
        let ends = [[min[0] - off, min[1] - off], [max[0] + off, max[1] + off]];
        let id = FeatureId { file: 0, feature: features.len() as u64 };
        let path = ends.map(|end| vertex(end, None)).to_vec();
        features.push(Feature { kind: FeatureKind::Line, id, paths: vec![path] });
    }
    (features, options)
}

fn place(side: i32, random: &mut Random) -> Site {
    [random.below(side.max(1)), random.below(side.max(1))]
}

fn far(random: &mut Random) -> Site {
    [(); 2].map(|()| match random.below(4) {
        0 => REACH - random.below(3),
        1 => random.below(3) - REACH,
        2 => random.below(3),
        _ => 2 * (random.below(REACH) - REACH / 2),
    })
}

/// Returns a polyline. One that zigzags turns back at nearly the same angle each time.
fn walk(zigzags: bool, side: i32, random: &mut Random) -> Vec<Site> {
    let mut at = place(side, random);
    let step = 1 + random.below(1 + side / 6);
    (0..2 + random.below(7))
        .map(|i| {
            let [x, y] = place(2 * step + 1, random).map(|v| v - step);
            at = if zigzags {
                [at[0] + if i % 2 == 0 { side / 3 } else { -side / 3 }, at[1] + random.below(4)]
            } else {
                [at[0] + x, at[1] + y]
            };
            at
        })
        .collect()
}

/// The height of a vertex depends on its place, so that no line is a wall.
fn height([x, y]: Site) -> i32 {
    (i64::from(x) * 7 + i64::from(y) * 13).rem_euclid(50) as i32
}

fn segments(features: &[Feature], wanted: impl Fn(FeatureKind) -> bool) -> Vec<[Site; 2]> {
    let mut found = Vec::new();
    for feature in features.iter().filter(|feature| wanted(feature.kind)) {
        for path in &feature.paths {
            let ring = feature.kind == FeatureKind::Lake;
            let closing = path.last().zip(path.first()).filter(|_| ring).map(|(a, b)| [a.place, b.place]);
            found.extend(path.windows(2).map(|pair| [pair[0].place, pair[1].place]).chain(closing));
        }
    }
    found
}

/// Returns the distance of `p` from the segment.
fn distance([a, b]: [Site; 2], p: Site) -> f64 {
    let along = dot(a, b, p).clamp(0, distance2(a, b)) as f64 / (distance2(a, b) as f64).max(1.0);
    let off = [0, 1].map(|k| f64::from(a[k]) + along * (f64::from(b[k]) - f64::from(a[k])) - f64::from(p[k]));
    off[0].hypot(off[1])
}

/// Returns how far a line in a bundle of so many may move: two snaps, one more for each other line, and half a step for each time that a
/// piece is halved and rounded.
fn moved_by(lines: usize, options: &BreaklineOptions) -> f64 {
    (1 + lines) as f64 * f64::from(options.floor) + 2.0 + 0.5 * f64::from(options.spacing).log2()
}

/// Returns how far a line may move at `p`, where it may run in a bundle of lines.
fn moved_at(p: Site, segments: &[[Site; 2]], options: &BreaklineOptions) -> f64 {
    let mut lines = 1;
    loop {
        let moved = moved_by(lines, options);
        let beside = segments.iter().filter(|s| distance(**s, p) <= moved).count();
        if beside <= lines {
            return moved;
        }
        lines = beside;
    }
}

/// Tells by the definition whether `p` is in a lake.
fn in_lake(features: &[Feature], p: Site) -> bool {
    let crosses = |[a, b]: &[Site; 2]| {
        let [low, high] = if a[1] < b[1] { [*a, *b] } else { [*b, *a] };
        low[1] <= p[1] && p[1] < high[1] && orient2d(low, high, p) > 0
    };
    let is_lake = |kind: FeatureKind| kind == FeatureKind::Lake;
    let inside =
        |lake: &Feature| segments(std::slice::from_ref(lake), is_lake).iter().filter(|s| crosses(s)).count() % 2 == 1;
    features.iter().any(inside)
}

/// Returns the sides of the box where lakes may reach it.
fn sides_at_lakes(features: &[Feature], options: &BreaklineOptions) -> Vec<[Site; 2]> {
    let Some(Bounds { min, max }) = options.within else { return Vec::new() };
    let corners = [min, [max[0], min[1]], max, [min[0], max[1]]];
    let has_lake = features.iter().any(|feature| feature.kind == FeatureKind::Lake);
    (0..4).filter(|_| has_lake).map(|i| [corners[i], corners[(i + 1) % 4]]).collect()
}

/// Returns the features without the rings that have fewer than three places.
fn without_thin_rings(features: &[Feature]) -> Vec<Feature> {
    let is_thin = |path: &Vec<Vertex>| path.iter().map(|v| v.place).collect::<BTreeSet<_>>().len() < 3;
    let keeps = |feature: &Feature, path: &Vec<Vertex>| feature.kind != FeatureKind::Lake || !is_thin(path);
    let kept = |feature: &Feature| feature.paths.iter().filter(|path| keeps(feature, path)).cloned().collect();
    features.iter().map(|feature| Feature { paths: kept(feature), ..feature.clone() }).collect()
}

/// Checks that subsegments cover what lies in the box of all segments longer than what snaps may make a point of, but for what lies in
/// other lakes or at their shores. `pairs` are the subsegments.
fn check_cover(features: &[Feature], options: &BreaklineOptions, pairs: &[[Site; 2]]) {
    let all = segments(features, |_| true);
    let near = |p: Site, segments: &[[Site; 2]]| {
        let reach = moved_at(p, &all, options) + 1.0;
        segments.iter().any(|s| distance(*s, p) <= reach)
    };
    // Samples are rounded, so those on the border may lie outside.
    let inside = |within: Bounds<2>| Bounds { min: within.min.map(|v| v + 1), max: within.max.map(|v| v - 1) };
    let holds = |p: Site| options.within.is_none_or(|within| exact::holds(&inside(within), p));
    for (i, feature) in features.iter().enumerate() {
        let others: Vec<Feature> = features[..i].iter().chain(&features[i + 1..]).cloned().collect();
        let lakes: Vec<Feature> = others.into_iter().filter(|other| other.kind == FeatureKind::Lake).collect();
        let shores = segments(&lakes, |_| true);
        for [a, b] in segments(std::slice::from_ref(feature), |_| true) {
            let samples: Vec<Site> = (0..=24).map(|k| exact::between(a, b, k, 24)).filter(|p| holds(*p)).collect();
            let length = samples.first().zip(samples.last()).map_or(0, |(a, b)| distance2(*a, *b));
            let least = 2 * i64::from(options.floor) + 3;
            if length <= least * least {
                continue;
            }
            for p in samples {
                let is_away = !in_lake(&lakes, p) && !near(p, &shores);
                assert!(!is_away || near(p, pairs), "{p:?} of {a:?} {b:?} has no edge");
            }
        }
    }
}

/// Checks everything that is promised about the breaklines of `features`.
fn check(features: &[Feature], options: &BreaklineOptions, random: &mut Random) -> Option<usize> {
    let (lines, findings) = match Breaklines::build(features, options) {
        Err(BreaklineError::TooMany { .. }) => return None,
        built => built.unwrap(),
    };
    let places: Vec<Site> = lines.sites().iter().map(|site| site.place).collect();
    let pairs: Vec<[Site; 2]> = lines.subsegments().iter().map(|ends| ends.map(|i| places[i as usize])).collect();
    assert!(places.is_sorted_by_key(|p| (p[1], p[0])) && lines.sites().iter().all(|site| site.z.is_some()));
    assert_eq!((findings.sites, findings.subsegments), (places.len() as u64, pairs.len() as u64));
    for &[a, b] in &pairs {
        let wrong = places.iter().find(|&&p| p != a && p != b && in_disc(a, b, p));
        assert_eq!(wrong, None, "in the disc of {a:?} {b:?}");
    }
    let all: Vec<[Site; 2]> =
        segments(features, |_| true).into_iter().chain(sides_at_lakes(features, options)).collect();
    let near = |p: Site, segments: &[[Site; 2]]| segments.iter().map(|s| distance(*s, p)).fold(f64::INFINITY, f64::min);
    let moved = moved_by(1, options);
    assert!(places.iter().all(|&p| near(p, &all) <= moved), "a line has moved");
    assert!(options.within.is_none_or(|within| places.iter().all(|&p| exact::holds(&within, p))));

    let rings = without_thin_rings(features);
    let paths = |features: &[Feature]| features.iter().map(|feature| feature.paths.len() as u64).sum::<u64>();
    assert!(findings.empty_paths >= paths(features) - paths(&rings), "a ring is left out without a word");
    check_cover(&rings, options, &pairs);

    let mut points = cloud(&places, random);
    points.retain(|&p| options.within.is_none_or(|within| exact::holds(&within, p)));
    // What a lake needs of the box's border may move as any shore does.
    let shores: Vec<[Site; 2]> = segments(features, |kind| kind == FeatureKind::Lake)
        .into_iter()
        .chain(sides_at_lakes(features, options))
        .collect();
    for &p in &points {
        let by_disc = pairs.iter().any(|&[a, b]| in_disc(a, b, p));
        assert!(!by_disc || lines.drops(p), "{p:?} is in a disc");
        assert!(by_disc || !lines.drops(p) || !shores.is_empty(), "{p:?} is in no disc");
        if near(p, &shores) > moved {
            assert_eq!(lines.drops(p), by_disc || in_lake(features, p), "{p:?} and lakes");
        }
        assert!(!by_disc || near(p, &all) <= 1.25 * f64::from(options.spacing) + moved, "{p:?} is far from all lines");
    }
    let kept = points.into_iter().filter(|&p| !lines.drops(p));
    let sites: Vec<Site> = places.iter().copied().chain(kept).collect::<BTreeSet<_>>().into_iter().collect();
    let mesh = reference::triangulate(&sites).unwrap();
    let edges: BTreeSet<[Site; 2]> =
        mesh.half_edges().map(|h| [mesh.origin(h), mesh.destination(h)].map(|v| sites[v.get()])).collect();
    let is_edge = |[a, b]: &[Site; 2]| edges.contains(&[*a, *b]) || edges.contains(&[*b, *a]);
    assert!(edges.is_empty() || pairs.iter().all(is_edge), "a subsegment is no edge");
    // Flat water has no other corners, except where other lakes are as near as the floor.
    let lakes = features.iter().filter(|feature| feature.kind == FeatureKind::Lake).count();
    let is_lake = |p: Site| lines.position(p).is_some_and(|i| lines.sites()[i].kind == FeatureKind::Lake);
    for corners in mesh.triangles.iter().map(|t| t.map(|v| sites[v.get()])).filter(|t| lakes == 1 && lines.is_water(*t))
    {
        assert!(corners.into_iter().all(is_lake), "{corners:?} is not all water");
    }
    check_order(features, options, &lines, random);
    Some(pairs.len())
}

/// Returns points of a cloud, many of them close to sites.
fn cloud(places: &[Site], random: &mut Random) -> Vec<Site> {
    let Some(bounds) = Bounds::of_points(places.iter().copied()) else { return vec![[0, 0]] };
    let within = |v: i64| v.clamp(-i64::from(REACH), i64::from(REACH)) as i32;
    let anywhere = |random: &mut Random| {
        [0, 1].map(|k| within(bounds.min[k] as i64 + (random.unit() * (bounds.extent(k) + 1) as f64) as i64))
    };
    let mut points: Vec<Site> = (0..60).map(|_| anywhere(random)).collect();
    for _ in 0..60 {
        let [a, b] = [(); 2].map(|()| places[random.below(places.len() as i32) as usize]);
        let off = place(7, random).map(|v| v - 3);
        let near = if random.below(2) == 0 { a } else { exact::middle(a, b) };
        points.push([0, 1].map(|k| within(i64::from(near[k]) + i64::from(off[k]))));
    }
    points
}

/// Checks that neither the order of features nor the direction of paths matters.
fn check_order(features: &[Feature], options: &BreaklineOptions, lines: &Breaklines, random: &mut Random) {
    let mut others = features.to_vec();
    for i in (1..others.len()).rev() {
        others.swap(i, random.below(i as i32 + 1) as usize);
    }
    for (i, feature) in others.iter_mut().enumerate() {
        feature.id = FeatureId { file: 1, feature: i as u64 };
        if random.below(2) == 0 {
            feature.paths.iter_mut().for_each(|path| path.reverse());
        }
    }
    let (again, _) = Breaklines::build(&others, options).unwrap();
    let vertices = |lines: &Breaklines| -> Vec<_> { lines.sites().iter().map(|s| (s.place, s.z, s.kind)).collect() };
    assert_eq!(vertices(&again), vertices(lines));
    assert_eq!(again.subsegments(), lines.subsegments());
}

#[test]
fn no_site_is_in_a_closed_disc_and_every_subsegment_is_an_edge() {
    let cases: u64 = std::env::var("GDT_CASES").ok().and_then(|s| s.parse().ok()).unwrap_or(1500);
    let (mut count, mut refused) = (0, 0);
    for i in 0..cases {
        let mut random = Random((i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let kind = KINDS[i as usize % KINDS.len()];
        let (features, options) = arrangement(kind, &mut random);
        let checked =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| check(&features, &options, &mut random)));
        let checked = checked.unwrap_or_else(|_| panic!("case {i}, {kind}, {options:?}: {features:?}"));
        count += checked.unwrap_or(0);
        refused += u64::from(checked.is_none());
    }
    eprintln!("{cases} arrangements, {refused} of them too many sites, {count} subsegments");
    assert!(refused * 50 <= cases, "{refused} of {cases} refused");
}
