//! `sample_texture` against f64: wrap modes, filters, sRGB decoding and 16 bits, through the images and materials of a scene.

use crate::common::kernel::{Random, TestKernel, empty_scene, floats};
use glam::DAffine3;
use sunfleck::prepare::srgb_to_linear;
use sunfleck::scene::{
    Filter, Image, Instance, Material, Mesh, Primitive, Scene, Texels, Texture, TextureBinding, TextureTransform, Wrap,
};

const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge];

/// A texture as a test looks at it.
#[derive(Clone, Copy, Debug)]
struct Case {
    image: usize,
    wrap: [Wrap; 2],
    filter: Filter,
    srgb: bool,
    set: usize,
    transform: TextureTransform,
}

const PLAIN: Case = Case {
    image: 0,
    wrap: [Wrap::Repeat; 2],
    filter: Filter::Linear,
    srgb: false,
    set: 0,
    transform: TextureTransform::IDENTITY,
};

fn image(width: u32, height: u32, texels: Texels) -> Image {
    Image { name: String::from("test"), width, height, texels }
}

fn images() -> Vec<Image> {
    let mut random = Random(31);
    let mut bytes = |n: usize| (0..n).map(|_| [0; 4].map(|_| random.bits() as u8)).collect();
    let (a, b) = (Texels::Rgba8(bytes(8 * 4)), Texels::Rgba8(bytes(5 * 3)));
    let words = (0..7 * 6).map(|_| [0; 4].map(|_| random.bits() as u16)).collect();
    let codes = (0..=255).map(|i| [i, 255 - i, i, i]).collect();
    vec![
        image(8, 4, a),
        image(5, 3, b),
        image(7, 6, Texels::Rgba16(words)),
        image(1, 1, Texels::Rgba8(vec![[10, 200, 30, 40]])),
        image(256, 1, Texels::Rgba8(codes)),
    ]
}

/// One material a case, whose only texture it is: headers come in the order of materials.
fn kernel(cases: &[Case]) -> TestKernel {
    let mut scene = Scene { images: images().into_iter().map(Into::into).collect(), ..empty_scene() };
    for (texture, case) in cases.iter().enumerate() {
        let [wrap_u, wrap_v] = case.wrap;
        scene.textures.push(Texture { image: case.image, wrap_u, wrap_v, filter: case.filter });
        let binding = Some(TextureBinding { texture, set: case.set, transform: case.transform });
        let (color, rough) = if case.srgb { (binding, None) } else { (None, binding) };
        scene.materials.push(Material {
            base_color_texture: color,
            metallic_roughness_texture: rough,
            ..Material::default()
        });
    }
    let primitive = |material| Primitive {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        texcoords: Some(vec![[0.0; 2]; 3]),
        triangles: vec![[0, 1, 2]],
        material,
        ..Primitive::default()
    };
    scene.meshes.push(Mesh { name: String::from("mesh"), primitives: (0..cases.len()).map(primitive).collect() });
    scene.instances.push(Instance { mesh: 0, object_to_world: DAffine3::IDENTITY, name: String::from("mesh") });
    TestKernel::with_scene("texture.comp", &scene)
}

fn sample(kernel: &TestKernel, at: &[(usize, [f32; 2])]) -> Vec<[f64; 4]> {
    // Only the first set is looked up: the second is where nothing is right.
    let inputs: Vec<_> = at.iter().map(|&(case, uv)| (case, uv, [f32::NAN; 2])).collect();
    sample_sets(kernel, &inputs)
}

/// By coordinates of both sets.
fn sample_sets(kernel: &TestKernel, at: &[(usize, [f32; 2], [f32; 2])]) -> Vec<[f64; 4]> {
    let input = |(case, [u, v], [u_1, v_1]): &(usize, [f32; 2], [f32; 2])| {
        [[u.to_bits(), v.to_bits(), *case as u32, 0], [u_1.to_bits(), v_1.to_bits(), 0, 0]]
    };
    let inputs: Vec<[u32; 4]> = at.iter().flat_map(input).collect();
    kernel.run(&inputs, at.len(), 1).into_iter().map(|t| floats(t).map(f64::from)).collect()
}

/// glTF 2.0, §3.8.4.
fn wrap(i: i64, size: u32, mode: Wrap) -> usize {
    let n = i64::from(size);
    let wrapped = match mode {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::ClampToEdge => i.clamp(0, n - 1),
        Wrap::MirroredRepeat => {
            let j = i.rem_euclid(2 * n);
            if j < n { j } else { 2 * n - 1 - j }
        }
    };
    wrapped as usize
}

fn texel(image: &Image, case: &Case, x: i64, y: i64) -> [f64; 4] {
    let index = wrap(y, image.height, case.wrap[1]) * image.width as usize + wrap(x, image.width, case.wrap[0]);
    let mut value = match &image.texels {
        Texels::Rgba8(texels) => texels[index].map(|c| f64::from(c) / 255.0),
        Texels::Rgba16(texels) => texels[index].map(|c| f64::from(c) / 65535.0),
    };
    if case.srgb {
        value[..3].iter_mut().for_each(|c| *c = srgb_to_linear(*c));
    }
    value
}

/// The exact lookup, and how near the coordinate is to where the nearest texel changes (in texels).
fn lookup(image: &Image, case: &Case, uv: [f32; 2]) -> ([f64; 4], f64) {
    let [u, v] = case.transform.apply(uv.map(f64::from));
    let (x, y) = (u * f64::from(image.width), v * f64::from(image.height));
    if case.filter == Filter::Nearest {
        let border = |x: f64| (x - x.round()).abs();
        return (texel(image, case, x.floor() as i64, y.floor() as i64), border(x).min(border(y)));
    }
    let (x, y) = (x - 0.5, y - 0.5);
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let (x, y) = (x.floor() as i64, y.floor() as i64);
    let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| texel(image, case, x + i, y + j));
    let mix = |a: f64, b: f64, f: f64| a + (b - a) * f;
    let channel = |c: usize| mix(mix(corners[0][c], corners[1][c], fx), mix(corners[2][c], corners[3][c], fx), fy);
    ([0, 1, 2, 3].map(channel), 1.0)
}

#[test]
fn filters_and_wrap_modes_are_exact() {
    let mut cases = Vec::new();
    for image in 0..4 {
        for (i, wrap_u) in WRAPS.into_iter().enumerate() {
            for filter in [Filter::Nearest, Filter::Linear] {
                for srgb in [false, true] {
                    cases.push(Case { image, wrap: [wrap_u, WRAPS[(i + image) % 3]], filter, srgb, ..PLAIN });
                }
            }
        }
    }
    let mut random = Random(32);
    let mut at = Vec::new();
    for case in 0..cases.len() {
        // Corners of texels and beyond on both sides, centres, and anywhere.
        let grid = |i: i32| (i as f32) / 16.0 - 1.5;
        at.extend((0..48).flat_map(|i| [(case, [grid(i), 0.3]), (case, [0.7, grid(i)]), (case, [grid(i), grid(i)])]));
        at.extend((0..256).map(|_| (case, [0.0; 2].map(|_| random.between(-3.0, 3.0) as f32))));
    }
    let images = images();
    let results = sample(&kernel(&cases), &at);
    for ((case, uv), result) in at.iter().zip(&results) {
        let (expected, border) = lookup(&images[cases[*case].image], &cases[*case], *uv);
        if border < 1e-5 && border > 0.0 {
            continue;
        }
        for (got, expected) in result.iter().zip(expected) {
            // Coordinates up to 3 in 8 texels are known to 2^-21; decoding has a relative error of 1e-5.
            let tolerance = 1.5e-6 + 1e-5 * expected;
            assert!((got - expected).abs() < tolerance, "{:?} at {uv:?}: {got} instead of {expected}", cases[*case]);
        }
    }
    // The comparison sees a wrong wrap mode.
    let wrong = Case { wrap: [Wrap::ClampToEdge; 2], ..cases[0] };
    let differs = |((case, uv), result): (&(usize, [f32; 2]), &[f64; 4])| {
        *case == 0 && (lookup(&images[0], &wrong, *uv).0[0] - result[0]).abs() > 1e-3
    };
    assert!(at.iter().zip(&results).any(differs));
}

/// KHR_texture_transform on either set, against the transform in f64.
#[test]
fn transforms_and_sets_are_exact() {
    let mut random = Random(33);
    let mut number = |low, high| random.between(low, high);
    let mut cases = Vec::new();
    for i in 0..24 {
        let offset = [number(-2.0, 2.0), number(-2.0, 2.0)];
        let transform = TextureTransform::new(offset, number(-4.0, 4.0), [number(-3.0, 3.0), number(-3.0, 3.0)]);
        cases.push(Case { image: i % 3, wrap: [WRAPS[i % 3], WRAPS[i / 3 % 3]], set: i % 2, transform, ..PLAIN });
    }
    // The same image and sampler on another set, or under another transform, is another texture.
    cases.push(Case { set: 1, ..PLAIN });
    cases.push(PLAIN);
    let mut coordinates = || [0; 2].map(|_| number(-2.0, 2.0) as f32);
    let at: Vec<_> = (0..cases.len())
        .flat_map(|case| (0..64).map(move |_| case))
        .map(|case| (case, coordinates(), coordinates()))
        .collect();
    let images = images();
    let mut swapped = 0.0_f64;
    for ((case, first, second), result) in at.iter().zip(sample_sets(&kernel(&cases), &at)) {
        let case = &cases[*case];
        let sets = [*first, *second];
        let (expected, _) = lookup(&images[case.image], case, sets[case.set]);
        let (other, _) = lookup(&images[case.image], case, sets[1 - case.set]);
        for channel in 0..4 {
            // Coordinates of up to 14, in 8 texels of contrast 1, are known to 2^-20 each.
            let error = (result[channel] - expected[channel]).abs();
            assert!(error < 1e-4, "{case:?} at {sets:?}: {result:?} instead of {expected:?}");
            swapped = swapped.max((result[channel] - other[channel]).abs());
        }
    }
    assert!(swapped > 0.1, "the comparison sees the wrong set");
}

#[test]
fn all_srgb_codes_are_decoded() {
    let case = Case { image: 4, filter: Filter::Nearest, srgb: true, ..PLAIN };
    let at: Vec<(usize, [f32; 2])> = (0..256).map(|i| (0, [(i as f32 + 0.5) / 256.0, 0.5])).collect();
    let mut worst = 0.0_f64;
    for (code, result) in sample(&kernel(&[case]), &at).iter().enumerate() {
        let encoded = code as f64 / 255.0;
        let exact = srgb_to_linear(encoded);
        if code > 0 {
            worst = worst.max((result[0] / exact - 1.0).abs());
        }
        assert!((result[0] - exact).abs() <= 1e-5 * exact, "code {code}: {} instead of {exact}", result[0]);
        assert!((result[3] - encoded).abs() <= 1e-7, "alpha {code} is not decoded: {}", result[3]);
    }
    eprintln!("worst relative error of the sRGB decoding: {worst:.2e}");
}

/// Coordinates that are no numbers, or far too large, give some texel and no harm.
#[test]
fn wild_coordinates_are_harmless() {
    let filters = [Filter::Nearest, Filter::Linear];
    let case = |wrap| filters.map(|filter| Case { wrap: [wrap; 2], filter, ..PLAIN });
    let cases: Vec<Case> = WRAPS.into_iter().flat_map(case).collect();
    let wild = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -f32::MAX, 1e10, -3e9, 1e-40, -0.0, -1e-30];
    let at: Vec<(usize, [f32; 2])> = (0..cases.len())
        .flat_map(|case| wild.into_iter().flat_map(move |u| [(case, [u, 0.5]), (case, [0.5, u])]))
        .collect();
    for ((case, uv), result) in at.iter().zip(sample(&kernel(&cases), &at)) {
        assert!(result.iter().all(|c| (0.0..=1.0 + 1e-6).contains(c)), "{:?} at {uv:?}: {result:?}", cases[*case]);
    }
}
