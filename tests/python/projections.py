"""Writes places and where PROJ has them on maps, for tests/input/projections.rs.

Arguments: a file to write, then for each map the code of its longitudes and latitudes, its own code, and the least longitude, the
least latitude, the greatest longitude and the greatest latitude. The file has longitude, latitude, x, y of each place in turn.
"""

import random
import sys
from array import array

from pyproj import Transformer

PLACES = 100_000

out, maps = sys.argv[1], sys.argv[2:]
with open(out, "wb") as file:
    for base, code, *area in (maps[at : at + 6] for at in range(0, len(maps), 6)):
        west, south, east, north = map(float, area)
        chance = random.Random(int(code))
        longitudes = array("d", (chance.uniform(west, east) for _ in range(PLACES)))
        latitudes = array("d", (chance.uniform(south, north) for _ in range(PLACES)))
        way = Transformer.from_crs(f"EPSG:{base}", f"EPSG:{code}", always_xy=True)
        x, y = way.transform(longitudes, latitudes)
        array("d", (value for place in zip(longitudes, latitudes, x, y) for value in place)).tofile(file)
