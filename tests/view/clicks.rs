//! Clicks, the ruler and walking: what the page tells of a place, and how it moves.

use std::path::Path;

use serde_json::{Value, json};

use crate::rig::*;

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

/// Returns the numbers of a row of CSV; an empty value is none.
fn numbers(row: &str) -> Vec<Option<f64>> {
    row.split(',').map(|value| value.parse().ok()).collect()
}

#[test]
fn the_ruler_shows_the_heights_along_it_and_files_can_be_saved() {
    let Some(chromium) = chromium() else { return };
    let terrain = Terrain::new("", "format = \"glb\"");
    let catch = "window.saved = []; const make = URL.createObjectURL; \
                 URL.createObjectURL = (blob) => { window.saved.push(blob); return make.call(URL, blob); }; \
                 document.getElementById('tab-point').click(); document.getElementById('ruler').click()";
    let picture = "window.saved[1].arrayBuffer().then((bytes) => btoa(String.fromCharCode(...new Uint8Array(bytes).slice(0, 24))))";
    let steps = json!([
        {"size": [1280, 800], "dark": false},
        {"wait": SHOWN},
        {"run": catch},
        {"click": [300, 400]},
        {"click": [650, 420]},
        {"wait": format!("{FOUND} && {SHOWN} && !document.getElementById('profile').hidden")},
        {"run": "document.getElementById('profile-save').click()"},
        {"run": "document.getElementById('picture').click()"},
        {"wait": "window.saved.length === 2"},
        {"run": "window.saved[0].text()"},
        {"run": picture},
        {"run": "[...document.querySelectorAll('#ruler-rows td')].map((cell) => cell.textContent)"},
        {"run": "document.getElementById('scale').textContent"},
    ]);
    let seen = terrain.seen(&chromium, &steps);
    let [csv, picture, cells, scale] = &seen["values"].as_array().unwrap()[3..] else { panic!("{seen}") };
    let mut lines = csv.as_str().unwrap().lines();
    assert_eq!(lines.next(), Some("distance,x,y,z"));
    let rows: Vec<Vec<Option<f64>>> = lines.map(numbers).collect();
    // The grid has a point every three metres: the line crosses many edges, and leaves no gap.
    assert!(rows.len() > 60, "{csv}");
    assert!(
        rows.windows(2).all(|two| two[0][0] <= two[1][0] && two[1][3].is_some_and(|z| (99.9..100.4).contains(&z))),
        "{csv}"
    );
    let [first, last] = [&rows[0], &rows[rows.len() - 1]].map(|row| [row[0], row[1], row[2]].map(Option::unwrap));
    let reach = (last[1] - first[1]).hypot(last[2] - first[2]);
    let told: f64 = cells[0].as_str().unwrap().trim_end_matches(" m").parse().unwrap();
    assert!((last[0] - reach).abs() < 0.05 && (told - reach).abs() < 0.05, "{last:?} {reach} {told}");
    // A PNG of the canvas: 950 x 800 pixels.
    assert!(picture.as_str().unwrap().starts_with("iVBORw0KGgoAAAANSUhEUg"), "{picture}");
    assert!(scale.as_str().unwrap().ends_with(" m"), "{scale}");
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
