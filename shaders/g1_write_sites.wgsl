// Step G1: write the sites into the texture. Of several sites in one pixel, the first in the list wins, in whatever order the
// invocations run: `texture` holds the greatest complement of a site's number, and 0 means "no site".

struct Params {
    width: u32,
    height: u32,
    // The number of sites in the list.
    sites: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// The pixel (y << 16 | x) of every site.
@group(0) @binding(1) var<storage, read> pixels: array<u32>;
@group(0) @binding(2) var<storage, read_write> texture: array<atomic<u32>>;

@compute @workgroup_size(64)
fn write(@builtin(global_invocation_id) id: vec3u) {
    let site = id.y * params.invocations + id.x;
    if site >= params.sites {
        return;
    }
    let pixel = pixels[site];
    let x = pixel & 0xffffu;
    let y = pixel >> 16u;
    if x < params.width && y < params.height {
        atomicMax(&texture[y * params.width + x], ~site);
    }
}
