// Required paint density of one nozzle per work group: the same steps as `cast.rs` and `density.rs`.

struct Settings {
    droplets: u32,
    width: u32,
    height: u32,
    literal: u32,
    farthest: f32,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> slopes: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> deficit: array<f32>;
// Six groups of four for each candidate: edge forms with determinant, height and whether it is painted; sum; column; row.
@group(0) @binding(3) var<storage, read> candidates: array<vec4<f32>>;
// First candidate, their number, saturation.
@group(0) @binding(4) var<storage, read> places: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read_write> results: array<f32>;

const THREADS: u32 = 64u;
var<workgroup> partial: array<f32, 64>;

// What one droplet adds.
fn droplet(slope: vec2<f32>, first: u32, count: u32, saturation: f32) -> f32 {
    let ray = vec3(slope, 1.0);
    var nearest = settings.farthest;
    var face = 0xffffffffu;
    for (var k = 0u; k < count; k++) {
        let at = 6u * (first + k);
        let side = sign(candidates[at].w);
        let u = dot(candidates[at].xyz, ray) * side;
        let v = dot(candidates[at + 1u].xyz, ray) * side;
        let w = dot(candidates[at + 2u].xyz, ray) * side;
        let inverse_depth = (u + v + w) / abs(candidates[at].w);
        if min(min(u, v), w) >= 0.0 && inverse_depth > nearest {
            nearest = inverse_depth;
            face = at;
        }
    }
    if face == 0xffffffffu || candidates[face + 2u].w == 0.0 {
        return 0.0;
    }
    let inverse = 1.0 / dot(candidates[face + 3u].xyz, ray);
    let column = clamp(i32(dot(candidates[face + 4u].xyz, ray) * inverse), 0, i32(settings.width) - 1);
    let row = clamp(i32(dot(candidates[face + 5u].xyz, ray) * inverse), 0, i32(settings.height) - 1);
    let depth = candidates[face].w * inverse;
    let distance_squared = depth * depth * (dot(slope, slope) + 1.0);
    let missing = deficit[u32(row) * settings.width + u32(column)];
    if settings.literal == 1u {
        return min(missing / distance_squared, saturation);
    }
    return min(missing * distance_squared / candidates[face + 1u].w, saturation);
}

@compute @workgroup_size(64)
fn density(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let place = places[group.x];
    var sum = 0.0;
    for (var k = local.x; k < settings.droplets; k += THREADS) {
        sum += droplet(slopes[k], place.x, place.y, bitcast<f32>(place.z));
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
