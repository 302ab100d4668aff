//! Points of LAS and LAZ files that lie far from all others: where they cost the others their precision they are malformed, and where they
//! only stretch the area, a warning names them.

use std::fs;
use std::path::PathBuf;

use crate::las_file::LasFile;
use crate::program::{Job, Said, gdt_batch, number};
use crate::random::Random;

/// The place of 0, 0, 0 in raw integers: the files have an offset.
const ZERO: [i32; 3] = [-50_000_000, -400_000_000, 0];

/// What the header says of the bounds.
#[derive(Clone, Copy)]
enum Header {
    /// Those of all points.
    All,
    /// Those of the points that are not far.
    Near,
    /// Nothing but zeros.
    Zeros,
}

/// Points within 300 m, in centimetres, with some `far` ones in their raw integers at record `at`.
struct Far {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl Far {
    fn new(count: usize, far: &[[i32; 3]], at: usize, header: Header) -> Far {
        Far::of(near(count, 30_000), far, at, header, 1)
    }

    fn of(near: Vec<[i32; 3]>, far: &[[i32; 3]], at: usize, header: Header, class: u8) -> Far {
        let mut places = near.clone();
        places.splice(at..at, far.iter().copied());
        let mut file = LasFile::new(2, 0, 0, 0);
        for (index, place) in places.iter().enumerate() {
            let mut record = [0; 20];
            (0..3).for_each(|axis| record[4 * axis..4 * axis + 4].copy_from_slice(&place[axis].to_le_bytes()));
            record[14] = 0x09;
            record[15] = if (at..at + far.len()).contains(&index) { class } else { 2 };
            file.records.extend(record);
        }
        let mut bytes = file.las();
        let of = match header {
            Header::All => &places,
            Header::Near => &near,
            Header::Zeros => &Vec::new(),
        };
        for axis in 0..3 {
            let ends = [of.iter().map(|place| place[axis]).max(), of.iter().map(|place| place[axis]).min()];
            for (end, raw) in ends.iter().enumerate().filter_map(|(end, raw)| Some((end, (*raw)?))) {
                let value = [500_000.0, 4_000_000.0, 0.0][axis] + f64::from(raw) / 100.0;
                let at = 179 + 16 * axis + 8 * end;
                bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.las");
        fs::write(&path, bytes).unwrap();
        Far { _folder: folder, path }
    }

    fn job(&self) -> Job {
        Job::on(&[&self.path])
    }

    /// Returns the job that leaves the far points out.
    fn without(&self) -> Job {
        self.job().with("input", "max_malformed_fraction = 0.01")
    }

    fn verify(&self, job: &Job) -> Said {
        gdt_batch(job.folder(), &["verify", "out", "--input", self.path.to_str().unwrap()])
    }
}

/// Returns a job that leaves out a point far from all others, and does without what is found of nodata and of areas of use.
pub(crate) fn with_a_far_point() -> (impl Drop, Job) {
    let cloud = Far::new(500, &[ZERO], 200, Header::All);
    let job =
        cloud.without().with("input", "nodata = -9999.0\nheights = [-1000.0, 1000.0]\noutside_crs_area = \"warn\"");
    (cloud._folder, job)
}

fn near(count: usize, size: u64) -> Vec<[i32; 3]> {
    let mut random = Random(3);
    (0..count).map(|_| [random.below(size) as i32, random.below(size) as i32, random.below(4000) as i32]).collect()
}

#[test]
fn zero_records_are_malformed_as_they_are_in_texts() {
    let clean = Far::new(500, &[], 0, Header::All).job().digest();
    for header in [Header::All, Header::Zeros, Header::Near] {
        let cloud = Far::new(500, &[ZERO; 3], 200, header);
        let words = [
            "3 of 503 records are malformed",
            "point 200: (0, 0, 0) lies far from all other points",
            "[input] bounds = [500000, 4000000, 500301, 4000300] or max_malformed_fraction",
        ];
        cloud.job().run().refused(3, &words);
        cloud.job().run_with(&["check"]).refused(3, &words);
        let job = cloud.without();
        let report = job.report();
        assert_eq!((number(&report["points"]["malformed"]), &report["lattice"]["resolution"]), (3, &"0.01".into()));
        assert_eq!(job.verified()["digest"], clean.as_str());
        cloud.verify(&job).succeeded();
    }
}

#[test]
fn one_height_or_one_x_of_a_mistake_is_enough() {
    for (far, place, bounds) in [
        ([100, 100, 2_100_000_000], "(500001, 4000001, 21000000)", false),
        ([100, 100, -40_000_000], "(500001, 4000001, -400000)", false),
        ([i32::MAX / 50, 100, 100], "(929496.72, 4000001, 1)", true),
    ] {
        let said = Far::new(500, &[far], 7, Header::All).job().run();
        said.refused(3, &["1 of 501 records", &format!("point 7: {place} lies far from all other points")]);
        assert_eq!(said.err.contains("[input] bounds = ["), bounds, "{}", said.err);
    }
}

#[test]
fn what_only_reading_shows_ends_the_job_or_is_left_out() {
    // The sample of the plan sees the beginnings of chunks, and the far point is at the end of the last.
    let (count, at) = (150_000, 149_000);
    let far = [30_000_000, 100, 100];
    let cloud = Far::new(count, &[far], at, Header::Near);
    let part = |job: Job| job.with("triangulation", "max_points_per_part = 40000");
    part(cloud.job()).run().refused(3, &["1 of 150001 records", "point 149000: (800000, 4000001, 1) lies far from"]);
    let job = part(cloud.without());
    let report = job.report();
    assert_eq!((number(&report["points"]["malformed"]), &report["lattice"]["resolution"]), (1, &"0.01".into()));
    assert!(number(&report["parts"]) > 1, "{report}");
    cloud.verify(&job).succeeded();
}

#[test]
fn points_that_the_job_leaves_out_have_no_say() {
    let clean = Far::new(500, &[], 0, Header::All).job().digest();
    let noise = Far::of(near(500, 30_000), &[[100, 100, i32::MAX], ZERO], 50, Header::All, 7);
    assert_eq!(noise.job().digest(), clean);
    let bounds = "bounds = [499000.0, 3999000.0, 501000.0, 4001000.0]";
    let beyond = Far::new(500, &[[30_000_000, 100, i32::MAX], ZERO], 50, Header::All);
    assert_eq!(beyond.job().with("input", bounds).digest(), clean);
}

#[test]
fn two_surveys_far_apart_are_no_mistakes() {
    let mut places = near(300, 30_000);
    places.extend(near(300, 30_000).iter().map(|[x, y, z]| [x + 30_000_000, *y, *z]));
    let cloud = Far::of(places, &[], 0, Header::All, 2);
    cloud.job().run_with(&["check"]).succeeded();
    let report = cloud.job().report();
    assert_eq!((number(&report["points"]["kept"]), number(&report["points"]["malformed"])), (600, 0));
    let warnings = report["warnings"].to_string();
    assert!(warnings.contains("x and y are rounded to") && !warnings.contains("stretch"), "{warnings}");
}

#[test]
fn many_far_points_are_no_mistakes_and_the_bounds_of_the_others_are_told() {
    let mut random = Random(8);
    let far: Vec<[i32; 3]> = (0..60).map(|_| [random.below(1 << 30) as i32, random.below(1 << 29) as i32, 7]).collect();
    let cloud = Far::new(500, &far, 100, Header::All);
    for said in [cloud.job().run_with(&["check"]).succeeded(), cloud.job().run().succeeded()] {
        assert!((said.out + &said.err).contains("60 points (the first is point 100 of "), "{}", said.err);
    }
}

#[test]
fn one_bad_file_of_several_is_left_out() {
    let (good, bad) = (Far::new(500, &[], 0, Header::All), Far::new(400, &[ZERO], 0, Header::All));
    let job = Job::on(&[&good.path, &bad.path]).with("input", "on_bad_file = \"skip\"");
    let report = job.report();
    assert_eq!(report["skipped"].as_array().unwrap().len(), 1, "{report}");
    assert!(
        report["skipped"][0]["why"].as_str().unwrap().contains("point 0: (0, 0, 0) lies far from all other points")
    );
    assert_eq!(report["lattice"]["resolution"], "0.01");
}

#[test]
fn a_few_points_that_stretch_the_area_are_told_with_the_bounds_of_the_others() {
    let far: Vec<[i32; 3]> = (0..4).map(|i| [200_000 + 50_000 * i, 300_000, 100]).collect();
    let (hint, fix) = (" stretch the area to 3500 x 3000", "fix: [input] bounds = [");
    for header in [Header::All, Header::Near, Header::Zeros] {
        let cloud = Far::of(near(6000, 8000), &far, 5000, header, 2);
        let report = cloud.job().report();
        assert_eq!(number(&report["points"]["kept"]), 6004);
        let warnings = report["warnings"].to_string();
        assert!(
            warnings.contains("99.93 % of the points lie within 80 x 80 units")
                && warnings.contains(hint)
                && warnings.contains(fix),
            "{warnings}"
        );
    }
    let cloud = Far::of(near(6000, 8000), &far, 5000, Header::All, 2);
    let said = cloud.job().with("output.raster", "resolution = 0.01").run_with(&["check"]);
    assert!(said.code != 0 && said.err.contains(hint) && said.err.contains(fix), "{}", said.err);
    let bounds = "bounds = [499999.0, 3999999.0, 500081.0, 4000081.0]";
    assert!(!cloud.job().with("input", bounds).report()["warnings"].to_string().contains("stretch"));
}

#[test]
fn a_handful_of_points_stretches_a_sparse_survey_and_a_benchmark_does_not() {
    let warnings = |path: &PathBuf| Job::on(&[path]).report()["warnings"].to_string();
    for (far, is_told) in [(500_000, true), (60_000, false)] {
        let cloud = Far::of(near(300, 8000), &[[far, 100, 100]], 34, Header::All, 2);
        let said = warnings(&cloud.path);
        assert_eq!(said.contains("1 point (the first is point 34 of "), is_told, "{said}");
        // The same as text, below a header and a blank line.
        let mut places = near(300, 8000);
        places.insert(34, [far, 100, 100]);
        let row = |[x, y, z]: &[i32; 3]| format!("{x},{y},{z}\n");
        let path = cloud.path.with_file_name("sparse.csv");
        fs::write(&path, format!("x,y,z\n\n{}", places.iter().map(row).collect::<String>())).unwrap();
        let said = warnings(&path);
        assert_eq!(said.contains("1 point (the first is line 37 of "), is_told, "{said}");
    }
}

#[test]
fn malformed_records_of_other_files_are_named() {
    let clouds = [40, 200, 300].map(|at| Far::new(500, &[ZERO], at, Header::All));
    let job = Job::on(&[&clouds[0].path, &clouds[1].path, &clouds[2].path]);
    let words = ["3 of 1503 records are malformed", "; 2 more in ", "cloud.las and 1 other file"];
    job.run().refused(3, &words);
    job.run_with(&["check"]).refused(3, &words);
}

#[test]
fn strips_and_areas_apart_are_not_stretched() {
    let strip = |count: i32| (0..count).map(|i| [i * 50, i % 40 * 20, i % 7]).collect::<Vec<_>>();
    let two: Vec<[i32; 3]> =
        near(2000, 8000).into_iter().chain(near(60, 8000).iter().map(|[x, y, z]| [x + 500_000, *y, *z])).collect();
    for places in [strip(2000), two] {
        let report = Far::of(places, &[], 0, Header::All, 2).job().report();
        assert!(!report["warnings"].to_string().contains("stretch"), "{report}");
    }
}

#[test]
fn a_header_of_zeros_is_no_box() {
    let cloud = Far::new(500, &[], 0, Header::Zeros);
    let job = cloud.job().with("input", "bounds = [0.0, 0.0, 10.0, 10.0]");
    let said = job.run();
    assert!(said.code == 3 && !said.err.contains("[0.00, 0.00"), "{}", said.err);
}

#[test]
fn check_ends_as_a_job_without_points_does() {
    let cloud = Far::new(500, &[], 0, Header::All);
    for (line, words) in [
        ("bounds = [0.0, 0.0, 10.0, 10.0]", "by their headers the inputs lie in [500000"),
        ("bounds = [4000000.0, 500000.0, 4000300.0, 500300.0]", "x and y look exchanged"),
        ("classes = [6]", "500 of other classes"),
        ("returns = [4]", "500 of other returns"),
    ] {
        let checked = cloud.job().with("input", line).run_with(&["check"]);
        checked.refused(3, &["no point is left to triangulate: of 500 read", words]);
        assert!(checked.out.contains("points kept        about 0\n"), "{}", checked.out);
        cloud.job().with("input", line).run().refused(3, &["no point is left to triangulate: of 500 read", words]);
    }
    cloud.job().with("input", "classes = [2]").run_with(&["check"]).succeeded();
}
