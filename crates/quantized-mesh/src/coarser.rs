//! The tile above four.
//!
//! Its vertices are selected from theirs (`refine.rs`, or `rough.rs` where that would be too many), those of its sides from those of their sides
//! alone. So a tile needs no neighbour, and meets all of them.

use crate::bound::{FIRST_FLAT_ZOOM, steps};
use crate::halves::Halves;
use crate::mesh::{LAST, Node, OUTSIDE, TileMesh, corner_place, in_order};
use crate::refine::refined;
use crate::rough::Cells;
use crate::side::selected_along;
use crate::tile::Tile;
use delaunay::geometry::Site;
use delaunay::triangulation::canonical;
use std::collections::BTreeMap;

/// A tile of the next finer zoom.
#[derive(Clone, Debug, Default)]
pub struct Child {
    /// 1 in the east, 0 in the west; 1 in the north, 0 in the south.
    pub quadrant: [u8; 2],
    /// Its vertices, in the order of a mesh.
    pub nodes: Vec<Node>,
}

/// The most vertices of a coarser tile, besides those along its sides. Where the bound of its zoom would select more, as in woods, a greater one holds.
const MOST_VERTICES: usize = 16_384;

/// The steps of the sides of a square that stand for one metre, or for as much in the other direction.
const SCALE: i32 = 1024;

/// Returns the mesh of a tile from the tiles of the next finer zoom in it, and the bound by which its vertices were selected. `outside` is the height of
/// the surroundings at its zoom.
///
/// # Errors
/// [`delaunay::Error::Stopped`].
pub fn coarser(tile: Tile, children: &[Child], outside: i32) -> Result<(TileMesh, u64), delaunay::Error> {
    let [on_border, inside] = candidates(tile, children);
    let mut fixed = border(&on_border, tile, outside);
    fixed.extend(grid(&inside, &fixed, tile));
    fixed.sort_unstable_by_key(|node| node.order());
    fixed.dedup_by_key(|node| node.order());
    let source = TileSource { tile, scale: scale_of(tile), fixed: &fixed, inside: &inside, outside };
    source.mesh()
}

/// Returns a tile that the terrain does not reach.
pub fn flat(tile: Tile) -> Result<TileMesh, delaunay::Error> {
    coarser(tile, &[], 0).map(|(mesh, _)| mesh)
}

/// Returns the vertices of all children as a tile of the zoom before has them, those on its border and the others, in order. Of those that come together
/// the highest of the terrain stays.
fn candidates(tile: Tile, children: &[Child]) -> [Vec<Node>; 2] {
    let [mut on_border, mut inside] = [Vec::new(), Vec::new()];
    let [columns, rows] = Halves::of(tile);
    let has = |quadrant: [u8; 2]| children.iter().any(|child| child.quadrant == quadrant);
    let mut ordered: Vec<&Child> = children.iter().collect();
    ordered.sort_by_key(|child| [child.quadrant[1], child.quadrant[0]]);
    for Child { quadrant: [east, north], nodes } in ordered {
        let [west_has, south_has] = [*east == 1 && has([0, *north]), *north == 1 && has([*east, 0])];
        for node in nodes {
            let is_outer = |along: u16, half: u8| along == if half == 0 { 0 } else { LAST };
            if is_outer(node.u, *east) || is_outer(node.v, *north) {
                let [u, v] = [columns.on_border(node.u, *east), rows.on_border(node.v, *north)];
                on_border.push(Node { u, v, h: node.h });
            } else if !(west_has && node.u == 0 || south_has && node.v == 0) {
                let [u, v] = [columns.inside(node.u, *east), rows.inside(node.v, *north)];
                inside.push(Node { u, v, h: node.h });
            }
        }
    }
    on_border.sort_unstable_by_key(|node| node.order());
    if !rows.are_even() {
        inside.sort_unstable_by_key(|node| node.order());
    }
    [on_border, inside].map(each_once)
}

/// Puts nodes that are nearly in order into it, each place once.
fn each_once(mut nodes: Vec<Node>) -> Vec<Node> {
    let mut orders: Vec<u32> = nodes.iter().map(|node| node.order()).collect();
    for i in 1..nodes.len() {
        let (node, order) = (nodes[i], orders[i]);
        let mut at = i;
        while at > 0 && orders[at - 1] > order {
            (nodes[at], orders[at]) = (nodes[at - 1], orders[at - 1]);
            at -= 1;
        }
        (nodes[at], orders[at]) = (node, order);
    }
    nodes.dedup_by(|node, known| {
        let is_same = [node.u, node.v] == [known.u, known.v];
        known.h = if is_same { known.h.max(node.h) } else { known.h };
        is_same
    });
    nodes
}

/// Returns the vertices along the sides: selected ones of `on_border`, and the corners.
fn border(on_border: &[Node], tile: Tile, outside: i32) -> Vec<Node> {
    let mut border: Vec<Node> = Vec::new();
    for corner in 0..4 {
        let [u, v] = corner_place(corner);
        let known = on_border.iter().find(|node| node.corner() == Some(corner));
        border.push(Node { u, v, h: known.map_or(OUTSIDE, |node| node.h) });
    }
    for side in 0..4 {
        let end = if side % 2 == 0 { 0 } else { LAST };
        let along = |node: &Node| {
            let (across, along) = if side < 2 { (node.u, node.v) } else { (node.v, node.u) };
            (across == end).then_some((along, *node))
        };
        // Its corners are in it whether they are known or not, so that it is the same line in both tiles.
        let ends = border[..4].iter().filter_map(along).collect::<Vec<_>>();
        let mut of_side: Vec<(u16, Node)> =
            on_border.iter().filter(|node| node.corner().is_none()).filter_map(along).collect();
        of_side.extend(ends);
        of_side.sort_unstable_by_key(|(along, _)| *along);
        let selected = selected_along(&of_side, tile, outside);
        border.extend(on_grid(&selected, tile, outside).into_iter().map(|(along, h)| {
            let [u, v] = if side < 2 { [end, along] } else { [along, end] };
            Node { u, v, h }
        }));
        border.extend(selected.into_iter().map(|(_, node)| node));
    }
    border
}

/// Returns vertices where the lines of the grid of a tile meet a side, on the straight lines between selected ones: steps along the side, and
/// heights.
fn on_grid(selected: &[(u16, Node)], tile: Tile, outside: i32) -> Vec<(u16, i32)> {
    let lines = grid_lines(tile);
    let inner = lines.get(1..lines.len() - 1).unwrap_or_default();
    let height = |&line: &u16| {
        let after = selected.partition_point(|(along, _)| *along < line);
        let ((to, last), (from, first)) = (selected.get(after)?, selected.get(after.checked_sub(1)?)?);
        if *to == line {
            return None;
        }
        if [first.h, last.h] == [OUTSIDE; 2] {
            return Some((line, OUTSIDE));
        }
        let [first, last] = [first, last].map(|node| i64::from(node.height(outside)));
        let (part, whole) = (i64::from(line - from), i64::from(to - from));
        Some((line, (first + (2 * (last - first) * part + whole).div_euclid(2 * whole)) as i32))
    };
    inner.iter().filter_map(height).collect()
}

/// Returns where the lines of the grid of a tile are, with both ends.
fn grid_lines(tile: Tile) -> Vec<u16> {
    let zoom = tile.geographic_zoom();
    let count = if zoom < FIRST_FLAT_ZOOM { (32u32 >> (zoom / 2)).max(1) } else { 1 };
    (0..=count).map(|line| (line * u32::from(LAST) / count) as u16).collect()
}

/// Returns vertices for the curve of the earth: of each cell of the grid one of those that may be selected, or where four cells without any meet,
/// one beside the terrain.
fn grid(inside: &[Node], border: &[Node], tile: Tile) -> Vec<Node> {
    let lines = grid_lines(tile);
    if lines.len() < 3 {
        return Vec::new();
    }
    let cell = |along: u16| lines.partition_point(|&line| line <= along).clamp(1, lines.len() - 1) - 1;
    let mut first: BTreeMap<[usize; 2], Node> = BTreeMap::new();
    for node in inside.iter().chain(border.iter().filter(|node| node.h != OUTSIDE)) {
        first.entry([cell(node.u), cell(node.v)]).or_insert(*node);
    }
    let mut vertices: Vec<Node> = first.values().copied().collect();
    for i in 1..lines.len() - 1 {
        for j in 1..lines.len() - 1 {
            let around = [[i - 1, j - 1], [i, j - 1], [i - 1, j], [i, j]];
            let is_empty = around.iter().all(|cell| !first.contains_key(cell));
            vertices.extend(is_empty.then_some(Node { u: lines[i], v: lines[j], h: OUTSIDE }));
        }
    }
    vertices
}

/// The vertices that a tile may have, as points to select from. Their x is stretched so that both axes have about the same scale on the ground.
struct TileSource<'a> {
    tile: Tile,
    /// The places in a step along both axes.
    scale: [i32; 2],
    /// Those that it has in any case.
    fixed: &'a [Node],
    inside: &'a [Node],
    outside: i32,
}

/// Returns the places in a step along both axes of a tile.
fn scale_of(tile: Tile) -> [i32; 2] {
    let [width, height] = tile.sides();
    let wider = width / height * libm::cos(tile.middle()[1]);
    [((f64::from(SCALE) * wider + 0.5) as i32).clamp(1, SCALE), SCALE]
}

impl TileSource<'_> {
    fn point(&self, node: &Node) -> [i32; 3] {
        let [x, y] = self.scale;
        [i32::from(node.u) * x, i32::from(node.v) * y, node.height(self.outside)]
    }

    /// Returns the mesh of the tile, and how far vertices are from it.
    fn mesh(&self) -> Result<(TileMesh, u64), delaunay::Error> {
        match self.medians() {
            Some(medians) => Ok((self.mesh_of(medians)?, self.range())),
            None => self.selected(),
        }
    }

    /// Returns a vertex for each cell of the tile, and the fixed ones, where the surface is so rough that the bound would select far more vertices than a
    /// tile may have.
    fn medians(&self) -> Option<Vec<Node>> {
        if self.inside.len() <= MOST_VERTICES {
            return None;
        }
        let cells = Cells::new(self.inside);
        let is_rough = cells.off_plane(2 * steps(self.tile.scheme, self.tile.zoom)) > MOST_VERTICES / 2;
        is_rough.then(|| {
            let mut medians = cells.medians();
            medians.extend(self.inside.iter().filter(|node| node.h == OUTSIDE));
            medians.retain(|node| !self.is_fixed(node));
            medians.extend(self.fixed);
            medians
        })
    }

    /// Returns the mesh of the vertices that the bound of the zoom selects, and this bound, or a greater one if these would be too many.
    fn selected(&self) -> Result<(TileMesh, u64), delaunay::Error> {
        let bound = steps(self.tile.scheme, self.tile.zoom);
        let first: Vec<[i32; 3]> = self.fixed.iter().map(|node| self.point(node)).collect();
        let points: Vec<[i32; 3]> =
            self.inside.iter().filter(|node| !self.is_fixed(node)).map(|node| self.point(node)).collect();
        let refined = refined(&first, &points, bound as f64, MOST_VERTICES)?;
        let [x, y] = self.scale;
        let nodes = refined.points.iter().map(|[px, py, h]| Node { u: (px / x) as u16, v: (py / y) as u16, h: *h });
        let mesh = self.in_order(nodes.collect(), &refined.triangles);
        Ok((mesh, refined.excess.map_or(bound, |excess| libm::ceil(excess) as u64)))
    }

    fn is_fixed(&self, node: &Node) -> bool {
        // Without a grid all fixed vertices lie on the border.
        self.tile.geographic_zoom() < FIRST_FLAT_ZOOM
            && self.fixed.binary_search_by_key(&node.order(), |fixed| fixed.order()).is_ok()
    }

    /// Returns the mesh of vertices.
    fn mesh_of(&self, nodes: Vec<Node>) -> Result<TileMesh, delaunay::Error> {
        let [x, y] = self.scale;
        let sites: Vec<Site> = nodes.iter().map(|node| [i32::from(node.u) * x, i32::from(node.v) * y]).collect();
        let mesh = canonical(&sites)?;
        Ok(self.in_order(nodes, mesh.corners()))
    }

    /// Returns a mesh with its vertices and triangles in order.
    fn in_order(&self, mut nodes: Vec<Node>, triangles: &[[u32; 3]]) -> TileMesh {
        let mut order: Vec<u64> = (0..).zip(&nodes).map(|(v, node)| u64::from(node.order()) << 32 | v).collect();
        order.sort_unstable();
        let mut numbers = vec![0u32; nodes.len()];
        (0..).zip(&order).for_each(|(number, key)| numbers[*key as u32 as usize] = number);
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|corners| corners.map(|v| numbers[v as usize])).collect();
        nodes = order.iter().map(|key| nodes[*key as u32 as usize]).collect();
        // Heights beside the terrain are again those of the surroundings, whatever these are at the next zoom.
        let all = self.fixed.iter().chain(self.inside);
        let mut outside: Vec<u32> = all.filter(|node| node.h == OUTSIDE).map(|node| node.order()).collect();
        if !outside.is_empty() {
            outside.sort_unstable();
            let is_outside = |node: &&mut Node| outside.binary_search(&node.order()).is_ok();
            nodes.iter_mut().filter(is_outside).for_each(|node| node.h = OUTSIDE);
        }
        let triangles = in_order(nodes.len(), triangles);
        TileMesh { nodes, triangles }
    }

    /// Returns the lowest and the highest height apart.
    fn range(&self) -> u64 {
        let heights = self.fixed.iter().chain(self.inside).map(|node| node.height(self.outside));
        let [low, high] = heights.fold([i32::MAX, i32::MIN], |[low, high], h| [low.min(h), high.max(h)]);
        if low > high { 0 } else { high.abs_diff(low).into() }
    }
}
