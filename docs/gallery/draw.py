"""Draws triangles in sun and sky light: a z-buffer, shadows from many directions, and antialiasing by drawing everything larger."""

from dataclasses import dataclass, field

import numpy as np
from PIL import Image, ImageDraw, ImageFont

CHUNK = 1 << 17  # how many pixels are looked at together, so that the arrays are small enough to be reused
SHADOW_PIXELS = 1000


@dataclass
class Scene:
    """Triangles with a colour each, and how they are shaded."""

    places: np.ndarray
    triangles: np.ndarray
    colors: np.ndarray  # (triangles, 3, 3): linear colours of the corners
    normals: np.ndarray  # (triangles, 3, 3): of the corners
    edges: np.ndarray = None  # (triangles, 3): how edges opposite to the corners look: 0 not at all, 1 thin, 2 as breaklines

    def joined(self, other):
        edges = [np.zeros((len(s.triangles), 3), int) if s.edges is None else s.edges for s in (self, other)]
        return Scene(
            np.concatenate([self.places, other.places]),
            np.concatenate([self.triangles, other.triangles + len(self.places)]),
            np.concatenate([self.colors, other.colors]),
            np.concatenate([self.normals, other.normals]),
            np.concatenate(edges),
        )


@dataclass
class Camera:
    """Looks at a place from an azimuth (degrees from north, clockwise: where the camera is) and a height above the horizon."""

    target: tuple
    azimuth: float
    elevation: float
    distance: float
    field_of_view: float  # degrees, across the picture
    size: tuple  # pixels
    axes: np.ndarray = field(init=False)

    def __post_init__(self):
        self.axes = frame(direction(self.azimuth, self.elevation))

    def project(self, places):
        """Returns pixels, and depths that grow linearly across a triangle on the screen and fall with the distance."""
        seen = (np.asarray(places, float) - self.target) @ self.axes.T
        away = self.distance - seen[:, 2]
        scale = self.size[0] / 2.0 / np.tan(np.radians(self.field_of_view / 2.0))
        x = self.size[0] / 2.0 + scale * seen[:, 0] / away
        y = self.size[1] / 2.0 - scale * seen[:, 1] / away
        return np.column_stack([x, y]), 1.0 / away


def direction(azimuth, elevation):
    """Returns the unit vector to somewhere in the sky."""
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)])


def frame(toward):
    """Returns right, up and toward, for somebody who looks from there."""
    right = np.cross([0.0, 0.0, 1.0], toward)
    if np.linalg.norm(right) < 1e-9:
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(toward, right), toward])


def rasterize(pixels, nearness, triangles, size):
    """Returns for every pixel the triangle that is nearest there, or -1, and how near it is."""
    width, height = size
    corners = pixels[triangles]
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, [width, height]).astype(np.int64)
    high = np.clip(np.floor(corners.max(axis=1) - 0.5) + 1, 0, [width, height]).astype(np.int64)
    spans = np.maximum(high - low, 0)
    counts = spans[:, 0] * spans[:, 1]
    near, far = nearness.max(), nearness.min()
    steps = (near - nearness) / max(near - far, 1e-300) * (2**31)
    buffer = np.full(width * height, np.iinfo(np.int64).max)
    order = np.flatnonzero(counts)
    ends = np.cumsum(counts[order])
    start = 0
    while start < len(order):
        stop = max(start + 1, int(np.searchsorted(ends, (ends[start - 1] if start else 0) + CHUNK)))
        fill(buffer, width, corners, steps, triangles, low, spans, order[start:stop])
        start = stop
    empty = (buffer == np.iinfo(np.int64).max).reshape(height, width)
    buffer = buffer.reshape(height, width)
    depths = near - (buffer >> 32) * ((near - far) / 2**31)
    return np.where(empty, -1, buffer & 0xFFFFFFFF), np.where(empty, -np.inf, depths)


def fill(buffer, width, corners, steps, triangles, low, spans, chunk):
    """Draws a chunk of triangles."""
    counts = spans[chunk, 0] * spans[chunk, 1]
    owner = np.repeat(chunk, counts)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    x = low[owner, 0] + place % spans[owner, 0]
    y = low[owner, 1] + place // spans[owner, 0]
    weights = barycentric(corners[owner], x + 0.5, y + 0.5)
    inside = (weights >= 0.0).all(axis=1)
    owner, x, y, weights = owner[inside], x[inside], y[inside], weights[inside]
    depth = np.clip((weights * steps[triangles[owner]]).sum(axis=1), 0, 2**31 - 1).astype(np.int64)
    np.minimum.at(buffer, y * width + x, depth << 32 | owner)


def barycentric(corners, x, y):
    """Returns the three weights of each place in its triangle; those of a triangle without area are negative."""
    ax, ay, bx, by, cx, cy = (corners[:, k // 2, k % 2] for k in range(6))
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    area = np.where(area == 0.0, np.nan, area)
    first = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
    second = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
    return np.nan_to_num(np.column_stack([first, second, 1.0 - first - second]), nan=-1.0)


class ShadowMap:
    """What light from one direction meets first."""

    def __init__(self, places, triangles, toward):
        self.axes = frame(toward)
        seen = places @ self.axes.T
        used = seen[np.unique(triangles), :2]
        self.low, high = used.min(axis=0), used.max(axis=0)
        self.scale = SHADOW_PIXELS / (high - self.low).max()
        size = tuple(int(n) + 1 for n in (high - self.low) * self.scale)
        pixels = (seen[:, :2] - self.low) * self.scale
        self.heights = rasterize(pixels, seen[:, 2], triangles, size)[1]

    def lit(self, places, normals):
        """Whether light comes to places; each is lifted by a pixel and a half, so that no triangle shades itself."""
        seen = (places + normals * (1.5 / self.scale)) @ self.axes.T
        x, y = ((seen[:, k] - self.low[k]) * self.scale for k in range(2))
        height, width = self.heights.shape
        within = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        x, y = (np.where(within, v, 0).astype(int) for v in (x, y))
        return ~within | (seen[:, 2] + 0.5 / self.scale >= self.heights[y, x])


@dataclass
class Light:
    toward: np.ndarray
    color: np.ndarray
    diffuse: bool  # whether it is one of many that together fall alike on level ground, so that its cosine counts already


def lights(azimuth, elevation, sky=28, suns=6):
    """Returns a soft sun, and a sky that is brighter above. Together they light level ground with about 1."""
    rng = np.random.default_rng(1)
    for _ in range(suns):
        toward = direction(azimuth + rng.normal(0, 1.6), elevation + rng.normal(0, 1.6))
        yield Light(toward, np.array([1.06, 0.99, 0.88]) * 1.08 / suns, False)
    for i in range(sky):
        turn, up = 360.0 * ((i * 0.618034) % 1.0), np.degrees(np.arcsin(np.sqrt((i + 0.5) / sky)))
        yield Light(direction(turn, up), np.array([0.88, 0.98, 1.14]) * 0.36 / sky, True)


def shade(scene, casters, camera, sun=(315.0, 38.0), edge_width=1.1):
    """Returns the picture of a scene, in linear colours. Triangles after the first `casters` throw no shadow."""
    pixels, nearness = camera.project(scene.places)
    ids, _ = rasterize(pixels, nearness, scene.triangles, camera.size)
    solid = scene.triangles[:casters]
    places = scene.places[: solid.max() + 1]
    shadows = [(light, ShadowMap(places, solid, light.toward)) for light in lights(*sun)]
    picture = np.ones((camera.size[0] * camera.size[1], 3))
    found = np.flatnonzero(ids.reshape(-1) >= 0)
    for start in range(0, len(found), CHUNK):
        chunk = found[start : start + CHUNK]
        y, x = chunk // camera.size[0], chunk % camera.size[0]
        picture[chunk] = shade_pixels(scene, pixels, nearness, shadows, ids.reshape(-1)[chunk], (x, y), edge_width)
    return picture.reshape(camera.size[1], camera.size[0], 3)


def shade_pixels(scene, pixels, nearness, shadows, owner, at, edge_width):
    """Returns the colours of some pixels."""
    corners = scene.triangles[owner]
    on_screen = barycentric(pixels[corners], at[0] + 0.5, at[1] + 0.5)
    weights = on_screen * nearness[corners]
    weights /= weights.sum(axis=1, keepdims=True)
    places, normals, albedo = (
        (weights[:, :, None] * values).sum(axis=1) for values in (scene.places[corners], scene.normals[owner], scene.colors[owner])
    )
    normals = unit(normals)
    light = np.zeros_like(places)
    for lamp, shadow in shadows:
        cosine = np.maximum(normals @ lamp.toward, 0.0)
        if lamp.diffuse:
            cosine = np.minimum(cosine / lamp.toward[2], 1.5)
        light += (cosine * shadow.lit(places, normals))[:, None] * lamp.color
    color = albedo * light
    return color if scene.edges is None else draw_edges(color, on_screen, pixels[corners], scene.edges[owner], edge_width)


EDGE_COLORS = {1: (0.02, 0.03, 0.04), 2: (0.75, 0.02, 0.01)}


def draw_edges(color, weights, corners, kinds, width):
    """Blends the edges of triangles in, the thin ones first."""
    sides = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]
    lengths = np.hypot(sides[..., 0], sides[..., 1])
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    distance = weights * area[:, None] / np.maximum(lengths, 1e-9)
    for kind, strength, wide in ((1, 0.5, width), (2, 1.0, 2.4 * width)):
        near = np.where(kinds == kind, distance, np.inf).min(axis=1)
        cover = strength * np.clip(wide / 2.0 + 0.5 - near, 0.0, 1.0)[:, None]
        color = color * (1.0 - cover) + np.array(EDGE_COLORS[kind]) * cover
    return color


def unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def flat_normals(places, triangles):
    a, b, c = (places[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def corner_normals(places, triangles, roundness):
    """Returns normals between those of the triangles (0) and those of their corners (1)."""
    flat = flat_normals(places, triangles)
    around = np.zeros_like(places)
    for k in range(3):
        np.add.at(around, triangles[:, k], flat)
    return unit((1.0 - roundness) * unit(flat)[:, None, :] + roundness * unit(around)[triangles])


def walls(places, triangles, base, color):
    """Returns the sides of the block of earth below the triangles, down to a height."""
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    keys = np.sort(edges, axis=1)
    _, first, count = np.unique(keys, axis=0, return_index=True, return_counts=True)
    rim = edges[first[count == 1]]
    top = places[rim].reshape(-1, 3)
    bottom = top * [1.0, 1.0, 0.0] + [0.0, 0.0, base]
    corners = np.stack([top.reshape(-1, 2, 3), bottom.reshape(-1, 2, 3)], axis=1).reshape(-1, 3)
    start = 4 * np.arange(len(rim))[:, None]
    faces = np.concatenate([start + [1, 0, 2], start + [1, 2, 3]])
    shades = np.broadcast_to(np.array(color), (len(faces), 3, 3))
    return Scene(corners, faces, shades, corner_normals(corners, faces, 0.0))


def floor(low, high, height, color):
    """Returns a plane that everything stands on."""
    places = np.array([[x, y, height] for x in (low[0], high[0]) for y in (low[1], high[1])])
    faces = np.array([[0, 2, 1], [1, 2, 3]])
    return Scene(places, faces, np.broadcast_to(np.array(color), (2, 3, 3)), corner_normals(places, faces, 0.0))


def encoded(linear):
    """Turns light into the numbers of a picture (sRGB), with a soft shoulder for what is too bright."""
    linear = np.maximum(linear, 0.0)
    soft = np.where(linear > 0.8, 0.8 + 0.2 * np.tanh((linear - 0.8) / 0.2), linear)
    return np.where(soft <= 0.0031308, 12.92 * soft, 1.055 * soft ** (1 / 2.4) - 0.055)


def linear(color):
    """Turns numbers of a picture (sRGB) into light."""
    color = np.asarray(color, float)
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


def to_image(picture, times):
    """Makes a picture that was drawn so many times larger an image: the mean of its pixels, in light."""
    height, width = picture.shape[0] // times, picture.shape[1] // times
    small = np.minimum(picture, 1.5).reshape(height, times, width, times, 3).mean(axis=(1, 3))
    return Image.fromarray((np.clip(encoded(small), 0, 1) * 255 + 0.5).astype(np.uint8))


def label(image, place, text, size=22, fill=(35, 40, 45)):
    """Writes into a picture, with a white rim."""
    ImageDraw.Draw(image).text(place, text, fill=fill, font=ImageFont.load_default(size), stroke_width=3, stroke_fill="white")
