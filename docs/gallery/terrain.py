"""Reads what gdt-batch writes: the triangles of its tiles (compression = "none"), and the edges along breaklines."""

import csv
import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


@dataclass
class Terrain:
    """A mesh in metres: x east, y north, z up, from the offset that georeference.json names."""

    places: np.ndarray  # (vertices, 3)
    triangles: np.ndarray  # (triangles, 3)
    classes: np.ndarray  # (vertices,), 0 without [output] attributes
    colors: np.ndarray  # (vertices, 3), 0 to 1, linear
    georeference: dict

    def local(self, source):
        """Turns source coordinates into those of the mesh."""
        scale = [self.georeference["metres_per_unit"]] * 2 + [self.georeference["metres_per_unit_z"]]
        return (np.asarray(source, float) - self.georeference["offset"]) * scale

    def cropped(self, low, high):
        """Keeps the triangles that lie within a rectangle of the mesh's coordinates."""
        inside = ((self.places[:, :2] >= low) & (self.places[:, :2] <= high)).all(axis=1)
        kept = self.triangles[inside[self.triangles].all(axis=1)]
        return Terrain(self.places, kept, self.classes, self.colors, self.georeference)

    def breakline_edges(self, directory):
        """Says of each triangle which of its edges, opposite to its corners, lie along breaklines."""
        with open(Path(directory) / "breaklines.csv", encoding="utf-8") as file:
            rows = [[float(v) for v in row[:6]] for row in list(csv.reader(file))[1:]]
        ends = self.local(np.array(rows).reshape(-1, 3))[:, :2]
        ids = nearest(self.places[:, :2], ends).reshape(-1, 2)
        lines = {frozenset(edge) for edge in ids.tolist()}
        corners = self.triangles.tolist()
        return np.array([[frozenset((t[(k + 1) % 3], t[(k + 2) % 3])) in lines for k in range(3)] for t in corners])


def nearest(places, wanted):
    """Returns the vertex at each wanted place, to the millimetre."""
    index = {key: i for i, key in enumerate(map(tuple, np.rint(places * 1000).astype(int).tolist()))}
    return np.array([index.get(key, -1) for key in map(tuple, np.rint(wanted * 1000).astype(int).tolist())])


def read_terrain(directory):
    """Reads all tiles of a job's output, and joins them along their borders."""
    directory = Path(directory)
    tiles = [read_glb(path) for path in sorted(directory.glob("tiles/**/*.glb"))]
    starts = np.cumsum([0] + [len(tile[0]) for tile in tiles[:-1]])
    places, classes, colors = (np.concatenate([tile[k] for tile in tiles]) for k in (0, 2, 3))
    triangles = np.concatenate([tile[1] + start for tile, start in zip(tiles, starts)])
    _, first, merged = np.unique(np.rint(places[:, :2] * 1000).astype(int), axis=0, return_index=True, return_inverse=True)
    triangles = merged.reshape(-1)[triangles]
    georeference = json.loads((directory / "georeference.json").read_text())
    return Terrain(places[first], triangles, classes[first], colors[first], georeference)


def read_glb(path):
    """Reads places, triangles, classes and colours of a tile."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    document = json.loads(data[20 : 20 + length])
    binary = data[20 + length + 8 :]
    node = next(node for node in document["nodes"] if "mesh" in node)
    primitive = document["meshes"][node["mesh"]]["primitives"][0]
    attributes = primitive["attributes"]
    scene = read_accessor(document, binary, attributes["POSITION"]) + np.array(node.get("translation", [0.0, 0.0, 0.0]))
    places = np.column_stack([scene[:, 0], -scene[:, 2], scene[:, 1]])
    classes = np.zeros(len(places), int)
    if "_CLASSIFICATION" in attributes:
        classes = read_accessor(document, binary, attributes["_CLASSIFICATION"]).reshape(-1).astype(int)
    colors = read_accessor(document, binary, attributes["COLOR_0"])[:, :3] / 65535.0 if "COLOR_0" in attributes else np.zeros_like(places)
    return places, read_accessor(document, binary, primitive["indices"]).reshape(-1, 3).astype(np.int64), classes, colors


def read_accessor(document, binary, index):
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    kind, width = np.dtype(COMPONENTS[accessor["componentType"]]), WIDTHS[accessor["type"]]
    stride = view.get("byteStride", kind.itemsize * width)
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    rows = np.ndarray((accessor["count"], width), kind, binary, start, (stride, kind.itemsize))
    return rows.astype(np.float64)
