// What the device makes of pairs of floats, for comparison with the processor.

@group(0) @binding(0) var<uniform> settings: vec4<u32>;
@group(0) @binding(1) var<storage, read> pairs: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read_write> results: array<vec4<f32>>;

@compute @workgroup_size(64)
fn probe(@builtin(global_invocation_id) id: vec3<u32>) {
    unknown_zero = settings.y;
    if id.x >= settings.x {
        return;
    }
    let a = pairs[id.x].x;
    let b = pairs[id.x].y;
    let sum = minus(plus(times(a, b), b), times(b, b));
    let rounded = minus(times(a, 7.0), nearest(times(a, 7.0)));
    results[2u * id.x] = vec4(sum, rounded, quotient(a, b), root(a));
    results[2u * id.x + 1u] = vec4(from_integer(bitcast<i32>(a)), from_integer(-bitcast<i32>(b)), divide(-1.0, b), root(b));
}
