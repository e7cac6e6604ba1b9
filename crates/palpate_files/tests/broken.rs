//! Damaged files of every format: they are read or rejected, without a panic and without a wait.
//!
//! ```sh
//! FILES=100000 cargo test --release -p palpate_files --test suite broken -- --nocapture
//! ```
//!
//! `FILES` is the number of damaged files of each kind. Two thousand are part of every test.

use crate::gltf_builder::Builder;
use crate::{cube, obj, ply, stl};
use palpate_files::{MeshFile, MeshFileError, MeshFormat};
use serde_json::json;
use std::time::{Duration, Instant};

pub fn file_count() -> u64 {
    std::env::var("FILES").map_or(2000, |text| text.parse().unwrap())
}

/// A generator of `SplitMix64`.
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % bound.max(1) as u64) as usize
    }
}

/// Truncates the file, or changes, inserts, removes or repeats some of its bytes from `start` on.
pub fn damage(bytes: &[u8], start: usize, random: &mut Random) -> Vec<u8> {
    const TOKENS: [&[u8]; 8] =
        [b"-1", b"0", b"9", b"4294967295", b"99999999999999999999", b"nan", b"\xff\xff\xff\xff", b"1e400"];
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(6) {
        let place = start + random.below(bytes.len().saturating_sub(start));
        if place >= bytes.len() {
            continue;
        }
        match random.below(8) {
            0 => bytes.truncate(place),
            1 => bytes[place] = random.below(256) as u8,
            2 => bytes[place] ^= 1 << random.below(8),
            3 => {
                bytes.remove(place);
            }
            4 => {
                bytes.splice(place..place, TOKENS[random.below(TOKENS.len())].iter().copied());
            }
            5 => {
                let end = bytes.len().min(place + 1 + random.below(4));
                bytes.splice(place..end, TOKENS[random.below(TOKENS.len())].iter().copied());
            }
            6 => {
                let end = bytes.len().min(place + random.below(40));
                let part = bytes[place..end].to_vec();
                bytes.splice(place..place, part);
            }
            // A digit, where there is one: other counts, offsets and references.
            _ => {
                let digit = bytes[place..].iter().position(u8::is_ascii_digit);
                if let Some(digit) = digit {
                    bytes[place + digit] = b'0' + random.below(10) as u8;
                }
            }
        }
    }
    bytes
}

#[expect(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "reports the slowest input; nothing depends on it"
)]
fn check(bytes: &[u8], start: usize, format: MeshFormat) {
    MeshFile::from_bytes(bytes, format, None).unwrap();
    let mut slowest = (Duration::ZERO, 0);
    for seed in 0..file_count() {
        let damaged = damage(bytes, start, &mut Random(seed));
        let begin = Instant::now();
        if let Ok(file) = MeshFile::from_bytes(&damaged, format, None) {
            for piece in &file.pieces {
                let count = piece.vertices.len();
                assert!(!piece.triangles.is_empty());
                assert!(piece.triangles.iter().flatten().all(|corner| (*corner as usize) < count), "{seed}");
                assert!(piece.normals.as_ref().is_none_or(|normals| normals.len() == count), "{seed}");
            }
        }
        slowest = slowest.max((begin.elapsed(), seed));
    }
    println!("{} files of {format:?}; the slowest took {:?}, seed {}", file_count(), slowest.0, slowest.1);
}

/// A file with nodes, normals, a morph target and a sparse accessor.
fn rich_cube() -> Builder {
    let mut builder = Builder::cube();
    let normals = builder.vectors(5126, &cube::position_bytes(&[[0.0, 0.0, 1.0]; 8]), 8);
    let (indices, values) = (builder.view(&[3, 7]), builder.view(&cube::position_bytes(&[[1.0; 3]; 2])));
    let sparse = json!({
        "count": 2,
        "indices": { "bufferView": indices, "componentType": 5121 },
        "values": { "bufferView": values },
    });
    let target = builder
        .add("accessors", json!({ "componentType": 5126, "count": 8, "type": "VEC3", "sparse": sparse }));
    let primitive = &mut builder.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["NORMAL"] = json!(normals);
    primitive["targets"] = json!([{ "POSITION": target, "NORMAL": target }]);
    builder.json["meshes"][0]["weights"] = json!([0.5]);
    builder.add("nodes", json!({ "children": [1, 2], "rotation": [0, 0, 0, 1] }));
    builder.add("nodes", json!({ "mesh": 0, "scale": [1, 1, -1] }));
    builder.add("nodes", json!({ "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1] }));
    builder.add("scenes", json!({ "nodes": [0] }));
    builder
}

/// Damages the whole file, and then the buffer of it alone, which decoders read.
fn check_gltf(builder: &Builder) {
    let bytes = builder.glb();
    check(&bytes, 0, MeshFormat::Gltf);
    check(&bytes, bytes.len() - builder.binary.len().next_multiple_of(4), MeshFormat::Gltf);
}

#[test]
fn damaged_glb_is_read_or_rejected() {
    check_gltf(&rich_cube());
}

#[test]
fn damaged_gltf_is_read_or_rejected() {
    check(&rich_cube().gltf_with_data(), 0, MeshFormat::Gltf);
}

#[test]
#[cfg(feature = "meshopt")]
fn damaged_meshopt_is_read_or_rejected() {
    check_gltf(&crate::compressed::meshopt_cube("EXT_meshopt_compression", 0, true));
    check_gltf(&crate::compressed::meshopt_cube("KHR_meshopt_compression", 1, false));
}

#[test]
#[cfg(feature = "draco")]
fn damaged_draco_is_read_or_rejected() {
    check_gltf(&crate::compressed::draco_cube(0));
    check_gltf(&crate::compressed::draco_cube(1));
}

#[test]
fn damaged_obj_is_read_or_rejected() {
    check(obj::cube_text().as_bytes(), 0, MeshFormat::Obj);
}

#[test]
fn damaged_stl_is_read_or_rejected() {
    check(stl::text_cube("cube").as_bytes(), 0, MeshFormat::Stl);
    check(&stl::binary_cube(b"solid"), 0, MeshFormat::Stl);
}

#[test]
fn damaged_ply_is_read_or_rejected() {
    for bytes in [ply::text_cube(), ply::binary_cube(false), ply::binary_cube(true)] {
        check(&bytes, 0, MeshFormat::Ply);
    }
}

#[test]
fn rejects_short_file_that_names_an_accessor_too_often() {
    // 4 million zeros take no byte of the file, and fifty primitives or targets name them.
    let file = |primitives: usize, targets: usize| {
        let mut builder = Builder::cube();
        let zeros =
            builder.add("accessors", json!({ "componentType": 5126, "count": 4_000_000, "type": "VEC3" }));
        let primitive = json!({
            "attributes": { "POSITION": zeros },
            "indices": builder.json["meshes"][0]["primitives"][0]["indices"],
            "targets": vec![json!({ "POSITION": zeros }); targets],
        });
        builder.json["meshes"][0]["primitives"] = json!(vec![primitive; primitives]);
        builder.json["meshes"][0]["weights"] = json!(vec![0.5; targets]);
        builder.glb()
    };
    for (primitives, targets) in [(50, 0), (1, 50)] {
        let error = MeshFile::from_bytes(&file(primitives, targets), MeshFormat::Gltf, None).unwrap_err();
        assert!(matches!(error, MeshFileError::TooLarge { .. }), "{error}");
    }
}

#[test]
fn rejects_stated_counts_without_content() {
    let stl = [vec![0; 80], u32::MAX.to_le_bytes().to_vec()].concat();
    let ply = |count: &str| {
        let property = "property float x\nproperty float y\nproperty float z";
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{property}\nend_header\n")
            .into_bytes()
    };
    assert!(matches!(MeshFile::from_bytes(&stl, MeshFormat::Stl, None), Err(MeshFileError::NotValid { .. })));
    for (count, is_too_large) in [("19999999", false), ("4294967295", true), ("18446744073709551615", true)] {
        let error = MeshFile::from_bytes(&ply(count), MeshFormat::Ply, None).unwrap_err();
        assert_eq!(matches!(error, MeshFileError::TooLarge { .. }), is_too_large, "{error}");
    }
}

#[test]
fn arbitrary_bytes_are_read_or_rejected() {
    // Beginnings that reach beyond the first check.
    let stl_header = [vec![0; 80], 2_u32.to_le_bytes().to_vec()].concat();
    let ply_header = "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\nproperty char y\nproperty short z\n\
                      element face 2\nproperty list uchar uint vertex_indices\nend_header\n";
    let beginnings: [(&[u8], MeshFormat); 7] = [
        (b"", MeshFormat::Gltf),
        (b"glTF\x02\0\0\0", MeshFormat::Gltf),
        (b"{\"asset\":{\"version\":\"2.0\"},", MeshFormat::Gltf),
        (b"f ", MeshFormat::Obj),
        (b"solid ", MeshFormat::Stl),
        (&stl_header, MeshFormat::Stl),
        (ply_header.as_bytes(), MeshFormat::Ply),
    ];
    for seed in 0..file_count() {
        let random = &mut Random(seed);
        let (beginning, format) = beginnings[random.below(beginnings.len())];
        let mut bytes = beginning.to_vec();
        bytes.extend((0..random.below(300)).map(|_| random.below(256) as u8));
        let _ = MeshFile::from_bytes(&bytes, format, None);
    }
}
