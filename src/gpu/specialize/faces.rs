//! The faces of a small scene: triangles, paired where two of them are one planar quadrilateral.

use glam::{DVec3, Vec3};

/// A triangle of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BakedTriangle {
    /// Its number, by which hits name it.
    pub number: u32,
    /// Its vertices, as in its slot.
    pub vertices: [[f32; 3]; 3],
}

impl std::hash::Hash for BakedTriangle {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        (self.number, self.vertices.map(|v| v.map(f32::to_bits))).hash(state);
    }
}

/// A plane with the triangles in it.
pub(super) struct Face {
    /// One or two triangles; of two, the second is a neighbour of the first.
    pub(super) triangles: Vec<BakedTriangle>,
    /// Normal of any length, the largest component 1.
    pub(super) normal: [f32; 3],
}

impl Face {
    /// Whether no triangle lies on the one side of its plane, or none on the other.
    pub(super) fn supports(&self, triangles: &[BakedTriangle]) -> bool {
        let n = cross(&self.triangles[0]);
        let a = points(&self.triangles[0])[0];
        let heights = || triangles.iter().flat_map(points).map(|p| n.dot(p - a));
        heights().all(|height| height >= 0.0) || heights().all(|height| height <= 0.0)
    }
}

/// Pairs neighbours that lie in one plane as well as their vertices are known: a distance to the plane is only asked for
/// to order what a ray meets, while whether it meets a triangle is asked of the triangle itself.
pub(super) fn faces(triangles: &[BakedTriangle]) -> Vec<Face> {
    let mut taken = vec![false; triangles.len()];
    let mut faces = Vec::new();
    for i in 0..triangles.len() {
        if std::mem::replace(&mut taken[i], true) {
            continue;
        }
        let mut members = vec![triangles[i]];
        if let Some(j) = (i + 1..triangles.len()).find(|&j| !taken[j] && are_one_face(&triangles[i], &triangles[j])) {
            taken[j] = true;
            members.push(triangles[j]);
        }
        faces.push(Face { normal: normal(&triangles[i]), triangles: members });
    }
    faces
}

fn points(triangle: &BakedTriangle) -> [DVec3; 3] {
    triangle.vertices.map(|v| Vec3::from(v).as_dvec3())
}

fn cross(triangle: &BakedTriangle) -> DVec3 {
    let [a, b, c] = points(triangle);
    (b - a).cross(c - a)
}

fn normal(triangle: &BakedTriangle) -> [f32; 3] {
    let n = cross(triangle);
    let largest = [n.x, n.y, n.z].into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(1.0);
    (n / largest).as_vec3().to_array()
}

/// Two triangles that share an edge, the other vertex of each within what rounding to f32 can have moved it of the plane of
/// the other: half a unit in the last place for each coordinate of the four vertices.
fn are_one_face(one: &BakedTriangle, other: &BakedTriangle) -> bool {
    let shared = one.vertices.iter().filter(|v| other.vertices.contains(v)).count();
    let lies_in = |point: &[f32; 3], triangle: &BakedTriangle| {
        let n = cross(triangle).normalize_or_zero();
        let [a, b, c] = points(triangle);
        let point = Vec3::from(*point).as_dvec3();
        let largest = [a, b, c, point].into_iter().fold(DVec3::ZERO, |most, p| most.max(p.abs()));
        let rounding = 4.0 * n.abs().dot(largest) * f64::from(f32::EPSILON) / 2.0;
        n.length_squared() > 0.0 && n.dot(point - a).abs() <= rounding
    };
    shared == 2 && one.vertices.iter().all(|v| lies_in(v, other)) && other.vertices.iter().all(|v| lies_in(v, one))
}
