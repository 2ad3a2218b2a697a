//! Which shader files a kernel is made of.

use std::collections::BTreeMap;

use crate::gpu::shader_compiler::{Sources, resolve_include};

/// Every file that `root` includes, directly or not, itself among them, each with the file that included it first.
pub fn reached_from<'a>(sources: &'a Sources, root: &'a str) -> BTreeMap<String, Option<String>> {
    let mut reached = BTreeMap::from([(root.to_owned(), None)]);
    let mut waiting = vec![root.to_owned()];
    while let Some(file) = waiting.pop() {
        let Some(source) = sources.get(&file) else { continue };
        for name in source.lines().filter_map(included) {
            let name = resolve_include(&file, name);
            if !reached.contains_key(&name) {
                reached.insert(name.clone(), Some(file.clone()));
                waiting.push(name);
            }
        }
    }
    reached
}

/// The files through which `file` is included, from the one that names it up to the kernel.
pub fn trail(reached: &BTreeMap<String, Option<String>>, file: &str) -> Vec<String> {
    let mut trail = Vec::new();
    let mut file = file;
    while let Some(Some(by)) = reached.get(file) {
        trail.push(by.clone());
        file = by;
    }
    trail
}

/// The name in an `#include "name"` line.
fn included(line: &str) -> Option<&str> {
    let rest = line.trim_start().strip_prefix('#')?.trim_start().strip_prefix("include")?.trim_start();
    rest.strip_prefix('"')?.split('"').next()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources() -> Sources {
        let files = [
            ("k.comp", "#version 460\n#include \"include/a.glsl\"\n// #include \"include/no.glsl\"\n"),
            ("include/a.glsl", "  # include \"b.glsl\"\n"),
            ("include/b.glsl", "#include \"../c.glsl\"\n#include \"a.glsl\"\n#include \"missing.glsl\"\n"),
            ("c.glsl", ""),
            ("include/no.glsl", ""),
        ];
        files.map(|(name, text)| (name.to_owned(), text.to_owned())).into_iter().collect()
    }

    #[test]
    fn includes_are_followed_once_and_past_those_that_are_missing() {
        let sources = sources();
        let reached = reached_from(&sources, "k.comp");
        let names: Vec<_> = reached.keys().map(String::as_str).collect();
        assert_eq!(names, ["c.glsl", "include/a.glsl", "include/b.glsl", "include/missing.glsl", "k.comp"]);
        assert_eq!(trail(&reached, "c.glsl"), ["include/b.glsl", "include/a.glsl", "k.comp"]);
        assert!(trail(&reached, "k.comp").is_empty());
    }
}
