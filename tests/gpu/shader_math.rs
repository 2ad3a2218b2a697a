//! Elementary functions of shaders/include/math.glsl against f64.

use crate::common::gpu;

#[test]
fn polynomials_are_good_to_a_few_ulp() {
    let n = 100_000_u32;
    let inputs: Vec<[u32; 4]> = (0..n)
        .map(|i| {
            let x = f64::from(i) / f64::from(n - 1);
            let angle = x * std::f64::consts::TAU;
            [x as f32, angle.cos() as f32, angle.sin() as f32, x as f32].map(f32::to_bits)
        })
        .collect();
    let outputs = gpu::call("math.comp", &inputs, n, 2);
    let mut worst = [0.0_f64; 4];
    for (input, output) in inputs.iter().zip(outputs.chunks_exact(2)) {
        let [x, c, s, _] = input.map(|bits| f64::from(f32::from_bits(bits)));
        let [cos, sin, turns, atan] = output[0].map(|bits| f64::from(f32::from_bits(bits)));
        let angle = x * std::f64::consts::TAU;
        let expected = s.atan2(c).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
        // Just below a whole turn is as good as zero.
        let turn_error = (turns - expected).abs().min(1.0 - (turns - expected).abs());
        let errors = [(cos - angle.cos()).abs(), (sin - angle.sin()).abs(), turn_error, (atan - x.atan()).abs()];
        for (w, e) in worst.iter_mut().zip(errors) {
            *w = w.max(e);
        }
        assert!((0.0..1.0).contains(&turns), "turns({s}, {c}) = {turns}");
    }
    // cos and sin: one rounding of the reduced angle times π/2, and the polynomial's own ulp.
    assert!(worst[0] < 2e-7 && worst[1] < 2e-7, "cos, sin: {worst:?}");
    assert!(worst[2] < 1e-7, "turns: {worst:?}");
    assert!(worst[3] < 2e-7, "atan: {worst:?}");
}

#[test]
fn next_floats_are_neighbours() {
    let values = [1.0_f32, -1.0, 1.5e-30, -3e20, 16_777_215.0, f32::INFINITY];
    let inputs: Vec<[u32; 4]> = values.iter().map(|x| [0, x.to_bits(), 0, 0]).collect();
    let outputs = gpu::call("math.comp", &inputs, values.len() as u32, 2);
    for (x, output) in values.iter().zip(outputs.chunks_exact(2)) {
        assert_eq!(f32::from_bits(output[1][0]), x.next_up(), "above {x}");
        assert_eq!(f32::from_bits(output[1][1]), x.next_down(), "below {x}");
    }
}
