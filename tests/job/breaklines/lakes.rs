//! Outlines of lakes that are no outlines of areas: the water is right, or a message names the lake.

use super::files::{Features, geojson, shapefile};
use super::terrain::{Mesh, Survey, inside};
use crate::program::Said;

type Ring = Vec<[f64; 2]>;

const SQUARE: [[f64; 2]; 4] = [[40.0, 40.0], [100.0, 40.0], [100.0, 100.0], [40.0, 100.0]];
const ISLAND: [[f64; 2]; 4] = [[60.0, 60.0], [80.0, 60.0], [80.0, 80.0], [60.0, 80.0]];
const BESIDE: [[f64; 2]; 4] = [[110.0, 40.0], [130.0, 40.0], [130.0, 60.0], [110.0, 60.0]];

fn twice(ring: &[[f64; 2]]) -> Ring {
    [ring, ring].concat()
}

/// Runs a job with these lakes, each of which has its rings. Returns what is said, and how many points are left in the square and in the
/// island.
fn run(survey: &Survey, lakes: &[&[Ring]]) -> (Said, [usize; 2]) {
    let with_height = |ring: &Ring| ring.iter().map(|[x, y]| [*x, *y, 5.0]).collect::<Vec<[f64; 3]>>();
    let area = |rings: &&[Ring]| ("lake", rings.iter().map(with_height).collect::<Vec<_>>());
    let features = Features::areas(&lakes.iter().map(area).collect::<Vec<_>>());
    let job = survey.job_with(&[geojson(survey.folder(), "lakes.geojson", &features)], "kind = \"lake\"");
    let said = job.run();
    if said.code != 0 {
        return (said, [0; 2]);
    }
    job.verified();
    let mesh = Mesh::of(&job);
    let steps = |ring: [[f64; 2]; 4]| ring.map(|place| place.map(|value| (value * 100.0) as i64));
    let (square, island) = (steps(SQUARE), steps(ISLAND));
    let points: Vec<[i64; 3]> = mesh.vertices.iter().filter(|p| !mesh.ends.contains(*p)).copied().collect();
    let within = |ring: &[[i64; 2]]| points.iter().filter(|p| inside(ring, **p)).count();
    let on_island = within(&island);
    (said, [within(&square) - on_island, on_island])
}

#[test]
fn rings_that_go_over_their_way_again_enclose_water() {
    let survey = Survey::new(2_000);
    let (square, island) = (SQUARE.to_vec(), ISLAND.to_vec());
    let spiked: Ring =
        [&square[..2], &[[100.0, 40.0], [130.0, 50.0], [140.0, 60.0], [130.0, 50.0], [100.0, 40.0]], &square[2..]]
            .concat();
    let turned: Ring = island.iter().rev().copied().collect();
    let (said, plain) = run(&survey, &[&[square.clone(), island.clone()]]);
    assert!(said.code == 0 && plain[0] == 0 && plain[1] > 5, "{plain:?}");
    for rings in [
        &[twice(&square), island.clone()][..],
        &[twice(&twice(&square)), twice(&island)],
        &[spiked, island.clone()],
        &[square.clone(), island.clone(), turned],
    ] {
        let (said, left) = run(&survey, &[rings]);
        assert!(said.code == 0 && !said.out.contains("lakes.geojson"), "{}", said.out);
        assert_eq!(left, plain, "{rings:?}");
    }
    // The same lake twice in a file.
    let lake = [square.clone(), island.clone()];
    assert_eq!(run(&survey, &[&lake, &lake]).1, plain);
}

#[test]
fn what_encloses_nothing_or_is_no_area_is_named() {
    let survey = Survey::new(2_000);
    let (square, island) = (SQUARE.to_vec(), ISLAND.to_vec());
    let eight = vec![SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]];
    let beyond = vec![[90.0, 50.0], [120.0, 50.0], [120.0, 70.0], [90.0, 70.0]];
    let flat = vec![[40.0, 40.0], [60.0, 60.0], [80.0, 80.0]];
    let back = vec![SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[1]];
    for (rings, words) in [
        (&[eight][..], "feature 1 is a lake whose outlines cross, so water and land alternate at (500070, 4000070)"),
        (
            &[square.clone(), beyond],
            "feature 1 is a lake whose outlines cross, so water and land alternate at (500100, 40000",
        ),
        (
            &[square.clone(), BESIDE.to_vec()],
            "feature 1 is a lake with a hole outside its outline, which is taken for water at (500110, 4000040)",
        ),
        (
            &[[&square[..], &[[40.0, 40.0], [70.0, 40.0]], &square[1..]].concat()],
            "feature 1 is a lake whose outlines enclose nothing",
        ),
        (&[flat], "feature 1 is an area whose outline encloses nothing"),
        (&[back], "feature 1 is an area whose outline encloses nothing"),
    ] {
        let (said, _) = run(&survey, &[rings]);
        assert!(said.code == 0 && said.out.contains(words), "{}", said.out);
    }
    let mut same = square.clone();
    same.reverse();
    for hole in [square.clone(), same, twice(&square)] {
        let (said, _) = run(&survey, &[std::slice::from_ref(&island), &[square.clone(), hole]]);
        said.refused(3, &["lakes.geojson: feature 2 has a hole that is the same as its outline, at (500040, 4000040)"]);
    }
    let (said, _) = run(&survey, &[&[square], &[island]]);
    assert!(said.out.contains("inside a lake are left out"), "{}", said.out);
}

/// Of two heights at a vertex, the lake would take the lower one without a word.
#[test]
fn heights_of_an_outline_that_is_run_through_twice_are_compared() {
    let survey = Survey::new(500);
    let at = |z: f64| SQUARE.map(|[x, y]| [x, y, z]).to_vec();
    for (again, is_named) in [(5.0, false), (4.5, true)] {
        let features = Features::areas(&[("lake", vec![[at(5.0), at(again)].concat()])]);
        let job = survey.job_with(&[geojson(survey.folder(), "twice.geojson", &features)], "kind = \"lake\"");
        let text = job.run_with(&["check"]).succeeded().out;
        assert_eq!(text.contains("1 lake is not flat; the worst is feature 1 of"), is_named, "{text}");
        assert_eq!(text.contains("which is 0.5 higher"), is_named, "{text}");
    }
}

/// A Shapefile has one list of rings.
#[test]
fn a_ring_beside_the_only_outline_is_named() {
    let survey = Survey::new(500);
    let clockwise = |ring: &[[f64; 2]]| ring.iter().rev().map(|[x, y]| [*x, *y, 5.0]).collect::<Vec<_>>();
    let other = |ring: &[[f64; 2]]| ring.iter().map(|[x, y]| [*x, *y, 5.0]).collect::<Vec<_>>();
    let features = Features::areas(&[("lake", vec![clockwise(&SQUARE), other(&BESIDE)])]);
    let job = survey.job_with(&[shapefile(survey.folder(), "lakes", &features)], "kind = \"lake\"");
    let text = job.run_with(&["check"]).succeeded().out;
    assert!(text.contains("a hole outside its outline"), "{text}");
}
