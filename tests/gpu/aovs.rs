//! AOVs: what they are of scenes whose surfaces are known, that they change nothing of the image, and that they are as
//! deterministic as it is.

use std::f64::consts::FRAC_PI_3;

use glam::{DAffine3, DVec2, DVec3};

use crate::common::builder::{camera, rectangle, scene};
use crate::common::gpu;
use crate::common::scenes::{scene as scene_file, short_form};
use crate::common::trace::icosphere;
use sunfleck::Error;
use sunfleck::film::aov::{Aov, AovFilm};
use sunfleck::gpu::TraceBackend;
use sunfleck::render::{BindingOverride, PathTracer, Run, Settings, prepare_scene};
use sunfleck::scene::{Bsdf, Camera, Material, Projection, Scene};

/// All AOVs that the back end under test gives.
fn all_aovs() -> Vec<Aov> {
    let counts = gpu::device().trace == TraceBackend::Bvh;
    Aov::ALL.iter().copied().filter(|&aov| aov != Aov::Cost || counts).collect()
}

fn settings(width: u32, height: u32) -> Settings {
    Settings { aovs: all_aovs(), ..gpu::settings(width, height) }
}

fn run(scene: &Scene, settings: &Settings) -> Run {
    gpu::run(&mut gpu::path_tracer(scene, settings), 1, 32)
}

/// The means of an AOV of three channels.
fn vectors(run: &Run, aov: Aov) -> Vec<DVec3> {
    let means = aovs(run).means(aov, &run.film).expect("it is kept");
    (0..means[0].len()).map(|i| DVec3::new(means[0][i], means[1][i], means[2][i])).collect()
}

fn numbers(run: &Run, aov: Aov) -> Vec<f64> {
    aovs(run).means(aov, &run.film).expect("it is kept").remove(0)
}

fn aovs(run: &Run) -> &AovFilm {
    run.aovs.as_ref().expect("the settings ask for AOVs")
}

/// Rounding of a sum of 16 terms of at most `most` in f32, and of the terms: each position is good to 16 roundings of the
/// largest coordinate.
fn rounding(most: f64) -> f64 {
    32.0 * most * f64::from(f32::EPSILON)
}

/// A tilted plane fills the view; far from the origin, so that the rebasing shows.
#[test]
fn a_plane_has_its_depth_position_normal_and_colour() {
    let centre = DVec3::new(3e4, -2e4, 1e4);
    let (a, b) = (DVec3::new(40.0, 0.0, 10.0), DVec3::new(0.0, 40.0, -20.0));
    let normal = a.cross(b).normalize();
    let colour = [0.25, 0.5, 0.75];
    let eye = centre + DVec3::new(0.0, 0.0, 5.0);
    let plane = rectangle(centre - 0.5 * (a + b), a, b, 0);
    let scene = scene(vec![plane], vec![Material::lambertian("plane", colour)], camera(eye, centre, 0.5));
    let settings = settings(24, 16);
    let run = run(&scene, &settings);
    let (positions, normals, albedos) =
        (vectors(&run, Aov::Position), vectors(&run, Aov::Normal), vectors(&run, Aov::Albedo));
    let (depths, coverage) = (numbers(&run, Aov::Depth), numbers(&run, Aov::Coverage));
    // In rebased space nothing is farther than this; vertices were rounded to f32 at 3·10⁴.
    let tolerance = rounding(16.0) + 3e4 * f64::from(f32::EPSILON);
    let half_height = 0.25_f64.tan();
    for pixel in 0..positions.len() {
        assert_eq!(coverage[pixel], 1.0);
        assert!((albedos[pixel] - DVec3::from(colour.map(f64::from))).length() <= rounding(1.0), "{}", albedos[pixel]);
        assert!((normals[pixel] - normal).length() <= 1e-3 / 3.0, "{} is not {normal}", normals[pixel]);
        let p = positions[pixel] - centre;
        assert!(p.dot(normal).abs() <= tolerance, "pixel {pixel}: {p} is {} off the plane", p.dot(normal));
        // The depth is linear in the position, so the means go together. The camera looks along −z.
        let depth = eye.z - positions[pixel].z;
        assert!((depths[pixel] - depth).abs() <= tolerance, "pixel {pixel}: {} is not {depth}", depths[pixel]);
        // The mean over a pixel's samples is a point that the pixel sees.
        let film = DVec2::new(p.x, p.y) / (depth * half_height);
        let (x, y) = ((film.x / 1.5 * 0.5 + 0.5) * 24.0, (0.5 - 0.5 * film.y) * 16.0);
        let (column, row) = ((pixel % 24) as f64, (pixel / 24) as f64);
        let inside = |value: f64, from: f64| (from - 1e-3..=from + 1.0 + 1e-3).contains(&value);
        assert!(inside(x, column) && inside(y, row), "pixel ({column}, {row}) has the mean position ({x}, {y})");
    }
}

/// An orthographic camera whose pixels are squares of 1.
fn pixel_camera(side: f64) -> Camera {
    let projection = Projection::Orthographic { ymag: 0.5 * side };
    Camera { projection, ..camera(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 1.0) }
}

/// The left half of the image and half of a column are covered: where there is nothing there is 0, and means over the coverage
/// are those of the surface.
#[test]
fn what_is_not_hit_counts_as_zero() {
    let wall = rectangle(DVec3::new(-4.0, -4.0, 1.0), DVec3::X * 4.5, DVec3::Y * 8.0, 0);
    let scene = scene(vec![wall], vec![Material::lambertian("wall", [0.5; 3])], pixel_camera(8.0));
    let run = run(&scene, &settings(8, 8));
    let (coverage, depths) = (numbers(&run, Aov::Coverage), numbers(&run, Aov::Depth));
    let normals = vectors(&run, Aov::Normal);
    for pixel in 0..64 {
        let share = coverage[pixel];
        match pixel % 8 {
            0..4 => assert_eq!(share, 1.0),
            // 32 samples, each inside with probability 1/2: six standard deviations.
            4 => assert!((share - 0.5).abs() < 6.0 * (0.25_f64 / 32.0).sqrt() && share > 0.0, "{share}"),
            _ => assert_eq!((share, depths[pixel], normals[pixel]), (0.0, 0.0, DVec3::ZERO)),
        }
        assert!((depths[pixel] - 3.0 * share).abs() <= rounding(4.0), "{} at {share}", depths[pixel]);
        assert!((normals[pixel] - share * DVec3::Z).length() <= rounding(1.0));
    }
    let over_hits = &aovs(&run).means_of_hits(Aov::Depth).expect("it is kept")[0];
    for (pixel, &depth) in over_hits.iter().enumerate() {
        assert_eq!(aovs(&run).is_hit(pixel), coverage[pixel] > 0.0);
        let expected = if coverage[pixel] > 0.0 { 3.0 } else { 0.0 };
        assert!((depth - expected).abs() <= rounding(4.0), "pixel {pixel}: {depth}");
    }
}

/// The albedo is the base colour whatever the lobes are; a black back has none.
#[test]
fn every_material_has_its_base_colour_as_albedo() {
    let colour = [0.8, 0.4, 0.2];
    let of = |bsdf: Bsdf| Material { bsdf, ..Material::lambertian("m", colour) };
    let metal = Material { metallic: 1.0, roughness: 0.3, ..of(Bsdf::MetallicRoughness) };
    let pane = Material { transmission: 1.0, roughness: 0.0, ..of(Bsdf::MetallicRoughness) };
    let front = |material: Material| (material, true);
    let black_back = Material { black_back: true, ..of(Bsdf::Lambertian) };
    let cases = [
        front(of(Bsdf::Lambertian)),
        front(of(Bsdf::Mirror)),
        front(of(Bsdf::Refract)),
        front(of(Bsdf::Glass)),
        front(metal),
        front(pane),
        front(of(Bsdf::Unlit)),
        (black_back, false),
    ];
    for (material, is_front) in cases {
        let expected = if is_front { DVec3::from(colour.map(f64::from)) } else { DVec3::ZERO };
        let (corner, a, b) = (DVec3::new(-5.0, -5.0, 0.0), DVec3::X * 10.0, DVec3::Y * 10.0);
        let wall = if is_front { rectangle(corner, a, b, 0) } else { rectangle(corner, b, a, 0) };
        let name = format!("{:?}", material.bsdf);
        let scene = scene(vec![wall], vec![material], pixel_camera(4.0));
        let run = run(&scene, &Settings { max_bounces: Some(2), ..settings(4, 4) });
        for albedo in vectors(&run, Aov::Albedo) {
            assert!((albedo - expected).length() <= rounding(1.0), "{name}: {albedo}");
        }
        // The side that is seen.
        vectors(&run, Aov::Normal)
            .iter()
            .for_each(|n| assert!((*n - DVec3::Z).length() <= rounding(1.0), "{name}: {n}"));
    }
}

/// A sphere of flat triangles with the sphere's normals: interpolated, position and normal of a point go the same way from the
/// centre. Their means over a pixel do so to the first order in how far positions lie below the sphere (1 − cos 6°, half
/// a percent) times what a pixel sees of it (a tenth).
#[test]
fn normals_are_those_of_the_vertices() {
    let mut ball = icosphere(3);
    ball.normals = Some(ball.positions.clone());
    let view = camera(DVec3::new(1.0, 2.0, 4.0), DVec3::ZERO, 0.5);
    let eye = view.camera_to_world.translation;
    let run = run(&scene(vec![ball], vec![Material::lambertian("ball", [0.5; 3])], view), &settings(48, 48));
    let (normals, positions, coverage) =
        (vectors(&run, Aov::Normal), vectors(&run, Aov::Position), numbers(&run, Aov::Coverage));
    let mut seen = 0;
    for pixel in (0..coverage.len()).filter(|&pixel| coverage[pixel] == 1.0) {
        let (radial, normal) = (positions[pixel].normalize(), normals[pixel].normalize());
        // At the silhouette normals are turned up to the side that is seen.
        if radial.dot((eye - positions[pixel]).normalize()) > 0.3 {
            assert!((radial - normal).length() < 5e-4, "pixel {pixel}: {normal} at {radial}");
            seen += 1;
        }
    }
    assert!(seen > 300, "{seen} pixels");
}

fn bits(run: &Run) -> Vec<[u64; 4]> {
    let pixels = run.film.pixels().iter();
    pixels.map(|p| [p.rgb[0], p.rgb[1], p.rgb[2], p.luminance_squared].map(f64::to_bits)).collect()
}

/// The image is the same, bit for bit, with everything kept and counted that there is.
#[test]
fn the_image_is_the_same_with_and_without() {
    // Small scenes are compiled in, unless one says otherwise; the others are traced by the BVH.
    let cases: &[(&str, bool)] = if short_form() {
        &[("cornell", true), ("cornell", false)]
    } else {
        &[
            ("cornell", true),
            ("cornell", false),
            ("alpha", true),
            ("instances", true),
            ("textured", false),
            ("volumes", true),
        ]
    };
    for &(name, bake) in cases {
        let scene = scene_file(name);
        let without = Settings { bake, ..gpu::settings(40, 33) };
        let with = Settings { aovs: all_aovs(), statistics: true, ..without.clone() };
        let [plain, extra] = [&without, &with].map(|settings| run(&scene, settings));
        assert_eq!(bits(&plain), bits(&extra), "{name}, compiled in: {bake}");
        assert_eq!((plain.aovs, plain.statistics), (None, None));
    }
}

/// AOVs that are asked for alone are those of a run with all of them.
#[test]
fn each_alone_is_what_it_is_with_the_others() {
    let scene = scene_file("cornell");
    let all = run(&scene, &settings(32, 24));
    for aov in all_aovs() {
        let alone = run(&scene, &Settings { aovs: vec![aov], ..settings(32, 24) });
        assert_eq!(aovs(&alone).means(aov, &alone.film), aovs(&all).means(aov, &all.film), "{aov}");
        assert_eq!(aovs(&alone).aovs().collect::<Vec<_>>(), [aov]);
    }
}

/// Neither slices nor workgroups nor budgets of rays, which cut paths in two, change a bit.
#[test]
fn slices_and_budgets_do_not_change_a_bit() {
    for name in if short_form() { &["cornell"][..] } else { &["alpha", "cornell"] } {
        let scene = scene_file(name);
        let with = |overrides: BindingOverride| {
            let mut tracer = gpu::path_tracer_with(&scene, &settings(50, 37), overrides);
            gpu::run(&mut tracer, 3, 40)
        };
        let reference = with(BindingOverride::default());
        for (slice_lanes, workgroup_size, ray_budget) in
            [(Some(1000), Some(32), None), (Some(4096), Some(128), Some(3)), (None, None, Some(50))]
        {
            let other = with(BindingOverride { slice_lanes, workgroup_size, ray_budget, ..BindingOverride::default() });
            assert_eq!(reference.aovs, other.aovs, "{name}: {slice_lanes:?} {workgroup_size:?} {ray_budget:?}");
        }
    }
}

/// Where the driver puts in the specialisation constants, what is not kept is bound, and not used.
#[test]
fn who_specializes_does_not_change_a_bit() {
    if short_form() {
        eprintln!("not run: some drivers take minutes to compile the whole kernel");
        return;
    }
    let scene = scene_file("alpha");
    let settings = Settings { statistics: true, bake: false, ..settings(32, 24) };
    let by_driver = BindingOverride { driver_specializes: true, ..BindingOverride::default() };
    let [ours, driver] = [BindingOverride::default(), by_driver]
        .map(|overrides| gpu::run(&mut gpu::path_tracer_with(&scene, &settings, overrides), 1, 16));
    assert_eq!(ours.aovs, driver.aovs);
    let counts = |run: &Run| run.statistics.as_ref().map(|s| (s.camera, s.scattered, s.shadow));
    assert_eq!(counts(&ours), counts(&driver));
}

/// The camera's own turn does not matter for the depth, nor the lens: points of a plane that faces the camera have one depth.
#[test]
fn depth_is_along_the_axis() {
    for (yfov, lens_radius) in [(FRAC_PI_3, 0.0), (1.0, 0.2)] {
        let (eye, target) = (DVec3::new(2.0, 3.0, 4.0), DVec3::new(-1.0, 0.5, -2.0));
        let view = Camera { lens_radius, focus_distance: 5.0, ..camera(eye, target, yfov) };
        let DAffine3 { matrix3, .. } = view.camera_to_world;
        let centre = eye - 7.0 * matrix3.z_axis;
        let (a, b) = (matrix3.x_axis * 60.0, matrix3.y_axis * 60.0);
        let wall = rectangle(centre - 0.5 * (a + b), a, b, 0);
        let scene = scene(vec![wall], vec![Material::lambertian("wall", [0.5; 3])], view);
        for depth in numbers(&run(&scene, &settings(16, 16)), Aov::Depth) {
            // Coordinates of the wall reach 40.
            assert!((depth - 7.0).abs() <= rounding(40.0), "{depth}");
        }
    }
}

#[test]
fn cost_is_refused_where_it_cannot_be_counted() {
    let scene = scene_file("cornell");
    let settings = Settings { aovs: vec![Aov::Cost], ..gpu::settings(8, 8) };
    let (camera, gpu) = (&scene.cameras[0], &gpu::device().gpu);
    let prepared = prepare_scene(&scene, camera, &settings).expect("the scene fits");
    let tracer = PathTracer::new(gpu, TraceBackend::RayQuery, &prepared, camera, &settings, BindingOverride::default());
    match tracer {
        Err(Error::Usage(message)) => assert!(message.contains("cost") && message.contains("--trace bvh"), "{message}"),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("it was not refused"),
    }
}
