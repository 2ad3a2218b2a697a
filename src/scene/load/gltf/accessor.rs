//! Accessors: typed elements in buffer views, interleaved or not, with or without sparse replacements.

use std::collections::HashMap;

use super::buffer::{Buffers, View};
use super::json::Json;
use crate::scene::{SceneError, SceneResult};

/// An accessor without a buffer view is all zeros and costs the file nothing, so its count is limited here.
const MAX_ZEROS: usize = 1 << 24;

/// The type of an element's components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn read(place: &Json<'_>) -> SceneResult<Self> {
        Ok(match place.unsigned()? {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => return Err(place.fail(format!("{other} is no component type of glTF 2.0"))),
        })
    }

    const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The component that starts at `bytes[0]`, as a number; normalised integers as glTF 2.0 section 3.11 defines.
    fn decode(self, bytes: &[u8], normalized: bool) -> f32 {
        let scale = |value: f32, greatest: f32| if normalized { (value / greatest).max(-1.0) } else { value };
        match self {
            Self::I8 => scale(f32::from(bytes[0] as i8), 127.0),
            Self::U8 => scale(f32::from(bytes[0]), 255.0),
            Self::I16 => scale(f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
            Self::U16 => scale(f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
            Self::U32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as f32,
            Self::F32 => f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }

    fn decode_index(self, bytes: &[u8]) -> u32 {
        match self {
            Self::U8 => u32::from(bytes[0]),
            Self::U16 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }
}

/// Where the elements of an array lie in a view; every element was checked to lie inside.
struct Elements {
    view: View,
    offset: usize,
    stride: usize,
}

impl Elements {
    fn new(view: View, offset: usize, size: usize, count: usize, place: &Json<'_>) -> SceneResult<Self> {
        let stride = view.stride.unwrap_or(size);
        if stride < size {
            return Err(place.fail(format!("the view's byteStride of {stride} is less than an element's {size} bytes")));
        }
        let end = count
            .checked_sub(1)
            .map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size))
            .and_then(|length| length.checked_add(offset));
        let available = view.bytes().len();
        if end.is_none_or(|end| end > available) {
            let message = format!(
                "{count} elements of {size} bytes from offset {offset} do not fit the buffer view of {available} bytes"
            );
            return Err(place.fail(message).hint("the file is damaged: export it again"));
        }
        Ok(Self { view, offset, stride })
    }

    fn element(&self, index: usize) -> &[u8] {
        &self.view.bytes()[self.offset + index * self.stride..]
    }
}

/// An accessor, checked as a whole; elements are decoded one by one.
pub(super) struct Accessor {
    component: Component,
    components: usize,
    normalized: bool,
    count: usize,
    elements: Option<Elements>,
    sparse: HashMap<u32, usize>,
    sparse_values: Option<Elements>,
    pointer: String,
}

impl Accessor {
    /// Reads the accessor at `place`; its `type` must be `kind` (as `VEC3`).
    fn new(place: &Json<'_>, kind: &str, buffers: &mut Buffers) -> SceneResult<Self> {
        let type_place = place.require("type")?;
        let found = type_place.string()?;
        if found != kind {
            return Err(type_place.fail(format!("the accessor is used as {kind}, but its type is {found}")));
        }
        let component = Component::read(&place.require("componentType")?)?;
        let components = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        let count = place.require("count")?.unsigned()?;
        let mut accessor = Self {
            component,
            components,
            normalized: place.flag("normalized")?,
            count,
            elements: None,
            sparse: HashMap::new(),
            sparse_values: None,
            pointer: place.pointer.clone(),
        };
        let size = component.size() * components;
        match place.refer_by("bufferView", "bufferViews")? {
            Some((_, view)) => {
                let offset = place.unsigned_or("byteOffset", 0)?;
                accessor.elements = Some(Elements::new(buffers.view(&view)?, offset, size, count, place)?);
            }
            None if count > MAX_ZEROS => {
                let message = format!("{count} elements without a buffer view; {MAX_ZEROS} is the limit");
                return Err(place.require("count")?.fail(message));
            }
            None => {}
        }
        if let Some(sparse) = place.get("sparse")? {
            accessor.read_sparse(&sparse, size, buffers)?;
        }
        Ok(accessor)
    }

    fn read_sparse(&mut self, sparse: &Json<'_>, size: usize, buffers: &mut Buffers) -> SceneResult<()> {
        let count = sparse.require("count")?.unsigned()?;
        if count > self.count {
            let message = format!("{count} sparse elements, but the accessor has only {}", self.count);
            return Err(sparse.require("count")?.fail(message));
        }
        let part = |place: &Json<'_>, size: usize, buffers: &mut Buffers| {
            let (_, view) = place.require("bufferView")?.refer("bufferViews")?;
            Elements::new(buffers.view(&view)?, place.unsigned_or("byteOffset", 0)?, size, count, place)
        };
        let indices_place = sparse.require("indices")?;
        let component_place = indices_place.require("componentType")?;
        let component = unsigned_component(&component_place)?;
        let indices = part(&indices_place, component.size(), buffers)?;
        self.sparse_values = Some(part(&sparse.require("values")?, size, buffers)?);
        for i in 0..count {
            let index = component.decode_index(indices.element(i));
            if index as usize >= self.count {
                let message = format!("sparse index {index} is out of range: the accessor has {} elements", self.count);
                return Err(indices_place.fail(message));
            }
            self.sparse.insert(index, i);
        }
        Ok(())
    }

    /// Three numbers an element, of any component type that KHR_mesh_quantization allows.
    pub(super) fn vec3(place: &Json<'_>, buffers: &mut Buffers) -> SceneResult<Self> {
        Self::new(place, "VEC3", buffers)?.numeric(place)
    }

    /// Two numbers an element, of any component type that KHR_mesh_quantization allows.
    pub(super) fn vec2(place: &Json<'_>, buffers: &mut Buffers) -> SceneResult<Self> {
        Self::new(place, "VEC2", buffers)?.numeric(place)
    }

    /// Four numbers an element, of any component type that KHR_mesh_quantization allows.
    pub(super) fn vec4(place: &Json<'_>, buffers: &mut Buffers) -> SceneResult<Self> {
        Self::new(place, "VEC4", buffers)?.numeric(place)
    }

    /// Colours: three or four numbers an element; integers are normalised whatever the accessor says.
    pub(super) fn color(place: &Json<'_>, buffers: &mut Buffers) -> SceneResult<Self> {
        let kind = if place.require("type")?.string()? == "VEC3" { "VEC3" } else { "VEC4" };
        let mut accessor = Self::new(place, kind, buffers)?.numeric(place)?;
        accessor.normalized = true;
        Ok(accessor)
    }

    fn numeric(self, place: &Json<'_>) -> SceneResult<Self> {
        match self.component {
            Component::U32 => Err(place.fail("32-bit integers are not allowed for a vertex attribute")),
            _ => Ok(self),
        }
    }

    /// Vertex indices: unsigned integers of 8, 16 or 32 bits.
    pub(super) fn indices(place: &Json<'_>, buffers: &mut Buffers) -> SceneResult<Self> {
        unsigned_component(&place.require("componentType")?)?;
        Self::new(place, "SCALAR", buffers)
    }

    /// Number of elements.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    fn element(&self, index: usize) -> Option<&[u8]> {
        match (self.sparse.get(&(index as u32)), &self.sparse_values, &self.elements) {
            (Some(&i), Some(values), _) => Some(values.element(i)),
            (_, _, Some(elements)) => Some(elements.element(index)),
            _ => None,
        }
    }

    /// The numbers of element `index`, which must be less than the count.
    pub(super) fn get<const N: usize>(&self, index: usize) -> [f32; N] {
        debug_assert!(index < self.count && N == self.components);
        let size = self.component.size();
        let decode = |bytes: &[u8], i: usize| self.component.decode(&bytes[i * size..], self.normalized);
        match self.element(index) {
            Some(bytes) => std::array::from_fn(|i| decode(bytes, i)),
            None => [0.0; N],
        }
    }

    /// Colour `index` with its alpha; 1 if it has none.
    pub(super) fn get_color(&self, index: usize) -> [f32; 4] {
        if self.components == 4 {
            return self.get(index);
        }
        let [r, g, b] = self.get(index);
        [r, g, b, 1.0]
    }

    /// Element `index` as a vertex index.
    pub(super) fn get_index(&self, index: usize) -> u32 {
        self.element(index).map_or(0, |bytes| self.component.decode_index(bytes))
    }

    /// An error about the accessor, for a file.
    pub(super) fn fail(&self, place: &Json<'_>, message: impl Into<String>) -> SceneError {
        SceneError::at(&place.document.path, &self.pointer, message)
    }
}

fn unsigned_component(place: &Json<'_>) -> SceneResult<Component> {
    match Component::read(place)? {
        component @ (Component::U8 | Component::U16 | Component::U32) => Ok(component),
        _ => Err(place.fail("indices must be unsigned integers of 8, 16 or 32 bits (5121, 5123 or 5125)")),
    }
}
