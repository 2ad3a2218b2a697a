//! Which tests are meant, and the shader sources that go with them: those of a folder, or the embedded ones.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::expectations::Expectations;
use crate::gpu::embedded::SOURCES;
use crate::gpu::shader_compiler::{Sources, read_sources};
use crate::{Error, Result};

/// A file that a folder of shader sources is known by.
const KNOWN_BY: &str = "include/test_kernel.glsl";

/// A kernel with what is expected of it.
pub struct Target {
    /// Shader sources by path.
    pub sources: Rc<Sources>,
    /// The expectations' file, as messages name it.
    pub file: String,
    /// The kernel's file among the sources.
    pub kernel: String,
    /// What is expected.
    pub expectations: Expectations,
}

/// The tests that `files` name: kernels (`.comp`) or expectations (`.toml`) by path, or by their name among the sources of
/// `folder` (without one, the embedded sources). Without files, all tests there are.
///
/// A file outside of any folder of shader sources is tested with the embedded ones, as if it lay in their `test/`.
///
/// # Errors
/// Files that are missing or are not as they should be.
pub fn resolve(files: &[String], folder: Option<&Path>) -> Result<Vec<Target>> {
    let base = Rc::new(match folder {
        Some(folder) => read(folder)?,
        None => embedded(),
    });
    let told = |name: &str| folder.map_or_else(|| name.to_owned(), |folder| folder.join(name).display().to_string());
    if files.is_empty() {
        let all: Vec<_> = base.keys().filter(|name| name.ends_with(".toml")).cloned().collect();
        if all.is_empty() {
            let place = folder.unwrap_or(Path::new("the embedded shaders"));
            return Err(Error::input(place, "there are no expectations (.toml) beside its test kernels"));
        }
        return all.iter().map(|name| target(base.clone(), name, &told(name))).collect();
    }
    let one = |file: &String| match place(Path::new(file), folder)? {
        Some((sources, name)) => target(Rc::new(sources), &name, file),
        None => {
            let name = known_name(&base, file).ok_or_else(|| {
                let place = folder.map_or("the built-in shaders".to_owned(), |f| f.display().to_string());
                Error::input(Path::new(file), format!("no such file, nor is it one of {place}"))
            })?;
            target(base.clone(), &name, &told(&name))
        }
    };
    files.iter().map(one).collect()
}

/// The sources around a file on disk, and its name among them; `None` if it is none.
fn place(file: &Path, folder: Option<&Path>) -> Result<Option<(Sources, String)>> {
    if !file.is_file() {
        return Ok(None);
    }
    let path = std::fs::canonicalize(file).map_err(|error| Error::io(file, "read", error))?;
    let inside = |root: &Path| {
        let below = path.strip_prefix(root).ok()?;
        Some(below.components().map(|part| part.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/"))
    };
    let given = folder.and_then(|folder| std::fs::canonicalize(folder).ok());
    let around = || path.ancestors().skip(1).find(|root| root.join(KNOWN_BY).is_file()).map(PathBuf::from);
    if let Some(root) = given.filter(|root| inside(root).is_some()).or_else(around)
        && let Some(name) = inside(&root)
    {
        return Ok(Some((read(&root)?, name)));
    }
    // A file of its own: with those beside it, among the sources of the folder or the embedded ones.
    let mut sources = folder.map_or_else(|| Ok(embedded()), read)?;
    let beside = path.parent().unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(beside).map_err(|error| Error::io(beside, "read the folder", error))?;
    for entry in entries.flatten().map(|entry| entry.path()).filter(|path| is_source(path)) {
        let name = entry.file_name().unwrap_or_default().to_string_lossy();
        let text = std::fs::read_to_string(&entry).map_err(|error| Error::io(&entry, "read", error))?;
        sources.insert(format!("test/{name}"), text);
    }
    Ok(path.file_name().map(|name| (sources, format!("test/{}", name.to_string_lossy()))))
}

fn is_source(path: &Path) -> bool {
    path.is_file() && path.extension().is_some_and(|ending| ["comp", "glsl", "toml"].iter().any(|e| ending == *e))
}

fn read(folder: &Path) -> Result<Sources> {
    read_sources(folder).map_err(|error| Error::io(folder, "read the shader folder", error))
}

fn embedded() -> Sources {
    SOURCES.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect()
}

/// `fresnel`, `fresnel.comp`, `test/fresnel` or `test/fresnel.toml` is `test/fresnel.toml`.
fn known_name(sources: &Sources, file: &str) -> Option<String> {
    let file = file.replace('\\', "/");
    let stem = file.strip_suffix(".comp").or_else(|| file.strip_suffix(".toml")).unwrap_or(&file);
    let names =
        [format!("{stem}.toml"), format!("test/{stem}.toml"), format!("{stem}.comp"), format!("test/{stem}.comp")];
    names.into_iter().find(|name| sources.contains_key(name))
}

/// A kernel or its expectations, by the name among the sources.
fn target(sources: Rc<Sources>, name: &str, told: &str) -> Result<Target> {
    let told_path = Path::new(told);
    let stem = name.strip_suffix(".comp").or_else(|| name.strip_suffix(".toml"));
    let Some(stem) = stem else {
        return Err(Error::input(told_path, "expected a test kernel (.comp) or its expectations (.toml)"));
    };
    let file = format!("{stem}.toml");
    let Some(text) = sources.get(&file) else {
        let message = format!(
            "there are no expectations beside it: {file} is missing; `sunfleck shaders new bsdf NAME` writes an example"
        );
        return Err(Error::input(told_path, message));
    };
    let told = told_path.with_extension("toml").display().to_string();
    let expectations = Expectations::parse(text).map_err(|error| Error::input(Path::new(&told), error.to_string()))?;
    let folder = stem.rsplit_once('/').map_or("", |(folder, _)| folder);
    let kernel = match &expectations.kernel {
        Some(other) if folder.is_empty() => other.clone(),
        Some(other) => format!("{folder}/{other}"),
        None => format!("{stem}.comp"),
    };
    if !sources.contains_key(&kernel) {
        let message = format!("its kernel {kernel} does not exist; `kernel = \"…\"` names one beside it");
        return Err(Error::input(Path::new(&told), message));
    }
    Ok(Target { sources, file: told, kernel, expectations })
}
