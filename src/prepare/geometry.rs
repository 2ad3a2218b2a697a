//! Places the scene's meshes: what is baked into the world, what stays an instance, and around which origin.

use std::collections::HashSet;

use glam::{DAffine3, DVec3, Vec3};

use super::attributes::{Attributes, MeshGeometry, add_primitive};
use super::bounds::DBounds;
use super::instances::can_stay_instance;
use super::materials::MaterialTable;
use super::vertices::Vertices;
use super::{PrepareError, PrepareOptions};
use crate::scene::{Mesh, Scene};

/// The scene's triangles, placed.
#[derive(Debug, Default)]
pub(super) struct Geometry {
    /// World position of the rebased space's zero.
    pub(super) origin: DVec3,
    pub(super) attributes: Attributes,
    /// Everything baked, in rebased world space.
    pub(super) world: MeshGeometry,
    pub(super) shared: Vec<SharedMesh>,
}

/// A mesh in object space, and where it stands.
#[derive(Debug)]
pub(super) struct SharedMesh {
    pub(super) geometry: MeshGeometry,
    pub(super) placements: Vec<Placement>,
}

/// One instance of a shared mesh.
#[derive(Debug)]
pub(super) struct Placement {
    /// Index into `Scene::instances`.
    pub(super) source: usize,
    /// From the shared mesh's space to rebased world space.
    pub(super) transform: DAffine3,
}

/// Gathers and places all triangles.
pub(super) fn gather(
    scene: &Scene,
    options: &PrepareOptions,
    materials: &MaterialTable,
) -> Result<Geometry, PrepareError> {
    let mesh_bounds: Vec<DBounds> = scene.meshes.iter().map(bounds_of_mesh).collect();
    let mut geometry = Geometry { origin: origin(scene, &mesh_bounds, options.camera)?, ..Geometry::default() };
    geometry.attributes.vertices = Vertices::for_scene(scene, materials);
    let stays = which_stay(scene, options);
    let repeated = which_repeat(scene, materials);
    let placed = || scene.instances.iter().enumerate().filter(|(index, _)| !repeated[*index]);
    for (index, instance) in placed().filter(|(index, _)| !stays[*index]) {
        let mesh = &scene.meshes[instance.mesh];
        // The error names what is being baked.
        geometry.world.name = if instance.name.is_empty() { mesh.name.clone() } else { instance.name.clone() };
        let transform = rebased(scene, index, geometry.origin);
        for primitive in &mesh.primitives {
            add_primitive(primitive, &transform, materials, &mut geometry.attributes, &mut geometry.world)?;
        }
    }
    geometry.world.name = "world".to_owned();
    for (index, (mesh, bounds)) in scene.meshes.iter().zip(&mesh_bounds).enumerate() {
        let users = placed().filter(|(user, i)| stays[*user] && i.mesh == index);
        let center = recentring(bounds);
        let placements: Vec<Placement> = users
            .map(|(source, _)| Placement {
                source,
                transform: rebased(scene, source, geometry.origin) * DAffine3::from_translation(center),
            })
            .collect();
        if placements.is_empty() {
            continue;
        }
        let mut shared = MeshGeometry { name: mesh.name.clone(), ..MeshGeometry::default() };
        for primitive in &mesh.primitives {
            let transform = DAffine3::from_translation(-center);
            add_primitive(primitive, &transform, materials, &mut geometry.attributes, &mut shared)?;
        }
        geometry.shared.push(SharedMesh { geometry: shared, placements });
    }
    Ok(geometry)
}

/// An instance's transform to rebased world space.
fn rebased(scene: &Scene, instance: usize, origin: DVec3) -> DAffine3 {
    let mut transform = scene.instances[instance].object_to_world;
    transform.translation -= origin;
    transform
}

/// Which instances are not baked: those whose mesh at least two of them share that can be traversed in object space.
/// A mesh without triangles is baked, which leaves nothing of it.
fn which_stay(scene: &Scene, options: &PrepareOptions) -> Vec<bool> {
    let mut can = vec![false; scene.instances.len()];
    if options.bake_instances {
        return can;
    }
    let mut uses = vec![0; scene.meshes.len()];
    for (can, instance) in can.iter_mut().zip(&scene.instances) {
        let has_triangles = scene.meshes[instance.mesh].primitives.iter().any(|p| !p.triangles.is_empty());
        *can = has_triangles && can_stay_instance(&instance.object_to_world);
        uses[instance.mesh] += usize::from(*can);
    }
    can.iter().zip(&scene.instances).map(|(&can, instance)| can && uses[instance.mesh] >= 2).collect()
}

/// Which instances are a lamp that came before once more, the same mesh at the same place: see [`super::coincident`].
fn which_repeat(scene: &Scene, materials: &MaterialTable) -> Vec<bool> {
    let mut seen = HashSet::new();
    let key = |m: &DAffine3| m.to_cols_array().map(|x| (x + 0.0).to_bits());
    let emits = |mesh: &Mesh| mesh.primitives.iter().any(|p| materials.used(p.material).emissive);
    let instances = scene.instances.iter();
    instances.map(|i| emits(&scene.meshes[i.mesh]) && !seen.insert((i.mesh, key(&i.object_to_world)))).collect()
}

fn bounds_of_mesh(mesh: &Mesh) -> DBounds {
    let points = mesh.primitives.iter().flat_map(|p| &p.positions);
    points.fold(DBounds::EMPTY, |bounds, &point| {
        let point = Vec3::from(point).as_dvec3();
        DBounds { min: bounds.min.min(point), max: bounds.max.max(point) }
    })
}

/// Where the rebased space has its zero: the point of the scene's bounds nearest to the camera. f32 is finest around
/// zero, and pixels are where the camera is. Inside the scene that is the camera itself: in a corner of a huge scene,
/// what is near keeps its detail, and what is far is small in the picture. Far away from a small scene it is the scene's
/// edge: around the camera, the whole scene would be a few units in the last place wide.
fn origin(scene: &Scene, mesh_bounds: &[DBounds], camera: DVec3) -> Result<DVec3, PrepareError> {
    let mut bounds = DBounds::EMPTY;
    for instance in &scene.instances {
        let placed = mesh_bounds[instance.mesh].transformed(&instance.object_to_world);
        if !(placed.is_empty() || placed.min.is_finite() && placed.max.is_finite()) {
            return Err(PrepareError::TooFar { name: instance.name.clone(), limit: super::COORDINATE_LIMIT });
        }
        bounds = bounds.union(placed);
    }
    for light in &scene.lights {
        // Without triangles, lights are all there is to be near to.
        if bounds.is_empty() {
            bounds = DBounds { min: light.position, max: light.position };
        }
    }
    Ok(bounds.nearest(camera))
}

/// What to subtract from a shared mesh's vertices: its centre if it lies so far off its own zero that f32 loses bits
/// there, else nothing, so that vertices stay as they are.
fn recentring(bounds: &DBounds) -> DVec3 {
    let (center, half) = (bounds.center(), bounds.half_extent());
    if center.abs().max_element() > 2.0 * half.max_element() { center } else { DVec3::ZERO }
}
