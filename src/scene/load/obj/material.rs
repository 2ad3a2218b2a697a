//! MTL material libraries, as they stand in the file.

use std::collections::HashMap;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};

use super::parse::{keyword, logical_lines};
use super::{at_line, beside};
use crate::scene::load::warnings::Warnings;
use crate::scene::{SceneResult, Wrap};

/// A texture of a material. Two are equal if they show the same, wherever they are named.
#[derive(Clone, Debug)]
pub(super) struct MtlTexture {
    pub(super) file: PathBuf,
    pub(super) wrap: Wrap,
    /// `-bm`, which scales normals.
    pub(super) scale: f32,
    /// Where it was named: the library and the line.
    pub(super) mtl_file: PathBuf,
    pub(super) line: usize,
}

impl PartialEq for MtlTexture {
    fn eq(&self, other: &Self) -> bool {
        self.file == other.file && self.wrap == other.wrap
    }
}

impl Eq for MtlTexture {}

impl Hash for MtlTexture {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.file.hash(state);
    }
}

/// A material of a library; `None` where the file says nothing.
#[derive(Clone, Debug, Default)]
pub(super) struct MtlMaterial {
    pub(super) diffuse: Option<[f32; 3]>,
    pub(super) specular: Option<[f32; 3]>,
    pub(super) emission: Option<[f32; 3]>,
    pub(super) transmission_filter: Option<[f32; 3]>,
    pub(super) ior: Option<f32>,
    /// 1 is opaque.
    pub(super) dissolve: Option<f32>,
    pub(super) illum: Option<u32>,
    /// Phong exponent (`Ns`).
    pub(super) exponent: Option<f32>,
    /// Some statement of the PBR extension is there.
    pub(super) is_pbr: bool,
    pub(super) roughness: Option<f32>,
    pub(super) metallic: Option<f32>,
    pub(super) anisotropy: Option<f32>,
    /// In turns.
    pub(super) anisotropy_rotation: Option<f32>,
    pub(super) diffuse_texture: Option<MtlTexture>,
    pub(super) specular_texture: Option<MtlTexture>,
    pub(super) emission_texture: Option<MtlTexture>,
    pub(super) alpha_texture: Option<MtlTexture>,
    pub(super) roughness_texture: Option<MtlTexture>,
    pub(super) metallic_texture: Option<MtlTexture>,
    pub(super) normal_texture: Option<MtlTexture>,
    /// Heights by MTL, normals in the files of some exporters.
    pub(super) bump_texture: Option<MtlTexture>,
    /// Statements that are not honoured.
    pub(super) ignored: Vec<String>,
    /// For messages.
    pub(super) place: String,
}

/// Adds the materials of a library to those known so far; of two with one name the later counts.
pub(super) fn parse(
    path: &Path,
    text: &str,
    materials: &mut HashMap<String, MtlMaterial>,
    warnings: &mut Warnings,
) -> SceneResult<()> {
    let mut current: Option<(String, MtlMaterial)> = None;
    for (line, content) in logical_lines(text) {
        let (word, rest) = keyword(&content);
        if word == "newmtl" {
            let material = MtlMaterial { place: format!("{} line {line}", path.display()), ..MtlMaterial::default() };
            materials.extend(current.replace((rest.to_owned(), material)));
        } else if let Some((_, material)) = &mut current {
            statement(path, line, word, rest, material, warnings)?;
        }
    }
    materials.extend(current);
    Ok(())
}

fn statement(
    path: &Path,
    line: usize,
    word: &str,
    rest: &str,
    material: &mut MtlMaterial,
    warnings: &mut Warnings,
) -> SceneResult<()> {
    let place = Place { path, line };
    match word {
        "Kd" => material.diffuse = place.color(word, rest, warnings)?,
        "Ks" => material.specular = place.color(word, rest, warnings)?,
        "Ke" => material.emission = place.color(word, rest, warnings)?,
        "Tf" => material.transmission_filter = place.color(word, rest, warnings)?,
        "Ni" => material.ior = Some(place.number(word, rest)?),
        // The later of the two counts; `d -halo` depends on the angle, and only its number is read.
        "d" => material.dissolve = Some(place.number(word, rest.trim_start_matches("-halo"))?),
        "Tr" => material.dissolve = Some(1.0 - place.number(word, rest)?),
        "illum" => material.illum = Some(place.number(word, rest)? as u32),
        // Old exporters write exponents a little below 0.
        "Ns" => material.exponent = Some(place.signed_number(word, rest)?.max(0.0)),
        "anisor" => (material.is_pbr, material.anisotropy_rotation) = (true, Some(place.signed_number(word, rest)?)),
        "Pr" | "Pm" | "aniso" => {
            let number = Some(place.number(word, rest)?);
            material.is_pbr = true;
            match word {
                "Pr" => material.roughness = number,
                "Pm" => material.metallic = number,
                _ => material.anisotropy = number,
            }
        }
        // Sheen, clearcoat and its roughness.
        "Ps" | "Pc" | "Pcr" => {
            material.is_pbr = true;
            if place.number(word, rest)? > 0.0 && word != "Pcr" {
                material.ignored.push(word.to_owned());
            }
        }
        "map_Kd" => material.diffuse_texture = place.texture(rest, warnings),
        "map_Ks" => material.specular_texture = place.texture(rest, warnings),
        "map_d" => material.alpha_texture = place.texture(rest, warnings),
        "map_Pr" => (material.is_pbr, material.roughness_texture) = (true, place.texture(rest, warnings)),
        "map_Pm" => (material.is_pbr, material.metallic_texture) = (true, place.texture(rest, warnings)),
        "bump" | "map_bump" | "map_Bump" => material.bump_texture = place.texture(rest, warnings),
        "norm" | "map_norm" | "map_Kn" => material.normal_texture = place.texture(rest, warnings),
        "map_Ke" | "map_emissive" => material.emission_texture = place.texture(rest, warnings),
        // Ambient light is what a path tracer computes.
        "map_Ka" => {}
        _ if word.starts_with("map_") || matches!(word, "disp" | "decal" | "refl") => {
            material.ignored.push(word.to_owned());
        }
        _ => {}
    }
    Ok(())
}

/// Where a statement stands.
struct Place<'a> {
    path: &'a Path,
    line: usize,
}

impl Place<'_> {
    fn number(&self, word: &str, text: &str) -> SceneResult<f32> {
        self.number_that(word, text, "a finite number of at least 0", |number| number >= 0.0)
    }

    fn signed_number(&self, word: &str, text: &str) -> SceneResult<f32> {
        self.number_that(word, text, "a finite number", |_| true)
    }

    fn number_that(&self, word: &str, text: &str, what: &str, fits: impl Fn(f32) -> bool) -> SceneResult<f32> {
        let first = text.split_whitespace().next().unwrap_or_default();
        let number = first.parse::<f32>().ok().filter(|number| number.is_finite() && fits(*number));
        number.ok_or_else(|| {
            let message = format!("{word} must be {what}, not \"{first}\"");
            at_line(self.path, self.line, message).hint("repair the line")
        })
    }

    /// Three numbers, or one for all three. Spectral curves and CIE XYZ are not read.
    fn color(&self, word: &str, text: &str, warnings: &mut Warnings) -> SceneResult<Option<[f32; 3]>> {
        let words: Vec<&str> = text.split_whitespace().take_while(|word| !word.starts_with('#')).take(3).collect();
        if matches!(words.first(), Some(&("spectral" | "xyz"))) {
            let subject = "spectral and xyz colours in material libraries are not supported: they are ignored";
            warnings.add(subject, format!("{} line {}", self.path.display(), self.line));
            return Ok(None);
        }
        match words[..] {
            [r, g, b] => Ok(Some([self.number(word, r)?, self.number(word, g)?, self.number(word, b)?])),
            [grey] => Ok(Some([self.number(word, grey)?; 3])),
            _ => {
                let message = format!("{word} has {} numbers, it needs three or one", words.len());
                Err(at_line(self.path, self.line, message).hint("repair the line"))
            }
        }
    }

    /// `[-option value…]… file`, where the file's name may have spaces.
    fn texture(&self, text: &str, warnings: &mut Warnings) -> Option<MtlTexture> {
        let mut rest = text.trim();
        let mut wrap = Wrap::Repeat;
        let mut scale = 1.0;
        while rest.starts_with('-') {
            let (option, after) = keyword(rest);
            let (greatest, only_numbers) = match option {
                "-s" | "-o" | "-t" => (3, true),
                "-mm" => (2, true),
                "-bm" | "-boost" | "-texres" | "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-type"
                | "-colorspace" => (1, false),
                // Not an option: a file name that begins with a dash.
                _ => break,
            };
            rest = after;
            for _ in 0..greatest {
                let (value, after) = keyword(rest);
                if only_numbers && value.parse::<f32>().is_err() {
                    break;
                }
                if option == "-clamp" && value == "on" {
                    wrap = Wrap::ClampToEdge;
                }
                if option == "-bm" {
                    scale = value.parse().ok().filter(|scale: &f32| scale.is_finite()).unwrap_or(1.0);
                }
                rest = after;
            }
            if !matches!(option, "-bm" | "-clamp" | "-blendu" | "-blendv" | "-cc" | "-texres" | "-type") {
                let subject = format!("texture option {option} is not supported and ignored");
                warnings.add(subject, format!("{} line {}", self.path.display(), self.line));
            }
        }
        let file = (!rest.is_empty()).then(|| beside(self.path, rest));
        if file.is_none() {
            let subject = "a texture statement without a file name is ignored";
            warnings.add(subject, format!("{} line {}", self.path.display(), self.line));
        }
        file.map(|file| MtlTexture { file, wrap, scale, mtl_file: self.path.to_owned(), line: self.line })
    }
}
