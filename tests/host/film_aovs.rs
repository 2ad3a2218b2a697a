//! AOVs on the host: means over samples and over hits, layers, pictures.

use sunfleck::film::Film;
use sunfleck::film::aov::{Aov, AovFilm, AovSample};
use sunfleck::film::aov_picture::{aov_picture, picture_path};
use sunfleck::film::exr::{ChannelValues, ExrImage};
use sunfleck::film::metadata::Metadata;

/// Three pixels: two samples that hit, one of four that does, and none of two.
fn film() -> (Film, AovFilm) {
    let mut film = Film::new(3, 1);
    let mut aovs = AovFilm::new(Aov::ALL, 3);
    for (pixel, samples, hits) in [(0, 2, 2), (1, 4, 1), (2, 2, 0)] {
        film.add_block(pixel, [1.0; 3], 1.0, samples);
        let n = f64::from(hits);
        aovs.add_block(
            pixel,
            &AovSample {
                albedo: [0.5 * n, 0.25 * n, n],
                normal: [0.0, 0.0, n],
                depth: (2.0 + f64::from(pixel as u32)) * n,
                position: [4.0 * n, -n, f64::from(pixel as u32) * n],
                hits: n,
                visits: 10.0 * f64::from(samples),
            },
        );
    }
    (film, aovs)
}

#[test]
fn means_are_over_samples_or_over_hits() {
    let (film, aovs) = film();
    assert_eq!(aovs.means(Aov::Depth, &film), Some(vec![vec![2.0, 0.75, 0.0]]));
    assert_eq!(aovs.means_of_hits(Aov::Depth), Some(vec![vec![2.0, 3.0, 0.0]]));
    assert_eq!(aovs.means(Aov::Coverage, &film), Some(vec![vec![1.0, 0.25, 0.0]]));
    assert_eq!(aovs.means(Aov::Cost, &film), Some(vec![vec![10.0; 3]]));
    assert_eq!(AovFilm::new(&[Aov::Cost], 3).means(Aov::Depth, &film), None);
    // A pixel without samples has no mean.
    assert_eq!(aovs.means(Aov::Cost, &Film::new(3, 1)), Some(vec![vec![0.0; 3]]));
}

#[test]
fn layers_are_named_as_other_programs_name_them() {
    let (film, aovs) = film();
    let mut image = ExrImage::from_film(&film, Metadata::default());
    aovs.push_layers(&film, &mut image);
    let names: Vec<_> = image.channels.iter().map(|c| c.name.as_str()).filter(|n| n.contains('.')).collect();
    let expected = "albedo.R albedo.G albedo.B normal.X normal.Y normal.Z depth.Z position.X position.Y position.Z \
        coverage.A cost.Y";
    assert_eq!(names, expected.split_whitespace().collect::<Vec<_>>());
    assert_eq!(image.values("albedo.B"), Some(&ChannelValues::F32(vec![1.0, 0.25, 0.0])));
    assert_eq!(image.rgb().expect("radiance")[0], [0.5; 3], "radiance is the first layer");
}

#[test]
fn pictures_show_what_they_say() {
    let (film, aovs) = film();
    let picture = |aov| aov_picture(&aovs, &film, aov).expect("it is kept");
    assert_eq!(picture(Aov::Coverage).pixels, [[255; 3], [64; 3], [0; 3]]);
    assert_eq!(picture(Aov::Normal).pixels, [[128, 128, 255], [128, 128, 159], [128; 3]]);
    // Depths 2 and 3 of what is hit; nothing is black.
    assert_eq!(picture(Aov::Depth).pixels, [[255; 3], [25; 3], [0; 3]]);
    assert_eq!(picture(Aov::Depth).scale.as_deref(), Some("white 2.0000 m, dark grey 3.0000 m"));
    // One x and one y for all that is seen, so nothing to tell apart.
    assert_eq!(picture(Aov::Position).pixels, [[0; 3], [0, 0, 255], [0; 3]]);
    // All cost alike, so all have the brightest colour.
    let cost = picture(Aov::Cost);
    assert!(cost.pixels.iter().all(|pixel| *pixel == cost.pixels[0]) && cost.pixels[0][0] > 240, "{cost:?}");
    assert!(cost.scale.expect("a scale").contains("10.0 visits"));
    assert_eq!(aov_picture(&AovFilm::new(&[Aov::Cost], 3), &film, Aov::Depth), None);
}

#[test]
fn a_film_that_has_seen_nothing_can_be_drawn() {
    let (film, aovs) = (Film::new(2, 2), AovFilm::new(Aov::ALL, 4));
    for aov in Aov::ALL {
        assert_eq!(aov_picture(&aovs, &film, *aov).expect("it is kept").pixels.len(), 4);
    }
}

#[test]
fn pictures_lie_beside_the_image() {
    assert_eq!(picture_path("out/a.b.png".as_ref(), Aov::Depth).to_str(), Some("out/a.b.depth.png"));
}
