//! Image files: EXR round trips with attributes, PNG values, tone curves, atomic writing.

use std::fs;
use std::path::Path;

use glam::{DAffine3, DMat4, DVec3, Mat4, Vec4};
use sunfleck::atomic_file::{check_writable, write_atomically};
use sunfleck::film::Film;
use sunfleck::film::exr::{ChannelValues, ExrImage, read_exr};
use sunfleck::film::metadata::{
    Metadata, REC709_CHROMATICITIES, software, world_to_camera, world_to_ndc_orthographic, world_to_ndc_perspective,
};
use sunfleck::film::output::ImageFormat;
use sunfleck::film::png::{NON_FINITE_SRGB8, tone_map_srgb8, write_png};
use sunfleck::film::tonemap::{ToneMap, srgb_encode, to_srgb8};

fn film() -> Film {
    let mut film = Film::new(5, 3);
    for pixel in 0..15 {
        let value = pixel as f64;
        for sample in 0..=pixel as u32 {
            film.add_block(pixel, [value, 0.5 * value, f64::from(sample)], value * value, 2);
        }
    }
    film
}

fn metadata() -> Metadata {
    let mut matrix = [0.0; 16];
    matrix.iter_mut().enumerate().for_each(|(i, m)| *m = i as f32 + 0.5);
    Metadata {
        samples_per_pixel: Some(16.0),
        seed: Some(4_000_000_000),
        sample_ranges: vec![0..16, 32..48],
        render_time_seconds: Some(1.25),
        world_to_camera: Some(matrix),
        world_to_ndc: Some(matrix.map(|m| -m)),
        chromaticities: Some(REC709_CHROMATICITIES),
        software: Some(software()),
        kernel_key: Some("bvh/w4/µ".to_owned()),
        scene: Some("cornell".to_owned()),
        integrator: Some("path".to_owned()),
        sampler: Some("sobol".to_owned()),
        clamp_indirect: Some(10.0),
        estimated_error: Some(0.25),
        estimated_error_interval: Some([0.125, 0.5]),
        device: Some("llvmpipe, 25.0".to_owned()),
        other: [("comment of the test".to_owned(), "größer".to_owned())].into(),
    }
}

#[test]
fn exr_keeps_channels_and_attributes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    let mut image = ExrImage::from_film(&film(), metadata());
    image.push("albedo.R", ChannelValues::F32((0..15).map(|i| i as f32 / 15.0).collect()));
    image.write(&path).unwrap();
    let read = read_exr(&path).unwrap();
    assert_eq!((read.width, read.height), (5, 3));
    assert_eq!(read.metadata, image.metadata);
    assert_eq!(read.metadata.software.as_deref(), Some(concat!("sunfleck ", env!("CARGO_PKG_VERSION"))));
    assert_eq!(read.channels.len(), 6);
    for channel in &image.channels {
        assert_eq!(read.values(&channel.name), Some(&channel.values), "{}", channel.name);
    }
    // Nothing else is left in the folder.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn exr_keeps_every_bit_of_every_float() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bits.exr");
    let values = vec![0.0, -0.0, f32::MIN_POSITIVE, 1e-45, f32::MAX, f32::INFINITY, f32::NAN, 0.1];
    let mut image = ExrImage { width: 8, height: 1, channels: Vec::new(), metadata: Metadata::default() };
    image.push("R", ChannelValues::F32(values.clone()));
    image.write(&path).unwrap();
    let read = read_exr(&path).unwrap().values("R").unwrap().to_f32();
    assert_eq!(
        read.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
        values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    );
}

#[test]
fn film_comes_back_from_its_image() {
    let again = ExrImage::from_film(&film(), metadata()).to_film().unwrap();
    assert_eq!(again.radiance(), film().radiance());
    let counts = |film: &Film| film.pixels().iter().map(|p| p.count).collect::<Vec<_>>();
    assert_eq!(counts(&again), counts(&film()));
}

#[test]
fn half_channels_of_other_programs_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.exr");
    exr::prelude::write_rgb_file(&path, 2, 2, |x, y| {
        (half::f16::from_f32(x as f32), half::f16::from_f32(y as f32), half::f16::from_f32(0.25))
    })
    .unwrap();
    let rgb = read_exr(&path).unwrap().rgb().unwrap();
    assert_eq!(rgb, vec![[0.0, 0.0, 0.25], [1.0, 0.0, 0.25], [0.0, 1.0, 0.25], [1.0, 1.0, 0.25]]);
}

#[test]
fn a_broken_exr_is_an_input_error_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    ExrImage::from_film(&film(), metadata()).write(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    for length in [0, 3, 40, bytes.len() / 2, bytes.len() - 1] {
        fs::write(&path, &bytes[..length]).unwrap();
        let error = read_exr(&path).unwrap_err();
        assert_eq!(error.exit_code(), 3, "{length} bytes: {error}");
        assert!(error.to_string().contains("image.exr"), "{error}");
    }
    assert_eq!(read_exr(&folder.path().join("missing.exr")).unwrap_err().exit_code(), 3);
    assert_eq!(read_exr(folder.path()).unwrap_err().exit_code(), 3);
}

#[test]
fn camera_matrices_take_points_where_openexr_says() {
    // OpenEXR multiplies row vectors: with the matrix read row by row, (x, y, z, 1) · M.
    let apply = |m: [f32; 16], p: DVec3| {
        let v = Mat4::from_cols_array(&m) * Vec4::new(p.x as f32, p.y as f32, p.z as f32, 1.0);
        (v.truncate() / v.w).as_dvec3()
    };
    let placed = DAffine3::from_mat4(
        DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0)) * DMat4::from_rotation_y(std::f64::consts::FRAC_PI_2),
    );
    // Five metres ahead, two to the right and one up, seen by a camera 90° high and twice as wide.
    let point = placed.transform_point3(DVec3::new(2.0, 1.0, -5.0));
    let in_camera = apply(world_to_camera(placed), point);
    assert!((in_camera - DVec3::new(2.0, 1.0, 5.0)).length() < 1e-5, "{in_camera}");
    let yfov = std::f64::consts::FRAC_PI_2;
    let ndc = apply(world_to_ndc_perspective(placed, yfov, 2.0), point);
    assert!((ndc.x - (0.5 + 0.5 * 2.0 / 10.0)).abs() < 1e-5 && (ndc.y - (0.5 - 0.5 / 5.0)).abs() < 1e-5, "{ndc}");
    let ndc = apply(world_to_ndc_orthographic(placed, 2.0, 2.0), point);
    assert!((ndc.x - 0.75).abs() < 1e-5 && (ndc.y - 0.25).abs() < 1e-5, "{ndc}");
}

#[test]
fn srgb_values_are_those_of_the_standard() {
    for (linear, encoded) in [(0.0, 0), (0.003_130_8, 10), (0.214_041_14, 128), (0.18, 118), (0.5, 188), (1.0, 255)] {
        assert_eq!(to_srgb8([linear; 3], 0.0, ToneMap::Clip), Some([encoded; 3]), "{linear}");
    }
    assert_eq!(to_srgb8([-1.0, 2.0, 1e38], 0.0, ToneMap::Clip), Some([0, 255, 255]));
    assert_eq!(to_srgb8([0.25; 3], 1.0, ToneMap::Clip), to_srgb8([0.5; 3], 0.0, ToneMap::Clip));
    // The two pieces of the transfer function meet.
    assert!((srgb_encode(0.003_130_8) - srgb_encode(0.003_130_9)).abs() < 1e-5);
}

#[test]
fn tone_curves_are_monotonic_from_black_to_white() {
    for (name, map) in ToneMap::NAMES {
        assert_eq!(name.parse::<ToneMap>(), Ok(map));
        assert_eq!(map.to_string(), name);
        assert_eq!(to_srgb8([0.0; 3], 0.0, map), Some([0; 3]), "{name}");
        assert_eq!(to_srgb8([f32::MAX; 3], 60.0, map), Some([255; 3]), "{name}");
        let curve: Vec<f32> = (0..4000).map(|i| map.apply([i as f32 * 0.005; 3])[1]).collect();
        assert!(curve.windows(2).all(|w| w[0] <= w[1]), "{name}");
        assert!(curve.iter().all(|c| (0.0..=1.0).contains(c)), "{name}");
    }
    let error = "filmic".parse::<ToneMap>().unwrap_err();
    assert!(error.contains("filmic") && error.contains("clip, exponential, reinhard, aces"), "{error}");
}

#[test]
fn tone_curves_have_their_known_values() {
    let at = |map: ToneMap, l: f32| map.apply([l; 3])[0];
    assert_eq!(at(ToneMap::Clip, 0.75), 0.75);
    assert!((at(ToneMap::Exponential, 1.0) - (1.0 - (-1.0f32).exp())).abs() < 1e-6);
    assert_eq!(at(ToneMap::Reinhard, 1.0), 0.5);
    // Hill's fit by hand for grey, whose rows add up to 1: (v² + 0.0245786 v − 0.000090537) / (0.983729 v² + …).
    assert!((at(ToneMap::Aces, 1.0) - 1.024_488 / 1.654_761).abs() < 1e-4);
}

#[test]
fn a_png_shows_srgb_and_makes_nan_seen() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.png");
    let radiance = [[0.0; 3], [1.0, 0.5, 0.0], [f32::NAN, 0.0, 0.0], [f32::INFINITY; 3]];
    let (pixels, non_finite) = tone_map_srgb8(&radiance, 0.0, ToneMap::Clip);
    assert_eq!(non_finite, 2);
    write_png(&path, 2, 2, &pixels).unwrap();
    let image = image::open(&path).unwrap().into_rgb8();
    let read: Vec<[u8; 3]> = image.pixels().map(|p| p.0).collect();
    assert_eq!(read, vec![[0; 3], [255, 188, 0], NON_FINITE_SRGB8, NON_FINITE_SRGB8]);
}

#[test]
fn a_failed_write_leaves_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.png");
    fs::write(&path, "old").unwrap();
    let result = write_atomically(&path, |file| {
        std::io::Write::write_all(file, b"half of the new")?;
        Err(std::io::Error::other("the disk is full"))
    });
    assert_eq!(result.unwrap_err().exit_code(), 3);
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn a_link_is_followed_and_devices_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (real, link) = (folder.path().join("real.png"), folder.path().join("link.png"));
    fs::write(&real, "old").unwrap();
    std::os::unix::fs::symlink(&real, &link).unwrap();
    write_atomically(&link, |file| std::io::Write::write_all(file, b"new")).unwrap();
    assert!(link.is_symlink());
    assert_eq!(fs::read(&real).unwrap(), b"new");
    assert!(check_writable(Path::new("/dev/null")).is_err());
    assert!(check_writable(folder.path()).is_err());
    let mode = std::os::unix::fs::PermissionsExt::mode(&fs::metadata(&real).unwrap().permissions());
    assert_eq!(mode & 0o400, 0o400);
}

#[test]
fn the_extension_chooses_the_format() {
    assert_eq!(ImageFormat::of(Path::new("a/b.EXR")).unwrap(), ImageFormat::Exr);
    assert_eq!(ImageFormat::of(Path::new("b.png")).unwrap(), ImageFormat::Png);
    for wrong in ["b.jpg", "b", ".exr", "exr/"] {
        let error = ImageFormat::of(Path::new(wrong)).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(".exr") && error.to_string().contains(".png"), "{error}");
    }
}
