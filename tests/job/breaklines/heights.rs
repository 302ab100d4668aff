//! Heights of lines in another unit than those of the points, counted from another zero, or missing: they are converted, refused or named.

use std::fs;
use std::path::Path;

use super::files::{Features, UTM_33, geojson, shapefile};
use super::terrain::{Mesh, Survey};
use crate::program::Job;

/// The length of a foot in metres.
const FOOT: f64 = 0.3048;

/// A line on the slope of the survey, with another height at each vertex.
fn on_slope(change: impl Fn(usize, f64) -> f64) -> Vec<[f64; 3]> {
    let height = |x: f64, y: f64| 15.15 - x / 20.0 + y / 40.0;
    (0..8)
        .map(|i| [10.0 + 18.0 * i as f64, 30.0])
        .enumerate()
        .map(|(i, [x, y])| [x, y, change(i, height(x, y))])
        .collect()
}

/// Returns what a job with this line says.
fn said(survey: &Survey, line: Vec<[f64; 3]>, rest: &str) -> String {
    let file = geojson(survey.folder(), "line.geojson", &Features::lines(&[("line", line)]));
    survey.job_with(&[file], rest).run_with(&["check"]).succeeded().out
}

fn highest(job: &Job) -> i64 {
    Mesh::listed(job).iter().flatten().map(|end| end[2]).max().unwrap()
}

/// The plane is that of the points, and only heights have another unit.
#[test]
fn heights_in_feet_are_converted_though_the_plane_is_the_same() {
    let survey = Survey::new(2_000);
    let in_feet = || Features::lines(&[("line", on_slope(|_, z| z / FOOT))]);
    let shp = shapefile(survey.folder(), "feet", &in_feet());
    let heights = r#"["EGM2008_Geoid",VDATUM["EGM2008_Geoid"],PARAMETER["Vertical_Shift",0.0],PARAMETER["Direction",1.0],UNIT["Foot",0.3048]]"#;
    for text in [
        format!("{UTM_33},VERTCS{heights}"),
        format!(
            r#"COMPD_CS["both",{UTM_33},VERT_CS["EGM2008 height",VERT_DATUM["EGM2008 geoid",2005],UNIT["foot",0.3048]]]"#
        ),
    ] {
        fs::write(shp.with_extension("prj"), text).unwrap();
        let job = survey.job_with(&[&shp], "");
        let said = job.run().succeeded();
        assert!(said.out.contains("its heights are converted from foot to metre"), "{}", said.out);
        assert!((1_400..1_600).contains(&highest(&job)), "{}", highest(&job));
    }
    // Points in feet, and lines in metres.
    fs::write(
        shp.with_extension("prj"),
        format!("{UTM_33},VERTCS{}", heights.replace(r#""Foot",0.3048"#, r#""Meter",1.0"#)),
    )
    .unwrap();
    let job = survey.job_with(&[&shp], "").with("input", "crs = \"EPSG:32633+3855\"");
    assert!(!job.run_with(&["check"]).out.contains("converted"));
    let text = survey.job_with(&[&shp], "height_unit = \"foot\"").run_with(&["check"]).out;
    assert!(text.contains("converted from foot to metre"), "{text}");
}

#[test]
fn heights_that_seem_to_be_in_feet_are_named_with_the_option_that_converts_them() {
    let survey = Survey::new(2_000);
    let feet = || on_slope(|_, z| z / FOOT);
    let text = said(&survey, feet(), "");
    assert!(text.contains("line.geojson: its heights seem to be in feet, and those of the points in metres"), "{text}");
    let text = said(&survey, feet(), "height_unit = \"foot\"");
    assert!(!text.contains("seem") && text.contains("its heights are converted from foot to metre"), "{text}");
    let text = said(&survey, on_slope(|_, z| z * FOOT), "");
    assert!(text.contains("seem to be in metres") && text.contains("[input] unit or crs"), "{text}");
    let text = said(&survey, on_slope(|_, z| z + 45.0), "");
    assert!(text.contains("its heights lie above the terrain") && text.contains("ellipsoid"), "{text}");
    for metres in [-4.0, -0.5, 0.0, 0.5, 4.0] {
        let text = said(&survey, on_slope(|_, z| z + metres), "");
        assert!(!text.contains("height"), "{metres}: {text}");
    }
}

#[test]
fn heights_that_stand_for_none_are_refused_or_named() {
    let survey = Survey::new(2_000);
    let one = |wrong: f64| on_slope(move |i, z| if i == 3 { wrong } else { z });
    let run = |line: Vec<[f64; 3]>| {
        let file = shapefile(survey.folder(), "one", &Features::lines(&[("line", on_slope(|_, z| z)), ("line", line)]));
        survey.job_with(&[file], "").run_with(&["check"])
    };
    for wrong in [-9999.0, -32_768.0] {
        run(one(wrong))
            .refused(3, &["one.shp: feature 2 has the height", "at (500064, 4000030)", "stands for no height"]);
    }
    for wrong in [f64::NAN, -3.4e38, -1e39] {
        run(one(wrong))
            .refused(3, &["one.shp: feature 2 has a vertex without a height, its number 4, at (500064, 4000030)"]);
    }
    for (wrong, word) in [(0.0, "if 0 stands for no height"), (-99.0, "correct it"), (127.0, "correct it")] {
        let text = run(one(wrong)).succeeded().out;
        let named =
            format!("one.shp: feature 2 has the height {wrong} at (500064, 4000030), where the points around lie from");
        assert!(text.contains(&named) && text.contains(word) && text.contains("heights = \"points\""), "{text}");
    }
    // All of a line is far from the terrain.
    for wrong in [9000.0, -999.9, 60.0] {
        let right = || ("line", on_slope(|_, z| z));
        let lines = [right(), ("line", on_slope(|_, z| z + wrong)), right()];
        let file = shapefile(survey.folder(), "among", &Features::lines(&lines));
        let text = survey.job_with(&[file], "").run_with(&["check"]).succeeded().out;
        assert!(
            text.contains("among.shp: feature 2 has the height") && text.contains("set [[breaklines]] height_unit"),
            "{wrong}: {text}"
        );
    }
    let text = run(on_slope(|_, _| 0.0)).succeeded().out;
    assert!(text.contains("feature 2 has the height 0 at"), "{text}");
    let text = said(&survey, on_slope(|_, _| 0.0), "");
    assert!(text.contains("all its heights are 0, but the median of the points around is"), "{text}");
}

/// Returns what a job says about these lines, the second of which is between two that are right.
fn said_among(survey: &Survey, line: Vec<[f64; 3]>, rest: &str) -> String {
    let right =
        |y: f64| ("line", on_slope(|_, z| z).into_iter().map(|[x, _, z]| [x, 30.0 + y, z + y / 40.0]).collect());
    let lines = [right(-9.0), ("line", line), right(9.0), right(18.0), right(27.0)];
    let file = geojson(survey.folder(), "among.geojson", &Features::lines(&lines));
    survey.job_with(&[file], rest).run_with(&["check"]).succeeded().out
}

#[test]
fn a_feature_in_another_unit_is_named_among_others() {
    let survey = Survey::new(2_000);
    let text = said_among(&survey, on_slope(|_, z| z / FOOT), "");
    assert!(
        text.contains("among.geojson: the heights of feature 2 seem to be in feet, and those of the points in metres")
            && text.contains("[[breaklines]] height_unit = \"foot\""),
        "{text}"
    );
    let text = said_among(&survey, on_slope(|_, z| z * FOOT), "");
    assert!(text.contains("the heights of feature 2 are 3.28 times too low"), "{text}");
    // A bridge, a river bed, and a road on a dam.
    for other in [7.0, -6.0, 3.0, 18.0] {
        let text = said_among(&survey, on_slope(|_, z| z + other), "");
        assert!(!text.contains("height"), "{other}: {text}");
    }
}

/// Roofs that stand over low ground are 3.28 times as high as this by chance.
#[test]
fn roofs_over_low_ground_are_not_doubtful() {
    let survey = Survey::new(100);
    let cloud = survey.folder().join("low.csv");
    let rows = (0..60).flat_map(|x| {
        (0..60).map(move |y| {
            format!("{},{},{}\n", 500_000 + 2 * x, 4_000_000 + 2 * y, 5.0 + f64::from((x * 7 + y) % 9) * 0.02)
        })
    });
    fs::write(&cloud, format!("x,y,z\n{}", rows.collect::<String>())).unwrap();
    let roof = |i: usize| {
        let (x, y, z) = (10.0 + 20.0 * (i % 5) as f64, 10.0 + 20.0 * (i / 5) as f64, 8.0 + (i * 7 % 20) as f64);
        ("line", [[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]].map(|[dx, dy]| [x + dx, y + dy, z]).to_vec())
    };
    let roofs: Vec<_> = (0..25).map(roof).collect();
    let file = geojson(survey.folder(), "roofs.geojson", &Features::lines(&roofs));
    let job = Job::on::<&Path>(&[&cloud]).with("input", "crs = \"EPSG:32633\"");
    let text = job.with("[breaklines]", &format!("files = [{file:?}]")).run_with(&["check"]).succeeded().out;
    assert!(!text.contains("seem to be") && !text.contains("heights of feature"), "{text}");
}

/// Most vertices of the roof lie over low points, and a few beside points of the roof itself.
#[test]
fn a_roof_whose_height_some_points_share_is_in_no_other_unit() {
    let roof = |high: bool| {
        let roof = [[20.0, 20.0], [60.0, 20.0], [60.0, 60.0], [20.0, 60.0]].map(|[x, y]| [x, y, 13.1]).to_vec();
        let ground = |i: u32| ("line", vec![[90.0, 9.0 * f64::from(i), 4.0], [140.0, 9.0 * f64::from(i), 4.0]]);
        let lines: Vec<_> = std::iter::once(("line", roof)).chain((1..9).map(ground)).collect();
        let is_roof = move |x: f64, y: f64| high && (58.0..66.0).contains(&x) && (58.0..66.0).contains(&y);
        said_on(&Features::lines(&lines), "", move |x, y, _| if is_roof(x, y) { 13.1 } else { 4.0 })
    };
    let text = roof(false);
    assert!(text.contains("the heights of feature 1 seem to be in feet"), "{text}");
    let text = roof(true);
    assert!(!text.contains("height"), "{text}");
}

/// A waterline at a quay or a dyke may lie at 0.
#[test]
fn a_line_at_0_under_low_even_ground_is_named_among_lines_on_the_ground() {
    let said = |ground: fn(f64) -> f64, others: f64| {
        let at = |i: u32, y: f64| 11.0 + 9.0 * f64::from(i) + y / 50.0;
        let line = |number: u32| {
            let y = 7.0 + 15.0 * f64::from(number);
            let z = |x: f64| if number == 4 { 0.0 } else { ground(x) + others };
            ("line", (0..15).map(|i| [at(i, y), y, z(at(i, y))]).collect())
        };
        said_on(&Features::lines(&(0..9).map(line).collect::<Vec<_>>()), "", |x, _, _| ground(x))
    };
    let text = said(|x| 7.0 + x / 500.0, 0.0);
    assert!(text.contains("feature 5 has the height 0 at (500012, 4000067)"), "{text}");
    for (ground, others) in
        [((|x| 7.0 + x / 500.0) as fn(f64) -> f64, 3.0), (|x| 2.6 + x / 500.0, 0.0), (|x| 7.0 + x / 2.0 % 2.0, 0.0)]
    {
        let text = said(ground, others);
        assert!(!text.contains("height"), "{text}");
    }
}

/// The remedy that was taken is not offered again.
#[test]
fn a_wrong_unit_of_heights_is_named() {
    let survey = Survey::new(2_000);
    let text = said(&survey, on_slope(|_, z| z), "height_unit = \"foot\"");
    assert!(
        text.contains("its heights seem to be in metres, but they are converted from feet")
            && text.contains("[[breaklines]] height_unit = \"metre\" instead"),
        "{text}"
    );
    let feet = said(&survey, on_slope(|_, z| z / FOOT), "height_unit = \"metre\"");
    assert!(feet.contains("[[breaklines]] height_unit = \"foot\""), "{feet}");
}

#[test]
fn missing_heights_are_named_in_other_units_and_beside_the_points() {
    let survey = Survey::new(2_000);
    let one = |wrong: f64| on_slope(move |i, z| if i == 3 { wrong } else { z / FOOT });
    let file = geojson(survey.folder(), "feet.geojson", &Features::lines(&[("line", one(-9999.0))]));
    survey
        .job_with(&[file], "height_unit = \"foot\"")
        .run_with(&["check"])
        .refused(3, &["feet.geojson: feature 1 has the height -9999 at", "stands for no height"]);
    // The first vertex lies west of the points.
    let outside = |wrong: f64| [vec![[-8.0, 30.0, wrong]], on_slope(|_, z| z)].concat();
    for (wrong, is_named) in [(0.0, true), (14.0, false), (9.0, false)] {
        let text = said(&survey, outside(wrong), "");
        let named = text.contains("feature 1 has the height 0 at (499992, 4000030), where the points around lie from");
        assert!(named == is_named && text.contains("height") == is_named, "{wrong}: {text}");
    }
}

/// At the sea, 0 is a height.
#[test]
fn the_shore_of_the_sea_and_rivers_that_flow_into_it_are_not_doubtful() {
    let survey = Survey::new(100);
    let cloud = survey.folder().join("coast.csv");
    let height = |x: u32| f64::from(x) * 0.15 + 0.2;
    let rows = (0..60)
        .flat_map(|x| (0..60).map(move |y| format!("{},{},{}\n", 500_000 + 2 * x, 4_000_000 + 2 * y, height(2 * x))));
    fs::write(&cloud, format!("x,y,z\n{}", rows.collect::<String>())).unwrap();
    let said = |lines: &Features| {
        let file = geojson(survey.folder(), "sea.geojson", lines);
        let job = Job::on::<&Path>(&[&cloud]).with("input", "crs = \"EPSG:32633\"");
        job.with("[breaklines]", &format!("files = [{file:?}]")).run_with(&["check"]).succeeded().out
    };
    let shore: Vec<[f64; 3]> = (0..12).map(|i| [1.0, 10.0 * f64::from(i), 0.0]).collect();
    let river: Vec<[f64; 3]> = (0..11).map(|i| [110.0 - 10.0 * f64::from(i), 61.0, height(110 - 10 * i)]).collect();
    let river = [river, vec![[0.0, 61.0, 0.0]]].concat();
    for lines in [Features::lines(&[("line", shore.clone())]), Features::lines(&[("line", shore), ("river", river)])] {
        let text = said(&lines);
        assert!(!text.contains("height"), "{text}");
    }
}

/// Returns what a job says about these features on points at these heights, which may differ from point to point.
fn said_on(features: &Features, rest: &str, height: impl Fn(f64, f64, u32) -> f64) -> String {
    let survey = Survey::new(1);
    let cloud = survey.folder().join("grid.csv");
    let row = |i: u32| {
        let [x, y] = [i % 80, i / 80].map(|at| f64::from(at) * 2.0);
        format!("{},{},{:.2}\n", 500_000.0 + x, 4_000_000.0 + y, height(x, y, i))
    };
    fs::write(&cloud, format!("x,y,z\n{}", (0..6400).map(row).collect::<String>())).unwrap();
    let file = geojson(survey.folder(), "lines.geojson", features);
    let job = Job::on::<&Path>(&[&cloud]).with("input", "crs = \"EPSG:32633\"");
    job.with("[breaklines]", &format!("files = [{file:?}]\n{rest}")).run_with(&["check"]).succeeded().out
}

/// Returns lines across the grid.
fn across(height: impl Fn(f64, f64) -> f64) -> Features {
    let vertex = |i: u32, y: f64| [11.0 + 9.0 * f64::from(i), y, height(11.0 + 9.0 * f64::from(i), y)];
    let line = |y: u32| ("line", (0..15).map(|i| vertex(i, 7.0 + 15.0 * f64::from(y))).collect());
    Features::lines(&(0..9).map(line).collect::<Vec<_>>())
}

fn low_land(x: f64, y: f64) -> f64 {
    1.6 + 0.5 * (x / 25.0).sin() * (y / 30.0).sin()
}

/// They are nearer to the terrain than roofs and bridges.
#[test]
fn another_unit_on_low_land_and_under_trees_is_named() {
    let seems = "lines.geojson: its heights seem to be in feet, and those of the points in metres";
    let low =
        |factor: f64, more: f64| said_on(&across(|x, y| low_land(x, y) * factor + more), "", |x, y, _| low_land(x, y));
    let text = low(1.0 / FOOT, 0.0);
    assert!(text.contains(seems), "{text}");
    for more in [0.0, 3.7, -2.0] {
        let text = low(1.0, more);
        assert!(!text.contains("height"), "{more}: {text}");
    }
    let trees =
        |x: f64, y: f64, i: u32| 5.0 + x / 20.0 + y / 50.0 + f64::from((i * 7919 % 100).saturating_sub(30)) * 0.4;
    let in_forest = |factor: f64| said_on(&across(|x, y| (5.0 + x / 20.0 + y / 50.0) * factor), "", trees);
    let text = in_forest(1.0 / FOOT);
    assert!(text.contains(seems), "{text}");
    let text = in_forest(1.0);
    assert!(!text.contains("height"), "{text}");
    // Two neighbours without a height.
    let ground = |x: f64, y: f64| if (60.0..80.0).contains(&x) && y < 10.0 { 0.0 } else { 12.0 + x / 20.0 };
    let text = said_on(&across(ground), "", |x, _, i| 7.0 + trees(x, 0.0, i));
    assert!(text.contains("feature 1 has the height 0 at (500065, 4000007)"), "{text}");
}

#[test]
fn a_constant_factor_is_named() {
    let survey = Survey::new(2_000);
    for (factor, words) in [
        (1e3, "its heights seem to be in millimetres"),
        (100.0, "its heights seem to be in centimetres"),
        (10.0, "its heights seem to be in decimetres"),
        (1.0 / 0.0254, "its heights seem to be in inches"),
        (FOOT.powi(-2), "its heights are 10.76 times too high, as if they had been converted"),
    ] {
        let text = said(&survey, on_slope(|_, z| z * factor), "");
        assert!(text.contains(words) && !text.contains("another datum"), "{factor}: {text}");
    }
}

/// On a dam, points are as high as the water.
#[test]
fn a_lake_above_all_of_its_shore_is_named() {
    let lake = |z: f64| {
        let shore = (0..24).map(|i| f64::from(i) * std::f64::consts::TAU / 24.0);
        Features::areas(&[("lake", vec![shore.map(|t| [80.0 + 30.0 * t.cos(), 80.0 + 30.0 * t.sin(), z]).collect()])])
    };
    let dam = |x: f64, y: f64| (6.6 - ((x - 80.0).hypot(y - 80.0) - 33.0).abs() / 2.0).max(2.0);
    let plain = |z: f64, rest: &str| said_on(&lake(z), rest, |x, _, _| 2.0 + x / 500.0);
    let text = plain(6.5, "kind = \"lake\"");
    assert!(text.contains("lines.geojson: feature 1 has the height 6.5 at (500110, 4000080)"), "{text}");
    for text in
        [plain(2.9, "kind = \"lake\""), plain(6.5, ""), said_on(&lake(6.5), "kind = \"lake\"", |x, y, _| dam(x, y))]
    {
        assert!(!text.contains("height"), "{text}");
    }
}
