//! URIs in glTF files: embedded data or relative file names.

use std::path::PathBuf;

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use crate::import::Source;

/// A resolved URI.
#[derive(Debug, PartialEq)]
pub(crate) enum Resource {
    /// Decoded data.
    Data(Vec<u8>),
    /// A file.
    File(PathBuf),
}

/// Resolves a URI in `source`: `data:`, or a percent-encoded relative path ([`Source::resolve_reference`]).
pub(crate) fn resolve(uri: &str, source: &Source) -> Result<Resource, String> {
    if let Some(rest) = strip_prefix_ignoring_case(uri, "data:") {
        let (kind, data) = rest.split_once(',').ok_or("a data URI without a comma")?;
        if !kind.to_ascii_lowercase().ends_with(";base64") {
            return Ok(Resource::Data(percent_encoding::percent_decode_str(data).collect()));
        }
        // Some exporters omit the padding.
        let lenient = GeneralPurposeConfig::new()
            .with_decode_padding_mode(DecodePaddingMode::Indifferent)
            .with_decode_allow_trailing_bits(true);
        let engine = GeneralPurpose::new(&STANDARD, lenient);
        let clean: String = data.chars().filter(|c| !c.is_ascii_whitespace()).collect();
        return engine.decode(clean).map(Resource::Data).map_err(|e| format!("a damaged data URI: {e}"));
    }
    // A path of another machine; the file is searched by its name.
    if let Some(path) = strip_prefix_ignoring_case(uri, "file:") {
        let path = percent_encoding::percent_decode_str(path).decode_utf8_lossy();
        return source.resolve_reference(&path).map(Resource::File);
    }
    if ["http:", "https:", "ftp:"].iter().any(|scheme| strip_prefix_ignoring_case(uri, scheme).is_some()) {
        return Err(format!("`{uri}` is not a relative path; kiln reads local files only"));
    }
    let path = percent_encoding::percent_decode_str(uri)
        .decode_utf8()
        .map_err(|_| format!("`{uri}` does not decode to a file name"))?;
    source.resolve_reference(&path).map(Resource::File)
}

fn strip_prefix_ignoring_case<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let head = text.get(..prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then(|| &text[prefix.len()..])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolve(uri: &str) -> Result<Resource, String> {
        super::resolve(uri, &Source::of("in/a.gltf", []))
    }

    #[test]
    fn files_and_data() {
        let file = |name: &str| Ok(Resource::File(PathBuf::from("in").join(name)));
        assert_eq!(resolve("a%20b.bin"), file("a b.bin"));
        assert_eq!(resolve("a b:c.bin"), file("a b:c.bin"));
        assert_eq!(resolve("textures/../a.png"), file("textures/../a.png"));
        let data = Ok(Resource::Data(b"kiln".to_vec()));
        assert_eq!(resolve("data:application/octet-stream;base64,a2lsbg=="), data);
        assert_eq!(resolve("data:;base64,a2lsbg"), data);
        assert_eq!(resolve("DATA:;charset=utf-8;BASE64,a2ls\nbg=="), data);
        assert_eq!(resolve("data:,kil%6e"), data);
    }
}
