//! The geometry of an OBJ file.

use std::collections::HashMap;
use std::path::Path;

use super::at_line;
use crate::scene::load::warnings::Warnings;
use crate::scene::{SceneError, SceneResult};

/// A corner of a face: indices from 0, each in range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Corner {
    pub(super) position: u32,
    pub(super) texcoord: Option<u32>,
    pub(super) normal: Option<u32>,
}

/// A polygon of at least three corners.
pub(super) struct Face {
    pub(super) corners: Vec<Corner>,
    /// Index into [`Geometry::material_names`].
    pub(super) material: Option<u32>,
    line: usize,
}

/// What an OBJ file holds.
#[derive(Default)]
pub(super) struct Geometry {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    /// v runs downwards here, as in glTF.
    pub(super) texcoords: Vec<[f32; 2]>,
    pub(super) faces: Vec<Face>,
    pub(super) material_names: Vec<String>,
    /// The arguments of each `mtllib`, with its line.
    pub(super) libraries: Vec<(usize, String)>,
}

/// Parses an OBJ file.
pub(super) fn parse(path: &Path, text: &str, warnings: &mut Warnings) -> SceneResult<Geometry> {
    let mut parser =
        Parser { path, geometry: Geometry::default(), material: None, materials: HashMap::new(), warnings };
    for (line, content) in logical_lines(text) {
        parser.line(line, &content)?;
    }
    parser.check_indices()?;
    Ok(parser.geometry)
}

/// Lines with their numbers from 1; a backslash at the end of a line joins it with the next.
pub(super) fn logical_lines(text: &str) -> impl Iterator<Item = (usize, String)> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (index, first) = lines.next()?;
        let mut content = first.trim_end().to_owned();
        while content.ends_with('\\') {
            content.pop();
            let Some((_, next)) = lines.next() else { break };
            content.push(' ');
            content.push_str(next.trim_end());
        }
        Some((index + 1, content))
    })
}

/// The first word of a line and the rest, both trimmed.
pub(super) fn keyword(content: &str) -> (&str, &str) {
    let content = content.trim();
    let (word, rest) = content.split_once(char::is_whitespace).unwrap_or((content, ""));
    (word, rest.trim())
}

struct Parser<'a> {
    path: &'a Path,
    geometry: Geometry,
    material: Option<u32>,
    materials: HashMap<String, u32>,
    warnings: &'a mut Warnings,
}

impl Parser<'_> {
    fn line(&mut self, line: usize, content: &str) -> SceneResult<()> {
        let (word, rest) = keyword(content);
        match word {
            "v" => {
                let (position, count) = self.floats::<3>(line, "v", rest)?;
                self.geometry.positions.push(position);
                if count >= 6 {
                    self.warn("vertex colours are not supported yet and ignored", line);
                }
            }
            "vn" => {
                let (normal, _) = self.floats::<3>(line, "vn", rest)?;
                self.geometry.normals.push(normal);
            }
            "vt" => {
                // A texture coordinate may have one number: v is then 0.
                let padded = if rest.split_whitespace().count() == 1 { format!("{rest} 0") } else { rest.to_owned() };
                let ([u, v], _) = self.floats::<2>(line, "vt", &padded)?;
                self.geometry.texcoords.push([u, 1.0 - v]);
            }
            "f" | "fo" => self.face(line, rest)?,
            "usemtl" => self.material = self.use_material(rest),
            "mtllib" if rest.is_empty() => self.warn("mtllib without a name", line),
            "mtllib" => self.geometry.libraries.push((line, rest.to_owned())),
            "p" | "l" => self.warn("points and lines have no surface and are skipped", line),
            "curv" | "curv2" | "surf" => {
                self.warn("free-form curves and surfaces are not supported: they are skipped", line)
            }
            _ => {}
        }
        Ok(())
    }

    fn warn(&mut self, subject: &str, line: usize) {
        self.warnings.add(subject, format!("line {line}"));
    }

    fn use_material(&mut self, name: &str) -> Option<u32> {
        if name.is_empty() {
            return None;
        }
        if let Some(&known) = self.materials.get(name) {
            return Some(known);
        }
        let index = self.geometry.material_names.len() as u32;
        self.geometry.material_names.push(name.to_owned());
        self.materials.insert(name.to_owned(), index);
        Some(index)
    }

    /// The first N numbers of a line, finite, and how many there are in all.
    fn floats<const N: usize>(&self, line: usize, what: &str, text: &str) -> SceneResult<([f32; N], usize)> {
        let mut numbers = [0.0; N];
        let mut count = 0;
        for word in text.split_whitespace().take_while(|word| !word.starts_with('#')) {
            if count < N {
                let number = word.parse::<f32>().ok().filter(|number| number.is_finite());
                numbers[count] =
                    number.ok_or_else(|| self.fail(line, format!("\"{word}\" in {what} is no finite number")))?;
            }
            count += 1;
        }
        if count < N {
            return Err(self.fail(line, format!("{what} has {count} numbers, it needs {N}")));
        }
        Ok((numbers, count))
    }

    fn fail(&self, line: usize, message: String) -> SceneError {
        at_line(self.path, line, message).hint("repair the line, or export the file again")
    }

    fn face(&mut self, line: usize, text: &str) -> SceneResult<()> {
        let words = text.split_whitespace().take_while(|word| !word.starts_with('#'));
        let corners = words.map(|word| self.corner(line, word)).collect::<SceneResult<Vec<_>>>()?;
        match corners.len() {
            0 => Err(self.fail(line, String::from("the face has no vertices"))),
            1 | 2 => {
                self.warn("faces of fewer than three vertices are skipped", line);
                Ok(())
            }
            _ => {
                self.geometry.faces.push(Face { corners, material: self.material, line });
                Ok(())
            }
        }
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&self, line: usize, word: &str) -> SceneResult<Corner> {
        let mut parts = word.split('/');
        let (position, texcoord, normal) = (parts.next(), parts.next(), parts.next());
        if parts.next().is_some() {
            return Err(self.fail(line, format!("\"{word}\" is no vertex of a face")));
        }
        let index = |text: Option<&str>, count: usize, what: &str| match text {
            None | Some("") => Ok(None),
            Some(text) => self.index(line, text, count, what).map(Some),
        };
        let position = index(position, self.geometry.positions.len(), "vertex")?
            .ok_or_else(|| self.fail(line, format!("\"{word}\" has no vertex index")))?;
        Ok(Corner {
            position,
            texcoord: index(texcoord, self.geometry.texcoords.len(), "texture coordinate")?,
            normal: index(normal, self.geometry.normals.len(), "normal")?,
        })
    }

    /// Indices count from 1; negative ones count back from the last element so far. Positive ones may point forwards, so
    /// their upper bound is checked at the end.
    fn index(&self, line: usize, text: &str, count: usize, what: &str) -> SceneResult<u32> {
        let number: i64 = text.parse().map_err(|_| self.fail(line, format!("\"{text}\" is no {what} index")))?;
        let index = if number < 0 { number.checked_add(count as i64) } else { number.checked_sub(1) };
        index.and_then(|index| u32::try_from(index).ok()).ok_or_else(|| {
            let message = format!("{what} index {number} is out of range: {count} were defined before this line");
            self.fail(line, message)
        })
    }

    /// Every index must be in range. Where the file defines no normals or no texture coordinates at all, the faces that
    /// refer to some are read as if they did not.
    fn check_indices(&mut self) -> SceneResult<()> {
        let mut faces = std::mem::take(&mut self.geometry.faces);
        let (positions, normals) = (self.geometry.positions.len(), self.geometry.normals.len());
        let texcoords = self.geometry.texcoords.len();
        for face in &mut faces {
            for corner in &mut face.corners {
                self.in_range(face.line, "vertex", Some(corner.position), positions)?;
                if normals == 0 && corner.normal.take().is_some() {
                    self.warn("faces refer to normals, but there are none: they are flat", face.line);
                }
                if texcoords == 0 && corner.texcoord.take().is_some() {
                    self.warn("faces refer to texture coordinates, but there are none", face.line);
                }
                self.in_range(face.line, "normal", corner.normal, normals)?;
                self.in_range(face.line, "texture coordinate", corner.texcoord, texcoords)?;
            }
        }
        self.geometry.faces = faces;
        Ok(())
    }

    fn in_range(&self, line: usize, what: &str, index: Option<u32>, count: usize) -> SceneResult<()> {
        match index {
            Some(index) if index as usize >= count => {
                let number = u64::from(index) + 1;
                Err(self.fail(line, format!("{what} index {number} is out of range: the file has {count}")))
            }
            _ => Ok(()),
        }
    }
}
