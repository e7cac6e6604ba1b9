use super::*;
use std::path::PathBuf;

/// Writes a glTF file with `nodes` and `meshes` as JSON. Accessors 0 and 1 are positions and indices of a tetrahedron.
fn gltf(name: &str, nodes: &str, meshes: &str) -> PathBuf {
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let triangles = [0_u16, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];
    bytes.extend(triangles.iter().flat_map(|i| i.to_le_bytes()));
    let roots: Vec<String> = (0..nodes.matches("\"root\"").count()).map(|root| root.to_string()).collect();
    let meshes = if meshes.is_empty() { String::new() } else { format!(r#""meshes":[{meshes}],"#) };
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[{}]}}],"nodes":[{nodes}],{meshes}
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
        {{"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":24}}],
        "buffers":[{{"byteLength":72,"uri":"corners.bin"}}]}}"#,
        roots.join(",")
    );
    // A folder whose name has a special character of asset paths.
    let folder = std::env::temp_dir().join(format!("palpate #{} {name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("corners.bin"), bytes).unwrap();
    let path = folder.join("a mesh#1.gltf");
    std::fs::write(&path, text).unwrap();
    path
}

const TRIANGLES: &str = r#"{"attributes":{"POSITION":0},"indices":1}"#;

fn remove(path: &Path) {
    std::fs::remove_dir_all(path.parent().unwrap()).ok();
}

#[test]
fn all_primitives_are_joined_with_the_transforms_of_their_nodes() {
    // One scaled by two and moved by a parent, one mirrored, and one outside the scene.
    let nodes = r#"{"name":"root","translation":[10,0,0],"children":[2]},{"name":"root","mesh":1,"scale":[-1,1,1]},
        {"mesh":0,"scale":[2,2,2]},{"mesh":0,"translation":[0,0,99]}"#;
    let meshes = format!(r#"{{"primitives":[{TRIANGLES},{TRIANGLES}]}},{{"primitives":[{TRIANGLES}]}}"#);
    let path = gltf("nodes", nodes, &meshes);
    let MeshFile { mesh, bounds, parts } = MeshFile::read(&path, &MeshSelection::All).unwrap();
    assert_eq!((parts, mesh.count_vertices()), (3, 12));
    assert_eq!(bounds, [DVec3::new(-1.0, 0.0, 0.0), DVec3::new(12.0, 2.0, 2.0)]);
    // Every part has a positive volume: none is inside out, including the mirrored one.
    let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap().as_float3().unwrap();
    let corners: Vec<Vec3> =
        mesh.indices().unwrap().iter().map(|corner| Vec3::from(positions[corner])).collect();
    for part in corners.chunks(12) {
        let volume: f32 =
            part.chunks(3).map(|t| (t[0] - part[0]).dot((t[1] - part[0]).cross(t[2] - part[0]))).sum();
        assert!(volume > 0.9, "{part:?}");
    }
    // A single mesh.
    let only = MeshFile::read(&path, &MeshSelection::Mesh(1)).unwrap();
    assert_eq!((only.parts, only.bounds), (1, [DVec3::new(-1.0, 0.0, 0.0), DVec3::new(0.0, 1.0, 1.0)]));
    let error = MeshFile::read(&path, &MeshSelection::Mesh(2)).unwrap_err().to_string();
    assert!(error.contains("nothing in the file is mesh 2; change --mesh or --node"), "{error}");
    remove(&path);
}

#[test]
fn files_without_a_mesh_are_errors_with_path_and_reason() {
    let line = r#"{"attributes":{"POSITION":0},"mode":1}"#;
    let lines = gltf("lines", r#"{"name":"root","mesh":0}"#, &format!(r#"{{"primitives":[{line}]}}"#));
    let nothing = gltf("nothing", r#"{"name":"root"}"#, "");
    let no_bin = gltf("no_bin", r#"{"name":"root","mesh":0}"#, &format!(r#"{{"primitives":[{TRIANGLES}]}}"#));
    std::fs::remove_file(no_bin.with_file_name("corners.bin")).unwrap();
    let picture = nothing.with_file_name("picture.glb");
    std::fs::write(&picture, b"\x89PNG\r\n\x1a\n and so on").unwrap();
    let empty = nothing.with_file_name("empty.glb");
    std::fs::write(&empty, b"").unwrap();
    for (path, expected) in [
        (lines.clone(), "no triangles"),
        (nothing.clone(), "no triangles"),
        (no_bin.clone(), "corners.bin"),
        (picture, "glTF"),
        (empty, "empty"),
        (nothing.with_file_name("cup.glb"), "cannot be read"),
        (nothing.with_file_name("cup.stl"), "cannot be read"),
    ] {
        let error = MeshFile::read(&path, &MeshSelection::All).unwrap_err().to_string();
        assert!(error.contains(expected) && error.starts_with(&path.display().to_string()), "{error}");
    }
    [lines, nothing, no_bin].iter().for_each(|path| remove(path));
}
