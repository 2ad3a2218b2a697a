//! What every consumer of a [`Scene`] may rely on: indices in range, lengths that agree, finite numbers.

use std::path::Path;

use super::{
    AlphaMode, Camera, Environment, Image, Material, Primitive, Projection, PunctualKind, Scene, SceneError,
    SceneResult, Texels,
};

impl Scene {
    /// Checks every promise of the scene types. The loaders and the built-in scenes keep them; a scene put together by a
    /// program should be checked once. The error's place is a path through the fields, as `meshes[2].primitives[0]`.
    pub fn validate(&self) -> SceneResult<()> {
        let check = Check { path: Path::new(&self.name) };
        for (index, camera) in self.cameras.iter().enumerate() {
            check.camera(&format!("cameras[{index}]"), camera)?;
        }
        for (index, mesh) in self.meshes.iter().enumerate() {
            for (part, primitive) in mesh.primitives.iter().enumerate() {
                check.primitive(&format!("meshes[{index}].primitives[{part}]"), primitive, self.materials.len())?;
            }
        }
        for (index, material) in self.materials.iter().enumerate() {
            check.material(&format!("materials[{index}]"), material, self.textures.len())?;
        }
        for (index, texture) in self.textures.iter().enumerate() {
            check.index(&format!("textures[{index}].image"), texture.image, self.images.len())?;
        }
        for (index, image) in self.images.iter().enumerate() {
            check.image(&format!("images[{index}]"), image)?;
        }
        for (index, instance) in self.instances.iter().enumerate() {
            check.index(&format!("instances[{index}].mesh"), instance.mesh, self.meshes.len())?;
            let place = format!("instances[{index}].object_to_world");
            check.that(instance.object_to_world.is_finite(), &place, "the transform is not finite")?;
        }
        check.lights(self)?;
        check.environment(&self.environment)
    }
}

/// The checks, with the name of the scene for their messages.
struct Check<'a> {
    path: &'a Path,
}

impl Check<'_> {
    fn that(&self, holds: bool, place: &str, message: &str) -> SceneResult<()> {
        if holds { Ok(()) } else { Err(SceneError::at(self.path, place, message)) }
    }

    fn index(&self, place: &str, index: usize, count: usize) -> SceneResult<()> {
        let message = format!("index {index} is out of range: there are {count}");
        self.that(index < count, place, &message)
    }

    fn camera(&self, place: &str, camera: &Camera) -> SceneResult<()> {
        self.that(camera.camera_to_world.is_finite(), place, "the transform is not finite")?;
        let projection_is_valid = match camera.projection {
            Projection::Perspective { yfov_radians } => yfov_radians > 0.0 && yfov_radians < std::f64::consts::PI,
            Projection::Orthographic { ymag } => ymag > 0.0 && ymag.is_finite(),
        };
        self.that(projection_is_valid, place, "the projection's angle or height is out of range")?;
        let lens_is_valid = camera.lens_radius >= 0.0 && camera.lens_radius.is_finite();
        self.that(lens_is_valid, place, "the lens radius is negative or not finite")?;
        let focus_is_valid = camera.lens_radius == 0.0 || camera.focus_distance > 0.0;
        self.that(focus_is_valid, place, "the focus distance is not positive")
    }

    fn primitive(&self, place: &str, primitive: &Primitive, materials: usize) -> SceneResult<()> {
        let count = primitive.positions.len();
        self.index(&format!("{place}.material"), primitive.material, materials)?;
        let normals_fit = primitive.normals.as_ref().is_none_or(|normals| normals.len() == count);
        let texcoords_fit = [0, 1].iter().all(|&set| primitive.texcoord_set(set).is_none_or(|t| t.len() == count));
        let colors_fit = primitive.colors.as_ref().is_none_or(|colors| colors.len() == count);
        let tangents_fit = primitive.tangents.as_ref().is_none_or(|tangents| tangents.len() == count);
        self.that(
            normals_fit && texcoords_fit && colors_fit && tangents_fit,
            place,
            "normals, tangents, colours or texture coordinates differ in number from positions",
        )?;
        let finite = primitive.positions.iter().flatten().all(|x| x.is_finite());
        self.that(finite, place, "a position is not finite")?;
        let unit = |n: &[f32; 3]| (n.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-3;
        let normals_are_unit = primitive.normals.iter().flatten().all(unit);
        self.that(normals_are_unit, place, "a normal is not of unit length")?;
        let mut texcoords = primitive.texcoords.iter().chain(&primitive.texcoords_1).flatten().flatten();
        self.that(texcoords.all(|x| x.is_finite()), place, "a texture coordinate is not finite")?;
        let is_tangent = |t: &[f32; 4]| t[..3] == [0.0; 3] || unit(&[t[0], t[1], t[2]]) && t[3].abs() == 1.0;
        let tangents_are_valid = primitive.tangents.iter().flatten().all(is_tangent);
        self.that(
            tangents_are_valid,
            place,
            "a tangent is neither zero nor of unit length, or its sign is not 1 or -1",
        )?;
        let mut colors = primitive.colors.iter().flatten().flatten();
        self.that(colors.all(|c| (0.0..=1.0).contains(c)), place, "a vertex colour is outside [0, 1]")?;
        let in_range = primitive.triangles.iter().flatten().all(|&vertex| (vertex as usize) < count);
        self.that(in_range, place, "a triangle's vertex index is out of range")
    }

    fn material(&self, place: &str, material: &Material, textures: usize) -> SceneResult<()> {
        for binding in material.textures() {
            self.index(place, binding.texture, textures)?;
            self.that(binding.set < 2, place, "a texture looks up a set of coordinates other than 0 and 1")?;
            let finite = binding.transform.rows.iter().flatten().all(|x| x.is_finite());
            self.that(finite, place, "a texture transform is not finite")?;
        }
        let unit = |x: f32| (0.0..=1.0).contains(&x);
        let factors = [
            material.metallic,
            material.roughness,
            material.transmission,
            material.specular,
            material.anisotropy,
            material.alpha,
        ];
        let factors_are_valid = factors.into_iter().chain(material.base_color).all(unit);
        self.that(factors_are_valid, place, "a colour or factor is outside [0, 1]")?;
        let emission_is_valid = material.emission.iter().all(|&e| e >= 0.0 && e.is_finite());
        self.that(emission_is_valid, place, "the emission is negative or not finite")?;
        let specular_color_is_valid = material.specular_color.iter().all(|&c| c >= 0.0 && c.is_finite());
        self.that(specular_color_is_valid, place, "the specular colour is negative or not finite")?;
        let angles_are_finite = material.anisotropy_rotation_radians.is_finite() && material.normal_scale.is_finite();
        self.that(angles_are_finite, place, "the anisotropy's rotation or the normal scale is not finite")?;
        let mask_is_valid = match material.alpha_mode {
            AlphaMode::Mask { cutoff } => cutoff >= 0.0 && cutoff.is_finite(),
            AlphaMode::Opaque | AlphaMode::Blend => true,
        };
        self.that(mask_is_valid, place, "the alpha cutoff is negative or not finite")?;
        let volume_is_valid =
            material.volume.is_none_or(|v| v.attenuation_color.into_iter().all(unit) && v.attenuation_distance > 0.0);
        self.that(volume_is_valid, place, "the volume's attenuation is out of range")?;
        self.that(material.ior > 0.0 && material.ior.is_finite(), place, "the index of refraction is not positive")
    }

    fn image(&self, place: &str, image: &Image) -> SceneResult<()> {
        let texels = match &image.texels {
            Texels::Rgba8(texels) => texels.len(),
            Texels::Rgba16(texels) => texels.len(),
        };
        let fits = texels > 0 && texels as u64 == u64::from(image.width) * u64::from(image.height);
        self.that(fits, place, "the number of texels is not width × height, or the image is empty")
    }

    fn lights(&self, scene: &Scene) -> SceneResult<()> {
        for (index, light) in scene.lights.iter().enumerate() {
            let place = format!("lights[{index}]");
            let intensity_is_valid = light.intensity.iter().all(|&i| i >= 0.0 && i.is_finite());
            self.that(intensity_is_valid, &place, "the intensity is negative or not finite")?;
            self.that(light.position.is_finite(), &place, "the position is not finite")?;
            let aimed = light.kind == PunctualKind::Point || (light.direction.length() - 1.0).abs() < 1e-6;
            self.that(aimed, &place, "the direction is not of unit length")?;
            if let PunctualKind::Spot { inner_cone_radians: inner, outer_cone_radians: outer } = light.kind {
                let cone_is_valid = 0.0 <= inner && inner < outer && outer <= std::f64::consts::FRAC_PI_2 + 1e-6;
                self.that(cone_is_valid, &place, "the cone must satisfy 0 ≤ inner < outer ≤ π/2")?;
            }
        }
        Ok(())
    }

    fn environment(&self, environment: &Environment) -> SceneResult<()> {
        let valid = |radiance: &[f32; 3]| radiance.iter().all(|&l| l >= 0.0 && l.is_finite());
        match environment {
            Environment::None => Ok(()),
            Environment::Constant(radiance) => {
                self.that(valid(radiance), "environment", "the radiance is negative or not finite")
            }
            Environment::Image { width, height, texels, strength, rotation_radians, .. } => {
                let fits = !texels.is_empty() && texels.len() as u64 == u64::from(*width) * u64::from(*height);
                self.that(fits, "environment", "the number of texels is not width × height, or the image is empty")?;
                self.that(texels.iter().all(valid), "environment", "a texel is negative or not finite")?;
                let scale_is_valid = *strength >= 0.0 && strength.is_finite() && rotation_radians.is_finite();
                self.that(scale_is_valid, "environment", "the strength or the rotation is out of range")?;
                let fits = texels.iter().flatten().all(|&l| (l * strength).is_finite());
                self.that(fits, "environment", "a texel times the strength is not finite")
            }
        }
    }
}
