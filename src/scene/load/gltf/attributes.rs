//! What the vertices of a primitive carry besides their positions.

use super::Loader;
use super::accessor::Accessor;
use super::json::Json;
use crate::scene::SceneResult;

/// Reads attributes of a primitive for the vertices in use.
pub(super) struct AttributeReader<'a> {
    pub(super) attributes: &'a Json<'a>,
    pub(super) positions: &'a Accessor,
    pub(super) vertices: &'a [u32],
}

type Read = fn(&Json<'_>, &mut super::buffer::Buffers) -> SceneResult<Accessor>;

impl<'a> AttributeReader<'a> {
    /// The accessor of an attribute and where it stands.
    fn accessor(&self, loader: &mut Loader<'_>, name: &str, read: Read) -> SceneResult<Option<(Accessor, Json<'a>)>> {
        let Some((_, place)) = self.attributes.refer_by(name, "accessors")? else { return Ok(None) };
        let accessor = read(&place, &mut loader.buffers)?;
        same_count(&accessor, &place, self.positions)?;
        Ok(Some((accessor, place)))
    }

    fn of_vertices<T>(&self, value: impl Fn(usize) -> T) -> Vec<T> {
        self.vertices.iter().map(|&vertex| value(vertex as usize)).collect()
    }

    /// Unit normals; `None` (flat shading) without them or if one of them cannot be normalised.
    pub(super) fn normals(&self, loader: &mut Loader<'_>) -> SceneResult<Option<Vec<[f32; 3]>>> {
        let Some((accessor, place)) = self.accessor(loader, "NORMAL", Accessor::vec3)? else { return Ok(None) };
        let normals = self.of_vertices(|vertex| unit(accessor.get(vertex)));
        let normals: Option<Vec<[f32; 3]>> = normals.into_iter().collect();
        if normals.is_none() {
            loader.warnings.add("normals of zero length or NaN: those meshes are shaded flat", &place.pointer);
        }
        Ok(normals)
    }

    /// Unit tangents with the sign of the bitangent; `None` without them or if one of them is none.
    pub(super) fn tangents(&self, loader: &mut Loader<'_>) -> SceneResult<Option<Vec<[f32; 4]>>> {
        let Some((accessor, place)) = self.accessor(loader, "TANGENT", Accessor::vec4)? else { return Ok(None) };
        let tangents = self.of_vertices(|vertex| {
            let [x, y, z, w] = accessor.get(vertex);
            let [x, y, z] = unit([x, y, z])?;
            Some([x, y, z, if w < 0.0 { -1.0 } else { 1.0 }])
        });
        let tangents: Option<Vec<[f32; 4]>> = tangents.into_iter().collect();
        if tangents.is_none() {
            loader.warnings.add("tangents of zero length or NaN: those meshes get new ones", &place.pointer);
        }
        Ok(tangents)
    }

    /// A set of texture coordinates.
    pub(super) fn texcoords(&self, loader: &mut Loader<'_>, name: &str) -> SceneResult<Option<Vec<[f32; 2]>>> {
        let Some((accessor, place)) = self.accessor(loader, name, Accessor::vec2)? else { return Ok(None) };
        let mut texcoords: Vec<[f32; 2]> = self.of_vertices(|vertex| accessor.get(vertex));
        for texcoord in texcoords.iter_mut().filter(|texcoord| !texcoord.iter().all(|x| x.is_finite())) {
            *texcoord = [0.0; 2];
            loader.warnings.add("texture coordinates that are NaN or infinite were set to 0", &place.pointer);
        }
        Ok(Some(texcoords))
    }

    /// Linear colours; `None` without them or if all are white, which changes nothing.
    pub(super) fn colors(&self, loader: &mut Loader<'_>) -> SceneResult<Option<Vec<[f32; 4]>>> {
        let Some((accessor, place)) = self.accessor(loader, "COLOR_0", Accessor::color)? else { return Ok(None) };
        let mut colors = self.of_vertices(|vertex| accessor.get_color(vertex));
        for component in colors.iter_mut().flatten().filter(|c| !(0.0..=1.0).contains(*c)) {
            // Above 1 a surface would create light. NaN becomes 0.
            *component = if *component > 0.0 { 1.0 } else { 0.0 };
            loader.warnings.add("vertex colours outside [0, 1] were limited to it", &place.pointer);
        }
        Ok(Some(colors).filter(|colors| colors.iter().any(|color| *color != [1.0; 4])))
    }
}

fn same_count(accessor: &Accessor, place: &Json<'_>, positions: &Accessor) -> SceneResult<()> {
    if accessor.count() == positions.count() {
        return Ok(());
    }
    let message = format!("{} elements, but POSITION has {}", accessor.count(), positions.count());
    Err(place.fail(message).hint("all attributes of a primitive must have the same count: export the file again"))
}

/// The vector at unit length, if it has a direction. In f64, where squares of f32 neither overflow nor vanish.
fn unit(vector: [f32; 3]) -> Option<[f32; 3]> {
    let vector = glam::DVec3::from(vector.map(f64::from));
    vector.try_normalize().map(|unit| unit.to_array().map(|x| x as f32))
}
