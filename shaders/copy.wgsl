// Copies numbers, so that what a device's memory can move is measured by what moves it in all other steps: a shader.

struct Params {
    // The number of vectors.
    count: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> numbers: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> copies: array<vec4u>;

@compute @workgroup_size(64)
fn copy(@builtin(global_invocation_id) id: vec3u) {
    let i = id.y * params.invocations + id.x;
    if i < params.count {
        copies[i] = numbers[i];
    }
}
