//! Mip chains and the ray cones that choose their levels: the shader's lookups and cones against f64, and images with and
//! without them.

use glam::{DAffine3, DMat2, DVec2, DVec3};
use sunfleck::prepare::srgb_to_linear;
use sunfleck::render::Settings;
use sunfleck::scene::{
    Bsdf, Filter, Image, Instance, Material, Mesh, Primitive, Projection, Scene, Texels, Texture, TextureBinding,
    TextureTransform, Wrap,
};

use crate::common::kernel::{Random, TestKernel, empty_scene, floats, vector_texel};
use crate::common::statistics::{Comparison, TileStatistics};
use crate::common::{builder, gpu, scenes, trace};

fn texture(image: usize) -> Texture {
    Texture { image, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, filter: Filter::Linear }
}

/// Linear texels of the levels of a chain whose sides are powers of two.
struct Chain(Vec<(usize, usize, Vec<[f64; 4]>)>);

impl Chain {
    fn new(image: &Image, srgb: bool) -> Self {
        let Texels::Rgba8(texels) = &image.texels else { unreachable!() };
        let decode = |texel: &[u8; 4]| {
            let [r, g, b, a] = texel.map(|code| f64::from(code) / 255.0);
            if srgb { [srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b), a] } else { [r, g, b, a] }
        };
        let first: Vec<[f64; 4]> = texels.iter().map(decode).collect();
        let mut levels = vec![(image.width as usize, image.height as usize, first)];
        while let Some((width, height, above)) = levels.last().filter(|level| level.0 * level.1 > 1) {
            let (columns, rows): (usize, usize) = ((width / 2).max(1), (height / 2).max(1));
            let mean = |i: usize| {
                let (x, y) = (i % columns * 2, i / columns * 2);
                let at = |dx: usize, dy: usize| above[(y + dy).min(height - 1) * width + (x + dx).min(width - 1)];
                [0, 1, 2, 3].map(|c: usize| 0.25 * (at(0, 0)[c] + at(1, 0)[c] + at(0, 1)[c] + at(1, 1)[c]))
            };
            let below: Vec<[f64; 4]> = (0..columns * rows).map(mean).collect();
            levels.push((columns, rows, below));
        }
        Self(levels)
    }

    /// Bilinear, repeated.
    fn look_up(&self, level: usize, uv: DVec2) -> [f64; 4] {
        let (width, height, texels) = &self.0[level];
        let at = uv * DVec2::new(*width as f64, *height as f64) - 0.5;
        let corner = at.floor();
        let f = at - corner;
        let texel = |dx: i64, dy: i64| {
            let x = (corner.x as i64 + dx).rem_euclid(*width as i64) as usize;
            let y = (corner.y as i64 + dy).rem_euclid(*height as i64) as usize;
            texels[y * width + x]
        };
        let mix = |a: f64, b: f64, f: f64| a + (b - a) * f;
        [0, 1, 2, 3].map(|c: usize| {
            mix(mix(texel(0, 0)[c], texel(1, 0)[c], f.x), mix(texel(0, 1)[c], texel(1, 1)[c], f.x), f.y)
        })
    }
}

fn noise_image(random: &mut Random, width: u32, height: u32) -> Image {
    let texels = (0..width * height).map(|_| [0; 4].map(|_| random.bits() as u8)).collect();
    Image { name: String::from("noise"), width, height, texels: Texels::Rgba8(texels) }
}

/// A scene of textures alone, one a material: headers come in the order of materials. Those of even index are sRGB.
fn texture_kernel(images: Vec<Image>, transforms: &[TextureTransform]) -> TestKernel {
    let mut scene = Scene { images: images.into_iter().map(Into::into).collect(), ..empty_scene() };
    let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut primitives = Vec::new();
    for (i, &transform) in transforms.iter().enumerate() {
        scene.textures.push(texture(i));
        let binding = Some(TextureBinding { texture: i, set: 0, transform });
        let (color, rough) = if i % 2 == 0 { (binding, None) } else { (None, binding) };
        scene.materials.push(Material {
            base_color_texture: color,
            metallic_roughness_texture: rough,
            ..Material::default()
        });
        primitives.push(Primitive {
            positions: positions.clone(),
            texcoords: Some(vec![[0.0; 2]; 3]),
            triangles: vec![[0, 1, 2]],
            material: i,
            ..Primitive::default()
        });
    }
    scene.meshes.push(Mesh { name: String::from("mesh"), primitives });
    scene.instances.push(Instance { mesh: 0, object_to_world: DAffine3::IDENTITY, name: String::from("mesh") });
    TestKernel::with_scene("mip.comp", &scene)
}

/// The level whose texels are no wider than the footprint, by the smaller singular value of its map to texels.
#[test]
fn lookups_read_the_level_that_fits_the_footprint() {
    let mut random = Random(71);
    let sizes = [(64, 64), (128, 16), (8, 32), (1, 16)];
    let images: Vec<_> = sizes.map(|(width, height)| noise_image(&mut random, width, height)).into();
    let transforms: Vec<_> = (0..4)
        .map(|i| match i {
            0 => TextureTransform::IDENTITY,
            _ => TextureTransform::new([0.3, -0.7], f64::from(i), [0.5 * f64::from(i), 1.5]),
        })
        .collect();
    let chains: Vec<_> = images.iter().enumerate().map(|(i, image)| Chain::new(image, i % 2 == 0)).collect();
    let mut asked = Vec::new();
    for _ in 0..4096 {
        // Footprints of 1/16 to 2048 texels, up to 16 times as long as wide, in any plane.
        let index = random.below(4);
        let uv = DVec2::new(random.between(-2.0, 2.0), random.between(-2.0, 2.0)).as_vec2().as_dvec2();
        let size = 2f64.powf(random.between(-10.0, 5.0));
        let x = random.direction();
        let y = x.cross(random.direction()).normalize() * random.between(0.06, 1.0) + x * random.between(-1.0, 1.0);
        asked.push((index, uv, [x * size, y * size].map(|v| v.as_vec3().as_dvec3())));
    }
    let inputs: Vec<[u32; 4]> = asked
        .iter()
        .flat_map(|&(index, uv, [du, dv])| {
            let place = [(uv.x as f32).to_bits(), (uv.y as f32).to_bits(), index as u32, 0];
            [place, vector_texel(du, 0), vector_texel(dv, 0)]
        })
        .collect();
    let outputs = texture_kernel(images, &transforms).run(&inputs, asked.len(), 2);
    let mut seen = [0; 8];
    for (&(index, uv, [du, dv]), output) in asked.iter().zip(outputs.chunks_exact(2)) {
        let (chain, transform) = (&chains[index], &transforms[index]);
        let (width, height, _) = chain.0[0];
        let [u, v] = transform.rows.map(|row| row.map(f64::from));
        let a = (du * u[0] + dv * u[1]) * width as f64;
        let b = (du * v[0] + dv * v[1]) * height as f64;
        let [x, y] = across(a.cross(b).normalize());
        let texels = smaller_singular_value(DMat2::from_cols_array(&[a.dot(x), a.dot(y), b.dot(x), b.dot(y)]));
        let level = output[1][0] as usize;
        let expected = (texels.max(1.0).log2().floor() as usize).min(chain.0.len() - 1);
        let border = (texels.log2() - texels.log2().round()).abs();
        assert!(level == expected || border < 1e-4, "{texels} texels: level {level} instead of {expected}");
        seen[level] += 1;
        let uv = DVec2::from(transform.apply(uv.to_array()));
        let exact = chain.look_up(level, uv);
        for (got, exact) in floats(output[0]).iter().zip(exact) {
            // Coordinates up to 8 in 128 texels of contrast 1 are known to 2^-13; steps of 16 bits.
            assert!((f64::from(*got) - exact).abs() < 2e-4, "level {level} at {uv}: {got} instead of {exact}");
        }
    }
    assert!(seen[..7].iter().all(|&count| count > 20), "lookups by level: {seen:?}");
}

/// Footprints that are no numbers, have no area or are far too large read some level and do no harm.
#[test]
fn wild_footprints_are_harmless() {
    let mut random = Random(72);
    let kernel = texture_kernel(vec![noise_image(&mut random, 16, 16)], &[TextureTransform::IDENTITY]);
    let wild = [0.0, f64::NAN, f64::INFINITY, -1e30, 1e-40, 1e19];
    let pairs: Vec<_> = wild.iter().flat_map(|&x| wild.map(|y| [DVec3::X * x, DVec3::Y * y])).collect();
    let texel = |v: DVec3| vector_texel(v, 0);
    let inputs: Vec<_> = pairs.iter().flat_map(|&[du, dv]| [[0, 0, 0, 0], texel(du), texel(dv)]).collect();
    for (pair, output) in pairs.iter().zip(kernel.run(&inputs, pairs.len(), 2).chunks_exact(2)) {
        assert!(output[1][0] <= 4, "{pair:?}: level {}", output[1][0]);
        assert!(floats(output[0]).iter().all(|c| (0.0..=1.0 + 1e-6).contains(c)), "{pair:?}: {:?}", floats(output[0]));
    }
}

/// A unit vector refracted at the plane y = 0 into the index `eta`, as seen against its direction; `None` beyond the
/// critical angle.
fn refracted(d: DVec3, eta: f64) -> Option<DVec3> {
    let tangential = DVec3::new(d.x, 0.0, d.z) / eta;
    let squared = 1.0 - tangential.length_squared();
    (squared > 0.0).then(|| tangential - DVec3::Y * squared.sqrt())
}

fn smaller_singular_value(m: DMat2) -> f64 {
    let [p, q, r] = [m.x_axis.length_squared(), m.x_axis.dot(m.y_axis), m.y_axis.length_squared()];
    (0.5 * (p + r - ((p - r).powi(2) + 4.0 * q * q).sqrt())).max(0.0).sqrt()
}

/// Two unit vectors that make an orthogonal frame with `d`.
fn across(d: DVec3) -> [DVec3; 2] {
    let (x, y) = d.any_orthonormal_pair();
    [x, y]
}

/// The map from offsets across `from` to offsets across `to`, by central differences of `f`.
fn jacobian(from: DVec3, to: DVec3, f: impl Fn(DVec3) -> DVec3) -> DMat2 {
    let h = 1e-5;
    let [x, y] = across(to);
    let column = |axis: DVec3| {
        let difference = (f(axis * h) - f(-axis * h)) / (2.0 * h);
        DVec2::new(difference.dot(x), difference.dot(y))
    };
    let [a, b] = across(from);
    DMat2::from_cols(column(a), column(b))
}

/// Cones against differentials of the camera's rays and of Snell's law: a cone is never wider than the share that it takes of
/// what it stands for, and a camera's is that, for square pixels.
#[test]
fn cones_are_no_wider_than_what_they_stand_for() {
    let mut scene = empty_scene();
    scene.cameras[0] = builder::camera(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.2, 0.1, -0.4), 1.4);
    for (width, height, orthographic) in [(200, 100, false), (64, 64, true)] {
        if orthographic {
            scene.cameras[0].projection = Projection::Orthographic { ymag: 3.0 };
        }
        let settings = Settings { width, height, ..gpu::settings(width, height) };
        let mut kernel = TestKernel::with_scene("ray_cone.comp", &scene);
        (kernel.prepared, kernel.constants) = gpu::prepared(&scene, &settings);
        let axis = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        let c = kernel.constants;
        let (right, up, forward) = (axis(c.camera_right), axis(c.camera_up), axis(c.camera_forward));
        let mut random = Random(73);
        let mut cases = Vec::new();
        while cases.len() < 1000 {
            let film = DVec2::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0));
            let eta = 2f64.powf(random.between(-1.5, 1.5));
            let incident = DVec3::new(0.0, -random.between(0.02, 1.0), 0.0);
            let incident = incident + DVec3::X * (1.0 - incident.y * incident.y).sqrt();
            if let Some(transmitted) = refracted(incident, eta) {
                cases.push((film, eta, incident, transmitted, 10f64.powf(random.between(-4.0, 6.0))));
            }
        }
        let ray = |film: DVec2| (forward + right * film.x - up * film.y).normalize();
        let inputs: Vec<_> = cases
            .iter()
            .flat_map(|&(film, eta, incident, transmitted, pdf)| {
                let event = [-incident.y, -transmitted.y, eta, pdf].map(|x| (x as f32).to_bits());
                [vector_texel(if orthographic { forward } else { ray(film) }, 0), event]
            })
            .collect();
        let outputs = kernel.run(&inputs, cases.len(), 2);
        for (&(film, eta, incident, transmitted, pdf), output) in cases.iter().zip(outputs.chunks_exact(2)) {
            let [camera_width, camera_spread, width, spread] = floats(output[0]).map(f64::from);
            let step = DVec2::new(2.0 / f64::from(settings.width), 2.0 / f64::from(settings.height));
            if orthographic {
                let pixel = (right.length() * step.x).min(up.length() * step.y);
                assert!((camera_width / (0.25 * pixel) - 1.0).abs() < 1e-5 && camera_spread == 0.0);
            } else {
                let [x, y] = across(ray(film));
                let h = 1e-4;
                let column = |d: DVec2| {
                    let difference = (ray(film + d * step * h) - ray(film - d * step * h)) / (2.0 * h);
                    DVec2::new(difference.dot(x), difference.dot(y))
                };
                let pixel = smaller_singular_value(DMat2::from_cols(column(DVec2::X), column(DVec2::Y)));
                let share = camera_spread / pixel;
                assert!(camera_width == 0.0 && (share - 0.25).abs() < 1e-4, "{share} of a pixel at {film}");
            }
            // A bundle of parallel rays: where those that are offset across it meet the plane, they go on.
            let offsets = jacobian(incident, transmitted, |offset| {
                let met = offset - incident * (offset.y / incident.y);
                met - transmitted * met.dot(transmitted)
            });
            let angles =
                jacobian(incident, transmitted, |d| refracted((incident + d).normalize(), eta).unwrap_or(transmitted));
            let (offsets, angles) = (smaller_singular_value(offsets), smaller_singular_value(angles));
            assert!(width <= offsets * 1.0001 && width >= offsets * 0.9999, "width {width} of {offsets}, {incident}");
            // Beside the critical angle the differences see beyond it.
            let near = transmitted.y > -0.02;
            assert!(near || (spread / angles - 1.0).abs() < 1e-3, "spread {spread} of {angles}, {incident} {eta}");
            let lobe = f64::from(floats(output[1])[0]);
            let solid_angle = (1.0 / pdf).min(2.0 * std::f64::consts::PI);
            assert!((lobe / (solid_angle.sqrt() / 32.0) - 1.0).abs() < 1e-5, "{lobe} at pdf {pdf}");
        }
    }
}

/// The rectangle of builder::rectangle with texture coordinates from 0 to 1.
fn textured(corner: DVec3, a: DVec3, b: DVec3, material: usize) -> Primitive {
    let texcoords = Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    Primitive { texcoords, ..builder::rectangle(corner, a, b, material) }
}

/// Grey noise that is smooth over `pitch` texels.
fn smooth_image([side, pitch]: [u32; 2]) -> Image {
    let mut random = Random(74);
    let n = (side / pitch) as usize;
    let lattice: Vec<f64> = (0..n * n).map(|_| random.unit()).collect();
    let texel = |i: u32| {
        let at = DVec2::new(f64::from(i % side), f64::from(i / side)) / f64::from(pitch);
        let (corner, f) = (at.floor(), at - at.floor());
        let value = |dx: usize, dy: usize| lattice[(corner.y as usize + dy) % n * n + (corner.x as usize + dx) % n];
        let top = value(0, 0) + (value(1, 0) - value(0, 0)) * f.x;
        let bottom = value(0, 1) + (value(1, 1) - value(0, 1)) * f.x;
        [((top + (bottom - top) * f.y) * 255.0).round() as u8; 4]
    };
    Image {
        name: String::from("smooth"),
        width: side,
        height: side,
        texels: Texels::Rgba8((0..side * side).map(texel).collect()),
    }
}

/// Radiance of the first channel with and without mip chains, by the same samples.
fn with_and_without(scene: &Scene, side: u32, spp: u32) -> [Vec<f64>; 2] {
    [true, false].map(|mip| {
        let settings = Settings { mip, ..gpu::settings(side, side) };
        let film = gpu::run(&mut gpu::path_tracer(scene, &settings), 0, spp).film;
        film.radiance().iter().map(|pixel| f64::from(pixel[0])).collect()
    })
}

/// What is seen loses no detail, straight, at a slant, in a mirror, through flat glass and through a lens.
///
/// Texels of a level are at most w = 1/4 pixel wide: a box of w and the tent of the bilinear filter have the variance
/// w²/12 + w²/6 = w²/4, so the mip chain takes at most 2π²f²·w²/4 = 7.7 % of the finest waves that pixels can show, f = 1/2.
#[test]
fn what_is_seen_stays_sharp() {
    const SIDE: u32 = 48;
    // A picture of noise, 18 texels a pixel, whose waves are about a pixel long.
    let unlit = Material { bsdf: Bsdf::Unlit, base_color_texture: Some(TextureBinding::new(0)), ..Material::default() };
    let glass = Material { bsdf: Bsdf::Refract, ior: 1.5, ..Material::default() };
    let mirror = Material { bsdf: Bsdf::Mirror, ..Material::default() };
    let eye = DVec3::new(0.0, 0.0, 4.0);
    let straight = builder::camera(eye, DVec3::ZERO, 0.6);
    let slanted = builder::camera(DVec3::new(3.0, 0.0, 2.5), DVec3::ZERO, 0.4);
    let picture = textured(DVec3::new(-1.5, -1.5, 0.0), DVec3::X * 3.0, DVec3::Y * 3.0, 0);
    let pane = builder::placed(trace::cube(1), 0.5, DVec3::new(0.0, 0.0, 1.5), 1);
    let in_mirror = textured(DVec3::new(-1.5, -1.5, 4.5), DVec3::X * 3.0, DVec3::Y * 3.0, 0);
    let reflector = builder::rectangle(DVec3::new(-1.5, -1.5, 0.0), DVec3::X * 3.0, DVec3::Y * 3.0, 2);
    // A ball lens close to the picture, which it shows about twice as large.
    let centre = DVec3::new(0.0, 0.0, 0.75);
    let close = builder::camera(eye, DVec3::ZERO, 0.34);
    let mut lens = builder::placed(trace::icosphere(4), 0.6, centre, 1);
    let normal = |&p: &[f32; 3]| (DVec3::from(p.map(f64::from)) - centre).normalize().as_vec3().to_array();
    lens.normals = Some(lens.positions.iter().map(normal).collect());
    let views = [
        ("straight", straight.clone(), vec![picture.clone()], [1024, 16]),
        ("slanted", slanted.clone(), vec![picture.clone()], [1024, 16]),
        ("pane", slanted, vec![picture.clone(), pane], [1024, 16]),
        ("mirror", straight, vec![in_mirror, reflector], [1024, 16]),
        ("lens", close, vec![picture, lens], [2048, 8]),
    ];
    for (name, camera, primitives, image) in views {
        let mut scene = builder::scene(primitives, vec![unlit.clone(), glass.clone(), mirror.clone()], camera);
        scene.images.push(smooth_image(image).into());
        scene.textures.push(texture(0));
        let [mip, plain] = with_and_without(&scene, SIDE, 64);
        let n = plain.len() as f64;
        let mean = plain.iter().sum::<f64>() / n;
        let contrast = (plain.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        let lost = (mip.iter().zip(&plain).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / n).sqrt() / contrast;
        let shift = mip.iter().zip(&plain).map(|(a, b)| a - b).sum::<f64>() / n / mean;
        println!("{name}: {:.2} % of the contrast {contrast:.3} lost, mean {shift:+.1e}", 100.0 * lost);
        assert!(lost < 0.077, "{name}: {lost} of the contrast is lost");
        assert!(shift.abs() < 2e-3, "{name}: the mean shifts by {shift:e}");
        assert!(name == "lens" || lost > 0.0, "{name}: no level but the first was read");
    }
}

/// Light that a picture of fine black and white squares scatters on a wall is that of the picture itself.
#[test]
fn scattered_light_stays_the_same() {
    let squares = |i: u32| if (i % 256 / 8 + i / 256 / 8).is_multiple_of(2) { [255; 4] } else { [0, 0, 0, 255] };
    let floor = Material {
        bsdf: Bsdf::Lambertian,
        base_color_texture: Some(TextureBinding::new(0)),
        double_sided: true,
        ..Material::default()
    };
    let wall = Material { bsdf: Bsdf::Lambertian, base_color: [0.9; 3], double_sided: true, ..Material::default() };
    let lamp = Material { emission: [10.0; 3], base_color: [0.0; 3], double_sided: true, ..Material::default() };
    let primitives = vec![
        textured(DVec3::new(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::NEG_Z * 2.0, 0),
        builder::rectangle(DVec3::new(-1.0, 0.0, -1.0), DVec3::X * 2.0, DVec3::Y * 2.0, 1),
        builder::rectangle(DVec3::new(-0.3, 1.0, -0.98), DVec3::X * 0.6, DVec3::Z * 0.3, 2),
    ];
    let camera = builder::camera(DVec3::new(0.0, 0.6, 3.0), DVec3::new(0.0, 0.5, -0.5), 0.6);
    let mut scene = builder::scene(primitives, vec![floor, wall, lamp], camera);
    let texels = Texels::Rgba8((0..256 * 256).map(squares).collect());
    scene.images.push(Image { name: String::from("squares"), width: 256, height: 256, texels }.into());
    scene.textures.push(texture(0));
    let side = 32;
    let (seeds, spp) = if scenes::slow_driver() { (16, 64) } else { (24, 128) };
    let [mip, plain]: [TileStatistics; 2] = [true, false].map(|mip| {
        let settings = Settings { mip, ..gpu::settings(side, side) };
        // Seeds of their own: the test is one of independent images.
        let mut tracer = gpu::path_tracer(&scene, &settings);
        let mut statistics = TileStatistics::new(side as usize, side as usize, 8);
        for seed in 0..seeds {
            statistics.add(&gpu::run(&mut tracer, seed + 1000 * u32::from(mip), spp).film.radiance());
        }
        statistics
    });
    let comparison = Comparison::new(&mip.tiles(), &plain.tiles(), 0.01);
    let [a, b] = [mip.image()[0], plain.image()[0]];
    println!("ratio of the means {:.5} +- {:.5}", a.mean / b.mean, a.relative_error().hypot(b.relative_error()));
    assert!(comparison.passed(), "{comparison:?}");
    assert!(a.deviation(&b) < 4.0, "{} instead of {}", a.mean, b.mean);
}
