// Colours of stacks of films, one place of the surface per thread: the same steps as `film_colours.rs`.

struct Settings {
    places: u32,
    films: u32,
}

@group(0) @binding(0) var<uniform> settings: Settings;
// Film after film, of every band: exponent, both sides and scattering.
@group(0) @binding(1) var<storage, read> paints: array<vec4<f32>>;
// Of every band: its weights in red, green and blue, and what the ground reflects; then, in fours, the least linear component of every code.
@group(0) @binding(2) var<storage, read> looks: array<vec4<f32>>;
// Film after film, m, as the bits of floats.
@group(0) @binding(3) var<storage, read> thickness: array<u32>;
@group(0) @binding(4) var<storage, read_write> results: array<u32>;

const BANDS: u32 = 36u;
const INFINITE: u32 = 0x7f800000u;
const LARGEST: u32 = 0x7f7fffffu;

// 1 - exp2(power), of a power from -126 to 0.
fn lost_at(power: f32) -> f32 {
    let whole = round(power);
    let part = power - whole;
    let scale = bitcast<f32>(u32(i32(whole) + 127) << 23u);
    let series = 0.6931471805599453 + part * (2.4022651e-1 + part * (5.5503571e-2
        + part * (9.6180826e-3 + part * (1.3390863e-3 + part * 1.5453163e-4))));
    return (1.0 - scale) - scale * (part * series);
}

fn linear_at(place: u32) -> vec3<f32> {
    var colour = vec3(0.0);
    for (var band = 0u; band < BANDS; band++) {
        let look = looks[band];
        var reflectance = look.w;
        for (var film = 0u; film < settings.films; film++) {
            let paint = paints[film * BANDS + band];
            let word = thickness[film * settings.places + place];
            // Neither infinite nor not a number: of those a device may make anything.
            let depth = bitcast<f32>(select(0u, min(word, LARGEST), word <= INFINITE));
            let lost = lost_at(max(depth * paint.x, -126.0));
            let scattered = lost * paint.w * (1.0 - reflectance);
            reflectance = (reflectance * (2.0 - lost * paint.y) + scattered) / (2.0 - lost * paint.z + scattered);
        }
        colour += reflectance * look.xyz;
    }
    return colour;
}

@compute @workgroup_size(64)
fn linear_srgb(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= settings.places {
        return;
    }
    let colour = linear_at(id.x);
    for (var c = 0u; c < 3u; c++) {
        results[3u * id.x + c] = bitcast<u32>(colour[c]);
    }
}

// The largest code whose least component is not above this one.
fn code(component: f32) -> u32 {
    var code = 0u;
    for (var step = 128u; step > 0u; step /= 2u) {
        let next = code + step;
        if component >= looks[BANDS + next / 4u][next % 4u] {
            code = next;
        }
    }
    return code;
}

@compute @workgroup_size(64)
fn srgb8(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= settings.places {
        return;
    }
    let colour = linear_at(id.x);
    results[id.x] = code(colour.x) | code(colour.y) << 8u | code(colour.z) << 16u;
}
