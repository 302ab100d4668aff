//! The writers, on small meshes in tiles.

use crate::{
    LengthUnit, Mesh, MeshSource, ObjOffset, Output, SystemNames, TileSurface, TooManyVertices, Units, VertexNumbers,
    write_dxf, write_landxml, write_obj, write_ply,
};
use lattice::Lattice;
use proptest::prelude::*;
use rust_decimal::Decimal;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use sys::Result;

/// A mesh in memory.
#[derive(Default)]
struct InMemory {
    vertices: Vec<[i32; 3]>,
    triangles: Vec<[u32; 3]>,
    has_colors: bool,
}

/// Returns a colour that tells the number of its vertex.
fn color(number: u64) -> [u8; 3] {
    [number as u8, 255 - number as u8, 7]
}

fn range(range: Range<u64>) -> Range<usize> {
    range.start as usize..range.end as usize
}

impl MeshSource for InMemory {
    fn vertices(&self, numbers: Range<u64>) -> Result<Vec<[i32; 3]>> {
        Ok(self.vertices[range(numbers)].to_vec())
    }

    fn triangles(&self, numbers: Range<u64>) -> Result<Vec<[u32; 3]>> {
        Ok(self.triangles[range(numbers)].to_vec())
    }

    fn colors(&self, numbers: Range<u64>) -> Result<Option<Vec<[u8; 3]>>> {
        Ok(self.has_colors.then(|| numbers.map(color).collect()))
    }
}

fn height(x: i32, y: i32) -> i32 {
    (x * 7 + y * 13) % 11 - 5
}

/// Returns the triangles of the squares of a grid, by the places of their corners. Every other one is clockwise.
fn squares(columns: Range<i32>, rows: Range<i32>) -> Vec<[[i32; 3]; 3]> {
    let place = |x, y| [x, y, height(x, y)];
    let square = |(x, y)| {
        let [a, b, c, d] = [place(x, y), place(x + 1, y), place(x + 1, y + 1), place(x, y + 1)];
        [[a, b, c], [a, d, c]]
    };
    rows.flat_map(|y| columns.clone().map(move |x| (x, y))).flat_map(square).collect()
}

/// Returns a tile as a file has it: some positions more than once.
fn tile(triangles: &[[[i32; 3]; 3]]) -> TileSurface {
    let positions: Vec<[i32; 3]> = triangles.iter().flatten().copied().collect();
    let corners: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
    TileSurface::new(&positions, &corners)
}

fn numbered(tiles: &[TileSurface]) -> std::result::Result<(InMemory, VertexNumbers), TooManyVertices> {
    let (mut mesh, mut numbers) = (InMemory::default(), VertexNumbers::default());
    for tile in tiles {
        let more = numbers.add(tile)?;
        mesh.vertices.extend(more.new_vertices);
        mesh.triangles.extend(more.triangles);
    }
    Ok((mesh, numbers))
}

fn two_tiles() -> [TileSurface; 2] {
    [tile(&squares(0..3, 0..4)), tile(&squares(3..5, 0..4))]
}

fn twice_area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[test]
fn a_shared_border_is_numbered_once() {
    let (mesh, numbers) = numbered(&two_tiles()).unwrap();
    let summary = numbers.summary();
    assert_eq!((summary.vertices, summary.triangles, summary.twice_area), (6 * 5, 2 * 5 * 4, 2 * 5 * 4));
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (30, 40));
    assert_eq!(mesh.vertices.iter().collect::<BTreeSet<_>>().len(), 30, "each once");
    assert_eq!(summary.bounds, [[0, 0, -5], [5, 4, 5]]);
    // Euler's formula for a disc: edges are counted twice, but for those along the border.
    let border = numbers.border_edges();
    assert_eq!(border, 2 * (5 + 4));
    let edges = (3 * 40 + border) / 2;
    assert_eq!(30 + 40, edges + 1);
    for triangle in &mesh.triangles {
        let corner = |v: u32| [0, 1].map(|axis| f64::from(mesh.vertices[v as usize][axis]));
        assert!(twice_area(triangle.map(corner)) > 0.0, "{triangle:?} is clockwise");
    }
    // All that later tiles may have are the vertices of the border.
    assert_eq!(numbers.held(), border);
}

#[test]
fn vertices_that_are_closed_in_are_forgotten() {
    // Rings around a tile: whatever comes, only the border is held.
    let cell = |x: i32, y: i32| tile(&squares(x..x + 1, y..y + 1));
    let tiles: Vec<TileSurface> = (0..400).map(|n| cell(n % 20, n / 20)).collect();
    let (mesh, numbers) = numbered(&tiles).unwrap();
    assert_eq!((mesh.vertices.len(), numbers.held(), numbers.border_edges()), (21 * 21, 80, 80));
}

proptest! {
    /// In a grid two fans may meet in a vertex and look the same from it: they must not count as closed.
    #[test]
    fn any_cut_into_tiles_gives_the_same_mesh(of in prop::collection::vec(0usize..5, 2 * 36), gaps: u64) {
        let all = squares(0..6, 0..6);
        let kept = (0..).zip(&all).filter(|(n, _)| gaps >> (n % 64) & 1 == 0 || n % 3 > 0);
        let mut tiles: BTreeMap<usize, Vec<[[i32; 3]; 3]>> = BTreeMap::new();
        let mut expected = BTreeSet::new();
        for ((n, triangle), tile) in kept.zip(&of) {
            let _: i32 = n;
            tiles.entry(*tile).or_default().push(*triangle);
            let mut sorted = *triangle;
            sorted.sort_unstable();
            expected.insert(sorted);
        }
        let tiles: Vec<TileSurface> = tiles.values().map(|triangles| tile(triangles)).collect();
        let (mesh, _) = numbered(&tiles).unwrap();
        prop_assert_eq!(mesh.vertices.iter().collect::<BTreeSet<_>>().len(), mesh.vertices.len());
        let found: BTreeSet<[[i32; 3]; 3]> = mesh.triangles.iter().map(|triangle| {
            let mut sorted = triangle.map(|v| mesh.vertices[v as usize]);
            sorted.sort_unstable();
            sorted
        }).collect();
        prop_assert_eq!(found, expected);
        prop_assert_eq!(mesh.triangles.len(), tiles.iter().map(|tile| tile.triangles.len()).sum::<usize>());
    }
}

fn lattice() -> Lattice {
    let offset = [Decimal::new(63_700_125, 2), Decimal::new(8_510_000, 1), Decimal::new(4_000, 1)];
    Lattice::new(offset, Decimal::new(25, 2), Decimal::new(1, 2)).unwrap()
}

/// Returns what `write` writes of the two tiles, with a breakline.
fn file(write: impl Fn(&Mesh, &mut Output) -> Result<()>) -> Vec<u8> {
    file_of(write, false)
}

fn file_of(write: impl Fn(&Mesh, &mut Output) -> Result<()>, has_colors: bool) -> Vec<u8> {
    let (source, numbers) = numbered(&two_tiles()).unwrap();
    let source = InMemory { has_colors, ..source };
    let lattice = lattice();
    let lines = [vec![[0, 0, height(0, 0)], [1, 1, height(1, 1)], [2, 2, height(2, 2)]]];
    let mesh = Mesh {
        source: &source,
        summary: numbers.summary(),
        lattice: &lattice,
        units: Units {
            plane: LengthUnit::UsFoot,
            plane_name: "US survey foot".into(),
            height_name: "US survey foot".into(),
        },
        system: SystemNames { name: Some("A & B".into()), code: Some(2992), ..SystemNames::default() },
        lines: &lines,
        copyright: Some("(c) Größe"),
    };
    let mut bytes = Vec::new();
    write(&mesh, &mut |more: &[u8]| {
        bytes.extend_from_slice(more);
        Ok(())
    })
    .unwrap();
    bytes
}

fn text(write: impl Fn(&Mesh, &mut Output) -> Result<()>) -> String {
    String::from_utf8(file(write)).unwrap()
}

/// Returns the places of the mesh in source coordinates, in the order of their numbers.
fn places() -> Vec<[f64; 3]> {
    let (mesh, _) = numbered(&two_tiles()).unwrap();
    let source = |place: &[i32; 3]| [0, 1, 2].map(|axis| lattice().world(axis, place[axis]));
    mesh.vertices.iter().map(source).collect()
}

fn triangles() -> Vec<[u32; 3]> {
    numbered(&two_tiles()).unwrap().0.triangles
}

fn numbers<T: std::str::FromStr<Err: std::fmt::Debug>>(line: &str) -> Vec<T> {
    line.split(' ').map(|number| number.parse().unwrap()).collect()
}

#[test]
fn ply_has_all_places_and_faces() {
    let bytes = file(write_ply);
    let end = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let head = std::str::from_utf8(&bytes[..end]).unwrap();
    assert!(head.contains("element vertex 30\n") && head.contains("element face 40\n"), "{head}");
    assert!(head.contains("comment CRS: A & B (EPSG:2992)\n") && head.contains("comment unit: US survey foot\n"));
    assert!(head.contains("comment copyright: (c) Gr??e\n"), "{head}");
    let (vertices, faces) = bytes[end..].split_at(30 * 24);
    let double = |at: &[u8]| f64::from_le_bytes(at.try_into().unwrap());
    let found: Vec<[f64; 3]> =
        vertices.chunks(24).map(|place| [0, 8, 16].map(|at| double(&place[at..at + 8]))).collect();
    assert_eq!(found, places());
    assert_eq!(faces.len(), 40 * 13);
    let corner = |at: &[u8]| u32::from_le_bytes(at.try_into().unwrap());
    let found: Vec<[u32; 3]> = faces.chunks(13).map(|face| [1, 5, 9].map(|at| corner(&face[at..at + 4]))).collect();
    assert_eq!(found, triangles());
    assert!(faces.chunks(13).all(|face| face[0] == 3));
}

#[test]
fn ply_has_the_colours_of_vertices_if_there_are_any() {
    let [plain, colored] = [false, true].map(|has_colors| file_of(write_ply, has_colors));
    let split = |bytes: &[u8]| {
        let end = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
        (String::from_utf8_lossy(&bytes[..end]).into_owned(), bytes[end..].to_vec())
    };
    let ((head, body), (_, plain_body)) = (split(&colored), split(&plain));
    let properties = "double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 40\n";
    assert!(head.contains(properties), "{head}");
    let (vertices, faces) = body.split_at(30 * 27);
    let (plain_vertices, plain_faces) = plain_body.split_at(30 * 24);
    assert_eq!(faces, plain_faces);
    for (number, (vertex, plain)) in (0..).zip(vertices.chunks(27).zip(plain_vertices.chunks(24))) {
        assert_eq!((&vertex[..24], &vertex[24..]), (plain, &color(number)[..]));
    }
}

#[test]
fn a_new_vertex_knows_where_it_came_from() {
    let (mut numbers, squares) = (VertexNumbers::default(), squares(0..3, 0..2));
    let positions: Vec<[i32; 3]> = squares.iter().flatten().copied().collect();
    let tile = numbers.add(&tile(&squares)).unwrap();
    let origins = tile.origins.iter().map(|&origin| positions[origin as usize]);
    assert!(origins.eq(tile.new_vertices.iter().copied()));
}

#[test]
fn obj_counts_from_its_offset() {
    let whole = |mesh: &Mesh, out: &mut Output| write_obj(mesh, ObjOffset::of(mesh)?, out);
    let text = text(whole);
    assert!(text.contains("# offset: add 637002 851000 0 to x y z"), "{text}");
    assert!(text.contains("z is up") && text.contains("# copyright: (c) Größe\n"));
    let lines = |start: &'static str| text.lines().filter_map(move |line| line.strip_prefix(start));
    let back = |local: Vec<f64>| [local[0] + 637_002.0, local[1] + 851_000.0, local[2]];
    assert_eq!(lines("v ").map(|line| back(numbers(line))).collect::<Vec<_>>(), places());
    let corners = |line: &str| numbers::<u32>(line).iter().map(|n| n - 1).collect::<Vec<_>>();
    assert_eq!(lines("f ").map(corners).collect::<Vec<_>>(), triangles());
}

#[test]
fn landxml_has_northings_first() {
    let text = text(write_landxml);
    for part in [
        "<Imperial areaUnit=\"squareFoot\" linearUnit=\"USSurveyFoot\"",
        "name=\"A &amp; B\" epsgCode=\"2992\"",
        "<Definition surfType=\"TIN\" area2DSurf=\"1.25\" elevMax=\"400.05\" elevMin=\"399.95\">",
        "<Breakline brkType=\"standard\"><PntList3D>851000 637001.25 399.95 851000.25 637001.5 400.04 \
         851000.5 637001.75 400.02</PntList3D></Breakline>",
        "<Project name=\"terrain\" desc=\"(c) Größe\"/>",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    let point = |(number, line): (usize, &str)| {
        let (id, place) = line.strip_prefix("<P id=\"")?.strip_suffix("</P>")?.split_once("\">")?;
        assert_eq!(id, (number + 1).to_string());
        let place: Vec<f64> = numbers(place);
        Some([place[1], place[0], place[2]])
    };
    let points = text.lines().filter(|line| line.starts_with("<P id"));
    assert_eq!(points.enumerate().filter_map(point).collect::<Vec<_>>(), places());
    let face = |line: &str| {
        let face: Vec<u32> = numbers(line.strip_prefix("<F>")?.strip_suffix("</F>")?);
        Some([face[0] - 1, face[1] - 1, face[2] - 1])
    };
    assert_eq!(text.lines().filter_map(face).collect::<Vec<_>>(), triangles());
}

#[test]
fn dxf_has_faces_and_lines() {
    let text = text(write_dxf);
    let lines: Vec<&str> = text.lines().collect();
    let groups: Vec<(&str, &str)> = lines.chunks(2).map(|pair| (pair[0].trim(), pair[1])).collect();
    let entities: Vec<&[(&str, &str)]> = groups.chunk_by(|_, next| next.0 != "0").collect();
    let place = |groups: &[(&str, &str)], first: usize| {
        let value = |code: usize| groups.iter().find(|(found, _)| *found == code.to_string()).unwrap().1;
        [first, first + 10, first + 20].map(|code| value(code).parse::<f64>().unwrap())
    };
    let faces = entities.iter().filter(|entity| entity[0].1 == "3DFACE");
    let faces: Vec<[[f64; 3]; 4]> = faces.map(|face| [10, 11, 12, 13].map(|code| place(face, code))).collect();
    let (places, triangles) = (places(), triangles());
    let expected = triangles.iter().map(|[a, b, c]| [a, b, c, c].map(|corner| places[*corner as usize]));
    assert_eq!(faces, expected.collect::<Vec<_>>());
    let line: Vec<[f64; 3]> =
        entities.iter().filter(|entity| entity[0].1 == "VERTEX").map(|vertex| place(vertex, 10)).collect();
    assert_eq!(
        line,
        [[637_001.25, 851_000.0, 399.95], [637_001.5, 851_000.25, 400.04], [637_001.75, 851_000.5, 400.02]]
    );
    let after = |name: &str| groups.iter().position(|group| *group == ("9", name)).unwrap() + 1;
    assert_eq!(groups[after("$INSUNITS")], ("70", "21"));
    assert_eq!(groups[after("$EXTMAX")..][..3], [("10", "637002.5"), ("20", "851001"), ("30", "400.05")]);
}
