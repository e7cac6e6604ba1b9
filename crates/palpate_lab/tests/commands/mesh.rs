//! `palpate-lab mesh`.

use super::*;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// Triangles and their corners.
#[derive(Clone, Default)]
struct Shape {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[usize; 3]>,
}

impl Shape {
    /// Adds `quad`, counter-clockwise as seen from outside, as two triangles.
    fn quad(mut self, quad: [[f64; 3]; 4]) -> Self {
        let first = self.vertices.len();
        self.vertices.extend(quad);
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        self
    }

    fn and(mut self, other: &Self) -> Self {
        let first = self.vertices.len();
        self.vertices.extend(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|corner| first + corner)));
        self
    }

    fn moved(mut self, by: [f64; 3]) -> Self {
        self.vertices.iter_mut().for_each(|x| *x = [0, 1, 2].map(|axis| x[axis] + by[axis]));
        self
    }

    /// Enclosed volume: the sum of the tetrahedra from the origin.
    fn volume(&self) -> f64 {
        let of = |t: &[usize; 3]| {
            let [[a, b, c], [d, e, f], [g, h, i]] = t.map(|corner| self.vertices[corner]);
            (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) / 6.0
        };
        self.triangles.iter().map(of).sum()
    }

    /// Writes it as an OBJ file.
    fn file(&self, folder: &Path, name: &str) -> String {
        let mut text = String::new();
        self.vertices.iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").unwrap());
        let corners = self.triangles.iter().map(|t| t.map(|corner| corner + 1));
        corners.for_each(|[a, b, c]| writeln!(text, "f {a} {b} {c}").unwrap());
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    }
}

/// A box from `low` to `high`.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Shape {
    let at =
        |corner: usize| [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] });
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    quads.into_iter().fold(Shape::default(), |shape, quad| shape.quad(quad.map(at)))
}

/// A cube of 0.1 m on the plane y = 0.
fn cube() -> Shape {
    cuboid([-0.05, 0.0, -0.05], [0.05, 0.1, 0.05])
}

/// A ball of 12 by 24 fields.
fn ball(radius: f64) -> Shape {
    let at = |row: usize, column: usize| {
        let (polar, round) =
            (std::f64::consts::PI / 12.0 * row as f64, std::f64::consts::TAU / 24.0 * column as f64);
        let across = radius * polar.sin();
        [across * round.sin(), radius * polar.cos(), across * round.cos()]
    };
    let fields = (0..12).flat_map(|row| (0..24).map(move |column| (row, column)));
    fields.fold(Shape::default(), |shape, (row, column)| {
        shape.quad([at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1)])
    })
}

/// The report on an accepted file.
fn accepted(file: &str, more: &[&str]) -> Value {
    let report = json(&[&["mesh", file], more].concat());
    assert_eq!((&report["accepted"], &report["reason"]), (&true.into(), &Value::Null), "{report}");
    report
}

/// The reason of a rejection. It is the same as JSON and as text, and the exit code is that of rejected input.
fn reason(file: &str, more: &[&str]) -> String {
    let arguments = [&["mesh", file], more].concat();
    let output = run(&[&arguments[..], &["--json"]].concat());
    assert_eq!(output.status.code(), Some(2));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["accepted"], false, "{report}");
    let reason = report["reason"].as_str().unwrap().to_owned();
    assert_eq!(rejected(&arguments), format!("error: {reason}\n"));
    reason
}

#[test]
fn cube_has_its_cells_and_the_force_of_its_tissue() {
    let folder = tempfile::tempdir().unwrap();
    let report = accepted(&cube().file(folder.path(), "cube.obj"), &["--cells", "4", "--taps", "1"]);
    let count = |of: &str| report[of].as_u64().unwrap();
    assert_eq!([count("pieces"), count("cells"), count("nodes"), count("fixed_nodes")], [1, 64, 125, 25]);
    assert_eq!([count("holes"), count("crossings"), count("reoriented"), count("beyond_support")], [0; 4]);
    assert_eq!([number(&report["uncertain_share"]), number(&report["piece_share"])], [0.0, 1.0]);
    close(number(&report["volume_m3"]), 1e-3, 1e-6);
    close(number(&report["mass_kg"]), 1.0, 1e-6);
    assert!(number(&report["deviation_m"]) < 1e-9 && number(&report["build_ms"]) > 0.0, "{report}");
    let taps = report["taps"].as_array().unwrap();
    let [x, y, z] = numbers(&taps[0]["place_m"])[..] else { panic!("{report}") };
    assert!(taps.len() == 1 && x.abs().max(z.abs()) < 1e-6 && (y - 0.1).abs() < 1e-6, "{report}");
    // A ball of 1/120 m, pressed 10 mm deep into a half-space of 10 kPa. The cube is stiffer, because its bottom is fixed, and softer,
    // because its sides are free.
    let (radius, modulus) = (0.1 / 12.0, 10e3 / (1.0 - 1.0 / 16.0));
    let hertz = 4.0 / 3.0 * modulus * radius * radius + 2.0 * modulus * radius * (0.01 - radius);
    close(number(&taps[0]["peak_n"]), hertz, 0.2);
    assert!(number(&taps[0]["repeat_spread"]) < 0.05, "{report}");
    let error = &report["live_error"];
    let [median, p95, largest, first] =
        ["median", "p95", "largest", "first_touch"].map(|of| number(&error[of]));
    assert!(
        0.0 < median && median <= p95 && p95 <= largest && first <= largest && largest < 0.05,
        "{report}"
    );
    let twice = accepted(
        &cube().file(folder.path(), "cube.obj"),
        &["--cells", "4", "--taps", "1", "--youngs-pa", "20e3"],
    );
    close(number(&twice["taps"][0]["peak_n"]), 2.0 * number(&taps[0]["peak_n"]), 0.05);
}

#[test]
fn largest_of_two_balls_is_the_body_unless_another_is_selected() {
    let folder = tempfile::tempdir().unwrap();
    let (large, small) = (ball(0.03), ball(0.02).moved([0.1, 0.0, 0.0]));
    let file = small.clone().and(&large).file(folder.path(), "balls.obj");
    for (more, expected) in [(&[][..], &large), (&["--piece", "0"], &large), (&["--piece", "1"], &small)] {
        let report = accepted(&file, &[&["--taps", "0", "--cells", "16"], more].concat());
        assert_eq!(report["pieces"], 2);
        close(number(&report["volume_m3"]), expected.volume(), 1e-5);
        close(number(&report["mass_kg"]), 1e3 * expected.volume(), 1e-3);
        close(number(&report["piece_share"]), expected.volume() / (large.volume() + small.volume()), 1e-2);
        assert_eq!(report["taps"], Value::Array(Vec::new()));
        assert_eq!(
            [&report["live_error"]["median"], &report["live_error"]["first_touch"]],
            [&Value::Null; 2]
        );
    }
    assert!(reason(&file, &["--taps", "0", "--piece", "2"]).contains("(--piece)"));
}

#[test]
fn hole_counts_as_closed_unless_strict() {
    let folder = tempfile::tempdir().unwrap();
    let mut open = cube();
    open.triangles.pop();
    let file = open.file(folder.path(), "open.obj");
    let report = accepted(&file, &["--taps", "0"]);
    assert_eq!(report["holes"], 1);
    close(number(&report["volume_m3"]), 1e-3, 0.005);
    close(number(&report["mass_kg"]), 1.0, 0.005);
    let reason = reason(&file, &["--taps", "0", "--strict"]);
    assert!(reason.starts_with(&file) && reason.contains("the mesh has holes: 3 edges"), "{reason}");
}

#[test]
fn sheet_needs_a_thickness() {
    let folder = tempfile::tempdir().unwrap();
    let sheet = Shape::default().quad([
        [-0.05, 0.0, -0.05],
        [-0.05, 0.0, 0.05],
        [0.05, 0.0, 0.05],
        [0.05, 0.0, -0.05],
    ]);
    let file = sheet.file(folder.path(), "sheet.obj");
    assert!(reason(&file, &[]).contains("set `thickness_m` (--thickness-m)"));
    let report = accepted(&file, &["--taps", "0", "--thickness-m", "0.01"]);
    // The plate, and half a tube around its edges.
    let tube = std::f64::consts::PI * 0.005 * 0.005 / 2.0 * 0.4;
    let least = 1e-4;
    let volume = number(&report["volume_m3"]);
    assert!(volume > 0.99 * least && volume < 1.03 * (least + tube), "{volume}");
    close(number(&report["mass_kg"]), 1e3 * volume, 0.01);
    assert!(reason(&file, &["--thickness-m", "0.2"]).contains("thickness of the open parts"));
}

#[test]
fn place_beside_a_hole_is_the_nearest_one_and_places_differ() {
    // A frame of 0.1 m with a window of 0.04 m, of four walls that share their ends.
    let (outer, inner) = (0.05, 0.02);
    let shapes = [
        cuboid([-outer, 0.0, -outer], [-inner, 0.03, outer]),
        cuboid([inner, 0.0, -outer], [outer, 0.03, outer]),
        cuboid([-inner, 0.0, -outer], [inner, 0.03, -inner]),
        cuboid([-inner, 0.0, inner], [inner, 0.03, outer]),
    ];
    let frame = shapes.iter().fold(Shape::default(), |all, wall| all.and(wall));
    let folder = tempfile::tempdir().unwrap();
    let file = frame.file(folder.path(), "frame.obj");
    let report = accepted(&file, &["--cells", "10", "--taps", "3"]);
    close(number(&report["mass_kg"]), 1e3 * 0.03 * (0.01 - 0.0016), 0.01);
    let places: Vec<Vec<f64>> =
        report["taps"].as_array().unwrap().iter().map(|tap| numbers(&tap["place_m"])).collect();
    let across = |a: &[f64], b: &[f64]| (a[0] - b[0]).hypot(a[2] - b[2]);
    let [first, second, third] = &places[..] else { panic!("{report}") };
    assert!((0.0199..0.0284).contains(&across(first, &[0.0; 3])) && first[1] > 0.015, "{first:?}");
    for (a, b) in [(first, second), (first, third), (second, third)] {
        assert!(across(a, b) > 0.04, "{places:?}");
    }
    // The others are on the top, two radii of the tool or more from its rim.
    for x in [second, third] {
        let farthest = x[0].abs().max(x[2].abs());
        assert!((x[1] - 0.03).abs() < 1e-3 && (0.025..0.0451).contains(&farthest), "{places:?}");
    }
}

#[test]
fn size_is_set_by_a_scale_or_a_length() {
    let folder = tempfile::tempdir().unwrap();
    let file = cuboid([0.0, 0.0, 0.0], [100.0, 50.0, 25.0]).file(folder.path(), "mm.obj");
    let tapless = |more: &[&str]| accepted(&file, &[&["--taps", "0", "--cells", "4"], more].concat());
    for (more, length) in [(["--scale", "0.001"], 0.1), (["--size-m", "0.2"], 0.2)] {
        let report = tapless(&more);
        for (side, share) in numbers(&report["size_m"]).into_iter().zip([1.0, 0.5, 0.25]) {
            close(side, share * length, 1e-6);
        }
        close(number(&report["mass_kg"]), 125.0 * length * length * length, 1e-6);
    }
    let reason = reason(&file, &[]);
    assert!(
        reason.contains("100 m long")
            && reason.ends_with("`metres_per_unit` (--scale), for example by 0.001"),
        "{reason}"
    );
}

#[test]
fn implausible_sizes_and_the_force_limit_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = cube().file(folder.path(), "cube.obj");
    let tap = ["--cells", "4", "--taps", "1"];
    let report = |more: &[&str]| accepted(&file, &[&tap[..], more].concat());
    assert_eq!(report(&[])["warnings"], Value::Array(Vec::new()));
    // 60 times the length makes 3,600 times the force of 3 N.
    let large = report(&["--size-m", "6"]);
    let [size, limit] = &large["warnings"].as_array().unwrap()[..] else { panic!("{large}") };
    let (size, limit) = (size.as_str().unwrap(), limit.as_str().unwrap());
    assert!(
        size.starts_with("the body is 6.000 m long") && size.ends_with("change --scale or --size-m"),
        "{size}"
    );
    assert!(size.contains("centimetres needs the factor 0.010, which gives 0.060 m"), "{size}");
    assert_eq!(limit, "the force reached 10 N, the limit of the virtual coupling; change --max-force-n");
    close(number(&large["taps"][0]["peak_n"]), 10.0, 1e-6);
    let small = report(&["--scale", "0.03"]);
    let warnings = small["warnings"].as_array().unwrap();
    assert!(warnings.len() == 1 && warnings[0].as_str().unwrap().contains("0.003 m long"), "{small}");
    let peak_n = number(&report(&[])["taps"][0]["peak_n"]);
    let low = report(&["--max-force-n", "0.1"]);
    close(number(&low["taps"][0]["peak_n"]), 0.1, 1e-6);
    assert!(
        peak_n > 1.0
            && low["warnings"][0]
                == "the force reached 0.1 N, the limit of the virtual coupling; change --max-force-n"
    );
    let text = String::from_utf8(run(&["mesh", &file, "--taps", "0", "--size-m", "6"]).stdout).unwrap();
    assert!(text.contains("warning            the body is 6.000 m long"), "{text}");
}

#[test]
fn primitives_are_listed_and_selected() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::new();
    for (name, at) in [("left", -0.2), ("right", 0.2)] {
        let Shape { vertices, triangles } = cube().moved([at, 0.0, 0.0]);
        let first = if name == "left" { 1 } else { 1 + vertices.len() };
        writeln!(text, "o {name}").unwrap();
        vertices.iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").unwrap());
        let corners = triangles.iter().map(|t| t.map(|corner| corner + first));
        corners.for_each(|[a, b, c]| writeln!(text, "f {a} {b} {c}").unwrap());
    }
    let path = folder.path().join("two.obj");
    std::fs::write(&path, text).unwrap();
    let file = path.to_str().unwrap();
    let list = json(&["mesh", file, "--list"]);
    let nodes: BTreeMap<u64, &str> = list
        .as_array()
        .unwrap()
        .iter()
        .map(|p| (p["mesh"].as_u64().unwrap(), p["node"].as_str().unwrap()))
        .collect();
    assert_eq!(nodes, BTreeMap::from([(0, "left"), (1, "right")]));
    assert_eq!(list[1]["triangles"], 12);
    let printed = String::from_utf8(run(&["mesh", file, "--list"]).stdout).unwrap();
    assert!(printed.lines().count() == 2 && printed.contains("mesh 1 primitive 0  node right"), "{printed}");
    for (more, at) in [(["--mesh", "0"], -0.2), (["--node", "right"], 0.2)] {
        let report = accepted(file, &[&["--taps", "1", "--cells", "4"], &more[..]].concat());
        close(number(&report["taps"][0]["place_m"][0]), at, 1e-5);
    }
    assert!(
        reason(file, &["--node", "middle"]).contains("a node with the name middle; change --mesh or --node")
    );
}

#[test]
fn text_has_units_and_assumptions() {
    let folder = tempfile::tempdir().unwrap();
    let mut open = cube();
    open.triangles.pop();
    let file = open.file(folder.path(), "open.obj");
    let output = run(&["mesh", &file, "--cells", "4", "--taps", "1"]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}");
    for expected in [
        "accepted           yes",
        "size, mm           100.0 x 100.0 x 100.0",
        "volume, ml",
        "the mesh has 1 hole",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    assert!(text.contains(" N at ") && text.contains("at first touch "), "{text}");
}

#[test]
fn rejects_unreadable_files_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    assert!(reason(&write("empty.glb", ""), &[]).contains("file is not valid"));
    assert!(reason(&write("empty.obj", ""), &[]).contains("has no triangles"));
    assert!(reason("no/such.glb", &[]).starts_with("no/such.glb: mesh file `no/such.glb` cannot be read"));
    let flat = Shape { vertices: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 2]] };
    assert!(reason(&flat.file(folder.path(), "point.obj"), &[]).contains("no thickness"));
}

#[test]
fn rejects_invalid_flags_of_mesh_by_name() {
    for (arguments, expected) in [
        (&[][..], "the following required arguments were not provided: <FILE>"),
        (&["a.glb", "--scale", "0"], "--scale is 0; it must be 1e-9 to 1e9"),
        (&["a.glb", "--size-m", "20"], "--size-m is 20; it must be 0.001 to 10"),
        (
            &["a.glb", "--size-m", "0.1", "--scale", "1"],
            "the argument '--size-m <L>' cannot be used with '--scale",
        ),
        (&["a.glb", "--cells", "0"], "--cells is 0; it must be 1 to 127 along the longest side"),
        (&["a.glb", "--thickness-m", "-1"], "--thickness-m is -1; it must be finite and above 0"),
        (
            &["a.glb", "--thickness-m", "1", "--strict"],
            "the argument '--thickness-m <M>' cannot be used with '--strict'",
        ),
        (&["a.glb", "--youngs-pa", "inf"], "--youngs-pa is inf; it must be 1 to 1e9"),
        (&["a.glb", "--max-force-n", "0"], "--max-force-n is 0; it must be 0.001 to 1000"),
        (&["a.glb", "--taps", "101"], "--taps is 101; it must be 0 to 100"),
        (&["a.glb", "--piece", "x"], "invalid value 'x' for '--piece <INDEX>': it must be a whole number"),
        (
            &["a.glb", "--mesh", "1", "--node", "n"],
            "the argument '--mesh <INDEX>' cannot be used with '--node",
        ),
    ] {
        let text = rejected(&[&["mesh"], arguments].concat());
        assert!(text.starts_with(&format!("error: {expected}")), "{arguments:?}: {text}");
    }
}
