// Step G2, the paper's 1+JFA: every pixel examines the labels of the eight pixels `step` away and takes the nearest site: the site's
// pixel with the least (d^2, x, y). The step is 1, then half the texture's side, a quarter, and so on down to 1. A few pixels in a
// million end with a label that is not the nearest.

const NONE = 0xffffffffu;

struct Params {
    width: u32,
    height: u32,
    first_row: u32,
    step: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> texture: array<u32>;
@group(0) @binding(2) var<storage, read> before: array<u32>;
@group(0) @binding(3) var<storage, read_write> after: array<u32>;

// Labels the pixels that have a site.
@compute @workgroup_size(32, 8)
fn seed(@builtin(global_invocation_id) id: vec3u) {
    let y = params.first_row + id.y;
    if id.x >= params.width || y >= params.height {
        return;
    }
    let at = y * params.width + id.x;
    after[at] = select(NONE, (y << 16u) | id.x, texture[at] != 0u);
}

@compute @workgroup_size(32, 8)
fn flood(@builtin(global_invocation_id) id: vec3u) {
    let x = i32(id.x);
    let y = i32(params.first_row + id.y);
    let size = vec2i(i32(params.width), i32(params.height));
    if x >= size.x || y >= size.y {
        return;
    }
    var label = NONE;
    var best = NONE;
    for (var j = -1; j <= 1; j++) {
        for (var i = -1; i <= 1; i++) {
            let p = vec2i(x, y) + i32(params.step) * vec2i(i, j);
            if any(p < vec2i(0)) || any(p >= size) {
                continue;
            }
            let other = before[u32(p.y) * params.width + u32(p.x)];
            if other == NONE {
                continue;
            }
            let sx = i32(other & 0xffffu);
            let sy = i32(other >> 16u);
            let d = u32((sx - x) * (sx - x) + (sy - y) * (sy - y));
            if d < best || (d == best && is_before(other, label)) {
                best = d;
                label = other;
            }
        }
    }
    after[u32(y) * params.width + u32(x)] = label;
}

// Returns whether label a comes before label b in the order of (x, y).
fn is_before(a: u32, b: u32) -> bool {
    let turned_a = (a << 16u) | (a >> 16u);
    let turned_b = (b << 16u) | (b >> 16u);
    return turned_a < turned_b;
}
