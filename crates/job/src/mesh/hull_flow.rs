//! Where the ways of [`HullRule`] lead: out of the hull, to a triangle that stays, or to where a node above goes on.
//!
//! A node knows its final ground alone. A way that leaves it does so over an edge of the ground's boundary. For every such edge the node
//! passes up where a way goes on that comes in there, and which tiles ask where a way leads that goes out there. The merge above follows
//! them over its own final triangles, and answers what it can: at the root everything that leaves the ground leaves the hull. Tiles with
//! an open question wait. Only long edges of the boundary count, so this is little.

use crate::index::TileIndex;
use crate::merge_records::{FlowQuestion, TrimmedEdge};
use crate::mesh::final_triangles::{FinalTriangles, TriangleState};
use crate::mesh::hull_rule::HullRule;
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::{HalfEdgeIndex, SiteIndex};
use std::collections::HashMap;
use sys::{Error, Result};

/// A directed edge between vertices of a node's mesh.
type Edge = [SiteIndex; 2];

/// The mesh of a node, and what it decides about its triangles.
pub(crate) struct NodeMesh<'a> {
    pub(crate) mesh: &'a HalfEdgeMesh,
    pub(crate) sites: &'a [Site],
    pub(crate) found: &'a FinalTriangles,
    pub(crate) rule: HullRule,
    /// Whether no node above goes on.
    pub(crate) is_root: bool,
}

/// What the nodes below pass up, with numbers of the merge's own vertices and of the edges of all boundaries below.
#[derive(Default)]
pub(crate) struct FlowsBelow {
    pub(crate) boundary: Vec<[u32; 2]>,
    pub(crate) passes: Vec<[u32; 2]>,
    pub(crate) questions: Vec<FlowQuestion>,
    /// The number of triangles that are final below.
    pub(crate) triangles: u64,
}

/// What a node passes up, and what it answers.
#[derive(Debug, Default)]
pub(crate) struct NodeFlows {
    /// The edges of the node's boundary over which a way comes in that goes out again, each with the edge where it does.
    pub(crate) passes: Vec<[u32; 2]>,
    /// What tiles ask about edges of the node's boundary.
    pub(crate) questions: Vec<FlowQuestion>,
    /// The edges of tiles from which a way leads out of the hull.
    pub(crate) trimmed: Vec<TrimmedEdge>,
    /// The number of triangles whose ways lead there.
    pub(crate) slivers: u64,
}

/// Where a way leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// To a triangle that does not flow.
    Stays,
    /// Out of the hull.
    Outside,
    /// Over this edge of the node's boundary.
    Boundary(u32),
}

/// What comes after an edge of a way.
enum Step {
    /// Another edge.
    On(HalfEdgeIndex),
    Ends(End),
}

/// Follows ways over the ground of a node.
struct Routes<'a> {
    node: &'a NodeMesh<'a>,
    /// The long edges of the node's boundary.
    boundary: HashMap<HalfEdgeIndex, u32>,
    /// The long edges of the boundaries below.
    below: Vec<Option<HalfEdgeIndex>>,
    /// Where a way that comes in over an edge of a boundary below goes out.
    passes: HashMap<HalfEdgeIndex, HalfEdgeIndex>,
    /// Where ways lead that were followed before: many lead over one edge.
    known: HashMap<HalfEdgeIndex, End>,
}

/// Follows the ways in a leaf, which is `tile`.
///
/// # Errors
/// [`Error::Broken`] if the mesh is not Delaunay.
pub(crate) fn flows_of_leaf(node: &NodeMesh, tile: TileIndex) -> Result<NodeFlows> {
    let mut ways = Routes::new(node, &FlowsBelow::default());
    let mut flows = NodeFlows { passes: ways.passes_up()?, ..NodeFlows::default() };
    // A way that leaves the tile does so at its boundary, so only triangles there need be asked for.
    let mut last: Vec<HalfEdgeIndex> = match node.is_root {
        true => node.mesh.hull().filter(|&h| node.is_long(h)).collect(),
        false => ways.boundary.keys().copied().collect(),
    };
    last.retain(|&h| node.flow_of(h.triangle()) == Some(h));
    for h in last {
        let (edge, triangles) = (node.positions(h), node.triangles_before(h));
        flows.take(FlowQuestion { tile, exit: 0, edge, triangles }, ways.outward(h)?);
    }
    Ok(flows.sorted())
}

/// Follows the ways in a merge node. `tiles_of` returns the tiles that own corners of a triangle.
///
/// # Errors
/// [`Error::Broken`] if the mesh is not Delaunay, or what is below contradicts it.
pub(crate) fn flows_of_merge(
    node: &NodeMesh,
    below: &FlowsBelow,
    tiles_of: impl Fn([SiteIndex; 3]) -> [TileIndex; 3],
) -> Result<NodeFlows> {
    let mut ways = Routes::new(node, below);
    let mut flows = NodeFlows { passes: ways.passes_up()?, ..NodeFlows::default() };
    for question in &below.questions {
        let h = ways.below.get(question.exit as usize).copied().flatten().ok_or_else(contradiction)?;
        flows.take(*question, ways.outward(h)?);
    }
    for (t, _) in node.found.states.iter().enumerate().filter(|(_, state)| **state == TriangleState::Final) {
        let Some(h) = node.flow_of(t) else { continue };
        let end = ways.outward(h)?;
        let mut tiles = tiles_of(node.mesh.triangles[t]);
        tiles.sort_unstable();
        let edge = node.positions(h);
        for i in (0..3).filter(|&i| i == 0 || tiles[i] != tiles[i - 1]) {
            let triangles = u32::from(i == 0);
            flows.take(FlowQuestion { tile: tiles[i], exit: 0, edge, triangles }, end);
        }
    }
    Ok(flows.sorted())
}

impl NodeFlows {
    fn take(&mut self, question: FlowQuestion, end: End) {
        match end {
            End::Stays => {}
            End::Outside => {
                self.trimmed.push(TrimmedEdge { tile: question.tile, edge: question.edge });
                self.slivers += u64::from(question.triangles);
            }
            End::Boundary(exit) => self.questions.push(FlowQuestion { exit, ..question }),
        }
    }

    fn sorted(mut self) -> NodeFlows {
        self.passes.sort_unstable();
        self.questions.sort_unstable();
        self.trimmed.sort_unstable();
        self
    }
}

impl NodeMesh<'_> {
    fn positions(&self, h: HalfEdgeIndex) -> [Site; 2] {
        self.ends(h).map(|v| self.sites[v.get()])
    }

    fn ends(&self, h: HalfEdgeIndex) -> Edge {
        [self.mesh.origin(h), self.mesh.destination(h)]
    }

    fn is_long(&self, h: HalfEdgeIndex) -> bool {
        let [a, b] = self.positions(h);
        self.rule.is_long(a, b)
    }

    /// Returns the number of final triangles whose ways lead over `last`, which the triangle before it flows over.
    fn triangles_before(&self, last: HalfEdgeIndex) -> u32 {
        let (mut count, mut ways) = (0, vec![last]);
        while let Some(h) = ways.pop() {
            count += 1;
            let twins = HalfEdgeIndex::of_triangle(h.triangle()).into_iter().map(|edge| self.mesh.twin(edge));
            let is_final = |twin: &HalfEdgeIndex| self.found.states[twin.triangle()] == TriangleState::Final;
            let before =
                twins.filter(|&twin| twin != HalfEdgeIndex::HULL && twin != self.mesh.twin(h)).filter(is_final);
            ways.extend(before.filter(|&twin| self.flow_of(twin.triangle()) == Some(twin)));
        }
        count
    }

    /// Returns the edge over which triangle `t` flows.
    fn flow_of(&self, t: usize) -> Option<HalfEdgeIndex> {
        let corners = self.mesh.triangles[t].map(|v| self.sites[v.get()]);
        self.rule.flow(corners).map(|corner| HalfEdgeIndex::of_triangle(t)[corner])
    }
}

impl<'a> Routes<'a> {
    fn new(node: &'a NodeMesh<'a>, below: &FlowsBelow) -> Routes<'a> {
        let edges = (0..).zip(&node.found.boundary_edges).filter(|(_, h)| node.is_long(**h));
        let boundary = edges.map(|(at, &h)| (h, at)).collect();
        let found = find_edges(node, &below.boundary);
        let pass = |&[from, to]: &[u32; 2]| Some(((*found.get(from as usize)?)?, (*found.get(to as usize)?)?));
        let passes = below.passes.iter().filter_map(pass).collect();
        Routes { node, boundary, below: found, passes, known: HashMap::new() }
    }

    /// Returns where the way leads that leaves over `h`.
    fn outward(&mut self, h: HalfEdgeIndex) -> Result<End> {
        let (mut way, mut last) = (Vec::new(), h);
        let end = loop {
            if let Some(&end) = self.known.get(&last) {
                break end;
            }
            way.push(last);
            match self.step(last)? {
                Step::On(next) => last = next,
                Step::Ends(end) => break end,
            }
        };
        self.known.extend(way.into_iter().map(|h| (h, end)));
        Ok(end)
    }

    /// Goes over `h`, out of one triangle and out of the next.
    fn step(&self, h: HalfEdgeIndex) -> Result<Step> {
        let twin = self.node.mesh.twin(h);
        let is_out = |twin: HalfEdgeIndex| self.node.found.states[twin.triangle()] == TriangleState::Pending;
        if twin == HalfEdgeIndex::HULL || is_out(twin) {
            return match self.node.is_root {
                true => Ok(Step::Ends(End::Outside)),
                false => self.boundary.get(&h).map(|&at| Step::Ends(End::Boundary(at))).ok_or_else(contradiction),
            };
        }
        let Some(next) = self.through(twin) else { return Ok(Step::Ends(End::Stays)) };
        match self.length(next) > self.length(h) {
            true => Ok(Step::On(next)),
            false => Err(contradiction()),
        }
    }

    /// Returns where a way goes on that comes in over `h`: over the flow of the final triangle there, or where it leaves the ground that is
    /// final below.
    fn through(&self, h: HalfEdgeIndex) -> Option<HalfEdgeIndex> {
        match self.node.found.states[h.triangle()] {
            TriangleState::Final => self.node.flow_of(h.triangle()),
            TriangleState::Covered | TriangleState::Pending => self.passes.get(&h).copied(),
        }
    }

    /// Returns where ways go out again that come in over the node's boundary.
    fn passes_up(&mut self) -> Result<Vec<[u32; 2]>> {
        let mut passes = Vec::new();
        let boundary: Vec<(HalfEdgeIndex, u32)> = self.boundary.iter().map(|(&h, &at)| (h, at)).collect();
        for (h, at) in boundary {
            let Some(next) = self.through(h).filter(|&next| next != h) else { continue };
            if let End::Boundary(to) = self.outward(next)? {
                passes.push([at, to]);
            }
        }
        Ok(passes)
    }

    fn length(&self, h: HalfEdgeIndex) -> u64 {
        let [a, b] = self.node.positions(h);
        let [dx, dy] = [0, 1].map(|k| (a[k] as i64 - b[k] as i64).unsigned_abs());
        dx * dx + dy * dy
    }
}

/// Returns the half-edges of the long ones among `edges`.
fn find_edges(node: &NodeMesh, edges: &[[u32; 2]]) -> Vec<Option<HalfEdgeIndex>> {
    let site = |v: u32| node.sites[v as usize];
    let long = (0..).zip(edges).filter(|(_, [a, b])| node.rule.is_long(site(*a), site(*b)));
    let wanted: HashMap<Edge, usize> = long.map(|(at, edge)| (edge.map(SiteIndex), at)).collect();
    let mut found = vec![None; edges.len()];
    if wanted.is_empty() {
        return found;
    }
    for h in node.mesh.half_edges().filter(|&h| node.is_long(h)) {
        if let Some(&at) = wanted.get(&node.ends(h)) {
            found[at] = Some(h);
        }
    }
    found
}

fn contradiction() -> Error {
    Error::Broken("the ways of slivers to the hull contradict each other".into())
}
