// Step G4: find the Voronoi vertices, which are the corners between four pixels of three or four colours. A corner does not count if
// two pixels of one colour face each other across it, because they are connected there. A corner belongs to the pixel to its
// southwest.
//
// One invocation handles a segment of 32 corners of a row, without barriers, and counts its triangles for step G5.

struct Params {
    width: u32,
    height: u32,
    // Segments in a row of corners.
    segments: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> labels: array<u32>;
// Two words per segment: the corners with one or two triangles, and the corners with two.
@group(0) @binding(2) var<storage, read_write> vertices: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(64)
fn mark(@builtin(global_invocation_id) id: vec3u) {
    let segment = id.y * params.invocations + id.x;
    let y = segment / params.segments;
    if y + 1u >= params.height {
        return;
    }
    let first = segment % params.segments * 32u;
    let corners = min(32u, params.width - 1u - first);
    let south = y * params.width + first;
    let north = south + params.width;
    var any_triangle = 0u;
    var two = 0u;
    var sw = labels[south];
    var nw = labels[north];
    for (var i = 0u; i < corners; i++) {
        let se = labels[south + i + 1u];
        let ne = labels[north + i + 1u];
        // The number of sides between different colours. At three or four sides, three or four colours meet.
        let sides = u32(sw != se) + u32(se != ne) + u32(ne != nw) + u32(nw != sw);
        let apart = sw != ne && se != nw;
        any_triangle |= u32(apart && sides >= 3u) << i;
        two |= u32(apart && sides == 4u) << i;
        sw = se;
        nw = ne;
    }
    vertices[segment] = vec2u(any_triangle, two);
    counts[segment] = countOneBits(any_triangle) + countOneBits(two);
}
