//! Deliberate bugs in the shaders, each with the test that notices it: what the suite is worth. A mutation is caught or the
//! suite fails. They judge the tests, not the driver, so one driver is enough.

use crate::common::mutation::{Mutation, assert_caught, assert_passes_unchanged};
use crate::common::scenes::short_form;

/// `name: "file", "original" => "mutant", caught by "test";`
macro_rules! mutations {
    ($($(#[$doc:meta])* $name:ident: $file:literal, $original:literal => $mutant:literal, caught by $test:literal;)+) => {
        $($(#[$doc])* #[test] fn $name() {
            if !short_form() {
                assert_caught(&Mutation { file: $file, original: $original, mutant: $mutant }, $test);
            }
        })+
    };
}

mutations! {
    /// Cosine-distributed directions that claim to be uniform.
    wrong_pdf: "include/bsdf_lambertian.glsl",
        "return max(wi.y, 0.0) * INV_PI;" => "return wi.y > 0.0 ? 0.5 * INV_PI : 0.0;",
        caught by "bsdf_chi_square::scattered_directions_follow_the_pdf";
    /// Light that arrives at a slant counts as much as from above.
    missing_cosine: "include/surface.glsl",
        "bsdf_evaluate(s.bsdf, wo, wi) * abs(wi.y)" => "bsdf_evaluate(s.bsdf, wo, wi)",
        caught by "furnace::closed_box_of_albedo_one_half_has_radiance_two";
    /// The columns of the environment are drawn from the row below.
    shifted_cdf: "include/environment.glsl",
        "environment_row_word(constants, row.index)" =>
        "environment_row_word(constants, (row.index + 1u) % constants.environment_height)",
        caught by "environment_chi_square::importance_sampling_follows_the_pdf";
    /// A point is uniform between a texel's centre and its neighbours'.
    flat_tent: "include/environment.glsl",
        "sqrt(2.0 * min(area, 0.5))" => "2.0 * min(area, 0.5)",
        caught by "environment_chi_square::importance_sampling_follows_the_pdf";
    /// Beyond the pole is the other side of the pole.
    unfolded_tent: "include/environment.glsl",
        "min(abs(p.y), 2.0 * size.y - p.y)" => "p.y",
        caught by "environment_chi_square::importance_sampling_follows_the_pdf";
    /// The environment's density per texel area, not per solid angle.
    dropped_jacobian: "include/environment.glsl",
        "image.w > 0.0 ? image.w / sine : 0.0" => "image.w",
        caught by "environment_chi_square::importance_sampling_follows_the_pdf";
    /// What the compensated density leaves of a dim sky is forgotten: BSDF samples bring it in full, light samples again.
    forgotten_sky: "include/environment.glsl",
        "image.w > 0.0 ? image.w / sine : 0.0" => "image.w > 0.25 * INV_PI ? image.w / sine : 0.0",
        caught by "agreement::environment_samplings_agree";
    /// Small densities are raised, so that no sample is ever bright.
    raised_density: "include/environment.glsl",
        "image.rgb, image.w / polar.y)" => "image.rgb, max(image.w, 0.25 * INV_PI) / polar.y)",
        caught by "environment_chi_square::samples_agree_with_lookups";
    /// A lamp's density per area, not per solid angle.
    dropped_distance: "include/light.glsl",
        "pick / point.area * (distance * distance) / abs(cosine)" => "pick / point.area / abs(cosine)",
        caught by "light_sampling::densities_are_per_solid_angle";
    /// What rounding cuts off is lost.
    float_accumulator: "include/lane.glsl",
        "lane.compensation += lost;" => "",
        caught by "determinism::integrators_add_up";
    /// Radiance is carried through a boundary as if it were power.
    eta_squared_left_out: "include/bsdf_specular.glsl",
        "p.color / (p.eta * p.eta)" => "p.color",
        caught by "bsdf_delta::refract_reflects_totally_or_not_at_all";
    /// The light sample gets the BSDF sample's weight.
    swapped_mis_weight: "path_trace.comp",
        "weight = mis_weight(light.pdf, scattering.pdf)" => "weight = mis_weight(scattering.pdf, light.pdf)",
        caught by "furnace::closed_box_of_albedo_one_half_has_radiance_two";
    /// The point on the lamp and the scattered direction from the same numbers.
    correlated_dimension: "include/rng.glsl",
        "DIMENSIONS_LIGHT = 3u" => "DIMENSIONS_LIGHT = 2u",
        caught by "sampler::no_two_groups_share_numbers";
    /// The density of a light that the BSDF found, as if no light stood outside of the tree.
    forgotten_far_lights: "include/light_bvh.glsl",
        "return cdf_probability(counts);" => "return float(counts) / float(constants.light_bvh_counts);",
        caught by "light_bvh::picks_follow_their_probabilities";
    /// Lamps are thought to shine from their backs.
    reversed_orientation: "include/light_bvh.glsl",
        "vec4 cosine = -(x * ax" => "vec4 cosine = (x * ax",
        caught by "light_bvh::no_light_that_arrives_is_left_out";
    /// A hash whose low bits repeat along the columns of the image.
    weak_hash: "include/rng.glsl",
        "    v ^= v >> 16u;\n    pcg_mix(v);\n    return v;" => "    return v;",
        caught by "sampler::dimensions_are_uniform_and_independent";
    /// Pascal's triangle without one of its steps.
    broken_sobol_pair: "include/sobol.glsl",
        "j ^= (j >> 2u) & 0x33333333u;" => "",
        caught by "sobol::powers_of_two_of_samples_are_nets";
    /// Neighbours have the same points.
    pixels_alike: "include/sobol.glsl",
        "i ^= shifts.x;" => "",
        caught by "sobol::squares_of_pixels_complete_each_other";
    /// The square root of a negative number beyond the critical angle.
    unclamped_cosine: "include/fresnel.glsl",
        "scaled > 0.0 ? sqrt(scaled) / eta : -1.0" => "sqrt(scaled) / eta",
        caught by "bsdf_delta::refract_reflects_totally_or_not_at_all";
    /// A ray through an edge belongs to neither triangle.
    leaky_edges: "include/trace_bvh.glsl",
        "all(greaterThanEqual(edges, vec3(0.0))) || all(lessThanEqual(edges, vec3(0.0)))" =>
        "all(greaterThan(edges, vec3(0.0))) || all(lessThan(edges, vec3(0.0)))",
        caught by "watertight::axis_parallel_rays_do_not_leak";
    /// The edge that two triangles of a leaf share, turned the same way for both.
    unturned_edge: "include/trace_bvh.glsl",
        "vec3(cd, da, -ca)" => "vec3(cd, da, ca)",
        caught by "watertight::closed_meshes_are_watertight";
    /// The triangle that a ray starts on is not left out of the baked search.
    baked_start_is_met: "include/trace_baked.glsl",
        "constants.zero, b.grazing,\n                                ray.from.slot" =>
        "constants.zero, b.grazing,\n                                NONE",
        caught by "baked::hits_agree_with_brute_force";
    /// The rows of ray space go by the wrong axis.
    baked_rows_swapped: "include/trace_baked.glsl",
        "space.axis == 1u ? vec3(0.0, x, 1.0)" => "space.axis == 1u ? vec3(1.0, x, 0.0)",
        caught by "baked::closed_meshes_are_watertight";
    /// The lights of a baked scene all count as the first.
    baked_light_mistaken: "include/light.glsl",
        "uint index = baked_light_search(x);" => "uint index = 0u;",
        caught by "baked::images_are_those_without";
    /// Boxes that are narrower than what rounding leaves of a ray.
    shrunken_boxes: "include/trace_bvh.glsl",
        "(16.0 * UNIT_ROUNDOFF)" => "(-16.0 * UNIT_ROUNDOFF)",
        caught by "watertight::axis_parallel_rays_do_not_leak";
    /// Paths end at random and nobody takes their place.
    roulette_without_compensation: "path_trace.comp",
        "lane.throughput /= survival;" => "",
        caught by "furnace::closed_box_of_albedo_one_half_has_radiance_two";
    /// Light behind a pane is found by light samples, and again in full by chance.
    light_behind_panes_twice: "path_trace.comp",
        "if (HAS_PANES && (scattered.flags & STRAIGHT) == STRAIGHT && bsdf_is_pane(surface.bsdf)) {" => "if (false) {",
        caught by "panes::ways_to_look_for_light_agree_behind_panes";
    /// What the camera sees of lamps is counted by paths and by emission rays.
    lamps_counted_twice: "include/emission_rays.glsl",
        "return HAS_EMISSION_RAYS && bounce == 0u &&" => "return HAS_EMISSION_RAYS && bounce == 1u &&",
        caught by "emission_rays::what_the_camera_sees_keeps_its_mean";
    /// Panes take nothing of the light that light samples bring.
    panes_without_absorption: "path_trace.comp",
        "lane.shadow_light *= pane_transmittance(surface.bsdf);" => "",
        caught by "panes::a_point_light_shines_through_panes";
    /// The shadow ray passes a sheet wherever the path's ray did.
    shared_alpha_decisions: "include/alpha.glsl",
        "shadow ? bits.zw : bits.xy" => "bits.xy",
        caught by "alpha::shadow_rays_pass_as_path_rays_do";
    /// All instances of a sheet are there, or none.
    instances_share_alpha: "include/alpha.glsl",
        "pcg4d(uvec4(key, triangle, instance)).x" => "pcg4d(uvec4(key, triangle, 0u)).x",
        caught by "alpha::sheets_mix_with_the_background";
    /// What is not there of a lamp shines when it is sampled.
    lamp_without_alpha: "include/light.glsl",
        "emission *= surface_opacity" => "vec3(1.0) * surface_opacity",
        caught by "alpha::a_lamp_that_is_partly_there_gives_its_share";
    /// A mask by the wrong half.
    mask_turned_around: "include/alpha.glsl",
        "alpha >= material.alpha_cutoff" => "alpha < material.alpha_cutoff",
        caught by "alpha::a_mask_is_the_geometry_cut_out";
    /// Emission met by chance is weighted as if its lamp were the only one.
    pick_left_out: "include/light.glsl",
        "float pick = light_pick_probability(constants, receiver, light);" => "float pick = 1.0;",
        caught by "light_sampling::densities_are_per_solid_angle";
    /// A near lamp's solid angle halved where it is met by chance.
    half_the_solid_angle: "include/light_triangle.glsl",
        "float triangle_solid_angle(RelativeTriangle t) { return 4.0" =>
        "float triangle_solid_angle(RelativeTriangle t) { return 2.0",
        caught by "light_sampling::near_lamps_are_sampled_by_solid_angle";
    /// The planar mapping on the sphere.
    flat_arc: "include/light_triangle.glsl",
        "sqrt(u.y * (2.0 - u.y * whole) / rest)" => "sqrt(u.y)",
        caught by "light_sampling::near_lamps_are_sampled_by_solid_angle";
    /// Light that a normal map sends into the surface is lost.
    absorbed_below_the_horizon: "include/surface.glsl",
        "if (dot(drawn.wi, horizon) < 0.0) drawn.wi = other;" =>
        "if (dot(drawn.wi, horizon) < 0.0) drawn.weight = vec3(0.0);",
        caught by "shading_normals::no_normal_map_gains_or_loses_light";
    /// Light samples see no more than the lobe itself.
    unmirrored_light: "include/surface.glsl",
        "    if (HAS_SHADING_NORMALS)\n        add_scattering(sum, s, wo, mirrored(" =>
        "    if (false)\n        add_scattering(sum, s, wo, mirrored(",
        caught by "shading_normals::a_tilted_map_is_a_tilted_plane";
    /// Rays leave from the flat triangles.
    flat_terminator: "include/shading_normal.glsl",
        "(0.5 * weights * max(depth * side, 0.0))" => "(0.0 * weights * max(depth * side, 0.0))",
        caught by "shading_normals::a_coarse_sphere_has_a_smooth_terminator";
    /// The density of a refraction per half vector, not per direction.
    dropped_refraction_jacobian: "include/bsdf_dielectric.glsl",
        "visible_normal_pdf(p, wo, h) * sqr(p.eta) * jacobian" => "visible_normal_pdf(p, wo, h)",
        caught by "bsdf_dielectric::scattered_directions_follow_the_pdf";
    /// Rough glass refracts radiance as if it were power.
    rough_eta_squared_left_out: "include/bsdf_dielectric.glsl",
        "float value = refracted * lobe * near * jacobian;" =>
        "float value = refracted * lobe * near * jacobian * sqr(p.eta);",
        caught by "bsdf_dielectric::samples_agree_with_the_model";
    /// Water in glass refracts as water in air.
    boundary_to_nothing: "include/surface.glsl",
        "medium_ior(constants, s.far) / medium_ior(constants, s.near)" =>
        "(front ? medium_ior(constants, s.far) : 1.0 / medium_ior(constants, s.near))",
        caught by "volume::boundaries_reflect_by_both_of_their_media";
    /// Light samples are not absorbed.
    clear_shadow_rays: "path_trace.comp",
        "lane.shadow_light *= transmittance(constants, media, light.distance);" => "",
        caught by "volume::shadow_rays_are_absorbed";
    /// A mirrored instance whose bitangent is not.
    unmirrored_bitangent: "include/attributes.glsl",
        "bitangent_sign = -bitangent_sign;" => "bitangent_sign = bitangent_sign;",
        caught by "attributes::attributes_go_with_their_instance";
    /// Rough across the direction, not along it.
    swapped_anisotropy: "include/anisotropy.glsl",
        "alpha.x += (1.0 - alpha.x) * strength * strength" => "alpha.y += (1.0 - alpha.y) * strength * strength",
        caught by "anisotropy::tangents_turn_the_rough_direction";
    /// The texture's direction turned clockwise.
    clockwise_anisotropy: "include/anisotropy.glsl",
        "own.x * direction.y + own.y * direction.x" => "own.x * direction.y - own.y * direction.x",
        caught by "anisotropy::the_texture_gives_direction_and_strength";
    /// The albedo of a surface whose grooves run the other way.
    albedo_of_other_grooves: "include/ggx.glsl",
        "alpha.x < alpha.y ? wo.zx : wo.xz" => "alpha.x > alpha.y ? wo.zx : wo.xz",
        caught by "bsdf_chi_square::anisotropic_lobes_give_back_what_they_get";
    /// A cone of two pixels.
    wide_cone: "include/ray_cone.glsl",
        "CONE_PIXEL_SHARE = 0.25" => "CONE_PIXEL_SHARE = 2.0",
        caught by "mip::what_is_seen_stays_sharp";
    /// A lens that does not focus cones.
    cone_through_a_lens: "include/ray_cone.glsl",
        "if (curved) return RayCone(0.0, 0.0);" => "",
        caught by "mip::what_is_seen_stays_sharp";
    /// Stretched textures are blurred along their long side.
    level_by_the_larger_side: "include/texture.glsl",
        "length(cross(a, b)) / larger" => "larger",
        caught by "mip::lookups_read_the_level_that_fits_the_footprint";
    /// Linear texels decoded as sRGB.
    mip_decoded_twice: "include/texture.glsl",
        "(header.sampling & ~TEXTURE_SRGB) | TEXTURE_16_BIT" => "header.sampling | TEXTURE_16_BIT",
        caught by "mip::lookups_read_the_level_that_fits_the_footprint";
}

/// A call of a shader function and a render pass with the same sources read from a folder: what fails is the mutant.
#[test]
fn unchanged_shaders_are_not_blamed() {
    if !short_form() {
        assert_passes_unchanged("bsdf_delta::refract_reflects_totally_or_not_at_all");
        assert_passes_unchanged("determinism::sample_ranges_add_up");
    }
}
