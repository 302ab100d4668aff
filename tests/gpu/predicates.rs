//! The exact predicates: shader against twin against `geometry::predicates`.

use super::random::Random;
use super::rig::Rig;
use delaunay::geometry::REACH;
use delaunay::geometry::Site;
use delaunay::geometry::predicates::{in_circle, in_circle_determinant, orient2d};
use delaunay_gpu::buffer_id::BufferId;
use delaunay_gpu::recording::{GpuCommand, Recording};
use delaunay_gpu::reference_kernels::predicates::decide;

const QUADS: usize = 1_000_000;

/// Returns a number from -reach to reach.
fn within(random: &mut Random, reach: i32) -> i32 {
    random.below(2 * reach as u32 + 1) as i32 - reach
}

fn site_within(random: &mut Random, reach: i32) -> Site {
    [within(random, reach), within(random, reach)]
}

/// Returns sites around `centre`: a site at most `reach` from it, turned by right angles and mirrored.
fn on_a_circle(random: &mut Random, centre: Site, reach: i32) -> [Site; 4] {
    let [p, q] = site_within(random, reach);
    let around = [[p, q], [-q, p], [-p, -q], [q, -p], [q, p], [-p, q], [-q, -p], [p, -q]];
    let first = random.below(8) as usize;
    let step = [1, 3, 5, 7][random.below(4) as usize];
    [0, 1, 2, 3].map(|i| {
        let [x, y] = around[(first + step * i) % 8];
        [centre[0] + x, centre[1] + y]
    })
}

/// Returns sites on a line, the last perhaps a step off.
fn on_a_line(random: &mut Random, reach: i32) -> [Site; 4] {
    let root = ((reach as f64).sqrt() as i32 / 2).max(1);
    let (start, direction) = (site_within(random, reach / 2), site_within(random, root));
    let mut sites = [(); 4].map(|()| {
        let factor = within(random, root);
        [start[0] + factor * direction[0], start[1] + factor * direction[1]]
    });
    sites[3][1] += random.below(2) as i32;
    sites
}

/// Returns sites whose coordinates are a limit of a tier, or a step from it.
fn at_the_limits(random: &mut Random, limit: i32) -> [Site; 4] {
    let mut coordinate = || {
        let edge = [-limit, 0, limit][random.below(3) as usize];
        let step = if random.below(4) == 0 { within(random, 1) } else { 0 };
        (edge + step).clamp(-REACH, REACH)
    };
    [(); 4].map(|()| [coordinate(), coordinate()])
}

/// Returns four distinct sites of the kind that `number` selects.
fn quad(number: usize, random: &mut Random) -> [Site; 4] {
    let reach = [1, 7, 100, 8191, 16_384, 32_768, 1 << 20, 1 << 25, REACH][number / 5 % 9];
    loop {
        let quad = match number % 5 {
            0 => [(); 4].map(|()| site_within(random, reach)),
            1 => {
                let centre = site_within(random, REACH / 2);
                on_a_circle(random, centre, (reach / 2).max(3))
            }
            2 => {
                let centre = site_within(random, REACH / 4);
                let mut sites = on_a_circle(random, centre, (reach / 2).max(3));
                sites[3][0] += within(random, 1);
                sites
            }
            3 => on_a_line(random, reach),
            _ => {
                let limit = [8192, 16_383, 16_384, 32_767, 32_768, REACH][random.below(6) as usize];
                at_the_limits(random, limit)
            }
        };
        if (0..4).all(|i| !quad[..i].contains(&quad[i])) {
            return quad;
        }
    }
}

fn quads() -> Vec<[Site; 4]> {
    let mut random = Random(5);
    (0..QUADS).map(|number| quad(number, &mut random)).collect()
}

fn decided_by_the_cpu(quads: &[[Site; 4]]) -> Vec<u32> {
    let decision =
        |&[a, b, c, d]: &[Site; 4]| (orient2d(a, b, c).signum() + 1) as u32 | (in_circle(a, b, c, d) as u32) << 2;
    quads.iter().map(decision).collect()
}

#[test]
fn a_million_decisions_are_those_of_the_cpu() {
    let Some(mut rig) = Rig::new() else { return };
    let quads = quads();
    let expected = decided_by_the_cpu(&quads);
    assert!(decide(&quads) == expected, "the twin differs");

    let mut recording = Recording::default();
    recording.decide(&quads);
    rig.run(&recording);
    let decisions = rig.numbers(BufferId::Decisions, QUADS as u64);
    let differing: Vec<_> = (0..QUADS).filter(|&i| decisions[i] != expected[i]).collect();
    let shown: Vec<_> = differing.iter().take(5).map(|&i| (quads[i], decisions[i], expected[i])).collect();
    assert!(differing.is_empty(), "{} differ, for example {shown:?}", differing.len());
}

#[test]
fn many_of_the_decisions_are_ties_in_both_tiers() {
    let quads = quads();
    let farthest = |[a, b, c, d]: [Site; 4]| {
        let each = [a, b, c].into_iter().flat_map(|p| [p[0].abs_diff(d[0]), p[1].abs_diff(d[1])]);
        each.max().expect("six differences")
    };
    let is_on_a_line = |&&[a, b, c, _]: &&[Site; 4]| orient2d(a, b, c) == 0;
    let (lines, proper): (Vec<&[Site; 4]>, Vec<&[Site; 4]>) = quads.iter().partition(is_on_a_line);
    let on_circles: Vec<_> =
        proper.into_iter().filter(|&&[a, b, c, d]| in_circle_determinant(a, b, c, d) == 0).collect();
    let near = on_circles.iter().filter(|quad| farthest(***quad) < 32_768).count();
    let far = on_circles.iter().filter(|quad| farthest(***quad) >= 1 << 28).count();
    eprintln!("{} on circles ({near} near, {far} very far), {} on lines", on_circles.len(), lines.len());
    assert!(near > 50_000 && far > 20_000 && lines.len() > 50_000, "{near} {far} {}", lines.len());
    assert_eq!(quads.iter().map(|&quad| farthest(quad)).max(), Some(1 << 30));
}

/// Each line of the shader that a rare carry, a tie or a tier depends on is spoilt in turn: the quads show it.
#[test]
fn the_quads_find_every_error_in_the_limbs() {
    let Some(mut rig) = Rig::new() else { return };
    let quads = quads();
    let expected = decided_by_the_cpu(&quads);
    for (right, wrong) in [
        ("NEAR = 32768", "NEAR = 32769"),
        ("+ (middle >> 16u)", "+ (middle >> 17u)"),
        ("+ (hl & 0xffffu)", "+ (hl & 0x7fffu)"),
        ("a.y + b.y + u32(low < a.x)", "a.y + b.y"),
        ("~a.y + u32(a.x == 0u)", "~a.y"),
        ("carry_x = u32(x < a.x)", "carry_x = 0u"),
        ("u32(y < a.y) + ", ""),
        (" + u32(y_carried < carry_x)", ""),
        ("u32(z < a.z) + ", ""),
        ("a.w + b.w + carry_z", "a.w + b.w"),
        ("a.x == b.x && a.y < b.y", "false"),
        ("orientation(a, b, d) > 0", "orientation(a, b, d) < 0"),
        ("orientation(a, d, c) > 0", "orientation(a, d, c) < 0"),
        ("orientation(d, b, c) > 0", "orientation(d, b, c) < 0"),
    ] {
        let mut recording = Recording::default();
        recording.decide(&quads);
        for command in &mut recording.commands {
            if let GpuCommand::Run(program, ..) = command {
                assert_eq!(program.source.matches(right).count(), 1, "{right}");
                program.source = program.source.replace(right, wrong).leak();
            }
        }
        rig.run(&recording);
        let decisions = rig.numbers(BufferId::Decisions, QUADS as u64);
        let differing = decisions.iter().zip(&expected).filter(|(a, b)| a != b).count();
        eprintln!("{right}: {differing}");
        assert!(differing > 0, "{right}");
    }
}
