//! The files of `sunfleck shaders new bsdf NAME`: a lobe that works, its test kernel and its expectations.

use crate::gpu::shader_compiler::Sources;

/// The files, by path below the shader folder, with NAME in place of the lobe's name.
const FILES: [(&str, &str); 3] = [
    ("include/bsdf_NAME.glsl", include_str!("../../assets/new_bsdf/lobe.glsl")),
    ("test/bsdf_NAME.comp", include_str!("../../assets/new_bsdf/test.comp")),
    ("test/bsdf_NAME.toml", include_str!("../../assets/new_bsdf/test.toml")),
];

/// The functions that the lobe's file defines.
const FUNCTIONS: [&str; 4] = ["scatter", "evaluate", "pdf", "strength"];

/// Path and text of each file of a new lobe.
///
/// # Errors
/// A name that is none for GLSL, or is taken in `sources`.
pub fn new_bsdf(name: &str, sources: &Sources) -> Result<Vec<(String, String)>, String> {
    check_name(name)?;
    for function in FUNCTIONS.map(|function| format!("{name}_{function}")) {
        let user = sources.iter().find(|(_, text)| defines(text, &function));
        if let Some((file, _)) = user {
            return Err(format!("the name '{name}' is taken: {file} has a function {function}; choose another"));
        }
    }
    let upper = name.to_uppercase();
    let fill = |text: &str| text.replace("BSDF_NAME_GLSL", &format!("BSDF_{upper}_GLSL")).replace("NAME", name);
    Ok(FILES.map(|(path, text)| (fill(path), fill(text))).into())
}

fn check_name(name: &str) -> Result<(), String> {
    let starts = name.starts_with(|c: char| c.is_ascii_lowercase());
    let plain = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    // GLSL keeps names that begin with gl_, and those with two underscores in a row.
    let kept = name == "gl" || name.starts_with("gl_") || name.contains("__") || name.ends_with('_');
    if starts && plain && !kept {
        return Ok(());
    }
    Err(format!(
        "'{name}' is no name for a lobe: expected lower-case letters, digits and single underscores, a letter first, \
         as in velvet or clear_coat (gl is GLSL's own)"
    ))
}

/// Whether the text calls or defines a function of that name.
fn defines(text: &str, function: &str) -> bool {
    text.match_indices(function).any(|(at, _)| {
        let before = text[..at].chars().next_back().is_some_and(|c| c.is_ascii_alphanumeric() || c == '_');
        !before && text[at + function.len()..].trim_start().starts_with('(')
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_put_in_everywhere() {
        let files = new_bsdf("clear_coat2", &Sources::new()).unwrap();
        let paths: Vec<_> = files.iter().map(|(path, _)| path.as_str()).collect();
        assert_eq!(
            paths,
            ["include/bsdf_clear_coat2.glsl", "test/bsdf_clear_coat2.comp", "test/bsdf_clear_coat2.toml"]
        );
        for (path, text) in &files {
            assert!(!text.contains("NAME"), "{path}");
        }
        assert!(files[0].1.contains("#ifndef BSDF_CLEAR_COAT2_GLSL") && files[0].1.contains("clear_coat2_scatter("));
    }

    #[test]
    fn names_that_glsl_or_the_sources_have_are_refused() {
        for name in ["", "2fast", "Velvet", "clear-coat", "gl_", "gl", "a__b", "a_", "samt\u{e9}", "../x", "a b"] {
            assert!(new_bsdf(name, &Sources::new()).unwrap_err().contains("no name for a lobe"), "{name}");
        }
        let taken = Sources::from([("include/x.glsl".to_owned(), "float velvet_pdf (vec3 w);".to_owned())]);
        let error = new_bsdf("velvet", &taken).unwrap_err();
        assert!(error.contains("include/x.glsl has a function velvet_pdf"), "{error}");
        assert!(new_bsdf("elvet", &taken).is_ok(), "a part of a name is none");
    }
}
