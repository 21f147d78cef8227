//! A builder of glTF files.

use base64::Engine;
use kiln::error::Error;
use kiln::scene::Scene;
use serde_json::{Value, json};

use super::borders::Folder;

pub const FLOAT: u32 = 5126;
pub const UNSIGNED_SHORT: u32 = 5123;

/// A glTF file with one mesh of one primitive. Numbers stand in the file as they are given.
pub struct Model {
    pub json: Value,
    pub bytes: Vec<u8>,
}

impl Model {
    /// Positions of triangles, or of others by an index accessor or a mode.
    pub fn new(positions: &[[f32; 3]]) -> Self {
        let json = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
            "nodes": [{ "name": "it", "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": {} }] }],
            "bufferViews": [], "accessors": [],
        });
        let mut model = Model { json, bytes: Vec::new() };
        model.attribute("POSITION", positions);
        model
    }

    /// A triangle of the corners 0, x and y.
    pub fn triangle() -> Self {
        Model::new(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    }

    /// A square from (0, 0) to (1, 1), on which a picture stands upright: glTF counts v from the top.
    pub fn square() -> Self {
        let mut model = Model::new(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        model.attribute("TEXCOORD_0", &[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        let indices = model.shorts(&[0, 1, 2, 0, 2, 3], "SCALAR", 6);
        model.primitive()["indices"] = json!(indices);
        model
    }

    pub fn with(mut self, key: &str, value: Value) -> Self {
        self.json[key] = value;
        self
    }

    /// The primitive with a material of one texture, the image at `uri`, sampled by `sampler`.
    pub fn with_texture(mut self, uri: &str, sampler: &Value, material: &Value) -> Self {
        self.primitive()["material"] = json!(0);
        self.with("images", json!([{ "uri": uri }]))
            .with("samplers", json!([sampler]))
            .with("textures", json!([{ "source": 0, "sampler": 0 }]))
            .with("materials", json!([material]))
    }

    pub fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    pub fn attribute<const N: usize>(&mut self, name: &str, values: &[[f32; N]]) {
        let index = self.floats(values);
        self.primitive()["attributes"][name] = json!(index);
    }

    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"].get(N - 1).unwrap_or(&"MAT4");
        let index = self.accessor(bytes, FLOAT, values.len(), kind);
        // The format wants bounds of positions; kiln looks at the numbers themselves.
        let bound = json!(vec![0.0; N]);
        let accessor = &mut self.json["accessors"][index];
        (accessor["min"], accessor["max"]) = (bound.clone(), bound);
        index
    }

    pub fn shorts(&mut self, values: &[u16], kind: &str, count: usize) -> usize {
        self.accessor(values.iter().flat_map(|x| x.to_le_bytes()).collect(), UNSIGNED_SHORT, count, kind)
    }

    /// Adds an accessor; its index.
    pub fn accessor(&mut self, bytes: Vec<u8>, component: u32, count: usize, kind: &str) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (offset, length) = (self.bytes.len(), bytes.len());
        self.bytes.extend(bytes);
        let list = |json: &mut Value, key: &str, value: Value| {
            let list = json[key].as_array_mut().expect("it was made as a list");
            list.push(value);
            list.len() - 1
        };
        let view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
        let view = list(&mut self.json, "bufferViews", view);
        let accessor =
            json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
        list(&mut self.json, "accessors", accessor)
    }

    /// Replaces the first bytes of an accessor's numbers.
    pub fn set_bytes(&mut self, accessor: usize, bytes: &[u8]) {
        let view = self.json["accessors"][accessor]["bufferView"].as_u64().expect("a buffer view") as usize;
        let offset = self.json["bufferViews"][view]["byteOffset"].as_u64().expect("an offset") as usize;
        self.bytes[offset..offset + bytes.len()].copy_from_slice(bytes);
    }

    /// The scene of the file, and the warnings without the folder before its name.
    pub fn load(&self) -> (Scene, Vec<String>) {
        Folder::new().load("a.gltf", self.text())
    }

    /// The error of a file that cannot be used.
    #[track_caller]
    pub fn fails(&self) -> Error {
        Folder::new().fails("a.gltf", self.text())
    }

    /// The file as .gltf with its buffer in a data URI.
    pub fn text(&self) -> String {
        let mut json = self.json.clone();
        if json.get("buffers").is_none() {
            let uri = data_uri("application/octet-stream", &self.bytes);
            json["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        }
        json.to_string()
    }

    /// The file as .glb (glTF 2.0, section 4.4): a header of 12 bytes, then chunks padded to four bytes, JSON with
    /// spaces and binary with zeros.
    pub fn binary(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        let (mut text, mut data) = (json.to_string().into_bytes(), self.bytes.clone());
        text.resize(text.len().next_multiple_of(4), b' ');
        data.resize(data.len().next_multiple_of(4), 0);
        let mut out = b"glTF".to_vec();
        let word = |out: &mut Vec<u8>, x: usize| out.extend((x as u32).to_le_bytes());
        word(&mut out, 2);
        word(&mut out, 12 + 8 + text.len() + 8 + data.len());
        for (kind, chunk) in [(b"JSON", text), (b"BIN\0", data)] {
            word(&mut out, chunk.len());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }
}

pub fn data_uri(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// A PNG of RGBA texels, row by row from the top.
pub fn png(width: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    let image =
        image::RgbaImage::from_raw(width, texels.len() as u32 / width, texels.as_flattened().to_vec());
    image.expect("whole rows").write_to(&mut png, image::ImageFormat::Png).expect("a picture");
    png.into_inner()
}

pub fn png_uri(width: u32, texels: &[[u8; 4]]) -> String {
    data_uri("image/png", &png(width, texels))
}
