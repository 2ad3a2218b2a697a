//! Tests of what runs on the host: film, preparation, scenes, and the statistics that tests use.

#[path = "../common/mod.rs"]
mod common;

mod bench;
mod bench_rows;
mod dielectric_albedo;
mod film_aovs;
mod film_images;
mod film_metrics;
mod film_sums;
mod ggx_albedo;
mod prepare_alpha;
mod prepare_bvh;
mod prepare_environment;
mod prepare_geometry;
mod prepare_light_bvh;
mod prepare_lights;
mod prepare_support;
mod reload;
mod scene_assets;
mod scene_attributes;
mod scene_bad_input;
mod scene_gltf;
mod scene_obj;
mod scene_support;
mod specialize;
mod statistics;
