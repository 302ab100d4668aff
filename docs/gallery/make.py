#!/usr/bin/env python3
"""Makes the pictures of docs/gallery.md again.

    GDT_BATCH=../../target/release/gdt-batch python3 make.py [NAME...]
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

import draw
import terrain
import valley

HERE = Path(__file__).parent
SAMPLES = int(os.environ.get("SAMPLES", "3"))
WATER = 9


def run(name):
    """Runs a configuration, and reads what it wrote."""
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
EARTH = draw.linear(np.array([150, 132, 112]) / 255.0)
FLOOR = (0.97, 0.97, 0.97)


def land_colors(mesh, low, high):
    """Colours triangles by height, and those with three corners in water blue."""
    heights = mesh.places[:, 2] + mesh.georeference["offset"][2]
    height = np.clip((heights[mesh.triangles] - low) / (high - low), 0.0, 1.0)
    colors = ramp(height, LAND)
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


def stacked(images, gap=6):
    """Puts pictures one below the other."""
    width, height = images[0].width, sum(image.height for image in images) + gap * (len(images) - 1)
    whole = Image.new("RGB", (width, height), "white")
    top = 0
    for image in images:
        whole.paste(image, (0, top))
        top += image.height + gap
    return whole


def save(image, name, quality=86):
    image.save(HERE / f"{name}.jpg", quality=quality, optimize=True, progressive=True, subsampling=0)


def make_valley():
    """The valley from the points alone, and with breaklines."""
    images = []
    for name, text in (("valley-points", "points alone"), ("valley-breaklines", "with [[breaklines]]")):
        mesh = run(name)
        scene, casters = block(mesh, land_colors(mesh, 400.0, 426.0), 1.5, 8.0)
        image = picture(scene, casters, camera((0.0, -16.0, 0.0), 205.0, 36.0, 1500.0, 18.6, 1100, 540))
        draw.label(image, (24, 18), text, 26)
        images.append(image)
    save(stacked(images), "valley")


PICTURES = {"valley": make_valley}


def main():
    valley.main()
    for name in sys.argv[1:] or PICTURES:
        PICTURES[name]()


if __name__ == "__main__":
    main()
