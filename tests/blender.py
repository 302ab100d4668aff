"""python blender.py TERRAIN.glb REQUEST.json: opens the file with Blender's importer and prints as JSON what there is then: triangles,
bounds, and the heights at the places [x, y] that the request lists as "places", in Blender's metres, x east, y north and z up. Needs the
module bpy, for example from PyPI."""

import json
import sys

import bpy
from mathutils import Vector

path, request = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=path)
meshes = [thing for thing in bpy.context.scene.objects if thing.type == "MESH"]
corners = [thing.matrix_world @ vertex.co for thing in meshes for vertex in thing.data.vertices]
with open(request) as file:
    places = json.load(file)["places"]


def height(x, y):
    scene, depsgraph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    hit, place, *_ = scene.ray_cast(depsgraph, Vector((x, y, 1e4)), Vector((0, 0, -1)))
    return place.z if hit else None


print()
print(json.dumps({
    "triangles": sum(len(thing.data.polygons) for thing in meshes),
    "box": [[side(corner[k] for corner in corners) for k in range(3)] for side in (min, max)],
    "heights": [height(x, y) for x, y in places],
}))
