// Arithmetic that keeps a device busy and shows nothing, so that its clocks stay up.

@group(0) @binding(0) var<storage, read_write> kept: array<f32>;

@compute @workgroup_size(64)
fn cs_main(@builtin(global_invocation_id) id: vec3<u32>) {
    let idx = id.x & 0xffffu;
    var value = kept[idx];
    for (var turn = 0u; turn < 4096u; turn += 1u) {
        value = fma(value, 0.999, 0.5);
    }
    kept[idx] = value;
}
