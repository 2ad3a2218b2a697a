//! Whether anything stands so near to an emissive triangle that light sampling needs its solid angle.

use glam::DVec3;

use crate::scene::{Instance, Primitive, Scene};

/// Pairs of lamps and triangles that are looked at; with more, there is something near.
const PAIRS: usize = 1 << 24;
/// Over the distance at which `triangle_is_near` of `light_triangle.glsl` begins, one longest edge: shading normals lift
/// the points from which lamps are seen off their triangles.
const REACH: f64 = 1.125;
/// What is this little in front of a lamp's plane, relative to its distance, is in the plane.
const FLAT: f64 = 1.0 / (1 << 20) as f64;

struct Lamp {
    vertices: [DVec3; 3],
    /// Unit normal of the front.
    normal: DVec3,
    double_sided: bool,
    reach: f64,
}

impl Lamp {
    fn new(vertices: [DVec3; 3], mirrored: bool, double_sided: bool) -> Self {
        let [a, b, c] = vertices;
        let normal = (b - a).cross(c - a).normalize_or_zero() * if mirrored { -1.0 } else { 1.0 };
        let edge = a.distance(b).max(b.distance(c)).max(c.distance(a));
        Self { vertices, normal, double_sided, reach: REACH * edge }
    }

    /// A point of the triangle may be lit by the lamp from nearby.
    fn is_near(&self, triangle: &[DVec3; 3]) -> bool {
        let [a, b, c] = *triangle;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let touches = |v: &DVec3| v.distance_squared(v.clamp(low, high)) <= self.reach * self.reach;
        let lit = |v: &DVec3| {
            let offset = *v - self.vertices[0];
            let height = self.normal.dot(offset);
            let height = if self.double_sided { height.abs() } else { height };
            height > FLAT * offset.length()
        };
        self.vertices.iter().any(touches) && triangle.iter().any(lit)
    }
}

/// See the module.
pub(super) fn any(scene: &Scene) -> bool {
    let emits = |primitive: &Primitive| scene.materials[primitive.material].emission != [0.0; 3];
    let lamps: Vec<Lamp> = placed(scene)
        .filter(|(_, primitive)| emits(primitive))
        .flat_map(|(instance, primitive)| {
            let mirrored = instance.object_to_world.matrix3.determinant() < 0.0;
            let double_sided = scene.materials[primitive.material].double_sided;
            triangles(instance, primitive).map(move |vertices| Lamp::new(vertices, mirrored, double_sided))
        })
        .collect();
    let count: usize = placed(scene).map(|(_, primitive)| primitive.triangles.len()).sum();
    if lamps.len().saturating_mul(count) > PAIRS {
        return true;
    }
    placed(scene)
        .flat_map(|(instance, primitive)| triangles(instance, primitive))
        .any(|triangle| lamps.iter().any(|lamp| lamp.is_near(&triangle)))
}

fn placed(scene: &Scene) -> impl Iterator<Item = (&Instance, &Primitive)> {
    scene.instances.iter().flat_map(|i| scene.meshes[i.mesh].primitives.iter().map(move |p| (i, p)))
}

fn triangles<'a>(instance: &'a Instance, primitive: &'a Primitive) -> impl Iterator<Item = [DVec3; 3]> + 'a {
    let place = |i: u32| {
        let position = DVec3::from(primitive.positions[i as usize].map(f64::from));
        instance.object_to_world.transform_point3(position)
    };
    primitive.triangles.iter().map(move |t| t.map(place))
}
