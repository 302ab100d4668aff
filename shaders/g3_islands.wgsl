// Step G3: a pixel that has lost touch with its site is given the colour of the nearest other site among its neighbours'. It has
// lost touch if none of the neighbours that lie towards the site (three, or one where the site lies straight along an
// axis) has its colour.
//
// A round is three dispatches: `find` lists all such pixels of the texture with their new colours, `arrange` says how many
// workgroups the next two need, `recolour` writes the colours. So the result does not depend on the order of the list. If it
// overflows, which takes a texture with islands everywhere, the labels stay as they are.

const NONE = 0xffffffffu;

struct Params {
    width: u32,
    height: u32,
    // How many pixels the list has room for.
    room: u32,
    // Workgroups of `find` in x and y.
    find_x: u32,
    find_y: u32,
}

struct Islands {
    count: atomic<u32>,
    // Pixel and new label, two numbers each.
    list: array<u32>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> labels: array<u32>;
@group(0) @binding(2) var<storage, read_write> islands: Islands;
@group(0) @binding(3) var<storage, read_write> labels_out: array<u32>;
// Workgroups of the next `recolour` (0 to 2) and of the next `find` (3 to 5).
@group(0) @binding(4) var<storage, read_write> workgroups: array<u32>;

fn label_at(p: vec2i) -> u32 {
    return labels[u32(p.y) * params.width + u32(p.x)];
}

fn is_island(p: vec2i, label: u32) -> bool {
    let towards = sign(vec2i(i32(label & 0xffffu), i32(label >> 16u)) - p);
    let along_x = vec2i(towards.x, 0);
    let along_y = vec2i(0, towards.y);
    if all(towards == vec2i(0)) {
        return false;
    }
    // Where the site lies straight along an axis, two of the three are the same pixel and the third is p itself.
    let touches_x = towards.x != 0 && label_at(p + along_x) == label;
    let touches_y = towards.y != 0 && label_at(p + along_y) == label;
    return !touches_x && !touches_y && label_at(p + towards) != label;
}

// Whether label a comes before label b by (x, y).
fn is_before(a: u32, b: u32) -> bool {
    let turned_a = (a << 16u) | (a >> 16u);
    let turned_b = (b << 16u) | (b >> 16u);
    return turned_a < turned_b;
}

// The nearest site among the neighbours', least (d^2, x, y), but not `label`.
fn other_colour(p: vec2i, label: u32) -> u32 {
    let size = vec2i(i32(params.width), i32(params.height));
    var best = NONE;
    var colour = NONE;
    for (var j = -1; j <= 1; j++) {
        for (var i = -1; i <= 1; i++) {
            let q = p + vec2i(i, j);
            if any(q < vec2i(0)) || any(q >= size) {
                continue;
            }
            let other = label_at(q);
            if other == label || other == NONE {
                continue;
            }
            let away = vec2i(i32(other & 0xffffu), i32(other >> 16u)) - p;
            let d = u32(away.x * away.x + away.y * away.y);
            if d < best || (d == best && is_before(other, colour)) {
                best = d;
                colour = other;
            }
        }
    }
    return colour;
}

@compute @workgroup_size(32, 8)
fn find(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let p = vec2i(id.xy);
    let label = label_at(p);
    if label == NONE || !is_island(p, label) {
        return;
    }
    let colour = other_colour(p, label);
    if colour == NONE {
        return;
    }
    let at = atomicAdd(&islands.count, 1u);
    if at < params.room {
        islands.list[2u * at] = id.y * params.width + id.x;
        islands.list[2u * at + 1u] = colour;
    }
}

@compute @workgroup_size(1)
fn arrange() {
    let count = atomicLoad(&islands.count);
    let goes_on = count > 0u && count <= params.room;
    let groups = select(0u, (count + 63u) / 64u, goes_on);
    workgroups[0] = min(groups, 65535u);
    workgroups[1] = (groups + 65534u) / 65535u;
    workgroups[2] = 1u;
    workgroups[3] = select(0u, params.find_x, goes_on);
    workgroups[4] = select(0u, params.find_y, goes_on);
    workgroups[5] = 1u;
}

@compute @workgroup_size(64)
fn recolour(@builtin(global_invocation_id) id: vec3u) {
    let i = id.y * 65535u * 64u + id.x;
    if i < min(atomicLoad(&islands.count), params.room) {
        labels_out[islands.list[2u * i]] = islands.list[2u * i + 1u];
    }
}
