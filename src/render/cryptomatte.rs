//! Cryptomatte (Friedman and Jones, Cryptomatte Specification 1.2.0, Psyop): of each pixel, the objects or materials
//! that cover it, as pairs of an id and a coverage, the largest first. An id is a hash of a name, so that compositing
//! programs make a matte of each name.

use std::collections::BTreeMap;

use crate::world::World;

/// Pairs of a pixel that are stored; those with less coverage are left out. Blender, too, stores 6.
const PAIRS: usize = 6;

/// Channels of a Cryptomatte.
const CHANNELS: usize = 2 * PAIRS;

/// What a Cryptomatte names.
#[derive(Clone, Copy)]
pub(super) enum Matte {
    Objects,
    Materials,
}

impl Matte {
    pub(super) const ALL: [Matte; 2] = [Matte::Objects, Matte::Materials];

    /// The name of its AOV.
    pub(super) const fn aov(self) -> &'static str {
        match self {
            Matte::Objects => "cryptomatte-object",
            Matte::Materials => "cryptomatte-material",
        }
    }

    /// The names of its channels: two pairs a layer. Lower case tells them apart from colours.
    pub(super) const fn channels(self) -> &'static [&'static str] {
        macro_rules! layers {
            ($($layer:literal)*) => { &[$(
                concat!($layer, ".r"), concat!($layer, ".g"), concat!($layer, ".b"), concat!($layer, ".a"),
            )*] };
        }
        match self {
            Matte::Objects => layers!("CryptoObject00" "CryptoObject01" "CryptoObject02"),
            Matte::Materials => layers!("CryptoMaterial00" "CryptoMaterial01" "CryptoMaterial02"),
        }
    }

    /// The start of the names of its layers.
    fn layer(self) -> &'static str {
        match self {
            Matte::Objects => "CryptoObject",
            Matte::Materials => "CryptoMaterial",
        }
    }

    /// For each object, the id of its name or of that of its material.
    pub(super) fn ids(self, world: &World) -> Vec<u32> {
        let id = |object: &crate::world::WorldObject| match self {
            Matte::Objects => id_of(&object.name),
            Matte::Materials => id_of(world.materials[object.material as usize].name()),
        };
        world.objects.iter().map(id).collect()
    }

    /// The text attributes of a file: the names with their ids. Equal names have one id.
    pub(super) fn texts(self, world: &World) -> Vec<(String, String)> {
        let names: BTreeMap<&str, String> = match self {
            Matte::Objects => world.objects.iter().map(|object| with_id(&object.name)).collect(),
            Matte::Materials => world.materials.iter().map(|material| with_id(material.name())).collect(),
        };
        let key = format!("{:08x}", id_of(self.layer()));
        let entry = |what: &str, text: String| (format!("cryptomatte/{}/{what}", &key[..7]), text);
        vec![
            entry("name", self.layer().into()),
            entry("hash", "MurmurHash3_32".into()),
            entry("conversion", "uint32_to_float32".into()),
            entry("manifest", serde_json::to_string(&names).unwrap_or_default()),
        ]
    }
}

fn with_id(name: &str) -> (&str, String) {
    (name, format!("{:08x}", id_of(name)))
}

/// The values of a pixel's channels. `covered`: object and coverage; `ids`: of each object.
///
/// Filters with negative lobes give coverages outside of 0 to 1: each is limited to that range, and their sum to 1.
pub(super) fn pairs(covered: &[(u32, f64)], ids: &[u32]) -> [f32; CHANNELS] {
    let mut all: Vec<(u32, f64)> = Vec::with_capacity(covered.len());
    for &(object, coverage) in covered {
        let id = ids[object as usize];
        match all.iter_mut().find(|(known, _)| *known == id) {
            Some((_, sum)) => *sum += coverage,
            None => all.push((id, coverage)),
        }
    }
    all.iter_mut().for_each(|(_, coverage)| *coverage = coverage.clamp(0.0, 1.0));
    let sum = all.iter().map(|(_, coverage)| coverage).sum::<f64>().max(1.0);
    all.sort_unstable_by(|(a, of_a), (b, of_b)| of_b.total_cmp(of_a).then(a.cmp(b)));
    let mut values = [0.0; CHANNELS];
    for (pair, (id, coverage)) in values.chunks_exact_mut(2).zip(all).filter(|(_, (_, c))| *c > 0.0) {
        pair.copy_from_slice(&[f32::from_bits(id), (coverage / sum) as f32]);
    }
    values
}

/// The id of a name, the bits of a finite, normal `f32`: a hash whose exponent is neither 0 nor 255.
fn id_of(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes());
    match hash >> 23 & 255 {
        0 | 255 => hash ^ 1 << 23,
        _ => hash,
    }
}

/// MurmurHash3_x86_32 (Appleby, 2011, public domain) with seed 0.
fn murmur3(bytes: &[u8]) -> u32 {
    let mix = |block: u32| block.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let mut blocks = bytes.chunks_exact(4);
    let mut hash = 0;
    for block in &mut blocks {
        hash ^= mix(u32::from_le_bytes([block[0], block[1], block[2], block[3]]));
        hash = u32::wrapping_add(u32::rotate_left(hash, 13).wrapping_mul(5), 0xe654_6b64);
    }
    let rest = blocks.remainder().iter().rev().fold(0, |rest, &byte| rest << 8 | u32::from(byte));
    hash ^= mix(rest) ^ bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values of `CryptoHashing` in `cryptomatte_utilities_tests.py` of Psyop's repository, and of the Python module
    /// `mmh3` where exponents are 0 or 255: 0 becomes 1, 255 becomes 254.
    #[test]
    fn ids_are_those_of_the_specification() {
        for (name, value) in [
            ("hello", 6.070_562_710_24e-17),
            ("cube", -4.084_619_125_19e15),
            ("sphere", 2.790_186_043_83e15),
            ("plane", 3.665_576_175_93e-11),
            ("равнина", -1.319_263_121_24e-25),
            ("mädchen", 6.236_129_821_16e25_f64),
        ] {
            assert_eq!(f32::from_bits(id_of(name)), value as f32, "{name}");
        }
        for (name, hash, id) in [
            ("", 0, 0x0080_0000),
            ("object 259", 0x0069_b367, 0x00e9_b367),
            ("object 1008", 0x8062_7585, 0x80e2_7585),
            ("object 858", 0xff86_8043, 0xff06_8043),
        ] {
            assert_eq!((murmur3(name.as_bytes()), id_of(name)), (hash, id), "{name}");
        }
    }

    /// Objects of one name are one; the largest come first, equal ones by their ids; 6 of 8 are stored.
    #[test]
    fn pairs_are_ranked() {
        let value = |id: u32| f32::from_bits(id);
        let of_one = pairs(&[(0, 0.25), (1, 0.5), (2, 0.25)], &[9, 7, 9]);
        assert_eq!(of_one[..4], [value(7), 0.5, value(9), 0.5]);
        assert_eq!(of_one[4..], [0.0; 8]);
        let many: Vec<(u32, f64)> = (0..8).map(|object| (object, f64::from(object) / 28.0)).collect();
        let ids = [11, 12, 13, 14, 15, 16, 17, 18];
        let found = pairs(&many, &ids);
        let expected: Vec<f32> = (2..8).rev().flat_map(|i| [value(ids[i]), i as f32 / 28.0]).collect();
        assert_eq!(found[..], expected);
        // A negative lobe: 1.25 and -0.25 become 1 and nothing; 1.5, 0.5 and -1 become 2/3 and 1/3.
        assert_eq!(pairs(&[(0, 1.25), (1, -0.25)], &[1, 2])[..4], [value(1), 1.0, 0.0, 0.0]);
        let limited = pairs(&[(0, 1.5), (1, 0.5), (2, -1.0)], &[1, 2, 3]);
        assert_eq!(limited[..6], [value(1), 2.0 / 3.0, value(2), 1.0 / 3.0, 0.0, 0.0]);
    }
}
