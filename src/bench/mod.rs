//! Run time against error: a scene is rendered at doubling sample counts or times with several seeds, and every image is measured
//! against a reference whose own noise is known.
//!
//! | file | subject |
//! |---|---|
//! | [`plan`] | what is to be rendered |
//! | [`measure`] | the renders, and what they come to |
//! | [`point`] | all images of one row, and the slopes over the rows |
//! | [`mod@reference`] | what is measured against, and the errors to it |
//! | [`own_reference`] | a long run of another estimator as the reference |
//! | [`mean_image`] | a mean of images with the variance of every pixel |
//! | [`statistics`] | means, standard errors, intervals |
//! | [`jackknife`] | the same for what is no mean |
//! | [`power_law`] | slopes |
//! | [`bias`] | a test of whether two images have one expectation |
//! | [`pairs`] | two sides rendered in alternation, as ratios with intervals |
//! | [`plot`] | the picture |
//!
//! docs/benchmarks/time-against-error.md has the method in words.

pub mod bias;
pub mod jackknife;
pub mod mean_image;
pub mod measure;
pub mod own_reference;
pub mod pairs;
pub mod plan;
pub mod plot;
pub mod point;
pub mod power_law;
pub mod reference;
pub mod statistics;
mod work;

pub use work::too_short;
