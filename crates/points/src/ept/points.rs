//! The points of an EPT, node by node.

use std::ops::Range;
use std::path::Path;

use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};

use crate::ept::binary::{BinaryLayout, decompressed};
use crate::ept::files::{LARGEST, SideFile};
use crate::ept::hierarchy::{Hierarchy, Node};
use crate::ept::index::{DataType, EptIndex};
use crate::ept::name::node_name;
use crate::ept::node_sink::{NodeCell, NodeSink};
use crate::file::random_access::RandomAccessFile;
use crate::las::header::LasHeader;
use crate::las::laz::CompressedPoints;
use crate::las::vlr;
use crate::point_format::PointFormat;
use crate::points::axis::Axis;
use crate::points::chunk_request::ChunkRequest;
use crate::points::raw_bounds::RawBounds;
use crate::points::record_sink::RecordSink;
use sys::{Error, Result, Warnings};

/// The least number of records of a chunk of the source, as long as there are enough. Smaller nodes go together.
const LEAST_RECORDS: u64 = 50_000;

/// About so many bytes takes a point of LAZ.
const BYTES_OF_LAZ: u64 = 12;

/// So many chunks are fetched ahead of the one that is decoded.
const CHUNKS_AHEAD: usize = 2;

/// How nodes hold their points.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum NodeData {
    Laszip,
    Binary(BinaryLayout),
    Zstandard(BinaryLayout),
}

/// The point data of an EPT.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct EptPoints {
    data: NodeData,
    /// Those of all nodes.
    axes: [Axis; 3],
    /// The least x, y, z of the octree's cube, in raw steps, and its sides.
    min: [f64; 3],
    side: [f64; 3],
    /// The nodes that bounds may want, in the order of their records.
    nodes: Vec<Node>,
    /// The end of each chunk among the nodes, and the number of the first record behind it.
    ends: Vec<(usize, u64)>,
    /// The points in other nodes.
    unlisted: u64,
    /// The number of points that the index promises and no node has.
    pub(crate) missing: u64,
    /// Whether the octree may leave nodes out.
    uses_index: bool,
}

/// What is wanted of a node.
struct NodeRequest<'a> {
    index: &'a Path,
    node: Node,
    file: SideFile,
    /// The number of its first record in the data set.
    first: u64,
    /// Where its points lie by the octree, if they are compared with it.
    cell: Option<NodeCell>,
    axes: &'a [Axis; 3],
    request: ChunkRequest<'a>,
}

impl EptPoints {
    /// Reads the hierarchy of the EPT at `path`, as far as `bounds` [xmin, ymin, xmax, ymax] need it. Without `uses_index`, all nodes will
    /// be read.
    ///
    /// # Errors
    /// [`Error::Input`] if it does not fit the index, [`Error::Io`] if it cannot be read.
    pub(crate) fn read(path: &Path, index: &EptIndex, bounds: Option<[f64; 4]>, uses_index: bool) -> Result<EptPoints> {
        let float = |number: rust_decimal::Decimal| number.to_f64().unwrap_or(f64::NAN);
        let (corner, side) = index.cube;
        let (offset, scale) = (index.axes.map(|axis| float(axis.offset)), index.axes.map(|axis| float(axis.scale)));
        let min = [0, 1, 2].map(|axis| (corner[axis] - offset[axis]) / scale[axis]);
        let side = [0, 1, 2].map(|axis| side[axis] / scale[axis]);
        if min.iter().chain(&side).any(|number| !number.is_finite()) {
            return Err(Error::input(path, "has bounds that are no numbers in steps of its scale"));
        }
        let bounds = bounds.filter(|_| uses_index).map(|bounds| RawBounds::of(&index.axes, bounds));
        let is_wanted = |key| bounds.as_ref().is_none_or(|bounds| NodeCell::of(min, side, key).plane.meet(bounds));
        let hierarchy = Hierarchy::read(path, is_wanted)?;
        let promised = index.points;
        if hierarchy.points > promised {
            let what = format!("claims {promised} points, but the nodes of its hierarchy have {}", hierarchy.points);
            return Err(Error::input(path, format!("{what}: one of the two is damaged, so copy or build it again")));
        }
        let missing = if hierarchy.is_whole { promised - hierarchy.points } else { 0 };
        let listed: u64 = hierarchy.nodes.iter().map(|node| node.points).sum();
        let layout = index.layout.clone();
        Ok(EptPoints {
            data: match index.data_type {
                DataType::Laszip => NodeData::Laszip,
                DataType::Binary => NodeData::Binary(layout),
                DataType::Zstandard => NodeData::Zstandard(layout),
            },
            axes: index.axes,
            min,
            side,
            ends: ends_of_chunks(&hierarchy.nodes),
            nodes: hierarchy.nodes,
            unlisted: promised - missing - listed,
            missing,
            uses_index,
        })
    }

    /// Says that all chunks will be decoded within these bounds.
    ///
    /// # Errors
    /// [`Error::Config`] if nobody knows the query of the index at `path`.
    pub(crate) fn expect(&self, path: &Path, request: &ChunkRequest) -> Result<()> {
        for node in self.nodes.iter().filter(|node| self.is_decoded(node, request)) {
            self.side_file(path, node)?.expect();
        }
        Ok(())
    }

    fn nodes_of(&self, chunk: usize) -> &[Node] {
        let start = chunk.checked_sub(1).map_or(0, |before| self.ends[before].0);
        self.ends.get(chunk).map_or(&[], |(end, _)| &self.nodes[start..*end])
    }

    /// Returns what the points of a node lie within.
    fn cell(&self, node: &Node) -> NodeCell {
        NodeCell::of(self.min, self.side, node.key)
    }

    fn may_reach(&self, node: &Node, bounds: Option<&RawBounds>) -> bool {
        bounds.filter(|_| self.uses_index).is_none_or(|bounds| self.cell(node).plane.meet(bounds))
    }

    fn is_decoded(&self, node: &Node, request: &ChunkRequest) -> bool {
        self.may_reach(node, request.bounds) != request.left_out
    }

    fn side_file(&self, path: &Path, node: &Node) -> Result<SideFile> {
        let length = |layout: &BinaryLayout| layout.length as u64;
        let (ending, about) = match &self.data {
            NodeData::Laszip => ("laz", BYTES_OF_LAZ),
            NodeData::Binary(layout) => ("bin", length(layout)),
            NodeData::Zstandard(layout) => ("zst", length(layout) / 2 + 1),
        };
        SideFile::new(path, &node_name(node.key, ending), about.saturating_mul(node.points).min(LARGEST))
    }

    /// Begins to fetch the nodes of a chunk, and of the next ones, if they are expected.
    fn prepare(&self, path: &Path, chunk: usize, request: &ChunkRequest) -> Result<()> {
        let chunks = chunk..(chunk + 1 + CHUNKS_AHEAD).min(self.ends.len());
        for node in chunks.flat_map(|chunk| self.nodes_of(chunk)).filter(|node| self.is_decoded(node, request)) {
            self.side_file(path, node)?.prepare();
        }
        Ok(())
    }
}

impl PointFormat for EptPoints {
    fn chunk_count(&self) -> usize {
        self.ends.len().max((self.missing + self.unlisted > 0) as usize)
    }

    fn has_index(&self) -> bool {
        self.uses_index
    }

    fn decoded_records(&self, chunk: usize, bounds: Option<&RawBounds>) -> Option<u64> {
        self.uses_index.then(|| {
            self.nodes_of(chunk).iter().filter(|node| self.may_reach(node, bounds)).map(|node| node.points).sum()
        })
    }

    /// The points are in other files.
    fn bytes_of(&self, _: usize, _: &ChunkRequest, _: u64) -> Vec<Range<u64>> {
        Vec::new()
    }

    fn decode(
        &self,
        file: &RandomAccessFile,
        chunk: usize,
        request: ChunkRequest,
        sink: &mut impl RecordSink,
    ) -> Result<()> {
        let index = file.path();
        if request.needs_whole_chunk() {
            self.prepare(index, chunk, &request)?;
        }
        let mut left = request.records;
        let mut first = chunk.checked_sub(1).map_or(0, |before| self.ends[before].1);
        for node in self.nodes_of(chunk) {
            if left == 0 {
                return Ok(());
            }
            let number = first;
            first += node.points;
            if !self.is_decoded(node, &request) {
                sink.not_decoded(if request.left_out { 0 } else { node.points });
                continue;
            }
            let records = node.points.min(left);
            left -= records;
            let wanted = NodeRequest {
                index,
                node: *node,
                file: self.side_file(index, node)?,
                first: number,
                cell: (!request.left_out).then(|| self.cell(node)),
                axes: &self.axes,
                request: ChunkRequest { records, bounds: None, left_out: false, ..request },
            };
            match &self.data {
                NodeData::Laszip => wanted.decode_laszip(sink)?,
                NodeData::Binary(layout) => wanted.decode_records(layout, false, sink)?,
                NodeData::Zstandard(layout) => wanted.decode_records(layout, true, sink)?,
            }
        }
        if left > 0 && !request.left_out && chunk + 1 == self.chunk_count() {
            let missing = self.missing;
            sink.not_decoded(self.unlisted);
            if missing > 0 {
                sink.malformed(missing, || {
                    format!("the index promises {missing} points more than its hierarchy has; copy it again, or allow the loss")
                });
            }
        }
        Ok(())
    }
}

impl NodeRequest<'_> {
    fn sink<'a, S: RecordSink>(&'a self, inner: &'a mut S) -> NodeSink<'a, S> {
        let NodeRequest { index, ref file, first, cell, axes, .. } = *self;
        NodeSink { index, file: &file.path, first, cell, axes, inner }
    }

    /// Counts all wanted records as lost.
    fn lose(&self, sink: &mut impl RecordSink, why: &str) {
        self.sink(sink).malformed(self.request.records, || why.into());
    }

    fn is_missing(&self, sink: &mut impl RecordSink) {
        self.lose(sink, "this node of the hierarchy is not there; copy the data set again, or allow the loss");
    }

    fn refused(&self, what: &str) -> Error {
        Error::input(self.index, format!("{}: {what}; build or copy the data set again", self.file.path.display()))
    }

    /// Decodes a node that is a LAZ file.
    fn decode_laszip(&self, sink: &mut impl RecordSink) -> Result<()> {
        let Some(file) = self.file.open()? else {
            self.is_missing(sink);
            return Ok(());
        };
        let (header, points) = match read_laz(&file) {
            Err(Error::Input { what, .. }) => {
                self.lose(sink, &format!("{what}; copy it again, or allow the loss"));
                return Ok(());
            }
            read => read?,
        };
        if header.axes != *self.axes {
            return Err(self.refused("this node has another scale or offset than the index"));
        }
        if header.records != self.node.points {
            let what = format!("this node has {} points, and its hierarchy says {}", header.records, self.node.points);
            return Err(self.refused(&what));
        }
        let mut left = self.request.records;
        for chunk in 0..points.chunk_count() {
            let records = points.records_of(chunk).min(left);
            let request = ChunkRequest { records: left, ..self.request };
            points.decode(&file, chunk, request, &mut self.sink(sink))?;
            left -= records;
        }
        Ok(())
    }

    /// Decodes a node of records, compressed together or not.
    fn decode_records(&self, layout: &BinaryLayout, is_compressed: bool, sink: &mut impl RecordSink) -> Result<()> {
        let Some(bytes) = self.file.bytes()? else {
            self.is_missing(sink);
            return Ok(());
        };
        let (points, length) = (self.node.points, layout.length as u64);
        let size = length.saturating_mul(points);
        if size > LARGEST {
            return Err(self.refused(&format!("this node has {points} points, too many to be in memory together")));
        }
        let unpacked = is_compressed.then(|| decompressed(bytes.as_ref(), size as usize + 1));
        let (records, damage) = match &unpacked {
            Some((records, damage)) => (records.as_slice(), damage.as_deref()),
            None => (bytes.as_ref(), None),
        };
        if records.len() as u64 > size {
            return Err(self.refused(&format!("this node has more bytes than {points} records of {length}")));
        }
        let mut sink = self.sink(sink);
        let whole = records.len() as u64 / length;
        let wanted = self.request.records;
        for (number, record) in (0..wanted.min(whole)).zip(records.chunks_exact(layout.length)) {
            match layout.record(record, self.request.fields) {
                Some(record) => sink.push(number, &record, || format!("point {number}"))?,
                None => sink.malformed(1, || format!("point {number} has coordinates beyond 32 bits")),
            }
        }
        if wanted > whole {
            let why = damage.map_or(String::new(), |damage| format!(" ({damage})"));
            sink.malformed(wanted - whole, || {
                format!("this node ends after {whole} of {points} points{why}; copy it again, or allow the loss")
            });
        }
        Ok(())
    }
}

/// Returns the header of a LAZ file, and its points.
fn read_laz(file: &RandomAccessFile) -> Result<(LasHeader, CompressedPoints)> {
    let mut unusual = Warnings::default();
    let header = LasHeader::read(file, &mut unusual)?;
    let vlrs = vlr::list(file, &header, &mut unusual)?;
    let points = CompressedPoints::read(file, &header, &vlrs, false, &mut unusual)?;
    Ok((header, points))
}

/// Groups nodes into chunks.
fn ends_of_chunks(nodes: &[Node]) -> Vec<(usize, u64)> {
    let (mut ends, mut records, mut before) = (Vec::new(), 0, 0);
    for (index, node) in nodes.iter().enumerate() {
        records += node.points;
        if records - before >= LEAST_RECORDS || index + 1 == nodes.len() {
            ends.push((index + 1, records));
            before = records;
        }
    }
    ends
}
