//! EPT as inputs: the results are those of one file with the same points, from this machine and from another one.

use std::fs;

use serde_json::Value;

use crate::copc_file::CopcFile;
use crate::ept_files::{EptFiles, NodeType, one_file};
use crate::las_file::LasFile;
use crate::program::{Job, gdt_batch};

fn cloud() -> CopcFile {
    CopcFile::new(&LasFile::new(4, 7, 0, 9_000), 4)
}

/// A small part of the cloud.
const PART: &str = "bounds = [500060.0, 4000060.0, 500300.0, 4000300.0]";

/// Returns what must not depend on how a cloud is stored: the checksums of all results.
fn results(report: &Value) -> &Value {
    assert!(report["file_list"].is_string());
    &report["file_list"]
}

fn in_parts(job: Job) -> Job {
    job.tiles_of(1000).with("triangulation", "max_points_per_part = 4000")
}

#[test]
fn the_results_are_those_of_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let laz = folder.path().join("cloud.laz");
    fs::write(&laz, one_file(&cloud())).unwrap();
    let whole = Job::on(&[&laz]).tiles_of(2000).report();
    let part = Job::on(&[&laz]).tiles_of(500).with("input", PART).report();
    for kind in NodeType::ALL {
        let index = EptFiles::of(&cloud(), kind).write(&folder.path().join(format!("{kind:?}")));
        let job = Job::on(&[&index]).tiles_of(2000);
        assert_eq!(results(&job.report()), results(&whole), "{kind:?}");
        let index = index.to_str().unwrap();
        gdt_batch(job.folder(), &["verify", "out", "--input", index]).succeeded();
        assert_eq!(results(&Job::on(&[index]).tiles_of(500).with("input", PART).report()), results(&part), "{kind:?}");
    }
    // The plan of a job of several parts is written down. The folder stands for the data set in it.
    let report = in_parts(Job::on(&[folder.path().join("Laszip")])).report();
    assert_eq!(results(&report), results(&in_parts(Job::on(&[&laz])).report()));
    assert!(report["parts"].as_u64().unwrap() > 1);
}

#[cfg(feature = "fault-injection")]
#[test]
fn an_interrupted_job_goes_on_unless_the_data_set_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = EptFiles::of(&cloud(), NodeType::Binary);
    let index = files.write(folder.path());
    let expected = Job::on(&[&index]).tiles_of(2000).report();
    let mut job = Job::on(&[&index]).tiles_of(2000).variable("GDT_FAULT", "signal-merge:1");
    assert_eq!(job.run().code, 1);
    job.calm();
    let said = job.run_with(&["--json"]).succeeded();
    assert!(said.err.contains("continuing"), "{}", said.err);
    assert_eq!(results(&said.json()), results(&expected));
    // One point less, which only the hierarchy and a node tell.
    let allowed = || Job::on(&[&index]).tiles_of(2000).with("input", "max_malformed_fraction = 0.001");
    let mut job = allowed().variable("GDT_FAULT", "signal-merge:1");
    assert_eq!(job.run().code, 1);
    job.calm();
    let points = cloud().nodes[&[0; 4]].len();
    files.edit("ept-hierarchy/0-0-0-0.json", |bytes| {
        let text = String::from_utf8(std::mem::take(bytes)).unwrap();
        *bytes = text.replace(&format!("\"0-0-0-0\":{points}"), &format!("\"0-0-0-0\":{}", points - 1)).into_bytes();
    });
    files.edit("ept-data/0-0-0-0.bin", |bytes| bytes.truncate(bytes.len() - bytes.len() / points));
    files.write(folder.path());
    Job::on(&[&index]).run().refused(3, &["ept.json", "1 is missing"]);
    let said = job.run().succeeded();
    assert!(said.err.contains("ept.json; starting over"), "{}", said.err);
    fs::remove_file(folder.path().join("ept-data/1-0-0-0.bin")).unwrap();
    allowed().run().refused(3, &["ept-data/1-0-0-0.bin: this node of the hierarchy is not there"]);
}

#[cfg(feature = "remote")]
mod by_url {
    use super::*;
    use crate::program::number;
    use crate::web_server::{Answer, WebServer};

    fn server_of(files: &EptFiles) -> WebServer {
        let named: Vec<(String, Vec<u8>)> =
            files.0.iter().map(|(name, bytes)| (format!("/valley/{name}"), bytes.clone())).collect();
        let named: Vec<(&str, Vec<u8>)> = named.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
        WebServer::of(&named)
    }

    #[test]
    fn the_results_are_those_of_local_files() {
        let files = EptFiles::of(&cloud(), NodeType::Laszip);
        let (server, folder) = (server_of(&files), tempfile::tempdir().unwrap());
        let index = files.write(folder.path());
        let expected = Job::on(&[&index]).tiles_of(2000).report();
        let url = server.url("/valley/ept.json?key=SECRET");
        let size: usize = files.0.values().map(Vec::len).sum();
        server.answer(|_, _| Answer::Right);
        let job = Job::on(&[&url]).tiles_of(2000);
        let report = job.report();
        assert_eq!(results(&report), results(&expected));
        assert_eq!(number(&report["network"]["bytes"]), server.sent() as u64);
        // Each node in a request of its own. A cloud of a single chunk is read twice: the first time, its box is compared with the index.
        let requests = server.requests();
        assert!(requests.len() < 2 * files.0.len() + 20, "{} for {} files", requests.len(), files.0.len());
        assert!(server.sent() < 2 * size + size / 4, "{} of {size}", server.sent());
        // The signature of the index is for all files of the data set, and nobody sees it.
        assert!(requests.iter().all(|request| request.target.ends_with("?key=SECRET")));
        assert!(!report.to_string().contains("SECRET"));
        let info = gdt_batch(folder.path(), &["info", &url, "--json"]).succeeded().json();
        assert_eq!((number(&info["points"]), info["format"].as_str().unwrap()), (9_000, "ept"));
        gdt_batch(folder.path(), &["init", &server.url("/valley/ept.json"), "-o", "job.toml"]).succeeded();
        let check = gdt_batch(folder.path(), &["check", "job.toml", "--json"]).succeeded().json();
        assert_eq!(number(&check["records"]), 9_000);
        // What may pass is asked for again, and what is not there is named.
        server.answer(|number, _| if number % 3 == 1 { Answer::CutOff(100) } else { Answer::Right });
        let patient = Job::on(&[&url]).tiles_of(2000).variable("GDT_TIMEOUT_MS", "2000");
        assert_eq!(results(&patient.report()), results(&expected));
        server.answer(|_, request| match request.target.contains("1-0-0-0.laz") {
            true => Answer::Status(404, "X: y"),
            false => Answer::Right,
        });
        Job::on(&[&url]).run().refused(3, &["valley/ept-data/1-0-0-0.laz: this node of the hierarchy is not there"]);
    }

    /// An octree whose nodes have as many points as those of real data sets have at least.
    #[test]
    fn bounds_of_a_hundredth_of_the_area_take_a_twelfth_of_the_bytes() {
        let cloud = CopcFile::new(&LasFile::new(4, 7, 0, 400_000), 4);
        let side = 2.0 * f64::from(cloud.half) / 100.0;
        let files = EptFiles::of(&cloud, NodeType::Laszip);
        let server = server_of(&files);
        let size: usize = files.0.values().map(Vec::len).sum();
        // Off the middle, where the points are densest.
        let [x, y] = [500_000.0 + side * 0.14, 4_000_000.0 + side * 0.14];
        let bounds = format!("bounds = [{x}, {y}, {}, {}]", x + side / 10.0, y + side / 10.0);
        let report = Job::on(&[server.url("/valley/ept.json")]).with("input", &bounds).report();
        assert!(number(&report["points"]["kept"]) > 500);
        let sent = server.sent();
        assert!(sent * 12 < size, "{sent} of {size} bytes");
    }
}
