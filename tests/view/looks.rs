//! How the terrain looks: exaggeration, links to a view, the ground, missing tiles, images, and every way to colour it.

use std::path::Path;

use serde_json::{Value, json};

use crate::rig::*;

/// Sets the slider `id`, as a hand does.
fn slide(id: &str, value: f64) -> String {
    format!(
        "{{ const slider = document.getElementById('{id}'); slider.value = {value}; \
         slider.dispatchEvent(new Event('input', {{bubbles: true}})); }}"
    )
}

/// Waits until the address has followed the view, and no more tiles come: one that is there may ask for finer ones in a later frame.
fn settled() -> [Value; 2] {
    let still = format!(
        "new Promise((resolve) => {{ let [drawn, frames, since] = ['', 0, Date.now()]; const look = () => {{ \
         const now = document.getElementById('shown').textContent; \
         if (now !== drawn || !({SHOWN})) [drawn, frames, since] = [now, 0, Date.now()]; \
         frames += 1; \
         if (frames > 20 && Date.now() - since > 800) resolve(); else requestAnimationFrame(look); }}; look(); }})"
    );
    [json!({"run": still}), json!({"wait": SHOWN})]
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
    let address = "[location.hash, history.length, document.getElementById('shown').textContent]";
    let mut steps = steps_to(&terrain, wanted).as_array().unwrap().clone();
    steps.extend([json!({"run": set}), json!({"run": go_again}), json!({"wait": format!("{FOUND} && {SHOWN}")})]);
    steps.push(json!({"run": "document.getElementById('point-facts').children[5].textContent"}));
    steps.extend(settled());
    steps.push(json!({"run": address}));
    // How fine the tiles are depends on what was loaded before, so pictures are of pages that come from the link alone.
    for name in ["linked.png", "again.png"] {
        steps.push(json!({"run": "window.isOld = true; location.reload()"}));
        steps.push(json!({"wait": format!("!window.isOld && {SHOWN}")}));
        steps.extend(settled());
        steps.push(json!({"run": address, "shot": shot(name)}));
    }
    let seen = terrain.seen(&chromium, &Value::Array(steps));
    let values = seen["values"].as_array().unwrap().iter().filter(|value| value.is_string() || value[1].is_u64());
    let [height, set, linked, again] = values.collect::<Vec<_>>()[..] else { panic!("{seen}") };
    let height: f64 = height.as_str().unwrap().parse().unwrap();
    assert!((height - wanted[2] as f64 / 100.0).abs() < 0.05, "{height} is exaggerated");
    for part in ["view=", "colours=height", "exaggeration=4", "sun=90,45"] {
        assert!(set[0].as_str().unwrap().contains(part), "{set}");
    }
    assert_eq!((linked, &linked[0], &linked[1]), (again, &set[0], &set[1]));
    let [same, other] = [shot("again.png"), terrain.picture()].map(|picture| differing(&shot("linked.png"), &picture));
    assert!(same < 100_000 && other > 500_000, "{same} pixels differ from the link, {other} from the first view");
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
fn a_job_can_give_its_page_the_images_of_a_map_service() {
    let Some(chromium) = chromium() else { return };
    let service = MapService::start();
    let output = format!("format = \"3dtiles\"\nimagery = \"{}{{z}}/{{x}}/{{-y}}.png\"", service.url);
    let terrain = Terrain::new("crs = \"EPSG:26910\"", &output);
    let points = terrain.folder.path().join("points.png");
    let steps = json!([
        {"size": [1280, 800], "dark": false},
        {"wait": format!("document.getElementById('attribution').textContent.includes('Images') && {SHOWN}"), "shot": terrain.picture()},
        {"run": "location.hash"},
        {"run": "location.hash = 'images=none'"},
        {"wait": format!("!document.getElementById('attribution').textContent.includes('Images') && {SHOWN}"), "shot": points},
    ]);
    let seen = terrain.opened(&chromium, &steps, Some(&service.url));
    assert!(
        !seen["values"][0].as_str().unwrap().contains("images"),
        "what the page is written with is no part of its address: {seen}"
    );
    let [draped, without] = [terrain.picture(), points].map(|path| share_of(2, &path));
    assert!(draped > 0.2 && without < 0.01, "{draped} and {without} of the pictures are blue");
}

#[test]
fn a_lake_is_blue_where_colours_stand_for_heights() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("", "format = \"3dtiles\"\ncolor = \"elevation\"");
    let shot = |name: &str| terrain.folder.path().join(name);
    let look = |name: &str| {
        let steps = json!([{"size": [1280, 800], "dark": false}, {"wait": SHOWN}, {"shot": shot(name)}, {"run": "document.getElementById('legend').textContent"}]);
        terrain.seen(&chromium, &steps)["values"][0].as_str().unwrap().to_owned()
    };
    let legend = look("land.png");
    assert!(legend.contains("Height") && !legend.contains("water"), "{legend}");
    let shore =
        [[500_040, 4_800_040], [500_170, 4_800_040], [500_170, 4_800_170], [500_040, 4_800_170], [500_040, 4_800_040]];
    let shore = shore.map(|[x, y]| json!([x, y, 99.5]));
    let lake = json!({"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [shore]}});
    std::fs::write(shot("lake.geojson"), lake.to_string()).unwrap();
    let config = std::fs::read_to_string(shot("job.toml")).unwrap();
    let lines = "[[breaklines]]\nfiles = [\"lake.geojson\"]\nkind = \"lake\"\ncrs = \"points\"\n";
    std::fs::write(shot("job.toml"), format!("{config}{lines}")).unwrap();
    terrain.succeeds(&["job.toml", "--quiet"]);
    let legend = look("lake.png");
    assert!(legend.contains("water"), "{legend}");
    // Level water has the light of level ground, which changes no colour.
    let is_blue =
        |pixel: &[u8; 3]| [72, 132, 204].into_iter().zip(pixel).all(|(wanted, value)| value.abs_diff(wanted) < 12);
    let [land, lake] = ["land.png", "lake.png"].map(|name| {
        let pixels = pixels(&shot(name));
        pixels.iter().filter(|pixel| is_blue(pixel)).count() as f64 / pixels.len() as f64
    });
    assert!(land < 0.001 && lake > 0.1, "{land} and {lake} of the picture are blue");
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
