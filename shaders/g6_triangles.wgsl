// Step G6: write the triangles as triples of site numbers, counterclockwise from the site of the southwestern pixel, in the order of
// the corners, row by row. Four colours make two triangles, cut along the diagonal from the southwest.

struct Params {
    width: u32,
    height: u32,
    segments: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
    // The number of triangles for which there is room.
    room: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> labels: array<u32>;
@group(0) @binding(2) var<storage, read> texture: array<u32>;
@group(0) @binding(3) var<storage, read> vertices: array<vec2u>;
// The number of triangles before every segment.
@group(0) @binding(4) var<storage, read> before: array<u32>;
@group(0) @binding(5) var<storage, read_write> triangles: array<u32>;

fn site(label: u32) -> u32 {
    return ~texture[(label >> 16u) * params.width + (label & 0xffffu)];
}

fn put(at: u32, a: u32, b: u32, c: u32) {
    if at < params.room {
        triangles[3u * at] = site(a);
        triangles[3u * at + 1u] = site(b);
        triangles[3u * at + 2u] = site(c);
    }
}

@compute @workgroup_size(64)
fn emit(@builtin(global_invocation_id) id: vec3u) {
    let segment = id.y * params.invocations + id.x;
    let y = segment / params.segments;
    if y + 1u >= params.height {
        return;
    }
    let two = vertices[segment].y;
    var left = vertices[segment].x;
    var at = before[segment];
    while left != 0u {
        let bit = firstTrailingBit(left);
        left &= left - 1u;
        let south = y * params.width + segment % params.segments * 32u + bit;
        let north = south + params.width;
        let sw = labels[south];
        let se = labels[south + 1u];
        let ne = labels[north + 1u];
        let nw = labels[north];
        if ((two >> bit) & 1u) != 0u {
            put(at, sw, se, ne);
            put(at + 1u, sw, ne, nw);
            at += 2u;
        } else {
            // One pair of neighbours has the same colour: skip its second pixel.
            let b = select(se, ne, se == sw);
            let c = select(nw, ne, nw == sw || nw == ne);
            put(at, sw, b, c);
            at += 1u;
        }
    }
}
