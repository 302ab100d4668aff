//! What the tests of the page have in common: terrains, the server, a map service, Chromium, and pictures of the page.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_gdt-batch");
pub(crate) const SHOWN: &str = "document.documentElement.dataset.state === 'shown'";
pub(crate) const FOUND: &str = "document.getElementById('point-facts').dataset.final === 'true' && \
                     document.getElementById('point-facts').children.length > 0";
/// The middle of the picture beside the panel, in a window of 1280 x 800 pixels.
pub(crate) const MIDDLE: [u32; 2] = [475, 400];
/// What makes vertices carry class and intensity.
pub(crate) const ATTRIBUTES: &str = "attributes = [\"classification\", \"intensity\"]";
/// Red points, side by side along each axis.
pub(crate) const SIDE: i64 = 70;

/// What a job with these points wrote.
pub(crate) struct Terrain {
    pub(crate) folder: TempDir,
}

/// Returns point number `i`, `j` of a rough grid in hundredths of a unit, so that no rounding is in the way. It is so flat that no point hides
/// another one.
pub(crate) fn point(i: i64, j: i64) -> [i64; 3] {
    let shift = |k: i64| (k * 7919).rem_euclid(131) - 65;
    [50_000_000 + 300 * i + shift(i * 31 + j), 480_000_000 + 300 * j + shift(j * 17 - i), 10_000 + (i * j) % 37]
}

/// Returns the class and the intensity of that point.
pub(crate) fn look(i: i64, j: i64) -> [i64; 2] {
    [2 + (i + j) % 4, (i * 900 + j) % 65_536]
}

/// Returns point number `i`, `j` of a grid in hundredths of a unit.
pub(crate) type PointAt<'a> = &'a dyn Fn(i64, i64) -> [i64; 3];

/// As [`point`], 21 km wide.
pub(crate) fn far_point(i: i64, j: i64) -> [i64; 3] {
    let [x, y, z] = point(i, j);
    // Not on whole metres, so that coordinates have their two decimals.
    let odd = 1 + (31 * i + 17 * j) % 97;
    [50_000_000 + 100 * (x - 50_000_000) + odd, 480_000_000 + 100 * (y - 480_000_000) + odd, z]
}

pub(crate) fn text(hundredths: i64) -> String {
    format!("{}.{:02}", hundredths / 100, hundredths % 100)
}

impl Terrain {
    /// Runs a job with these options.
    pub(crate) fn new(input: &str, output: &str) -> Terrain {
        Terrain::of(&point, input, output)
    }

    /// Runs a job on the points of a grid with these options.
    pub(crate) fn of(point: PointAt, input: &str, output: &str) -> Terrain {
        let folder = tempfile::tempdir().unwrap();
        let mut cloud = String::from("x,y,z,red,green,blue,class,intensity\n");
        for (i, j) in (0..SIDE * SIDE).map(|n| (n / SIDE, n % SIDE)) {
            let ([x, y, z], [class, intensity]) = (point(i, j), look(i, j));
            cloud += &format!("{},{},{},230,40,30,{class},{intensity}\n", text(x), text(y), text(z));
        }
        std::fs::write(folder.path().join("cloud.csv"), cloud).unwrap();
        let config = format!(
            "[input]\nfiles = [\"cloud.csv\"]\n{input}\n[triangulation]\nmax_points_per_tile = 600\n\
             [output]\ndirectory = \"out\"\npage = true\nmax_points_per_level_tile = 600\n{output}\n"
        );
        std::fs::write(folder.path().join("job.toml"), config).unwrap();
        let terrain = Terrain { folder };
        terrain.succeeds(&["job.toml", "--quiet"]);
        terrain.succeeds(&["verify", "out", "--quiet"]);
        terrain
    }

    /// Returns the terrain of a job that writes to the folder of its inputs and its configuration.
    pub(crate) fn among_inputs() -> Terrain {
        let terrain = Terrain::new("", "format = \"3dtiles\"\nraster = { resolution = 5 }");
        let config = terrain.folder.path().join("job.toml");
        let text = std::fs::read_to_string(&config).unwrap().replace("directory = \"out\"", "directory = \".\"");
        std::fs::write(&config, text).unwrap();
        terrain.succeeds(&["job.toml", "--quiet"]);
        terrain
    }

    #[track_caller]
    pub(crate) fn succeeds(&self, arguments: &[&str]) {
        let output = Command::new(PROGRAM).args(arguments).current_dir(self.folder.path()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }

    pub(crate) fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Opens the page and does the steps. Returns what they gave.
    #[track_caller]
    pub(crate) fn seen(&self, chromium: &Path, steps: &Value) -> Value {
        let seen = self.opened(chromium, steps, None);
        assert_eq!(seen["complaints"], json!([]), "the console has errors");
        seen
    }

    /// The same. The page may ask `host` too, and the console may have errors.
    #[track_caller]
    pub(crate) fn opened(&self, chromium: &Path, steps: &Value, host: Option<&str>) -> Value {
        let server = Server::start(&self.out());
        let path = self.folder.path().join("steps.json");
        std::fs::write(&path, steps.to_string()).unwrap();
        let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/npm/page.mjs");
        let output = Command::new("node").arg(driver).arg(&server.url).arg(chromium).arg(path).output();
        let output = output.expect("node runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let seen: Value = serde_json::from_slice(&output.stdout).unwrap();
        let requests = seen["requests"].as_array().unwrap();
        let is_elsewhere = |url: &&Value| {
            let allowed = ["data:", "blob:", &server.url].into_iter().chain(host);
            !allowed.into_iter().any(|start| url.as_str().unwrap().starts_with(start))
        };
        assert!(!requests.is_empty());
        assert_eq!(requests.iter().find(is_elsewhere), None, "the page asks another host");
        seen
    }

    pub(crate) fn picture(&self) -> PathBuf {
        self.folder.path().join("shot.png")
    }
}

/// A running `gdt-batch view`.
pub(crate) struct Server {
    pub(crate) program: Child,
    pub(crate) url: String,
}

impl Server {
    pub(crate) fn start(out: &Path) -> Server {
        Server::with(out, &[])
    }

    /// The same, with more options.
    pub(crate) fn with(out: &Path, options: &[&str]) -> Server {
        let mut program = Command::new(PROGRAM)
            .args(["view", "--no-open", "--quiet"])
            .args(options)
            .arg(out)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(program.stdout.take().unwrap()).read_line(&mut line).unwrap();
        // With --quiet, the URL is all that is said.
        let url = line.trim_end().to_owned();
        assert!(url.starts_with("http://127.0.0.1:"), "{line}");
        Server { program, url }
    }

    /// Returns the head and the body of the answer to a request for the path `target`.
    pub(crate) fn answer(&self, target: &str) -> (String, Vec<u8>) {
        let host = self.url.trim_start_matches("http://").trim_end_matches('/');
        let mut stream = TcpStream::connect(host).unwrap();
        write!(stream, "GET {target} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        (String::from_utf8(answer[..end].to_vec()).unwrap(), answer[end + 4..].to_vec())
    }

    /// Returns the status of the answer to a request for the path `target`, letter by letter.
    pub(crate) fn status(&self, target: &str) -> u16 {
        let host = self.url.trim_start_matches("http://").trim_end_matches('/');
        let mut stream = TcpStream::connect(host).unwrap();
        write!(stream, "GET {target} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
        let mut line = String::new();
        BufReader::new(stream).read_line(&mut line).unwrap();
        line.split(' ').nth(1).unwrap().parse().unwrap()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

/// A map service that has blue images for all places up to a level, and none beyond it.
pub(crate) struct MapService {
    pub(crate) url: String,
}

impl MapService {
    pub(crate) const FINEST_LEVEL: u32 = 15;

    pub(crate) fn start() -> MapService {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/", listener.local_addr().unwrap());
        std::thread::spawn(move || listener.incoming().flatten().filter_map(MapService::answer).count());
        MapService { url }
    }

    /// Answers one request. What goes wrong with it, such as a browser that has gone, is the browser's matter.
    pub(crate) fn answer(mut stream: TcpStream) -> Option<()> {
        let lines = BufReader::new(&stream).lines().map_while(Result::ok).take_while(|line| !line.is_empty());
        let first = lines.reduce(|first, _| first)?;
        let level: u32 = first.split('/').nth(1)?.parse().ok()?;
        let image = if level <= MapService::FINEST_LEVEL { blue_image() } else { Vec::new() };
        let status = if image.is_empty() { "404 Not Found" } else { "200 OK" };
        let head = format!(
            "HTTP/1.1 {status}\r\nContent-Type: image/png\r\nContent-Length: {}\r\n\
             Access-Control-Allow-Origin: *\r\nConnection: close\r\n\r\n",
            image.len()
        );
        stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(&image)).ok()
    }
}

pub(crate) fn blue_image() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 256, 256);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[20, 40, 230].repeat(256 * 256)).unwrap();
    bytes
}

/// Returns the path of Chromium, or `None` if there is none. Under tests/run that is a failure.
pub(crate) fn chromium() -> Option<PathBuf> {
    let found = ["/usr/bin/chromium", "/usr/bin/chromium-browser"].map(PathBuf::from).into_iter().find(|p| p.exists());
    if found.is_none() {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no Chromium");
        eprintln!("not tested: no Chromium");
    }
    found
}

/// The steps of a user who goes near a point and clicks it, with a picture of the whole before.
pub(crate) fn steps_to(terrain: &Terrain, [x, y, _]: [i64; 3]) -> Value {
    let go = format!(
        "document.getElementById('tab-point').click(); document.getElementById('go-to').value = '{}, {}'; \
         document.querySelector('#go button').click()",
        text(x),
        text(y)
    );
    let facts = "document.getElementById('point-facts')";
    json!([
        {"size": [1280, 800], "dark": false},
        {"wait": SHOWN},
        {"shot": terrain.picture()},
        {"run": go},
        {"wait": format!("{FOUND} && {SHOWN}")},
        {"run": format!("{facts}.replaceChildren()")},
        {"click": MIDDLE},
        {"wait": FOUND},
        {"run": format!("[...{facts}.children].map((child) => child.textContent)")},
    ])
}

/// Returns the value that the page gives for a term in the last of `values`.
pub(crate) fn fact<'a>(seen: &'a Value, term: &str) -> &'a str {
    let facts = seen["values"].as_array().unwrap().last().unwrap().as_array().unwrap();
    let at = facts.iter().position(|fact| fact == term).unwrap_or_else(|| panic!("no {term} in {facts:?}"));
    facts[at + 1].as_str().unwrap()
}

/// Returns the pixels of a picture.
pub(crate) fn pixels(path: &Path) -> Vec<[u8; 3]> {
    let decoder = png::Decoder::new(BufReader::new(std::fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let pixels = bytes[..info.buffer_size()].chunks(info.color_type.samples());
    pixels.map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
}

/// Returns the share of the pixels of a picture whose `channel` is at least twice as bright as the two others.
pub(crate) fn share_of(channel: usize, path: &Path) -> f64 {
    let pixels = pixels(path);
    let is_strong = |pixel: &&[u8; 3]| {
        let other = |k: usize| pixel[(channel + k) % 3];
        pixel[channel] > 90 && pixel[channel] / 2 > other(1).max(other(2))
    };
    pixels.iter().filter(is_strong).count() as f64 / pixels.len() as f64
}

/// Returns the share of the pixels of a picture that are red, as the points are.
pub(crate) fn red_share(path: &Path) -> f64 {
    share_of(0, path)
}
