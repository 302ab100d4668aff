//! Heights that no terrain joins to the others, such as spikes and nodata that does not repeat: a warning names them, and `[input] heights`
//! leaves them out.

use std::fs;
use std::path::PathBuf;

use crate::las_file::LasFile;
use crate::program::{Job, gdt_batch, number};

const POINTS: usize = 1500;

/// The folder of made files.
struct Files(tempfile::TempDir);

impl Files {
    fn new() -> Files {
        Files(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, content).unwrap();
        path
    }

    /// Writes a grid whose heights are so many centimetres, as text, LAS or LAZ. The first column of the grid is column `from`.
    fn grid(&self, name: &str, from: usize, heights: &[i32]) -> PathBuf {
        let places = heights.iter().enumerate().map(|(i, z)| [200 * (from + i % 50) as i32, 200 * (i / 50) as i32, *z]);
        if name.ends_with("xyz") {
            let hundredths = |raw: i32| format!("{:.2}", f64::from(raw) / 100.0);
            let row =
                |[x, y, z]: [i32; 3]| format!("{} {} {}\n", 500_000 + x / 100, 4_000_000 + y / 100, hundredths(z));
            return self.write(name, places.map(row).collect::<String>());
        }
        self.las(name, &places.collect::<Vec<_>>(), heights)
    }

    /// Writes points in raw integers, with a header that claims the heights `claimed`.
    fn las(&self, name: &str, places: &[[i32; 3]], claimed: &[i32]) -> PathBuf {
        let record = |place: &[i32; 3]| {
            let mut record: Vec<u8> = place.iter().flat_map(|raw| raw.to_le_bytes()).collect();
            record.extend([0, 0, 0b1001, 2, 0, 0, 0, 0]);
            record
        };
        let records = places.iter().flat_map(record).collect();
        let file = LasFile { minor: 2, format: 0, extra: 0, stray: 0, records };
        let mut bytes = if name.ends_with("laz") { file.laz(&[500; 3], false) } else { file.las() };
        let ends = |axis: usize| {
            let values = || places.iter().map(|place| place[axis]);
            [values().max().unwrap(), values().min().unwrap()]
        };
        let heights = [*claimed.iter().max().unwrap(), *claimed.iter().min().unwrap()];
        let zero = [500_000.0, 4_000_000.0, 0.0];
        let claims = [ends(0), ends(1), heights].into_iter().zip(zero);
        let claims = claims.flat_map(|(ends, zero)| ends.map(|raw| (zero + f64::from(raw) / 100.0).to_le_bytes()));
        bytes[179..227].copy_from_slice(&claims.collect::<Vec<_>>().concat());
        self.write(name, bytes)
    }
}

/// Hills between 840 and 960 m, in centimetres; every so many points have the height that `other` gives for them.
fn hills(every: usize, other: impl Fn(usize) -> i32) -> Vec<i32> {
    let height = |i: usize| 84_000 + (7 * (i % 50) * (i / 50) % 12_001) as i32;
    (0..POINTS).map(|i| if i % every == 3 % every { other(i) } else { height(i) }).collect()
}

/// Asserts that a job and `check` warn in these words about these files.
#[track_caller]
fn warns(files: &[&PathBuf], words: &[&str]) {
    let warnings = Job::on(files).report()["warnings"].to_string();
    let check = Job::on(files).run_with(&["check"]).succeeded();
    for text in [warnings, check.out + &check.err] {
        for word in words {
            assert!(text.contains(word), "{word}: {text}");
        }
    }
}

#[track_caller]
fn is_silent(files: &[&PathBuf]) {
    let warnings = Job::on(files).report()["warnings"].to_string();
    assert!(!warnings.contains("[input] heights"), "{warnings}");
}

/// Returns the height of point number i in hundredths.
type HeightAt<'a> = &'a dyn Fn(usize) -> i32;

#[test]
fn nodata_that_does_not_repeat_is_told_and_heights_leave_it_out() {
    let files = Files::new();
    // -9999 after a change of the geoid.
    let grid = hills(25, |i| -995_390 + (i % 31) as i32);
    let kept = "heights = [839.99, 960]";
    let mut meshes = Vec::new();
    for name in ["a.xyz", "a.las", "a.laz"] {
        let path = files.grid(name, 0, &grid);
        let first = if name == "a.xyz" { "(the first is line 4)" } else { "(the first is point 3)" };
        warns(&[&path], &[name, "60 points have heights from -9953.9 to -9953.", first, "[input] heights = ["]);
        let job = Job::on(&[&path]).with("input", kept);
        let report = job.report();
        let points = &report["points"];
        let counts = ["kept", "out_of_bounds", "nodata"].map(|name| number(&points[name]));
        assert_eq!(counts, [POINTS as u64 - 60, 60, 0], "{points}");
        assert!(!report["warnings"].to_string().contains("heights"), "{report}");
        let verdict = gdt_batch(job.folder(), &["verify", "out", "--json", "--input", path.to_str().unwrap()]);
        assert_eq!(verdict.succeeded().json()["failures"], serde_json::json!([]));
        let digest = |job: Job| job.with("input", kept).digest();
        let whole = digest(Job::on(&[&path]).tiles_of(200));
        assert_eq!(digest(Job::on(&[&path]).tiles_of(700).threads(1)), whole);
        meshes.push(whole);
        Job::on(&[&path]).with("input", "heights = [2000, 3000]").run().refused(3, &["no height lies between"]);
    }
    assert!(meshes.windows(2).all(|pair| pair[0] == pair[1]), "{meshes:?}");
}

#[test]
fn a_change_of_heights_starts_over_and_wrong_ones_are_refused() {
    let files = Files::new();
    let path = files.grid("a.xyz", 0, &hills(25, |_| -995_390));
    Job::on(&[&path]).with("input", "heights = [960, 840]").run().refused(2, &["[lowest, highest]"]);
    Job::on(&[&path]).with("input", "heights = [960]").run().refused(2, &["[lowest, highest]"]);
}

#[test]
fn spikes_pits_and_ramps_are_told() {
    let files = Files::new();
    let cases: [(usize, HeightAt, &str); 6] = [
        (POINTS, &|_| 10_000_000, " has the height 100000"),
        (POINTS, &|_| -1_200_000, " has the height -12000"),
        (750, &|_| 0, "2 points have the height 0"),
        (20, &|i| (i % 7) as i32 - 3, "75 points have heights from -0.03 to 0.03"),
        // A resampled edge of nodata.
        (30, &|i| -999_900 + 720 * i as i32, "50 points have heights from -9977.4"),
        (2, &|i| -995_390 + (i % 31) as i32, "750 points have heights from -9953.9"),
    ];
    for (every, other, words) in cases {
        for name in ["a.xyz", "a.las"] {
            let path = files.grid(name, 0, &hills(every, other));
            warns(&[&path], &[name, words, "far from all others, which lie between 84"]);
        }
    }
}

#[test]
fn terrain_and_towers_are_heights() {
    let files = Files::new();
    let at = |i: usize| [(i % 50) as i32, (i / 50) as i32];
    let cases: [&dyn Fn(usize) -> i32; 7] = [
        // A cliff of 180 m at the sea, and a fjord.
        &|i| if at(i)[0] < 20 { (i % 9) as i32 } else { 18_000 + 50 * at(i)[1] },
        &|i| (at(i)[0] - 10).max(0) * 2300,
        // A quarry of 130 m, and a mast of 330 m.
        &|i| if at(i)[0] > 40 { 2000 + (i % 9) as i32 } else { 15_000 + 10 * at(i)[1] },
        &|i| if i == 700 { 34_000 } else { 1000 + 10 * at(i)[1] },
        // The bottom of a sea, an island in it, and heights in millimetres.
        &|i| -400_000 + at(i)[0] * at(i)[0] * 150,
        &|i| (at(i)[0] - 47).max(0) * 30_000,
        &|i| 1_200_000 + 9000 * at(i)[0],
    ];
    for case in cases {
        let path = files.grid("a.las", 0, &(0..POINTS).map(case).collect::<Vec<_>>());
        is_silent(&[&path]);
    }
    // Surveys far apart at different heights, and a sea beside a coast.
    let [low, high] =
        [files.grid("low.las", 0, &[3000; 600]), files.grid("high.las", 50_000, &hills(POINTS, |_| 90_000))];
    is_silent(&[&low, &high]);
    let coast: Vec<i32> = (0..POINTS).map(|i| at(i)[0] * 1000).collect();
    is_silent(&[&files.grid("sea.las", 50, &[0; 600]), &files.grid("coast.las", 0, &coast)]);
}

#[test]
fn a_file_of_zeros_beside_mountains_is_told() {
    let files = Files::new();
    let mountains = files.grid("a.las", 0, &hills(POINTS, |_| 90_000));
    for (name, height, words) in
        [("z.las", 0, "the height 0"), ("z.xyz", -995_390, "the height -9953.9"), ("z.laz", 150_000, "the height 1500")]
    {
        let flat = files.grid(name, 50, &[height; 600]);
        warns(&[&flat, &mountains], &[name, words, "far from those of the files around it"]);
    }
}

#[test]
fn what_a_header_hides_is_told_after_reading() {
    let files = Files::new();
    let places: Vec<[i32; 3]> = (0..150_000).map(|i| [10 * (i % 400), 10 * (i / 400), 84_000 + i % 997]).collect();
    let mut spiked = places.clone();
    spiked[149_900][2] = 500_000;
    let path = files.las("a.las", &spiked, &[84_000, 84_996]);
    let job = Job::on(&[&path]).with("triangulation", "max_points_per_part = 40000");
    let warnings = job.report()["warnings"].to_string();
    let words = ["a.las: has heights from 840 to 5000", "lie between 84", "[input] heights = [8"];
    assert!(words.iter().all(|word| warnings.contains(word)), "{warnings}");
    let clean = files.las("b.las", &places, &[84_000, 84_996]);
    is_silent(&[&clean]);
}

#[test]
fn files_without_coordinates_are_named() {
    let files = Files::new();
    let good = files.grid("a.las", 0, &hills(POINTS, |_| 90_000));
    let far = [[-50_000_000, -400_000_000, 0]];
    for count in [1, 20] {
        let zeros = files.las("z.las", &far.repeat(count), &[0]);
        let words = ["z.las: ", "(0, 0, 0), so it holds no coordinates", "on_bad_file"];
        Job::on(&[&good, &zeros]).run().refused(3, &words);
        Job::on(&[&good, &zeros]).run_with(&["check"]).refused(3, &words);
        let report = Job::on(&[&good, &zeros]).with("input", "on_bad_file = \"skip\"").report();
        assert_eq!(report["skipped"].as_array().unwrap().len(), 1, "{report}");
        assert_eq!(report["lattice"]["resolution"], "0.01");
    }
}

#[test]
fn check_ends_as_the_job_does_if_a_point_has_no_place_in_the_new_system() {
    let files = Files::new();
    let mut places: Vec<[i32; 3]> = (0..900).map(|i| [100 * (i % 30), 100 * (i / 30), 100 * (i % 7)]).collect();
    places.push([i32::MAX, i32::MIN, 100]);
    let path = files.las("a.las", &places, &[0, 600]);
    // The header knows nothing of the last point.
    let mut bytes = fs::read(&path).unwrap();
    let claims = [500_029.0, 500_000.0, 4_000_029.0, 4_000_000.0, 6.0, 0.0].map(f64::to_le_bytes).concat();
    bytes[179..227].copy_from_slice(&claims);
    let path = files.write("a.las", bytes);
    let job = || Job::on(&[&path]).with("input", "crs = \"EPSG:32631\"\nto_crs = \"EPSG:32632\"");
    let words = ["1 of 901 records are malformed", "point 900", "outside the area of"];
    job().run().refused(3, &words);
    job().run_with(&["check"]).refused(3, &words);
    job().with("input", "max_malformed_fraction = 0.01").run().succeeded();
}

#[test]
fn nodata_in_feet_is_known_in_a_job_in_metres() {
    let files = Files::new();
    let grid: Vec<i32> = hills(25, |_| -999_900);
    let path = files.grid("a.las", 0, &grid);
    let mut bytes = fs::read(&path).unwrap();
    // New York, in feet; the header hides the nodata.
    bytes[155..163].copy_from_slice(&980_000f64.to_le_bytes());
    bytes[163..171].copy_from_slice(&190_000f64.to_le_bytes());
    let claims = [980_098.0, 980_000.0, 190_058.0, 190_000.0, 960.01, 840.0].map(f64::to_le_bytes).concat();
    bytes[179..227].copy_from_slice(&claims);
    let path = files.write("a.las", bytes);
    let job = || Job::on(&[&path]).with("input", "crs = \"EPSG:2263\"\nto_crs = \"EPSG:26918\"");
    job().run().refused(3, &["the height -9999, which stands for nodata", "[input] nodata = -9999"]);
    let report = job().with("input", "nodata = -9999").report();
    assert_eq!(number(&report["points"]["nodata"]), 60, "{report}");
}

#[test]
fn the_heights_of_the_advice_are_those_of_all_files() {
    let files = Files::new();
    let valley = files.grid("valley.las", 0, &hills(750, |_| 600_000));
    let mount: Vec<i32> = hills(POINTS, |_| 90_000).iter().map(|height| height + 100_000).collect();
    let mount = files.grid("mount.xyz", 50, &mount);
    warns(
        &[&valley, &mount],
        &["valley.las: 2 points have the height 6000", "[input] heights = [840, 1940] leaves them out"],
    );
    let beyond = files.grid("beyond.xyz", 100, &[599_000, 600_000, 601_000].repeat(200));
    warns(&[&valley, &beyond], &["valley.las", "remove them from the file ([input] heights holds for all files"]);
    let job = Job::on(&[&valley, &mount]).with("input", "heights = [840, 960]");
    let warnings = job.report()["warnings"].to_string();
    assert!(
        warnings.contains("mount.xyz: no point of a sample lies within [input] heights = [840, 960]"),
        "{warnings}"
    );
    assert!(!warnings.contains("valley.las"), "{warnings}");
}

#[test]
fn a_height_alone_that_no_lattice_holds_is_left_out_by_heights() {
    let files = Files::new();
    let path = files.grid("a.xyz", 0, &hills(POINTS, |_| 90_000));
    let text = fs::read_to_string(&path).unwrap() + "500020 4000020 111399000.00\n";
    let path = files.write("a.xyz", text);
    Job::on(&[&path]).run().refused(3, &["lies far from all other rows", "[input] heights = ["]);
    Job::on(&[&path]).with("input", "heights = [840, 960]").run().succeeded();
}
