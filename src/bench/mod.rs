//! Run time against error: a scene is rendered at doubling sample counts with several seeds, and every image is measured
//! against a reference whose own noise is known.
//!
//! | file | subject |
//! |---|---|
//! | [`measure`] | the renders, and what they come to |
//! | [`mod@reference`] | what is measured against: a file, or a long run of another estimator |
//! | [`mean_image`] | a mean of images with the variance of every pixel |
//! | [`statistics`] | standard errors, intervals, slopes |
//! | [`bias`] | a test of whether two images have one expectation |
//! | [`pairs`] | two sides rendered in alternation, as ratios with intervals |
//! | [`plot`] | the picture |
//!
//! docs/benchmarks/time-against-error.md has the method in words.

pub mod bias;
pub mod mean_image;
pub mod measure;
pub mod pairs;
pub mod plot;
pub mod reference;
pub mod statistics;
