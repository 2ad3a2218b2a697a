//! A glTF document as JSON values that know where they stand, so that every error carries a JSON pointer.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::scene::{SceneError, SceneResult};

/// A parsed glTF file.
pub(super) struct Document {
    /// The file, for messages and relative URIs.
    pub(super) path: PathBuf,
    root: Value,
}

impl Document {
    /// Parses the JSON of a glTF file. Messages name line and column.
    pub(super) fn parse(path: &Path, json: &[u8]) -> SceneResult<Self> {
        const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
        let json = json.strip_prefix(BYTE_ORDER_MARK).unwrap_or(json);
        let root = serde_json::from_slice(json).map_err(|error| {
            let place = format!("line {} column {}", error.line(), error.column());
            SceneError::at(path, place, format!("not valid JSON: {error}")).hint("export the file again")
        })?;
        Ok(Self { path: path.to_owned(), root })
    }

    /// The value at the top.
    pub(super) fn root(&self) -> Json<'_> {
        Json { document: self, value: &self.root, pointer: String::new() }
    }
}

/// A value in a [`Document`], with its JSON pointer (RFC 6901).
#[derive(Clone)]
pub(super) struct Json<'a> {
    /// The document it stands in.
    pub(super) document: &'a Document,
    value: &'a Value,
    /// Where it stands, as `/nodes/3/mesh`.
    pub(super) pointer: String,
}

impl<'a> Json<'a> {
    /// An error at this place.
    pub(super) fn fail(&self, message: impl Into<String>) -> SceneError {
        let place = if self.pointer.is_empty() { "the top level" } else { &self.pointer };
        SceneError::at(&self.document.path, place, message)
    }

    fn expected(&self, what: &str) -> SceneError {
        let found = match self.value {
            Value::Null => "null",
            Value::Bool(_) => "a boolean",
            Value::Number(_) => "a number",
            Value::String(_) => "a string",
            Value::Array(_) => "an array",
            Value::Object(_) => "an object",
        };
        self.fail(format!("expected {what}, found {found}"))
    }

    fn child(&self, value: &'a Value, key: &str) -> Json<'a> {
        let key = key.replace('~', "~0").replace('/', "~1");
        Json { document: self.document, value, pointer: format!("{}/{key}", self.pointer) }
    }

    /// The member of that name, if this object has one.
    pub(super) fn get(&self, key: &str) -> SceneResult<Option<Json<'a>>> {
        match self.value {
            Value::Object(members) => Ok(members.get(key).map(|value| self.child(value, key))),
            _ => Err(self.expected("an object")),
        }
    }

    /// The member of that name, which must be there.
    pub(super) fn require(&self, key: &str) -> SceneResult<Json<'a>> {
        self.get(key)?.ok_or_else(|| self.fail(format!("\"{key}\" is missing")))
    }

    /// The member at the end of a chain of names, if every link is there.
    pub(super) fn get_path(&self, keys: &[&str]) -> SceneResult<Option<Json<'a>>> {
        let mut place = self.clone();
        for key in keys {
            match place.get(key)? {
                Some(next) => place = next,
                None => return Ok(None),
            }
        }
        Ok(Some(place))
    }

    /// The names of this object's members.
    pub(super) fn keys(&self) -> SceneResult<impl Iterator<Item = &'a String> + use<'a>> {
        match self.value {
            Value::Object(members) => Ok(members.keys()),
            _ => Err(self.expected("an object")),
        }
    }

    /// The elements of this array.
    pub(super) fn elements(&self) -> SceneResult<Vec<Json<'a>>> {
        match self.value {
            Value::Array(values) => {
                Ok(values.iter().enumerate().map(|(i, value)| self.child(value, &i.to_string())).collect())
            }
            _ => Err(self.expected("an array")),
        }
    }

    /// The elements of the array of that name; none if there is no such member.
    pub(super) fn list(&self, key: &str) -> SceneResult<Vec<Json<'a>>> {
        self.get(key)?.map_or(Ok(Vec::new()), |array| array.elements())
    }

    /// This value as a string.
    pub(super) fn string(&self) -> SceneResult<&'a str> {
        self.value.as_str().ok_or_else(|| self.expected("a string"))
    }

    /// This value as a boolean.
    pub(super) fn boolean(&self) -> SceneResult<bool> {
        self.value.as_bool().ok_or_else(|| self.expected("true or false"))
    }

    /// This value as a number; JSON has no NaN and the parser refuses what overflows, so it is finite.
    pub(super) fn number(&self) -> SceneResult<f64> {
        self.value.as_f64().ok_or_else(|| self.expected("a number"))
    }

    /// This value as an integer of at least 0. As glTF allows, it may be written `3.0`.
    pub(super) fn unsigned(&self) -> SceneResult<usize> {
        const EXACT: f64 = (1_u64 << 53) as f64;
        let integer = self.value.as_u64().or_else(|| {
            let number = self.value.as_f64()?;
            (number.fract() == 0.0 && (0.0..EXACT).contains(&number)).then_some(number as u64)
        });
        let integer = integer.and_then(|integer| usize::try_from(integer).ok());
        integer.ok_or_else(|| self.expected("an integer of at least 0"))
    }

    /// This value as an array of N numbers.
    pub(super) fn numbers<const N: usize>(&self) -> SceneResult<[f64; N]> {
        let elements = self.elements()?;
        let numbers = elements.iter().map(Json::number).collect::<SceneResult<Vec<f64>>>()?;
        let found = numbers.len();
        numbers.try_into().map_err(|_| self.fail(format!("expected {N} numbers, found {found}")))
    }

    /// The number of that name, or the default.
    pub(super) fn number_or(&self, key: &str, default: f64) -> SceneResult<f64> {
        self.get(key)?.map_or(Ok(default), |value| value.number())
    }

    /// The number of that name, or the default; a value outside `[low, high]` is an error.
    pub(super) fn number_in(&self, key: &str, default: f64, low: f64, high: f64) -> SceneResult<f64> {
        let Some(place) = self.get(key)? else { return Ok(default) };
        place.number_within(low, high)
    }

    /// This value as a number in `[low, high]`.
    pub(super) fn number_within(&self, low: f64, high: f64) -> SceneResult<f64> {
        let number = self.number()?;
        if (low..=high).contains(&number) {
            return Ok(number);
        }
        let range = if high == f64::MAX { format!("at least {low}") } else { format!("in [{low}, {high}]") };
        Err(self.fail(format!("{number} is out of range: it must be {range}")))
    }

    /// The integer of that name, or the default.
    pub(super) fn unsigned_or(&self, key: &str, default: usize) -> SceneResult<usize> {
        self.get(key)?.map_or(Ok(default), |value| value.unsigned())
    }

    /// The boolean of that name, or false.
    pub(super) fn flag(&self, key: &str) -> SceneResult<bool> {
        self.get(key)?.map_or(Ok(false), |value| value.boolean())
    }

    /// The string of that name, or an empty one: names never stop a scene from loading.
    pub(super) fn name(&self) -> String {
        self.value.get("name").and_then(Value::as_str).unwrap_or_default().to_owned()
    }

    /// A linear RGB colour of that name with components in `[0, high]`, or the default.
    pub(super) fn color(&self, key: &str, default: [f64; 3], high: f64) -> SceneResult<[f64; 3]> {
        let Some(place) = self.get(key)? else { return Ok(default) };
        for component in place.elements()? {
            component.number_within(0.0, high)?;
        }
        place.numbers::<3>()
    }

    /// The element of the top-level array `collection` that this index names.
    pub(super) fn refer(&self, collection: &str) -> SceneResult<(usize, Json<'a>)> {
        let index = self.unsigned()?;
        let root = self.document.root();
        let array = root.get(collection)?;
        let elements = array.as_ref().and_then(|array| array.value.as_array());
        let count = elements.map_or(0, Vec::len);
        match (array.as_ref(), elements.and_then(|elements| elements.get(index))) {
            (Some(array), Some(value)) => Ok((index, array.child(value, &index.to_string()))),
            _ => Err(self.fail(format!("index {index} is out of range: the file has {count} {collection}"))),
        }
    }

    /// The element that the member `key` of this object names, if it has that member.
    pub(super) fn refer_by(&self, key: &str, collection: &str) -> SceneResult<Option<(usize, Json<'a>)>> {
        self.get(key)?.map(|index| index.refer(collection)).transpose()
    }

    /// The object of the extension of that name, if this object has it.
    pub(super) fn extension(&self, name: &str) -> SceneResult<Option<Json<'a>>> {
        self.get_path(&["extensions", name])
    }

    /// The names of the extensions of this object.
    pub(super) fn extension_names(&self) -> SceneResult<Vec<&'a String>> {
        match self.get("extensions")? {
            Some(extensions) => Ok(extensions.keys()?.collect()),
            None => Ok(Vec::new()),
        }
    }

    /// `extras.sunfleck` of this object. Its members must be among `known`: a misspelt one is never silently ignored.
    /// Extras of any other form belong to other programs.
    pub(super) fn sunfleck_extras(&self, known: &[&str]) -> SceneResult<Option<Json<'a>>> {
        let Some(extras) = self.get("extras")? else { return Ok(None) };
        if !extras.value.is_object() {
            return Ok(None);
        }
        let Some(ours) = extras.get("sunfleck")? else { return Ok(None) };
        for key in ours.keys()? {
            if !known.contains(&key.as_str()) {
                let hint = format!("known are {}", known.join(", "));
                return Err(ours.child(ours.value, key).fail(format!("\"{key}\" is not known")).hint(hint));
            }
        }
        Ok(Some(ours))
    }
}
