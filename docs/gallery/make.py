#!/usr/bin/env python3
"""Makes the pictures of docs/gallery.md: runs the configurations in this folder, and draws what the jobs wrote.

    python3 make.py [NAME...]       all pictures, or those named: valley, triangles, surfaces, raster, hull

It takes numpy and Pillow, and the program gdt-batch on the path or at GDT_BATCH. SAMPLES=1 draws faster and coarser than SAMPLES=3.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import draw
import terrain
import valley

HERE = Path(__file__).parent
SAMPLES = int(os.environ.get("SAMPLES", "3"))
WATER = 9


def run(name):
    """Runs a configuration, and reads what it wrote."""
    if name.startswith("autzen") and not (HERE / "data" / "autzen_trim.las").exists():
        sys.exit(f"{HERE / 'data' / 'autzen_trim.las'} is missing; docs/gallery.md says where to get it")
    program = os.environ.get("GDT_BATCH", "gdt-batch")
    subprocess.run([program, "--quiet", str(HERE / f"{name}.toml")], check=True)
    return terrain.read_terrain(HERE / "out" / name)


def ramp(values, stops):
    """Returns the linear colours of values between 0 and 1."""
    at = np.linspace(0.0, 1.0, len(stops))
    table = draw.linear(np.array(stops) / 255.0)
    return np.stack([np.interp(values, at, table[:, k]) for k in range(3)], axis=-1)


LAND = [(104, 140, 92), (134, 160, 100), (170, 178, 116), (196, 184, 132), (190, 162, 122), (178, 150, 124), (214, 204, 192)]
BLUE = draw.linear(np.array([86, 142, 178]) / 255.0)
EARTH = draw.linear(np.array([178, 160, 138]) / 255.0)
FLOOR = (0.97, 0.97, 0.97)


def land_colors(mesh, low=400.0, high=426.0, water=True):
    """Colours triangles by height, and those with three corners in water blue."""
    heights = mesh.places[:, 2] + mesh.georeference["offset"][2]
    height = np.clip((heights[mesh.triangles] - low) / (high - low), 0.0, 1.0)
    colors = ramp(height, LAND)
    if water:
        colors[(mesh.classes[mesh.triangles] == WATER).all(axis=1)] = BLUE
    return colors


def block(mesh, colors, lift, thickness, roundness=0.35, edges=None):
    """Makes a block of earth on a plane; returns the scene and how many triangles throw shadows."""
    places = mesh.places * [1.0, 1.0, lift]
    used = places[np.unique(mesh.triangles)]
    base = used[:, 2].min() - thickness
    scene = draw.Scene(places, mesh.triangles, colors, draw.corner_normals(places, mesh.triangles, roundness), edges)
    scene = scene.joined(draw.walls(places, mesh.triangles, base, EARTH))
    reach = 0.8 * (used.max(axis=0) - used.min(axis=0))
    ground = draw.floor(used.min(axis=0) - reach, used.max(axis=0) + reach, base, FLOOR)
    return scene.joined(ground), len(scene.triangles)


def camera(target, azimuth, elevation, distance, view, width, height):
    return draw.Camera(target, azimuth, elevation, distance, view, (width * SAMPLES, height * SAMPLES))


def picture(scene, casters, eye, sun=(300.0, 36.0), edge_width=1.1):
    return draw.to_image(draw.shade(scene, casters, eye, sun, edge_width=edge_width * SAMPLES), SAMPLES)


def joined(images, across, gap=6):
    """Puts pictures side by side, or one below the other."""
    wide = sum(image.width for image in images) + gap * (len(images) - 1)
    high = sum(image.height for image in images) + gap * (len(images) - 1)
    whole = Image.new("RGB", (wide, images[0].height) if across else (images[0].width, high), "white")
    at = 0
    for image in images:
        whole.paste(image, (at, 0) if across else (0, at))
        at += gap + (image.width if across else image.height)
    return whole


def save(image, name, quality=82):
    image.save(HERE / f"{name}.jpg", quality=quality, optimize=True, progressive=True)


def make_valley():
    """The whole valley, from the points alone and with breaklines."""
    images = []
    for name, text in (("valley-points", "the points alone"), ("valley-breaklines", "with [[breaklines]]")):
        mesh = run(name)
        scene, casters = block(mesh, land_colors(mesh), 1.5, 8.0)
        image = picture(scene, casters, camera((4.0, -10.0, 0.0), 205.0, 36.0, 1500.0, 21.6, 1100, 540))
        draw.label(image, (24, 18), text, 26)
        images.append(image)
    save(joined(images, False), "valley")


BEND = np.array([[612208.0, 5278088.0], [612300.0, 5278180.0]])  # of the river, with a part of the lake's shore
REACH = np.array([[612257.0, 5278122.0], [612301.0, 5278166.0]])  # of the river, with both banks
LOW, HIGH = 399.0, 407.5  # heights there, for colours


def close_up(mesh, directory, place, size, colors=land_colors, lift=1.5):
    """Draws the triangles at a place, with their edges; those along breaklines are red."""
    middle = place.mean(axis=0) - mesh.georeference["offset"][:2]
    half = (place[1] - place[0]) / 2.0
    part = mesh.cropped(middle - half, middle + half)
    edges = np.ones((len(part.triangles), 3), int)
    if directory:
        edges[part.breakline_edges(directory)] = 2
    scene, casters = block(part, colors(part), lift, 4.0, 0.0, edges)
    height = lift * part.places[np.unique(part.triangles), 2].mean() - 1.0
    view = 0.208 * half[0]
    return picture(scene, casters, camera((*middle, height), 205.0, 40.0, 700.0, view, *size), edge_width=0.8)


def make_triangles():
    """The bend of the river, triangle by triangle."""
    images = []
    for name, text in (("valley-points", "the points alone"), ("valley-breaklines", "with [[breaklines]]")):
        lines = HERE / "out" / name if name == "valley-breaklines" else None
        images.append(close_up(run(name), lines, BEND, (547, 430)))
        draw.label(images[-1], (16, 12), text, 20)
    save(joined(images, True), "triangles")


def make_surfaces():
    """The same place as bare earth and as first returns."""
    images = []
    for name, text in (("autzen-first", 'surface = "first"'), ("autzen-ground", 'surface = "ground"')):
        mesh = run(name)
        scene, casters = block(mesh, (1.25 * mesh.colors)[mesh.triangles], 1.0, 6.0, 0.5)
        image = picture(scene, casters, camera((0.0, -6.0, 6.0), 196.0, 38.0, 1400.0, 16.3, 1100, 480))
        draw.label(image, (24, 18), text, 26)
        images.append(image)
    save(joined(images, False), "surfaces")


def hillshade(heights, cell, azimuth=300.0, elevation=36.0):
    """Returns how bright each cell is in the sun; the slope is that between its neighbours."""
    north, east = np.gradient(heights, cell)
    normals = draw.unit(np.stack([-east, north, np.ones_like(east)], axis=-1))
    return np.maximum(normals @ draw.direction(azimuth, elevation), 0.0)


def read_raster(path):
    """Returns the heights of a GeoTIFF, the side of a cell, and its north-west corner."""
    with Image.open(path) as image:
        cell, corner = image.tag_v2[33550][0], image.tag_v2[33922][3:5]
        return np.asarray(image, float), cell, corner


def raster_map(directory, place, pixels):
    """Draws the cells of terrain.tif at a place, so many pixels wide each, without any smoothing."""
    heights, cell, (west, north) = read_raster(directory / "terrain.tif")
    column, row = round((place[0, 0] - west) / cell), round((north - place[1, 1]) / cell)
    count = round((place[1, 0] - place[0, 0]) / cell)
    rows, columns = slice(row, row + count), slice(column, column + count)
    colors = ramp(np.clip((heights[rows, columns] - LOW) / (HIGH - LOW), 0.0, 1.0), LAND)
    light = 0.05 + 1.45 * hillshade(heights, cell)[rows, columns]
    return draw.to_image((colors * light[..., None]).repeat(pixels, axis=0).repeat(pixels, axis=1), 1)


def draw_outlines(image, mesh, directory, place):
    """Draws the edges of the triangles thinly over a map of a place; those along breaklines are red."""
    scale = 3 * image.width / (place[1, 0] - place[0, 0])
    source = mesh.places[:, :2] + mesh.georeference["offset"][:2]
    pixels = np.column_stack([source[:, 0] - place[0, 0], place[1, 1] - source[:, 1]]) * scale
    along = mesh.breakline_edges(directory)
    for lines, width, strength, color in ((False, 3, 95, (10, 14, 16)), (True, 6, 255, (226, 38, 30))):
        mask = Image.new("L", (3 * image.width, 3 * image.height))
        pen = ImageDraw.Draw(mask)
        for triangle, corner in np.argwhere(along >= lines):
            ends = pixels[mesh.triangles[triangle][[(corner + 1) % 3, (corner + 2) % 3]]]
            pen.line([tuple(p) for p in ends], fill=strength, width=width)
        image.paste(color, mask=mask.resize(image.size, Image.Resampling.BOX))


def make_raster():
    """The triangles at the river, and the cells of terrain.tif there."""
    mesh = run("raster")
    cells = raster_map(HERE / "out" / "raster", REACH, 11)
    draw_outlines(cells, mesh, HERE / "out" / "raster", REACH)
    size = (1100 - 6 - cells.width, cells.height)
    triangles = close_up(mesh, HERE / "out" / "raster", REACH, size, lambda part: land_colors(part, LOW, HIGH, water=False))
    draw.label(triangles, (16, 12), "the triangles", 20)
    draw.label(cells, (16, 12), "the cells of terrain.tif, from above", 20)
    save(joined([triangles, cells], True), "raster")


def make_hull():
    """A corridor along the river with three choices for the outside."""
    images = []
    for name, text in (("hull-whole", 'hull = "whole"'), ("hull-trimmed", 'hull = "trimmed"'), ("hull-max-edge", "max_edge = 15.0")):
        mesh = run(name)
        edges = np.ones((len(mesh.triangles), 3), int)
        scene, casters = block(mesh, land_colors(mesh), 1.0, 3.0, 0.0, edges)
        image = picture(scene, casters, camera((0.0, 0.0, 0.0), 180.0, 60.0, 1500.0, 17.2, 1100, 360), edge_width=0.4)
        draw.label(image, (24, 14), text, 24)
        images.append(image)
    save(joined(images, False), "hull")


PICTURES = {"valley": make_valley, "triangles": make_triangles, "surfaces": make_surfaces, "raster": make_raster, "hull": make_hull}


def check_page():
    """Stops if the page shows a configuration that is not one of the files."""
    files = {path.read_text(encoding="utf-8") for path in HERE.glob("*.toml")}
    page = (HERE.parent / "gallery.md").read_text(encoding="utf-8")
    for part in page.split("```toml\n")[1:]:
        if part.split("```")[0] not in files:
            sys.exit(f"no file in {HERE} has this configuration of gallery.md:\n{part.split('```')[0]}")


def main():
    check_page()
    valley.main()
    for name in sys.argv[1:] or PICTURES:
        PICTURES[name]()


if __name__ == "__main__":
    main()
