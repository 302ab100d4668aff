#!/usr/bin/env python3
"""Writes the river valley of the gallery: a sparse cloud, the lines that a surveyor would draw over it, and a corridor along the river.

    python3 valley.py        makes data/valley.csv, data/valley.geojson and data/corridor.csv

It needs nothing but Python. The same files come out every time.
"""

import json
import math
import random
from pathlib import Path

EAST, NORTH = 612000.0, 5278000.0  # of the south-west corner, in ETRS89 / UTM zone 32N (EPSG:25832)
WIDTH, HEIGHT = 420.0, 300.0
SPACING = 4.0  # about how far apart the points are
LAKE = (270.0, 66.0)
LAKE_LEVEL = 401.2


def river_middle(x):
    """Returns y of the middle of the river."""
    return 150.0 + 34.0 * math.sin(x / 47.0) + 11.0 * math.sin(x / 23.0 + 1.0)


def river_slope(x):
    return (river_middle(x + 0.5) - river_middle(x - 0.5)) / 1.0


def river_half_width(x):
    return 6.5 + 1.5 * math.sin(x / 31.0 + 2.0)


def river_level(x):
    """Returns the height of the water, which falls to the east."""
    return 402.0 - 0.006 * x


def river_distance(x, y):
    """Returns how far a place is from the water's edge; it is negative in the river."""
    nearest = min(math.hypot(x + i - x, river_middle(x + i) - y) - river_half_width(x + i) for i in range(-60, 61, 2))
    if nearest > 12.0:
        return nearest
    steps = (i / 10.0 for i in range(-200, 201))
    return min(math.hypot(s, river_middle(x + s) - y) - river_half_width(x + s) for s in steps)


def lake_radius(angle):
    return 33.0 + 9.0 * math.cos(2.0 * angle - 0.6) + 4.0 * math.sin(3.0 * angle)


def lake_distance(x, y):
    """Returns about how far a place is from the shore; it is negative in the lake."""
    dx, dy = (x - LAKE[0]) / 1.35, y - LAKE[1]
    return math.hypot(dx, dy) - lake_radius(math.atan2(dy, dx))


def levee_middle(x):
    """Returns y of the middle of the levee, north of the river."""
    return 232.0 + 9.0 * math.sin(x / 70.0 + 0.4)


def smooth(a, b, t):
    """Rises from 0 at a to 1 at b."""
    t = min(1.0, max(0.0, (t - a) / (b - a)))
    return t * t * (3.0 - 2.0 * t)


def waves(x, y):
    """Returns the unevenness of the ground, some decimetres."""
    return (
        0.9 * math.sin(x / 41.0 + 0.7 * math.sin(y / 29.0))
        + 0.7 * math.sin(y / 33.0 + 1.3 * math.sin(x / 53.0))
        + 0.25 * math.sin(x / 11.0 + y / 17.0)
    )


def hills(x, y):
    """Returns the sides of the valley: a low terrace in the south, hills with gullies in the north."""
    terrace = 2.6 * smooth(0.0, 9.0, 34.0 + 9.0 * math.sin(x / 61.0 + 1.2) - y)
    rise = max(0.0, y - 256.0 - 5.0 * math.sin(x / 37.0)) / 44.0
    gullies = 1.0 + 0.2 * math.sin(x / 13.0 + 0.8 * math.sin(x / 31.0)) + 0.06 * math.sin(x / 6.0 + y / 14.0)
    return terrace + 17.0 * rise**1.2 * gullies


def levee(x, y):
    """Returns how much the levee is above the plain: 3 m high, 4 m wide on top, with sides of 1 : 2."""
    across = abs(y - levee_middle(x))
    return 3.0 * min(1.0, max(0.0, (8.0 - across) / 6.0))


def plain(x, y):
    """Returns the ground without the river and the lake."""
    return river_level(x) + 3.4 + 0.5 * waves(x, y) + hills(x, y) + levee(x, y)


def ground(x, y):
    """Returns the height of dry ground, with the banks of the river and the shore of the lake."""
    z = plain(x, y)
    bank = min(1.0, max(0.0, river_distance(x, y) / 4.0))
    z = river_level(x) + (z - river_level(x)) * bank
    shore = smooth(0.0, 14.0, lake_distance(x, y))
    return LAKE_LEVEL + (z - LAKE_LEVEL) * shore


def echoes(x, y):
    """Whether the laser had an echo from the water at a place: only in patches, since calm water swallows most of the light."""
    return math.sin(x / 9.0 + 2.0 * math.sin(y / 13.0)) + math.sin(y / 8.0 + x / 21.0) > 0.3


def survey(rng):
    """Yields x, y, z and the class of every point."""
    columns, rows = int(WIDTH / SPACING), int(HEIGHT / SPACING)
    for i in range(columns + 1):
        for j in range(rows + 1):
            x, y = i * SPACING, j * SPACING
            if 0 < i < columns:
                x += rng.uniform(-0.45, 0.45) * SPACING
            if 0 < j < rows:
                y += rng.uniform(-0.45, 0.45) * SPACING
            noise = rng.gauss(0.0, 1.0)
            wet = river_distance(x, y) < 0.0, lake_distance(x, y) < 0.0
            if not any(wet):
                yield x, y, ground(x, y) + 0.04 * noise, 2
            elif echoes(x, y):
                yield x, y, (river_level(x) if wet[0] else LAKE_LEVEL) + 0.12 * noise, 9


def write_cloud(path, points):
    with open(path, "w", encoding="ascii", newline="\n") as file:
        file.write("x,y,z,classification\n")
        for x, y, z, kind in points:
            file.write(f"{EAST + x:.2f},{NORTH + y:.2f},{z:.2f},{kind}\n")


def beside_river(distance, side, lift):
    """Returns a line along the river, so far from the water's edge, on the left (1) or right (-1), from west to east."""
    line = []
    for step in range(-10, int(WIDTH / 3.0) + 11):
        x = 3.0 * step
        run = math.hypot(1.0, river_slope(x))
        out = side * (river_half_width(x) + distance)
        px, py = x - out * river_slope(x) / run, river_middle(x) + out / run
        line.append((px, py, lift(x, px, py)))
    return line


def lake_shore():
    ring = []
    for step in range(72):
        angle = step * math.tau / 72.0
        r = lake_radius(angle)
        ring.append((LAKE[0] + 1.35 * r * math.cos(angle), LAKE[1] + r * math.sin(angle), LAKE_LEVEL))
    return ring + ring[:1]


def beside_levee(offset):
    xs = [-12.0 + 4.0 * step for step in range(int(WIDTH / 4.0) + 7)]
    return [(x, levee_middle(x) + offset, ground(x, levee_middle(x) + offset)) for x in xs]


def feature(name, kind, geometry, line):
    """Returns a feature of GeoJSON: a line, or an area with this ring."""
    places = [[round(EAST + x, 2), round(NORTH + y, 2), round(z, 2)] for x, y, z in line]
    places = [places] if geometry == "Polygon" else places
    return {"type": "Feature", "properties": {"name": name, "type": kind}, "geometry": {"type": geometry, "coordinates": places}}


def features():
    banks = [beside_river(0.0, side, lambda x, *_: river_level(x)) for side in (1, -1)]
    yield feature("the river", "river", "Polygon", banks[0] + banks[1][::-1] + banks[0][:1])
    yield feature("the lake", "lake", "Polygon", lake_shore())
    for side, name in ((1, "top of the left bank"), (-1, "top of the right bank")):
        yield feature(name, "line", "LineString", beside_river(4.0, side, lambda _, x, y: ground(x, y)))
    for offset in (-8.0, -2.0, 2.0, 8.0):
        yield feature("levee", "line", "LineString", beside_levee(offset))


def write_lines(path):
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}
    collection = {"type": "FeatureCollection", "crs": crs, "features": list(features())}
    path.write_text(json.dumps(collection) + "\n", encoding="ascii")


def main():
    folder = Path(__file__).parent / "data"
    folder.mkdir(exist_ok=True)
    points = list(survey(random.Random(18)))
    write_cloud(folder / "valley.csv", points)
    write_cloud(folder / "corridor.csv", [p for p in points if abs(p[1] - river_middle(p[0])) < 42.0 * math.hypot(1.0, river_slope(p[0]))])
    write_lines(folder / "valley.geojson")


if __name__ == "__main__":
    main()
