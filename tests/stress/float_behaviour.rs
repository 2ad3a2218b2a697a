//! What the shaders rely on of a driver's float arithmetic, on the driver under test. The list, with where each is relied
//! on, is docs/accuracy/float-behaviour.md.

use std::sync::OnceLock;

use crate::common::kernel::{Random, TestKernel};

const TEXELS: usize = 10;

/// Numbers that show where an implementation differs: zeros, denormals, ends of the range, infinities, NaN, neighbours.
fn special() -> Vec<f32> {
    let mut numbers =
        vec![0.0, f32::MIN_POSITIVE, 1e-40, 1e-45, 0.5, 1.0, 1.0_f32.next_up(), 1.0_f32.next_down(), 1.5, 3.0];
    numbers.extend([255.0, 16_777_215.0, 16_777_216.0, 1e10, 1.8e19, f32::MAX, f32::INFINITY]);
    numbers.extend(numbers.clone().iter().map(|x| -x));
    numbers.push(f32::NAN);
    numbers
}

/// All triples of special numbers and many random ones.
fn inputs() -> Vec<[u32; 4]> {
    let mut random = Random(51);
    let special = special();
    let mut inputs = Vec::new();
    for (x, y) in special.iter().flat_map(|x| special.iter().map(move |y| (x, y))) {
        for z in [0.0, -1.0, 1e-40, f32::INFINITY, f32::NAN, -x * y] {
            inputs.push([x.to_bits(), y.to_bits(), z.to_bits(), inputs.len() as u32]);
        }
    }
    for i in 0..100_000 {
        // Any bits; numbers of one magnitude; products that nearly cancel.
        let any = [(); 3].map(|()| f32::from_bits(random.bits() as u32));
        let near = [(); 3].map(|()| random.between(-2.0, 2.0) as f32);
        let [x, y, z] = match i % 3 {
            0 => any,
            1 => near,
            _ => [near[0], near[1], -near[0] * near[1]],
        };
        inputs.push([x.to_bits(), y.to_bits(), z.to_bits(), random.bits() as u32]);
    }
    inputs
}

/// One lane: what went in, and the ten texels that came out.
struct Case {
    x: f32,
    y: f32,
    z: f32,
    bits: [u32; 4],
    texels: [[u32; 4]; TEXELS],
}

impl Case {
    /// Result `component` of texel `texel`, as a float.
    fn out(&self, texel: usize, component: usize) -> f32 {
        f32::from_bits(self.texels[texel][component])
    }

    /// Asserts that a result is `f` of a product and the inputs, where the device may take denormals for zeros: those that
    /// go in, those that come out, and products, before or after they are rounded.
    fn assert_is(&self, what: &str, got: f32, f: impl Fn(Product, [f32; 3]) -> f32) {
        let numbers = [self.x, self.y, self.z];
        let is = |expected: f32| got == expected || got.is_nan() && expected.is_nan();
        let allowed = |numbers| {
            let products: [Product; 3] = [|x, y| x * y, |x, y| flush(x * y), flushed_product];
            products.map(|product| f(product, numbers)).into_iter().any(|r| is(r) || is(flush(r)))
        };
        assert!(allowed(numbers) || allowed(numbers.map(flush)), "{what} of {numbers:?} is {got:e}");
    }
}

/// A way to multiply.
type Product = fn(f32, f32) -> f32;

/// Zero where the exact product, which f64 holds, is denormal: SwiftShader flushes before it rounds.
fn flushed_product(x: f32, y: f32) -> f32 {
    if (f64::from(x) * f64::from(y)).abs() < f64::from(f32::MIN_POSITIVE) { 0.0 } else { x * y }
}

/// Zero for a denormal.
fn flush(x: f32) -> f32 {
    if x.abs() < f32::MIN_POSITIVE { 0.0 } else { x }
}

fn is_normal(numbers: &[f32]) -> bool {
    numbers.iter().all(|x| x.is_normal())
}

fn cases() -> &'static [Case] {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    CASES.get_or_init(|| {
        let inputs = inputs();
        let outputs = TestKernel::new("float_behaviour.comp").run(&inputs, inputs.len(), TEXELS as u32);
        let case = |(bits, texels): (&[u32; 4], &[[u32; 4]])| {
            let [x, y, z, _] = bits.map(f32::from_bits);
            Case { x, y, z, bits: *bits, texels: texels.try_into().expect("ten texels") }
        };
        inputs.iter().zip(outputs.chunks_exact(TEXELS)).map(case).collect()
    })
}

/// The error of a result in units in the last place of the exact value.
fn ulps(got: f32, exact: f64) -> f64 {
    let nearest = (exact as f32).abs();
    (f64::from(got) - exact).abs() / f64::from(nearest.next_up() - nearest)
}

/// Prints the worst error of a function and asserts its bound.
fn assert_accurate(what: &str, bound: f64, errors: impl Iterator<Item = (f64, String)>) {
    let (worst, place) = errors.fold((0.0, String::new()), |a, b| if b.0 > a.0 { b } else { a });
    println!("{what}: at most {worst:.2} ulp, at {place}");
    assert!(worst <= bound, "{what}: {worst} ulp at {place}, {bound} are allowed");
}

#[test]
fn sums_and_products_are_rounded_to_nearest() {
    for case in cases().iter().filter(|c| c.x.is_finite() && c.y.is_finite()) {
        case.assert_is("x + y", case.out(0, 0), |_, [x, y, _]| x + y);
        case.assert_is("x - y", case.out(0, 1), |_, [x, y, _]| x - y);
        case.assert_is("x * y", case.out(0, 2), |product, [x, y, _]| product(x, y));
    }
    let denormal = cases().iter().find(|c| c.x == 1e-40 && c.y == 0.0).expect("among the special numbers");
    println!("denormals: 1e-40 + 0 is {:e}", denormal.out(0, 0));
}

/// The triangle test relies on it: neighbours must compute a shared edge alike.
#[test]
fn precise_keeps_operations_apart() {
    let mut contracted = 0;
    for case in cases().iter().filter(|c| is_normal(&[c.x, c.y, c.z])) {
        case.assert_is("precise x * y + z", case.out(1, 0), |product, [x, y, z]| product(x, y) + z);
        case.assert_is("precise x * y - z * y", case.out(1, 2), |product, [x, y, z]| product(x, y) - product(z, y));
        let fused = case.x.mul_add(case.y, case.z);
        let apart = case.x * case.y + case.z;
        contracted += u32::from(fused != apart && case.out(1, 1) == fused);
    }
    println!("without precise, {contracted} sums of a product are fused");
}

/// Vulkan's own bounds (specification, "Precision and operation of SPIR-V instructions"): division 2.5 ulp where the
/// divisor is within 2^±126, inversesqrt 2 ulp, sqrt as 1/inversesqrt.
#[test]
fn division_and_roots_are_as_good_as_vulkan_demands() {
    let limit = 2.0_f32.powi(126);
    let quotients =
        cases().iter().filter(|c| is_normal(&[c.x, c.y, c.x / c.y]) && (1.0 / limit..=limit).contains(&c.y.abs()));
    let quotients =
        quotients.map(|c| (ulps(c.out(0, 3), f64::from(c.x) / f64::from(c.y)), format!("{:e} / {:e}", c.x, c.y)));
    assert_accurate("x / y", 2.5, quotients);
    let positive = || cases().iter().filter(|c| c.x.is_normal() && c.x > 0.0);
    let roots = positive().map(|c| (ulps(c.out(2, 0), f64::from(c.x).sqrt()), format!("{:e}", c.x)));
    assert_accurate("sqrt", 5.0, roots);
    let inverse = positive().map(|c| (ulps(c.out(2, 1), 1.0 / f64::from(c.x).sqrt()), format!("{:e}", c.x)));
    assert_accurate("inversesqrt", 2.0, inverse);
    for zero in cases().iter().filter(|c| c.x == 0.0) {
        assert_eq!(zero.out(2, 0), 0.0, "sqrt(0)");
    }
}

/// Of two numbers the right one; of a number and a NaN either of the two, so nothing may depend on which.
#[test]
fn min_and_max_give_one_of_their_operands() {
    let same = |a: f32, b: f32| flush(a) == flush(b) || a.is_nan() && b.is_nan();
    for case in cases() {
        let (x, y) = (case.x, case.y);
        let (least, largest) = (case.out(2, 2), case.out(2, 3));
        if x.is_nan() || y.is_nan() {
            assert!(same(least, x) || same(least, y), "min({x:e}, {y:e}) is {least:e}");
            assert!(same(largest, x) || same(largest, y), "max({x:e}, {y:e}) is {largest:e}");
        } else {
            assert!(same(least, x.min(y)), "min({x:e}, {y:e}) is {least:e}");
            assert!(same(largest, x.max(y)), "max({x:e}, {y:e}) is {largest:e}");
        }
        if !x.is_nan() {
            assert!(same(case.out(6, 2), x.clamp(0.0, 1.0)), "clamp({x:e})");
            assert!(same(case.out(6, 0), x.abs()) && same(case.out(6, 1), -x), "abs or minus of {x:e}");
        }
    }
    for case in
        cases().iter().filter(|c| (c.x.is_nan() && c.y == 1.0) || (c.x == 1.0 && c.y.is_nan())).take(12).step_by(6)
    {
        println!("min({}, {}) = {}, max = {}", case.x, case.y, case.out(2, 2), case.out(2, 3));
    }
}

/// Infinities and NaN are not lost in + and ×: a non-finite sample is seen in its sum.
#[test]
fn infinities_and_nan_propagate() {
    for case in cases().iter().filter(|c| !c.x.is_finite() || !c.y.is_finite()) {
        case.assert_is("x + y", case.out(0, 0), |_, [x, y, _]| x + y);
        case.assert_is("x - y", case.out(0, 1), |_, [x, y, _]| x - y);
        case.assert_is("x * y", case.out(0, 2), |product, [x, y, _]| product(x, y));
        assert_eq!(case.texels[3][2] != 0, case.x.is_finite(), "is_finite({:e})", case.x);
    }
}

#[test]
fn comparisons_with_nan_are_false() {
    for case in cases() {
        let word = case.texels[3][0];
        let mask = |x: f32, y: f32| {
            let results = [x < y, x <= y, x > y, x >= y, x == y, x != y];
            results.iter().enumerate().map(|(bit, holds)| u32::from(*holds) << bit).sum::<u32>()
        };
        let (kept, flushed) = (mask(case.x, case.y), mask(flush(case.x), flush(case.y)));
        assert!(word == kept || word == flushed, "comparisons of {:e} and {:e}: {word:06b}", case.x, case.y);
    }
}

/// The slab test compares distances as integers.
#[test]
fn bits_of_non_negative_floats_are_ordered() {
    for case in
        cases().iter().filter(|c| c.x.is_sign_positive() && c.y.is_sign_positive() && !c.x.is_nan() && !c.y.is_nan())
    {
        assert_eq!(case.texels[3][1] != 0, case.x < case.y, "{:e} < {:e} by their bits", case.x, case.y);
    }
}

/// Random numbers, sample counts, texels and grid positions are converted.
#[test]
fn conversions_are_exact_where_the_number_fits() {
    for case in cases() {
        let word = case.bits[0];
        assert_eq!(case.out(4, 0), (word >> 8) as f32, "float({word} >> 8)");
        assert_eq!(case.out(4, 1), (word & 255) as f32, "float({word} & 255)");
        assert_eq!(case.out(4, 2), ((word as i32) >> 8) as f32, "float(int({word}) >> 8)");
        let fitting = if case.x.abs() < 2_147_483_520.0 { case.x } else { 0.0 };
        assert_eq!(case.texels[5][0] as i32, fitting as i32, "int({fitting:e})");
        assert_eq!(case.texels[5][1], fitting.abs() as u32, "uint({fitting:e})");
        let floor = case.out(5, 2);
        // Of a negative denormal −1, or 0 where it is flushed.
        assert!(floor == fitting.floor() || floor == flush(fitting).floor(), "floor({fitting:e}) is {floor:e}");
    }
}

/// Words that only pass through as floats, denormals and NaN among them, keep their bits.
#[test]
fn bits_that_pass_through_stay() {
    let same = |got: u32, sent: u32| got == sent || f32::from_bits(got).is_nan() && f32::from_bits(sent).is_nan();
    for case in cases() {
        let picked = if case.bits[3] & 1 != 0 { case.bits[0] } else { case.bits[1] };
        for (got, sent) in case.texels[7].iter().zip([case.bits[0], case.bits[1], picked]) {
            assert!(same(*got, sent), "{sent:#010x} came back as {got:#010x}");
        }
    }
}

/// What the shaders build on the above: the squared length of a vector is positive or zero and good to a few roundings,
/// and so is the largest component.
#[test]
fn squared_lengths_are_never_negative() {
    for case in cases().iter().filter(|c| c.x.is_finite() && c.y.is_finite() && c.z.is_finite()) {
        let exact: f64 = [case.x, case.y, case.z].iter().map(|x| f64::from(*x).powi(2)).sum();
        let got = case.out(8, 0);
        assert!(got >= 0.0, "the squared length of ({}, {}, {}) is {got}", case.x, case.y, case.z);
        if exact < f64::from(f32::MAX) * 0.999 {
            // Three products and two sums round once each; each product below the normal range may vanish.
            let bound = 3.0 * exact / 16_777_216.0 + 3.0 * f64::from(f32::MIN_POSITIVE);
            assert!((f64::from(got) - exact).abs() <= bound, "{got:e}, not {exact:e}");
        }
        let largest = case.x.max(case.y).max(case.z);
        assert_eq!(flush(case.out(8, 1)), flush(largest), "max_component");
    }
}
