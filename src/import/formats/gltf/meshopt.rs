//! EXT_meshopt_compression and KHR_meshopt_compression: buffer views compressed by meshoptimizer, decoded by
//! `meshoptimizer-rs` into the place where they lie in their buffers.

use std::ops::Range;
use std::path::Path;

use meshopt::{Limits, Workspace, codec};
use meshoptimizer_rs as meshopt;
use serde_json::Value;

use crate::error::{Result, contain};
use crate::import::formats::gltf::check::fault;

pub(super) const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The extension object of a buffer view.
pub(super) fn extension(value: &Value) -> Option<&Value> {
    NAMES.iter().find_map(|name| value["extensions"].get(name))
}

/// Decodes the compressed buffer views of a document.
pub(super) fn decode_views(
    root: &Value,
    mut buffers: Vec<Result<Vec<u8>>>,
    file: &Path,
) -> Result<Vec<Result<Vec<u8>>>> {
    let views = root["bufferViews"].as_array().into_iter().flatten();
    for (index, view) in views.enumerate() {
        let Some(value) = extension(view) else { continue };
        let fault = |what: String| fault(file, format!("buffer view {index}, {}", NAMES[0]), what);
        let invalid = || fault("its byteOffset or byteLength is invalid".into());
        let (from, bytes) = place(value).ok_or_else(invalid)?;
        let source = buffers.get(from).and_then(|buffer| match buffer {
            Ok(buffer) => Some(Ok(buffer.get(bytes)?)),
            Err(e) => Some(Err(e.clone())),
        });
        let source = source.ok_or_else(|| fault("its data lies outside its buffer".into()))??;
        let decoded = decode(value, source).map_err(&fault)?;
        let (buffer, place) = place(view).ok_or_else(invalid)?;
        let place = buffers.get_mut(buffer).and_then(|buffer| buffer.as_mut().ok()?.get_mut(place));
        let place = place.filter(|place| place.len() == decoded.len());
        place
            .ok_or_else(|| fault("byteLength is not count times byteStride".into()))?
            .copy_from_slice(&decoded);
    }
    Ok(buffers)
}

/// The buffer and the bytes of a buffer view or of the extension.
fn place(view: &Value) -> Option<(usize, Range<usize>)> {
    let number =
        |key: &str| view.get(key).map_or(Some(0), Value::as_u64).and_then(|n| usize::try_from(n).ok());
    let offset = number("byteOffset")?;
    Some((number("buffer")?, offset..offset.checked_add(number("byteLength")?)?))
}

fn decode(value: &Value, source: &[u8]) -> std::result::Result<Vec<u8>, String> {
    let number = |key: &str| value[key].as_u64().and_then(|n| usize::try_from(n).ok());
    let text = |key: &str| value.get(key).map_or(Some("NONE"), Value::as_str).unwrap_or_default();
    let (Some(count), Some(stride)) = (number("count"), number("byteStride")) else {
        return Err("it states no count and byteStride".into());
    };
    let size = count.checked_mul(stride).ok_or("it is too large")?;
    crate::limits::check_claim(size as u64).map_err(|excess| format!("its data {excess}"))?;
    let mut decoded = vec![0; size];
    let run = || -> std::result::Result<(), meshopt::Error> {
        let work = &mut Workspace::new(Limits::default());
        match text("mode") {
            "ATTRIBUTES" => codec::decode_vertex_buffer_into(&mut decoded, count, stride, source, work)?,
            "TRIANGLES" => codec::decode_index_buffer_into(&mut decoded, count, stride, source, work)?,
            "INDICES" => codec::decode_index_sequence_into(&mut decoded, count, stride, source, work)?,
            _ => return Err(meshopt::Error::InvalidParameter),
        }
        match text("filter") {
            "NONE" => Ok(()),
            "OCTAHEDRAL" => codec::decode_filter_oct(&mut decoded, count, stride, work),
            "QUATERNION" => codec::decode_filter_quat(&mut decoded, count, stride, work),
            "EXPONENTIAL" => codec::decode_filter_exp(&mut decoded, count, stride, work),
            "COLOR" => codec::decode_filter_color(&mut decoded, count, stride, work),
            _ => Err(meshopt::Error::InvalidParameter),
        }
    };
    match contain(run) {
        Some(Ok(())) => Ok(decoded),
        Some(Err(e)) => Err(format!("its data is damaged: {e}")),
        None => Err("its data is damaged".to_owned()),
    }
}
