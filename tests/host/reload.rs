//! A scene that is loaded again with what was kept of the load before is bit for bit the scene that is loaded afresh, whatever
//! was saved, and what has not changed is not made again.

use serde_json::{Value, json};
use sunfleck::prepare::{Kept, PrepareOptions, Prepared, prepare, prepare_again};
use sunfleck::scene::Scene;
use sunfleck::scene::load::{Decoded, resolve, resolve_again};

use crate::scene_support::{Folder, png, set};

/// A scene of files, loaded again and again.
struct Watched {
    folder: Folder,
    document: Value,
    decoded: Decoded,
    kept: Kept,
}

/// Images, environments, mip chains and trees that were made, of how many.
type Made = [(u32, u32); 4];

impl Watched {
    /// The scene of alpha, with a texture of its own for its lamp, another for its floor, and an image as its sky.
    fn new() -> Self {
        let folder = Folder::new();
        let source = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/alpha.gltf");
        let mut document: Value = serde_json::from_slice(&std::fs::read(source).expect("it is there")).expect("JSON");
        set(&mut document, "/images", json!([{"uri": "fence.png"}, {"uri": "floor.png"}, {"uri": "lamp.png"}]));
        set(&mut document, "/textures", json!([{"source": 0}, {"source": 1}, {"source": 2}]));
        set(&mut document, "/materials/0/pbrMetallicRoughness/baseColorTexture", json!({"index": 1}));
        set(&mut document, "/materials/3/emissiveTexture", json!({"index": 2}));
        set(&mut document, "/scenes/0/extras/sunfleck/environment", json!({"file": "sky.png"}));
        for (name, color) in
            [("fence.png", [255, 255, 255, 90]), ("floor.png", [200; 4]), ("lamp.png", [255; 4]), ("sky.png", [90; 4])]
        {
            folder.write(name, png(8, 4, color));
        }
        let this = Self { folder, document, decoded: Decoded::keeping(), kept: Kept::keeping() };
        this.save();
        this
    }

    fn save(&self) {
        self.folder.write("scene.gltf", self.document.to_string());
    }

    /// Loads it again and afresh; the same must come of it.
    fn load(&self, what: &str) -> Made {
        let path = self.folder.write("saved", "").with_file_name("scene.gltf");
        let name = path.to_str().expect("UTF-8");
        let options = |scene: &Scene| PrepareOptions {
            camera: scene.cameras[0].camera_to_world.translation,
            ..PrepareOptions::default()
        };
        let again = resolve_again(name, &self.decoded).expect("it loads");
        let again = prepare_again(&again, &options(&again), &self.kept).expect("it fits");
        let afresh = resolve(name).expect("it loads");
        let afresh = prepare(&afresh, &options(&afresh)).expect("it fits");
        assert_same(&again, &afresh, what);
        let reuse = self.kept.sweep();
        [self.decoded.sweep(), reuse.environments, reuse.chains, reuse.trees]
    }
}

fn assert_same(a: &Prepared, b: &Prepared, what: &str) {
    assert!(a.arrays == b.arrays, "{what}: the arrays");
    assert_eq!(bytemuck::bytes_of(&a.constants), bytemuck::bytes_of(&b.constants), "{what}: the constants");
    assert_eq!((a.features, a.origin), (b.features, b.origin), "{what}");
    assert_eq!((a.meshes.len(), a.instances.len()), (b.meshes.len(), b.instances.len()), "{what}");
}

#[test]
fn whatever_is_saved_the_scene_is_that_of_its_files_and_only_what_changed_is_made_anew() {
    let mut scene = Watched::new();
    let [images, environments, chains, trees] = scene.load("at first");
    assert_eq!((images, environments), ((4, 4), (1, 1)));
    assert!(chains == (1, 1) && trees == (2, 2), "{chains:?} {trees:?}: the world and the sheets");
    let all = |made: u32, (_, all): (u32, u32)| (made, all);
    let kept = [all(0, images), all(0, environments), all(0, chains), all(0, trees)];
    assert_eq!(scene.load("nothing"), kept);

    scene.folder.write("floor.png", png(8, 4, [10, 200, 30, 255]));
    assert_eq!(scene.load("a texture"), [(1, 4), (0, 1), all(1, chains), (0, 2)]);

    scene.folder.write("sky.png", png(8, 4, [10, 20, 200, 255]));
    assert_eq!(scene.load("the environment"), [(1, 4), (1, 1), all(0, chains), (0, 2)]);

    set(&mut scene.document, "/materials/0/pbrMetallicRoughness/baseColorFactor", json!([0.5, 0.25, 1.0, 1.0]));
    scene.save();
    assert_eq!(scene.load("a material"), kept);

    set(&mut scene.document, "/nodes/0/translation", json!([0.0, -0.125, 0.0]));
    scene.save();
    assert_eq!(scene.load("geometry of the world"), [kept[0], kept[1], kept[2], (1, 2)]);

    // The fence's alpha is under its cutoff and goes over it: it is absent, then there.
    for (alpha, what) in [(200, "an alpha texture: there"), (90, "an alpha texture: absent again")] {
        scene.folder.write("fence.png", png(8, 4, [255, 255, 255, alpha]));
        let [images, _, _, trees] = scene.load(what);
        assert_eq!((images, trees), ((1, 4), (1, 2)), "{what}");
    }

    for (color, what) in [([0, 0, 0, 255], "an emission texture: dark"), ([255, 99, 9, 255], "and bright again")] {
        scene.folder.write("lamp.png", png(8, 4, color));
        assert_eq!(scene.load(what)[0], (1, 4), "{what}");
    }
    set(&mut scene.document, "/materials/0/emissiveFactor", json!([1.0, 1.0, 0.5]));
    scene.save();
    assert_eq!(scene.load("the floor shines")[0], (0, 4));
}

#[test]
fn a_load_that_fails_keeps_what_was_kept() {
    let scene = Watched::new();
    let [images, ..] = scene.load("at first");
    scene.folder.write("scene.gltf", "{");
    let path = scene.folder.write("saved", "").with_file_name("scene.gltf");
    assert!(resolve_again(path.to_str().expect("UTF-8"), &scene.decoded).is_err());
    scene.decoded.count_anew();
    scene.save();
    assert_eq!(scene.load("mended")[0], (0, images.1));
}
