//! The bytes of a tile: quantized-mesh 1.0, with normals and the water mask.

use crate::header::{Header, circle};
use crate::mesh::{LAST, Node, TileMesh};
use crate::normals::{BorderNormal, normals};
use crate::place::HEIGHT_STEPS;
use crate::tile::Tile;
use crate::water::Water;

/// A step of heights that all tiles of a zoom can be written with: a power of two of the steps of [`Node`]s. Heights on borders are rounded to it, so that
/// neighbours have the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeightSteps(i64);

impl HeightSteps {
    /// Returns the step for tiles whose lowest and highest heights are `range` steps apart, and `farthest` from zero, at most.
    pub fn over(range: u64, farthest: u64) -> HeightSteps {
        let [range, farthest] = [range, farthest].map(|steps| i64::try_from(steps).unwrap_or(i64::MAX >> 8));
        HeightSteps(smallest(range, farthest))
    }

    /// Returns the height nearest to one, both in steps of nodes, that this step and finer ones hold exactly.
    pub fn nearest(self, height: i32) -> i32 {
        nearest(height.into(), self.0) as i32
    }

    /// Returns the step in metres.
    pub fn metres(self) -> f64 {
        self.0 as f64 / HEIGHT_STEPS
    }
}

/// Steps from zero, with room for a tile, that the header holds exactly: its numbers have 24 bits.
const MOST_EXACT: i64 = (1 << 24) - (1 << 16);

/// Returns the smallest power of two of which `range` steps, rounded outwards at both ends, are no more than a tile can have, and `farthest` steps
/// from zero are no more than its header holds exactly.
fn smallest(range: i64, farthest: i64) -> i64 {
    let fits = |step: &i64| range + 2 * step <= i64::from(LAST) * step && farthest <= MOST_EXACT.saturating_mul(*step);
    (0..48).map(|bit| 1 << bit).find(fits).unwrap_or(1 << 48)
}

/// Returns the multiple of `step`, a power of two, nearest to a height.
fn nearest(height: i64, step: i64) -> i64 {
    // By shifts: a division takes ten times as long.
    let bits = step.trailing_zeros();
    (2 * height + step) >> (bits + 1) << bits
}

/// A tile that is to be written.
pub struct Surface<'a> {
    /// The tile.
    pub tile: Tile,
    /// Its mesh.
    pub mesh: &'a TileMesh,
    /// The height of the surroundings.
    pub outside: i32,
    /// What the tiles around it add to the normals on its border, by the columns east and the rows north that they lie.
    pub around: &'a [([i32; 2], Vec<BorderNormal>)],
    /// Where the water of its zoom is, if tiles tell that.
    pub water: Option<&'a Water>,
}

/// The bytes of a vertex and its two triangles.
const BYTES_PER_VERTEX: usize = 20;

/// The bytes that most tiles have besides.
const BYTES_BESIDE: usize = 4096;

/// The number of the extension with normals.
pub(crate) const NORMALS: u8 = 1;

/// The number of the extension with the water mask.
pub(crate) const WATER_MASK: u8 = 2;

/// Returns the bytes of a tile.
pub fn encode(surface: &Surface, steps: HeightSteps) -> Vec<u8> {
    let Surface { tile, mesh, .. } = *surface;
    let heights = Heights::new(surface, steps);
    let order = VertexOrder::new(mesh);
    let nodes: Vec<Node> = order.vertices.iter().map(|&v| mesh.nodes[v as usize]).collect();
    let mut bytes = Vec::with_capacity(BYTES_PER_VERTEX * nodes.len() + BYTES_BESIDE);
    push_head(&mut bytes, tile, heights.metres());
    bytes.extend((nodes.len() as u32).to_le_bytes());
    push_differences(&mut bytes, nodes.iter().map(|node| i32::from(node.u)));
    push_differences(&mut bytes, nodes.iter().map(|node| i32::from(node.v)));
    push_differences(&mut bytes, order.vertices.iter().map(|&v| heights.quantized[v as usize].into()));
    let is_long = nodes.len() > 1 << 16;
    if is_long {
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    bytes.extend((order.triangles.len() as u32).to_le_bytes());
    let mut highest = 0;
    let back = order.triangles.as_flattened().iter().map(|&v| {
        let back = highest - v;
        highest += u32::from(back == 0);
        back
    });
    push_numbers(&mut bytes, back, is_long);
    push_sides(&mut bytes, &nodes, is_long);
    let normals = normals(mesh, tile, surface.around);
    let frame = EarthFrame::new(tile);
    bytes.push(NORMALS);
    bytes.extend((2 * nodes.len() as u32).to_le_bytes());
    let directions =
        order.vertices.iter().zip(&nodes).map(|(&v, node)| frame.earth_centred(*node, normals[v as usize]));
    bytes.extend(directions.map(octahedral).collect::<Vec<[u8; 2]>>().as_flattened());
    if let Some(mask) = surface.water.map(|water| water.mask(tile)) {
        bytes.push(WATER_MASK);
        bytes.extend((mask.len() as u32).to_le_bytes());
        bytes.extend(mask);
    }
    bytes
}

/// The heights of a tile as it has them.
struct Heights {
    /// The least, in steps of nodes.
    least: i64,
    /// The step, in steps of nodes.
    step: i64,
    /// In steps above the least.
    quantized: Vec<u16>,
}

impl Heights {
    fn new(surface: &Surface, HeightSteps(shared): HeightSteps) -> Heights {
        // Neighbours must have the same heights on the border, so those are rounded first.
        let height = |node: &Node| match i64::from(node.height(surface.outside)) {
            height if node.is_on_border() => nearest(height, shared),
            height => height,
        };
        let heights: Vec<i64> = surface.mesh.nodes.iter().map(height).collect();
        let (low, high) = heights.iter().fold((i64::MAX, i64::MIN), |(low, high), h| (low.min(*h), high.max(*h)));
        let least = low.div_euclid(shared) * shared;
        let step = smallest(high - least, least.abs().max(high.abs())).min(shared);
        let quantized =
            |height| ((nearest(height, step) - least) >> step.trailing_zeros()).clamp(0, LAST.into()) as u16;
        Heights { least, step, quantized: heights.into_iter().map(quantized).collect() }
    }

    /// Returns the heights in metres that the least and the greatest number stand for.
    fn metres(&self) -> [f64; 2] {
        [self.least, self.least + i64::from(LAST) * self.step].map(|steps| steps as f64 / HEIGHT_STEPS)
    }
}

/// The vertices in the order in which triangles use them first, as the format wants it.
struct VertexOrder {
    /// By new number, the old one.
    vertices: Vec<u32>,
    /// With new numbers.
    triangles: Vec<[u32; 3]>,
}

impl VertexOrder {
    fn new(mesh: &TileMesh) -> VertexOrder {
        let (mut numbers, mut vertices) = (vec![u32::MAX; mesh.nodes.len()], Vec::with_capacity(mesh.nodes.len()));
        let mut number = |v: u32| {
            let known = &mut numbers[v as usize];
            if *known == u32::MAX {
                *known = vertices.len() as u32;
                vertices.push(v);
            }
            *known
        };
        let triangles = mesh.triangles.iter().map(|triangle| triangle.map(&mut number)).collect();
        VertexOrder { vertices, triangles }
    }
}

/// Adds the header.
fn push_head(bytes: &mut Vec<u8>, tile: Tile, heights: [f64; 2]) {
    let Header { centre, radius, horizon } = Header::new(tile, heights);
    let mut push = |numbers: &[f64]| numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    push(&centre);
    let [low, high] = heights.map(|height| (height as f32).to_le_bytes());
    bytes.extend([low, high].as_flattened());
    let mut push = |numbers: &[f64]| numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    push(&centre);
    push(&[radius]);
    push(&horizon);
}

/// Adds each number as the difference to the one before, the sign in the last bit.
fn push_differences(bytes: &mut Vec<u8>, numbers: impl Iterator<Item = i32>) {
    let mut last = 0;
    let differences = numbers.map(|number| {
        let difference = number - last;
        last = number;
        (((difference << 1) ^ (difference >> 31)) as u16).to_le_bytes()
    });
    bytes.extend(differences.collect::<Vec<[u8; 2]>>().as_flattened());
}

/// Adds numbers of two bytes, or four.
fn push_numbers(bytes: &mut Vec<u8>, numbers: impl Iterator<Item = u32>, is_long: bool) {
    match is_long {
        true => bytes.extend(numbers.map(u32::to_le_bytes).collect::<Vec<[u8; 4]>>().as_flattened()),
        false => {
            bytes.extend(numbers.map(|number| (number as u16).to_le_bytes()).collect::<Vec<[u8; 2]>>().as_flattened())
        }
    }
}

/// Adds the vertices along the west, south, east and north side, each list in the direction of its axis.
fn push_sides(bytes: &mut Vec<u8>, nodes: &[Node], is_long: bool) {
    let on_border: Vec<(u32, Node)> =
        (0..).zip(nodes.iter().copied()).filter(|(_, node)| node.is_on_border()).collect();
    for (axis, end) in [(0, 0), (1, 0), (0, LAST), (1, LAST)] {
        let place = |node: &Node| if axis == 0 { [node.u, node.v] } else { [node.v, node.u] };
        let along = on_border.iter().filter(|(_, node)| place(node)[0] == end);
        let mut along: Vec<(u16, u32)> = along.map(|(v, node)| (place(node)[1], *v)).collect();
        along.sort_unstable();
        bytes.extend((along.len() as u32).to_le_bytes());
        push_numbers(bytes, along.into_iter().map(|(_, v)| v), is_long);
    }
}

/// Tiles from this zoom of the geographic scheme on are so small that directions are the same everywhere in them, as far as two bytes tell.
const FIRST_SMALL_ZOOM: u8 = 12;

/// East, north and up in a tile, in earth-centred axes.
struct EarthFrame {
    tile: Tile,
    /// Sine and cosine of the longitude and of the latitude of its middle.
    middle: [[f64; 2]; 2],
}

impl EarthFrame {
    fn new(tile: Tile) -> EarthFrame {
        EarthFrame { tile, middle: tile.middle().map(circle) }
    }

    /// Returns about sine and cosine of longitude and latitude at a vertex.
    fn circles(&self, node: Node) -> [[f64; 2]; 2] {
        if self.tile.geographic_zoom() >= FIRST_SMALL_ZOOM {
            return self.middle;
        }
        let [west, south] = self.tile.south_west();
        let [east, north] = self.tile.sides().map(|side| side / f64::from(LAST));
        [circle(west + east * f64::from(node.u)), circle(south + north * f64::from(node.v))]
    }

    /// Returns about the direction of a normal in earth-centred axes, of any length.
    fn earth_centred(&self, node: Node, normal: [f32; 3]) -> [f64; 3] {
        // A vertex beside the terrain has no triangle of it.
        let [east, north, up] = if normal == [0.0; 3] { [0.0, 0.0, 1.0] } else { normal.map(f64::from) };
        let [[sin_x, cos_x], [sin_y, cos_y]] = self.circles(node);
        let outwards = up * cos_y - north * sin_y;
        [outwards * cos_x - east * sin_x, outwards * sin_x + east * cos_x, north * cos_y + up * sin_y]
    }
}

/// Returns a direction on an unfolded octahedron, in two bytes (Meyer et al. 2010; Cigolle et al. 2014, "A survey of efficient representations for
/// independent unit vectors").
fn octahedral([x, y, z]: [f64; 3]) -> [u8; 2] {
    let scale = 1.0 / (x.abs() + y.abs() + z.abs());
    let [x, y] = [x * scale, y * scale];
    let folded = if z < 0.0 { [(1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)] } else { [x, y] };
    // From 0 on, so that the fraction is cut off.
    folded.map(|along| ((along * 0.5 + 0.5) * 255.0 + 0.5) as u8)
}
