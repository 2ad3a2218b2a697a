//! Image differences of known images.

use sunfleck::film::metrics::{compare, flip, magma};
use sunfleck::film::tonemap::ToneMap;

#[test]
fn equal_images_do_not_differ() {
    let image = vec![[0.25, 0.5, 4.0]; 64];
    let difference = compare(&image, &image);
    assert_eq!((difference.mse, difference.rel_mse, difference.max_difference), (0.0, 0.0, 0.0));
    assert_eq!(difference.mean_difference, [0.0; 3]);
    assert_eq!(flip((8, 8), &image, &image, 0.0, ToneMap::Clip).unwrap().mean, 0.0);
}

#[test]
fn a_known_difference_is_measured() {
    // One channel is off by +0.5 in half of the pixels, and by −0.5 in the other half of another one.
    let a = [[1.5, 2.0, 0.0], [1.0, 1.5, 0.0]];
    let b = [[1.0, 2.0, 0.0], [1.0, 2.0, 0.0]];
    let difference = compare(&a, &b);
    assert!((difference.mse - 0.5 / 6.0).abs() < 1e-15);
    let expected = (0.25 / (1.0 + 1e-4) + 0.25 / (4.0 + 1e-4)) / 6.0;
    assert!((difference.rel_mse - expected).abs() < 1e-15);
    assert_eq!(difference.mean_difference, [0.25, -0.25, 0.0]);
    assert_eq!(difference.mean_b, [1.0, 2.0, 0.0]);
    assert_eq!(difference.max_difference, 0.5);
}

#[test]
fn black_references_divide_by_the_epsilon() {
    let difference = compare(&[[0.01; 3]], &[[0.0; 3]]);
    assert!((difference.rel_mse - 1.0).abs() < 1e-6, "{}", difference.rel_mse);
}

#[test]
fn non_finite_pixels_are_counted_and_left_out() {
    let a = [[f32::NAN, 0.0, 0.0], [1.0; 3], [2.0; 3]];
    let b = [[0.0; 3], [f32::INFINITY; 3], [1.0; 3]];
    let difference = compare(&a, &b);
    assert_eq!((difference.non_finite_a, difference.non_finite_b, difference.compared_pixels), (1, 1, 1));
    assert_eq!(difference.mse, 1.0);
}

#[test]
fn flip_of_black_against_white_is_near_one() {
    let (black, white) = (vec![[0.0; 3]; 32 * 32], vec![[1.0; 3]; 32 * 32]);
    let flip = flip((32, 32), &black, &white, 0.0, ToneMap::Clip).unwrap();
    assert!(flip.mean > 0.9 && flip.mean <= 1.0, "{}", flip.mean);
    assert_eq!(flip.error_map.len(), 32 * 32);
}

#[test]
fn flip_is_not_taken_of_what_it_cannot_hold() {
    assert!(flip((0, 4), &[], &[], 0.0, ToneMap::Clip).is_none());
    assert!(flip((1 << 20, 1 << 20), &[], &[], 0.0, ToneMap::Clip).is_none());
}

#[test]
fn magma_runs_from_black_to_yellowish_white() {
    let colours = magma(3, 1, &[0.0, 0.5, 1.0]);
    let brightness = |c: [u8; 3]| c.map(u32::from).iter().sum::<u32>();
    assert!(brightness(colours[0]) < 10, "{colours:?}");
    assert!(colours[2][0] > 240 && colours[2][1] > 240 && colours[2][2] < 220, "{colours:?}");
    assert!(brightness(colours[1]) > brightness(colours[0]) && brightness(colours[1]) < brightness(colours[2]));
}
