//! Minimal GLB files, with minimal pictures.

use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;

/// A picture in a GLB file.
pub struct Picture {
    /// MIME type of the picture.
    pub mime: &'static str,
    /// File of the picture.
    pub bytes: Vec<u8>,
}

/// Returns the file of a mesh with positions and indices. Each picture is the base colour of a material; the mesh has the first one.
#[must_use]
pub fn glb(mesh: &Mesh, pictures: &[Picture]) -> Vec<u8> {
    let positions = match mesh.attribute(Mesh::ATTRIBUTE_POSITION) {
        Some(VertexAttributeValues::Float32x3(positions)) => positions.clone(),
        _ => Vec::new(),
    };
    let indices: Vec<u32> = mesh.indices().into_iter().flat_map(|i| i.iter().map(|i| i as u32)).collect();
    let mut binary: Vec<u8> = positions.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let mut views = vec![format!(r#"{{"buffer":0,"byteOffset":0,"byteLength":{}}}"#, binary.len())];
    let mut add = |bytes: &mut dyn Iterator<Item = u8>| {
        let start = binary.len();
        binary.extend(bytes);
        views.push(format!(r#"{{"buffer":0,"byteOffset":{start},"byteLength":{}}}"#, binary.len() - start));
        binary.resize(binary.len().next_multiple_of(4), 0);
    };
    add(&mut indices.iter().flat_map(|i| i.to_le_bytes()));
    pictures.iter().for_each(|picture| add(&mut picture.bytes.iter().copied()));
    let extreme = |pick: fn(f32, f32) -> f32| {
        let of = |axis: usize| positions.iter().map(|x| x[axis]).reduce(pick).unwrap_or_default();
        format!("[{},{},{}]", of(0), of(1), of(2))
    };
    let list = |each: &dyn Fn(usize) -> String| (0..pictures.len()).map(each).collect::<Vec<_>>().join(",");
    let of_pictures = format!(
        r#","images":[{}],"textures":[{}],"materials":[{}]"#,
        list(&|i| format!(r#"{{"bufferView":{},"mimeType":"{}"}}"#, i + 2, pictures[i].mime)),
        list(&|i| format!(r#"{{"source":{i}}}"#)),
        list(&|i| format!(r#"{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":{i}}}}}}}"#)),
    );
    let has_pictures = !pictures.is_empty();
    let mut json = format!(
        concat!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"#,
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1{}}}]}}],"#,
            r#""accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3","min":{},"max":{}}},"#,
            r#"{{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}],"#,
            r#""bufferViews":[{}],"buffers":[{{"byteLength":{}}}]{}}}"#
        ),
        if has_pictures { r#","material":0"# } else { "" },
        positions.len(),
        extreme(f32::min),
        extreme(f32::max),
        indices.len(),
        views.join(","),
        binary.len(),
        if has_pictures { of_pictures.as_str() } else { "" },
    )
    .into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF".to_vec();
    file.extend(2_u32.to_le_bytes());
    file.extend((12 + 8 + json.len() as u32 + 8 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

/// Returns one red pixel as PNG.
#[must_use]
pub fn png() -> Picture {
    let mut bytes = vec![0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a];
    let mut chunk = |kind: &[u8; 4], data: &[u8]| {
        bytes.extend((data.len() as u32).to_be_bytes());
        let checked = [kind, data].concat();
        bytes.extend(&checked);
        bytes.extend(crc(&checked).to_be_bytes());
    };
    // One pixel, 8 bits, red, green and blue.
    chunk(b"IHDR", &[0, 0, 0, 1, 0, 0, 0, 1, 8, 2, 0, 0, 0]);
    // One stored block of deflate: no filter, the pixel; then the Adler checksum.
    let line = [0, 255, 0, 0];
    let (a, b) = line.iter().fold((1_u32, 0_u32), |(a, b), x| (a + x, b + a + x));
    let stored =
        [&[0x78, 0x01, 1, 4, 0, 0xfb, 0xff], &line.map(|x| x as u8)[..], &(b << 16 | a).to_be_bytes()];
    chunk(b"IDAT", &stored.concat());
    chunk(b"IEND", &[]);
    Picture { mime: "image/png", bytes }
}

fn crc(bytes: &[u8]) -> u32 {
    let byte = |sum: u32, byte: &u8| {
        (0..8).fold(sum ^ u32::from(*byte), |s, _| if s & 1 == 1 { 0xedb8_8320 ^ s >> 1 } else { s >> 1 })
    };
    !bytes.iter().fold(u32::MAX, byte)
}

/// Returns eight by eight grey pixels as JPEG: one block, with only a mean.
#[must_use]
pub fn jpeg() -> Picture {
    // Start of image; a quantization table of ones.
    let mut bytes = vec![0xff, 0xd8, 0xff, 0xdb, 0, 67, 0];
    bytes.extend([1; 64]);
    // Baseline, 8 bits, 8 by 8, one component.
    bytes.extend([0xff, 0xc0, 0, 11, 8, 0, 8, 0, 8, 1, 1, 0x11, 0]);
    // Huffman tables of means and of the rest, each with the single code "0" of the symbol 0.
    for table in [0x00, 0x10] {
        // One code of one bit, no longer ones, the symbol.
        bytes.extend([0xff, 0xc4, 0, 20, table, 1]);
        bytes.extend([0; 15 + 1]);
    }
    // Start of scan; zero difference of the mean, end of block, padding; end of image.
    bytes.extend([0xff, 0xda, 0, 8, 1, 1, 0, 0, 63, 0, 0x3f, 0xff, 0xd9]);
    Picture { mime: "image/jpeg", bytes }
}
