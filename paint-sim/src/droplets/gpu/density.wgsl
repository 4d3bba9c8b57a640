// Required paint density of one nozzle per work group, behind `cast.wgsl`: the same steps as `density.rs`. The number of the program is the
// saturation, as its bits.

@group(0) @binding(4) var<storage, read> deficit: array<f32>;
@group(0) @binding(5) var<storage, read_write> results: array<f32>;

var<workgroup> partial: array<f32, 64>;

// As large as a saturation that is none.
const UNLIMITED: f32 = 3.4e38;

// What one droplet adds.
fn need(hit: Hit, saturation: f32) -> f32 {
    if hit.texel == NOTHING {
        return 0.0;
    }
    let missing = deficit[hit.texel];
    let over = select(distance_over_cosine(hit), 1.0 / hit.distance_squared, settings.literal == 1u);
    let least = select(-UNLIMITED, 0.0, saturation < UNLIMITED);
    return max(min(missing * over, saturation), least);
}

fn distance_over_cosine(hit: Hit) -> f32 {
    return hit.distance_squared / hit.height;
}

@compute @workgroup_size(64)
fn density(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let place = places[group.x];
    var sum = 0.0;
    for (var k = local.x; k < settings.droplets; k += THREADS) {
        sum += need(land(slopes[place.w + k], place.x, place.y), bitcast<f32>(place.z));
    }
    partial[local.x] = sum;
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if local.x < half {
            partial[local.x] += partial[local.x + half];
        }
    }
    if local.x == 0u {
        results[group.x] = partial[0] / f32(settings.droplets);
    }
}
