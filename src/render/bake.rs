//! What of a scene is compiled into the kernel: a rule of scene and device.

use std::hash::{Hash, Hasher};

use glam::{DVec3, Vec3};

use crate::gpu::specialize::{BakedScene, BakedTable, BakedTriangle, bake};
use crate::gpu::{DeviceKind, TraceBackend};
use crate::layout::{LIGHT_TEXELS, LIGHT_TRIANGLE, Light, MATERIAL_TEXELS, NONE, SceneArray, Texel};
use crate::prepare::{LightChoice, Prepared};

/// Most triangles that are compiled in (docs/benchmarks).
pub const MOST_BAKED_TRIANGLES: u64 = 128;
/// Most that the scene may extend, over the shortest edge in it. The distance to a plane is known to 8·2⁻²⁴ of itself, and
/// what of a face lies within that of another is decided by rounding: here at most 2⁻⁹ of the shortest edge. In a room of 10⁷
/// units with a cube of one, shadow rays between them lost 2 % of the light, and at 10⁵ to 1 6·10⁻⁶.
const WIDEST_BAKED: f64 = 4096.0;
/// Most materials, and most lights, likewise.
pub const MOST_BAKED_RECORDS: usize = 16;

const GEOMETRY: u32 = 1;
const MATERIALS: u32 = 2;
const LIGHTS: u32 = 4;
const LARGE_FACES: u32 = 8;

/// The part of the kernel key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Baked {
    /// Specialisation constant BAKED of shaders/include/features.glsl.
    pub parts: u32,
    /// Hash of what is compiled in.
    pub hash: u64,
}

/// What of a scene is compiled into a kernel.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct BakeReport {
    /// `geometry`, `materials`, `lights`.
    pub parts: Vec<&'static str>,
    /// Why geometry is or is not among them.
    pub reason: String,
}

impl std::fmt::Display for BakeReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parts = if self.parts.is_empty() { String::from("nothing") } else { self.parts.join(", ") };
        write!(f, "{parts} (geometry: {})", self.reason)
    }
}

/// What is compiled in, and why, or why not.
#[derive(Clone, Debug, Default)]
pub struct Bake {
    scene: BakedScene,
    parts: u32,
    /// Why geometry is or is not compiled in.
    pub reason: String,
}

impl Bake {
    /// Chooses for a scene on a device; `wanted` is false for `--no-bake`.
    pub fn choose(prepared: &Prepared, device: DeviceKind, trace: TraceBackend, wanted: bool) -> Self {
        if !wanted {
            return Self { reason: String::from("--no-bake"), ..Self::default() };
        }
        if device != DeviceKind::Cpu {
            return Self { reason: String::from("the device is no CPU"), ..Self::default() };
        }
        let mut this = Self::default();
        match geometry_refused(prepared, trace) {
            Some(reason) => {
                this.reason = reason;
                if trace == TraceBackend::Bvh {
                    this.add_large_faces(prepared);
                }
            }
            None => {
                let count = prepared.statistics.triangles;
                this.reason = format!("{count} triangles, at most {MOST_BAKED_TRIANGLES}");
                this.add_geometry(prepared);
            }
        }
        this.add_materials(prepared);
        this.add_lights(prepared);
        this
    }

    /// Compiles in all that can be, whatever the rule says of geometry.
    pub fn add_all(&mut self, prepared: &Prepared) {
        self.add_geometry(prepared);
        self.add_materials(prepared);
        self.add_lights(prepared);
    }

    /// A kernel with the scene compiled in, and what of it that is. A kernel that lacks the functions for it, as one of
    /// `--shaders` may, stays as it is.
    pub fn apply(&self, spirv: Vec<u32>) -> (Vec<u32>, Baked) {
        if self.parts == 0 {
            return (spirv, Baked::default());
        }
        match bake(&spirv, &self.scene) {
            Some(words) => (words, Baked { parts: self.parts, hash: fingerprint(&self.scene) }),
            None => (spirv, Baked::default()),
        }
    }

    /// What is compiled in, for people and programs.
    pub fn report(&self, baked: Baked) -> BakeReport {
        let names =
            [(GEOMETRY, "geometry"), (LARGE_FACES, "large faces"), (MATERIALS, "materials"), (LIGHTS, "lights")];
        let parts = names.into_iter().filter(|(bit, _)| baked.parts & bit != 0).map(|(_, name)| name).collect();
        BakeReport { parts, reason: self.reason.clone() }
    }

    /// What the rule would compile in: [`Bake::apply`] may find that a shader lacks the functions for it.
    pub fn planned(&self) -> BakeReport {
        self.report(Baked { parts: self.parts, hash: 0 })
    }

    /// Whether geometry is compiled in.
    pub fn has_geometry(&self) -> bool {
        self.parts & GEOMETRY != 0
    }

    /// Compiles in the geometry, whatever the rule says.
    pub fn add_geometry(&mut self, prepared: &Prepared) {
        self.scene.triangles = triangles(prepared);
        self.scene.lamps_only = prepared.features.lights == 1 << LIGHT_TRIANGLE;
        self.parts |= GEOMETRY;
    }

    /// Compiles in the faces that stand apart from the tree of the rest, if there are any.
    pub fn add_large_faces(&mut self, prepared: &Prepared) {
        let large = large_faces(prepared);
        // Among themselves they are ordered by the distances to their planes, before the rest by interpolated ones.
        if !large.is_empty() && extent_over_shortest_edge(&large) <= WIDEST_BAKED {
            self.scene.triangles = large;
            self.parts |= LARGE_FACES;
        }
    }

    /// Whether large faces are compiled in.
    pub fn has_large_faces(&self) -> bool {
        self.parts & LARGE_FACES != 0
    }

    fn add_materials(&mut self, prepared: &Prepared) {
        let start = prepared.constants.materials;
        let records = records(prepared, start, prepared.constants.textures, MATERIAL_TEXELS);
        if (1..=MOST_BAKED_RECORDS).contains(&records.len()) {
            self.scene.tables.push(BakedTable { name: "baked_material", records });
            self.parts |= MATERIALS;
        }
    }

    fn add_lights(&mut self, prepared: &Prepared) {
        let (start, count) = (prepared.constants.lights, prepared.constants.light_count);
        if !(1..=MOST_BAKED_RECORDS as u32).contains(&count) {
            return;
        }
        let lights = records(prepared, start, start + count * LIGHT_TEXELS, LIGHT_TEXELS);
        let lamps = lights.iter().map(|light| {
            let light: Light = bytemuck::cast([light[0], light[1], light[2], light[3]]);
            let is_triangle = light.kind == LIGHT_TRIANGLE && light.slot != NONE;
            let vertices = is_triangle.then(|| prepared.triangle(light.slot).vertices);
            let mut texels = [[0_u32; 4]; 3];
            let floats = vertices.unwrap_or_default();
            texels.as_flattened_mut().iter_mut().zip(floats.as_flattened()).for_each(|(word, x)| *word = x.to_bits());
            texels.to_vec()
        });
        let lamps = BakedTable { name: "baked_lamp", records: lamps.collect() };
        self.scene.tables.extend([BakedTable { name: "baked_light", records: lights }, lamps]);
        if prepared.features.light_choice != LightChoice::Bvh {
            let tables: &[u32] = bytemuck::cast_slice(&prepared.arrays[SceneArray::Tables as usize]);
            let words = &tables[prepared.constants.light_cdf_word as usize..][..=count as usize];
            let record = |&word: &u32| vec![[word, 0, 0, 0]];
            self.scene.tables.push(BakedTable { name: "baked_light_cdf", records: words.iter().map(record).collect() });
            self.scene.light_cdf = words.to_vec();
        }
        self.parts |= LIGHTS;
    }
}

/// Why the rule leaves geometry out, if it does.
fn geometry_refused(prepared: &Prepared, trace: TraceBackend) -> Option<String> {
    let count = prepared.statistics.triangles;
    let features = &prepared.features;
    if trace != TraceBackend::Bvh {
        Some(String::from("the device traces the rays"))
    } else if features.instances || features.alpha || features.panes {
        Some(String::from("there are instances, alpha or panes"))
    } else if count == 0 || count > MOST_BAKED_TRIANGLES {
        Some(format!("{count} triangles, not 1 to {MOST_BAKED_TRIANGLES}"))
    } else if extent_over_shortest_edge(&triangles(prepared)) > WIDEST_BAKED {
        Some(format!("an edge is shorter than a {WIDEST_BAKED}th of the scene"))
    } else {
        None
    }
}

/// Infinite if an edge has no length.
fn extent_over_shortest_edge(triangles: &[BakedTriangle]) -> f64 {
    let points = |triangle: &BakedTriangle| triangle.vertices.map(|v| Vec3::from(v).as_dvec3());
    let all = || triangles.iter().flat_map(points);
    let (low, high) = all().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let edges = triangles.iter().flat_map(|triangle| {
        let [a, b, c] = points(triangle);
        [a.distance(b), b.distance(c), c.distance(a)]
    });
    low.distance(high) / edges.fold(f64::INFINITY, f64::min)
}

/// The records of a table between two texels.
fn records(prepared: &Prepared, start: u32, end: u32, texels: u32) -> Vec<Vec<Texel>> {
    let table = &prepared.arrays[SceneArray::Tables as usize][start as usize..end as usize];
    table.chunks_exact(texels as usize).map(<[Texel]>::to_vec).collect()
}

/// Every triangle of the scene, by its number.
fn triangles(prepared: &Prepared) -> Vec<BakedTriangle> {
    baked(prepared, prepared.meshes.iter().flat_map(|mesh| prepared.triangle_slots(mesh)))
}

/// Those that stand apart from the rest of the world.
fn large_faces(prepared: &Prepared) -> Vec<BakedTriangle> {
    baked(prepared, prepared.meshes.first().into_iter().flat_map(|world| prepared.large_triangle_slots(world)))
}

fn baked(prepared: &Prepared, numbers: impl Iterator<Item = u32>) -> Vec<BakedTriangle> {
    numbers.map(|number| BakedTriangle { number, vertices: prepared.triangle(number).vertices }).collect()
}

/// FNV-1a (Fowler, Noll, Vo), which is the same in every build.
struct Fnv(u64);

impl Hasher for Fnv {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        self.0 = bytes.iter().fold(self.0, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    }
}

fn fingerprint(scene: &BakedScene) -> u64 {
    let mut hasher = Fnv(0xcbf2_9ce4_8422_2325);
    scene.hash(&mut hasher);
    hasher.finish()
}
