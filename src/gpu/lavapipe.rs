//! Which lavapipes the Vulkan loader would load, and of which Mesa, found without loading them: from the drivers' manifests
//! (Vulkan-Loader, docs/LoaderDriverInterface.md, "Driver Discovery") and the version text in their libraries.

use std::env;
use std::ffi::OsStr;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use memchr::memmem;

/// A Mesa release series.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct MesaVersion {
    /// The year's last two digits.
    pub(super) major: u32,
    /// The series of the year, from 0.
    pub(super) minor: u32,
}

impl fmt::Display for MesaVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

/// The versions of the lavapipes that the loader would find; `None` for a library that does not say.
pub(super) fn lavapipe_versions() -> Vec<Option<MesaVersion>> {
    let libraries = manifests().iter().filter_map(|manifest| library(manifest)).collect::<Vec<_>>();
    libraries.iter().filter(|library| is_lavapipe(library)).map(|library| version_of(library)).collect()
}

/// The drivers' manifests, from the loader's variables or from the folders that it searches.
fn manifests() -> Vec<PathBuf> {
    let paths = |name: &str| env::var_os(name).filter(|value| !value.is_empty());
    let added = paths("VK_ADD_DRIVER_FILES");
    let mut places = Vec::new();
    match paths("VK_DRIVER_FILES").or_else(|| paths("VK_ICD_FILENAMES")) {
        Some(listed) => places.extend(env::split_paths(&listed)),
        None => {
            places.extend(added.iter().flat_map(|value| env::split_paths(value)));
            places.extend(search_folders().into_iter().map(|folder| folder.join("vulkan/icd.d")));
        }
    }
    places.iter().flat_map(|place| files_of(place)).collect()
}

fn search_folders() -> Vec<PathBuf> {
    let home = env::var_os("HOME").map(PathBuf::from);
    let one =
        |name, default: &str| env::var_os(name).map(PathBuf::from).or_else(|| home.as_ref().map(|h| h.join(default)));
    let list = |name, default: &str| -> Vec<PathBuf> {
        env::split_paths(&env::var_os(name).unwrap_or_else(|| default.into())).collect()
    };
    let mut folders: Vec<PathBuf> = one("XDG_CONFIG_HOME", ".config").into_iter().collect();
    folders.extend(list("XDG_CONFIG_DIRS", "/etc/xdg"));
    folders.extend(["/usr/local/etc", "/etc"].map(PathBuf::from));
    folders.extend(one("XDG_DATA_HOME", ".local/share"));
    folders.extend(list("XDG_DATA_DIRS", "/usr/local/share:/usr/share"));
    folders
}

/// The file itself, or the manifests in the folder.
fn files_of(place: &Path) -> Vec<PathBuf> {
    if !place.is_dir() {
        return vec![place.to_owned()];
    }
    let entries = fs::read_dir(place).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(|path| path.extension() == Some(OsStr::new("json"))).collect()
}

/// The library that a manifest names: an absolute path, one relative to the manifest, or a bare name.
fn library(manifest: &Path) -> Option<PathBuf> {
    let json: serde_json::Value = serde_json::from_slice(&fs::read(manifest).ok()?).ok()?;
    let named = PathBuf::from(json["ICD"]["library_path"].as_str()?);
    if named.components().count() > 1 {
        return Some(manifest.parent()?.join(named));
    }
    let set = env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let triple = format!("/usr/lib/{}-linux-gnu", env::consts::ARCH);
    let system = [triple.as_str(), "/usr/local/lib", "/usr/lib64", "/usr/lib"].map(PathBuf::from);
    let found = env::split_paths(&set).chain(system).map(|folder| folder.join(&named)).find(|path| path.exists());
    Some(found.unwrap_or(named))
}

fn is_lavapipe(library: &Path) -> bool {
    library.file_name().is_some_and(|name| name.to_string_lossy().contains("vulkan_lvp"))
}

/// The first text "Mesa MAJOR.MINOR" in the library, which is the version that it reports as `driverInfo`.
fn version_of(library: &Path) -> Option<MesaVersion> {
    version_in(&fs::read(library).ok()?)
}

fn version_in(bytes: &[u8]) -> Option<MesaVersion> {
    memmem::find_iter(bytes, b"Mesa ").find_map(|at| {
        let (major, rest) = number(&bytes[at + 5..])?;
        let (minor, _) = number(rest.strip_prefix(b".")?)?;
        Some(MesaVersion { major, minor })
    })
}

/// The decimal number that the bytes begin with, and what follows it.
fn number(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let digits = bytes.iter().take(4).take_while(|byte| byte.is_ascii_digit()).count();
    let value = std::str::from_utf8(&bytes[..digits]).ok()?.parse().ok()?;
    Some((value, &bytes[digits..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_found_among_other_text() {
        let library = b"\x7fELF Mesa Project\0Mesa \0Mesa X11\025.0.7-2~bpo12+1Mesa 25.0.7-2~bpo12+1 (LLVM 15.0";
        assert_eq!(version_in(library), Some(MesaVersion { major: 25, minor: 0 }));
        assert_eq!(version_in(b"Mesa 22.3.6 (LLV6 (LLVM 15.0.6)"), Some(MesaVersion { major: 22, minor: 3 }));
        for unknown in [&b""[..], b"Mesa ", b"Mesa 25", b"Mesa 25.", b"a driver"] {
            assert_eq!(version_in(unknown), None, "{unknown:?}");
        }
        assert!(MesaVersion { major: 22, minor: 3 } < MesaVersion { major: 25, minor: 0 });
    }

    #[test]
    fn libraries_are_named_by_manifests() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = folder.path().join("lvp_icd.x86_64.json");
        let write = |path: &str| fs::write(&manifest, format!(r#"{{"ICD": {{"library_path": "{path}"}}}}"#)).unwrap();
        write("/opt/mesa/libvulkan_lvp.so");
        assert_eq!(library(&manifest), Some("/opt/mesa/libvulkan_lvp.so".into()));
        write("./libvulkan_lvp.so");
        let beside = library(&manifest).unwrap();
        fs::write(&beside, b"Mesa 24.1.0").unwrap();
        assert!(is_lavapipe(&beside) && !is_lavapipe(Path::new("/usr/lib/libvulkan_intel.so")));
        assert_eq!(version_of(&beside), Some(MesaVersion { major: 24, minor: 1 }));
        assert_eq!(files_of(folder.path()), [manifest.clone()]);
        fs::write(&manifest, "not JSON").unwrap();
        assert_eq!(library(&manifest), None);
    }
}
