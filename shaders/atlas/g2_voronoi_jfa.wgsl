// Step G2, the paper's 1+JFA: every pixel examines the labels of the eight pixels `step` away and takes the nearest site: the site's
// pixel with the least (d^2, x, y). The step is 1, then half the side of the largest leaf, a quarter, and so on down to 1. A few pixels
// in a million end with a label that is not the nearest. No jump leaves a leaf, so a step that is too long for a leaf changes nothing
// in it.
//
// The first jumps, of step 1, read the sites themselves.

const NONE = 0xffffffffu;

struct Params {
    blocks: u32,
    // The number of workgroups in a row of the dispatch.
    across: u32,
    step: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(2) var<storage, read> blocks: array<Block>;
@group(0) @binding(3) var<storage, read> texture: array<u32>;
@group(0) @binding(4) var<storage, read> before: array<u32>;
@group(0) @binding(5) var<storage, read_write> after: array<u32>;

// A pixel of a block.
struct Place {
    is_in_atlas: bool,
    leaf: u32,
    p: vec2u,
}

// Returns the pixel of an invocation. One workgroup per eight rows of a block.
fn place_of(group: vec3u, local: vec3u) -> Place {
    let i = group.y * params.across + group.x;
    let block = i / 4u;
    if block >= params.blocks {
        return Place(false, 0u, vec2u(0u));
    }
    return Place(true, blocks[block].leaf, corner_of(block) + vec2u(local.x, i % 4u * 8u + local.y));
}

// Returns whether label a comes before label b in the order of (x, y).
fn is_before(a: u32, b: u32) -> bool {
    let turned_a = (a << 16u) | (a >> 16u);
    let turned_b = (b << 16u) | (b >> 16u);
    return turned_a < turned_b;
}

// Returns the nearer of two labels.
fn nearer(p: vec2i, a: u32, b: u32) -> u32 {
    if a == NONE || b == NONE {
        return min(a, b);
    }
    let u = vec2i(i32(a & 0xffffu), i32(a >> 16u)) - p;
    let v = vec2i(i32(b & 0xffffu), i32(b >> 16u)) - p;
    let d = u.x * u.x + u.y * u.y;
    let e = v.x * v.x + v.y * v.y;
    return select(b, a, d < e || (d == e && is_before(a, b)));
}

fn is_inside(leaf: u32, p: vec2i) -> bool {
    return all(p >= vec2i(0)) && p.x < i32(leaves[leaf].width) && p.y < i32(leaves[leaf].height);
}

@compute @workgroup_size(32, 8)
fn seed(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let place = place_of(group, local);
    if !place.is_in_atlas {
        return;
    }
    let p = vec2i(place.p);
    var label = FRAME;
    if is_inside(place.leaf, p) {
        for (var i = 0u; i < 9u; i++) {
            let q = p + vec2i(vec2u(i % 3u, i / 3u)) - 1;
            if is_inside(place.leaf, q) && texture[pixel_number(place.leaf, u32(q.x), u32(q.y))] != 0u {
                label = nearer(p, label, u32((q.y << 16u) | q.x));
            }
        }
    }
    after[pixel_number(place.leaf, place.p.x, place.p.y)] = label;
}

@compute @workgroup_size(32, 8)
fn flood(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let place = place_of(group, local);
    if !place.is_in_atlas {
        return;
    }
    let p = vec2i(place.p);
    var label = FRAME;
    if is_inside(place.leaf, p) {
        for (var i = 0u; i < 9u; i++) {
            let q = p + i32(params.step) * (vec2i(vec2u(i % 3u, i / 3u)) - 1);
            if is_inside(place.leaf, q) {
                label = nearer(p, label, before[pixel_number(place.leaf, u32(q.x), u32(q.y))]);
            }
        }
    }
    after[pixel_number(place.leaf, place.p.x, place.p.y)] = label;
}
