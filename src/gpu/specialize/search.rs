//! The search over the faces of a baked scene, as straight code (see [`super::bake()`]).

use super::code::Code;
use super::faces::{BakedTriangle, Face};
use super::instruction::op;

/// Words of a set of excluded triangles: one for 32 numbers.
const SET_BITS: u32 = 32;

/// What is asked for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Search {
    Nearest,
    Occluded,
}

/// The ids of a ray's numbers.
pub(super) struct RayIds {
    origin: [u32; 3],
    /// The direction with the other sign.
    back: [u32; 3],
    row_x: [u32; 3],
    row_y: [u32; 3],
    row_z: [u32; 3],
    t_max: u32,
    /// 0 that no compiler knows.
    zero: u32,
    /// Squared speed towards a plane below which the distance to it is doubtful.
    grazing: u32,
    /// The set of excluded triangles, a word for 32 of them; `None` where the scene has none of these.
    excluded: Vec<Option<u32>>,
}

impl RayIds {
    pub(super) fn new(code: &mut Code<'_>, parameters: &[u32], faces: &[Face]) -> Option<Self> {
        let &[origin, back, row_x, row_y, row_z, t_max, zero, grazing, from, towards] = parameters else {
            return None;
        };
        let [origin, back, row_x, row_y, row_z] = [origin, back, row_x, row_y, row_z].map(|v| code.components(v));
        let numbers = || faces.iter().flat_map(|face| &face.triangles).map(|t| t.number);
        let words = numbers().max().map_or(0, |number| number / SET_BITS + 1);
        let excluded = (0..words)
            .map(|word| {
                numbers().any(|number| number / SET_BITS == word).then(|| {
                    let [a, b] = [from, towards].map(|number| code.set_word(number, word));
                    code.uint(op::BITWISE_OR, &[a, b])
                })
            })
            .collect();
        Some(Self { origin, back, row_x, row_y, row_z, t_max, zero, grazing, excluded })
    }

    /// The origin relative to a vertex. The other way round the literal would be the first operand of a subtraction, which
    /// processors do not take from memory.
    fn relative(&self, code: &mut Code<'_>, vertex: [f32; 3]) -> [u32; 3] {
        [0, 1, 2].map(|i| {
            let coordinate = code.constant_float(vertex[i]);
            code.float(op::F_SUB, &[self.origin[i], coordinate])
        })
    }

    /// A vertex in ray space, with the other sign: products of two coordinates do not change.
    fn project(&self, code: &mut Code<'_>, vertex: [f32; 3]) -> [u32; 2] {
        [self.row_x, self.row_y].map(|row| self.along_row(code, row, vertex))
    }

    fn along_row(&self, code: &mut Code<'_>, row: [u32; 3], vertex: [f32; 3]) -> u32 {
        let relative = self.relative(code, vertex);
        let products = [0, 1, 2].map(|i| code.float(op::F_MUL, &[row[i], relative[i]]));
        let sum = code.float(op::F_ADD, &[products[0], products[1]]);
        code.float(op::F_ADD, &[sum, products[2]])
    }

    /// All of a triangle's vertices at once, so that what they are made of need not be kept for its distance.
    fn prepare(&self, code: &mut Code<'_>, triangle: &BakedTriangle) {
        for vertex in triangle.vertices {
            for row in [self.row_x, self.row_y, self.row_z] {
                self.along_row(code, row, vertex);
            }
        }
    }

    /// The edge function of two vertices, and whether it stands with the other sign: of the two directions of an edge the
    /// one is computed whose first vertex is the lesser. It is 0 or has the sign of the exact one.
    fn edge(&self, code: &mut Code<'_>, first: [f32; 3], second: [f32; 3]) -> (u32, bool) {
        let bits = |v: [f32; 3]| v.map(f32::to_bits);
        if bits(first) > bits(second) {
            return (self.edge(code, second, first).0, true);
        }
        let [ax, ay] = self.project(code, first);
        let [bx, by] = self.project(code, second);
        let left = code.float(op::F_MUL, &[ax, by]);
        let right = code.float(op::F_MUL, &[ay, bx]);
        (code.float(op::F_SUB, &[left, right]), false)
    }

    /// The signs of an edge function: words whose top bits say that it is negative, and positive. Of -0 the sign would
    /// count, so +0 is added.
    fn edge_signs(&self, code: &mut Code<'_>, first: [f32; 3], second: [f32; 3]) -> [u32; 2] {
        let (edge, reversed) = self.edge(code, first, second);
        let negative = code.float(op::F_ADD, &[edge, self.zero]);
        let positive = code.float(op::F_SUB, &[self.zero, edge]);
        let [negative, positive] = [negative, positive].map(|value| code.int(op::BITCAST, &[value]));
        if reversed { [positive, negative] } else { [negative, positive] }
    }

    /// A word whose top bit says that the line of the ray meets the triangle: there are edge functions of one sign, and
    /// none of the other. Zero has no sign, and all zero is edge-on.
    fn meets(&self, code: &mut Code<'_>, triangle: &BakedTriangle) -> u32 {
        let [a, b, c] = triangle.vertices;
        let edges = [(a, b), (b, c), (c, a)].map(|(first, second)| self.edge_signs(code, first, second));
        let [negative, positive] = [0, 1].map(|sign| {
            let two = code.int(op::BITWISE_OR, &[edges[0][sign], edges[1][sign]]);
            code.int(op::BITWISE_OR, &[two, edges[2][sign]])
        });
        code.int(op::BITWISE_XOR, &[negative, positive])
    }

    /// The dot product of a normal with a vector, without what is multiplied by 0 or 1.
    fn along(&self, code: &mut Code<'_>, normal: [f32; 3], vector: [u32; 3]) -> u32 {
        let mut sum = None;
        for (n, v) in normal.into_iter().zip(vector).filter(|(n, _)| *n != 0.0) {
            let n_id = code.constant_float(n);
            let product = if n == 1.0 { v } else { code.float(op::F_MUL, &[n_id, v]) };
            sum = Some(sum.map_or(product, |sum| code.float(op::F_ADD, &[sum, product])));
        }
        sum.unwrap_or_else(|| code.constant_float(0.0))
    }

    /// The speed against the normal.
    fn speed(&self, code: &mut Code<'_>, face: &Face) -> u32 {
        self.along(code, face.normal, self.back)
    }

    /// Whether the distance to the face is doubtful: never along an axis, where height and speed are not sums, and not where
    /// it is interpolated.
    fn is_grazing(&self, code: &mut Code<'_>, face: &Face) -> Option<u32> {
        let is_along_axis = face.normal.iter().filter(|n| **n != 0.0).count() == 1;
        (face.triangles.len() > 1 && !is_along_axis).then(|| {
            let speed = self.speed(code, face);
            let square = code.float(op::F_MUL, &[speed, speed]);
            code.bool(op::F_ORD_LESS_THAN_EQUAL, &[square, self.grazing])
        })
    }

    /// The distance to a face as a fraction: of the origin's height over the speed against the normal for a plane of two
    /// triangles; of one triangle, interpolated by the edge functions between the distances of its vertices.
    fn distance(&self, code: &mut Code<'_>, face: &Face) -> [u32; 2] {
        let [a, b, c] = face.triangles[0].vertices;
        if face.triangles.len() > 1 {
            let relative = self.relative(code, a);
            return [self.along(code, face.normal, relative), self.speed(code, face)];
        }
        let edges = [(b, c), (c, a), (a, b)].map(|(first, second)| self.edge(code, first, second));
        let weighted = [a, b, c].map(|vertex| self.along_row(code, self.row_z, vertex));
        let weighted = [0, 1, 2].map(|i| (code.float(op::F_MUL, &[edges[i].0, weighted[i]]), edges[i].1));
        [weighted, edges].map(|terms| signed_sum(code, &terms))
    }

    /// The distance itself. Parallel planes share what is divided by.
    fn quotient(&self, code: &mut Code<'_>, face: &Face, numerator: u32, denominator: u32) -> u32 {
        if face.triangles.len() == 1 {
            return code.float(op::F_DIV, &[numerator, denominator]);
        }
        let one = code.constant_float(1.0);
        let inverse = code.float(op::F_DIV, &[one, denominator]);
        code.float(op::F_MUL, &[numerator, inverse])
    }

    /// Whether a distance lies between 0 and `t_max`, without dividing.
    fn is_within(&self, code: &mut Code<'_>, numerator: u32, denominator: u32) -> u32 {
        let [numerator, denominator] = [numerator, denominator].map(|value| code.uint(op::BITCAST, &[value]));
        let [sign, rest] = [1 << 31, !(1 << 31)].map(|bits| code.constant_uint(bits));
        let sign = code.uint(op::BITWISE_AND, &[denominator, sign]);
        let magnitude = code.uint(op::BITWISE_AND, &[denominator, rest]);
        let turned = code.uint(op::BITWISE_XOR, &[numerator, sign]);
        let [turned, magnitude] = [turned, magnitude].map(|value| code.float(op::BITCAST, &[value]));
        let zero = code.constant_float(0.0);
        let most = code.float(op::F_MUL, &[self.t_max, magnitude]);
        let ahead = code.bool(op::F_ORD_GREATER_THAN, &[turned, zero]);
        let before = code.bool(op::F_ORD_LESS_THAN, &[turned, most]);
        code.bool(op::LOGICAL_AND, &[ahead, before])
    }

    /// Whether none of the triangles of a face is excluded. All of one plane are: a ray from one cannot meet the other.
    fn is_allowed(&self, code: &mut Code<'_>, face: &Face) -> u32 {
        let mut allowed = None;
        for (word, &set) in self.excluded.iter().enumerate() {
            let in_word = |t: &&BakedTriangle| (t.number / SET_BITS) as usize == word;
            let bits = face.triangles.iter().filter(in_word).fold(0, |bits, t| bits | 1 << (t.number % SET_BITS));
            if let (Some(set), true) = (set, bits != 0) {
                let [mask, zero] = [bits, 0].map(|bits| code.constant_uint(bits));
                let common = code.uint(op::BITWISE_AND, &[set, mask]);
                let none = code.bool(op::I_EQUAL, &[common, zero]);
                allowed = Some(allowed.map_or(none, |other| code.bool(op::LOGICAL_AND, &[other, none])));
            }
        }
        // Every number is in some word.
        allowed.unwrap_or(0)
    }
}

/// Emits the search; returns its result.
pub(super) fn emit_search(code: &mut Code<'_>, ray: &RayIds, faces: &[Face], search: Search) -> u32 {
    let none = code.constant_uint(u32::MAX);
    let [zero_float, zero_int] = [code.constant_float(0.0), code.constant_int(0)];
    let (mut nearest, mut number, mut occluded, mut doubtful) = (ray.t_max, none, None, None);
    for face in faces {
        if let [triangle] = &face.triangles[..] {
            ray.prepare(code, triangle);
        }
        let meets: Vec<u32> = face.triangles.iter().map(|triangle| ray.meets(code, triangle)).collect();
        let word = meets[1..].iter().fold(meets[0], |word, &other| code.int(op::BITWISE_OR, &[word, other]));
        let met = code.bool(op::S_LESS_THAN, &[word, zero_int]);
        if let Some(grazing) = ray.is_grazing(code, face) {
            let both = code.bool(op::LOGICAL_AND, &[met, grazing]);
            doubtful = Some(either(code, doubtful, both));
        }
        let [numerator, denominator] = ray.distance(code, face);
        let allowed = ray.is_allowed(code, face);
        if search == Search::Occluded {
            let within = ray.is_within(code, numerator, denominator);
            let hit = all(code, &[met, within, allowed]);
            occluded = Some(either(code, occluded, hit));
            continue;
        }
        let distance = ray.quotient(code, face, numerator, denominator);
        let ahead = code.bool(op::F_ORD_GREATER_THAN, &[distance, zero_float]);
        let nearer = code.bool(op::F_ORD_LESS_THAN, &[distance, nearest]);
        let hit = all(code, &[met, ahead, nearer, allowed]);
        let mut which = code.constant_uint(face.triangles[0].number);
        if let [_, second] = face.triangles[..] {
            let other = code.constant_uint(second.number);
            let first = code.bool(op::S_LESS_THAN, &[meets[0], zero_int]);
            which = code.uint(op::SELECT, &[first, which, other]);
        }
        nearest = code.float(op::SELECT, &[hit, distance, nearest]);
        number = code.uint(op::SELECT, &[hit, which, number]);
    }
    let doubtful = flag(code, doubtful);
    if search == Search::Occluded {
        let occluded = flag(code, occluded);
        return code.vector(&[occluded, doubtful]);
    }
    let bits = code.uint(op::BITCAST, &[nearest]);
    code.vector(&[bits, number, doubtful])
}

/// The sum of terms, some of them with the other sign, or its negative: whose ratio with another such sum is the same.
fn signed_sum(code: &mut Code<'_>, terms: &[(u32, bool); 3]) -> u32 {
    let [first, rest @ ..] = terms;
    rest.iter().fold(first.0, |sum, (term, reversed)| {
        code.float(if *reversed == first.1 { op::F_ADD } else { op::F_SUB }, &[sum, *term])
    })
}

fn all(code: &mut Code<'_>, conditions: &[u32]) -> u32 {
    conditions[1..].iter().fold(conditions[0], |all, &one| code.bool(op::LOGICAL_AND, &[all, one]))
}

fn either(code: &mut Code<'_>, one: Option<u32>, other: u32) -> u32 {
    one.map_or(other, |one| code.bool(op::LOGICAL_OR, &[one, other]))
}

/// 1 if it holds.
fn flag(code: &mut Code<'_>, condition: Option<u32>) -> u32 {
    let [one, zero] = [1, 0].map(|n| code.constant_uint(n));
    condition.map_or(zero, |condition| code.uint(op::SELECT, &[condition, one, zero]))
}
