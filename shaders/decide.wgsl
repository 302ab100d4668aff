// Decides about quadruples of sites, so that the predicates can be compared with their twins.

struct Params {
    count: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// Four sites for each decision.
@group(0) @binding(1) var<storage, read> quads: array<vec2i>;
// Bits 0 and 1: the orientation of the first three sites, plus one. Bit 2: whether the fourth is in their circle.
@group(0) @binding(2) var<storage, read_write> decisions: array<u32>;

@compute @workgroup_size(64)
fn decide(@builtin(global_invocation_id) id: vec3u) {
    let i = id.y * params.invocations + id.x;
    if i >= params.count {
        return;
    }
    let a = quads[4u * i];
    let b = quads[4u * i + 1u];
    let c = quads[4u * i + 2u];
    let d = quads[4u * i + 3u];
    decisions[i] = u32(orientation(a, b, c) + 1) | u32(in_circle(a, b, c, d)) << 2u;
}
