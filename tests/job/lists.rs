//! Lists of point clouds as inputs: virtual point clouds, other documents of STAC, and texts.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::program::{Job, gdt_batch};

/// Returns rows of points from x = `x` on.
fn rows(x: usize) -> String {
    let row = |i: usize| format!("{}.{},{}.5,{}\n", x + i % 30, i % 7, i / 30, i % 13);
    (0..900).map(row).collect()
}

/// Returns an item of a list, of a cloud from x = `x` to x + 30.
fn item(name: &str, x: usize) -> Value {
    json!({
        "type": "Feature",
        "id": name,
        "bbox": [11, 48, 11, 48],
        "properties": {"proj:epsg": 25832, "proj:bbox": [x, 0, 0, x + 30, 30, 13], "pc:count": 900},
        "assets": {"data": {"href": format!("./clouds/{name}"), "roles": ["data"]}}
    })
}

fn list(items: &[Value]) -> String {
    json!({"type": "FeatureCollection", "stac_version": "1.0.0", "features": items, "links": []}).to_string()
}

/// Writes clouds of these names, which begin at x = 0, 30 and so on, each with and without an ending.
fn write_clouds(folder: &Path, names: &[&str]) {
    fs::create_dir_all(folder.join("clouds")).unwrap();
    for (index, name) in names.iter().enumerate() {
        for file in [name.to_string(), format!("{name}.csv")] {
            fs::write(folder.join("clouds").join(file), rows(30 * index)).unwrap();
        }
    }
}

fn results(report: &Value) -> &Value {
    assert!(report["file_list"].is_string());
    &report["file_list"]
}

#[test]
fn a_list_stands_for_its_files_and_those_outside_the_bounds_are_not_opened() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_clouds(root, &["a", "b"]);
    let [a, b] = ["a", "b"].map(|name| root.join(format!("clouds/{name}.csv")));
    let bounds = "bounds = [0.0, 0.0, 55.0, 30.0]";
    let expected = Job::on(&[&a, &b]).with("input", bounds).report();
    // An item without a usable box is opened.
    let mut nowhere = item("b", 30);
    nowhere["properties"]["proj:bbox"] = json!([30, null, 60, 30]);
    fs::write(root.join("nowhere.vpc"), list(&[item("a", 0), nowhere])).unwrap();
    let report = Job::on(&[root.join("nowhere.vpc")]).with("input", bounds).report();
    assert_eq!(results(&report), results(&expected));
    let warnings = report["warnings"].to_string();
    assert!(warnings.contains(r#"item \"b\" (number 2) has proj:bbox [30,null,60,30]"#), "{warnings}");
    // The third file is not there at all.
    let vpc = root.join("list.vpc");
    fs::write(&vpc, list(&[item("a", 0), item("b", 30), item("far", 60)])).unwrap();
    let report = Job::on(&[&vpc]).with("input", bounds).report();
    assert_eq!(results(&report), results(&expected));
    let warnings = report["warnings"].to_string();
    assert!(warnings.contains("list.vpc: 1 of its 3 files lie outside [input] bounds or clip"), "{warnings}");
    let check = Job::on(&[&vpc]).with("input", bounds).run_with(&["check", "--json"]).succeeded().json();
    assert_eq!(check["files"].as_array().unwrap().len(), 2);
    Job::on(&[&vpc]).run().refused(3, &["list.vpc: names", "clouds/far, which does not exist"]);
    let skipped = Job::on(&[&vpc]).with("input", "on_bad_file = \"skip\"").report();
    assert!(skipped["skipped"].to_string().contains("clouds/far"), "{skipped}");
    let apart = "bounds = [500.0, 0.0, 600.0, 30.0]";
    Job::on(&[&vpc])
        .with("input", apart)
        .run()
        .refused(2, &["list.vpc", "no point cloud of a list meets [input] bounds"]);
    // A text with their names is a list too, and a table of points is none.
    let text = root.join("tiles.txt");
    fs::write(&text, "# north to south\nclouds/a.csv\n\nclouds/b.csv\n").unwrap();
    assert_eq!(results(&Job::on(&[&text]).with("input", bounds).report()), results(&expected));
    let table = root.join("table.txt");
    fs::write(&table, rows(0) + &rows(30)).unwrap();
    assert_eq!(results(&Job::on(&[&table]).with("input", bounds).report()), results(&expected));
    // Commands take lists as well.
    let info = gdt_batch(root, &["info", "tiles.txt"]).succeeded().out;
    assert!(info.contains("a.csv") && info.contains("b.csv"), "{info}");
    gdt_batch(root, &["tiles.txt", "--quiet"]).succeeded();
    assert!(root.join("tiles-terrain/tileset.json").is_file());
    gdt_batch(root, &["verify", "tiles-terrain", "--input", "tiles.txt"]).succeeded();
    gdt_batch(root, &["init", "tiles.txt", "-o", "job.toml"]).succeeded();
    assert!(fs::read_to_string(root.join("job.toml")).unwrap().contains("files = [\"tiles.txt\"]"));
}

#[cfg(feature = "fault-injection")]
#[test]
fn an_interrupted_job_notices_a_list_that_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    write_clouds(folder.path(), &["a", "b", "c"]);
    let text = folder.path().join("tiles.txt");
    let interrupted = || {
        fs::write(&text, "clouds/a.csv\nclouds/b.csv\n").unwrap();
        let mut job = Job::on(&[&text]).tiles_of(500).variable("GDT_FAULT", "signal-merge:1");
        assert_eq!(job.run().code, 1);
        job.calm();
        job
    };
    let job = interrupted();
    fs::write(&text, "# the same files\nclouds/a.csv\nclouds/b.csv\n").unwrap();
    assert!(job.run().succeeded().err.contains("continuing"));
    let job = interrupted();
    fs::write(&text, "clouds/a.csv\nclouds/b.csv\nclouds/c.csv\n").unwrap();
    let said = job.run().succeeded();
    assert!(said.err.contains("c.csv (new)") && said.err.contains("starting over"), "{}", said.err);
}

#[test]
fn what_is_wrong_with_a_list_is_named_with_its_item() {
    let folder = tempfile::tempdir().unwrap();
    let vpc = folder.path().join("list.vpc");
    let refused = |text: &str, words: &[&str]| {
        fs::write(&vpc, text).unwrap();
        Job::on(&[&vpc]).run().refused(3, words);
    };
    refused("{", &["list.vpc: is not a readable JSON list of point clouds"]);
    refused(&list(&[]), &["list.vpc: is a list that names no point cloud"]);
    let mut number = item("north", 0);
    number["assets"]["data"]["href"] = 5.into();
    refused(&list(&[item("south", 0), number]), &["list.vpc: item 2 is not a readable item of STAC"]);
    let mut image = item("north", 0);
    image["assets"] = json!({"data": {"href": "north.tif", "roles": ["data"]}});
    refused(&list(&[image]), &["list.vpc: item \"north\": has no asset that is a point cloud"]);
}

#[cfg(feature = "remote")]
#[test]
fn a_catalogue_by_url_leads_to_clouds_by_url() {
    use crate::web_server::WebServer;
    let folder = tempfile::tempdir().unwrap();
    write_clouds(folder.path(), &["a", "b"]);
    let [a, b] = ["a", "b"].map(|name| folder.path().join(format!("clouds/{name}.csv")));
    let expected = Job::on(&[&a, &b]).report();
    let link = |rel: &str, href: &str| json!({"rel": rel, "href": href});
    let catalogue =
        json!({"type": "Catalog", "links": [link("self", "catalog.json"), link("child", "east/collection.json")]});
    let collection =
        json!({"type": "Collection", "links": [link("root", "../catalog.json"), link("items", "items?limit=1")]});
    let page = |name: &str, links: Value| {
        let mut item = item(name, 0);
        item["assets"]["data"]["href"] = format!("../clouds/{name}?sign=SECRET").into();
        json!({"type": "FeatureCollection", "features": [item], "links": links}).to_string().into_bytes()
    };
    let server = WebServer::of(&[
        ("/s/catalog.json", catalogue.to_string().into_bytes()),
        ("/s/east/collection.json", collection.to_string().into_bytes()),
        ("/s/east/items", page("a", json!([link("next", "more.json")]))),
        ("/s/east/more.json", page("b", json!([]))),
        ("/s/clouds/a", rows(0).into_bytes()),
        ("/s/clouds/b", rows(30).into_bytes()),
        ("/s/tiles.txt", b"clouds/a\n".to_vec()),
        ("/s/list.txt", b"# of texts\nb.csv\n../s/a.csv\n".to_vec()),
        ("/s/a.csv", rows(0).into_bytes()),
        ("/s/b.csv", rows(30).into_bytes()),
    ]);
    let report = Job::on(&[server.url("/s/catalog.json")]).report();
    assert_eq!(results(&report), results(&expected));
    assert!(!report.to_string().contains("SECRET"));
    assert!(server.requests().iter().any(|request| request.target == "/s/clouds/b?sign=SECRET"));
    assert_eq!(results(&Job::on(&[server.url("/s/list.txt")]).report()), results(&Job::on(&[&b, &a]).report()));
    let said = Job::on(&[server.url("/s/none.vpc")]).run();
    said.refused(2, &["there is no file", "/s/none.vpc"]);
}
