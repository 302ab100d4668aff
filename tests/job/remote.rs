//! Inputs of other machines: the results are those of local files, few requests bring only what is needed, and what may pass is waited for.

use std::fs;
use std::ops::Range;
use std::path::Path;

use serde_json::Value;

use crate::copc_file::CopcFile;
use crate::las_file::LasFile;
use crate::program::{Job, Said, gdt_batch, number};
use crate::random::Random;
use crate::web_server::{Answer, Request, WebServer};

/// What a program with the feature `fault-injection` waits for a server, in milliseconds.
const TIMEOUT: &str = "2000";

/// A hundredth of the area of the cloud.
const HUNDREDTH: &str = "bounds = [500600.0, 4000600.0, 500840.0, 4000840.0]";

/// Writes the box of the points of `file` into the header of `bytes`, as real files have it: without one a job measures all points first.
fn with_box(mut bytes: Vec<u8>, file: &LasFile) -> Vec<u8> {
    let records = || file.records.chunks_exact(file.length() as usize);
    for (axis, offset) in [500_000.0, 4_000_000.0, 0.0].into_iter().enumerate() {
        let raw = |record: &[u8]| i32::from_le_bytes(record[4 * axis..4 * axis + 4].try_into().unwrap());
        let ends = [records().map(raw).max().unwrap(), records().map(raw).min().unwrap()];
        for (end, raw) in ends.into_iter().enumerate() {
            let at = 179 + 16 * axis + 8 * end;
            bytes[at..at + 8].copy_from_slice(&(offset + raw as f64 * 0.01).to_le_bytes());
        }
    }
    bytes
}

/// Returns rows of points from x = `x` on.
fn rows(x: usize) -> Vec<u8> {
    let row = |i: usize| format!("{}.{},{}.5,{}\n", x + i % 90, i % 7, i / 90, i % 13);
    (0..9_000).map(row).collect::<String>().into_bytes()
}

fn cloud() -> LasFile {
    LasFile::new(4, 7, 0, 9_000)
}

/// Returns a file of each kind.
fn files() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("/a/cloud.las", with_box(cloud().las(), &cloud())),
        ("/a/layered.laz", with_box(cloud().laz(&[1000], false), &cloud())),
        ("/a/pointwise.laz", LasFile::new(2, 3, 0, 9_000).laz(&[1000], false)),
        ("/a/cloud.copc.laz", with_box(CopcFile::new(&cloud(), 4).bytes(), &cloud())),
        ("/a/rows.csv", rows(0)),
    ]
}

/// Returns a job on a file of the server.
fn job_on(server: &WebServer, target: &str) -> Job {
    Job::on(&[server.url(target)]).tiles_of(2000).variable("GDT_TIMEOUT_MS", TIMEOUT)
}

/// Returns what must not depend on where a file is: the checksums of all results.
fn results(report: &Value) -> &Value {
    assert!(report["file_list"].is_string());
    &report["file_list"]
}

/// A job without a configuration, whose results have the name of the file. Its query is written to no configuration.
#[test]
fn a_url_on_the_command_line_is_a_point_cloud() {
    let (server, folder) = (WebServer::of(&files()), tempfile::tempdir().unwrap());
    let (url, root) = (server.url("/a/cloud.copc.laz"), folder.path());
    let expected = Job::on(&[&url]).report();
    let report = gdt_batch(root, &[&url, "--json", "--quiet"]).succeeded().json();
    assert_eq!(results(&report), results(&expected));
    assert!(root.join("cloud-terrain/tileset.json").is_file());
    gdt_batch(root, &[&url, "--write-config", "job.toml"]).succeeded();
    assert!(fs::read_to_string(root.join("job.toml")).unwrap().contains(&format!("files = [\"{url}\"]")));
    let said = gdt_batch(root, &[&format!("{url}?key=SECRET"), "--write-config", "other.toml"]);
    said.refused(2, &["the query of this URL may be a secret"]);
    assert!(!said.err.contains("SECRET") && !root.join("other.toml").exists(), "{}", said.err);
    let said = gdt_batch(root, &[&format!("{url}?key=SECRET"), "-o", "secret"]).succeeded();
    assert!(!format!("{said:?}").contains("SECRET") && root.join("secret/tileset.json").is_file());
}

#[test]
fn results_are_those_of_local_files() {
    let (server, folder) = (WebServer::of(&files()), tempfile::tempdir().unwrap());
    for (name, bytes) in files() {
        let local = folder.path().join(Path::new(name).file_name().unwrap());
        fs::write(&local, &bytes).unwrap();
        let expected = Job::on(&[&local]).tiles_of(2000).report();
        server.answer(|_, _| Answer::Right);
        let job = job_on(&server, name);
        let report = job.report();
        assert_eq!(results(&report), results(&expected), "{name}");
        let (requests, sent) = (server.requests(), server.sent());
        assert_eq!(number(&report["network"]["requests"]), requests.len() as u64);
        assert_eq!(number(&report["network"]["bytes"]), sent as u64);
        assert!(requests.iter().skip(1).all(|request| request.headers["if-match"] == "\"first\""), "{name}");
        // The beginning, samples of the heights, and the points; texts are looked at more than once.
        assert!(requests.len() < 60 && sent < 8 * bytes.len() + (1 << 18), "{name}: {} {sent}", requests.len());
        let arguments = ["verify", "out", "--json", "--input", &server.url(name)];
        assert_eq!(gdt_batch(job.folder(), &arguments).succeeded().json()["failures"], serde_json::json!([]));
    }
    let info = gdt_batch(folder.path(), &["info", &server.url("/a/cloud.las"), "--json"]).succeeded().json();
    assert_eq!((number(&info["points"]), info["file"].as_str().unwrap()), (9_000, server.url("/a/cloud.las").as_str()));
    let check = job_on(&server, "/a/cloud.copc.laz").run_with(&["check", "--json"]).succeeded().json();
    assert_eq!(number(&check["records"]), 9_000);
}

#[test]
fn a_job_of_several_parts_and_files_has_the_same_results() {
    let files = [("/a.csv", rows(0)), ("/b.csv", rows(90))];
    let (server, folder) = (WebServer::of(&files), tempfile::tempdir().unwrap());
    let names = ["/a.csv", "/b.csv"];
    let local = names.map(|name| folder.path().join(&name[1..]));
    files.iter().zip(&local).for_each(|((_, bytes), path)| fs::write(path, bytes).unwrap());
    let parts = |job: Job| job.tiles_of(1000).with("triangulation", "max_points_per_part = 4000").report();
    let (expected, report) = (parts(Job::on(&local)), parts(Job::on(&names.map(|name| server.url(name)))));
    assert!(number(&report["parts"]) > 1);
    assert_eq!(results(&report), results(&expected));
}

#[test]
fn bounds_of_a_hundredth_take_a_small_share_of_a_copc_file() {
    let mut large = LasFile::new(4, 7, 60, 60_000);
    // What cannot be compressed makes the file large.
    let (length, mut random) = (large.length() as usize, Random(1));
    for record in large.records.chunks_exact_mut(length) {
        record[36..].iter_mut().for_each(|byte| *byte = random.below(256) as u8);
    }
    let bytes = with_box(CopcFile::new(&large, 6).bytes(), &large);
    let server = WebServer::of(&[("/large.copc.laz", bytes.clone())]);
    let bounded = |name: &str| Job::on(&[name]).with("input", HUNDREDTH).report();
    let report = bounded(&server.url("/large.copc.laz"));
    let (requests, sent) = (server.requests().len(), server.sent());
    // A job looks at 4096 points of the root and below, whatever its bounds, to see whether the header is right.
    assert!(sent < bytes.len() / 5, "{sent} of {}", bytes.len());
    // Points within the bounds that samples have looked at do not come again. The octree is behind the points.
    let end_of_points = u64::from_le_bytes(bytes[235..243].try_into().unwrap()) as usize;
    let mut ranges: Vec<Range<usize>> = server.requests().iter().map(Request::range).collect();
    ranges.retain(|range| range.end <= end_of_points);
    ranges.sort_by_key(|range| (range.start, range.end));
    let twice: usize = ranges.windows(2).map(|pair| pair[0].end.min(pair[1].end).saturating_sub(pair[1].start)).sum();
    // The beginning of the file comes with the header, and again with the root.
    assert!(twice < 1 << 15, "{twice} of {sent}: {ranges:?}");
    assert!(requests < 60, "{requests}");
    let folder = tempfile::tempdir().unwrap();
    let local = folder.path().join("large.copc.laz");
    fs::write(&local, &bytes).unwrap();
    assert_eq!(results(&report), results(&bounded(local.to_str().unwrap())));
}

#[test]
fn what_may_pass_is_asked_for_again() {
    let server = WebServer::of(&files());
    let expected = job_on(&server, "/a/cloud.las").report();
    let rules: [fn(usize) -> Answer; 4] = [
        |number| if number % 3 < 2 { Answer::Status(503, "Retry-After: 0") } else { Answer::Right },
        |number| if number % 2 == 0 { Answer::CutOff(1000) } else { Answer::Right },
        |number| if number % 2 == 0 { Answer::CutOff(0) } else { Answer::Right },
        |number| if number % 5 == 1 { Answer::Status(429, "X: y") } else { Answer::Right },
    ];
    for rule in rules {
        server.answer(move |number, _| rule(number));
        let report = job_on(&server, "/a/cloud.las").report();
        assert_eq!(results(&report), results(&expected));
    }
}

#[cfg(feature = "fault-injection")]
#[test]
fn a_server_that_fails_for_ever_does_not_hold_a_job_up() {
    let server = WebServer::of(&files());
    let run = |answer: Answer| -> Said {
        // The beginning comes, and then nothing more.
        server.answer(move |number, _| if number == 0 { Answer::Right } else { answer.clone() });
        job_on(&server, "/a/cloud.las").variable("GDT_TIMEOUT_MS", "400").run()
    };
    let url = server.url("/a/cloud.las");
    run(Answer::Status(503, "X: y")).refused(1, &[&url, "bytes ", "503", "times in", "run again later"]);
    run(Answer::Nothing).refused(1, &[&url, "did not answer in time", "times in"]);
    run(Answer::CutOff(10)).refused(1, &[&url, "bytes too early"]);
    run(Answer::Tagged("second")).refused(1, &["it has changed while it was in use", "\"first\"", "\"second\""]);
    run(Answer::Status(412, "X: y")).refused(1, &["it has changed while it was in use"]);
    run(Answer::Status(403, "X: y")).refused(1, &["403", "a signature in the URL may have expired"]);
}

#[test]
fn what_no_server_can_hand_out_is_refused() {
    let server = WebServer::of(&files());
    let refused =
        |url: &str, code, words: &[&str]| Job::on(&[url]).variable("GDT_TIMEOUT_MS", "400").run().refused(code, words);
    refused(&server.url("/none.laz"), 2, &["there is no file", "/none.laz", "404"]);
    refused(&server.url("/a/*.laz"), 2, &["[input] files", "name each one"]);
    refused("http://user:secret@127.0.0.1/a.laz", 2, &["a user and a password is refused"]);
    for (place, words) in [
        ("Location: file:///etc/hosts", "the server redirects "),
        ("Location: file://host/a.laz", "the server redirects from http to file, which is not followed"),
        ("Location: ftp://host/a.laz", "the server redirects from http to ftp, which is not followed"),
    ] {
        server.answer(move |_, _| Answer::Status(302, place));
        refused(&server.url("/a/cloud.las"), 1, &[words]);
    }
    refused("gs://bucket/a.laz", 2, &["not by gs://"]);
    refused("http://127.0.0.1:1/a.laz", 1, &["127.0.0.1:1 refuses connections"]);
    refused("https://no-such-host.invalid/a.laz", 1, &["no-such-host.invalid", "check the network"]);
    server.answer(|_, _| Answer::Whole);
    refused(&server.url("/a/cloud.las"), 2, &["does not send parts", "download the file"]);
    server.answer(|_, _| Answer::Status(401, "X: y"));
    refused(&server.url("/a/cloud.las"), 1, &["cannot read", "401"]);
    server.answer(|_, _| Answer::Right);
    let lines = Job::on(&[server.url("/a/cloud.las")])
        .with("[breaklines]", "files = [\"https://host/a.gpkg?token=1\"]\nkind = \"line\"");
    lines
        .run()
        .refused(2, &["[[breaklines]] files: https://host/a.gpkg: only point clouds and orthophotos are read by URL"]);
    gdt_batch(lines.folder(), &["info", &server.url("/none.laz")]).refused(2, &["there is no file"]);
}

#[test]
fn a_file_that_has_changed_is_noticed_and_one_without_a_tag_is_read_with_a_warning() {
    let server = WebServer::of(&files());
    let job = job_on(&server, "/a/cloud.las");
    let fingerprint = |job: &Job| job.report()["inputs_fingerprint"].clone();
    let (first, again) = (fingerprint(&job), fingerprint(&job));
    server.answer(|_, _| Answer::Tagged("second"));
    assert!(first == again && fingerprint(&job) != first);
    server.answer(|_, _| Answer::Untagged);
    let report = job.report();
    assert!(report["warnings"].to_string().contains("neither ETag nor Last-Modified"), "{}", report["warnings"]);
}

#[test]
fn a_query_is_sent_and_written_nowhere() {
    let server = WebServer::of(&files());
    let secret = "X-Amz-Signature=0123secret4567";
    let job = job_on(&server, &format!("/a/cloud.las?{secret}"));
    let said = job.run().succeeded();
    assert!(server.requests().iter().all(|request| request.target.ends_with(secret)));
    let failing = job_on(&server, &format!("/a/none.las?{secret}")).run();
    failing.refused(2, &["/a/none.las?..."]);
    // Plans and journals are in the folder of a job that has failed.
    let stopped = job_on(&server, &format!("/a/cloud.las?{secret}")).variable("GDT_FAULT", "read-points:1");
    let stopped_said = stopped.run();
    let files =
        |folder: &Path| glob::glob(&format!("{}/**/*", folder.display())).unwrap().flatten().collect::<Vec<_>>();
    let written = files(&job.out()).into_iter().chain(files(&stopped.out())).filter(|path| path.is_file());
    for path in written {
        let bytes = fs::read(&path).unwrap();
        assert!(!bytes.windows(10).any(|window| window == &secret.as_bytes()[16..26]), "{}", path.display());
    }
    for Said { out, err, .. } in [said, failing, stopped_said] {
        assert!(!out.contains("secret") && !err.contains("secret"), "{out} {err}");
    }
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_download_that_hangs() {
    use std::process::{Command, Stdio};
    let server = WebServer::of(&files());
    server.answer(|number, _| if number == 0 { Answer::Right } else { Answer::Nothing });
    let job = Job::on(&[server.url("/a/cloud.las")]);
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
    let child = command.arg(job.config()).current_dir(job.folder()).stderr(Stdio::piped()).spawn().unwrap();
    while server.requests().len() < 2 {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    // Without the signal the request would have had 30 seconds.
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("error: interrupted"));
}

#[test]
fn buckets_are_listed_and_requests_signed() {
    let key = |name: &str| format!("/bucket/clouds/{name}");
    let server = WebServer::of(&[
        (&key("a%20b.laz"), cloud().laz(&[1000], false)),
        (&key("c.laz"), LasFile::new(4, 7, 0, 500).laz(&[1000], false)),
    ]);
    server.answer(|_, request| match request.target.split_once('?') {
        Some((_, query)) if query.contains("continuation") => list(&["clouds/c.laz", "clouds/d.txt"], false),
        Some(_) => list(&["clouds/a b.laz", "clouds/deep/e.laz"], true),
        None => Answer::Right,
    });
    let job = |files: &str| {
        let own = server.url("");
        let job = Job::on(&[files]).variable("AWS_ENDPOINT_URL", &own).variable("AWS_ALLOW_HTTP", "true");
        job.variable("AWS_SKIP_SIGNATURE", "").variable("AWS_REGION", "eu-central-1")
    };
    let with_key = |files: &str| {
        let job = job(files).variable("AWS_ACCESS_KEY_ID", "who").variable("AWS_SECRET_ACCESS_KEY", "hidden");
        job.variable("AWS_SESSION_TOKEN", "token")
    };
    let report = with_key("s3://bucket/clouds/*.laz").report();
    assert_eq!((number(&report["files"]), number(&report["points"]["read"])), (2, 9_500));
    for request in server.requests() {
        let signature = &request.headers["authorization"];
        assert!(signature.starts_with("AWS4-HMAC-SHA256 Credential=who/"), "{signature}");
        assert!(signature.contains("/eu-central-1/s3/aws4_request") && signature.contains("x-amz-security-token"));
        assert!(!format!("{request:?}").contains("hidden"));
    }
    assert!(server.requests()[0].target.contains("delimiter=%2F&list-type=2&prefix=clouds%2F"));
    with_key("s3://bucket/clouds/*.las").run().refused(2, &["there is no file s3://bucket/clouds/*.las"]);
    with_key("s3://bucket/clouds/").run().refused(2, &["is a folder", "s3://bucket/clouds/*.laz"]);
    with_key("s3://bucket/clouds/x.laz").run().refused(2, &["there is no file s3://bucket/clouds/x.laz", "404"]);
    server.answer(|_, _| list(&["clouds/c.laz"], true));
    with_key("s3://bucket/clouds/*.laz").run().refused(2, &["the server repeats parts of the bucket's list"]);
    let nobody = job("s3://bucket/clouds/c.laz").variable("AWS_ACCESS_KEY_ID", "");
    nobody.run().refused(2, &["AWS_ACCESS_KEY_ID", "AWS_SKIP_SIGNATURE=true"]);
    server.answer(|_, _| Answer::Right);
    job("s3://bucket/clouds/c.laz").variable("AWS_SKIP_SIGNATURE", "true").run().succeeded();
    assert!(server.requests().iter().all(|request| !request.headers.contains_key("authorization")));
}

/// Returns a page of a bucket's list.
fn list(keys: &[&str], goes_on: bool) -> Answer {
    let keys: String = keys.iter().map(|key| format!("<Contents><Key>{key}</Key></Contents>")).collect();
    let next = if goes_on { "<NextContinuationToken>more</NextContinuationToken>" } else { "" };
    Answer::Text(format!("<ListBucketResult><IsTruncated>{goes_on}</IsTruncated>{keys}{next}</ListBucketResult>"))
}

/// Starts the S3 of `tests/python/s3_server.py` on the files of a folder; `None` if GDT_MOTO names no Python that has what it takes.
fn moto(folder: &Path) -> Option<(std::process::Child, Value)> {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    let Some(python) = std::env::var_os("GDT_MOTO") else {
        eprintln!("skipped: GDT_MOTO names no Python with moto[server] and boto3; see CONTRIBUTING.md");
        return None;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/s3_server.py");
    let mut command = Command::new(python);
    command.arg(script).arg(folder).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut server = command.spawn().expect("Python starts");
    let mut line = String::new();
    BufReader::new(server.stdout.take().unwrap()).read_line(&mut line).unwrap();
    Some((server, serde_json::from_str(&line).expect("the server is ready")))
}

#[test]
fn an_s3_that_checks_signatures_hands_files_out() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["a b+c.laz", "d.copc.laz", "e.txt"];
    fs::create_dir(folder.path().join("sub")).unwrap();
    for (name, bytes) in names.iter().zip([cloud().laz(&[1000], false), CopcFile::new(&cloud(), 4).bytes(), Vec::new()])
    {
        fs::write(folder.path().join("sub").join(name), bytes).unwrap();
    }
    let Some((mut server, said)) = moto(folder.path()) else { return };
    let job = |secret: &str| {
        let text = |name: &str| said[name].as_str().unwrap();
        let job = Job::on(&["s3://clouds/sub/*.laz"]).tiles_of(2000).variable("AWS_ENDPOINT_URL", text("endpoint"));
        let job = job.variable("AWS_ALLOW_HTTP", "true").variable("AWS_ACCESS_KEY_ID", text("key"));
        job.variable("AWS_SECRET_ACCESS_KEY", secret)
    };
    let report = job(said["secret"].as_str().unwrap()).report();
    let local: Vec<_> = names[..2].iter().map(|name| folder.path().join("sub").join(name)).collect();
    assert_eq!(results(&report), results(&Job::on(&local).tiles_of(2000).report()));
    job("wrong").run().refused(1, &["cannot read s3://clouds/sub/*.laz", "403", "SignatureDoesNotMatch"]);
    drop(server.stdin.take());
    server.wait().unwrap();
}
