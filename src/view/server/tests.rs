use super::*;
use crate::view::hosts::Hosts;
use crate::view::results::Results;
use flate2::read::GzDecoder;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::path::Path;
use std::thread;
use tempfile::TempDir;
use tiles::checksums::{Checksum, list_text};

/// A folder with files, served on a port of its own until the test process ends.
struct Rig {
    folder: TempDir,
    address: SocketAddr,
}

struct Answer {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Answer {
    fn header(&self, name: &str) -> Option<&str> {
        let line = self.head.lines().filter_map(|line| line.split_once(": "));
        line.filter(|(found, _)| found.eq_ignore_ascii_case(name)).map(|(_, value)| value).next()
    }
}

impl Rig {
    fn new() -> Rig {
        Rig::with(STILLNESS, false)
    }

    /// Clients may take nothing of an answer for so long, and pages of other servers may read the files if `cors` is set.
    fn with(stillness: Duration, cors: bool) -> Rig {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().canonicalize().unwrap().join("out");
        std::fs::create_dir_all(root.join("tiles")).unwrap();
        std::fs::write(root.join("tiles/000000.glb"), tile()).unwrap();
        std::fs::write(root.join("report.json"), json()).unwrap();
        std::fs::write(root.join("XXH128SUMS"), list()).unwrap();
        std::fs::write(folder.path().join("secret.json"), "secret").unwrap();
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let address = listener.local_addr().unwrap();
        let hosts = Hosts::new(&["maps.example".into()]);
        let site = Site { results: Results::new(&root), root, page: Some("<p>the page".into()), hosts, cors };
        let server = Server { stillness, ..Server::new(listener, site).unwrap() };
        thread::spawn(move || server.run());
        Rig { folder, address }
    }

    fn out(&self) -> std::path::PathBuf {
        self.folder.path().join("out")
    }

    /// Sends a request with these lines after the first, and returns the answer.
    fn ask(&self, first: &str, headers: &str) -> Answer {
        let mut stream = TcpStream::connect(self.address).unwrap();
        let host = if headers.contains("Host:") { "" } else { "Host: localhost\r\n" };
        write!(stream, "{first} HTTP/1.1\r\n{host}{headers}Connection: close\r\n\r\n").unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let end = memchr::memmem::find(&bytes, b"\r\n\r\n").unwrap();
        let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        let is_chunked = head.to_ascii_lowercase().contains("transfer-encoding: chunked");
        let body = bytes[end + 4..].to_vec();
        Answer { status, head, body: if is_chunked { unchunked(&body) } else { body } }
    }

    fn get(&self, path: &str) -> Answer {
        self.ask(&format!("GET {path}"), "")
    }
}

#[test]
fn pages_of_other_servers_read_files_only_if_the_user_wants_that() {
    let (own, all) = (Rig::new(), Rig::with(STILLNESS, true));
    let part = "Range: bytes=8-11\r\nOrigin: https://maps.example\r\n";
    let answer = own.ask("GET /tiles/000000.glb", part);
    assert_eq!((answer.status, answer.header("Access-Control-Allow-Origin")), (206, None));
    assert_eq!(answer.header("Cross-Origin-Resource-Policy"), Some("same-origin"));
    let answer = all.ask("GET /tiles/000000.glb", part);
    assert_eq!((answer.status, answer.header("Access-Control-Allow-Origin")), (206, Some("*")));
    assert_eq!(answer.header("Cross-Origin-Resource-Policy"), Some("cross-origin"));
    assert_eq!(answer.header("Content-Range"), Some("bytes 8-11/400000"));
    assert!(answer.header("Access-Control-Expose-Headers").unwrap().contains("Content-Range"));
    assert_eq!(answer.body, tile()[8..12]);
    // A page sees why it gets nothing, and what it may ask.
    assert_eq!(all.get("/nothing").header("Access-Control-Allow-Origin"), Some("*"));
    let before = all.ask("OPTIONS /tiles/000000.glb", "Access-Control-Request-Method: GET\r\n");
    assert_eq!((before.status, before.header("Access-Control-Allow-Origin")), (204, Some("*")));
    assert!(before.header("Access-Control-Allow-Headers").unwrap().contains("Range"));
    assert_eq!(own.ask("OPTIONS /tiles/000000.glb", "").status, 405);
    // Names that a page may have given itself stay out.
    assert_eq!(all.ask("GET /tiles/000000.glb", "Host: evil.example\r\n").status, 403);
}

fn tile() -> Vec<u8> {
    (0..100_000u32).flat_map(|i| (i % 251).to_le_bytes()).collect()
}

/// Returns the list of the results. Not all of them are there.
fn list() -> String {
    let names = ["tiles/000000.glb", "large.glb", "link.json", "up/secret.json", "inside.json", "pipe.json"];
    list_text(&names.map(|name| (name.into(), Checksum::default())))
}

/// Returns a report.
fn json() -> String {
    let list = Checksum::of(list().as_bytes());
    format!(
        "{{\"generator\": \"gdt-batch 9\", \"file_list\": \"{list}\", \"warnings\": [{}0]}}\n",
        "0, ".repeat(20_000)
    )
}

fn unchunked(mut bytes: &[u8]) -> Vec<u8> {
    let mut whole = Vec::new();
    while let Some(end) = memchr::memmem::find(bytes, b"\r\n") {
        let size = usize::from_str_radix(std::str::from_utf8(&bytes[..end]).unwrap(), 16).unwrap();
        whole.extend_from_slice(&bytes[end + 2..end + 2 + size]);
        bytes = &bytes[end + 4 + size..];
    }
    whole
}

#[test]
fn files_come_whole_and_with_their_types() {
    let rig = Rig::new();
    let found = rig.get("/tiles/000000.glb");
    assert_eq!((found.status, found.header("Content-Type")), (200, Some("model/gltf-binary")));
    assert_eq!(found.header("Content-Length"), Some("400000"));
    assert!(found.body == tile());
    assert_eq!(rig.get("/report.json").header("Content-Type"), Some("application/json"));
    for page in ["/", "/index.html", "/?x=1"] {
        let page = rig.get(page);
        assert_eq!(page.body, b"<p>the page");
        assert!(page.header("Content-Type").unwrap().starts_with("text/html"));
    }
}

#[test]
fn ranges_give_the_bytes_that_were_asked_for() {
    let rig = Rig::new();
    let tile = tile();
    let last = tile.len() - 1;
    let cases = [
        ("0-0", 0, 0),
        ("100-299", 100, 299),
        ("399990-", 399_990, last),
        ("-7", last - 6, last),
        ("399999-500000", last, last),
        ("-9999999", 0, last),
    ];
    for (range, from, to) in cases {
        let part = rig.ask("GET /tiles/000000.glb", &format!("Range: bytes={range}\r\nAccept-Encoding: gzip\r\n"));
        assert_eq!(part.status, 206, "{range}");
        assert_eq!(part.header("Content-Range").unwrap(), format!("bytes {from}-{to}/400000"));
        assert!(part.body == tile[from..=to], "{range}");
    }
    for beyond in ["400000-", "500000-500001", "-0"] {
        let refused = rig.ask("GET /tiles/000000.glb", &format!("Range: bytes={beyond}\r\n"));
        assert_eq!((refused.status, refused.header("Content-Range")), (416, Some("bytes */400000")), "{beyond}");
    }
    // What is no range, or several, may be answered with everything.
    for other in ["bytes=5-2", "lines=1-2", "bytes=0-1,5-6", "bytes=x"] {
        let whole = rig.ask("GET /tiles/000000.glb", &format!("Range: {other}\r\n"));
        assert_eq!((whole.status, whole.body.len()), (200, 400_000), "{other}");
    }
    let changed = rig.ask("GET /tiles/000000.glb", "Range: bytes=0-1\r\nIf-Range: \"another\"\r\n");
    assert_eq!((changed.status, changed.body.len()), (200, 400_000));
}

#[test]
fn texts_are_packed_for_browsers_that_unpack_them() {
    let rig = Rig::new();
    let packed = rig.ask("GET /report.json", "Accept-Encoding: br, gzip;q=0.5\r\n");
    assert_eq!((packed.header("Content-Encoding"), packed.header("Accept-Ranges")), (Some("gzip"), None));
    assert!(packed.body.len() < 2_000);
    // A part of the packed bytes would not fit to the others.
    let tags = [&packed, &rig.get("/report.json")].map(|answer| answer.header("ETag").unwrap().to_owned());
    assert_ne!(tags[0], tags[1]);
    for tag in tags {
        assert_eq!(rig.ask("GET /report.json", &format!("If-None-Match: {tag}\r\n")).status, 304, "{tag}");
    }
    let mut text = String::new();
    GzDecoder::new(packed.body.as_slice()).read_to_string(&mut text).unwrap();
    assert_eq!(text, json());
    for refused in ["", "Accept-Encoding: br\r\n", "Accept-Encoding: gzip;q=0\r\n"] {
        let plain = rig.ask("GET /report.json", refused);
        assert_eq!((plain.header("Content-Encoding"), plain.body == json().as_bytes()), (None, true), "{refused}");
    }
}

#[test]
fn browsers_need_not_fetch_twice_what_has_not_changed() {
    let rig = Rig::new();
    let tag = rig.get("/report.json").header("ETag").unwrap().to_owned();
    let same = rig.ask("GET /report.json", &format!("If-None-Match: {tag}\r\n"));
    assert_eq!((same.status, same.body.len()), (304, 0));
    let other = json().replace("gdt-batch 9", "gdt-batch 10");
    std::fs::write(rig.out().join("report.json"), &other).unwrap();
    let new = rig.ask("GET /report.json", &format!("If-None-Match: {tag}\r\n"));
    assert_eq!((new.status, new.body), (200, other.into_bytes()));
}

#[test]
fn head_gives_the_headers_without_the_file() {
    let rig = Rig::new();
    let head = rig.ask("HEAD /tiles/000000.glb", "");
    assert_eq!((head.status, head.header("Content-Length"), head.body.len()), (200, Some("400000"), 0));
    assert_eq!(rig.ask("HEAD /nothing", "").status, 404);
    for range in ["0-9", "500000-", "-7"] {
        let whole = rig.ask("HEAD /tiles/000000.glb", &format!("Range: bytes={range}\r\n"));
        assert_eq!((whole.status, whole.header("Content-Length")), (200, Some("400000")), "{range}");
        assert_eq!(whole.header("Content-Range"), None, "{range}");
    }
}

#[test]
fn nothing_outside_the_folder_is_served() {
    let rig = Rig::new();
    let paths = [
        "/../secret.json",
        "/tiles/../../secret.json",
        "/%2e%2e/secret.json",
        "/..%2fsecret.json",
        "/%2e%2e%2fsecret.json",
        "/..%5csecret.json",
        "/tiles/%00",
        "/tiles",
        "/tiles/",
        "/nothing.json",
    ];
    for path in paths {
        let answer = rig.get(path);
        assert_eq!(answer.status, 404, "{path}");
        assert!(!answer.body.ends_with(b"secret"), "{path}");
    }
    assert_eq!(rig.get("//tiles//000000.glb").status, 200);
}

#[test]
fn nothing_but_results_is_served() {
    let rig = Rig::new();
    let others =
        [".env", ".git/config", "job.toml", "cloud.laz", "job/plan.json", "tiles/000001.glb", "tiles/roof.glb"];
    for name in others {
        let path = rig.out().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "secret").unwrap();
    }
    let ways = [
        "/%2egit/config",
        "/.git%2fconfig",
        "/JOB.TOML",
        "/tiles/000000.GLB",
        "/Tiles/000000.glb",
        "/job.toml/",
        "/XXH128SUMS",
    ];
    for path in others.iter().map(|name| format!("/{name}")).chain(ways.map(String::from)) {
        for method in ["GET", "HEAD"] {
            let answer = rig.ask(&format!("{method} {path}"), "");
            assert_eq!((answer.status, answer.header("ETag")), (404, None), "{method} {path}");
            assert!(!answer.body.ends_with(b"secret"), "{path}");
        }
    }
    assert_eq!(rig.get("/tiles/000000.glb").status, 200);
}

#[cfg(unix)]
#[test]
fn links_and_pipes_are_not_opened_even_if_they_have_names_of_results() {
    use std::os::unix::fs::symlink;
    let rig = Rig::new();
    symlink(rig.folder.path().join("secret.json"), rig.out().join("link.json")).unwrap();
    symlink(rig.folder.path(), rig.out().join("up")).unwrap();
    symlink(Path::new("report.json"), rig.out().join("inside.json")).unwrap();
    let made = std::process::Command::new("mkfifo").arg(rig.out().join("pipe.json")).status().unwrap();
    assert!(made.success());
    for path in ["/link.json", "/up/secret.json", "/inside.json", "/pipe.json"] {
        assert_eq!(rig.get(path).status, 404, "{path}");
    }
}

#[test]
fn other_methods_and_other_hosts_are_refused() {
    let rig = Rig::new();
    for method in ["POST", "PUT", "DELETE", "OPTIONS"] {
        let refused = rig.ask(&format!("{method} /report.json"), "");
        assert_eq!((refused.status, refused.header("Allow")), (405, Some("GET, HEAD")), "{method}");
    }
    assert!(rig.out().join("report.json").exists());
    let refused = rig.ask("GET /report.json", "Host: evil.example\r\n");
    assert_eq!(refused.status, 403);
    let why = String::from_utf8(refused.body).unwrap();
    assert!(why.contains("--host NAME") && why.contains("localhost, IP addresses, "), "{why}");
    for own in ["127.0.0.1:9", "192.0.2.7:8080", "maps.example"] {
        assert_eq!(rig.ask("GET /report.json", &format!("Host: {own}\r\n")).status, 200, "{own}");
    }
}

#[test]
fn clients_that_never_send_or_never_read_hold_up_nobody() {
    let rig = Rig::new();
    let silent: Vec<TcpStream> = (0..50).map(|_| TcpStream::connect(rig.address).unwrap()).collect();
    let mut slow = Vec::new();
    for _ in 0..50 {
        let mut stream = TcpStream::connect(rig.address).unwrap();
        stream.write_all(b"GET /tiles/000000.glb HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
        slow.push(stream);
    }
    let mut half = TcpStream::connect(rig.address).unwrap();
    half.write_all(b"GET /report.json HTT").unwrap();
    thread::scope(|scope| {
        for _ in 0..64 {
            scope.spawn(|| assert!(rig.get("/tiles/000000.glb").body == tile()));
        }
    });
    drop((silent, slow, half));
    assert_eq!(rig.get("/report.json").status, 200);
}

/// Returns a connection that asks for a file that is larger than what systems keep of an answer on its way.
fn asks_for_much(rig: &Rig) -> TcpStream {
    let mut stream = TcpStream::connect(rig.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    stream.write_all(b"GET /large.glb HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
    stream
}

const LARGE: u64 = 32 << 20;

#[test]
fn clients_that_never_read_lose_their_places() {
    let rig = Rig::with(Duration::from_millis(300), false);
    std::fs::File::create(rig.out().join("large.glb")).unwrap().set_len(LARGE).unwrap();
    let still: Vec<TcpStream> = (0..MOST_CONNECTIONS).map(|_| asks_for_much(&rig)).collect();
    assert_eq!(rig.get("/report.json").status, 200);
    // What the system still had on its way comes, but not the file. Not all have lost their places yet: that one has let the report through.
    let is_cut_off = |mut stream: &TcpStream| {
        let mut taken = Vec::new();
        let _ = stream.read_to_end(&mut taken);
        (taken.len() as u64) < LARGE
    };
    assert!(still.iter().any(is_cut_off));
}

#[test]
fn clients_that_read_slowly_get_all() {
    let rig = Rig::with(Duration::from_secs(3), false);
    std::fs::File::create(rig.out().join("large.glb")).unwrap().set_len(LARGE).unwrap();
    let (mut stream, mut piece, mut total) = (asks_for_much(&rig), vec![0; 1 << 20], 0);
    // This takes longer than a client may take nothing.
    while let count @ 1.. = stream.read(&mut piece).unwrap() {
        total += count as u64;
        thread::sleep(Duration::from_millis(100));
    }
    assert!(total > LARGE, "{total}");
}

#[test]
fn connections_that_stay_open_keep_no_new_one_waiting() {
    let rig = Rig::new();
    let mut open = Vec::new();
    for _ in 0..100 {
        let mut stream = TcpStream::connect(rig.address).unwrap();
        stream.write_all(b"HEAD /report.json HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        open.push(stream);
    }
    for mut stream in open.iter() {
        let mut start = [0; 12];
        stream.read_exact(&mut start).unwrap();
        assert_eq!(&start, b"HTTP/1.1 200");
    }
}

#[test]
fn nonsense_does_not_end_the_server() {
    let rig = Rig::new();
    for nonsense in
        [&b"\r\n\r\n"[..], b"GET\r\n\r\n", b"\x16\x03\x01\x02\x00", b"GET / HTTP/9.9\r\n\r\n", &[0xff; 70_000]]
    {
        let mut stream = TcpStream::connect(rig.address).unwrap();
        let _ = stream.write_all(nonsense);
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let _ = stream.read_to_end(&mut Vec::new());
    }
    assert_eq!(rig.get("/report.json").status, 200);
}
