//! `gdt-batch view` and its page, as a user meets them: a job writes the terrain and the page, the program serves it, and a headless
//! Chromium opens it, clicks, and reads what the page says.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

const PROGRAM: &str = env!("CARGO_BIN_EXE_gdt-batch");
const SHOWN: &str = "document.documentElement.dataset.state === 'shown'";
const FOUND: &str = "document.getElementById('point-facts').dataset.final === 'true' && \
                     document.getElementById('point-facts').children.length > 0";
/// The middle of the picture beside the panel, in a window of 1280 x 800 pixels.
const MIDDLE: [u32; 2] = [475, 400];
/// What makes vertices carry class and intensity.
const ATTRIBUTES: &str = "attributes = [\"classification\", \"intensity\"]";
/// Red points, side by side along each axis.
const SIDE: i64 = 70;

/// What a job with these points wrote.
struct Terrain {
    folder: TempDir,
}

/// Returns point number `i`, `j` of a rough grid in hundredths of a unit, so that no rounding is in the way. It is so flat that no point hides
/// another one.
fn point(i: i64, j: i64) -> [i64; 3] {
    let shift = |k: i64| (k * 7919).rem_euclid(131) - 65;
    [50_000_000 + 300 * i + shift(i * 31 + j), 480_000_000 + 300 * j + shift(j * 17 - i), 10_000 + (i * j) % 37]
}

/// Returns the class and the intensity of that point.
fn look(i: i64, j: i64) -> [i64; 2] {
    [2 + (i + j) % 4, (i * 900 + j) % 65_536]
}

/// Returns point number `i`, `j` of a grid in hundredths of a unit.
type PointAt<'a> = &'a dyn Fn(i64, i64) -> [i64; 3];

/// As [`point`], 21 km wide.
fn far_point(i: i64, j: i64) -> [i64; 3] {
    let [x, y, z] = point(i, j);
    // Not on whole metres, so that coordinates have their two decimals.
    let odd = 1 + (31 * i + 17 * j) % 97;
    [50_000_000 + 100 * (x - 50_000_000) + odd, 480_000_000 + 100 * (y - 480_000_000) + odd, z]
}

fn text(hundredths: i64) -> String {
    format!("{}.{:02}", hundredths / 100, hundredths % 100)
}

impl Terrain {
    /// Runs a job with these options.
    fn new(input: &str, output: &str) -> Terrain {
        Terrain::of(&point, input, output)
    }

    /// Runs a job on the points of a grid with these options.
    fn of(point: PointAt, input: &str, output: &str) -> Terrain {
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
    fn among_inputs() -> Terrain {
        let terrain = Terrain::new("", "format = \"3dtiles\"\nraster = { resolution = 5 }");
        let config = terrain.folder.path().join("job.toml");
        let text = std::fs::read_to_string(&config).unwrap().replace("directory = \"out\"", "directory = \".\"");
        std::fs::write(&config, text).unwrap();
        terrain.succeeds(&["job.toml", "--quiet"]);
        terrain
    }

    #[track_caller]
    fn succeeds(&self, arguments: &[&str]) {
        let output = Command::new(PROGRAM).args(arguments).current_dir(self.folder.path()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Opens the page and does the steps. Returns what they gave.
    #[track_caller]
    fn seen(&self, chromium: &Path, steps: &Value) -> Value {
        let seen = self.opened(chromium, steps, None);
        assert_eq!(seen["complaints"], json!([]), "the console has errors");
        seen
    }

    /// The same. The page may ask `host` too, and the console may have errors.
    #[track_caller]
    fn opened(&self, chromium: &Path, steps: &Value, host: Option<&str>) -> Value {
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

    fn picture(&self) -> PathBuf {
        self.folder.path().join("shot.png")
    }
}

/// A running `gdt-batch view`.
struct Server {
    program: Child,
    url: String,
}

impl Server {
    fn start(out: &Path) -> Server {
        let mut program = Command::new(PROGRAM)
            .args(["view", "--no-open", "--quiet"])
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

    /// Returns the status of the answer to a request for the path `target`, letter by letter.
    fn status(&self, target: &str) -> u16 {
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
struct MapService {
    url: String,
}

impl MapService {
    const FINEST_LEVEL: u32 = 15;

    fn start() -> MapService {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/", listener.local_addr().unwrap());
        std::thread::spawn(move || listener.incoming().flatten().filter_map(MapService::answer).count());
        MapService { url }
    }

    /// Answers one request. What goes wrong with it, such as a browser that has gone, is the browser's matter.
    fn answer(mut stream: TcpStream) -> Option<()> {
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

fn blue_image() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 256, 256);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[20, 40, 230].repeat(256 * 256)).unwrap();
    bytes
}

/// Returns the path of Chromium, or `None` if there is none. Under tests/run that is a failure.
fn chromium() -> Option<PathBuf> {
    let found = ["/usr/bin/chromium", "/usr/bin/chromium-browser"].map(PathBuf::from).into_iter().find(|p| p.exists());
    if found.is_none() {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no Chromium");
        eprintln!("not tested: no Chromium");
    }
    found
}

/// The steps of a user who goes near a point and clicks it, with a picture of the whole before.
fn steps_to(terrain: &Terrain, [x, y, _]: [i64; 3]) -> Value {
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
fn fact<'a>(seen: &'a Value, term: &str) -> &'a str {
    let facts = seen["values"].as_array().unwrap().last().unwrap().as_array().unwrap();
    let at = facts.iter().position(|fact| fact == term).unwrap_or_else(|| panic!("no {term} in {facts:?}"));
    facts[at + 1].as_str().unwrap()
}

/// Returns the pixels of a picture.
fn pixels(path: &Path) -> Vec<[u8; 3]> {
    let decoder = png::Decoder::new(BufReader::new(std::fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let pixels = bytes[..info.buffer_size()].chunks(info.color_type.samples());
    pixels.map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
}

/// Returns the share of the pixels of a picture whose `channel` is at least twice as bright as the two others.
fn share_of(channel: usize, path: &Path) -> f64 {
    let pixels = pixels(path);
    let is_strong = |pixel: &&[u8; 3]| {
        let other = |k: usize| pixel[(channel + k) % 3];
        pixel[channel] > 90 && pixel[channel] / 2 > other(1).max(other(2))
    };
    pixels.iter().filter(is_strong).count() as f64 / pixels.len() as f64
}

/// Returns the share of the pixels of a picture that are red, as the points are.
fn red_share(path: &Path) -> f64 {
    share_of(0, path)
}

/// Asserts that the page draws the terrain, and that a click tells the coordinates of the source.
#[track_caller]
fn tells_the_source(terrain: &Terrain, point: PointAt, chromium: &Path) {
    for (i, j) in [(20, 33), (51, 8)] {
        let wanted = point(i, j);
        let seen = terrain.seen(chromium, &steps_to(terrain, wanted));
        let share = red_share(&terrain.picture());
        assert!(share > 0.1, "{share} of the picture is terrain");
        let exact = wanted.map(text).join(", ");
        assert!(fact(&seen, "nearest corner").starts_with(&format!("{exact} (")), "{exact}: {seen}");
        let [class, intensity] = look(i, j).map(|value| value.to_string());
        assert_eq!(fact(&seen, "class of that corner"), class);
        assert_eq!(fact(&seen, "intensity of that corner"), intensity);
        // The place itself is as near as pixels are.
        for (term, value) in ["x (m)", "y (m)"].into_iter().zip(wanted) {
            let told: f64 = fact(&seen, term).parse().unwrap();
            assert!((told - value as f64 / 100.0).abs() < 0.3, "{term} {told}");
        }
    }
}

#[test]
fn a_click_on_the_globe_tells_the_coordinates_of_the_source() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("crs = \"EPSG:26910\"", &format!("format = \"3dtiles\"\n{ATTRIBUTES}"));
    let tileset: Value = serde_json::from_slice(&std::fs::read(terrain.out().join("tileset.json")).unwrap()).unwrap();
    assert!(tileset["root"]["transform"].is_array(), "it is on the globe, and has levels");
    tells_the_source(&terrain, &point, &chromium);
}

/// The scene of a wide terrain follows the curve of the earth: the places clicked lie some metres below the plane of the source.
#[test]
fn a_click_on_a_curved_scene_tells_the_coordinates_of_the_source() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::of(&far_point, "crs = \"EPSG:26910\"", &format!("format = \"3dtiles\"\n{ATTRIBUTES}"));
    let tileset: Value = serde_json::from_slice(&std::fs::read(terrain.out().join("tileset.json")).unwrap()).unwrap();
    assert!(tileset["asset"]["extras"]["curvature"].is_object());
    tells_the_source(&terrain, &far_point, &chromium);
}

#[test]
fn one_file_without_a_reference_system_is_shown_too() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("", &format!("format = \"glb\"\n{ATTRIBUTES}"));
    assert!(!terrain.out().join("tileset.json").exists());
    tells_the_source(&terrain, &point, &chromium);
}

/// The steps of a user who does not wait between the places of the ruler, and makes a double click.
fn ruler_steps() -> Value {
    let set_up = "document.querySelector('[value=height]').click(); document.getElementById('tab-point').click(); \
                  document.getElementById('ruler').click()";
    let cells = "[...document.querySelectorAll('#ruler-rows td')].map((cell) => cell.textContent)";
    json!([
        {"size": [1280, 800], "dark": true},
        {"wait": SHOWN},
        {"run": set_up},
        {"click": [400, 400]},
        {"double": MIDDLE},
        {"wait": format!("{FOUND} && {SHOWN}")},
        {"run": cells},
    ])
}

#[test]
fn a_double_click_is_one_place_of_the_ruler_and_heights_have_their_own_unit() {
    let Some(chromium) = chromium() else { return };
    // Feet in the plane, metres upward.
    let terrain = Terrain::new("crs = \"EPSG:2992+5703\"\noutside_crs_area = \"warn\"", "format = \"3dtiles\"");
    let seen = terrain.seen(&chromium, &ruler_steps());
    let cells: Vec<String> = serde_json::from_value(seen["values"][1].clone()).unwrap();
    let [flat, up, direct, slope] = cells.as_slice() else { panic!("two places make one line: {cells:?}") };
    assert!(flat.ends_with(" ft)") && !up.contains('(') && !direct.contains('(') && slope.ends_with('°'), "{cells:?}");
}

#[test]
fn a_tileset_of_another_program_is_told_apart() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("", "format = \"3dtiles\"");
    let path = terrain.out().join("tileset.json");
    let mut tileset: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    tileset["asset"].as_object_mut().unwrap().remove("extras");
    std::fs::write(&path, tileset.to_string()).unwrap();
    let steps = json!([
        {"size": [800, 600], "dark": false},
        {"wait": "document.documentElement.dataset.state === 'failed'"},
        {"run": "document.getElementById('message').textContent"},
    ]);
    let said = terrain.seen(&chromium, &steps)["values"][0].as_str().unwrap().to_owned();
    assert!(said.contains("tileset.json does not say where it lies") && !said.contains("undefined"), "{said}");
}

/// A key that is released while Ctrl is down, or while another window has the keys, is not taken as held.
#[test]
fn walking_ends_with_the_key_whatever_else_is_pressed() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("", "format = \"glb\"");
    let key = |kind: &str, more: &str| {
        format!(
            "document.getElementById('terrain').dispatchEvent(new KeyboardEvent('{kind}', {{key: 'ArrowLeft', code: 'ArrowLeft'{more}}}))"
        )
    };
    let wait = |ms: u32| json!({"run": format!("new Promise((resolve) => setTimeout(resolve, {ms}))")});
    let shot = |name: &str| terrain.folder.path().join(name);
    let mut steps = vec![json!({"size": [500, 400], "dark": false}), json!({"wait": SHOWN})];
    steps.push(json!({"run": "document.querySelector('[value=walk]').click()"}));
    let releases = [key("keyup", ", ctrlKey: true"), "window.dispatchEvent(new Event('blur'))".into()];
    for (number, release) in releases.into_iter().enumerate() {
        steps.extend([wait(600), json!({"shot": shot(&format!("{number}-still.png"))})]);
        steps.extend([json!({"run": key("keydown", "")}), wait(300), json!({"run": release}), wait(600)]);
        steps.extend([json!({"shot": shot(&format!("{number}-turned.png"))}), wait(400)]);
        steps.push(json!({"shot": shot(&format!("{number}-after.png"))}));
    }
    terrain.seen(&chromium, &Value::Array(steps));
    for number in 0..2 {
        let [still, turned, after] =
            ["still", "turned", "after"].map(|name| std::fs::read(shot(&format!("{number}-{name}.png"))).unwrap());
        assert!(still != turned, "the key does something");
        assert!(turned == after, "it goes on after release {number}");
    }
}

/// Sets the slider `id`, as a hand does.
fn slide(id: &str, value: f64) -> String {
    format!(
        "{{ const slider = document.getElementById('{id}'); slider.value = {value}; \
         slider.dispatchEvent(new Event('input', {{bubbles: true}})); }}"
    )
}

/// Waits until the address has followed the view.
fn settled() -> [Value; 2] {
    [json!({"run": "new Promise((resolve) => setTimeout(resolve, 800))"}), json!({"wait": SHOWN})]
}

/// Returns how many pixels beside the panel differ between two pictures of a window that is 1280 pixels wide.
fn differing(one: &Path, other: &Path) -> usize {
    let pairs = pixels(one).into_iter().zip(pixels(other)).enumerate().filter(|(i, _)| i % 1280 < 950);
    pairs.filter(|(_, (a, b))| (0..3).any(|k| a[k].abs_diff(b[k]) > 8)).count()
}

#[test]
fn exaggerated_heights_are_told_as_they_are_and_a_link_shows_the_same() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("crs = \"EPSG:26910\"", "format = \"3dtiles\"");
    let wanted = point(20, 33);
    let shot = |name: &str| terrain.folder.path().join(name);
    let set =
        slide("exaggeration", 4.0) + &slide("sun-azimuth", 90.0) + "document.querySelector('[value=height]').click();";
    // The page goes to the point again: the exaggeration has moved it out of the middle.
    let go_again =
        "document.getElementById('point-facts').replaceChildren(); document.querySelector('#go button').click()";
    let address = "[location.hash, history.length]";
    let mut steps = steps_to(&terrain, wanted).as_array().unwrap().clone();
    steps.extend([json!({"run": set}), json!({"run": go_again}), json!({"wait": format!("{FOUND} && {SHOWN}")})]);
    steps.push(json!({"run": "document.getElementById('point-facts').children[5].textContent"}));
    steps.extend(settled());
    steps.push(json!({"run": address, "shot": shot("linked.png")}));
    steps.push(json!({"run": "window.isOld = true; location.reload()"}));
    steps.push(json!({"wait": format!("!window.isOld && {SHOWN}")}));
    steps.extend(settled());
    steps.push(json!({"run": address, "shot": shot("again.png")}));
    let seen = terrain.seen(&chromium, &Value::Array(steps));
    let values = seen["values"].as_array().unwrap().iter().filter(|value| value.is_string() || value[1].is_u64());
    let [height, linked, again] = values.collect::<Vec<_>>()[..] else { panic!("{seen}") };
    let height: f64 = height.as_str().unwrap().parse().unwrap();
    assert!((height - wanted[2] as f64 / 100.0).abs() < 0.05, "{height} is exaggerated");
    for part in ["view=", "colours=height", "exaggeration=4", "sun=90,45"] {
        assert!(linked[0].as_str().unwrap().contains(part), "{linked}");
    }
    assert_eq!(linked, again);
    // The ring around the point is no part of the view, and how fine the tiles are depends on what was loaded before. A page that does not
    // follow the link shows the first view.
    let [same, other] = [shot("again.png"), terrain.picture()].map(|picture| differing(&shot("linked.png"), &picture));
    assert!(4 * same < 3 * other && other > 500_000, "{same} pixels differ from the link, {other} from the first view");
}

#[test]
fn the_wheel_stops_above_the_ground() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("", "format = \"glb\"");
    let turn = "document.getElementById('terrain').dispatchEvent(new WheelEvent('wheel', \
                {deltaY: -400, clientX: 400, clientY: 400, bubbles: true, cancelable: true}))";
    let wheel = format!(
        "(async () => {{ for (let i = 0; i < 80; i += 1) {{ {turn}; await new Promise((next) => setTimeout(next, 10)); }} }})()"
    );
    // The camera turns around a place far below the ground, and comes nearer to it.
    let look_down = "location.hash = 'view=0,60,1,0,-300,0'";
    let mut steps =
        vec![json!({"size": [1280, 800], "dark": false}), json!({"wait": SHOWN}), json!({"run": look_down})];
    steps.extend(settled());
    steps.push(json!({"run": wheel}));
    steps.extend(settled());
    steps.push(json!({"shot": terrain.picture()}));
    terrain.seen(&chromium, &Value::Array(steps));
    // Below the ground is nothing; the panel takes a quarter of the window.
    let share = red_share(&terrain.picture());
    assert!(share > 0.6, "{share} of the picture is terrain");
}

#[test]
fn a_tile_that_is_missing_is_named_and_another_one_stands_in_for_it() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("crs = \"EPSG:26910\"", "format = \"3dtiles\"");
    for tile in std::fs::read_dir(terrain.out().join("tiles")).unwrap() {
        std::fs::remove_file(tile.unwrap().path()).unwrap();
    }
    // A place is exact, or would be: its tile is asked for.
    let mut steps = steps_to(&terrain, point(20, 33)).as_array().unwrap().clone();
    let said = "document.getElementById('message').textContent";
    steps.push(json!({"wait": format!("{said}.includes('cannot be loaded')"), "run": said, "shot": terrain.picture()}));
    let seen = terrain.opened(&chromium, &Value::Array(steps), None);
    let said = seen["values"].as_array().unwrap().last().unwrap().as_str().unwrap();
    assert!(said.contains("tiles/0000") && said.contains("404"), "{said}");
    let share = red_share(&terrain.picture());
    assert!(share > 0.3, "{share} of the picture is terrain");
}

#[test]
fn images_of_a_map_service_cover_the_terrain_once_the_user_names_it() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("crs = \"EPSG:26910\"", "format = \"3dtiles\"");
    let service = MapService::start();
    let name = |template: &str| {
        format!(
            "document.getElementById('images-url').value = '{}{template}'; document.querySelector('#images button').click()",
            service.url
        )
    };
    let steps = json!([
        {"size": [1280, 800], "dark": false},
        {"wait": SHOWN},
        {"run": name("{z}/{x}.png")},
        {"run": "document.getElementById('images-hint').textContent", "shot": terrain.folder.path().join("without.png")},
        {"run": name("{z}/{x}/{-y}.png")},
        {"wait": format!("document.getElementById('attribution').textContent.includes('Images') && {SHOWN}"), "shot": terrain.picture()},
        {"run": "location.hash"},
    ]);
    let seen = terrain.opened(&chromium, &steps, Some(&service.url));
    assert!(seen["values"][1].as_str().unwrap().contains("{y}"), "a template without y is refused: {seen}");
    assert!(seen["values"][3].as_str().unwrap().contains("images=http"), "{seen}");
    let [before, after] = [terrain.folder.path().join("without.png"), terrain.picture()].map(|path| share_of(2, &path));
    assert!(before < 0.01 && after > 0.2, "{before} and {after} of the picture are blue");
}

#[test]
fn every_way_to_look_draws_something_else() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("", "format = \"3dtiles\"");
    let mut steps = vec![json!({"size": [390, 844], "dark": true}), json!({"wait": SHOWN})];
    let ways = ["[value=points]", "[value=height]", "[value=slope]", "[value=levels]", "#edges", "[value=walk]"];
    let shot = |number: usize| terrain.folder.path().join(format!("{number}.png"));
    for (number, way) in ways.iter().enumerate() {
        steps.push(json!({"run": format!("document.querySelector('{way}').click()")}));
        steps.push(json!({"run": "new Promise((resolve) => setTimeout(resolve, 400))"}));
        steps.push(json!({"wait": SHOWN, "shot": shot(number)}));
    }
    terrain.seen(&chromium, &Value::Array(steps));
    let pictures: Vec<Vec<u8>> = (0..ways.len()).map(|number| std::fs::read(shot(number)).unwrap()).collect();
    for (number, picture) in pictures.iter().enumerate() {
        assert!(!pictures[..number].contains(picture), "{} changes nothing", ways[number]);
    }
}

#[test]
fn inputs_and_configurations_beside_the_results_are_not_served() {
    let terrain = Terrain::among_inputs();
    let folder = terrain.folder.path();
    for name in [".git/config", ".env", "tiles/notes.txt", "tiles/000999.glb"] {
        std::fs::create_dir_all(folder.join(name).parent().unwrap()).unwrap();
        std::fs::write(folder.join(name), "secret").unwrap();
    }
    let server = Server::start(folder);
    let results = [
        "/",
        "/index.html",
        "/tileset.json",
        "/tiles/000000.glb",
        "/terrain.tif",
        "/preview.png",
        "/preview.pgw",
        "/georeference.json",
        "/report.json",
    ];
    for target in results {
        assert_eq!(server.status(target), 200, "{target}");
    }
    let others = [
        "/job.toml",
        "/cloud.csv",
        "/.git/config",
        "/.env",
        "/%2eenv",
        "/tiles/notes.txt",
        "/tiles/000999.glb",
        "/out/tileset.json",
        "/tiles",
        "/tiles/",
        "/JOB.toml",
        "/tiles/../job.toml",
        "/tiles%2f..%2fjob.toml",
        "/.\\job.toml",
        "/XXH128SUMS",
    ];
    for target in others {
        assert_eq!(server.status(target), 404, "{target}");
    }
}

#[test]
fn the_page_beside_the_tiles_opens_what_the_job_wrote() {
    let terrain = Terrain::new("", "format = \"glb\"");
    let page = std::fs::read_to_string(terrain.out().join("index.html")).unwrap();
    assert!(page.contains("data-terrain=\"terrain.glb\""));
    let sums = std::fs::read_to_string(terrain.out().join("XXH128SUMS")).unwrap();
    assert!(sums.contains("  index.html\n"));
    // A job without a page takes away the page of the job before.
    let config = terrain.folder.path().join("job.toml");
    let without = std::fs::read_to_string(&config).unwrap().replace("page = true\n", "");
    std::fs::write(&config, &without).unwrap();
    terrain.succeeds(&["job.toml", "--quiet"]);
    assert!(!terrain.out().join("index.html").exists());
    // But not that of somebody else, and it does not write over it.
    std::fs::write(terrain.out().join("index.html"), "<title>My survey</title>").unwrap();
    terrain.succeeds(&["job.toml", "--quiet"]);
    std::fs::write(&config, without.replace("[output]", "[output]\npage = true")).unwrap();
    let refused = Command::new(PROGRAM).arg(&config).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", String::from_utf8_lossy(&refused.stderr));
    assert_eq!(std::fs::read_to_string(terrain.out().join("index.html")).unwrap(), "<title>My survey</title>");
}
