// The texel of every droplet of one nozzle per work group, behind `cast.wgsl`; the processor counts them.

@group(0) @binding(4) var<storage, read_write> results: array<u32>;

@compute @workgroup_size(64)
fn hits(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let place = places[group.x];
    for (var k = local.x; k < settings.droplets; k += THREADS) {
        results[group.x * settings.droplets + k] = land(slopes[place.w + k], place.x, place.y).texel;
    }
}
