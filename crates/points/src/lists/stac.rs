//! Documents of STAC, the SpatioTemporal Asset Catalog, of which a virtual point cloud (`.vpc`) is one: items with files (assets), collections
//! of items, and links to further documents.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Deserialize;
use serde_json::Value;
use serde_json::value::RawValue;

use crate::ept::name::EPT;
use crate::lists::listed_cloud::{ListedBox, ListedCloud, is_cloud, name_in, place_of};
use crate::remote::WholeRequest;
use crate::remote::name::{address, is_remote};
use sys::{Error, Result, interrupt};

/// The most bytes of a document of another machine.
const MOST: u64 = 1 << 28;

/// About as many bytes has a document.
const ABOUT: u64 = 1 << 16;

/// Numbers that JSON does not have, but some programs write.
const NO_JSON: [&str; 3] = ["NaN", "-Infinity", "Infinity"];

/// The most characters of a value that a message shows.
const MOST_SHOWN: usize = 80;

/// The most documents of a list, and the most links from the first to the last of them.
const MOST_DOCUMENTS: usize = 1_000_000;
const DEEPEST: usize = 32;

/// A document. Which of its parts there are depends on its `type`.
#[derive(Deserialize)]
struct Document {
    #[serde(rename = "type", default)]
    kind: String,
    #[serde(default)]
    id: Value,
    /// Each is parsed alone, so that messages name it.
    #[serde(default)]
    features: Vec<Box<RawValue>>,
    #[serde(default)]
    properties: Option<Properties>,
    #[serde(default)]
    assets: BTreeMap<String, Asset>,
    #[serde(default)]
    links: Vec<Link>,
    /// Only the index of an EPT has it.
    #[serde(rename = "hierarchyType", default)]
    hierarchy: Option<String>,
}

#[derive(Deserialize)]
struct Item {
    #[serde(default)]
    id: Value,
    #[serde(default)]
    properties: Option<Properties>,
    #[serde(default)]
    assets: BTreeMap<String, Asset>,
}

#[derive(Deserialize)]
struct Properties {
    #[serde(rename = "proj:epsg", default)]
    epsg: Value,
    #[serde(rename = "proj:code", default)]
    code: Value,
    #[serde(rename = "proj:wkt2", default)]
    wkt: Value,
    #[serde(rename = "proj:bbox", default)]
    bounds: Value,
}

#[derive(Deserialize)]
struct Asset {
    href: String,
    #[serde(default)]
    roles: Option<Vec<String>>,
}

#[derive(Deserialize)]
struct Link {
    #[serde(default)]
    rel: String,
    #[serde(default)]
    href: String,
    #[serde(default)]
    method: Option<String>,
}

/// Returns the clouds of the document at `path` and of those that it leads to.
pub(super) fn clouds_of(path: &Path) -> Result<Vec<ListedCloud>> {
    let reader = Reader { documents: AtomicUsize::new(0) };
    reader.clouds_of(path, &[])
}

struct Reader {
    /// The number of documents that have been read.
    documents: AtomicUsize,
}

impl Reader {
    /// Returns the clouds of a document that the documents at `above` lead to.
    fn clouds_of(&self, path: &Path, above: &[PathBuf]) -> Result<Vec<ListedCloud>> {
        let mut clouds = Vec::new();
        let mut way = [above, &[path.to_path_buf()]].concat();
        let mut next = Some(path.to_path_buf());
        while let Some(path) = next.take() {
            interrupt::check()?;
            let document = self.read(&path)?;
            clouds.extend(document.clouds(&path)?);
            let leads_to = document.leads_to(&path)?;
            if !leads_to.is_empty() && way.len() > DEEPEST {
                return Err(Error::input(&path, format!("is {DEEPEST} links away from the list: name it directly")));
            }
            if let Some(circle) = leads_to.iter().find(|place| way.contains(place)) {
                let what = format!("leads back to {}, which leads to it", circle.display());
                return Err(Error::input(&path, what));
            }
            // In parallel, because each takes a request, and in their order.
            let below = leads_to.par_iter().map(|place| self.clouds_of(place, &way)).collect::<Result<Vec<_>>>()?;
            clouds.extend(below.into_iter().flatten());
            next = document.next(&path)?;
            if let Some(next) = &next {
                if way.contains(next) {
                    return Err(Error::input(&path, format!("has the next page {}, which was before", next.display())));
                }
                way.push(next.clone());
            }
        }
        Ok(clouds)
    }

    fn read(&self, path: &Path) -> Result<Document> {
        if self.documents.fetch_add(1, Ordering::Relaxed) >= MOST_DOCUMENTS {
            let what = format!("is one of more than {MOST_DOCUMENTS} documents of a list: divide the list");
            return Err(Error::input(path, what));
        }
        match is_remote(path) {
            false => parsed(path, &std::fs::read(path).map_err(Error::io("read", path))?),
            true => {
                let url = address(&path.to_string_lossy())?;
                let request = WholeRequest::new(path, &url, MOST, ABOUT);
                let missing = || Error::Config(format!("there is no file {}", path.display()));
                parsed(path, request.fetch(false)?.ok_or_else(missing)?.bytes())
            }
        }
    }
}

/// Returns the document with the text `bytes`, also if it has numbers that JSON does not have but some programs write.
fn parsed(path: &Path, bytes: &[u8]) -> Result<Document> {
    let document = serde_json::from_slice(bytes).or_else(|error| match without_nan(bytes) {
        Some(bytes) => serde_json::from_slice(&bytes),
        None => Err(error),
    });
    document.map_err(|error| {
        Error::input(path, format!("is not a readable JSON list of point clouds (STAC or VPC): {error}"))
    })
}

/// Returns a text with `null` in the places of `NaN` and `Infinity`; `None` if it has neither.
fn without_nan(text: &[u8]) -> Option<Vec<u8>> {
    let mut rest = text;
    let (mut replaced, mut has_found, mut is_in_string) = (Vec::with_capacity(text.len()), false, false);
    while let [first, ..] = rest {
        let word = NO_JSON.iter().find(|word| !is_in_string && rest.starts_with(word.as_bytes()));
        let taken = match (first, word) {
            (_, Some(word)) => word.len(),
            (b'\\', _) => 2.min(rest.len()),
            _ => 1,
        };
        is_in_string ^= *first == b'"';
        has_found |= word.is_some();
        replaced.extend_from_slice(if word.is_some() { b"null" } else { &rest[..taken] });
        rest = &rest[taken..];
    }
    has_found.then_some(replaced)
}

impl Document {
    /// Returns the clouds of the items that are in the document itself.
    fn clouds(&self, path: &Path) -> Result<Vec<ListedCloud>> {
        let mut clouds = Vec::new();
        match self.kind.as_str() {
            "FeatureCollection" => {
                for (number, text) in (1..).zip(&self.features) {
                    let item: Item = serde_json::from_str(text.get()).map_err(|error| {
                        Error::input(path, format!("item {number} is not a readable item of STAC: {error} of the item"))
                    })?;
                    add_clouds(path, (&item.id, number), &item.properties, &item.assets, &mut clouds)?;
                }
            }
            "Feature" => add_clouds(path, (&self.id, 1), &self.properties, &self.assets, &mut clouds)?,
            "Collection" | "Catalog" => {}
            _ if self.hierarchy.is_some() => {
                return Err(Error::input(
                    path,
                    format!("is the index of an EPT: rename it to {EPT}, its original name"),
                ));
            }
            _ => {
                let what = "is JSON, but not a list of point clouds: neither a virtual point cloud (VPC) nor an item, an item collection, \
                            a collection or a catalogue of STAC";
                return Err(Error::input(path, what));
            }
        }
        Ok(clouds)
    }

    /// Returns the documents whose clouds belong to this one.
    fn leads_to(&self, path: &Path) -> Result<Vec<PathBuf>> {
        if !["Collection", "Catalog"].contains(&self.kind.as_str()) {
            return Ok(Vec::new());
        }
        // Servers list the same items as links and as pages.
        let has_pages = self.links.iter().any(|link| link.rel == "items");
        let is_wanted = |link: &&Link| match link.rel.as_str() {
            "items" | "child" => true,
            "item" => !has_pages,
            _ => false,
        };
        self.links.iter().filter(is_wanted).map(|link| link.place(path)).collect()
    }

    /// Returns the next page of a list.
    fn next(&self, path: &Path) -> Result<Option<PathBuf>> {
        let Some(link) = self.links.iter().find(|link| link.rel == "next") else { return Ok(None) };
        if link.method.as_ref().is_some_and(|method| !method.eq_ignore_ascii_case("get")) {
            let what = "has a next page that needs a POST request, which is not supported: name the items of a collection instead";
            return Err(Error::input(path, what));
        }
        link.place(path).map(Some)
    }
}

impl Link {
    fn place(&self, path: &Path) -> Result<PathBuf> {
        place_of(path, &self.href).map_err(|what| Error::input(path, format!("has a link \"{}\": {what}", self.rel)))
    }
}

/// Adds the clouds of an item, of which a message tells its id, or its number from 1 on.
fn add_clouds(
    path: &Path,
    (id, number): (&Value, usize),
    properties: &Option<Properties>,
    assets: &BTreeMap<String, Asset>,
    clouds: &mut Vec<ListedCloud>,
) -> Result<()> {
    let item = if id.is_null() { format!("item {number}") } else { format!("item {id}") };
    let refused = |what: String| Error::input(path, format!("{item}: {what}"));
    let hrefs = cloud_assets(assets);
    if hrefs.is_empty() {
        let what = "has no asset that is a point cloud: none ends with .las, .laz or ept.json, or has the role \"data\" and no other ending";
        return Err(refused(what.into()));
    }
    let (claim, unusable_box) = match properties.as_ref().map_or(Ok(None), Properties::claim) {
        Ok(claim) => (claim, None),
        Err(what) => (None, Some(format!("{item} (number {number}) has {what}"))),
    };
    for href in hrefs {
        let path = place_of(path, href).map_err(refused)?;
        clouds.push(ListedCloud { path, claim: claim.clone(), unusable_box: unusable_box.clone() });
    }
    Ok(())
}

/// Returns the assets that are point clouds, by their names. Of the same cloud in several formats it returns one.
fn cloud_assets(assets: &BTreeMap<String, Asset>) -> Vec<&str> {
    let named: Vec<&str> = assets.values().map(|asset| asset.href.as_str()).filter(|href| is_cloud(href)).collect();
    if named.is_empty() {
        let is_data = |asset: &&Asset| asset.roles.iter().flatten().any(|role| role == "data");
        // The file of a download may have no ending, and an image has another one.
        let may_be_cloud = |href: &&str| !name_in(href).contains('.');
        return assets.values().filter(is_data).map(|asset| asset.href.as_str()).filter(may_be_cloud).collect();
    }
    // An octree can be read in part.
    let rank = |href: &str| {
        let name = name_in(href);
        [".copc.laz", ".laz", ".las"].iter().position(|ending| name.ends_with(ending)).unwrap_or(3)
    };
    let mut by_stem: BTreeMap<String, &str> = BTreeMap::new();
    for href in named.iter().filter(|href| rank(href) < 3) {
        let name = name_in(href);
        let stem = name.trim_end_matches(".las").trim_end_matches(".laz").trim_end_matches(".copc").to_string();
        by_stem
            .entry(stem)
            .and_modify(|known| *known = if rank(href) < rank(known) { href } else { known })
            .or_insert(href);
    }
    match by_stem.is_empty() {
        true => named.into_iter().take(1).collect(),
        false => by_stem.into_values().collect(),
    }
}

impl Properties {
    /// Returns where the item lies in its own system, if it says both.
    ///
    /// # Errors
    /// Says what it has instead of a box, or of a system.
    fn claim(&self) -> std::result::Result<Option<ListedBox>, String> {
        let [code, wkt] =
            [&self.code, &self.wkt].map(|value| value.as_str().map(str::trim).filter(|text| !text.is_empty()));
        let crs = code.map(str::to_string).or_else(|| epsg_code(&self.epsg)).or_else(|| wkt.map(str::to_string));
        if self.bounds.is_null() {
            return Ok(None);
        }
        let bounds = box_in(&self.bounds).ok_or_else(|| format!("proj:bbox {}", shown(&self.bounds)))?;
        let systems = [("proj:code", &self.code), ("proj:epsg", &self.epsg), ("proj:wkt2", &self.wkt)];
        match (crs, systems.into_iter().find(|(_, value)| !value.is_null())) {
            (Some(crs), _) => Ok(Some(ListedBox { crs: Arc::from(crs), bounds })),
            (None, Some((name, value))) => Err(format!("{name} {}", shown(value))),
            (None, None) => Ok(None),
        }
    }
}

/// Returns the code of a system, which is a number, or its digits.
fn epsg_code(value: &Value) -> Option<String> {
    let number = value.as_u64().or_else(|| value.as_str()?.trim().parse().ok());
    number.and_then(|number| u32::try_from(number).ok()).map(|number| format!("EPSG:{number}"))
}

/// Returns the least x and y and the greatest of a box of two or three dimensions.
fn box_in(value: &Value) -> Option<[f64; 4]> {
    let numbers: Vec<f64> = value.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    let bounds = match numbers[..] {
        [xmin, ymin, xmax, ymax] | [xmin, ymin, _, xmax, ymax, _] => [xmin, ymin, xmax, ymax],
        _ => return None,
    };
    let is_box = bounds[0] <= bounds[2] && bounds[1] <= bounds[3] && bounds.iter().all(|number| number.is_finite());
    is_box.then_some(bounds)
}

/// Returns the beginning of a value, for messages.
fn shown(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(MOST_SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sys::ErrorKind;

    const ITEM: &str = r#"{"type": "Feature", "id": "tile-1", "properties": {"proj:epsg": 2056, "proj:bbox": [1, 2, 3, 4, 5, 6], "pc:count": 7},
        "assets": {"data": {"href": "./tile.copc.laz", "roles": ["data"]}, "again": {"href": "tile.laz"}, "image": {"href": "a.png"}}}"#;

    /// Writes documents, and returns what the first one names, by paths from their folder.
    fn clouds(documents: &[(&str, &str)]) -> Result<Vec<(String, Option<ListedBox>)>> {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in documents {
            std::fs::create_dir_all(folder.path().join(name).parent().unwrap()).unwrap();
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let short = |cloud: ListedCloud| {
            let path = cloud.path.strip_prefix(folder.path()).map(Path::to_path_buf).unwrap_or(cloud.path);
            (path.to_string_lossy().into_owned(), cloud.claim)
        };
        let found = clouds_of(&folder.path().join(documents[0].0));
        Ok(found?.into_iter().map(short).collect())
    }

    fn names(documents: &[(&str, &str)]) -> Vec<String> {
        clouds(documents).unwrap().into_iter().map(|(name, _)| name).collect()
    }

    #[test]
    fn an_item_names_its_cloud_and_where_it_lies() {
        let found = clouds(&[("item.json", ITEM)]).unwrap();
        let claim = ListedBox { crs: "EPSG:2056".into(), bounds: [1.0, 2.0, 4.0, 5.0] };
        assert_eq!(found, [("tile.copc.laz".to_string(), Some(claim))]);
        let claim = |properties: &str| {
            let item = ITEM.replace(r#""proj:epsg": 2056, "proj:bbox": [1, 2, 3, 4, 5, 6]"#, properties);
            clouds(&[("item.json", &item)]).unwrap().remove(0).1
        };
        let wkt = claim(r#""proj:epsg": null, "proj:wkt2": "PROJCRS[]", "proj:bbox": [1, 2, 3, 4]"#).unwrap();
        assert_eq!((&*wkt.crs, wkt.bounds), ("PROJCRS[]", [1.0, 2.0, 3.0, 4.0]));
        assert_eq!(&*claim(r#""proj:code": "EPSG:25832", "proj:bbox": [1, 2, 3, 4]"#).unwrap().crs, "EPSG:25832");
        for nothing in [
            r#""proj:epsg": 2056"#,
            r#""proj:bbox": [1, 2, 3, 4]"#,
            r#""proj:epsg": 2056, "proj:bbox": [3, 2, 1, 4]"#,
            r#""proj:epsg": 2056, "proj:bbox": [1, 2, 3]"#,
        ] {
            assert_eq!(claim(nothing), None, "{nothing}");
        }
        assert_eq!(&*claim(r#""proj:epsg": "25832", "proj:bbox": [1, 2, 3, 4]"#).unwrap().crs, "EPSG:25832");
    }

    #[test]
    fn a_box_that_cannot_be_used_is_told_with_its_item() {
        let unusable = |properties: &str| {
            let item = ITEM.replace(r#""proj:epsg": 2056, "proj:bbox": [1, 2, 3, 4, 5, 6]"#, properties);
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("l.vpc");
            let other = ITEM.replace("tile", "other");
            std::fs::write(&path, format!(r#"{{"type": "FeatureCollection", "features": [{other}, {item}]}}"#))
                .unwrap();
            let mut found = clouds_of(&path).unwrap();
            assert!(found[0].claim.is_some() && found[0].unusable_box.is_none());
            found.remove(1).unusable_box
        };
        let item = r#"item "tile-1" (number 2) has "#;
        for (bounds, shown) in [
            ("[3, 2, 1, 4]", "[3,2,1,4]"),
            ("[1, 2, 3]", "[1,2,3]"),
            ("[1, NaN, 3, Infinity]", "[1,null,3,null]"),
            ("[1, null, 3, 4]", "[1,null,3,4]"),
            ("\"a NaN\"", "\"a NaN\""),
            ("{}", "{}"),
        ] {
            let found = unusable(&format!(r#""proj:epsg": 2056, "proj:bbox": {bounds}"#)).unwrap();
            assert_eq!(found, format!("{item}proj:bbox {shown}"));
        }
        let found = unusable(r#""proj:epsg": -7, "proj:bbox": [1, 2, 3, 4]"#).unwrap();
        assert_eq!(found, format!("{item}proj:epsg -7"));
        for fine in [r#""proj:bbox": null"#, r#""proj:epsg": null, "proj:bbox": [1, 2, 3, 4]"#, r#""proj:epsg": "x""#] {
            assert_eq!(unusable(fine), None, "{fine}");
        }
    }

    #[test]
    fn assets_are_clouds_by_their_endings_or_their_role() {
        let of = |assets: &str| {
            let assets: BTreeMap<String, Asset> = serde_json::from_str(assets).unwrap();
            cloud_assets(&assets).into_iter().map(str::to_string).collect::<Vec<_>>()
        };
        let both = r#"{"a": {"href": "x/1.laz"}, "b": {"href": "y/1.copc.laz"}, "c": {"href": "2.LAS?key=1"}, "d": {"href": "e/ept.json"}}"#;
        assert_eq!(of(both), ["y/1.copc.laz", "2.LAS?key=1"]);
        assert_eq!(
            of(r#"{"ept.json": {"href": "https://host/e/ept.json"}, "meta": {"href": "m.json"}}"#),
            ["https://host/e/ept.json"]
        );
        assert_eq!(
            of(
                r#"{"d": {"href": "https://host/get?id=1", "roles": ["data"]}, "t": {"href": "t.tif", "roles": ["data"]}}"#
            ),
            ["https://host/get?id=1"]
        );
        assert_eq!(of(r#"{"d": {"href": "https://host/get", "roles": null}}"#), [""; 0]);
    }

    #[test]
    fn collections_lead_to_items_and_pages_to_the_next() {
        let item = |name: &str| {
            ITEM.replace("./tile.copc.laz", &format!("../{name}.copc.laz")).replace("tile.laz", &format!("{name}.laz"))
        };
        let catalogue = r#"{"type": "Catalog", "id": "c", "links": [{"rel": "self", "href": "catalog.json"}, {"rel": "child", "href": "a/b.json"},
            {"rel": "item", "href": "./i/3.json"}]}"#;
        let collection = r#"{"type": "Collection", "links": [{"rel": "root", "href": "../catalog.json"}, {"rel": "item", "href": "../i/1.json"},
            {"rel": "items", "href": "pages/1.json"}]}"#;
        let page = |name: &str, next: &str| {
            format!(r#"{{"type": "FeatureCollection", "features": [{}], "links": [{next}]}}"#, item(name))
        };
        let first = page("one", r#"{"rel": "next", "href": "2.json", "method": "GET"}"#);
        let documents = [
            ("catalog.json", catalogue),
            ("a/b.json", collection),
            ("a/pages/1.json", &first),
            ("a/pages/2.json", &page("two", "")),
            ("i/3.json", &item("three")),
        ];
        assert_eq!(names(&documents), ["a/pages/../one.copc.laz", "a/pages/../two.copc.laz", "i/../three.copc.laz"]);
    }

    #[test]
    fn errors_name_the_list_and_the_item() {
        let error = |documents: &[(&str, &str)]| {
            let error = clouds(documents).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Input, "{error}");
            error.to_string()
        };
        let empty = r#"{"type": "FeatureCollection", "features": [{"type": "Feature", "id": "a", "assets": {}}]}"#;
        assert!(error(&[("l.vpc", empty)]).contains("l.vpc: item \"a\": has no asset that is a point cloud"));
        let unnamed = empty.replace(r#""id": "a", "#, "");
        assert!(error(&[("l.vpc", &unnamed)]).contains("item 1: has no asset"));
        let number =
            format!(r#"{{"type": "FeatureCollection", "features": [{ITEM}, {}]}}"#, ITEM.replace(r#""a.png""#, "5"));
        assert!(
            error(&[("l.vpc", &number)]).contains("item 2 is not a readable item of STAC: invalid type: integer `5`")
        );
        let ftp = ITEM.replace("./tile.copc.laz", "ftp://host/tile.copc.laz");
        assert!(error(&[("l.json", &ftp)]).contains("item \"tile-1\": files can be read by https://"));
        assert!(error(&[("l.json", "{\"type\": 1}")]).contains("at line 1 column"));
        assert!(error(&[("l.json", "{}")]).contains("not a list of point clouds"));
        assert!(error(&[("l.json", r#"{"hierarchyType": "json"}"#)]).contains("rename it to ept.json"));
        let circle = r#"{"type": "Catalog", "links": [{"rel": "child", "href": "l.json"}]}"#;
        assert!(error(&[("l.json", circle)]).contains("leads back to"));
        let next = r#"{"type": "FeatureCollection", "links": [{"rel": "next", "href": "l.json"}]}"#;
        assert!(error(&[("l.json", next)]).contains("which was before"));
        let post = next.replace(r#""href""#, r#""method": "POST", "href""#);
        assert!(error(&[("l.json", &post)]).contains("POST"));
    }
}
