// All droplets of a nozzle cast at once, one nozzle per work group: the same steps as `cast.rs`.

struct Settings {
    droplets: u32,
    width: u32,
    height: u32,
    literal: u32,
    farthest: f32,
}

struct Hit {
    // Texel, row by row; NOTHING where no paint lands.
    texel: u32,
    distance_squared: f32,
    height: f32,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> slopes: array<vec2<f32>>;
// Six groups of four for each candidate: edge forms with determinant, height and whether it is painted; sum; column; row.
@group(0) @binding(2) var<storage, read> candidates: array<vec4<f32>>;
// First candidate, their number, a number of the program, first droplet.
@group(0) @binding(3) var<storage, read> places: array<vec4<u32>>;

const THREADS: u32 = 64u;
const NOTHING: u32 = 0xffffffffu;

// Where the droplet with these slopes lands.
fn land(slope: vec2<f32>, first: u32, count: u32) -> Hit {
    let ray = vec3(slope, 1.0);
    var nearest = settings.farthest;
    var face = NOTHING;
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
    if face == NOTHING || candidates[face + 2u].w == 0.0 {
        return Hit(NOTHING, 0.0, 0.0);
    }
    let inverse = 1.0 / dot(candidates[face + 3u].xyz, ray);
    let column = clamp(i32(dot(candidates[face + 4u].xyz, ray) * inverse), 0, i32(settings.width) - 1);
    let row = clamp(i32(dot(candidates[face + 5u].xyz, ray) * inverse), 0, i32(settings.height) - 1);
    let depth = candidates[face].w * inverse;
    let distance_squared = depth * depth * (dot(slope, slope) + 1.0);
    return Hit(u32(row) * settings.width + u32(column), distance_squared, candidates[face + 1u].w);
}
