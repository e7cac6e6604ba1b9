//! `palpate-lab organ`: the project's own organ, a closed mesh for examples, benchmarks and `palpate-lab probe --mesh`.

mod glb;
mod shape;

use crate::error::{LabError, check, whole};
use crate::output::{Output, write_files};
use clap::Args;
use palpate_body::ClosedMesh;
use serde::Serialize;

/// A closed mesh like a small liver, as a GLB file
///
/// Two lobes, a groove between them and a hollow below: ellipsoids blended into each other, 126 mm wide (x), 67 mm high (y,
/// up) and 76 mm deep. It has the licence of this project. With `--out` it is written as organ.glb: positions in metres, normals,
/// triangles.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab organ --out assets/meshes\n  palpate-lab organ --vertices 50000 --out results"
)]
pub(crate) struct Organ {
    /// Approximate number of vertices: 6 n² + 2, of an inflated cube with n fields along each edge
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 10_000)]
    vertices: usize,
}

/// Properties of the mesh.
#[derive(Serialize)]
struct OrganReport {
    vertices: usize,
    triangles: usize,
    size_m: [f64; 3],
    volume_m3: f64,
}

impl Organ {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let n = self.vertices;
        check("--vertices", n as f64, (100..=1_000_000).contains(&n), "100 to 1000000")?;
        let fields = ((n - 2) as f64 / 6.0).sqrt().round() as usize;
        let shape = shape::organ(fields);
        let mesh = ClosedMesh::new(shape.positions_m.clone(), shape.triangles.clone());
        let mesh = mesh.map_err(palpate_body::BodyError::from)?;
        let [low, high] = mesh.bounds_m();
        let made = OrganReport {
            vertices: shape.positions_m.len(),
            triangles: shape.triangles.len(),
            size_m: (high - low).to_array(),
            volume_m3: mesh.volume_m3(),
        };
        if let Some(folder) = output.folder() {
            write_files(folder, &[("organ.glb", glb::glb("organ", &shape)?)])?;
        }
        output.print(&made, |out| {
            let [x, y, z] = made.size_m.map(|m| 1e3 * m);
            writeln!(out, "vertices  {}", made.vertices)?;
            writeln!(out, "triangles {}", made.triangles)?;
            writeln!(out, "size      {x:.1} mm x {y:.1} mm x {z:.1} mm")?;
            writeln!(out, "volume    {:.1} ml", 1e6 * made.volume_m3)
        })
    }
}
